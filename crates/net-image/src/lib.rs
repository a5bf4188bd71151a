//! Images as borrowed views, and what is done to them before geometry begins: filters, pyramids, sampling. Nothing here
//! decodes a file.
//!
//! # Conventions
//! - **Pixels** `(u, v)`: u right, v down; the centre of the top-left pixel is `(0, 0)`. A pixel is a `u8`, `u16` or
//!   `f32` ([`Pixel`]); grey values keep their scale, 0 black to 255 white, as `f32` too.
//! - **Border**: filters see the image go on as its outermost pixel. Sampling between pixels ends at the centres of the
//!   outermost ones: beyond is `None`.
//! - **Buffers**: a filter is made once (`new(...)`), owns its scratch, and writes into an [`Image`] that the caller
//!   keeps. Both grow to the size of the images they meet, and from then on nothing is allocated.
//!
//! # Stages
//! [`View`] and [`GrayView`] borrow, [`Image`] owns. [`convert`] changes the kind of pixel; [`GaussianBlur`] and
//! [`BoxFilter`] smooth; [`Gradient`] differentiates; [`Pyramid`] halves; [`bilinear`] and [`bicubic`] read between
//! pixels; [`Remap`] reads a whole picture that way. [`widely!`] compiles loops for the widest instructions.
//!
//! ```
//! use net_image::{GaussianBlur, GrayView, Image, bilinear};
//!
//! let pixels = [0, 0, 0, 0, 255, 0, 0, 0, 0];
//! let image = GrayView::packed(&pixels, 3, 3)?;
//! assert_eq!(bilinear(image, 0.5, 1.0), Some(127.5));
//!
//! let mut blur = GaussianBlur::new(0.8)?;
//! let mut blurred = Image::default();
//! blur.apply(image, &mut blurred);
//! assert!(blurred.row(1)[1] < 100.0);
//! # Ok::<(), net_image::Error>(())
//! ```

mod box_filter;
pub mod convert;
mod error;
mod gaussian;
mod gradient;
mod image;
mod pixel;
mod pyramid;
mod remap;
mod sampling;
mod view;
mod wide;

pub use box_filter::BoxFilter;
pub use convert::ColourLayout;
pub use error::{Error, Result};
pub use gaussian::GaussianBlur;
pub use gradient::{Gradient, GradientKernel};
pub use image::Image;
pub use pixel::{Pixel, Sum};
#[doc(hidden)]
pub use pulp;
pub use pyramid::Pyramid;
pub use remap::Remap;
pub use sampling::{bicubic, bicubic_with_gradient, bilinear};
pub use view::{GrayView, View};
