//! Errors on random scenes from the simulator, whether the covariance knows them, and what is claimed where there is no net.
//!
//!     cargo run --release -p net-lattice --example lattice_study -- STUDY [SCENES] [SEED]
//!     cargo run --release -p net-lattice --example lattice_study -- named [FRAMES] [NAME]
//!
//! STUDY: `planar`, `hung`, `negative`, `noise`, `jitter2`, `jitter5`, `sag`, `overgrown` (see [`net_sim::Study`]). `named`: the simulator's own
//! scenarios (those with NAME in their name), at most FRAMES of each.
//!
//! A line per scene, then a table. Wrong: range off by more than 5 %, normal or in-plane rotation by more than 5 degrees. The errors per
//! degree of freedom are those of the pose against its covariance (6 degrees); with a covariance that holds, their mean is 1.

mod evidence;

use std::time::Instant;

use net_geometry::nalgebra::{UnitQuaternion, Vector2, Vector6};
use net_geometry::{Camera, Mesh};
use net_image::Image;
use net_lattice::{Config, LatticeEstimate, LatticeEstimator};
use net_sim::{LayerTruth, Scenario, Simulator, Study, Truth};

/// Share of the net that must be in plain view for a refusal to count against the estimator.
const SEEN: f64 = 0.4;

fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(((values.len().max(1) - 1) as f64 * q).round() as usize).copied().unwrap_or(f64::NAN)
}

/// How an estimate differs from the truth.
struct Errors {
    range_percent: f64,
    normal_deg: f64,
    inplane_deg: f64,
    xy_mm: f64,
    crossing_deg: f64,
    /// Each component over its standard deviation: rotation, translation.
    normalised: [f64; 6],
    /// Normalised error squared per degree of freedom.
    nees: f64,
}

impl Errors {
    fn new(truth: &LayerTruth, e: &LatticeEstimate) -> Option<Self> {
        let axis = truth.axis?;
        let lattice = truth.lattice_at_axis()?.following(&e.pose).anchored_at(e.pose.translation).ok()?.0;
        let turn =
            UnitQuaternion::from_rotation_matrix(&(e.pose.rotation * lattice.pose.rotation.inverse())).scaled_axis();
        let shift = e.pose.translation - lattice.pose.translation;
        let d = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
        let inverse = e.covariance.try_inverse()?;
        let normal = axis.normal;
        // Where the axis meets the net, in lattice coordinates of each.
        let at = |pose: &net_geometry::Pose, range: f64| {
            pose.inverse_transform(net_geometry::nalgebra::Vector3::new(0.0, 0.0, range)).xy()
        };
        let (a, b): (Vector2<f64>, Vector2<f64>) = (at(&e.pose, e.range), at(&lattice.pose, axis.range_m));
        Some(Self {
            range_percent: 100.0 * (e.range / axis.range_m - 1.0),
            normal_deg: normal.angle(&e.pose.normal()).to_degrees(),
            inplane_deg: turn.dot(&normal).abs().to_degrees(),
            xy_mm: 1e3 * (a - b).norm(),
            crossing_deg: (e.crossing_angle - lattice.mesh.angle()).abs().to_degrees(),
            normalised: std::array::from_fn(|i| d[i] / e.covariance[(i, i)].sqrt()),
            nees: (d.transpose() * inverse * d)[0] / 6.0,
        })
    }

    fn wrong(&self) -> bool {
        self.range_percent.abs() > 5.0 || self.normal_deg > 5.0 || self.inplane_deg > 5.0
    }
}

#[derive(Default)]
struct Tally {
    right: u32,
    wrong: u32,
    refused: u32,
    alarms: u32,
    negatives: u32,
    hidden: u32,
    errors: [Vec<f64>; 6],
}

impl Tally {
    fn add(&mut self, name: &str, camera: &Camera, truth: &Truth, found: Option<&LatticeEstimate>, ms: u128) {
        let ok = found.is_some_and(|e| e.probability >= Config::default().probability_threshold);
        let net = truth.layers.first();
        let errors = net.zip(found).and_then(|(net, e)| Errors::new(net, e));
        let seen = net.map_or(0.0, LayerTruth::visible_share);
        let verdict = match (net, ok, errors.as_ref().is_some_and(|e| !e.wrong())) {
            (None, true, _) => "FALSE-ALARM",
            (None, false, _) => "no-net",
            (Some(_), true, true) => "right",
            (Some(_), true, false) => "WRONG",
            (Some(_), false, _) if seen < SEEN => "hidden",
            (Some(_), false, true) => "REFUSED-right",
            (Some(_), false, false) => "REFUSED-wrong",
        };
        match verdict {
            "FALSE-ALARM" => self.alarms += 1,
            "right" => self.right += 1,
            "WRONG" => self.wrong += 1,
            "hidden" => self.hidden += 1,
            "no-net" => (),
            _ => self.refused += 1,
        }
        self.negatives += u32::from(net.is_none());
        let mut line = format!("{name:16} {verdict:13} {ms:4} ms seen {seen:.2}");
        if let Some(net) = net
            && let Some(axis) = &net.axis
        {
            let tilt = axis.normal.z.clamp(-1.0, 1.0).acos().to_degrees();
            let snr = net.contrast_grey.abs() / truth.noise_grey.max(1e-9);
            // The mesh's shorter side as it would be seen head-on at that range.
            let cell = net.mesh.side1().min(net.mesh.side2()) * camera.fx() / axis.range_m;
            line += &format!(" true {:.3} m tilt {tilt:.0} cell {cell:.0} px snr {snr:.1}", axis.range_m);
        }
        if let Some(e) = found {
            line += &format!(" p {:.3} z {:.3}", e.probability, e.range);
        }
        if let Some(r) = &errors {
            line += &format!(
                " | range {:.4} % normal {:.4} inplane {:.4} xy {:.3} mm cross {:.4} nees {:.2} of {:.1?}",
                r.range_percent, r.normal_deg, r.inplane_deg, r.xy_mm, r.crossing_deg, r.nees, r.normalised
            );
            if verdict == "right" {
                let all = [r.range_percent.abs(), r.normal_deg, r.inplane_deg, r.xy_mm, r.crossing_deg, r.nees];
                self.errors.iter_mut().zip(all).for_each(|(v, e)| v.push(e));
            }
        }
        if let Some(e) = found {
            line += &evidence::line(e);
        }
        println!("{line}");
    }

    fn print(&mut self) {
        println!(
            "right {}, wrong claims {}, refused {} (and {} with less than {SEEN} in plain view); false alarms {} of {} without a net",
            self.right, self.wrong, self.refused, self.hidden, self.alarms, self.negatives
        );
        let names = ["range %", "normal deg", "in-plane deg", "xy mm", "crossing deg", "error^2/dof"];
        for (name, v) in names.iter().zip(&mut self.errors) {
            let mean = v.iter().sum::<f64>() / v.len().max(1) as f64;
            println!(
                "{name:12} median {:.4}  95th percentile {:.4}  mean {mean:.4}",
                quantile(v, 0.5),
                quantile(v, 0.95)
            );
        }
    }
}

/// Estimates the frame `k` of a scenario and adds it to the tally.
fn one(scenario: &Scenario, k: u32, kept: &mut Option<(Camera, Mesh, LatticeEstimator)>, tally: &mut Tally) {
    let (Ok(camera), Ok(mesh), Ok(frame)) = (scenario.camera(), scenario.mesh(), scenario.frame(k)) else { return };
    if kept.as_ref().is_none_or(|(c, m, _)| *c != camera || *m != mesh) {
        let Ok(estimator) = LatticeEstimator::new(&camera, &mesh, &Config::default()) else { return };
        *kept = Some((camera, mesh, estimator));
    }
    let Some((_, _, estimator)) = kept else { return };
    let mut image = Image::default();
    let mut simulator = Simulator::new(camera);
    let truth = match simulator.render(&frame.scene, frame.seed, &mut image) {
        Ok(truth) => truth,
        Err(error) => return eprintln!("{}: {error}", scenario.name),
    };
    let Some(view) = image.view() else { return };
    let started = Instant::now();
    let found = estimator.estimate(view).ok().flatten();
    let name = if scenario.frames > 1 { format!("{} {k}", scenario.name) } else { scenario.name.clone() };
    tally.add(&name, &camera, truth, found.as_ref(), started.elapsed().as_millis());
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, default: u64| args.get(k).and_then(|a| a.parse().ok()).unwrap_or(default);
    let mode = args.first().map_or("planar", String::as_str);
    let (mut tally, mut kept) = (Tally::default(), None);
    if mode == "named" {
        let part = args.get(2).map_or("", String::as_str);
        for scenario in Scenario::all().into_iter().filter(|s| s.name.contains(part)) {
            let step = (scenario.frames / number(1, 1).max(1) as u32).max(1);
            for k in (0..scenario.frames).step_by(step as usize) {
                one(&scenario, k, &mut kept, &mut tally);
            }
        }
    } else if let Some(study) = Study::ALL.into_iter().find(|s| s.name() == mode) {
        let first = number(2, 1);
        for seed in first..first + number(1, 50) {
            one(&study.scenario(seed), 0, &mut kept, &mut tally);
        }
    } else {
        eprintln!("{mode}: no such study");
        std::process::exit(2);
    }
    tally.print();
}
