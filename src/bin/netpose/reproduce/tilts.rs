//! Tables 5.3 to 5.5: distance and tilt of grids over an underwater scene.

use anyhow::Result;
use net_sim::Scenario;

use super::Column;
use super::published::{TILT_TABLES, TiltRow};
use super::reading::{Reading, draw};
use super::table::Table;
use crate::progress::Progress;
use crate::sim::reseed;
use crate::stats::median;

/// Scenarios of a tilt, with the axis it is about: the thesis does not say which.
fn scenarios(tilt_deg: f64) -> &'static [(&'static str, &'static str)] {
    match tilt_deg as u32 {
        0 => &[("-", "table-5.3")],
        20 => &[("x", "table-5.4x"), ("y", "table-5.4y")],
        _ => &[("x", "table-5.5x"), ("y", "table-5.5y")],
    }
}

/// Pictures that are drawn.
pub fn pictures(scenes: u32) -> u64 {
    TILT_TABLES.iter().map(|row| scenarios(row.tilt_deg).len() as u64 * u64::from(scenes)).sum()
}

/// All three tables in one, each cell the median over `scenes` pictures.
pub fn run(columns: &[Column], scenes: u32, progress: &mut Progress) -> Result<Table> {
    let mut head: Vec<String> =
        ["tilt", "axis", "z", "Schellewald 2021 in print", "thesis in print"].map(Into::into).into();
    for column in columns {
        let name = column.name;
        head.extend([format!("{name}: z (tilt)"), "normal".into(), "sign".into(), "answered".into(), "wrong".into()]);
    }
    let mut table = Table::new(
        "Tables 5.3 to 5.5: distance and tilt of grids in an underwater scene",
        head,
        &format!(
            "z in cm, angles in degrees. Ours: medians over {scenes} scenes, of those answered; normal: angle between estimated \
             and true normal; sign: pictures whose net is tilted to the right side; wrong: answered, but off by more than 5 % or 5°."
        ),
    );
    for row in &TILT_TABLES {
        for &(axis, name) in scenarios(row.tilt_deg) {
            let mut cells = vec![
                format!("{}°", row.tilt_deg),
                axis.to_owned(),
                format!("{}", row.distance_cm),
                published(row.schellewald),
                published(row.thesis),
            ];
            let mut tallies: Vec<Tally> = columns.iter().map(|_| Tally::default()).collect();
            for scene in 0..scenes {
                let (scenario, frame) = scene_of(name, row, scene)?;
                let picture = draw(&scenario, frame)?;
                for (column, tally) in columns.iter().zip(&mut tallies) {
                    tally.add(&Reading::new(&column.config, &scenario, &picture)?, &picture.net.pose.normal());
                }
                progress.step(String::new);
            }
            cells.extend(tallies.iter().flat_map(|tally| tally.cells(scenes, row.tilt_deg)));
            table.row(cells);
        }
    }
    Ok(table)
}

/// A scenario's frames go through the four distances twice, the lattice lying otherwise; further scenes take another seed.
fn scene_of(name: &str, row: &TiltRow, scene: u32) -> Result<(Scenario, u32)> {
    let mut scenario = Scenario::by_name(name)?;
    reseed(&mut scenario, u64::from(scene / 2));
    let distance = ((row.distance_cm - 80.0) / 40.0) as u32;
    Ok((scenario, distance + 4 * (scene % 2)))
}

fn published((z_cm, angle_deg): (f64, f64)) -> String {
    format!("{z_cm} ({angle_deg}°)")
}

/// Answers of one method to the pictures of one cell.
#[derive(Debug, Default)]
struct Tally {
    z_cm: Vec<f64>,
    tilt_deg: Vec<f64>,
    normal_deg: Vec<f64>,
    right_side: usize,
    wrong: usize,
}

impl Tally {
    fn add(&mut self, reading: &Reading, true_normal: &net_geometry::nalgebra::Vector3<f64>) {
        let Some((net, error)) = &reading.net else { return };
        self.z_cm.push(100.0 * net.range_m);
        self.tilt_deg.push(net.normal.xy().norm().atan2(net.normal.z).to_degrees());
        self.normal_deg.push(error.normal_deg);
        self.right_side += usize::from(net.normal.xy().dot(&true_normal.xy()) > 0.0);
        self.wrong += usize::from(error.is_wrong());
    }

    fn cells(&self, scenes: u32, tilt_deg: f64) -> [String; 5] {
        let answered = self.z_cm.len();
        if answered == 0 {
            return ["refused".into(), "-".into(), "-".into(), format!("0/{scenes}"), "0".into()];
        }
        [
            format!("{:.2} ({:.2}°)", median(&self.z_cm), median(&self.tilt_deg)),
            format!("{:.2}°", median(&self.normal_deg)),
            // Straight ahead there is no side.
            if tilt_deg == 0.0 { "-".into() } else { format!("{}/{answered}", self.right_side) },
            format!("{answered}/{scenes}"),
            self.wrong.to_string(),
        ]
    }
}
