//! Pictures without a net give no junctions, and bad input is an error or nothing, never a panic.

#![allow(clippy::unwrap_used)] // shared by tests

mod scene;

use net_geometry::nalgebra::Vector3;
use net_image::View;
use net_junction::{CellArea, Config, Error, Expectation, JunctionDetector, LocalMean, Shape};
use scene::{HEIGHT, Random, WIDTH, scene, view};

#[test]
fn constant_and_tiny_pictures_have_no_junctions() {
    for (width, height) in [(1, 1), (1, 50), (50, 1), (3, 3), (100, 60)] {
        for grey in [0_u8, 128, 255] {
            let data = vec![grey; width * height];
            let picture = View::packed(&data, width, height).unwrap();
            for shape in [Shape::Quadrilateral, Shape::Rectangle] {
                for mean in [LocalMean::Box, LocalMean::Gaussian] {
                    let config = Config { shape, mean, keep_rejected: true, keep_outlines: true, ..Config::default() };
                    let mut detector = JunctionDetector::new(width, height, &config).unwrap();
                    assert!(detector.detect(picture, None).unwrap().is_empty());
                    let area = Expectation::Area(CellArea::uniform(100.0));
                    assert!(detector.detect(picture, Some(&area)).unwrap().is_empty());
                    assert_eq!(detector.covering(), None);
                }
            }
        }
    }
}

#[test]
fn noise_has_hardly_any_junctions() {
    let mut random = Random(3);
    let picture: Vec<u8> =
        (0..WIDTH * HEIGHT).map(|_| (128.0 + 20.0 * random.normal()).clamp(0.0, 255.0) as u8).collect();
    let mut detector = JunctionDetector::new(WIDTH, HEIGHT, &Config::default()).unwrap();
    let expectation = Expectation::Net(scene(1.0, 0.0, 20.0, 0.0).net);
    let named =
        detector.detect(view(&picture), Some(&expectation)).unwrap().iter().filter(|j| j.index.is_some()).count();
    // A net at that place has some 450 junctions.
    assert!(named < 20, "{named} junctions in noise");
}

#[test]
fn a_picture_of_another_size_is_refused() {
    let data = [0_u8; 12];
    let mut detector = JunctionDetector::new(5, 3, &Config::default()).unwrap();
    let error = detector.detect(View::packed(&data, 4, 3).unwrap(), None).unwrap_err();
    assert_eq!(error, Error::ImageSize { width: 5, height: 3, image_width: 4, image_height: 3 });
    let mut detector = JunctionDetector::new(4, 3, &Config::default()).unwrap();
    let expectation = Expectation::Net(scene(1.0, 0.0, 0.0, 0.0).net);
    let error = detector.detect(View::packed(&data, 4, 3).unwrap(), Some(&expectation)).unwrap_err();
    assert!(matches!(error, Error::Geometry(_)), "{error}");
}

#[test]
fn values_out_of_range_are_named() {
    let wrong = [
        (Config { block_cells: f64::NAN, ..Config::default() }, "block_cells"),
        (Config { eps_cells: 0.0, ..Config::default() }, "eps_cells"),
        (Config { area_max: 0.1, ..Config::default() }, "area_max"),
        (Config { min_corners: 5, ..Config::default() }, "min_corners"),
        (Config { offset_grey: -1.0, ..Config::default() }, "offset_grey"),
        (Config { block_px: Some(0), ..Config::default() }, "block_px"),
    ];
    for (config, name) in wrong {
        let error = JunctionDetector::new(10, 10, &config).unwrap_err();
        assert!(matches!(error, Error::Value { field, .. } if field == name), "{error}");
    }
    assert!(JunctionDetector::new(0, 10, &Config::default()).is_err());
    Config::default().validate().unwrap();
    Config::thesis().validate().unwrap();
}

#[test]
fn poses_that_cannot_be_give_no_junctions() {
    let s = scene(1.0, 0.0, 0.0, 0.0);
    let picture = s.draw();
    let mut detector = JunctionDetector::new(WIDTH, HEIGHT, &Config::default()).unwrap();
    for translation in [
        Vector3::new(0.0, 0.0, f64::NAN),
        Vector3::zeros(),
        Vector3::new(0.0, 0.0, -1.0),
        Vector3::new(0.0, 0.0, 1e9),
        Vector3::new(f64::INFINITY, 0.0, 1.0),
    ] {
        let mut net = s.net.clone();
        net.pose.translation = translation;
        let junctions = detector.detect(view(&picture), Some(&Expectation::Net(net))).unwrap();
        assert!(junctions.iter().all(|j| j.pixel.x.is_finite() && j.sigma_px.is_finite()));
    }
    for area in [f64::NAN, 0.0, -5.0, f64::INFINITY, 1e-9, 1e12] {
        let area = Expectation::Area(CellArea::uniform(area));
        detector.detect(view(&picture), Some(&area)).unwrap();
    }
}
