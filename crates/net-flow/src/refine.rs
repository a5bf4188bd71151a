//! Stage 2b: the last hundredths of a pixel, by Gauss-Newton on the template's own gradient.
//!
//! A quadratic through nine scores is pulled towards whole pixels by some hundredths, always the same way for the same fraction; summed
//! over a hundred frames that counts. Inverse-compositional alignment (Baker and Matthews 2004) with gain and offset of the light
//! eliminated starts from there and has no such pull.

use nalgebra::{Matrix2, Vector2};
use net_image::GrayView;

use crate::zncc::{sample_patch, sum_of};

/// Farther than this from the start it has run away, px: the quadratic is never that wrong.
const MAX_WALK_PX: f64 = 0.75;
/// Steps below this change nothing, px.
const SMALL_STEP_PX: f64 = 0.002;

/// Buffers of the alignment.
#[derive(Debug, Clone, Default)]
pub(crate) struct Refine {
    /// Patch of the next picture.
    patch: Vec<f32>,
    /// Gradient of the template along u and v, zero mean, zero on its rim.
    gradient_u: Vec<f32>,
    gradient_v: Vec<f32>,
}

impl Refine {
    /// Aligns `template` (rows of `2 half + 1`, zero mean) with `image` from `start` on. `None` where it does not converge.
    pub(crate) fn align(
        &mut self,
        template: &[f32],
        half: usize,
        image: GrayView<'_>,
        start: Vector2<f64>,
        iterations: usize,
    ) -> Option<Vector2<f64>> {
        let side = 2 * half + 1;
        if side < 5 || template.len() != side * side {
            return None;
        }
        self.set_gradient(template, side);
        let (gu, gv) = (&self.gradient_u, &self.gradient_v);
        let (uu, uv, vv) = (dot(gu, gu), dot(gu, gv), dot(gv, gv));
        let inverse = Matrix2::new(uu, uv, uv, vv).map(f64::from).try_inverse()?;
        let (ut, vt) = (dot(gu, template), dot(gv, template));
        let mut at = start;
        for _ in 0..iterations {
            self.patch.clear();
            sample_patch(image, at, &Matrix2::identity(), half, &mut self.patch);
            let n = self.patch.len() as f32;
            let mean = sum_of(&self.patch) / n;
            self.patch.iter_mut().for_each(|w| *w -= mean);
            let (tw, ww) = (dot(template, &self.patch), dot(&self.patch, &self.patch));
            if ww <= n * 0.25 || tw <= 0.0 {
                return None;
            }
            let gain = tw / ww;
            let (uw, vw) = (dot(gu, &self.patch), dot(gv, &self.patch));
            let step = inverse * Vector2::new(f64::from(gain * uw - ut), f64::from(gain * vw - vt));
            at -= step;
            let walk = (at - start).norm();
            if walk.is_nan() || walk > MAX_WALK_PX {
                return None;
            }
            if step.amax() < SMALL_STEP_PX {
                break;
            }
        }
        Some(at)
    }

    /// Central differences, zero on the rim, mean taken away inside so that an offset of the light moves nothing.
    fn set_gradient(&mut self, template: &[f32], side: usize) {
        for (gradient, step) in [(&mut self.gradient_u, 1), (&mut self.gradient_v, side)] {
            gradient.clear();
            gradient.resize(side * side, 0.0);
            let mut total = 0.0;
            for v in 1..side - 1 {
                let inner = v * side + 1..(v + 1) * side - 1;
                let after = &template[inner.start + step..inner.end + step];
                let before = &template[inner.start - step..inner.end - step];
                for ((g, a), b) in gradient[inner.clone()].iter_mut().zip(after).zip(before) {
                    *g = 0.5 * (a - b);
                }
                total += sum_of(&gradient[inner]);
            }
            let mean = total / ((side - 2) * (side - 2)) as f32;
            for v in 1..side - 1 {
                gradient[v * side + 1..(v + 1) * side - 1].iter_mut().for_each(|g| *g -= mean);
            }
        }
    }
}

/// Sum of products in eight lanes.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut lanes = [0.0f32; 8];
    for (a, b) in a.iter().zip(b) {
        for k in 0..8 {
            lanes[k] += a[k] * b[k];
        }
    }
    lanes.iter().sum::<f32>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f32>()
}
