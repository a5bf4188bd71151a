//! Junctions of the tilted grid: sections 5.2.3 and 6.3.

use anyhow::Result;
use net_geometry::JunctionState;
use net_geometry::nalgebra::Vector2;
use net_sim::{Scenario, Visibility};

use super::Column;
use super::published::{JUNCTIONS_EPS_3, JUNCTIONS_EPS_6};
use super::reading::{Reading, draw};
use super::table::Table;
use crate::stats::rms;

/// A junction further from every true knot is a false one, px.
const MATCH_PX: f64 = 3.0;

/// The grid of 30 x 50 lines at 3 m and 30 degrees.
pub fn run(columns: &[Column]) -> Result<Table> {
    let scenario = Scenario::by_name("fig-5.6")?;
    let picture = draw(&scenario, 0)?;
    let visible: Vec<Vector2<f64>> =
        picture.net.nodes.iter().filter(|n| n.visibility == Visibility::Visible).map(|n| n.pixel).collect();
    let mut table = Table::new(
        "Junctions of the grid of 30 x 50 lines, 3 m, 30° (sections 5.2.3, 6.3)",
        ["", "found", "precision", "recall", "RMSE", "listed as hidden"],
        &format!(
            "{} knots are in view, those on the grid's border included; of the inner ones, which close four meshes, there are 28 x 48 = \
             1344. One to one within {MATCH_PX} px. Hidden: where the lattice goes on and no knot was measured, behind a fish or beyond the border; not counted as found.",
            visible.len()
        ),
    );
    table.row(["thesis in print, clusters of 6 px", &JUNCTIONS_EPS_6.to_string(), "-", "-", "-", "-"]);
    table.row(["thesis in print, clusters of 3 px", &JUNCTIONS_EPS_3.to_string(), "-", "-", "-", "-"]);
    for column in columns {
        let reading = Reading::new(&column.config, &scenario, &picture)?;
        if reading.net.is_none() {
            let refused = format!("refused, probability {:.2}", reading.probability);
            table.row([column.name, &refused, "-", "-", "-", "-"]);
            continue;
        }
        let seen = reading.junctions.iter().filter(|j| j.state == JunctionState::Seen);
        let found: Vec<Vector2<f64>> = seen.map(|j| j.pixel).collect();
        let hidden = reading.junctions.iter().filter(|j| j.state == JunctionState::Hidden).count();
        let matched = match_one_to_one(&found, &visible);
        let share = |of: usize| format!("{:.3}", matched.len() as f64 / of.max(1) as f64);
        let error = if matched.is_empty() { "-".to_owned() } else { format!("{:.3} px", rms(&matched)) };
        table.row([
            column.name.to_owned(),
            found.len().to_string(),
            share(found.len()),
            share(visible.len()),
            error,
            hidden.to_string(),
        ]);
    }
    Ok(table)
}

/// Distances of the pairs, nearest pairs first, each point in one pair at most.
fn match_one_to_one(found: &[Vector2<f64>], truth: &[Vector2<f64>]) -> Vec<f64> {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (f, a) in found.iter().enumerate() {
        for (t, b) in truth.iter().enumerate() {
            let distance = (a - b).norm();
            if distance <= MATCH_PX {
                pairs.push((distance, f, t));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut found_taken, mut truth_taken) = (vec![false; found.len()], vec![false; truth.len()]);
    let mut distances = Vec::new();
    for (distance, f, t) in pairs {
        if !found_taken[f] && !truth_taken[t] {
            (found_taken[f], truth_taken[t]) = (true, true);
            distances.push(distance);
        }
    }
    distances
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_knot_counts_once_and_with_its_nearest_partner() {
        let at = |u: f64, v: f64| Vector2::new(u, v);
        let truth = [at(0.0, 0.0), at(10.0, 0.0)];
        let found = [at(1.0, 0.0), at(0.5, 0.0), at(10.0, 2.0), at(5.0, 5.0)];
        assert_eq!(match_one_to_one(&found, &truth), vec![0.5, 2.0]);
    }
}
