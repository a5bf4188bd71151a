//! Which cell is the true one: a net at a third of the distance with a third of the meshes is nearly the same picture.

use crate::drawing::polarity::Polarity;
use crate::lock::comb::Looks;
use crate::picture::view::LEVELS;
use crate::picture::window::Window;
use crate::sheet::surface::Surface;
use crate::workspace::{Lock, SMALLEST_CELL, Workspace};

/// Rival depths: scaling depth by m scales every phase by m.
const RIVALS: [f64; 12] = [1.0 / 7.0, 1.0 / 6.0, 0.2, 0.25, 1.0 / 3.0, 0.5, 2.0 / 3.0, 1.0, 1.5, 2.0, 3.0, 4.0];
/// Agreeing tiles without which all of the picture tells between rival periods.
const FEWEST: usize = 4;
/// Share of the best rival's worth below which others are no danger whatever they are worth: by how much they fall short is then a least.
const HOPELESS: f64 = 0.4;
/// Coherence, summed over both families, that a rival period has at least. Slid to where its twines seem to be, one that is not there has up to 3.4.
const IN_STEP: f64 = 3.5;
/// How often the period may change.
const CHANGES: usize = 3;
/// Side of a cell, px, from which drawings of it can be told apart.
const FINE_PX: f64 = 6.0;
/// Blurs, px, of which the drawing that tells between rivals takes the best.
const BLURS: [f64; 3] = [0.76, 1.5, 2.8];

/// A lattice of another period in the place of the one that was locked to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rival {
    /// Its depth over that of the lock.
    scale: f64,
    surface: Surface,
    looks: Looks,
    /// What its drawing explains, of what the lock's does on the same level.
    gain: f64,
    polarity: [Polarity; 2],
}

impl Workspace {
    /// Tests the rival periods until the best is the lock itself; returns it, and the share of its gain by which the second falls short, at least. A rival may have
    /// rivals of its own: from the third harmonic of a net half as far as it, say.
    pub(crate) fn true_period(&mut self, mut lock: Lock) -> Option<(Lock, f64)> {
        let mut rivals = std::mem::take(&mut self.rivals);
        let mut margin = Some(1.0);
        for _ in 0..CHANGES {
            let before = lock.surface.depth;
            margin = self.challenge(&mut lock, &mut rivals, f64::INFINITY);
            if margin.is_none() || lock.surface.depth == before {
                break;
            }
            if let Some(surface) = self.lock_whole(&lock) {
                lock.surface = surface;
            }
        }
        self.rivals = rivals;
        self.tools.mask.clear();
        margin.map(|margin| (lock, margin))
    }

    /// The best period by which a lock is nearer than `depth`, if it is the lock's own or better than that; `None` if the net stays where it is.
    pub(crate) fn nearer_period(&mut self, mut lock: Lock, depth: f64) -> Option<Lock> {
        if lock.surface.depth < depth {
            return Some(lock);
        }
        let mut rivals = std::mem::take(&mut self.rivals);
        let judged = self.challenge(&mut lock, &mut rivals, depth);
        self.rivals = rivals;
        self.tools.mask.clear();
        judged?;
        if lock.surface.depth < depth
            && let Some(surface) = self.lock_whole(&lock)
        {
            lock.surface = surface;
        }
        (lock.surface.depth < depth).then_some(lock)
    }

    /// Puts the best of the rival periods that bring it nearer than `depth` in the place of the lock; returns by how much of its gain the second falls short.
    fn challenge(&mut self, lock: &mut Lock, rivals: &mut Vec<Rival>, depth: f64) -> Option<f64> {
        let cell = self.short_px(lock.surface.depth);
        let span = 0.95 * (self.view.levels[0].raw.height() * self.view.reduction) as f64 / 3.0;
        let smallest = SMALLEST_CELL * 0.9 * self.view.reduction as f64;
        let own = lock.surface.depth;
        let possible = |m: &f64| *m == 1.0 || (cell / m > smallest && cell / m < span && own * m < depth);
        self.look_where(lock);
        rivals.clear();
        for m in RIVALS.into_iter().filter(possible) {
            let mut surface = lock.surface;
            let mut looks = lock.seed.looks;
            if m != 1.0 {
                surface = surface.scaled(m);
                let Some(seen) = self.slide(&mut surface) else { continue };
                looks = seen;
            }
            rivals.push(Rival { scale: m, surface, looks, gain: 0.0, polarity: lock.polarity });
        }
        let first = rivals.first()?.scale;
        // Each against the lock, fine enough for the smaller cells of the two, and all filtered for the widest.
        let level = |m: f64| self.view.level_for(cell / m.max(1.0), FINE_PX);
        let (levels, own_level) = (RIVALS.map(level), level(1.0));
        let widest = self.cell_px(own * first);
        (_, _, lock.blur) = self.gain(&lock.surface, own_level, widest, &[lock.polarity], &BLURS);
        let mut by_level = [None; LEVELS];
        for (m, level) in RIVALS.into_iter().zip(levels) {
            let Some(r) = rivals.iter_mut().find(|r| r.scale == m) else { continue };
            let unit = match by_level[level] {
                Some(unit) => unit,
                None => self.gain(&lock.surface, level, widest, &[lock.polarity], &[lock.blur]).0,
            };
            by_level[level] = Some(unit);
            (r.gain, r.polarity, _) = self.gain(&r.surface, level, widest, &Polarity::ALIKE, &[lock.blur]);
            r.gain /= unit.abs().max(1e-9);
        }
        let unit = by_level[own_level].unwrap_or(0.0).abs();
        rivals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        // The best and the second of them by worth, which is at most the gain.
        let (mut best, mut second) = ((f64::NEG_INFINITY, 0), f64::NEG_INFINITY);
        for (k, r) in rivals.iter().enumerate() {
            if r.gain <= second {
                break;
            }
            if r.gain < HOPELESS * best.0 {
                second = r.gain;
                break;
            }
            let Some(there) = self.all_there(r) else { continue };
            let worth = if r.gain > 0.0 { r.gain * there } else { r.gain };
            if worth > best.0 {
                second = best.0;
                best = (worth, k);
            } else {
                second = second.max(worth);
            }
        }
        let (gain, r) = (best.0, rivals[best.1]);
        // Nothing beside it: the empty picture is the rival.
        let second = if second.is_finite() { second } else { 0.0 };
        lock.seed.looks = r.looks;
        (lock.surface, lock.start) = (r.surface, lock.start.scaled(r.scale));
        (lock.gain, lock.polarity) = (r.gain * unit, r.polarity);
        Some((gain - second) / gain.abs().max(1e-9))
    }

    /// Rivals share the tiles in which the lattice is: what a drawing explains of a fish must not tell between them.
    pub(crate) fn look_where(&mut self, lock: &Lock) {
        let place = self.scale_for(lock.surface.depth);
        self.measure_comb(&lock.surface, place, lock.seed.looks, &Window::ALL);
        let t = &mut self.tools;
        t.tiling = place.1;
        t.mask.clear();
        t.mask.extend(t.measurements.iter().map(|m| m.aligned()));
        if t.mask.iter().filter(|m| **m).count() < FEWEST {
            t.mask.clear();
        }
    }

    /// A lattice of which only every second or third line is there draws most of the picture, too: 1 if all are, 0 if they are not. `None` if the tiles are
    /// out of step: the wider a rival's cells, the more its drawing explains of any fish.
    fn all_there(&mut self, rival: &Rival) -> Option<f64> {
        let place = self.scale_for(rival.surface.depth);
        self.measure_comb(&rival.surface, place, rival.looks, &Window::ALL);
        let [a, b] = self.evidence().v;
        let in_step = rival.scale == 1.0 || a + b > IN_STEP;
        in_step.then(|| 1.0 - (2.0 * self.fold(&rival.surface, place).unlike).min(1.0))
    }
}
