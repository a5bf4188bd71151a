//! A net behind a net: the twine of the first is painted over where it was measured, and the search begins again.
//!
//! What is left of the first net is a lattice, too. A second one is believed only if its twine shows where the first one has none
//! ([`Workspace::shown`]), and if it is not the first one's lattice over again ([`same_lattice`]).

use net_image::{GrayView, Image};

use crate::answer::estimate::LatticeEstimate;
use crate::config::Config;
use crate::drawing::paint::{Lines, at, each_pixel, slope};
use crate::drawing::polarity::contrasts;
use crate::drawing::template::{Profile, look_up};
use crate::error::Result;
use crate::estimator::LatticeEstimator;
use crate::numeric::wrap;
use crate::picture::view::Level;
use crate::sheet::chart::Chart;
use crate::sheet::surface::Surface;
use crate::workspace::Workspace;

/// Largest difference, cells, between two lattices of one sheet under other names, to a cell.
const SAME: f64 = 0.1;

impl LatticeEstimator {
    /// The net before or behind one that was found in the same picture: the twine of `first` is painted over, and a cold start looks for
    /// another. Which of the two is in front their ranges tell. The probability is that of any estimate, times the chance that it is no
    /// remainder of the first. `None` when nothing periodic is left, or the first hides too much to tell.
    ///
    /// Takes as long as a cold start, allocates, and changes nothing about what [`LatticeEstimator::update`] follows.
    ///
    /// # Errors
    /// [`crate::Error::Geometry`] when the picture's size is not the camera's.
    pub fn another(&mut self, image: GrayView<'_>, first: &LatticeEstimate) -> Result<Option<LatticeEstimate>> {
        self.camera().check_image_size(image.width() as u32, image.height() as u32)?;
        let config = self.config.clone();
        let Some(work) = &mut self.work else { return Ok(None) };
        let kept = (work.last, work.stages);
        work.load(image);
        let found = work.another(&config, first);
        (work.last, work.stages) = kept;
        Ok(found)
    }
}

impl Workspace {
    fn another(&mut self, config: &Config, first: &LatticeEstimate) -> Option<LatticeEstimate> {
        let cell = self.cell_px(first.range);
        self.high(0, cell);
        let level = &mut self.view.levels[0];
        self.tools.map.fill(&first.surface, level);
        let lines = Lines::measured(&self.tools.map, level, first.labels.families(first.polarity))?;
        let least = self.scope.sides.map(|s| 0.5 * (self.twine / s) as f32);
        let painted = lines.paint_over(&self.tools.map, level, least, first.blur, &mut self.tools.smoother)?;
        self.view.average_down();
        self.tools.forget();
        let mut second = self.cold(config)?;
        let logistic = |x: f64| 1.0 / (1.0 + (-x).exp());
        let shown = self.shown(&second, &painted);
        let same = same_lattice(&first.surface, &second.surface, &self.view.levels[0]);
        second.probability *= logistic((shown - 0.5) / 0.04) * logistic((0.3 - same) / 0.03);
        Some(second)
    }

    /// Share of the tiles in which the twine of a net shows between what was painted over, of those in which there is room for it.
    fn shown(&mut self, net: &LatticeEstimate, painted: &Image<f32>) -> f64 {
        let cell = self.cell_px(net.range);
        self.high(0, cell);
        let level = &self.view.levels[0];
        let map = &mut self.tools.map;
        map.fill(&net.surface, level);
        let (sign, both) = contrasts(net.labels.families(net.polarity));
        let mut profiles = [Profile::default(), Profile::default()];
        profiles.iter_mut().zip(self.scope.sides).for_each(|(p, s)| p.prepare(self.twine / s));
        let grid = &level.tiles[self.view.tiling_for(cell)];
        // n, T, TT, I, IT, II
        let mut sums = vec![[0.0f64; 6]; grid.nx * grid.ny];
        let (bx, by) = level.blocks();
        for y in 0..by {
            for x in 0..bx {
                let Some(planes) = map.block(x, y) else { continue };
                let rows: [_; 2] = std::array::from_fn(|f| profiles[f].row((net.blur as f32) * slope(&planes[f])));
                let tile = &mut sums[usize::from(grid.row[y]) * grid.nx + usize::from(grid.column[x])];
                each_pixel(x, y, |column, row, u, v| {
                    if painted.row(row)[column] > 0.0 {
                        return;
                    }
                    let [p, q] = std::array::from_fn(|f| look_up(rows[f], wrap(at(&planes[f], u, v))).0);
                    let t = f64::from(sign[0] * p + sign[1] * q - both * p * q);
                    let i = f64::from(level.high.row(row)[column]);
                    for (sum, value) in tile.iter_mut().zip([1.0, t, t * t, i, i * t, i * i]) {
                        *sum += value;
                    }
                });
            }
        }
        let (mut room, mut seen) = (0.0f64, 0.0);
        for [n, t, tt, i, it, ii] in sums {
            if n < 0.1 * grid.area {
                continue;
            }
            let (var_t, cov, var_i) = (tt - t * t / n, it - i * t / n, ii - i * i / n);
            // As much as two pixels of twine.
            if var_t < 2.0 {
                continue;
            }
            room += 1.0;
            let noise = ((var_i - cov * cov / var_t) / n).max(1e-12);
            seen += f64::from(u8::from(cov > 2.5 * (var_t * noise).sqrt()));
        }
        // A handful of tiles proves nothing.
        seen / room.max(0.2 * (grid.nx * grid.ny) as f64)
    }
}

/// Share of the places about which both sheets are seen where one lattice is the other over again: the same twines under other names.
fn same_lattice(first: &Surface, second: &Surface, level: &Level) -> f64 {
    let (a, b) = (first.chart(), second.chart());
    let (mut both, mut same) = (0.0f64, 0.0);
    for site in level.tiles[0].sites.iter().filter(|s| s.valid) {
        let slopes = |chart: &Chart| {
            let [p, q, r] = [site.ray, site.next[0], site.next[1]].map(|r| chart.at(r[0], r[1]).map(|p| p.s));
            let (p, q, r) = (p?, q?, r?);
            Some([[q[0] - p[0], r[0] - p[0]], [q[1] - p[1], r[1] - p[1]]])
        };
        let (Some(j), Some(k)) = (slopes(&a), slopes(&b)) else { continue };
        let det = j[0][0] * j[1][1] - j[0][1] * j[1][0];
        if det.abs() < 1e-12 {
            continue;
        }
        both += 1.0;
        // Cells of the second to a cell of the first.
        let ratio =
            |f: usize| [(k[f][0] * j[1][1] - k[f][1] * j[1][0]) / det, (k[f][1] * j[0][0] - k[f][0] * j[0][1]) / det];
        let m = [ratio(0), ratio(1)];
        let whole = m.map(|row| row.map(f64::round));
        let near = m.iter().flatten().zip(whole.iter().flatten()).all(|(m, w)| (m - w).abs() < SAME);
        same += f64::from(u8::from(near && (whole[0][0] * whole[1][1] - whole[0][1] * whole[1][0]).abs() == 1.0));
    }
    same / both.max(1.0)
}
