use crate::error::{Error, Result};

/// A borrowed image of one channel: `height` rows of `width` values, `stride` values from one row to the next.
#[derive(Debug, Clone, Copy)]
pub struct View<'a, T> {
    data: &'a [T],
    width: usize,
    height: usize,
    stride: usize,
}

/// A borrowed grey image, 0 black to 255 white.
pub type GrayView<'a> = View<'a, u8>;

impl<'a, T: Copy> View<'a, T> {
    /// Borrows `data`.
    ///
    /// # Errors
    /// [`Error::Size`] for an empty image or a stride below the width, [`Error::BufferLength`] for too short a buffer.
    pub fn new(data: &'a [T], width: usize, height: usize, stride: usize) -> Result<Self> {
        let needed = (height.wrapping_sub(1)).checked_mul(stride).and_then(|n| n.checked_add(width));
        let expected = match needed {
            Some(n) if width > 0 && height > 0 && stride >= width => n,
            _ => return Err(Error::Size { width, height, stride }),
        };
        if data.len() < expected {
            return Err(Error::BufferLength { width, height, stride, expected, got: data.len() });
        }
        Ok(Self { data, width, height, stride })
    }

    /// Borrows `data` whose rows follow each other without a gap.
    ///
    /// # Errors
    /// As [`View::new`].
    pub fn packed(data: &'a [T], width: usize, height: usize) -> Result<Self> {
        Self::new(data, width, height, width)
    }

    /// Width, px.
    pub fn width(&self) -> usize {
        self.width
    }
    /// Height, px.
    pub fn height(&self) -> usize {
        self.height
    }
    /// Row `v`, `width` values.
    ///
    /// # Panics
    /// If `v` is not below the height.
    #[inline]
    pub fn row(&self, v: usize) -> &'a [T] {
        assert!(v < self.height, "row {v} of {}", self.height);
        &self.data[v * self.stride..][..self.width]
    }
    /// All rows, top to bottom.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &'a [T]> + use<'a, T> {
        let view = *self;
        (0..view.height).map(move |v| view.row(v))
    }
    /// The value at `(u, v)`, `None` outside.
    #[inline]
    pub fn get(&self, u: usize, v: usize) -> Option<T> {
        (u < self.width && v < self.height).then(|| self.data[v * self.stride + u])
    }
    /// The two by two values of which the top-left one is `(u, v)`, row by row; `None` if one of them is outside.
    #[inline]
    pub fn square(&self, u: usize, v: usize) -> Option<[[T; 2]; 2]> {
        if u >= self.width - 1 || v >= self.height - 1 {
            return None;
        }
        let at = v * self.stride + u;
        let pair = |at: usize| self.data.get(at..)?.first_chunk().copied();
        Some([pair(at)?, pair(at + self.stride)?])
    }
    /// The part of `width` x `height` px whose top-left pixel is `(u, v)`; `None` if it does not lie inside.
    pub fn crop(&self, u: usize, v: usize, width: usize, height: usize) -> Option<Self> {
        if width == 0 || height == 0 || u.checked_add(width)? > self.width || v.checked_add(height)? > self.height {
            return None;
        }
        Some(Self { data: &self.data[v * self.stride + u..], width, height, stride: self.stride })
    }
}
