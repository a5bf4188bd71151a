//! What the stages of an estimator share: the pyramid, plans and buffers.

use net_geometry::{Camera, Mesh};
use net_image::GrayView;

use crate::answer::decision::Evidence;
use crate::answer::estimate::Followed;
use crate::answer::fold::Folder;
use crate::answer::stages::Stages;
use crate::config::Config;
use crate::drawing::likelihood::Likelihood;
use crate::drawing::polarity::Polarity;
use crate::lock::comb::LOOKS;
use crate::lock::demodulate::{Columns, TileSum};
use crate::lock::lockin::Measurement;
use crate::lock::seed::{Said, Seed};
use crate::lock::spread::Spread;
use crate::numeric::clip_level;
use crate::picture::smooth::Smoother;
use crate::picture::view::{LEVELS, View};
use crate::picture::window::Window;
use crate::search::background::Background;
use crate::search::spectra::{Bank, Spectra};
use crate::search::table::{Candidate, Scope, Search};
use crate::sheet::alike::Influence;
use crate::sheet::fit::{Fitter, Observation, Prior};
use crate::sheet::map::PhaseMap;
use crate::sheet::surface::{self, Surface};
use crate::start::periods::Rival;

/// Smallest cell, full-resolution px on the axis, that is looked for.
pub(crate) const SMALLEST_CELL: f64 = 3.7;

#[derive(Debug)]
pub(crate) struct Workspace {
    pub view: View,
    pub banks: Vec<(Bank, Search)>,
    pub spectra: Spectra,
    pub background: Background,
    pub tools: Tools,
    pub scope: Scope,
    pub prior: Prior,
    pub candidates: Vec<Candidate>,
    /// Those of one bank.
    pub found: Vec<Candidate>,
    pub locks: Vec<Lock>,
    pub rivals: Vec<Rival>,
    /// Twine diameter, m.
    pub twine: f64,
    /// What the next picture starts from.
    pub last: Option<Followed>,
    /// What the stages of the last picture gave, if it was a cold start.
    pub stages: Option<Stages>,
}

/// Buffers that the stages share.
#[derive(Debug, Default)]
pub(crate) struct Tools {
    pub smoother: Smoother,
    pub map: PhaseMap,
    /// Sums of a lock-in by column of blocks in one row of tiles, and by tile.
    pub columns: Vec<Columns>,
    pub sums: Vec<TileSum>,
    /// Cells by which sums are turned.
    pub turns: Vec<[f64; 2]>,
    pub measurements: Vec<Measurement>,
    /// The same by each look.
    pub looks: [Vec<Said>; LOOKS.len()],
    pub observations: Vec<Observation>,
    pub fitter: Fitter,
    pub likelihood: Likelihood,
    pub histogram: Vec<u32>,
    pub scratch: Vec<f64>,
    pub influences: Vec<Influence>,
    pub folder: Folder,
    pub spread: Spread,
    /// Tiles, of this tiling, that a comparison of drawings looks at; empty for all.
    pub mask: Vec<bool>,
    pub tiling: usize,
    /// Length of the filter of each level's `high`; zero for none yet.
    pub high: [f64; LEVELS],
    /// The level whose `high` the likelihood has.
    pub loaded: Option<usize>,
    /// The same of `thin`, and the gain of the lock-in.
    pub thin: [(f64, f32); LEVELS],
    /// The sheet, level and tiling of `sums`, where all of the picture is in them.
    pub summed: Option<(Surface, (usize, usize))>,
}

impl Tools {
    /// Another picture: nothing is filtered yet.
    pub(crate) fn forget(&mut self) {
        self.high = [0.0; LEVELS];
        self.loaded = None;
        self.thin = [(0.0, 0.0); LEVELS];
        self.summed = None;
    }
}

/// A locked candidate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lock {
    /// The candidate's score in the search, and how far it stood above its background.
    pub score: f64,
    pub above: f64,
    pub surface: Surface,
    /// What the search gave to lock to.
    pub start: Surface,
    pub seed: Seed,
    pub evidence: Evidence,
    pub gain: f64,
    pub polarity: [Polarity; 2],
    pub blur: f64,
    /// Standard deviation of the window about the optical axis in which the sheet is fitted, px of an 848 x 480 px picture.
    pub focus: f64,
    /// Side of a cell, px, down to which the picture is averaged before it is compared with the drawing.
    pub drawn_cell_px: f64,
    /// Whether only the rest of a prediction is left to be found: one drawing in closed form, one set of derivatives.
    pub quick: bool,
}

impl Lock {
    /// Coherence of the family that agrees less: what both have.
    pub(crate) fn coherence(&self) -> f64 {
        self.evidence.v[0].min(self.evidence.v[1])
    }
}

impl Workspace {
    pub(crate) fn new(camera: &Camera, mesh: &Mesh, config: &Config, view: View) -> Self {
        let mut banks = Vec::new();
        let reduction = view.reduction as f64;
        // Tiles of 160 px for cells up to 60 px, of 360 px for those up to 136 px (848 x 480 px).
        for (half, length, columns, rows, smooth) in [(0, 160.0, 9, 5, 10.0), (1, 360.0, 5, 2, 24.0)] {
            let level = half.min(view.levels.len() - 1);
            let scale = view.levels[level].scale;
            let tile = length * view.size / scale;
            if let Some(bank) = Bank::new(camera, &view, level, tile, columns, rows, smooth * view.size) {
                let side = bank.length as f64 * scale;
                let smallest = if half == 0 { SMALLEST_CELL * reduction } else { 0.075 * side };
                let largest = 0.378 * side;
                if largest > 1.3 * smallest {
                    let search = Search::new(&view, &bank, smallest, largest);
                    banks.push((bank, search));
                }
            }
        }
        let sides = [mesh.side1(), mesh.side2()];
        let mut tools = Tools::default();
        let tiles = view.levels.iter().flat_map(|level| &level.tiles).map(|grid| grid.sites.len());
        tools.fitter.bumps.reserve(tiles.max().unwrap_or(0));
        tools.likelihood.set_widths(sides.map(|side| config.twine_diameter_m / side));
        Self {
            scope: Scope { sides, angle: mesh.angle(), angle_sigma: config.crossing_angle_sigma_deg.to_radians() },
            prior: Prior {
                sigma: surface::prior(config),
                angle: mesh.angle(),
                bumps: [config.height_sigma_m, config.height_length_m],
                held: 0.0,
            },
            banks,
            spectra: Spectra::new(),
            background: Background::default(),
            tools,
            candidates: Vec::new(),
            found: Vec::new(),
            locks: Vec::new(),
            rivals: Vec::new(),
            twine: config.twine_diameter_m,
            last: None,
            stages: None,
            view,
        }
    }

    pub(crate) fn load(&mut self, image: GrayView<'_>) {
        self.view.load(image);
        self.stages = None;
        self.tools.smoother.least = Smoother::FINE;
        self.tools.forget();
    }

    /// Full-resolution px of a cell (geometric mean of the sides) on the axis.
    pub(crate) fn cell_px(&self, depth: f64) -> f64 {
        self.view.focal * (self.scope.sides[0] * self.scope.sides[1]).sqrt() / depth
    }

    /// The shorter side in full-resolution px.
    pub(crate) fn short_px(&self, depth: f64) -> f64 {
        self.view.focal * self.scope.sides[0].min(self.scope.sides[1]) / depth
    }

    /// Makes sure that `high` of a level is filtered for drawing cells of `cell` px.
    pub(crate) fn high(&mut self, level: usize, cell: f64) {
        let sigma = self.view.high_pass_px(cell);
        let t = &mut self.tools;
        if t.high[level] != sigma {
            t.high[level] = sigma;
            t.loaded = t.loaded.filter(|loaded| *loaded != level);
            self.view.levels[level].filter_high(sigma, &mut t.smoother);
        }
    }

    /// Makes sure that `thin` of a level is filtered for locking to cells of `cell` px; returns the lock-in's gain.
    pub(crate) fn thin(&mut self, level: usize, cell: f64) -> f32 {
        let sigma = self.view.thin_px(cell);
        let t = &mut self.tools;
        if t.thin[level].0 != sigma {
            self.view.levels[level].filter_thin(sigma, &mut t.smoother, &mut t.histogram);
            let q = clip_level(self.view.levels[level].thin.data().iter().copied(), &mut t.histogram);
            t.thin[level] = (sigma, 1.0 / (q + 1e-9));
        }
        t.thin[level].1
    }

    /// Level and tiling of the lock-in for a depth.
    pub(crate) fn scale_for(&self, depth: f64) -> (usize, usize) {
        (self.view.level_for(self.short_px(depth), 12.0), self.view.tiling_for(self.cell_px(depth)))
    }

    /// The same where three harmonics are enough to go on: on the way, and for a net that is followed.
    pub(crate) fn coarse_scale_for(&self, depth: f64) -> (usize, usize) {
        (self.view.level_for(self.short_px(depth), 8.0), self.view.tiling_for(self.cell_px(depth)))
    }

    /// A window about the optical axis, radius in px of an 848 x 480 px picture.
    pub(crate) fn window(&self, radius: f64) -> Window {
        Window { centre: self.view.centre, radius: radius * self.view.size }
    }
}
