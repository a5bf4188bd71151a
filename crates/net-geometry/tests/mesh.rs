//! Meshes: lattice vectors, and what they are written as.
#![allow(clippy::unwrap_used)]

use net_geometry::nalgebra::Vector2;
use net_geometry::{Error, Mesh};
use proptest::prelude::*;

#[test]
fn every_form_of_the_contract() {
    for text in ["50mm", "5cm", "0.05m", "0.05", " 50mm ", "50x50mm", "50x50mm@90deg", "5e-2"] {
        assert_eq!(text.parse::<Mesh>().unwrap(), Mesh::square(0.05).unwrap(), "{text}");
    }
    assert_eq!("50x40mm".parse::<Mesh>().unwrap(), Mesh::rectangular(0.05, 0.04).unwrap());
    assert_eq!("27.5mm".parse::<Mesh>().unwrap(), Mesh::square(0.0275).unwrap());
    assert_eq!("50x40mm@60deg".parse::<Mesh>().unwrap(), Mesh::oblique(0.05, 0.04, 60f64.to_radians()).unwrap());
    assert_eq!("50mm@60deg".parse::<Mesh>().unwrap(), Mesh::oblique(0.05, 0.05, 60f64.to_radians()).unwrap());
}

#[test]
fn nonsense_is_refused_with_what_would_do() {
    let nonsense = [
        "",
        "mm",
        "50x",
        "x50mm",
        "x",
        "-50mm",
        "50x-40mm",
        "nanmm",
        "NaN",
        "infm",
        "inf",
        "infinity",
        "0",
        "0mm",
        "0x50mm",
        "50x0mm",
        "50mm@190deg",
        "50mm@180deg",
        "50mm@0deg",
        "50mm@-60deg",
        "50mm@deg",
        "50mm@60",
        "50mm@nandeg",
        "50mm@60rad",
        "@60deg",
        "50",
        "50m",
        "50 40mm",
        "50x40x30mm",
        "50mmm",
        "50mm50",
        "fifty",
        "5e400",
        "5e-400",
        "1e-400mm",
        "50km",
        "50MM",
        "50,5mm",
        "+5cm",
    ];
    for text in nonsense {
        let error = text.parse::<Mesh>().unwrap_err();
        assert!(matches!(&error, Error::MeshText { text: given, .. } if given == text), "{text}: {error:?}");
        let message = error.to_string();
        assert!(message.contains("50x50mm@60deg") && message.contains(&format!("{text:?}")), "{message}");
    }
}

#[test]
fn bad_sides_and_angles_are_named() {
    // 50 is a forgotten unit.
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-9, 50.0, 1e300] {
        assert!(Mesh::square(bad).unwrap_err().to_string().contains("mesh side a"));
        assert!(Mesh::rectangular(1.0, bad).unwrap_err().to_string().contains("mesh side b"));
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 50.0] {
        assert!(Mesh::oblique(1.0, 1.0, bad).unwrap_err().to_string().contains("mesh angle"));
    }
    assert!(Mesh::oblique(1.0, 1.0, std::f64::consts::PI).is_err());
}

#[test]
fn nodes_of_a_square_are_exact() {
    let mesh = Mesh::square(0.05).unwrap();
    assert_eq!(mesh.node(2.0, -3.0), Vector2::new(0.1, -0.05 * 3.0));
    assert_eq!(mesh.a2().x, 0.0);
}

proptest! {
    #[test]
    fn written_and_read_back(a in 0.001..2.0, b in 0.001..2.0, degrees in 1.0..179.0f64) {
        for mesh in [Mesh::square(a), Mesh::rectangular(a, b), Mesh::oblique(a, b, degrees.to_radians())] {
            let mesh = mesh.unwrap();
            let back = mesh.to_string().parse::<Mesh>().unwrap();
            // Written to a nanometre and a millionth of a degree.
            prop_assert!((back.side1() - mesh.side1()).abs() < 1e-9 && (back.side2() - mesh.side2()).abs() < 1e-9);
            prop_assert!((back.angle() - mesh.angle()).abs() < 1e-8, "{mesh}");
        }
    }

    #[test]
    fn parsing_never_panics(text in ".{0,12}") {
        let _ = text.parse::<Mesh>();
    }
}
