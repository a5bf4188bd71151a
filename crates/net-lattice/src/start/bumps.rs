//! Bumps that no polynomial follows: a net that is seen over several lengths of its bumps is followed tile by tile, and fitted with a relief.

use net_geometry::nalgebra::Vector3;

use crate::answer::decision::Evidence;
use crate::lock::seed::Seed;
use crate::sheet::fit::Robust;
use crate::sheet::model::Model;
use crate::sheet::relief::Relief;
use crate::sheet::surface::Surface;
use crate::start::cold::COLD;
use crate::start::outwards::OUTWARDS;
use crate::workspace::{Lock, Workspace};

/// How much better than with a polynomial tiles must agree with a relief. Of simulated flat nets that fish hide none agrees 1.18 times as well, of hung ones that only a
/// relief follows 43 of 44 more than 1.2 times.
const BETTER: f64 = 1.2;
/// Turn of the normal, rad, that what scatters about a polynomial may make, from which a relief is looked for although tiles agree; and the part of that scatter which may be left.
pub(crate) const WAVERS: f64 = 0.0175;
const NEARER: f64 = 0.6;
/// The part of a polynomial's agreement that is no worse.
const AS_WELL: f64 = 0.95;
/// How many more tiles must be found tile by tile than agree with a polynomial, for a relief to be looked for.
const MORE: f64 = 1.1;
/// Agreement from which nothing is left to be followed, of what there can be.
const ENOUGH: f64 = 0.9;
/// Windows of a lock-in with a relief, px of an 848 x 480 px picture: they grow slowly, for what is foretold beyond is the prior's.
const GROWN: [(f64, Model); 9] = [
    (200.0, Model::Bumpy),
    (260.0, Model::Bumpy),
    (330.0, Model::Bumpy),
    (420.0, Model::Bumpy),
    (540.0, Model::Bumpy),
    (700.0, Model::Bumpy),
    (1000.0, Model::Bumpy),
    (2000.0, Model::Bumpy),
    (2000.0, Model::Bumpy),
];
/// The last of them again, once everything is near.
const SETTLED: [(f64, Model); 4] = [(2000.0, Model::Bumpy); 4];
/// Scales, cells, of the residuals of what is found tile by tile.
const SCALES: [f64; 3] = [0.5, 0.25, 0.12];
/// Depth, in units of that on the axis, to which a sheet is described.
const DEEPEST: f64 = 2.5;

/// What `agreement` would be with both families in step in every tile.
fn perfect(evidence: &Evidence) -> f64 {
    2.0 * f64::sqrt(2.0 * evidence.tiles.max(1) as f64)
}

impl Workspace {
    /// A sheet with a relief in the place of a locked polynomial one, if tiles agree far better with it. `wavers`: they agree with the polynomial, but scatter so much about it that nothing
    /// can be claimed; then it is enough if they agree as well and scatter far less.
    pub(crate) fn over_bumps(&mut self, lock: &Lock, wavers: bool) -> Option<Lock> {
        let (polynomial, evidence) = self.agreement(&lock.surface, lock.seed.looks);
        if !wavers && BETTER * polynomial > perfect(&evidence) {
            return None;
        }
        let agreeing = if wavers { 0.0 } else { evidence.good * evidence.tiles as f64 };
        let mut best = self.bumps_outwards(lock, (MORE * agreeing) as usize);
        if best.is_none_or(|(score, found)| score < ENOUGH * perfect(&found.evidence)) {
            // From the search once more: a polynomial may have led astray what lies about the axis.
            let other = self.grown_bumps(lock).and_then(|grown| self.bumps_outwards(&grown, 0));
            if let Some(other) = other
                && best.is_none_or(|best| other.0 > best.0)
            {
                best = Some(other);
            }
        }
        let (score, found) = best?;
        let off = |e: &Evidence| e.scatter[0].hypot(e.scatter[1]);
        let as_well = score / perfect(&found.evidence) > AS_WELL * polynomial / perfect(&evidence);
        let nearer = wavers && as_well && off(&found.evidence) < NEARER * off(&evidence);
        (score > BETTER * polynomial || nearer).then_some(Lock { focus: f64::INFINITY, ..found })
    }

    /// Locks from what the search gave, in windows that grow.
    fn grown_bumps(&mut self, lock: &Lock) -> Option<Lock> {
        let mut start = lock.start.truncated(Model::Rhomb.parameters(), self.prior.angle);
        let seed = self.seed(&mut start);
        let first = self.lock(&start, &COLD[..2], seed)?;
        let surface = self.lock(&self.with_relief(&first), &GROWN, seed)?;
        Some(Lock { surface, seed, ..*lock })
    }

    /// The sheet fitted to what is found tile by tile, as long as that makes it agree better, and how well it agrees. `None` if hardly more than `known` tiles are found.
    fn bumps_outwards(&mut self, lock: &Lock, known: usize) -> Option<(f64, Lock)> {
        let mut best: Option<(f64, Lock)> = None;
        for _ in 0..OUTWARDS {
            let from = best.map_or(*lock, |best| best.1);
            let Some(surface) = self.spread(&from, known).then(|| self.fit_spread(&from)).flatten() else { break };
            let seed = Seed { looks: from.seed.looks, ..lock.seed };
            let (score, evidence) = self.agreement(&surface, seed.looks);
            if best.is_some_and(|best| score <= best.0) {
                break;
            }
            best = Some((score, Lock { surface, evidence, seed, ..from }));
        }
        best
    }

    /// A sheet with a relief fitted to what was found tile by tile, and locked.
    fn fit_spread(&mut self, lock: &Lock) -> Option<Surface> {
        let mut surface = lock.surface.truncated(Model::Rhomb.parameters(), self.prior.angle);
        let t = &mut self.tools;
        for model in [Model::Rhomb, Model::Quadratic] {
            let robust = Robust::Family(1.0);
            surface = t.fitter.fit(&surface, model.parameters(), &t.observations, robust, &self.prior, 4)?.surface;
        }
        surface = self.with_relief(&surface);
        for scale in SCALES {
            let (t, robust) = (&mut self.tools, Robust::Family(scale));
            surface = t.fitter.fit_model(&surface, Model::Bumpy, &t.observations, robust, &self.prior, 4)?.surface;
        }
        self.lock(&surface, &SETTLED, lock.seed)
    }

    /// A sheet with a level relief over what is seen of it.
    fn with_relief(&self, surface: &Surface) -> Surface {
        let flat = surface.truncated(Model::Rhomb.parameters(), self.prior.angle).chart();
        let (mut low, mut high) = ([0.0f64; 2], [0.0f64; 2]);
        for site in self.view.levels[0].tiles[0].sites.iter().filter(|s| s.valid) {
            let [x, y] = site.ray;
            let Some(p) = flat.at(x, y).filter(|p| p.depth < DEEPEST * surface.depth) else { continue };
            let local = surface.rotation.transpose()
                * (Vector3::new(x, y, 1.0) * p.depth - Vector3::new(0.0, 0.0, surface.depth));
            for k in 0..2 {
                (low[k], high[k]) = (low[k].min(local[k]), high[k].max(local[k]));
            }
        }
        Surface { relief: Some(Relief::level(low, high, self.prior.bumps[1])), ..*surface }
    }
}
