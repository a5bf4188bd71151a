//! Scores the estimator on a folder of stills with exact truth (`sNNN_<group>_<name>.json` beside each picture).
//!
//!     cargo run --release -p net-lattice --example score -- FOLDER [NAME-PART ...] [--overlay DIR]
//!
//! A line per picture, then a table by group. Wrong: range off by 5 %, normal or in-plane rotation by 5 degrees.

mod draw;
mod evidence;

use std::path::PathBuf;
use std::time::Instant;

use net_geometry::nalgebra::{Matrix3, Vector2, Vector3};
use net_geometry::{Camera, Lens, Mesh};
use net_image::GrayView;
use net_lattice::{Config, LatticeEstimate, LatticeEstimator};
use serde_json::Value;

fn number(v: &Value) -> Option<f64> {
    v.as_f64()
}
fn vector(v: &Value) -> Option<Vec<f64>> {
    v.as_array().map(|a| a.iter().filter_map(number).collect())
}
fn vector3(v: &Value) -> Option<Vector3<f64>> {
    let v = vector(v)?;
    (v.len() == 3).then(|| Vector3::new(v[0], v[1], v[2]))
}

struct Truth {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    normal: Vector3<f64>,
    range: f64,
    a1: Vector2<f64>,
    a2: Vector2<f64>,
    origin: Vector2<f64>,
    angle: f64,
    visible: bool,
}

fn truth(layer: &Value) -> Option<Truth> {
    let rows: Vec<Vec<f64>> = layer["R"].as_array()?.iter().filter_map(vector).collect();
    let rotation = Matrix3::from_fn(|i, j| rows[i][j]);
    let mut fit = &layer["fit"];
    let curved = number(&fit["max_offplane_m"]).unwrap_or(0.0) > 0.0055;
    if curved && layer["fit_local"]["normal_cam"].is_array() {
        fit = &layer["fit_local"];
    }
    let mut normal = vector3(&fit["normal_cam"]).unwrap_or_else(|| rotation.column(2).into_owned());
    if normal.z < 0.0 {
        normal = -normal;
    }
    let mut range = number(&fit["dist_axis"]).or_else(|| number(&layer["dist_axis"]))?;
    if curved {
        range = number(&layer["fit"]["axis_depth_local"]).unwrap_or(range);
    }
    let two = |v: &Value| vector(v).map(|v| Vector2::new(v[0], v[1]));
    let visibility =
        if layer["visibility_local"].is_object() { &layer["visibility_local"] } else { &layer["visibility"] };
    let visible = match (number(&visibility["contrast_mean"]), number(&visibility["snr"])) {
        (Some(c), Some(s)) => !(c.abs() < 1.5 && s < 0.3),
        _ => true,
    };
    Some(Truth {
        rotation,
        translation: vector3(&layer["t"])?,
        normal,
        range,
        a1: two(&layer["a1"])?,
        a2: two(&layer["a2"])?,
        origin: two(&layer["origin"]).unwrap_or_default(),
        angle: number(&fit["cell_angle_deg"]).or_else(|| number(&layer["cell_angle_deg"])).unwrap_or(90.0),
        visible,
    })
}

fn angle(a: Vector3<f64>, b: Vector3<f64>) -> f64 {
    a.cross(&b).norm().atan2(a.dot(&b)).to_degrees()
}

#[derive(Default, Clone)]
struct Score {
    kind: String,
    negative: bool,
    visible: bool,
    ok: bool,
    range: f64,
    normal: f64,
    inplane: f64,
    xy_mm: f64,
    crossing: f64,
    wrong: bool,
    z: f64,
    ms: f64,
    probability: f64,
}

fn score(e: &LatticeEstimate, t: &Truth) -> Score {
    let r = e.pose.rotation.matrix();
    let plane = std::env::var_os("MEAN_PLANE").is_some();
    let normal = if plane { e.mean_plane.normal } else { e.pose.normal() };
    let x = r.column(0).into_owned();
    let inplane = [t.a1, t.a2]
        .iter()
        .flat_map(|v| [*v, -*v])
        .map(|v| angle(x, t.rotation * Vector3::new(v.x, v.y, 0.0)))
        .fold(f64::INFINITY, f64::min);
    let o = t.rotation.transpose() * (e.pose.translation - t.translation);
    let a = net_geometry::nalgebra::Matrix2::from_columns(&[t.a1, t.a2]);
    let ij = a.try_inverse().unwrap_or_default() * (Vector2::new(o.x, o.y) - t.origin);
    let ij = ij.map(|v| v - v.round());
    let mut xy = f64::INFINITY;
    for p in -1..=1 {
        for q in -1..=1 {
            xy = xy.min((a * (ij - Vector2::new(f64::from(p), f64::from(q)))).norm());
        }
    }
    let range = 100.0 * (e.range / t.range - 1.0).abs();
    let tilt = angle(normal, t.normal);
    let c = e.crossing_angle.to_degrees();
    Score {
        ok: true,
        range,
        normal: tilt,
        inplane,
        xy_mm: 1000.0 * xy,
        crossing: (c - t.angle).abs().min((180.0 - c - t.angle).abs()),
        wrong: range > 5.0 || tilt > 5.0 || inplane > 5.0,
        z: (e.range - t.range).abs() / e.range_sigma.max(1e-12),
        probability: e.probability,
        ..Score::default()
    }
}

fn mesh(j: &Value, name: &str) -> Option<Mesh> {
    let Some(layer) = j["layers"].get(0) else { return Mesh::square(0.05).ok() };
    let sides = vector(&layer["cell_len"])?;
    let mut angle = number(&layer["cell_angle_deg"])?;
    if j["group"].as_str() == Some("H") || name.contains("skew") {
        angle = 90.0;
    }
    let side = |s: f64| (s * 1e6).round() / 1e6;
    if (angle - 90.0).abs() < 1e-6 {
        return Mesh::rectangular(side(sides[0]), side(sides[1])).ok();
    }
    Mesh::oblique(side(sides[0]), side(sides[1]), angle.to_radians()).ok()
}

fn camera(j: &Value) -> Option<Camera> {
    let k: Vec<f64> = j["K"].as_array()?.iter().filter_map(vector).flatten().collect();
    let mut d = vector(&j["dist"]).unwrap_or_default();
    d.resize(5, 0.0);
    let lens = if d.iter().all(|d| *d == 0.0) { Lens::None } else { Lens::PlumbBob([d[0], d[1], d[2], d[3], d[4]]) };
    Camera::new(k[0], k[4], k[2], k[5], j["width"].as_u64()? as u32, j["height"].as_u64()? as u32, lens).ok()
}

fn kind(j: &Value, name: &str) -> String {
    let base = name.splitn(3, '_').nth(2).unwrap_or(name);
    let stem: String = base.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches('_').into();
    match j["group"].as_str() {
        Some("N") => "NEGATIVE".into(),
        Some("H") => if name.contains("iso") { "H iso" } else { "H hung" }.into(),
        Some("C") => "C mixed".into(),
        Some("A") if base.starts_with("tilt") => format!("A tilt {}", &base[base.len() - 2..]),
        Some("A") => format!("A {}", base.chars().take_while(|c| c.is_alphabetic()).collect::<String>()),
        _ => stem,
    }
}

fn quantile(values: &mut [f64], q: f64) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * q).round() as usize]
}

fn main() {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let mut draw: Option<PathBuf> = None;
    if let Some(k) = args.iter().position(|a| a == "--overlay") {
        args.remove(k);
        draw = (k < args.len()).then(|| args.remove(k).into());
    }
    let Some(folder) = args.first().map(PathBuf::from) else {
        eprintln!("usage: score FOLDER [NAME-PART ...] [--overlay DIR]");
        std::process::exit(2);
    };
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder)
        .map(|d| {
            d.filter_map(|e| Some(e.ok()?.path())).filter(|p| p.extension().is_some_and(|e| e == "json")).collect()
        })
        .unwrap_or_default();
    files.sort();
    let config = Config::default();
    let mut scores: Vec<Score> = Vec::new();
    for path in files {
        let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        if args.len() > 1 && !args[1..].iter().any(|a| name.contains(a.as_str())) {
            continue;
        }
        let Some(j) = std::fs::read_to_string(&path).ok().and_then(|t| serde_json::from_str::<Value>(&t).ok()) else {
            continue;
        };
        let (Some(camera), Some(mesh)) = (camera(&j), mesh(&j, &name)) else { continue };
        let Some(gray) = j["file"].as_str().and_then(|f| image::open(folder.join(f)).ok()).map(|i| i.to_luma8()) else {
            continue;
        };
        let (w, h) = gray.dimensions();
        let Ok(view) = GrayView::packed(gray.as_raw(), w as usize, h as usize) else { continue };
        let mut estimator = match LatticeEstimator::new(&camera, &mesh, &config) {
            Ok(e) => e,
            Err(error) => {
                eprintln!("{name}: {error}");
                continue;
            }
        };
        let start = Instant::now();
        let found = estimator.estimate(view).ok().flatten();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let t = j["layers"].get(0).and_then(truth);
        let mut s = match (&found, &t) {
            (Some(e), Some(t)) => score(e, t),
            (Some(e), None) => Score { ok: true, probability: e.probability, ..Score::default() },
            _ => Score::default(),
        };
        s.ok = s.ok && s.probability >= config.probability_threshold;
        s.kind = kind(&j, &name);
        s.negative = t.is_none();
        s.visible = t.as_ref().is_some_and(|t| t.visible);
        s.ms = ms;
        let verdict = match (s.negative, s.ok, s.wrong) {
            (true, true, _) => "FALSE ALARM",
            (true, false, _) => "-",
            (false, true, true) => "WRONG",
            (false, true, false) => "ok",
            (false, false, true) => "refused (wrong)",
            (false, false, false) => "REFUSED though right",
        };
        let depth = t.as_ref().map_or(0.0, |t| t.range);
        print!(
            "{name:26} {verdict:12} p {:.3} | true {depth:.3} m | range {:7.3} % normal {:6.3} inpl {:6.3} xy {:5.2} cross {:6.3} z {:4.1} | {ms:5.0} ms",
            s.probability, s.range, s.normal, s.inplane, s.xy_mm, s.crossing, s.z
        );
        if let Some(e) = &found {
            println!(" | z {:.3}{}", e.range, evidence::line(e));
            if let Some(dir) = &draw {
                draw::overlay(&dir.join(format!("{name}.png")), &gray, &camera, e);
            }
        } else {
            println!();
        }
        scores.push(s);
    }
    table(&scores);
}

fn table(scores: &[Score]) {
    let mut kinds: Vec<String> = scores.iter().map(|s| s.kind.clone()).collect();
    kinds.sort();
    kinds.dedup();
    kinds.push(String::new());
    println!(
        "{:14} {:>3} {:>3} {:>5} | {:>8} {:>7} | {:>7} {:>6} | {:>6} | {:>6} {:>6} | {:>6}",
        "kind", "n", "ok", "wrong", "range %", "p95", "normal", "p95", "inpl", "xy mm", "cross", "ms"
    );
    for k in kinds {
        let of: Vec<&Score> = scores.iter().filter(|s| if k.is_empty() { !s.negative } else { s.kind == k }).collect();
        let right: Vec<&Score> = of.iter().copied().filter(|s| s.ok && !s.wrong).collect();
        let q = |f: fn(&Score) -> f64, q: f64| quantile(&mut right.iter().map(|s| f(s)).collect::<Vec<_>>(), q);
        println!(
            "{:14} {:3} {:3} {:5} | {:8.4} {:7.3} | {:7.3} {:6.2} | {:6.3} | {:6.2} {:6.3} | {:6.0}",
            if k.is_empty() { "ALL NETS" } else { &k },
            of.len(),
            of.iter().filter(|s| s.ok).count(),
            of.iter().filter(|s| s.ok && s.wrong).count(),
            q(|s| s.range, 0.5),
            q(|s| s.range, 0.95),
            q(|s| s.normal, 0.5),
            q(|s| s.normal, 0.95),
            q(|s| s.inplane, 0.5),
            q(|s| s.xy_mm, 0.5),
            q(|s| s.crossing, 0.5),
            quantile(&mut of.iter().map(|s| s.ms).collect::<Vec<_>>(), 0.5),
        );
    }
    let nets: Vec<&Score> = scores.iter().filter(|s| !s.negative && s.visible).collect();
    println!(
        "visible {} right {} wrong {} refused {} | false alarms {} of {}",
        nets.len(),
        nets.iter().filter(|s| s.ok && !s.wrong).count(),
        scores.iter().filter(|s| !s.negative && s.ok && s.wrong).count(),
        nets.iter().filter(|s| !s.ok).count(),
        scores.iter().filter(|s| s.negative && s.ok).count(),
        scores.iter().filter(|s| s.negative).count()
    );
}
