//! `netpose`: where is the net? One file per command; results on standard output or in files, everything else on standard error.

mod calibrate;
mod describe;
mod draw;
mod eval;
mod failure;
mod image;
mod info;
mod interrupt;
mod map;
mod options;
mod progress;
mod reproduce;
mod run;
mod sim;
mod smooth;
mod stats;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Where is the net? Pose, junctions and motion of a fish net from one camera.
#[derive(Parser)]
#[command(
    version,
    about,
    max_term_width = 110,
    after_help = "\
Exit status: 0 done (frames without a net are no errors), 1 the command failed, was stopped, or a frame could not be \
read (the results of all others stand), 2 wrong usage."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Run(run::Args),
    Smooth(smooth::Args),
    Image(image::Args),
    Sim(sim::Args),
    Eval(eval::Args),
    Info(info::Args),
    Reproduce(reproduce::Args),
    Calibrate(calibrate::Args),
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Run(args) => run::main(&args),
        Command::Smooth(args) => smooth::main(&args),
        Command::Image(args) => image::main(&args),
        Command::Sim(args) => sim::main(&args),
        Command::Eval(args) => eval::main(&args),
        Command::Info(args) => info::main(&args),
        Command::Reproduce(args) => reproduce::main(&args),
        Command::Calibrate(args) => calibrate::main(&args),
    };
    failure::exit_code(done)
}
