//! A net of unstretchable twine on a bent surface (a Chebyshev net): two threads through the origin are laid out, then every other
//! knot is where its two neighbours' twines meet, as draping a cloth is computed.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::sheet::Sheet;
use crate::scene::Net;

/// Knots on a surface, in the net frame.
#[derive(Debug, Default)]
pub(crate) struct Drape {
    /// What the knots were computed for.
    made_for: Option<(Sheet, [f64; 4], [f64; 2])>,
    /// First and last column and row.
    columns: [i32; 2],
    rows: [i32; 2],
    /// Row by row; NaN where no net can lie (the meshes collapse).
    points: Vec<Vector3<f64>>,
}

impl Drape {
    /// Lays out the knots of `columns` x `rows`, which are widened to hold the origin. Keeps what it has if that will do.
    pub(crate) fn lay(&mut self, net: &Net, sheet: &Sheet, columns: [i32; 2], rows: [i32; 2]) {
        let columns = [columns[0].min(0), columns[1].max(0)];
        let rows = [rows[0].min(0), rows[1].max(0)];
        let sides = [net.side1_m, net.side2_m, net.angle_deg, net.shear_deg];
        let made_for = Some((sheet.clone(), sides, net.surface.thread_bend_per_m));
        let inside = |have: [i32; 2], need: [i32; 2]| have[0] <= need[0] && have[1] >= need[1];
        if self.made_for == made_for && inside(self.columns, columns) && inside(self.rows, rows) {
            return;
        }
        (self.made_for, self.columns, self.rows) = (made_for, columns, rows);
        let count = (columns[1] - columns[0] + 1) as usize * (rows[1] - rows[0] + 1) as usize;
        self.points.clear();
        self.points.resize(count, Vector3::repeat(f64::NAN));
        let crossing = (net.angle_deg + net.shear_deg).to_radians();
        self.set(0, 0, sheet.point(Vector2::zeros()));
        for (sign, limits) in [(1, columns), (-1, columns)] {
            self.thread(sheet, [sign, 0], limits, 0.0, net.surface.thread_bend_per_m[0], net.side1_m);
        }
        for (sign, limits) in [(1, rows), (-1, rows)] {
            self.thread(sheet, [0, sign], limits, crossing, net.surface.thread_bend_per_m[1], net.side2_m);
        }
        for row_sign in [1, -1] {
            for column_sign in [1, -1] {
                self.quadrant(sheet, column_sign, row_sign, [net.side1_m, net.side2_m]);
            }
        }
    }

    /// Knot `(i, j)` in the net frame; `None` outside and where there can be none.
    #[inline]
    pub(crate) fn point(&self, i: i32, j: i32) -> Option<Vector3<f64>> {
        Some(self.points[self.index(i, j)?]).filter(|p| p.x.is_finite())
    }

    fn index(&self, i: i32, j: i32) -> Option<usize> {
        let ([first, last], [top, bottom]) = (self.columns, self.rows);
        let inside = (first..=last).contains(&i) && (top..=bottom).contains(&j);
        inside.then(|| (j - top) as usize * (last - first + 1) as usize + (i - first) as usize)
    }

    fn set(&mut self, i: i32, j: i32, point: Vector3<f64>) {
        if let Some(k) = self.index(i, j) {
            self.points[k] = point;
        }
    }

    /// Lays a thread from the origin in steps of `side` (straight through the water from knot to knot), its heading in the net's
    /// plane turning by `bend` per metre.
    fn thread(&mut self, sheet: &Sheet, step: [i32; 2], limits: [i32; 2], heading: f64, bend: f64, side: f64) {
        let sign = f64::from(step[0] + step[1]);
        let last = if sign > 0.0 { limits[1] } else { -limits[0] };
        let mut here = sheet.point(Vector2::zeros());
        for k in 1..=last {
            let middle = sign * (f64::from(k) - 0.5) * side;
            let (sin, cos) = (heading + bend * middle).sin_cos();
            let direction = Vector2::new(cos, sin) * sign;
            // Newton on the way along the heading until the chord has the side's length.
            let mut way = side;
            let mut next = here;
            for _ in 0..20 {
                let p = here.xy() + direction * way;
                let (height, slope) = sheet.height(p);
                next = Vector3::new(p.x, p.y, height);
                let chord = next - here;
                let excess = chord.norm_squared() - side * side;
                let gain = 2.0 * chord.dot(&Vector3::new(direction.x, direction.y, slope.dot(&direction)));
                way -= excess / gain;
                if excess.abs() < 1e-15 * side {
                    break;
                }
            }
            if ((next - here).norm() / side - 1.0).abs() > 1e-9 {
                return;
            }
            self.set(step[0] * k, step[1] * k, next);
            here = next;
        }
    }

    /// Fills one quadrant from its two threads.
    fn quadrant(&mut self, sheet: &Sheet, column_sign: i32, row_sign: i32, sides: [f64; 2]) {
        let last = |sign: i32, limits: [i32; 2]| if sign > 0 { limits[1] } else { -limits[0] };
        for row in 1..=last(row_sign, self.rows) {
            for column in 1..=last(column_sign, self.columns) {
                let (i, j) = (column_sign * column, row_sign * row);
                let (beside, below) = (self.point(i - column_sign, j), self.point(i, j - row_sign));
                let corner = self.point(i - column_sign, j - row_sign);
                let (Some(beside), Some(below), Some(corner)) = (beside, below, corner) else { continue };
                if let Some(point) = fourth(sheet, corner, [beside, below], sides) {
                    self.set(i, j, point);
                }
            }
        }
    }
}

/// The knot that completes a mesh: `sides[0]` from the first neighbour, `sides[1]` from the second, opposite `corner`.
fn fourth(sheet: &Sheet, corner: Vector3<f64>, neighbours: [Vector3<f64>; 2], sides: [f64; 2]) -> Option<Vector3<f64>> {
    let mut p = (neighbours[0] + neighbours[1] - corner).xy();
    for _ in 0..20 {
        let (height, slope) = sheet.height(p);
        let point = Vector3::new(p.x, p.y, height);
        let chords = [point - neighbours[0], point - neighbours[1]];
        let excess = Vector2::new(
            chords[0].norm_squared() - sides[0] * sides[0],
            chords[1].norm_squared() - sides[1] * sides[1],
        );
        let row = |c: Vector3<f64>| 2.0 * (c.xy() + slope * c.z);
        let jacobian = Matrix2::from_rows(&[row(chords[0]).transpose(), row(chords[1]).transpose()]);
        let step = jacobian.try_inverse()? * excess;
        // A fallen-in mesh has no fourth knot, or one that swaps with its corner.
        if step.norm().is_nan() || step.norm() > sides[0] + sides[1] {
            return None;
        }
        p -= step;
        if step.norm_squared() < 1e-26 {
            let point = sheet.point(p);
            let stretched = (0..2).any(|k| ((point - neighbours[k]).norm() / sides[k] - 1.0).abs() > 1e-9);
            return (!stretched).then_some(point);
        }
    }
    None
}
