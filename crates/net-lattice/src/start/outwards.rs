//! A locked sheet made to agree with as much of the picture as it can: other tilts, tile by tile outwards, and as much about the axis as it follows.

use net_geometry::nalgebra::{Rotation3, Vector3};

use crate::answer::decision::Evidence;
use crate::lock::comb::Looks;
use crate::lock::passes::LOUDEST;
use crate::lock::seed::Seed;
use crate::picture::window::Window;
use crate::sheet::fit::{Observation, Robust};
use crate::sheet::model::Model;
use crate::sheet::surface::Surface;
use crate::start::cold::COLD;
use crate::workspace::{Lock, Workspace};

/// Radii, px of an 848 x 480 px picture, within which a sheet may be fitted, and the share of the tiles there that agree if it follows the net.
const FOCUS: [f64; 4] = [f64::INFINITY, 420.0, 300.0, 220.0];
const FOLLOWED: f64 = 0.9;
/// How often a sheet is followed outwards from where it is sure.
pub(crate) const OUTWARDS: usize = 3;
/// Turn of the tilts about the one found from which a lock-in is tried again, rad.
const OTHER: f64 = 0.16;

impl Workspace {
    /// Locks again from other tilts about the one found, and keeps what agrees best. Bent sheets have more than one tilt from which the phases
    /// settle, a cycle apart at the rim; all but one of them leave tiles behind.
    pub(crate) fn elsewhere(&mut self, mut best: Lock) -> Lock {
        let all = |e: &Evidence| f64::sqrt(2.0 * e.tiles.max(1) as f64);
        if best.evidence.v[0].min(best.evidence.v[1]) > 0.9 * all(&best.evidence) {
            return best;
        }
        let first = best;
        let mut top = self.agreement(&first.surface, first.seed.looks).0;
        for _ in 0..OUTWARDS {
            let Some(surface) = self.followed_outwards(&best) else { break };
            let (score, evidence) = self.agreement(&surface, first.seed.looks);
            if score <= top {
                break;
            }
            top = score;
            best = Lock { surface, evidence, ..first };
        }
        for (x, y) in [(0.0, 0.0), (OTHER, 0.0), (-OTHER, 0.0), (0.0, OTHER), (0.0, -OTHER)] {
            let turn = Rotation3::new(Vector3::new(x, y, 0.0)).into_inner();
            let s = &first.surface;
            let rotation = turn * s.rotation;
            if rotation[(2, 2)] < 0.3 {
                continue;
            }
            let mut start = Surface::flat(rotation, s.depth, s.angle, s.sides);
            let seed = self.seed(&mut start);
            let Some(surface) = self.lock(&start, &COLD, seed) else { continue };
            if (surface.depth / first.surface.depth).ln().abs() > 0.06 {
                continue;
            }
            let (score, evidence) = self.agreement(&surface, seed.looks);
            if score > top {
                top = score;
                best = Lock { surface, seed, evidence, ..first };
            }
        }
        best
    }

    /// Locks again to a sheet that is right but for a few cells at the rim.
    pub(crate) fn lock_whole(&mut self, lock: &Lock) -> Option<Surface> {
        self.lock(&lock.surface, &COLD[2..], lock.seed)
    }

    /// The sheet fitted to what is found tile by tile from where it is sure outwards, and locked again.
    fn followed_outwards(&mut self, lock: &Lock) -> Option<Surface> {
        if !self.spread(lock, 0) {
            return None;
        }
        let t = &mut self.tools;
        // From the stiffest on: a sheet that curls up somewhere is no place to start from.
        let mut surface = lock.surface.truncated(Model::Rhomb.parameters(), self.prior.angle);
        for (model, scale) in [
            (Model::Rhomb, 1.0),
            (Model::Quadratic, 1.0),
            (Model::Cubic, 0.5),
            (Model::Quartic, 0.25),
            (Model::Quartic, 0.12),
        ] {
            let robust = Robust::Family(scale);
            surface = t.fitter.fit(&surface, model.parameters(), &t.observations, robust, &self.prior, 4)?.surface;
        }
        self.lock(&surface, &COLD[5..], lock.seed)
    }

    /// Observes what is found tile by tile from where a sheet is sure outwards. `false` if that is nothing new, or not in more than `known` tiles.
    pub(crate) fn spread(&mut self, lock: &Lock, known: usize) -> bool {
        let place = self.scale_for(lock.surface.depth);
        let gain = self.demodulate(&lock.surface, place, &Window::ALL);
        let comb = self.comb(&lock.surface, place, [1.0; 2], lock.seed.looks, gain);
        let level = &self.view.levels[place.0];
        let grid = &level.tiles[place.1];
        let t = &mut self.tools;
        let sure = t.spread.start(&t.measurements, grid);
        let grown = t.spread.grow(level, grid, &comb, gain);
        if grown == sure || grown <= known {
            return false;
        }
        t.observations.clear();
        for (site, known) in grid.sites.iter().zip(&t.spread.known) {
            let w = |f: usize| known.map_or(0.0, |k| k.snr[f].min(LOUDEST) * std::f64::consts::TAU.powi(2));
            let s = known.map_or([0.0; 2], |k| k.s);
            t.observations.push(Observation { site: *site, s, weight: [w(0), 0.0, w(1)] });
        }
        true
    }

    /// A polynomial sheet does not follow a net that bends in many ways all over the picture, and what it misses at the rim it makes up for on the axis,
    /// where range and normal are claimed. Fits it to as much about the axis as it follows.
    pub(crate) fn focus(&mut self, lock: &mut Lock) {
        let place = self.scale_for(lock.surface.depth);
        let mut best = 0.0;
        for radius in FOCUS {
            let mut surface = lock.surface;
            if radius.is_finite() {
                let seed = Seed { centre: self.view.centre, ..lock.seed };
                let Some(locked) = self.lock(&surface, &[(radius, Model::Quartic); 3], seed) else { continue };
                surface = locked;
            }
            self.measure_comb(&surface, place, lock.seed.looks, &Window::ALL);
            let good = self.evidence_within(radius).good;
            if good > best {
                best = good;
                (lock.focus, lock.surface) = (radius, surface);
            }
            if good > FOLLOWED {
                break;
            }
        }
    }

    /// How well the tiles agree with a locked sheet.
    pub(crate) fn agreement(&mut self, surface: &Surface, looks: Looks) -> (f64, Evidence) {
        self.measure_comb(surface, self.scale_for(surface.depth), looks, &Window::ALL);
        let e = self.evidence();
        // Range and normal are claimed on the axis: what agrees there counts twice.
        (e.v[0].min(e.v[1]) * (1.0 + e.good_near), e)
    }
}
