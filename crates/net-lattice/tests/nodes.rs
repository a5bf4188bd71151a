//! Nodes in view and names that are carried over, against the simulator's knots.

#![allow(clippy::unwrap_used)]

use net_geometry::nalgebra::{Rotation3, Vector3};
use net_geometry::{Camera, Lens, Mesh, Pose};
use net_image::Image;
use net_lattice::{Config, LatticeEstimate, LatticeEstimator};
use net_sim::{Layer, NetPose, Scene, Simulator, Truth};

/// What the estimator's own error (about 0.02 px here) and one refinement of a bilinear patch leave, px.
const NODE_PX: f64 = 0.3;

fn camera() -> Camera {
    Camera::new(320.0, 320.0, 211.5, 159.5, 424, 320, Lens::None).unwrap()
}

fn estimate() -> (LatticeEstimate, Truth) {
    let mesh = Mesh::square(0.05).unwrap();
    let pose = NetPose { range_m: 0.9, tilt_x_deg: 12.0, tilt_y_deg: -25.0, roll_deg: 8.0, ..NetPose::default() };
    let scene = Scene { layers: vec![Layer::planar(&mesh, pose)], ..Scene::default() };
    let mut image = Image::default();
    let mut simulator = Simulator::new(camera());
    let truth = simulator.render(&scene, 3, &mut image).unwrap().clone();
    let mut estimator = LatticeEstimator::new(&camera(), &mesh, &Config::default()).unwrap();
    (estimator.estimate(image.view().unwrap()).unwrap().unwrap(), truth)
}

#[test]
fn every_knot_in_view_is_a_node_and_every_node_a_knot() {
    let (estimate, truth) = estimate();
    let mut nodes = Vec::new();
    estimate.nodes_in_view(&camera(), &mut nodes);
    let knots = &truth.layers[0].nodes;
    assert!(knots.len() > 100, "{} knots", knots.len());
    // Knots within the tolerance of the rim may fall on either side of it.
    assert!(nodes.len().abs_diff(knots.len()) <= knots.len() / 50, "{} nodes, {} knots", nodes.len(), knots.len());
    let inner = |p: &net_geometry::nalgebra::Vector2<f64>| p.x > 1.0 && p.y > 1.0 && p.x < 422.0 && p.y < 318.0;
    for node in nodes.iter().filter(|n| inner(&n.pixel)) {
        let miss = knots.iter().map(|k| (k.pixel - node.pixel).norm()).fold(f64::INFINITY, f64::min);
        assert!(miss < NODE_PX, "node {:?} at {:?} is {miss} px from a knot", node.index, node.pixel);
    }
    let mut names: Vec<_> = nodes.iter().map(|n| n.index).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), nodes.len(), "a node is listed twice");
}

#[test]
fn names_are_carried_over_from_a_predicted_pose() {
    let (found, _) = estimate();
    // The same net named otherwise: turned by a quarter, counted from node (3, -2), and predicted with an error of a tenth of a cell.
    let quarter = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    let origin = Vector3::new(3.0 * 0.05 + 0.005, -2.0 * 0.05, 0.0);
    let predicted = Pose { rotation: found.pose.rotation * quarter, translation: found.pose.transform(origin) };
    let (counted, off) = found.counted_on(&predicted).unwrap();
    assert!((off - 0.1).abs() < 0.02, "{off} cells");
    let exact = found.pose.transform(Vector3::new(3.0 * 0.05, -2.0 * 0.05, 0.0));
    // The crossing angle is estimated, not exactly 90 degrees: the origin is a few cells from the axis.
    assert!((counted.pose.translation - exact).norm() < 0.001, "{:?}", counted.pose.translation - exact);
    let turn = (counted.pose.rotation.matrix() - predicted.rotation.matrix()).amax();
    assert!(turn < 0.01, "{turn}: the axes must be the predicted ones");
    assert_eq!(counted.range, found.range);
    // Another half cell on, names are a guess, and it says so.
    let far = Pose { translation: found.pose.transform(Vector3::new(0.024, 0.0, 0.0)), ..found.pose };
    assert!(found.counted_on(&far).unwrap().1 > 0.4);
}
