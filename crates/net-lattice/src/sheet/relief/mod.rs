//! Bumps that no polynomial follows: a bicubic spline over the tangent plane at the optical axis, and how the threads through the axis stray from parabolas.
//!
//! The coefficients' prior makes the spline a smooth random field with the deviation and the correlation length of [`crate::Config`]: nowhere does it
//! bend for what lies elsewhere, as a polynomial's rim does, and where nothing is seen it has its prior's spread. Its value and slopes at the axis are taken off, so
//! that depth and normal there are still the sheet's own. A net of unstretchable twine is laid out by two threads (a Chebyshev net); bumps make them stray.

mod prior;
mod rows;

pub(crate) use rows::Rows;

/// Coefficients along each side of the grid.
const SIDE: usize = 12;
/// Of the grid.
const GRID: usize = SIDE * SIDE;
/// Of the grid, and of a thread of each family.
pub(crate) const COEFFICIENTS: usize = GRID + 2 * SIDE;
/// Gaps between coefficients that the spline describes.
const GAPS: f64 = (SIDE - 3) as f64;
/// Distance of coefficients over the correlation length.
const SPACING: f64 = 0.8;

/// Coefficients between the axis and the middle of what is described, from which that is moved by one.
const STRAYED: f64 = 2.0;

/// Derivatives by the coefficients.
pub(crate) type Row = [f64; COEFFICIENTS];

/// Heights above the polynomial, m, and threads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relief {
    /// Place of the first coefficient in the tangent plane, m, and the distance from one to the next.
    origin: [f64; 2],
    spacing: f64,
    /// The same distance along the threads, and where the axis is on them, m.
    along: f64,
    axis: [f64; 2],
    coefficients: Row,
    /// Value and slopes of the spline itself where the axis meets the sheet.
    tangent: [f64; 3],
    /// Value and slope of each thread's own spline there.
    straight: [[f64; 2]; 2],
}

/// Four coefficients side by side: the first one, their weights, and the weights' slopes, 1/m.
#[derive(Debug, Clone, Copy)]
struct Four {
    first: usize,
    value: [f64; 4],
    slope: [f64; 4],
}

impl Four {
    /// At a place, counted in coefficients. Beyond the gaps the spline is level.
    #[inline(always)]
    fn new(place: f64, spacing: f64) -> Self {
        let inside = place.clamp(1.0, 1.0 + GAPS - 1e-9);
        let gap = inside.floor();
        let u = inside - gap;
        let v = 1.0 - u;
        let value = [
            v * v * v / 6.0,
            (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0,
            (4.0 - 6.0 * v * v + 3.0 * v * v * v) / 6.0,
            u * u * u / 6.0,
        ];
        let per = if inside == place { 1.0 / spacing } else { 0.0 };
        let slope = [-0.5 * v * v, 0.5 * u * (3.0 * u - 4.0), 0.5 * v * (4.0 - 3.0 * v), 0.5 * u * u];
        // A place that is no number has no weights that are.
        Self { first: (gap as usize).clamp(1, SIDE - 3) - 1, value, slope: slope.map(|s| s * per) }
    }
}

/// Second derivatives of the weights of [`Four`], 1/m².
fn second(place: f64, spacing: f64) -> [f64; 4] {
    let inside = place.clamp(1.0, 1.0 + GAPS - 1e-9);
    let u = inside - inside.floor();
    let v = 1.0 - u;
    let per = if inside == place { 1.0 / (spacing * spacing) } else { 0.0 };
    [v, 3.0 * u - 2.0, 3.0 * v - 2.0, u].map(|s| s * per)
}

fn dot(a: &[f64; 4], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Relief {
    /// Level, about the axis and as far as `low` and `high` of the tangent plane, m, if bumps of this correlation length, m, can be described so far.
    pub(crate) fn level(low: [f64; 2], high: [f64; 2], length: f64) -> Self {
        let spacing = SPACING * length;
        let half = 0.5 * GAPS * spacing;
        let origin = std::array::from_fn(|k| {
            let middle = 0.5 * (low[k] + high[k]);
            let middle = if high[k] - low[k] > 2.0 * half { middle.clamp(-0.5 * half, 0.5 * half) } else { middle };
            middle - 0.5 * (SIDE - 1) as f64 * spacing
        });
        let farthest = low.into_iter().chain(high).fold(0.0, |m: f64, p| m.max(p.abs()));
        let along = f64::max(spacing, 2.0 * farthest.min(2.0 * half) / GAPS);
        let coefficients = [0.0; COEFFICIENTS];
        Self { origin, spacing, along, axis: [0.0; 2], coefficients, tangent: [0.0; 3], straight: [[0.0; 2]; 2] }
    }

    pub(crate) fn coefficients(&self) -> &Row {
        &self.coefficients
    }

    /// With `by` of these steps added to the coefficients.
    pub(crate) fn stepped(mut self, steps: &[f64], by: f64) -> Self {
        self.coefficients.iter_mut().zip(steps).for_each(|(c, s)| *c += by * s);
        self.settled()
    }

    /// The same in a picture at another depth: everything grows with it.
    pub(crate) fn scaled(mut self, m: f64) -> Self {
        self.origin.iter_mut().for_each(|o| *o *= m);
        self.spacing *= m;
        self.along *= m;
        self.axis.iter_mut().for_each(|a| *a *= m);
        self.coefficients.iter_mut().for_each(|c| *c *= m);
        self.settled()
    }

    /// The same where the axis meets the sheet in another place of the tangent plane, `arcs` along the two families.
    pub(crate) fn about(mut self, [x, y]: [f64; 2], arcs: [f64; 2]) -> Self {
        self.origin = [self.origin[0] - x, self.origin[1] - y];
        self.axis = [self.axis[0] + arcs[1], self.axis[1] + arcs[0]];
        let middle = 0.5 * (SIDE - 1) as f64;
        for k in 0..2 {
            // From the axis to the middle of what is described, in coefficients.
            let off = (self.origin[k] / self.spacing + middle, -self.axis[k] / self.along);
            if off.0.abs() > STRAYED {
                let step = off.0.signum();
                self.origin[k] -= step * self.spacing;
                let stride = [1, SIDE][k];
                for line in 0..SIDE {
                    roll(&mut self.coefficients, line * [SIDE, 1][k], stride, step);
                }
            }
            if off.1.abs() > STRAYED {
                let step = off.1.signum();
                self.axis[k] += step * self.along;
                roll(&mut self.coefficients, GRID + k * SIDE, 1, step);
            }
        }
        self.settled()
    }

    /// What is taken off at the axis.
    fn settled(mut self) -> Self {
        (self.tangent, self.straight) = ([0.0; 3], [[0.0; 2]; 2]);
        self.tangent = self.at(0.0, 0.0);
        self.straight = [0, 1].map(|family| {
            let four = self.thread(family, 0.0);
            let c = &self.coefficients[GRID + family * SIDE + four.first..];
            [dot(&four.value, c), dot(&four.slope, c)]
        });
        self
    }

    fn column(&self, x: f64) -> Four {
        Four::new((x - self.origin[0]) / self.spacing, self.spacing)
    }

    fn row(&self, y: f64) -> Four {
        Four::new((y - self.origin[1]) / self.spacing, self.spacing)
    }

    fn thread(&self, family: usize, s: f64) -> Four {
        Four::new((s + self.axis[family]) / self.along + 0.5 * (SIDE - 1) as f64, self.along)
    }

    /// Whether the spline describes a place.
    pub(crate) fn covers(&self, x: f64, y: f64) -> bool {
        [x, y].iter().zip(self.origin).all(|(p, o)| (1.0..=1.0 + GAPS).contains(&((p - o) / self.spacing)))
    }

    /// Height and slopes at `(x, y)` of the tangent plane.
    #[inline]
    pub(crate) fn at(&self, x: f64, y: f64) -> [f64; 3] {
        let (column, row) = (self.column(x), self.row(y));
        let [t, tx, ty] = self.tangent;
        let mut sum = [-t - tx * x - ty * y, -tx, -ty];
        for j in 0..4 {
            let c = &self.coefficients[(row.first + j) * SIDE + column.first..][..4];
            let (h, hx) = (dot(&column.value, c), dot(&column.slope, c));
            sum[0] += row.value[j] * h;
            sum[1] += row.value[j] * hx;
            sum[2] += row.slope[j] * h;
        }
        sum
    }

    /// How far the thread of a family through the axis strays, m, where the other family's arc is `s`, m.
    #[inline]
    pub(crate) fn aside(&self, family: usize, s: f64) -> f64 {
        let four = self.thread(family, s);
        let [value, slope] = self.straight[family];
        dot(&four.value, &self.coefficients[GRID + family * SIDE + four.first..]) - value - slope * s
    }

    /// Derivatives, by the coefficients, of a weighted sum of the second derivatives at the axis: xx, xy, yy.
    pub(crate) fn curvature_row(&self, [xx, xy, yy]: [f64; 3]) -> Row {
        let (column, row) = (self.column(0.0), self.row(0.0));
        let [cc, rr] = self.origin.map(|o| second(-o / self.spacing, self.spacing));
        let mut derivatives = [0.0; COEFFICIENTS];
        for j in 0..4 {
            for i in 0..4 {
                derivatives[(row.first + j) * SIDE + column.first + i] =
                    xx * cc[i] * row.value[j] + xy * column.slope[i] * row.slope[j] + yy * column.value[i] * rr[j];
            }
        }
        derivatives
    }

    /// Second derivatives at the axis: xx, xy, yy.
    pub(crate) fn curvature(&self) -> [f64; 3] {
        let h = 1e-3 * self.spacing;
        let [right, left] = [self.at(h, 0.0), self.at(-h, 0.0)];
        let [below, above] = [self.at(0.0, h), self.at(0.0, -h)];
        [right[1] - left[1], right[2] - left[2], below[2] - above[2]].map(|d| 0.5 * d / h)
    }
}

/// Moves the coefficients along a line by one place, where the line begins a place earlier (a positive step) or later; what is new is as its neighbour.
fn roll(of: &mut Row, first: usize, stride: usize, step: f64) {
    let at = |k: usize| first + k * stride;
    if step > 0.0 {
        (1..SIDE).rev().for_each(|k| of[at(k)] = of[at(k - 1)]);
    } else {
        (1..SIDE).for_each(|k| of[at(k - 1)] = of[at(k)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn bumpy() -> Relief {
        let steps: Row = std::array::from_fn(|k| 0.03 * f64::sin(1.7 * k as f64));
        Relief::level([-0.8, -0.7], [0.7, 0.8], 0.25).stepped(&steps, 1.0)
    }

    #[test]
    fn the_axis_keeps_its_depth_and_normal() {
        for r in [bumpy(), bumpy().scaled(1.5), bumpy().about([0.2, -0.1], [0.2, -0.1])] {
            // differences of sums of sixteen: rounding only
            assert!(r.at(0.0, 0.0).into_iter().all(|v| v.abs() < 1e-15), "{:?}", r.at(0.0, 0.0));
            assert!(r.aside(0, 0.0).abs() < 1e-15 && (r.aside(1, 1e-6) - r.aside(1, -1e-6)).abs() < 1e-15);
        }
    }

    #[test]
    fn second_derivatives_are_a_sum_over_coefficients() {
        let r = bumpy().about([0.13, -0.07], [0.13, -0.07]);
        let second = r.curvature();
        for k in 0..3 {
            let row = r.curvature_row(std::array::from_fn(|l| f64::from(u8::from(k == l))));
            let sum: f64 = row.iter().zip(r.coefficients()).map(|(d, c)| d * c).sum();
            // central differences over a thousandth of the spacing, of slopes that are piecewise quadratic
            assert!((sum - second[k]).abs() < 1e-3 * second[k].abs() + 1e-9, "{k}: {sum} {}", second[k]);
        }
    }

    #[test]
    fn another_axis_sees_the_same_bumps() {
        let (r, moved) = (bumpy(), bumpy().about([0.2, -0.1], [0.2, -0.1]));
        let (a, b) = (r.at(0.5, 0.3), moved.at(0.3, 0.4));
        let [h, hx, hy] = r.at(0.2, -0.1);
        let along = (r.aside(0, 0.2) - r.aside(0, -0.1)) - (moved.aside(0, 0.3) - moved.aside(0, 0.0));
        let slope = (r.aside(0, -0.1 + 1e-6) - r.aside(0, -0.1 - 1e-6)) / 2e-6;
        // the thread's slope where the axis is now is taken off; differences over 2e-6 are known to 1e-10
        assert!((along - 0.3 * slope).abs() < 1e-9, "{along} {slope}");
        assert!((a[0] - (b[0] + h + hx * 0.3 + hy * 0.4)).abs() < 1e-14 && (a[1] - b[1] - hx).abs() < 1e-14);
    }

    #[test]
    fn what_is_described_goes_along_with_the_axis() {
        let r = bumpy();
        let mut moved = r;
        for _ in 0..12 {
            moved = moved.about([0.1, -0.05], [0.1, -0.05]);
            assert!(moved.covers(0.0, 0.0), "the axis has left what is described");
        }
        let height =
            |of: &Relief, x: f64, y: f64| of.at(x, y)[0] - 0.5 * (of.at(x - 0.05, y)[0] + of.at(x + 0.05, y)[0]);
        // Bumps that were described at first, and still are: 1.2 m farther along x, 0.6 m along y. Second differences know nothing of the tangent.
        for (x, y) in [(0.55, -0.3), (0.45, -0.15)] {
            let (a, b) = (height(&r, x, y), height(&moved, x - 1.2, y + 0.6));
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }
}
