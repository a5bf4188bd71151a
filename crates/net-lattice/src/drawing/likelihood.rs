//! The picture against a drawing of the net: how much better it is explained with the net than without, and by how much each tile would
//! move the net.

use net_image::{Image, widely};

use crate::drawing::bar::Bar;
use crate::drawing::blocks::{Block, PIXELS, chosen, fill_in, positions, total};
use crate::drawing::polarity::{Polarity, contrasts};
use crate::drawing::template::{Profile, look_up_all};
use crate::numeric::{log2_rough, magnitude_quantiles, median};
use crate::picture::smooth::Smoother;
use crate::picture::view::{BLOCK, Level, TileGrid};
use crate::sheet::fit::Observation;
use crate::sheet::map::{PhaseMap, Plane};
use crate::sheet::surface::Surface;

/// How the net is drawn and compared.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drawing {
    /// Of each family: light from aside can have one brighter than the water and leave the other darker.
    pub polarity: [Polarity; 2],
    /// Blur of the picture, px of the level, one standard deviation.
    pub blur: f64,
    /// Added to the coordinates, cells: half a cell turns bright twine's lock-in into dark twine's.
    pub offset: [f32; 2],
    /// Length over which the contrast may change, px of the level.
    pub contrast_length: f64,
    /// Length of the high-pass filter, px of the level.
    pub high_pass: f64,
    /// Compare one block in four only.
    pub sparse: bool,
    /// Draw in closed form, where slopes are asked for.
    pub quick: bool,
}

/// Buffers of the comparison; one picture, many drawings.
#[derive(Debug, Default)]
pub(crate) struct Likelihood {
    blocks_x: usize,
    blocks_y: usize,
    image: Vec<Block>,
    drawn: Vec<Block>,
    d1: Vec<Block>,
    d2: Vec<Block>,
    used: Vec<bool>,
    /// Robust noise level of the high-passed picture.
    noise: f32,
    mean: Image<f32>,
    smooth: Image<f32>,
    num: Image<f32>,
    den: Image<f32>,
    amplitude: Image<f32>,
    variance: Image<f32>,
    /// Twine widths along the two families, cells, and what they look like.
    widths: [f32; 2],
    profiles: [Profile; 2],
    histogram: Vec<u32>,
    order: Vec<f64>,
    /// Gradient and information of both coordinates per tile: g1, g2, h11, h12, h22.
    tiles: Vec<[f64; 5]>,
    /// Shifts found in the last call of [`Likelihood::observe`], NaN where there is nothing to see.
    pub shifts: Vec<[f64; 2]>,
}

impl Likelihood {
    /// Takes the high-passed picture of a level.
    pub(crate) fn load(&mut self, level: &Level) {
        let (bx, by) = level.blocks();
        (self.blocks_x, self.blocks_y) = (bx, by);
        let n = bx * by;
        self.image.resize(n, [0.0; PIXELS]);
        for (y, blocks) in self.image.chunks_exact_mut(bx).enumerate() {
            for r in 0..BLOCK {
                for (block, pixels) in blocks.iter_mut().zip(level.high.row(y * BLOCK + r).chunks_exact(BLOCK)) {
                    block[r * BLOCK..][..BLOCK].copy_from_slice(pixels);
                }
            }
        }
        for buffer in [&mut self.drawn, &mut self.d1, &mut self.d2] {
            buffer.resize(n, [0.0; PIXELS]);
        }
        self.used.resize(n, false);
        for small in
            [&mut self.mean, &mut self.num, &mut self.den, &mut self.amplitude, &mut self.variance, &mut self.smooth]
        {
            small.resize(bx, by);
        }
        let every = level.high.data().iter().copied();
        // Most of a picture may be empty: not less than a few per cent of what stands out in it.
        let [middle, contrast] = magnitude_quantiles(every, [0.5, 0.97], &mut self.histogram);
        self.noise = (1.4826 * middle).max(0.04 * contrast).max(1e-6);
    }

    /// Twine widths along the two families, cells.
    pub(crate) fn set_widths(&mut self, widths: [f64; 2]) {
        self.widths = widths.map(|w| w as f32);
        for (p, w) in self.profiles.iter_mut().zip(widths) {
            p.prepare(w);
        }
    }

    /// Draws the net and its derivatives, and removes from it what the high-pass filter removed from the picture.
    fn draw<const SLOPES: bool>(&mut self, map: &PhaseMap, drawing: &Drawing, smoother: &mut Smoother) {
        match (SLOPES, drawing.quick) {
            (true, true) => draw_quickly(self, map, drawing),
            (true, false) => draw_with_slopes(self, map, drawing),
            (false, _) => draw_alone(self, map, drawing),
        }
        if drawing.sparse {
            fill_in(&mut self.mean);
        }
        smoother.blur(&self.mean, (drawing.high_pass / BLOCK as f64) as f32, &mut self.smooth);
        for (b, used) in self.used.iter().enumerate() {
            if *used {
                let m = self.smooth.data()[b];
                self.drawn[b].iter_mut().for_each(|t| *t -= m);
            }
        }
    }

    /// Block by block, and each block's mean.
    #[inline(always)]
    fn draw_blocks<const SLOPES: bool, const QUICK: bool>(&mut self, map: &PhaseMap, drawing: &Drawing) {
        let bx = self.blocks_x;
        let (sign, both) = contrasts(drawing.polarity);
        for y in 0..self.blocks_y {
            for x in 0..bx {
                let b = y * bx + x;
                self.used[b] = false;
                self.mean.data_mut()[b] = 0.0;
                if drawing.sparse && !chosen(x, y) {
                    continue;
                }
                let Some(planes) = map.block(x, y) else { continue };
                self.used[b] = true;
                let blur = |f: usize| {
                    let p: &Plane = &planes[f];
                    drawing.blur as f32 * (p.du * p.du + p.dv * p.dv).sqrt()
                };
                let [q1, q2] = std::array::from_fn(|f| positions(&planes[f], drawing.offset[f]));
                let ((p1, g1), (p2, g2)) = (self.look::<QUICK>(0, blur(0), &q1), self.look::<QUICK>(1, blur(1), &q2));
                let (t, d1, d2) = (&mut self.drawn[b], &mut self.d1[b], &mut self.d2[b]);
                // Whole arrays, of which the compiler knows that they are not one.
                *t = std::array::from_fn(|k| sign[0] * p1[k] + sign[1] * p2[k] - both * p1[k] * p2[k]);
                if SLOPES {
                    *d1 = std::array::from_fn(|k| (sign[0] - both * p2[k]) * g1[k]);
                    *d2 = std::array::from_fn(|k| (sign[1] - both * p1[k]) * g2[k]);
                }
                self.mean.data_mut()[b] = total([&self.drawn[b]], |[t]| t) / PIXELS as f32;
            }
        }
    }

    /// Coverage by the twine of one family, and its derivative, blurred over so many cells.
    #[inline(always)]
    fn look<const QUICK: bool>(&self, family: usize, blur: f32, q: &Block) -> (Block, Block) {
        if QUICK {
            Bar::new(self.widths[family], blur).cover(q)
        } else {
            look_up_all(self.profiles[family].row(blur), q)
        }
    }

    /// Products of picture and drawing, and of the drawing with itself, block by block.
    #[inline(always)]
    fn correlate_blocks(&mut self) {
        for b in 0..self.used.len() {
            let (mut num, mut den) = (0.0f32, 0.0f32);
            if self.used[b] {
                num = total([&self.image[b], &self.drawn[b]], |[i, t]| i * t);
                den = total([&self.drawn[b]], |[t]| t * t);
            }
            self.num.data_mut()[b] = num;
            self.den.data_mut()[b] = den;
        }
    }

    /// Local contrast of the drawing in the picture; none where it would have to be turned over.
    fn fit_amplitude(&mut self, drawing: &Drawing, smoother: &mut Smoother) {
        correlate(self);
        let sigma = (drawing.contrast_length / BLOCK as f64) as f32;
        smoother.blur(&self.num, sigma, &mut self.smooth);
        smoother.blur(&self.den, sigma, &mut self.amplitude);
        for (a, n) in self.amplitude.data_mut().iter_mut().zip(self.smooth.data()) {
            *a = (n / (*a + 3e-4)).max(0.0);
        }
    }

    /// Robust log-likelihood gain of the drawing over an empty picture (Cauchy noise), natural units, in the tiles of `grid` that the mask has; an empty mask
    /// has all.
    pub(crate) fn gain(
        &mut self,
        map: &PhaseMap,
        drawing: &Drawing,
        grid: &TileGrid,
        mask: &[bool],
        smoother: &mut Smoother,
    ) -> f64 {
        self.draw::<false>(map, drawing, smoother);
        self.fit_amplitude(drawing, smoother);
        let gain = compare(self, grid, mask);
        gain * std::f64::consts::LN_2 * if drawing.sparse { 4.0 } else { 1.0 }
    }

    /// The gain of the blocks drawn, in powers of 2.
    #[inline(always)]
    fn compare_blocks(&self, grid: &TileGrid, mask: &[bool]) -> f64 {
        let per = 1.0 / (1.5 * self.noise);
        let mut gain = 0.0f64;
        for b in 0..self.used.len() {
            let a = self.amplitude.data()[b];
            if !self.used[b] || a == 0.0 {
                continue;
            }
            let tile = usize::from(grid.row[b / self.blocks_x]) * grid.nx + usize::from(grid.column[b % self.blocks_x]);
            if mask.get(tile) == Some(&false) {
                continue;
            }
            let mut sum = 0.0;
            for (i, t) in self.image[b].chunks_exact(4).zip(self.drawn[b].chunks_exact(4)) {
                // One logarithm for four pixels.
                let (mut without, mut with) = (1.0f32, 1.0f32);
                for (i, t) in i.iter().zip(t) {
                    without *= 1.0 + (i * per).powi(2);
                    with *= 1.0 + ((i - a * t) * per).powi(2);
                }
                sum += log2_rough((without / with).clamp(1e-30, 1e30));
            }
            gain += f64::from(sum);
        }
        gain
    }

    /// Where each tile says the lattice is: its predicted coordinates plus the shift that the picture asks for.
    pub(crate) fn observe(
        &mut self,
        surface: &Surface,
        map: &PhaseMap,
        drawing: &Drawing,
        grid: &TileGrid,
        smoother: &mut Smoother,
        out: &mut Vec<Observation>,
    ) {
        self.draw::<true>(map, drawing, smoother);
        self.fit_amplitude(drawing, smoother);
        self.cap_amplitude();
        square_residuals(self, drawing);
        if drawing.sparse {
            fill_in(&mut self.num);
        }
        smoother.blur(&self.num, (drawing.contrast_length / BLOCK as f64) as f32, &mut self.variance);
        sum_tiles(self, grid);
        self.solve_tiles(surface, grid, out);
    }

    /// Mean square of what the drawing leaves of the picture, block by block, clipped.
    #[inline(always)]
    fn square_blocks(&mut self, drawing: &Drawing) {
        let clip = (4.0 * self.noise).powi(2);
        for b in 0..self.used.len() {
            if drawing.sparse && !chosen(b % self.blocks_x, b / self.blocks_x) {
                continue;
            }
            // Without a drawing the picture itself is the residual.
            let a = if self.used[b] { self.amplitude.data()[b] } else { 0.0 };
            let sum = total([&self.image[b], &self.drawn[b]], |[i, t]| (i - a * t).powi(2).min(clip));
            self.num.data_mut()[b] = sum / PIXELS as f32;
        }
    }

    /// Gradient and information of every tile.
    #[inline(always)]
    fn sum_blocks(&mut self, grid: &TileGrid) {
        self.tiles.clear();
        self.tiles.resize(grid.nx * grid.ny, [0.0; 5]);
        for y in 0..self.blocks_y {
            let tiles = &mut self.tiles[usize::from(grid.row[y]) * grid.nx..][..grid.nx];
            for x in 0..self.blocks_x {
                let b = y * self.blocks_x + x;
                let a = self.amplitude.data()[b];
                if !self.used[b] || a == 0.0 {
                    continue;
                }
                let variance = self.variance.data()[b].max(1e-7);
                let per = 1.0 / variance.sqrt();
                let (mut r, mut w) = ([0.0; PIXELS], [0.0; PIXELS]);
                let (image, drawn) = (&self.image[b], &self.drawn[b]);
                for k in 0..PIXELS {
                    r[k] = image[k] - a * drawn[k];
                    let e = r[k].abs() * per;
                    w[k] = 3.0 / e.max(3.0) * f32::from(u8::from(e < 6.0));
                }
                let (d1, d2) = (&self.d1[b], &self.d2[b]);
                let sums = [
                    a * total([&w, d1, &r], |[w, d, r]| w * d * r),
                    a * total([&w, d2, &r], |[w, d, r]| w * d * r),
                    a * a * total([&w, d1, d1], |[w, d, e]| w * d * e),
                    a * a * total([&w, d1, d2], |[w, d, e]| w * d * e),
                    a * a * total([&w, d2, d2], |[w, d, e]| w * d * e),
                ];
                let tile = &mut tiles[usize::from(grid.column[x])];
                for (t, s) in tile.iter_mut().zip(sums) {
                    *t += f64::from(s / variance);
                }
            }
        }
    }

    /// No contrast beyond four times the median: a fish's edge is not twine.
    fn cap_amplitude(&mut self) {
        self.order.clear();
        self.order.extend(self.amplitude.data().iter().filter(|a| **a != 0.0).map(|a| f64::from(*a)));
        let cap = (4.0 * median(&mut self.order)) as f32;
        for a in self.amplitude.data_mut() {
            *a = a.min(cap);
        }
    }

    /// Two numbers per tile from its gradient and information.
    fn solve_tiles(&mut self, surface: &Surface, grid: &TileGrid, out: &mut Vec<Observation>) {
        // No tile claims better than this, cells: knots are not where a perfect lattice has them.
        const FLOOR: f64 = 0.004 * 0.004;
        self.order.clear();
        self.order.extend(self.tiles.iter().map(|t| t[2] + t[4]).filter(|t| *t > 0.0));
        let least = 1e-3 * median(&mut self.order);
        let chart = surface.chart();
        out.clear();
        self.shifts.clear();
        for (site, t) in grid.sites.iter().zip(&self.tiles) {
            let mut o = Observation { site: *site, s: [0.0; 2], weight: [0.0; 3] };
            let trace = t[2] + t[4];
            let point = chart.at(site.ray[0], site.ray[1]);
            self.shifts.push([f64::NAN; 2]);
            if let (true, Some(p)) = (site.valid && trace > least && trace > 0.0, point) {
                let ridge = 1e-2 * trace + 1e-6;
                let (a, b, c) = (t[2] + ridge, t[3], t[4] + ridge);
                let det = a * c - b * b;
                let shift = [(c * t[0] - b * t[1]) / det, (a * t[1] - b * t[0]) / det].map(|s| s.clamp(-0.12, 0.12));
                o.s = [p.s[0] + shift[0], p.s[1] + shift[1]];
                let (ia, ib, ic) = (c / det + FLOOR, -b / det, a / det + FLOOR);
                let idet = ia * ic - ib * ib;
                o.weight = [ic / idet, -ib / idet, ia / idet];
                if let Some(last) = self.shifts.last_mut() {
                    *last = shift;
                }
            }
            out.push(o);
        }
    }
}

widely! {
    fn draw_with_slopes<'a>(likelihood: &'a mut Likelihood, map: &'a PhaseMap, drawing: &'a Drawing) -> () {
        likelihood.draw_blocks::<true, false>(map, drawing);
    }
}
widely! {
    fn draw_quickly<'a>(likelihood: &'a mut Likelihood, map: &'a PhaseMap, drawing: &'a Drawing) -> () {
        likelihood.draw_blocks::<true, true>(map, drawing);
    }
}
widely! {
    fn draw_alone<'a>(likelihood: &'a mut Likelihood, map: &'a PhaseMap, drawing: &'a Drawing) -> () {
        likelihood.draw_blocks::<false, false>(map, drawing);
    }
}
widely! {
    fn correlate<'a>(likelihood: &'a mut Likelihood) -> () {
        likelihood.correlate_blocks();
    }
}
widely! {
    fn compare<'a>(likelihood: &'a Likelihood, grid: &'a TileGrid, mask: &'a [bool]) -> f64 {
        likelihood.compare_blocks(grid, mask)
    }
}
widely! {
    fn sum_tiles<'a>(likelihood: &'a mut Likelihood, grid: &'a TileGrid) -> () {
        likelihood.sum_blocks(grid);
    }
}
widely! {
    fn square_residuals<'a>(likelihood: &'a mut Likelihood, drawing: &'a Drawing) -> () {
        likelihood.square_blocks(drawing);
    }
}
