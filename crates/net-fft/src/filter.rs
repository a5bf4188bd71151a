//! Which peaks are worth a look: half plane, ellipse, falling threshold (thesis 4.3.2 and 4.3.3, mended).

use net_geometry::nalgebra::Vector2;

use crate::error::{Error, Result};
use crate::peaks::Peak;

/// The ellipse round the constant bin within which peaks count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    /// Half axis along u, bins (`r_h`).
    pub horizontal_bins: f64,
    /// Half axis along v, bins (`r_v`).
    pub vertical_bins: f64,
}

impl Ellipse {
    /// How far `bin` lies on the way from the centre to the edge: 0 in the centre, 1 on the edge. Eq. 4.11 with the squares that its print
    /// lacks: `s = sqrt(r_v² x² + r_h² y²) / (r_h r_v)`.
    #[inline]
    pub fn fraction(&self, bin: Vector2<f64>) -> f64 {
        // Bins are far from the ends of what a double holds: `hypot`'s care costs more than all else here.
        let (x, y) = (bin.x / self.horizontal_bins, bin.y / self.vertical_bins);
        (x * x + y * y).sqrt()
    }
}

/// Which peaks pass.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FilterConfig {
    /// Radius of the ellipse, cycles per pixel. Default 0.35: cells of three pixels still count. The thesis does not give its value; 0.25 and, close to the
    /// net, 0.12 reproduce its figures.
    pub radius_cycles_per_px: f64,
    /// Peaks nearer to the constant bin than this are shading, not net, bins. Default 2, the half width of a peak under the Hann window.
    pub constant_radius_bins: f64,
    /// With it, a peak's level must reach a threshold that falls linearly from so many levels below the centre's to the image's mean at the ellipse
    /// (eq. 4.12). The thesis takes 40 and, close to the net, 60. Default none: against a flattened spectrum the threshold is level.
    pub margin_levels: Option<f64>,
}

impl Default for FilterConfig {
    fn default() -> Self {
        Self { radius_cycles_per_px: 0.35, constant_radius_bins: 2.0, margin_levels: None }
    }
}

impl FilterConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the field.
    pub fn validate(&self) -> Result<()> {
        let value = self.radius_cycles_per_px;
        if !(value > 0.0 && value <= 0.5) {
            return Err(Error::Parameter { field: "radius_cycles_per_px", value, expected: "above 0, at most 0.5" });
        }
        let value = self.constant_radius_bins;
        if !(value >= 0.0 && value.is_finite()) {
            return Err(Error::Parameter { field: "constant_radius_bins", value, expected: "0 bins or more" });
        }
        if let Some(value) = self.margin_levels
            && !value.is_finite()
        {
            return Err(Error::Parameter { field: "margin_levels", value, expected: "a finite number of levels" });
        }
        Ok(())
    }
}

/// The level that a peak must reach, falling from the centre to the edge of the ellipse: `max - (max - min) s`, eq. 4.12 with its sign put right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FallingThreshold {
    /// Level in the centre (`max_thres`): the spectrum's there, less a margin.
    pub centre: f64,
    /// Level at the ellipse (`min_thres`): the spectrum's mean.
    pub edge: f64,
}

impl FallingThreshold {
    /// The threshold at the fraction `s` of the way to the ellipse.
    #[inline]
    pub fn at(&self, s: f64) -> f64 {
        self.centre - (self.centre - self.edge) * s
    }
}

/// Keeps of every pair `±bin` the one right of the constant bin, inside the ellipse (eq. 4.6), outside `constant_radius_bins`, and above the threshold if there is one.
pub fn filter_peaks(
    peaks: &[Peak],
    ellipse: &Ellipse,
    constant_radius_bins: f64,
    threshold: Option<FallingThreshold>,
    out: &mut Vec<Peak>,
) {
    out.clear();
    out.extend(peaks.iter().copied().filter(|peak| {
        let s = ellipse.fraction(peak.bin);
        let right_half = peak.bin.x > 0.0 || (peak.bin.x == 0.0 && peak.bin.y > 0.0);
        right_half
            && s < 1.0
            && peak.bin.norm() > constant_radius_bins
            && threshold.is_none_or(|threshold| peak.level >= threshold.at(s))
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ELLIPSE: Ellipse = Ellipse { horizontal_bins: 40.0, vertical_bins: 20.0 };

    fn peak(x: f64, y: f64, level: f64) -> Peak {
        Peak { bin: Vector2::new(x, y), level }
    }

    #[test]
    fn the_edge_is_at_one_in_every_direction() {
        for degrees in 0..360 {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let s = ELLIPSE.fraction(Vector2::new(40.0 * cos, 20.0 * sin));
            assert!((s - 1.0).abs() < 1e-12, "{degrees} degrees: {s}");
        }
    }

    #[test]
    fn the_threshold_falls_from_the_centre_to_the_mean() {
        let threshold = FallingThreshold { centre: 200.0, edge: 80.0 };
        assert_eq!((threshold.at(0.0), threshold.at(0.5), threshold.at(1.0)), (200.0, 140.0, 80.0));
        let peaks = [peak(10.0, 0.0, 165.0), peak(10.0, 0.0, 175.0), peak(38.0, 0.0, 90.0)];
        let mut out = Vec::new();
        filter_peaks(&peaks, &ELLIPSE, 2.0, Some(threshold), &mut out);
        assert_eq!(out, [peaks[1], peaks[2]]);
    }

    proptest! {
        #[test]
        fn of_a_mirrored_pair_one_stays(x in -50.0..50.0f64, y in -50.0..50.0f64) {
            let bin = Vector2::new(x, y);
            let mut out = Vec::new();
            filter_peaks(&[peak(x, y, 1.0), peak(-x, -y, 1.0)], &ELLIPSE, 2.0, None, &mut out);
            let inside = ELLIPSE.fraction(bin) < 1.0 && bin.norm() > 2.0;
            prop_assert_eq!(out.len(), usize::from(inside));
        }
    }
}
