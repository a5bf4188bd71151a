//! Values between pixels.

use crate::pixel::Pixel;
use crate::view::View;

/// The value at `(u, v)` px by bilinear interpolation; `None` outside the centres of the outermost pixels (or for NaN).
#[inline]
pub fn bilinear<T: Pixel>(image: View<'_, T>, u: f64, v: f64) -> Option<f32> {
    let (u, x) = split(u, image.width())?;
    let (v, y) = split(v, image.height())?;
    let along = |[a, b]: [T; 2]| lerp(a.to_f32(), b.to_f32(), x);
    if let Some([top, bottom]) = image.square(u, v) {
        return Some(lerp(along(top), along(bottom), y));
    }
    // At the image's end.
    let right = (u + 1).min(image.width() - 1);
    let [top, bottom] = [v, (v + 1).min(image.height() - 1)].map(|v| [image.row(v)[u], image.row(v)[right]]);
    Some(lerp(along(top), along(bottom), y))
}

/// The value at `(u, v)` px and its derivatives along u and v, by bicubic interpolation (Keys 1981, a = -1/2: exact for
/// parabolas); `None` outside the centres of the outermost pixels (or for NaN). Beyond its border the image goes on as
/// its outermost pixel.
#[inline]
pub fn bicubic_with_gradient<T: Pixel>(image: View<'_, T>, u: f64, v: f64) -> Option<(f32, [f32; 2])> {
    let (width, height) = (image.width(), image.height());
    let (u, x) = split(u, width)?;
    let (v, y) = split(v, height)?;
    let columns = [u.saturating_sub(1), u, (u + 1).min(width - 1), (u + 2).min(width - 1)];
    let rows = [v.saturating_sub(1), v, (v + 1).min(height - 1), (v + 2).min(height - 1)];
    let ((wx, dx), (wy, dy)) = (keys(x), keys(y));
    let (mut value, mut gradient) = (0.0, [0.0; 2]);
    for (k, v) in rows.into_iter().enumerate() {
        let row = image.row(v);
        let pixels = columns.map(|u| row[u].to_f32());
        let along = |weights: [f32; 4]| (0..4).map(|i| weights[i] * pixels[i]).sum::<f32>();
        let sum = along(wx);
        value += wy[k] * sum;
        gradient[0] += wy[k] * along(dx);
        gradient[1] += dy[k] * sum;
    }
    Some((value, gradient))
}

/// The value at `(u, v)` px by bicubic interpolation, as [`bicubic_with_gradient`].
#[inline]
pub fn bicubic<T: Pixel>(image: View<'_, T>, u: f64, v: f64) -> Option<f32> {
    bicubic_with_gradient(image, u, v).map(|(value, _)| value)
}

/// Pixel at or before `x`, and the rest in [0, 1).
#[inline]
fn split(x: f64, size: usize) -> Option<(usize, f32)> {
    // NaN is in no range.
    if !(0.0..=(size - 1) as f64).contains(&x) {
        return None;
    }
    let pixel = x as usize;
    Some((pixel, (x - pixel as f64) as f32))
}

#[inline]
fn lerp(a: f32, b: f32, x: f32) -> f32 {
    a + (b - a) * x
}

/// Weights of the pixels at -1, 0, 1, 2 for the value at `x` in [0, 1), and their derivatives.
#[inline]
fn keys(x: f32) -> ([f32; 4], [f32; 4]) {
    let (x2, x3) = (x * x, x * x * x);
    let weights = [
        0.5 * (-x3 + 2.0 * x2 - x),
        0.5 * (3.0 * x3 - 5.0 * x2 + 2.0),
        0.5 * (-3.0 * x3 + 4.0 * x2 + x),
        0.5 * (x3 - x2),
    ];
    let derivatives = [
        0.5 * (-3.0 * x2 + 4.0 * x - 1.0),
        0.5 * (9.0 * x2 - 10.0 * x),
        0.5 * (-9.0 * x2 + 8.0 * x + 1.0),
        0.5 * (3.0 * x2 - 2.0 * x),
    ];
    (weights, derivatives)
}
