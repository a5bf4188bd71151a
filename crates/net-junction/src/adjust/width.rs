//! How wide twines look: the area of picture that each covers, over its length.

use net_geometry::{Twine, TwineState};
use net_image::widely;
use wide::f32x8;

use crate::adjust::appearance::Appearance;
use crate::adjust::foreign::beside;
use crate::adjust::graph::Graph;
use crate::adjust::lanes::{LANES, total};
use crate::adjust::lines::Means;
use crate::adjust::profile::Profiles;

/// Least contrast of the neighbourhood, deviations, of a width.
const CONTRAST: f32 = 3.0;
/// Part of the profile that noise may seem to cover.
const NOISE: f32 = 0.3;

/// Buffers of this stage.
#[derive(Debug, Default)]
pub(crate) struct Widths {
    /// By edge: parts of their profiles that twines and control lines cover; NaN where that is not known.
    covered: [Vec<f32>; 2],
    /// By block: part that noise seems to cover.
    noise: Vec<f32>,
    /// By block: how far the template's extreme is off its ends, grey levels.
    contrasts: Vec<f32>,
    /// By edge: mean grey levels beside twines; NaN where either side is out of view.
    around: Vec<f32>,
}

impl Widths {
    /// Measures all twines, from the profiles of twines and of control lines, between the knots. `levels` are mean grey levels of control lines, each half a cell beside its
    /// twine.
    pub fn measure(
        &mut self,
        graph: &mut Graph,
        [twine, control]: [(&Profiles, &Means); 2],
        bins: std::ops::Range<usize>,
        appearance: &Appearance,
        levels: &[f32],
        twines: &mut [Twine],
    ) {
        let half = appearance.half;
        self.contrasts.clear();
        self.contrasts.extend((0..graph.blocks.count()).map(|block| {
            let template = &appearance.template(block).0[..2 * half + 1];
            let ends = 0.5 * (template[0] + template[2 * half]);
            template.iter().fold(0.0_f32, |most, t| most.max((t - ends).abs()))
        }));
        self.around.clear();
        self.around.extend((0..graph.edges.len()).map(|e| {
            // One side alone would take a slope of brightness for twine.
            0.5 * (beside(graph, e)[0].map_or(f32::NAN, |e| levels[e]) + levels[e])
        }));
        let Self { covered, noise, contrasts, around, .. } = self;
        let [of_twines, of_control] = covered;
        cover(graph, twine, (half, bins.clone()), contrasts, around, of_twines);
        cover(graph, control, (half, bins), contrasts, levels, of_control);
        graph.blocks.local_median(of_control, noise);
        let window_px = (2 * half + 1) as f32 * twine.0.step_px as f32;
        for (e, twine) in twines.iter_mut().enumerate() {
            let there = matches!(twine.state, TwineState::Present | TwineState::Fouled | TwineState::Unknown);
            let noise = noise[graph.blocks.of_edge(e)];
            let share = (of_twines[e] - noise) / (1.0 - noise);
            let told = there && twine.contrast >= CONTRAST && noise < NOISE && share.is_finite();
            twine.width_px = told.then(|| share.max(0.0) * window_px);
        }
    }
}

widely! {
    /// Parts of the lines' profiles, `half` steps to each side, that are covered: their distance from the level around in parts of twine's contrast, one at most.
    fn cover<'a>(
        graph: &'a Graph,
        lines: (&'a Profiles, &'a Means),
        window: (usize, std::ops::Range<usize>),
        contrasts: &'a [f32],
        around: &'a [f32],
        out: &'a mut Vec<f32>,
    ) -> () {
        let ((profiles, means), (half, bins)) = (lines, window);
        let (first, width) = (profiles.half - half, 2 * half + 1);
        let one = f32x8::splat(1.0);
        out.clear();
        out.extend((0..graph.edges.len()).map(|e| {
            let (level, scale) = (around[e], 1.0 / contrasts[graph.blocks.of_edge(e)].max(1e-3));
            // The lesser of one and no number is one.
            if !means.inside[e] || level.is_nan() {
                return f32::NAN;
            }
            let (levels, scales) = (f32x8::splat(level), f32x8::splat(scale));
            let (mut sums, mut rest) = (f32x8::ZERO, 0.0);
            for bin in bins.clone() {
                let (whole, end) = profiles.row(e, bin)[first..][..width].as_chunks::<LANES>();
                for values in whole {
                    sums += ((f32x8::from(*values) - levels).abs() * scales).fast_min(one);
                }
                rest += end.iter().map(|v| ((v - level).abs() * scale).min(1.0)).sum::<f32>();
            }
            (total(sums.to_array()) + rest) / (bins.len() * width) as f32
        }));
    }
}
