//! What the stages of an estimator share: the pyramid, plans, buffers, and the steps that both a cold start and a followed picture take.

use net_geometry::{Camera, Mesh};
use net_image::GrayView;

use crate::alike::Influence;
use crate::background::Background;
use crate::comb::{Comb, LOOKS, Looks};
use crate::config::Config;
use crate::decision::Evidence;
use crate::demodulate::{Columns, TileSum, demodulate};
use crate::estimate::Followed;
use crate::fit::{Fit, Fitter, Observation, Prior, Robust};
use crate::fold::{Fold, Folder};
use crate::likelihood::{Drawing, Likelihood, Polarity};
use crate::lockin::{Measurement, Probe, Window, measure};
use crate::map::PhaseMap;
use crate::model::Model;
use crate::numeric::clip_level;
use crate::periods::Rival;
use crate::search::{Candidate, Scope, Search};
use crate::seed::{Said, Seed};
use crate::smooth::Smoother;
use crate::spectra::{Bank, Spectra};
use crate::spread::Spread;
use crate::stages::Stages;
use crate::surface::{self, Surface};
use crate::view::{LEVELS, View};

/// Weight of a tile in which next to nothing is.
const WEAK: f64 = 0.05;
/// Last passes of a lock-in that see all harmonics.
const FINE: usize = 2;
/// What counts as near the optical axis, px of an 848 x 480 px picture.
const NEAR: f64 = 220.0;
/// How what a lock-in measured loses its weight: a phase of 0.6 rad is off.
pub(crate) const LOCKED: Robust = Robust::Family(0.6 / std::f64::consts::TAU);
/// Power of a wave over that of noise from which more adds no weight: knots are not where a perfect lattice has them.
pub(crate) const LOUDEST: f64 = 60.0;
/// Smallest cell, full-resolution px on the axis, that is looked for.
pub(crate) const SMALLEST_CELL: f64 = 3.7;

#[derive(Debug)]
pub(crate) struct Workspace {
    pub view: View,
    pub banks: Vec<(Bank, Search)>,
    pub spectra: Spectra,
    pub background: Background,
    pub tools: Tools,
    pub scope: Scope,
    pub prior: Prior,
    pub candidates: Vec<Candidate>,
    /// Those of one bank.
    pub found: Vec<Candidate>,
    pub locks: Vec<Lock>,
    pub rivals: Vec<Rival>,
    /// Twine diameter, m.
    pub twine: f64,
    /// What the next picture starts from.
    pub last: Option<Followed>,
    /// What the stages of the last picture gave, if it was a cold start.
    pub stages: Option<Stages>,
}

/// Buffers that the stages share.
#[derive(Debug, Default)]
pub(crate) struct Tools {
    pub smoother: Smoother,
    pub map: PhaseMap,
    /// Sums of a lock-in by column of blocks in one row of tiles, and by tile.
    pub columns: Vec<Columns>,
    pub sums: Vec<TileSum>,
    /// Cells by which sums are turned.
    pub turns: Vec<[f64; 2]>,
    pub measurements: Vec<Measurement>,
    /// The same by each look.
    pub looks: [Vec<Said>; LOOKS.len()],
    pub observations: Vec<Observation>,
    pub fitter: Fitter,
    pub likelihood: Likelihood,
    pub histogram: Vec<u32>,
    pub scratch: Vec<f64>,
    pub influences: Vec<Influence>,
    pub folder: Folder,
    pub spread: Spread,
    /// Tiles, of this tiling, that a comparison of drawings looks at; empty for all.
    pub mask: Vec<bool>,
    pub tiling: usize,
    /// Length of the filter of each level's `high`; zero for none yet.
    pub high: [f64; LEVELS],
    /// The level whose `high` the likelihood has.
    pub loaded: Option<usize>,
    /// The same of `thin`, and the gain of the lock-in.
    pub thin: [(f64, f32); LEVELS],
    /// The sheet, level and tiling of `sums`, where all of the picture is in them.
    pub summed: Option<(Surface, (usize, usize))>,
}

impl Tools {
    /// Another picture: nothing is filtered yet.
    pub(crate) fn forget(&mut self) {
        self.high = [0.0; LEVELS];
        self.loaded = None;
        self.thin = [(0.0, 0.0); LEVELS];
        self.summed = None;
    }
}

/// A locked candidate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lock {
    /// The candidate's score in the search, and how far it stood above its background.
    pub score: f64,
    pub above: f64,
    pub surface: Surface,
    /// What the search gave to lock to.
    pub start: Surface,
    pub seed: Seed,
    pub evidence: Evidence,
    pub gain: f64,
    pub polarity: [Polarity; 2],
    pub blur: f64,
    /// Standard deviation of the window about the optical axis in which the sheet is fitted, px of an 848 x 480 px picture.
    pub focus: f64,
    /// Side of a cell, px, down to which the picture is averaged before it is compared with the drawing.
    pub drawn_cell_px: f64,
    /// Whether only the rest of a prediction is left to be found: one drawing in closed form, one set of derivatives.
    pub quick: bool,
}

impl Lock {
    /// Coherence of the family that agrees less: what both have.
    pub(crate) fn coherence(&self) -> f64 {
        self.evidence.v[0].min(self.evidence.v[1])
    }
}

impl Workspace {
    pub(crate) fn new(camera: &Camera, mesh: &Mesh, config: &Config, view: View) -> Self {
        let mut banks = Vec::new();
        let reduction = view.reduction as f64;
        // Tiles of 160 px for cells up to 60 px, of 360 px for those up to 136 px (848 x 480 px).
        for (half, length, columns, rows, smooth) in [(0, 160.0, 9, 5, 10.0), (1, 360.0, 5, 2, 24.0)] {
            let level = half.min(view.levels.len() - 1);
            let scale = view.levels[level].scale;
            let tile = length * view.size / scale;
            if let Some(bank) = Bank::new(camera, &view, level, tile, columns, rows, smooth * view.size) {
                let side = bank.length as f64 * scale;
                let smallest = if half == 0 { SMALLEST_CELL * reduction } else { 0.075 * side };
                let largest = 0.378 * side;
                if largest > 1.3 * smallest {
                    let search = Search::new(&view, &bank, smallest, largest);
                    banks.push((bank, search));
                }
            }
        }
        let sides = [mesh.side1(), mesh.side2()];
        let mut tools = Tools::default();
        tools.likelihood.set_widths(sides.map(|side| config.twine_diameter_m / side));
        Self {
            scope: Scope { sides, angle: mesh.angle(), angle_sigma: config.crossing_angle_sigma_deg.to_radians() },
            prior: Prior { sigma: surface::prior(config), angle: mesh.angle() },
            banks,
            spectra: Spectra::new(),
            background: Background::default(),
            tools,
            candidates: Vec::new(),
            found: Vec::new(),
            locks: Vec::new(),
            rivals: Vec::new(),
            twine: config.twine_diameter_m,
            last: None,
            stages: None,
            view,
        }
    }

    pub(crate) fn load(&mut self, image: GrayView<'_>) {
        self.view.load(image);
        self.stages = None;
        self.tools.smoother.least = Smoother::FINE;
        self.tools.forget();
    }

    /// Full-resolution px of a cell (geometric mean of the sides) on the axis.
    pub(crate) fn cell_px(&self, depth: f64) -> f64 {
        self.view.focal * (self.scope.sides[0] * self.scope.sides[1]).sqrt() / depth
    }

    /// The shorter side in full-resolution px.
    pub(crate) fn short_px(&self, depth: f64) -> f64 {
        self.view.focal * self.scope.sides[0].min(self.scope.sides[1]) / depth
    }

    /// Makes sure that `high` of a level is filtered for drawing cells of `cell` px.
    pub(crate) fn high(&mut self, level: usize, cell: f64) {
        let sigma = self.view.high_pass_px(cell);
        let t = &mut self.tools;
        if t.high[level] != sigma {
            t.high[level] = sigma;
            t.loaded = t.loaded.filter(|loaded| *loaded != level);
            self.view.levels[level].filter_high(sigma, &mut t.smoother);
        }
    }

    /// Makes sure that `thin` of a level is filtered for locking to cells of `cell` px; returns the lock-in's gain.
    pub(crate) fn thin(&mut self, level: usize, cell: f64) -> f32 {
        let sigma = self.view.thin_px(cell);
        let t = &mut self.tools;
        if t.thin[level].0 != sigma {
            self.view.levels[level].filter_thin(sigma, &mut t.smoother, &mut t.histogram);
            let q = clip_level(self.view.levels[level].thin.data().iter().copied(), &mut t.histogram);
            t.thin[level] = (sigma, 1.0 / (q + 1e-9));
        }
        t.thin[level].1
    }

    /// Level and tiling of the lock-in for a depth.
    pub(crate) fn scale_for(&self, depth: f64) -> (usize, usize) {
        (self.view.level_for(self.short_px(depth), 12.0), self.view.tiling_for(self.cell_px(depth)))
    }

    /// The same where three harmonics are enough to go on: on the way, and for a net that is followed.
    pub(crate) fn coarse_scale_for(&self, depth: f64) -> (usize, usize) {
        (self.view.level_for(self.short_px(depth), 8.0), self.view.tiling_for(self.cell_px(depth)))
    }

    /// The sums of a lock-in at the predicted sheet; returns the gain they were taken with.
    pub(crate) fn demodulate(&mut self, surface: &Surface, place: (usize, usize), window: &Window) -> f32 {
        let gain = self.thin(place.0, self.cell_px(surface.depth));
        let t = &mut self.tools;
        let level = &self.view.levels[place.0];
        t.summed = None;
        t.map.fill(surface, level);
        let (columns, sums) = (&mut t.columns, &mut t.sums);
        demodulate(level, place.1, &t.map, gain, window, columns, sums);
        gain
    }

    /// The last sums read as combs.
    pub(crate) fn comb(
        &mut self,
        surface: &Surface,
        place: (usize, usize),
        odd: [f64; 2],
        looks: Looks,
        gain: f32,
    ) -> Comb {
        let width = self.scope.sides.map(|s| self.twine / s);
        let cell = self.cell_px(surface.depth) / self.view.levels[place.0].scale;
        let t = &mut self.tools;
        let comb = Comb::new(&t.sums, width, cell, odd, looks, &mut t.scratch);
        measure(surface, &self.view, place, Probe::Comb(comb), gain, &t.sums, &mut t.scratch, &mut t.measurements);
        comb
    }

    /// What the last sums, which are those of this sheet, have for it where it lies on the twine: first by all harmonics together, then by the first two, whose
    /// measurements are left behind.
    pub(crate) fn weigh(&mut self, surface: &Surface, place: (usize, usize), gain: f32, lock: &Lock) -> Evidence {
        let sign = lock.polarity.map(|p| f64::from(p.sign()));
        let looks = std::array::from_fn(|f| sign[f] * lock.seed.looks[f]);
        self.comb(surface, place, sign, looks, gain);
        let all = self.evidence_within(lock.focus);
        let t = &mut self.tools;
        let probe = Probe::Waves(sign);
        measure(surface, &self.view, place, probe, gain, &t.sums, &mut t.scratch, &mut t.measurements);
        self.evidence_within(lock.focus).with_comb(&all)
    }

    /// One lock-in by all harmonics together.
    pub(crate) fn measure_comb(&mut self, surface: &Surface, place: (usize, usize), looks: Looks, window: &Window) {
        let gain = self.demodulate(surface, place, window);
        self.comb(surface, place, [1.0; 2], looks, gain);
    }

    /// What the last measurements say for the lattice.
    pub(crate) fn evidence(&mut self) -> Evidence {
        self.evidence_within(f64::INFINITY)
    }

    /// The same of those within a radius of the optical axis, px of an 848 x 480 px picture.
    pub(crate) fn evidence_within(&mut self, radius: f64) -> Evidence {
        let (near, window) = (self.window(NEAR), self.window(radius));
        Evidence::new(&self.tools.measurements, near, window, &mut self.tools.scratch)
    }

    /// All cells on top of each other, where the last measurements found the lattice; those of `place` and this surface.
    pub(crate) fn fold(&mut self, surface: &Surface, place: (usize, usize)) -> Fold {
        let gain = self.tools.thin[place.0].1;
        let level = &self.view.levels[place.0];
        let cell = self.short_px(surface.depth) / level.scale;
        let t = &mut self.tools;
        t.folder.fold(level, &t.map, gain, &level.tiles[place.1], &t.measurements, cell)
    }

    /// A window about the optical axis, radius in px of an 848 x 480 px picture.
    pub(crate) fn window(&self, radius: f64) -> Window {
        Window { centre: self.view.centre, radius: radius * self.view.size }
    }

    /// Lock-in and fit with a window that grows about `centre`. The measurements left behind are those of the last pass, before its step.
    pub(crate) fn lock(&mut self, start: &Surface, schedule: &[(f64, Model)], seed: Seed) -> Option<Surface> {
        let (rough, fine) = schedule.split_at(schedule.len().saturating_sub(FINE));
        let surface = self.lock_on(self.coarse_scale_for(start.depth), start, rough, seed)?;
        self.lock_on(self.scale_for(surface.depth), &surface, fine, seed)
    }

    /// The same on a level and tiling.
    pub(crate) fn lock_on(
        &mut self,
        place: (usize, usize),
        start: &Surface,
        schedule: &[(f64, Model)],
        seed: Seed,
    ) -> Option<Surface> {
        let mut surface = *start;
        for &(radius, model) in schedule {
            let window = Window { centre: seed.centre, radius: radius * self.view.size };
            self.measure_comb(&surface, place, seed.looks, &window);
            self.observe_measured(&window);
            let t = &mut self.tools;
            surface = t.fitter.fit(&surface, model.parameters(), &t.observations, LOCKED, &self.prior, 2)?.surface;
        }
        Some(surface)
    }

    /// The last measurements as observations, weighted by a window.
    pub(crate) fn observe_measured(&mut self, window: &Window) {
        let t = &mut self.tools;
        t.observations.clear();
        for m in &t.measurements {
            let w = |f: usize| {
                if !m.good || m.snr[f] <= 3.0 {
                    return 0.0;
                }
                m.snr[f].min(LOUDEST)
                    * if m.empty { WEAK } else { 1.0 }
                    * window.weight(m.site.pixel)
                    * std::f64::consts::TAU.powi(2)
            };
            let s = |f: usize| m.predicted.s[f] + m.phase[f] / std::f64::consts::TAU;
            t.observations.push(Observation { site: m.site, s: [s(0), s(1)], weight: [w(0), 0.0, w(1)] });
        }
    }

    /// How to draw and compare a net at `depth` on `level`, high-passed for cells of `cell` px.
    pub(crate) fn drawing(&self, level: usize, cell: f64, polarity: [Polarity; 2], blur_px: f64) -> Drawing {
        let scale = self.view.levels[level].scale;
        // The average over a level's pixel adds its own blur.
        let own = (1.0 - 1.0 / (scale * scale)).max(0.0) / 12.0;
        Drawing {
            polarity,
            blur: ((blur_px / scale).powi(2) + own).sqrt(),
            offset: [0.0; 2],
            contrast_length: (36.0 * self.view.size).max(0.8 * cell) / scale,
            high_pass: self.view.high_pass_px(cell) / scale,
            sparse: false,
            quick: false,
        }
    }

    /// Best gain of the drawing over polarities and blurs (px), one block in four compared. Dark twine is the lattice half a cell off
    /// with the opposite sign: the lock-in cannot tell it from bright twine, the drawing can.
    pub(crate) fn gain(
        &mut self,
        surface: &Surface,
        level: usize,
        cell: f64,
        polarities: &[[Polarity; 2]],
        blurs: &[f64],
    ) -> (f64, [Polarity; 2], f64) {
        self.high(level, cell);
        let area = self.view.levels[level].scale.powi(2);
        let mut best = (f64::NEG_INFINITY, [Polarity::Bright; 2], 0.0);
        self.tools.map.fill(surface, &self.view.levels[level]);
        self.load_likelihood(level);
        for &blur in blurs {
            for &polarity in polarities {
                let mut drawing = self.drawing(level, cell, polarity, blur);
                drawing.sparse = true;
                drawing.offset = polarity.map(Polarity::offset);
                let t = &mut self.tools;
                let gain = t.likelihood.gain(
                    &t.map,
                    &drawing,
                    &self.view.levels[level].tiles[t.tiling],
                    &t.mask,
                    &mut t.smoother,
                ) * area;
                if gain > best.0 {
                    best = (gain, polarity, blur);
                }
            }
        }
        best
    }

    /// Makes sure that the likelihood has the high-passed picture of a level.
    pub(crate) fn load_likelihood(&mut self, level: usize) {
        let t = &mut self.tools;
        if t.loaded != Some(level) {
            t.loaded = Some(level);
            t.likelihood.load(&self.view.levels[level]);
        }
    }

    /// Refines on the drawing, of all blocks or one in four: one shift per tile and pass, the sheet fitted to those.
    pub(crate) fn likelihood(
        &mut self,
        surface: &Surface,
        lock: &Lock,
        model: Model,
        passes: usize,
        sparse: bool,
    ) -> Option<(Fit, Robust)> {
        let cell = self.cell_px(surface.depth);
        let level = self.view.level_for(self.short_px(surface.depth), lock.drawn_cell_px);
        let tiling = self.view.tiling_for(cell);
        self.high(level, cell);
        self.load_likelihood(level);
        let focus = self.window(lock.focus);
        let quick = lock.quick;
        let drawing = Drawing { sparse, quick, ..self.drawing(level, cell, lock.polarity, lock.blur) };
        let t = &mut self.tools;
        let view = &self.view.levels[level];
        let mut fit = None;
        let mut surface = *surface;
        for _ in 0..passes {
            t.map.fill(&surface, view);
            t.likelihood.observe(&surface, &t.map, &drawing, &view.tiles[tiling], &mut t.smoother, &mut t.observations);
            t.scratch.clear();
            t.scratch.extend(t.likelihood.shifts.iter().flatten().filter(|s| s.is_finite()).map(|s| s.abs()));
            let scale = (3.0 * 1.4826 * crate::numeric::median(&mut t.scratch)).max(0.01);
            let robust = Robust::Tile(scale);
            for o in &mut t.observations {
                let w = focus.weight(o.site.pixel);
                o.weight.iter_mut().for_each(|o| *o *= w);
            }
            let count = model.parameters();
            let done = if lock.quick {
                t.fitter.settle(&surface, count, &t.observations, robust, &self.prior)?
            } else {
                t.fitter.fit(&surface, count, &t.observations, robust, &self.prior, 2)?
            };
            surface = done.surface;
            fit = Some((done, robust));
        }
        fit
    }
}
