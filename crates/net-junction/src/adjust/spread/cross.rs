//! One knot, looked for by a cross of two profiles.

use net_geometry::nalgebra::Vector2;

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::{Graph, median};
use crate::adjust::lanes::LANES;
use crate::adjust::locate::{reach_px, vertex};
use crate::adjust::source::Source;
use crate::adjust::spread::{FEWEST, REACH, Spreader};
use crate::adjust::template::Look;

/// The arms of the cross on which a knot is looked for, in steps of the lattice.
const ARM: f64 = 0.42;
/// Amplitudes outside these parts of the neighbours' are something else than twine.
const AMPLITUDE_PARTS: (f32, f32) = (0.35, 3.0);
/// Most of the other polarity within reach, in parts of a twine's amplitude: the filter's own lobes come to a third. Cells that motion blurs away
/// look alike half a cell aside.
const OPPOSITE: f32 = 0.8;
/// A knot that is found farther off than this, cells, is another one.
const FOUND_CELLS: f64 = 0.4;

impl Spreader {
    /// How far from where it is led a knot lies, if both its twines are there.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn find(
        &mut self,
        source: &Source,
        graph: &Graph,
        k: usize,
        led: Vector2<f64>,
        steps: [Vector2<f64>; 2],
        look: &Look,
        config: &AdjustConfig,
    ) -> Option<Vector2<f64>> {
        if !graph.nodes[k].inside {
            return None;
        }
        let (mut normals, mut off) = ([Vector2::zeros(); 2], [0.0; 2]);
        for family in 0..2 {
            let typical = self.typical(source, graph, k, family, look, config)?;
            let (normal, q, amplitude, reach) =
                self.cross(source, graph, k, family, led, steps[family], Some(typical), look, config)?;
            let part = amplitude / typical;
            if !(part > AMPLITUDE_PARTS.0 && part < AMPLITUDE_PARTS.1) || q.abs() > reach {
                return None;
            }
            (normals[family], off[family]) = (normal, q);
        }
        let cross = normals[0].perp(&normals[1]);
        let off =
            Vector2::new(off[0] * normals[1].y - off[1] * normals[0].y, off[1] * normals[0].x - off[0] * normals[1].x)
                / cross;
        // False for NaN.
        (off.norm() < FOUND_CELLS * graph.nodes[k].height).then_some(off)
    }

    /// Median signed amplitude of the known knots around a node.
    fn typical(
        &mut self,
        source: &Source,
        graph: &Graph,
        k: usize,
        family: usize,
        look: &Look,
        config: &AdjustConfig,
    ) -> Option<f32> {
        let (i, j) = graph.nodes[k].index;
        self.values.clear();
        for b in -REACH..=REACH {
            for a in -REACH..=REACH {
                let Some(n) = graph.node_at((i + a, j + b)).filter(|&n| self.knots[n].known && self.knots[n].leads)
                else {
                    continue;
                };
                if self.knots[n].amplitudes[family].is_nan() {
                    let here = self.knots[n].shift;
                    let step = self.step(graph, n, family);
                    let found = self.cross(source, graph, n, family, here, step, None, look, config);
                    self.knots[n].amplitudes[family] = found.map_or(0.0, |f| f.2);
                }
                self.values.push(self.knots[n].amplitudes[family]);
            }
        }
        (self.values.len() >= FEWEST).then(|| median(&mut self.values)).flatten()
    }

    /// The map's step along a direction.
    pub(super) fn step(&self, graph: &Graph, k: usize, family: usize) -> Vector2<f64> {
        let (i, j) = graph.nodes[k].index;
        let [next, last] = if family == 0 { [(i + 1, j), (i - 1, j)] } else { [(i, j + 1), (i, j - 1)] };
        let from = |index| graph.node_at(index).map(|n| graph.nodes[n].predicted);
        match (from(last), from(next)) {
            (Some(last), Some(next)) => (next - last) * 0.5,
            (None, Some(next)) => next - graph.nodes[k].predicted,
            (Some(last), None) => graph.nodes[k].predicted - last,
            (None, None) => graph.nodes[k].half_steps[family] * 2.0,
        }
    }

    /// Twine of a family across a node: the normal, how far along it the twine lies, px, its signed amplitude, and how far it may lie. With `like` the strongest
    /// twine of that sign in reach, else the one where it is believed to be.
    #[allow(clippy::too_many_arguments)]
    fn cross(
        &mut self,
        source: &Source,
        graph: &Graph,
        k: usize,
        family: usize,
        shift: Vector2<f64>,
        step: Vector2<f64>,
        like: Option<f32>,
        look: &Look,
        config: &AdjustConfig,
    ) -> Option<(Vector2<f64>, f64, f32, f64)> {
        let node = &graph.nodes[k];
        let arm = step * ARM;
        let middle = graph.nodes[k].predicted + shift;
        let normal = Vector2::new(-arm.y, arm.x) / arm.norm();
        let edge = graph.edge_from(k, family)?;
        let reach = f64::from(reach_px(graph, edge, config.search_cells[0]));
        let width = (look.twine_m * node.scale).max(0.15);
        let blur = look.blur_m[family] * node.scale;
        let half = (look.window_px(width, node.spacing[family], blur) / look.coarse_px).round() as usize;
        let kernel = self.kernels.get(width, look.spread_px, blur, half);
        let steps = (reach / look.coarse_px).ceil() as usize + 1;
        self.profile.clear();
        self.profile.resize(2 * (steps + kernel.half()) + 1 + LANES, 0.0);
        let mut inside = [true];
        source.profiles([middle - arm, middle + arm], [0.0; 2], look.coarse_px, &mut inside, &mut self.profile);
        if !inside[0] || !normal.x.is_finite() {
            return None;
        }
        self.responses.clear();
        self.responses.resize(2 * steps + 1, 0.0);
        self.kernels.amplitudes(&kernel, &self.profile, kernel.half(), &mut self.responses);
        let Some(like) = like else {
            let near = &self.responses[steps - 1..=steps + 1];
            let most = near.iter().fold(0.0_f32, |most, a| if a.abs() > most.abs() { *a } else { most });
            return Some((normal, 0.0, most, reach));
        };
        let sign = like.signum();
        let mut best = (steps, 0.0_f32);
        for (n, a) in self.responses.iter().enumerate() {
            let q = (n as f64 - steps as f64) * look.coarse_px;
            let near = if q.abs() > reach { 0.0 } else { 1.0 / (1.0 + (0.5 * q / reach).powi(2)) };
            if a * sign * near as f32 > best.1 {
                best = (n, a * sign * near as f32);
            }
        }
        let opposite = self.responses.iter().fold(0.0_f32, |most, a| most.max(-a * sign));
        if opposite > OPPOSITE * self.responses[best.0].abs() {
            return None;
        }
        let n = best.0.clamp(1, 2 * steps - 1);
        let part = vertex([n - 1, n, n + 1].map(|m| self.responses[m] * sign));
        let q = (n as f64 - steps as f64 + f64::from(part)) * look.coarse_px;
        Some((normal, q, self.responses[best.0], 0.9 * reach))
    }
}
