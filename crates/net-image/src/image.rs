use crate::view::View;

/// An owned image of one channel without gaps between rows. Made to be reused: [`Image::resize`] keeps its memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Image<T> {
    data: Vec<T>,
    width: usize,
    height: usize,
}

impl<T> Default for Image<T> {
    /// An image without pixels: a buffer waiting for its first use.
    fn default() -> Self {
        Self { data: Vec::new(), width: 0, height: 0 }
    }
}

impl<T: Copy + Default> Image<T> {
    /// An image of `width` x `height` px, all zero.
    pub fn new(width: usize, height: usize) -> Self {
        Self { data: vec![T::default(); width * height], width, height }
    }

    /// Takes `data` of `width * height` values; `None` if the length is another.
    pub fn from_vec(data: Vec<T>, width: usize, height: usize) -> Option<Self> {
        (data.len() == width.checked_mul(height)?).then_some(Self { data, width, height })
    }

    /// Changes the size; values are then unspecified. Allocates only when it grows past what it ever was.
    pub fn resize(&mut self, width: usize, height: usize) {
        self.data.resize(width * height, T::default());
        self.width = width;
        self.height = height;
    }

    /// Takes the size and the values of `view`.
    pub fn copy_from(&mut self, view: View<'_, T>) {
        self.resize(view.width(), view.height());
        for (v, row) in view.rows().enumerate() {
            self.row_mut(v).copy_from_slice(row);
        }
    }

    /// Sets every pixel.
    pub fn fill(&mut self, value: T) {
        self.data.fill(value);
    }

    /// Width, px.
    pub fn width(&self) -> usize {
        self.width
    }
    /// Height, px.
    pub fn height(&self) -> usize {
        self.height
    }
    /// All values, row by row.
    pub fn data(&self) -> &[T] {
        &self.data
    }
    /// All values, row by row.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }
    /// Row `v`.
    ///
    /// # Panics
    /// If `v` is not below the height.
    #[inline]
    pub fn row(&self, v: usize) -> &[T] {
        &self.data[v * self.width..][..self.width]
    }
    /// Row `v`.
    ///
    /// # Panics
    /// If `v` is not below the height.
    #[inline]
    pub fn row_mut(&mut self, v: usize) -> &mut [T] {
        &mut self.data[v * self.width..][..self.width]
    }
    /// Borrows it as a view; `None` while it has no pixels.
    pub fn view(&self) -> Option<View<'_, T>> {
        View::packed(&self.data, self.width, self.height).ok()
    }
}
