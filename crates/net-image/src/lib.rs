//! Images as borrowed views, and what is done to them before geometry begins: filters, pyramids, sampling.
//!
//! Pixel `(u, v)`: u right, v down, the centre of the top-left pixel is `(0, 0)`. Nothing here decodes a file.

mod error;
mod image;
mod view;

pub use error::{Error, Result};
pub use image::Image;
pub use view::{GrayView, View};
