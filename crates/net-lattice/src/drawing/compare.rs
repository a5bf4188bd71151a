//! The net drawn on the working picture: what it explains, and the sheet refined on it.

use crate::drawing::likelihood::Drawing;
use crate::drawing::polarity::Polarity;
use crate::sheet::fit::{Fit, Prior, Robust};
use crate::sheet::model::Model;
use crate::sheet::surface::Surface;
use crate::workspace::{Lock, Workspace};

/// How many times as much as their prior the bumps of the last picture count in the next: a net does not change its shape from frame to frame. Of 3, 10 and 30 the last two are as good on
/// a path-traced sequence (the normal 0.54 degrees off its true tangent in the median, where the first has 0.74).
const HELD: f64 = 10.0;

impl Workspace {
    /// How to draw and compare a net at `depth` on `level`, high-passed for cells of `cell` px.
    pub(crate) fn drawing(&self, level: usize, cell: f64, polarity: [Polarity; 2], blur_px: f64) -> Drawing {
        let scale = self.view.levels[level].scale;
        // The average over a level's pixel adds its own blur.
        let own = (1.0 - 1.0 / (scale * scale)).max(0.0) / 12.0;
        Drawing {
            polarity,
            blur: ((blur_px / scale).powi(2) + own).sqrt(),
            offset: [0.0; 2],
            contrast_length: (36.0 * self.view.size).max(0.8 * cell) / scale,
            high_pass: self.view.high_pass_px(cell) / scale,
            sparse: false,
            quick: false,
        }
    }

    /// Best gain of the drawing over polarities and blurs (px), one block in four compared. Dark twine is the lattice half a cell off
    /// with the opposite sign: the lock-in cannot tell it from bright twine, the drawing can.
    pub(crate) fn gain(
        &mut self,
        surface: &Surface,
        level: usize,
        cell: f64,
        polarities: &[[Polarity; 2]],
        blurs: &[f64],
    ) -> (f64, [Polarity; 2], f64) {
        self.high(level, cell);
        let area = self.view.levels[level].scale.powi(2);
        let mut best = (f64::NEG_INFINITY, [Polarity::Bright; 2], 0.0);
        self.tools.map.fill(surface, &self.view.levels[level]);
        self.load_likelihood(level);
        for &blur in blurs {
            for &polarity in polarities {
                let mut drawing = self.drawing(level, cell, polarity, blur);
                drawing.sparse = true;
                drawing.offset = polarity.map(Polarity::offset);
                let t = &mut self.tools;
                let gain = t.likelihood.gain(
                    &t.map,
                    &drawing,
                    &self.view.levels[level].tiles[t.tiling],
                    &t.mask,
                    &mut t.smoother,
                ) * area;
                if gain > best.0 {
                    best = (gain, polarity, blur);
                }
            }
        }
        best
    }

    /// Makes sure that the likelihood has the high-passed picture of a level.
    pub(crate) fn load_likelihood(&mut self, level: usize) {
        let t = &mut self.tools;
        if t.loaded != Some(level) {
            t.loaded = Some(level);
            t.likelihood.load(&self.view.levels[level]);
        }
    }

    /// Refines on the drawing, of all blocks or one in four: one shift per tile and pass, the sheet fitted to those.
    pub(crate) fn likelihood(
        &mut self,
        surface: &Surface,
        lock: &Lock,
        model: Model,
        passes: usize,
        sparse: bool,
    ) -> Option<(Fit, Robust)> {
        let cell = self.cell_px(surface.depth);
        let level = self.view.level_for(self.short_px(surface.depth), lock.drawn_cell_px);
        let tiling = self.view.tiling_for(cell);
        self.high(level, cell);
        self.load_likelihood(level);
        let focus = self.window(lock.focus);
        let quick = lock.quick;
        let drawing = Drawing { sparse, quick, ..self.drawing(level, cell, lock.polarity, lock.blur) };
        let t = &mut self.tools;
        let view = &self.view.levels[level];
        let prior = Prior { held: if lock.quick { HELD } else { 0.0 }, ..self.prior };
        let mut fit = None;
        let mut surface = *surface;
        for _ in 0..passes {
            t.map.fill(&surface, view);
            t.likelihood.observe(&surface, &t.map, &drawing, &view.tiles[tiling], &mut t.smoother, &mut t.observations);
            t.scratch.clear();
            t.scratch.extend(t.likelihood.shifts.iter().flatten().filter(|s| s.is_finite()).map(|s| s.abs()));
            let scale = (3.0 * 1.4826 * crate::numeric::median(&mut t.scratch)).max(0.01);
            let robust = Robust::Tile(scale);
            for o in &mut t.observations {
                let w = focus.weight(o.site.pixel);
                o.weight.iter_mut().for_each(|o| *o *= w);
            }
            let done = if lock.quick && model != Model::Bumpy {
                t.fitter.settle(&surface, model.parameters(), &t.observations, robust, &self.prior)?
            } else {
                t.fitter.fit_model(&surface, model, &t.observations, robust, &prior, 2)?
            };
            surface = done.surface;
            fit = Some((done, robust));
        }
        fit
    }
}
