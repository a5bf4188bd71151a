//! The closest and the farthest grid: sections 5.2.1 and 5.2.2.

use anyhow::Result;
use net_sim::Scenario;

use super::Column;
use super::published::RANGES;
use super::reading::{Reading, draw};
use super::table::Table;

/// One virtual grid at each distance.
pub fn run(columns: &[Column]) -> Result<Table> {
    let mut head = vec!["true range".to_owned(), "thesis in print".to_owned()];
    for column in columns {
        head.extend([format!("{}: range", column.name), "error".into(), "normal".into(), "probability".into()]);
    }
    let mut table = Table::new(
        "Closest and farthest virtual grid (sections 5.2.1, 5.2.2)",
        head,
        "Grids straight ahead, mesh 50 mm, one picture each. Error in % of the range, normal: angle between estimated and true normal.",
    );
    for (range_m, scenario, thesis) in RANGES {
        let scenario = Scenario::by_name(scenario)?;
        let picture = draw(&scenario, 0)?;
        let mut cells = vec![format!("{range_m} m"), thesis.to_owned()];
        for column in columns {
            let reading = Reading::new(&column.config, &scenario, &picture)?;
            match reading.net {
                Some((net, error)) => cells.extend([
                    format!("{:.4} m", net.range_m),
                    format!("{:+.3} %", error.range_percent),
                    format!("{:.2}°", error.normal_deg),
                ]),
                None => cells.extend(["refused".to_owned(), "-".into(), "-".into()]),
            }
            cells.push(format!("{:.2}", reading.probability));
        }
        table.row(cells);
    }
    Ok(table)
}
