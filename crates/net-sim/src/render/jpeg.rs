//! What a JPEG does to a grey picture: cosine transform of 8 x 8 blocks, coefficients rounded to the steps of the standard's
//! luminance table (ITU-T T.81, annex K), and back. The entropy coding, which loses nothing, is left out.

use net_image::Image;

/// Quantisation steps for quality 50, row by row.
#[rustfmt::skip]
const LUMINANCE: [u16; 64] = [
    16, 11, 10, 16,  24,  40,  51,  61,
    12, 12, 14, 19,  26,  58,  60,  55,
    14, 13, 16, 24,  40,  57,  69,  56,
    14, 17, 22, 29,  51,  87,  80,  62,
    18, 22, 37, 56,  68, 109, 103,  77,
    24, 35, 55, 64,  81, 104, 113,  92,
    49, 64, 78, 87, 103, 121, 120, 101,
    72, 92, 95, 98, 112, 100, 103,  99,
];

/// Passes pictures through JPEG.
#[derive(Debug)]
pub(crate) struct Jpeg {
    /// Orthonormal cosine transform: row k is the k-th basis vector.
    basis: [[f32; 8]; 8],
}

impl Jpeg {
    pub(crate) fn new() -> Self {
        let mut basis = [[0.0; 8]; 8];
        for (k, row) in basis.iter_mut().enumerate() {
            for (x, value) in row.iter_mut().enumerate() {
                let angle = std::f64::consts::PI * (x as f64 + 0.5) * k as f64 / 8.0;
                let norm = if k == 0 { 0.125f64.sqrt() } else { 0.5 };
                *value = (norm * angle.cos()) as f32;
            }
        }
        Self { basis }
    }

    /// Replaces `image` by what is left of it at `quality`, 1 to 100.
    pub(crate) fn apply(&self, image: &mut Image<u8>, quality: u8) {
        let steps = steps(quality);
        let (width, height) = (image.width(), image.height());
        for top in (0..height).step_by(8) {
            for left in (0..width).step_by(8) {
                let mut block = [[0.0f32; 8]; 8];
                for (y, row) in block.iter_mut().enumerate() {
                    // A block that reaches over the border repeats the last pixels.
                    let source = image.row((top + y).min(height - 1));
                    for (x, value) in row.iter_mut().enumerate() {
                        *value = f32::from(source[(left + x).min(width - 1)]) - 128.0;
                    }
                }
                let mut coefficients = multiply(&multiply(&self.basis, &block), &transpose(&self.basis));
                for (value, &step) in coefficients.iter_mut().flatten().zip(&steps) {
                    *value = (*value / step).round() * step;
                }
                let back = multiply(&multiply(&transpose(&self.basis), &coefficients), &self.basis);
                for (y, row) in back.iter().enumerate().take(height - top) {
                    for (out, value) in image.row_mut(top + y)[left..].iter_mut().zip(row) {
                        *out = (value + 128.0).round() as u8;
                    }
                }
            }
        }
    }
}

/// Quantisation steps of a quality, as libjpeg scales them.
fn steps(quality: u8) -> [f32; 64] {
    let quality = u32::from(quality.clamp(1, 100));
    let scale = if quality < 50 { 5000 / quality } else { 200 - 2 * quality };
    LUMINANCE.map(|step| ((u32::from(step) * scale + 50) / 100).clamp(1, 255) as f32)
}

fn multiply(a: &[[f32; 8]; 8], b: &[[f32; 8]; 8]) -> [[f32; 8]; 8] {
    let mut out = [[0.0; 8]; 8];
    for (row, a) in out.iter_mut().zip(a) {
        for (&factor, b) in a.iter().zip(b) {
            for (o, &x) in row.iter_mut().zip(b) {
                *o += factor * x;
            }
        }
    }
    out
}

fn transpose(a: &[[f32; 8]; 8]) -> [[f32; 8]; 8] {
    std::array::from_fn(|y| std::array::from_fn(|x| a[x][y]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_libjpegs() {
        assert_eq!(steps(50)[0], 16.0);
        assert_eq!(steps(100), [1.0; 64]);
        // cjpeg -quality 90: 3 2 2 3 5 8 10 12 ...
        assert_eq!(&steps(90)[..8], &[3.0, 2.0, 2.0, 3.0, 5.0, 8.0, 10.0, 12.0]);
        assert_eq!(&steps(10)[..3], &[80.0, 55.0, 50.0]);
    }

    #[test]
    fn quality_100_changes_next_to_nothing_and_low_quality_makes_blocks() {
        let mut image = Image::new(37, 21);
        for (k, p) in image.data_mut().iter_mut().enumerate() {
            *p = ((k * 7) % 200) as u8 + 20;
        }
        let original = image.clone();
        let jpeg = Jpeg::new();
        jpeg.apply(&mut image, 100);
        // Steps of 1: rounding of 64 coefficients by up to a half, and of the pixel.
        let worst = |image: &Image<u8>| image.data().iter().zip(original.data()).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst(&image) <= Some(3), "{:?}", worst(&image));
        jpeg.apply(&mut image, 5);
        assert!(worst(&image) > Some(20), "{:?}", worst(&image));
        let mut flat = Image::new(16, 16);
        flat.fill(77);
        jpeg.apply(&mut flat, 50);
        // The mean is coded in steps of 16 / 8 = 2 grey levels.
        assert!(flat.data().iter().all(|&p| p == flat.data()[0] && p.abs_diff(77) <= 1));
    }
}
