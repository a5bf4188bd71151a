//! No memory is allocated per picture once the buffers have grown; the same picture gives the same answer, whatever came before; wrong pictures are errors.

#![allow(clippy::unwrap_used)] // a test may stop

mod scene;

use net_fft::{Error, ThesisConfig, ThesisEstimator};
use net_geometry::{Camera, Lens};
use net_image::{Image, View};
use net_sim::Scene;
use scene::{camera, draw, scene_of, square};

fn pictures() -> Vec<Image<u8>> {
    let mut scenes = vec![Scene::empty()];
    scenes.extend(
        [(0.5, 0.0), (1.2, 25.0), (3.0, -15.0)].map(|(range, tilt)| scene_of(&square(), range, 5.0, tilt, 4.0)),
    );
    scenes.iter().map(|scene| draw(&camera(), scene, 2).0).collect()
}

#[test]
fn nothing_is_allocated_after_warm_up() {
    let pictures = pictures();
    for config in [ThesisConfig::default(), ThesisConfig::thesis(false)] {
        let mut estimator = ThesisEstimator::new(&camera(), &square(), &config).unwrap();
        let mut all = || {
            let found = pictures.iter().map(|picture| estimator.estimate(picture.view().unwrap()).unwrap());
            found.fold(0.0, |sum, found| sum + found.map_or(0.0, |found| found.probability))
        };
        let first = all();
        let mut again = 0.0;
        let allocations = allocation_counter::measure(|| again = all());
        assert_eq!(again, first);
        assert_eq!(allocations.count_total, 0, "{:?}", config.selection);
    }
}

#[test]
fn the_same_picture_gives_the_same_answer_whatever_came_before() {
    let pictures = pictures();
    let mut used = ThesisEstimator::new(&camera(), &square(), &ThesisConfig::default()).unwrap();
    for picture in &pictures {
        used.estimate(picture.view().unwrap()).unwrap();
    }
    for picture in &pictures {
        let mut fresh = ThesisEstimator::new(&camera(), &square(), &ThesisConfig::default()).unwrap();
        assert_eq!(fresh.estimate(picture.view().unwrap()).unwrap(), used.estimate(picture.view().unwrap()).unwrap());
    }
}

#[test]
fn wrong_pictures_and_tiny_cameras_are_no_panic() {
    let mut estimator = ThesisEstimator::new(&camera(), &square(), &ThesisConfig::default()).unwrap();
    let small = [0u8; 100];
    let error = estimator.estimate(View::packed(&small, 10, 10).unwrap()).unwrap_err();
    assert_eq!(error.to_string(), "planned for 848x480 px, got 10x10 px");
    for level in [0u8, 128, 255] {
        let constant = vec![level; 848 * 480];
        let found = estimator.estimate(View::packed(&constant, 848, 480).unwrap()).unwrap();
        assert!(found.is_none_or(|found| found.probability < 0.1), "a constant picture of {level}");
    }
    for (width, height) in [(1, 1), (1, 97), (211, 1), (2, 3), (16, 9), (33, 31), (64, 2), (5, 200), (211, 127)] {
        let camera = Camera::new(20.0, 20.0, 8.0, 4.0, width, height, Lens::None).unwrap();
        match ThesisEstimator::new(&camera, &square(), &ThesisConfig::default()) {
            Ok(mut estimator) => {
                let noise: Vec<u8> = (0..width * height).map(|i| (i * 7919 % 251) as u8).collect();
                let picture = View::packed(&noise, width as usize, height as usize).unwrap();
                assert!(estimator.estimate(picture).unwrap().is_none_or(|found| found.probability < 0.5));
            }
            Err(error) => assert!(matches!(error, Error::EmptySize { .. }), "{error}"),
        }
    }
}
