//! Where twines end in the picture.

use std::collections::HashMap;

use net_geometry::nalgebra::Vector2;
use net_geometry::{Junction, Twine, TwineState};

/// Knots on either side of one that was not measured, up to so many steps away, tell where it is.
const REACH: i32 = 6;

/// The junctions of a frame that have names, to draw twines by.
#[derive(Debug, Clone)]
pub struct Knots {
    named: HashMap<(i32, i32), Vector2<f64>>,
}

impl Knots {
    /// Of these junctions.
    pub fn new(junctions: &[Junction]) -> Self {
        Self { named: junctions.iter().filter_map(|j| Some((j.index?, j.pixel))).collect() }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.named.is_empty()
    }

    /// Pixels of a twine's ends. Knots within a hole are no junctions of the frame: those of twines that are gone, or look so, are where the knots on both sides say.
    pub fn ends(&self, twine: &Twine) -> Option<[Vector2<f64>; 2]> {
        let gone = matches!(twine.state, TwineState::Missing | TwineState::Doubtful);
        let pixel = |index| {
            let named = self.named.get(&index).copied();
            if gone { named.or_else(|| self.between(index)) } else { named }
        };
        Some([pixel(twine.index)?, pixel(twine.end())?])
    }

    /// Straight between the nearest knots on both sides, along each direction that has them.
    fn between(&self, (i, j): (i32, i32)) -> Option<Vector2<f64>> {
        let along = |di: i32, dj: i32| {
            let nearest = |sign: i32| {
                (1..=REACH).find_map(|k| {
                    let at = (i.saturating_add(sign * k * di), j.saturating_add(sign * k * dj));
                    self.named.get(&at).map(|pixel| (f64::from(k), *pixel))
                })
            };
            let ((a, before), (b, after)) = (nearest(-1)?, nearest(1)?);
            Some((before * b + after * a) / (a + b))
        };
        match (along(1, 0), along(0, 1)) {
            (Some(a), Some(b)) => Some(0.5 * (a + b)),
            (a, b) => a.or(b),
        }
    }
}

#[cfg(test)]
mod tests {
    use net_geometry::JunctionState;

    use super::*;

    #[test]
    fn holes_have_edges_where_there_is_no_knot() {
        let at = |i: i32, j: i32| Vector2::new(f64::from(10 * i + j), f64::from(12 * j));
        let junctions: Vec<Junction> = (0..6)
            .flat_map(|j| (0..6).map(move |i| (i, j)))
            .filter(|&(i, j)| !((2..4).contains(&i) && (2..4).contains(&j)))
            .map(|(i, j)| Junction { pixel: at(i, j), index: Some((i, j)), sigma_px: 0.1, state: JunctionState::Seen })
            .collect();
        let knots = Knots::new(&junctions);
        let twine =
            |index, direction, state| Twine { index, direction, state, llr: -9.0, contrast: 5.0, width_px: None };
        for (index, direction) in [((2, 2), 0), ((2, 2), 1), ((1, 3), 0), ((3, 3), 1), ((0, 0), 0)] {
            let gone = twine(index, direction, TwineState::Doubtful);
            let [from, to] = knots.ends(&gone).expect("knots on both sides");
            let (end_i, end_j) = gone.end();
            assert!((from - at(index.0, index.1)).norm() < 1e-9 && (to - at(end_i, end_j)).norm() < 1e-9);
        }
        // Nothing else is drawn where no knot was measured, and nothing where knots are on one side only.
        assert_eq!(knots.ends(&twine((2, 2), 0, TwineState::Present)), None);
        assert_eq!(knots.ends(&twine((5, 0), 0, TwineState::Missing)), None);
        assert_eq!(knots.ends(&twine((i32::MAX, i32::MIN), 1, TwineState::Missing)), None);
        assert!(Knots::new(&[]).is_empty());
    }
}
