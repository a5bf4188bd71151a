//! Stage 2b: the last hundredths of a pixel, by Gauss-Newton on the template's own gradient.
//!
//! A quadratic through nine scores is pulled towards whole pixels by some hundredths, always the same way for the same fraction; summed
//! over a hundred frames that counts. Inverse-compositional alignment (Baker and Matthews 2004) has no such pull. Offset and gain of the
//! light are eliminated by taking the mean and the template itself out of the gradient. Bilinear sampling is linear in the picture, so that the
//! gradient's products with the window at the nine whole shifts round the peak are all that the iteration needs.

use nalgebra::{Matrix2, Vector2};
use wide::i16x8;

use crate::lanes::{LANES, push_rounded, sum_of};
use crate::zncc::Zncc;

/// Steps below this change nothing, px.
const SMALL_STEP_PX: f64 = 0.002;

/// Buffers of the alignment.
#[derive(Debug, Clone, Default)]
pub(crate) struct Refine {
    /// Gradient along one axis, zero on its rim, without mean and without the template's own part.
    gradient: Vec<f32>,
    /// The same along u and v, as the correlation wants it.
    lanes: [Vec<i16x8>; 2],
}

impl Refine {
    /// Aligns the template of `zncc` with the window of its last search; the shift from the search's centre, px. `None` where the peak lies on the border
    /// of the search or the alignment leaves its neighbourhood.
    pub(crate) fn align(&mut self, zncc: &Zncc, iterations: usize) -> Option<Vector2<f64>> {
        let side = 2 * zncc.half() + 1;
        let (u, v) = zncc.highest();
        let last = 2 * zncc.radius();
        if side < 5 || u == 0 || v == 0 || u == last || v == last {
            return None;
        }
        let template = zncc.exact();
        let energy = dot(template, template);
        let mut norms = [0.0f32; 3];
        for axis in 0..2 {
            self.set_gradient(template, side, if axis == 0 { 1 } else { side });
            let own = dot(&self.gradient, template) / energy;
            self.gradient.iter_mut().zip(template).for_each(|(g, t)| *g -= own * t);
            self.store(axis, side);
        }
        let [gu, gv] = &self.lanes;
        for (norm, (a, b)) in norms.iter_mut().zip([(gu, gu), (gu, gv), (gv, gv)]) {
            let sum: i64 =
                a.iter().zip(b).map(|(a, b)| a.dot(*b).to_array().into_iter().map(i64::from).sum::<i64>()).sum();
            *norm = sum as f32;
        }
        let inverse = Matrix2::new(norms[0], norms[1], norms[1], norms[2]).map(f64::from).try_inverse()?;
        let mut products = [[Vector2::zeros(); 3]; 3];
        for (j, row) in products.iter_mut().enumerate() {
            for (i, product) in row.iter_mut().enumerate() {
                let along = |g: &[i16x8]| zncc.product(g, u + i - 1, v + j - 1) as f64;
                *product = Vector2::new(along(gu), along(gv));
            }
        }
        let gain = zncc.gain(u, v);
        let mut shift = Vector2::zeros();
        for _ in 0..iterations {
            let step = inverse * interpolate(&products, shift) * gain;
            shift -= step;
            if step.iter().any(|x| x.is_nan()) || shift.amax() > 1.0 {
                return None;
            }
            if step.amax() < SMALL_STEP_PX {
                break;
            }
        }
        Some(shift + Vector2::new(u as f64, v as f64) - Vector2::repeat(zncc.radius() as f64))
    }

    /// Central differences, zero on the rim, mean taken away inside so that an offset of the light moves nothing.
    fn set_gradient(&mut self, template: &[f32], side: usize, step: usize) {
        self.gradient.clear();
        self.gradient.resize(side * side, 0.0);
        let mut total = 0.0;
        for v in 1..side - 1 {
            let inner = v * side + 1..(v + 1) * side - 1;
            let after = &template[inner.start + step..inner.end + step];
            let before = &template[inner.start - step..inner.end - step];
            for ((g, a), b) in self.gradient[inner.clone()].iter_mut().zip(after).zip(before) {
                *g = 0.5 * (a - b);
            }
            total += sum_of(&self.gradient[inner]);
        }
        let mean = total / ((side - 2) * (side - 2)) as f32;
        for v in 1..side - 1 {
            self.gradient[v * side + 1..(v + 1) * side - 1].iter_mut().for_each(|g| *g -= mean);
        }
    }

    /// Rounds the gradient to the template's steps, rows padded with zeros.
    fn store(&mut self, axis: usize, side: usize) {
        self.lanes[axis].clear();
        for row in self.gradient.chunks_exact(side) {
            push_rounded(row, &mut self.lanes[axis]);
        }
    }
}

/// Bilinear between the nine products; `shift` is within one pixel of the middle.
fn interpolate(products: &[[Vector2<f64>; 3]; 3], shift: Vector2<f64>) -> Vector2<f64> {
    let (i, j) = (usize::from(shift.x >= 0.0), usize::from(shift.y >= 0.0));
    let (fu, fv) = (shift.x + 1.0 - i as f64, shift.y + 1.0 - j as f64);
    let row = |j: usize| products[j][i] * (1.0 - fu) + products[j][i + 1] * fu;
    row(j) * (1.0 - fv) + row(j + 1) * fv
}

/// Sum of products in eight lanes.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut lanes = [0.0f32; LANES];
    for (a, b) in a.iter().zip(b) {
        for k in 0..LANES {
            lanes[k] += a[k] * b[k];
        }
    }
    lanes.iter().sum::<f32>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f32>()
}
