//! A net taken out of the picture: where its twines lie and how wide they look, measured piece by piece, and painted over with what is
//! beside them. A drawing would leave what the model does not know, knots and their places first of all: another lattice.

use net_image::Image;

use crate::drawing::polarity::Polarity;
use crate::numeric::{median, wrap};
use crate::picture::smooth::Smoother;
use crate::picture::view::{BLOCK, Level};
use crate::sheet::map::{PhaseMap, Plane};

/// Positions across a twine at which its profile is taken, over [`REACH`] cells to either side.
const BINS: usize = 48;
/// Farthest, cells, that a twine may lie from its place, and its profile reach.
const REACH: f32 = 0.24;
/// Pieces to a cell, each of which may lie otherwise: knots are off their places, twine hangs through.
const PIECES: f32 = 2.0;
/// Deviations by which a piece must stand out for its place to be believed.
const CLEAR: f32 = 4.0;
/// Share of the peak at which a profile ends.
const END: f32 = 0.05;
/// Smallest cell of the first net, px of the lowest level, between whose twines anything can be seen.
const SMALLEST_PX: f32 = 8.0;
/// Largest share of the picture that may be painted over.
const MOST: f64 = 0.75;
/// Pieces that are measured at most: more are a lattice gone wild.
const MOST_PIECES: usize = 400_000;

/// Where the twines of a net lie in the picture, piece by piece, and how wide they look.
pub(crate) struct Lines {
    /// First line and piece of each family, and how many of either.
    first: [[i32; 2]; 2],
    count: [[usize; 2]; 2],
    /// Distance of each piece from its place, cells.
    offset: [Vec<f32>; 2],
    /// Half of the width of a twine, blur included, cells, and the lattice's slope (cells per px) that goes with it.
    half: [f32; 2],
    slope: [f32; 2],
}

impl Lines {
    /// Measures the lattice of `map` on the high-passed picture. `None` where cells are too small, or nothing of it is in view.
    pub(crate) fn measured(map: &PhaseMap, level: &Level, polarity: [Polarity; 2]) -> Option<Self> {
        let sign = polarity.map(Polarity::sign);
        let (bx, by) = level.blocks();
        let blocks = || (0..by).flat_map(|y| (0..bx).map(move |x| (x, y)));
        let open = || blocks().filter_map(|(x, y)| Some((x, y, map.block(x, y).filter(is_open)?)));
        let (mut low, mut high, mut slopes, mut n) = ([f32::MAX; 2], [f32::MIN; 2], [0.0f32; 2], 0.0f32);
        for (_, _, planes) in open() {
            for f in 0..2 {
                low[f] = low[f].min(planes[f].s - 1.0);
                high[f] = high[f].max(planes[f].s + 1.0);
                slopes[f] += slope(&planes[f]);
            }
            n += 1.0;
        }
        if n == 0.0 {
            return None;
        }
        let span = |low: f32, high: f32, per: f32| {
            let first = (low * per).floor();
            (first as i32, ((high * per).ceil() - first) as usize + 1)
        };
        let mut first = [[0; 2]; 2];
        let mut count = [[0; 2]; 2];
        for f in 0..2 {
            (first[f][0], count[f][0]) = span(low[f], high[f], 1.0);
            (first[f][1], count[f][1]) = span(low[1 - f], high[1 - f], PIECES);
            if count[f][0].saturating_mul(count[f][1]) > MOST_PIECES {
                return None;
            }
        }
        let mut lines = Self { first, count, offset: [Vec::new(), Vec::new()], half: [0.0; 2], slope: [0.0; 2] };
        let mut profiles: [Vec<[f32; 2]>; 2] =
            std::array::from_fn(|f| vec![[0.0; 2]; count[f][0] * count[f][1] * BINS]);
        let (mut squares, mut pixels) = (0.0f64, 0.0f64);
        for (x, y, planes) in open() {
            each_pixel(x, y, |column, row, u, v| {
                let s: [f32; 2] = std::array::from_fn(|f| at(&planes[f], u, v));
                let value = level.high.row(row)[column];
                squares += f64::from(value * value);
                pixels += 1.0;
                for f in 0..2 {
                    let q = wrap(s[f]);
                    // Where the other family crosses there is nothing to tell.
                    if q.abs() >= REACH || wrap(s[1 - f]).abs() < 0.12 {
                        continue;
                    }
                    if let Some(piece) = lines.piece(f, s) {
                        let bin = ((q / REACH + 1.0) * 0.5 * BINS as f32) as usize;
                        let sum = &mut profiles[f][piece * BINS + bin.min(BINS - 1)];
                        sum[0] += sign[f] * value;
                        sum[1] += 1.0;
                    }
                }
            });
        }
        let noise = (squares / pixels.max(1.0)).sqrt() as f32;
        for f in 0..2 {
            lines.slope[f] = slopes[f] / n;
            lines.settle(f, &profiles[f], noise);
        }
        Some(lines)
    }

    /// Number of the piece of family `f` at lattice coordinates `s`.
    fn piece(&self, f: usize, s: [f32; 2]) -> Option<usize> {
        let line = usize::try_from(s[f].round() as i32 - self.first[f][0]).ok()?;
        let along = usize::try_from((s[1 - f] * PIECES).floor() as i32 - self.first[f][1]).ok()?;
        (line < self.count[f][0] && along < self.count[f][1]).then(|| line * self.count[f][1] + along)
    }

    /// Where the pieces of a family lie, and how wide they are, from the profiles across them.
    fn settle(&mut self, f: usize, profiles: &[[f32; 2]], noise: f32) {
        let per_bin = 2.0 * REACH / BINS as f32;
        // A twine looks about three pixels wide.
        let reach = ((1.5 * self.slope[f] / per_bin).round() as usize).clamp(1, BINS / 6);
        let centre = |bin: usize| (bin as f32 + 0.5) * per_bin - REACH;
        self.offset[f] = profiles
            .chunks_exact(BINS)
            .map(|profile| {
                let mut best = (CLEAR, 0.0);
                for bin in BINS / 4..3 * BINS / 4 {
                    let near = &profile[bin - reach..=bin + reach];
                    let (sum, n) = near.iter().fold((0.0, 0.0), |(s, n), p| (s + p[0], n + p[1]));
                    // Between two equal peaks the nearer to its place.
                    let z = sum / (noise * f32::sqrt(n + 1e-6)) * (1.0 - 2.0 * centre(bin).abs());
                    if n > 0.0 && z > best.0 {
                        best = (z, centre(bin));
                    }
                }
                if best.0 > CLEAR { best.1 } else { f32::NAN }
            })
            .collect();
        let mut known: Vec<f64> = self.offset[f].iter().filter(|o| o.is_finite()).map(|o| f64::from(*o)).collect();
        let usual = if known.len() > 8 { median(&mut known) as f32 } else { 0.0 };
        self.offset[f].iter_mut().filter(|o| o.is_nan()).for_each(|o| *o = usual);
        // All pieces on top of each other, each in its place.
        let mut stack = [[0.0f32; 2]; BINS];
        for (profile, offset) in profiles.chunks_exact(BINS).zip(&self.offset[f]) {
            let shift = (offset / per_bin).round() as isize;
            for (bin, sum) in stack.iter_mut().enumerate() {
                if let Some(p) = bin.checked_add_signed(shift).and_then(|b| profile.get(b)) {
                    sum[0] += p[0];
                    sum[1] += p[1];
                }
            }
        }
        let mean = stack.map(|s| s[0] / s[1].max(1.0));
        let floor = mean.iter().copied().fold(f32::MAX, f32::min);
        let peak = mean[BINS / 2 - 1].max(mean[BINS / 2]) - floor;
        let blank = 2.5 * noise / f32::sqrt(stack.iter().map(|s| s[1]).sum::<f32>() / BINS as f32 + 1.0);
        let end = (END * peak).max(blank);
        let side = |bins: &mut dyn Iterator<Item = usize>| bins.take_while(|b| mean[*b] - floor > end).count();
        let wide = side(&mut (BINS / 2..BINS)).max(side(&mut (0..BINS / 2).rev()));
        self.half[f] = wide as f32 * per_bin;
    }

    /// How far twine of family `f` is from its place at lattice coordinates `s`: linear between the middles of pieces.
    fn offset(&self, f: usize, s: [f32; 2]) -> f32 {
        let along = s[1 - f] * PIECES - 0.5;
        let t = along - along.floor();
        let of = |piece: f32| {
            let mut s = s;
            s[1 - f] = (piece + 0.5) / PIECES;
            self.piece(f, s).map_or(0.0, |p| self.offset[f][p])
        };
        (1.0 - t) * of(along.floor()) + t * of(along.floor() + 1.0)
    }

    /// Paints over the twines, knots included, and all of the net whose cells are too small: the mean of what is beside them. Returns
    /// what was painted over. `None` when little else is left. `least`: half of the twine's own width, cells.
    pub(crate) fn paint_over(
        &self,
        map: &PhaseMap,
        level: &mut Level,
        least: [f32; 2],
        blur: f64,
        smoother: &mut Smoother,
    ) -> Option<Image<f32>> {
        let (width, height) = (level.raw.width(), level.raw.height());
        let mut painted = Image::new(width, height);
        let (bx, by) = level.blocks();
        let mut widest = 0.0f32;
        let mut share = 0.0f64;
        for y in 0..by {
            for x in 0..bx {
                let Some(planes) = map.block(x, y) else { continue };
                let open = is_open(&planes);
                let half: [f32; 2] = std::array::from_fn(|f| {
                    let k = slope(&planes[f]);
                    let looks = self.half[f] * (k / self.slope[f]).max(1.0);
                    looks.max(least[f] + 1.5 * blur as f32 * k) + 0.7 * k
                });
                if open {
                    widest = (0..2).fold(widest, |w, f| w.max(half[f] / slope(&planes[f]).max(1e-6)));
                }
                each_pixel(x, y, |column, row, u, v| {
                    let s: [f32; 2] = std::array::from_fn(|f| at(&planes[f], u, v));
                    let q: [f32; 2] = std::array::from_fn(|f| wrap(s[f]) - if open { self.offset(f, s) } else { 0.0 });
                    let knot = (q[0] / half[0]).hypot(q[1] / half[1]) < 1.8;
                    if !open || knot || q[0].abs() < half[0] || q[1].abs() < half[1] {
                        painted.row_mut(row)[column] = 1.0;
                        share += 1.0;
                    }
                });
            }
        }
        if share > MOST * (width * height) as f64 {
            return None;
        }
        // What is beside, near at hand or farther off where nothing is near.
        let mut weight = Image::new(width, height);
        let mut light = Image::new(width, height);
        for (i, p) in painted.data().iter().enumerate() {
            weight.data_mut()[i] = 1.0 - p;
            light.data_mut()[i] = (1.0 - p) * level.raw.data()[i];
        }
        let (mut mean, mut there) = (Image::default(), Image::default());
        let mut open = painted.data().to_vec();
        for sigma in [0.8 * widest.max(1.0), 4.0 * widest.max(1.0), 40.0 * widest.max(1.0)] {
            smoother.blur(&light, sigma, &mut mean);
            smoother.blur(&weight, sigma, &mut there);
            for (i, p) in open.iter_mut().enumerate() {
                if *p > 0.0 && there.data()[i] > 0.08 {
                    level.raw.data_mut()[i] = mean.data()[i] / there.data()[i];
                    *p = 0.0;
                }
            }
        }
        Some(painted)
    }
}

/// Cells per px.
pub(crate) fn slope(plane: &Plane) -> f32 {
    plane.du.hypot(plane.dv)
}

/// Lattice coordinate at `(u, v)` px from the middle of a block.
pub(crate) fn at(plane: &Plane, u: f32, v: f32) -> f32 {
    plane.s + plane.du * u + plane.dv * v
}

/// Calls `visit(column, row, u, v)` for the pixels of a block, `u`, `v` from its middle.
pub(crate) fn each_pixel(x: usize, y: usize, mut visit: impl FnMut(usize, usize, f32, f32)) {
    for r in 0..BLOCK {
        for c in 0..BLOCK {
            visit(x * BLOCK + c, y * BLOCK + r, c as f32 - 1.5, r as f32 - 1.5);
        }
    }
}

/// Whether cells are wide enough in a block for anything to be seen between their twines.
fn is_open(planes: &[Plane; 2]) -> bool {
    planes.iter().all(|p| slope(p) < 1.0 / SMALLEST_PX)
}
