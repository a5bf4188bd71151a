//! The cells in view, laid out: brightness normalised, blocked share measured.

use std::collections::BTreeSet;

use net_geometry::nalgebra::Vector2;
use net_image::GrayView;

use crate::frame::{NetView, Seen, TwineLook, in_reach};
use crate::tile::{PATCH, SAMPLES};
use crate::water::{Around, Water};

/// Largest span of cells in view along either direction: more is no view of a net.
const MAX_SPAN: u32 = 512;
/// Grey levels of the mosaic from water to twine.
const SWING: f32 = 90.0;
/// Share of a cell's samples that are surely no brighter or darker than its twine: the rest, thin twine covers.
const TWINE_QUANTILE: f32 = 0.95;
/// That quantile, and the median, of what is as far from zero as normal noise, deviations.
const NORMAL_TWINE: f32 = 1.96;
const NORMAL_MEDIAN: f32 = 0.6745;
/// As far as cells are usually off the water around them, times this, a cell is believed to show other water and no growth.
const OWN: f32 = 2.5;
/// Least contrast of twine of which anything is said: grey levels, and deviations of the noise. Below, a third of the noise and more would have to be taken off.
const LEAST: (f32, f32) = (2.0, 4.0);
/// Deviation of the logarithm of contrast from cell to cell above which nothing is said. Nets have 0.1 to 0.3, under growth too; moving light makes 0.3 to 1, and
/// there neighbours do not tell what twine looks like.
const UNEVEN: f32 = 0.3;
/// Parts that half of the normal distribution is cut into where its share of what is blocked is summed.
const PARTS: usize = 16;

/// A cell in view.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct View {
    pub cell: (i32, i32),
    /// Height of the cell: area over the longer side, px.
    pub px: f64,
    pub depth_m: f64,
    /// How far twine stands out hereabouts, grey levels.
    pub contrast: f32,
    /// Blocked share; `None` where something hides the cell, or twine does not stand out enough to tell.
    pub blocked: Option<f32>,
    /// Something lies before it.
    pub hidden: bool,
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
    around: Around,
    /// By cell: the middle of its opening, and how far that is off the water around.
    opening: Vec<f32>,
    off: Vec<f32>,
    water: Vec<Water>,
    /// By cell: deviation of the samples in its opening, and how far its twine is off the water.
    spread: Vec<f32>,
    reach: Vec<f32>,
    /// By cell: how far it is off its neighbours in what is compared.
    apart: Vec<f32>,
    noise: Vec<f32>,
    swing: Vec<f32>,
    uneven: Vec<f32>,
    sorted: Vec<f32>,
}

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
            let (swing, noise) = (self.swing[k], self.noise[k]);
            let (samples, water) = (&self.samples[k], &self.water[k]);
            let off: [f32; SAMPLES] = std::array::from_fn(|s| samples[s] - water.at(s % PATCH, s / PATCH));
            let hidden = self.hidden.contains(&cell);
            let told = !hidden && swing > LEAST.0.max(LEAST.1 * noise) && self.uneven[k] < UNEVEN;
            // Where noise is all there is, it shall not look like a net.
            let scale = SWING / swing.max(3.0 * noise).max(1.0);
            each(View {
                cell,
                px,
                depth_m,
                contrast: swing,
                blocked: told.then(|| blocked(&off, swing, noise)),
                hidden,
                patch: off.map(|v| (128.0 + scale * v).clamp(1.0, 255.0) as u8),
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

    /// Level of the water, contrast of the twine and noise, compared over the neighbourhood: fish, haze and growth do not count, and slow changes of light go.
    fn compare(&mut self) {
        let Self {
            seen, samples, around, opening, off, water, spread, reach, apart, noise, swing, uneven, sorted, ..
        } = self;
        around.index(seen, &self.hidden);
        // Each cell's water is the middle of its opening.
        let inner = || (PATCH / 4..PATCH - PATCH / 4).flat_map(|y| (PATCH / 4..PATCH - PATCH / 4).map(move |x| (x, y)));
        let mut quantile_of = |values: &mut dyn Iterator<Item = f32>, q: f32| {
            sorted.clear();
            sorted.extend(values);
            quantile(sorted, q)
        };
        opening.clear();
        opening.extend(samples.iter().map(|patch| quantile_of(&mut inner().map(|(x, y)| patch[y * PATCH + x]), 0.5)));
        water.clear();
        off.clear();
        apart.clear();
        for (k, (cell, ..)) in seen.iter().enumerate() {
            water.push(around.sheet(*cell, opening));
            off.push(opening[k] - water[k].level(0.0, 0.0));
            apart.push(off[k].abs());
        }
        spread.clear();
        reach.clear();
        for (k, patch) in samples.iter().enumerate() {
            let usual = OWN * around.median(seen[k].0, apart) / NORMAL_MEDIAN;
            let own = off[k].clamp(-usual, usual);
            water[k].raise(own);
            let (water, rest) = (&water[k], off[k] - own);
            let from_water = |(x, y): (usize, usize)| patch[y * PATCH + x] - water.at(x, y);
            spread.push(quantile_of(&mut inner().map(|s| (from_water(s) - rest).abs()), 0.5) / NORMAL_MEDIAN);
            let all = &mut (0..SAMPLES).map(|s| from_water((s % PATCH, s / PATCH)).abs());
            reach.push(quantile_of(all, TWINE_QUANTILE));
        }
        noise.clear();
        for (k, (cell, ..)) in seen.iter().enumerate() {
            noise.push(around.median(*cell, spread));
            // Noise alone reaches so far.
            reach[k] = (reach[k].powi(2) - (NORMAL_TWINE * noise[k]).powi(2)).max(0.01).sqrt();
        }
        swing.clear();
        swing.extend(seen.iter().map(|(cell, ..)| around.median(*cell, reach)));
        apart.clear();
        apart.extend(reach.iter().zip(&*swing).map(|(own, around)| (own / around).ln().abs()));
        uneven.clear();
        uneven.extend(seen.iter().map(|(cell, ..)| around.median(*cell, apart) / NORMAL_MEDIAN));
    }
}

/// Blocked share: how far the samples are off the water, in parts of twine's contrast, each part at most one. A blurred line counts as the sharp one. What noise brings to clear
/// water is taken off.
fn blocked(off: &[f32; SAMPLES], swing: f32, noise: f32) -> f32 {
    let sum: f32 = off.iter().map(|v| (v.abs() / swing).min(1.0)).sum();
    // The mean of a positive number is the integral over how often it is exceeded.
    let exceeded = |k: usize| beyond_by_chance((k as f32 + 0.5) / PARTS as f32 * swing / noise.max(f32::MIN_POSITIVE));
    let chance = (0..PARTS).map(exceeded).sum::<f32>() / PARTS as f32;
    ((sum / SAMPLES as f32 - chance) / (1.0 - chance)).max(0.0)
}

/// Share of normal noise that is farther from zero than `x` deviations, to 3e-5: Abramowitz and Stegun 7.1.25.
fn beyond_by_chance(x: f32) -> f32 {
    let z = x / std::f32::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.470_47 * z);
    t * (0.348_024_2 + t * (-0.095_879_8 + t * 0.747_855_6)) * (-z * z).exp()
}

/// Of no values 0.
pub(crate) fn quantile(values: &mut [f32], q: f32) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let at = ((values.len() - 1) as f32 * q) as usize;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twine on a fifth of a mesh counts as much with noise as without, whatever the noise, and blurred as much as sharp.
    #[test]
    fn noise_and_blur_leave_the_blocked_share() {
        let mut state = 7_u64;
        let mut normal = || {
            // The sum of twelve uniform numbers.
            (0..12).fold(-6.0, |sum, _| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum + (state >> 40) as f32 / (1 << 24) as f32
            })
        };
        for noise in [0.0, 1.0, 2.0] {
            let mean = (0..200)
                .map(|_| {
                    let samples = std::array::from_fn(|s| if s % 5 == 0 { -9.0 } else { 0.0 } + noise * normal());
                    blocked(&samples, 8.0, noise)
                })
                .sum::<f32>()
                / 200.0;
            assert!((mean - 0.2).abs() < 0.02, "{noise}: {mean}");
        }
        let blurred = std::array::from_fn(|s| if s % 5 < 2 { 4.0 } else { 0.0 });
        assert!((blocked(&blurred, 8.0, 0.0) - 0.2).abs() < 0.01);
        assert!(blocked(&[0.0; SAMPLES], 8.0, 1.0) == 0.0);
    }
}
