//! Four straight sides fitted to an opening's outline.

use net_geometry::nalgebra::Vector2;

/// Parts of a side, from its middle to its ends, that take part in the fit: knots round the corners off.
const SIDE_PART: f64 = 0.72;
/// Standard deviation of an outline point, px, against which the prior on a side's direction is weighed.
const POINT_SIGMA_PX: f64 = 0.3;
/// Standard deviation of a side's direction about the first guess, rad: twines sag and nets deform.
const DIRECTION_SIGMA: f64 = 0.08;
/// Distance from a side at which a point counts half, parts of half a side, round by round.
const SOFTNESS: [f64; 3] = [0.1, 0.04, 0.015];
/// The least such distance, px: twice the scatter of a good outline's points.
const SOFTNESS_MIN_PX: f64 = 0.5;

/// A quadrilateral with what its fit left over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Quadrilateral {
    /// Corners in the sense from u to v.
    pub corners: [Vector2<f64>; 4],
    /// Root mean square distance of the outline from the sides, corners left out, px.
    pub rms: f64,
}

/// Fits the sides of a quadrilateral that looks about like the parallelogram with half sides `half1`, `half2` (directions
/// matter, lengths do not). Each point belongs to the side it lies nearest to; distances count robustly; a side's direction is held
/// loosely to the guess, as short sides would otherwise turn with the noise. `None` if a side has fewer than two points.
pub(crate) fn fit_quadrilateral(
    outline: &[Vector2<f64>],
    half1: Vector2<f64>,
    half2: Vector2<f64>,
) -> Option<Quadrilateral> {
    let cross = half1.perp(&half2);
    if !(cross.is_finite() && cross != 0.0) {
        return None;
    }
    // Coordinates along the guess: its sides are at ±1 once centre and lengths are taken from the outline's extent.
    let along = |p: Vector2<f64>| Vector2::new(p.perp(&half2) / cross, half1.perp(&p) / cross);
    let (mut low, mut high) = (Vector2::repeat(f64::MAX), Vector2::repeat(f64::MIN));
    for p in outline {
        let q = along(*p);
        low = low.inf(&q);
        high = high.sup(&q);
    }
    let extent = (high - low) * 0.5;
    let middle = (high + low) * 0.5;
    if !(extent.x > 0.0 && extent.y > 0.0) {
        return None;
    }
    let centre = half1 * middle.x + half2 * middle.y;
    let mut quad = Quadrilateral {
        corners: super::rectangle::parallelogram_corners(centre, half1 * extent.x, half2 * extent.y),
        rms: 0.0,
    };
    for softness in SOFTNESS {
        quad = refine(outline, &quad, [half1 * extent.x, half2 * extent.y], softness)?;
    }
    Some(quad)
}

/// One round: sides refitted to the points that lie nearest to them now.
fn refine(
    outline: &[Vector2<f64>],
    quad: &Quadrilateral,
    guess: [Vector2<f64>; 2],
    softness: f64,
) -> Option<Quadrilateral> {
    let corners = &quad.corners;
    let centre = corners.iter().sum::<Vector2<f64>>() * 0.25;
    let half1 = (corners[1] + corners[2] - corners[0] - corners[3]) * 0.25;
    let half2 = (corners[2] + corners[3] - corners[0] - corners[1]) * 0.25;
    let cross = half1.perp(&half2);
    if !(cross.is_finite() && cross.abs() > 1e-9) {
        return None;
    }
    // Sides in the order of their first corners: −half2, +half1, +half2, −half1.
    let mut sides = [Side::default(); 4];
    for k in 0..4 {
        let direction = guess[k % 2];
        let sign = if k < 2 { 1.0 } else { -1.0 };
        let tangent = (direction * sign).try_normalize(0.0)?;
        sides[k] = Side {
            middle: (corners[k] + corners[(k + 1) % 4]) * 0.5,
            tangent,
            normal: Vector2::new(-tangent.y, tangent.x),
            current: quad_direction(corners, k, tangent),
            softness: (softness * direction.norm()).max(SOFTNESS_MIN_PX),
            ..Side::default()
        };
    }
    for p in outline {
        let q = p - centre;
        let (x, y) = (q.perp(&half2) / cross, half1.perp(&q) / cross);
        let (k, part) =
            if x.abs() > y.abs() { (if x > 0.0 { 1 } else { 3 }, y) } else { (if y > 0.0 { 2 } else { 0 }, x) };
        if part.abs() <= SIDE_PART {
            sides[k].add(*p);
        }
    }
    let mut lines = [(Vector2::zeros(), Vector2::zeros()); 4];
    let (mut squares, mut count) = (0.0, 0.0);
    for (line, side) in lines.iter_mut().zip(&sides) {
        *line = side.line()?;
        squares += side.squares;
        count += side.count;
    }
    let mut fitted = Quadrilateral { corners: quad.corners, rms: f64::sqrt(squares / count) };
    for k in 0..4 {
        // Corner k lies between side k - 1 and side k.
        let ((p, s), (q, t)) = (lines[(k + 3) % 4], lines[k]);
        let sine = s.perp(&t);
        if sine.abs() < 0.1 {
            return None;
        }
        fitted.corners[k] = p + s * ((q - p).perp(&t) / sine);
    }
    Some(fitted)
}

/// Slope of side `k` against its prior direction.
fn quad_direction(corners: &[Vector2<f64>; 4], k: usize, tangent: Vector2<f64>) -> f64 {
    let side = corners[(k + 1) % 4] - corners[k];
    let along = side.dot(&tangent);
    if along > 0.0 { (tangent.perp(&side) / along).clamp(-0.6, 0.6) } else { 0.0 }
}

/// Sums of a robust straight-line fit `across = offset + slope * along` about `middle`.
#[derive(Debug, Clone, Copy, Default)]
struct Side {
    middle: Vector2<f64>,
    /// Prior direction.
    tangent: Vector2<f64>,
    normal: Vector2<f64>,
    /// Slope of the last round, from which residuals are taken.
    current: f64,
    /// Distance at which a point counts half, px.
    softness: f64,
    weight: f64,
    a: f64,
    aa: f64,
    q: f64,
    aq: f64,
    /// Plain count and squared distances from the last round's line.
    count: f64,
    squares: f64,
}

impl Side {
    fn add(&mut self, point: Vector2<f64>) {
        let d = point - self.middle;
        let (along, across) = (d.dot(&self.tangent), d.dot(&self.normal));
        let residual = across - self.current * along;
        // Cauchy: an outline that runs astray at a tuft or a break pulls little.
        let weight = 1.0 / (1.0 + (residual / self.softness).powi(2));
        self.weight += weight;
        self.a += weight * along;
        self.aa += weight * along * along;
        self.q += weight * across;
        self.aq += weight * along * across;
        self.count += 1.0;
        self.squares += residual * residual;
    }

    /// A point of the line and its direction.
    fn line(&self) -> Option<(Vector2<f64>, Vector2<f64>)> {
        if self.count < 2.0 {
            return None;
        }
        let prior = (POINT_SIGMA_PX / DIRECTION_SIGMA).powi(2);
        let determinant = self.weight * (self.aa + prior) - self.a * self.a;
        if determinant.is_nan() || determinant <= 0.0 {
            return None;
        }
        let slope = (self.weight * self.aq - self.a * self.q) / determinant;
        let offset = (self.q - slope * self.a) / self.weight;
        let point = self.middle + self.normal * offset;
        Some((point, self.tangent + self.normal * slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points along a quadrilateral's sides, `step` px apart.
    fn outline_of(corners: [Vector2<f64>; 4], step: f64) -> Vec<Vector2<f64>> {
        (0..4)
            .flat_map(|k| {
                let (a, b) = (corners[k], corners[(k + 1) % 4]);
                let n = ((b - a).norm() / step).ceil() as usize;
                (0..n).map(move |i| a + (b - a) * (i as f64 / n as f64))
            })
            .collect()
    }

    fn skewed() -> [Vector2<f64>; 4] {
        [(10.0, 10.0), (42.0, 13.0), (47.0, 38.0), (14.0, 36.0)].map(|(x, y)| Vector2::new(x, y))
    }

    #[test]
    fn straight_sides_are_found_where_they_are() {
        let corners = skewed();
        let quad =
            fit_quadrilateral(&outline_of(corners, 1.0), Vector2::x(), Vector2::new(0.1, 1.0)).expect("four sides");
        for (c, e) in quad.corners.iter().zip(&corners) {
            // The prior on directions pulls sides of 30 px by a hundredth of their slope.
            assert!((c - e).norm() < 0.1, "{c} for {e}");
        }
        assert!(quad.rms < 0.05);
    }

    #[test]
    fn round_corners_and_a_tuft_do_not_move_the_corners() {
        let corners = skewed();
        let centre = corners.iter().sum::<Vector2<f64>>() * 0.25;
        let mut outline = outline_of(corners, 1.0);
        outline.retain(|p| corners.iter().all(|c| (p - c).norm() > 4.0));
        for p in &mut outline {
            // A tuft of 3 px into the opening on a fifth of the upper side.
            if p.y < 14.0 && (24.0..30.0).contains(&p.x) {
                *p += (centre - *p).normalize() * 3.0;
            }
        }
        let quad = fit_quadrilateral(&outline, Vector2::x(), Vector2::y()).expect("four sides");
        for (c, e) in quad.corners.iter().zip(&corners) {
            // The tuft's points count about a tenth.
            assert!((c - e).norm() < 0.5, "{c} for {e}");
        }
    }

    #[test]
    fn what_has_no_four_sides_is_refused() {
        assert!(fit_quadrilateral(&[], Vector2::x(), Vector2::y()).is_none());
        assert!(fit_quadrilateral(&[Vector2::zeros(); 5], Vector2::x(), Vector2::y()).is_none());
        let line: Vec<_> = (0..9).map(|k| Vector2::new(f64::from(k), 0.0)).collect();
        assert!(fit_quadrilateral(&line, Vector2::x(), Vector2::y()).is_none());
        assert!(fit_quadrilateral(&outline_of(skewed(), 1.0), Vector2::x(), Vector2::x()).is_none());
        assert!(fit_quadrilateral(&outline_of(skewed(), 1.0), Vector2::x() * f64::NAN, Vector2::y()).is_none());
    }
}
