//! The end of every picture: the last pass on the drawing, evidence, covariance, and the result in the net frame.

use net_geometry::Plane;
use net_geometry::nalgebra::{Matrix3, Vector3};

use crate::answer::covariance::{self, Doubt};
use crate::answer::decision::Evidence;
use crate::answer::estimate::{Labels, LatticeEstimate};
use crate::config::Config;
use crate::picture::window::Window;
use crate::sheet::alike::REACH_PX;
use crate::sheet::model::{self, Model};
use crate::sheet::surface::Surface;
use crate::workspace::{Lock, Workspace};

impl Workspace {
    /// The last pass on the drawing with the chosen model, evidence, covariance, and the result in the net frame.
    pub(crate) fn conclude(
        &mut self,
        config: &Config,
        surface: &Surface,
        lock: &Lock,
        model: Model,
        margin: f64,
        labels: Option<Labels>,
    ) -> Option<LatticeEstimate> {
        let followed = labels.is_some();
        let (fit, robust) = self.likelihood(surface, lock, model, 1, false)?;
        let surface = fit.surface;
        let labels = labels.unwrap_or_else(|| Labels::nearest(&surface));
        let scale = if followed { Self::coarse_scale_for } else { Self::scale_for };
        let place = scale(self, surface.depth);
        // What was summed to lock to is turned to where the lattice is now.
        let gain =
            if followed { self.sums_at(&surface, place) } else { self.demodulate(&surface, place, &Window::ALL) };
        let weighed = self.weigh(&surface, place, gain, lock);
        // What the average cell looks like does not change from picture to picture.
        let fold = if followed { lock.evidence.fold() } else { self.fold(&surface, place) };
        let mean_plane = self.mean_plane(&surface);
        let bend = mean_plane.normal.angle(&surface.normal());
        let evidence = Evidence { above: lock.above, ..weighed }.folded(fold).bent(
            bend,
            surface.sides,
            surface.depth,
            config.height_length_m,
        );
        let reach = REACH_PX[self.view.tiling_for(self.cell_px(surface.depth))] * self.view.size;
        let t = &mut self.tools;
        let scale = model::robust_scale(t.fitter.whiten(&t.observations), &mut t.scratch);
        // What a relief leaves open is in its covariance: nothing is too short for it that would turn the normal.
        let bumpy = model == Model::Bumpy;
        let bumps = if bumpy { 0.0 } else { evidence.bumps };
        let strain =
            surface.relief.map_or([0.0; 2], |relief| relief.strain(config.height_sigma_m, config.height_length_m));
        let evidence = Evidence { bumps, strain, ..evidence };
        let formal = if bumpy { 1.0 } else { covariance::FORMAL };
        let doubt = Doubt { formal, scale, reach, side_ratio: config.side_ratio_sigma, bumps: evidence.bumps };
        let errors = covariance::errors(
            &t.fitter,
            &fit,
            model.parameters(),
            &t.observations,
            robust,
            &labels,
            &doubt,
            &mut t.influences,
        );
        let odd = labels.turns % 2 == 1;
        Some(LatticeEstimate {
            pose: labels.pose(&surface),
            covariance: errors.pose,
            range: surface.depth,
            range_sigma: errors.range,
            tilt_sigma: errors.tilt,
            xy_sigma: errors.xy,
            mean_plane,
            crossing_angle: if odd { std::f64::consts::PI - surface.angle } else { surface.angle },
            crossing_angle_sigma: errors.angle,
            curvatures: surface.principal().map(|(curvature, _)| curvature),
            curvature_sigmas: errors.curvatures,
            sides: labels.families(surface.sides),
            probability: evidence.probability(errors.tilt),
            evidence,
            gain: lock.gain / (self.view.levels[0].raw.data().len() as f64),
            margin,
            model,
            polarity: labels.families(lock.polarity),
            looks: lock.seed.looks,
            focus: lock.focus,
            blur: lock.blur,
            surface,
            labels,
        })
    }
    /// Mean plane of the sheet within 220 px (848 x 480 px) of the axis.
    fn mean_plane(&self, surface: &Surface) -> Plane {
        let tangent = Plane { normal: surface.normal(), distance: surface.depth * surface.rotation[(2, 2)] };
        if surface.is_flat() {
            return tangent;
        }
        let chart = surface.chart();
        let (mut n, mut sum, mut square) = (0.0, Vector3::zeros(), Matrix3::zeros());
        for site in &self.view.levels[0].tiles[0].sites {
            let (u, v) = (site.pixel[0] - self.view.centre[0], site.pixel[1] - self.view.centre[1]);
            if !site.valid || u.hypot(v) > 220.0 * self.view.size {
                continue;
            }
            if let Some(p) = chart.at(site.ray[0], site.ray[1]) {
                let point = Vector3::new(site.ray[0], site.ray[1], 1.0) * p.depth;
                n += 1.0;
                sum += point;
                square += point * point.transpose();
            }
        }
        if n < 6.0 {
            return tangent;
        }
        let mean: Vector3<f64> = sum / n;
        let eigen = (square / n - mean * mean.transpose()).symmetric_eigen();
        let mut normal: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        if normal.z < 0.0 {
            normal = -normal;
        }
        Plane { normal, distance: normal.dot(&mean) }
    }
}
