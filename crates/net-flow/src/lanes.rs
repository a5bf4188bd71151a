//! Products and sums in lanes: eight in one instruction, the same on every machine.

use wide::{i16x8, i32x4};

use crate::zncc::MAX_HALF;

/// Lanes of one product.
pub(crate) const LANES: usize = 8;
/// Steps of a rounded template per grey level.
pub(crate) const STEPS: f32 = 16.0;
/// Rounds a small f32 to a whole number when added.
pub(crate) const ROUNDER: f32 = 12_582_912.0;

/// Rounds a row of at most 63 values to steps and appends it, padded with zeros to whole lanes.
pub(crate) fn push_rounded(row: &[f32], out: &mut Vec<i16x8>) {
    let mut padded = [0.0f32; 2 * MAX_HALF + 2];
    padded[..row.len()].copy_from_slice(row);
    for chunk in padded.as_chunks::<LANES>().0.iter().take(row.len().div_ceil(LANES)) {
        // |x| <= 255: adding 1.5 * 2^23 leaves the rounded number in the low bits of the sum.
        out.push(i16x8::from(chunk.map(|x| (x * STEPS + ROUNDER).to_bits() as i16)));
    }
}

/// Sum in eight lanes.
pub(crate) fn sum_of(values: &[f32]) -> f32 {
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut lanes = [0.0f32; LANES];
    for chunk in chunks {
        lanes.iter_mut().zip(chunk).for_each(|(lane, x)| *lane += x);
    }
    lanes.iter().sum::<f32>() + rest.iter().sum::<f32>()
}

/// Sum of products of a template (rows of `row_lanes`) with the window that starts at `window[0]`.
#[inline]
pub(crate) fn correlate(template: &[i16x8], row_lanes: usize, window: &[i16], stride: usize) -> i64 {
    match row_lanes {
        1 => correlate_rows::<1>(template, window, stride),
        2 => correlate_rows::<2>(template, window, stride),
        3 => correlate_rows::<3>(template, window, stride),
        4 => correlate_rows::<4>(template, window, stride),
        5 => correlate_rows::<5>(template, window, stride),
        6 => correlate_rows::<6>(template, window, stride),
        7 => correlate_rows::<7>(template, window, stride),
        _ => correlate_rows::<8>(template, window, stride),
    }
}

/// [`correlate`] of rows of `N` lanes. A lane gains at most 2 * 4080 * 128 = 1.04e6 per product, and there are 63 * 8 products: 5.3e8.
#[inline]
fn correlate_rows<const N: usize>(template: &[i16x8], window: &[i16], stride: usize) -> i64 {
    let mut sum = i32x4::ZERO;
    let (rows, _) = template.as_chunks::<N>();
    let mut window = window;
    for row in rows {
        let (lanes, _) = window.as_chunks::<LANES>();
        let Some(lanes) = lanes.first_chunk::<N>() else { break };
        for k in 0..N {
            sum += row[k].dot(i16x8::from(lanes[k]));
        }
        window = window.get(stride..).unwrap_or_default();
    }
    sum.to_array().into_iter().map(i64::from).sum()
}
