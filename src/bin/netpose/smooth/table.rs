//! `poses_smooth.csv` and `slips.csv`.

use std::path::Path;

use anyhow::{Context, Result};
use net_geometry::PoseCovariance;
use net_log::{NetColumns, PoseRow, PosesCsv, RowStatus};
use net_track::{Origin, Smoothed, Trajectory, Verdict};

use super::rows::Rows;

/// Columns behind the usual ones.
const APPENDED: [&str; 14] = [
    "track",
    "crossing_angle_deg",
    "sigma_crossing_angle_deg",
    "curvature_1_per_m",
    "curvature_2_per_m",
    "measured",
    "outlier",
    "residual",
    "vx_m_s",
    "vy_m_s",
    "vz_m_s",
    "repair_i",
    "repair_j",
    "slip_suspected",
];

/// Writes both tables.
pub fn write(dir: &Path, rows: &Rows, trajectory: &Trajectory) -> Result<()> {
    write_poses(&dir.join("poses_smooth.csv"), rows, trajectory)?;
    let path = dir.join("slips.csv");
    write_slips(&path, rows, trajectory).with_context(|| format!("cannot write {}", path.display()))
}

fn write_poses(path: &Path, rows: &Rows, trajectory: &Trajectory) -> Result<()> {
    let mut smoothed: Vec<Option<&Smoothed>> = vec![None; rows.rows.len()];
    let mut suspected = vec![false; rows.rows.len()];
    for (&row, pose) in rows.row_of.iter().zip(&trajectory.poses) {
        smoothed[row] = pose.as_ref();
    }
    for repair in &trajectory.repairs {
        suspected[rows.row_of[repair.suspect.sample]] = true;
    }
    let mut table = PosesCsv::create(path, &APPENDED)?;
    for (k, row) in rows.rows.iter().enumerate() {
        let net = smoothed[k].and_then(net_columns);
        let status = match net {
            Some(_) => RowStatus::Ok,
            None if row.status == RowStatus::Unreadable => RowStatus::Unreadable,
            None => RowStatus::NoNet,
        };
        let mut appended = vec![f64::NAN; APPENDED.len()];
        if let Some(pose) = smoothed[k] {
            appended[0] = f64::from(pose.segment);
            for (n, name) in APPENDED.iter().enumerate().take(5).skip(1) {
                appended[n] = rows.appended(k, name);
            }
            let measured = pose.origin != Origin::Interpolated;
            appended[5] = f64::from(u8::from(measured));
            appended[6] = f64::from(u8::from(pose.origin == Origin::Outlier));
            appended[7] = if measured { pose.residual } else { f64::NAN };
            appended[8..11].copy_from_slice(pose.velocity.as_slice());
            appended[11] = f64::from(pose.correction.0);
            appended[12] = f64::from(pose.correction.1);
            appended[13] = f64::from(u8::from(suspected[k]));
        }
        table.write(&PoseRow { status, net, appended, ..row.clone() })?;
    }
    Ok(())
}

fn net_columns(smoothed: &Smoothed) -> Option<NetColumns> {
    let (pose, plane) = (smoothed.pose, smoothed.pose.plane());
    let covariance = PoseCovariance { matrix: smoothed.covariance };
    Some(NetColumns {
        range_m: plane.range()?,
        distance_m: plane.distance,
        normal: pose.normal(),
        pose,
        sigma_range_m: covariance.sigma_range(&pose),
        sigma_tilt_deg: covariance.sigma_tilt(&pose).to_degrees(),
        sigma_xy_m: covariance.sigma_xy(&pose),
    })
}

fn write_slips(path: &Path, rows: &Rows, trajectory: &Trajectory) -> Result<()> {
    let mut table = csv::Writer::from_path(path)?;
    table.write_record([
        "frame",
        "frame_before",
        "i",
        "j",
        "estimate_i",
        "estimate_j",
        "gain",
        "verdict",
        "z",
        "applied",
    ])?;
    let frame = |sample: usize| rows.rows[rows.row_of[sample]].frame.to_string();
    for repair in &trajectory.repairs {
        let (s, a) = (&repair.suspect, &repair.answer);
        let z = if a.z.is_finite() { format!("{:.3}", a.z) } else { String::new() };
        table.write_record([
            frame(s.sample),
            frame(s.before),
            s.cells.0.to_string(),
            s.cells.1.to_string(),
            format!("{:.4}", s.estimate[0]),
            format!("{:.4}", s.estimate[1]),
            format!("{:.2}", s.gain),
            a.verdict.as_str().to_owned(),
            z,
            u8::from(a.verdict == Verdict::Confirmed).to_string(),
        ])?;
    }
    Ok(table.flush()?)
}
