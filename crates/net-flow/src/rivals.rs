//! Stage 4: could it have been the next cell?
//!
//! A regular net looks the same after a step of one cell. For every rival, the consensus moved by a lattice vector, each agreeing point is scored
//! at the winner and at the rival, over equal neighbourhoods. Where the picture holds something that does not repeat, the winner scores higher by
//! more than chance; where it does not, only a prior can decide, and without one the motion is ambiguous.

use nalgebra::{Matrix3, Vector2};
use net_geometry::Basis;
use net_image::Pyramid;

use crate::block_match::Matcher;
use crate::consensus::median_of;
use crate::motion::Motion;
use crate::surface::{SurfacePeak, spread};

/// Most rivals compared.
pub(crate) const MAX_RIVALS: usize = 10;
/// Fewer points than this compare nothing.
const MIN_COMPARED: usize = 8;
/// Most that the pictures can say, standard deviations: beyond it errors that all points share dominate.
const MAX_Z: f64 = 10.0;

/// Standard deviation of differences that all points share though the net is perfectly regular, in units of correlation: light that stays with the
/// camera, edges of shadows. Measured on regular nets: up to 0.0065; nets whose knots are displaced by 6 % of a cell show 0.11 to 0.15.
const SYSTEMATIC: f64 = 0.007;

/// What is known of the lattice in the earlier picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lattice {
    /// The same two lattice vectors everywhere: a net seen nearly square on.
    Uniform(Basis),
    /// The homography from lattice coordinates (i, j) to pixels.
    Plane(Matrix3<f64>),
}

impl Lattice {
    /// Displacement of `cells` lattice steps at `pixel`, px; `None` where the lattice makes no sense.
    pub fn step(&self, pixel: Vector2<f64>, cells: (i32, i32)) -> Option<Vector2<f64>> {
        let (i, j) = (f64::from(cells.0), f64::from(cells.1));
        let shift = match self {
            Self::Uniform(basis) => basis.b1 * i + basis.b2 * j,
            Self::Plane(pixel_from_lattice) => {
                let at = pixel_from_lattice.try_inverse()?.transform_point(&pixel.into());
                let there = pixel_from_lattice.transform_point(&(at + Vector2::new(i, j)));
                there.coords - pixel
            }
        };
        shift.iter().all(|x| x.is_finite()).then_some(shift)
    }

    /// The same lattice in another picture: exact for a plane; of a uniform one the vectors at the middle of the picture.
    pub(crate) fn carried(&self, there_from_here: &Motion, width: usize, height: usize) -> Self {
        match self {
            Self::Plane(h) => Self::Plane(there_from_here.matrix() * h),
            Self::Uniform(basis) => {
                let turn = there_from_here.jacobian(Vector2::new(width as f64 / 2.0, height as f64 / 2.0));
                Self::Uniform(Basis { b1: turn * basis.b1, b2: turn * basis.b2 })
            }
        }
    }
}

/// A motion that the winner must beat: the winner and a shift on top.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rival {
    /// The shift on top of the winner at the middle of the points, px.
    pub shift_px: Vector2<f64>,
    /// The shift in cells, when a lattice was given.
    pub cells: Option<(i32, i32)>,
    /// Median over points of the winner's normalised correlation less the rival's.
    pub margin: f64,
    /// Mean of that difference in its standard errors: positive for the winner.
    pub z: f64,
    /// Points whose own match agrees with the rival.
    pub support: usize,
    /// Points compared.
    pub compared: usize,
    /// Natural logarithm of the odds of winner to rival, from the pictures and the prior together; infinite for a rival that the
    /// bounds rule out.
    pub log_odds: f64,
}

/// What the caller expects of the motion, as far as it decides between cells.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Expectation {
    /// Expected motion and its standard deviation, px.
    pub prior: Option<(Motion, f64)>,
    /// Most that the picture can move, px.
    pub max_step_px: Option<f64>,
}

/// Compares the winner with its rivals. Owns its buffers.
#[derive(Debug, Clone)]
pub(crate) struct Rivals {
    /// Per rival, the winner's score less the rival's at each compared point.
    differences: [Vec<f64>; MAX_RIVALS],
    sorted: Vec<f64>,
    rivals: Vec<Rival>,
}

/// The points that take part, and what they showed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Evidence<'a> {
    /// Pixels in the earlier picture.
    pub from: &'a [Vector2<f64>],
    /// Their matches in the later one.
    pub to: &'a [Vector2<f64>],
    /// Who agrees with the winner.
    pub agrees: &'a [bool],
    /// Distance within which a match agrees, px.
    pub threshold_px: f64,
    /// Most points compared.
    pub most: usize,
}

impl Rivals {
    /// Buffers to compare up to `points` points.
    pub(crate) fn new(points: usize) -> Self {
        Self {
            differences: std::array::from_fn(|_| Vec::with_capacity(points)),
            sorted: Vec::with_capacity(points),
            rivals: Vec::with_capacity(MAX_RIVALS),
        }
    }

    /// Fills the list of rivals of `winner`: the eight neighbouring cells when a lattice is known, else the other peaks of the summed surfaces
    /// round it.
    pub(crate) fn compare(
        &mut self,
        matcher: &mut Matcher,
        prev: &Pyramid,
        next: &Pyramid,
        winner: &Motion,
        evidence: &Evidence<'_>,
        candidates: Candidates<'_>,
        expectation: &Expectation,
    ) -> &[Rival] {
        self.rivals.clear();
        let agreed = evidence.agrees.iter().filter(|&&a| a).count().max(1);
        let sum = |list: &[Vector2<f64>]| {
            list.iter().zip(evidence.agrees).filter(|(_, a)| **a).map(|(p, _)| p).sum::<Vector2<f64>>()
        };
        let middle = sum(evidence.from) / agreed as f64;
        let count = candidates.len().min(MAX_RIVALS);
        self.differences.iter_mut().for_each(Vec::clear);
        for i in spread(evidence.from.len(), evidence.most).filter(|&i| evidence.agrees[i]) {
            let p = evidence.from[i];
            if !matcher.hold(prev, p, &winner.jacobian(p)) {
                continue;
            }
            let Some(base) = matcher.score_at(next, winner.apply(p)) else { continue };
            for (k, differences) in self.differences.iter_mut().enumerate().take(count) {
                let there = candidates.shift(k, p, winner).map(|shift| winner.apply(p) + shift);
                if let Some(score) = there.and_then(|there| matcher.score_at(next, there)) {
                    differences.push(f64::from(base - score));
                }
            }
        }
        for k in 0..count {
            if let Some(rival) = self.rival(winner, evidence, &candidates, k, middle, expectation) {
                self.rivals.push(rival);
            }
        }
        self.rivals.sort_unstable_by(|a, b| a.log_odds.total_cmp(&b.log_odds));
        &self.rivals
    }

    /// The rivals of the last comparison, the most dangerous first.
    pub(crate) fn list(&self) -> &[Rival] {
        &self.rivals
    }

    /// Forgets the last comparison.
    pub(crate) fn clear(&mut self) {
        self.rivals.clear();
    }

    /// What the differences, the points' own matches and the expectation say of rival `k`.
    fn rival(
        &mut self,
        winner: &Motion,
        evidence: &Evidence<'_>,
        candidates: &Candidates<'_>,
        k: usize,
        middle: Vector2<f64>,
        expectation: &Expectation,
    ) -> Option<Rival> {
        let shift_px = candidates.shift(k, middle, winner)?;
        let cells = candidates.cells(k);
        let differences = &self.differences[k];
        let compared = differences.len();
        let margin = median_of(&mut self.sorted, differences.iter().copied());
        let z = standard_errors(differences);
        let near = |(&p, &q): (&Vector2<f64>, &Vector2<f64>)| {
            candidates.shift(k, p, winner).is_some_and(|s| (winner.apply(p) + s - q).norm() <= evidence.threshold_px)
        };
        let support = evidence.from.iter().zip(evidence.to).filter(|&pair| near(pair)).count();
        let mut log_odds = if compared < MIN_COMPARED { 0.0 } else { z.abs().min(MAX_Z).powi(2) / 2.0 * z.signum() };
        let (here, there) = (winner.apply(middle), winner.apply(middle) + shift_px);
        if let Some((prior, sigma_px)) = &expectation.prior {
            let expected = prior.apply(middle);
            log_odds +=
                ((there - expected).norm_squared() - (here - expected).norm_squared()) / (2.0 * sigma_px * sigma_px);
        }
        if let Some(bound) = expectation.max_step_px {
            match ((here - middle).norm() <= bound, (there - middle).norm() <= bound) {
                (true, false) => log_odds = f64::INFINITY,
                (false, true) => log_odds = f64::NEG_INFINITY,
                _ => {}
            }
        }
        // A prior that makes no sense (NaN) decides nothing.
        let log_odds = if log_odds.is_nan() { 0.0 } else { log_odds };
        Some(Rival { shift_px, cells, margin, z, support, compared, log_odds })
    }
}

/// Where rivals come from.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Candidates<'a> {
    /// The eight neighbouring cells.
    Lattice(&'a Lattice),
    /// Other peaks of the summed surfaces round the winner.
    Peaks(&'a [SurfacePeak]),
}

/// Neighbours of a cell.
const NEIGHBOURS: [(i32, i32); 8] = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)];

impl Candidates<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Lattice(_) => NEIGHBOURS.len(),
            Self::Peaks(peaks) => peaks.len(),
        }
    }

    /// Rival `k` in cells, where these are known.
    fn cells(&self, k: usize) -> Option<(i32, i32)> {
        match self {
            Self::Lattice(_) => Some(NEIGHBOURS[k]),
            Self::Peaks(_) => None,
        }
    }

    /// Shift of rival `k` for a point of the earlier picture, px of the later one.
    fn shift(&self, k: usize, point: Vector2<f64>, winner: &Motion) -> Option<Vector2<f64>> {
        match self {
            Self::Lattice(lattice) => {
                // The neighbouring knot's picture, carried along by the winner.
                let there = point + lattice.step(point, NEIGHBOURS[k])?;
                let shift = winner.apply(there) - winner.apply(point);
                shift.iter().all(|x| x.is_finite()).then_some(shift)
            }
            Self::Peaks(peaks) => Some(peaks[k].shift),
        }
    }
}

/// Mean over its standard error, the systematic one included; zero for fewer than two values.
fn standard_errors(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    if values.len() < 2 {
        return 0.0;
    }
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    mean / (variance / n + SYSTEMATIC * SYSTEMATIC).sqrt()
}
