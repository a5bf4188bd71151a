//! Time of each stage and of the whole.

#![allow(clippy::unwrap_used)] // a bench may stop

#[path = "../tests/scene/mod.rs"]
mod scene;

use criterion::{Criterion, criterion_group, criterion_main};
use net_fft::{
    Bins, Flattener, HalfSpectrum, PeakConfig, PeakFinder, RealFft2, RunningExtrema, SectionAnalyser, SectionConfig,
    SectionSpectrum, SpectrumImage, SpectrumImageConfig, SpectrumPlan, ThesisConfig, ThesisEstimator, Window,
};
use net_geometry::{Camera, Lens};
use net_image::{Image, View};
use scene::{camera, draw, scene_of, square};

/// The transform alone, to be held against `scipy.fft.rfft2` in one thread.
fn transform(c: &mut Criterion) {
    let mut group = c.benchmark_group("real 2-D transform");
    for (width, height) in [(848, 480), (1280, 720), (424, 240), (240, 256), (211, 127)] {
        let picture: Vec<f32> = (0..width * height).map(|i| ((i * 7919) % 251) as f32).collect();
        let view = View::packed(&picture, width, height).unwrap();
        let (mut fft, mut out) = (RealFft2::new(width, height).unwrap(), HalfSpectrum::default());
        group.bench_function(format!("{width}x{height}"), |b| b.iter(|| fft.forward(view, &mut out).unwrap()));
    }
    group.finish();
}

/// The stages of one section of 240 x 256 px.
fn stages(c: &mut Criterion) {
    let (picture, _) = draw(&camera(), &scene_of(&square(), 1.5, 10.0, 20.0, 5.0), 1);
    let section = picture.view().unwrap().crop(300, 100, 240, 256).unwrap();
    let (width, height) = (240, 256);
    let mut group = c.benchmark_group("section 240x256");

    let (mut plan, mut half) = (SpectrumPlan::new(width, height, Window::Hann).unwrap(), HalfSpectrum::default());
    group.bench_function("window and transform", |b| b.iter(|| plan.transform(section, &mut half).unwrap()));
    let bins = Bins::Half { left: 8, right: 92, vertical: 97 };
    let mut drawn = SpectrumImage::default();
    group.bench_function("grey image", |b| b.iter(|| drawn.draw(&half, bins, SpectrumImageConfig::default())));
    let (mut flattener, mut flat) = (Flattener::new(width, height, bins, 1e4).unwrap(), Image::default());
    group.bench_function("flatten", |b| b.iter(|| flattener.flatten(&half, &mut flat).unwrap()));
    let (mut extrema, mut out) = (RunningExtrema::default(), Image::default());
    for size in [3, 16, 64] {
        group.bench_function(format!("running maximum over {size}"), |b| {
            b.iter(|| extrema.max(flat.view().unwrap(), size, size, &mut out));
        });
    }
    let mut finder = PeakFinder::default();
    group.bench_function("peaks", |b| {
        b.iter(|| finder.find(flat.view().unwrap(), flattener.constant_bin(), &PeakConfig::default()).len());
    });
    let mut analyser = SectionAnalyser::new(width, height, &SectionConfig::default()).unwrap();
    let mut spectrum = SectionSpectrum::default();
    group.bench_function("all, to the candidates", |b| b.iter(|| analyser.analyse(section, &mut spectrum).unwrap()));
    group.finish();
}

/// A whole picture.
fn whole(c: &mut Criterion) {
    let mut group = c.benchmark_group("whole picture");
    let wide = Camera::new(900.0, 900.0, 640.0, 360.0, 1280, 720, Lens::None).unwrap();
    for (name, camera) in [("848x480", camera()), ("1280x720", wide)] {
        for range in [0.5, 1.5, 4.0] {
            let (picture, _) = draw(&camera, &scene_of(&square(), range, 5.0, 20.0, 5.0), 1);
            let mut estimator = ThesisEstimator::new(&camera, &square(), &ThesisConfig::default()).unwrap();
            group.bench_function(format!("{name}, net at {range} m"), |b| {
                b.iter(|| estimator.estimate(picture.view().unwrap()).unwrap().is_some());
            });
        }
    }
    let (picture, _) = draw(&camera(), &scene_of(&square(), 1.5, 5.0, 20.0, 5.0), 1);
    let mut estimator = ThesisEstimator::new(&camera(), &square(), &ThesisConfig::thesis(false)).unwrap();
    group.bench_function("848x480, four sections, each with its own choice", |b| {
        b.iter(|| estimator.estimate(picture.view().unwrap()).unwrap().is_some());
    });
    group.finish();
}

criterion_group!(benches, transform, stages, whole);
criterion_main!(benches);
