//! What looks at a twine add up to.

use net_geometry::nalgebra::Vector2;

use crate::config::Config;
use crate::frame::{Seen, TwineLook};
use crate::tile::Twine;

/// Least contrast, deviations, at which a frame says anything. Where twine is faint, chance lifts it above a higher one, and chance is all that is then looked at.
const GATE: f32 = 0.8;
/// What a frame that does not call the twine present or missing may say at the most, either way: the same both ways, or faint twines would never add up.
const DOUBTFUL: f32 = 3.0;
/// Frames that call a twine missing for each that calls it overgrown, at least, if it is a gap. Growth must be 2.5 deviations off the water: as far as normal
/// deviations of water come in one frame of a hundred.
const FOULED: u32 = 5;

impl Twine {
    /// Adds a frame. Frames of one look are averaged: the camera has hardly moved, and what disturbs one disturbs all.
    pub(crate) fn add(&mut self, look: &TwineLook, frame: u32, axis: Vector2<f64>, config: &Config) {
        let llr = match look.seen {
            Seen::Hidden => return,
            Seen::Fouled => {
                self.fouled = self.fouled.saturating_add(1);
                return;
            }
            _ if !(look.llr.is_finite() && look.contrast > GATE) => return,
            Seen::Unknown => look.llr.clamp(-DOUBTFUL, DOUBTFUL),
            Seen::Present | Seen::Missing => look.llr,
        };
        if look.seen == Seen::Missing {
            if self.missing == 0 {
                self.first_missing = frame;
            }
            self.last_missing = frame;
            self.missing = self.missing.saturating_add(1);
            self.contrast = self.contrast.max(look.contrast);
        }
        let moved = (f64::from(self.look_at[0]) - axis.x).hypot(f64::from(self.look_at[1]) - axis.y);
        let over = frame.saturating_sub(self.look_since) >= config.look_frames;
        if self.looks == 0 || over || moved > config.look_cells {
            self.settled = self.sum(config);
            (self.look_sum, self.look_frames) = (0.0, 0);
            self.look_at = [axis.x as f32, axis.y as f32];
            self.look_since = frame;
            self.looks = self.looks.saturating_add(1);
        }
        self.look_sum += llr;
        self.look_frames += 1;
    }

    /// Log likelihood ratio, present to missing, of all looks; 0 without any. The sum over looks, divided by the root of their number: a twine that is faint in itself is faint
    /// in every look, so that looks are worth less than as many independent ones.
    pub fn llr(&self, config: &Config) -> f32 {
        self.sum(config) / (self.looks.max(1) as f32).sqrt()
    }

    /// Whether frames called it missing, and hardly any of them overgrown: a tuft of weed in its place stands out from the water in some
    /// frames only, but in a gap one sees nothing but water in all.
    pub fn is_gap(&self) -> bool {
        self.missing > 0 && self.fouled.saturating_mul(FOULED) <= self.missing
    }

    fn sum(&self, config: &Config) -> f32 {
        let most = config.look_max as f32;
        let mean = if self.look_frames > 0 { self.look_sum / self.look_frames as f32 } else { 0.0 };
        self.settled + mean.clamp(-most, most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(llr: f32, seen: Seen) -> TwineLook {
        TwineLook { index: (0, 0), direction: 0, seen, llr, contrast: 5.0 }
    }

    #[test]
    fn frames_of_one_look_are_averaged_and_looks_add_up() {
        let (config, mut twine) = (Config::default(), Twine::default());
        for frame in 0..10 {
            twine.add(&look(-4.0, Seen::Missing), frame, Vector2::new(0.05 * f64::from(frame), 0.0), &config);
        }
        assert_eq!((twine.llr(&config), twine.looks), (-4.0, 1));
        twine.add(&look(-3.0, Seen::Missing), 10, Vector2::new(3.0, 0.0), &config);
        assert_eq!((twine.llr(&config), twine.looks), (-7.0 / 2_f32.sqrt(), 2));
        // The same place, later: another look. No single one decides.
        twine.add(&look(-50.0, Seen::Missing), 40, Vector2::new(3.0, 0.0), &config);
        assert_eq!((twine.llr(&config), twine.looks), (-15.0 / 3_f32.sqrt(), 3));
        assert_eq!((twine.missing, twine.first_missing, twine.last_missing), (12, 0, 40));
    }

    #[test]
    fn a_twine_that_is_now_and_then_overgrown_is_no_gap() {
        let (config, mut twine) = (Config::default(), Twine::default());
        assert!(!twine.is_gap());
        for frame in 0..15 {
            twine.add(&look(-4.0, Seen::Missing), frame, Vector2::zeros(), &config);
        }
        for fouled in 1..=4 {
            twine.add(&look(-4.0, Seen::Fouled), 14 + fouled, Vector2::zeros(), &config);
            // One frame of five is more than chance.
            assert_eq!(twine.is_gap(), fouled < 4);
        }
    }

    #[test]
    fn what_is_covered_or_not_to_be_told_says_nothing() {
        let (config, mut twine) = (Config::default(), Twine::default());
        twine.add(&look(-20.0, Seen::Hidden), 0, Vector2::zeros(), &config);
        twine.add(&look(-20.0, Seen::Fouled), 1, Vector2::zeros(), &config);
        twine.add(&look(f32::NAN, Seen::Missing), 2, Vector2::zeros(), &config);
        twine.add(&TwineLook { contrast: 0.5, ..look(-20.0, Seen::Missing) }, 3, Vector2::zeros(), &config);
        assert_eq!((twine.llr(&config), twine.looks, twine.fouled), (0.0, 0, 1));
        // A frame in doubt counts little.
        twine.add(&look(-20.0, Seen::Unknown), 4, Vector2::zeros(), &config);
        assert_eq!(twine.llr(&config), -3.0);
    }
}
