use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// The local mean that a pixel is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LocalMean {
    /// All pixels of the block alike. A block of whole cells averages the net's own pattern away exactly.
    #[default]
    Box,
    /// Nearer pixels count more: three boxes in a row, of the same variance as the block's Gaussian.
    Gaussian,
}

/// Which side of the local mean the twine is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Polarity {
    /// Both are tried; the one that closes more meshes wins, and the other fills in where the first found nothing near.
    #[default]
    Auto,
    /// Twine brighter than its background.
    Light,
    /// Twine darker than its background.
    Dark,
}

/// What is laid around an opening to find its corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Four lines fitted to the opening's sides: sub-pixel, and right for cells that tilt has turned into parallelograms.
    #[default]
    Quadrilateral,
    /// The rectangle of least area (Algorithm 4).
    Rectangle,
}

/// Parameters of the contour method. [`Config::default`] serves 0.3 to 6 m; [`Config::thesis`] is Algorithm 4 as it was published.
///
/// Lengths "in cells" are multiples of the side of the cell that is expected at the place (the root of its area).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Standard deviation of the blur, cells. Raising it calms noise and fills thin twine in. 0.02: below a twine's width.
    pub blur_cells: f64,
    /// Least standard deviation of the blur, px, whatever the cell. 0.7 is the usual 3 x 3 kernel.
    pub blur_min_px: f64,
    /// How the local mean is taken.
    pub mean: LocalMean,
    /// Side of the block over which the mean is taken, cells. Whole cells average the net's own pattern away; below one the block sees
    /// twine or opening alone; large blocks follow the light less closely.
    pub block_cells: f64,
    /// Side of the block, px, instead of `block_cells`: the thesis's 15. Fixed blocks fail at other cell sizes.
    pub block_px: Option<usize>,
    /// How far beyond the local mean twine begins, mean absolute deviations of the neighbourhood. Raising it thins the twine, and weak twine breaks.
    pub offset_deviations: f64,
    /// Least distance of twine from the local mean, grey levels: keeps flat water flat.
    pub offset_grey: f64,
    /// Light or dark twine.
    pub polarity: Polarity,
    /// Least area of an opening, part of the expected cell's (eq 4.36).
    pub area_min: f64,
    /// Largest area of an opening, part of the expected cell's (eq 4.36).
    pub area_max: f64,
    /// What is laid around an opening.
    pub shape: Shape,
    /// Least ratio of short to long side of an opening, when no pose says what a cell looks like here.
    pub squareness_min: f64,
    /// Least side of an opening, part of the expected cell's side. Needs a pose.
    pub side_min: f64,
    /// Largest side of an opening, part of the expected cell's side. Needs a pose.
    pub side_max: f64,
    /// How far an opening's sides may turn from the expected cell's, as the part of a side by which its end is off. Needs a pose.
    pub skew_max: f64,
    /// Least ratio of the opening's area to the shape's around it. A disc in a square has 0.79.
    pub fill_min: f64,
    /// Largest ratio of the opening's area to the shape's around it.
    pub fill_max: f64,
    /// Largest root mean square distance of the outline from the four lines, part of the opening's side.
    pub ragged_max: f64,
    /// Corners nearer to each other than this, cells, belong to one junction.
    pub eps_cells: f64,
    /// The same in px, instead of `eps_cells`: the thesis's 6 or 3.
    pub eps_px: Option<f64>,
    /// Least number of corners, each of another opening, that make a junction. The thesis's 3 leaves the net's border out.
    pub min_corners: usize,
    /// Move an opening's corners out to the middle of the twine before they are clustered; otherwise corners lie half a twine inside.
    pub move_corners: bool,
    /// Keep openings that were rejected, with the reason, for [`crate::JunctionDetector::boxes`].
    pub keep_rejected: bool,
    /// Keep the outlines of all kept openings, for [`crate::JunctionDetector::outline`].
    pub keep_outlines: bool,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            blur_cells: 0.02,
            blur_min_px: 0.7,
            mean: LocalMean::Box,
            block_cells: 3.0,
            block_px: None,
            offset_deviations: 0.1,
            offset_grey: 0.3,
            polarity: Polarity::Auto,
            area_min: 0.15,
            area_max: 1.3,
            shape: Shape::Quadrilateral,
            squareness_min: 0.5,
            side_min: 0.35,
            side_max: 1.15,
            skew_max: 0.3,
            fill_min: 0.75,
            fill_max: 1.15,
            ragged_max: 0.12,
            eps_cells: 0.22,
            eps_px: None,
            min_corners: 2,
            move_corners: true,
            keep_rejected: false,
            keep_outlines: false,
        }
    }
}

impl Config {
    /// Algorithm 4 with the thesis's figures: block of 15 px, rectangles, corners within 6 px, three to a junction.
    pub fn thesis() -> Self {
        Self {
            blur_cells: 0.0,
            mean: LocalMean::Gaussian,
            block_px: Some(15),
            offset_deviations: 0.0,
            offset_grey: 4.0,
            area_min: 0.4,
            area_max: 1.6,
            shape: Shape::Rectangle,
            squareness_min: 0.6,
            fill_min: 0.6,
            fill_max: 1.2,
            ragged_max: f64::MAX,
            eps_px: Some(6.0),
            min_corners: 3,
            move_corners: false,
            ..Self::default()
        }
    }

    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Value`] names the first parameter that is out of range.
    pub fn validate(&self) -> Result<()> {
        let within = |field, value: f64, low: f64, high: f64, expected| {
            if value >= low && value <= high { Ok(()) } else { Err(Error::Value { field, value, expected }) }
        };
        let above_zero = "a finite number above zero";
        within("blur_cells", self.blur_cells, 0.0, 1.0, "a number from 0 to 1")?;
        within("blur_min_px", self.blur_min_px, 0.0, 20.0, "a number from 0 to 20")?;
        within("block_cells", self.block_cells, 0.5, 20.0, "a number from 0.5 to 20")?;
        if let Some(block) = self.block_px {
            within("block_px", block as f64, 3.0, 10_000.0, "a number from 3 to 10000")?;
        }
        within("offset_deviations", self.offset_deviations, 0.0, 10.0, "a number from 0 to 10")?;
        within("offset_grey", self.offset_grey, 0.0, 255.0, "a number from 0 to 255")?;
        within("area_min", self.area_min, f64::MIN_POSITIVE, f64::MAX, above_zero)?;
        within("area_max", self.area_max, self.area_min, f64::MAX, "finite, and not below area_min")?;
        within("squareness_min", self.squareness_min, 0.0, 1.0, "a number from 0 to 1")?;
        within("side_min", self.side_min, f64::MIN_POSITIVE, f64::MAX, above_zero)?;
        within("side_max", self.side_max, self.side_min, f64::MAX, "finite, and not below side_min")?;
        within("skew_max", self.skew_max, f64::MIN_POSITIVE, f64::MAX, above_zero)?;
        within("fill_min", self.fill_min, 0.0, f64::MAX, "a finite number, not negative")?;
        within("fill_max", self.fill_max, self.fill_min, f64::MAX, "finite, and not below fill_min")?;
        within("ragged_max", self.ragged_max, f64::MIN_POSITIVE, f64::MAX, above_zero)?;
        within("eps_cells", self.eps_cells, f64::MIN_POSITIVE, 1.0, "above 0, at most 1")?;
        if let Some(eps) = self.eps_px {
            within("eps_px", eps, f64::MIN_POSITIVE, f64::MAX, above_zero)?;
        }
        within("min_corners", self.min_corners as f64, 1.0, 4.0, "a number from 1 to 4")?;
        Ok(())
    }
}
