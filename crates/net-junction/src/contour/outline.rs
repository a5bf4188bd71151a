//! The outline of a mesh opening: where it runs, what it encloses, its convex hull.

use std::iter::once;

use net_geometry::nalgebra::Vector2;

use crate::contour::rectangle::half_hull;

/// Where the threshold's level crosses zero between two pixels, in parts of [`Crossing::PARTS`] to a pixel. As whole numbers crossings are compared,
/// summed and multiplied exactly; images have at most 32768 pixels a side, so that the difference of two fits too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Crossing {
    pub x: i32,
    pub y: i32,
}

impl Crossing {
    /// Parts of a pixel: far finer than any picture tells.
    pub const PARTS: i32 = 1 << 16;

    /// The same in px.
    pub fn pixel(self) -> Vector2<f64> {
        Vector2::new(f64::from(self.x), f64::from(self.y)) / f64::from(Self::PARTS)
    }

    /// Orders by x, then by y, in one comparison.
    fn order(self) -> i64 {
        // The sign bit turned, negative numbers come before the others among unsigned ones.
        i64::from(self.x) << 32 | i64::from(self.y as u32 ^ (1 << 31))
    }

    /// The way from another crossing.
    fn from(self, other: Self) -> [i64; 2] {
        [i64::from(self.x) - i64::from(other.x), i64::from(self.y) - i64::from(other.y)]
    }
}

/// The closed outline of an opening.
#[derive(Debug)]
pub(crate) struct Outline<'a> {
    /// Crossings of the threshold in the sense from u to v.
    pub crossings: &'a [Crossing],
    /// Enclosed area, px² (Green's theorem on the crossings).
    pub area: f64,
    /// Mean of the crossings, px.
    pub middle: Vector2<f64>,
    /// Whether the picture's end cuts the opening.
    pub cut: bool,
}

impl<'a> Outline<'a> {
    /// The outline through `crossings`.
    pub fn of(crossings: &'a [Crossing], cut: bool) -> Self {
        let first = crossings.first().copied().unwrap_or(Crossing { x: 0, y: 0 });
        let (mut doubled_area, mut sum, mut before) = (0.0, Vector2::zeros(), Vector2::zeros());
        for crossing in crossings {
            let [x, y] = crossing.from(first);
            let point = Vector2::new(x as f64, y as f64);
            doubled_area += before.perp(&point);
            sum += point;
            before = point;
        }
        let parts = f64::from(Crossing::PARTS);
        let mean = sum / (crossings.len().max(1) as f64 * parts);
        Self { crossings, area: 0.5 * doubled_area / (parts * parts), middle: first.pixel() + mean, cut }
    }

    /// Its crossings, px.
    pub fn pixels(&self) -> impl Iterator<Item = Vector2<f64>> {
        self.crossings.iter().map(|crossing| crossing.pixel())
    }
}

/// Finds outlines' convex hulls; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Huller {
    turns: Vec<Crossing>,
    /// Those to the left and to the right of the way from the first to the last.
    sides: [Vec<Crossing>; 2],
    hull: Vec<Vector2<f64>>,
}

impl Huller {
    /// The corners of the outline's convex hull, px, in the sense from u to v: each side of it by itself (Andrew 1979).
    pub fn hull(&mut self, outline: &Outline) -> &[Vector2<f64>] {
        self.hull.clear();
        outward_turns(outline.crossings, &mut self.turns);
        let ends = self.turns.iter().map(|&crossing| (crossing.order(), crossing));
        let (first, last) = (ends.clone().min_by_key(|end| end.0), ends.max_by_key(|end| end.0));
        let (Some((_, first)), Some((_, last))) = (first, last) else { return &self.hull };
        split(&self.turns, first, last, &mut self.sides);
        let [left, right] = &mut self.sides;
        left.sort_unstable_by_key(|crossing| crossing.order());
        right.sort_unstable_by_key(|crossing| crossing.order());
        let there = once(&first).chain(&*left).chain(once(&last));
        let back = once(&last).chain(right.iter().rev()).chain(once(&first));
        half_hull(there.map(|crossing| crossing.pixel()), &mut self.hull);
        half_hull(back.map(|crossing| crossing.pixel()), &mut self.hull);
        &self.hull
    }
}

/// Crossings on either side of the way from `first` to `last`; those on it are no corners of any hull but for these two.
fn split(crossings: &[Crossing], first: Crossing, last: Crossing, sides: &mut [Vec<Crossing>; 2]) {
    let way = last.from(first);
    for side in &mut *sides {
        side.resize(crossings.len(), first);
    }
    let (mut lefts, mut rights) = (0, 0);
    let [left, right] = sides;
    for &crossing in crossings {
        let [x, y] = crossing.from(first);
        let aside = way[0] * y - way[1] * x;
        left[lefts] = crossing;
        lefts += usize::from(aside < 0);
        right[rights] = crossing;
        rights += usize::from(aside > 0);
    }
    left.truncate(lefts);
    right.truncate(rights);
}

/// The crossings at which an outline does not turn inwards, into `turns` (cleared first). It does not cross itself, so they have the same hull as all.
fn outward_turns(outline: &[Crossing], turns: &mut Vec<Crossing>) {
    turns.clear();
    let &[.., before, here] = outline else { return };
    turns.resize(outline.len(), here);
    let (mut here, mut step, mut kept) = (here, here.from(before), 0);
    for &after in outline {
        // Every crossing is written and only counted where it stays: where a border turns nobody can predict.
        let next = after.from(here);
        turns[kept] = here;
        kept += usize::from(step[0] * next[1] >= step[1] * next[0]);
        (here, step) = (after, next);
    }
    turns.truncate(kept);
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::contour::level::Level;
    use crate::contour::rectangle::convex_hull;
    use crate::contour::trace::Tracer;

    proptest! {
        #[test]
        fn the_outward_turns_of_any_outline_have_its_hull(
            width in 1_usize..20,
            // Zeros are many: there several crossings of an outline fall on one pixel.
            levels in prop::collection::vec(-3_i16..3, 20 * 16),
        ) {
            let level = Level::from_fn(width, 16, |u, v| levels[v * width + u]);
            let (mut huller, mut all) = (Huller::default(), Vec::new());
            Tracer::default().trace(&level, usize::MAX, |outline| {
                convex_hull(&mut outline.pixels().collect::<Vec<_>>(), &mut all);
                assert_eq!(huller.hull(&outline), all);
            });
        }
    }
}
