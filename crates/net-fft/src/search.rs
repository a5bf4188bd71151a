//! From the candidates of single sections to one lattice that all sections bear out.
//!
//! A pair of wave vectors in one section leaves the plane open. So every pair is tried with planes of all tilts: each foretells the wave vectors of the neighbouring sections,
//! and of all those planes one, of all those pairs the right ones, find them there.

use net_geometry::Mesh;
use net_geometry::nalgebra::{Vector2, Vector3};

use crate::error::{Error, Result};
use crate::evidence::{Evidence, Reading, Section, evidence, preference};
use crate::field::LatticeField;
use crate::fit::{FLAT, NormalEquations, ShapeConfig, shape_misfit};
use crate::measure::measure_peaks;

/// How hard to look.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SearchConfig {
    /// So many of a section's best candidates are paired. Default 8.
    pub candidates_per_section: usize,
    /// So many pairs of a section are tried. Default 4.
    pub pairs_per_section: usize,
    /// So many pairs in all. Default 24.
    pub pairs: usize,
    /// So many lattices are fitted to all sections before the search gives up. Default 12.
    pub fits: usize,
    /// Wave vectors at less than this angle are no pair, degrees. Default 25: a square cell at 60 degrees of tilt along its diagonal.
    pub min_angle_deg: f64,
    /// Steepest tilt that is tried, degrees. Default 65.
    pub max_tilt_deg: f64,
}

impl Default for SearchConfig {
    fn default() -> Self {
        Self {
            candidates_per_section: 8,
            pairs_per_section: 4,
            pairs: 24,
            fits: 12,
            min_angle_deg: 25.0,
            max_tilt_deg: 65.0,
        }
    }
}

impl SearchConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the field.
    pub fn validate(&self) -> Result<()> {
        for (field, value) in [
            ("candidates_per_section", self.candidates_per_section),
            ("pairs_per_section", self.pairs_per_section),
            ("pairs", self.pairs),
            ("fits", self.fits),
        ] {
            // A search for nothing finds no net in any picture.
            if value == 0 {
                return Err(Error::Parameter { field, value: 0.0, expected: "1 or more" });
            }
        }
        for (field, value, most) in
            [("min_angle_deg", self.min_angle_deg, 90.0), ("max_tilt_deg", self.max_tilt_deg, 80.0)]
        {
            if !(value >= 0.0 && value <= most) {
                return Err(Error::Parameter {
                    field,
                    value,
                    expected: "0 or more, at most 90 (angle) or 80 (tilt) degrees",
                });
            }
        }
        Ok(())
    }
}

/// Step between the normals that are tried, rad: half of it is bridged by the width of the peaks' neighbourhood.
const NORMAL_STEP: f64 = 0.19;
/// Sections at most so far (tangent of the angle) from a pair's own judge the planes it is tried with: farther ones need a better normal first.
const NEAR_REACH: f64 = 0.45;
/// Shape of a cell as a pair and a plane of the grid give it: ratio of the sides and crossing angle, one standard deviation.
const COARSE_SHAPE: (f64, f64) = (0.12, 0.21);
/// Sides whose ratio is farther from the mesh's than this are those of another period, relative.
const CLEAR_RATIO: f64 = 0.05;
/// Mean log-likelihood ratio per harmonic of both families that ends the search.
const DECISIVE: f64 = 1.8;

/// A lattice, and what the sections say of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hypothesis {
    /// The lattice, fitted to the peaks of all sections.
    pub field: LatticeField,
    /// Evidence of all sections.
    pub evidence: Evidence,
    /// Evidence less what its shape costs.
    pub total: f64,
    /// Root mean square distance of the peaks from where the lattice has them, bins.
    pub residual_bins: f64,
}

/// Two candidates of one section.
#[derive(Debug, Clone, Copy)]
struct Pair {
    section: usize,
    /// Indices among the section's candidates.
    candidates: [usize; 2],
    value: f64,
    ideal: [Vector2<f64>; 2],
}

/// Search with its buffers.
#[derive(Debug, Clone, Default)]
pub(crate) struct Search {
    normals: Vec<Vector3<f64>>,
    own: Vec<Pair>,
    pairs: Vec<Pair>,
    planes: Vec<(f64, usize, LatticeField)>,
    found: Vec<Hypothesis>,
    /// Planes looked at, and lattices fitted, in the last run.
    tried: usize,
    fits: usize,
}

impl Search {
    pub(crate) fn new(config: &SearchConfig, sections: usize) -> Self {
        let mut normals = vec![Vector3::z()];
        let rings = (config.max_tilt_deg.to_radians() / NORMAL_STEP) as usize;
        for ring in 1..=rings {
            let tilt = ring as f64 * NORMAL_STEP;
            let count = (std::f64::consts::TAU * tilt.sin() / NORMAL_STEP).round();
            for index in 0..count as usize {
                // Every ring starts elsewhere, so that no direction is preferred.
                let azimuth = (index as f64 + 0.38 * ring as f64) / count * std::f64::consts::TAU;
                normals.push(Vector3::new(tilt.sin() * azimuth.cos(), tilt.sin() * azimuth.sin(), tilt.cos()));
            }
        }
        let candidates = config.candidates_per_section.min(64);
        Self {
            normals,
            own: Vec::with_capacity(candidates * candidates / 2),
            pairs: Vec::with_capacity(sections * config.pairs_per_section.min(64)),
            planes: Vec::with_capacity(2 * config.pairs.min(1024)),
            found: Vec::with_capacity(config.fits.min(64) + 4),
            ..Self::default()
        }
    }

    /// Lattices that were fitted, best first: until one stands out everywhere.
    pub(crate) fn run(
        &mut self,
        sections: &[Section],
        mesh: &Mesh,
        shape: &ShapeConfig,
        config: &SearchConfig,
    ) -> &[Hypothesis] {
        self.collect_pairs(sections, config);
        self.try_planes(sections, mesh);
        self.found.clear();
        (self.fits, self.tried) = (0, 0);
        self.fit_planes(sections, mesh, shape, config, true);
        self.settle_period(sections, mesh, shape);
        &self.found
    }

    /// Where the first of [`Self::run`] turned out to be wrong: all that were not fitted before, best of all first.
    pub(crate) fn go_on(
        &mut self,
        sections: &[Section],
        mesh: &Mesh,
        shape: &ShapeConfig,
        config: &SearchConfig,
    ) -> &[Hypothesis] {
        self.fit_planes(sections, mesh, shape, config, false);
        &self.found
    }

    fn fit_planes(
        &mut self,
        sections: &[Section],
        mesh: &Mesh,
        shape: &ShapeConfig,
        config: &SearchConfig,
        until_decisive: bool,
    ) {
        while self.tried < self.planes.len() && self.fits < config.fits {
            let (_, pair, field) = self.planes[self.tried];
            self.tried += 1;
            let ray = sections[self.pairs[pair].section].view.ray;
            if self.found.iter().any(|known| same_waves(&known.field, &field, ray)) {
                continue;
            }
            self.fits += 1;
            let Some(hypothesis) = refine(&field, sections, mesh, shape, Some(ray.xy())) else { continue };
            let ratio_off = shape_misfit(&hypothesis.field, mesh, CLEAR_RATIO, f64::INFINITY);
            let decisive = is_decisive(&hypothesis.evidence) && ratio_off < 1.0;
            self.found.push(hypothesis);
            if decisive && until_decisive {
                break;
            }
        }
        // A handful, and stable on so few without a buffer.
        self.found.sort_by(|a, b| b.total.total_cmp(&a.total));
    }

    /// What the last run found.
    pub(crate) fn found(&self) -> &[Hypothesis] {
        &self.found
    }

    /// The best pairs of all sections.
    fn collect_pairs(&mut self, sections: &[Section], config: &SearchConfig) {
        let smallest_sine = config.min_angle_deg.to_radians().sin();
        self.pairs.clear();
        for (section, seen) in sections.iter().enumerate() {
            let candidates = &seen.spectrum.candidates();
            let candidates = &candidates[..candidates.len().min(config.candidates_per_section)];
            self.own.clear();
            for (index, first) in candidates.iter().enumerate() {
                for (other, second) in candidates.iter().enumerate().skip(index + 1) {
                    let (mut a, mut b) = (seen.view.ideal_from_bin(first.bin), seen.view.ideal_from_bin(second.bin));
                    let sine = a.perp(&b) / (a.norm() * b.norm());
                    if sine.abs() < smallest_sine {
                        continue;
                    }
                    if sine < 0.0 {
                        std::mem::swap(&mut a, &mut b);
                    }
                    self.own.push(Pair {
                        section,
                        candidates: [index, other],
                        value: first.value() + second.value(),
                        ideal: [a, b],
                    });
                }
            }
            self.own.sort_unstable_by(by_value);
            self.pairs.extend(self.own.iter().take(config.pairs_per_section));
        }
        self.pairs.sort_unstable_by(by_value);
        self.pairs.truncate(config.pairs);
    }

    /// For each pair the two planes that its neighbours like best; the best of all first.
    fn try_planes(&mut self, sections: &[Section], mesh: &Mesh) {
        // A square looks the same from all four sides; of other meshes either vector may be the first side's.
        let is_square = mesh.is_right_angled() && mesh.side1() == mesh.side2();
        self.planes.clear();
        for (index, pair) in self.pairs.iter().enumerate() {
            let ray = sections[pair.section].view.ray;
            let [a, b] = pair.ideal;
            let mut best: [Option<(f64, LatticeField)>; 2] = [None, None];
            for ideal in [[a, b], [b, -a]].into_iter().take(if is_square { 1 } else { 2 }) {
                for &normal in &self.normals {
                    if normal.dot(&ray) < 0.35 * ray.norm() {
                        continue;
                    }
                    let field = LatticeField::through(ideal, ray, normal);
                    let misfit = shape_misfit(&field, mesh, COARSE_SHAPE.0, COARSE_SHAPE.1);
                    if misfit > 9.0 {
                        continue;
                    }
                    let found = evidence(&field, sections, Some((ray.xy(), NEAR_REACH)), 2, Reading::Around);
                    let total = found.total() - 0.5 * misfit;
                    if best[0].is_none_or(|(other, _)| total > other) {
                        best = [Some((total, field)), best[0]];
                    } else if best[1].is_none_or(|(other, _)| total > other) {
                        best[1] = Some((total, field));
                    }
                }
            }
            self.planes.extend(best.into_iter().flatten().map(|(total, field)| (total, index, field)));
        }
        self.planes.sort_unstable_by(|a, b| {
            b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)).then(b.2.normal.x.total_cmp(&a.2.normal.x))
        });
    }

    /// Moves the best to the period that the sections prefer.
    fn settle_period(&mut self, sections: &[Section], mesh: &Mesh, shape: &ShapeConfig) {
        for _ in 0..3 {
            let Some(best) = self.found.first().copied() else { return };
            let (margin, (numerator, denominator)) = weakest_period(&best.field, sections);
            if margin >= 0.0 {
                return;
            }
            let factor = f64::from(numerator) / f64::from(denominator);
            let field = best.field.scaled(factor);
            let Some(better) = refine(&field, sections, mesh, shape, None) else { return };
            self.found.insert(0, better);
        }
    }
}

/// Periods that are mistaken for one another: the rival's wave vectors are so many times the field's.
const PERIODS: [(u32, u32); 8] = [(2, 1), (1, 2), (3, 1), (1, 3), (3, 2), (2, 3), (4, 1), (1, 4)];

/// Best first; ties in the order of sections and candidates, so that the result is one and the same everywhere.
fn by_value(a: &Pair, b: &Pair) -> std::cmp::Ordering {
    b.value.total_cmp(&a.value).then(a.section.cmp(&b.section)).then(a.candidates.cmp(&b.candidates))
}

/// The period that rivals the field's most: how much the sections prefer the field to it, and the ratio of wave vectors.
pub(crate) fn weakest_period(field: &LatticeField, sections: &[Section]) -> (f64, (u32, u32)) {
    let mut weakest = (f64::INFINITY, (1, 1));
    for (numerator, denominator) in PERIODS {
        let margin = preference(field, sections, numerator, denominator);
        if margin < weakest.0 {
            weakest = (margin, (numerator, denominator));
        }
    }
    weakest
}

fn is_decisive(found: &Evidence) -> bool {
    found.families.iter().zip(found.terms).all(|(&sum, terms)| terms >= 10 && sum > DECISIVE * f64::from(terms))
}

/// Whether two fields have the same two wave vectors along `ray`, to five percent, in either order and of either sign.
fn same_waves(a: &LatticeField, b: &LatticeField, ray: Vector3<f64>) -> bool {
    let (Some(a), Some(b)) = (a.waves(ray), b.waves(ray)) else { return false };
    let near = |p: Vector2<f64>, q: Vector2<f64>| (p - q).norm().min((p + q).norm()) < 0.05 * p.norm();
    (near(a[0], b[0]) && near(a[1], b[1])) || (near(a[0], b[1]) && near(a[1], b[0]))
}

/// Fits the field to the peaks of the sections near `start` first, then to those of all, and weighs it.
pub(crate) fn refine(
    field: &LatticeField,
    sections: &[Section],
    mesh: &Mesh,
    shape: &ShapeConfig,
    start: Option<Vector2<f64>>,
) -> Option<Hypothesis> {
    let mut field = *field;
    let mut residual_bins = f64::INFINITY;
    let near = start.map(|ray| (ray, NEAR_REACH));
    let passes = [(near, 3.0), (near, 2.0), (None, 2.5), (None, 2.0), (None, 1.5)];
    for (near, radius) in passes.into_iter().skip(if start.is_some() { 0 } else { 2 }) {
        let mut equations = NormalEquations::about(&field, FLAT);
        residual_bins = measure_peaks(&mut equations, sections, near, radius)?;
        equations.add_shape(mesh, shape);
        field = equations.solve(0.4)?;
    }
    let evidence = evidence(&field, sections, None, 4, Reading::Here);
    let misfit = shape_misfit(&field, mesh, 3.0 * shape.sigma_ratio, shape.sigma_angle_deg.to_radians());
    Some(Hypothesis { field, evidence, total: evidence.total() - 0.5 * misfit, residual_bins })
}
