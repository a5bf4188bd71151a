//! Passes of a lock-in over the picture: sums along a sheet, what they say, and the sheet that fits it.

use crate::answer::decision::Evidence;
use crate::answer::fold::Fold;
use crate::lock::comb::{Comb, Looks};
use crate::lock::demodulate::demodulate;
use crate::lock::lockin::{Probe, measure};
use crate::lock::seed::Seed;
use crate::picture::window::Window;
use crate::sheet::fit::{Observation, Robust};
use crate::sheet::model::Model;
use crate::sheet::surface::Surface;
use crate::workspace::{Lock, Workspace};

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

impl Workspace {
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
            surface = t.fitter.fit_model(&surface, model, &t.observations, LOCKED, &self.prior, 2)?.surface;
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
}
