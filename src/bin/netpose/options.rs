//! What several commands must know: camera, mesh, parameters.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use net_log::LogInfo;
use netpose::{Camera, Config, Mesh};

use crate::failure::Usage;

/// Camera, mesh and parameters.
#[derive(Debug, Clone, clap::Args)]
pub struct Setup {
    /// Calibration: ROS camera_info YAML (as camera_calibration writes it) or Kalibr camchain YAML. Default: what the log says,
    /// else camera.yaml beside the images
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Mesh, knot to knot: 50mm, 5cm, 0.05m or 0.05 (metres); 50x40mm for a rectangle; 50x50mm@60deg for an oblique mesh
    #[arg(long, value_name = "SIZE")]
    cell: Option<Mesh>,
    /// Parameters, TOML; what it leaves out keeps its default
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

/// A camera, and where it was found.
#[derive(Debug, Clone)]
pub struct KnownCamera {
    pub camera: Camera,
    pub origin: String,
}

impl Setup {
    /// The mesh, or the flag that gives it.
    pub fn mesh(&self) -> Result<Mesh> {
        let unknown = "the mesh is not known: give its size, knot to knot, with --cell (for example --cell 50mm)";
        self.cell.ok_or_else(|| Usage(unknown.into()).into())
    }

    /// The parameters, checked.
    pub fn config(&self) -> Result<Config> {
        let Some(path) = &self.config else { return Ok(Config::default()) };
        let text =
            std::fs::read_to_string(path).with_context(|| format!("--config: cannot read {}", path.display()))?;
        let config: Config = toml::from_str(&text).map_err(|e| Usage(format!("{}: {e}", path.display())))?;
        config.validate().map_err(|e| Usage(format!("{}: {e}", path.display())))?;
        Ok(config)
    }

    /// The camera that `--camera` gives; `None` without the flag.
    pub fn camera_flag(&self) -> Result<Option<KnownCamera>> {
        self.camera.as_deref().map(from_file).transpose()
    }

    /// The camera: from the flag, else from the log's messages, else from a `camera.yaml` beside its images.
    pub fn camera(&self, log: &LogInfo) -> Result<KnownCamera> {
        if let Some(known) = self.camera_flag()? {
            return Ok(known);
        }
        if let Some(found) = &log.camera {
            let origin = format!("topic {}", found.topic);
            return match &found.camera {
                Ok(camera) => Ok(KnownCamera { camera: *camera, origin }),
                Err(why) => {
                    Err(anyhow::anyhow!("the camera in the log can't be used, give one with --camera FILE: {why}"))
                }
            };
        }
        known_or_asked_for(log.camera_file.as_deref())
    }

    /// The cameras of single pictures: from the flag, else each from a `camera.yaml` beside it, which is said on standard error.
    pub fn cameras_of(&self, pictures: &[PathBuf]) -> Result<Vec<Camera>> {
        if let Some(known) = self.camera_flag()? {
            return Ok(vec![known.camera; pictures.len()]);
        }
        let mut by_folder = HashMap::new();
        let mut cameras = Vec::with_capacity(pictures.len());
        for picture in pictures {
            let folder = picture.parent().unwrap_or(Path::new(""));
            let camera = match by_folder.get(folder) {
                Some(&camera) => camera,
                None => {
                    let known = known_or_asked_for(net_log::camera_beside(folder).as_deref())?;
                    eprintln!("camera: {}", known.origin);
                    by_folder.insert(folder, known.camera);
                    known.camera
                }
            };
            cameras.push(camera);
        }
        Ok(cameras)
    }
}

/// The camera of a file that was found, or which flag gives it.
fn known_or_asked_for(found: Option<&Path>) -> Result<KnownCamera> {
    let unknown = "the camera is not known: give its calibration with --camera FILE (ROS camera_info YAML or Kalibr camchain YAML), \
                   or put it beside the images as camera.yaml";
    found.map_or_else(|| Err(Usage(unknown.into()).into()), from_file)
}

fn from_file(path: &Path) -> Result<KnownCamera> {
    let camera = net_log::read_camera(path).context("camera")?;
    Ok(KnownCamera { camera, origin: path.display().to_string() })
}
