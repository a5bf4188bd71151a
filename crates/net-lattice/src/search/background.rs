//! What hypotheses score that are not there: fish and shadows have power at long waves wherever one looks, so a score says little by itself.

use net_geometry::nalgebra::{Rotation3, Vector3};

use crate::numeric::median;
use crate::search::score::score;
use crate::search::spectra::Bank;
use crate::search::table::{Candidate, NOTHING, Scope, Search};

/// Median and spread of such scores by depth.
#[derive(Debug, Default)]
pub(crate) struct Background {
    /// Natural logarithm of the nearest depth, m.
    first: f64,
    /// Median and standard deviation in half octaves from there.
    bands: Vec<(f64, f64)>,
    scores: Vec<f64>,
}

impl Background {
    const BAND: f64 = 0.5 * std::f64::consts::LN_2;

    pub(crate) fn measure(&mut self, search: &Search, bank: &Bank, scale: f64, scope: &Scope) {
        let (near, far) = search.depths_m(scope.sides[0]);
        self.first = near.ln();
        self.bands.clear();
        let count = ((far.ln() - self.first) / Self::BAND).ceil() as usize;
        for band in 0..count.max(1) {
            self.scores.clear();
            let mut golden = 0.5;
            for r in search.normals.iter().step_by(2) {
                golden = (golden + 0.618_034) % 1.0;
                let depth = (self.first + (band as f64 + golden) * Self::BAND).exp();
                for k in 0..2 {
                    let roll = std::f64::consts::PI * ((golden * 7.0 + 0.5 * f64::from(k)) % 1.0);
                    let rotation = r * Rotation3::new(Vector3::new(0.0, 0.0, roll)).into_inner();
                    let score = score(
                        bank,
                        scale,
                        scope,
                        &Candidate { score: 0.0, above: 0.0, rotation, depth, angle: scope.angle },
                    );
                    if score > f64::from(NOTHING) {
                        self.scores.push(score);
                    }
                }
            }
            let middle = median(&mut self.scores);
            self.scores.iter_mut().for_each(|s| *s = (*s - middle).abs());
            self.bands.push((middle, 1.4826 * median(&mut self.scores)));
        }
    }

    /// Score in standard deviations of what is not there.
    pub(crate) fn above(&self, c: &Candidate) -> f64 {
        let band = ((c.depth.ln() - self.first) / Self::BAND).clamp(0.0, (self.bands.len() - 1) as f64);
        let (middle, spread) = self.bands[band as usize];
        (c.score - middle) / spread.max(1.0)
    }
}
