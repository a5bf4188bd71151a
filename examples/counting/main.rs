//! Does the count of cells slip in silence? The tracker over many random simulated sequences, the count held against the truth in every frame.
//!
//! ```text
//! cargo run --release --example counting -- [SEQUENCES [FRAMES [FIRST_SEED [KIND ...]]]]
//! ```
//! A small camera (424 x 240 px), steps of up to a cell a frame in every direction, speeds that change, turns and tilts; nets flat and bent, jittered, overgrown or bare of growth,
//! with another net behind and blurred by the motion; murky water, noise, fish. `far`, asked for by name, is bent and so far away that many a frame has a lattice but no pose.
//! In `rounds` the camera goes three times round a loop of `FRAMES` pictures (340 take it 50 cells away), and in each round but the first it sees open water for a while,
//! too long to count through: what it says afterwards it must know from the map.
//! A slip is a count that is off by more than half a cell against the frame before of the same `track`. A frame is flagged if its count was begun anew, or is in doubt.

mod sequence;

use std::error::Error;

use sequence::{KINDS, ROUNDS, Tally, run, sequence};

fn main() -> Result<(), Box<dyn Error>> {
    let numbers: Vec<u64> = std::env::args().skip(1).take(3).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let wanted: Vec<String> = std::env::args().skip(4).collect();
    let number = |k: usize, default: u64| numbers.get(k).copied().unwrap_or(default);
    let (sequences, frames, first) = (number(0, 20), u32::try_from(number(1, 50))?, number(2, 1));
    let mut tallies = [Tally::default(); KINDS.len()];
    for seed in first..first + sequences {
        for (kind, name) in KINDS.iter().enumerate() {
            let asked =
                if wanted.is_empty() { !matches!(*name, "rounds" | "far") } else { wanted.iter().any(|w| w == name) };
            if !asked {
                continue;
            }
            let mut scenario = sequence(kind, frames, seed);
            scenario.name = (*name).to_owned();
            let rounds = if *name == "rounds" { ROUNDS } else { 1 };
            run(&scenario, rounds, &mut tallies[kind])?;
        }
    }
    println!("| kind | frames | steps above half a cell | refused | flagged | recognised again | silent slips |");
    println!("|---|---|---|---|---|---|---|");
    let mut all = Tally::default();
    let row = |name: &str, t: &Tally| {
        let share = |n: u32| format!("{n} ({:.1} %)", 100.0 * f64::from(n) / f64::from(t.frames.max(1)));
        println!(
            "| {name} | {} | {} | {} | {} | {} | {} |",
            t.frames,
            t.large_steps,
            share(t.refused),
            share(t.flagged),
            t.recognised,
            t.silent
        );
    };
    for (name, t) in KINDS.iter().zip(&tallies) {
        row(name, t);
        all.frames += t.frames;
        all.refused += t.refused;
        all.flagged += t.flagged;
        all.recognised += t.recognised;
        all.silent += t.silent;
        all.large_steps += t.large_steps;
    }
    row("all", &all);
    Ok(())
}
