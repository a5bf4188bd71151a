//! Stage 2b: the last hundredths of a pixel, by Gauss-Newton on the template's own gradient.
//!
//! A quadratic through nine scores is pulled towards whole pixels by some hundredths, always the same way for the same fraction; summed
//! over a hundred frames that counts. Inverse-compositional alignment (Baker and Matthews 2004) with gain and offset of the light
//! eliminated starts from there and has no such pull.

use nalgebra::{Matrix2, Vector2};
use net_image::Image;

use crate::zncc::sample_patch;

/// Farther than this from the start it has run away, px: the quadratic is never that wrong.
const MAX_WALK_PX: f64 = 0.75;
/// Steps below this change nothing, px.
const SMALL_STEP_PX: f64 = 0.002;

/// Buffers of the alignment.
#[derive(Debug, Clone, Default)]
pub(crate) struct Refine {
    /// Patch of the next picture.
    patch: Vec<f32>,
    /// Gradient of the template, zero mean, zero on its rim.
    gradient: Vec<[f32; 2]>,
}

impl Refine {
    /// Aligns `template` (rows of `2 half + 1`, zero mean) with `image` from `start` on. `None` where it does not converge.
    pub(crate) fn align(
        &mut self,
        template: &[f32],
        half: usize,
        image: &Image<u8>,
        start: Vector2<f64>,
        iterations: usize,
    ) -> Option<Vector2<f64>> {
        let side = 2 * half + 1;
        if side < 5 || template.len() != side * side {
            return None;
        }
        self.set_gradient(template, side);
        let (mut uu, mut uv, mut vv) = (0.0f32, 0.0f32, 0.0f32);
        for [gu, gv] in &self.gradient {
            uu += gu * gu;
            uv += gu * gv;
            vv += gv * gv;
        }
        let inverse = Matrix2::new(uu, uv, uv, vv).map(f64::from).try_inverse()?;
        let mut at = start;
        for _ in 0..iterations {
            self.patch.clear();
            sample_patch(image, at, &Matrix2::identity(), half, &mut self.patch);
            let n = self.patch.len() as f32;
            let mean = self.patch.iter().sum::<f32>() / n;
            let (mut tw, mut ww, mut gt, mut gw) = (0.0f32, 0.0f32, [0.0f32; 2], [0.0f32; 2]);
            for ((&w, &t), g) in self.patch.iter().zip(template).zip(&self.gradient) {
                let w = w - mean;
                tw += t * w;
                ww += w * w;
                gt[0] += g[0] * t;
                gt[1] += g[1] * t;
                gw[0] += g[0] * w;
                gw[1] += g[1] * w;
            }
            if ww <= n * 0.25 || tw <= 0.0 {
                return None;
            }
            let gain = tw / ww;
            let right = Vector2::new(f64::from(gain * gw[0] - gt[0]), f64::from(gain * gw[1] - gt[1]));
            let step = inverse * right;
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

    /// Central differences, mean taken away over the inside so that an offset of the light moves nothing.
    fn set_gradient(&mut self, template: &[f32], side: usize) {
        self.gradient.clear();
        self.gradient.resize(side * side, [0.0; 2]);
        let mut mean = [0.0f32; 2];
        for v in 1..side - 1 {
            for u in 1..side - 1 {
                let i = v * side + u;
                let g = [0.5 * (template[i + 1] - template[i - 1]), 0.5 * (template[i + side] - template[i - side])];
                mean = [mean[0] + g[0], mean[1] + g[1]];
                self.gradient[i] = g;
            }
        }
        let inner = ((side - 2) * (side - 2)) as f32;
        for v in 1..side - 1 {
            for g in &mut self.gradient[v * side + 1..(v + 1) * side - 1] {
                *g = [g[0] - mean[0] / inner, g[1] - mean[1] / inner];
            }
        }
    }
}
