//! A camera along simulated nets with holes and growth: what the map says against what the simulator made.

mod support;

use std::collections::{BTreeMap, BTreeSet};

use net_geometry::nalgebra::{Vector2, Vector3};
use net_geometry::{Camera, Lens, Mesh};
use net_junction::{AdjustConfig, ExpectedNet, NetAdjuster};
use net_map::{Config, Frame, Mapper, Seen, Tile, TileKey, TwineLook};
use net_sim::{Growth, Hole, Image, Layer, Net, NetPose, Scene, Simulator, Water};

type Twine = ((i32, i32), usize);

struct Run {
    mapper: Mapper<BTreeMap<TileKey, Vec<u8>>>,
    /// Twines that the simulator broke, of those that were in view with a margin of two cells.
    missing: BTreeSet<Twine>,
}

/// `frames` pictures along X, a third of a cell apart, from the true pose.
fn run(net: Net, frames: u32, config: &Config) -> Run {
    let mesh = Mesh::square(0.05).expect("a mesh");
    let camera = Camera::new(450.0, 450.0, 239.5, 159.5, 480, 320, Lens::None).expect("a camera");
    let mut simulator = Simulator::new(camera);
    let mut adjuster = NetAdjuster::new(480, 320, &AdjustConfig::default()).expect("default");
    let mut mapper = Mapper::new(BTreeMap::new(), config).expect("valid");
    let mut missing = BTreeSet::new();
    let mut image = Image::default();
    for number in 0..frames {
        let pose = NetPose {
            range_m: 1.0,
            tilt_y_deg: 10.0,
            roll_deg: 3.0,
            x_m: 0.017 * f64::from(number),
            ..NetPose::default()
        };
        let scene =
            Scene { layers: vec![Layer { net: net.clone(), pose }], water: Water::default(), ..Scene::default() };
        let truth = simulator.render(&scene, u64::from(number), &mut image).expect("a scene");
        for edge in &truth.layers[0].missing_edges {
            let inside = |p: &Vector2<f64>| p.x > 50.0 && p.x < 430.0 && p.y > 50.0 && p.y < 270.0;
            if edge.pixels.iter().all(inside) {
                let [a, b] = edge.nodes;
                missing.insert((a.min(b), usize::from(a.0 == b.0)));
            }
        }
        let expected = ExpectedNet { camera, mesh, pose: pose.pose(), anchored: true };
        let view = image.view().expect("pixels");
        adjuster.adjust(view, &expected).expect("the size is right");
        let twines = support::looks(adjuster.twines());
        let pixel = |at: Vector2<f64>| {
            let point = expected.pose.transform(mesh.node(at.x, at.y).push(0.0));
            Some((camera.pixel_from_point(point)?, point.z))
        };
        let axis =
            expected.pose.net_from_ray(Vector3::z()).map(|p| mesh.coordinates(p)).expect("the axis meets the net");
        mapper.add(&Frame { number, track: 0, image: view, view: &pixel, axis, twines: &twines }).expect("in order");
    }
    Run { mapper, missing }
}

fn net(holes: Vec<Hole>) -> Net {
    Net { holes, jitter: 0.02, seed: 5, ..Net::default() }
}

#[test]
fn holes_are_found_twine_by_twine_and_none_where_there_is_none() {
    let holes = vec![
        // One twine; four; a dozen.
        Hole { i: 0.5, j: 2.0, radius_i: 0.4, radius_j: 0.4 },
        Hole { i: 4.0, j: -1.0, radius_i: 0.8, radius_j: 0.8 },
        Hole { i: 9.5, j: 1.5, radius_i: 1.6, radius_j: 1.6 },
    ];
    let mut run = run(net(holes), 12, &Config::default());
    let found = run.mapper.holes().expect("in memory");
    let twines: BTreeSet<Twine> = found.iter().flat_map(|h| h.twines.iter().copied()).collect();
    let hit = run.missing.intersection(&twines).count();
    println!("{} holes, {hit} of {} twines", found.len(), run.missing.len());
    assert_eq!(found.len(), 3, "{found:?}");
    // Stubs make single twines of a hole doubtful: nine in ten, over a dozen looks.
    assert!(10 * hit >= 9 * run.missing.len(), "{hit} of {}", run.missing.len());
    assert!(twines.iter().all(|t| run.missing.contains(t)), "no twine that is there is called missing");
    for hole in &found {
        assert!(hole.llr < -6.0 && hole.last_frame > hole.first_frame);
        assert!(hole.outline.len() >= 4 && hole.cells.len() >= 2);
    }
    let whole = self::run(net(Vec::new()), 6, &Config::default()).mapper.holes().expect("in memory");
    assert!(whole.is_empty(), "{whole:?}");
}

#[test]
fn growth_blocks_meshes_where_it_is() {
    let growth = Growth { density: 0.35, size_m: 0.016, patchiness: 0.0, ..Growth::default() };
    let share = |net: Net| {
        let mut run = run(net, 4, &Config::default());
        let keys: Vec<TileKey> = run.mapper.keys().iter().copied().collect();
        let mut shares = Vec::new();
        for key in keys {
            shares
                .extend(run.mapper.tile(key).expect("in memory").cells.iter().filter_map(net_map::Cell::blocked_share));
        }
        assert!(shares.len() > 50 && shares.iter().all(|s| (0.0..=1.0).contains(s)));
        shares.iter().sum::<f32>() / shares.len() as f32
    };
    let (clean, grown) = (share(net(Vec::new())), share(Net { growth, ..net(Vec::new()) }));
    println!("blocked: clean {clean:.3}, grown {grown:.3}");
    // Twine of 2 mm in cells of 50 mm blocks 8 %; blur adds to it.
    assert!(clean > 0.04 && clean < 0.2, "{clean}");
    // Tufts of 16 mm on a third of the twines cover two to four per cent of a cell each side.
    assert!(grown > clean + 0.015, "{clean} {grown}");
}

#[test]
fn coverage_says_what_was_seen_from_where() {
    let mut run = run(net(Vec::new()), 3, &Config::default());
    let (key, place) = TileKey::of(0, (0, 0));
    let cell = run.mapper.tile(key).expect("in memory").cells[place];
    assert_eq!((cell.frames, cell.first, cell.last), (3, 0, 2));
    // 50 mm at 1 m with f = 450 px, tilted by 10 degrees.
    assert!((cell.best_px - 22.0).abs() < 1.0, "{}", cell.best_px);
    assert!((cell.best_depth_m - 1.0).abs() < 0.05);
    // Twine is drawn away from the water's 128 at the borders, not in the middle.
    let at = |x: usize, y: usize| i32::from(cell.patch[y * net_map::PATCH + x]) - 128;
    assert!(at(8, 8).abs() < 30 && at(0, 8).abs() > 40, "{} {}", at(8, 8), at(0, 8));
}

#[test]
fn memory_is_bounded_and_what_is_spilled_comes_back() {
    let small = Config { tiles_in_memory: 4, ..Config::default() };
    let holes = vec![Hole { i: 4.0, j: -1.0, radius_i: 0.8, radius_j: 0.8 }];
    let mut a = run(net(holes.clone()), 5, &small);
    let mut b = run(net(holes), 5, &Config::default());
    assert_eq!(a.mapper.holes().expect("sound"), b.mapper.holes().expect("sound"));
    let keys = a.mapper.keys().clone();
    assert_eq!(&keys, b.mapper.keys());
    for key in keys {
        let tile: Tile = a.mapper.tile(key).expect("sound").clone();
        assert_eq!(&tile, b.mapper.tile(key).expect("sound"));
    }
}

#[test]
fn bad_input_is_refused() {
    assert!(Mapper::new(BTreeMap::new(), &Config { look_cells: f64::NAN, ..Config::default() }).is_err());
    let mut mapper = Mapper::new(BTreeMap::new(), &Config::default()).expect("default");
    let picture = [0_u8; 4];
    let image = net_image::GrayView::new(&picture, 2, 2, 2).expect("two by two");
    let nowhere = |_: Vector2<f64>| None;
    let twines = [TwineLook {
        index: (i32::MIN, i32::MAX),
        direction: 7,
        seen: Seen::Missing,
        llr: f32::NAN,
        contrast: f32::INFINITY,
    }];
    let frame = Frame { number: 3, track: 0, image, view: &nowhere, axis: Vector2::zeros(), twines: &twines };
    mapper.add(&frame).expect("it says nothing");
    assert!(mapper.keys().is_empty());
    let error = mapper.add(&frame).expect_err("the same frame again").to_string();
    assert!(error.contains("frame 3"), "{error}");
}
