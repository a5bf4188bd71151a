//! The mean over each pixel's block.

use net_image::Image;

/// Side of the squares over which the block's size is constant, px.
pub(crate) const TILE: usize = 16;

/// Largest pixel: 255 grey levels in sixteenths.
pub(crate) const VALUE_MAX: usize = 4080;

/// By how many bits `number` has to be shifted down not to exceed `most`.
const fn bits_over(number: usize, most: usize) -> u32 {
    let mut bits = 0;
    while number >> bits > most {
        bits += 1;
    }
    bits
}

/// Buffers of this stage.
#[derive(Debug, Default)]
pub(crate) struct BlockMean {
    /// Sums over all pixels above and left, one row and column of zeros first; they wrap, and differences are right all the same.
    sums: Vec<u32>,
    /// Sums over the rows of the blocks at hand, zeros before and after. Of at most nine rows: 16 bits hold them.
    columns: Vec<u16>,
}

impl BlockMean {
    /// Mean over each pixel's block, as far as it lies inside the picture, into `out`. `half_blocks` holds half of a block's side less the pixel itself,
    /// px, for every tile, row by row. Values are at most 4080.
    #[inline(always)]
    pub fn take(&mut self, source: &Image<u16>, half_blocks: &[u16], out: &mut Image<u16>) {
        out.resize(source.width(), source.height());
        let first = half_blocks.first().copied().unwrap_or(0);
        let alike = half_blocks.iter().all(|&half| half == first);
        match first {
            1 if alike => self.small_blocks::<3>(source, out),
            2 if alike => self.small_blocks::<5>(source, out),
            3 if alike => self.small_blocks::<7>(source, out),
            4 if alike => self.small_blocks::<9>(source, out),
            _ => {
                self.sum_up(source);
                self.means_by_sums(half_blocks, out);
            }
        }
    }

    /// Blocks of `SIDE` px everywhere: sums that move on from row to row.
    #[inline(always)]
    fn small_blocks<const SIDE: usize>(&mut self, source: &Image<u16>, out: &mut Image<u16>) {
        let (width, height, half) = (source.width(), source.height(), SIDE / 2);
        // Sixteen bits a value, all through: so many of the columns' lowest, rounded, are left out that a block's sum fits too.
        let shift = const { bits_over(SIDE * SIDE * VALUE_MAX, u16::MAX as usize - SIDE * SIDE) };
        self.columns.clear();
        self.columns.resize(width + 2 * half, 0);
        let rounding = (1 << shift) / 2;
        self.columns[half..][..width].fill(rounding);
        for v in 0..height + half {
            let sums = &mut self.columns[half..][..width];
            let entering = (v < height).then(|| source.row(v));
            let leaving = v.checked_sub(SIDE).map(|v| source.row(v));
            match (entering, leaving) {
                (Some(entering), Some(leaving)) => {
                    let rows = entering.iter().zip(leaving);
                    sums.iter_mut().zip(rows).for_each(|(sum, (&new, &old))| *sum = *sum + new - old);
                }
                (Some(entering), None) => sums.iter_mut().zip(entering).for_each(|(sum, &new)| *sum += new),
                (None, Some(leaving)) => sums.iter_mut().zip(leaving).for_each(|(sum, &old)| *sum -= old),
                (None, None) => {}
            }
            let Some(middle) = v.checked_sub(half) else { continue };
            let rows = (v + 1).min(height) - middle.saturating_sub(half);
            let to = out.row_mut(middle);
            // 65536ths of a block's sum.
            let pixels = rows * SIDE;
            let per_pixel = u32::from((((65536 << shift) + pixels / 2) / pixels) as u16);
            for (to, block) in to.iter_mut().zip(self.columns.array_windows::<SIDE>()) {
                let sum = block.iter().fold((pixels / 2) as u16 >> shift, |all, &sum| all + (sum >> shift));
                *to = ((u32::from(sum) * per_pixel) >> 16) as u16;
            }
            // At both ends blocks have fewer columns.
            for u in (0..half.min(width)).chain(width.saturating_sub(half).max(half)..width) {
                let columns = ((u + half + 1).min(width) - u.saturating_sub(half)) as u32;
                let sum: u32 = self.columns[u..u + SIDE].iter().map(|&sum| u32::from(sum)).sum();
                let pixels = rows as u32 * columns;
                to[u] = ((sum - columns * u32::from(rounding) + pixels / 2) / pixels) as u16;
            }
        }
    }

    #[inline(always)]
    fn sum_up(&mut self, source: &Image<u16>) {
        let (width, height) = (source.width(), source.height());
        let stride = width + 1;
        self.sums.resize(stride * (height + 1), 0);
        self.sums[..stride].fill(0);
        for v in 0..height {
            let (above, here) = self.sums.split_at_mut((v + 1) * stride);
            let above = &above[v * stride..];
            let mut row = 0_u32;
            here[0] = 0;
            for ((s, &a), &p) in here[1..stride].iter_mut().zip(&above[1..]).zip(source.row(v)) {
                row = row.wrapping_add(u32::from(p));
                *s = a.wrapping_add(row);
            }
        }
    }

    /// Blocks of any size, from four of the sums each.
    #[inline(always)]
    fn means_by_sums(&self, half_blocks: &[u16], out: &mut Image<u16>) {
        let (width, height) = (out.width(), out.height());
        let (stride, tiles_wide) = (width + 1, width.div_ceil(TILE));
        for v in 0..height {
            for tile in 0..tiles_wide {
                let half = usize::from(half_blocks[(v / TILE) * tiles_wide + tile]);
                let (top, bottom) = (v.saturating_sub(half) * stride, (v + half + 1).min(height) * stride);
                let rows = (bottom - top) / stride;
                let (start, end) = (tile * TILE, (tile * TILE + TILE).min(width));
                let mean = &mut out.row_mut(v)[start..end];
                if start >= half && end + half <= width {
                    let count = end - start;
                    let slice = |row: usize, u: usize| &self.sums[row + u..][..count];
                    let (right, left) = (start + half + 1, start - half);
                    let corners = slice(bottom, right).iter().zip(slice(bottom, left));
                    let corners = corners.zip(slice(top, right).iter().zip(slice(top, left)));
                    let scale = 1.0 / (rows * (2 * half + 1)) as f32;
                    for (m, ((&br, &bl), (&tr, &tl))) in mean.iter_mut().zip(corners) {
                        let sum = br.wrapping_sub(bl).wrapping_sub(tr).wrapping_add(tl);
                        *m = rounded(sum as f32 * scale);
                    }
                } else {
                    for (k, m) in mean.iter_mut().enumerate() {
                        let (left, right) = ((start + k).saturating_sub(half), (start + k + half + 1).min(width));
                        let sum = self.sums[bottom + right]
                            .wrapping_sub(self.sums[bottom + left])
                            .wrapping_sub(self.sums[top + right])
                            .wrapping_add(self.sums[top + left]);
                        *m = rounded(sum as f32 * (1.0 / (rows * (right - left)) as f32));
                    }
                }
            }
        }
    }
}

/// `x`, from 0 to 2¹⁶, rounded: the digits after the point do not fit beside 2²³. (A cast minds values out of range, which costs three times as much.)
#[inline(always)]
pub(crate) fn rounded(x: f32) -> u16 {
    (x + 8_388_608.0).to_bits() as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_blocks_are_blocks_of_any_size() {
        for (width, height) in [(1, 1), (1, 9), (40, 1), (3, 2), (37, 23)] {
            let mut source = Image::new(width, height);
            for (k, p) in source.data_mut().iter_mut().enumerate() {
                *p = (k * 7919 % 4081) as u16;
            }
            for half in 1..6_u16 {
                let half_blocks = vec![half; width.div_ceil(TILE) * height.div_ceil(TILE)];
                let (mut mean, mut sums) = (BlockMean::default(), BlockMean::default());
                let (mut by_rows, mut by_sums) = (Image::default(), Image::new(width, height));
                mean.take(&source, &half_blocks, &mut by_rows);
                sums.sum_up(&source);
                sums.means_by_sums(&half_blocks, &mut by_sums);
                for (a, b) in by_rows.data().iter().zip(by_sums.data()) {
                    // Each is rounded from what may be a hair to one side of a half.
                    assert!(a.abs_diff(*b) <= 1, "{width}x{height}, {half}: {a} {b}");
                }
            }
        }
    }
}
