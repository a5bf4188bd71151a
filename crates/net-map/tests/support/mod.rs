//! What tests of whole sequences share.

use net_junction::{Twine, TwineState};
use net_map::{Seen, TwineLook};

/// An adjuster's twines as the map takes them.
pub fn looks(twines: &[Twine]) -> Vec<TwineLook> {
    let look = |t: &Twine| TwineLook {
        index: t.index,
        direction: t.direction,
        seen: match t.state {
            TwineState::Unknown => Seen::Unknown,
            TwineState::Present => Seen::Present,
            TwineState::Missing | TwineState::Doubtful => Seen::Missing,
            TwineState::Hidden => Seen::Hidden,
            TwineState::Fouled => Seen::Fouled,
        },
        llr: t.llr,
        contrast: t.contrast,
    };
    twines.iter().map(look).collect()
}
