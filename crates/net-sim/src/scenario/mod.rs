//! Named scenes and sequences, and files of them.

mod camera;
mod catalogue;
mod path;

pub use camera::CameraModel;
pub use path::Path;

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use net_geometry::{Camera, Mesh, Pose};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, within};
use crate::random::{Addressed, Stream};
use crate::scene::{Layer, Motion, NetPose, Scene};
use crate::study::Study;

/// Time of the first frame: 2023-11-14 22:13:20 UTC, a round number of seconds.
const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

/// A scene or sequence with all that it takes to draw it: what `netpose sim` reads from a file or knows by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scenario {
    /// Its name.
    pub name: String,
    /// What it shows, in a line.
    pub description: String,
    /// The mesh that a user would give: `50mm`, `60x40mm`, `50x50mm@75deg`. A hung net is still sold as square.
    pub mesh: String,
    /// Number of frames.
    pub frames: u32,
    /// Frames per second. Default 10.
    pub rate_hz: f64,
    /// Noise of frame `k` follows from this and `k`. Default 0.
    pub seed: u64,
    /// The camera.
    pub camera: CameraModel,
    /// The scene at the start.
    pub scene: Scene,
    /// How the camera moves.
    pub path: Path,
}

impl Default for Scenario {
    fn default() -> Self {
        Self {
            name: "plain".to_owned(),
            description: "One light flat net of 50 mm mesh that fills the view, 1.2 m away".to_owned(),
            mesh: "50mm".to_owned(),
            frames: 1,
            rate_hz: 10.0,
            seed: 0,
            camera: CameraModel::default(),
            scene: Scene::default(),
            path: Path::default(),
        }
    }
}

/// One frame of a scenario, ready to be drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// What is in view.
    pub scene: Scene,
    /// Seed of the sensor's noise.
    pub seed: u64,
    /// Nanoseconds since the Unix epoch.
    pub timestamp_ns: i64,
}

impl Scenario {
    /// All scenarios that have a name, in the order of the thesis and then from easy to hard.
    pub fn all() -> Vec<Self> {
        catalogue::all()
    }

    /// The scenario of this name. `fig-5.7` to `fig-5.9` show the picture of `fig-5.6`; `study-planar-17` is the scene of seed 17 of
    /// [`Study::Planar`](crate::Study::Planar), and so with every study.
    ///
    /// # Errors
    /// [`Error::Name`] if there is none.
    pub fn by_name(name: &str) -> Result<Self> {
        let study = name.strip_prefix("study-").and_then(|rest| rest.rsplit_once('-'));
        if let Some((study, seed)) = study
            && let (Ok(study), Ok(seed)) = (study.parse::<Study>(), seed.parse())
        {
            return Ok(study.scenario(seed));
        }
        let known = match name {
            "fig-5.7" | "fig-5.8" | "fig-5.9" => "fig-5.6",
            other => other,
        };
        let found = Self::all().into_iter().find(|s| s.name == known);
        found.ok_or_else(|| Error::Name { what: "scenario", name: name.to_owned() })
    }

    /// The camera.
    ///
    /// # Errors
    /// [`Error::Geometry`] for values that make no camera.
    pub fn camera(&self) -> Result<Camera> {
        self.camera.camera()
    }

    /// The mesh that a user would give.
    ///
    /// # Errors
    /// [`Error::Geometry`] for text that is no mesh.
    pub fn mesh(&self) -> Result<Mesh> {
        Ok(self.mesh.parse()?)
    }

    /// Frame `k`, from 0. Deterministic: any frame can be asked for in any order.
    ///
    /// # Errors
    /// As [`Scenario::validate`].
    pub fn frame(&self, k: u32) -> Result<Frame> {
        self.validate()?;
        let time_s = f64::from(k) / self.rate_hz;
        let mut scene = self.scene.clone();
        scene.time_s += time_s;
        let start = self.start();
        let here = self.pose(time_s, k);
        // The camera's motion carries all that is fixed to the net.
        let from_start = compose(&here, &inverse(&start.pose()));
        if here != start.pose() {
            for layer in &mut scene.layers {
                layer.pose = after(&from_start, &layer.pose)?;
            }
            if let Some(backdrop) = &mut scene.backdrop {
                backdrop.pose = after(&from_start, &backdrop.pose)?;
            }
        }
        if scene.sensor.exposure_s > 0.0 && !matches!(self.path, Path::Still | Path::Poses(_)) {
            scene.motion = self.motion(time_s, k);
        }
        let timestamp_ns = EPOCH_NS + (time_s * 1e9).round() as i64;
        let seed = Addressed::new(self.seed, Stream::Noise).bits(i64::from(k), 0, 1);
        Ok(Frame { scene, seed, timestamp_ns })
    }

    /// Refuses what cannot be drawn.
    ///
    /// # Errors
    /// [`Error::Value`] or [`Error::Geometry`] with the first field that is out of range.
    pub fn validate(&self) -> Result<()> {
        within("frames", f64::from(self.frames), 1.0, 1e7, "between 1 and 10000000")?;
        within("rate_hz", self.rate_hz, 1e-3, 1e4, "frames per second between 0.001 and 10000")?;
        self.camera()?;
        self.mesh()?;
        self.scene.validate()?;
        self.path.validate()
    }

    /// The pose that the path starts from: the first net's, or the backdrop's.
    fn start(&self) -> NetPose {
        let first = self.scene.layers.first().map(|l: &Layer| l.pose);
        first.or(self.scene.backdrop.map(|b| b.pose)).unwrap_or_default()
    }

    /// The first net's pose at some time.
    fn pose(&self, time_s: f64, frame: u32) -> Pose {
        let length_s = f64::from(self.frames.saturating_sub(1)) / self.rate_hz;
        self.path.at(&self.start(), time_s, length_s, frame).pose()
    }

    /// Motion of the camera, by central differences of a smooth path: a millisecond leaves 1e-6 of it.
    fn motion(&self, time_s: f64, frame: u32) -> Motion {
        let step_s = 1e-3;
        let (before, after) = (self.pose(time_s - step_s, frame), self.pose(time_s + step_s, frame));
        // The later camera in the frame of the earlier one.
        let moved = compose(&before, &inverse(&after));
        let rate = 0.5 / step_s;
        Motion {
            linear_m_per_s: (moved.translation * rate).into(),
            // By quaternion: the angle from a matrix's trace is not a number for the smallest turns.
            angular_deg_per_s: (UnitQuaternion::from_rotation_matrix(&moved.rotation)
                .scaled_axis()
                .map(f64::to_degrees)
                * rate)
                .into(),
        }
    }
}

fn compose(a: &Pose, b: &Pose) -> Pose {
    Pose { rotation: a.rotation * b.rotation, translation: a.transform(b.translation) }
}

fn inverse(pose: &Pose) -> Pose {
    let rotation: Rotation3<f64> = pose.rotation.inverse();
    Pose { rotation, translation: -(rotation * pose.translation) }
}

/// Where a net is after the camera's motion.
fn after(motion: &Pose, pose: &NetPose) -> Result<NetPose> {
    let moved = compose(motion, &pose.pose());
    NetPose::from_pose(&moved).ok_or_else(|| {
        let toward: Vector3<f64> = moved.normal();
        let value = toward.z;
        Error::Value { field: "cosine of the tilt along the path", value, expected: "above 0: the net in front" }
    })
}
