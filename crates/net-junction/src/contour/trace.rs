//! Outlines of the mesh openings: border following on the signed threshold level.
//!
//! Openings are 4-connected and twine is 8-connected, so that a twine one pixel wide closes its mesh also where it runs diagonally. The
//! follower walks the cracks between pixels with the opening on its right and passes every crack once, so the work is
//! proportional to the length of all borders. Each crack gives one crossing, where the level passes zero between the two pixels.

use crate::contour::level::{FRAME, Level};
use crate::contour::outline::{Crossing, Outline};

/// Pixels of a row that are looked at together.
const STRIP: usize = 16;

/// Follows outlines; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Tracer {
    /// -1 for pixels whose left crack has been passed, else 0.
    passed: Vec<i8>,
    crossings: Vec<Crossing>,
}

impl Tracer {
    /// Hands every opening's outer outline of at most `longest` crossings to `visit`, in the order of their top-left pixels.
    /// Outlines of twine inside an opening are left out.
    pub fn trace(&mut self, level: &Level, longest: usize, mut visit: impl FnMut(Outline)) {
        let (values, stride) = (level.values(), level.stride());
        self.passed.clear();
        self.passed.resize(values.len(), 0);
        // The frame is twine, so a left crack found in all rows at once belongs to a pixel of the picture.
        for first in (1..values.len()).step_by(STRIP) {
            let (left, here, passed) = (&values[first - 1..], &values[first..], &self.passed[first..]);
            if let (Some(left), Some(here), Some(passed)) =
                (left.first_chunk::<STRIP>(), here.first_chunk::<STRIP>(), passed.first_chunk::<STRIP>())
            {
                // Negative where twine is left of an opening and the crack has not been passed. Most strips hold none: a look at all signs at once.
                let cracks: [i16; STRIP] = std::array::from_fn(|k| !left[k] & here[k] & !i16::from(passed[k]));
                if cracks.iter().fold(0, |any, &crack| any | crack) >= 0 {
                    continue;
                }
            }
            for pixel in first..values.len().min(first + STRIP) {
                if !values[pixel - 1] & values[pixel] < 0 && self.passed[pixel] == 0 {
                    let position = ((pixel % stride) as i32 - 1, (pixel / stride) as i32 - 1);
                    self.follow(level, pixel, position, longest, &mut visit);
                }
            }
        }
    }

    /// Walks the border that begins at the left crack of pixel `start`, `(u, v)` in the picture.
    fn follow(
        &mut self,
        level: &Level,
        start: usize,
        (mut u, mut v): (i32, i32),
        longest: usize,
        visit: &mut impl FnMut(Outline),
    ) {
        let (values, stride) = (level.values(), level.stride());
        // East, south, west, north: turning right adds one.
        let (along_u, along_v) = ([1, 0, -1, 0], [0, 1, 0, -1]);
        let steps = [1_isize, stride as isize, -1, -(stride as isize)];
        // The frame is one pixel wide, so a step from a pixel of the picture, or one more to the side, stays inside `values`.
        let at = |pixel: usize, direction: usize| pixel.wrapping_add_signed(steps[direction]);
        self.crossings.clear();
        let (mut cut, mut turns) = (false, 0);
        let (mut pixel, mut heading) = (start, 3);
        // Levels on both sides of the crack.
        let (mut inner, mut outer) = (values[start], values[at(start, 2)]);
        loop {
            let left = (heading + 3) & 3;
            self.passed[pixel] |= -i8::from(heading == 3);
            cut |= outer == FRAME;
            if self.crossings.len() <= longest {
                // inner < 0 <= outer; the frame's level is no measurement.
                let (inner, outer) = (i32::from(inner), i32::from(outer));
                let part = if outer == i32::from(FRAME) {
                    Crossing::PARTS / 2
                } else {
                    inner * Crossing::PARTS / (inner - outer)
                };
                let (x, y) = (u * Crossing::PARTS + along_u[left] * part, v * Crossing::PARTS + along_v[left] * part);
                self.crossings.push(Crossing { x, y });
            }
            let ahead = at(pixel, heading);
            let in_front = values[ahead];
            if in_front >= 0 {
                outer = in_front;
                heading = (heading + 1) & 3;
                turns += 1;
            } else {
                let aside = at(ahead, left);
                let beside = values[aside];
                (u, v) = (u + along_u[heading], v + along_v[heading]);
                if beside >= 0 {
                    (pixel, inner, outer) = (ahead, in_front, beside);
                } else {
                    // Round the corner of the same pixel of twine.
                    (pixel, inner) = (aside, beside);
                    (u, v) = (u + along_u[left], v + along_v[left]);
                    heading = left;
                    turns -= 1;
                }
            }
            if pixel == start && heading == 3 {
                break;
            }
        }
        // Four turns to the right lead once round an opening, four to the left round twine inside one.
        if turns > 0 && self.crossings.len() <= longest {
            visit(Outline::of(&self.crossings, cut));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use imageproc::contours::{BorderType, find_contours};
    use net_geometry::nalgebra::Vector2;
    use proptest::prelude::*;

    use super::*;

    /// Level ±1 of a mask: crossings are midpoints of cracks.
    fn level_of(mask: &[bool], width: usize) -> Level {
        Level::from_fn(width, mask.len() / width, |u, v| if mask[v * width + u] { 1 } else { -1 })
    }

    /// Pixels of twine across the outline's cracks.
    fn twine_beside(outline: &Outline, mask: &[bool], width: usize) -> BTreeSet<(u32, u32)> {
        outline
            .pixels()
            .map(|p| {
                let (a, b) = ((p.x.floor() as u32, p.y.floor() as u32), (p.x.ceil() as u32, p.y.ceil() as u32));
                if mask[a.1 as usize * width + a.0 as usize] { a } else { b }
            })
            .collect()
    }

    fn holes_by_imageproc(mask: &[bool], width: usize) -> Vec<BTreeSet<(u32, u32)>> {
        let height = mask.len() / width;
        let picture = image::GrayImage::from_fn(width as u32, height as u32, |x, y| {
            image::Luma([u8::from(mask[y as usize * width + x as usize]) * 255])
        });
        let mut holes: Vec<_> = find_contours::<u32>(&picture)
            .iter()
            .filter(|c| c.border_type == BorderType::Hole)
            .map(|c| c.points.iter().map(|p| (p.x, p.y)).collect())
            .collect();
        holes.sort();
        holes
    }

    fn holes_by_us(mask: &[bool], width: usize) -> Vec<BTreeSet<(u32, u32)>> {
        let mut holes = Vec::new();
        Tracer::default().trace(&level_of(mask, width), usize::MAX, |outline| {
            if !outline.cut {
                holes.push(twine_beside(&outline, mask, width));
            }
        });
        holes.sort();
        holes
    }

    /// A mask with twine all round, as imageproc takes the picture's end for background.
    fn framed(mut mask: Vec<bool>, width: usize) -> Vec<bool> {
        let height = mask.len() / width;
        for (k, m) in mask.iter_mut().enumerate() {
            let (u, v) = (k % width, k / width);
            *m |= u == 0 || v == 0 || u + 1 == width || v + 1 == height;
        }
        mask
    }

    proptest! {
        #[test]
        fn the_openings_are_the_holes_that_imageproc_finds(
            width in 3_usize..24,
            bits in prop::collection::vec(prop::bool::weighted(0.55), 24 * 16),
        ) {
            let mask = framed(bits[..width * 16].to_vec(), width);
            prop_assert_eq!(holes_by_us(&mask, width), holes_by_imageproc(&mask, width));
        }

        #[test]
        fn every_opening_is_seen_once_whatever_the_picture(
            width in 1_usize..24,
            bits in prop::collection::vec(any::<bool>(), 24 * 12),
        ) {
            let mask = &bits[..width * 12];
            let mut count = 0;
            Tracer::default().trace(&level_of(mask, width), usize::MAX, |outline| {
                count += 1;
                assert!(outline.area > 0.0);
            });
            prop_assert_eq!(count, components(mask, width));
        }
    }

    /// Number of 4-connected openings, by flood fill.
    fn components(mask: &[bool], width: usize) -> usize {
        let mut seen = mask.to_vec();
        let mut count = 0;
        for start in 0..seen.len() {
            if seen[start] {
                continue;
            }
            count += 1;
            let mut stack = vec![start];
            while let Some(k) = stack.pop() {
                if std::mem::replace(&mut seen[k], true) {
                    continue;
                }
                let u = k % width;
                stack.extend((u > 0).then(|| k - 1));
                stack.extend((u + 1 < width).then_some(k + 1));
                stack.extend(k.checked_sub(width));
                stack.extend((k + width < mask.len()).then_some(k + width));
            }
        }
        count
    }

    #[test]
    fn the_outline_of_a_ramped_square_is_where_the_ramp_crosses_zero() {
        // Distance to a square's border, 10 levels a pixel; its true sides lie between the pixels.
        let (middle, half) = (Vector2::new(20.3, 18.6), 6.4);
        let level = Level::from_fn(40, 40, |u, v| {
            let d = Vector2::new(u as f64, v as f64) - middle;
            ((d.x.abs().max(d.y.abs()) - half) * 1000.0) as i16
        });
        let mut seen = 0;
        Tracer::default().trace(&level, usize::MAX, |outline| {
            seen += 1;
            assert!(!outline.cut);
            for p in outline.pixels() {
                let d = (p - middle).abs();
                // The ramp is not straight within a pixel of a corner.
                if d.min() > half - 1.0 {
                    continue;
                }
                // Levels are whole thousandths.
                assert!((d.max() - half).abs() < 2e-3, "{p}");
            }
            // Four corners cut off between two points, each less than half a square pixel.
            assert!((outline.area - 4.0 * half * half).abs() < 2.0, "{}", outline.area);
        });
        assert_eq!(seen, 1);
    }

    #[test]
    fn openings_at_the_end_of_the_picture_are_called_cut() {
        let mask: Vec<bool> = (0..9 * 9).map(|k| k % 9 == 4 || k / 9 == 4).collect();
        let mut cuts = Vec::new();
        Tracer::default().trace(&level_of(&mask, 9), usize::MAX, |outline| cuts.push(outline.cut));
        assert_eq!(cuts, [true; 4]);
    }

    #[test]
    fn long_outlines_are_left_out() {
        let mask = framed(vec![false; 20 * 20], 20);
        let mut seen = 0;
        Tracer::default().trace(&level_of(&mask, 20), 71, |_| seen += 1);
        assert_eq!(seen, 0);
        Tracer::default().trace(&level_of(&mask, 20), 72, |_| seen += 1);
        assert_eq!(seen, 1);
    }
}
