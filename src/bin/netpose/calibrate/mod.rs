//! `netpose calibrate`: can the probability be trusted? The estimator on random scenes whose truth is known.

mod curves;
mod plots;
mod record;
mod scene;
mod tables;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use net_sim::Study;
use netpose::Config;
use rayon::prelude::*;

use crate::failure::{Outcome, Usage};
use crate::interrupt::Interrupt;
use crate::progress::Progress;
use record::Records;
use scene::{Bench, Examined};

/// Scenes examined between two writes to the disk.
const BATCH: u64 = 16;

/// Random scenes with and without nets, the estimator on each, and how often a probability keeps its word.
///
/// Writes calibration.csv (a row per scene: truth, estimate, errors, evidence), reliability.svg and risk-coverage.svg, and prints
/// errors and refusals by condition. `netpose sim DIR --scenario study-planar-17` draws a scene again by its name.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for the results, made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Scenes of each study
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..))]
    scenes: u64,
    /// Seed of the first scene; the others follow it
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Only these studies: planar, hung, negative, noise, jitter2, jitter5, sag, overgrown, layers, seam. Default planar, hung and negative
    #[arg(long = "study", value_name = "STUDY")]
    studies: Vec<Study>,
    /// Parameters, TOML; what it leaves out keeps its default
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Threads. Default: as many as there are processors
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: Option<u16>,
    /// Markdown instead of plain text
    #[arg(long)]
    markdown: bool,
}

/// Runs the command.
pub fn main(args: &Args) -> Result<Outcome> {
    let config = parameters(args.config.as_deref())?;
    let chosen =
        if args.studies.is_empty() { vec![Study::Planar, Study::Hung, Study::Negative] } else { args.studies.clone() };
    std::fs::create_dir_all(&args.out).with_context(|| format!("cannot create {}", args.out.display()))?;
    let seeds = args.seed..args.seed.saturating_add(args.scenes);
    let scenes: Vec<(Study, u64)> = chosen.iter().flat_map(|&s| seeds.clone().map(move |seed| (s, seed))).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.jobs.map_or(0, usize::from)).build()?;
    let interrupt = Interrupt::listen()?;
    let mut records = Records::create(&args.out.join("calibration.csv"))?;
    let mut progress = Progress::new(Some(scenes.len() as u64));
    let mut all: Vec<Examined> = Vec::new();
    for batch in scenes.chunks(BATCH as usize) {
        if interrupt.is_set() {
            break;
        }
        // In the order of the seeds, whatever the number of threads; scenes not begun when the command is stopped are left out.
        let done: Vec<Option<Examined>> = pool.install(|| {
            let examine = |bench: &mut Bench, &(study, seed): &(Study, u64)| match interrupt.is_set() {
                true => Ok(None),
                false => bench.examine(study, seed, &config).map(Some),
            };
            batch.par_iter().map_init(Bench::default, examine).collect::<Result<_>>()
        })?;
        let done: Vec<Examined> = done.into_iter().flatten().collect();
        for scene in &done {
            records.write(scene)?;
            progress.step(|| format!("{} wrong claims", all.iter().chain(&done).filter(|s| s.is_lie(&config)).count()));
        }
        all.extend(done);
    }
    progress.finish();
    let threshold = config.lattice.probability_threshold;
    for table in tables::all(&all, threshold) {
        print!("{}", if args.markdown { table.to_markdown() } else { table.to_text() });
    }
    for (name, svg) in
        [("reliability.svg", plots::reliability(&all)?), ("risk-coverage.svg", plots::risk_coverage(&all, threshold)?)]
    {
        let path = args.out.join(name);
        std::fs::write(&path, svg).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(if all.len() == scenes.len() { Outcome::Complete } else { Outcome::Partial })
}

fn parameters(path: Option<&Path>) -> Result<Config> {
    let Some(path) = path else { return Ok(Config::default()) };
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let config: Config = toml::from_str(&text).map_err(|e| Usage(format!("{}: {e}", path.display())))?;
    config.validate().map_err(|e| Usage(format!("{}: {e}", path.display())))?;
    Ok(config)
}
