use net_geometry::nalgebra::Matrix2;
use net_geometry::{Junction, JunctionState};
use net_image::GrayView;

use crate::adjust::between;
use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::{Graph, lower, median};
use crate::adjust::grow::{Grower, Warped};
use crate::adjust::locate::Locator;
use crate::adjust::map::LatticeMap;
use crate::adjust::presence::{Presence, Twine, TwineState};
use crate::adjust::profile::{FINE_PX, Profiles, coarse_px};
use crate::adjust::seen::{Witnesses, own_twines};
use crate::adjust::solve::Solver;
use crate::adjust::source::Source;
use crate::adjust::spread::Spreader;
use crate::adjust::template::Look;
use crate::error::{Error, Result};

/// No junction is claimed to be known better than this, px.
const SIGMA_MIN_PX: f64 = 0.03;
/// Standard deviation of the distance, in twine diameters, between a twine's axis and the middle of its brightness: light from
/// above makes the upper flank of white twine bright. Thin twine does not tell.
const SHADING: f64 = 0.12;
/// Rounds of robust reweighting: on newly sampled profiles, and on the same ones again.
const ROUNDS: [usize; 2] = [4, 3];
/// How often knots may lead to another prediction, how often to one that goes farther, and how many of them, and which part of all, must be elsewhere than the last one
/// says, or new.
const LED: usize = 2;
const CONTINUED: usize = 4;
const LED_FEWEST: usize = 4;
const LED_PART: usize = 100;
/// Contrast of twine that may lead to other twine.
const LED_CONTRAST: f32 = 1.0;

/// Adjusts a predicted lattice to a picture, node by node. Owns all buffers: after the first pictures no memory is allocated.
#[derive(Debug)]
pub struct NetAdjuster {
    config: AdjustConfig,
    width: usize,
    height: usize,
    source: Source,
    graph: Graph,
    grower: Grower,
    spreader: Spreader,
    profiles: Profiles,
    locator: Locator,
    solver: Solver,
    presence: Presence,
    witnesses: Witnesses,
    values: Vec<f32>,
    junctions: Vec<Junction>,
    twine_m: f64,
}

impl NetAdjuster {
    /// An adjuster for images of `width` x `height` px.
    ///
    /// # Errors
    /// [`Error::Value`] for a parameter out of range or an empty image.
    pub fn new(width: usize, height: usize, config: &AdjustConfig) -> Result<Self> {
        config.validate()?;
        for (field, value) in [("width", width), ("height", height)] {
            if value == 0 || value > 1 << 15 {
                return Err(Error::Value { field, value: value as f64, expected: "an image side from 1 to 32768 px" });
            }
        }
        Ok(Self {
            graph: Graph::new(width, height, config.cell_min_px),
            config: config.clone(),
            width,
            height,
            source: Source::default(),
            grower: Grower::default(),
            spreader: Spreader::default(),
            profiles: Profiles::default(),
            locator: Locator::default(),
            solver: Solver::default(),
            presence: Presence::default(),
            witnesses: Witnesses::default(),
            values: Vec::new(),
            junctions: Vec::new(),
            twine_m: f64::NAN,
        })
    }

    /// The junctions that a predicted lattice has in the picture, with their lattice indices: those that are seen, hidden, overgrown or missing, or lie between seen ones. Other nodes
    /// of which the picture says nothing are left out; so is everything where twine does not stand out from lines half a cell aside.
    ///
    /// # Errors
    /// [`Error::ImageSize`] if the image is not of the adjuster's size.
    pub fn adjust(&mut self, image: GrayView, map: &impl LatticeMap) -> Result<&[Junction]> {
        if (image.width(), image.height()) != (self.width, self.height) {
            return Err(Error::ImageSize {
                width: self.width,
                height: self.height,
                image_width: image.width(),
                image_height: image.height(),
            });
        }
        self.junctions.clear();
        self.presence.twines.clear();
        self.twine_m = f64::NAN;
        let seed = map.seed().and_then(|(i, j)| map.pixel(f64::from(i), f64::from(j)));
        let Some(seed) = seed.filter(|p| p.x.is_finite() && p.y.is_finite()) else { return Ok(&self.junctions) };
        let Self { config, source, graph, grower, profiles, locator, .. } = self;
        let (width, height, least) = (self.width, self.height, config.cell_min_px);
        source.load(image);
        graph.build(map, width, height, least);
        if graph.edges.is_empty() {
            return Ok(&self.junctions);
        }
        let cell = median_of(&mut self.values, graph.nodes.iter().map(|n| n.height));
        // 1. How the camera moved, and outward from the seed what the prediction misses smoothly.
        let mut look = Look {
            twine_m: config.twines_m[config.twines_m.len() / 2],
            blur_m: [0.0; 2],
            spread_px: config.point_spread_px,
            coarse_px: coarse_px(cell),
        };
        source.shrink(look.coarse_px);
        let diagonal = (width as f64).hypot(height as f64);
        look.blur_m = locator.fit_blur(source, graph, profiles, cell, &look, config);
        let warp = grower.grow(source, graph, seed, diagonal, &look, config);
        graph.build(&Warped { map, warp: &warp }, width, height, least);
        if graph.edges.is_empty() {
            return Ok(&self.junctions);
        }
        // 2. All nodes, and once more from where the knots that hold lead if that is elsewhere.
        for pass in 0.. {
            self.measure(image, &mut look);
            let Self { config, source, graph, spreader, witnesses, presence, .. } = self;
            let strong = |n: usize| {
                let own = own_twines(graph, n).into_iter().flatten().flatten();
                own.map(|e| presence.twines[e].contrast).any(|c| c > LED_CONTRAST)
            };
            let moved = spreader.spread(source, graph, |n| witnesses.saw(n), strong, pass > 0, &look, config);
            let fresh = if pass < CONTINUED { spreader.settle(graph, (width, height), least) } else { 0 };
            let many = LED_FEWEST.max(graph.nodes.len() / LED_PART);
            if fresh < many && (moved < many || pass >= LED) {
                break;
            }
            graph.build(spreader.continued(), width, height, least);
            self.values.clear();
            self.values.extend(graph.nodes.iter().map(|n| n.height as f32));
            let small = lower(&mut self.values).map_or(cell, f64::from);
            look.coarse_px = look.coarse_px.min(coarse_px(small));
            if graph.edges.is_empty() {
                return Ok(&self.junctions);
            }
        }
        self.twine_m = look.twine_m;
        self.leave_out_unnamed();
        self.presence.claim(&self.graph, |n| self.witnesses.saw(n), &self.config);
        self.presence.widths(&mut self.graph, &self.locator.profiles);
        self.report();
        Ok(&self.junctions)
    }

    /// Measures the nodes of the graph, and judges what is there.
    fn measure(&mut self, image: GrayView, look: &mut Look) {
        let Self { config, source, graph, profiles, locator, solver, presence, .. } = self;
        // 1. From wide to narrow search on the same profiles.
        let (last, wider) = config.search_cells.split_last().unwrap_or((&0.12, &[]));
        if let Some(&widest) = wider.first() {
            locator.look(source, graph, look, widest, look.coarse_px);
            solver.start(graph, &locator.profiles.along, config);
            for (pass, &search) in wider.iter().enumerate() {
                locator.reach(graph, search);
                locator.pick(graph, (pass > 0).then_some(&*solver));
                solver.solve(graph, &locator.offsets, &locator.weights, ROUNDS[usize::from(pass > 0)]);
            }
            solver.commit(graph);
        }
        let cell = median_of(&mut self.values, graph.nodes.iter().map(|n| n.height));
        look.twine_m = locator.fit_twine(source, graph, profiles, cell, look, config);
        // 2. Along the bent twines, with their own width.
        locator.look(source, graph, look, *last, FINE_PX);
        solver.start(graph, &locator.profiles.along, config);
        locator.pick(graph, None);
        solver.solve(graph, &locator.offsets, &locator.weights, ROUNDS[0]);
        solver.commit(graph);
        // 3. What is really there.
        let scale = median_of(&mut self.values, graph.nodes.iter().map(|n| n.scale));
        let (width, blur) = (scale * look.twine_m, look.blur_m.map(|b| scale * b));
        let window = blur.map(|b| look.window_px(width, cell, b));
        let half = (window[0].max(window[1]) / FINE_PX).round() as usize;
        // The brighter flank of shaded twine is its extreme.
        // And the top of what motion has blurred is flat.
        let beside = ((0.6 * width + 0.5).max(1.0) + 0.5 * blur[0].max(blur[1])) / FINE_PX;
        presence.judge(graph, &locator.profiles, source, image, half, beside.round() as usize, config);
        self.witnesses.judge(graph, &presence.twines, &presence.votes, config);
    }

    /// The junctions of the last picture.
    pub fn junctions(&self) -> &[Junction] {
        &self.junctions
    }

    /// The twines of the last picture.
    pub fn twines(&self) -> &[Twine] {
        &self.presence.twines
    }

    /// Twine diameter, m, that explained the last picture best; NaN if there was no lattice in view.
    pub fn twine_m(&self) -> f64 {
        self.twine_m
    }

    /// Nothing is said of twines whose ends have no name.
    fn leave_out_unnamed(&mut self) {
        for (twine, edge) in self.presence.twines.iter_mut().zip(&self.graph.edges) {
            if !edge.nodes.iter().all(|&n| self.spreader.named(n as usize)) {
                (twine.state, twine.llr, twine.contrast) = (TwineState::Unknown, 0.0, 0.0);
            }
        }
    }

    fn report(&mut self) {
        for (k, node) in self.graph.nodes.iter().enumerate() {
            if !self.spreader.named(k) || !node.inside {
                continue;
            }
            let twines = own_twines(&self.graph, k).map(|edges| edges.map(|e| Some(self.presence.twines[e?])));
            let any = |family: usize, state: TwineState| twines[family].iter().flatten().any(|t| t.state == state);
            let either = |state: TwineState| any(0, state) || any(1, state);
            let missing = twines.iter().flatten().flatten().filter(|t| t.state == TwineState::Missing).count();
            let known = twines.iter().flatten().flatten().count();
            let mut open = 1.0;
            let state = if self.witnesses.saw(k) {
                JunctionState::Seen
            } else if either(TwineState::Hidden) {
                JunctionState::Hidden
            } else if either(TwineState::Fouled) {
                JunctionState::Fouled
            } else if missing == known && known >= 3 {
                JunctionState::Missing
            } else if let Some(steps) = between::steps(&self.graph, k, &self.presence.twines, |n| {
                self.witnesses.saw(n) && self.spreader.named(n)
            }) {
                open = steps;
                JunctionState::Inferred
            } else {
                continue;
            };
            // Without measurements a node is known as well as its neighbours predict it.
            let prior = Matrix2::identity() / (open * (self.config.jitter_cells * node.height + 0.1).powi(2));
            let covariance =
                (self.solver.information[k].cast::<f64>() + prior).try_inverse().unwrap_or_else(Matrix2::identity);
            let shading = SHADING * self.twine_m * node.scale;
            let sigma = (0.5 * covariance.trace()).sqrt().max(SIGMA_MIN_PX).hypot(shading);
            self.junctions.push(Junction { pixel: node.pixel(), index: Some(node.index), sigma_px: sigma, state });
        }
    }
}

/// Median of some values; 0 if there are none.
fn median_of(buffer: &mut Vec<f32>, values: impl Iterator<Item = f64>) -> f64 {
    buffer.clear();
    buffer.extend(values.map(|v| v as f32));
    f64::from(median(buffer).unwrap_or(0.0))
}
