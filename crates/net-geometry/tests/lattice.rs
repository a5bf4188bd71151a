//! Nodes of the net: where they are, which are seen, how they are called.
#![allow(clippy::unwrap_used)]

use net_geometry::nalgebra::{Rotation3, Unit, Vector2, Vector3};
use net_geometry::{Camera, Junction, JunctionState, Lattice, Lens, Mesh, Pose, VisibleNode};
use proptest::prelude::*;

/// Rounding of a chain of some hundred operations on numbers near one.
const ROUNDING: f64 = 1e-9;

fn camera(lens: Lens) -> Camera {
    Camera::new(300.0, 310.0, 155.0, 122.0, 320, 240, lens).unwrap()
}

fn lenses() -> impl Strategy<Value = Lens> {
    prop_oneof![
        Just(Lens::None),
        Just(Lens::PlumbBob([-0.28, 0.09, 0.0011, -0.0007, -0.012])),
        Just(Lens::Rational([0.41, -0.22, -0.0006, 0.0009, 0.013, 0.72, -0.11, 0.021])),
        Just(Lens::KannalaBrandt([0.031, -0.012, 0.0042, -0.0009])),
    ]
}

prop_compose! {
    fn poses()(tilt in 0.0..75f64.to_radians(), azimuth in -3.1..3.1, turn in -3.1..3.1, range in 0.3..2.0) -> Pose {
        let axis = Unit::new_normalize(Vector3::new(f64::cos(azimuth), f64::sin(azimuth), 0.0));
        let rotation = Rotation3::from_axis_angle(&axis, tilt) * Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
        // The origin somewhere on the net, out of view too.
        let on_axis = Vector3::new(0.0, 0.0, range);
        Pose { rotation, translation: on_axis + rotation * Vector3::new(0.31 * turn, -0.17 * azimuth, 0.0) }
    }
}

prop_compose! {
    fn meshes()(a in 0.02..0.1, b in 0.02..0.1, degrees in 30.0..150.0f64, kind in 0..3) -> Mesh {
        match kind {
            0 => Mesh::square(a),
            1 => Mesh::rectangular(a, b),
            _ => Mesh::oblique(a, b, degrees.to_radians()),
        }.unwrap()
    }
}

proptest! {
    #[test]
    fn the_nearest_node_is_nearest(mesh in meshes(), degrees in 3.0..177.0f64, x in -1.0..1.0, y in -1.0..1.0) {
        // Slivers too.
        for mesh in [mesh, Mesh::oblique(mesh.side1(), mesh.side2(), degrees.to_radians()).unwrap()] {
            let point = Vector2::new(x, y);
            let (i, j) = mesh.nearest_node(point).unwrap();
            let distance = (mesh.node(f64::from(i), f64::from(j)) - point).norm();
            let around = mesh.coordinates(point).map(|c| c.round() as i32);
            for di in -25..=25 {
                for dj in -25..=25 {
                    let node = mesh.node(f64::from(around.x + di), f64::from(around.y + dj));
                    prop_assert!((node - point).norm() >= distance - ROUNDING, "{mesh}: {i} {j}, {di} {dj}");
                }
            }
            let back = mesh.coordinates(mesh.node(f64::from(i), f64::from(j)));
            prop_assert!((back - Vector2::new(f64::from(i), f64::from(j))).norm() < ROUNDING * f64::from(1 + i.abs() + j.abs()));
        }
    }

    #[test]
    fn another_origin_is_the_same_net(pose in poses(), mesh in meshes(), i in -20i32..20, j in -20i32..20) {
        let lattice = Lattice { pose, mesh };
        let (anchored, name) = lattice.anchored().unwrap();
        prop_assert!((anchored.node_in_camera((i - name.0, j - name.1)) - lattice.node_in_camera((i, j))).norm() < ROUNDING);
        // No node is nearer to the optical axis' point.
        let point = pose.plane().point_along(Vector3::z()).unwrap();
        let distance = (anchored.pose.translation - point).norm();
        prop_assert!((anchored.node_in_camera((i % 3, j % 3)) - point).norm() >= distance - ROUNDING);
        // At the old origin it is the old lattice.
        let (back, _) = anchored.anchored_at(pose.translation).unwrap();
        prop_assert!((back.pose.translation - pose.translation).norm() < ROUNDING);
    }

    #[test]
    fn a_turn_is_the_same_net(pose in poses(), mesh in meshes(), i in -20i32..20, j in -20i32..20) {
        let lattice = Lattice { pose, mesh };
        let turned = lattice.turned();
        prop_assert!((turned.node_in_camera((j, -i)) - lattice.node_in_camera((i, j))).norm() < ROUNDING);
        prop_assert!((turned.pose.normal() - pose.normal()).norm() < ROUNDING);
        prop_assert!((turned.mesh.cell_area() - mesh.cell_area()).abs() < ROUNDING);
    }

    #[test]
    fn the_first_frame_is_named_by_the_rule(pose in poses(), mesh in meshes()) {
        let lattice = Lattice { pose, mesh };
        let canonical = lattice.canonical().unwrap();
        let rotation = canonical.pose.in_plane_rotation();
        if mesh.is_right_angled() {
            let limit = std::f64::consts::FRAC_PI_4 + ROUNDING;
            prop_assert!(rotation > -limit && rotation <= limit, "{}", rotation.to_degrees());
        }
        // Whatever way the net was given, it is named the same.
        let mut other = lattice.anchored_at(lattice.node_in_camera((3, -2))).unwrap().0;
        for _ in 0..4 {
            other = other.turned();
            let again = other.canonical().unwrap();
            prop_assert!((again.pose.rotation.matrix() - canonical.pose.rotation.matrix()).norm() < 1e-6);
            prop_assert!((again.mesh.side1() - canonical.mesh.side1()).abs() < ROUNDING);
            prop_assert!((again.mesh.angle() - canonical.mesh.angle()).abs() < ROUNDING);
            // Of two nodes equally near either will do.
            let (a, b) = (again.pose.translation, canonical.pose.translation);
            let point = pose.plane().point_along(Vector3::z()).unwrap();
            prop_assert!(((a - point).norm() - (b - point).norm()).abs() < ROUNDING);
        }
    }

    #[test]
    fn a_track_keeps_its_names(pose in poses(), mesh in meshes(), w in prop::array::uniform3(-0.2..0.2f64)) {
        let lattice = Lattice { pose, mesh };
        let moved = Lattice { pose: pose.perturbed(Vector3::from(w), Vector3::zeros()), mesh };
        let mut renamed = moved;
        for _ in 0..4 {
            renamed = renamed.turned();
            let followed = renamed.following(&lattice.pose);
            prop_assert!((followed.pose.rotation.matrix() - moved.pose.rotation.matrix()).norm() < 1e-6);
            prop_assert!((followed.mesh.side1() - mesh.side1()).abs() < ROUNDING && (followed.mesh.angle() - mesh.angle()).abs() < ROUNDING);
        }
    }
}

proptest! {
    // Brute force takes its time.
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn nodes_in_view_are_those_that_brute_force_sees(pose in poses(), mesh in meshes(), lens in lenses(), min_cell in 4.0..12.0) {
        let (camera, lattice) = (camera(lens), Lattice { pose, mesh });
        let mut nodes = vec![VisibleNode { index: (0, 0), pixel: Vector2::zeros(), depth: 0.0 }; 3];
        lattice.nodes_in_view(&camera, min_cell, &mut nodes);
        let mut expected = Vec::new();
        let reach = 250;
        for j in -reach..=reach {
            for i in -reach..=reach {
                let point = lattice.node_in_camera((i, j));
                let Some((pixel, jacobian)) = camera.pixel_from_point_with_jacobian(point) else { continue };
                let b1 = jacobian * (pose.x_axis() * mesh.a1().x + pose.y_axis() * mesh.a1().y);
                let b2 = jacobian * (pose.x_axis() * mesh.a2().x + pose.y_axis() * mesh.a2().y);
                let height = b1.perp(&b2).abs() / b1.norm().max(b2.norm());
                // Neither at the limit of the size nor at the border, where rounding decides.
                let inside = |x: f64, size: u32| (x > -0.5 + 1e-6, x < f64::from(size) - 0.5 - 1e-6) == (true, true);
                if inside(pixel.x, 320) && inside(pixel.y, 240) && height > min_cell + 1e-6 {
                    expected.push((i, j));
                }
            }
        }
        let found: Vec<_> = nodes.iter().map(|n| n.index).collect();
        for index in &expected {
            prop_assert!(found.contains(index), "{index:?} of {} is missing", expected.len());
        }
        for node in &nodes {
            prop_assert!(camera.contains(node.pixel) && node.depth > 0.0);
            prop_assert!((lattice.pixel_of_node(&camera, node.index).unwrap() - node.pixel).norm() < ROUNDING);
            let coordinates = lattice.coordinates_at(&camera, node.pixel).unwrap();
            let index = Vector2::new(f64::from(node.index.0), f64::from(node.index.1));
            prop_assert!((coordinates - index).norm() < 1e-6, "{coordinates} for {index}");
        }
        prop_assert!(found.windows(2).all(|w| (w[0].1, w[0].0) < (w[1].1, w[1].0)), "in order, each once");
        let border = nodes.len() as i64 - expected.len() as i64;
        prop_assert!(border <= 2, "{border} more than brute force, which stops at the border");
    }
}

#[test]
fn junctions_get_the_names_of_their_nodes() {
    let camera = camera(Lens::PlumbBob([-0.28, 0.09, 0.0011, -0.0007, -0.012]));
    let rotation = Rotation3::from_euler_angles(0.3, -0.2, 0.1);
    let lattice = Lattice {
        pose: Pose { rotation, translation: Vector3::new(0.01, -0.02, 0.8) },
        mesh: Mesh::rectangular(0.05, 0.04).unwrap(),
    };
    let junction = |pixel| Junction { pixel, index: Some((99, 99)), sigma_px: 0.1, state: JunctionState::Seen };
    let at = |i, j| lattice.pixel_of_node(&camera, (i, j)).unwrap();
    let cell = (at(1, 0) - at(0, 0)).norm();
    let mut junctions = [
        junction(at(0, 0)),
        junction(at(2, -1) + Vector2::new(0.1 * cell, 0.0)),
        junction(at(2, -1)),
        junction((at(1, 1) + at(2, 2)) / 2.0),
        junction(at(-2, 1)),
        junction(Vector2::new(f64::NAN, 0.0)),
        junction(at(2, -1)),
    ];
    let mut scratch = Vec::new();
    lattice.name_junctions(&camera, &mut junctions, 0.3, &mut scratch);
    let names: Vec<_> = junctions.iter().map(|j| j.index).collect();
    // Of three near one node the nearest has the name, and of two equally near the first.
    assert_eq!(names, [Some((0, 0)), None, Some((2, -1)), None, Some((-2, 1)), None, None]);
}

#[test]
fn exactly_45_degrees_is_named_one_way() {
    let mesh = Mesh::square(0.05).unwrap();
    for k in -3..4 {
        let angle = std::f64::consts::FRAC_PI_4 + f64::from(k) * std::f64::consts::FRAC_PI_2;
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
        let lattice = Lattice { pose: Pose { rotation, translation: Vector3::z() }, mesh };
        let rotation = lattice.canonical().unwrap().pose.in_plane_rotation();
        assert!((rotation - std::f64::consts::FRAC_PI_4).abs() < ROUNDING, "{k}: {}", rotation.to_degrees());
    }
}

#[test]
fn a_receding_net_has_an_end() {
    // The plane of the net runs to the horizon in the middle of the view; what is smaller than 4 px is left out.
    let camera = Camera::new(700.0, 700.0, 424.0, 240.0, 848, 480, Lens::None).unwrap();
    let rotation = Rotation3::from_axis_angle(&Vector3::x_axis(), 89f64.to_radians());
    let mesh = Mesh::square(0.05).unwrap();
    let lattice = Lattice { pose: Pose { rotation, translation: Vector3::new(0.0, 0.5, 0.0) }, mesh };
    let mut nodes = Vec::new();
    lattice.nodes_in_view(&camera, 4.0, &mut nodes);
    assert!(!nodes.is_empty() && nodes.iter().all(|n| n.depth < 700.0 * 0.05 / 4.0 * 1.3), "{}", nodes.len());
}

#[test]
fn nothing_is_seen_of_a_net_behind_or_of_nonsense() {
    let mut nodes = Vec::new();
    let fisheye = camera(Lens::KannalaBrandt([0.0; 4]));
    for camera in [camera(Lens::None), fisheye] {
        for z in [-1.0, 0.0, f64::NAN, f64::INFINITY, 1e300] {
            let pose = Pose { rotation: Rotation3::identity(), translation: Vector3::new(0.0, 0.0, z) };
            let lattice = Lattice { pose, mesh: Mesh::square(0.05).unwrap() };
            lattice.nodes_in_view(&camera, 1.0, &mut nodes);
            assert!(nodes.is_empty(), "z = {z}");
            if z < 0.0 || z.is_nan() {
                assert!(lattice.anchored().is_err(), "z = {z}");
            }
        }
        // One node of a net of the largest meshes, none of one too fine to see.
        for (side, seen, z) in [(0.001, 0, 1e6), (2.0, 1, 1.0)] {
            let pose = Pose { rotation: Rotation3::identity(), translation: Vector3::z() * z };
            let lattice = Lattice { pose, mesh: Mesh::square(side).unwrap() };
            lattice.nodes_in_view(&camera, f64::NAN, &mut nodes);
            assert_eq!(nodes.len(), seen, "side {side}");
        }
    }
    let mesh = Mesh::oblique(0.001, 2.0, 1e-9).unwrap();
    assert_eq!(mesh.nearest_node(Vector2::repeat(f64::NAN)), None);
    assert_eq!(Mesh::square(0.001).unwrap().nearest_node(Vector2::new(1e8, 0.0)), None);
    let _ = mesh.nearest_node(Vector2::new(1.0, 1.0));
}
