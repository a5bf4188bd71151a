//! What the prediction misses smoothly, and growth outward from where it is right.
//!
//! A bent net leaves its tangent plane with the square of the distance from the axis. So the lattice is adjusted near the seed first; a polynomial
//! through the displacements found there corrects the prediction a little farther out, and so on to the picture's corners.

use net_geometry::nalgebra::{SMatrix, SVector, Vector2};

use crate::adjust::graph::Graph;
use crate::adjust::map::LatticeMap;
use crate::adjust::solve::Solver;

/// Terms of two variables up to the fourth degree.
const TERMS: usize = 15;
/// How many of them there are up to each degree.
const TERMS_TO_DEGREE: [usize; 5] = [1, 3, 6, 10, 15];
/// Distance from the seed that counts as one, px.
const UNIT_PX: f64 = 500.0;
/// Standard deviation of coefficients of each degree, px at one unit: nets bend, and what bends more than once bends less.
const SIGMA_BY_DEGREE_PX: [f64; 5] = [50.0, 100.0, 150.0, 60.0, 30.0];
/// Standard deviation of a node about the polynomial: cells and px.
const NODE_SIGMA: (f64, f64) = (0.03, 0.2);
/// Least information, px⁻², of a node that takes part.
const INFORMATION_MIN: f64 = 1.0;

/// First radius of growth, px, at least and in cells, and the factor from one to the next.
const FIRST_RADIUS: (f64, f64) = (60.0, 5.0);
const GROWTH: f64 = 1.4;

/// Displacement of the prediction, a polynomial of the predicted pixel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Warp {
    origin: Vector2<f64>,
    coefficients: SMatrix<f64, TERMS, 2>,
}

impl Warp {
    /// No displacement.
    pub fn none(origin: Vector2<f64>) -> Self {
        Self { origin, coefficients: SMatrix::zeros() }
    }

    fn terms(&self, p: Vector2<f64>) -> SVector<f64, TERMS> {
        let d = (p - self.origin) / UNIT_PX;
        let (x, y) = (d.x, d.y);
        let (xx, xy, yy) = (x * x, x * y, y * y);
        SVector::from([
            1.0,
            x,
            y,
            xx,
            xy,
            yy,
            xx * x,
            xx * y,
            x * yy,
            yy * y,
            xx * xx,
            xx * xy,
            xx * yy,
            xy * yy,
            yy * yy,
        ])
    }

    /// Displacement, px, at a predicted pixel.
    pub fn at(&self, p: Vector2<f64>) -> Vector2<f64> {
        self.coefficients.tr_mul(&self.terms(p))
    }

    /// Robust fit, of at most this degree (1 to 4), to where the graph's nodes were found. Stays as it is where nothing can be fitted.
    pub fn fit(&mut self, graph: &Graph, solver: &Solver, map: &impl LatticeMap, degree: usize) {
        let count = TERMS_TO_DEGREE[degree.min(4)];
        for round in 0..4 {
            let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
            let mut right = SMatrix::<f64, TERMS, 2>::zeros();
            for k in 0..TERMS {
                // Terms of higher degrees are held at zero.
                let of_degree = TERMS_TO_DEGREE.iter().position(|&n| k < n).unwrap_or(0);
                normal[(k, k)] = if k < count { SIGMA_BY_DEGREE_PX[of_degree].powi(-2) } else { 1e6 };
            }
            for (node, information) in graph.nodes.iter().zip(&solver.information) {
                let (i, j) = node.index;
                let Some(from) = map.pixel(f64::from(i), f64::from(j)) else { continue };
                let known = information.determinant().max(0.0).sqrt();
                if known < INFORMATION_MIN {
                    continue;
                }
                let moved = node.pixel() - from;
                let sigma = NODE_SIGMA.0 * node.height + NODE_SIGMA.1;
                let off = if round == 0 { 0.0 } else { (moved - self.at(from)).norm() };
                let weight = sigma.powi(-2) / (1.0 + (off / (2.5 * sigma)).powi(2)).powi(2);
                let terms = self.terms(from);
                normal += terms * terms.transpose() * weight;
                right += terms * moved.transpose() * weight;
            }
            let Some(solver) = normal.cholesky() else { return };
            self.coefficients = solver.solve(&right);
        }
    }
}

/// A prediction with its correction.
pub(crate) struct Warped<'a, M> {
    pub map: &'a M,
    pub warp: &'a Warp,
}

impl<M: LatticeMap> LatticeMap for Warped<'_, M> {
    fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>> {
        let p = self.map.pixel(i, j)?;
        Some(p + self.warp.at(p))
    }
    fn pixels_per_metre(&self, i: f64, j: f64) -> Option<f64> {
        self.map.pixels_per_metre(i, j)
    }
    fn seed(&self) -> Option<(i32, i32)> {
        self.map.seed()
    }
}

/// Radii of growth, px: all but the last, which is the whole picture of this diagonal. `cell` is the distance of twines at the seed, px.
pub(crate) fn radii(cell: f64, diagonal: f64) -> impl Iterator<Item = f64> {
    let first = FIRST_RADIUS.0.max(FIRST_RADIUS.1 * cell);
    std::iter::successors(Some(first), |r| Some(r * GROWTH)).take_while(move |r| 2.0 * r < diagonal)
}
