//! The folder that a run writes: made, resumed or refused; then frame after frame; then closed, however the run ended.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use net_image::Image;
use net_log::{
    DEFAULT_CAMERA_FRAME, NetColumns, PoseRow, PoseRows, RawFrame, RowStatus, RunFiles, RunPaths, RunSummary,
    TimingHistogram, write_report,
};
use netpose::{Camera, Connection, NetPose, Status};

use super::examples::Examples;
use super::frames::Tracked;
use crate::draw::Overlay;
use crate::failure::Outcome;

/// Columns of `poses.csv` behind the usual ones: the count of cells, and how the net hangs where the method estimates it.
pub const APPENDED: [&str; 13] = [
    "track",
    "crossing_angle_deg",
    "sigma_crossing_angle_deg",
    "curvature_1_per_m",
    "curvature_2_per_m",
    "recognised",
    "sigma_curvature_1_per_m",
    "sigma_curvature_2_per_m",
    "mean_normal_x",
    "mean_normal_y",
    "mean_normal_z",
    "mean_distance_m",
    "cell_margin",
];
/// Where `recognised` is among them, behind `track` and the first columns of [`hanging`].
const RECOGNISED: usize = 5;

/// What to do with what is in the folder already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Existing {
    /// Leave it, and refuse to run.
    Keep,
    /// Go on behind it.
    Resume,
    /// Write over it.
    Replace,
}

/// Results, their summary and what is measured on the way.
pub struct Folder {
    files: RunFiles,
    summary: RunSummary,
    camera: Camera,
    last_frame: Option<u64>,
    /// Number of this run's first count of cells: behind those of the runs that are resumed, whose origins it does not know.
    first_track: u32,
    examples: Examples,
    decoding: TimingHistogram,
    tracking: TimingHistogram,
    writing: TimingHistogram,
    start: Instant,
    /// Keeps others out of the folder until this is dropped.
    _lock: Option<File>,
}

impl Folder {
    /// Makes the folder, or opens it where an earlier run into it may be resumed or replaced. `summary` is what is known before
    /// the first frame.
    pub fn prepare(dir: &Path, existing: Existing, camera: Camera, mut summary: RunSummary) -> Result<Self> {
        let paths = RunPaths::new(dir);
        let lock = lock(dir)?;
        // A run that failed before its first frame is in nobody's way.
        let empty =
            || PoseRows::open(&paths.poses()).is_ok_and(|rows| rows.is_some_and(|mut rows| rows.next().is_none()));
        let holds_a_run = (paths.poses().exists() || paths.summary().exists()) && !empty();
        if holds_a_run && existing == Existing::Keep {
            bail!("{} already holds a run: --resume goes on with it, --force replaces it", dir.display());
        }
        let (files, rows) = if holds_a_run && existing == Existing::Resume {
            let earlier = RunSummary::read(&paths.summary())?;
            check_same(&earlier, &summary)?;
            summary.unreadable = earlier.unreadable;
            RunFiles::resume(dir, &APPENDED)?
        } else {
            (RunFiles::create(dir, &APPENDED)?, Vec::new())
        };
        let last_frame = rows.last().map(|row| row.frame);
        let tracks = rows.iter().filter_map(|row| row.appended.first().copied()).filter(|track| track.is_finite());
        let first_track = tracks.fold(0, |next, track| next.max(track as u32 + 1));
        for row in &rows {
            summary.count(row.status);
        }
        summary.unreadable.retain(|u| last_frame.is_some_and(|last| u.frame <= last));
        summary.write(&paths.summary())?;
        let (decoding, tracking, writing) = Default::default();
        let examples = Examples::default();
        let start = Instant::now();
        Ok(Self {
            files,
            summary,
            camera,
            last_frame,
            first_track,
            examples,
            decoding,
            tracking,
            writing,
            start,
            _lock: lock,
        })
    }

    /// Number of the last frame that an earlier run did.
    pub fn last_frame(&self) -> Option<u64> {
        self.last_frame
    }

    /// Frames so far, those of the runs that are resumed included.
    pub fn frames(&self) -> u64 {
        self.summary.frames.values().sum()
    }

    /// `97 ok, 2 no_net, 1 unreadable`.
    pub fn counts(&self) -> String {
        counts(&self.summary)
    }

    /// Writes one frame's results.
    pub fn write(&mut self, frame: &RawFrame, decoding: Duration, tracked: Result<&Tracked, &str>) -> Result<()> {
        let start = Instant::now();
        self.decoding.add(milliseconds(decoding));
        let row = match tracked {
            Ok(tracked) => row(frame, tracked, self.first_track),
            Err(_) => PoseRow::unreadable(frame.index, &frame.name, frame.timestamp_ns),
        };
        match tracked {
            Ok(tracked) => self.tracking.add(milliseconds(tracked.latency)),
            Err(why) => self.summary.name_unreadable(frame.index, &frame.name, &why),
        }
        let (junctions, twines) = tracked.map_or((&[][..], &[][..]), |t| (&t.junctions, &t.twines));
        self.files.write(&row, junctions, twines)?;
        self.summary.count(row.status);
        self.writing.add(milliseconds(start.elapsed()));
        Ok(())
    }

    /// Keeps the frame for the report, if it is one of the telling ones.
    pub fn consider(&mut self, frame: u64, image: &Image<u8>, tracked: &Tracked) {
        self.examples.consider(frame, image, tracked);
    }

    /// Closes all files and makes the report. Where the run failed, the results so far are closed as well before the failure is passed on.
    pub fn finish(mut self, run: Result<Ended>, damage: &[String], overlay: &Overlay) -> Result<Finished> {
        let paths = self.files.paths().clone();
        self.summary.finished = matches!(run, Ok(Ended::AtTheEnd));
        self.summary.log.damage = damage.to_vec();
        self.summary.elapsed_s = self.start.elapsed().as_secs_f64();
        for (stage, times) in [("decode", &self.decoding), ("track", &self.tracking), ("write", &self.writing)] {
            self.summary.timing_ms.insert(stage.to_owned(), times.timing());
        }
        let closed = self.files.finish(&self.camera, DEFAULT_CAMERA_FRAME);
        let recorded = self.summary.write(&paths.summary());
        let reported =
            closed.and(recorded).and_then(|()| write_report(&paths, &self.summary, &self.examples.draw(overlay)));
        let ended = run?;
        reported?;
        Ok(Finished { summary: self.summary, ended, dir: paths.dir })
    }
}

/// Makes the folder and keeps other runs out of it; the system lets go of the lock however this process ends. `None` where there are no such locks.
fn lock(dir: &Path) -> Result<Option<File>> {
    std::fs::create_dir_all(dir).with_context(|| format!("cannot create {}", dir.display()))?;
    let Ok(folder) = File::open(dir) else { return Ok(None) };
    match folder.try_lock() {
        Ok(()) => Ok(Some(folder)),
        Err(TryLockError::WouldBlock) => bail!("another netpose is writing into {}", dir.display()),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

/// How the loop over the frames ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    AtTheEnd,
    /// By Ctrl-C or its kin.
    Stopped,
}

/// A run whose files are closed.
pub struct Finished {
    summary: RunSummary,
    ended: Ended,
    dir: PathBuf,
}

impl Finished {
    /// Whether there was no frame at all.
    pub fn is_empty(&self) -> bool {
        self.summary.frames.values().sum::<u64>() == 0
    }

    /// The run in a line.
    pub fn line(&self) -> String {
        let frames: u64 = self.summary.frames.values().sum();
        let end = if self.ended == Ended::Stopped { " (stopped; --resume goes on from there)" } else { "" };
        format!("{frames} frames: {}; results in {}{end}", counts(&self.summary), self.dir.display())
    }

    /// Complete if all frames were read.
    pub fn outcome(&self) -> Outcome {
        let unreadable = self.summary.frames_of(RowStatus::Unreadable);
        if self.ended == Ended::Stopped || unreadable > 0 { Outcome::Partial } else { Outcome::Complete }
    }
}

fn counts(summary: &RunSummary) -> String {
    let all = [RowStatus::Ok, RowStatus::NoNet, RowStatus::Unreadable];
    all.map(|status| format!("{} {}", summary.frames_of(status), status.as_str())).join(", ")
}

/// Refuses to go on with a run that was about something else.
fn check_same(earlier: &RunSummary, now: &RunSummary) -> Result<()> {
    let parts = |s: &RunSummary| {
        serde_json::to_value(s).context("cannot compare with the earlier run").map(|mut value| {
            // Counted and found on the way; all else must agree.
            for path in ["/log/damage", "/log/frames", "/arguments"] {
                value.pointer_mut(path).map(serde_json::Value::take);
            }
            value
        })
    };
    let (earlier, now) = (parts(earlier)?, parts(now)?);
    for part in ["version", "log", "camera", "mesh", "config"] {
        let (was, is) = (&earlier[part], &now[part]);
        if was != is {
            bail!("cannot resume: {part} was {was}, and now is {is}; --force starts anew");
        }
    }
    Ok(())
}

fn row(frame: &RawFrame, tracked: &Tracked, first_track: u32) -> PoseRow {
    let net = tracked.net.as_ref().map(columns);
    PoseRow {
        frame: frame.index,
        file: frame.name.to_string(),
        timestamp_ns: frame.timestamp_ns,
        status: match tracked.status {
            Status::Ok => RowStatus::Ok,
            Status::NoNet => RowStatus::NoNet,
        },
        probability: Some(tracked.probability),
        net,
        junctions: Some(tracked.junctions.len() as u64),
        latency_ms: Some(milliseconds(tracked.latency)),
        appended: appended(tracked, first_track),
    }
}

/// A pose in the columns of `poses.csv`.
pub fn columns(net: &NetPose) -> NetColumns {
    NetColumns {
        range_m: net.range_m,
        distance_m: net.distance_m,
        normal: net.normal,
        pose: net.pose,
        sigma_range_m: net.sigma_range_m,
        sigma_tilt_deg: net.sigma_tilt.to_degrees(),
        sigma_xy_m: net.sigma_xy_m,
    }
}

fn appended(tracked: &Tracked, first_track: u32) -> Vec<f64> {
    // NaN is an empty cell.
    let Some(net) = &tracked.net else { return vec![f64::NAN; APPENDED.len()] };
    let track = f64::from(first_track.saturating_add(tracked.track));
    let recognised = f64::from(u8::from(tracked.connection == Connection::Recognised));
    let hanging = hanging(net);
    let (before, behind) = hanging.split_at(RECOGNISED - 1);
    [&[track], before, &[recognised], behind].concat()
}

/// How a net hangs: [`APPENDED`] without `track` and `recognised`. NaN, an empty cell, for what was held and not estimated.
pub fn hanging(net: &NetPose) -> [f64; 11] {
    net.sheet.map_or([f64::NAN; 11], |sheet| {
        let [larger, smaller] = sheet.curvatures_per_m;
        let [sigma_larger, sigma_smaller] = sheet.sigma_curvatures_per_m.unwrap_or([f64::NAN; 2]);
        let (angle, sigma) = (sheet.crossing_angle, sheet.sigma_crossing_angle.unwrap_or(f64::NAN));
        let (mean, margin) = (sheet.mean_plane, sheet.cell_margin);
        let [x, y, z]: [f64; 3] = mean.normal.into();
        let (angle, sigma) = (angle.to_degrees(), sigma.to_degrees());
        [angle, sigma, larger, smaller, sigma_larger, sigma_smaller, x, y, z, mean.distance, margin]
    })
}

/// The names of what [`hanging`] has.
pub fn hanging_names() -> impl Iterator<Item = &'static str> {
    APPENDED.into_iter().filter(|name| !["track", "recognised"].contains(name))
}

/// For tables.
pub fn milliseconds(time: Duration) -> f64 {
    1e3 * time.as_secs_f64()
}
