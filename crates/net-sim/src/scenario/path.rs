//! How the camera moves along the net, as a smooth function of time.

use std::f64::consts::TAU;

use nalgebra::{Rotation3, Vector3};
use net_geometry::Pose;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, within};
use crate::scene::NetPose;

/// How the camera moves along the first net. `time_s` runs from 0 to the sequence's `length_s`; the pose at 0 is the scene's own
/// for all but [`Path::Poses`] and [`Path::Similarity`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Path {
    /// It stays where it is.
    #[default]
    Still,
    /// One pose after another, not a motion: a table of pictures.
    Poses(Vec<NetPose>),
    /// Along the net's X at a speed that changes evenly, swaying.
    Strafe {
        /// Speed at the start and at the end, m/s.
        speed_m_per_s: [f64; 2],
        /// Up and down by so much, m.
        heave_m: f64,
        /// Left and right by so much about the camera's y axis, degrees.
        sway_deg: f64,
        /// Time for one heave and sway, s.
        period_s: f64,
    },
    /// Towards the net or away, easing in and out, to the end of the sequence.
    Approach {
        /// Range at the end, m.
        to_m: f64,
        /// Tilt about the camera's y axis at the end, degrees.
        tilt_y_deg: f64,
        /// Way along the net's X and Y by the end, m.
        aside_m: [f64; 2],
    },
    /// Once around and back: the last moment is the first.
    Loop {
        /// Half axes along the net's X and Y, m.
        radius_m: [f64; 2],
        /// Range nods by so much, m.
        depth_m: f64,
        /// Tilts about both axes nod by so much, degrees.
        nod_deg: f64,
        /// Turn in the net's plane rocks by so much, degrees.
        roll_deg: f64,
    },
    /// The thesis-like tracking test: the picture moves by a similarity about its centre, `shift_px` in all with a little wobble, turning
    /// by up to 2 degrees and growing by up to 3 %. The net faces the camera at `range_m`; with `loop_s`, it then returns to the start.
    Similarity {
        /// Range at the start, m.
        range_m: f64,
        /// Focal length that turns pixels into metres, px.
        focal_px: f64,
        /// Motion of the picture in all, px.
        shift_px: [f64; 2],
        /// Duration of the way there, s.
        there_s: f64,
        /// Duration of the way back, s; 0 for none.
        back_s: f64,
    },
}

impl Path {
    /// The first net's pose at `time_s` of `length_s`, frame number `frame`; `start` is the scene's.
    pub(crate) fn at(&self, start: &NetPose, time_s: f64, length_s: f64, frame: u32) -> NetPose {
        let share = if length_s > 0.0 { (time_s / length_s).clamp(0.0, 1.0) } else { 0.0 };
        match self {
            Self::Still => *start,
            Self::Poses(poses) => poses.get(frame as usize % poses.len().max(1)).copied().unwrap_or(*start),
            Self::Strafe { speed_m_per_s: [from, to], heave_m, sway_deg, period_s } => {
                let phase = TAU * time_s / period_s;
                NetPose {
                    x_m: start.x_m + from * time_s + 0.5 * (to - from) * time_s * share,
                    y_m: start.y_m + heave_m * phase.sin(),
                    tilt_y_deg: start.tilt_y_deg + sway_deg * (0.7 * phase).sin(),
                    ..*start
                }
            }
            Self::Approach { to_m, tilt_y_deg, aside_m } => {
                // Without a jerk at either end.
                let s = share * share * (3.0 - 2.0 * share);
                NetPose {
                    range_m: start.range_m + (to_m - start.range_m) * s,
                    tilt_y_deg: start.tilt_y_deg + (tilt_y_deg - start.tilt_y_deg) * s,
                    x_m: start.x_m + aside_m[0] * s,
                    y_m: start.y_m + aside_m[1] * s,
                    ..*start
                }
            }
            Self::Loop { radius_m, depth_m, nod_deg, roll_deg } => {
                let phase = TAU * share;
                NetPose {
                    range_m: start.range_m + depth_m * phase.sin(),
                    tilt_x_deg: start.tilt_x_deg + nod_deg * phase.sin(),
                    tilt_y_deg: start.tilt_y_deg + nod_deg * (2.0 * phase).sin(),
                    roll_deg: start.roll_deg + roll_deg * phase.sin(),
                    x_m: start.x_m + radius_m[0] * (1.0 - phase.cos()),
                    y_m: start.y_m + radius_m[1] * phase.sin(),
                }
            }
            Self::Similarity { range_m, focal_px, shift_px, there_s, back_s } => {
                let u = if time_s <= *there_s || *back_s <= 0.0 {
                    (time_s / there_s).min(1.0)
                } else {
                    1.0 - ((time_s - there_s) / back_s).min(1.0)
                };
                let shift = Vector3::new(
                    shift_px[0] * u + 3.0 * (TAU * 3.0 * u).sin(),
                    shift_px[1] * u + 2.0 * (TAU * 2.0 * u).sin(),
                    0.0,
                );
                let turn = 2f64.to_radians() * (TAU * 1.5 * u).sin();
                let depth = range_m / (1.0 + 0.03 * (TAU * u).sin());
                let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
                let translation = Vector3::new(0.0, 0.0, depth) + shift * (depth / focal_px);
                NetPose::from_pose(&Pose { rotation, translation }).unwrap_or(*start)
            }
        }
    }

    pub(crate) fn validate(&self) -> Result<()> {
        let metres = |field, value| within(field, value, -1e4, 1e4, "metres within ±10000");
        let degrees = |field, value| within(field, value, -90.0, 90.0, "degrees within ±90");
        match self {
            Self::Still => Ok(()),
            Self::Poses(poses) if poses.is_empty() => {
                Err(Error::Value { field: "path.poses", value: 0.0, expected: "at least one pose" })
            }
            Self::Poses(poses) => poses.iter().try_for_each(NetPose::validate),
            Self::Strafe { speed_m_per_s, heave_m, sway_deg, period_s } => {
                for &speed in speed_m_per_s {
                    within("path.strafe.speed_m_per_s", speed, -100.0, 100.0, "m/s within ±100")?;
                }
                metres("path.strafe.heave_m", *heave_m)?;
                degrees("path.strafe.sway_deg", *sway_deg)?;
                within("path.strafe.period_s", *period_s, 0.01, 1e6, "seconds between 0.01 and 1000000")
            }
            Self::Approach { to_m, tilt_y_deg, aside_m } => {
                within("path.approach.to_m", *to_m, 0.02, 1e3, "metres between 0.02 and 1000")?;
                degrees("path.approach.tilt_y_deg", *tilt_y_deg)?;
                aside_m.iter().try_for_each(|&m| metres("path.approach.aside_m", m))
            }
            Self::Loop { radius_m, depth_m, nod_deg, roll_deg } => {
                radius_m.iter().try_for_each(|&m| metres("path.loop.radius_m", m))?;
                metres("path.loop.depth_m", *depth_m)?;
                degrees("path.loop.nod_deg", *nod_deg)?;
                degrees("path.loop.roll_deg", *roll_deg)
            }
            Self::Similarity { range_m, focal_px, shift_px, there_s, back_s } => {
                within("path.similarity.range_m", *range_m, 0.02, 1e3, "metres between 0.02 and 1000")?;
                within("path.similarity.focal_px", *focal_px, 1.0, 1e6, "pixels between 1 and 1000000")?;
                for &px in shift_px {
                    within("path.similarity.shift_px", px, -1e5, 1e5, "pixels within ±100000")?;
                }
                within("path.similarity.there_s", *there_s, 1e-3, 1e6, "seconds between 0.001 and 1000000")?;
                within("path.similarity.back_s", *back_s, 0.0, 1e6, "seconds between 0 and 1000000")
            }
        }
    }
}
