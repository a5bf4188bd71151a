//! From the log's frames to rows: decoded ahead in other threads, tracked in order on this one.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use net_image::Image;
use net_log::{Log, RawFrame};
use netpose::{Camera, Config, Connection, Error, Layer, Mesh, NetPose, Status, Tracker};

use super::ahead::in_order;
use super::count::{self, Count};
use super::doubt::HeldBack;
use super::folder::{Ended, Finished, Folder};
use super::layers::{self, LayersCsv};
use super::overlays::Overlays;
use crate::draw::{Overlay, Shown};
use crate::interrupt::Interrupt;
use crate::map::NetMap;
use crate::progress::Progress;

/// What is to be done with every frame.
#[derive(Debug)]
pub struct Job {
    pub camera: Camera,
    pub mesh: Mesh,
    pub config: Config,
    /// Threads that decode and draw.
    pub threads: usize,
    /// Folder of the run.
    pub out: PathBuf,
    /// Whether the net is to be mapped, and whether cells are to be counted with care: for the map, or for the smoother.
    pub map: bool,
    pub count: bool,
    /// Folder for a picture of each frame, if wanted.
    pub overlay: Option<PathBuf>,
}

/// A frame on its way from the decoder to the tracker.
struct Decoded {
    frame: RawFrame,
    /// The grey picture, or why there is none.
    image: Result<Image<u8>, String>,
    time: Duration,
}

impl Decoded {
    fn new(frame: RawFrame) -> Self {
        let start = Instant::now();
        let image = frame.decode().map_err(|e| e.to_string());
        Self { frame, image, time: start.elapsed() }
    }
}

/// What the tracker said of a frame.
#[derive(Debug, Clone)]
pub struct Tracked {
    pub status: Status,
    pub probability: f64,
    /// Number of the count of cells: another number, another origin.
    pub track: u32,
    /// How that count goes on.
    pub connection: Connection,
    /// Cells that were added to the names of nodes.
    pub corrected: (i32, i32),
    /// Which frame of a doubt this is.
    pub in_doubt: u32,
    pub net: Option<NetPose>,
    pub junctions: Vec<netpose::Junction>,
    pub twines: Vec<netpose::Twine>,
    /// All nets, nearest first, where they were looked for.
    pub layers: Vec<Layer>,
    /// Time of the tracker's update alone.
    pub latency: Duration,
}

impl Tracked {
    /// For drawing.
    pub fn shown(&self) -> Shown<'_> {
        Shown {
            status: self.status,
            probability: self.probability,
            net: self.net.as_ref(),
            junctions: &self.junctions,
            twines: &self.twines,
            latency_ms: 1e3 * self.latency.as_secs_f64(),
        }
    }
}

/// Runs all frames of `log` that the folder does not hold yet.
pub fn process(mut log: Log, job: &Job, mut folder: Folder, interrupt: &Interrupt) -> Result<Finished> {
    let mut tracker = Tracker::new(job.camera, job.mesh, &job.config)?;
    let done = folder.last_frame();
    let mut progress = Progress::new(log.frames_expected().map(|n| n.saturating_sub(folder.frames())));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(job.threads).build().context("cannot start threads")?;
    // Nothing else holds frames, so memory does not grow with the log.
    let depth = 2 * job.threads;
    let overlay = Arc::new(Overlay { camera: job.camera, mesh: job.mesh });
    let mut overlays = job.overlay.as_deref().map(|dir| Overlays::new(dir, &pool, depth, &overlay)).transpose()?;
    if !job.count {
        // That of an earlier run in this folder is about other poses.
        count::forget(&job.out)?;
    }
    let mut count = job.count.then(|| Count::new(&job.out)).transpose()?;
    if !job.config.layers {
        layers::forget(&job.out)?;
    }
    let mut layers = job.config.layers.then(|| LayersCsv::create(&job.out)).transpose()?;
    let mut map = job.map.then(|| NetMap::new(&job.out, job.mesh)).transpose()?;
    let mut held_back = HeldBack::default();
    // No frame has shown yet that the calibration is this camera's.
    let mut size_confirmed = done.is_some();

    let ended: Result<Ended> = std::thread::scope(|scope| {
        let frames = log.by_ref().skip_while(|frame| done.is_some_and(|last| frame.index <= last));
        for Decoded { frame, image, time } in in_order(scope, &pool, depth, frames, Decoded::new) {
            if interrupt.is_set() {
                return Ok(Ended::Stopped);
            }
            let tracked = match &image {
                Ok(image) => track(&mut tracker, image, &frame, &mut size_confirmed)?,
                Err(why) => Err(why.clone()),
            };
            held_back.write(&mut folder, &job.mesh, &frame, time, tracked.as_ref().map_err(String::as_str))?;
            match (&tracked, image) {
                (Ok(tracked), Ok(image)) => {
                    if let (Some(count), Some(_), Some(view)) = (&mut count, &tracked.net, image.view())
                        && let Some(counted) = count.update(frame.index, tracked, view, &tracker)?
                        && let Some(map) = &mut map
                    {
                        map.add(&counted, view, &tracker, &tracked.twines)?;
                    }
                    if let Some(layers) = &mut layers {
                        layers.write(&frame, tracked)?;
                    }
                    folder.consider(frame.index, &image, tracked);
                    if let Some(overlays) = &mut overlays {
                        overlays.draw(frame.index, image, tracked)?;
                    }
                }
                (Err(why), _) => progress.say(&format!("frame {} ({}) is unreadable: {why}", frame.index, frame.name)),
                _ => {}
            }
            progress.step(|| folder.counts());
        }
        overlays.map_or(Ok(()), Overlays::finish).map(|()| Ended::AtTheEnd)
    });
    progress.finish();
    let ended = held_back.flush(&mut folder).and(ended);
    for damage in log.damage() {
        eprintln!("warning: {damage}");
    }
    let finished = folder.finish(ended, log.damage(), &overlay)?;
    count.map_or(Ok(()), Count::finish)?;
    if let Some(map) = map {
        eprintln!("{}", map.finish()?);
    }
    Ok(finished)
}

/// One update. The inner error says why the frame does not count; the outer one ends the run.
fn track(
    tracker: &mut Tracker,
    image: &Image<u8>,
    frame: &RawFrame,
    size_confirmed: &mut bool,
) -> Result<Result<Tracked, String>> {
    let (Some(view), Some(timestamp_ns)) = (image.view(), frame.timestamp_ns) else {
        return Ok(Err("it has no pixels or no time".into()));
    };
    let start = Instant::now();
    let tracked = match tracker.update(view, timestamp_ns) {
        Ok(estimate) => Tracked {
            status: estimate.status,
            probability: estimate.probability,
            track: estimate.track,
            connection: estimate.connection,
            corrected: estimate.corrected,
            in_doubt: estimate.in_doubt,
            net: estimate.net,
            latency: start.elapsed(),
            junctions: estimate.junctions.to_vec(),
            twines: estimate.twines.to_vec(),
            layers: estimate.layers.to_vec(),
        },
        Err(Error::Geometry(why @ net_geometry::Error::ImageSize { .. })) if *size_confirmed => {
            return Ok(Err(why.to_string()));
        }
        Err(why) => {
            let hint = match why {
                Error::Geometry(net_geometry::Error::ImageSize { .. }) => {
                    "; give the calibration of this camera with --camera"
                }
                _ => "",
            };
            return Err(anyhow::anyhow!("frame {} ({}): {why}{hint}", frame.index, frame.name));
        }
    };
    *size_confirmed = true;
    Ok(Ok(tracked))
}
