//! Local mean.

use crate::error::{Error, Result};
use crate::image::Image;
use crate::pixel::{Pixel, Sum};
use crate::view::View;

/// Largest radius, px: a column sum of `u16` then still fits its integer.
const MAX_RADIUS: usize = 16_383;

/// Mean over a square window, by running sums: the time it takes does not depend on the window. Exact for integers.
/// Beyond its border the image goes on as its outermost pixel. Keeps its buffer: images of a size seen before allocate
/// nothing.
#[derive(Debug, Clone)]
pub struct BoxFilter<T: Pixel> {
    radius: usize,
    /// Sum of each column over the window's rows, with the border on both sides.
    columns: Vec<T::ColumnSum>,
}

impl<T: Pixel> BoxFilter<T> {
    /// A window of `2 radius + 1` px squared.
    ///
    /// # Errors
    /// [`Error::Value`] for a radius above 16,383.
    pub fn new(radius: usize) -> Result<Self> {
        if radius > MAX_RADIUS {
            return Err(Error::Value { field: "radius of a mean", value: radius as f64, expected: "0 to 16383 px" });
        }
        Ok(Self { radius, columns: Vec::new() })
    }

    /// The mean around each pixel of `image` into `out`, which takes its size.
    pub fn mean(&mut self, image: View<'_, T>, out: &mut Image<f32>) {
        let (width, height, radius) = (image.width(), image.height(), self.radius);
        let scale = 1.0 / (2.0 * radius as f64 + 1.0).powi(2);
        out.resize(width, height);
        self.columns.clear();
        self.columns.resize(width + 2 * radius + 1, T::ColumnSum::default());

        // The window of row 0: its own row stands in for those above, the last row for those below.
        let inside = radius.min(height - 1);
        self.add(image.row(0), radius + 1);
        for v in 1..=inside {
            self.add(image.row(v), 1);
        }
        self.add(image.row(height - 1), radius - inside);
        for v in 0..height {
            self.pad(width);
            let first = &self.columns[..2 * radius + 1];
            let mut window = first.iter().fold(T::WindowSum::default(), |sum, &c| sum + c.into());
            let (leaving, entering) = (&self.columns[..width], &self.columns[2 * radius + 1..]);
            for ((mean, &enters), &leaves) in out.row_mut(v).iter_mut().zip(entering).zip(leaving) {
                *mean = T::scaled(window, scale);
                window += T::WindowSum::from(enters) - T::WindowSum::from(leaves);
            }
            let (above, below) = (image.row(v.saturating_sub(radius)), image.row((v + radius + 1).min(height - 1)));
            for ((column, &enters), &leaves) in self.columns[radius..].iter_mut().zip(below).zip(above) {
                *column += T::ColumnSum::from(enters) - T::ColumnSum::from(leaves);
            }
        }
    }

    /// Adds a row to the columns, `count` times.
    fn add(&mut self, row: &[T], count: usize) {
        for (column, &x) in self.columns[self.radius..].iter_mut().zip(row) {
            *column += T::ColumnSum::from(x).times(count);
        }
    }

    /// The border left and right of the columns.
    fn pad(&mut self, width: usize) {
        let (left, rest) = self.columns.split_at_mut(self.radius);
        let (middle, right) = rest.split_at_mut(width);
        left.fill(middle[0]);
        right.fill(middle[width - 1]);
    }
}
