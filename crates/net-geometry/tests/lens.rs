//! Lenses against OpenCV, against finite differences, and there and back.
#![allow(clippy::unwrap_used)]

use net_geometry::nalgebra::{Matrix2, Vector2, Vector3};
use net_geometry::{Camera, Error, Lens};
use proptest::prelude::*;

type Reference = (&'static str, &'static [f64], &'static [([f64; 2], [f64; 2])]);

/// Model, coefficients, and points `(x, y)` on the plane `z = 1` with their pixels by OpenCV 4, for
/// `fx, fy, cx, cy = 700, 710, 424, 240`:
///
/// ```python
/// project = cv2.fisheye.projectPoints if model == "equidistant" else cv2.projectPoints
/// project(np.array([[[x, y, 1.0]]]), np.zeros(3), np.zeros(3), K, np.array(coefficients))[0]
/// ```
#[rustfmt::skip]
const REFERENCE: [Reference; 3] = [
    ("plumb_bob", &[-0.28, 0.09, 0.0011, -0.0007, -0.012], &[
        ([0.0, 0.0], [424.0000000000, 240.0000000000]),
        ([0.1, -0.05], [493.7323577344, 204.6423891133]),
        ([-0.31, 0.12], [213.2734162193, 322.8019308416]),
        ([0.45, 0.3], [715.3985494197, 437.3662813933]),
        ([-0.6, -0.35], [52.2422369887, 20.5600408433]),
        ([0.02, 0.5], [436.9871085814, 572.6227500005]),
        ([0.7, -0.01], [855.9276834982, 234.1207444046]),
        ([-0.25, -0.55], [264.8604732125, -114.4243309172]),
    ]),
    ("rational_polynomial", &[0.41, -0.22, -0.0006, 0.0009, 0.013, 0.72, -0.11, 0.021], &[
        ([0.0, 0.0], [424.0000000000, 240.0000000000]),
        ([0.1, -0.05], [493.7546464085, 204.6230980714]),
        ([-0.31, 0.12], [214.3883485254, 322.2793966020]),
        ([0.45, 0.3], [713.0384028285, 435.1958052460]),
        ([-0.6, -0.35], [60.4317673447, 24.5033988040]),
        ([0.02, 0.5], [437.1402012541, 569.0911499728]),
        ([0.7, -0.01], [848.8225908430, 233.6400986700]),
        ([-0.25, -0.55], [267.1523036651, -110.6630379645]),
    ]),
    ("equidistant", &[0.031, -0.012, 0.0042, -0.0009], &[
        ([0.0, 0.0], [424.0000000000, 240.0000000000]),
        ([0.1, -0.05], [493.7371633360, 204.6332957368]),
        ([-0.31, 0.12], [213.8582849112, 322.5072540349]),
        ([0.45, 0.3], [714.7663651792, 436.6134469307]),
        ([-0.6, -0.35], [53.2483257538, 20.6385927377]),
        ([0.02, 0.5], [437.0606315319, 571.1802995577]),
        ([0.7, -0.01], [855.8137228220, 233.7431072816]),
        ([-0.25, -0.55], [265.2856827972, -114.1596621010]),
    ]),
];

/// The table's last digit.
const OPENCV_ROUNDING_PX: f64 = 1e-9;

/// There and back, px: Newton's method stops within 1e-12 focal lengths, and a stretch of 1e-3 amplifies that.
const ROUND_TRIP_PX: f64 = 1e-6;

fn camera(lens: Lens) -> Camera {
    Camera::new(700.0, 710.0, 424.0, 240.0, 848, 480, lens).unwrap()
}

/// Lenses as calibrations give them, from harmless to so strong that they turn back within the picture.
fn lenses() -> impl Strategy<Value = Lens> {
    let (small, tangential) = (-0.1..0.1f64, -0.003..0.003f64);
    prop_oneof![
        Just(Lens::None),
        (-0.5..0.3f64, small.clone(), tangential.clone(), tangential.clone(), small.clone())
            .prop_map(|(k1, k2, p1, p2, k3)| Lens::PlumbBob([k1, k2, p1, p2, k3])),
        (prop::array::uniform3(-0.5..0.5f64), prop::array::uniform2(tangential), prop::array::uniform3(-0.3..0.5f64))
            .prop_map(|([k1, k2, k3], [p1, p2], [k4, k5, k6])| Lens::Rational([k1, k2, p1, p2, k3, k4, k5, k6])),
        (-0.2..0.2f64, prop::array::uniform3(small))
            .prop_map(|(k1, [k2, k3, k4])| Lens::KannalaBrandt([k1, k2, k3, k4])),
    ]
}

#[test]
fn opencv_agrees() {
    for (model, coefficients, points) in REFERENCE {
        let camera = camera(Lens::from_model(model, coefficients).unwrap());
        assert_eq!(camera.lens().coefficients(), coefficients);
        assert_eq!(camera.lens().model(), model);
        for &([x, y], [u, v]) in points {
            let expected = Vector2::new(u, v);
            let pixel = camera.pixel_from_point(Vector3::new(x, y, 1.0) * 2.5).unwrap();
            assert!((pixel - expected).norm() < OPENCV_ROUNDING_PX, "{model} {x} {y}: {pixel} for {expected}");
            let ray = camera.ray_from_pixel(expected).unwrap();
            assert!((ray - Vector3::new(x, y, 1.0)).norm() < 1e-11, "{model} {x} {y}: {ray}");
        }
    }
}

proptest! {
    #[test]
    fn there_and_back(lens in lenses(), x in -2.0..2.0, y in -2.0..2.0, z in 0.2..8.0) {
        let camera = camera(lens);
        let point = Vector3::new(x, y, 1.0) * z;
        // Beyond the model's range there is no pixel; within it there is a way back, to the same point.
        if let Some(pixel) = camera.pixel_from_point(point) {
            let ray = camera.ray_from_pixel(pixel);
            prop_assert!(ray.is_some(), "no ray through {pixel}");
            let ray = ray.unwrap();
            prop_assert_eq!(ray.z, 1.0);
            let error: Vector2<f64> = ray.xy() - Vector2::new(x, y);
            prop_assert!(error.norm() * 700.0 < ROUND_TRIP_PX, "{} for {}", ray, point / z);
            let again = camera.pinhole_from_pixel(pixel).unwrap();
            prop_assert!((camera.pixel_from_pinhole(again).unwrap() - pixel).norm() < ROUND_TRIP_PX);
        }
    }

    #[test]
    fn back_and_there(lens in lenses(), u in -500.0..1500.0, v in -500.0..1000.0) {
        let camera = camera(lens);
        let pixel = Vector2::new(u, v);
        if let Some(ray) = camera.ray_from_pixel(pixel) {
            let again = camera.pixel_from_point(ray);
            prop_assert!(again.is_some(), "no pixel for {ray}");
            prop_assert!((again.unwrap() - pixel).norm() < ROUND_TRIP_PX, "{} for {pixel}", again.unwrap());
        }
    }

    #[test]
    fn jacobians_are_the_slopes(lens in lenses(), x in -1.0..1.0, y in -1.0..1.0, z in 0.5..4.0) {
        let camera = camera(lens);
        let point = Vector3::new(x, y, 1.0) * z;
        let Some((pixel, jacobian)) = camera.pixel_from_point_with_jacobian(point) else {
            prop_assert!(camera.pixel_from_point(point).is_none());
            return Ok(());
        };
        prop_assert_eq!(Some(pixel), camera.pixel_from_point(point));
        // Central differences: error of the order of step², and of rounding over the step.
        let step = 1e-6 * z;
        let tolerance = 1e-5 * (1.0 + jacobian.norm());
        for k in 0..3 {
            let mut d = Vector3::zeros();
            d[k] = step;
            let (Some(after), Some(before)) = (camera.pixel_from_point(point + d), camera.pixel_from_point(point - d)) else {
                return Ok(());
            };
            let slope = (after - before) / (2.0 * step);
            prop_assert!((slope - jacobian.column(k)).norm() < tolerance, "{slope} for {}", jacobian.column(k));
        }

        let (ray, inverse) = camera.ray_from_pixel_with_jacobian(pixel).unwrap();
        prop_assert_eq!(Some(ray), camera.ray_from_pixel(pixel));
        // One step along x, y moves the pixel by the first two columns times z, and the ray back by one.
        let product = inverse * jacobian.fixed_columns::<2>(0) * z;
        let error: Matrix2<f64> = product - Matrix2::identity();
        prop_assert!(error.norm() < 1e-6, "{product}");
    }

    #[test]
    fn no_two_points_share_a_pixel(lens in lenses(), a in -1.5..1.5, b in -1.5..1.5, c in -1.5..1.5, d in -1.5..1.5) {
        // Injective: the Jacobian's symmetric part is positive between any two points of the valid disc.
        let camera = camera(lens);
        let (p, q) = (Vector2::new(a, b), Vector2::new(c, d));
        if let (Some(at_p), Some(at_q)) = (camera.pixel_from_point(p.push(1.0)), camera.pixel_from_point(q.push(1.0))) {
            let apart = (at_p - at_q).component_div(&Vector2::new(700.0, 710.0));
            if matches!(lens, Lens::KannalaBrandt(_)) {
                prop_assert!(apart.norm() > 1e-5 * (p - q).norm());
            } else {
                prop_assert!(apart.dot(&(p - q)) >= 0.99e-3 * (p - q).norm_squared(), "{p} {q}");
            }
        }
    }
}

#[test]
fn a_lens_is_refused_where_it_turns_back() {
    // r - 0.35 r³ rises to 0.6506 at r = 0.9759 and falls from there: a pixel at 0.66 belongs to no ray, one at 0.6 to
    // two, of which the inner one is meant.
    let camera = camera(Lens::PlumbBob([-0.35, 0.0, 0.0, 0.0, 0.0]));
    let at = |r: f64| Vector2::new(424.0 + 700.0 * r, 240.0);
    assert!(camera.ray_from_pixel(at(0.66)).is_none());
    let inner = camera.ray_from_pixel(at(0.6)).unwrap().x;
    assert!(inner < 0.9759 && (inner - 0.35 * inner.powi(3) - 0.6).abs() < 1e-12);
    assert!(camera.pixel_from_point(Vector3::new(0.97, 0.0, 1.0)).is_some());
    assert!(camera.pixel_from_point(Vector3::new(0.98, 0.0, 1.0)).is_none());
    assert!(camera.pixel_from_point(Vector3::new(1.2, 0.0, 1.0)).is_none());
}

#[test]
fn a_pole_of_the_rational_model_is_refused() {
    // The denominator 1 - r² is zero at r = 1.
    let camera = camera(Lens::Rational([0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0]));
    assert!(camera.pixel_from_point(Vector3::new(0.9, 0.0, 1.0)).is_some());
    assert!(camera.pixel_from_point(Vector3::new(1.1, 0.0, 1.0)).is_none());
}

#[test]
fn a_fisheye_sees_to_ninety_degrees_and_no_further() {
    let camera = camera(Lens::KannalaBrandt([0.0; 4]));
    let at = |degrees: f64| Vector2::new(424.0, 240.0 + 710.0 * degrees.to_radians());
    for degrees in [1e-9, 1.0, 45.0, 80.0, 89.0, 89.8] {
        let ray = camera.ray_from_pixel(at(degrees)).unwrap();
        assert!((ray.y.atan().to_degrees() - degrees).abs() < 1e-9, "{degrees}: {ray}");
    }
    for degrees in [89.95, 90.0, 95.0, 200.0] {
        assert!(camera.ray_from_pixel(at(degrees)).is_none(), "{degrees}");
    }
    assert!(camera.pixel_from_point(Vector3::new(1.0, 0.0, 0.0)).is_none());
    assert!(camera.pixel_from_point(Vector3::new(1.0, 0.0, -0.1)).is_none());
}

#[test]
fn nonsense_has_no_pixel_and_no_ray() {
    for lens in [Lens::PlumbBob([0.1; 5]), Lens::Rational([0.1; 8]), Lens::KannalaBrandt([0.1; 4])] {
        let camera = camera(lens);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
            assert!(camera.ray_from_pixel(Vector2::new(bad, 0.0)).is_none(), "{lens:?} {bad}");
            assert!(camera.pixel_from_point(Vector3::new(bad, 0.0, 1.0)).is_none(), "{lens:?} {bad}");
        }
        for z in [0.0, -1.0, f64::NAN, -f64::INFINITY] {
            assert!(camera.pixel_from_point(Vector3::new(0.1, 0.0, z)).is_none(), "{lens:?} {z}");
            assert!(camera.pinhole().pixel_from_point(Vector3::new(0.1, 0.0, z)).is_none(), "{z}");
        }
    }
}

#[test]
fn intrinsics_are_checked_by_name() {
    let new = |fx, fy, cx, cy, w, h, lens| Camera::new(fx, fy, cx, cy, w, h, lens).unwrap_err().to_string();
    assert!(new(0.0, 1.0, 0.0, 0.0, 1, 1, Lens::None).contains("fx is 0"));
    assert!(new(1.0, f64::NAN, 0.0, 0.0, 1, 1, Lens::None).contains("fy is NaN"));
    assert!(new(1.0, 1.0, f64::INFINITY, 0.0, 1, 1, Lens::None).contains("cx is inf"));
    assert!(new(1.0, 1.0, 0.0, 0.0, 0, 1, Lens::None).contains("image width is 0"));
    assert!(new(1.0, 1.0, 0.0, 0.0, 1, 0, Lens::None).contains("image height is 0"));
    assert!(
        new(1.0, 1.0, 0.0, 0.0, 1, 1, Lens::KannalaBrandt([0.0, f64::NAN, 0.0, 0.0]))
            .contains("distortion coefficient is NaN")
    );
    let sizes = camera(Lens::None).check_image_size(640, 480).unwrap_err().to_string();
    assert!(sizes.contains("848x480") && sizes.contains("640x480"), "{sizes}");
}

/// Coefficients that make no lens at this focal length are an error; lenses that end inside the picture, as wide ones do, are not.
#[test]
fn a_lens_that_takes_nothing_into_the_picture_is_refused() {
    let new = |focal: f64, width: u32, lens| {
        let (w, h) = (f64::from(width), 480.0);
        Camera::new(focal, focal, w / 2.0, h / 2.0, width, 480, lens)
    };
    for lens in [
        Lens::PlumbBob([1e6, 0.0, 0.0, 0.0, 0.0]),
        Lens::PlumbBob([-5.0, 0.0, 0.0, 0.0, 0.0]),
        Lens::PlumbBob([0.0, 0.0, 30.0, 0.0, 0.0]),
        Lens::Rational([0.0, 0.0, 0.0, 0.0, 0.0, 1e6, 0.0, 0.0]),
        Lens::KannalaBrandt([-8.0, 0.0, 0.0, 0.0]),
    ] {
        let refused = new(600.0, 848, lens).unwrap_err();
        assert!(matches!(refused, Error::NearlyBlind { .. }), "{lens:?}: {refused}");
        assert!(refused.to_string().contains(&format!("{:?} of {}", lens.coefficients(), lens.model())), "{refused}");
    }
    for (focal, width, lens) in [
        // Ideal fisheyes of 190 and 250 degrees whose circles fit into the picture's height; half as much of a picture twice as wide.
        (240.0 / 95f64.to_radians(), 848, Lens::KannalaBrandt([0.0; 4])),
        (240.0 / 125f64.to_radians(), 848, Lens::KannalaBrandt([0.0; 4])),
        (240.0 / 95f64.to_radians(), 1696, Lens::KannalaBrandt([0.0; 4])),
        // The polynomial of a wide lens turns back before the corners.
        (420.0, 848, Lens::PlumbBob([-0.45, 0.0, 0.0, 0.0, 0.0])),
        // As strong as this looks, at a long focal length it is 5 % at the corner.
        (4000.0, 848, Lens::PlumbBob([-4.0, 0.0, 0.0, 0.0, 0.0])),
        // The strong pincushion of a flat port.
        (600.0, 848, Lens::PlumbBob([0.5, 0.3, 0.0, 0.0, 0.0])),
    ] {
        let camera = new(focal, width, lens);
        assert!(camera.is_ok(), "{lens:?} at {focal} px: {camera:?}");
    }
}

#[test]
fn models_by_name() {
    assert_eq!(Lens::from_model("plumb_bob", &[]).unwrap(), Lens::None);
    assert_eq!(Lens::from_model("plumb_bob", &[0.0; 5]).unwrap(), Lens::None);
    assert_eq!(Lens::from_model("", &[]).unwrap(), Lens::None);
    assert_eq!(Lens::from_model("radtan", &[0.1, 0.2, 0.3, 0.4]).unwrap(), Lens::PlumbBob([0.1, 0.2, 0.3, 0.4, 0.0]));
    // OpenCV writes 12 or 14, with thin prism and tilt; zero there is a rational model, other than zero is refused.
    let mut twelve = vec![0.1; 8];
    twelve.extend([0.0; 4]);
    assert_eq!(Lens::from_model("rational_polynomial", &twelve).unwrap(), Lens::Rational([0.1; 8]));
    twelve[10] = 0.01;
    assert!(matches!(Lens::from_model("rational_polynomial", &twelve), Err(Error::LensModel { count: 12, .. })));
    // An ideal fisheye is no pinhole.
    assert_eq!(Lens::from_model("equidistant", &[0.0; 4]).unwrap(), Lens::KannalaBrandt([0.0; 4]));
    assert!(Lens::from_model("none", &[0.1]).is_err());
    assert!(Lens::from_model("omni", &[]).unwrap_err().to_string().contains("omni"));
    assert!(matches!(Lens::from_model("plumb_bob", &[f64::NAN]), Err(Error::Value { .. })));
}

#[test]
fn a_crop_sees_the_same_rays() {
    let whole = camera(Lens::PlumbBob([-0.28, 0.09, 0.0011, -0.0007, -0.012]));
    let part = whole.cropped(400, 100, 300, 200).unwrap();
    let pixel = Vector2::new(500.0, 170.0);
    let (a, b) =
        (whole.ray_from_pixel(pixel).unwrap(), part.ray_from_pixel(pixel - Vector2::new(400.0, 100.0)).unwrap());
    assert!((a - b).norm() < 1e-14);
    assert_eq!((part.width(), part.height()), (300, 200));
    assert!(whole.cropped(0, 0, 0, 5).is_err());
}
