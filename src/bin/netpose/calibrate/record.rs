//! `calibration.csv`: a row per scene.

use std::path::Path;

use anyhow::{Context, Result};
use net_lattice::Evidence;
use net_sim::Extent;
use serde_json::Value;

use super::scene::Examined;

/// The table, written row by row; what is written is whole whenever the command is stopped.
#[derive(Debug)]
pub struct Records {
    file: csv::Writer<std::fs::File>,
    has_header: bool,
}

/// A column's name and its cell.
type Cell = (String, String);

impl Records {
    /// A new table.
    pub fn create(path: &Path) -> Result<Self> {
        let file = csv::Writer::from_path(path).with_context(|| format!("cannot create {}", path.display()))?;
        Ok(Self { file, has_header: false })
    }

    /// One scene. Cells that do not apply are empty.
    pub fn write(&mut self, scene: &Examined) -> Result<()> {
        let cells = cells(scene)?;
        let mut lines = Vec::new();
        if !std::mem::replace(&mut self.has_header, true) {
            lines.push(cells.iter().map(|c| c.0.as_str()).collect::<Vec<_>>());
        }
        lines.push(cells.iter().map(|c| c.1.as_str()).collect());
        let written = lines.iter().try_for_each(|line| self.file.write_record(line));
        written.context("cannot write calibration.csv")?;
        self.file.flush().context("cannot write calibration.csv")
    }
}

fn cells(scene: &Examined) -> Result<Vec<Cell>> {
    let mut cells = Vec::new();
    let mut put = |name: &str, value: Option<String>| cells.push((name.to_owned(), value.unwrap_or_default()));
    let drawn = &scene.scenario.scene;
    put("study", Some(scene.study.name().to_owned()));
    put("seed", Some(scene.seed.to_string()));
    put("scene", Some(scene.scenario.description.clone()));
    put("mesh", Some(scene.scenario.mesh.clone()));
    put("lens", Some(scene.scenario.camera.distortion_model.clone()));
    put("defocus_px", Some(number(drawn.sensor.defocus_px)));
    put("noise_grey", Some(number(drawn.sensor.read_noise_grey)));
    let layer = drawn.layers.first();
    put("ends_in_view", layer.map(|l| flag(l.net.extent != Extent::Full)));
    put("node_jitter", layer.map(|l| number(l.net.jitter)));

    let net = scene.truth.as_ref();
    let of_net = |value: fn(&super::scene::Net) -> f64| net.map(|n| number(value(n)));
    put("visible", Some(flag(scene.is_visible())));
    put("true_range_m", of_net(|n| n.range_m));
    put("true_tilt_deg", of_net(super::scene::Net::tilt_deg));
    put("true_normal_x", of_net(|n| n.lattice.pose.normal().x));
    put("true_normal_y", of_net(|n| n.lattice.pose.normal().y));
    put("true_normal_z", of_net(|n| n.lattice.pose.normal().z));
    put("true_in_plane_deg", of_net(|n| n.lattice.pose.in_plane_rotation().to_degrees()));
    put("true_crossing_deg", of_net(|n| n.lattice.mesh.angle().to_degrees()));
    put("true_curvature_1_per_m", of_net(|n| n.curvatures_per_m[0]));
    put("true_curvature_2_per_m", of_net(|n| n.curvatures_per_m[1]));
    put("snr", of_net(|n| n.snr));
    put("signal", of_net(|n| n.signal));
    put("cell_px", of_net(|n| n.cell_px));
    put("visible_share", of_net(|n| n.visible_share));

    let found = scene.estimate.as_deref();
    let of = |value: fn(&net_lattice::LatticeEstimate) -> f64| found.map(|e| number(value(e)));
    put("probability", Some(number(scene.probability())));
    put("right", Some(flag(scene.is_right())));
    let error = |value: fn(&super::scene::Errors) -> f64| scene.error.as_ref().map(|e| number(value(e)));
    put("range_error_percent", error(|e| e.pose.range_percent));
    put("normal_error_deg", error(|e| e.pose.normal_deg));
    put("in_plane_error_deg", error(|e| e.pose.inplane_deg));
    put("crossing_error_deg", error(|e| e.crossing_deg));
    put("xy_error_mm", error(|e| e.xy_mm));
    put("nees", error(|e| e.nees));
    put("range_m", of(|e| e.range));
    put("tilt_deg", of(|e| e.pose.plane().tilt().to_degrees()));
    put("normal_x", of(|e| e.pose.normal().x));
    put("normal_y", of(|e| e.pose.normal().y));
    put("normal_z", of(|e| e.pose.normal().z));
    put("in_plane_deg", of(|e| e.pose.in_plane_rotation().to_degrees()));
    put("crossing_deg", of(|e| e.crossing_angle.to_degrees()));
    put("curvature_1_per_m", of(|e| e.curvatures[0]));
    put("curvature_2_per_m", of(|e| e.curvatures[1]));
    put("sigma_curvature_1_per_m", of(|e| e.curvature_sigmas.map_or(f64::NAN, |s| s[0])));
    put("sigma_curvature_2_per_m", of(|e| e.curvature_sigmas.map_or(f64::NAN, |s| s[1])));
    put("sigma_range_m", of(|e| e.range_sigma));
    put("sigma_tilt_deg", of(|e| e.tilt_sigma.to_degrees()));
    put("sigma_xy_m", of(|e| e.xy_sigma));
    put("sigma_crossing_deg", of(|e| e.crossing_angle_sigma.unwrap_or(f64::NAN).to_degrees()));
    put("gain", of(|e| e.gain));
    put("margin", of(|e| e.margin));
    put("blur_px", of(|e| e.blur));
    put("model", found.map(|e| format!("{:?}", e.model).to_lowercase()));
    put("polarity", found.map(|e| e.polarity.map(|p| format!("{p:?}").to_lowercase()).join(" ")));
    put("ms", Some(format!("{:.1}", scene.ms)));
    // Every statistic that the probability stands on, by its own name.
    let known = found.is_some();
    let evidence = serde_json::to_value(found.map_or_else(Evidence::default, |e| e.evidence))?;
    for (name, value) in evidence.as_object().into_iter().flatten() {
        match value.as_array() {
            Some(parts) => {
                for (k, part) in parts.iter().enumerate() {
                    put(&format!("{name}_{}", k + 1), known.then(|| statistic(part)));
                }
            }
            None => put(name, known.then(|| statistic(value))),
        }
    }
    Ok(cells)
}

fn statistic(value: &Value) -> String {
    value.as_f64().map_or_else(|| value.to_string(), number)
}

fn flag(value: bool) -> String {
    String::from(if value { "1" } else { "0" })
}

/// Six digits, as many as any of these is good for.
fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = (5 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_six_digits() {
        let texts = [0.0, -1.5, 1234567.8, 0.000123456789, 0.1 + 0.2].map(number);
        assert_eq!(texts, ["0", "-1.5", "1234568", "0.000123457", "0.3"]);
    }
}
