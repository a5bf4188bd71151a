//! The truth of one net, from its knots and its sheet.

use nalgebra::{Vector2, Vector3};

use crate::error::Result;
use crate::net::damage::{Damage, Edge};
use crate::render::layer::{LayerPainter, Subject};
use crate::scene::Layer;
use crate::truth::{AxisTruth, LayerTruth, MissingEdge, NodeTruth, Visibility};

/// What `painter`, which has just drawn it, shows of `subject`.
pub(crate) fn layer_truth(layer: &Layer, subject: &Subject, painter: &LayerPainter) -> Result<LayerTruth> {
    let (lattice, pose, camera) = (subject.lattice, subject.pose, subject.medium.camera());
    let damage = Damage::of(&layer.net);
    let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
    let inside = |p: Vector2<f64>| p.x >= -0.5 && p.y >= -0.5 && p.x < width - 0.5 && p.y < height - 0.5;
    let nodes = lattice.iter().filter(|(_, n)| inside(n.pixel)).map(|(index, n)| {
        let visibility = if damage.gone(index.0, index.1) {
            Visibility::Missing
        } else if painter.is_fouled(index) {
            Visibility::Fouled
        } else {
            Visibility::Visible
        };
        NodeTruth { index, pixel: n.pixel, depth_m: n.point.z, point: n.point, visibility }
    });
    let mut missing_edges = Vec::new();
    if damage.any() {
        for (index, from) in lattice.iter() {
            for family in 0..2 {
                let edge = Edge { i: index.0, j: index.1, family };
                let [_, (i, j)] = edge.ends();
                let Some(to) = lattice.node(i, j) else { continue };
                if !damage.broken(edge) || !(inside(from.pixel) || inside(to.pixel)) {
                    continue;
                }
                let length = (to.point - from.point).norm();
                let stubs_m = [0, 1].map(|end| damage.stub(edge, end).map_or(0.0, |(share, _)| share * length));
                missing_edges.push(MissingEdge { nodes: edge.ends(), pixels: [from.pixel, to.pixel], stubs_m });
            }
        }
    }
    Ok(LayerTruth {
        pose: *pose,
        mesh: layer.net.mesh()?,
        axis: axis_truth(layer, subject),
        nodes: nodes.collect(),
        missing_edges,
        contrast_grey: 0.0,
    })
}

/// The net where the optical axis meets it.
fn axis_truth(layer: &Layer, subject: &Subject) -> Option<AxisTruth> {
    let (pose, sheet) = (subject.pose, subject.fabric.sheet());
    // Newton along the axis, from the nominal plane to the sheet.
    let mut range_m = pose.plane().range()?;
    let axis_in_net = pose.rotation.inverse() * Vector3::z();
    let (mut place, mut slope) = (Vector2::zeros(), Vector2::zeros());
    for _ in 0..50 {
        let point = pose.inverse_transform(Vector3::z() * range_m);
        let height;
        place = point.xy();
        (height, slope) = sheet.height(place);
        let step = (point.z - height) / (axis_in_net.z - slope.dot(&axis_in_net.xy()));
        range_m -= step.clamp(-0.2 * range_m, 0.2 * range_m);
        if step.abs() < 1e-13 {
            break;
        }
    }
    let normal = (pose.rotation * Vector3::new(-slope.x, -slope.y, 1.0)).normalize();
    let found = subject.fabric.locate(place)?;
    let inside =
        |at: f64, ends: Option<[i32; 2]>| ends.is_none_or(|[a, b]| (f64::from(a)..=f64::from(b)).contains(&at));
    let (columns, rows) = (layer.net.extent.columns(), layer.net.extent.rows());
    if !(range_m > 0.0 && normal.z > 0.0 && inside(found.cells.x, columns) && inside(found.cells.y, rows)) {
        return None;
    }
    let directions = found.sides.map(|side| (pose.rotation * side).normalize());
    Some(AxisTruth {
        range_m,
        distance_m: range_m * normal.z,
        normal,
        cells: found.cells,
        directions,
        crossing_angle: directions[0].dot(&directions[1]).clamp(-1.0, 1.0).acos(),
        curvatures_per_m: sheet.curvatures(place),
    })
}
