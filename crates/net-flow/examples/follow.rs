//! Follows points through a folder of binary PGM pictures (natural order of their names) and writes where they go.
//!
//! ```text
//! follow FOLDER [--summed] [--only-given] [--threshold PX] > tracks.csv
//! ```
//! `FOLDER/truth.csv` has `frame,point,u,v`: the points of frame 0 are followed, the others serve to tell the error. Standard output:
//! `frame,point,u,v,state,status`; standard error: errors and times.

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use nalgebra::Vector2;
use net_flow::{Config, FlowTracker, Hints, Mode, Status};
use net_image::{GrayView, Image};

fn main() -> Result<(), Box<dyn Error>> {
    let mut config = Config::default();
    let mut folder = None;
    let mut only_given = false;
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--summed" => config.mode = Mode::Summed,
            "--only-given" => only_given = true,
            "--max-step" => config.max_step_px = Some(args.next().ok_or("--max-step PX")?.parse()?),
            _ => folder = Some(PathBuf::from(arg)),
        }
    }
    let folder = folder.ok_or("follow FOLDER [--summed] [--max-step PX] [--only-given]")?;
    if only_given {
        config.seed_spacing_px = 1000.0;
    }
    let mut files: Vec<_> = std::fs::read_dir(&folder)?.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>()?;
    files.retain(|p| p.extension().is_some_and(|e| e == "pgm"));
    files.sort();
    let truth = read_truth(&folder.join("truth.csv"))?;
    let frames = files.iter().map(|p| read_pgm(p)).collect::<Result<Vec<_>, _>>()?;
    let first = frames.first().ok_or("no picture")?;
    let mut tracker = FlowTracker::new(first.width(), first.height(), &config)?;
    let mut out = String::from("frame,point,u,v,state,status\n");
    let mut ids = 0;
    let (mut started, mut tracked, mut ambiguous, mut lost) = (0, 0, 0, 0);
    let (mut time, mut cpu) = (0.0, 0.0);
    let mut points = 0;
    for (k, frame) in frames.iter().enumerate() {
        let view = frame.view().ok_or("an empty picture")?;
        let (begin, cpu_begin) = (Instant::now(), cpu_seconds());
        let result = tracker.update(view, &Hints::default())?;
        time += begin.elapsed().as_secs_f64();
        cpu += cpu_seconds() - cpu_begin;
        points += result.tracks.len();
        match result.step.status {
            Status::Started => started += 1,
            Status::Tracked => tracked += 1,
            Status::Ambiguous => ambiguous += 1,
            Status::Lost => lost += 1,
        }
        let status = result.status;
        if std::env::var_os("FLOW_TRACE").is_some() {
            let (s, d) = (&result.step, &result.direct);
            let worst = s.rivals.first();
            eprintln!(
                "{k} {status:?} step {:?} {}/{}/{} spread {:.3} cover {:.2} rivals {} worst {:?} direct {:?}",
                s.status,
                s.agreed,
                s.matched,
                s.points,
                s.spread_px,
                s.coverage,
                s.rivals.len(),
                worst.map(|r| (r.shift_px.x.round(), r.shift_px.y.round(), r.margin, r.z, r.support, r.log_odds)),
                d.map(|d| (d.status, d.agreed, d.points, d.spread_px))
            );
        }
        if k == 0 {
            let begin: Vec<_> = truth[0].clone();
            ids = tracker.add_points(&begin).unwrap_or(0);
        }
        for track in tracker.tracks().iter().filter(|t| t.id >= ids && t.id < ids + truth[0].len() as u64) {
            let (id, p) = (track.id - ids, track.pixel);
            writeln!(out, "{k},{id},{:.4},{:.4},{:?},{status:?}", p.x, p.y, track.state)?;
        }
    }
    print!("{out}");
    let last = frames.len() - 1;
    let mut errors: Vec<f64> = tracker
        .tracks()
        .iter()
        .filter(|t| t.id >= ids && t.id < ids + truth[0].len() as u64)
        .map(|t| (t.pixel - truth[last][(t.id - ids) as usize]).norm())
        .collect();
    errors.sort_by(f64::total_cmp);
    let at = |q: f64| errors.get((q * (errors.len() as f64 - 1.0)).round() as usize).copied().unwrap_or(f64::NAN);
    eprintln!(
        "{} frames, {} of {} points left: error median {:.3} p90 {:.3} max {:.3} px; steps {started} started {tracked} tracked {ambiguous} ambiguous {lost} lost; {:.2} ms, {:.2} ms CPU a frame, {} points a frame",
        frames.len(),
        errors.len(),
        truth[0].len(),
        at(0.5),
        at(0.9),
        at(1.0),
        1e3 * time / frames.len() as f64,
        1e3 * cpu / frames.len() as f64,
        points / frames.len()
    );
    Ok(())
}

/// Time that this thread has had of a processor, s, where the system tells (Linux); else 0.
fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split_whitespace().next().and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(0.0) * 1e-9
}

/// Points of each frame.
fn read_truth(path: &Path) -> Result<Vec<Vec<Vector2<f64>>>, Box<dyn Error>> {
    let mut frames: Vec<Vec<Vector2<f64>>> = Vec::new();
    for line in std::fs::read_to_string(path)?.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let &[frame, _, u, v] = fields.as_slice() else {
            return Err(format!("{line}: expected frame,point,u,v").into());
        };
        let frame: usize = frame.parse()?;
        frames.resize_with(frames.len().max(frame + 1), Vec::new);
        frames[frame].push(Vector2::new(u.parse()?, v.parse()?));
    }
    Ok(frames)
}

/// Binary PGM of 8 bits without comments.
fn read_pgm(path: &Path) -> Result<Image<u8>, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let mut at = 0;
    let mut field = || {
        let start = at;
        while bytes.get(at).is_some_and(|b| !b.is_ascii_whitespace()) {
            at += 1;
        }
        at += 1;
        std::str::from_utf8(bytes.get(start..at - 1).unwrap_or_default()).unwrap_or_default().to_owned()
    };
    let (magic, width, height, _) = (field(), field().parse()?, field().parse()?, field());
    let data = bytes.get(at..).unwrap_or_default();
    if magic != "P5" {
        return Err(format!("{}: not a binary PGM", path.display()).into());
    }
    GrayView::packed(data, width, height)?;
    Image::from_vec(data[..width * height].to_vec(), width, height).ok_or_else(|| "wrong length".into())
}
