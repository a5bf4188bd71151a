//! Neighbours of points of the plane.

use std::ops::Range;

use nalgebra::Vector2;

/// Points of the plane sorted into a grid of square cells, about two to a cell, so that neighbours are found without
/// looking at all.
///
/// A k-d tree would do as well, but kiddo's can neither be refilled nor asked for all points within a radius without
/// allocating; this keeps its buffers, and allocates nothing once it has held as many points. (The tests hold it
/// against kiddo.) Points that are not finite are nobody's neighbours.
#[derive(Debug, Clone, Default)]
pub struct NearestPoints {
    /// Top-left corner of the grid.
    origin: Vector2<f64>,
    /// Cells per unit of length.
    density: f64,
    columns: usize,
    rows: usize,
    /// Where each cell's points begin in `entries`; one more than there are cells.
    starts: Vec<u32>,
    /// The points and their indices, cell by cell, row by row.
    entries: Vec<(Vector2<f64>, u32)>,
}

/// Points to a cell, on average over the box around all points.
const POINTS_PER_CELL: f64 = 2.0;

/// Widening of a search, in cells, so that rounding excludes no point at exactly the radius.
const SLACK: f64 = 1e-6;

impl NearestPoints {
    /// Forgets the points before and takes `points`. No more than 2^32 of them.
    pub fn fill(&mut self, points: &[Vector2<f64>]) {
        self.entries.clear();
        self.starts.clear();
        let finite = || points.iter().zip(0u32..).filter(|(p, _)| p.x.is_finite() && p.y.is_finite());
        let (mut min, mut max) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        let mut count = 0;
        for (p, _) in finite() {
            (min, max) = (min.inf(p), max.sup(p));
            count += 1;
        }
        if count == 0 {
            (self.columns, self.rows) = (0, 0);
            return;
        }
        let cells = (count as f64 / POINTS_PER_CELL).max(1.0);
        let size = max - min;
        // On a line the area says nothing, so a side counts as no shorter than if all cells lay in one row.
        let long = size.amax();
        let (width, height) = (size.x.max(long / cells), size.y.max(long / cells));
        let density = (cells / width / height).sqrt();
        self.origin = min;
        // One point, or extents too large or small for numbers: one cell.
        self.density = if density.is_finite() && long.is_finite() { density } else { 0.0 };
        let along = |side: f64| ((side * self.density) as usize).min(2 * count) + 1;
        (self.columns, self.rows) = (along(size.x), along(size.y));

        // Counting sort: how many to a cell, where each cell ends, then each point to its place from the back.
        self.starts.resize(self.columns * self.rows + 1, 0);
        for (p, _) in finite() {
            let cell = self.cell(*p);
            self.starts[cell] += 1;
        }
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        self.entries.resize(count, (Vector2::zeros(), 0));
        for (p, index) in finite() {
            let cell = self.cell(*p);
            self.starts[cell] -= 1;
            self.entries[self.starts[cell] as usize] = (*p, index);
        }
    }

    /// Indices of the points at most `radius` away from `centre`, in no particular (but always the same) order.
    pub fn within(&self, centre: Vector2<f64>, radius: f64) -> impl Iterator<Item = usize> + '_ {
        let limit = radius * radius;
        self.candidates(centre, radius)
            .filter(move |(p, _)| (p - centre).norm_squared() <= limit)
            .map(|&(_, index)| index as usize)
    }

    /// Index and distance of the point nearest to `centre` and at most `radius` away; of equally near ones the first.
    pub fn nearest(&self, centre: Vector2<f64>, radius: f64) -> Option<(usize, f64)> {
        let limit = radius * radius;
        self.candidates(centre, radius)
            .map(|&(p, index)| ((p - centre).norm_squared(), index as usize))
            .filter(|&(square, _)| square <= limit)
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
            .map(|(square, index)| (index, square.sqrt()))
    }

    /// The points in all cells that a circle touches. None for a radius that is negative or NaN.
    fn candidates(&self, centre: Vector2<f64>, radius: f64) -> impl Iterator<Item = &(Vector2<f64>, u32)> + '_ {
        let at = (centre - self.origin) * self.density;
        // Infinite is every cell, also of a grid of one (0 times infinity is NaN).
        let reach = radius.min(f64::MAX) * self.density + SLACK;
        let sane = radius >= 0.0 && !self.entries.is_empty();
        let columns = if sane { cells_between(at.x - reach, at.x + reach, self.columns) } else { 0..0 };
        let rows = if columns.is_empty() { 0..0 } else { cells_between(at.y - reach, at.y + reach, self.rows) };
        rows.flat_map(move |row| {
            let first = self.starts[row * self.columns + columns.start] as usize;
            let last = self.starts[row * self.columns + columns.end] as usize;
            &self.entries[first..last]
        })
    }

    fn cell(&self, point: Vector2<f64>) -> usize {
        let at = (point - self.origin) * self.density;
        // Rounding may put the last point one cell too far.
        (at.y as usize).min(self.rows - 1) * self.columns + (at.x as usize).min(self.columns - 1)
    }
}

/// Cells from `low` to `high`, both counted in cells, of `count`. Empty for NaN.
fn cells_between(low: f64, high: f64, count: usize) -> Range<usize> {
    if !(low < count as f64 && high >= 0.0) {
        return 0..0;
    }
    // Casts saturate: what is below zero becomes zero.
    low as usize..(high as usize).min(count - 1) + 1
}
