//! Counts what the vote decides over scenarios of the simulator: every frame is numbered right, or wrong by one cell more than the one before.
//!
//! ```text
//! votes [--alias I J] [--stride N] SCENARIO ...
//! ```

use std::error::Error;

use nalgebra::{Vector2, Vector3};
use net_flow::vote::{CellVote, Verdict, VoteConfig};
use net_sim::{Image, Scenario, Simulator};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let number = |args: &[String], name: &str, k: usize| {
        args.iter().position(|a| a == name).and_then(|i| args.get(i + k)?.parse::<i32>().ok())
    };
    let alias = (number(&args, "--alias", 1).unwrap_or(0), number(&args, "--alias", 2).unwrap_or(0));
    let stride = number(&args, "--stride", 1).unwrap_or(1).max(1) as u32;
    args.retain(|a| !a.starts_with("--") && a.parse::<i32>().is_err());
    println!(
        "| scenario | decided right | ambiguous | blind | count broken | wrong in silence | z of the best: median, 5 % | z of the second: median | ms a frame |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for name in &args {
        let scenario = Scenario::by_name(name)?;
        let camera = scenario.camera()?;
        let (a, b) = (scenario.mesh()?.side1(), scenario.mesh()?.side2());
        let mut simulator = Simulator::new(camera);
        let mut vote = CellVote::new(&VoteConfig::default())?;
        let mut image = Image::default();
        let (mut right, mut ambiguous, mut blind, mut broken, mut wrong) = (0, 0, 0, 0, 0);
        let (mut best, mut second) = (Vec::new(), Vec::new());
        // Cells between the caller's numbers and the true ones; what one frame adds to them.
        let mut off = (0, 0);
        let mut time = 0.0;
        for k in (0..scenario.frames).step_by(stride as usize) {
            let frame = scenario.frame(k)?;
            let truth = simulator.render(&frame.scene, frame.seed, &mut image)?;
            let Some(axis) = truth.layers.first().and_then(|l| l.axis) else { continue };
            if k > 0 {
                off = (off.0 + alias.0, off.1 + alias.1);
            }
            let (u, v) = (axis.directions[0] * a, axis.directions[1] * b);
            let point = Vector3::new(0.0, 0.0, axis.range_m);
            let pixel = |at: Vector2<f64>| {
                let from_axis = at - Vector2::new(f64::from(off.0), f64::from(off.1)) - axis.cells;
                camera.pixel_from_point(point + u * from_axis.x + v * from_axis.y)
            };
            let middle = (axis.cells.x.round() as i32 + off.0, axis.cells.y.round() as i32 + off.1);
            let begin = std::time::Instant::now();
            let result = vote.update(image.view().ok_or("no picture")?, middle, pixel);
            time += begin.elapsed().as_secs_f64();
            match result.verdict {
                Verdict::Started => {}
                Verdict::Ambiguous => ambiguous += 1,
                Verdict::Blind => {
                    blind += 1;
                    off = (0, 0);
                }
                Verdict::Decided => {
                    let (i, j) = result.correction().unwrap_or_default();
                    off = (off.0 + i, off.1 + j);
                    if result.dropped > 0 {
                        // It says itself that the count is broken.
                        broken += 1;
                        off = (0, 0);
                        vote.reset();
                    } else if off == (0, 0) {
                        right += 1;
                    } else {
                        wrong += 1;
                        eprintln!("{name} {k}: {result:?}");
                        off = (0, 0);
                        vote.reset();
                    }
                }
            }
            if matches!(result.verdict, Verdict::Decided | Verdict::Ambiguous) {
                best.push(result.shifts[0].z);
                second.push(result.shifts[1].z);
            }
        }
        best.sort_by(f64::total_cmp);
        second.sort_by(f64::total_cmp);
        let at =
            |list: &[f64], q: f64| list.get((q * (list.len().max(1) - 1) as f64) as usize).copied().unwrap_or(f64::NAN);
        println!(
            "| {name} | {right} | {ambiguous} | {blind} | {broken} | {wrong} | {:.1}, {:.1} | {:.1} | {:.2} |",
            at(&best, 0.5),
            at(&best, 0.05),
            at(&second, 0.5),
            1e3 * time / f64::from(scenario.frames.div_ceil(stride))
        );
    }
    Ok(())
}
