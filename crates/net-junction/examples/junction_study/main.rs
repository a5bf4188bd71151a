//! What net adjustment reaches, by kind of picture: places, names, missing twines, holes, time.
//!
//! `cargo run --release -p net-junction --example junction_study -- [--scenes N] [--seed S] [--only KIND] [--true-pose] [--overlays DIR] [--renders DIR]`
//!
//! Scenes are `net-sim`'s, `N` of each kind (default 8); another seed draws others. Each is adjusted twice: from its true pose (of a bent net a polynomial of fourth degree through its
//! knots) and from what the lattice estimator makes of the picture (left out with `--true-pose`). With `--renders` the pictures of a folder instead, a `.json` with the
//! truth beside each. Times are of the thread's processor, not of the clock on the wall.

mod kinds;
mod overlay;
mod renders;
mod sample;
mod score;
mod table;

use std::error::Error;
use std::path::PathBuf;

use net_junction::{AdjustConfig, LatticeMap, NetAdjuster};
use net_lattice::{Config, LatticeEstimator};
use sample::{EstimatedMap, Sample};
use score::{Score, score};

/// Knots of smaller cells have no part in the figures: the adjustment tries them as well.
const SCORED_CELL_PX: f64 = 4.5;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Repeated calls of which the fastest counts.
const REPEATS: usize = 3;

struct Options {
    scenes: u64,
    seed: u64,
    only: Option<String>,
    true_pose: bool,
    overlays: Option<PathBuf>,
    renders: Option<PathBuf>,
}

fn options() -> Result<Options> {
    let mut options = Options { scenes: 8, seed: 1, only: None, true_pose: false, overlays: None, renders: None };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--scenes" => options.scenes = value()?.parse()?,
            "--seed" => options.seed = value()?.parse()?,
            "--only" => options.only = Some(value()?),
            "--true-pose" => options.true_pose = true,
            "--overlays" => options.overlays = Some(value()?.into()),
            "--renders" => options.renders = Some(value()?.into()),
            _ => return Err(format!("what is {argument}?").into()),
        }
    }
    Ok(options)
}

/// The results of all pictures of a kind.
struct Kind {
    name: String,
    pictures: usize,
    truly: Score,
    estimated: Score,
    refused: usize,
    milliseconds: f64,
    nodes: usize,
}

impl Kind {
    fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            pictures: 0,
            truly: Score::default(),
            estimated: Score::default(),
            refused: 0,
            milliseconds: 0.0,
            nodes: 0,
        }
    }

    fn add(&mut self, sample: &Sample, options: &Options) -> Result<()> {
        let view = sample.image.view().ok_or("a picture without pixels")?;
        let config = AdjustConfig::default();
        let mut adjuster = NetAdjuster::new(view.width(), view.height(), &config)?;
        let map = sample.true_map().ok_or("too few knots in view")?;
        let milliseconds = time(&mut adjuster, sample, &map)?;
        let found = score(&adjuster, sample, &map, SCORED_CELL_PX, false);
        let nodes = found.in_view;
        if let Some(folder) = &options.overlays {
            overlay::draw(folder, sample, &adjuster, "")?;
        }
        eprintln!("{:<28} {found} {milliseconds:.1} ms", sample.name);
        self.truly.add(found);
        self.pictures += 1;
        self.milliseconds += milliseconds;
        self.nodes += nodes;
        if !options.true_pose {
            let config_of_pose = Config::default();
            let mut estimator = LatticeEstimator::new(&sample.camera, &sample.mesh, &config_of_pose)?;
            let estimate = estimator.estimate(view)?.filter(|e| e.probability >= config_of_pose.probability_threshold);
            match estimate {
                None => self.refused += 1,
                Some(estimate) => {
                    adjuster.adjust(view, &EstimatedMap { estimate: &estimate, camera: &sample.camera })?;
                    let found = score(&adjuster, sample, &map, SCORED_CELL_PX, true);
                    if let Some(folder) = &options.overlays {
                        overlay::draw(folder, sample, &adjuster, "_estimated")?;
                    }
                    eprintln!("{:<28} {found} from an estimate", "");
                    self.estimated.add(found);
                }
            }
        }
        Ok(())
    }
}

/// Milliseconds of the processor that one adjustment takes.
fn time(adjuster: &mut NetAdjuster, sample: &Sample, map: &impl LatticeMap) -> Result<f64> {
    let view = sample.image.view().ok_or("a picture without pixels")?;
    let mut best = f64::INFINITY;
    for _ in 0..REPEATS {
        let before = processor_ms();
        adjuster.adjust(view, map)?;
        best = best.min(processor_ms() - before);
    }
    Ok(best)
}

/// Time that this thread has had on a processor, ms (Linux); elsewhere, the clock on the wall.
fn processor_ms() -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let ns = told.and_then(|t| t.split_whitespace().next()?.parse::<f64>().ok());
    let wall = || std::time::SystemTime::UNIX_EPOCH.elapsed().map_or(0.0, |t| t.as_secs_f64() * 1e9);
    ns.unwrap_or_else(wall) * 1e-6
}

fn main() -> Result<()> {
    let options = options()?;
    let mut kinds: Vec<Kind> = Vec::new();
    if let Some(folder) = &options.renders {
        let mut samples = renders::list(folder)?;
        samples.retain(|(kind, _)| options.only.as_ref().is_none_or(|only| kind.contains(only.as_str())));
        samples.sort();
        for (kind, path) in samples {
            if kinds.last().is_none_or(|k| k.name != kind) {
                kinds.push(Kind::new(&kind));
            }
            let sample = renders::read(&path)?;
            if let Some(last) = kinds.last_mut() {
                last.add(&sample, &options)?;
            }
        }
    } else {
        for (name, make) in kinds::KINDS {
            if options.only.as_ref().is_some_and(|only| !name.contains(only.as_str())) {
                continue;
            }
            let mut kind = Kind::new(name);
            let scenes = if *name == kinds::GRID { 1 } else { options.scenes };
            for k in 0..scenes {
                kind.add(&Sample::simulated(name, k, &make(options.seed * 1000 + k))?, &options)?;
            }
            kinds.push(kind);
        }
    }
    table::print(&kinds);
    Ok(())
}
