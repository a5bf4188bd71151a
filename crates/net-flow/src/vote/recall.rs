//! A place recognised: a frame's cells against a map of cells that were seen before.

use serde::{Deserialize, Serialize};

use super::cell::CELL;
use super::cells::Cells;
use super::score::{BLOCKS, MIN_BLOCK, median};
use crate::error::{Result, in_range};

/// Numbers of a patch are kept in 8 bits: of unit length and clipped at three deviations, they are up to a quarter.
const SCALE: f32 = 508.0;
/// Looks that a cell's mean stands for at the most: what grows on a net is to be seen in the end.
const MOST_LOOKS: u8 = 8;
/// A cell that nobody saw.
const NOWHERE: (i32, i32) = (i32::MIN, i32::MIN);

/// Parameters of the recognition of places.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecallConfig {
    /// Cells that the map holds along each direction, 32 to 1024. Default 128. Cells a multiple of it apart share a place, and the later one has it; memory is 150 bytes
    /// a cell.
    pub side_cells: usize,
    /// Shifts tried, cells either way, 1 to 200. Default 50. The time grows with its square.
    pub reach_cells: usize,
    /// Fewest cells in common with the map for a shift to be tried, 12 to 1000. Default 40.
    pub min_cells: usize,
    /// Deviations by which the best shift must stand out, 6 to 100. Default 10: the best of ten thousand wrong ones reaches 4 to 6.5.
    pub min_z: f64,
    /// And so many times as far as the second, 1 to 10. Default 1.5.
    pub min_ratio: f64,
}

impl Default for RecallConfig {
    fn default() -> Self {
        Self { side_cells: 128, reach_cells: 50, min_cells: 40, min_z: 10.0, min_ratio: 1.5 }
    }
}

impl RecallConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`crate::Error::Value`] names the field and the value.
    pub fn validate(&self) -> Result<()> {
        in_range("side_cells", self.side_cells as f64, 32.0, 1024.0, "32 to 1024 cells")?;
        in_range("reach_cells", self.reach_cells as f64, 1.0, 200.0, "1 to 200 cells")?;
        in_range("min_cells", self.min_cells as f64, 12.0, 1000.0, "12 to 1000 cells")?;
        in_range("min_z", self.min_z, 6.0, 100.0, "6 to 100")?;
        in_range("min_ratio", self.min_ratio, 1.0, 10.0, "1 to 10")
    }
}

/// What a search of a map says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recall {
    /// Cells to add to the frame's lattice coordinates to agree with the map's.
    pub cells: (i32, i32),
    /// Deviations of the best shift above the median of all that were tried, and of the second.
    pub z: f64,
    /// See `z`.
    pub second_z: f64,
    /// Cells in common with the map at the best shift.
    pub compared: usize,
    /// Shifts that were tried.
    pub tried: usize,
    /// Whether the place is certain.
    pub recognised: bool,
}

/// What was seen of each cell of a net. Of fixed size: a patch of the net that moves along.
#[derive(Debug)]
pub struct CellMap {
    config: RecallConfig,
    /// Which cell each place holds.
    names: Vec<(i32, i32)>,
    looks: Vec<u8>,
    patches: Vec<[i8; CELL]>,
    here: Vec<[i8; CELL]>,
    /// Of each shift tried: mean correlation, number of common cells.
    scores: Vec<(f64, u32)>,
    shifts: Vec<(i32, i32)>,
    sorted: Vec<f64>,
    cells: usize,
}

impl CellMap {
    /// An empty map.
    ///
    /// # Errors
    /// [`crate::Error::Value`] for a parameter out of range.
    pub fn new(config: &RecallConfig) -> Result<Self> {
        config.validate()?;
        let (n, shifts) = (config.side_cells.pow(2), (2 * config.reach_cells + 1).pow(2));
        Ok(Self {
            config: config.clone(),
            names: vec![NOWHERE; n],
            looks: vec![0; n],
            patches: vec![[0; CELL]; n],
            // As many as a vote lays out at the most.
            here: Vec::with_capacity(64 * 64),
            scores: Vec::with_capacity(shifts),
            shifts: Vec::with_capacity(shifts),
            sorted: Vec::with_capacity(shifts),
            cells: 0,
        })
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.names.fill(NOWHERE);
        self.cells = 0;
    }

    /// Number of cells that it holds.
    pub fn cells(&self) -> usize {
        self.cells
    }

    fn place(&self, (i, j): (i32, i32)) -> usize {
        let side = self.config.side_cells as i32;
        (j.rem_euclid(side) * side + i.rem_euclid(side)) as usize
    }

    pub(super) fn add(&mut self, cells: &Cells) {
        for (k, patch) in cells.patches.iter().enumerate().filter(|(k, _)| cells.valid[*k]) {
            let (i, j) = ((k % cells.columns) as i32, (k / cells.columns) as i32);
            let name = (cells.corner.0.saturating_add(i), cells.corner.1.saturating_add(j));
            let at = self.place(name);
            if self.names[at] != name {
                self.cells += usize::from(self.names[at] == NOWHERE);
                (self.names[at], self.looks[at]) = (name, 0);
            }
            let weight = f32::from(self.looks[at]);
            let mut mean = [0.0; CELL];
            for ((m, old), new) in mean.iter_mut().zip(&self.patches[at]).zip(patch) {
                *m = if weight > 0.0 { weight * f32::from(*old) / SCALE } else { 0.0 } + new;
            }
            self.patches[at] = packed(&mean);
            self.looks[at] = (self.looks[at] + 1).min(MOST_LOOKS);
        }
    }

    pub(super) fn find(&mut self, cells: &Cells, around: (i32, i32)) -> Option<Recall> {
        self.here.clear();
        self.here.extend(cells.patches.iter().map(packed));
        let reach = self.config.reach_cells as i32;
        let (mut scores, mut shifts) = (std::mem::take(&mut self.scores), std::mem::take(&mut self.shifts));
        scores.clear();
        shifts.clear();
        for dj in -reach..=reach {
            for di in -reach..=reach {
                let shift = (around.0.saturating_add(di), around.1.saturating_add(dj));
                if let Some(score) = self.score(cells, shift) {
                    scores.push(score);
                    shifts.push(shift);
                }
            }
        }
        let found = self.judge(&scores, &shifts);
        (self.scores, self.shifts) = (scores, shifts);
        found
    }

    fn judge(&mut self, scores: &[(f64, u32)], shifts: &[(i32, i32)]) -> Option<Recall> {
        // All cells of a net have something in common, which is not noise that more cells would average out.
        let centre = median(&mut scores.iter().map(|s| s.0), &mut self.sorted)?;
        let above = |(mean, count): (f64, u32)| (mean - centre) * f64::from(count).sqrt();
        let spread = 1.4826 * median(&mut scores.iter().map(|s| above(*s).abs()), &mut self.sorted)?;
        let deviations = |k: usize| above(scores[k]) / spread.max(1e-6);
        let (mut best, mut second) = (0, None);
        for k in 1..scores.len() {
            if deviations(k) > deviations(best) {
                (best, second) = (k, Some(best));
            } else if second.is_none_or(|s: usize| deviations(k) > deviations(s)) {
                second = Some(k);
            }
        }
        let (z, second_z) = (deviations(best), deviations(second?));
        let c = &self.config;
        Some(Recall {
            cells: shifts[best],
            z,
            second_z,
            compared: scores[best].1 as usize,
            tried: scores.len(),
            recognised: z > c.min_z && z > c.min_ratio * second_z,
        })
    }

    /// Places of the frame's cells and of the map's that a shift brings together.
    fn common<'a>(&'a self, cells: &'a Cells, shift: (i32, i32)) -> impl Iterator<Item = (usize, usize)> + 'a {
        (0..cells.valid.len()).filter(|&k| cells.valid[k]).filter_map(move |k| {
            let (i, j) = ((k % cells.columns) as i32, (k / cells.columns) as i32);
            let along = |corner: i32, i: i32, shift: i32| corner.checked_add(i)?.checked_add(shift);
            let name = (along(cells.corner.0, i, shift.0)?, along(cells.corner.1, j, shift.1)?);
            let at = self.place(name);
            (self.names[at] == name).then_some((k, at))
        })
    }

    /// Median over blocks of the mean correlation, and the number of common cells; `None` where they are too few.
    fn score(&self, cells: &Cells, shift: (i32, i32)) -> Option<(f64, u32)> {
        let mut blocks = [(0_i64, 0_u32); BLOCKS.0 * BLOCKS.1];
        if self.common(cells, shift).count() < self.config.min_cells {
            return None;
        }
        let mut count = 0_u32;
        for (k, at) in self.common(cells, shift) {
            let (i, j) = (k % cells.columns, k / cells.columns);
            let block = &mut blocks[j * BLOCKS.1 / cells.rows * BLOCKS.0 + i * BLOCKS.0 / cells.columns];
            block.0 += i64::from(dot(&self.here[k], &self.patches[at]));
            block.1 += 1;
            count += 1;
        }
        let mut means = [0.0; BLOCKS.0 * BLOCKS.1];
        let mut used = 0;
        for (sum, n) in blocks {
            if n as f32 >= MIN_BLOCK {
                means[used] = sum as f64 / f64::from(n);
                used += 1;
            }
        }
        let means = &mut means[..used];
        means.sort_unstable_by(f64::total_cmp);
        let middle = match used {
            0 => return None,
            n if n % 2 == 1 => means[n / 2],
            n => 0.5 * (means[n / 2 - 1] + means[n / 2]),
        };
        Some((middle / f64::from(SCALE * SCALE), count))
    }
}

/// A patch brought to unit length, in 8 bits.
fn packed(patch: &[f32; CELL]) -> [i8; CELL] {
    let norm = super::cell::dot(patch, patch).sqrt().max(1e-6);
    // Bounds that i8 holds.
    patch.map(|x| (x / norm * SCALE).round().clamp(-127.0, 127.0) as i8)
}

fn dot(a: &[i8; CELL], b: &[i8; CELL]) -> i32 {
    a.iter().zip(b).map(|(a, b)| i32::from(*a) * i32::from(*b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    /// Patches of a net that goes on for ever: made from the cell's name alone.
    fn cells(corner: (i32, i32), noise: u64) -> Cells {
        let mut cells = Cells::new(18, 12);
        cells.corner = corner;
        cells.valid.fill(true);
        let random = |state: &mut u64| {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        for (k, patch) in cells.patches.iter_mut().enumerate() {
            let name = ((corner.0 + (k % 18) as i32) as u64) << 32 | u64::from((corner.1 + (k / 18) as i32) as u32);
            let (mut own, mut frames) = (name ^ 0x9e37_79b9, name ^ noise);
            for _ in 0..4 {
                random(&mut own);
                random(&mut frames);
            }
            // As much noise as net, and something that all cells have in common.
            for (s, x) in patch.iter_mut().enumerate() {
                *x = random(&mut own) + random(&mut frames) + 0.3 * (s as f32).sin();
            }
            let norm = super::super::cell::dot(patch, patch).sqrt();
            patch.iter_mut().for_each(|x| *x /= norm);
        }
        cells
    }

    #[test]
    fn a_place_is_recognised_from_far_away_and_a_strange_one_is_not() {
        let mut map = CellMap::new(&RecallConfig { reach_cells: 30, ..RecallConfig::default() }).expect("in range");
        assert_eq!(map.find(&cells((0, 0), 1), (0, 0)), None);
        for k in 0..20 {
            map.add(&cells((2 * k, k / 4), k as u64 + 10));
        }
        // The frame's numbers are off by 23 and -11.
        let mut here = cells((5, 1), 999);
        here.renumber((-23, 11));
        let found = map.find(&here, (0, 0)).expect("cells in common");
        assert!(found.recognised && found.cells == (23, -11) && found.compared > 150, "{found:?}");
        assert!(found.z > 20.0 && found.second_z < 7.0, "{found:?}");
        let found = map.find(&cells((5000, 5000), 999), (-4990, -5000)).expect("cells in common");
        assert!(!found.recognised && found.z < 7.0, "{found:?}");
    }

    #[test]
    fn cells_too_far_away_make_room_and_extreme_numbers_do_no_harm() {
        let mut map = CellMap::new(&RecallConfig { reach_cells: 4, ..RecallConfig::default() }).expect("in range");
        map.add(&cells((0, 0), 1));
        map.add(&cells((128, 0), 1));
        assert_eq!(map.cells(), 216);
        assert_eq!(map.find(&cells((0, 0), 2), (0, 0)), None);
        let mut far = cells((0, 0), 2);
        far.renumber((i32::MAX, i32::MIN));
        map.add(&far);
        map.find(&far, (i32::MAX, i32::MAX));
        map.clear();
        assert_eq!((map.cells(), map.find(&cells((128, 0), 2), (0, 0))), (0, None));
        let wrong = CellMap::new(&RecallConfig { side_cells: 7, ..RecallConfig::default() });
        assert!(matches!(wrong, Err(Error::Value { .. })));
    }
}
