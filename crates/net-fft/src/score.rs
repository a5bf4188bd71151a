//! Which peaks are the lattice's own: peak, beam and repeated pattern (thesis Algorithm 3, mended), and a fourth part against sub-multiples.

use net_geometry::nalgebra::Vector2;
use net_image::View;

use crate::error::{Error, Result};
use crate::filter::Ellipse;
use crate::peaks::Peak;

/// Weights and reach of Algorithm 3.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScoreConfig {
    /// Weight `k1` of the peak's own level above the mean. Default 1.5 (thesis 5.1.2).
    pub peak_weight: f64,
    /// Weight `k2` of the mean level of the beam from the centre through the peak to the ellipse. Default 2 (thesis 5.1.2).
    pub beam_weight: f64,
    /// Weight `k3` of the peaks found at the multiples. Default 1 (thesis 5.1.2).
    pub pattern_weight: f64,
    /// Weight `k4` of multiples that are missing: half or a third of a wave vector finds the whole one's peaks at every second or third multiple, and nothing
    /// between. Default 2; the thesis has none (0), and takes 1.2 m for 0.48 m.
    pub absent_weight: f64,
    /// What each further multiple counts, as a fraction of the one before. Default 0.9 (not given in the thesis).
    pub decay: f64,
    /// A multiple is found when a peak lies within this distance of where it should be, bins. Default 2.5 (not given in the thesis).
    pub search_radius_bins: f64,
    /// Highest multiple that is searched. Default 9.
    pub max_multiple: u32,
    /// So many of the strongest peaks are tried. Default 20 (thesis 5.2.1).
    pub max_peaks: usize,
    /// Width of the beam, bins. Default 3 (thesis 4.3.4).
    pub beam_width_bins: u32,
}

impl Default for ScoreConfig {
    fn default() -> Self {
        Self {
            peak_weight: 1.5,
            beam_weight: 2.0,
            pattern_weight: 1.0,
            absent_weight: 2.0,
            decay: 0.9,
            search_radius_bins: 2.5,
            max_multiple: 9,
            max_peaks: 20,
            beam_width_bins: 3,
        }
    }
}

impl ScoreConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the field.
    pub fn validate(&self) -> Result<()> {
        let weights = [
            ("peak_weight", self.peak_weight),
            ("beam_weight", self.beam_weight),
            ("pattern_weight", self.pattern_weight),
            ("absent_weight", self.absent_weight),
            ("decay", self.decay),
            ("search_radius_bins", self.search_radius_bins),
        ];
        for (field, value) in weights {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::Parameter { field, value, expected: "a finite number, 0 or more" });
            }
        }
        if self.max_peaks == 0 {
            return Err(Error::Parameter { field: "max_peaks", value: 0.0, expected: "1 or more" });
        }
        Ok(())
    }
}

/// A peak that may be one of the lattice's two wave vectors, and what speaks for it. All parts carry their weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Index of the peak it started from.
    pub peak_index: usize,
    /// The wave vector, bins, refined by its multiples: those at `n` times the vector have `1/n` of its error, so they weigh `n²` (eq. 4.13 mended).
    pub bin: Vector2<f64>,
    /// `k1` x level above the mean.
    pub peak: f64,
    /// `k2` x mean level of the beam above the mean.
    pub beam: f64,
    /// `k3` x levels above the mean of the multiples found, each less than the one before.
    pub pattern: f64,
    /// `-k4` x how far its multiples fall short of every second or third of them; 0 when they do not.
    pub absent: f64,
    /// Highest multiple found; 1 is the peak itself.
    pub multiples: u32,
}

impl Candidate {
    /// The total value.
    pub fn value(&self) -> f64 {
        self.peak + self.beam + self.pattern + self.absent
    }
}

/// Algorithm 3: values of the strongest `peaks` of `image` (whose constant bin lies at `constant_bin`) into `out`, best first. `mean` is the level from which all
/// levels count: the mean of the image, or the background of a flattened one. `order` is scratch.
pub fn score_peaks(
    image: View<'_, u8>,
    constant_bin: (usize, usize),
    peaks: &[Peak],
    ellipse: &Ellipse,
    mean: f64,
    config: &ScoreConfig,
    order: &mut Vec<usize>,
    out: &mut Vec<Candidate>,
) {
    order.clear();
    order.extend(0..peaks.len());
    // Ties keep the order of the peaks, so that the result is one and the same everywhere.
    order.sort_unstable_by(|&a, &b| peaks[b].level.total_cmp(&peaks[a].level).then(a.cmp(&b)));
    let levels = Levels { image, constant_bin, mean };
    out.clear();
    for &peak_index in order.iter().take(config.max_peaks) {
        let first = peaks[peak_index];
        let mut candidate = Candidate {
            peak_index,
            bin: first.bin,
            peak: config.peak_weight * (first.level - mean),
            beam: config.beam_weight * levels.beam(first.bin, ellipse, config.beam_width_bins),
            pattern: 0.0,
            absent: 0.0,
            multiples: 1,
        };
        // Sums of n p_n and of n²: the refined vector is their quotient.
        let (mut sum, mut weight, mut scale) = (first.bin, 1.0, config.pattern_weight);
        for n in 2..=config.max_multiple {
            let expected = candidate.bin * f64::from(n);
            let near = peaks.iter().filter(|peak| (peak.bin - expected).norm() <= config.search_radius_bins);
            let Some(found) = near.max_by(|a, b| a.level.total_cmp(&b.level)) else { break };
            candidate.pattern += scale * (found.level - mean);
            candidate.multiples = n;
            scale *= config.decay;
            sum += found.bin * f64::from(n);
            weight += f64::from(n * n);
            candidate.bin = sum / weight;
        }
        candidate.absent = -config.absent_weight * levels.shortfall(candidate.bin, ellipse);
        out.push(candidate);
    }
    out.sort_unstable_by(|a, b| b.value().total_cmp(&a.value()).then(a.peak_index.cmp(&b.peak_index)));
}

struct Levels<'a> {
    image: View<'a, u8>,
    constant_bin: (usize, usize),
    mean: f64,
}

impl Levels<'_> {
    /// Highest level above the mean within a bin of `bin`, or of its mirror image where the image shows only that. `None` beyond the image.
    fn highest_near(&self, bin: Vector2<f64>) -> Option<f64> {
        let bin = if bin.x < 0.0 { -bin } else { bin };
        let (u, v) = (
            bin.x.round() as isize + self.constant_bin.0 as isize,
            bin.y.round() as isize + self.constant_bin.1 as isize,
        );
        if u < 1 || v < 1 || u as usize + 1 >= self.image.width() || v as usize + 1 >= self.image.height() {
            return None;
        }
        let (u, v) = (u as usize, v as usize);
        let highest = (v - 1..=v + 1).map(|v| self.image.row(v)[u - 1..=u + 1].iter().fold(0, |a, &b| a.max(b)));
        Some(f64::from(highest.fold(0, u8::max)) - self.mean)
    }

    /// Mean level above the mean of a beam from beside the constant bin in the direction of `bin` to the ellipse.
    fn beam(&self, bin: Vector2<f64>, ellipse: &Ellipse, width: u32) -> f64 {
        // The beam of the mirror image where the image shows only that: it has the same levels.
        let bin = if bin.x < 0.0 { -bin } else { bin };
        let (length, along) = (bin.norm() / ellipse.fraction(bin), bin.normalize());
        let across = Vector2::new(-along.y, along.x);
        let origin = Vector2::new(self.constant_bin.0 as f64, self.constant_bin.1 as f64);
        let (mut sum, mut count) = (0u32, 0u32);
        for lane in 0..width {
            let mut at = origin + along * 2.0 + across * (f64::from(lane) - (f64::from(width) - 1.0) / 2.0);
            for _ in 0..(length - 2.0).ceil().max(0.0) as usize {
                // Beside the image there is nothing to see: a cast of what is negative is zero, so it is asked for here.
                if let Some(level) = self
                    .image
                    .get((at.x + 0.5) as usize, (at.y + 0.5) as usize)
                    .filter(|_| at.x >= -0.5 && at.y >= -0.5)
                {
                    sum += u32::from(level);
                    count += 1;
                }
                at += along;
            }
        }
        if count > 0 { f64::from(sum) / f64::from(count) - self.mean } else { 0.0 }
    }

    /// How much higher every second, or every third, multiple of `bin` is than the rest: a lattice's own wave vectors have it the other way round.
    fn shortfall(&self, bin: Vector2<f64>, ellipse: &Ellipse) -> f64 {
        let mut levels = [0.0; 6];
        let mut count = 0;
        for (index, level) in levels.iter_mut().enumerate() {
            let at = bin * (index + 1) as f64;
            match self.highest_near(at) {
                Some(found) if ellipse.fraction(at) < 1.0 => *level = found,
                _ => break,
            }
            count += 1;
        }
        let mut worst = 0.0f64;
        for period in [2, 3] {
            // Each of those multiples against the ones since the last: levels fall from multiple to multiple, so the later ones prove nothing.
            let groups = levels[..count].chunks_exact(period);
            let rise =
                |group: &[f64]| group[period - 1] - group[..period - 1].iter().sum::<f64>() / (period - 1) as f64;
            let found = groups.len() as f64;
            worst = worst.max(groups.map(rise).sum::<f64>() / found.max(1.0));
        }
        worst
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use net_image::Image;

    const ELLIPSE: Ellipse = Ellipse { horizontal_bins: 60.0, vertical_bins: 60.0 };
    const MEAN: f64 = 64.0;

    /// A flattened half plane with peaks of the given levels, and the peaks.
    fn half_plane(dots: &[(i32, i32, u8)]) -> (Image<u8>, Vec<Peak>) {
        let mut image = Image::new(70, 141);
        image.fill(MEAN as u8);
        let mut peaks = Vec::new();
        for &(x, y, level) in dots {
            image.row_mut((70 + y) as usize)[(5 + x) as usize] = level;
            peaks.push(Peak { bin: Vector2::new(f64::from(x), f64::from(y)), level: f64::from(level) });
        }
        (image, peaks)
    }

    fn score(dots: &[(i32, i32, u8)], config: ScoreConfig) -> Vec<Candidate> {
        let (image, peaks) = half_plane(dots);
        let mut out = Vec::new();
        score_peaks(image.view().unwrap(), (5, 70), &peaks, &ELLIPSE, MEAN, &config, &mut Vec::new(), &mut out);
        out
    }

    #[test]
    fn the_parts_are_those_of_the_algorithm() {
        let found = score(&[(10, 0, 164), (20, 0, 144), (30, 0, 124)], ScoreConfig::default());
        let best = found[0];
        assert_eq!((best.peak_index, best.multiples), (0, 3));
        assert_eq!(best.peak, 150.0);
        assert!((best.pattern - (80.0 + 0.9 * 60.0)).abs() < 1e-9, "pattern {}", best.pattern);
        // Steps 2 .. 59 of three bins each, three of which are peaks: 240 levels over 174 bins, doubled.
        assert!((best.beam - 2.0 * 240.0 / 174.0).abs() < 1e-9, "beam {}", best.beam);
        assert_eq!(best.absent, 0.0);
    }

    #[test]
    fn multiples_refine_the_vector_with_the_square_of_their_number() {
        let found = score(&[(10, 0, 164), (21, 0, 144), (32, 1, 124)], ScoreConfig::default());
        let expected: Vector2<f64> =
            (Vector2::new(10.0, 0.0) + 2.0 * Vector2::new(21.0, 0.0) + 3.0 * Vector2::new(32.0, 1.0)) / 14.0;
        assert!((found[0].bin - expected).norm() < 1e-12, "{:?}", found[0].bin);
    }

    #[test]
    fn a_half_that_finds_only_every_second_multiple_loses() {
        let dots = [(20, 0, 190), (40, 0, 170), (10, 0, 104), (30, 0, 80), (50, 0, 80)];
        let with = score(&dots, ScoreConfig::default());
        assert_eq!(with[0].bin.x.round(), 20.0);
        assert!(with.iter().any(|c| c.bin.x.round() == 10.0 && c.absent < -50.0), "{with:?}");
        let without = score(&dots, ScoreConfig { absent_weight: 0.0, ..ScoreConfig::default() });
        assert_eq!(without[0].bin.x.round(), 10.0, "as the thesis has it, the half inherits the whole's peaks");
    }

    #[test]
    fn nothing_gives_nothing() {
        assert!(score(&[], ScoreConfig::default()).is_empty());
        assert!(ScoreConfig { decay: f64::INFINITY, ..ScoreConfig::default() }.validate().is_err());
    }
}
