//! Stage 3: the one motion that most points agree on.
//!
//! Hypotheses from minimal samples (two points of a similarity, four of a homography), drawn by a generator of fixed seed, scored by
//! truncated squared distances (MSAC, Torr and Zisserman 2000); then reweighted least squares on the best. Points that a fish carries off, or that
//! slipped to the neighbouring cell, do not agree and take no part.

use nalgebra::{Matrix3, SMatrix, SVector, Vector2};

use crate::config::{ConsensusConfig, Model};
use crate::error::Result;
use crate::motion::Motion;

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

/// Coordinates near one, so that the normal equations are well scaled: `(pixel - centre) / scale`.
#[derive(Debug, Clone, Copy)]
struct Frame {
    centre: Vector2<f64>,
    scale: f64,
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

impl Frame {
    fn around(points: &[Vector2<f64>]) -> Self {
        let centre = points.iter().sum::<Vector2<f64>>() / points.len().max(1) as f64;
        let scale = points.iter().map(|p| (p - centre).amax()).fold(0.0, f64::max);
        Self { centre, scale: scale.max(1.0) }
    }

    fn normalise(&self, p: Vector2<f64>) -> Vector2<f64> {
        (p - self.centre) / self.scale
    }

    /// The homography in this frame's coordinates on both sides back in pixels.
    fn to_pixels(self, h: &Matrix3<f64>) -> Option<Motion> {
        let (c, s) = (self.centre, self.scale);
        let out = Matrix3::new(s, 0.0, c.x, 0.0, s, c.y, 0.0, 0.0, 1.0);
        let into = Matrix3::new(1.0 / s, 0.0, -c.x / s, 0.0, 1.0 / s, -c.y / s, 0.0, 0.0, 1.0);
        Motion::from_matrix(out * h * into)
    }

    fn corners(&self) -> [Vector2<f64>; 4] {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(u, v)| self.centre + Vector2::new(u, v) * self.scale)
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

/// The similarity through two pairs.
fn similarity_of_two(p: &[Vector2<f64>; 4], q: &[Vector2<f64>; 4]) -> Option<Motion> {
    let (dp, dq) = (p[1] - p[0], q[1] - q[0]);
    let square = dp.norm_squared();
    // Close points say little on turn and scale.
    if square < 100.0 {
        return None;
    }
    let (a, b) = (dp.dot(&dq) / square, dp.perp(&dq) / square);
    let turned = Vector2::new(a * p[0].x - b * p[0].y, b * p[0].x + a * p[0].y);
    Some(Motion::similarity(a, b, q[0] - turned))
}

/// The homography through four pairs.
fn homography_of_four(p: &[Vector2<f64>; 4], q: &[Vector2<f64>; 4], frame: &Frame) -> Option<Motion> {
    let (p, q) = (p.map(|x| frame.normalise(x)), q.map(|x| frame.normalise(x)));
    // Three points near a line determine nothing; nor may the order of turns change.
    for (i, j, k) in [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)] {
        let (a, b) = ((p[j] - p[i]).perp(&(p[k] - p[i])), (q[j] - q[i]).perp(&(q[k] - q[i])));
        if a.abs() < 0.02 || a * b <= 0.0 {
            return None;
        }
    }
    let mut a = SMatrix::<f64, 8, 8>::zeros();
    let mut b = SVector::<f64, 8>::zeros();
    for k in 0..4 {
        let (x, y, u, v) = (p[k].x, p[k].y, q[k].x, q[k].y);
        a.set_row(2 * k, &SMatrix::<f64, 1, 8>::from([[x], [y], [1.0], [0.0], [0.0], [0.0], [-u * x], [-u * y]]));
        a.set_row(2 * k + 1, &SMatrix::<f64, 1, 8>::from([[0.0], [0.0], [0.0], [x], [y], [1.0], [-v * x], [-v * y]]));
        (b[2 * k], b[2 * k + 1]) = (u, v);
    }
    let h = a.lu().solve(&b)?;
    frame.to_pixels(&Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0))
}

/// The weighted least-squares similarity, in closed form.
fn weighted_similarity(
    pairs: impl Iterator<Item = (Vector2<f64>, Vector2<f64>, f64)> + Clone,
    frame: &Frame,
) -> Option<Motion> {
    let mut total = 0.0;
    let (mut mean_p, mut mean_q) = (Vector2::zeros(), Vector2::zeros());
    for (p, q, w) in pairs.clone() {
        total += w;
        mean_p += (p - frame.centre) * w;
        mean_q += (q - frame.centre) * w;
    }
    if total < 1e-9 {
        return None;
    }
    let (mean_p, mean_q) = (frame.centre + mean_p / total, frame.centre + mean_q / total);
    let (mut dot, mut cross, mut square) = (0.0, 0.0, 0.0);
    for (p, q, w) in pairs {
        let (p, q) = (p - mean_p, q - mean_q);
        dot += w * p.dot(&q);
        cross += w * p.perp(&q);
        square += w * p.norm_squared();
    }
    let (a, b) = (dot / square, cross / square);
    let turned = Vector2::new(a * mean_p.x - b * mean_p.y, b * mean_p.x + a * mean_p.y);
    let motion = Motion::similarity(a, b, mean_q - turned);
    Motion::from_matrix(*motion.matrix())
}

/// One Gauss-Newton step on the reprojection error of a homography.
fn homography_step(
    pairs: impl Iterator<Item = (Vector2<f64>, Vector2<f64>, f64)>,
    motion: &Motion,
    frame: &Frame,
) -> Option<Motion> {
    let (c, s) = (frame.centre, frame.scale);
    let into = Matrix3::new(1.0 / s, 0.0, -c.x / s, 0.0, 1.0 / s, -c.y / s, 0.0, 0.0, 1.0);
    let out = Matrix3::new(s, 0.0, c.x, 0.0, s, c.y, 0.0, 0.0, 1.0);
    let h = into * motion.matrix() * out;
    let h = h / h[(2, 2)];
    let mut normal = SMatrix::<f64, 8, 8>::zeros();
    let mut right = SVector::<f64, 8>::zeros();
    for (p, q, weight) in pairs {
        let (p, q) = (frame.normalise(p), frame.normalise(q));
        let w = h[(2, 0)] * p.x + h[(2, 1)] * p.y + 1.0;
        let u = (h[(0, 0)] * p.x + h[(0, 1)] * p.y + h[(0, 2)]) / w;
        let v = (h[(1, 0)] * p.x + h[(1, 1)] * p.y + h[(1, 2)]) / w;
        let (x, y, o) = (p.x / w, p.y / w, 1.0 / w);
        let ju = SVector::<f64, 8>::from([x, y, o, 0.0, 0.0, 0.0, -u * x, -u * y]);
        let jv = SVector::<f64, 8>::from([0.0, 0.0, 0.0, x, y, o, -v * x, -v * y]);
        normal += (ju * ju.transpose() + jv * jv.transpose()) * weight;
        right += (ju * (q.x - u) + jv * (q.y - v)) * weight;
    }
    let step = normal.cholesky()?.solve(&right);
    let h = Matrix3::new(
        h[(0, 0)] + step[0],
        h[(0, 1)] + step[1],
        h[(0, 2)] + step[2],
        h[(1, 0)] + step[3],
        h[(1, 1)] + step[4],
        h[(1, 2)] + step[5],
        h[(2, 0)] + step[6],
        h[(2, 1)] + step[7],
        1.0,
    );
    frame.to_pixels(&h)
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
