//! Pictures of half the size, for nets so near that their peaks crowd round the constant bin.

use net_image::{Image, View};

/// Sums of 2 x 2 pixels of `image` into `out`; an odd last row or column is left out. Sums rather than means: nothing is rounded away, and a spectrum does not mind the scale.
pub fn sum_of_four<T: Copy + Into<u16>>(image: View<'_, T>, out: &mut Image<u16>) {
    let (width, height) = (image.width() / 2, image.height() / 2);
    out.resize(width, height);
    for v in 0..height {
        let (upper, lower) = (image.row(2 * v).chunks_exact(2), image.row(2 * v + 1).chunks_exact(2));
        for ((to, upper), lower) in out.row_mut(v).iter_mut().zip(upper).zip(lower) {
            let [a, b, c, d]: [u16; 4] = [upper[0].into(), upper[1].into(), lower[0].into(), lower[1].into()];
            *to = a.wrapping_add(b).wrapping_add(c.wrapping_add(d));
        }
    }
}

/// Half the size again, where a sum would not fit: means of four, rounded.
pub fn mean_of_four(image: View<'_, u16>, out: &mut Image<u16>) {
    let (width, height) = (image.width() / 2, image.height() / 2);
    out.resize(width, height);
    for v in 0..height {
        let (upper, lower) = (image.row(2 * v).chunks_exact(2), image.row(2 * v + 1).chunks_exact(2));
        for ((to, upper), lower) in out.row_mut(v).iter_mut().zip(upper).zip(lower) {
            let sum: u32 = [upper[0], upper[1], lower[0], lower[1]].map(u32::from).iter().sum();
            *to = ((sum + 2) / 4) as u16;
        }
    }
}

/// Halvings by [`sum_of_four`] that 8-bit pictures stand: 255 x 4^4 is the last that fits.
pub(crate) const SUMS: usize = 4;

/// How many times the noise of a pixel that of a sample is after so many halvings, by sums as long as they fit and by means then.
pub(crate) fn noise_factor(halvings: usize) -> f64 {
    let sums = halvings.min(SUMS) as i32;
    2f64.powi(sums - (halvings as i32 - sums))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_and_drops_the_odd_rest() {
        let data: Vec<u8> = vec![1, 2, 3, 4, 99, 5, 6, 7, 8, 99, 99, 99, 99, 99, 99];
        let mut out = Image::default();
        sum_of_four(View::packed(&data, 5, 3).unwrap(), &mut out);
        assert_eq!((out.width(), out.height(), out.data()), (2, 1, &[14, 22][..]));
        let mut again = Image::default();
        sum_of_four(View::packed(&[255u8; 4], 2, 2).unwrap(), &mut out);
        sum_of_four(View::packed(out.data(), 1, 1).unwrap(), &mut again);
        assert_eq!((out.data(), again.width()), (&[1020][..], 0));
        mean_of_four(View::packed(&[65280, 65280, 65281, 65280], 2, 2).unwrap(), &mut out);
        assert_eq!(out.data(), &[65280]);
        assert_eq!([0, 1, 4, 5, 6].map(noise_factor), [1.0, 2.0, 16.0, 8.0, 4.0]);
    }
}
