//! Cold start: candidates of the search locked to the picture, the best one's true cell, the model that the tiles support.

use net_geometry::nalgebra::{Rotation3, Vector3};

use crate::config::Config;
use crate::decision::Evidence;
use crate::estimate::LatticeEstimate;
use crate::fit::{Observation, Robust};
use crate::likelihood::Polarity;
use crate::lockin::Window;
use crate::model::{self, Model};
use crate::search;
use crate::stages::Stages;
use crate::surface::Surface;
use crate::workspace::{LOUDEST, Lock, SMALLEST_CELL, Workspace};

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
/// Candidates of the search that are locked to: at least the first number, more while none is coherent.
const CANDIDATES: (usize, usize) = (3, 8);

/// Tilt from which a lock-in is tried again, rad.
const OTHER: f64 = 0.16;

impl Workspace {
    pub(crate) fn cold(&mut self, config: &Config) -> Option<LatticeEstimate> {
        self.search();
        let mut locks = std::mem::take(&mut self.locks);
        locks.clear();
        for k in 0..self.candidates.len().min(CANDIDATES.1) {
            let c = self.candidates[k];
            if k >= CANDIDATES.0 && locks.iter().any(|l| l.evidence.v[0].min(l.evidence.v[1]) > 5.0) {
                break;
            }
            let start = Surface::flat(c.rotation, c.depth, c.angle, self.scope.sides);
            let mut seeded = start;
            let centre = self.seed(&mut seeded);
            let Some(surface) = self.lock(&seeded, &COLD, centre) else { continue };
            self.measure::<false>(&surface, self.scale_for(surface.depth), 1.0, &Window::ALL);
            let evidence = self.evidence();
            let level = self.view.level_for(self.short_px(surface.depth), 12.0);
            let cell = self.cell_px(surface.depth);
            let (gain, polarity, blur) = self.gain(&surface, level, cell, &Polarity::BOTH, &[1.2]);
            locks.push(Lock { surface, start, centre, evidence, gain, polarity, blur });
            // Nearly every tile agrees: other candidates could only be other periods, which are tested below.
            let coherence = evidence.v[0].min(evidence.v[1]) / f64::sqrt(2.0 * evidence.tiles.max(1) as f64);
            if coherence > 0.8 && evidence.good > 0.9 {
                break;
            }
        }
        let lock = self.best_lock(&mut locks);
        self.locks = locks;
        let lock = lock?;
        let lock = self.elsewhere(lock);
        let (lock, margin) = self.true_cell(lock)?;
        self.stages = Some(Stages::new(&lock.start, &lock.surface));
        self.finish(config, lock, margin)
    }
    fn search(&mut self) {
        let (found, refined) = (&mut self.found, &mut self.candidates);
        refined.clear();
        for (bank, search) in &mut self.banks {
            self.spectra.compute(&self.view, bank, &mut self.tools.smoother);
            found.clear();
            search.run(bank, &self.scope, 3, found);
            let scale = self.view.levels[bank.level].scale;
            found.iter_mut().for_each(|c| *c = search::refine(bank, scale, &self.scope, c));
            let range = search.depths_m(self.scope.sides[0]);
            search::add_rivals(bank, scale, &self.scope, range, found);
            refined.append(found);
        }
        search::distinct(refined);
    }

    /// Gain decides between periods, coherence between candidates of the same period: a cycle slip at the rim costs coherence, hardly gain.
    fn best_lock(&self, locks: &mut [Lock]) -> Option<Lock> {
        let v = |l: &Lock| l.evidence.v[0].abs().min(l.evidence.v[1].abs());
        let score = |l: &Lock| l.gain * if v(l) > 3.5 { 1.0 } else { 0.05 };
        locks.sort_by(|a, b| score(b).total_cmp(&score(a)));
        let top = *locks.first()?;
        let same =
            locks.iter().filter(|l| (l.surface.depth / top.surface.depth).ln().abs() < 0.06 && l.gain > 0.6 * top.gain);
        let coherence = |l: &Lock| v(l) + 0.25 * (l.evidence.v[0].abs() + l.evidence.v[1].abs());
        same.max_by(|a, b| coherence(a).total_cmp(&coherence(b))).copied()
    }

    /// Locks again from other tilts about the one found, and keeps what agrees best. Bent sheets have more than one tilt from which the phases
    /// settle, a cycle apart at the rim; all but one of them leave tiles behind.
    fn elsewhere(&mut self, mut best: Lock) -> Lock {
        let all = |e: &Evidence| f64::sqrt(2.0 * e.tiles.max(1) as f64);
        if best.evidence.v[0].min(best.evidence.v[1]) > 0.9 * all(&best.evidence) {
            return best;
        }
        let first = best;
        let mut top = self.agreement(&first.surface).0;
        if let Some(surface) = self.counted_out(&first) {
            let (score, evidence) = self.agreement(&surface);
            if score > top {
                top = score;
                best = Lock { surface, evidence, ..first };
            }
        }
        for (x, y) in [(0.0, 0.0), (OTHER, 0.0), (-OTHER, 0.0), (0.0, OTHER), (0.0, -OTHER)] {
            let turn = Rotation3::new(Vector3::new(x, y, 0.0)).into_inner();
            let s = &first.surface;
            let rotation = turn * s.rotation;
            if rotation[(2, 2)] < 0.3 {
                continue;
            }
            let mut start = Surface::flat(rotation, s.depth, s.angle, s.sides);
            let centre = self.seed(&mut start);
            let Some(surface) = self.lock(&start, &COLD, centre) else { continue };
            if (surface.depth / first.surface.depth).ln().abs() > 0.06 {
                continue;
            }
            let (score, evidence) = self.agreement(&surface);
            if score > top {
                top = score;
                best = Lock { surface, centre, evidence, ..first };
            }
        }
        best
    }

    /// The sheet fitted to phases whose whole cycles are counted from tile to tile, and locked again.
    fn counted_out(&mut self, lock: &Lock) -> Option<Surface> {
        let place = self.scale_for(lock.surface.depth);
        self.measure::<false>(&lock.surface, place, 1.0, &Window::ALL);
        let t = &mut self.tools;
        t.unwrapper.run(&t.measurements, self.view.levels[place.0].tiles[place.1].nx);
        t.observations.clear();
        for (m, cycles) in t.measurements.iter().zip(&t.unwrapper.cycles) {
            let cycles = cycles.filter(|_| !m.empty);
            let w = |f: usize| cycles.map_or(0.0, |_| m.snr[f].min(LOUDEST) * std::f64::consts::TAU.powi(2));
            let c = cycles.unwrap_or_default();
            let s = [m.predicted.s[0] + c[0], m.predicted.s[1] + c[1]];
            t.observations.push(Observation { site: m.site, s, weight: [w(0), 0.0, w(1)] });
        }
        let robust = Robust::Family(0.25);
        let fit = t.fitter.fit(&lock.surface, Model::Quartic.parameters(), &t.observations, robust, &self.prior, 5)?;
        self.lock(&fit.surface, &COLD[5..], lock.centre)
    }

    /// How well the tiles agree with a locked sheet, in both harmonics; the second is never fitted.
    fn agreement(&mut self, surface: &Surface) -> (f64, Evidence) {
        self.measure::<true>(surface, self.scale_for(surface.depth), 1.0, &Window::ALL);
        let e = self.evidence();
        // Range and normal are claimed on the axis: what agrees there counts twice.
        let harmonics = e.v[0].min(e.v[1]) + e.v2[0].abs().min(e.v2[1].abs());
        (harmonics * (1.0 + e.good_near), e)
    }

    /// Tests the rival periods; returns the best, and the share of its gain by which the second falls short.
    fn true_cell(&mut self, lock: Lock) -> Option<(Lock, f64)> {
        let cell = self.short_px(lock.surface.depth);
        let span = 0.95 * (self.view.levels[0].raw.height() * self.view.reduction) as f64 / 3.0;
        let smallest = SMALLEST_CELL * 0.9 * self.view.reduction as f64;
        let possible = |m: &f64| *m == 1.0 || (cell / m > smallest && cell / m < span);
        let (first, last) = (RIVALS.into_iter().find(possible)?, RIVALS.into_iter().rev().find(possible)?);
        let widest = self.cell_px(lock.surface.depth * first);
        let level = self.view.level_for(cell / last, 6.0);
        // The best and the second of them by gain, with the rival's period.
        let mut best: Option<(f64, f64, Lock)> = None;
        let (mut second, mut tested) = (0.0, 0);
        let (_, _, blur) = self.gain(&lock.surface, level, widest, &[lock.polarity], &[0.76, 1.5, 2.8]);
        for m in RIVALS.into_iter().filter(possible) {
            let mut centre = lock.centre;
            let surface = if m == 1.0 {
                lock.surface
            } else {
                let mut start = lock.surface.scaled(m);
                centre = self.seed(&mut start);
                let Some(s) = self.lock(&start, &RIVAL, centre) else { continue };
                let v = self.evidence().v;
                // Waves of that period are not there at all.
                if v[0].min(v[1]) < 1.0 {
                    continue;
                }
                s
            };
            let (gain, polarity, blur) = self.gain(&surface, level, widest, &Polarity::BOTH, &[blur]);
            // A lattice of which only every second or third line is there draws most of the picture, too.
            let place = (level, self.view.tiling_for(self.cell_px(surface.depth)));
            self.measure::<false>(&surface, place, 1.0, &Window::ALL);
            let all_there = 1.0 - (2.0 * self.fold(&surface, place).unlike).min(1.0);
            let worth = gain * if gain > 0.0 { all_there } else { 1.0 };
            let rival = Lock { surface, start: lock.start.scaled(m), centre, gain, polarity, blur, ..lock };
            match &best {
                Some((top, ..)) if worth <= *top => second = if tested == 1 { worth } else { f64::max(second, worth) },
                before => {
                    second = before.as_ref().map_or(0.0, |b| b.0);
                    best = Some((worth, m, rival));
                }
            }
            tested += 1;
        }
        let (gain, m, mut best) = best?;
        if m != 1.0
            && let Some(s) = self.lock(&best.surface, &COLD[2..], best.centre)
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

    /// Refines a lock on the drawing, chooses the model, and says what is known of the result.
    fn finish(&mut self, config: &Config, lock: Lock, margin: f64) -> Option<LatticeEstimate> {
        let mut surface = lock.surface;
        let mut model = Model::Bent;
        if let Some((fit, _)) = self.likelihood(&surface, &lock, model, 3) {
            surface = fit.surface;
            let t = &mut self.tools;
            if let Some(choice) =
                model::choose(&mut t.fitter, &surface, &t.observations, &self.prior, Model::Bent, &mut t.scratch)
            {
                surface = choice.fit.surface;
                model = choice.model;
            }
        }
        self.conclude(config, &surface, &lock, model, 2, margin, None)
    }
}
