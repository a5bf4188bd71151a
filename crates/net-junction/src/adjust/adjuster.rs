use net_geometry::nalgebra::Matrix2;
use net_geometry::{Junction, JunctionState};
use net_image::GrayView;

use crate::adjust::config::AdjustConfig;
use crate::adjust::connect::Connector;
use crate::adjust::graph::{Graph, predict};
use crate::adjust::locate::Locator;
use crate::adjust::map::LatticeMap;
use crate::adjust::presence::{Presence, Twine, TwineState, template_half};
use crate::adjust::profile::{Profiles, STEP_PX};
use crate::adjust::solve::Solver;
use crate::adjust::warp::{Warp, Warped, radii};
use crate::error::{Error, Result};

/// No junction is claimed to be known better than this, px.
const SIGMA_MIN_PX: f64 = 0.03;
/// Standard deviation of the distance, in twine diameters, between a twine's axis and the middle of its brightness: light from
/// above makes the upper flank of white twine bright. Thin twine does not tell.
const SHADING: f64 = 0.12;

/// Adjusts a predicted lattice to a picture, node by node. Owns all buffers: after the first pictures no memory is allocated.
#[derive(Debug)]
pub struct NetAdjuster {
    config: AdjustConfig,
    width: usize,
    height: usize,
    graph: Graph,
    profiles: Profiles,
    locator: Locator,
    solver: Solver,
    presence: Presence,
    connector: Connector,
    heights: Vec<f32>,
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
            profiles: Profiles::default(),
            locator: Locator::default(),
            solver: Solver::default(),
            presence: Presence::default(),
            connector: Connector::default(),
            heights: Vec::new(),
            junctions: Vec::new(),
            twine_m: f64::NAN,
        })
    }

    /// The junctions that a predicted lattice has in the picture, with their lattice indices: those that are seen, hidden, overgrown or missing. Nodes
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
        let Self { config, graph, profiles, locator, solver, presence, .. } = self;
        let (width, height, least) = (self.width, self.height, config.cell_min_px);
        profiles.load(image);
        let mut twine = config.twines_m[config.twines_m.len() / 2];
        let locate_and_solve = |graph: &mut Graph,
                                profiles: &mut Profiles,
                                locator: &mut Locator,
                                solver: &mut Solver,
                                twine: f64,
                                search: f64| {
            locator.locate(graph, profiles, twine, search, config);
            solver.solve(graph, &profiles.along, &locator.offsets, &locator.weights, config);
        };
        // 1. Outward from the seed: what the prediction misses smoothly.
        let seed =
            map.seed().and_then(|(i, j)| Some((map.pixel(f64::from(i), f64::from(j))?, predict(map, (i, j))?.height)));
        let Some((seed, cell)) = seed else { return Ok(&self.junctions) };
        let mut warp = Warp::none(seed);
        let diagonal = (width as f64).hypot(height as f64);
        for (round, radius) in radii(cell, diagonal).enumerate() {
            graph.build(&Warped { map, warp: &warp }, width, height, least, radius);
            if graph.edges.is_empty() {
                continue;
            }
            locate_and_solve(graph, profiles, locator, solver, twine, config.search_cells[0]);
            warp.fit(graph, solver, map, 1 + round.div_ceil(2));
        }
        // 2. Whether that helps, over the whole picture: a correction that leads astray finds less.
        let mut best = (f32::MIN, Warp::none(seed));
        for warp in [best.1.clone(), warp] {
            graph.build(&Warped { map, warp: &warp }, width, height, least, f64::MAX);
            if graph.edges.is_empty() {
                continue;
            }
            locate_and_solve(graph, profiles, locator, solver, twine, config.search_cells[0]);
            let found = solver.weight();
            if found > best.0 {
                best = (found, warp);
            }
        }
        // 3. All nodes in view and their twines' bows, from wide to narrow search.
        graph.build(&Warped { map, warp: &best.1 }, width, height, least, f64::MAX);
        if graph.edges.is_empty() {
            return Ok(&self.junctions);
        }
        for (pass, &search) in config.search_cells.iter().enumerate() {
            locate_and_solve(graph, profiles, locator, solver, twine, search);
            if pass == 0 {
                twine = locator.fit_twine(graph, profiles, config);
            }
        }
        self.twine_m = twine;
        // 4. What is really there.
        self.heights.clear();
        self.heights.extend(graph.nodes.iter().map(|n| n.height as f32));
        let height = f64::from(crate::adjust::graph::median(&mut self.heights).unwrap_or(0.0));
        self.heights.clear();
        self.heights.extend(graph.nodes.iter().map(|n| (n.scale * twine) as f32));
        let width = f64::from(crate::adjust::graph::median(&mut self.heights).unwrap_or(0.0));
        let half = template_half(height, width, config.point_spread_px);
        // The brighter flank of shaded twine is its extreme.
        let beside = ((0.6 * width + 0.5).max(1.0) / STEP_PX).round() as usize;
        presence.judge(graph, profiles, image, half, beside, config);
        // 5. As far as names can be trusted.
        self.connector.walk(&self.graph, &self.presence.twines);
        self.report();
        Ok(&self.junctions)
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

    fn report(&mut self) {
        for (k, node) in self.graph.nodes.iter().enumerate() {
            if !self.connector.reached(k) {
                continue;
            }
            let (i, j) = node.index;
            let before = [(i - 1, j), (i, j - 1)];
            let at = |n: usize, family: usize| {
                let edge = self.graph.edge_from(n, family)?;
                Some(self.presence.twines[edge].state)
            };
            let twines = [0, 1].map(|f| [at(k, f), self.graph.node_at(before[f]).and_then(|n| at(n, f))]);
            let any = |family: usize, state: TwineState| twines[family].contains(&Some(state));
            let either = |state: TwineState| any(0, state) || any(1, state);
            let missing = twines.iter().flatten().filter(|t| **t == Some(TwineState::Missing)).count();
            let known = twines.iter().flatten().flatten().count();
            let state = if any(0, TwineState::Present) && any(1, TwineState::Present) {
                JunctionState::Seen
            } else if either(TwineState::Hidden) {
                JunctionState::Hidden
            } else if either(TwineState::Fouled) {
                JunctionState::Fouled
            } else if missing == known && known >= 3 {
                JunctionState::Missing
            } else {
                continue;
            };
            // Without measurements a node is known as well as its neighbours predict it.
            let prior = Matrix2::identity() / (self.config.jitter_cells * node.height + 0.1).powi(2);
            let covariance = (self.solver.information[k] + prior).try_inverse().unwrap_or_else(Matrix2::identity);
            let shading = SHADING * self.twine_m * node.scale;
            let sigma = (0.5 * covariance.trace()).sqrt().max(SIGMA_MIN_PX).hypot(shading);
            self.junctions.push(Junction { pixel: node.pixel(), index: Some(node.index), sigma_px: sigma, state });
        }
    }
}
