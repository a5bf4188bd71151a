//! Tables of the truth: poses, every knot, every broken twine.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use anyhow::{Context, Result};
use net_geometry::nalgebra::{Matrix3, Rotation3, Vector3};
use net_log::{NetColumns, PoseRow, PosesCsv, RowStatus};
use net_sim::{LayerTruth, Truth, Visibility};
use netpose::Pose;

/// The tables beside the frames.
pub struct Tables {
    /// `truth.csv`: the nearest net in the columns of `poses.csv`.
    poses: PosesCsv,
    /// `truth_layers.csv`: all nets in the same columns and the layer's number, a row for each net of a frame.
    layers: PosesCsv,
    /// `truth_junctions.csv`: every knot in view, of every net.
    junctions: Table,
    /// `truth_missing.csv`: every broken twine in view.
    missing: Table,
}

impl Tables {
    /// New tables in `dir`.
    pub fn create(dir: &Path) -> Result<Self> {
        let [crossing, larger, smaller] = ["crossing_angle_deg", "curvature_1_per_m", "curvature_2_per_m"];
        Ok(Self {
            poses: PosesCsv::create(&dir.join("truth.csv"), &[crossing, larger, smaller])?,
            layers: PosesCsv::create(&dir.join("truth_layers.csv"), &[crossing, larger, smaller, "layer"])?,
            junctions: Table::create(dir, "truth_junctions.csv", "frame,layer,i,j,u,v,depth_m,visibility")?,
            missing: Table::create(dir, "truth_missing.csv", "frame,layer,i0,j0,i1,j1,u0,v0,u1,v1,stub0_m,stub1_m")?,
        })
    }

    /// One frame.
    pub fn write(&mut self, frame: u64, file: &str, timestamp_ns: i64, truth: &Truth) -> Result<()> {
        self.poses.write(&pose_row(frame, file, timestamp_ns, truth.layers.first()))?;
        for (number, layer) in truth.layers.iter().enumerate() {
            let mut row = pose_row(frame, file, timestamp_ns, Some(layer));
            row.appended.resize(3, f64::NAN);
            row.appended.push(number as f64);
            self.layers.write(&row)?;
            for node in &layer.nodes {
                let ((i, j), (u, v)) = (node.index, (node.pixel.x, node.pixel.y));
                let (depth, seen) = (node.depth_m, node.visibility.as_str());
                self.junctions.line(format_args!("{frame},{number},{i},{j},{u:.4},{v:.4},{depth:.5},{seen}"))?;
            }
            for edge in &layer.missing_edges {
                let [(i0, j0), (i1, j1)] = edge.nodes;
                let [a, b] = edge.pixels;
                let [stub_a, stub_b] = edge.stubs_m;
                self.missing.line(format_args!(
                    "{frame},{number},{i0},{j0},{i1},{j1},{:.3},{:.3},{:.3},{:.3},{stub_a:.5},{stub_b:.5}",
                    a.x, a.y, b.x, b.y
                ))?;
            }
        }
        Ok(())
    }

    /// Hands everything to the system.
    pub fn finish(self) -> Result<()> {
        self.junctions.finish()?;
        self.missing.finish()
    }
}

fn pose_row(frame: u64, file: &str, timestamp_ns: i64, net: Option<&LayerTruth>) -> PoseRow {
    let visible = |n: &&LayerTruth| n.nodes.iter().filter(|n| n.visibility == Visibility::Visible).count() as u64;
    let columns = net.and_then(|net| {
        let pose = contract_pose(net);
        let plane = pose.plane();
        // Where the axis passes the net by there is no range.
        let (range_m, distance_m) = net.axis.map_or((plane.range()?, plane.distance), |a| (a.range_m, a.distance_m));
        let unknown = f64::NAN;
        let (sigma_range_m, sigma_tilt_deg, sigma_xy_m) = (unknown, unknown, unknown);
        Some(NetColumns { range_m, distance_m, normal: pose.normal(), pose, sigma_range_m, sigma_tilt_deg, sigma_xy_m })
    });
    let sheet = net.and_then(|net| net.axis);
    PoseRow {
        frame,
        file: file.to_owned(),
        timestamp_ns: Some(timestamp_ns),
        status: if columns.is_some() { RowStatus::Ok } else { RowStatus::NoNet },
        probability: Some(if columns.is_some() { 1.0 } else { 0.0 }),
        net: columns,
        junctions: Some(net.as_ref().map_or(0, visible)),
        latency_ms: None,
        appended: sheet.map_or_else(Vec::new, |a| {
            vec![a.crossing_angle.to_degrees(), a.curvatures_per_m[0], a.curvatures_per_m[1]]
        }),
    }
}

/// The net frame of the files: the tangent plane where the optical axis meets the net, X along the first mesh direction there, and
/// the origin at the knot (0, 0) as if the net were spread flat on that plane.
fn contract_pose(net: &LayerTruth) -> Pose {
    let Some(axis) = &net.axis else { return net.pose };
    let [first, second] = axis.directions;
    let (x, z) = (first, axis.normal);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    let to_knot = first * (net.mesh.side1() * axis.cells.x) + second * (net.mesh.side2() * axis.cells.y);
    Pose { rotation, translation: Vector3::z() * axis.range_m - to_knot }
}

/// A text file, line by line.
struct Table {
    name: &'static str,
    file: BufWriter<File>,
}

impl Table {
    fn create(dir: &Path, name: &'static str, header: &str) -> Result<Self> {
        let path = dir.join(name);
        let file = File::create(&path).with_context(|| format!("cannot create {}", path.display()))?;
        let mut table = Self { name, file: BufWriter::new(file) };
        table.line(format_args!("{header}"))?;
        Ok(table)
    }

    fn line(&mut self, cells: std::fmt::Arguments<'_>) -> Result<()> {
        writeln!(self.file, "{cells}").with_context(|| format!("cannot write {}", self.name))
    }

    fn finish(mut self) -> Result<()> {
        self.file.flush().with_context(|| format!("cannot write {}", self.name))
    }
}
