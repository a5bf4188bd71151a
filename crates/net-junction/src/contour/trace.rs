//! Outlines of the mesh openings: border following on the signed threshold level.
//!
//! Openings are 4-connected and twine is 8-connected, so that a twine one pixel wide closes its mesh also where it runs diagonally. The
//! follower walks the cracks between pixels with the opening on its right and passes every crack once, so the work is
//! proportional to the length of all borders. Each crack gives one crossing, where the level passes zero between the two pixels.

use crate::contour::block_mean::rounded;
use crate::contour::level::{FRAME, Level};
use crate::contour::outline::{Crossing, Outline};

/// Pixels of a row that are looked at together.
const STRIP: usize = 32;

/// Headings of the follower: turning right adds one.
const EAST: usize = 0;
const SOUTH: usize = 1;
const WEST: usize = 2;
const NORTH: usize = 3;

/// Follows outlines; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Tracer {
    /// The widest vectors that the processor has.
    arch: pulp::Arch,
    /// Negative for pixels with a left crack that has not been passed.
    waiting: Vec<i8>,
    places: Vec<Place>,
    levels: Vec<Levels>,
    crossings: Vec<Crossing>,
}

/// Where the follower is: row above column, 16 bits each, so that a step is one sum. Images have at most 32768 pixels a side: the highest bits of column and row are free for the
/// lower and the higher bit of the heading.
type Place = u32;
const COLUMN: Place = 1;
const ROW: Place = 1 << 16;
const fn heading_bits(heading: usize) -> Place {
    (heading as Place & 1) << 15 | (heading as Place >> 1) << 31
}

/// Levels of a crack's two pixels, 16 bits each: of the twine above that of the opening, which is negative.
type Levels = u32;

impl Tracer {
    /// Hands every opening's outer outline of at most `longest` crossings to `visit`, in the order of their top-left pixels.
    /// Outlines of twine inside an opening are left out.
    pub fn trace(&mut self, level: &Level, longest: usize, mut visit: impl FnMut(Outline)) {
        let (values, stride) = (level.values(), level.stride());
        self.waiting.resize(values.len(), 0);
        self.arch.dispatch(LeftCracks { values, left_cracks: &mut self.waiting });
        let longest = longest.min(4 * values.len());
        self.places.resize(longest, 0);
        self.levels.resize(longest, 0);
        self.crossings.clear();
        self.crossings.reserve(longest);
        // The frame is twine, so a left crack found in all rows at once belongs to a pixel of the picture.
        for first in (0..values.len()).step_by(STRIP) {
            // Most strips hold none: a look at all signs at once.
            let strip = self.waiting[first..].first_chunk::<STRIP>();
            if strip.is_some_and(|strip| strip.iter().fold(0, |any, &waiting| any | waiting) >= 0) {
                continue;
            }
            for pixel in first..values.len().min(first + STRIP) {
                if self.waiting[pixel] < 0 {
                    let place = ROW * (pixel / stride - 1) as Place + COLUMN * (pixel % stride - 1) as Place;
                    let mut walk = Walk {
                        values,
                        stride,
                        start: pixel,
                        waiting: &mut self.waiting,
                        places: &mut self.places,
                        levels: &mut self.levels,
                        count: 0,
                        turns: 0,
                    };
                    walk.round(place);
                    // Four turns to the right lead once round an opening, four to the left round twine inside one.
                    let (count, turns) = (walk.count, walk.turns);
                    if turns > 0 && count <= longest {
                        self.crossings.resize(count, Crossing { x: 0, y: 0 });
                        visit(self.arch.dispatch(Cracks {
                            places: &self.places[..count],
                            levels: &self.levels[..count],
                            crossings: &mut self.crossings,
                        }));
                    }
                }
            }
        }
    }
}

/// Once along a border, from the left crack of a pixel back to it.
struct Walk<'a> {
    values: &'a [i16],
    stride: usize,
    /// The pixel.
    start: usize,
    waiting: &'a mut [i8],
    /// Of the first cracks that were passed, as many as there is room for: the opening's pixel with the heading, and the levels.
    places: &'a mut [Place],
    levels: &'a mut [Levels],
    /// How many were passed.
    count: usize,
    /// To the right, less those to the left.
    turns: i32,
}

impl Walk<'_> {
    /// Walks from `place`, the start's in the picture.
    fn round(&mut self, place: Place) {
        let mut here = Some((self.start, place, NORTH));
        while let Some((pixel, place, heading)) = here {
            here = match heading {
                EAST => self.straight_on::<EAST>(pixel, place),
                SOUTH => self.straight_on::<SOUTH>(pixel, place),
                WEST => self.straight_on::<WEST>(pixel, place),
                _ => self.straight_on::<NORTH>(pixel, place),
            };
        }
    }

    /// Passes cracks up to the next turn; tells where it leads, `None` where the border is closed.
    #[inline(always)]
    fn straight_on<const HEADING: usize>(
        &mut self,
        mut pixel: usize,
        mut place: Place,
    ) -> Option<(usize, Place, usize)> {
        let left = (HEADING + 3) % 4;
        // The frame is one pixel wide, so a step from a pixel of the picture, or one more to the side, stays inside `values`.
        let steps = [1, self.stride, 1_usize.wrapping_neg(), self.stride.wrapping_neg()];
        let moves = [COLUMN, ROW, COLUMN.wrapping_neg(), ROW.wrapping_neg()];
        let (mut inner, mut outer) = (self.values[pixel], self.values[pixel.wrapping_add(steps[left])]);
        let next = loop {
            if let (Some(to), Some(levels)) = (self.places.get_mut(self.count), self.levels.get_mut(self.count)) {
                *to = place | heading_bits(HEADING);
                *levels = Levels::from(outer as u16) << 16 | Levels::from(inner as u16);
            }
            self.count += 1;
            if HEADING == NORTH {
                self.waiting[pixel] = 0;
            }
            let ahead = pixel.wrapping_add(steps[HEADING]);
            inner = self.values[ahead];
            if inner >= 0 {
                self.turns += 1;
                break (pixel, place, (HEADING + 1) % 4);
            }
            let aside = ahead.wrapping_add(steps[left]);
            outer = self.values[aside];
            place = place.wrapping_add(moves[HEADING]);
            if outer < 0 {
                // Round the corner of the same pixel of twine.
                self.turns -= 1;
                break (aside, place.wrapping_add(moves[left]), left);
            }
            pixel = ahead;
            if HEADING == NORTH && pixel == self.start {
                return None;
            }
        };
        Some(next).filter(|&(pixel, _, heading)| pixel != self.start || heading != NORTH)
    }
}

/// Where twine is left of an opening, as a task for wide vectors.
struct LeftCracks<'a> {
    values: &'a [i16],
    /// As many; negative there.
    left_cracks: &'a mut [i8],
}

impl pulp::WithSimd for LeftCracks<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let ([_, values @ ..], [_, left_cracks @ ..]) = (self.values, self.left_cracks) else { return };
        for (to, (&left, &here)) in left_cracks.iter_mut().zip(self.values.iter().zip(values)) {
            *to = ((!left & here) >> 15) as i8;
        }
    }
}

/// The cracks around an opening, as a task for wide vectors: to its outline.
struct Cracks<'a> {
    places: &'a [Place],
    levels: &'a [Levels],
    /// As many.
    crossings: &'a mut [Crossing],
}

impl<'a> pulp::WithSimd for Cracks<'a> {
    type Output = Outline<'a>;

    /// The level passes from negative to not negative: between whole numbers at -1/2, so that no crossing falls on a pixel and no outline touches itself.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> Outline<'a> {
        let column = |place: Place| (place & 0x7FFF) as i32;
        let row = |place: Place| (place >> 16 & 0x7FFF) as i32;
        // The heading's lower and higher bit.
        let bits = |place: Place| ((place >> 15 & 1) as i32, (place >> 31) as i32);
        let outer = |levels: Levels| levels as i32 >> 16;
        for (to, (&place, &levels)) in self.crossings.iter_mut().zip(self.places.iter().zip(self.levels)) {
            let (odd, second) = bits(place);
            // inner < 0 <= outer, and neither is beyond 8160 (255 grey levels and the offset, in sixteenths): the part is above 0 and below a whole one. The frame's level is no measurement.
            let (inner, outer) = ((levels << 16) as i32 >> 16, outer(levels));
            let part = (inner as f32 + 0.5) * Crossing::PARTS as f32 / (inner - outer) as f32;
            let part = if outer == i32::from(FRAME) { Crossing::PARTS / 2 } else { i32::from(rounded(part)) };
            // Left of east is north, of south east, of west south, of north west.
            let part = if odd == second { -part } else { part };
            to.x = column(place) * Crossing::PARTS + (part & -odd);
            to.y = row(place) * Crossing::PARTS + (part & (odd - 1));
        }
        let cut = self.levels.iter().fold(0, |most, &levels| outer(levels).max(most)) == i32::from(FRAME);
        let (mut lefts, mut tops) = (0, 0);
        let (mut first_column, mut last_column, mut first_row, mut last_row) = (i32::MAX, 0, i32::MAX, 0);
        for &place in self.places {
            let (odd, second) = bits(place);
            lefts += odd & second;
            tops += 1 - (odd | second);
            first_column = first_column.min(column(place));
            last_column = last_column.max(column(place));
            first_row = first_row.min(row(place));
            last_row = last_row.max(row(place));
        }
        let gapless = (tops, lefts) == (last_column - first_column + 1, last_row - first_row + 1);
        Outline::of(self.crossings, cut, gapless)
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
