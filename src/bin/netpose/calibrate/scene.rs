//! One scene: drawn, estimated from one picture, held against its truth.

use std::time::Instant;

use anyhow::{Context, Result};
use net_geometry::Lattice;
use net_geometry::nalgebra::Vector6;
use net_lattice::{LatticeEstimate, LatticeEstimator};
use net_sim::{Image, LayerTruth, Scenario, Scene, Simulator, Study};
use netpose::Config;

use crate::eval::PoseError;

/// A net in view of which at least this share of knots is in plain view can be asked for: estimators must stand 60 % of occlusion.
const VISIBLE_SHARE: f64 = 0.4;
/// And whose picture, matched to its own drawing, stands out of the noise at least so many times. One knot's worth of twine has a few;
/// a sheet of hundreds of cells far below the noise has 30.
const VISIBLE_SIGNAL: f64 = 30.0;

/// Standard deviation that eight bits add: grey levels over the root of twelve.
const ROUNDING_GREY: f64 = 0.289;

/// What is known of one scene.
#[derive(Debug, Clone)]
pub struct Examined {
    pub study: Study,
    pub seed: u64,
    pub scenario: Scenario,
    pub truth: Option<Net>,
    pub estimate: Option<Box<LatticeEstimate>>,
    /// Of an estimate where there is a net.
    pub error: Option<Errors>,
    /// Time of the estimate, ms.
    pub ms: f64,
}

/// The true net.
#[derive(Debug, Clone)]
pub struct Net {
    /// The flat lattice that touches it on the optical axis, X nearest to the image's u axis.
    pub lattice: Lattice,
    pub range_m: f64,
    /// Larger first, 1/m.
    pub curvatures_per_m: [f64; 2],
    /// Contrast of wide twine over the noise on open water.
    pub snr: f64,
    /// Of the net's picture, before noise, against the same picture without it: root of the sum of squares over the noise. What a matched
    /// filter would find at best.
    pub signal: f64,
    /// Along the direction in which tilt shortens it, of the shorter side, px.
    pub cell_px: f64,
    /// Of the knots in the picture.
    pub visible_share: f64,
}

impl Net {
    /// Whether an estimator may be blamed for not finding it.
    pub fn is_visible(&self) -> bool {
        self.visible_share >= VISIBLE_SHARE && self.signal >= VISIBLE_SIGNAL && self.snr >= 0.5
    }

    pub fn tilt_deg(&self) -> f64 {
        self.lattice.pose.plane().tilt().to_degrees()
    }
}

/// Estimate against truth, names of directions and nodes chosen alike.
#[derive(Debug, Clone, Copy)]
pub struct Errors {
    pub pose: PoseError,
    pub crossing_deg: f64,
    /// In the net plane, to the nearest node, mm.
    pub xy_mm: f64,
    /// Normalised error squared over its six degrees of freedom: 1 where the covariance is right.
    pub nees: f64,
}

impl Examined {
    /// The probability given; 0 where nothing was found.
    pub fn probability(&self) -> f64 {
        self.estimate.as_ref().map_or(0.0, |e| e.probability)
    }

    /// There is a net and the estimate is within the limits.
    pub fn is_right(&self) -> bool {
        self.error.is_some_and(|e| !e.pose.is_wrong())
    }

    /// A claim that should not have been made.
    pub fn is_lie(&self, config: &Config) -> bool {
        self.probability() >= config.lattice.probability_threshold && !self.is_right()
    }

    /// Whether an estimator may be blamed for not finding it.
    pub fn is_visible(&self) -> bool {
        self.truth.as_ref().is_some_and(Net::is_visible)
    }
}

/// Buffers of one thread.
#[derive(Debug, Default)]
pub struct Bench {
    image: Image<u8>,
    blank: Image<u8>,
}

impl Bench {
    /// Draws and estimates the scene of this seed.
    pub fn examine(&mut self, study: Study, seed: u64, config: &Config) -> Result<Examined> {
        let scenario = study.scenario(seed);
        let name = || scenario.name.clone();
        let (camera, mesh) = (scenario.camera()?, scenario.mesh()?);
        let frame = scenario.frame(0).with_context(name)?;
        let mut simulator = Simulator::new(camera);
        let drawn = simulator.render(&frame.scene, frame.seed, &mut self.image).with_context(name)?.clone();
        let net = match drawn.layers.first() {
            Some(layer) => self.net(&mut simulator, &frame.scene, layer, drawn.noise_grey)?,
            None => None,
        };
        let mut estimator = LatticeEstimator::new(&camera, &mesh, &config.lattice).with_context(name)?;
        let view = self.image.view().context("the simulator drew an empty picture")?;
        let start = Instant::now();
        let estimate = estimator.estimate(view).with_context(name)?.map(Box::new);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let error = estimate.as_deref().zip(net.as_ref()).map(|(e, net)| errors(e, net));
        Ok(Examined { study, seed, scenario, truth: net, estimate, error, ms })
    }

    fn net(
        &mut self,
        simulator: &mut Simulator,
        scene: &Scene,
        layer: &LayerTruth,
        noise_grey: f64,
    ) -> Result<Option<Net>> {
        let (Some(axis), Some(lattice)) = (layer.axis, layer.lattice_at_axis()) else { return Ok(None) };
        let with = simulator.noiseless().to_vec();
        simulator.render(&Scene { layers: Vec::new(), ..scene.clone() }, 0, &mut self.blank)?;
        let squares = with.iter().zip(simulator.noiseless()).map(|(a, b)| f64::from(a - b).powi(2));
        let signal = squares.sum::<f64>().sqrt() / noise_grey.max(ROUNDING_GREY);
        let side_m = lattice.mesh.side1().min(lattice.mesh.side2());
        Ok(Some(Net {
            range_m: axis.range_m,
            curvatures_per_m: axis.curvatures_per_m,
            snr: layer.contrast_grey.abs() / noise_grey.max(ROUNDING_GREY),
            signal,
            cell_px: simulator.camera().fx() * side_m * axis.normal.z / axis.range_m,
            visible_share: layer.visible_share(),
            lattice: lattice.canonical().unwrap_or(lattice),
        }))
    }
}

fn errors(estimate: &LatticeEstimate, net: &Net) -> Errors {
    // Of the four ways to name the directions the one nearest to the estimate's, of the nodes the nearest.
    let once = net.lattice.turned();
    let twice = once.turned();
    let off = |l: &Lattice| (estimate.pose.rotation * l.pose.rotation.inverse()).scaled_axis();
    let ways = [net.lattice, once, twice, twice.turned()];
    let truth = ways.into_iter().min_by(|a, b| off(a).norm().total_cmp(&off(b).norm())).unwrap_or(net.lattice);
    let at = truth.mesh.coordinates(truth.pose.inverse_transform(estimate.pose.translation).xy());
    let (node, aside) = (at.map(f64::round), at - at.map(f64::round));
    let turn = off(&truth);
    let shift = estimate.pose.translation - truth.pose.transform(truth.mesh.node(node.x, node.y).push(0.0));
    let error = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
    let nees = estimate.covariance.try_inverse().map_or(f64::NAN, |c| (error.transpose() * c * error)[0] / 6.0);
    Errors {
        pose: PoseError::new(&estimate.pose, estimate.range, &truth.pose, net.range_m, &truth.mesh),
        crossing_deg: (estimate.crossing_angle - truth.mesh.angle()).abs().to_degrees(),
        xy_mm: 1e3 * truth.mesh.node(aside.x, aside.y).norm(),
        nees,
    }
}
