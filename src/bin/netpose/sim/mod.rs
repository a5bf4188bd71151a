//! `netpose sim`: an image log of a virtual net, with the truth beside it.

mod truth;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use net_log::{ImageFolderWriter, ImageMcapWriter};
use net_sim::{Image, Scenario, Simulator, Truth};
use netpose::Camera;
use rayon::prelude::*;

use crate::failure::{Outcome, Usage};
use crate::interrupt::Interrupt;
use crate::progress::Progress;

/// Frames drawn at a time: bounds what is held in memory.
const BATCH: u32 = 32;

/// A log of a virtual net: images, times, camera, and the truth.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for the log; must be empty or not there
    #[arg(required_unless_present = "list")]
    dir: Option<PathBuf>,
    /// A scenario's name (--list tells them), or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "plain")]
    scenario: String,
    /// Number of frames. Default: what the scenario says
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Another draw of noise, water, fish and the net's irregularities; 0 is the scenario as it stands
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// One MCAP file of ROS 2 messages (`log.mcap`) instead of a folder of images
    #[arg(long)]
    mcap: bool,
    /// Names all scenarios
    #[arg(long)]
    list: bool,
}

/// Runs the command.
pub fn main(args: &Args) -> Result<Outcome> {
    if args.list {
        print!("{}", list());
        return Ok(Outcome::Complete);
    }
    let Some(dir) = &args.dir else { return Err(Usage("name the folder to write".into()).into()) };
    let mut scenario = load(&args.scenario)?;
    scenario.frames = args.frames.unwrap_or(scenario.frames);
    if let Some(seed) = args.seed {
        reseed(&mut scenario, seed);
    }
    scenario.validate().with_context(|| format!("scenario {}", args.scenario))?;
    let holds_something = std::fs::read_dir(dir).is_ok_and(|mut entries| entries.next().is_some());
    if holds_something {
        bail!("{} is not empty: a log's frames would mix with what is there", dir.display());
    }
    let done = write(&scenario, dir, args.mcap, &Interrupt::listen()?)?;
    println!(
        "{done} frames of {}; netpose run {} --cell {} --out RESULTS",
        scenario.name,
        dir.display(),
        scenario.mesh
    );
    Ok(if done == scenario.frames { Outcome::Complete } else { Outcome::Partial })
}

/// Another draw of everything that chance decides: noise, water, fish and the net's own irregularities. 0 changes nothing.
pub fn reseed(scenario: &mut Scenario, by: u64) {
    let scene = &mut scenario.scene;
    let nets = scene.layers.iter_mut().map(|layer| &mut layer.net.seed);
    let objects = scene.objects.iter_mut().map(|object| &mut object.seed);
    for seed in nets.chain(objects).chain([&mut scene.seed, &mut scenario.seed]) {
        *seed = seed.wrapping_add(by);
    }
}

fn list() -> String {
    let all = Scenario::all();
    let width = all.iter().map(|s| s.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for s in all {
        let _ = writeln!(text, "{:width$}  {:>5} frames  {:14} {}", s.name, s.frames, s.mesh, s.description);
    }
    text
}

/// By name, or from a file: what ends in `.toml` or has a folder in it is a file.
fn load(name: &str) -> Result<Scenario> {
    let path = Path::new(name);
    if path.extension().is_none_or(|e| e != "toml") && path.components().count() == 1 {
        return Scenario::by_name(name).map_err(|e| Usage(format!("{e}; --list names them all")).into());
    }
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {name}"))?;
    toml::from_str(&text).map_err(|e| Usage(format!("{name}: {e}")).into())
}

/// Writes the log; returns the number of frames.
fn write(scenario: &Scenario, dir: &Path, as_mcap: bool, interrupt: &Interrupt) -> Result<u32> {
    std::fs::create_dir_all(dir).with_context(|| format!("cannot create {}", dir.display()))?;
    let camera = scenario.camera()?;
    let text = toml::to_string(scenario).context("cannot write the scenario as TOML")?;
    std::fs::write(dir.join("scenario.toml"), text).with_context(|| format!("cannot write into {}", dir.display()))?;
    let mut log = Images::create(dir, as_mcap, &camera)?;
    let mut tables = truth::Tables::create(dir)?;
    let mut progress = Progress::new(Some(scenario.frames.into()));
    let mut first = 0;
    while first < scenario.frames && !interrupt.is_set() {
        let last = scenario.frames.min(first.saturating_add(BATCH));
        let drawn: Vec<Drawn> = (first..last)
            .into_par_iter()
            .map_init(
                || (Simulator::new(camera), Image::default()),
                |(simulator, image), k| {
                    let frame = scenario.frame(k)?;
                    let truth = simulator.render(&frame.scene, frame.seed, image)?.clone();
                    let png = image.view().map(net_log::png).unwrap_or_default();
                    Ok(Drawn { timestamp_ns: frame.timestamp_ns, png, truth })
                },
            )
            .collect::<Result<_>>()?;
        for (k, Drawn { timestamp_ns, png, truth }) in (first..last).zip(&drawn) {
            let name = format!("f{k:06}.png");
            log.write(&name, *timestamp_ns, png)?;
            tables.write(k.into(), &name, *timestamp_ns, truth)?;
            progress.step(String::new);
        }
        first = last;
    }
    progress.finish();
    log.finish()?;
    tables.finish()?;
    Ok(first)
}

/// A frame on its way to the disk.
struct Drawn {
    timestamp_ns: i64,
    png: Vec<u8>,
    truth: Truth,
}

/// Where the images go.
enum Images {
    Folder(Box<ImageFolderWriter>),
    Mcap(Box<ImageMcapWriter>),
}

impl Images {
    fn create(dir: &Path, as_mcap: bool, camera: &Camera) -> Result<Self> {
        Ok(if as_mcap {
            Self::Mcap(Box::new(ImageMcapWriter::create(&dir.join("log.mcap"), camera)?))
        } else {
            Self::Folder(Box::new(ImageFolderWriter::create(dir, camera)?))
        })
    }

    fn write(&mut self, name: &str, timestamp_ns: i64, png: &[u8]) -> Result<()> {
        match self {
            Self::Folder(folder) => folder.write_encoded(name, timestamp_ns, png)?,
            Self::Mcap(mcap) => mcap.write_encoded(timestamp_ns, "png", png)?,
        }
        Ok(())
    }

    fn finish(self) -> Result<()> {
        match self {
            Self::Folder(_) => Ok(()),
            Self::Mcap(mcap) => Ok(mcap.finish()?),
        }
    }
}
