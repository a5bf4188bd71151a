//! The outline of a mesh opening: where it runs, what it encloses, its convex hull.

use std::cmp::Ordering;

use net_geometry::nalgebra::Vector2;

/// Where the threshold's level crosses zero between two pixels, in parts of [`Crossing::PARTS`] to a pixel. As whole numbers crossings are compared,
/// summed and multiplied exactly; images have at most 32768 pixels a side, so that two differences' product fits 64 bits twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Crossing {
    pub x: i32,
    pub y: i32,
}

impl Crossing {
    /// Parts of a pixel: far finer than any picture tells.
    pub const PARTS: i32 = 1 << 14;

    /// The same in px.
    pub fn pixel(self) -> Vector2<f64> {
        Vector2::new(f64::from(self.x), f64::from(self.y)) / f64::from(Self::PARTS)
    }

    /// The way from another crossing.
    fn from(self, other: Self) -> [i64; 2] {
        [self.x - other.x, self.y - other.y].map(i64::from)
    }
}

/// The closed outline of an opening, which never crosses or touches itself.
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
    /// Whether the opening's pixels have no gap in any row or column of the picture, as a mesh has none but for tufts.
    pub gapless: bool,
}

impl<'a> Outline<'a> {
    /// The outline through `crossings`.
    #[inline(always)]
    pub fn of(crossings: &'a [Crossing], cut: bool, gapless: bool) -> Self {
        let first = crossings.first().copied().unwrap_or(Crossing { x: 0, y: 0 });
        let (mut doubled_area, mut sum) = (0_i64, [0_i64; 2]);
        for [before, here] in crossings.array_windows() {
            let ([x, y], [u, v]) = (here.from(first), before.from(first));
            // Partial sums may pass the largest number; what an image holds does not.
            doubled_area = doubled_area.wrapping_add(u * y - v * x);
            sum = [sum[0] + x, sum[1] + y];
        }
        let parts = f64::from(Crossing::PARTS);
        let mean = Vector2::from(sum.map(|sum| sum as f64)) / (crossings.len().max(1) as f64 * parts);
        let area = 0.5 * doubled_area as f64 / (parts * parts);
        Self { crossings, area, middle: first.pixel() + mean, cut, gapless }
    }

    /// Its crossings, px.
    pub fn pixels(&self) -> impl Iterator<Item = Vector2<f64>> {
        self.crossings.iter().map(|crossing| crossing.pixel())
    }
}

/// Finds outlines' convex hulls; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Huller {
    /// Crossings left by one thinning, and by the next.
    turns: [Vec<Crossing>; 2],
    /// The hull of the crossings so far, its latest corner at both ends; grows at both.
    chain: Vec<Crossing>,
    hull: Vec<Vector2<f64>>,
}

impl Huller {
    /// Makes room for outlines of up to `longest` crossings, so that none of them needs memory.
    pub fn reserve(&mut self, longest: usize) {
        let Self { turns: [once, twice], chain, hull } = self;
        for crossings in [once, twice] {
            crossings.clear();
            crossings.reserve(longest);
        }
        chain.clear();
        chain.reserve(2 * longest + 2);
        hull.clear();
        hull.reserve(longest);
    }

    /// The corners of the outline's convex hull, px, in the sense from u to v, those on its edges left out. The outline does not cross itself, so that one
    /// look at each crossing is enough (Melkman 1987). Empty if all lie on a line.
    pub fn hull(&mut self, outline: &Outline) -> &[Vector2<f64>] {
        self.hull.clear();
        let mut crossings = outline.crossings;
        if outline.gapless {
            // Each thinning leaves about half, and needs no guess at where the border turns.
            let [here, there] = &mut self.turns;
            outward_turns(crossings, here);
            outward_turns(here, there);
            outward_turns(there, here);
            crossings = here;
        }
        let Some((first, second, next)) = first_corners(crossings) else { return &self.hull };
        // It grows by at most one corner at either end for each crossing.
        self.chain.resize(2 * crossings.len() + 2, first);
        let chain = &mut self.chain[..];
        let (mut low, mut high) = (crossings.len() - 1, crossings.len() + 2);
        let third = crossings[next];
        let (left, right) = match bend(first, second, third) {
            Ordering::Greater => (first, second),
            _ => (second, first),
        };
        chain[low..=high].copy_from_slice(&[third, left, right, third]);
        for &crossing in &crossings[next + 1..] {
            // An outline comes out of the hull only beside its latest corner.
            let before_it = !inside(chain[high - 1], chain[high], crossing, Ordering::Greater);
            let behind_it = !inside(chain[low + 1], chain[low], crossing, Ordering::Less);
            if before_it {
                high -= 1;
                while high > low + 1 && bend(chain[high - 1], chain[high], crossing) != Ordering::Greater {
                    high -= 1;
                }
            }
            if behind_it {
                low += 1;
                while high > low + 1 && bend(chain[low + 1], chain[low], crossing) != Ordering::Less {
                    low += 1;
                }
            }
            if before_it || behind_it {
                (low, high) = (low - 1, high + 1);
                (chain[low], chain[high]) = (crossing, crossing);
            }
        }
        self.hull.extend(chain[low..high].iter().map(|crossing| crossing.pixel()));
        &self.hull
    }
}

/// The crossings at which the outline of a gapless opening does not turn inwards, into `turns` (cleared first). Between its four outermost points such an
/// outline runs along one diagonal, so that what is left has the same hull and does not cross itself either.
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

/// How the way by three crossings bends: `Greater` in the sense from u to v.
fn bend(a: Crossing, b: Crossing, c: Crossing) -> Ordering {
    let (there, on) = (b.from(a), c.from(b));
    (there[0] * on[1]).cmp(&(there[1] * on[0]))
}

/// Whether `c` lies on the side `within` of the edge from `a` to `b`, or on its line but not on from `b`.
fn inside(a: Crossing, b: Crossing, c: Crossing, within: Ordering) -> bool {
    let side = bend(a, b, c);
    let (there, on) = (b.from(a), c.from(b));
    side == within || side == Ordering::Equal && there[0] * on[0] <= -(there[1] * on[1])
}

/// The outline's first crossing, the farthest from it on its first straight way, and where the first one off that way is.
fn first_corners(crossings: &[Crossing]) -> Option<(Crossing, Crossing, usize)> {
    let (&first, rest) = crossings.split_first()?;
    let mut second = first;
    for (k, &crossing) in rest.iter().enumerate() {
        if bend(first, second, crossing) != Ordering::Equal {
            return Some((first, second, k + 1));
        }
        let far = |c: Crossing| c.from(first).map(i64::abs);
        if far(crossing) > far(second) {
            second = crossing;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::contour::level::Level;
    use crate::contour::rectangle::convex_hull;
    use crate::contour::trace::Tracer;

    /// Holds every outline's hull against that of its points by another way; tells how many outlines had no gap, of how many.
    fn check_hulls(level: &Level) -> (usize, usize) {
        let (mut huller, mut all) = (Huller::default(), Vec::new());
        let (mut gapless, mut count) = (0, 0);
        Tracer::default().trace(level, usize::MAX, |outline| {
            gapless += usize::from(outline.gapless);
            count += 1;
            convex_hull(&mut outline.pixels().collect::<Vec<_>>(), &mut all);
            let mut hull = huller.hull(&outline).to_vec();
            // The same corners round, from another one on.
            if let Some(start) = hull.iter().position(|p| p == &all[0]) {
                hull.rotate_left(start);
            }
            assert_eq!(hull, all);
        });
        (gapless, count)
    }

    proptest! {
        #[test]
        fn any_outline_has_the_hull_of_its_points(
            width in 1_usize..20,
            levels in prop::collection::vec(-3_i16..3, 20 * 16),
        ) {
            check_hulls(&Level::from_fn(width, 16, |u, v| levels[v * width + u]));
        }

        #[test]
        fn so_has_that_of_a_turned_oblong_or_oval(
            (half1, half2) in (0.8_f64..15.0, 0.8_f64..15.0),
            angle in 0.0..3.2,
            // Steep borders give crossings near the middle between pixels, shallow ones anywhere.
            steepness in 1.0..200.0,
            oval in any::<bool>(),
            noise in prop::collection::vec(-4_i16..4, 40 * 40),
        ) {
            let level = Level::from_fn(40, 40, |u, v| {
                let d = Vector2::new(u as f64 - 19.7, v as f64 - 20.1);
                let (sine, cosine): (f64, f64) = f64::sin_cos(angle);
                let (x, y) = ((d.x * cosine + d.y * sine).abs() / half1, (d.y * cosine - d.x * sine).abs() / half2);
                let out = if oval { x.hypot(y) } else { x.max(y) } - 1.0;
                (steepness * out * half1.min(half2)) as i16 + noise[v * 40 + u]
            });
            check_hulls(&level);
        }
    }

    #[test]
    fn an_upright_square_has_no_gap_and_a_horseshoe_has() {
        let square = Level::from_fn(20, 20, |u, v| if (4..15).contains(&u) && (3..17).contains(&v) { -5 } else { 5 });
        assert_eq!(check_hulls(&square), (1, 1));
        let horseshoe = Level::from_fn(20, 20, |u, v| {
            let outside = !(2..18).contains(&u) || !(2..18).contains(&v);
            if outside || (6..14).contains(&u) && v < 14 { 5 } else { -5 }
        });
        assert_eq!(check_hulls(&horseshoe), (0, 1));
    }
}
