//! Neighbourhoods of twines: blocks of 3 x 3 cells that share what is learnt from 9 x 9.

use std::ops::Range;

use net_image::widely;
use wide::f32x8;

use crate::adjust::graph::{Edge, Node};

/// Cells along a block's side.
const SIDE: i32 = 3;

/// Edges by family and block; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Blocks {
    first: (i32, i32),
    columns: usize,
    rows: usize,
    of_edge: Vec<u32>,
    /// Where each block's members begin; one more than there are blocks.
    starts: Vec<u32>,
    members: Vec<u32>,
    next: Vec<u32>,
    sorted: Vec<f32>,
    scratch: Vec<f32>,
}

impl Blocks {
    /// Sorts edges into blocks by their first nodes.
    pub fn build(&mut self, nodes: &[Node], edges: &[Edge]) {
        let indices = || nodes.iter().map(|n| n.index);
        self.first = indices().fold((i32::MAX, i32::MAX), |a, b| (a.0.min(b.0), a.1.min(b.1)));
        let last = indices().fold((i32::MIN, i32::MIN), |a, b| (a.0.max(b.0), a.1.max(b.1)));
        let count = |first: i32, last: i32| if last < first { 0 } else { ((last - first) / SIDE) as usize + 1 };
        (self.columns, self.rows) = (count(self.first.0, last.0), count(self.first.1, last.1));
        self.of_edge.clear();
        self.of_edge.extend(edges.iter().map(|e| {
            let (i, j) = nodes[e.nodes[0] as usize].index;
            let (column, row) = ((i - self.first.0) / SIDE, (j - self.first.1) / SIDE);
            ((e.family * self.columns + column as usize) * self.rows + row as usize) as u32
        }));
        self.starts.clear();
        self.starts.resize(self.count() + 1, 0);
        for &block in &self.of_edge {
            self.starts[block as usize + 1] += 1;
        }
        for k in 1..self.starts.len() {
            self.starts[k] += self.starts[k - 1];
        }
        self.next.clone_from(&self.starts);
        self.members.clear();
        self.members.resize(edges.len(), 0);
        for (e, &block) in self.of_edge.iter().enumerate() {
            self.members[self.next[block as usize] as usize] = e as u32;
            self.next[block as usize] += 1;
        }
    }

    /// Number of blocks of both families.
    pub fn count(&self) -> usize {
        2 * self.columns * self.rows
    }

    /// The block of an edge.
    pub fn of_edge(&self, edge: usize) -> usize {
        self.of_edge[edge] as usize
    }

    /// Edges of a block.
    pub fn members(&self, block: usize) -> &[u32] {
        &self.members[self.starts[block] as usize..self.starts[block + 1] as usize]
    }

    /// A block and those of the same family around it: up to three runs of blocks.
    fn around(&self, block: usize) -> [Range<usize>; 3] {
        let (row, column) = (block % self.rows, block / self.rows % self.columns);
        let family = block / (self.rows * self.columns);
        let (low, high) = (row.saturating_sub(1), (row + 1).min(self.rows - 1));
        [-1_isize, 0, 1].map(|d| match column.checked_add_signed(d).filter(|&c| c < self.columns) {
            Some(column) => {
                let line = (family * self.columns + column) * self.rows;
                line + low..line + high + 1
            }
            None => 0..0,
        })
    }

    /// Where among the members those in a run of blocks are.
    fn members_of(&self, blocks: Range<usize>) -> Range<usize> {
        self.starts[blocks.start] as usize..self.starts[blocks.end] as usize
    }

    /// For each block the sum of its members' rows of `width` values, of those that have one.
    pub fn sum_members<'a>(&self, width: usize, row: impl Fn(usize) -> Option<&'a [f32]>, sums: &mut Vec<f32>) {
        sums.clear();
        sums.resize(self.count() * width, 0.0);
        for (block, sum) in sums.chunks_exact_mut(width).enumerate() {
            for row in self.members(block).iter().filter_map(|&e| row(e as usize)) {
                sum.iter_mut().zip(row).for_each(|(s, v)| *s += v);
            }
        }
    }

    /// Adds to each block's row of `width` values those of the blocks around it.
    pub fn sum_neighbours(&self, width: usize, sums: &mut Vec<f32>, scratch: &mut Vec<f32>) {
        let line = self.rows * width;
        add_beside(sums, scratch, line, width);
        add_beside(sums, scratch, self.columns * line, line);
    }

    /// The four blocks of the same family beside a block.
    pub fn beside(&self, block: usize) -> [Option<usize>; 4] {
        let (row, column) = (block % self.rows, block / self.rows % self.columns);
        [
            (row > 0).then(|| block - 1),
            (row + 1 < self.rows).then_some(block + 1),
            (column > 0).then(|| block - self.rows),
            (column + 1 < self.columns).then_some(block + self.rows),
        ]
    }

    /// Median of edges' values around each block into `out` (cleared first); NaN does not count, and blocks without any value get
    /// the overall median, or 0 if there is none. Empty blocks too.
    pub fn local_median(&mut self, values: &[f32], out: &mut Vec<f32>) {
        let (mut sorted, mut scratch) = (std::mem::take(&mut self.sorted), std::mem::take(&mut self.scratch));
        // In the order of members, so that neighbours are three runs.
        sorted.clear();
        sorted.extend(self.members.iter().map(|&e| values[e as usize]));
        medians_around(self, &sorted, &mut scratch, out);
        (self.sorted, self.scratch) = (sorted, scratch);
    }
}

widely! {
    /// Adds to each value of a line those that are `step` values before and after it in the same line.
    fn add_beside<'a>(sums: &'a mut Vec<f32>, own: &'a mut Vec<f32>, line: usize, step: usize) -> () {
        own.clone_from(sums);
        for (sums, own) in sums.chunks_exact_mut(line.max(1)).zip(own.chunks_exact(line.max(1))) {
            let Some(rest) = line.checked_sub(step) else { continue };
            sums[step..].iter_mut().zip(&own[..rest]).for_each(|(s, o)| *s += o);
            sums[..rest].iter_mut().zip(&own[step..]).for_each(|(s, o)| *s += o);
        }
    }
}

widely! {
    /// Upper median of the members' values around each block.
    fn medians_around<'a>(blocks: &'a Blocks, values: &'a [f32], scratch: &'a mut Vec<f32>, out: &'a mut Vec<f32>) -> () {
        out.clear();
        let mut overall = None;
        for block in 0..blocks.count() {
            scratch.clear();
            if !blocks.members(block).is_empty() {
                let runs = blocks.around(block).into_iter();
                runs.for_each(|run| scratch.extend_from_slice(&values[blocks.members_of(run)]));
            }
            let middle = upper_median(scratch).or_else(|| {
                *overall.get_or_insert_with(|| {
                    scratch.clear();
                    scratch.extend_from_slice(values);
                    upper_median(scratch)
                })
            });
            out.push(middle.unwrap_or(0.0));
        }
    }
}

/// How many halvings tell values apart unless some are thousands of times the others.
const HALVINGS: usize = 32;
/// So many values are counted at once.
const COUNTED: usize = 32;

/// Upper median of what are numbers; reorders. Halves the range in which it must be, for values are counted faster than they are sorted.
#[inline(always)]
fn upper_median(values: &mut Vec<f32>) -> Option<f32> {
    // No number is no larger than any, and whole vectors are counted.
    values.resize(values.len().next_multiple_of(COUNTED), f32::NAN);
    let (mut low, mut high) = least_and_most(values);
    let (mut below, mut up) = (up_to(values, low), up_to(values, high));
    let rank = up / 2;
    if below > rank || up == 0 {
        return (up > 0).then_some(low);
    }
    // Above `low`, at most `high`: so many are no larger than each.
    for _ in 0..HALVINGS {
        if rank == below {
            return Some(extreme(values, low, high, false));
        }
        if rank + 1 == up {
            return Some(extreme(values, low, high, true));
        }
        let middle = 0.5 * (low + high);
        let count = up_to(values, middle);
        // Chosen, not branched to: either is as likely.
        let beyond = count > rank;
        (high, up) = (if beyond { middle } else { high }, if beyond { count } else { up });
        (low, below) = (if beyond { low } else { middle }, if beyond { below } else { count });
    }
    values.retain(|&v| v > low && v <= high);
    let rank = ((rank - below) as usize).min(values.len().checked_sub(1)?);
    Some(*values.select_nth_unstable_by(rank, f32::total_cmp).1)
}

/// The least or the most of the values above `low` and at most `high`.
#[inline(always)]
fn extreme(values: &[f32], low: f32, high: f32, most: bool) -> f32 {
    let sign = if most { -1.0 } else { 1.0 };
    let (mut least, sign, low, high) =
        (f32x8::splat(f32::INFINITY), f32x8::splat(sign), f32x8::splat(low), f32x8::splat(high));
    for vector in values.as_chunks().0 {
        let value = f32x8::from(*vector);
        let better = value.simd_gt(low) & value.simd_le(high) & (value * sign).simd_lt(least);
        least = better.select(value * sign, least);
    }
    sign.to_array()[0] * least.to_array().into_iter().fold(f32::INFINITY, f32::min)
}

/// Least and largest of the values of whole vectors.
#[inline(always)]
fn least_and_most(values: &[f32]) -> (f32, f32) {
    let (mut low, mut high) = (f32x8::splat(f32::INFINITY), f32x8::splat(f32::NEG_INFINITY));
    for vector in values.as_chunks().0 {
        let value = f32x8::from(*vector);
        // False for NaN.
        low = value.simd_lt(low).select(value, low);
        high = value.simd_gt(high).select(value, high);
    }
    (
        low.to_array().into_iter().fold(f32::INFINITY, f32::min),
        high.to_array().into_iter().fold(f32::NEG_INFINITY, f32::max),
    )
}

/// How many values do not exceed one.
#[inline(always)]
fn up_to(values: &[f32], most: f32) -> u32 {
    values.as_chunks::<COUNTED>().0.as_flattened().iter().map(|&v| u32::from(v <= most)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_upper_median_is_the_sorted_ones_middle() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        for round in 0..400 {
            let count = round % 90;
            let scale = [1.0, 1e30, 0.0, 1e-30][round / 90 % 4];
            let mut values: Vec<f32> = (0..count).map(|_| random.random::<f32>() - 0.5).collect();
            for (k, value) in values.iter_mut().enumerate() {
                *value = match k % 11 {
                    // Equal ones, none, and some far off.
                    1 | 2 => 0.125,
                    5 => f32::NAN,
                    7 => scale * *value,
                    _ => *value,
                };
            }
            let mut sorted: Vec<f32> = values.iter().copied().filter(|v| !v.is_nan()).collect();
            sorted.sort_by(f32::total_cmp);
            assert_eq!(upper_median(&mut values), sorted.get(sorted.len() / 2).copied(), "{round}");
        }
    }
}
