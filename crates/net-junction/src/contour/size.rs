//! The cells' size from the openings themselves, when nothing is expected.

use net_geometry::nalgebra::{Matrix3, Vector2, Vector3};

use crate::contour::cluster::median;
use crate::contour::expectation::ExpectedCell;
use crate::contour::shape::CellBox;

/// Side of a cell over its opening's, a middling twine.
const CELL_PER_OPENING: f64 = 1.2;

/// Cell areas of a planar net: their cube roots are linear over the picture (see [`crate::CellArea::on_plane`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SizeField {
    origin: Vector2<f64>,
    /// Cube root of the area at the origin, and its slope per px.
    root: Vector3<f64>,
}

impl SizeField {
    /// The same size everywhere.
    pub fn uniform(side: f64) -> Self {
        Self { origin: Vector2::zeros(), root: Vector3::new(side.powf(2.0 / 3.0), 0.0, 0.0) }
    }

    /// Robust fit to openings. `scratch` is reused. `None` for fewer than four, or a fit that says nothing.
    pub fn fit(boxes: &[CellBox], scratch: &mut Vec<f64>) -> Option<Self> {
        if boxes.len() < 4 {
            return None;
        }
        let root = |b: &CellBox| (b.area * CELL_PER_OPENING * CELL_PER_OPENING).cbrt();
        scratch.clear();
        scratch.extend(boxes.iter().map(root));
        let middle = median(scratch)?;
        let origin = boxes.iter().map(CellBox::centre).sum::<Vector2<f64>>() / boxes.len() as f64;
        let mut field = Self { origin, root: Vector3::new(middle, 0.0, 0.0) };
        for round in 0..8 {
            // Wide at first: the middle size is right in the middle only.
            let softness = middle * if round < 3 { 0.2 } else { 0.07 };
            // A weak pull to equal sizes keeps few openings on a line solvable.
            let mut normal = Matrix3::from_diagonal(&Vector3::new(0.0, 100.0, 100.0));
            let mut right = Vector3::zeros();
            for found in boxes {
                let d = found.centre() - origin;
                let row = Vector3::new(1.0, d.x, d.y);
                let residual = root(found) - field.root.dot(&row);
                let weight = 1.0 / (1.0 + (residual / softness).powi(2)).powi(2);
                normal += row * row.transpose() * weight;
                right += row * (weight * root(found));
            }
            field.root = normal.cholesky()?.solve(&right);
        }
        field.root.iter().all(|r| r.is_finite()).then_some(field)
    }

    /// The cell expected at a pixel; `None` beyond the plane's horizon.
    pub fn cell_at(&self, pixel: Vector2<f64>) -> Option<ExpectedCell> {
        let d = pixel - self.origin;
        let root = self.root.dot(&Vector3::new(1.0, d.x, d.y));
        let area = root.powi(3);
        (root > 0.0 && area.is_finite() && area > 1.0).then_some(ExpectedCell { area, basis: None })
    }
}
