//! The next picture of a sequence: the last sheet moved as predicted, locked to and refined.

use net_geometry::Pose;

use crate::answer::estimate::LatticeEstimate;
use crate::config::Config;
use crate::lock::passes::LOCKED;
use crate::lock::seed::Seed;
use crate::picture::smooth::Smoother;
use crate::picture::window::Window;
use crate::sheet::chart::Chart;
use crate::sheet::fit::Robust;
use crate::sheet::model::Model;
use crate::sheet::surface::Surface;
use crate::start::bumps::WAVERS;
use crate::workspace::{Lock, Workspace};

/// Side of a cell, px, that is fine enough to draw where all that is to be found is the rest of a prediction: a fourth of the pixels of a first picture's, each of them of a
/// fourth of the noise.
const DRAWN_CELL_PX: f64 = 8.0;

/// Radius, px of an 848 x 480 px picture, of the window in which a prediction is corrected before the whole sheet may move.
const NEAR: f64 = 250.0;
/// Change of a shift, cells, from one tile to the next, up to which sums over tiles are turned instead of taken anew: half of it is lost between the middle of a
/// tile and its edge.
const TURNED_CELLS: f64 = 0.1;
/// One tile in so many may lose more, where a polynomial sheet rolls up at the rim.
const TURNED_TILES: usize = 12;

/// How residuals about a polynomial lose their weight where a relief was fitted before: a tenth of a cell is off.
const STIFFER: Robust = Robust::Tile(0.1);

impl Workspace {
    /// The sheet of the last picture, moved as predicted, locked and refined.
    pub(crate) fn follow(&mut self, config: &Config, predicted: &Pose) -> Option<LatticeEstimate> {
        let last = self.last?;
        self.tools.smoother.least = Smoother::QUICK;
        let turn = predicted.rotation * last.pose.rotation.inverse();
        let shift = predicted.translation - turn * last.pose.translation;
        let start = last.surface.seen_from(turn.matrix(), &shift)?;
        // Half a cell lies between the lock-in's zero and dark twine's drawing.
        let half = last.polarity.map(|p| f64::from(p.offset()));
        let mut surface = start;
        surface.offset = std::array::from_fn(|f| start.offset[f] - half[f]);
        let seed = Seed { centre: self.view.centre, looks: last.looks };
        let place = self.coarse_scale_for(start.depth);
        // A relief is carried along as it is until the drawing tells its coefficients.
        let settled = if last.model == Model::Bumpy { Model::Quadratic } else { last.model };
        for (radius, model) in [(NEAR, settled.min(Model::Rhomb)), (last.focus, settled)] {
            let gain = self.sums_at(&surface, place);
            self.comb(&surface, place, [1.0; 2], seed.looks, gain);
            self.observe_measured(&self.window(radius));
            let t = &mut self.tools;
            surface = t.fitter.settle(&surface, model.parameters(), &t.observations, LOCKED, &self.prior)?.surface;
        }
        surface.offset = std::array::from_fn(|f| surface.offset[f] + half[f]);
        let lock = Lock {
            score: 0.0,
            above: 0.0,
            surface,
            start,
            seed,
            evidence: last.evidence,
            gain: last.gain * self.view.levels[0].raw.data().len() as f64,
            polarity: last.polarity,
            blur: last.blur,
            focus: last.focus,
            drawn_cell_px: DRAWN_CELL_PX,
            quick: true,
        };
        let found = self.conclude(config, &surface, &lock, last.model, last.margin, Some(last.labels))?;
        let stiffer = (last.model == Model::Bumpy).then(|| self.stiffer(config, &found, &lock)).flatten();
        Some(stiffer.unwrap_or(found))
    }

    /// The sheet without a relief, if a polynomial follows as many tiles and can be claimed: it is stiffer, and so its tangent steadier.
    fn stiffer(&mut self, config: &Config, bumpy: &LatticeEstimate, lock: &Lock) -> Option<LatticeEstimate> {
        let model = Model::Bent;
        let start = bumpy.surface.truncated(Model::Quadratic.parameters(), self.prior.angle);
        let t = &mut self.tools;
        let fit = t.fitter.fit(&start, model.parameters(), &t.observations, STIFFER, &self.prior, 4)?;
        let lock = Lock { surface: fit.surface, ..*lock };
        let found = self.conclude(config, &fit.surface, &lock, model, bumpy.margin, Some(bumpy.labels))?;
        let claimed = found.probability >= config.probability_threshold && found.evidence.bumps < WAVERS;
        (claimed && found.evidence.comb_good >= bumpy.evidence.comb_good).then_some(found)
    }

    /// The sums of a lock-in over all of the picture at a sheet; returns their gain. Where the sheet is nearly the one of the last sums, those are turned by what the
    /// phase in the middle of each tile changed.
    pub(crate) fn sums_at(&mut self, surface: &Surface, place: (usize, usize)) -> f32 {
        let summed = self.tools.summed.filter(|(_, summed)| *summed == place);
        let near = summed.is_some_and(|(from, _)| self.turn_sums(&from, surface, place));
        let gain = if near { self.tools.thin[place.0].1 } else { self.demodulate(surface, place, &Window::ALL) };
        self.tools.summed = Some((*surface, place));
        gain
    }

    /// Turns the sums from one sheet to another. `false` if that is too far off: then nothing is changed.
    fn turn_sums(&mut self, from: &Surface, to: &Surface, place: (usize, usize)) -> bool {
        let grid = &self.view.levels[place.0].tiles[place.1];
        let (before, after) = (from.chart(), to.chart());
        let t = &mut self.tools;
        t.turns.clear();
        for site in &grid.sites {
            let at = |chart: &Chart| chart.at(site.ray[0], site.ray[1]).filter(|_| site.valid);
            let both = at(&before).zip(at(&after));
            t.turns.push(both.map_or([0.0; 2], |(p, q)| [q.s[0] - p.s[0], q.s[1] - p.s[1]]));
        }
        let far = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) > TURNED_CELLS;
        let beside = t.turns.chunks_exact(grid.nx).flat_map(|row| row.windows(2)).filter(|w| far(&w[0], &w[1])).count();
        let below = t.turns.iter().zip(&t.turns[grid.nx..]).filter(|(a, b)| far(a, b)).count();
        if (beside + below) * TURNED_TILES > t.turns.len() {
            return false;
        }
        t.sums.iter_mut().zip(&t.turns).for_each(|(sum, turn)| sum.turn(*turn));
        true
    }
}
