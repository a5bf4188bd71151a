//! The fit to the waves of all sections, as good as they allow.

use net_geometry::Mesh;
use net_geometry::nalgebra::Vector3;

use crate::config::ThesisConfig;
use crate::envelope::{Agreement, Envelopes};
use crate::evidence::Section;
use crate::field::LatticeField;
use crate::fit::{BENT, FLAT, NormalEquations, ParametersSquared};

/// Passes of the fit to the waves of all sections, and the residuals, bins, that still count in each: wide at first, or sections that a wrong tilt serves well would hold it
/// there.
const TOLERANCES_BINS: [f64; 7] = [1.0, 0.7, 0.45, 0.3, 0.2, 0.1, 0.1];
/// Residuals that count where nothing is fitted any more, bins.
pub(crate) const LAST_TOLERANCE_BINS: f64 = TOLERANCES_BINS[TOLERANCES_BINS.len() - 1];
/// Residual, bins, from which on a fit may be one of a wrong tilt. Right ones of flat nets leave a hundredth.
const DOUBTFUL_BINS: f64 = 0.03;
/// Tilts that are tried then, as multiples of the one found: its mirror image has nearly the same waves in the middle of the picture, and what bends looks tilted.
const OTHER_TILTS: [f64; 3] = [-1.0, 0.2, 1.8];

/// The lattice with the same waves along the optical axis on a plane of so many times the tilt.
fn tilted(field: &LatticeField, factor: f64) -> Option<LatticeField> {
    let ahead = Vector3::z();
    let slope = field.normal.xy() / field.normal.z * factor;
    Some(LatticeField::through(field.waves(ahead)?, ahead, slope.push(1.0).normalize()))
}

/// A field fitted to the waves of all sections.
pub(crate) struct Fitted {
    pub(crate) field: LatticeField,
    /// How well the sections agree on it.
    pub(crate) agreement: Agreement,
    information: ParametersSquared,
}

impl Fitted {
    /// Covariance of the fit's numbers by a sandwich over sections (what one section has wrong, all its waves have), and what the waves' own errors give.
    pub(crate) fn covariance(&self) -> Option<ParametersSquared> {
        let inverse = self.information.cholesky()?.inverse();
        let sections = f64::from(self.agreement.sections);
        // Six numbers, two to a section, were fitted: what is left is that much smaller than what was there.
        let lost = sections / (sections - 3.0).max(1.0);
        Some(inverse * self.agreement.scatter * inverse * lost + inverse)
    }
}

/// What a lattice is fitted to.
pub(crate) struct Polish<'a> {
    pub(crate) sections: &'a [Section],
    pub(crate) mesh: &'a Mesh,
    pub(crate) config: &'a ThesisConfig,
}

impl Polish<'_> {
    /// Fits the field to the waves of all sections: once where they agree on it, else from other tilts too, for a fit holds on to a wrong one. Leaves the waves of the
    /// returned field in `envelopes`.
    pub(crate) fn run(&self, field: &LatticeField, envelopes: &mut Envelopes) -> Option<Fitted> {
        let mut best = self.fit_shape(field, envelopes)?;
        let steepest = self.config.search.max_tilt_deg.to_radians().cos();
        if best.agreement.residual_bins > DOUBTFUL_BINS {
            for factor in OTHER_TILTS {
                let Some(start) = tilted(field, factor) else { continue };
                let Some(other) = self.fit_shape(&start, envelopes) else { continue };
                if other.field.normal.z > steepest && other.agreement.is_clearly_better_than(&best.agreement) {
                    best = other;
                }
            }
        }
        envelopes.extract(&best.field, self.sections);
        Some(best)
    }

    /// Flat, then bent; keeps the bend if the waves ask for it.
    fn fit_shape(&self, field: &LatticeField, envelopes: &mut Envelopes) -> Option<Fitted> {
        let flat = self.fit_waves(field, FLAT, envelopes)?;
        if self.config.shape.sigma_curvature_per_m == 0.0 {
            return Some(flat);
        }
        let Some(bent) = self.fit_waves(&flat.field, BENT, envelopes) else { return Some(flat) };
        // Bayesian information criterion: three numbers more must earn their keep. (Misfits are twice a logarithm of likelihood.)
        let price = 3.0 * f64::from(flat.agreement.measurements).ln();
        Some(if bent.agreement.gain_over(&flat.agreement) > price { bent } else { flat })
    }

    fn fit_waves(&self, field: &LatticeField, fitted: usize, envelopes: &mut Envelopes) -> Option<Fitted> {
        let mut field = *field;
        for (pass, tolerance) in TOLERANCES_BINS.into_iter().enumerate() {
            envelopes.extract(&field, self.sections);
            let mut equations = NormalEquations::about(&field, fitted);
            let agreement = envelopes.measure(&mut equations, self.sections, tolerance)?;
            equations.add_shape(self.mesh, &self.config.shape);
            if fitted == BENT {
                equations.add_bend(self.mesh, &self.config.shape);
            }
            if pass + 1 == TOLERANCES_BINS.len() {
                return Some(Fitted { field, agreement, information: equations.matrix });
            }
            field = equations.solve(0.3)?;
        }
        None
    }
}
