use net_geometry::nalgebra::Vector3;
use net_geometry::{Camera, Mesh, Plane, Pose};
use net_image::GrayView;

use crate::config::Config;
use crate::covariance;
use crate::decision::Evidence;
use crate::error::Result;
use crate::estimate::{Followed, Labels, LatticeEstimate};
use crate::fit::{Fit, Fitter, Observation, Prior, Robust};
use crate::fold::Folder;
use crate::likelihood::{Drawing, Likelihood, Polarity};
use crate::lockin::{Measurement, TileSum, Window, demodulate, measure};
use crate::map::PhaseMap;
use crate::model::{self, Model};
use crate::numeric::magnitude_quantile;
use crate::search::{self, Candidate, Scope, Search};
use crate::smooth::Smoother;
use crate::spectra::{Bank, Spectra};
use crate::surface::{self, Params, Surface};
use crate::view::View;

/// Windows of a cold lock-in, px of an 848 x 480 px picture, and the model that may move in each. The growth is the unwrapping.
const COLD: [(f64, Model); 7] = [
    (90.0, Model::Rhomb),
    (160.0, Model::Rhomb),
    (250.0, Model::Quadratic),
    (400.0, Model::Cubic),
    (700.0, Model::Quartic),
    (2000.0, Model::Quartic),
    (2000.0, Model::Quartic),
];
/// The short lock-in of a rival period.
const RIVAL: [(f64, Model); 2] = [(110.0, Model::Rhomb), (250.0, Model::Quadratic)];
/// Rival depths: scaling depth by m scales every phase by m.
const RIVALS: [f64; 9] = [0.25, 1.0 / 3.0, 0.5, 2.0 / 3.0, 1.0, 1.5, 2.0, 3.0, 4.0];
/// Weight of a tile in which next to nothing is.
const WEAK: f64 = 0.05;
/// Distance over which residuals of small tiles may be alike, px of an 848 x 480 px picture: three tiles.
const REACH: f64 = 160.0;
/// Candidates of the search that are locked to: at least the first number, more while none is coherent.
const CANDIDATES: (usize, usize) = (3, 8);
/// Smallest cell, full-resolution px on the axis, that is looked for.
const SMALLEST_CELL: f64 = 3.7;

/// Finds a net in single pictures, and follows it.
///
/// Owns every plan and buffer. One estimator per camera and mesh.
#[derive(Debug)]
pub struct LatticeEstimator {
    camera: Camera,
    mesh: Mesh,
    config: Config,
    /// `None` when the picture is too small for a lattice.
    work: Option<Workspace>,
}

#[derive(Debug)]
struct Workspace {
    view: View,
    banks: Vec<(Bank, Search)>,
    spectra: Spectra,
    tools: Tools,
    scope: Scope,
    prior: Prior,
    candidates: Vec<Candidate>,
    /// Twine diameter, m.
    twine: f64,
    /// What the next picture starts from.
    last: Option<Followed>,
}

/// Buffers that the stages share.
#[derive(Debug, Default)]
struct Tools {
    smoother: Smoother,
    map: PhaseMap,
    sums: Vec<TileSum>,
    measurements: Vec<Measurement>,
    observations: Vec<Observation>,
    fitter: Fitter,
    likelihood: Likelihood,
    histogram: Vec<u32>,
    scratch: Vec<f64>,
    scores: Vec<(usize, Params)>,
    folder: Folder,
    /// What `high` of each level holds: filter length, and the gain of the lock-in.
    high: [(f64, f32); 4],
}

/// A locked candidate.
#[derive(Debug, Clone, Copy)]
struct Lock {
    surface: Surface,
    evidence: Evidence,
    gain: f64,
    polarity: Polarity,
    blur: f64,
}

impl LatticeEstimator {
    /// Plans for one camera and mesh.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] names what is wrong in the configuration.
    pub fn new(camera: &Camera, mesh: &Mesh, config: &Config) -> Result<Self> {
        config.validate()?;
        let work = View::new(camera, config.working_pixels).map(|view| Workspace::new(camera, mesh, config, view));
        Ok(Self { camera: *camera, mesh: *mesh, config: config.clone(), work })
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Cold start: the net in one picture. `None` when nothing periodic was found at all; otherwise act on it only from
    /// [`Config::probability_threshold`] on.
    ///
    /// # Errors
    /// [`crate::Error::Geometry`] when the picture's size is not the camera's.
    pub fn estimate(&mut self, image: GrayView<'_>) -> Result<Option<LatticeEstimate>> {
        self.camera.check_image_size(image.width() as u32, image.height() as u32)?;
        let Some(work) = &mut self.work else { return Ok(None) };
        work.load(image);
        let found = work.cold(&self.config);
        work.last = found.as_ref().map(LatticeEstimate::followed);
        Ok(found)
    }

    /// The net in the next picture of a sequence, from where it was in the last one and the pose that is `predicted` for this one (net to
    /// camera; a constant-velocity prediction or the vehicle's own motion). The lattice is followed: the origin stays the node it was, so
    /// long as the prediction is off by less than half a cell across the picture's middle. `None` without a last picture, or when the net
    /// left the view; a low probability says that it was lost. Then start anew with [`LatticeEstimator::estimate`].
    ///
    /// # Errors
    /// [`crate::Error::Geometry`] when the picture's size is not the camera's.
    pub fn update(&mut self, image: GrayView<'_>, predicted: &Pose) -> Result<Option<LatticeEstimate>> {
        self.camera.check_image_size(image.width() as u32, image.height() as u32)?;
        let Some(work) = &mut self.work else { return Ok(None) };
        work.load(image);
        let found = work.follow(&self.config, predicted);
        work.last = found.as_ref().map(LatticeEstimate::followed);
        Ok(found)
    }

    /// Follows `estimate` in the next [`Self::update`]: for a caller that changed its names, see [`LatticeEstimate::counted_on`].
    pub fn follow_on(&mut self, estimate: &LatticeEstimate) {
        if let Some(work) = &mut self.work {
            work.last = Some(estimate.followed());
        }
    }

    /// Forgets the last picture.
    pub fn reset(&mut self) {
        if let Some(work) = &mut self.work {
            work.last = None;
        }
    }
}

impl Workspace {
    fn new(camera: &Camera, mesh: &Mesh, config: &Config, view: View) -> Self {
        let mut banks = Vec::new();
        let reduction = view.reduction as f64;
        // Tiles of 160 px for cells up to 60 px, of 360 px for those up to 136 px (848 x 480 px).
        for (half, length, columns, rows, smooth) in [(0, 160.0, 9, 5, 25.0), (1, 360.0, 5, 2, 60.0)] {
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
        Self {
            scope: Scope {
                sides: [mesh.side1(), mesh.side2()],
                angle: mesh.angle(),
                angle_sigma: config.crossing_angle_sigma_deg.to_radians(),
            },
            prior: Prior { sigma: surface::prior(config), angle: mesh.angle() },
            banks,
            spectra: Spectra::new(),
            tools: Tools::default(),
            candidates: Vec::new(),
            twine: config.twine_diameter_m,
            last: None,
            view,
        }
    }

    fn load(&mut self, image: GrayView<'_>) {
        self.view.load(image);
        self.tools.high = [(0.0, 0.0); 4];
    }

    /// Full-resolution px of a cell (geometric mean of the sides) on the axis.
    fn cell_px(&self, depth: f64) -> f64 {
        self.view.focal * (self.scope.sides[0] * self.scope.sides[1]).sqrt() / depth
    }

    /// The shorter side in full-resolution px.
    fn short_px(&self, depth: f64) -> f64 {
        self.view.focal * self.scope.sides[0].min(self.scope.sides[1]) / depth
    }

    /// Makes sure that `high` of a level is filtered for cells of `cell` px; returns the lock-in's gain.
    fn high(&mut self, level: usize, cell: f64) -> f32 {
        let sigma = self.view.high_pass_px(cell);
        let t = &mut self.tools;
        if (t.high[level].0 / sigma - 1.0).abs() > 0.02 {
            self.view.high_pass(level, sigma, &mut t.smoother);
            let high = self.view.levels[level].high.data();
            let q = magnitude_quantile(high.iter().copied(), 0.97, &mut t.histogram);
            t.high[level] = (sigma, 1.0 / (q + 1e-9));
        }
        t.high[level].1
    }

    /// Level and tiling of the lock-in for a depth.
    fn scale_for(&self, depth: f64) -> (usize, usize) {
        (self.view.level_for(self.short_px(depth), 12.0), self.view.tiling_for(self.cell_px(depth)))
    }

    /// One lock-in at the predicted sheet.
    fn measure<const SECOND: bool>(&mut self, surface: &Surface, place: (usize, usize), sign: f64, window: &Window) {
        let gain = self.high(place.0, self.cell_px(surface.depth));
        let t = &mut self.tools;
        let level = &self.view.levels[place.0];
        t.map.fill(surface, level);
        demodulate::<SECOND>(level, place.1, &t.map, gain, window, &mut t.sums);
        measure(surface, &self.view, place, sign, gain, &t.sums, &mut t.scratch, &mut t.measurements);
    }

    /// A window about the optical axis, radius in px of an 848 x 480 px picture.
    fn window(&self, radius: f64) -> Window {
        Window { centre: self.view.centre, radius: radius * self.view.size }
    }

    /// Lock-in and fit with a growing window. The measurements left behind are those of the last pass, before its step.
    fn lock(&mut self, start: &Surface, schedule: &[(f64, Model)], fresh: bool) -> Option<Surface> {
        let mut surface = *start;
        let place = self.scale_for(surface.depth);
        if fresh {
            surface.offset = [0.0; 2];
            let window = self.window(110.0);
            self.measure::<false>(&surface, (place.0, 0), 1.0, &window);
            for f in 0..2 {
                let mut sum = [0.0; 2];
                for m in self.tools.measurements.iter().filter(|m| m.good) {
                    let w = window.weight(m.site.pixel);
                    sum[0] += w * m.z[f][0];
                    sum[1] += w * m.z[f][1];
                }
                surface.offset[f] = sum[1].atan2(sum[0]) / std::f64::consts::TAU;
            }
        }
        for &(radius, model) in schedule {
            let window = self.window(radius);
            self.measure::<false>(&surface, place, 1.0, &window);
            let t = &mut self.tools;
            t.observations.clear();
            for m in &t.measurements {
                let w = |f: usize| {
                    if !m.good || m.snr[f] <= 3.0 {
                        return 0.0;
                    }
                    m.snr[f].min(60.0)
                        * if m.empty { WEAK } else { 1.0 }
                        * window.weight(m.site.pixel)
                        * std::f64::consts::TAU.powi(2)
                };
                let s = |f: usize| m.predicted.s[f] + m.phase[f] / std::f64::consts::TAU;
                t.observations.push(Observation { site: m.site, s: [s(0), s(1)], weight: [w(0), 0.0, w(1)] });
            }
            let robust = Robust::Family(0.6 / std::f64::consts::TAU);
            surface = t.fitter.fit(&surface, model.parameters(), &t.observations, robust, &self.prior, 2)?.surface;
        }
        Some(surface)
    }

    /// How to draw and compare a net at `depth` on `level`, high-passed for cells of `cell` px.
    fn drawing(&self, level: usize, cell: f64, polarity: Polarity, blur_px: f64) -> Drawing {
        let scale = self.view.levels[level].scale;
        // The average over a level's pixel adds its own blur.
        let own = (1.0 - 1.0 / (scale * scale)).max(0.0) / 12.0;
        Drawing {
            polarity,
            blur: ((blur_px / scale).powi(2) + own).sqrt(),
            offset: 0.0,
            contrast_length: (36.0 * self.view.size).max(0.8 * cell) / scale,
            high_pass: self.view.high_pass_px(cell) / scale,
            sparse: false,
        }
    }

    /// Best gain of the drawing over polarities and blurs (px), every second block compared. Dark twine is the lattice half a cell off
    /// with the opposite sign: the lock-in cannot tell it from bright twine, the drawing can.
    fn gain(
        &mut self,
        surface: &Surface,
        level: usize,
        cell: f64,
        polarities: &[Polarity],
        blurs: &[f64],
    ) -> (f64, Polarity, f64) {
        self.high(level, cell);
        let area = self.view.levels[level].scale.powi(2);
        let mut best = (f64::NEG_INFINITY, Polarity::Bright, 0.0);
        self.tools.map.fill(surface, &self.view.levels[level]);
        self.tools.likelihood.load(&self.view.levels[level]);
        self.tools.likelihood.set_widths(self.scope.sides.map(|s| self.twine / s));
        for &blur in blurs {
            for &polarity in polarities {
                let mut drawing = self.drawing(level, cell, polarity, blur);
                drawing.sparse = true;
                drawing.offset = if polarity == Polarity::Dark { 0.5 } else { 0.0 };
                let t = &mut self.tools;
                let gain = t.likelihood.gain(&t.map, &drawing, &mut t.smoother) * area;
                if gain > best.0 {
                    best = (gain, polarity, blur);
                }
            }
        }
        best
    }

    fn cold(&mut self, config: &Config) -> Option<LatticeEstimate> {
        self.search();
        let mut locks: Vec<Lock> = Vec::new();
        for k in 0..self.candidates.len().min(CANDIDATES.1) {
            let c = self.candidates[k];
            if k >= CANDIDATES.0 && locks.iter().any(|l| l.evidence.v[0].min(l.evidence.v[1]) > 5.0) {
                break;
            }
            let start = Surface::flat(c.rotation, c.depth, c.angle, self.scope.sides);
            let Some(surface) = self.lock(&start, &COLD, true) else { continue };
            self.measure::<false>(&surface, self.scale_for(surface.depth), 1.0, &Window::ALL);
            let evidence = Evidence::new(&self.tools.measurements);
            let level = self.view.level_for(self.short_px(surface.depth), 12.0);
            let cell = self.cell_px(surface.depth);
            let (gain, polarity, blur) = self.gain(&surface, level, cell, &Polarity::BOTH, &[1.2]);
            locks.push(Lock { surface, evidence, gain, polarity, blur });
            // Nearly every tile agrees: other candidates could only be other periods, which are tested below.
            let coherence = evidence.v[0].min(evidence.v[1]) / f64::sqrt(2.0 * evidence.tiles.max(1) as f64);
            if coherence > 0.8 && evidence.good > 0.9 {
                break;
            }
        }
        let lock = self.best_lock(locks)?;
        let (lock, margin) = self.true_cell(lock)?;
        self.finish(config, lock, margin)
    }

    /// The sheet of the last picture, moved as predicted, locked and refined.
    fn follow(&mut self, config: &Config, predicted: &Pose) -> Option<LatticeEstimate> {
        let last = self.last?;
        let turn = predicted.rotation * last.pose.rotation.inverse();
        let shift = predicted.translation - turn * last.pose.translation;
        let start = last.surface.seen_from(turn.matrix(), &shift)?;
        // Half a cell lies between the lock-in's zero and dark twine's drawing.
        let half = if last.polarity == Polarity::Dark { 0.5 } else { 0.0 };
        let mut surface = start;
        surface.offset = start.offset.map(|o| o - half);
        let model = last.model.max(Model::Rhomb);
        surface = self.lock(&surface, &[(250.0, Model::Rhomb), (2000.0, model)], false)?;
        surface.offset = surface.offset.map(|o| o + half);
        let lock = Lock {
            surface,
            evidence: last.evidence,
            gain: last.gain * self.view.levels[0].raw.data().len() as f64,
            polarity: last.polarity,
            blur: last.blur,
        };
        self.conclude(config, &surface, &lock, last.model, 1, last.margin, Some(last.labels))
    }

    fn search(&mut self) {
        let mut found = Vec::new();
        let mut refined: Vec<Candidate> = Vec::new();
        for (bank, search) in &mut self.banks {
            self.spectra.compute(&self.view, bank, &mut self.tools.smoother);
            found.clear();
            search.run(bank, &self.scope, 6, &mut found);
            let scale = self.view.levels[bank.level].scale;
            found.iter_mut().for_each(|c| *c = search::refine(bank, scale, &self.scope, c));
            let range = search.depths_m(self.scope.sides[0]);
            search::add_rivals(bank, scale, &self.scope, range, &mut found);
            refined.append(&mut found);
        }
        search::distinct(&mut refined);
        self.candidates = refined;
    }

    /// Gain decides between periods, coherence between candidates of the same period: a cycle slip at the rim costs coherence, hardly gain.
    fn best_lock(&self, mut locks: Vec<Lock>) -> Option<Lock> {
        let v = |l: &Lock| l.evidence.v[0].abs().min(l.evidence.v[1].abs());
        let score = |l: &Lock| l.gain * if v(l) > 3.5 { 1.0 } else { 0.05 };
        locks.sort_by(|a, b| score(b).total_cmp(&score(a)));
        let top = *locks.first()?;
        let same =
            locks.iter().filter(|l| (l.surface.depth / top.surface.depth).ln().abs() < 0.06 && l.gain > 0.6 * top.gain);
        let coherence = |l: &Lock| v(l) + 0.25 * (l.evidence.v[0].abs() + l.evidence.v[1].abs());
        same.max_by(|a, b| coherence(a).total_cmp(&coherence(b))).copied()
    }

    /// Tests the rival periods; returns the best, and the share of its gain by which the second falls short.
    fn true_cell(&mut self, lock: Lock) -> Option<(Lock, f64)> {
        let cell = self.short_px(lock.surface.depth);
        let span = 0.95 * (self.view.levels[0].raw.height() * self.view.reduction) as f64 / 3.0;
        let possible =
            |m: &f64| *m == 1.0 || (cell / m > SMALLEST_CELL * 0.9 * self.view.reduction as f64 && cell / m < span);
        let rivals: Vec<f64> = RIVALS.into_iter().filter(possible).collect();
        let (first, last) = (*rivals.first()?, *rivals.last()?);
        let widest = self.cell_px(lock.surface.depth * first);
        let level = self.view.level_for(cell / last, 6.0);
        let mut all: Vec<(f64, f64, Lock)> = Vec::new();
        let (_, _, blur) = self.gain(&lock.surface, level, widest, &[lock.polarity], &[0.76, 1.5, 2.8]);
        for m in rivals {
            let surface = if m == 1.0 {
                lock.surface
            } else {
                let Some(s) = self.lock(&lock.surface.scaled(m), &RIVAL, true) else { continue };
                let v = Evidence::new(&self.tools.measurements).v;
                // Waves of that period are not there at all.
                if v[0].min(v[1]) < 1.0 {
                    continue;
                }
                s
            };
            let (gain, polarity, blur) = self.gain(&surface, level, widest, &Polarity::BOTH, &[blur]);
            // A lattice of which only every second or third line is there draws most of the picture, too.
            let scale = self.view.levels[level].scale;
            let (short, t) = (self.short_px(surface.depth) / scale, &mut self.tools);
            let fold = t.folder.fold(&self.view.levels[level], &t.map, t.high[level].1, short);
            let all_there = 1.0 - (2.0 * fold.unlike).min(1.0);
            all.push((
                gain * if gain > 0.0 { all_there } else { 1.0 },
                m,
                Lock { surface, gain, polarity, blur, ..lock },
            ));
        }
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (gain, m, mut best) = *all.first()?;
        let second = all.get(1).map_or(0.0, |a| a.0);
        if m != 1.0
            && let Some(s) = self.lock(&best.surface, &COLD[2..], false)
        {
            best.surface = s;
        }
        if best.polarity == Polarity::Dark {
            best.surface.offset.iter_mut().for_each(|o| *o += 0.5);
        }
        self.seat_families(&mut best, level, widest);
        Some((best, (gain - second) / gain.abs().max(1e-9)))
    }

    /// One family can sit half a cell off when the other decided the polarity: the drawing tells.
    fn seat_families(&mut self, best: &mut Lock, level: usize, widest: f64) {
        self.high(level, widest);
        let mut drawing = self.drawing(level, widest, best.polarity, best.blur);
        drawing.sparse = true;
        let mut top = (f64::NEG_INFINITY, best.surface);
        for shift in [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]] {
            let mut surface = best.surface;
            surface.offset[0] += shift[0];
            surface.offset[1] += shift[1];
            let t = &mut self.tools;
            t.map.fill(&surface, &self.view.levels[level]);
            let gain = t.likelihood.gain(&t.map, &drawing, &mut t.smoother);
            if gain > top.0 {
                top = (gain, surface);
            }
        }
        best.surface = top.1;
    }

    /// Refines on the drawing: one shift per tile and pass, the sheet fitted to those.
    fn likelihood(&mut self, surface: &Surface, lock: &Lock, model: Model, passes: usize) -> Option<(Fit, Robust)> {
        let cell = self.cell_px(surface.depth);
        let level = self.view.level_for(self.short_px(surface.depth), 20.0);
        let tiling = self.view.tiling_for(cell);
        self.high(level, cell);
        let drawing = self.drawing(level, cell, lock.polarity, lock.blur);
        let t = &mut self.tools;
        let view = &self.view.levels[level];
        t.likelihood.load(view);
        t.likelihood.set_widths(self.scope.sides.map(|s| self.twine / s));
        let mut fit = None;
        let mut surface = *surface;
        for _ in 0..passes {
            t.map.fill(&surface, view);
            t.likelihood.observe(&surface, &t.map, &drawing, &view.tiles[tiling], &mut t.smoother, &mut t.observations);
            let mut shifts: Vec<f64> =
                t.likelihood.shifts.iter().flatten().filter(|s| s.is_finite()).map(|s| s.abs()).collect();
            let scale = (3.0 * 1.4826 * crate::numeric::median(&mut shifts)).max(0.01);
            let robust = Robust::Tile(scale);
            let done = t.fitter.fit(&surface, model.parameters(), &t.observations, robust, &self.prior, 2)?;
            surface = done.surface;
            fit = Some((done, robust));
        }
        fit
    }

    /// Refines a lock on the drawing, chooses the model, and says what is known of the result.
    fn finish(&mut self, config: &Config, lock: Lock, margin: f64) -> Option<LatticeEstimate> {
        let mut surface = lock.surface;
        let mut model = Model::Bent;
        if let Some((fit, _)) = self.likelihood(&surface, &lock, model, 3) {
            surface = fit.surface;
            let t = &mut self.tools;
            if let Some(choice) = model::choose(&mut t.fitter, &surface, &t.observations, &self.prior, Model::Bent) {
                surface = choice.fit.surface;
                model = choice.model;
            }
        }
        self.conclude(config, &surface, &lock, model, 2, margin, None)
    }

    /// Last passes on the drawing with the chosen model, evidence, covariance, and the result in the net frame.
    fn conclude(
        &mut self,
        config: &Config,
        surface: &Surface,
        lock: &Lock,
        model: Model,
        passes: usize,
        margin: f64,
        labels: Option<Labels>,
    ) -> Option<LatticeEstimate> {
        let (fit, robust) = self.likelihood(surface, lock, model, passes)?;
        let surface = fit.surface;
        let labels = labels.unwrap_or_else(|| cold_labels(&surface));
        let count = model.parameters();
        let reach =
            REACH * self.view.size * if self.view.tiling_for(self.cell_px(surface.depth)) == 1 { 2.0 } else { 1.0 };
        let t = &mut self.tools;
        let scale = model::robust_scale(&t.fitter.whitened(&t.observations));
        let c = covariance::parameters(
            &t.fitter,
            &surface,
            &t.observations,
            robust,
            &fit.covariance,
            count,
            scale,
            config.side_ratio_sigma,
            reach,
            &mut t.scores,
        );
        let errors = covariance::pose(&surface, &labels, &c, count);
        let place = self.scale_for(surface.depth);
        self.measure::<true>(&surface, place, f64::from(lock.polarity.sign()), &Window::ALL);
        let evidence = Evidence::new(&self.tools.measurements).near(&self.tools.measurements, self.window(220.0));
        let mean_plane = self.mean_plane(&surface);
        let cell = self.short_px(surface.depth) / self.view.levels[place.0].scale;
        let t = &mut self.tools;
        let evidence = evidence.folded(t.folder.fold(&self.view.levels[place.0], &t.map, t.high[place.0].1, cell));
        let evidence = evidence.bent_by(mean_plane.normal.angle(&surface.normal()));
        let odd = labels.turns % 2 == 1;
        Some(LatticeEstimate {
            pose: labels.pose(&surface),
            covariance: errors.pose,
            range: surface.depth,
            range_sigma: errors.range,
            tilt_sigma: errors.tilt,
            xy_sigma: errors.xy,
            mean_plane,
            crossing_angle: if odd { std::f64::consts::PI - surface.angle } else { surface.angle },
            crossing_angle_sigma: errors.angle,
            curvatures: curvatures(&surface),
            sides: if odd { [surface.sides[1], surface.sides[0]] } else { surface.sides },
            probability: evidence.probability(errors.tilt),
            evidence,
            gain: lock.gain / (self.view.levels[0].raw.data().len() as f64),
            margin,
            model,
            polarity: lock.polarity,
            blur: lock.blur,
            surface,
            labels,
        })
    }

    /// Mean plane of the sheet within 220 px (848 x 480 px) of the axis.
    fn mean_plane(&self, surface: &Surface) -> Plane {
        let tangent = Plane { normal: surface.normal(), distance: surface.depth * surface.rotation[(2, 2)] };
        if surface.height.iter().all(|c| *c == 0.0) {
            return tangent;
        }
        let chart = surface.chart();
        let mut points: Vec<Vector3<f64>> = Vec::new();
        for site in &self.view.levels[0].tiles[0].sites {
            let (u, v) = (site.pixel[0] - self.view.centre[0], site.pixel[1] - self.view.centre[1]);
            if !site.valid || u.hypot(v) > 220.0 * self.view.size {
                continue;
            }
            if let Some(p) = chart.at(site.ray[0], site.ray[1]) {
                points.push(Vector3::new(site.ray[0], site.ray[1], 1.0) * p.depth);
            }
        }
        if points.len() < 6 {
            return tangent;
        }
        let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        let mut scatter = net_geometry::nalgebra::Matrix3::zeros();
        for p in &points {
            scatter += (p - mean) * (p - mean).transpose();
        }
        let eigen = scatter.symmetric_eigen();
        let mut normal: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        if normal.z < 0.0 {
            normal = -normal;
        }
        Plane { normal, distance: normal.dot(&mean) }
    }
}

/// X nearest to the image's u axis, origin at the node nearest to the optical axis.
fn cold_labels(surface: &Surface) -> Labels {
    let d = 0.5 * (std::f64::consts::FRAC_PI_2 - surface.angle);
    let (sd, cd) = d.sin_cos();
    let (e1, e2) = (surface.rotation.column(0), surface.rotation.column(1));
    let u1 = e1[0] * cd + e2[0] * sd;
    let u2 = e1[0] * sd + e2[0] * cd;
    let turns = if u1.abs() >= u2.abs() {
        if u1 >= 0.0 { 0 } else { 2 }
    } else if u2 >= 0.0 {
        1
    } else {
        3
    };
    // In a rhomb the nearest node need not be the one whose coordinates round to it.
    let base = [surface.offset[0].round(), surface.offset[1].round()];
    let mut best = (f64::INFINITY, base);
    for i in -1..=1 {
        for j in -1..=1 {
            let node = [base[0] + f64::from(i), base[1] + f64::from(j)];
            let p = (node[0] - surface.offset[0]) * surface.sides[0];
            let q = (node[1] - surface.offset[1]) * surface.sides[1];
            let distance = p * p + q * q + 2.0 * p * q * surface.angle.cos();
            if distance < best.0 - 1e-15 {
                best = (distance, node);
            }
        }
    }
    Labels { turns, origin: best.1 }
}

/// Principal curvatures on the axis, larger magnitude first. The normal points away from the camera, so a positive height is farther away.
fn curvatures(surface: &Surface) -> [f64; 2] {
    let [a, b, c] = [surface.height[0], surface.height[1], surface.height[2]];
    let mean = 0.5 * (a + c);
    let half = (0.25 * (a - c) * (a - c) + b * b).sqrt();
    let (p, q) = (mean + half, mean - half);
    if p.abs() >= q.abs() { [p, q] } else { [q, p] }
}
