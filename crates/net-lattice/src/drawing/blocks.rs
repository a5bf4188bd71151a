//! The working picture in blocks of 4 x 4 pixels, of which a sparse comparison looks at one in four.

use net_image::Image;

use crate::numeric::wrap;
use crate::picture::view::BLOCK;
use crate::sheet::map::Plane;

/// Pixels of a block.
pub(crate) const PIXELS: usize = BLOCK * BLOCK;
/// A number for each of them, row by row.
pub(crate) type Block = [f32; PIXELS];

/// Sum of a function of the blocks' pixels, eight sums side by side: what the processor adds at once.
#[inline(always)]
pub(crate) fn total<const N: usize>(blocks: [&Block; N], f: impl Fn([f32; N]) -> f32) -> f32 {
    let mut sums = [0.0; 8];
    for k in (0..PIXELS).step_by(8) {
        for (lane, sum) in sums.iter_mut().enumerate() {
            *sum += f(std::array::from_fn(|n| blocks[n][k + lane]));
        }
    }
    let pair = |k: usize| sums[k] + sums[k + 4];
    (pair(0) + pair(1)) + (pair(2) + pair(3))
}

/// Cells from the nearest twine, of a block's pixels.
#[inline(always)]
pub(crate) fn positions(plane: &Plane, offset: f32) -> Block {
    let mut q = [0.0; PIXELS];
    for (k, q) in q.iter_mut().enumerate() {
        let (u, v) = ((k % BLOCK) as f32 - 1.5, (k / BLOCK) as f32 - 1.5);
        *q = wrap(plane.s + offset + plane.du * u + plane.dv * v);
    }
    q
}

/// Gives blocks that a sparse comparison leaves out the mean of those beside them.
pub(crate) fn fill_in(blocks: &mut Image<f32>) {
    let (bx, by) = (blocks.width(), blocks.height());
    for y in (0..by).step_by(2) {
        let row = blocks.row_mut(y);
        for x in (0..bx).filter(|x| !chosen(*x, y)) {
            let left = x.checked_sub(1).unwrap_or(x + 1).min(bx - 1);
            let right = if x + 1 < bx { x + 1 } else { x.saturating_sub(1) };
            row[x] = 0.5 * (row[left] + row[right]);
        }
    }
    for y in (1..by).step_by(2) {
        let (above, rest) = blocks.data_mut()[(y - 1) * bx..].split_at_mut(bx);
        let (row, below) = rest.split_at_mut(bx);
        let below = below.get(..bx).unwrap_or(above);
        for ((m, a), b) in row.iter_mut().zip(above.iter()).zip(below) {
            *m = 0.5 * (a + b);
        }
    }
}

/// The one block in four of a sparse comparison: every second of every second row, each such row a block aside of the last.
pub(crate) fn chosen(x: usize, y: usize) -> bool {
    y.is_multiple_of(2) && (x + y / 2).is_multiple_of(2)
}
