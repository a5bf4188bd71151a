//! Patches of a picture, sampled stretched.

use nalgebra::{Matrix2, Vector2};
use net_image::GrayView;

use crate::lanes::ROUNDER;
use crate::zncc::MAX_HALF;

/// Row length, px, of the part of the picture that a stretched template is sampled from.
pub(crate) const WARP_STRIDE: usize = 128;

/// Samples `(2 half + 1)^2` values round `centre`, bilinear, edges repeated, stretched by `source_from_patch`.
pub(crate) fn sample_patch(
    image: GrayView<'_>,
    centre: Vector2<f64>,
    source_from_patch: &Matrix2<f64>,
    half: usize,
    warp: &mut Vec<f32>,
    out: &mut Vec<f32>,
) {
    let reach = half as i64;
    let (width, height) = (image.width() as i64, image.height() as i64);
    let (u0, v0) = (centre.x.floor() as i64, centre.y.floor() as i64);
    let inside = u0 - reach >= 0 && v0 - reach >= 0 && u0 + reach + 1 < width && v0 + reach + 1 < height;
    if inside && *source_from_patch == Matrix2::identity() {
        let (fu, fv) = ((centre.x - u0 as f64) as f32, (centre.y - v0 as f64) as f32);
        let (start, side) = ((u0 - reach) as usize, 2 * half + 1);
        out.resize(side * side, 0.0);
        // Each row is interpolated along u once, and serves the output row above it and the one below.
        let mut rows = [[0.0f32; 2 * MAX_HALF + 2]; 2];
        let [above, below] = &mut rows;
        let (mut above, mut below) = (&mut above[..side], &mut below[..side]);
        between(&image.row((v0 - reach) as usize)[start..][..side + 1], fu, above);
        for (v, out) in (v0 - reach + 1..).zip(out.chunks_exact_mut(side)) {
            between(&image.row(v as usize)[start..][..side + 1], fu, below);
            for ((out, a), b) in out.iter_mut().zip(&*above).zip(&*below) {
                *out = a + fv * (b - a);
            }
            std::mem::swap(&mut above, &mut below);
        }
        return;
    }
    let m = source_from_patch.map(|x| x as f32);
    // Fractions are taken relative to a whole pixel, so that f32 is as good in the corner of a large picture as at the origin.
    let (fu, fv) = ((centre.x - u0 as f64) as f32, (centre.y - v0 as f64) as f32);
    let spread = (m.abs() * Vector2::repeat(reach as f32)).map(|x| x.ceil() as i64 + 1);
    let inside = u0 - spread.x >= 0 && v0 - spread.y >= 0 && u0 + spread.x + 1 < width && v0 + spread.y + 1 < height;
    let rows = (2 * spread.y + 2) as usize;
    if inside && rows <= WARP_STRIDE && 2 * spread.x + 2 <= WARP_STRIDE as i64 {
        // The part of the picture that takes part, in rows of fixed length: one check of bounds per sample.
        let (left, columns) = ((u0 - spread.x) as usize, (2 * spread.x + 2) as usize);
        warp.resize((WARP_STRIDE + 1) * WARP_STRIDE, 0.0);
        for (v, row) in (u64::try_from(v0 - spread.y).unwrap_or(0)..).zip(warp.chunks_exact_mut(WARP_STRIDE).take(rows))
        {
            let source = &image.row(v as usize)[left..][..columns];
            row.iter_mut().zip(source).for_each(|(x, &s)| *x = f32::from(s));
        }
        let side = 2 * half + 1;
        out.resize(side * side, 0.0);
        let (du, dv) = (fu + spread.x as f32, fv + spread.y as f32);
        let mut places = [(0u32, 0.0f32, 0.0f32); 2 * MAX_HALF + 1];
        for (v, out) in (-reach..).zip(out.chunks_exact_mut(side)) {
            let (base_u, base_v) = (du + m.m12 * v as f32, dv + m.m22 * v as f32);
            for (u, place) in (-reach as i32..).zip(&mut places[..side]) {
                let u = u as f32;
                let (u, v) = (base_u + m.m11 * u, base_v + m.m21 * u);
                // Rounds down (or to the whole number just reached): the low bits of the sum.
                let (iu, iv) = (u - 0.5 + ROUNDER, v - 0.5 + ROUNDER);
                let at = (iv.to_bits() & 0xffff) * WARP_STRIDE as u32 + (iu.to_bits() & 0xffff);
                *place = (at, u - (iu - ROUNDER), v - (iv - ROUNDER));
            }
            for (out, &(at, fu, fv)) in out.iter_mut().zip(&places) {
                let Some(near) = warp.get(at as usize..).and_then(|w| w.first_chunk::<{ WARP_STRIDE + 2 }>()) else {
                    continue;
                };
                let (a, b) = (near[0] + fu * (near[1] - near[0]), near[WARP_STRIDE]);
                let b = b + fu * (near[WARP_STRIDE + 1] - b);
                *out = a + fv * (b - a);
            }
        }
        return;
    }
    for v in -reach..=reach {
        for u in -reach..=reach {
            let (u, v) = (u as f32, v as f32);
            out.push(bilinear(image, centre.x as f32 + m.m11 * u + m.m12 * v, centre.y as f32 + m.m21 * u + m.m22 * v));
        }
    }
}

/// Values a fraction `f` of a pixel to the right of each of a row's; the row has one more.
fn between(row: &[u8], f: f32, out: &mut [f32]) {
    for ((out, &a), &b) in out.iter_mut().zip(row).zip(row.iter().skip(1)) {
        let (a, b) = (f32::from(a), f32::from(b));
        *out = a + f * (b - a);
    }
}

/// One bilinear sample, edges repeated. NaN samples the corner: callers have checked their points.
#[inline]
fn bilinear(image: GrayView<'_>, u: f32, v: f32) -> f32 {
    let u = u.clamp(0.0, (image.width() - 1) as f32);
    let v = v.clamp(0.0, (image.height() - 1) as f32);
    let (u0, v0) = (u as usize, v as usize);
    let (u1, v1) = ((u0 + 1).min(image.width() - 1), (v0 + 1).min(image.height() - 1));
    let (fu, fv) = (u - u0 as f32, v - v0 as f32);
    let (top, bottom) = (image.row(v0), image.row(v1));
    let mix = |r: &[u8]| f32::from(r[u0]) * (1.0 - fu) + f32::from(r[u1]) * fu;
    mix(top) * (1.0 - fv) + mix(bottom) * fv
}
