//! Overlapping tiles and their whitened power spectra.

use std::sync::Arc;

use net_geometry::Camera;
use net_image::{Image, widely};
use realfft::{RealFftPlanner, RealToComplex};
use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

use crate::numeric::{clip_level, exp2_rough, log2_rough};
use crate::picture::smooth::Smoother;
use crate::picture::view::{Site, View};
use crate::search::coarse::{blur_clip, pool};
use crate::search::score::Places;

/// Length of the transforms: tiles are shorter and padded with zeros.
pub(crate) const SIZE: usize = 256;
/// Columns kept: frequencies along u up to 0.43 cycles per pixel.
pub(crate) const COLUMNS: usize = 112;
/// Highest spatial frequency used, cycles per px of the bank's level.
pub(crate) const HIGHEST: f64 = 0.42;
/// Noise that every picture is taken to have, of what counts as full contrast in it. Without it a drawn picture without noise is whitened
/// by the leakage of its own edges.
const LEAST_NOISE: f32 = 0.01;
/// Radius, bins, from which the highest of 3 x 3 bins stands for the middle one: steps of the search's grid are constant in the logarithm,
/// so they are wider there than a peak is.
const POOLED: f64 = 30.0;
/// Over which contrast is made alike, in lengths of the high-pass filter.
const NEAR: f64 = 0.5;
/// Bins along a side of the blocks from which the noise floor is taken.
const FLOOR: usize = 4;

/// Tiles of one size on one level of the pyramid, and their spectra.
pub(crate) struct Bank {
    /// Level of the pyramid.
    pub level: usize,
    /// Side of a tile, px of that level.
    pub length: usize,
    /// Upper left corners, px of the level.
    corners: Vec<[usize; 2]>,
    /// Middle of each tile.
    pub sites: Vec<Site>,
    /// The same side by side.
    pub places: Vec<Places>,
    /// Standard deviation, full-resolution px, of what is smooth and taken away.
    smooth_px: f64,
    window: Vec<f32>,
    /// Whitened power, expected value 1 without a net: tile, column (fx from 0), row (fy + SIZE / 2).
    pub power: Vec<f32>,
    /// Every so many tiles the search looks at one: many that overlap say the same.
    stride: usize,
    /// The same of those as coarse as the search's grid: blurred by a bin, clipped, the highest of the neighbourhood far from the middle, less its mean.
    pub coarse: Vec<f32>,
    /// Whether a bin is farther from the middle than [`POOLED`].
    far: Vec<bool>,
    /// Radius class of each block of bins.
    radius: Vec<u16>,
}

/// Transforms and scratch shared by the banks.
pub(crate) struct Spectra {
    rows: Arc<dyn RealToComplex<f32>>,
    columns: Arc<dyn Fft<f32>>,
    line: Vec<f32>,
    half: Vec<Complex32>,
    plane: Vec<Complex32>,
    scratch_rows: Vec<Complex32>,
    scratch_columns: Vec<Complex32>,
    floor: Vec<f32>,
    floor2: Vec<f32>,
    profile: Vec<(f32, u32)>,
    log: Vec<f32>,
    histogram: Vec<u32>,
    high: Image<f32>,
    pooled: Vec<f32>,
}

const BX: usize = COLUMNS / FLOOR;
const BY: usize = SIZE / FLOOR;

impl Bank {
    /// `columns` x `rows` tiles of about `length` px spread over a level. `None` if the level is too small.
    pub(crate) fn new(
        camera: &Camera,
        view: &View,
        level: usize,
        length: f64,
        columns: usize,
        rows: usize,
        smooth_px: f64,
    ) -> Option<Self> {
        let raw = &view.levels.get(level)?.raw;
        let scale = view.levels[level].scale;
        let length = (length.round() as usize).min(SIZE).min(raw.width()).min(raw.height());
        if length < 40 {
            return None;
        }
        let spread = |n: usize, span: usize| {
            (0..n).map(move |k| if n > 1 { (k * span + (n - 1) / 2) / (n - 1) } else { span / 2 })
        };
        let mut corners = Vec::new();
        for y in spread(rows, raw.height() - length) {
            corners.extend(spread(columns, raw.width() - length).map(|x| [x, y]));
        }
        corners.dedup();
        let mid = 0.5 * (length as f64 - 1.0);
        let sites: Vec<_> = corners
            .iter()
            .map(|[x, y]| {
                let full = |p: usize| (p as f64 + mid + 0.5) * scale - 0.5;
                Site::new(camera, full(*x), full(*y))
            })
            .collect();
        let hann: Vec<f32> = (0..length)
            .map(|k| (0.5 - 0.5 * (std::f64::consts::TAU * (k + 1) as f64 / (length + 1) as f64).cos()) as f32)
            .collect();
        let stride = if corners.len() > 20 { 2 } else { 1 };
        let radius = (0..BX * BY)
            .map(|b| {
                let (x, y) = ((b / BY * FLOOR) as f64 + 1.5, (b % BY * FLOOR) as f64 + 1.5 - SIZE as f64 / 2.0);
                (x.hypot(y) / FLOOR as f64) as u16
            })
            .collect();
        let far = |b: usize| ((b / SIZE) as f64).hypot((b % SIZE) as f64 - SIZE as f64 / 2.0) >= POOLED;
        Some(Self {
            far: (0..COLUMNS * SIZE).map(far).collect(),
            level,
            length,
            places: Places::new(&sites),
            sites,
            smooth_px,
            window: hann,
            power: vec![1.0; corners.len() * COLUMNS * SIZE],
            coarse: vec![0.0; corners.len().div_ceil(stride) * COLUMNS * SIZE],
            stride,
            corners,
            radius,
        })
    }

    /// Sites of the tiles that the search looks at.
    pub(crate) fn searched(&self) -> impl Iterator<Item = &Site> {
        self.sites.iter().step_by(self.stride)
    }
}

impl Spectra {
    pub(crate) fn new() -> Self {
        let rows = RealFftPlanner::<f32>::new().plan_fft_forward(SIZE);
        let columns = FftPlanner::<f32>::new().plan_fft_forward(SIZE);
        Self {
            line: vec![0.0; SIZE],
            half: rows.make_output_vec(),
            plane: vec![Complex32::default(); COLUMNS * SIZE],
            scratch_rows: rows.make_scratch_vec(),
            scratch_columns: vec![Complex32::default(); columns.get_inplace_scratch_len()],
            rows,
            columns,
            floor: vec![0.0; BX * BY],
            floor2: vec![0.0; BX * BY],
            profile: Vec::new(),
            log: Vec::new(),
            histogram: Vec::new(),
            high: Image::default(),
            pooled: Vec::new(),
        }
    }

    /// Fills the bank's spectra from the picture in the view.
    pub(crate) fn compute(&mut self, view: &View, bank: &mut Bank, smoother: &mut Smoother) {
        let level = &view.levels[bank.level];
        smoother.subtract_blur(&level.raw, (bank.smooth_px / level.scale) as f32, &mut self.high);
        let near = NEAR * bank.smooth_px / level.scale;
        smoother.equalize(&mut self.high, near as f32, &mut self.histogram);
        let clip = clip_level(self.high.data().iter().copied(), &mut self.histogram).max(1e-9);
        let gain = 1.0 / clip;
        for p in self.high.data_mut() {
            *p = (*p * gain).clamp(-1.0, 1.0);
        }
        let tiles = bank.corners.len();
        self.log.resize(tiles * COLUMNS * SIZE, 0.0);
        let window: f32 = bank.window.iter().map(|w| w * w).sum();
        let floor = (LEAST_NOISE * window).powi(2) + 1e-12;
        for t in 0..tiles {
            self.transform(bank, t, floor);
        }
        whiten(self, bank);
    }

    /// Logarithm of the power of tile `t`, and of the `floor` added to it.
    fn transform(&mut self, bank: &Bank, t: usize, floor: f32) {
        let (l, [x, y]) = (bank.length, bank.corners[t]);
        let (mut sum, mut weight) = (0.0f64, 0.0f64);
        for v in 0..l {
            let row = &self.high.row(y + v)[x..x + l];
            let dot: f32 = row.iter().zip(&bank.window).map(|(p, w)| p * w).sum();
            sum += f64::from(dot * bank.window[v]);
            weight += f64::from(bank.window[v]);
        }
        let mean = (sum / (weight * weight)) as f32;
        self.plane.fill(Complex32::default());
        for v in 0..l {
            let row = &self.high.row(y + v)[x..x + l];
            let wv = bank.window[v];
            for ((o, p), w) in self.line.iter_mut().zip(row).zip(&bank.window) {
                *o = (p - mean) * w * wv;
            }
            self.line[l..].fill(0.0);
            // The lengths come from the plan itself, so this cannot fail.
            let done = self.rows.process_with_scratch(&mut self.line, &mut self.half, &mut self.scratch_rows);
            debug_assert!(done.is_ok());
            for (column, value) in self.plane.chunks_exact_mut(SIZE).zip(&self.half) {
                column[v] = *value;
            }
        }
        let log = &mut self.log[t * COLUMNS * SIZE..][..COLUMNS * SIZE];
        for (column, out) in self.plane.chunks_exact_mut(SIZE).zip(log.chunks_exact_mut(SIZE)) {
            self.columns.process_with_scratch(column, &mut self.scratch_columns);
            // Rows from fy = -1/2 on.
            let (positive, negative) = column.split_at(SIZE / 2);
            let (first, last) = out.split_at_mut(SIZE / 2);
            logarithms(negative, floor, first);
            logarithms(positive, floor, last);
        }
    }

    /// Divides by the local noise floor: first the mean over directions and tiles, then the neighbourhood of each bin.
    #[inline(always)]
    fn whiten(&mut self, bank: &mut Bank) {
        let tiles = bank.corners.len();
        let classes = bank.radius.iter().max().map_or(1, |r| usize::from(*r) + 1);
        self.profile.clear();
        self.profile.resize(classes, (0.0, 0));
        for t in 0..tiles {
            self.block_means(t, None);
            for (r, m) in bank.radius.iter().zip(&self.floor) {
                let p = &mut self.profile[usize::from(*r)];
                p.0 += m;
                p.1 += 1;
            }
        }
        for p in &mut self.profile {
            p.0 /= p.1.max(1) as f32;
        }
        // E[log2 of an exponential] = -0.8327; the prototype's 0.05 in natural units makes up for the clipping.
        const BIAS: f32 = 0.8327 - 0.0721;
        let low = (1.5 * SIZE as f64 / bank.length as f64) as usize;
        for t in 0..tiles {
            self.block_means(t, None);
            self.box_mean(bank);
            self.block_means(t, Some(2.16));
            self.box_mean(bank);
            let log = &self.log[t * COLUMNS * SIZE..][..COLUMNS * SIZE];
            let out = &mut bank.power[t * COLUMNS * SIZE..][..COLUMNS * SIZE];
            for x in 0..COLUMNS {
                let floor = &self.floor2[x / FLOOR * BY..][..BY];
                let (log, out) = (&log[x * SIZE..][..SIZE], &mut out[x * SIZE..][..SIZE]);
                spread(floor, BIAS, &mut self.line);
                for ((l, o), f) in log.iter().zip(out.iter_mut()).zip(&self.line) {
                    *o = exp2_rough(l - f);
                }
                if x <= low {
                    out[SIZE / 2 - low..=SIZE / 2 + low].fill(1.0);
                }
            }
            if t % bank.stride == 0 {
                let coarse = &mut bank.coarse[t / bank.stride * COLUMNS * SIZE..][..COLUMNS * SIZE];
                blur_clip(out, coarse, &mut self.line);
                pool(coarse, &bank.far, &mut self.pooled);
            }
        }
    }

    /// Mean logarithm in blocks of bins; with `above`, bins are clipped that much above `floor2`.
    #[inline(always)]
    fn block_means(&mut self, t: usize, above: Option<f32>) {
        let log = &self.log[t * COLUMNS * SIZE..][..COLUMNS * SIZE];
        let (mut sums, mut limits) = ([0.0f32; SIZE], [f32::INFINITY; SIZE]);
        for (bx, columns) in log.chunks_exact(FLOOR * SIZE).enumerate() {
            if let Some(above) = above {
                spread(&self.floor2[bx * BY..][..BY], above, &mut limits);
            }
            sums.fill(0.0);
            for column in columns.chunks_exact(SIZE) {
                for ((sum, l), limit) in sums.iter_mut().zip(column).zip(&limits) {
                    *sum += if l < limit { *l } else { *limit };
                }
            }
            for (floor, sums) in self.floor[bx * BY..][..BY].iter_mut().zip(sums.chunks_exact(FLOOR)) {
                *floor = sums.iter().sum::<f32>() / (FLOOR * FLOOR) as f32;
            }
        }
    }

    /// `floor2` = radial profile + mean of (floor - profile) over 5 x 5 blocks, with the spectrum's own symmetry at fx = 0.
    fn box_mean(&mut self, bank: &Bank) {
        let excess = |floor: &[f32], profile: &[(f32, u32)], bx: isize, by: isize| {
            // Block -1 - b of the left half plane mirrors block b; rows wrap.
            let (x, y) = if bx < 0 { (-1 - bx, BY as isize - 1 - by) } else { (bx, by) };
            let b = (x.min(BX as isize - 1) as usize) * BY + y.rem_euclid(BY as isize) as usize;
            floor[b] - profile[usize::from(bank.radius[b])].0
        };
        const R: isize = 2;
        // Along x first, into the end of `floor2`'s twin; the sums are small enough to do directly.
        let mut along = [0.0f32; BX * BY];
        for bx in 0..BX as isize {
            for by in 0..BY as isize {
                along[bx as usize * BY + by as usize] =
                    (-R..=R).map(|d| excess(&self.floor, &self.profile, bx + d, by)).sum();
            }
        }
        for bx in 0..BX {
            for by in 0..BY {
                let sum: f32 =
                    (-R..=R).map(|d| along[bx * BY + (by as isize + d).rem_euclid(BY as isize) as usize]).sum();
                let b = bx * BY + by;
                self.floor2[b] = self.profile[usize::from(bank.radius[b])].0 + sum / ((2 * R + 1) * (2 * R + 1)) as f32;
            }
        }
    }
}

widely! {
    fn logarithms<'a>(values: &'a [Complex32], floor: f32, out: &'a mut [f32]) -> () {
        for (o, c) in out.iter_mut().zip(values) {
            *o = log2_rough(c.norm_sqr() + floor);
        }
    }
}

widely! {
    fn whiten<'a>(spectra: &'a mut Spectra, bank: &'a mut Bank) -> () {
        spectra.whiten(bank);
    }
}

/// A number for each bin from one for each block of them, and something added.
#[inline(always)]
fn spread(blocks: &[f32], add: f32, bins: &mut [f32]) {
    for (bins, block) in bins.chunks_exact_mut(FLOOR).zip(blocks) {
        bins.fill(block + add);
    }
}

impl std::fmt::Debug for Spectra {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Spectra")
    }
}
impl std::fmt::Debug for Bank {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Bank of {} tiles of {} px", self.corners.len(), self.length)
    }
}
