use net_geometry::nalgebra::{Matrix6, Vector2, Vector3};
use net_geometry::{Camera, Plane, Pose};

use crate::answer::decision::Evidence;
use crate::drawing::polarity::Polarity;
use crate::lock::comb::Looks;
use crate::sheet::model::Model;
use crate::sheet::surface::Surface;

/// Where the net is. Angles in rad, lengths in m; frames as in [`net_geometry`].
#[derive(Debug, Clone)]
pub struct LatticeEstimate {
    /// Net to camera, at the tangent plane on the optical axis: X along the mesh direction nearest to the image's u axis, Z away from
    /// the camera, origin at a node (from a cold start: the one nearest to the axis).
    pub pose: Pose,
    /// Covariance of a perturbation in the camera frame: rotation (rad) first, then translation (m).
    pub covariance: Matrix6<f64>,
    /// Depth on the optical axis, m, and one standard deviation.
    pub range: f64,
    /// One standard deviation of the range, m.
    pub range_sigma: f64,
    /// One standard deviation of the normal's direction (root mean square over both axes), rad.
    pub tilt_sigma: f64,
    /// One standard deviation of the position in the net plane (root mean square over both axes), m.
    pub xy_sigma: f64,
    /// Mean plane of the fitted sheet about the optical axis.
    pub mean_plane: Plane,
    /// Angle from X to the other family of twine, rad.
    pub crossing_angle: f64,
    /// One standard deviation of the crossing angle, rad; `None` when it was held.
    pub crossing_angle_sigma: Option<f64>,
    /// Principal curvatures of the sheet on the axis, 1/m, larger magnitude first; positive bends away from the camera.
    pub curvatures: [f64; 2],
    /// One standard deviation of each, 1/m; `None` when the sheet was held flat.
    pub curvature_sigmas: Option<[f64; 2]>,
    /// Side lengths along X and along the other family, m.
    pub sides: [f64; 2],
    /// Probability that there is a net and that range is within 5 %, normal and in-plane rotation within 5 degrees.
    pub probability: f64,
    /// What the probability stands on.
    pub evidence: Evidence,
    /// Log-likelihood gain of the net's drawing over an empty picture, per px of the working image.
    pub gain: f64,
    /// Share of the gain by which the best rival period falls short (at least, if it is much); negative when a rival would be better.
    pub margin: f64,
    /// How much of the sheet was estimated.
    pub model: Model,
    /// Bright or dark twine: lines of constant i, and of constant j. Light from aside can have one family brighter than the water and leave the other darker.
    pub polarity: [Polarity; 2],
    /// Blur of the picture, px, one standard deviation, as chosen by likelihood among a few.
    pub blur: f64,
    /// How the twine looks to the lock-in.
    pub(crate) looks: Looks,
    /// Standard deviation of the window about the optical axis in which the sheet was fitted, px of an 848 x 480 px picture.
    pub(crate) focus: f64,
    /// The sheet itself.
    pub(crate) surface: Surface,
    /// Internal families to the net frame's: quarter turns, and the node that is the origin (internal coordinates).
    pub(crate) labels: Labels,
}

/// From the sheet's own lattice coordinates to those of the net frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Labels {
    /// Quarter turns: X is `a1`, `a2`, `-a1`, `-a2`.
    pub turns: u8,
    /// Internal coordinates of the net frame's node (0, 0).
    pub origin: [f64; 2],
}

impl Labels {
    /// X nearest to the image's u axis, origin at the node nearest to the optical axis.
    pub(crate) fn nearest(surface: &Surface) -> Self {
        let d = 0.5 * (std::f64::consts::FRAC_PI_2 - surface.angle);
        let (sd, cd) = d.sin_cos();
        let (e1, e2) = (surface.rotation.column(0), surface.rotation.column(1));
        let u1 = e1[0] * cd + e2[0] * sd;
        let u2 = e1[0] * sd + e2[0] * cd;
        let turns = if u1.abs() >= u2.abs() {
            if u1 >= 0.0 { 0 } else { 2 }
        } else if u2 >= 0.0 {
            1
        } else {
            3
        };
        // In a rhomb the nearest node need not be the one whose coordinates round to it.
        let base = [surface.offset[0].round(), surface.offset[1].round()];
        let mut best = (f64::INFINITY, base);
        for i in -1..=1 {
            for j in -1..=1 {
                let node = [base[0] + f64::from(i), base[1] + f64::from(j)];
                let p = (node[0] - surface.offset[0]) * surface.sides[0];
                let q = (node[1] - surface.offset[1]) * surface.sides[1];
                let distance = p * p + q * q + 2.0 * p * q * surface.angle.cos();
                if distance < best.0 - 1e-15 {
                    best = (distance, node);
                }
            }
        }
        Self { turns, origin: best.1 }
    }

    /// What belongs to the two families, from the sheet's order to that of X and the other, or back.
    pub(crate) fn families<T: Copy>(&self, of: [T; 2]) -> [T; 2] {
        if self.turns % 2 == 1 { [of[1], of[0]] } else { of }
    }

    /// Internal coordinates to (i, j).
    pub(crate) fn net_from_sheet(&self, s: [f64; 2]) -> Vector2<f64> {
        let (p, q) = (s[0] - self.origin[0], s[1] - self.origin[1]);
        match self.turns {
            0 => Vector2::new(p, q),
            // X = a2, the other direction is -a1.
            1 => Vector2::new(q, -p),
            2 => Vector2::new(-p, -q),
            _ => Vector2::new(-q, p),
        }
    }

    /// (i, j) to internal coordinates.
    pub(crate) fn sheet_from_net(self, ij: Vector2<f64>) -> [f64; 2] {
        let (p, q) = match self.turns {
            0 => (ij.x, ij.y),
            1 => (-ij.y, ij.x),
            2 => (-ij.x, -ij.y),
            _ => (ij.y, -ij.x),
        };
        [p + self.origin[0], q + self.origin[1]]
    }

    /// The pose in the net frame's convention.
    pub(crate) fn pose(&self, surface: &Surface) -> Pose {
        use net_geometry::nalgebra::{Matrix3, Rotation3};
        let d = 0.5 * (std::f64::consts::FRAC_PI_2 - surface.angle);
        let (sd, cd) = d.sin_cos();
        let (e1, e2) = (surface.rotation.column(0), surface.rotation.column(1));
        let n = surface.normal();
        let a1 = e1 * cd + e2 * sd;
        let a2 = e1 * sd + e2 * cd;
        let x = match self.turns {
            0 => a1,
            1 => a2,
            2 => -a1,
            _ => -a2,
        };
        let y = n.cross(&x);
        let p = self.origin[0] - surface.offset[0];
        let q = self.origin[1] - surface.offset[1];
        let translation =
            Vector3::new(0.0, 0.0, surface.depth) + a1 * (p * surface.sides[0]) + a2 * (q * surface.sides[1]);
        Pose { rotation: Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, n])), translation }
    }
}

/// What an estimate leaves to the next picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Followed {
    pub surface: Surface,
    pub labels: Labels,
    pub pose: Pose,
    /// In the sheet's order.
    pub polarity: [Polarity; 2],
    pub blur: f64,
    pub looks: Looks,
    pub focus: f64,
    pub model: Model,
    pub evidence: Evidence,
    pub gain: f64,
    pub margin: f64,
}

impl LatticeEstimate {
    pub(crate) fn followed(&self) -> Followed {
        Followed {
            surface: self.surface,
            labels: self.labels,
            pose: self.pose,
            polarity: self.labels.families(self.polarity),
            blur: self.blur,
            looks: self.looks,
            focus: self.focus,
            model: self.model,
            evidence: self.evidence,
            gain: self.gain,
            margin: self.margin,
        }
    }

    /// The sheet that was fitted.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Lattice coordinates (i, j) of the net frame at a pixel. `None` where the sheet is not seen.
    pub fn lattice_from_pixel(&self, camera: &Camera, pixel: Vector2<f64>) -> Option<Vector2<f64>> {
        let ray = camera.ray_from_pixel(pixel)?;
        let point = self.surface.chart().at(ray.x, ray.y)?;
        Some(self.labels.net_from_sheet(point.s))
    }

    /// Pixel of lattice coordinates (i, j) of the net frame, and the point's depth, m. `None` where the sheet is not seen there.
    pub fn pixel_from_lattice(&self, camera: &Camera, ij: Vector2<f64>) -> Option<(Vector2<f64>, f64)> {
        let target = self.labels.sheet_from_net(ij);
        let chart = self.surface.chart();
        // From the tangent plane, then Newton on the ray.
        let flat = self.labels.pose(&self.surface).transform({
            let cross = self.crossing_angle;
            Vector3::new(
                ij.x * self.sides[0] + ij.y * self.sides[1] * cross.cos(),
                ij.y * self.sides[1] * cross.sin(),
                0.0,
            )
        });
        if flat.z <= 1e-3 {
            return None;
        }
        let (mut x, mut y) = (flat.x / flat.z, flat.y / flat.z);
        let mut depth = 0.0;
        for _ in 0..12 {
            let p = chart.at(x, y)?;
            depth = p.depth;
            let (r0, r1) = (target[0] - p.s[0], target[1] - p.s[1]);
            if r0.abs() + r1.abs() < 1e-9 {
                break;
            }
            let h = 1e-5;
            let (px, py) = (chart.at(x + h, y)?, chart.at(x, y + h)?);
            let (a, b) = ((px.s[0] - p.s[0]) / h, (py.s[0] - p.s[0]) / h);
            let (c, d) = ((px.s[1] - p.s[1]) / h, (py.s[1] - p.s[1]) / h);
            let det = a * d - b * c;
            if det.abs() < 1e-9 {
                return None;
            }
            let limit = 0.2;
            x += ((d * r0 - b * r1) / det).clamp(-limit, limit);
            y += ((a * r1 - c * r0) / det).clamp(-limit, limit);
        }
        let p = chart.at(x, y)?;
        if (p.s[0] - target[0]).abs() + (p.s[1] - target[1]).abs() > 1e-3 {
            return None;
        }
        let pixel = camera.pixel_from_point(Vector3::new(x, y, 1.0) * depth)?;
        Some((pixel, depth))
    }
}
