//! Stage 3: the one motion that most points agree on.
//!
//! Hypotheses from minimal samples (two points of a similarity, four of a homography), drawn by a generator of fixed seed, scored by
//! truncated squared distances (MSAC, Torr and Zisserman 2000); then reweighted least squares on the best. Points that a fish carries off, or that
//! slipped to the neighbouring cell, do not agree and take no part.

use nalgebra::Vector2;

use crate::config::{ConsensusConfig, Model};
use crate::error::Result;
use crate::motion::Motion;
use crate::motion_fit::{Frame, homography_of_four, homography_step, similarity_of_two, weighted_similarity};

/// Fewer points do not carry the eight numbers of a homography.
const HOMOGRAPHY_POINTS: usize = 12;
/// Chance of having drawn at least one sample without outliers before stopping.
const CONFIDENCE: f64 = 0.999;
/// Rounds of reweighting.
const ROUNDS: usize = 8;
/// Spread below which more precision means nothing, px.
const LEAST_SPREAD_PX: f64 = 0.01;

/// Median of a Rayleigh distribution in its standard deviations per axis.
const RAYLEIGH_MEDIAN: f64 = 1.1774;
/// Points within this many spreads agree, if also within the threshold; but never fewer than those within the least, px.
const AGREE_SPREADS: f64 = 6.0;
const AGREE_LEAST_PX: f64 = 0.25;

/// A motion and who agrees with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Motion from the first list's pixels to the second's.
    pub motion: Motion,
    /// Points that agree: nearer than the threshold, and than six spreads (a quarter of a pixel at least).
    pub agreed: usize,
    /// Robust standard deviation of the agreeing points' residuals per axis, px.
    pub spread_px: f64,
}

/// Finds the consensus. Owns its buffers.
#[derive(Debug, Clone)]
pub struct Consensus {
    config: ConsensusConfig,
    /// Squared residuals of the motion at hand, px².
    squares: Vec<f64>,
    /// Workspace for medians.
    sorted: Vec<f64>,
    /// Whether each point agrees with the last fit.
    agrees: Vec<bool>,
}

impl Consensus {
    /// A consensus finder.
    ///
    /// # Errors
    /// [`crate::Error::Value`] for a parameter out of range.
    pub fn new(config: &ConsensusConfig) -> Result<Self> {
        config.validate()?;
        Ok(Self { config: config.clone(), squares: Vec::new(), sorted: Vec::new(), agrees: Vec::new() })
    }

    /// Makes room for `points` points.
    pub(crate) fn reserve(&mut self, points: usize) {
        self.squares.reserve(points);
        self.sorted.reserve(points);
        self.agrees.reserve(points);
    }

    /// The motion that carries most of `from` to `to` (pixels, pair by pair), or `None` when too few points agree on any.
    /// `guess` is tried first. The same input gives the same output.
    pub fn fit(&mut self, from: &[Vector2<f64>], to: &[Vector2<f64>], guess: Option<&Motion>) -> Option<Fit> {
        let n = from.len().min(to.len());
        let (from, to) = (&from[..n], &to[..n]);
        self.agrees.clear();
        self.agrees.resize(n, false);
        if n < self.config.min_points || !from.iter().chain(to).all(|p| p.iter().all(|x| x.is_finite())) {
            return None;
        }
        let frame = Frame::around(from);
        let start = self.search(from, to, guess, &frame)?;
        let motion = self.refine(from, to, start, &frame);
        self.measure(from, to, &motion);
        // Points at the edge of a fish are pulled by less than the threshold: what is far outside the others' spread does not agree either.
        let within = self.squares.iter().filter(|&&s| s <= self.config.threshold_px.powi(2));
        let spread = median_of(&mut self.sorted, within.map(|s| s.sqrt())) / RAYLEIGH_MEDIAN;
        let threshold = (AGREE_SPREADS * spread).max(AGREE_LEAST_PX).min(self.config.threshold_px).powi(2);
        let mut agreed = 0;
        for (agrees, &square) in self.agrees.iter_mut().zip(&self.squares) {
            *agrees = square <= threshold;
            agreed += usize::from(*agrees);
        }
        if agreed < self.config.min_points {
            return None;
        }
        let kept = self.squares.iter().filter(|&&s| s <= threshold);
        let spread_px = median_of(&mut self.sorted, kept.map(|s| s.sqrt())) / RAYLEIGH_MEDIAN;
        Some(Fit { motion, agreed, spread_px })
    }

    /// Whether each point of the last [`Consensus::fit`] agreed.
    pub fn agrees(&self) -> &[bool] {
        &self.agrees
    }

    /// Minimal samples; the best by MSAC.
    fn search(
        &mut self,
        from: &[Vector2<f64>],
        to: &[Vector2<f64>],
        guess: Option<&Motion>,
        frame: &Frame,
    ) -> Option<Motion> {
        let n = from.len();
        let size = if self.config.model == Model::Homography && n >= HOMOGRAPHY_POINTS { 4 } else { 2 };
        let threshold = self.config.threshold_px.powi(2);
        let cost = |motion: &Motion| {
            let (mut cost, mut within) = (0.0, 0usize);
            for (&p, &q) in from.iter().zip(to) {
                let square = (motion.apply(p) - q).norm_squared();
                // NaN (behind the horizon) counts as an outlier.
                if square < threshold {
                    cost += square;
                    within += 1;
                } else {
                    cost += threshold;
                }
            }
            (cost, within)
        };
        let mut best: Option<(f64, Motion)> = None;
        let mut limit = self.config.max_samples;
        let consider = |motion: Motion, best: &mut Option<(f64, Motion)>, limit: &mut usize| {
            let (cost, within) = cost(&motion);
            if best.is_none_or(|(least, _)| cost < least) {
                *best = Some((cost, motion));
                let clean = (within as f64 / n as f64).powi(size as i32).min(1.0 - 1e-9);
                let needed = (1.0 - CONFIDENCE).ln() / (1.0 - clean).ln();
                *limit = (*limit).min(needed.ceil().max(8.0) as usize);
            }
        };
        if let Some(motion) = guess {
            consider(*motion, &mut best, &mut limit);
        }
        let mut random = SplitMix(self.config.seed);
        let mut drawn = 0;
        while drawn < limit {
            drawn += 1;
            let mut sample = [0usize; 4];
            for k in 0..size {
                sample[k] = loop {
                    let i = random.below(n);
                    if !sample[..k].contains(&i) {
                        break i;
                    }
                };
            }
            let pick = |list: &[Vector2<f64>]| sample.map(|i| list[i]);
            let motion = match size {
                4 => homography_of_four(&pick(from), &pick(to), frame),
                _ => similarity_of_two(&pick(from), &pick(to)),
            };
            if let Some(motion) = motion.filter(|m| plausible(m, from)) {
                consider(motion, &mut best, &mut limit);
            }
        }
        best.map(|(_, motion)| motion)
    }

    /// Least squares with Tukey's weights, whose width follows the spread and ends at the threshold at most.
    fn refine(&mut self, from: &[Vector2<f64>], to: &[Vector2<f64>], start: Motion, frame: &Frame) -> Motion {
        let mut motion = start;
        for round in 0..ROUNDS {
            self.measure(from, to, &motion);
            let limit = self.config.threshold_px;
            let within = self.squares.iter().filter(|&&s| s <= limit * limit);
            let spread = median_of(&mut self.sorted, within.map(|s| s.sqrt())) / RAYLEIGH_MEDIAN;
            // Tukey's 4.685 standard deviations keep 95 % efficiency; the first rounds take all that agree.
            let width = if round < 2 { limit } else { (4.685 * spread.max(LEAST_SPREAD_PX)).min(limit) };
            let weight = |square: f64| {
                let x = square / (width * width);
                if x < 1.0 { (1.0 - x).powi(2) } else { 0.0 }
            };
            let used = self.squares.iter().filter(|&&s| weight(s) > 0.0).count();
            let homography = self.config.model == Model::Homography && used >= HOMOGRAPHY_POINTS;
            let weights = self.squares.iter().map(|&s| weight(s));
            let pairs = from.iter().zip(to).zip(weights).filter(|(_, w)| *w > 0.0).map(|((&p, &q), w)| (p, q, w));
            let next = match homography {
                true => homography_step(pairs, &motion, frame),
                false => weighted_similarity(pairs, frame),
            };
            let Some(next) = next.filter(|m| plausible(m, from)) else { break };
            let change = frame.corners().iter().map(|&c| (next.apply(c) - motion.apply(c)).norm()).fold(0.0, f64::max);
            motion = next;
            if round >= 3 && change < 1e-4 {
                break;
            }
        }
        motion
    }

    /// Squared residuals of all points; infinite behind the horizon.
    fn measure(&mut self, from: &[Vector2<f64>], to: &[Vector2<f64>], motion: &Motion) {
        self.squares.clear();
        self.squares.extend(from.iter().zip(to).map(|(&p, &q)| {
            let square = (motion.apply(p) - q).norm_squared();
            if square.is_finite() { square } else { f64::INFINITY }
        }));
    }
}

/// A camera that moves between two pictures does not magnify anywhere by four, nor turn the picture over: such a "motion" comes from a
/// sample of wrong matches.
fn plausible(motion: &Motion, from: &[Vector2<f64>]) -> bool {
    let some = [from.first(), from.get(from.len() / 2), from.last()];
    some.into_iter().flatten().all(|&p| {
        let area = motion.jacobian(p).determinant();
        motion.apply(p).x.is_finite() && area > 1.0 / 16.0 && area < 16.0
    })
}

/// The median; 0 of nothing.
pub(crate) fn median_of(buffer: &mut Vec<f64>, values: impl Iterator<Item = f64>) -> f64 {
    buffer.clear();
    buffer.extend(values);
    let middle = buffer.len() / 2;
    match buffer.is_empty() {
        true => 0.0,
        false => *buffer.select_nth_unstable_by(middle, f64::total_cmp).1,
    }
}

/// Steele, Lea and Flood 2014. Small, good enough to draw samples, and the same everywhere.
struct SplitMix(u64);

impl SplitMix {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((u128::from(z ^ (z >> 31)) * n as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;

    /// Points of a picture on a grid, moved by `motion` with `noise` px of pseudo-random error.
    fn scene(motion: &Motion, noise: f64) -> (Vec<Vector2<f64>>, Vec<Vector2<f64>>) {
        let mut random = SplitMix(7);
        let mut uniform = || random.below(1 << 20) as f64 / f64::from(1 << 19) - 1.0;
        let from: Vec<_> = (0..200).map(|i| Vector2::new(40.0 * (i % 20) as f64, 45.0 * (i / 20) as f64)).collect();
        let to = from.iter().map(|&p| motion.apply(p) + Vector2::new(uniform(), uniform()) * noise).collect();
        (from, to)
    }

    fn worst(a: &Motion, b: &Motion, points: &[Vector2<f64>]) -> f64 {
        points.iter().map(|&p| (a.apply(p) - b.apply(p)).norm()).fold(0.0, f64::max)
    }

    fn tilted() -> Motion {
        Motion::from_matrix(Matrix3::new(1.02, -0.05, 7.0, 0.04, 0.97, -3.0, 1e-4, -5e-5, 1.0)).expect("a motion")
    }

    #[test]
    fn exact_points_give_the_exact_motion() {
        let similarity = Motion::similarity(1.03, 0.04, Vector2::new(12.0, -5.0));
        for (model, truth) in [(Model::Similarity, similarity), (Model::Homography, tilted())] {
            let (from, to) = scene(&truth, 0.0);
            let mut consensus = Consensus::new(&ConsensusConfig { model, ..Default::default() }).expect("defaults");
            let fit = consensus.fit(&from, &to, None).expect("all agree");
            assert_eq!(fit.agreed, from.len());
            // Double rounding through the normal equations.
            assert!(worst(&fit.motion, &truth, &from) < 1e-6);
        }
    }

    #[test]
    fn points_carried_off_take_no_part() {
        let (from, mut to) = scene(&tilted(), 0.1);
        // 45 % go elsewhere: most with a fish, together; some a cell aside.
        for (i, q) in to.iter_mut().enumerate() {
            match i % 20 {
                0..6 => *q += Vector2::new(13.0, 4.0),
                6..9 => *q += Vector2::new(30.0, 0.0),
                _ => {}
            }
        }
        let mut consensus = Consensus::new(&ConsensusConfig::default()).expect("defaults");
        let fit = consensus.fit(&from, &to, None).expect("a majority");
        assert_eq!(fit.agreed, 110);
        assert!(consensus.agrees().iter().enumerate().all(|(i, &a)| a == (i % 20 >= 9)));
        // Uniform noise of 0.1 px has a deviation of 0.058 px. At the corner of the picture a homography through 110 points keeps about
        // 0.6 of it (leverage 8 / 110, times five there): three deviations per axis.
        assert!((fit.spread_px - 0.058).abs() < 0.02, "{}", fit.spread_px);
        let error = worst(&fit.motion, &tilted(), &from);
        assert!(error < 3.0 * 0.6 * 0.058 * 2f64.sqrt(), "{error}");
    }

    #[test]
    fn the_same_input_gives_the_same_output() {
        let (from, to) = scene(&tilted(), 0.4);
        let mut once = Consensus::new(&ConsensusConfig::default()).expect("defaults");
        let first = once.fit(&from, &to, None);
        assert!(first.is_some());
        assert_eq!(first, once.fit(&from, &to, None));
    }

    #[test]
    fn no_consensus_where_there_is_none() {
        let mut consensus = Consensus::new(&ConsensusConfig::default()).expect("defaults");
        assert_eq!(consensus.fit(&[], &[], None), None);
        let same = vec![Vector2::new(5.0, 5.0); 50];
        assert_eq!(consensus.fit(&same, &same, None), None);
        let (from, mut to) = scene(&Motion::identity(), 0.0);
        to[3].x = f64::NAN;
        assert_eq!(consensus.fit(&from, &to, None), None);
        // Every point at random: no twelve of two hundred agree on a homography within 1.5 px.
        let (_, random) = scene(&Motion::identity(), 300.0);
        assert_eq!(consensus.fit(&from, &random, None), None);
    }
}
