//! Blur and adaptive threshold: which pixels are twine.

use net_geometry::nalgebra::Vector2;
use net_image::{GrayView, Image};

use crate::contour::block_mean::{BlockMean, TILE, VALUE_MAX, rounded};
use crate::contour::config::{Config, LocalMean};
use crate::contour::level::Level;

/// Fixed-point scale of grey levels inside this stage: the 3 x 3 binomial kernel is then exact.
const SCALE: f64 = 16.0;
/// Largest block, px: its sum still fits 32 bits, 4080 * 1001² < 2³².
const BLOCK_MAX: f64 = 1001.0;

/// Buffers of the threshold stage.
#[derive(Debug, Default)]
pub(crate) struct Threshold {
    /// The widest vectors that the processor has.
    arch: pulp::Arch,
    blurred: Image<u16>,
    scratch: Image<u16>,
    block_mean: BlockMean,
    /// Local mean.
    mean: Image<u16>,
    /// Pixel less local mean.
    deviation: Image<i16>,
    /// Half block per tile, px.
    half_blocks: Vec<u16>,
    /// Mean absolute deviation per tile, then the same averaged over a block.
    spread: Vec<f32>,
    offsets: Vec<f32>,
    tiles_wide: usize,
    tiles_high: usize,
    level: Level,
}

impl Threshold {
    /// Blurs the image and takes the local mean away. `cell_side` tells the side, px, of the cell expected at a pixel, if any.
    pub fn prepare(&mut self, image: GrayView, config: &Config, cell_side: impl Fn(Vector2<f64>) -> Option<f64>) {
        let (width, height) = (image.width(), image.height());
        self.tiles_wide = width.div_ceil(TILE);
        self.tiles_high = height.div_ceil(TILE);
        self.plan_blocks(width, height, config, &cell_side);
        let sigma = (config.blur_cells * self.small_side(config)).max(config.blur_min_px);
        self.arch.dispatch(TakeMeanAway { threshold: self, image, sigma, config });
    }

    #[inline(always)]
    fn take_mean_away(&mut self, image: GrayView, sigma: f64, config: &Config) {
        self.blur(image, sigma);
        let boxes = if config.mean == LocalMean::Box { 1 } else { 3 };
        for pass in 0..boxes {
            if pass > 0 {
                std::mem::swap(&mut self.mean, &mut self.scratch);
            }
            let source = if pass == 0 { &self.blurred } else { &self.scratch };
            self.block_mean.take(source, &self.half_blocks, &mut self.mean);
        }
        self.deviation.resize(image.width(), image.height());
        let pixels = self.blurred.data().iter().zip(self.mean.data());
        for (d, (&b, &m)) in self.deviation.data_mut().iter_mut().zip(pixels) {
            // Both at most 255 * 16.
            *d = b as i16 - m as i16;
        }
        self.measure_spread(config);
    }

    /// Signed distance from the threshold for light (`true`) or dark twine.
    pub fn level(&mut self, light: bool) -> &Level {
        self.arch.dispatch(DrawLevel { threshold: self, light });
        &self.level
    }

    #[inline(always)]
    fn draw_level(&mut self, light: bool) {
        let (width, height) = (self.deviation.width(), self.deviation.height());
        self.level.resize(width, height);
        let (wide, high) = (self.tiles_wide, self.tiles_high);
        let sign = if light { 1 } else { -1 };
        if let [first, rest @ ..] = &self.offsets[..]
            && rest.iter().all(|offset| offset == first)
        {
            let offset = rounded(*first) as i16;
            for v in 0..height {
                let pixels = self.level.row_mut(v).iter_mut().zip(self.deviation.row(v));
                pixels.for_each(|(level, &deviation)| *level = sign * deviation - offset);
            }
            return;
        }
        for v in 0..height {
            let (row0, row1, b) = between_tiles(v, high);
            let (above, below) = (&self.offsets[row0 * wide..][..wide], &self.offsets[row1 * wide..][..wide]);
            let at = |tile: usize| above[tile] + b * (below[tile] - above[tile]);
            let source = self.deviation.row(v);
            let target = self.level.row_mut(v);
            // Runs of half a tile between which the offset is linear.
            let mut u = 0;
            while u < width {
                let (col0, col1, a) = between_tiles(u, wide);
                let end = (((u + TILE / 2) / TILE) * TILE + TILE / 2).min(width);
                let (offset, step) = (at(col0) + a * (at(col1) - at(col0)), (at(col1) - at(col0)) / TILE as f32);
                for (k, (t, &d)) in target[u..end].iter_mut().zip(&source[u..end]).enumerate() {
                    *t = sign * d - rounded(offset + step * k as f32) as i16;
                }
                u = end;
            }
        }
    }

    fn plan_blocks(
        &mut self,
        width: usize,
        height: usize,
        config: &Config,
        cell_side: &impl Fn(Vector2<f64>) -> Option<f64>,
    ) {
        self.half_blocks.clear();
        for row in 0..self.tiles_high {
            for col in 0..self.tiles_wide {
                let middle = |tile: usize, size: usize| ((tile * TILE + TILE / 2).min(size - 1)) as f64;
                let block = match config.block_px {
                    Some(block) => block as f64,
                    // Where no net can be, any block does: nothing is accepted there.
                    None => cell_side(Vector2::new(middle(col, width), middle(row, height)))
                        .map_or(3.0, |side| side * config.block_cells),
                };
                let block = match config.mean {
                    LocalMean::Box => block,
                    // Three boxes of width w have the variance (w² - 1) / 4.
                    LocalMean::Gaussian => (4.0 * gaussian_sigma(block).powi(2) + 1.0).sqrt(),
                };
                self.half_blocks.push(((block.clamp(3.0, BLOCK_MAX) - 1.0) * 0.5).round() as u16);
            }
        }
    }

    /// Side of the smaller cells, px, from the planned blocks: nine tenths of the picture have larger ones. One blur serves all, and
    /// small meshes suffer from it most.
    fn small_side(&mut self, config: &Config) -> f64 {
        self.offsets.clear();
        self.offsets.extend(self.half_blocks.iter().map(|&half| f32::from(half)));
        let tenth = self.offsets.len() / 10;
        let (_, half, _) = self.offsets.select_nth_unstable_by(tenth, f32::total_cmp);
        let block = 2.0 * f64::from(*half) + 1.0;
        match config.mean {
            LocalMean::Box => block / config.block_cells,
            LocalMean::Gaussian => 3.0 * block / config.block_cells,
        }
    }

    /// Binomial blur of the variance nearest to `sigma²`: each pass of 1-2-1 adds a half.
    #[inline(always)]
    fn blur(&mut self, image: GrayView, sigma: f64) {
        let (width, height) = (image.width(), image.height());
        self.blurred.resize(width, height);
        self.scratch.resize(width, height);
        let passes = (2.0 * sigma * sigma).round().clamp(0.0, 24.0) as usize;
        if passes == 0 {
            for (v, row) in image.rows().enumerate() {
                for (b, &p) in self.blurred.row_mut(v).iter_mut().zip(row) {
                    *b = u16::from(p) * SCALE as u16;
                }
            }
        }
        for pass in 0..passes {
            for v in 0..height {
                let target = self.scratch.row_mut(v);
                // Of the picture itself the kernel's sums are whole: no row of it is copied first.
                if pass == 0 {
                    blur_row(image.row(v), target, |a, b, c| {
                        (u16::from(a) + 2 * u16::from(b) + u16::from(c)) * (SCALE as u16 / 4)
                    });
                } else {
                    blur_row(self.blurred.row(v), target, |a, b, c| (a + 2 * b + c + 2) >> 2);
                }
            }
            for v in 0..height {
                let (above, below) = (self.scratch.row(v.saturating_sub(1)), self.scratch.row((v + 1).min(height - 1)));
                let here = self.scratch.row(v);
                for (t, ((&a, &h), &b)) in self.blurred.row_mut(v).iter_mut().zip(above.iter().zip(here).zip(below)) {
                    *t = (a + 2 * h + b + 2) >> 2;
                }
            }
        }
    }

    /// Threshold offset per tile: mean absolute deviation over the tiles that the block touches.
    #[inline(always)]
    fn measure_spread(&mut self, config: &Config) {
        let (width, height) = (self.deviation.width(), self.deviation.height());
        let (wide, high) = (self.tiles_wide, self.tiles_high);
        self.spread.clear();
        self.spread.resize(wide * high, 0.0);
        // Nothing is summed where nothing of it would count.
        let rows = if config.offset_deviations > 0.0 { height } else { 0 };
        for v in 0..rows {
            for (tile, part) in self.deviation.row(v).chunks(TILE).enumerate() {
                let sum: u32 = part.iter().map(|&d| u32::from(d.unsigned_abs())).sum();
                self.spread[(v / TILE) * wide + tile] += sum as f32;
            }
        }
        self.offsets.clear();
        for row in 0..high {
            for col in 0..wide {
                let reach = usize::from(self.half_blocks[row * wide + col]).div_ceil(TILE);
                let (left, right) = (col.saturating_sub(reach), (col + reach + 1).min(wide));
                let (top, bottom) = (row.saturating_sub(reach), (row + reach + 1).min(high));
                let sum: f32 = (top..bottom).map(|r| self.spread[r * wide..][left..right].iter().sum::<f32>()).sum();
                let pixels = ((right * TILE).min(width) - left * TILE) * ((bottom * TILE).min(height) - top * TILE);
                let offset = config.offset_deviations as f32 * sum / pixels as f32;
                self.offsets.push(offset.max((config.offset_grey * SCALE) as f32).min(VALUE_MAX as f32));
            }
        }
    }
}

/// [`Threshold::take_mean_away`] for the widest vectors that the processor has.
struct TakeMeanAway<'a> {
    threshold: &'a mut Threshold,
    image: GrayView<'a>,
    sigma: f64,
    config: &'a Config,
}

impl pulp::WithSimd for TakeMeanAway<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.threshold.take_mean_away(self.image, self.sigma, self.config);
    }
}

/// [`Threshold::draw_level`] for the same.
struct DrawLevel<'a> {
    threshold: &'a mut Threshold,
    light: bool,
}

impl pulp::WithSimd for DrawLevel<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.threshold.draw_level(self.light);
    }
}

/// Each value of `target` from three neighbours of `source`; beyond the ends the last one goes on.
#[inline(always)]
fn blur_row<T: Copy>(source: &[T], target: &mut [u16], kernel: impl Fn(T, T, T) -> u16) {
    let ([first, .., last], [to_first, to_inner @ .., to_last]) = (source, &mut *target) else {
        // One pixel wide.
        target.iter_mut().zip(source).for_each(|(to, &here)| *to = kernel(here, here, here));
        return;
    };
    *to_first = kernel(*first, *first, source[1]);
    *to_last = kernel(source[source.len() - 2], *last, *last);
    for (to, &[a, b, c]) in to_inner.iter_mut().zip(source.array_windows()) {
        *to = kernel(a, b, c);
    }
}

/// Standard deviation, px, that OpenCV's adaptive threshold gives its Gaussian for a block of this side.
fn gaussian_sigma(block: f64) -> f64 {
    (0.3 * ((block - 1.0) * 0.5 - 1.0) + 0.8).max(0.8)
}

/// The tiles before and after a pixel and how far it is from the first to the second. Beyond the outer tiles' middles the last goes on.
fn between_tiles(pixel: usize, tiles: usize) -> (usize, usize, f32) {
    let half = TILE / 2;
    if pixel < half {
        return (0, 0, 0.0);
    }
    let tile = (pixel - half) / TILE;
    let (first, second) = (tile.min(tiles - 1), (tile + 1).min(tiles - 1));
    (first, second, (pixel - half - tile * TILE) as f32 / TILE as f32)
}

#[cfg(test)]
mod tests {
    use net_image::View;

    use super::*;
    use crate::contour::level::FRAME;

    /// A picture of coarse random waves; deterministic.
    fn picture(width: usize, height: usize) -> Vec<u8> {
        let mut state = 12345_u32;
        (0..width * height)
            .map(|k| {
                state = state.wrapping_mul(1664525).wrapping_add(1013904223);
                let (u, v) = ((k % width) as f64, (k / width) as f64);
                let wave = 60.0 * (u * 0.31).sin() * (v * 0.23).cos();
                (128.0 + wave + f64::from(state >> 24) / 16.0) as u8
            })
            .collect()
    }

    fn naive_mean(blurred: &Image<u16>, u: usize, v: usize, half: usize) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for y in v.saturating_sub(half)..(v + half + 1).min(blurred.height()) {
            for x in u.saturating_sub(half)..(u + half + 1).min(blurred.width()) {
                sum += f64::from(blurred.row(y)[x]);
                count += 1.0;
            }
        }
        sum / count
    }

    #[test]
    fn the_mean_is_the_mean_of_a_block_that_follows_the_cell() {
        let (width, height) = (131, 77);
        let data = picture(width, height);
        let view = View::packed(&data, width, height).expect("a whole image");
        let mut threshold = Threshold::default();
        let side = |p: Vector2<f64>| Some(5.0 + p.x * 0.2);
        threshold.prepare(view, &Config::default(), side);
        for v in [0, 3, 40, 76] {
            for u in 0..width {
                let middle = ((u / TILE * TILE + TILE / 2).min(width - 1)) as f64;
                let half = ((side(Vector2::new(middle, 0.0)).unwrap_or(0.0) * Config::default().block_cells - 1.0)
                    * 0.5)
                    .round() as usize;
                let expected = naive_mean(&threshold.blurred, u, v, half);
                // Rounded to a sixteenth of a grey level.
                assert!((f64::from(threshold.mean.row(v)[u]) - expected).abs() <= 0.51, "at ({u}, {v})");
            }
        }
    }

    #[test]
    fn three_boxes_come_close_to_the_gaussian() {
        let (width, height) = (64, 64);
        let mut data = vec![0_u8; width * height];
        data[32 * width + 32] = 255;
        let view = View::packed(&data, width, height).expect("a whole image");
        let mut threshold = Threshold::default();
        let config = Config {
            block_px: Some(15),
            mean: LocalMean::Gaussian,
            blur_min_px: 0.0,
            blur_cells: 0.0,
            ..Config::default()
        };
        threshold.prepare(view, &config, |_| None);
        let sigma = gaussian_sigma(15.0);
        let spread: f64 = (0..width).map(|u| f64::from(threshold.mean.row(32)[u]) * (u as f64 - 32.0).powi(2)).sum();
        let mass: f64 = (0..width).map(|u| f64::from(threshold.mean.row(32)[u])).sum();
        // Boxes of whole odd widths reach the variance to 15 %.
        assert!(
            (spread / mass / (sigma * sigma) - 1.0).abs() < 0.15,
            "variance {} for {}",
            spread / mass,
            sigma * sigma
        );
    }

    #[test]
    fn light_and_dark_are_mirror_images() {
        let (width, height) = (90, 50);
        let data = picture(width, height);
        let mirrored: Vec<u8> = data.iter().map(|p| 255 - p).collect();
        let side = |_| Some(12.0);
        let (mut a, mut b) = (Threshold::default(), Threshold::default());
        a.prepare(View::packed(&data, width, height).expect("a whole image"), &Config::default(), side);
        b.prepare(View::packed(&mirrored, width, height).expect("a whole image"), &Config::default(), side);
        let (light, dark) = (a.level(true), b.level(false));
        for v in 0..height {
            for (x, y) in light.row(v).iter().zip(dark.row(v)) {
                // Rounding of blur and mean goes up in both.
                assert!((x - y).abs() <= 4);
            }
        }
    }

    #[test]
    fn the_frame_is_twine() {
        let data = [10_u8; 12];
        let mut threshold = Threshold::default();
        threshold.prepare(View::packed(&data, 4, 3).expect("a whole image"), &Config::default(), |_| Some(4.0));
        let level = threshold.level(true);
        assert_eq!(level.values().iter().filter(|&&l| l == FRAME).count(), 6 * 5 - 12);
        // Flat water is no twine.
        assert!((0..3).all(|v| level.row(v).iter().all(|&l| l < 0)));
    }

    #[test]
    fn any_size_is_taken() {
        for (width, height) in [(1, 1), (1, 40), (40, 1), (2, 2), (17, 16)] {
            let data = picture(width, height);
            let mut threshold = Threshold::default();
            threshold
                .prepare(View::packed(&data, width, height).expect("a whole image"), &Config::default(), |_| Some(9.0));
            assert_eq!(threshold.level(false).values().len(), (width + 2) * (height + 2));
        }
    }
}
