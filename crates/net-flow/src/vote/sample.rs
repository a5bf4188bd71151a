//! A cell's grey values.

use nalgebra::Vector2;
use net_image::{GrayView, widely};

use super::cell::{CELL, SIDE};
use crate::lanes::{LANES, ROUNDER};

/// Samples along a quarter's side.
const HALF: usize = SIDE / 2;

/// Where a row of samples begins in each half, and from one sample to the next, px.
type Row = [(Vector2<f32>, Vector2<f32>); 2];

/// Samples a cell whose corners, middles of sides and middle lie at `place`s, 0 to 2 along either side: the quarters belong to four meshes, in each of which a lattice laid out by its
/// knots is bilinear. `None` where some of it is outside.
pub(super) fn sample(
    view: GrayView<'_>,
    place: impl Fn(usize, usize) -> Option<Vector2<f64>>,
    out: &mut [f32; CELL],
) -> Option<()> {
    if view.width() < 2 || view.height() < 2 {
        return None;
    }
    let part = |x: usize| (x as f64 + 0.5) / HALF as f64;
    let (right, bottom) = ((view.width() - 1) as f64, (view.height() - 1) as f64);
    // False for NaN.
    let inside = |p: &Vector2<f64>| p.x >= 0.0 && p.y >= 0.0 && p.x <= right && p.y <= bottom;
    let mut rows = [Row::default(); SIDE];
    for b in 0..2 {
        let (top, low) =
            ([place(0, b)?, place(1, b)?, place(2, b)?], [place(0, b + 1)?, place(1, b + 1)?, place(2, b + 1)?]);
        for (y, row) in rows[b * HALF..][..HALF].iter_mut().enumerate() {
            let at: [_; 3] = std::array::from_fn(|a| top[a].lerp(&low[a], part(y)));
            for (a, half) in row.iter_mut().enumerate() {
                let ends = [0, HALF - 1].map(|x| at[a].lerp(&at[a + 1], part(x)));
                // All samples of a row lie between the first and the last.
                if !ends.iter().all(inside) {
                    return None;
                }
                *half = (ends[0].cast(), ((ends[1] - ends[0]) / (HALF - 1) as f64).cast());
            }
        }
    }
    take(view, &rows, out);
    Some(())
}

widely! {
    /// Bilinear values of all rows, which lie in the picture.
    fn take<'a>(view: GrayView<'a>, rows: &'a [Row; SIDE], out: &'a mut [f32; CELL]) -> () {
        // The square of four pixels that holds a sample begins here at the latest.
        let last = [view.width() - 2, view.height() - 2].map(|last| last as i32);
        let (mut pixel, mut part) = ([[0; CELL]; 2], [[0.0; CELL]; 2]);
        for axis in 0..2 {
            let mut at = [0.0; CELL + LANES];
            for (k, (start, step)) in rows.as_flattened().iter().enumerate() {
                // Whole vectors, whose ends the next ones write over.
                let lanes: [f32; LANES] = std::array::from_fn(|x| start[axis] + step[axis] * x as f32);
                at[k * HALF..][..LANES].copy_from_slice(&lanes);
            }
            for k in 0..CELL {
                // Rounded half a pixel before: at a whole pixel it may be either.
                let whole = (at[k] - 0.5 + ROUNDER).to_bits() as i32 - ROUNDER.to_bits() as i32;
                pixel[axis][k] = whole.clamp(0, last[axis]);
                part[axis][k] = at[k] - pixel[axis][k] as f32;
            }
        }
        let mut corners = [[0; CELL]; 4];
        for k in 0..CELL {
            let [top, low] = view.square(pixel[0][k] as usize, pixel[1][k] as usize).unwrap_or_default();
            [corners[0][k], corners[1][k], corners[2][k], corners[3][k]] = [top[0], top[1], low[0], low[1]];
        }
        for k in 0..CELL {
            let [a, b, c, d] = [0, 1, 2, 3].map(|corner: usize| f32::from(corners[corner][k]));
            let (top, low) = (a + (b - a) * part[0][k], c + (d - c) * part[0][k]);
            out[k] = top + (low - top) * part[1][k];
        }
    }
}
