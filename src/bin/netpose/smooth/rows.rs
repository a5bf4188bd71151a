//! From `poses.csv` to samples.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use net_geometry::nalgebra::{Matrix6, Vector2, Vector3};
use net_log::{NetColumns, PoseRow, PoseRows, RunPaths, RunSummary};
use net_track::{Measurement, Sample};
use netpose::Mesh;

use crate::run::COUNT_HEADER;

/// What is taken for sigmas that a run does not know: 1 % of the range, a degree, 5 mm.
const UNKNOWN: (f64, f64, f64) = (0.01, 0.017, 0.005);
/// Least sigmas, so that a covariance can be inverted: 0.01 mm, 1e-5 rad.
const LEAST: (f64, f64) = (1e-5, 1e-5);

/// The rows of a run, and those of them that have a time as samples.
pub struct Rows {
    pub rows: Vec<PoseRow>,
    /// Which row each sample is.
    pub row_of: Vec<usize>,
    pub samples: Vec<Sample>,
    /// Deviations by which the vote was sure of a sample's count during the run; `None` where it was not asked.
    pub judged: Vec<Option<f64>>,
    /// Names of the columns behind the usual ones.
    pub appended: Vec<String>,
}

impl Rows {
    pub fn read(paths: &RunPaths, summary: &RunSummary) -> Result<Self> {
        let path = paths.poses();
        let reader = PoseRows::open(&path)?.with_context(|| format!("{} is missing or empty", path.display()))?;
        let usual = net_log::POSES_HEADER.split(',').count();
        let appended: Vec<String> = reader.header().iter().skip(usual).map(str::to_owned).collect();
        let mesh: Mesh =
            summary.mesh.parse().with_context(|| format!("{} does not say the mesh", paths.summary().display()))?;
        let rows: Vec<PoseRow> = reader.collect::<net_log::Result<_>>()?;
        let counts = read_counts(&paths.dir.join("count.csv"))?;
        let (mut row_of, mut samples, mut judged) = (Vec::new(), Vec::<Sample>::new(), Vec::new());
        let column = |row: &PoseRow, name: &str| {
            let at = appended.iter().position(|a| a == name)?;
            row.appended.get(at).copied().filter(|x| x.is_finite())
        };
        for (k, row) in rows.iter().enumerate() {
            // Frames out of order are unreadable, and have no place in a trajectory.
            let Some(timestamp_ns) = row.timestamp_ns else { continue };
            if samples.last().is_some_and(|s| s.timestamp_ns >= timestamp_ns) {
                continue;
            }
            let counted = counts.get(&row.frame);
            let measurement = row.net.filter(|_| counted.is_none_or(|c| c.sure)).map(|mut net| {
                let lattice = lattice(&mesh, column(row, "crossing_angle_deg"));
                if let Some(c) = counted {
                    // Every name grows by the offset: the origin is another node.
                    let cells = lattice[0] * f64::from(c.offset.0) + lattice[1] * f64::from(c.offset.1);
                    net.pose.translation -= net.pose.rotation * cells.push(0.0);
                }
                Measurement {
                    pose: net.pose,
                    covariance: covariance(&net),
                    probability: row.probability.unwrap_or(0.0),
                    lattice,
                    track: counted.map_or_else(|| column(row, "track").map_or(0, |t| t as u32), |c| c.stretch),
                }
            });
            row_of.push(k);
            judged.push(counted.filter(|c| c.sure).map(|c| c.z));
            samples.push(Sample { timestamp_ns, measurement, increment: None });
        }
        Ok(Self { rows, row_of, samples, judged, appended })
    }

    /// A value in a column behind the usual ones.
    pub fn appended(&self, row: usize, name: &str) -> f64 {
        let at = self.appended.iter().position(|a| a == name);
        at.and_then(|at| self.rows[row].appended.get(at)).copied().unwrap_or(f64::NAN)
    }
}

/// What the vote says of a frame's count.
struct Count {
    stretch: u32,
    offset: (i32, i32),
    z: f64,
    sure: bool,
}

/// Reads `count.csv`; empty if the run made none.
fn read_counts(path: &Path) -> Result<BTreeMap<u64, Count>> {
    if !path.exists() {
        return Ok(BTreeMap::new());
    }
    let failed = || format!("cannot read {}", path.display());
    let mut reader = csv::Reader::from_path(path).with_context(failed)?;
    ensure!(
        reader.headers().with_context(failed)?.iter().eq(COUNT_HEADER),
        "{}: other columns than this version's",
        path.display()
    );
    reader
        .records()
        .map(|record| {
            let record = record.with_context(failed)?;
            let cell = |k: usize| -> Result<i64> {
                record
                    .get(k)
                    .unwrap_or("")
                    .parse()
                    .with_context(|| format!("{}: column {}", path.display(), COUNT_HEADER[k]))
            };
            let small = |k: usize| i32::try_from(cell(k)?).with_context(failed);
            let stretch = u32::try_from(cell(2)?).with_context(failed)?;
            let frame = u64::try_from(cell(0)?).with_context(failed)?;
            let z = record.get(6).and_then(|z| z.parse().ok()).unwrap_or(f64::NAN);
            Ok((frame, Count { stretch, offset: (small(3)?, small(4)?), z, sure: cell(7)? == 1 }))
        })
        .collect()
}

/// Lattice vectors, m, of a net whose meshes may hang askew.
fn lattice(mesh: &Mesh, crossing_angle_deg: Option<f64>) -> [Vector2<f64>; 2] {
    let askew = crossing_angle_deg.and_then(|a| Mesh::oblique(mesh.side1(), mesh.side2(), a.to_radians()).ok());
    let mesh = askew.unwrap_or(*mesh);
    [mesh.a1(), mesh.a2()]
}

/// The table has three sigmas of a pose, not its covariance: that of the point where the optical axis meets the net (place along the net, range), and a turn about
/// it (tilt; the rotation in the plane is taken as no better), all independent. From there to turn and shift of the net's origin.
fn covariance(net: &NetColumns) -> Matrix6<f64> {
    let known = |sigma: f64, unknown: f64, least: f64| if sigma.is_finite() { sigma.max(least) } else { unknown };
    let turn = known(net.sigma_tilt_deg.to_radians(), UNKNOWN.1, LEAST.1);
    let range = known(net.sigma_range_m, UNKNOWN.0 * net.range_m.abs().max(0.1), LEAST.0);
    let xy = known(net.sigma_xy_m, UNKNOWN.2, LEAST.0);
    let point = Vector3::new(0.0, 0.0, net.range_m);
    // Along the net's X and Y, and along the optical axis: t moves by these, and by the turn about the point, w x (t - point).
    let along = [(net.pose.x_axis(), xy), (net.pose.y_axis(), xy), (Vector3::z(), range)];
    let mut covariance = Matrix6::zeros();
    let mut shift = covariance.fixed_view_mut::<3, 3>(3, 3);
    for (direction, sigma) in along {
        shift += direction * direction.transpose() * (sigma * sigma);
    }
    let lever = -(net.pose.translation - point).cross_matrix();
    let variance = turn * turn;
    shift += lever * lever.transpose() * variance;
    covariance.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(variance);
    covariance.fixed_view_mut::<3, 3>(3, 0).copy_from(&(lever * variance));
    covariance.fixed_view_mut::<3, 3>(0, 3).copy_from(&(lever.transpose() * variance));
    covariance
}
