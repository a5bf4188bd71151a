//! `netpose run`: a whole log through the tracker, results into a folder.

mod ahead;
mod count;
mod doubt;
mod examples;
mod folder;
mod frames;
mod layers;
mod overlays;

use std::num::NonZeroU64;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use net_log::{LogInfo, LogSummary, OpenOptions, RunSummary, TimeBound};

use netpose::Method;

use crate::describe::{self, times};
use crate::failure::{Outcome, Usage, as_usage};
use crate::interrupt::Interrupt;
use crate::options::Setup;
pub use count::{Counted, HEADER as COUNT_HEADER};
use folder::{Existing, Folder};

/// Where the net is, frame by frame, in a log of images.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A folder of images, an MCAP file or a folder of MCAP files
    log: PathBuf,
    /// Folder for the results; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    setup: Setup,
    /// Image topic of an MCAP; needed only where there are several
    #[arg(long, value_name = "NAME")]
    topic: Option<String>,
    /// First time to read: seconds after the log's first frame (12.5), or nanoseconds since 1970 (16 digits or more)
    #[arg(long, value_name = "T", allow_hyphen_values = true)]
    from: Option<TimeBound>,
    /// Last time to read, in the same forms
    #[arg(long, value_name = "T", allow_hyphen_values = true)]
    to: Option<TimeBound>,
    /// Read every N-th frame only
    #[arg(long, value_name = "N", default_value = "1")]
    stride: NonZeroU64,
    /// Frames per second of an image folder without times: they are then made up, and the output says so
    #[arg(long, value_name = "HZ", default_value_t = 10.0)]
    fps: f64,
    /// Threads that decode frames and draw overlays; results are the same for any number. Default: one for each core
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: Option<u16>,
    /// Write two pictures for each frame into DIR/overlay: the frame with lattice, junctions, axes and status, and its spectrum with peaks and wave
    /// vectors
    #[arg(long)]
    overlay: bool,
    /// Unroll the net: mosaic, coverage, holes and growth into DIR/map, DIR/holes.csv and DIR/growth.parquet
    #[arg(long, conflicts_with = "resume")]
    map: bool,
    /// Look for a second net, before or behind the first, in every frame that shows one: DIR/layers.csv has a row for each. Takes as long as a
    /// frame looked at from scratch, for every frame. Also by `layers = true` in the file of --config
    #[arg(long, conflicts_with = "resume")]
    layers: bool,
    /// Smooth the poses in the end and look for slipped cells: poses_smooth.csv, slips.csv; as `netpose smooth` does
    #[arg(long, conflicts_with = "resume")]
    smooth: bool,
    /// Go on where an earlier run into the same folder stopped
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Replace the results of an earlier run in the same folder
    #[arg(long)]
    force: bool,
}

/// Runs the command.
pub fn main(args: &Args) -> Result<Outcome> {
    let mesh = args.setup.mesh()?;
    let mut config = args.setup.config()?;
    config.layers |= args.layers;
    if config.layers && args.resume {
        bail!(Usage("--resume does not go with layers = true of --config: layers.csv is not resumed".into()));
    }
    // An empty map would read as a net without holes.
    if args.map && config.method == Method::Thesis {
        bail!(Usage("--map goes with method lattice only, and --config says method = \"thesis\"".into()));
    }
    config.validate().map_err(|e| Usage(e.to_string()))?;
    args.check()?;
    let log = net_log::open(&args.log, &args.open_options()).map_err(as_usage)?;
    let camera = args.setup.camera(log.info())?;
    let span_ns = log.info().span_ns;
    eprintln!("{}", describe::log(log.info()));
    eprintln!("camera: {}", camera.origin);
    let interrupt = Interrupt::listen()?;
    let job = frames::Job {
        camera: camera.camera,
        mesh,
        config,
        threads: args.threads(),
        out: args.out.clone(),
        map: args.map,
        count: args.map || args.smooth,
        overlay: args.overlay.then(|| args.out.join("overlay")),
    };
    let folder =
        Folder::prepare(&args.out, args.existing(), job.camera, args.summary(&job, &camera.origin, log.info())?)?;
    let finished = frames::process(log, &job, folder, &interrupt)?;
    println!("{}", finished.line());
    if finished.is_empty() {
        let length = span_ns.map_or(0.0, |(first, last)| last.abs_diff(first) as f64 * 1e-9);
        bail!("no frame of the log was read ({}); it is {length:.3} s long", args.part());
    }
    if args.smooth && !interrupt.is_set() {
        println!("{}", crate::smooth::smooth_run(&args.out, Some(&args.log), &net_track::Config::default())?);
    }
    Ok(finished.outcome())
}

impl Args {
    fn open_options(&self) -> OpenOptions {
        OpenOptions { topic: self.topic.clone(), fps: self.fps, from: self.from, to: self.to, stride: self.stride }
    }

    /// What no single flag can see.
    fn check(&self) -> Result<()> {
        let backwards = match (self.from, self.to) {
            (Some(TimeBound::AfterStart(from)), Some(TimeBound::AfterStart(to)))
            | (Some(TimeBound::Epoch(from)), Some(TimeBound::Epoch(to))) => from > to,
            _ => false,
        };
        if backwards {
            bail!(Usage(format!("--from is later than --to: {}", self.part())));
        }
        let real = |path: &std::path::Path| path.canonicalize().ok();
        if real(&self.log).is_some_and(|log| Some(log) == real(&self.out)) {
            // Results beside the images would be read as part of the log the next time.
            bail!(Usage(format!("--out {} is the log itself: give another folder", self.out.display())));
        }
        Ok(())
    }

    fn existing(&self) -> Existing {
        match (self.resume, self.force) {
            (true, _) => Existing::Resume,
            (_, true) => Existing::Replace,
            _ => Existing::Keep,
        }
    }

    /// What `run.json` says before the first frame.
    fn summary(&self, job: &frames::Job, camera_origin: &str, log: &LogInfo) -> Result<RunSummary> {
        Ok(RunSummary {
            version: env!("CARGO_PKG_VERSION").into(),
            arguments: std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect(),
            log: LogSummary {
                path: self.log.display().to_string(),
                kind: log.kind.as_str().into(),
                topic: log.topic.clone(),
                frames: log.frames,
                part: self.part(),
                times: times(log),
                ..LogSummary::default()
            },
            camera: describe::camera_json(&job.camera, camera_origin),
            mesh: job.mesh.to_string(),
            config: serde_json::to_value(&job.config).context("cannot write the configuration")?,
            ..RunSummary::default()
        })
    }

    /// The part of the log that is read, in words.
    fn part(&self) -> String {
        let time = |name: &str, bound: TimeBound| match bound {
            TimeBound::AfterStart(ns) => format!("{name} {} s after the start", ns as f64 / 1e9),
            TimeBound::Epoch(ns) => format!("{name} {ns} ns"),
        };
        let bounds = [self.from.map(|b| time("from", b)), self.to.map(|b| time("to", b))];
        let stride = (self.stride.get() > 1).then(|| format!("every frame of {}", self.stride));
        let parts: Vec<String> = bounds.into_iter().chain([stride]).flatten().collect();
        if parts.is_empty() { "all".into() } else { parts.join(", ") }
    }

    fn threads(&self) -> usize {
        self.jobs.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from)
    }
}
