//! The results in Markdown.

use crate::Kind;
use crate::score::{SIZES_PX, Score};

pub fn print(kinds: &[Kind]) {
    println!(
        "| picture | pictures | cells px | RMSE px | RMSE as is | recall | precision | false holes (twines) | estimated: refused | RMSE px | recall | precision | false holes (twines) | ms per 1000 nodes |"
    );
    println!("|{}", "---|".repeat(14));
    for kind in kinds {
        let (t, e) = (&kind.truly, &kind.estimated);
        print!(
            "| {} | {} | {:.0} | {:.3} | {:.3} | {:.4} | {:.4} | {} ({}) |",
            kind.name,
            kind.pictures,
            t.cell_px(),
            t.rmse(),
            t.rmse_as_is(),
            t.recall(),
            t.precision(),
            t.false_holes,
            t.false_missing
        );
        if e.pictures > 0 || kind.refused > 0 {
            let figures = format!(
                "{:.3} | {:.4} | {:.4} | {} ({})",
                e.rmse(),
                e.recall(),
                e.precision(),
                e.false_holes,
                e.false_missing
            );
            print!(" {} | {} |", kind.refused, if e.pictures > 0 { figures } else { "- | - | - | -".to_owned() });
        } else {
            print!(" - | - | - | - | - |");
        }
        println!(" {:.1} |", 1000.0 * kind.milliseconds / kind.nodes.max(1) as f64);
    }
    println!();
    println!(
        "| missing twines | pose | missing | intact | AUC | found at a false rate of 1e-4 (log likelihood ratio) | holes of 2 or more found | single twines found | cells below {} px | to {} px | above | false holes (twines) |",
        SIZES_PX[0], SIZES_PX[1]
    );
    println!("|{}", "---|".repeat(12));
    for kind in kinds {
        for (pose, score) in [("true", &kind.truly), ("estimated", &kind.estimated)] {
            if !score.missing.is_empty() {
                print_missing(&kind.name, pose, score);
            }
        }
    }
}

fn print_missing(name: &str, pose: &str, score: &Score) {
    let (auc, found, threshold) = score.missing_twines();
    let [small, middle, large] = score.single_by_size.map(|[found, all]| format!("{found}/{all}"));
    println!(
        "| {name} | {pose} | {} | {} | {auc:.5} | {found:.3} ({threshold:.1}) | {}/{} | {}/{} | {small} | {middle} | {large} | {} ({}) |",
        score.missing.len(),
        score.intact.len(),
        score.large[0],
        score.large[1],
        score.single[0],
        score.single[1],
        score.false_holes,
        score.false_missing
    );
}
