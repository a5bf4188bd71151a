//! Convex hull, rectangle of least area, parallelogram of least area.

use net_geometry::nalgebra::Vector2;

/// A rectangle in any direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rectangle {
    /// Its middle, px.
    pub centre: Vector2<f64>,
    /// Half of its first side, px: from the centre to the middle of an edge.
    pub half1: Vector2<f64>,
    /// Half of its second side, px, a right angle from the first in the sense from u to v.
    pub half2: Vector2<f64>,
}

impl Rectangle {
    /// Area, px².
    pub fn area(&self) -> f64 {
        4.0 * self.half1.norm() * self.half2.norm()
    }

    /// Its corners, going round in the sense from u to v.
    pub fn corners(&self) -> [Vector2<f64>; 4] {
        parallelogram_corners(self.centre, self.half1, self.half2)
    }
}

/// Corners of the parallelogram `centre ± half1 ± half2`: (−, −), (+, −), (+, +), (−, +).
pub(crate) fn parallelogram_corners(
    centre: Vector2<f64>,
    half1: Vector2<f64>,
    half2: Vector2<f64>,
) -> [Vector2<f64>; 4] {
    [centre - half1 - half2, centre + half1 - half2, centre + half1 + half2, centre - half1 + half2]
}

/// Convex hull of `points` into `hull` (cleared first) in the sense from u to v, without points on its edges (Andrew 1979).
/// `points` are sorted in place. Fewer than three hull points mean that the points lie on a line.
pub fn convex_hull(points: &mut [Vector2<f64>], hull: &mut Vec<Vector2<f64>>) {
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    hull.clear();
    half_hull(points.iter().copied(), hull);
    half_hull(points.iter().rev().copied(), hull);
}

/// Appends one side of the hull of ordered points, but for its last point, which begins the other side.
pub(crate) fn half_hull(ordered: impl Iterator<Item = Vector2<f64>>, hull: &mut Vec<Vector2<f64>>) {
    let base = hull.len();
    for p in ordered {
        while let [.., a, b] = hull[base..] {
            if (b - a).perp(&(p - b)) > 0.0 {
                break;
            }
            hull.pop();
        }
        hull.push(p);
    }
    hull.pop();
}

/// Sides of a polygon at which [`min_area_rectangle`] sets its calipers together.
const TOGETHER: usize = 4;

/// The rectangle of least area around a convex polygon in the sense from u to v, by calipers (Toussaint 1983): one of its sides lies on a side of the
/// polygon. The calipers are not turned from side to side but set at several sides at once, which for the few corners of a mesh is quicker. `None` for fewer
/// than three corners or no area.
pub fn min_area_rectangle(hull: &[Vector2<f64>]) -> Option<Rectangle> {
    let n = hull.len();
    if n < 3 {
        return None;
    }
    let corner = |k: usize| hull[if k < n { k } else { k - n }];
    let mut best = None;
    let mut least = f64::INFINITY;
    for first in (0..n).step_by(TOGETHER) {
        // Not of unit length: lengths along and across them are so many times too long. After the last side comes the first again.
        let sides: [Vector2<f64>; TOGETHER] = std::array::from_fn(|k| corner(first + k + 1) - corner(first + k));
        let (x, y) = (sides.map(|side| side.x), sides.map(|side| side.y));
        let [mut low, mut high, mut far] =
            [[f64::INFINITY; TOGETHER], [-f64::INFINITY; TOGETHER], [-f64::INFINITY; TOGETHER]];
        for p in hull {
            for k in 0..TOGETHER {
                let along = x[k] * p.x + y[k] * p.y;
                let across = x[k] * p.y - y[k] * p.x;
                // Unlike `f64::min` these are one instruction each.
                low[k] = if along < low[k] { along } else { low[k] };
                high[k] = if along > high[k] { along } else { high[k] };
                far[k] = if across > far[k] { across } else { far[k] };
            }
        }
        for (k, here) in hull[first..].iter().take(TOGETHER).enumerate() {
            let (side, square) = (sides[k], sides[k].norm_squared());
            let near = side.perp(here);
            let area = (high[k] - low[k]) * (far[k] - near) / square;
            // Neither where two corners are in one place (no number) nor where there are no numbers at all.
            if area < least {
                least = area;
                let normal = Vector2::new(-side.y, side.x);
                best = Some((side / square, normal / square, [low[k], high[k], near, far[k]]));
            }
        }
    }
    let (side, normal, [low, high, near, far]) = best?;
    let rectangle = Rectangle {
        centre: side * (0.5 * (low + high)) + normal * (0.5 * (near + far)),
        half1: side * (0.5 * (high - low)),
        half2: normal * (0.5 * (far - near)),
    };
    Some(rectangle).filter(|b| b.area() > 0.0 && b.area().is_finite())
}

/// Half sides of the parallelogram of least area around a convex polygon, longer side's direction first as found, in the sense from
/// u to v, with its centre: `(centre, half1, half2)`. Both pairs of its sides touch a side of the polygon (Schwarz et al. 1995).
/// `heights` is scratch. `None` for fewer than three corners or no area.
pub fn min_area_parallelogram(
    hull: &[Vector2<f64>],
    heights: &mut Vec<f64>,
) -> Option<(Vector2<f64>, Vector2<f64>, Vector2<f64>)> {
    let n = hull.len();
    if n < 3 {
        return None;
    }
    let direction = |i: usize| (hull[(i + 1) % n] - hull[i]).try_normalize(0.0);
    heights.clear();
    let mut across = 1;
    for i in 0..n {
        across = across.max(i + 1);
        let Some(t) = direction(i) else {
            heights.push(f64::INFINITY);
            continue;
        };
        let height = |k: usize| t.perp(&(hull[k % n] - hull[i]));
        for _ in 0..n {
            if height(across + 1) <= height(across) {
                break;
            }
            across += 1;
        }
        heights.push(height(across));
    }
    let mut best: Option<(f64, usize, usize)> = None;
    for i in 0..n {
        let Some(t1) = direction(i) else { continue };
        for j in i + 1..n {
            let Some(t2) = direction(j) else { continue };
            let sine = t1.perp(&t2).abs();
            // Sides within 15 degrees of each other enclose no cell.
            if sine < 0.26 {
                continue;
            }
            let area = heights[i] * heights[j] / sine;
            if best.is_none_or(|(least, ..)| area < least) {
                best = Some((area, i, j));
            }
        }
    }
    let (area, i, j) = best.filter(|(area, ..)| *area > 0.0 && area.is_finite())?;
    let (t1, t2) = (direction(i)?, direction(j)?);
    let cross = t1.perp(&t2);
    // The centre lies half a height above both sides; along side i run |height_j / sine| px.
    let above_i = t1.perp(&hull[i]) + 0.5 * heights[i];
    let above_j = t2.perp(&hull[j]) + 0.5 * heights[j];
    // perp(t1, c) = above_i, perp(t2, c) = above_j, with c = a t1 + b t2.
    let centre = t1 * (-above_j / cross) + t2 * (above_i / cross);
    let half1 = t1 * (0.5 * heights[j] / cross.abs());
    let half2 = t2 * (0.5 * heights[i] / cross.abs());
    debug_assert!(area.is_finite());
    Some(if cross > 0.0 { (centre, half1, half2) } else { (centre, half1, -half2) })
}

#[cfg(test)]
mod tests {
    use net_geometry::nalgebra::Rotation2;
    use proptest::prelude::*;

    use super::*;

    fn shoelace(polygon: &[Vector2<f64>]) -> f64 {
        (0..polygon.len()).map(|i| polygon[i].perp(&polygon[(i + 1) % polygon.len()])).sum::<f64>() * 0.5
    }

    fn cloud() -> impl Strategy<Value = Vec<Vector2<f64>>> {
        prop::collection::vec((-50.0..50.0, -50.0..50.0).prop_map(|(x, y)| Vector2::new(x, y)), 3..40)
    }

    /// Rectangle around all points whose first side runs along `angle`.
    fn box_area(points: &[Vector2<f64>], angle: f64) -> f64 {
        let turned: Vec<_> = points.iter().map(|p| Rotation2::new(-angle) * p).collect();
        let span = |f: fn(&Vector2<f64>) -> f64| {
            turned.iter().map(f).fold(f64::MIN, f64::max) - turned.iter().map(f).fold(f64::MAX, f64::min)
        };
        span(|p| p.x) * span(|p| p.y)
    }

    proptest! {
        #[test]
        fn no_direction_gives_a_smaller_rectangle(mut points in cloud(), angle in 0.0..3.2) {
            let mut hull = Vec::new();
            let all = points.clone();
            convex_hull(&mut points, &mut hull);
            prop_assume!(hull.len() >= 3);
            let rectangle = min_area_rectangle(&hull).expect("a hull with area");
            // Rounding of sums of products of 50 px coordinates.
            prop_assert!(rectangle.area() <= box_area(&all, angle) * (1.0 + 1e-9) + 1e-9);
            for p in &all {
                let q = p - rectangle.centre;
                for half in [rectangle.half1, rectangle.half2] {
                    prop_assert!(q.dot(&half).abs() <= half.norm_squared() + 1e-6);
                }
            }
        }

        #[test]
        fn the_parallelogram_holds_all_points_and_is_no_larger_than_the_rectangle(mut points in cloud()) {
            let (mut hull, mut heights) = (Vec::new(), Vec::new());
            let all = points.clone();
            convex_hull(&mut points, &mut hull);
            prop_assume!(hull.len() >= 3 && shoelace(&hull) > 1.0);
            let Some((centre, half1, half2)) = min_area_parallelogram(&hull, &mut heights) else {
                // Only slivers have no two sides more than 15 degrees apart.
                return Ok(());
            };
            let area = 4.0 * half1.perp(&half2);
            prop_assert!(area > 0.0);
            for p in &all {
                let q = p - centre;
                prop_assert!((half1.perp(&q) / half1.perp(&half2)).abs() <= 1.0 + 1e-6);
                prop_assert!((q.perp(&half2) / half1.perp(&half2)).abs() <= 1.0 + 1e-6);
            }
            // The least parallelogram contains the polygon, and no polygon's exceeds its least rectangle unless slivers were skipped.
            prop_assert!(area >= shoelace(&hull) * (1.0 - 1e-9));
        }
    }

    #[test]
    fn a_parallelogram_is_its_own_least_parallelogram() {
        let (a, b) = (Vector2::new(9.0, 2.0), Vector2::new(-3.0, 7.0));
        let centre = Vector2::new(40.0, 20.0);
        let mut corners = parallelogram_corners(centre, a * 0.5, b * 0.5);
        let (mut hull, mut heights) = (Vec::new(), Vec::new());
        convex_hull(&mut corners, &mut hull);
        let (c, h1, h2) = min_area_parallelogram(&hull, &mut heights).expect("it has area");
        assert!((c - centre).norm() < 1e-9);
        assert!((4.0 * h1.perp(&h2) - a.perp(&b)).abs() < 1e-9);
    }

    #[test]
    fn corners_of_a_turned_square_are_not_rounded_to_pixels() {
        let turn = Rotation2::new(0.3);
        let centre = Vector2::new(10.25, 20.75);
        let mut points: Vec<_> = [(-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0)]
            .map(|(x, y)| centre + turn * Vector2::new(x, y))
            .into();
        let expected = points.clone();
        let mut hull = Vec::new();
        convex_hull(&mut points, &mut hull);
        let corners = min_area_rectangle(&hull).expect("it has area").corners();
        for e in expected {
            assert!(corners.iter().any(|c| (c - e).norm() < 1e-9), "{e} not among {corners:?}");
        }
    }

    #[test]
    fn points_on_a_line_have_no_rectangle() {
        let mut points: Vec<_> = (0..5).map(|k| Vector2::new(f64::from(k), 2.0 * f64::from(k))).collect();
        let mut hull = Vec::new();
        convex_hull(&mut points, &mut hull);
        assert!(min_area_rectangle(&hull).is_none());
        convex_hull(&mut [], &mut hull);
        assert!(min_area_rectangle(&hull).is_none());
        convex_hull(&mut [Vector2::new(1.0, 1.0)], &mut hull);
        assert!(min_area_rectangle(&hull).is_none());
    }
}
