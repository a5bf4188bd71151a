//! The two wave vectors of a section, and how much rivals fall behind (thesis 4.3.4, 4.3.5).

use net_geometry::nalgebra::Vector2;

use crate::score::Candidate;
use crate::sections::SectionView;

/// How sure a choice is: its value over its rival's.
///
/// The thesis divides by the third largest value and says that the quotient lies above 1. With the angle check it need not: the rival of the second vector is the best other candidate that passes
/// the check too, and where the choice came from all sections together it may have a rival of higher value in its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Confidence {
    /// Value of the choice over the rival's; infinite without a rival of positive value.
    pub ratio: f64,
    /// Index of the rival among the section's candidates.
    pub rival: Option<usize>,
}

impl Confidence {
    /// Of `value` against the `rival`'s.
    pub fn against(value: f64, rival: Option<(usize, f64)>) -> Self {
        let ratio = match rival {
            Some((_, other)) if other > 0.0 => (value / other).max(0.0),
            _ => f64::INFINITY,
        };
        Self { ratio, rival: rival.map(|(index, _)| index) }
    }
}

/// Two candidates of one section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Their indices among the section's candidates, the one of higher value first.
    pub candidates: [usize; 2],
    /// How sure each is.
    pub confidence: [Confidence; 2],
}

/// The best candidate, and the best of those whose wave vector is at least `min_angle` (rad, between lines) from it. `candidates` are in the order of their values.
/// `None` if there are no two of that kind.
pub fn choose(candidates: &[Candidate], view: &SectionView, min_angle: f64) -> Option<Choice> {
    let wave = |index: usize| view.wave_from_bin(candidates[index].bin);
    let first = 0;
    candidates.first()?;
    let crosses = |index: usize| angle_between(wave(first), wave(index)) >= min_angle;
    let mut crossing = (1..candidates.len()).filter(|&index| crosses(index));
    let second = crossing.next()?;
    let entry = |index: usize| (index, candidates[index].value());
    let third = (1..candidates.len()).find(|&index| index != second).map(entry);
    let rival_of_second = crossing.next().map(entry).or(third);
    Some(Choice {
        candidates: [first, second],
        confidence: [
            Confidence::against(candidates[first].value(), third),
            Confidence::against(candidates[second].value(), rival_of_second),
        ],
    })
}

/// Angle between two lines, rad, 0 to pi/2; 0 if either has no direction.
pub(crate) fn angle_between(a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    a.perp(&b).abs().atan2(a.dot(&b).abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use net_geometry::{Camera, Lens};

    fn candidate(x: f64, y: f64, value: f64) -> Candidate {
        Candidate {
            peak_index: 0,
            bin: Vector2::new(x, y),
            peak: value,
            beam: 0.0,
            pattern: 0.0,
            absent: 0.0,
            multiples: 1,
        }
    }

    fn view() -> SectionView {
        let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None).unwrap();
        SectionView::new(&camera, (0, 0), 424, 240, 1).unwrap()
    }

    #[test]
    fn the_thesiss_example() {
        // Table 5.2: p3 lies too near to p1's direction, so p2's rival is p4 (5.1.2: 260 / 154 = 1.69), p1's is p3 (319 / 186 = 1.72).
        let candidates = [
            candidate(20.0, 0.0, 319.0),
            candidate(0.0, 12.0, 260.0),
            candidate(40.0, 1.0, 186.0),
            candidate(3.0, 24.0, 154.0),
        ];
        let choice = choose(&candidates, &view(), 55f64.to_radians()).unwrap();
        assert_eq!(choice.candidates, [0, 1]);
        assert!((choice.confidence[0].ratio - 1.715).abs() < 1e-3 && choice.confidence[0].rival == Some(2));
        assert!((choice.confidence[1].ratio - 1.688).abs() < 1e-3 && choice.confidence[1].rival == Some(3));
    }

    #[test]
    fn without_a_rival_nothing_is_doubted_and_without_a_second_there_is_no_choice() {
        let two = [candidate(20.0, 0.0, 100.0), candidate(0.0, 12.0, 90.0)];
        let choice = choose(&two, &view(), 0.9).unwrap();
        assert_eq!(choice.confidence[1], Confidence { ratio: f64::INFINITY, rival: None });
        assert!(choose(&two[..1], &view(), 0.9).is_none());
        assert!(choose(&[candidate(20.0, 0.0, 9.0), candidate(40.0, 0.1, 8.0)], &view(), 0.9).is_none());
        assert!(choose(&[], &view(), 0.9).is_none());
    }
}
