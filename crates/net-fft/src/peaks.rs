//! Local maxima of a spectrum's image (thesis Algorithm 2).

use net_geometry::Dbscan;
use net_geometry::nalgebra::Vector2;
use net_image::{Image, View};

use crate::error::{Error, Result};
use crate::extrema::RunningExtrema;

/// What counts as a peak.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PeakConfig {
    /// A peak is the largest value within a square of so many bins. Default 5, the width of a peak under the Hann window, whatever the distance; the thesis
    /// takes 16, and 5 by hand close to the net. Larger: fewer peaks, and none of a net so near that its peaks lie closer.
    pub neighbourhood_bins: usize,
    /// And it stands out of the smallest value there by more than this, grey levels. Default 20 (thesis). Larger: fewer and surer peaks.
    pub threshold_levels: u8,
    /// And it reaches this level, whatever is round it. Default 92, a factor of 2.4 above the background of a flattened spectrum (64 + 28 levels of 1/32 nat);
    /// the thesis has none (0). Larger: fewer and surer peaks, and less of a faint net.
    pub lowest_level: u8,
    /// Of peaks chained by at most this distance only the largest stays, bins; 0 keeps all. Default 2.5; the thesis takes 10, and less close to the net.
    pub cluster_bins: f64,
}

impl Default for PeakConfig {
    fn default() -> Self {
        Self { neighbourhood_bins: 5, threshold_levels: 15, lowest_level: 86, cluster_bins: 2.5 }
    }
}

impl PeakConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the field.
    pub fn validate(&self) -> Result<()> {
        if self.neighbourhood_bins < 2 {
            let value = self.neighbourhood_bins as f64;
            return Err(Error::Parameter { field: "neighbourhood_bins", value, expected: "2 bins or more" });
        }
        if !(self.cluster_bins >= 0.0 && self.cluster_bins.is_finite()) {
            let value = self.cluster_bins;
            return Err(Error::Parameter { field: "cluster_bins", value, expected: "0 bins or more" });
        }
        Ok(())
    }
}

/// A local maximum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Where, in bins from the constant one: cycles per width and per height of the transformed picture.
    pub bin: Vector2<f64>,
    /// Grey level there.
    pub level: f64,
}

/// Room for the peaks of a spectrum of this size: local maxima of blurred bins are no denser than one in eight.
pub(crate) fn peaks_at_most(width: usize, height: usize) -> usize {
    (width * height).div_ceil(8)
}

/// Algorithm 2 with its buffers.
#[derive(Debug, Clone, Default)]
pub struct PeakFinder {
    extrema: RunningExtrema,
    maximum: Image<u8>,
    minimum: Image<u8>,
    /// Pixels that are maxima and not yet part of a peak.
    pending: Vec<u8>,
    stack: Vec<usize>,
    peaks: Vec<Peak>,
    points: Vec<Vector2<f64>>,
    dbscan: Dbscan,
    labels: Vec<Option<u32>>,
    strongest: Vec<Option<usize>>,
}

impl PeakFinder {
    /// Peaks of `image`, whose constant bin lies at `constant_bin`, in the order of their rows.
    pub fn find(&mut self, image: View<'_, u8>, constant_bin: (usize, usize), config: &PeakConfig) -> &[Peak] {
        let size = config.neighbourhood_bins;
        self.extrema.max(image, size, size, &mut self.maximum);
        self.extrema.min(image, size, size, &mut self.minimum);

        let (width, height) = (image.width(), image.height());
        let (threshold, lowest) = (config.threshold_levels, config.lowest_level);
        self.pending.resize(width * height, 0);
        for (v, pending) in self.pending.chunks_exact_mut(width).enumerate() {
            let levels = image.row(v).iter().zip(self.maximum.row(v)).zip(self.minimum.row(v));
            for (to, ((&here, &max), &min)) in pending.iter_mut().zip(levels) {
                *to = u8::from(here == max) & u8::from(max - min > threshold) & u8::from(here >= lowest);
            }
        }
        // The most there can be, give or take a plateau: how many there are changes from picture to picture.
        let room = peaks_at_most(width, height);
        self.peaks.clear();
        self.peaks.reserve(room);
        self.points.clear();
        self.points.reserve(room);
        self.labels.clear();
        self.labels.reserve(room);
        self.strongest.clear();
        self.strongest.reserve(room);
        self.stack.clear();
        self.stack.reserve(room);
        let origin = Vector2::new(constant_bin.0 as f64, constant_bin.1 as f64);
        for v in 0..height {
            let row = v * width..(v + 1) * width;
            // Most rows of most spectra hold no peak: sixteen pixels at a glance.
            if self.pending[row.clone()].iter().fold(0, |any, &pending| any | pending) == 0 {
                continue;
            }
            for seed in row {
                if self.pending[seed] == 0 {
                    continue;
                }
                let centroid = self.plateau(seed, width, height);
                // The centroid of a bent plateau may fall beside it, and the thesis reads the level there.
                let (u, v) = (centroid.x.round() as usize, centroid.y.round() as usize);
                let level = f64::from(image.get(u, v).unwrap_or_default());
                self.peaks.push(Peak { bin: centroid - origin, level });
            }
        }
        if config.cluster_bins > 0.0 {
            self.thin(config.cluster_bins);
        }
        &self.peaks
    }

    /// The largest value within the neighbourhood of each bin, from the last [`Self::find`].
    pub fn maximum(&self) -> &Image<u8> {
        &self.maximum
    }

    /// Takes the pixels that hang together with `seed` by their sides off the list, and returns their centroid.
    fn plateau(&mut self, seed: usize, width: usize, height: usize) -> Vector2<f64> {
        let (mut sum, mut count) = (Vector2::zeros(), 0.0);
        self.stack.clear();
        self.stack.push(seed);
        self.pending[seed] = 0;
        while let Some(at) = self.stack.pop() {
            let (u, v) = (at % width, at / width);
            sum += Vector2::new(u as f64, v as f64);
            count += 1.0;
            let sides = [
                (u > 0).then(|| at - 1),
                (u + 1 < width).then_some(at + 1),
                (v > 0).then(|| at - width),
                (v + 1 < height).then_some(at + width),
            ];
            for next in sides.into_iter().flatten() {
                if std::mem::take(&mut self.pending[next]) != 0 {
                    self.stack.push(next);
                }
            }
        }
        sum / count
    }

    /// Keeps the strongest peak of every cluster.
    fn thin(&mut self, radius: f64) {
        self.points.clear();
        self.points.extend(self.peaks.iter().map(|peak| peak.bin));
        let clusters = self.dbscan.cluster(&self.points, |_| radius, 1, &mut self.labels);
        self.strongest.clear();
        self.strongest.resize(clusters as usize, None);
        for (index, label) in self.labels.iter().enumerate() {
            // With one point making a cluster nothing is noise.
            let Some(label) = *label else { continue };
            let best = &mut self.strongest[label as usize];
            if best.is_none_or(|other| self.peaks[index].level > self.peaks[other].level) {
                *best = Some(index);
            }
        }
        let mut index = 0;
        self.peaks.retain(|_| {
            let label = self.labels[index];
            let keep = label.is_none_or(|label| self.strongest[label as usize] == Some(index));
            index += 1;
            keep
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANY_LEVEL: PeakConfig =
        PeakConfig { neighbourhood_bins: 5, threshold_levels: 20, lowest_level: 0, cluster_bins: 2.5 };

    fn image(width: usize, height: usize, dots: &[(usize, usize, u8)]) -> Image<u8> {
        let mut image = Image::new(width, height);
        image.fill(10);
        for &(u, v, level) in dots {
            image.row_mut(v)[u] = level;
        }
        image
    }

    fn find(image: &Image<u8>, config: PeakConfig) -> Vec<(f64, f64, f64)> {
        let mut finder = PeakFinder::default();
        let peaks = finder.find(image.view().unwrap(), (0, 0), &config);
        peaks.iter().map(|peak| (peak.bin.x, peak.bin.y, peak.level)).collect()
    }

    #[test]
    fn finds_what_stands_out_and_nothing_else() {
        let image = image(40, 30, &[(5, 6, 100), (20, 15, 25), (30, 25, 31), (0, 29, 90)]);
        // The dot of 25 is 15 above its surroundings: below the threshold of 20.
        assert_eq!(find(&image, ANY_LEVEL), [(5.0, 6.0, 100.0), (30.0, 25.0, 31.0), (0.0, 29.0, 90.0)]);
    }

    #[test]
    fn a_plateau_is_one_peak_at_its_centroid() {
        let image = image(20, 20, &[(7, 9, 80), (8, 9, 80), (9, 9, 80), (8, 10, 80)]);
        assert_eq!(find(&image, ANY_LEVEL), [(8.0, 9.25, 80.0)]);
    }

    #[test]
    fn clusters_keep_their_strongest() {
        let image = image(40, 20, &[(10, 10, 60), (16, 10, 90), (22, 10, 70), (36, 10, 50)]);
        let config = PeakConfig { cluster_bins: 6.5, ..ANY_LEVEL };
        assert_eq!(find(&image, config), [(16.0, 10.0, 90.0), (36.0, 10.0, 50.0)]);
        let all = PeakConfig { cluster_bins: 0.0, ..ANY_LEVEL };
        assert_eq!(find(&image, all).len(), 4);
    }

    #[test]
    fn flat_and_tiny_images_have_no_peaks() {
        for (width, height) in [(1, 1), (1, 7), (30, 30)] {
            assert!(find(&image(width, height, &[]), ANY_LEVEL).is_empty());
        }
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let bad = PeakConfig { cluster_bins: f64::NAN, ..ANY_LEVEL };
        assert!(bad.validate().unwrap_err().to_string().starts_with("cluster_bins is NaN"));
        assert!(PeakConfig { neighbourhood_bins: 0, ..ANY_LEVEL }.validate().is_err());
        assert!(ANY_LEVEL.validate().is_ok());
    }
}
