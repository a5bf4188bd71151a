//! One net on the picture: twines of both directions as strokes.

use nalgebra::{Vector2, Vector3};
use net_geometry::Camera;

use super::profile::EdgeSpread;
use super::stroke::{End, Family, Stroke, Vertex};
use crate::net::lattice::{Lattice, Node};
use crate::scene::{Net, Scene};

/// Straight pieces are joined up to this length, px: short enough for light and width to be linear along it.
const PIECE_PX: f64 = 32.0;

/// Draws nets onto pictures; owns what that takes.
#[derive(Debug)]
pub(crate) struct LayerPainter {
    edge: EdgeSpread,
    /// Twines along the first and along the second mesh direction.
    families: [Family; 2],
    /// The twine being drawn.
    twine: Vec<Vertex>,
}

impl LayerPainter {
    pub(crate) fn new() -> Self {
        Self { edge: EdgeSpread::new(), families: Default::default(), twine: Vec::new() }
    }

    /// Draws `net`, whose knots `lattice` holds, over what `picture` shows.
    pub(crate) fn paint(&mut self, scene: &Scene, net: &Net, lattice: &Lattice, camera: &Camera, picture: &mut [f32]) {
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        for family in &mut self.families {
            family.clear(width, height);
        }
        let (first_row, last_row) = lattice.row_range();
        let (first_column, last_column) = lattice.column_range();
        for j in first_row..=last_row {
            self.follow(0, scene, net, camera, (first_column..=last_column).map(|i| lattice.node(i, j)));
        }
        for i in first_column..=last_column {
            self.follow(1, scene, net, camera, (first_row..=last_row).map(|j| lattice.node(i, j)));
        }
        let [first, second] = &self.families;
        let twines = first.coverage.iter().zip(&first.light).zip(second.coverage.iter().zip(&second.light));
        for (out, ((&c1, &l1), (&c2, &l2))) in picture.iter_mut().zip(twines) {
            let sum = c1 + c2;
            if sum > 0.0 {
                // Crossing twines overlap: the blurred union of two crossing strips is 1 - (1 - c1)(1 - c2).
                let cover = 1.0 - (1.0 - c1.min(1.0)) * (1.0 - c2.min(1.0));
                *out += cover * ((l1 + l2) / sum - *out);
            }
        }
    }

    /// Draws one twine, knot by knot; it is interrupted where there is none.
    fn follow<'a>(
        &mut self,
        family: usize,
        scene: &Scene,
        net: &Net,
        camera: &Camera,
        nodes: impl Iterator<Item = Option<&'a Node>>,
    ) {
        self.twine.clear();
        let mut last: Option<&Node> = None;
        let mut pending: Option<Vertex> = None;
        for node in nodes.chain(std::iter::once(None)) {
            match (node, last) {
                (Some(node), previous) => {
                    let direction = previous.map(|p| node.point - p.point);
                    let vertex = vertex(scene, net, camera, node, direction);
                    if previous.is_none() {
                        self.twine.push(vertex);
                    } else {
                        let far = self.twine.last().is_none_or(|v| (vertex.pixel - v.pixel).norm() > PIECE_PX);
                        if let Some(kept) = pending.take().filter(|_| far) {
                            self.twine.push(kept);
                        }
                        pending = Some(vertex);
                    }
                }
                (None, Some(_)) => {
                    self.twine.extend(pending.take());
                    // The first knot had no neighbour to tell which way the twine runs when its width was taken.
                    if let [first, second, ..] = self.twine[..] {
                        self.twine[0] = Vertex {
                            width_px: if first.width_px.is_nan() { second.width_px } else { first.width_px },
                            ..first
                        };
                    }
                    self.stroke(family, scene);
                    self.twine.clear();
                }
                (None, None) => {}
            }
            last = node;
        }
    }

    /// Draws the collected twine.
    fn stroke(&mut self, family: usize, scene: &Scene) {
        let vertices = &self.twine;
        let tangent = |k: usize| {
            let back = vertices[k].pixel - vertices[k - 1].pixel;
            let ahead = vertices[k + 1].pixel - vertices[k].pixel;
            (back.normalize() + ahead.normalize()).try_normalize(1e-9).unwrap_or(ahead)
        };
        let joint = |k: usize| if k == 0 || k + 1 >= vertices.len() { End::Free } else { End::Joint(tangent(k)) };
        for k in 0..vertices.len().saturating_sub(1) {
            let piece =
                Stroke { from: vertices[k], to: vertices[k + 1], bow_px: 0.0, start: joint(k), end: joint(k + 1) };
            piece.draw(&mut self.families[family], &self.edge, scene.sensor.psf_px);
        }
    }
}

/// A knot as a point of its twine, which runs in `direction` (camera frame).
fn vertex(_scene: &Scene, net: &Net, camera: &Camera, node: &Node, direction: Option<Vector3<f64>>) -> Vertex {
    let width_px = direction.map_or(f64::NAN, |d| apparent_width(camera, node, d, net.twine.diameter_m));
    Vertex { pixel: node.pixel, width_px, grey: net.twine.grey }
}

/// Width in the picture, px, of a cylinder of this diameter through `node`: its outline is where the line of sight touches it,
/// half a diameter to either side of the axis, across both the twine and the line of sight.
fn apparent_width(camera: &Camera, node: &Node, direction: Vector3<f64>, diameter_m: f64) -> f64 {
    let width = || {
        let side = direction.cross(&node.point).try_normalize(1e-12)?;
        let edge = camera.pixel_from_point(node.point + side * (0.5 * diameter_m))? - node.pixel;
        let ahead = camera.pixel_from_point(node.point + direction * 0.01)? - node.pixel;
        let ahead: Vector2<f64> = ahead.try_normalize(1e-12)?;
        Some(2.0 * ahead.perp(&edge).abs())
    };
    width().unwrap_or(0.0)
}
