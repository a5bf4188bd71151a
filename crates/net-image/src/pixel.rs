//! What a pixel's value can be.

use std::ops::{Add, AddAssign, Sub, SubAssign};

mod sealed {
    pub trait Sealed {}
    impl Sealed for u8 {}
    impl Sealed for u16 {}
    impl Sealed for f32 {}
}

/// A sum of pixels that loses nothing: integers of integers, `f64` of `f32`.
pub trait Sum: Copy + Default + Add<Output = Self> + Sub<Output = Self> + AddAssign + SubAssign {
    /// `self` added up `count` times.
    fn times(self, count: usize) -> Self;
}

/// A pixel of one channel: `u8`, `u16` or `f32`.
pub trait Pixel: Copy + Default + sealed::Sealed {
    /// Sum along a column, of at most 32,767 pixels.
    type ColumnSum: Sum + From<Self>;
    /// Sum over a window.
    type WindowSum: Sum + From<Self::ColumnSum>;
    /// The value as it is.
    fn to_f32(self) -> f32;
    /// A sum times `scale`.
    fn scaled(sum: Self::WindowSum, scale: f64) -> f32;
}

macro_rules! sum {
    ($($sum:ty),*) => {$(
        impl Sum for $sum {
            #[inline]
            fn times(self, count: usize) -> Self {
                self * count as $sum
            }
        }
    )*};
}
sum!(i32, i64, f64);

macro_rules! pixel {
    ($($pixel:ty: $column:ty, $window:ty);*) => {$(
        impl Pixel for $pixel {
            type ColumnSum = $column;
            type WindowSum = $window;
            #[inline]
            fn to_f32(self) -> f32 {
                f32::from(self)
            }
            #[inline]
            fn scaled(sum: $window, scale: f64) -> f32 {
                (sum as f64 * scale) as f32
            }
        }
    )*};
}
pixel!(u8: i32, i64; u16: i32, i64; f32: f64, f64);
