/// What can be wrong with what a caller hands in. A picture without a net is not an error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A parameter outside its range, or not finite.
    #[error("{field} is {value}: {expected}")]
    Value {
        /// Name of the parameter.
        field: &'static str,
        /// The value that was given.
        value: f64,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// The image has another size than the detector was made for.
    #[error("the detector was made for {width}x{height} px, the image is {image_width}x{image_height} px")]
    ImageSize {
        /// Width the detector was made for, px.
        width: usize,
        /// Height the detector was made for, px.
        height: usize,
        /// Width of the image, px.
        image_width: usize,
        /// Height of the image, px.
        image_height: usize,
    },
    /// The camera of the expectation does not fit the image.
    #[error(transparent)]
    Geometry(#[from] net_geometry::Error),
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
