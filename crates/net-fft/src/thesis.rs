//! The thesis's pose: spectra of sections, a pose of each, one plane through them (4.3.6).

use net_geometry::nalgebra::{Matrix3, Matrix6, Rotation3, Vector2, Vector3};
use net_geometry::{Basis, Camera, Mesh, PlanarPose, Plane, Pose, PoseCovariance};
use net_image::GrayView;
use serde::{Deserialize, Serialize};

use crate::cell::{Choice, cell_poses, choose_pair, ordered_basis};
use crate::error::{Error, Result};
use crate::fft2::HalfSpectrum;
use crate::filter::{Ellipse, FallingThreshold, FilterConfig, filter_peaks};
use crate::peaks::{Peak, PeakConfig, PeakFinder};
use crate::score::{Candidate, ScoreConfig, score_peaks};
use crate::sections::{GridConfig, SectionView};
use crate::spectrum::{Bins, SpectrumImage, SpectrumImageConfig, SpectrumPlan, Window};

/// How the plane is put through the sections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlaneThrough {
    /// The three most confident (eq. 4.24, 4.25).
    Three,
    /// All, by singular values (eq. 4.30 to 4.35, mended). Steadier.
    #[default]
    All,
}

/// Parameters of the thesis's pose. The values that it changes by hand at 1.2 m and below are both tried, see [`ThesisEstimator`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ThesisConfig {
    /// Sections of the picture. Default 2 x 2.
    pub grid: GridConfig,
    /// What multiplies a section before its transform. Default Hann; the thesis has none, which makes two scenes in five wrong.
    pub window: Window,
    /// How peaks are valued.
    pub score: ScoreConfig,
    /// Least angle between the two wave vectors, degrees. Default 55; lower it for diamond meshes seen at a slant.
    pub min_angle_deg: f64,
    /// Which sections carry the plane.
    pub plane: PlaneThrough,
    /// Greatest median error, relative to their length, of the sections' wave vectors against those of the plane that is put through them. Default
    /// 0.06: sections that agree are below 0.03, ones that do not above 0.1. Raising it answers more and lies more.
    pub max_disagreement: f64,
    /// Least confidence (value over the rival's), mean over the sections and both vectors, that is acted on. Default 1.15, the thesis's remark in 5.1.2.
    pub min_confidence: f64,
}

impl Default for ThesisConfig {
    fn default() -> Self {
        Self {
            grid: GridConfig::default(),
            window: Window::Hann,
            score: ScoreConfig::default(),
            min_angle_deg: 55.0,
            plane: PlaneThrough::All,
            max_disagreement: 0.06,
            min_confidence: 1.15,
        }
    }
}

impl ThesisConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the field.
    pub fn validate(&self) -> Result<()> {
        self.grid.validate()?;
        self.score.validate()?;
        for (field, value, low, high, expected) in [
            ("min_angle_deg", self.min_angle_deg, 0.0, 90.0, "degrees from 0 to 90"),
            ("max_disagreement", self.max_disagreement, 0.0, 1.0, "from 0 to 1"),
            ("min_confidence", self.min_confidence, 0.0, 100.0, "from 0 to 100"),
        ] {
            if !(low..=high).contains(&value) {
                return Err(Error::Parameter { field, value, expected });
            }
        }
        Ok(())
    }
}

/// What one section says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionPose {
    /// Centre, px.
    pub centre: Vector2<f64>,
    /// Ray through the centre.
    pub ray: Vector3<f64>,
    /// Which peaks were chosen, and over which.
    pub choice: Choice,
    /// Lattice vectors, px, labelled alike in all sections.
    pub basis: Basis,
    /// Both poses of the cell at the centre.
    pub poses: [PlanarPose; 2],
    /// Mean of the two confidences.
    pub confidence: f64,
}

/// The thesis's answer for one picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThesisEstimate {
    /// Net to camera; the origin is where the optical axis meets the plane.
    pub pose: Pose,
    /// The plane.
    pub plane: Plane,
    /// Cell area on the optical axis, px²: for the junctions that follow.
    pub axis_cell_area: f64,
    /// Mean confidence of the sections.
    pub confidence: f64,
    /// Median relative error of the sections' wave vectors against the plane's.
    pub disagreement: f64,
    /// Rough probability that the pose is right: high where the sections agree. Not calibrated like the lattice method's.
    pub probability: f64,
    /// Covariance from the sections' disagreement, rotation (rad) then translation (m), perturbation in the camera frame.
    pub covariance: PoseCovariance,
}

/// Values that the thesis changes by hand between near and far (5.4): neighbourhood and distance of peaks, ellipse.
#[derive(Debug, Clone, Copy)]
struct Scale {
    peaks: PeakConfig,
    filter: FilterConfig,
}

/// The thesis's pose estimator. Both of its parameter sets, for near and far nets, are applied to the same spectra; the one on whose plane
/// the sections agree better is kept. Owns all plans and buffers: no allocation after the first picture.
#[derive(Debug)]
pub struct ThesisEstimator {
    config: ThesisConfig,
    camera: Camera,
    mesh: Mesh,
    size: (usize, usize),
    plan: SpectrumPlan,
    half: HalfSpectrum,
    image: SpectrumImage,
    finder: PeakFinder,
    peaks: Vec<Peak>,
    candidates: Vec<Candidate>,
    order: Vec<usize>,
    scales: [Scale; 2],
    sections: [Vec<SectionPose>; 2],
    best: usize,
    scratch: Vec<f64>,
}

impl ThesisEstimator {
    /// Plans for one camera and mesh.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a parameter out of range, [`Error::EmptySize`] for a picture too small for its sections.
    pub fn new(camera: &Camera, mesh: &Mesh, config: &ThesisConfig) -> Result<Self> {
        config.validate()?;
        let size = config.grid.section_size(camera.width() as usize, camera.height() as usize);
        let scale = |neighbourhood_bins, cluster_bins, radius_cycles_per_px, constant_radius_bins, margin| Scale {
            peaks: PeakConfig { neighbourhood_bins, cluster_bins, threshold_levels: 20 },
            filter: FilterConfig { radius_cycles_per_px, constant_radius_bins, margin_levels: Some(margin) },
        };
        Ok(Self {
            config: config.clone(),
            camera: *camera,
            mesh: *mesh,
            size,
            plan: SpectrumPlan::new(size.0, size.1, config.window)?,
            half: HalfSpectrum::default(),
            image: SpectrumImage::default(),
            finder: PeakFinder::default(),
            peaks: Vec::new(),
            candidates: Vec::new(),
            order: Vec::new(),
            scales: [scale(16, 10.0, 0.25, 4.0, 40.0), scale(5, 2.5, 0.12, 3.0, 60.0)],
            sections: [Vec::new(), Vec::new()],
            best: 0,
            scratch: Vec::new(),
        })
    }

    /// The pose in one picture; `None` where fewer than three sections have a pose or no plane goes through them.
    ///
    /// # Errors
    /// [`Error::Geometry`] when the picture's size is not the camera's.
    pub fn estimate(&mut self, image: GrayView<'_>) -> Result<Option<ThesisEstimate>> {
        let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        self.camera.check_image_size(side(image.width()), side(image.height()))?;
        self.sections.iter_mut().for_each(Vec::clear);
        let (width, height) = self.size;
        for (u, v) in self.config.grid.corners(image.width(), image.height()) {
            let Some(view) = SectionView::new(&self.camera, (u, v), width, height, 1) else { continue };
            let Some(part) = image.crop(u, v, width, height) else { continue };
            self.plan.transform(part, &mut self.half)?;
            self.image.draw(&self.half, Bins::All, SpectrumImageConfig::default());
            for k in 0..self.scales.len() {
                if let Some(section) = self.section(k, &view) {
                    self.sections[k].push(section);
                }
            }
        }
        let mut found: Option<ThesisEstimate> = None;
        for k in 0..self.scales.len() {
            if let Some(estimate) = self.through(k)
                && found.is_none_or(|best| estimate.disagreement < best.disagreement)
            {
                found = Some(estimate);
                self.best = k;
            }
        }
        Ok(found)
    }

    /// The sections behind the last answer.
    pub fn sections(&self) -> &[SectionPose] {
        &self.sections[self.best]
    }

    /// Peaks, values, choice and cell pose in the spectrum at hand.
    fn section(&mut self, scale: usize, view: &SectionView) -> Option<SectionPose> {
        let Scale { peaks, filter } = self.scales[scale];
        let (width, height) = self.size;
        let levels = self.image.view()?;
        let constant = self.image.constant_bin();
        let radius = filter.radius_cycles_per_px;
        let ellipse = Ellipse { horizontal_bins: radius * width as f64, vertical_bins: radius * height as f64 };
        let sum: u64 = self.image.image().data().iter().map(|&level| u64::from(level)).sum();
        let mean = sum as f64 / (width * height) as f64;
        let centre = (constant.1.saturating_sub(1)..=constant.1 + 1)
            .flat_map(|v| (constant.0.saturating_sub(1)..=constant.0 + 1).map(move |u| (u, v)))
            .filter_map(|(u, v)| levels.get(u, v))
            .max()?;
        let threshold =
            filter.margin_levels.map(|margin| FallingThreshold { centre: f64::from(centre) - margin, edge: mean });
        let all = self.finder.find(levels, constant, &peaks);
        filter_peaks(all, &ellipse, filter.constant_radius_bins, threshold, &mut self.peaks);
        score_peaks(
            levels,
            constant,
            &self.peaks,
            &ellipse,
            mean,
            &self.config.score,
            &mut self.order,
            &mut self.candidates,
        );
        let wave = |bin| view.wave_from_bin(bin);
        let choice = choose_pair(&self.candidates, self.config.min_angle_deg.to_radians(), wave)?;
        let [k1, k2] = choice.chosen.map(|c| wave(self.candidates[c].bin));
        let basis = ordered_basis(k1, k2)?;
        let poses = cell_poses(&self.camera, &self.mesh, view.centre, &basis)?;
        let confidence = choice.confidence.map(|c| c.min(10.0)).iter().sum::<f64>() / 2.0;
        Some(SectionPose { centre: view.centre, ray: view.ray, choice, basis, poses, confidence })
    }

    /// The plane through the sections of one scale, and how well they agree with it.
    fn through(&mut self, scale: usize) -> Option<ThesisEstimate> {
        let sections = &mut self.sections[scale];
        if sections.len() < 3 {
            return None;
        }
        sections.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
        // Near 45 degrees neighbours may differ in which side is first, and in its sense: all follow the most confident.
        let first = sections[0].basis;
        for section in &mut sections[1..] {
            section.basis = aligned(section.basis, &first);
            section.poses = cell_poses(&self.camera, &self.mesh, section.centre, &section.basis)?;
        }
        let plane = match self.config.plane {
            PlaneThrough::Three => {
                Plane::through_points([0, 1, 2].map(|k: usize| sections[k].poses[0].pose.translation)).ok()?
            }
            PlaneThrough::All => Plane::fit(sections.iter().map(|s| s.poses[0].pose.translation)).ok()?,
        };
        // The mean direction of the first side (eq. 4.26), lifted to the plane (eq. 4.27 and 4.28 mended).
        let total: f64 = sections.iter().map(|s| s.confidence).sum();
        let mut direction = Vector3::zeros();
        for section in sections.iter() {
            direction +=
                plane.lift(section.ray, section.basis.b1.push(0.0))?.normalize() * (section.confidence / total);
        }
        let x = (direction - plane.normal * plane.normal.dot(&direction)).try_normalize(1e-9)?;
        let y = plane.normal.cross(&x);
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, plane.normal]));
        let range = plane.range()?;
        let pose = Pose { rotation, translation: Vector3::z() * range };

        // What the plane predicts for each section, against what was seen there.
        let errors = &mut self.scratch;
        errors.clear();
        for section in sections.iter() {
            let predicted = predicted_basis(&self.camera, &self.mesh, &pose, section.centre)?;
            let (p1, p2) = predicted.wave_vectors().ok()?;
            let (k1, k2) = section.basis.wave_vectors().ok()?;
            errors.push((k1 - p1).norm() / p1.norm());
            errors.push((k2 - p2).norm() / p2.norm());
        }
        errors.sort_by(f64::total_cmp);
        let disagreement = errors[errors.len() / 2];
        let confidence = total / sections.len() as f64;
        let axis = predicted_basis(&self.camera, &self.mesh, &pose, Vector2::new(self.camera.cx(), self.camera.cy()))?;

        // Acted on from 1/2, which is where the disagreement reaches its limit; fewer sections and little confidence weigh against it.
        let agree = (self.config.max_disagreement - disagreement) / (0.3 * self.config.max_disagreement);
        let sure = (confidence - self.config.min_confidence).min(0.0) / 0.02;
        let missing = self.config.grid.rows * self.config.grid.columns - sections.len();
        let probability = 1.0 / (1.0 + (-(agree + sure - 1.5 * missing as f64)).exp());

        // One section's relative error moves its depth; sections half a picture apart turn that into tilt.
        let n = sections.len() as f64;
        let sigma_range = range * (disagreement.hypot(0.01)) / n.sqrt();
        let half_view = f64::from(self.camera.width()) / self.camera.fx() / 4.0;
        let sigma_tilt = disagreement.hypot(0.01) / (half_view * n.sqrt());
        let mut covariance = Matrix6::zeros();
        for k in 0..3 {
            covariance[(k, k)] = sigma_tilt * sigma_tilt;
            covariance[(3 + k, 3 + k)] = sigma_range * sigma_range;
        }
        // Along the net a picture tells the place only within a cell.
        let cell = self.mesh.side1().max(self.mesh.side2());
        covariance[(3, 3)] += cell * cell / 12.0;
        covariance[(4, 4)] += cell * cell / 12.0;
        Some(ThesisEstimate {
            pose,
            plane,
            axis_cell_area: axis.cell_area().abs(),
            confidence,
            disagreement,
            probability,
            covariance: PoseCovariance { matrix: covariance },
        })
    }
}

/// Lattice vectors, px, of a cell of the planar net seen at `centre`. `None` where it is not seen.
fn predicted_basis(camera: &Camera, mesh: &Mesh, pose: &Pose, centre: Vector2<f64>) -> Option<Basis> {
    let at = pose.net_from_ray(camera.ray_from_pixel(centre)?)?;
    let pixel = |step: Vector2<f64>| camera.pixel_from_point(pose.transform((at + step).push(0.0)));
    let (a1, a2) = (mesh.a1() * 0.5, mesh.a2() * 0.5);
    Some(Basis { b1: pixel(a1)? - pixel(-a1)?, b2: pixel(a2)? - pixel(-a2)? })
}

/// `basis` relabelled so that its first vector is the one along `like`'s, handedness kept.
fn aligned(basis: Basis, like: &Basis) -> Basis {
    let Basis { b1, b2 } = basis;
    let turns = [(b1, b2), (b2, -b1), (-b1, -b2), (-b2, b1)];
    let along = |b: &Vector2<f64>| b.dot(&like.b1) / b.norm();
    let (b1, b2) = turns.into_iter().max_by(|x, y| along(&x.0).total_cmp(&along(&y.0))).unwrap_or((b1, b2));
    Basis { b1, b2 }
}
