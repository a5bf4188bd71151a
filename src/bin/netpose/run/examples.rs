//! The few frames that a report shows: the ones that tell most, kept while the run goes by.

use net_image::Image;
use net_log::Example;
use netpose::Status;

use super::frames::Tracked;
use crate::draw::Overlay;

/// A frame that may be shown.
struct Kept {
    frame: u64,
    image: Image<u8>,
    tracked: Tracked,
}

/// One place for each reason to show a frame, so that memory does not grow with the log.
#[derive(Default)]
pub struct Examples {
    first: Option<Kept>,
    surest: Option<Kept>,
    doubtful: Option<Kept>,
    refused: Option<Kept>,
}

impl Examples {
    /// Keeps the frame where it tells more than the one that is kept.
    pub fn consider(&mut self, frame: u64, image: &Image<u8>, tracked: &Tracked) {
        let p = tracked.probability;
        let beats = |kept: &Option<Kept>, better: fn(f64, f64) -> bool| {
            kept.as_ref().is_none_or(|kept| better(p, kept.tracked.probability))
        };
        let place = if self.first.is_none() {
            &mut self.first
        } else if tracked.status != Status::Ok {
            if !beats(&self.refused, |new, old| new > old) {
                return;
            }
            &mut self.refused
        } else if beats(&self.surest, |new, old| new > old) {
            &mut self.surest
        } else if beats(&self.doubtful, |new, old| new < old) {
            &mut self.doubtful
        } else {
            return;
        };
        *place = Some(Kept { frame, image: image.clone(), tracked: tracked.clone() });
    }

    /// The pictures with what was found in them.
    pub fn draw(&self, overlay: &Overlay) -> Vec<Example> {
        let named = [
            ("the first frame", &self.first),
            ("the surest pose", &self.surest),
            ("the most doubtful pose", &self.doubtful),
            ("the frame without a pose that came nearest to one", &self.refused),
        ];
        named
            .into_iter()
            .filter_map(|(reason, kept)| {
                let Kept { frame, image, tracked } = kept.as_ref()?;
                let canvas = overlay.draw(image.view()?, &format!("frame {frame}"), &tracked.shown());
                let png = canvas.to_png().ok()?;
                Some(Example { caption: format!("Frame {frame}: {reason}"), png })
            })
            .collect()
    }
}
