//! Time of the stages for pictures of 848 x 480 px.
#![allow(missing_docs)] // criterion's macros

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Vector2;
use net_flow::vote::{CellVote, VoteConfig};
use net_flow::{Config, FlowTracker, Guess, Hints, Lattice, MatchConfig, Matcher, Mode, Pyramid};
use net_geometry::Basis;
use net_image::GrayView;

const WIDTH: usize = 848;
const HEIGHT: usize = 480;
const CELL: f64 = 30.0;

/// A net of light twines, 30 px apart, at `shift`, with some grain that moves along.
fn draw(shift: Vector2<f64>) -> Vec<u8> {
    let twine = |x: f64| (-(x - CELL * (x / CELL).round()).powi(2) / 2.5).exp();
    let pixel = |i: usize| {
        let (u, v) = ((i % WIDTH) as f64 - shift.x, (i / WIDTH) as f64 - shift.y);
        let grain = (u * 0.013 * (v * 0.017).sin()).sin() + (u * 0.11 + v * 0.07).cos();
        (80.0 + 12.0 * grain + 110.0 * twine(u).max(twine(v))) as u8
    };
    (0..WIDTH * HEIGHT).map(pixel).collect()
}

fn view(data: &[u8]) -> GrayView<'_> {
    GrayView::packed(data, WIDTH, HEIGHT).expect("a view of its own buffer")
}

fn stages(c: &mut Criterion) {
    let (a, b) = (draw(Vector2::zeros()), draw(Vector2::new(2.3, -1.4)));
    let config = MatchConfig::default();
    let mut prev = Pyramid::new(config.levels);
    let mut next = prev.clone();
    prev.build(view(&a), 24);
    c.bench_function("pyramid", |bench| bench.iter(|| next.build(black_box(view(&b)), 24)));
    let points: Vec<_> =
        (0..300).map(|i| Vector2::new(35.0 + 40.0 * (i % 20) as f64, 30.0 + 29.0 * (i / 20) as f64)).collect();
    let mut matcher = Matcher::new(&config).expect("defaults");
    let mut matches = Vec::new();
    c.bench_function("match 300 points, nothing known", |bench| {
        bench.iter(|| {
            matcher.match_points(&prev, &next, black_box(&points), Guess::Still, &mut matches).expect("equal sizes");
            matches.len()
        })
    });
    let lattice = Lattice::Uniform(Basis { b1: Vector2::new(CELL, 0.0), b2: Vector2::new(0.0, CELL) });
    for (name, mode, lattice) in [
        ("frame, summed", Mode::Summed, None),
        ("frame, with the key frame", Mode::KeyFrame, None),
        ("frame, with the key frame, lattice known", Mode::KeyFrame, Some(lattice)),
    ] {
        let mut tracker = FlowTracker::new(WIDTH, HEIGHT, &Config { mode, ..Config::default() }).expect("defaults");
        let hints = Hints { lattice, ..Hints::default() };
        tracker.update(view(&a), &hints).expect("its size");
        let mut frames = [&a, &b].into_iter().cycle();
        c.bench_function(name, |bench| {
            bench.iter(|| {
                // Infinite.
                let frame = frames.next().map_or(&a, |f| f);
                tracker.update(view(black_box(frame)), &hints).expect("its size").step.agreed
            })
        });
    }
    let mut vote = CellVote::new(&VoteConfig::default()).expect("defaults");
    let pixel = |at: Vector2<f64>| Some(at * CELL + Vector2::new(420.0, 240.0));
    c.bench_function("vote", |bench| bench.iter(|| vote.update(view(black_box(&a)), (0, 0), pixel).compared));
    // As in a run, where the flow has prepared the picture.
    next.build(view(&b), 24);
    c.bench_function("vote, picture flat already", |bench| {
        bench.iter(|| vote.update_flat(black_box(&next), (0, 0), pixel).compared)
    });
}

criterion_group!(benches, stages);
criterion_main!(benches);
