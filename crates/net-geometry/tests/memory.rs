//! Nothing is allocated once the buffers have met the work.
#![allow(clippy::unwrap_used)]

use net_geometry::nalgebra::{Rotation3, Vector2, Vector3};
use net_geometry::{
    Camera, Dbscan, Homography, Junction, JunctionState, Lattice, Lens, Mesh, NearestPoints, Plane, Pose, planar_pnp,
};

#[test]
fn the_second_frame_allocates_nothing() {
    let camera =
        Camera::new(300.0, 310.0, 155.0, 122.0, 320, 240, Lens::PlumbBob([-0.2, 0.05, 0.0, 0.0, 0.0])).unwrap();
    let rotation = Rotation3::from_euler_angles(0.3, -0.2, 0.1);
    let lattice = Lattice {
        pose: Pose { rotation, translation: Vector3::new(0.01, -0.02, 0.8) },
        mesh: Mesh::square(0.05).unwrap(),
    };
    let corners = [(0, 0), (0, 1), (1, 1), (1, 0)];
    let points = corners.map(|(i, j)| lattice.mesh.node(f64::from(i), f64::from(j)));
    let rays = corners.map(|index| lattice.node_in_camera(index)).map(|p| p / p.z);
    let pixels = corners.map(|index| lattice.pixel_of_node(&camera, index).unwrap());

    let (mut nodes, mut taken, mut labels) = (Vec::new(), Vec::new(), Vec::new());
    let (mut dbscan, mut near) = (Dbscan::default(), NearestPoints::default());
    lattice.nodes_in_view(&camera, 4.0, &mut nodes);
    let mut junctions: Vec<_> = nodes
        .iter()
        .map(|n| Junction { pixel: n.pixel, index: None, sigma_px: 0.1, state: JunctionState::Seen })
        .collect();
    let places: Vec<Vector2<f64>> = nodes.iter().map(|n| n.pixel).collect();
    let mut found = 0;
    let mut frame = || {
        lattice.nodes_in_view(&camera, 4.0, &mut nodes);
        lattice.name_junctions(&camera, &mut junctions, 0.3, &mut taken);
        found = dbscan.cluster(&places, |_| 30.0, 2, &mut labels);
        near.fill(&places);
        found += near.within(places[0], 40.0).count() as u32;
        let [best, _] = planar_pnp(&points, &rays).unwrap();
        let plane = Plane::fit(rays.iter().map(|r| best.pose.plane().point_along(*r).unwrap())).unwrap();
        assert!((plane.distance - lattice.pose.plane().distance).abs() < 1e-6);
        Homography::from_points(&points, &pixels).unwrap();
        lattice.canonical().unwrap();
    };
    frame();
    let allocations = allocation_counter::measure(&mut frame);
    assert_eq!(allocations.count_total, 0);
    assert!(found > 2);
    assert!(junctions.iter().zip(&nodes).all(|(junction, node)| junction.index == Some(node.index)));
}
