//! What the threshold leaves behind: which pixels are twine, and by how much.

/// Level of the frame that closes the picture: twine for sure.
pub(crate) const FRAME: i16 = i16::MAX;

/// Signed distance of each pixel from the threshold, in sixteenths of a grey level: twine where not negative. One pixel of frame, which
/// counts as twine, lies all round, so that followers of borders need no look at the picture's end.
#[derive(Debug, Default)]
pub(crate) struct Level {
    values: Vec<i16>,
    width: usize,
    height: usize,
}

impl Level {
    /// Makes room for a picture of this size, frame all round. Pixels inside keep what they were.
    pub fn resize(&mut self, width: usize, height: usize) {
        if (self.width, self.height) == (width, height) && !self.values.is_empty() {
            return;
        }
        self.width = width;
        self.height = height;
        self.values.clear();
        self.values.resize((width + 2) * (height + 2), FRAME);
    }

    /// Values from one row to the next.
    pub fn stride(&self) -> usize {
        self.width + 2
    }
    /// All values with the frame.
    pub fn values(&self) -> &[i16] {
        &self.values
    }
    /// Height of the picture without the frame, px.
    pub fn height(&self) -> usize {
        self.height
    }
    /// Row `v` of the picture without the frame.
    pub fn row(&self, v: usize) -> &[i16] {
        &self.values[(v + 1) * self.stride() + 1..][..self.width]
    }
    /// The same to write.
    pub fn row_mut(&mut self, v: usize) -> &mut [i16] {
        let start = (v + 1) * self.stride() + 1;
        &mut self.values[start..][..self.width]
    }

    /// For tests of the stages after this one.
    #[cfg(test)]
    pub fn from_fn(width: usize, height: usize, f: impl Fn(usize, usize) -> i16) -> Self {
        let mut level = Self::default();
        level.resize(width, height);
        for v in 0..height {
            for (u, value) in level.row_mut(v).iter_mut().enumerate() {
                *value = f(u, v);
            }
        }
        level
    }
}
