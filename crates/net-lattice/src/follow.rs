//! The next picture of a sequence: the last sheet moved as predicted, locked to and refined.

use net_geometry::Pose;

use crate::config::Config;
use crate::estimate::LatticeEstimate;
use crate::model::Model;
use crate::seed::Seed;
use crate::workspace::{Lock, Workspace};

/// Side of a cell, px, that is fine enough to draw where all that is to be found is the rest of a prediction: a fourth of the pixels of a first picture's, each of them of a
/// fourth of the noise.
const DRAWN_CELL_PX: f64 = 8.0;

impl Workspace {
    /// The sheet of the last picture, moved as predicted, locked and refined.
    pub(crate) fn follow(&mut self, config: &Config, predicted: &Pose) -> Option<LatticeEstimate> {
        let last = self.last?;
        let turn = predicted.rotation * last.pose.rotation.inverse();
        let shift = predicted.translation - turn * last.pose.translation;
        let start = last.surface.seen_from(turn.matrix(), &shift)?;
        // Half a cell lies between the lock-in's zero and dark twine's drawing.
        let half = last.polarity.map(|p| f64::from(p.offset()));
        let mut surface = start;
        surface.offset = std::array::from_fn(|f| start.offset[f] - half[f]);
        let seed = Seed { centre: self.view.centre, looks: last.looks };
        let model = last.model.max(Model::Rhomb);
        let place = self.coarse_scale_for(start.depth);
        surface = self.lock_on(place, &surface, &[(250.0, Model::Rhomb), (last.focus, model)], seed)?;
        surface.offset = std::array::from_fn(|f| surface.offset[f] + half[f]);
        let lock = Lock {
            score: 0.0,
            above: 0.0,
            surface,
            start,
            seed,
            evidence: last.evidence,
            gain: last.gain * self.view.levels[0].raw.data().len() as f64,
            polarity: last.polarity,
            blur: last.blur,
            focus: last.focus,
            drawn_cell_px: DRAWN_CELL_PX,
        };
        self.conclude(config, &surface, &lock, last.model, last.margin, Some(last.labels))
    }
}
