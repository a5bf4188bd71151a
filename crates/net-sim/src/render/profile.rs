/// Beyond this many standard deviations the point spread is nothing: 3e-7 of an edge is left.
pub(crate) const REACH_SIGMA: f64 = 5.0;

/// Table steps per standard deviation: linear interpolation is then right to 5e-7, far below a grey level.
const STEPS: f64 = 256.0;

/// The picture of an edge through a Gaussian point spread: the normal distribution function, tabulated.
#[derive(Debug)]
pub(crate) struct EdgeSpread {
    table: Vec<f32>,
}

impl EdgeSpread {
    pub(crate) fn new() -> Self {
        let n = (2.0 * REACH_SIGMA * STEPS) as usize;
        let at = |k: usize| 0.5 * libm::erfc(-(k as f64 / STEPS - REACH_SIGMA) * std::f64::consts::FRAC_1_SQRT_2);
        // One entry more than the last interval needs, so that the end can be interpolated like the rest.
        Self { table: (0..=n + 1).map(|k| at(k) as f32).collect() }
    }

    /// Share of a point spread of unit standard deviation that lies below `x`.
    #[inline]
    pub(crate) fn below(&self, x: f32) -> f32 {
        let p = ((x + REACH_SIGMA as f32) * STEPS as f32).clamp(0.0, (2.0 * REACH_SIGMA * STEPS) as f32);
        let k = p as usize;
        let (a, b) = (self.table[k], self.table[k + 1]);
        a + (b - a) * (p - k as f32)
    }

    /// Coverage at distance `x` from the middle of a strip of half width `half`, all in standard deviations.
    #[inline]
    pub(crate) fn strip(&self, x: f32, half: f32) -> f32 {
        self.below(x + half) - self.below(x - half)
    }
}
