//! The cells in view, laid out: brightness normalised, blocked share measured.

use std::collections::BTreeSet;

use net_geometry::nalgebra::Vector2;
use net_image::GrayView;

use crate::frame::{NetView, Seen, TwineLook, in_reach};
use crate::tile::{PATCH, SAMPLES};

/// Cells to each side over which water and twine are compared.
const RADIUS: i32 = 4;
/// Largest span of cells in view along either direction: more is no view of a net.
const MAX_SPAN: u32 = 512;
/// Grey levels of the mosaic from water to twine.
const SWING: f32 = 90.0;
/// Part of twine's contrast beyond which a sample is blocked: half, where a blurred edge lies.
const BLOCKED: f32 = 0.5;
/// Share of a cell's samples that are surely no brighter or darker than its twine: the rest, thin twine covers.
const TWINE_QUANTILE: f32 = 0.95;

/// A cell in view.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct View {
    pub cell: (i32, i32),
    /// Height of the cell: area over the longer side, px.
    pub px: f64,
    pub depth_m: f64,
    /// How far twine stands out hereabouts, grey levels.
    pub contrast: f32,
    /// Blocked share; `None` where something hides the cell, or no twine stands out.
    pub blocked: Option<f32>,
    pub patch: [u8; SAMPLES],
}

/// Buffers of this stage.
#[derive(Debug, Default)]
pub(crate) struct Patches {
    cells: BTreeSet<(i32, i32)>,
    hidden: BTreeSet<(i32, i32)>,
    samples: Vec<[f32; SAMPLES]>,
    /// Cell, height, depth of each.
    seen: Vec<((i32, i32), f64, f64)>,
    /// Number of the cell at a place of the span, less its corner.
    grid: Vec<u32>,
    water: Vec<f32>,
    swing: Vec<f32>,
    around: Vec<f32>,
    sorted: Vec<f32>,
}

/// No cell here.
const NONE: u32 = u32::MAX;

impl Patches {
    /// Lays out every cell in view that lies in the picture as a whole.
    pub fn lay_out(
        &mut self,
        image: GrayView<'_>,
        view: &impl NetView,
        twines: &[TwineLook],
        mut each: impl FnMut(View),
    ) {
        self.cells.clear();
        self.hidden.clear();
        let middle = twines.len() / 2;
        let Some(origin) = twines.get(middle).map(|t| t.index).filter(|&index| in_reach(index)) else { return };
        for t in twines.iter().filter(|t| in_reach(t.index)) {
            // Both cells beside a twine.
            let other = if t.direction == 0 { (t.index.0, t.index.1 - 1) } else { (t.index.0 - 1, t.index.1) };
            for cell in [t.index, other] {
                let off = (cell.0.saturating_sub(origin.0), cell.1.saturating_sub(origin.1));
                if off.0.unsigned_abs() < MAX_SPAN / 2 && off.1.unsigned_abs() < MAX_SPAN / 2 {
                    self.cells.insert(cell);
                    if t.seen == Seen::Hidden {
                        self.hidden.insert(cell);
                    }
                }
            }
        }
        self.sample(image, view);
        self.compare();
        for (k, &(cell, px, depth_m)) in self.seen.iter().enumerate() {
            let (water, swing) = (self.water[k], self.swing[k].max(1.0));
            let samples = &self.samples[k];
            let blocked = samples.iter().filter(|v| (**v - water).abs() > BLOCKED * swing).count();
            let told = !self.hidden.contains(&cell) && self.swing[k] > 2.0;
            each(View {
                cell,
                px,
                depth_m,
                contrast: self.swing[k],
                blocked: told.then_some(blocked as f32 / SAMPLES as f32),
                patch: std::array::from_fn(|s| (128.0 + SWING * (samples[s] - water) / swing).clamp(1.0, 255.0) as u8),
            });
        }
    }

    fn sample(&mut self, image: GrayView<'_>, view: &impl NetView) {
        self.seen.clear();
        self.samples.clear();
        for &(i, j) in &self.cells {
            let corner = |di: i32, dj: i32| view.pixel(Vector2::new(f64::from(i + di), f64::from(j + dj)));
            let (Some((a, da)), Some((b, _)), Some((c, _)), Some((d, dd))) =
                (corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1))
            else {
                continue;
            };
            let (u, v) = (b - a, c - a);
            let px = u.perp(&v).abs() / u.norm().max(v.norm());
            if !(px.is_finite() && px > 1.0) {
                continue;
            }
            let mut patch = [0.0; SAMPLES];
            // Within a cell the map is bilinear to a hundredth of a pixel.
            let whole = patch.iter_mut().enumerate().all(|(s, value)| {
                let place = |x: usize| (x as f64 + 0.5) / PATCH as f64;
                let (x, y) = (place(s % PATCH), place(s / PATCH));
                let p = (a * (1.0 - x) + b * x) * (1.0 - y) + (c * (1.0 - x) + d * x) * y;
                net_image::bilinear(image, p.x, p.y).is_some_and(|grey| {
                    *value = grey;
                    true
                })
            });
            if whole {
                self.seen.push(((i, j), px, 0.5 * (da + dd)));
                self.samples.push(patch);
            }
        }
    }

    /// Level of the water and contrast of the twine, medians over the neighbourhood: fish and haze do not count, and slow changes of light go.
    fn compare(&mut self) {
        let least = self.seen.iter().fold((i32::MAX, i32::MAX), |l, (c, ..)| (l.0.min(c.0), l.1.min(c.1)));
        let most = self.seen.iter().fold((i32::MIN, i32::MIN), |l, (c, ..)| (l.0.max(c.0), l.1.max(c.1)));
        let (columns, rows) = if self.seen.is_empty() { (0, 0) } else { (most.0 - least.0 + 1, most.1 - least.1 + 1) };
        self.grid.clear();
        self.grid.resize((columns * rows) as usize, NONE);
        for (k, (cell, ..)) in self.seen.iter().enumerate() {
            self.grid[((cell.1 - least.1) * columns + cell.0 - least.0) as usize] = k as u32;
        }
        let quantile = |values: &mut Vec<f32>, q: f32| {
            let at = ((values.len() - 1) as f32 * q) as usize;
            *values.select_nth_unstable_by(at, f32::total_cmp).1
        };
        // Each cell's water is the middle of its opening.
        let inner = PATCH / 4..PATCH - PATCH / 4;
        let raw: Vec<f32> = self
            .samples
            .iter()
            .map(|patch| {
                self.sorted.clear();
                self.sorted.extend(inner.clone().flat_map(|y| inner.clone().map(move |x| patch[y * PATCH + x])));
                quantile(&mut self.sorted, 0.5)
            })
            .collect();
        let median_around = |values: &[f32], grid: &[u32], seen: &[((i32, i32), f64, f64)], around: &mut Vec<f32>| {
            seen.iter()
                .map(|(cell, ..)| {
                    around.clear();
                    for j in (cell.1 - RADIUS).max(least.1)..=(cell.1 + RADIUS).min(most.1) {
                        for i in (cell.0 - RADIUS).max(least.0)..=(cell.0 + RADIUS).min(most.0) {
                            let k = grid[((j - least.1) * columns + i - least.0) as usize];
                            if k != NONE {
                                around.push(values[k as usize]);
                            }
                        }
                    }
                    quantile(around, 0.5)
                })
                .collect::<Vec<f32>>()
        };
        self.water = median_around(&raw, &self.grid, &self.seen, &mut self.around);
        let swing: Vec<f32> = self
            .samples
            .iter()
            .zip(&self.water)
            .map(|(patch, water)| {
                self.sorted.clear();
                self.sorted.extend(patch.iter().map(|v| (v - water).abs()));
                quantile(&mut self.sorted, TWINE_QUANTILE)
            })
            .collect();
        self.swing = median_around(&swing, &self.grid, &self.seen, &mut self.around);
    }
}
