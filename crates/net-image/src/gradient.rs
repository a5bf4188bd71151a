//! Derivatives of an image.

use crate::image::Image;
use crate::pixel::Pixel;
use crate::view::View;

/// How a derivative is taken: a difference over two pixels, averaged across over three.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GradientKernel {
    /// Weights (0, 1, 0) across: sharpest, noisiest.
    Central,
    /// Weights (3, 10, 3) / 16 across: its direction is nearly right at any angle (Scharr 2000).
    #[default]
    Scharr,
}

/// Derivatives along u and v, grey values per pixel. Keeps its buffers: images of a size seen before allocate nothing.
#[derive(Debug, Clone, Default)]
pub struct Gradient {
    kernel: GradientKernel,
    /// One row averaged along v, with a pixel of border on each side.
    mean: Vec<f32>,
    /// One row of differences along v, with a pixel of border on each side.
    difference: Vec<f32>,
}

impl Gradient {
    /// Derivatives by `kernel`.
    pub fn new(kernel: GradientKernel) -> Self {
        Self { kernel, ..Self::default() }
    }

    /// Derivatives of `image` along u into `du`, along v into `dv`; both take its size. Beyond its border the image
    /// goes on as its outermost pixel.
    pub fn apply<T: Pixel>(&mut self, image: View<'_, T>, du: &mut Image<f32>, dv: &mut Image<f32>) {
        let (width, height) = (image.width(), image.height());
        let (side, middle) = match self.kernel {
            GradientKernel::Central => (0.0, 1.0),
            GradientKernel::Scharr => (3.0 / 16.0, 10.0 / 16.0),
        };
        du.resize(width, height);
        dv.resize(width, height);
        self.mean.resize(width + 2, 0.0);
        self.difference.resize(width + 2, 0.0);
        for v in 0..height {
            let rows = image.row(v.saturating_sub(1)).iter().zip(image.row(v)).zip(image.row((v + 1).min(height - 1)));
            let sums = self.mean[1..].iter_mut().zip(&mut self.difference[1..]);
            for ((mean, difference), ((above, here), below)) in sums.zip(rows) {
                let (above, here, below) = (above.to_f32(), here.to_f32(), below.to_f32());
                *mean = side * (above + below) + middle * here;
                *difference = 0.5 * (below - above);
            }
            for row in [&mut self.mean, &mut self.difference] {
                row[0] = row[1];
                row[width + 1] = row[width];
            }
            for ((d, left), right) in du.row_mut(v).iter_mut().zip(&self.mean).zip(&self.mean[2..]) {
                *d = 0.5 * (right - left);
            }
            let (left, here, right) = (&self.difference, &self.difference[1..], &self.difference[2..]);
            for (((d, left), here), right) in dv.row_mut(v).iter_mut().zip(left).zip(here).zip(right) {
                *d = side * (left + right) + middle * here;
            }
        }
    }
}
