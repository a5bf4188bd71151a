//! Thin structures: a picture less its median. Outlines of fish are steps, which a median leaves where they are; twine is thin, so a median takes it
//! away (Huang, Yang and Tang 1979, a histogram that moves along each row).

use net_image::Image;

/// Grey levels told apart; between them the median is interpolated.
const LEVELS: usize = 256;

/// Running medians with their buffers kept.
#[derive(Debug, Default)]
pub(crate) struct Median {
    grey: Image<u8>,
    histogram: Vec<u32>,
}

impl Median {
    /// `out = image - median`, over squares of `2 radius + 1` px, at the edges over what there is of them. Brightness from 0 to 1.
    pub(crate) fn subtract(&mut self, image: &Image<f32>, radius: usize, out: &mut Image<f32>) {
        const WHITE: f32 = (LEVELS - 1) as f32;
        let (w, h) = (image.width(), image.height());
        out.resize(w, h);
        self.grey.resize(w, h);
        for (g, p) in self.grey.data_mut().iter_mut().zip(image.data()) {
            *g = (p * WHITE + 0.5) as u8;
        }
        self.histogram.resize(LEVELS, 0);
        let histogram = &mut self.histogram;
        for v in 0..h {
            let rows = &self.grey.data()[v.saturating_sub(radius) * w..(v + radius + 1).min(h) * w];
            let column = |u: usize| rows[u..].iter().step_by(w).map(|g| usize::from(*g));
            let height = (rows.len() / w) as u32;
            histogram.fill(0);
            // The level of the median, how many px are below it, and how many there are.
            let (mut level, mut below, mut all) = (0, 0u32, 0u32);
            for g in (0..radius.min(w)).flat_map(column) {
                histogram[g] += 1;
            }
            all += height * radius.min(w) as u32;
            for (u, (o, p)) in out.row_mut(v).iter_mut().zip(image.row(v)).enumerate() {
                if u + radius < w {
                    for g in column(u + radius) {
                        histogram[g] += 1;
                        below += u32::from(g < level);
                    }
                    all += height;
                }
                if u > radius {
                    for g in column(u - radius - 1) {
                        histogram[g] -= 1;
                        below -= u32::from(g < level);
                    }
                    all -= height;
                }
                while 2 * below > all {
                    level -= 1;
                    below -= histogram[level];
                }
                while 2 * (below + histogram[level]) < all {
                    below += histogram[level];
                    level += 1;
                }
                let part = (0.5 * all as f32 - below as f32) / histogram[level].max(1) as f32 - 0.5;
                *o = p - (level as f32 + part) / WHITE;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(w: usize, h: usize, of: impl Fn(usize, usize) -> f32) -> Image<f32> {
        let mut image = Image::new(w, h);
        for v in 0..h {
            for (u, p) in image.row_mut(v).iter_mut().enumerate() {
                *p = of(u, v);
            }
        }
        image
    }

    #[test]
    fn takes_away_steps_and_leaves_lines() {
        // A step of half the range at a slant, and away from it lines two px wide of a tenth of that, all of whole grey levels.
        let line = |u: usize, v: usize| u >= 96 && (u + v) % 41 < 2;
        let level =
            |u: usize, v: usize| if 2 * u > v + 70 { 204.0 } else { 77.0 } + if line(u, v) { 13.0 } else { 0.0 };
        let image = picture(160, 90, |u, v| level(u, v) / 255.0);
        let mut out = Image::default();
        Median::default().subtract(&image, 5, &mut out);
        // Not where lines end, nor at the picture's edge, where a slanted step has less of the square on its own side.
        for v in 6..84 {
            for u in (6..90).chain(102..154) {
                let expected = if line(u, v) { 13.0 } else { 0.0 };
                // The median is interpolated within a grey level.
                assert!((255.0 * out.row(v)[u] - expected).abs() < 0.501, "{u} {v}: {}", 255.0 * out.row(v)[u]);
            }
        }
    }

    #[test]
    fn is_the_median_of_each_square() {
        let noise = |u: usize, v: usize| ((u * 7919 + v * 104_729 + u * v * 31) % 256) as f32 / 255.0;
        let (w, h, r) = (37, 23, 3);
        let image = picture(w, h, noise);
        let mut out = Image::default();
        // Any radius, even one wider than the picture, and buffers of another size before.
        let mut median = Median::default();
        median.subtract(&picture(9, 5, noise), 12, &mut out);
        median.subtract(&image, r, &mut out);
        for v in 0..h {
            for u in 0..w {
                let mut all: Vec<f32> = (v.saturating_sub(r)..(v + r + 1).min(h))
                    .flat_map(|y| (u.saturating_sub(r)..(u + r + 1).min(w)).map(move |x| noise(x, y)))
                    .collect();
                all.sort_by(f32::total_cmp);
                let middle = 0.5 * (all[(all.len() - 1) / 2] + all[all.len() / 2]);
                // Of an even number the median is anywhere between the two in the middle.
                let slack = 0.5 * (all[all.len() / 2] - all[(all.len() - 1) / 2]) + 0.51 / 255.0;
                assert!((image.row(v)[u] - out.row(v)[u] - middle).abs() <= slack, "{u} {v}");
            }
        }
    }
}
