//! From a picture to the net.

use std::f64::consts::PI;

use net_geometry::nalgebra::{SMatrix, Vector3};
use net_geometry::{Camera, Mesh, Plane, Pose, PoseCovariance};
use net_image::{GrayView, Image, View};

use crate::config::{PlaneSource, Selection, ThesisConfig};
use crate::crossings::mixed_orders;
use crate::decide::{probability, sections_seeing};
use crate::envelope::{Agreement, Envelopes};
use crate::error::{Error, Result};
use crate::estimate::{SectionPose, Side, Support, ThesisEstimate};
use crate::evidence::{Reading, Section, evidence};
use crate::field::LatticeField;
use crate::fit::{BENT, FLAT, NormalEquations, Parameters, ParametersSquared, moved};
use crate::naming::Naming;
use crate::plane::{SideInSection, most_confident_three, plane_from_waves, pose_in_plane};
use crate::polish::{Fitted, LAST_TOLERANCE_BINS, Polish};
use crate::poses::{agreed_poses, own_poses};
use crate::reduce::{SUMS, mean_of_four, noise_factor, sum_of_four};
use crate::search::{Hypothesis, Search, weakest_period};
use crate::section::{SectionAnalyser, SectionConfig, SectionSpectrum};
use crate::sections::SectionView;

/// Finds the net of one mesh in the pictures of one camera. Owns all plans and buffers: after the first pictures it allocates nothing.
#[derive(Debug)]
pub struct ThesisEstimator {
    camera: Camera,
    mesh: Mesh,
    config: ThesisConfig,
    /// How often the picture is halved before the first grid.
    first_halvings: u32,
    /// The picture at half its size, a quarter, and so on.
    reduced: Vec<Image<u16>>,
    /// One for each grid.
    analysers: Vec<SectionAnalyser>,
    /// Sections of all grids, and the grid of each.
    sections: Vec<Section>,
    grids: Vec<usize>,
    search: Search,
    envelopes: Envelopes,
    poses: Vec<SectionPose>,
}

impl ThesisEstimator {
    /// For pictures of `camera` that may show a net of `mesh`.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a parameter out of range, [`Error::EmptySize`] if a picture reduced for the last grid has no pixel left.
    pub fn new(camera: &Camera, mesh: &Mesh, config: &ThesisConfig) -> Result<Self> {
        config.validate()?;
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        let mut first_halvings = 0;
        while (height >> first_halvings) as f64 > 1.5 * f64::from(config.working_height_px) {
            first_halvings += 1;
        }
        let (mut analysers, mut sections, mut grids) = (Vec::new(), Vec::new(), Vec::new());
        for (index, grid) in config.grids.iter().enumerate() {
            let halvings = first_halvings as usize + index;
            let (width, height) = (width >> halvings, height >> halvings);
            if width == 0 || height == 0 {
                return Err(Error::EmptySize { width, height });
            }
            let size = grid.section_size(width, height);
            let least_noise_grey = config.section.least_noise_grey * noise_factor(halvings);
            let section = SectionConfig { least_noise_grey, ..config.section };
            let analyser = SectionAnalyser::new(size.0, size.1, &section)?;
            for corner in grid.corners(width, height) {
                let reduction = 1 << halvings;
                // Beyond the lens model's reach there is nothing to be read.
                let Some(view) = SectionView::new(camera, corner, size.0, size.1, reduction) else { continue };
                let (ellipse, spectrum) = (*analyser.ellipse(), SectionSpectrum::default());
                sections.push(Section { view, corner, size, reduction, ellipse, spectrum });
                grids.push(index);
            }
            analysers.push(analyser);
        }
        Ok(Self {
            camera: *camera,
            mesh: *mesh,
            config: config.clone(),
            first_halvings,
            reduced: vec![Image::default(); first_halvings as usize + config.grids.len() - 1],
            analysers,
            grids,
            search: Search::new(&config.search, sections.len()),
            envelopes: Envelopes::with_room_for(sections.len()),
            poses: Vec::with_capacity(sections.len()),
            sections,
        })
    }

    /// The net in `picture`; `None` if there is nothing like one. What is returned may still be nothing: its probability says so.
    ///
    /// # Errors
    /// [`Error::Size`] for a picture of another size than the camera's.
    pub fn estimate(&mut self, picture: GrayView<'_>) -> Result<Option<ThesisEstimate>> {
        self.analyse(picture)?;
        self.poses.clear();
        Ok(match self.config.selection {
            Selection::Together => self.agree(),
            Selection::EachSection => self.follow_thesis(),
        })
    }

    /// All sections with their spectra, peaks and candidates, of the last picture.
    pub fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// The lattices that were fitted to the last picture, best first. Empty with [`Selection::EachSection`].
    pub fn hypotheses(&self) -> &[Hypothesis] {
        self.search.found()
    }

    /// The net as the single sections of the last picture see it.
    pub fn section_poses(&self) -> &[SectionPose] {
        &self.poses
    }

    /// The configuration.
    pub fn config(&self) -> &ThesisConfig {
        &self.config
    }

    /// Spectra, peaks and candidates of all sections.
    fn analyse(&mut self, picture: GrayView<'_>) -> Result<()> {
        let (expected_width, expected_height) = (self.camera.width() as usize, self.camera.height() as usize);
        let (width, height) = (picture.width(), picture.height());
        if (width, height) != (expected_width, expected_height) {
            return Err(Error::Size { expected_width, expected_height, width, height });
        }
        for halving in 0..self.reduced.len() {
            let (done, rest) = self.reduced.split_at_mut(halving);
            match done.last().and_then(Image::view) {
                Some(larger) if halving < SUMS => sum_of_four(larger, &mut rest[0]),
                Some(larger) => mean_of_four(larger, &mut rest[0]),
                None => sum_of_four(picture, &mut rest[0]),
            }
        }
        for (section, &grid) in self.sections.iter_mut().zip(&self.grids) {
            let analyser = &mut self.analysers[grid];
            let ((u, v), (width, height)) = (section.corner, section.size);
            let halvings = self.first_halvings as usize + grid;
            if halvings == 0 {
                let Some(part) = picture.crop(u, v, width, height) else { continue };
                analyser.analyse(part, &mut section.spectrum)?;
            } else {
                let part: Option<View<'_, u16>> =
                    self.reduced[halvings - 1].view().and_then(|picture| picture.crop(u, v, width, height));
                let Some(part) = part else { continue };
                analyser.analyse(part, &mut section.spectrum)?;
            }
        }
        Ok(())
    }

    /// All sections together. Where nothing comes of the lattice that the peaks bear out best, the next ones have their turn.
    fn agree(&mut self) -> Option<ThesisEstimate> {
        let (shape, search) = (&self.config.shape, &self.config.search);
        let first = *self.search.run(&self.sections, &self.mesh, shape, search).first()?;
        let mut best = self.fit(&first);
        if best.as_ref().is_some_and(|best| best.probability >= CREDIBLE) {
            return best;
        }
        self.search.go_on(&self.sections, &self.mesh, &self.config.shape, &self.config.search);
        let probability = |found: &Option<ThesisEstimate>| found.as_ref().map_or(0.0, |found| found.probability);
        let (mut winner, mut last) = (first, first);
        for turn in 0..self.search.found().len().min(OTHERS) {
            let next = self.search.found()[turn];
            if next == first {
                continue;
            }
            last = next;
            let found = self.fit_late(&next);
            if probability(&found) > probability(&best) {
                (best, winner) = (found, next);
            }
        }
        // What the sections see is that of the last one fitted.
        if winner == last {
            return best;
        }
        if winner == first { self.fit(&first) } else { self.fit_late(&winner) }
    }

    /// The same for one of several that were tried: the best of them looks good by chance more easily, and has to be that much surer.
    fn fit_late(&mut self, hypothesis: &Hypothesis) -> Option<ThesisEstimate> {
        let found = self.fit(hypothesis)?;
        let odds = found.probability / (1.0 - found.probability) * LATE_ODDS;
        Some(ThesisEstimate { probability: odds / (1.0 + odds), ..found })
    }

    /// The net of a lattice, fitted to the waves of all sections.
    fn fit(&mut self, hypothesis: &Hypothesis) -> Option<ThesisEstimate> {
        let polish = Polish { sections: &self.sections, mesh: &self.mesh, config: &self.config };
        let fitted = polish.run(&hypothesis.field, &mut self.envelopes)?;
        let parameters = fitted.covariance()?;
        let Fitted { field: fitted, agreement, .. } = fitted;
        let naming = Naming::along_u(&fitted);
        let field = naming.of(&fitted);
        let mesh = self.mesh_along(naming.side(), field.shape().1)?;
        agreed_poses(&field, &self.sections, &mesh, &mut self.poses);
        let planes = self.planes();
        let chosen = match self.config.plane {
            PlaneSource::Waves => None,
            PlaneSource::MostConfidentThree => planes[0],
            PlaneSource::Svd => planes[1],
        };
        let pose = match chosen {
            Some(plane) => self.pose_in(&plane, &mesh)?,
            None => self.pose_of(&field)?,
        };
        let covariance = self.covariance(&fitted, naming, &pose, &parameters);
        self.finish(field, mesh, naming.side(), pose, planes, agreement, covariance)
    }

    /// Each section for itself, as the thesis has it.
    fn follow_thesis(&mut self) -> Option<ThesisEstimate> {
        own_poses(&self.sections, &self.mesh, self.config.search.min_angle_deg.to_radians(), &mut self.poses);
        let planes = self.planes();
        let plane = match self.config.plane {
            PlaneSource::MostConfidentThree => planes[0].or(planes[1])?,
            PlaneSource::Waves | PlaneSource::Svd => planes[1].or(planes[0])?,
        };
        for pose in &mut self.poses {
            pose.choose_nearest_to(plane.normal);
        }
        let pose = self.pose_in(&plane, &self.mesh)?;
        let fitted = LatticeField::of_mesh(&self.mesh, &pose.rotation, plane.distance);
        let naming = Naming::along_u(&fitted);
        let field = naming.of(&fitted);
        let mesh = self.mesh_along(naming.side(), field.shape().1)?;
        let pose = Pose { rotation: field.rotation(), translation: pose.translation };
        self.envelopes.extract(&field, &self.sections);
        let mut equations = NormalEquations::about(&field, FLAT);
        let agreement = self.envelopes.measure(&mut equations, &self.sections, LAST_TOLERANCE_BINS).unwrap_or_default();
        let covariance =
            self.covariance(&fitted, naming, &pose, &ParametersSquared::from_diagonal(&THESIS_VARIANCES.into()));
        self.finish(field, mesh, naming.side(), pose, planes, agreement, covariance)
    }

    /// Planes by the three most confident sections, by all, and in closed form.
    fn planes(&self) -> [Option<Plane>; 3] {
        let places = self.poses.iter().map(SectionPose::place);
        [self.plane_of_three(), Plane::fit(places).ok(), self.plane_of_waves()]
    }

    fn plane_of_three(&self) -> Option<Plane> {
        let three = most_confident_three(self.poses.iter().map(SectionPose::mean_confidence))?;
        Plane::through_points(three.map(|i| self.poses[i].place())).ok()
    }

    fn plane_of_waves(&self) -> Option<Plane> {
        let waves = self.poses.iter().map(|pose| {
            let view = &self.sections[pose.section].view;
            (pose.bins.map(|bin| view.ideal_from_bin(bin)), view.ray, 1.0)
        });
        plane_from_waves(waves, &self.mesh).ok()
    }

    /// The mesh with its sides in the order of the frame, at the given crossing angle.
    fn mesh_along(&self, x_side: Side, angle: f64) -> Option<Mesh> {
        let (first, second) = match x_side {
            Side::First => (self.mesh.side1(), self.mesh.side2()),
            Side::Second => (self.mesh.side2(), self.mesh.side1()),
        };
        Mesh::oblique(first, second, angle).ok()
    }

    /// The pose of a lattice, its origin on the optical axis.
    fn pose_of(&self, field: &LatticeField) -> Option<Pose> {
        let range = Plane { normal: field.normal, distance: field.distance(&self.mesh) }.range()?;
        Some(Pose { rotation: field.rotation(), translation: Vector3::z() * range })
    }

    /// The pose in `plane` by the side of higher total confidence (eq. 4.26 to 4.29).
    fn pose_in(&self, plane: &Plane, mesh: &Mesh) -> Option<Pose> {
        // A confidence without a rival is no better than a very good one.
        let weight = |pose: &SectionPose, side: usize| pose.confidence[side].ratio.clamp(1e-3, 10.0);
        let total = |side: usize| self.poses.iter().map(|pose| weight(pose, side)).sum::<f64>();
        let side = usize::from(total(1) > total(0));
        let sides = self.poses.iter().map(|pose| {
            let view = &self.sections[pose.section].view;
            let step = if side == 0 { pose.basis.b1 } else { pose.basis.b2 };
            SideInSection { ray: view.ray, step: view.ideal_step(step), weight: weight(pose, side) }
        });
        pose_in_plane(plane, sides, if side == 0 { 0.0 } else { mesh.angle() }).ok()
    }

    fn finish(
        &self,
        field: LatticeField,
        mesh: Mesh,
        x_side: Side,
        pose: Pose,
        planes: [Option<Plane>; 3],
        agreement: Agreement,
        covariance: PoseCovariance,
    ) -> Option<ThesisEstimate> {
        // Naming the second side first turns the angle into its supplement.
        let (ratio, angle) = field.shape();
        let (ratio, angle) = if x_side == Side::First { (ratio, angle) } else { (1.0 / ratio, PI - angle) };
        let support = Support {
            evidence: evidence(&field, &self.sections, None, 4, Reading::Here),
            sections_seeing: sections_seeing(&field, &self.sections),
            period_margin_nats: weakest_period(&field, &self.sections).0,
            second_harmonic: self.envelopes.second_harmonic(&field, &self.sections).map(|(sum, _)| sum),
            mixed_orders_nats: mixed_orders(&field, &self.envelopes, &self.sections),
            ratio_off: (ratio * self.mesh.side2() / self.mesh.side1()).ln(),
            angle_sigmas: (angle - self.mesh.angle()).to_degrees() / self.config.shape.sigma_angle_deg,
            residual_bins: agreement.residual_bins,
            misfit: agreement.misfit / f64::from(agreement.measurements.max(1)),
            measurements: agreement.measurements,
        };
        let [k1, k2] = field.waves(Vector3::z())?;
        Some(ThesisEstimate {
            pose,
            plane: pose.plane(),
            mesh,
            x_side,
            field,
            probability: probability(&support),
            covariance,
            support,
            axis_cell_area: self.camera.fx() * self.camera.fy() / k1.perp(&k2).abs(),
            plane_of_three: planes[0],
            plane_of_all: planes[1],
            plane_of_waves: planes[2],
        })
    }

    /// Of the pose, from that of the fit's six numbers; the place along the net is spread evenly over a cell.
    fn covariance(
        &self,
        fitted: &LatticeField,
        naming: Naming,
        pose: &Pose,
        parameters: &ParametersSquared,
    ) -> PoseCovariance {
        let mut derivatives = SMatrix::<f64, 6, BENT>::zeros();
        let here = self.pose_of(&naming.of(fitted));
        for k in 0..BENT {
            let mut step = Parameters::zeros();
            step[k] = DERIVATIVE_STEP;
            let near = self.pose_of(&naming.of(&moved(fitted, &step)));
            let (Some(here), Some(near)) = (&here, &near) else { continue };
            let (turn, shift) = here.perturbation_to(near);
            derivatives.fixed_view_mut::<3, 1>(0, k).copy_from(&(turn / DERIVATIVE_STEP));
            derivatives.fixed_view_mut::<3, 1>(3, k).copy_from(&(shift / DERIVATIVE_STEP));
        }
        let mut matrix = derivatives * parameters * derivatives.transpose();
        // Of a place anywhere between two nodes, a side's twelfth squared.
        let spread = self.mesh.cell_area() / 12.0;
        for axis in [pose.x_axis(), pose.y_axis()] {
            let mut place = matrix.fixed_view_mut::<3, 3>(3, 3);
            place += axis * axis.transpose() * spread;
        }
        PoseCovariance { matrix: 0.5 * (matrix + matrix.transpose()) }
    }
}

/// Probability from which on no other lattice is looked for.
const CREDIBLE: f64 = 0.5;
/// So many of the best lattices are fitted where the first is not credible.
const OTHERS: usize = 4;
/// And the odds of each of those are taken so many times: ladders and bricks get up to 12 to 1 there, nets above 200 to 1.
const LATE_ODDS: f64 = 0.05;

/// For derivatives by differences: fields are smooth over 1e-2, doubles carry 1e-16.
const DERIVATIVE_STEP: f64 = 1e-5;

/// Variances of the six numbers where sections pick for themselves and have no common fit, rad² and relative: 5 degrees and 5 %, as the thesis's tables show.
const THESIS_VARIANCES: [f64; BENT] = [0.0076, 0.0076, 0.0076, 0.0025, 0.0025, 0.0076, 0.0, 0.0, 0.0];
