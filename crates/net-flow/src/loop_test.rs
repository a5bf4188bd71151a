//! The loop test: a track that goes round and returns should end where it began.

use nalgebra::Vector2;

/// How well a loop closed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopError {
    /// Points that arrived.
    pub closed: usize,
    /// Points that were lost on the way.
    pub lost: usize,
    /// Median distance between start and end, px; NaN when no point arrived, as the others.
    pub median_px: f64,
    /// Distance that 90 % stay within, px.
    pub p90_px: f64,
    /// Largest distance, px.
    pub max_px: f64,
}

/// Compares where points began with where they ended, pair by pair (`None`: lost), in a sequence whose last picture shows what its first did.
/// A point without partner in the longer list counts as lost.
pub fn loop_error(start: &[Vector2<f64>], end: &[Option<Vector2<f64>>]) -> LoopError {
    let pairs = start.iter().zip(end).filter_map(|(s, e)| Some((s - (*e)?).norm()));
    let mut distances: Vec<f64> = pairs.filter(|d| d.is_finite()).collect();
    distances.sort_by(f64::total_cmp);
    let at = |q: f64| {
        let last = distances.len().saturating_sub(1) as f64;
        distances.get((q * last).round() as usize).copied().unwrap_or(f64::NAN)
    };
    LoopError {
        closed: distances.len(),
        lost: start.len().max(end.len()) - distances.len(),
        median_px: at(0.5),
        p90_px: at(0.9),
        max_px: at(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_measures() {
        let start: Vec<_> = (0..11).map(|i| Vector2::new(f64::from(i), 0.0)).collect();
        let mut end: Vec<_> = start.iter().map(|s| Some(s * 1.1)).collect();
        end[10] = None;
        let error = loop_error(&start, &end);
        assert_eq!((error.closed, error.lost), (10, 1));
        // Ends are 0, 0.1 ... 0.9 px off: doubles.
        assert!((error.max_px - 0.9).abs() < 1e-12 && (error.p90_px - 0.8).abs() < 1e-12, "{error:?}");
        assert!(loop_error(&[], &[]).median_px.is_nan());
    }
}
