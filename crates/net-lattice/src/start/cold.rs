//! Cold start: candidates of the search locked to the picture, the best one's true cell, the model that the tiles support.

use crate::answer::estimate::LatticeEstimate;
use crate::answer::stages::Stages;
use crate::config::Config;
use crate::drawing::polarity::Polarity;
use crate::picture::window::Window;
use crate::search::refine;
use crate::sheet::alike::ALIKE;
use crate::sheet::model::{self, Model};
use crate::sheet::surface::Surface;
use crate::start::bumps::WAVERS;
use crate::workspace::{Lock, Workspace};

/// Windows of a cold lock-in, px of an 848 x 480 px picture, and the model that may move in each. The growth is the unwrapping.
pub(crate) const COLD: [(f64, Model); 7] = [
    (90.0, Model::Rhomb),
    (160.0, Model::Rhomb),
    (250.0, Model::Quadratic),
    (400.0, Model::Cubic),
    (700.0, Model::Quartic),
    (2000.0, Model::Quartic),
    (2000.0, Model::Quartic),
];
/// Candidates of the search that are locked to: at least the first number, more while none is coherent.
const CANDIDATES: (usize, usize) = (3, 8);

/// Coherence of both families that leaves no doubt. Forty tiles in perfect step have 8.9.
const SURE: f64 = 5.5;
/// Share of a candidate's score below which another is nothing beside it.
const PART: f64 = 0.45;
/// Candidates of a bank of tiles that are refined to the end.
const REFINED: usize = 16;
/// Candidates that are looked through for a second net.
const MOST: usize = 12;
/// Side of a cell, px, that the drawing needs to tell where twine is as well as the picture does.
const DRAWN_CELL_PX: f64 = 20.0;
/// Side of a cell, px of an 848 x 480 px picture, of which no blur is half.
const UNBLURRED_PX: f64 = 30.0;
/// Passes on the drawing that many free coefficients need besides the first three.
const BUMPY_PASSES: usize = 2;
/// How much more than alike ones a bright family and a dark one must explain: of two families alike both explain one, so it is 1.4 to 2 times as much, and less than
/// 1.05 of fish.
const UNLIKE: f64 = 1.2;

/// Angle between the normals of two models of the same tiles, rad, from which they contradict each other: half of what an answer may be off.
const CONTRADICTS: f64 = 0.0436;

impl Workspace {
    pub(crate) fn cold(&mut self, config: &Config) -> Option<LatticeEstimate> {
        self.search();
        let mut locks = std::mem::take(&mut self.locks);
        locks.clear();
        // A net in which nearly every tile agrees. Its periods are tested below, and what scores far less is nothing beside it; a second net is neither.
        let mut settled: Option<(Surface, f64)> = None;
        for k in 0..self.candidates.len() {
            let c = self.candidates[k];
            let start = Surface::flat(c.rotation, c.depth, c.angle, self.scope.sides);
            if let Some((net, score)) = &settled {
                if k >= MOST || c.score < PART * score || same_but_for_period(&start, net) {
                    continue;
                }
            } else if k >= CANDIDATES.1 || k >= CANDIDATES.0 && locks.iter().any(|l| l.coherence() > 5.0) {
                break;
            }
            let mut seeded = start;
            let seed = self.seed(&mut seeded);
            let Some(surface) = self.lock(&seeded, &COLD, seed) else { continue };
            self.measure_comb(&surface, self.scale_for(surface.depth), seed.looks, &Window::ALL);
            let evidence = self.evidence();
            let (gain, polarity, blur) = self.drawn(&surface);
            locks.push(Lock {
                score: c.score,
                above: c.above,
                surface,
                start,
                seed,
                evidence,
                gain,
                polarity,
                blur,
                focus: f64::INFINITY,
                drawn_cell_px: DRAWN_CELL_PX,
                quick: false,
            });
            let coherence = evidence.v[0].min(evidence.v[1]) / f64::sqrt(2.0 * evidence.tiles.max(1) as f64);
            if settled.is_none() && coherence > 0.8 && evidence.good > 0.9 {
                settled = Some((surface, c.score));
            }
        }
        let lock = Self::best_lock(&locks);
        let other = lock.and_then(|lock| Self::another_net(&locks, &lock));
        self.locks = locks;
        let lock = self.elsewhere(lock?);
        let (mut lock, mut margin) = self.true_period(lock)?;
        if let Some(nearer) = other.and_then(|other| self.nearer_net(&lock, other)) {
            (lock, margin) = nearer;
        }
        self.focus(&mut lock);
        let bumpy = self.over_bumps(&lock, false);
        let found = self.seated(config, bumpy.unwrap_or(lock), margin)?;
        if bumpy.is_some() || found.evidence.bumps < WAVERS {
            return Some(found);
        }
        // What scatters about a polynomial is seen with a relief as well. It is that which counts where nothing can be claimed otherwise, and where the two contradict each other.
        let stages = self.stages;
        let other = self.over_bumps(&lock, true).and_then(|bumpy| self.seated(config, bumpy, margin));
        let claimed = found.probability >= config.probability_threshold;
        if let Some(other) = other
            && !(claimed && other.pose.normal().angle(&found.pose.normal()) < CONTRADICTS)
        {
            return Some(other);
        }
        self.stages = stages;
        Some(found)
    }

    /// What a lock comes to once it is where the twine is.
    fn seated(&mut self, config: &Config, mut lock: Lock, margin: f64) -> Option<LatticeEstimate> {
        self.seat(&mut lock);
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
            found.iter_mut().for_each(|c| *c = refine::refine(bank, scale, &self.scope, c, refine::ROUGHLY));
            let range = search.depths_m(self.scope.sides[0]);
            refine::add_rivals(bank, scale, &self.scope, range, found);
            self.background.measure(search, bank, scale, &self.scope);
            for c in found.iter_mut() {
                c.above = self.background.above(c);
            }
            refine::distinct(found);
            refine::interleave(found);
            for c in found.iter_mut().take(REFINED) {
                *c = refine::refine(bank, scale, &self.scope, c, refine::FINELY);
                c.above = self.background.above(c);
            }
            refined.append(found);
        }
        refine::distinct(refined);
        refine::interleave(refined);
    }

    /// Between lattices that are there beyond doubt, two nets or periods of one, the drawing's gain decides; one whose drawing explains less than an empty picture is none of them: where
    /// tufts as dark as twine is bright cancel its first wave, every part of the period is in better step than the period itself. What a fish or a shadow is explained by counts
    /// for nothing, so in doubt it is how high a candidate stood in the search, how far above its background, and how well the tiles agree.
    fn best_lock(locks: &[Lock]) -> Option<Lock> {
        if let Some(top) =
            locks.iter().filter(|l| l.coherence() > SURE && l.gain > 0.0).max_by(|a, b| a.gain.total_cmp(&b.gain))
        {
            return Some(*top);
        }
        let coherence = |l: &Lock| l.coherence() + 0.25 * (l.evidence.v[0].abs() + l.evidence.v[1].abs());
        let merit = |l: &Lock| 0.3 * l.score + 0.5 * l.above + coherence(l);
        locks.iter().max_by(|a, b| merit(a).total_cmp(&merit(b))).copied()
    }

    /// The best lock on another net than the best lock is on, if both are there beyond doubt. Of its lines every second may have been locked to: then it has
    /// half of the gain that it will have.
    fn another_net(locks: &[Lock], best: &Lock) -> Option<Lock> {
        let another = |l: &&Lock| {
            l.coherence().min(best.coherence()) > SURE
                && !same_but_for_period(&l.surface, &best.surface)
                && l.gain > 0.5 * PART * best.gain
        };
        locks.iter().filter(another).max_by(|a, b| a.gain.total_cmp(&b.gain)).copied()
    }

    /// Of two nets the nearer one is what a vehicle drifts into; which one that is tell their true periods. `other` with its period if it is nearer than `best`
    /// and no mere ghost beside it, and by how much the next period falls short.
    fn nearer_net(&mut self, best: &Lock, other: Lock) -> Option<(Lock, f64)> {
        let other = self.elsewhere(other);
        let other = self.nearer_period(other, best.surface.depth)?;
        let (other, margin) = self.true_period(other)?;
        let nearer = other.surface.depth < best.surface.depth && !same_but_for_period(&other.surface, &best.surface);
        (nearer && self.drawn(&other.surface).0 > PART * self.drawn(&best.surface).0).then_some((other, margin))
    }

    /// What drawing a locked net explains of the picture, and how it is drawn best.
    fn drawn(&mut self, surface: &Surface) -> (f64, [Polarity; 2], f64) {
        let (level, _) = self.coarse_scale_for(surface.depth);
        let cell = self.cell_px(surface.depth);
        self.gain(surface, level, cell, &Polarity::ALIKE, &[1.2])
    }

    /// From where the lock-in has bright twine to where twine is, by what the drawing explains in the tiles in which the lattice is: what it explains of a fish must
    /// not tell. Where the waves say that one family is bright and one is dark, that is tried as well.
    fn seat(&mut self, best: &mut Lock) {
        self.look_where(best);
        let widest = self.cell_px(best.surface.depth);
        let level = self.view.level_for(self.short_px(best.surface.depth), 6.0);
        let (alike, polarity, _) = self.gain(&best.surface, level, widest, &Polarity::ALIKE, &[best.blur]);
        best.polarity = polarity;
        // Motion turns the even harmonics of one family where it is longer than half a cell.
        let [a, b] = best.seed.looks;
        if a * b < 0.0 && widest > UNBLURRED_PX * self.view.size {
            let unlike = [a, b].map(|look| if look > 0.0 { Polarity::Bright } else { Polarity::Dark });
            if self.gain(&best.surface, level, widest, &[unlike], &[best.blur]).0 > UNLIKE * alike {
                best.polarity = unlike;
            }
        }
        for (offset, polarity) in best.surface.offset.iter_mut().zip(best.polarity) {
            *offset += f64::from(polarity.offset());
        }
        self.tools.mask.clear();
    }

    /// Refines a lock on the drawing, chooses the model, and says what is known of the result.
    fn finish(&mut self, config: &Config, lock: Lock, margin: f64) -> Option<LatticeEstimate> {
        let mut surface = lock.surface;
        let mut model = if surface.relief.is_some() { Model::Bumpy } else { Model::Bent };
        if let Some((fit, _)) = self.likelihood(&surface, &lock, model, 2, true)
            && let Some((fit, _)) = self.likelihood(&fit.surface, &lock, model, 1, false)
        {
            surface = fit.surface;
            if model == Model::Bumpy {
                for _ in 0..BUMPY_PASSES {
                    surface = self.likelihood(&surface, &lock, model, 1, false)?.0.surface;
                }
                return self.conclude(config, &surface, &lock, model, margin, None);
            }
            let alike = ALIKE[self.view.tiling_for(self.cell_px(surface.depth))];
            let t = &mut self.tools;
            if let Some(choice) =
                model::choose(&mut t.fitter, &surface, &t.observations, &self.prior, alike, &mut t.scratch)
            {
                surface = choice.fit.surface;
                model = choice.model;
            }
        }
        self.conclude(config, &surface, &lock, model, margin, None)
    }
}

/// Whether two lattices may be one net seen with different periods: the same plane and twines along the same ways, at depths at which harmonics coincide.
fn same_but_for_period(a: &Surface, b: &Surface) -> bool {
    /// What the search leaves open, rad and as part of the depth.
    const TURN: f64 = 0.07;
    const DEPTH: f64 = 0.03;
    let turned = a.normal().angle(&b.normal());
    let along = |s: &Surface, t: &Surface| {
        s.twines().iter().all(|way| t.twines().iter().any(|other| way.dot(other).abs() > f64::cos(2.0 * TURN)))
    };
    let simple = |m: u8, n: u8| m == 1 || n == 1 || m + n <= 5;
    let coincide = |m: u8, n: u8| (a.depth * f64::from(n) / (b.depth * f64::from(m)) - 1.0).abs() < DEPTH;
    turned < TURN && along(a, b) && (1..=7).any(|m| (1..=7).any(|n| simple(m, n) && coincide(m, n)))
}
