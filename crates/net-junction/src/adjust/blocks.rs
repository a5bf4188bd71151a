//! Neighbourhoods of twines: blocks of 3 x 3 cells that share what is learnt from 9 x 9.

use std::ops::Range;

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
    keys: Vec<i32>,
    scratch: Vec<i32>,
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

    /// The sum of blocks' rows around a block.
    pub fn sum_around(&self, block: usize, width: usize, sums: &[f32], out: &mut Vec<f32>) {
        out.clear();
        out.resize(width, 0.0);
        for near in self.around(block).into_iter().flatten() {
            out.iter_mut().zip(&sums[near * width..][..width]).for_each(|(o, s)| *o += s);
        }
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
        let (mut keys, mut scratch) = (std::mem::take(&mut self.keys), std::mem::take(&mut self.scratch));
        // In the order of members, so that neighbours are three runs.
        keys.clear();
        keys.extend(self.members.iter().map(|&e| key(values[e as usize])));
        let mut overall = None;
        out.clear();
        for block in 0..self.count() {
            scratch.clear();
            if !self.members(block).is_empty() {
                self.around(block).into_iter().for_each(|run| scratch.extend_from_slice(&keys[self.members_of(run)]));
            }
            let middle = median_key(&mut scratch).or_else(|| {
                *overall.get_or_insert_with(|| {
                    scratch.clone_from(&keys);
                    median_key(&mut scratch)
                })
            });
            out.push(middle.map_or(0.0, value));
        }
        (self.keys, self.scratch) = (keys, scratch);
    }
}

/// What is no number comes last.
const NO_NUMBER: i32 = i32::MAX;

/// A whole number that orders as the value does.
fn key(value: f32) -> i32 {
    let bits = value.to_bits() as i32;
    if value.is_nan() { NO_NUMBER } else { bits ^ ((bits >> 31) & i32::MAX) }
}

fn value(key: i32) -> f32 {
    f32::from_bits((key ^ ((key >> 31) & i32::MAX)) as u32)
}

/// Upper median of what are numbers; reorders.
fn median_key(keys: &mut [i32]) -> Option<i32> {
    let numbers = keys.iter().filter(|&&k| k != NO_NUMBER).count();
    (numbers > 0).then(|| *keys.select_nth_unstable(numbers / 2).1)
}
