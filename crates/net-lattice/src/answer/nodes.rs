//! The nodes of the fitted sheet that are in view.

use net_geometry::Camera;
use net_geometry::nalgebra::{Matrix2, Vector2};

use crate::answer::estimate::LatticeEstimate;

/// Side, px, of the patches over which the map is taken as bilinear before it is refined.
const PATCH_PX: usize = 16;
/// Smallest cell, px, whose nodes are told apart.
const SMALLEST_CELL_PX: f64 = 3.0;

/// A node of the lattice as the sheet predicts it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Lattice indices in the net frame.
    pub index: (i32, i32),
    /// Pixel, lens distortion included.
    pub pixel: Vector2<f64>,
    /// Square root of the cell's area in the picture, px.
    pub cell_px: f64,
}

impl LatticeEstimate {
    /// All nodes inside the picture whose cells are at least three pixels wide, row by row of patches, into `nodes` (cleared first).
    pub fn nodes_in_view(&self, camera: &Camera, nodes: &mut Vec<Node>) {
        nodes.clear();
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        for v in (0..height).step_by(PATCH_PX) {
            for u in (0..width).step_by(PATCH_PX) {
                self.nodes_in_patch(camera, Vector2::new(u as f64, v as f64), nodes);
            }
        }
        let inside =
            |p: &Vector2<f64>| p.x >= -0.5 && p.y >= -0.5 && p.x < width as f64 - 0.5 && p.y < height as f64 - 0.5;
        nodes.retain(|node| inside(&node.pixel));
    }

    fn nodes_in_patch(&self, camera: &Camera, corner: Vector2<f64>, nodes: &mut Vec<Node>) {
        let side = PATCH_PX as f64;
        let at = |a: f64, b: f64| {
            self.lattice_from_pixel(camera, corner + Vector2::new(a, b) * side - Vector2::new(0.5, 0.5))
        };
        let (Some(s00), Some(s10), Some(s01), Some(s11)) = (at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0))
        else {
            return;
        };
        // s(a, b) = s00 + a along + b down + a b twist
        let (along, down, twist) = (s10 - s00, s01 - s00, s11 - s10 - s01 + s00);
        let jacobian = |a: f64, b: f64| Matrix2::from_columns(&[along + twist * b, down + twist * a]);
        let cells = jacobian(0.5, 0.5).determinant().abs();
        if !(cells.is_finite() && cells * SMALLEST_CELL_PX * SMALLEST_CELL_PX <= side * side) {
            return;
        }
        let low = s00.inf(&s10).inf(&s01.inf(&s11));
        let high = s00.sup(&s10).sup(&s01.sup(&s11));
        let whole = |low: f64, high: f64| low.ceil() as i32..=high.floor() as i32;
        for j in whole(low.y, high.y) {
            for i in whole(low.x, high.x) {
                let target = Vector2::new(f64::from(i), f64::from(j));
                let (mut a, mut b) = (0.5, 0.5);
                for _ in 0..4 {
                    let miss = target - (s00 + along * a + down * b + twist * (a * b));
                    let Some(step) = jacobian(a, b).try_inverse().map(|m| m * miss) else { return };
                    a += step.x;
                    b += step.y;
                }
                if !((0.0..1.0).contains(&a) && (0.0..1.0).contains(&b)) {
                    continue;
                }
                // The patch is only nearly bilinear: one step on the map itself.
                let (Some(s), Some(inverse)) = (at(a, b), jacobian(a, b).try_inverse()) else { continue };
                let step = inverse * (target - s);
                let pixel = corner + Vector2::new(a + step.x, b + step.y) * side - Vector2::new(0.5, 0.5);
                nodes.push(Node { index: (i, j), pixel, cell_px: side / cells.sqrt() });
            }
        }
    }
}
