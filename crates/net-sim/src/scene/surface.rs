use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, within};

/// How a net bends: its height `z = h(X, Y)` over its nominal plane, `Z` away from the camera. Default flat.
///
/// `h` is a polynomial from second to fourth order without constant or linear part, so the nominal plane is the tangent plane at
/// the net's origin, plus waves (which tilt it there). Twine does not stretch: unless `isometric` is off, the knots are laid on the
/// surface so that every side keeps its length and the crossing angle yields (a Chebyshev net, Chebyshev 1878).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Surface {
    /// `[h_XX, h_XY, h_YY]` at the origin, 1/m: positive curves away from the camera at the sides.
    pub curvature_per_m: [f64; 3],
    /// Coefficients of `X³, X²Y, XY², Y³`, 1/m².
    pub cubic_per_m2: [f64; 4],
    /// Coefficients of `X⁴, X³Y, X²Y², XY³, Y⁴`, 1/m³.
    pub quartic_per_m3: [f64; 5],
    /// Distance from the origin, m, beyond which the polynomial levels off: a polynomial grows without bound, a net does not. It
    /// is taken at `(X, Y) / sqrt(1 + (X² + Y²) / reach²)`. Default 2.
    pub reach_m: f64,
    /// Waves and bellies.
    pub waves: Vec<Wave>,
    /// How the first and second thread through the origin turn in the net's plane, 1/m: their headings change by this per metre, and
    /// the crossing angle with them. Default 0.
    pub thread_bend_per_m: [f64; 2],
    /// Whether sides keep their length. Default true. Off: knots of the flat lattice are lifted straight up, which stretches
    /// twine (sagging rubber rather than a net) but makes a quick and simple deviation from a plane.
    pub isometric: bool,
}

impl Default for Surface {
    fn default() -> Self {
        Self {
            curvature_per_m: [0.0; 3],
            cubic_per_m2: [0.0; 4],
            quartic_per_m3: [0.0; 5],
            reach_m: 2.0,
            waves: Vec::new(),
            thread_bend_per_m: [0.0; 2],
            isometric: true,
        }
    }
}

impl Surface {
    /// Whether it is a plane with straight threads.
    pub fn is_flat(&self) -> bool {
        let zero = |x: &[f64]| x.iter().all(|&c| c == 0.0);
        self.is_level() && (zero(&self.thread_bend_per_m) || !self.isometric)
    }

    /// Whether its height is zero everywhere.
    pub(crate) fn is_level(&self) -> bool {
        let zero = |x: &[f64]| x.iter().all(|&c| c == 0.0);
        zero(&self.curvature_per_m)
            && zero(&self.cubic_per_m2)
            && zero(&self.quartic_per_m3)
            && self.waves.iter().all(|w| w.amplitude_m == 0.0)
    }

    pub(crate) fn validate(&self) -> Result<()> {
        let expected = "within ±100";
        for &value in &self.curvature_per_m {
            within("net.surface.curvature_per_m", value, -100.0, 100.0, expected)?;
        }
        for &value in &self.cubic_per_m2 {
            within("net.surface.cubic_per_m2", value, -100.0, 100.0, expected)?;
        }
        for &value in &self.quartic_per_m3 {
            within("net.surface.quartic_per_m3", value, -100.0, 100.0, expected)?;
        }
        for &value in &self.thread_bend_per_m {
            within("net.surface.thread_bend_per_m", value, -10.0, 10.0, "within ±10 per metre")?;
        }
        within("net.surface.reach_m", self.reach_m, 0.01, 1e3, "metres between 0.01 and 1000")?;
        if self.waves.len() > 64 {
            let value = self.waves.len() as f64;
            return Err(Error::Value { field: "net.surface.waves", value, expected: "at most 64 waves" });
        }
        self.waves.iter().try_for_each(Wave::validate)
    }
}

/// A wave: `amplitude sin(2 pi s / length + phase)`, `s` along its direction; less its value at the origin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Wave {
    /// Height, m. Default 0.02.
    pub amplitude_m: f64,
    /// Crest to crest, m. Default 1.5.
    pub length_m: f64,
    /// Direction in the net's plane from X to Y, degrees. Default 0.
    pub direction_deg: f64,
    /// Phase at the origin, degrees. 90 puts a crest there: a belly. Default 0.
    pub phase_deg: f64,
}

impl Default for Wave {
    fn default() -> Self {
        Self { amplitude_m: 0.02, length_m: 1.5, direction_deg: 0.0, phase_deg: 0.0 }
    }
}

impl Wave {
    fn validate(&self) -> Result<()> {
        within("net.surface.waves.amplitude_m", self.amplitude_m, -1.0, 1.0, "metres within ±1")?;
        within("net.surface.waves.length_m", self.length_m, 0.05, 1e3, "metres between 0.05 and 1000")?;
        within("net.surface.waves.direction_deg", self.direction_deg, -360.0, 360.0, "degrees within ±360")?;
        within("net.surface.waves.phase_deg", self.phase_deg, -360.0, 360.0, "degrees within ±360")
    }
}
