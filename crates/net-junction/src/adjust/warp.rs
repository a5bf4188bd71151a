//! What the prediction misses smoothly, and growth outward from where it is right.
//!
//! A bent net leaves its tangent plane with the square of the distance from the axis. So twine is measured near the seed first; a polynomial
//! through the offsets found there corrects the prediction a little farther out, and so on to the picture's corners. Some hundreds of twines
//! are enough.

use net_geometry::nalgebra::{SMatrix, SVector, Vector2};

/// Terms of two variables up to the third degree.
const TERMS: usize = 10;
const UNKNOWNS: usize = 2 * TERMS;
/// How many of them there are up to each degree.
const TERMS_TO_DEGREE: [usize; 4] = [1, 3, 6, 10];
/// Distance from the seed that counts as one, px.
const UNIT_PX: f64 = 500.0;
/// Standard deviation of coefficients of each degree, px at one unit: nets bend, and what bends more than once bends less.
const SIGMA_BY_DEGREE_PX: [f64; 4] = [50.0, 100.0, 150.0, 60.0];
/// Standard deviation of a twine about the polynomial: cells and px.
const TWINE_SIGMA: (f64, f64) = (0.03, 0.2);
/// Rounds of robust reweighting.
const ROUNDS: usize = 4;
/// Most twines in a fit.
const FIT_TWINES: usize = 400;

/// First radius of growth, px, at least and in cells, and the factor from one to the next.
pub(crate) const FIRST_RADIUS: (f64, f64) = (60.0, 5.0);
const GROWTH: f64 = 1.4;

/// Displacement of the prediction, a polynomial of the predicted pixel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Warp {
    origin: Vector2<f64>,
    coefficients: SVector<f64, UNKNOWNS>,
}

/// A measured twine: at `from` as predicted without a warp the net lies `across` px off along `normal`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Measured {
    pub from: Vector2<f64>,
    pub normal: Vector2<f64>,
    pub across: f64,
    /// Distance of twines here, px.
    pub cell: f64,
}

fn terms(d: Vector2<f64>) -> SVector<f64, TERMS> {
    let (x, y) = (d.x, d.y);
    let (xx, xy, yy) = (x * x, x * y, y * y);
    SVector::from([1.0, x, y, xx, xy, yy, xx * x, xx * y, x * yy, yy * y])
}

impl Warp {
    /// No displacement.
    pub fn none(origin: Vector2<f64>) -> Self {
        Self { origin, coefficients: SVector::zeros() }
    }

    fn terms(&self, p: Vector2<f64>) -> SVector<f64, TERMS> {
        terms((p - self.origin) / UNIT_PX)
    }

    /// Displacement, px, at a predicted pixel.
    pub fn at(&self, p: Vector2<f64>) -> Vector2<f64> {
        let terms = self.terms(p);
        let (x, y) = (self.coefficients.fixed_rows::<TERMS>(0), self.coefficients.fixed_rows::<TERMS>(TERMS));
        Vector2::new(x.dot(&terms), y.dot(&terms))
    }

    /// Robust fit, of at most this degree (1 to 3). Stays as it is where nothing can be fitted.
    pub fn fit(&mut self, twines: &[Measured], degree: usize) {
        let count = TERMS_TO_DEGREE[degree.min(3)];
        // Odd: both families in turn.
        let stride = twines.len().div_ceil(FIT_TWINES) | 1;
        for round in 0..ROUNDS {
            let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
            let mut right = SVector::<f64, UNKNOWNS>::zeros();
            for twine in twines.iter().step_by(stride) {
                let sigma = TWINE_SIGMA.0 * twine.cell + TWINE_SIGMA.1;
                let off = if round == 0 { 0.0 } else { twine.across - twine.normal.dot(&self.at(twine.from)) };
                let weight = sigma.powi(-2) / (1.0 + (off / (2.5 * sigma)).powi(2)).powi(2);
                let terms = self.terms(twine.from);
                let (nx, ny) = (twine.normal.x, twine.normal.y);
                for r in 0..count {
                    let part = terms[r] * weight;
                    right[r] += nx * twine.across * part;
                    right[TERMS + r] += ny * twine.across * part;
                    for c in 0..count {
                        let product = part * terms[c];
                        normal[(r, TERMS + c)] += nx * ny * product;
                        if c <= r {
                            normal[(r, c)] += nx * nx * product;
                            normal[(TERMS + r, TERMS + c)] += ny * ny * product;
                        }
                    }
                }
            }
            for r in 0..UNKNOWNS {
                for c in r + 1..UNKNOWNS {
                    let value = if r < TERMS && c >= TERMS { normal[(r, c)] } else { normal[(c, r)] };
                    (normal[(r, c)], normal[(c, r)]) = (value, value);
                }
                // Terms of higher degrees are held at zero.
                let term = r % TERMS;
                let of_degree = TERMS_TO_DEGREE.iter().position(|&n| term < n).unwrap_or(0);
                normal[(r, r)] += if term < count { SIGMA_BY_DEGREE_PX[of_degree].powi(-2) } else { 1e6 };
            }
            let Some(solver) = normal.cholesky() else { return };
            self.coefficients = solver.solve(&right);
        }
    }
}

/// Radii of growth, px: all but the last, which is the whole picture of this diagonal. `cell` is the distance of twines at the seed, px.
pub(crate) fn radii(cell: f64, diagonal: f64) -> impl Iterator<Item = f64> {
    let first = FIRST_RADIUS.0.max(FIRST_RADIUS.1 * cell);
    std::iter::successors(Some(first), |r| Some(r * GROWTH)).take_while(move |r| 2.0 * r < diagonal)
}
