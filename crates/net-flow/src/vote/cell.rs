//! One cell, laid out square.

/// Samples along a cell's side.
pub(super) const SIDE: usize = 12;
/// Numbers of a cell.
pub(super) const CELL: usize = SIDE * SIDE;

/// Mean of the middle of a cell.
pub(super) fn knot(cell: &[f32; CELL]) -> f32 {
    const MIDDLE: std::ops::Range<usize> = SIDE / 2 - 2..SIDE / 2 + 2;
    MIDDLE.flat_map(|v| MIDDLE.map(move |u| cell[v * SIDE + u])).sum::<f32>() / (MIDDLE.len() * MIDDLE.len()) as f32
}

/// Sum of products in eight lanes.
#[inline(always)]
pub(super) fn dot(a: &[f32; CELL], b: &[f32; CELL]) -> f32 {
    let mut lanes = [0.0f32; 8];
    for (a, b) in a.as_chunks::<8>().0.iter().zip(b.as_chunks::<8>().0) {
        for k in 0..8 {
            lanes[k] += a[k] * b[k];
        }
    }
    lanes.iter().sum()
}
