//! Derivatives of the lattice coordinates by the relief's coefficients.

use super::{GRID, Relief, Row, SIDE};

/// Derivatives of both lattice coordinates by the coefficients, while they are summed up.
pub(crate) struct Rows<'a> {
    relief: &'a Relief,
    rows: &'a mut [Row; 2],
    /// What is to be taken off as the spline's value and slopes at the axis.
    axis: [[f64; 3]; 2],
}

impl<'a> Rows<'a> {
    pub(crate) fn new(relief: &'a Relief, rows: &'a mut [Row; 2]) -> Self {
        Self { relief, rows, axis: [[0.0; 3]; 2] }
    }

    /// Adds of each coordinate `by` times the derivatives of the height at a place.
    pub(crate) fn add_height(&mut self, x: f64, y: f64, by: [f64; 2]) {
        let (column, row) = (self.relief.column(x), self.relief.row(y));
        let weight = |i: usize, j: usize| column.value[i] * row.value[j];
        self.add([row.first, column.first], by, weight);
        for (axis, by) in self.axis.iter_mut().zip(by) {
            axis.iter_mut().zip([1.0, x, y]).for_each(|(a, p)| *a += by * p);
        }
    }

    /// The same of the slope along a way `(cx, cy)`.
    pub(crate) fn add_slope(&mut self, x: f64, y: f64, [cx, cy]: [f64; 2], by: [f64; 2]) {
        let (column, row) = (self.relief.column(x), self.relief.row(y));
        let weight = |i: usize, j: usize| cx * column.slope[i] * row.value[j] + cy * column.value[i] * row.slope[j];
        self.add([row.first, column.first], by, weight);
        for (axis, by) in self.axis.iter_mut().zip(by) {
            axis[1] += by * cx;
            axis[2] += by * cy;
        }
    }

    fn add(&mut self, first: [usize; 2], by: [f64; 2], weight: impl Fn(usize, usize) -> f64) {
        for j in 0..4 {
            let at = (first[0] + j) * SIDE + first[1];
            for i in 0..4 {
                let w = weight(i, j);
                self.rows.iter_mut().zip(by).for_each(|(row, by)| row[at + i] += by * w);
            }
        }
    }

    /// The same of how far a family's thread strays where the other family's arc is `s`.
    pub(crate) fn add_aside(&mut self, family: usize, s: f64, by: [f64; 2]) {
        let (here, axis) = (self.relief.thread(family, s), self.relief.thread(family, 0.0));
        let at = GRID + family * SIDE;
        for (row, by) in self.rows.iter_mut().zip(by) {
            for k in 0..4 {
                row[at + here.first + k] += by * here.value[k];
                row[at + axis.first + k] -= by * (axis.value[k] + axis.slope[k] * s);
            }
        }
    }

    /// Takes off what the axis keeps.
    pub(crate) fn settle(mut self) {
        let (column, row) = (self.relief.column(0.0), self.relief.row(0.0));
        let first = [row.first, column.first];
        for (f, [h, hx, hy]) in self.axis.into_iter().enumerate() {
            let by = std::array::from_fn(|k| if k == f { -1.0 } else { 0.0 });
            let (cv, cs, rv, rs) = (column.value, column.slope, row.value, row.slope);
            self.add(first, by, |i, j| h * cv[i] * rv[j] + hx * cs[i] * rv[j] + hy * cv[i] * rs[j]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::COEFFICIENTS;
    use super::super::tests::bumpy;
    use super::*;

    #[test]
    fn slopes_are_those_of_the_heights_and_rows_those_of_the_coefficients() {
        let r = bumpy();
        for (x, y) in [(0.3, 0.2), (-0.6, 0.41), (0.01, -0.4), (2.0, 0.1)] {
            let [h, hx, hy] = r.at(x, y);
            let d = 1e-6;
            // second derivatives are below 5 / m
            assert!(((r.at(x + d, y)[0] - h) / d - hx).abs() < 1e-5 && ((r.at(x, y + d)[0] - h) / d - hy).abs() < 1e-5);
            let mut rows = [[0.0; COEFFICIENTS]; 2];
            let mut sums = Rows::new(&r, &mut rows);
            sums.add_height(x, y, [2.0, -1.0]);
            sums.add_slope(x, y, [0.5, -0.3], [1.0, 3.0]);
            sums.add_aside(0, 0.4, [0.2, 0.7]);
            sums.settle();
            let by = |f: usize| rows[f].iter().zip(r.coefficients()).map(|(a, c)| a * c).sum::<f64>();
            let slope = 0.5 * hx - 0.3 * hy;
            assert!((by(0) - (2.0 * h + slope + 0.2 * r.aside(0, 0.4))).abs() < 1e-12);
            assert!((by(1) - (-h + 3.0 * slope + 0.7 * r.aside(0, 0.4))).abs() < 1e-12);
        }
        let (d, [xx, xy, yy]) = (1e-4, r.curvature());
        let (right, below) = (r.at(d, 0.0), r.at(0.0, d));
        // third derivatives are below 50 / m^2
        assert!([right[1] / d - xx, right[2] / d - xy, below[2] / d - yy].into_iter().all(|v| v.abs() < 1e-2));
    }
}
