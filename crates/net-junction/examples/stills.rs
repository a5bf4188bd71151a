//! Junctions of rendered stills against their truth, with the true pose as the expectation: by contours, then by net adjustment.
//!
//! `cargo run --release -p net-junction --example stills -- FOLDER [OVERLAYS]`
//!
//! FOLDER holds pictures and a `.json` of the same name beside each: `file`, `K`, `dist_model`, `dist`, `layers[0]` with `R`, `t`, `origin`,
//! `a1`, `a2` and `junctions` (rows `i, j, u, v, depth, flag`; flag 0 is visible). OVERLAYS receives pictures of meshes (green), rejected
//! openings (red, size and shape only), junctions (yellow, magenta without a name).

use std::error::Error;
use std::path::Path;

use image::{Rgb, RgbImage};
use net_geometry::JunctionState;
use net_geometry::nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use net_geometry::{Camera, Junction, Lens, Mesh, Pose};
use net_image::View;
use net_junction::{AdjustConfig, Config, Expectation, ExpectedNet, JunctionDetector, NetAdjuster, Verdict};
use serde_json::Value;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn number(value: &Value) -> Result<f64> {
    value.as_f64().ok_or_else(|| format!("{value} is no number").into())
}

fn numbers(value: &Value) -> Result<Vec<f64>> {
    value.as_array().ok_or_else(|| format!("{value} is no list"))?.iter().map(number).collect()
}

/// A visible node: index, pixel.
type Node = ((i32, i32), Vector2<f64>);

struct Truth {
    net: ExpectedNet,
    /// Every node in the picture, visible or not.
    nodes: Vec<Node>,
    visible: Vec<Node>,
}

fn read_truth(json: &Value) -> Result<Option<Truth>> {
    let layer = &json["layers"][0];
    if layer.is_null() {
        return Ok(None);
    }
    let k = json["K"].as_array().ok_or("no K")?.iter().map(numbers).collect::<Result<Vec<_>>>()?;
    let lens = match json["dist_model"].as_str() {
        Some("plumb_bob") => Lens::PlumbBob(numbers(&json["dist"])?.try_into().map_err(|_| "five coefficients")?),
        _ => Lens::None,
    };
    let (width, height) = (number(&json["width"])? as u32, number(&json["height"])? as u32);
    let camera = Camera::new(k[0][0], k[1][1], k[0][2], k[1][2], width, height, lens)?;
    let rows = layer["R"].as_array().ok_or("no R")?.iter().map(numbers).collect::<Result<Vec<_>>>()?;
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|r, c| rows[r][c]));
    let point = |key: &str| -> Result<Vector2<f64>> {
        let p = numbers(&layer[key])?;
        Ok(Vector2::new(p[0], p[1]))
    };
    let (a1, a2, origin, t) = (point("a1")?, point("a2")?, point("origin")?, numbers(&layer["t"])?);
    // Our net frame begins at the lattice's origin with X along the first direction.
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), a1.y.atan2(a1.x));
    let mesh = Mesh::oblique(a1.norm(), a2.norm(), a1.perp(&a2).atan2(a1.dot(&a2)))?;
    let translation = Vector3::new(t[0], t[1], t[2]) + rotation * origin.push(0.0);
    let pose = Pose { rotation: rotation * turn, translation };
    let (mut nodes, mut visible) = (Vec::new(), Vec::new());
    for row in layer["junctions"].as_array().ok_or("no junctions")? {
        let row = numbers(row)?;
        let node = ((row[0] as i32, row[1] as i32), Vector2::new(row[2], row[3]));
        nodes.push(node);
        if row[5] == 0.0 {
            visible.push(node);
        }
    }
    Ok(Some(Truth { net: ExpectedNet { camera, mesh, pose, anchored: true }, nodes, visible }))
}

/// Counts of one picture: found, right within 2 px, named, named right, visible nodes.
#[derive(Default, Clone, Copy)]
struct Counts {
    found: usize,
    right: usize,
    named: usize,
    named_right: usize,
    visible: usize,
    visible_found: usize,
    squares: f64,
    /// Squared errors over the claimed variance, both axes.
    normalised: f64,
}

impl Counts {
    fn add(&mut self, other: &Counts) {
        self.found += other.found;
        self.right += other.right;
        self.named += other.named;
        self.named_right += other.named_right;
        self.visible += other.visible;
        self.visible_found += other.visible_found;
        self.squares += other.squares;
        self.normalised += other.normalised;
    }
}

fn compare(junctions: &[Junction], truth: &Truth) -> Counts {
    let mut counts = Counts { found: junctions.len(), visible: truth.visible.len(), ..Counts::default() };
    let mut taken = std::collections::BTreeSet::new();
    counts.found = 0;
    for junction in junctions.iter().filter(|j| j.state == JunctionState::Seen) {
        counts.found += 1;
        counts.named += usize::from(junction.index.is_some());
        let distance = |n: &Node| (n.1 - junction.pixel).norm();
        let Some(node) = truth.nodes.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) else { continue };
        if distance(node) <= 2.0 && taken.insert(node.0) {
            counts.right += 1;
            counts.squares += distance(node).powi(2);
            counts.normalised += 0.5 * (distance(node) / junction.sigma_px).powi(2);
            counts.named_right += usize::from(junction.index == Some(node.0));
        }
    }
    counts.visible_found = truth.visible.iter().filter(|n| taken.contains(&n.0)).count();
    counts
}

fn draw_line(canvas: &mut RgbImage, a: Vector2<f64>, b: Vector2<f64>, colour: Rgb<u8>, scale: f64) {
    let (a, b) = (a * scale, b * scale);
    let steps = (b - a).amax().ceil().max(1.0) as usize;
    for k in 0..=steps {
        let p = a + (b - a) * (k as f64 / steps as f64) + Vector2::repeat(0.5 * scale);
        if p.x >= 0.0 && p.y >= 0.0 && (p.x as u32) < canvas.width() && (p.y as u32) < canvas.height() {
            canvas.put_pixel(p.x as u32, p.y as u32, colour);
        }
    }
}

fn draw(detector: &JunctionDetector, junctions: &[Junction], picture: &image::GrayImage, path: &Path) -> Result<()> {
    let scale = 2_u32;
    let mut canvas = RgbImage::from_fn(picture.width() * scale, picture.height() * scale, |x, y| {
        let grey = picture.get_pixel(x / scale, y / scale).0[0];
        Rgb([grey; 3])
    });
    let scale = f64::from(scale);
    for found in detector.boxes() {
        let colour = match found.verdict {
            Verdict::Accepted => Rgb([0, 200, 0]),
            Verdict::TooSmall | Verdict::Cut | Verdict::NotExpected => continue,
            Verdict::TooLarge => Rgb([150, 60, 0]),
            _ => Rgb([255, 0, 0]),
        };
        for k in 0..4 {
            draw_line(&mut canvas, found.corners[k], found.corners[(k + 1) % 4], colour, scale);
        }
    }
    for junction in junctions {
        let colour = match (junction.state, junction.index) {
            (JunctionState::Seen, Some(_)) => Rgb([255, 255, 0]),
            (JunctionState::Seen, None) => Rgb([255, 0, 255]),
            (JunctionState::Hidden, _) => Rgb([80, 80, 255]),
            (JunctionState::Fouled, _) => Rgb([0, 160, 60]),
            (JunctionState::Missing, _) => Rgb([255, 0, 0]),
            (JunctionState::Inferred, _) => Rgb([160, 160, 0]),
        };
        for arm in [Vector2::new(1.5, 0.0), Vector2::new(0.0, 1.5)] {
            draw_line(&mut canvas, junction.pixel - arm, junction.pixel + arm, colour, scale);
        }
    }
    canvas.save(path)?;
    Ok(())
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("usage: stills FOLDER [OVERLAYS]")?;
    let overlays = arguments.next();
    let mut truths: Vec<_> = std::fs::read_dir(&folder)?.collect::<std::io::Result<Vec<_>>>()?;
    truths.retain(|entry| entry.path().extension().is_some_and(|e| e == "json"));
    truths.sort_by_key(std::fs::DirEntry::file_name);
    println!(
        "| still | visible |{}",
        " found | recall | precision 2 px | RMSE px | error / sigma | named right |".repeat(2)
    );
    println!("|---|---|{}", "---|---|---|---|---|---|".repeat(2));
    let mut total = [Counts::default(); 2];
    for entry in truths {
        let json: Value = serde_json::from_slice(&std::fs::read(entry.path())?)?;
        let Some(truth) = read_truth(&json)? else { continue };
        let name = json["file"].as_str().ok_or("no file")?;
        let picture = image::open(Path::new(&folder).join(name))?.to_luma8();
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let config = Config { keep_rejected: overlays.is_some(), ..Config::default() };
        let mut detector = JunctionDetector::new(width, height, &config)?;
        let mut adjuster = NetAdjuster::new(width, height, &AdjustConfig::default())?;
        let view = View::packed(picture.as_raw(), width, height)?;
        let contours = compare(detector.detect(view, Some(&Expectation::Net(truth.net.clone())))?, &truth);
        let adjusted = compare(adjuster.adjust(view, &truth.net)?, &truth);
        print_row(name, &[contours, adjusted]);
        total[0].add(&contours);
        total[1].add(&adjusted);
        if let Some(overlays) = &overlays {
            std::fs::create_dir_all(overlays)?;
            let stem = Path::new(name).file_stem().and_then(|s| s.to_str()).ok_or("no name")?;
            let path = |method: &str| Path::new(overlays).join(format!("{stem}-{method}.png"));
            draw(&detector, detector.junctions(), &picture, &path("contours"))?;
            draw(&JunctionDetector::new(width, height, &config)?, adjuster.junctions(), &picture, &path("adjusted"))?;
        }
    }
    print_row("all", &total);
    Ok(())
}

fn print_row(name: &str, counts: &[Counts; 2]) {
    let part = |a: usize, b: usize| if b > 0 { a as f64 / b as f64 } else { f64::NAN };
    print!("| {name} | {} |", counts[0].visible);
    for c in counts {
        let n = c.right.max(1) as f64;
        print!(
            " {} | {:.3} | {:.3} | {:.2} | {:.2} | {:.3} |",
            c.found,
            part(c.visible_found, c.visible),
            part(c.right, c.found),
            (c.squares / n).sqrt(),
            (c.normalised / n).sqrt(),
            part(c.named_right, c.named),
        );
    }
    println!();
}
