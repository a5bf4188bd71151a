/// What can be wrong with geometry that a caller hands in.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A number outside its range, or not finite.
    #[error("{field} is {value}: {expected}")]
    Value {
        /// The field or argument, in the caller's words.
        field: &'static str,
        /// The value that was given.
        value: f64,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// A mesh that could not be read.
    #[error("mesh size {text:?}: {expected}")]
    MeshText {
        /// The text that was given.
        text: String,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// A lens model that is not known, or not with as many coefficients.
    #[error("distortion model {model:?} with {count} coefficients: {expected}")]
    LensModel {
        /// The model that was given.
        model: String,
        /// How many coefficients were given.
        count: usize,
        /// What is wrong, or what would have been accepted.
        expected: &'static str,
    },
    /// A lens that takes next to nothing of the scene into the picture: a calibration of another camera, or none.
    #[error("distortion coefficients are {coefficients:?} of {model}: expected {expected}")]
    NearlyBlind {
        /// The lens model, as in ROS.
        model: &'static str,
        /// Its coefficients, OpenCV's order.
        coefficients: Vec<f64>,
        /// What would have been accepted, and how far it is from that.
        expected: String,
    },
    /// The camera was calibrated for another image size than the one at hand.
    #[error(
        "the camera is calibrated for {camera_width}x{camera_height} px, the image is {image_width}x{image_height} px"
    )]
    ImageSize {
        /// Width of the calibration, px.
        camera_width: u32,
        /// Height of the calibration, px.
        camera_height: u32,
        /// Width of the image, px.
        image_width: u32,
        /// Height of the image, px.
        image_height: u32,
    },
    /// Points or vectors that do not determine what was asked for.
    #[error("{what} is degenerate: {why}")]
    Degenerate {
        /// What was to be computed.
        what: &'static str,
        /// Why it cannot be.
        why: &'static str,
    },
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Refuses numbers that are not finite.
pub(crate) fn finite(field: &'static str, value: f64) -> Result<f64> {
    if value.is_finite() { Ok(value) } else { Err(Error::Value { field, value, expected: "a finite number" }) }
}

/// Refuses numbers that are not finite and above zero.
pub(crate) fn positive(field: &'static str, value: f64) -> Result<f64> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(Error::Value { field, value, expected: "a finite number above zero" })
    }
}
