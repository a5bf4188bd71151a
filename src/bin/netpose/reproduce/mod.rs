//! `netpose reproduce`: the thesis's experiments on virtual nets, its figures and ours side by side.

mod bound;
mod junctions;
mod precision;
mod published;
mod ranges;
mod reading;
pub mod table;
mod tilts;
mod tracking;

use anyhow::Result;
use clap::ValueEnum;
use netpose::{Config, Method};

use crate::failure::Outcome;
use crate::progress::Progress;
use table::Table;

/// The thesis's experiments on virtual nets: its figures, those of Schellewald 2021, and ours, side by side.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Markdown instead of plain text
    #[arg(long)]
    markdown: bool,
    /// Only these experiments; all by default
    #[arg(long, value_name = "EXPERIMENT", value_enum)]
    only: Vec<Experiment>,
    /// Pictures to each cell of the tables of tilts, half of them with the lattice lying otherwise
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    scenes: u32,
    /// Pictures to the table of precision
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..))]
    pictures: u32,
}

/// Parts of chapter 5.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Experiment {
    /// Closest and farthest grid: sections 5.2.1 and 5.2.2.
    Ranges,
    /// Tables 5.3 to 5.5.
    Tilts,
    /// Junctions of the tilted grid: sections 5.2.3 and 6.3.
    Junctions,
    /// Tracking over 99 flows and round a loop: section 5.5.
    Tracking,
    /// Errors stage by stage beside the Cramér-Rao bound; not of the thesis.
    Precision,
}

/// A column of results: a way to the pose.
pub struct Column {
    pub name: &'static str,
    pub config: Config,
}

/// All methods that the library has, the thesis's first.
fn columns() -> Vec<Column> {
    [("ours, thesis's method", Method::Thesis), ("ours, lattice", Method::Lattice)]
        .map(|(name, method)| Column { name, config: Config { method, ..Config::default() } })
        .into()
}

/// Runs the command.
pub fn main(args: &Args) -> Result<Outcome> {
    use Experiment::{Junctions, Precision, Ranges, Tilts, Tracking};
    let columns = columns();
    for experiment in [Ranges, Tilts, Junctions, Tracking, Precision] {
        if !(args.only.is_empty() || args.only.contains(&experiment)) {
            continue;
        }
        if let Some(name) = experiment.to_possible_value() {
            eprintln!("{} ...", name.get_name());
        }
        let tables: Vec<Table> = match experiment {
            Ranges => vec![ranges::run(&columns)?],
            Tilts => {
                let mut progress = Progress::new(Some(tilts::pictures(args.scenes)));
                let table = tilts::run(&columns, args.scenes, &mut progress);
                progress.finish();
                vec![table?]
            }
            Junctions => vec![junctions::run(&columns)?],
            Tracking => tracking::run(&columns)?,
            Precision => {
                let mut progress = Progress::new(Some(u64::from(args.pictures)));
                let table = precision::run(args.pictures, &mut progress);
                progress.finish();
                vec![table?]
            }
        };
        for table in tables {
            print!("{}", if args.markdown { table.to_markdown() } else { table.to_text() });
        }
    }
    Ok(Outcome::Complete)
}
