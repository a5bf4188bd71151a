//! `netpose smooth`, and `netpose run --smooth`: the poses of a run that is done, smoothed, and slipped cells found.

mod rows;
mod table;
mod verify;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use net_log::{RunPaths, RunSummary};
use net_track::{Answer, Config, Origin, Suspect, Trajectory, Verdict};

use crate::failure::{Outcome, Usage};
use rows::Rows;

/// Smooth the poses of a run and look for slipped cells; writes `poses_smooth.csv` and `slips.csv` into its folder.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A folder that `netpose run` wrote
    run_dir: PathBuf,
    /// The log of the run, to look at suspected slips again. Default: where run.json says it is
    #[arg(long, value_name = "LOG")]
    log: Option<PathBuf>,
    /// Parameters of the smoother, TOML; what it leaves out keeps its default
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

/// Runs the command.
pub fn main(args: &Args) -> Result<Outcome> {
    let config = match &args.config {
        None => Config::default(),
        Some(path) => {
            let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
            let config: Config = toml::from_str(&text).map_err(|e| Usage(format!("{}: {e}", path.display())))?;
            config.validate().map_err(|e| Usage(format!("{}: {e}", path.display())))?;
            config
        }
    };
    println!("{}", smooth_run(&args.run_dir, args.log.as_deref(), &config)?);
    Ok(Outcome::Complete)
}

/// Rounds of smoothing and looking at the pictures: a repaired slip may uncover another.
const ROUNDS: usize = 4;

/// Smooths the run in a folder; returns what to tell of it.
pub fn smooth_run(dir: &Path, log: Option<&Path>, config: &Config) -> Result<String> {
    let paths = RunPaths::new(dir);
    let summary = RunSummary::read(&paths.summary())?;
    let rows = Rows::read(&paths, &summary)?;
    let log = log.map_or_else(|| PathBuf::from(&summary.log.path), Path::to_owned);
    let mut answers: BTreeMap<(usize, (i32, i32)), Answer> = BTreeMap::new();
    let mut trajectory = Trajectory::default();
    for round in 1..=ROUNDS {
        let mut open: Vec<Suspect> = Vec::new();
        let verify = |suspect: &Suspect| {
            // The vote was asked during the run, on the sheet as it hangs, and said what the count is: a jump that is left is one of the pose.
            if let Some(z) = rows.judged[suspect.sample].filter(|_| rows.judged[suspect.before].is_some()) {
                return Answer { verdict: Verdict::Refuted, z };
            }
            answers.get(&(suspect.sample, suspect.cells)).copied().unwrap_or_else(|| {
                open.push(*suspect);
                Answer::UNKNOWN
            })
        };
        trajectory = net_track::smooth(&rows.samples, config, verify)?;
        if open.is_empty() || round == ROUNDS {
            break;
        }
        match verify::look(&log, &summary, &rows, &open) {
            Ok(found) => answers.extend(open.iter().map(|s| (s.sample, s.cells)).zip(found)),
            Err(why) => {
                eprintln!("suspected slips are not verified: {why:#}");
                break;
            }
        }
    }
    table::write(dir, &rows, &trajectory)?;
    Ok(in_words(&trajectory))
}

fn in_words(trajectory: &Trajectory) -> String {
    let count = |origin: Origin| trajectory.poses.iter().flatten().filter(|p| p.origin == origin).count();
    let confirmed = trajectory.repairs.iter().filter(|r| r.answer.verdict == Verdict::Confirmed).count();
    format!(
        "{} poses smoothed, {} interpolated, {} outliers; {} slips repaired, {} suspected and not confirmed; {} connected stretches",
        count(Origin::Smoothed),
        count(Origin::Interpolated),
        count(Origin::Outlier),
        confirmed,
        trajectory.repairs.len() - confirmed,
        trajectory.poses.iter().flatten().last().map_or(0, |p| p.segment + 1),
    )
}
