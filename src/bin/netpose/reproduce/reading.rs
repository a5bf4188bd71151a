//! One picture of a scenario, read by one method, against its truth.

use anyhow::{Context, Result};
use net_sim::{Image, LayerTruth, Scenario, Simulator};
use netpose::{Config, Junction, NetPose, Tracker};

use crate::eval::PoseError;

/// A drawn picture with its truth.
pub struct Picture {
    pub image: Image<u8>,
    pub net: LayerTruth,
    pub timestamp_ns: i64,
}

/// Draws frame `k` of a scenario that has a net.
pub fn draw(scenario: &Scenario, k: u32) -> Result<Picture> {
    let frame = scenario.frame(k)?;
    let mut image = Image::default();
    let mut simulator = Simulator::new(scenario.camera()?);
    let truth = simulator.render(&frame.scene, frame.seed, &mut image)?;
    let net = truth.layers.first().with_context(|| format!("scenario {} has no net", scenario.name))?.clone();
    Ok(Picture { image, net, timestamp_ns: frame.timestamp_ns })
}

/// What a method makes of a picture.
pub struct Reading {
    /// The pose and its errors, where one was claimed.
    pub net: Option<(NetPose, PoseError)>,
    pub probability: f64,
    pub junctions: Vec<Junction>,
}

impl Reading {
    /// Reads a picture by itself, without a track.
    pub fn new(config: &Config, scenario: &Scenario, picture: &Picture) -> Result<Self> {
        let mesh = scenario.mesh()?;
        let mut tracker = Tracker::new(scenario.camera()?, mesh, config)?;
        let view = picture.image.view().context("a picture without pixels")?;
        let estimate = tracker.update(view, picture.timestamp_ns)?;
        let range = picture.net.axis.map_or(f64::NAN, |axis| axis.range_m);
        let net =
            estimate.net.map(|net| (net, PoseError::new(&net.pose, net.range_m, &picture.net.pose, range, &mesh)));
        Ok(Self { net, probability: estimate.probability, junctions: estimate.junctions.to_vec() })
    }
}
