//! Tables of poses: what a run wrote, and truths.

use std::collections::HashMap;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use net_geometry::nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};
use netpose::Pose;
use serde::Deserialize;

/// One row of `poses.csv` or of a truth that names its columns alike. Columns that are missing or empty are `None`.
#[derive(Debug, Clone, Deserialize)]
pub struct Row {
    pub frame: u64,
    #[serde(default)]
    pub file: String,
    pub status: Option<String>,
    pub probability: Option<f64>,
    #[serde(alias = "dist_axis")]
    pub range_m: Option<f64>,
    tx: Option<f64>,
    ty: Option<f64>,
    tz: Option<f64>,
    qw: Option<f64>,
    qx: Option<f64>,
    qy: Option<f64>,
    qz: Option<f64>,
    pub sigma_range_m: Option<f64>,
    pub latency_ms: Option<f64>,
    /// Number of the count of cells: another number, another origin.
    pub track: Option<f64>,
}

impl Row {
    /// The pose, net to camera; `None` where the row has none.
    pub fn pose(&self) -> Option<Pose> {
        let q = Quaternion::new(self.qw?, self.qx?, self.qy?, self.qz?);
        let rotation = Rotation3::from(UnitQuaternion::new_normalize(q));
        let pose = Pose { rotation, translation: Vector3::new(self.tx?, self.ty?, self.tz?) };
        (pose.translation.iter().chain(rotation.matrix().iter()).all(|x| x.is_finite())).then_some(pose)
    }

    /// Why the row's pose is none, if it looks like one. No pose at all is no net.
    fn flaw(&self) -> Option<String> {
        let columns = ["tx", "ty", "tz", "qw", "qx", "qy", "qz"];
        let values = [self.tx, self.ty, self.tz, self.qw, self.qx, self.qy, self.qz];
        let given = || columns.iter().zip(values).filter_map(|(c, v)| Some((c, v?)));
        if let Some((column, value)) = given().find(|(_, v)| !v.is_finite()) {
            return Some(format!("{column} is {value}: a finite number, or nothing in all of {}", columns.join(", ")));
        }
        match given().count() {
            0 => None,
            7 if values[3..].iter().flatten().all(|q| q.abs() < 1e-6) => {
                Some("qw, qx, qy, qz are 0: no rotation".into())
            }
            7 => None,
            _ => Some(format!("some of {} are empty: a pose has all of them, no pose none", columns.join(", "))),
        }
    }

    /// Range along the optical axis, m: as written, else from the pose.
    pub fn range(&self) -> Option<f64> {
        self.range_m.or_else(|| self.pose()?.plane().range())
    }

    /// Whether the row claims a pose. A truth without the column claims one wherever it has one.
    pub fn is_ok(&self) -> bool {
        self.status.as_deref().is_none_or(|s| s == "ok")
    }
}

/// Reads a table whose first line names its columns and which has at most one row for each frame.
pub fn read(path: &Path) -> Result<Vec<Row>> {
    let mut reader = csv::Reader::from_path(path).with_context(|| format!("cannot read {}", path.display()))?;
    let headers = reader.headers().with_context(|| format!("cannot read {}", path.display()))?;
    for column in ["frame", "tx", "ty", "tz", "qw", "qx", "qy", "qz"] {
        ensure!(headers.iter().any(|h| h == column), "{} has no column {column:?}", path.display());
    }
    let headers = headers.clone();
    let mut rows = Vec::new();
    let mut lines = HashMap::new();
    for record in reader.records() {
        let record = record.with_context(|| format!("cannot read {}", path.display()))?;
        let line = record.position().map_or(0, csv::Position::line);
        let row: Row = record.deserialize(Some(&headers)).map_err(|e| {
            let field = match e.kind() {
                csv::ErrorKind::Deserialize { err, .. } => err.field(),
                _ => None,
            };
            let field = field.and_then(|f| usize::try_from(f).ok());
            let what = field.and_then(|f| Some(format!("{} is {:?}", headers.get(f)?, record.get(f)?)));
            anyhow::anyhow!("{}, line {line}: {}", path.display(), what.unwrap_or_else(|| e.to_string()))
        })?;
        if let Some(flaw) = row.flaw() {
            bail!("{}, line {line}: {flaw}", path.display());
        }
        if let Some(earlier) = lines.insert(row.frame, line) {
            bail!(
                "{}, line {line}: frame {} is in line {earlier} already; give a table with one row for each frame",
                path.display(),
                row.frame
            );
        }
        rows.push(row);
    }
    Ok(rows)
}
