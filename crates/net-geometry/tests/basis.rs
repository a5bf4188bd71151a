//! Wave vectors and lattice vectors.
#![allow(clippy::unwrap_used)]

use net_geometry::nalgebra::Vector2;
use net_geometry::{Basis, Error};
use proptest::prelude::*;

proptest! {
    #[test]
    fn waves_and_lattice_are_dual(k in prop::array::uniform4(-0.2..0.2f64)) {
        let (k1, k2) = (Vector2::new(k[0], k[1]), Vector2::new(k[2], k[3]));
        prop_assume!(k1.perp(&k2).abs() > 1e-3 * k1.norm() * k2.norm() && k1.norm().min(k2.norm()) > 1e-3);
        let basis = Basis::from_wave_vectors(k1, k2).unwrap();
        // A step of one lattice vector is one period of its own wave and none of the other.
        for (product, expected) in [(basis.b1.dot(&k1), 1.0), (basis.b1.dot(&k2), 0.0), (basis.b2.dot(&k1), 0.0), (basis.b2.dot(&k2), 1.0)] {
            prop_assert!((product - expected).abs() < 1e-9);
        }
        let (back1, back2) = basis.wave_vectors().unwrap();
        prop_assert!((back1 - k1).norm() < 1e-9 && (back2 - k2).norm() < 1e-9);
        prop_assert!((basis.cell_area() * k1.perp(&k2) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn a_foreshortened_cell_keeps_its_sides() {
    // Cells of 10 x 20 px: waves of 1/10 along u and 1/20 along v. The printed eq. 4.14 swaps the sides.
    let basis = Basis::from_wave_vectors(Vector2::new(0.1, 0.0), Vector2::new(0.0, 0.05)).unwrap();
    let (b1, b2) = (Vector2::new(10.0, 0.0), Vector2::new(0.0, 20.0));
    assert!((basis.b1 - b1).norm() < 1e-9 && (basis.b2 - b2).norm() < 1e-9, "{basis:?}");
}

#[test]
fn parallel_waves_have_no_lattice() {
    let k = Vector2::new(0.1, 0.05);
    for other in [k, -2.0 * k, Vector2::zeros(), Vector2::repeat(f64::NAN), Vector2::repeat(f64::INFINITY)] {
        assert!(matches!(Basis::from_wave_vectors(k, other), Err(Error::Degenerate { .. })), "{other}");
    }
}
