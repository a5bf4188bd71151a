//! One section of the picture: its spectrum, peaks and candidates (thesis 4.3.1 to 4.3.4 in one call).

use net_geometry::nalgebra::Vector2;
use net_image::{Image, View};

use crate::bins::Bins;
use crate::error::{Error, Result};
use crate::fft2::HalfSpectrum;
use crate::filter::{Ellipse, FallingThreshold, FilterConfig, filter_peaks};
use crate::flatten::Flattener;
use crate::peaks::{Peak, PeakConfig, PeakFinder, peaks_at_most};
use crate::score::{Candidate, ScoreConfig, score_peaks};
use crate::spectrum::{SpectrumPlan, Window};
use crate::spectrum_image::{SpectrumImage, SpectrumImageConfig};

/// Bins beyond the ellipse that the filters see, so that peaks at its edge are found.
const PADDING_BINS: usize = 8;

/// From a picture to candidates.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SectionConfig {
    /// What multiplies the picture. Default Hann.
    pub window: Window,
    /// How magnitudes become levels.
    pub image: SpectrumImageConfig,
    /// Leaves the background of the spectrum in, as the thesis does. Default false: peaks are looked for in the flattened spectrum ([`Flattener`]).
    pub keep_background: bool,
    /// Least noise of a pixel that is reckoned with, grey levels (of whatever the samples hold). Default 1: less than that of any camera, more than the rounding of 8-bit pictures (0.29). In a drawn picture without noise
    /// nothing else would hide what is a thousand times weaker than the net's waves, and everything in it would look like one. Larger: faint nets are lost.
    pub least_noise_grey: f64,
    /// What counts as a peak.
    pub peaks: PeakConfig,
    /// Which peaks pass.
    pub filter: FilterConfig,
    /// Which are the lattice's own.
    pub score: ScoreConfig,
}

impl Default for SectionConfig {
    fn default() -> Self {
        Self {
            window: Window::default(),
            image: SpectrumImageConfig::default(),
            keep_background: false,
            least_noise_grey: 1.0,
            peaks: PeakConfig::default(),
            filter: FilterConfig::default(),
            score: ScoreConfig::default(),
        }
    }
}

impl SectionConfig {
    /// The thesis's own values, as far as it gives them; `near` for those it uses by hand at 1.2 m and below.
    pub fn thesis(near: bool) -> Self {
        let peaks = PeakConfig {
            neighbourhood_bins: if near { 5 } else { 16 },
            threshold_levels: 20,
            lowest_level: 0,
            cluster_bins: if near { 2.5 } else { 10.0 },
        };
        let filter = FilterConfig {
            radius_cycles_per_px: if near { 0.12 } else { 0.25 },
            constant_radius_bins: if near { 3.0 } else { 4.0 },
            margin_levels: Some(if near { 60.0 } else { 40.0 }),
        };
        let score = ScoreConfig {
            absent_weight: 0.0,
            search_radius_bins: if near { 2.5 } else { 4.0 },
            max_peaks: if near { 40 } else { 20 },
            ..ScoreConfig::default()
        };
        Self { window: Window::None, keep_background: true, peaks, filter, score, ..Self::default() }
    }

    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] names the field.
    pub fn validate(&self) -> Result<()> {
        let value = self.least_noise_grey;
        if !(value > 1e-3 && value < 1e6) {
            return Err(Error::Parameter { field: "least_noise_grey", value, expected: "between 0.001 and a million" });
        }
        self.peaks.validate()?;
        self.filter.validate()?;
        self.score.validate()
    }
}

/// What is known of a section after [`SectionAnalyser::analyse`]; buffers are reused.
#[derive(Debug, Clone, Default)]
pub struct SectionSpectrum {
    pub(crate) half: HalfSpectrum,
    pub(crate) levels: Image<u8>,
    pub(crate) constant_bin: (usize, usize),
    pub(crate) highest: Image<u8>,
    pub(crate) all_peaks: Vec<Peak>,
    pub(crate) peaks: Vec<Peak>,
    pub(crate) candidates: Vec<Candidate>,
    /// Magnitude that the flattened spectrum's logarithms count from.
    pub(crate) least_magnitude: f64,
}

impl SectionSpectrum {
    /// The transform.
    pub fn transform(&self) -> &HalfSpectrum {
        &self.half
    }
    /// The half plane of its logarithm in which peaks were looked for, flattened unless the configuration keeps the background. (For a picture of the whole spectrum
    /// with its background draw [`Self::transform`] into a [`SpectrumImage`].)
    pub fn levels(&self) -> &Image<u8> {
        &self.levels
    }
    /// What Algorithm 2 found, before any filter.
    pub fn all_peaks(&self) -> &[Peak] {
        &self.all_peaks
    }
    /// What passed half plane, ellipse and threshold.
    pub fn peaks(&self) -> &[Peak] {
        &self.peaks
    }
    /// The strongest of those with their values, best first.
    pub fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }
    /// Column and row of the constant bin in [`Self::levels`].
    pub fn constant_bin(&self) -> (usize, usize) {
        self.constant_bin
    }
}

/// Plans and scratch for sections of one size.
#[derive(Debug)]
pub struct SectionAnalyser {
    config: SectionConfig,
    plan: SpectrumPlan,
    /// Magnitude of a bin of the least noise.
    least_magnitude: f64,
    ellipse: Ellipse,
    bins: Bins,
    image: SpectrumImage,
    flattener: Flattener,
    finder: PeakFinder,
    order: Vec<usize>,
}

impl SectionAnalyser {
    /// For sections of `width` x `height` px.
    ///
    /// # Errors
    /// [`crate::Error::EmptySize`], and [`crate::Error::Parameter`] for a parameter out of range.
    pub fn new(width: usize, height: usize, config: &SectionConfig) -> Result<Self> {
        config.validate()?;
        let radius = config.filter.radius_cycles_per_px;
        let ellipse = Ellipse { horizontal_bins: radius * width as f64, vertical_bins: radius * height as f64 };
        let bins = Bins::Half {
            left: PADDING_BINS,
            right: ellipse.horizontal_bins as usize + PADDING_BINS,
            vertical: ellipse.vertical_bins as usize + PADDING_BINS,
        };
        let plan = SpectrumPlan::new(width, height, config.window)?;
        let noise_power = plan.noise_power(config.least_noise_grey);
        Ok(Self {
            config: *config,
            plan,
            least_magnitude: noise_power.sqrt(),
            ellipse,
            bins,
            image: SpectrumImage::default(),
            flattener: Flattener::new(width, height, bins, noise_power)?,
            finder: PeakFinder::default(),
            order: Vec::new(),
        })
    }

    /// The ellipse within which peaks count.
    pub fn ellipse(&self) -> &Ellipse {
        &self.ellipse
    }

    /// Transform, image, peaks, filter and values of `picture`, into `out`.
    ///
    /// # Errors
    /// [`crate::Error::Size`] if the picture has another size than planned.
    pub fn analyse<T: Copy + Into<f32>>(&mut self, picture: View<'_, T>, out: &mut SectionSpectrum) -> Result<()> {
        let config = &self.config;
        self.plan.transform(picture, &mut out.half)?;
        out.least_magnitude = self.least_magnitude;
        let (mean, threshold) = if config.keep_background {
            self.image.draw(&out.half, self.bins, config.image);
            out.constant_bin = self.image.constant_bin();
            let image = self.image.image();
            out.levels.resize(image.width(), image.height());
            out.levels.data_mut().copy_from_slice(image.data());
            let mean = mean_level(&out.levels);
            let centre = centre_level(&out.levels, out.constant_bin);
            let falling = |margin: f64| FallingThreshold { centre: centre - margin, edge: mean };
            (mean, config.filter.margin_levels.map(falling))
        } else {
            self.flattener.flatten(&out.half, &mut out.levels)?;
            out.constant_bin = self.flattener.constant_bin();
            (f64::from(Flattener::ZERO), None)
        };
        let constant_bin = out.constant_bin;
        // A picture has at least one pixel, and so has its spectrum.
        let Some(levels) = out.levels.view() else { return Ok(()) };
        let room = peaks_at_most(levels.width(), levels.height());
        out.all_peaks.clear();
        out.all_peaks.reserve(room);
        out.peaks.clear();
        out.peaks.reserve(room);
        out.candidates.clear();
        out.candidates.reserve(room.min(config.score.max_peaks));
        self.order.clear();
        self.order.reserve(room);
        out.all_peaks.extend_from_slice(self.finder.find(levels, constant_bin, &config.peaks));
        let highest = self.finder.maximum();
        out.highest.resize(highest.width(), highest.height());
        out.highest.data_mut().copy_from_slice(highest.data());
        filter_peaks(&out.all_peaks, &self.ellipse, config.filter.constant_radius_bins, threshold, &mut out.peaks);
        score_peaks(
            levels,
            constant_bin,
            &out.peaks,
            &self.ellipse,
            mean,
            &config.score,
            &mut self.order,
            &mut out.candidates,
        );
        Ok(())
    }
}

fn mean_level(image: &Image<u8>) -> f64 {
    let sum: u64 = image.data().iter().map(|&level| u64::from(level)).sum();
    sum as f64 / image.data().len().max(1) as f64
}

/// Highest level in the 3 x 3 bins round the constant one.
fn centre_level(image: &Image<u8>, (u, v): (usize, usize)) -> f64 {
    let mut highest = 0;
    for row in v.saturating_sub(1)..(v + 2).min(image.height()) {
        for column in u.saturating_sub(1)..(u + 2).min(image.width()) {
            highest = highest.max(image.row(row)[column]);
        }
    }
    f64::from(highest)
}

/// Level of `levels` at `bin` between four bins, of the mirror image where only that is shown; `None` beyond both.
#[inline]
pub(crate) fn level_at(levels: &Image<u8>, constant_bin: (usize, usize), bin: Vector2<f64>) -> Option<f32> {
    let bin = if bin.x < 0.0 { -bin } else { bin };
    let (x, y) = (bin.x as f32 + constant_bin.0 as f32, bin.y as f32 + constant_bin.1 as f32);
    if !(x >= 0.0 && y >= 0.0) {
        return None;
    }
    let (u, v) = (x as usize, y as usize);
    if u + 1 >= levels.width() || v + 1 >= levels.height() {
        return None;
    }
    let (fu, fv) = (x - u as f32, y - v as f32);
    let (upper, lower) = (&levels.row(v)[u..u + 2], &levels.row(v + 1)[u..u + 2]);
    let mix = |pair: &[u8]| f32::from(pair[0]) + fu * (f32::from(pair[1]) - f32::from(pair[0]));
    Some(mix(upper) + fv * (mix(lower) - mix(upper)))
}
