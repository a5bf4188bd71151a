//! Which sheet the tiles support: flat square, flat rhomb, quadratic, cubic, quartic, or quartic with threads bent in the plane.

use crate::sheet::fit::{Fit, Fitter, Observation, Prior, Robust};
use crate::sheet::surface::Surface;

/// How much of the sheet is estimated. Every model contains the ones before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Model {
    /// Flat, sides crossing at the mesh's nominal angle: 6 parameters.
    Square,
    /// Flat, crossing angle free: 7.
    Rhomb,
    /// Quadratic height: 10.
    Quadratic,
    /// Cubic: 14.
    Cubic,
    /// Quartic: 19.
    Quartic,
    /// Quartic, and twines curved within the sheet: 21.
    Bent,
    /// Quadratic, twines curved within the sheet, and bumps: 12, and the bumps' own.
    Bumpy,
}

impl Model {
    /// Those that are chosen among, stiffest first.
    pub const ALL: [Self; 6] = [Self::Square, Self::Rhomb, Self::Quadratic, Self::Cubic, Self::Quartic, Self::Bent];

    /// Number of parameters, bumps aside.
    pub fn parameters(self) -> usize {
        match self {
            Self::Square => 6,
            Self::Rhomb => 7,
            Self::Quadratic => 10,
            Self::Cubic => 14,
            Self::Quartic => 19,
            Self::Bent | Self::Bumpy => 21,
        }
    }
}

/// A model fitted to the tiles.
#[derive(Debug, Clone)]
pub(crate) struct Choice {
    pub model: Model,
    pub fit: Fit,
}

/// Fits every model to the same observations and keeps the one with the least Bayesian information criterion (Cauchy cost).
///
/// `alike`: tiles whose residuals are one and the same: they count as one. Taken for as many, they would have any unevenness of the twine pass for a bend.
pub(crate) fn choose(
    fitter: &mut Fitter,
    start: &Surface,
    observations: &[Observation],
    prior: &Prior,
    alike: f64,
    scratch: &mut Vec<f64>,
) -> Option<Choice> {
    let mut best: Option<(f64, Choice)> = None;
    for model in Model::ALL.into_iter().rev() {
        let count = model.parameters();
        let from = start.truncated(count, prior.angle);
        let Some(fit) = fitter.fit(&from, count, observations, Robust::Tile(0.08), prior, 6) else { continue };
        // Residuals are those before the last step; six steps are past convergence.
        let whitened = fitter.whiten(observations);
        let n = 2 * whitened.len();
        if n < count + 6 {
            continue;
        }
        let scale = robust_scale(whitened, scratch);
        let cost: f64 =
            whitened.iter().map(|s| 2.0 * (0.25 * (s / scale).powi(2)).ln_1p()).sum::<f64>() + n as f64 * scale.ln();
        let bic = 2.0 * cost / alike + count as f64 * (n as f64 / alike).ln();
        if best.as_ref().is_none_or(|(b, _)| bic < *b) {
            best = Some((bic, Choice { model, fit }));
        }
    }
    best.map(|b| b.1)
}

/// Scale of two-component whitened residuals by a Cauchy-type iteration from their median. `scratch` is overwritten.
pub(crate) fn robust_scale(whitened: &[f64], scratch: &mut Vec<f64>) -> f64 {
    scratch.clear();
    scratch.extend_from_slice(whitened);
    let mut s = crate::numeric::median(scratch) + 1e-9;
    for _ in 0..20 {
        let (mut sum, mut weight) = (0.0, 1e-9);
        for x in whitened {
            let w = 1.0 / (1.0 + (x / (2.0 * s)).powi(2));
            sum += w * x * x;
            weight += w;
        }
        s = (sum / weight / 2.0).sqrt() + 1e-9;
    }
    s
}
