//! Tables of poses: what a run wrote, and truths.

use std::path::Path;

use anyhow::{Context, Result, ensure};
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

    /// Range along the optical axis, m: as written, else from the pose.
    pub fn range(&self) -> Option<f64> {
        self.range_m.or_else(|| self.pose()?.plane().range())
    }

    /// Whether the row claims a pose. A truth without the column claims one wherever it has one.
    pub fn is_ok(&self) -> bool {
        self.status.as_deref().is_none_or(|s| s == "ok")
    }
}

/// Reads a table whose first line names its columns.
pub fn read(path: &Path) -> Result<Vec<Row>> {
    let mut reader = csv::Reader::from_path(path).with_context(|| format!("cannot read {}", path.display()))?;
    let headers = reader.headers().with_context(|| format!("cannot read {}", path.display()))?;
    for column in ["frame", "tx", "ty", "tz", "qw", "qx", "qy", "qz"] {
        ensure!(headers.iter().any(|h| h == column), "{} has no column {column:?}", path.display());
    }
    reader.deserialize().collect::<Result<_, _>>().with_context(|| format!("cannot read {}", path.display()))
}
