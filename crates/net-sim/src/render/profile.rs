//! Simple shapes through a Gaussian point spread, in closed form or tabulated. Lengths in standard deviations of it.

/// Beyond this many standard deviations the point spread is nothing: 3e-7 of an edge is left.
pub(crate) const REACH_SIGMA: f64 = 5.0;

/// Table steps per standard deviation: linear interpolation is then right to 5e-7, far below a grey level.
const STEPS: f64 = 256.0;

/// The picture of an edge: the normal distribution function.
#[derive(Debug)]
pub(crate) struct EdgeSpread {
    below: Vec<f32>,
    density: Vec<f32>,
}

impl EdgeSpread {
    pub(crate) fn new() -> Self {
        let n = (2.0 * REACH_SIGMA * STEPS) as usize;
        // One entry more than the last interval needs, so that the end is interpolated like the rest.
        let table = |at: fn(f64) -> f64| (0..=n + 1).map(|k| at(k as f64 / STEPS - REACH_SIGMA) as f32).collect();
        Self {
            below: table(|x| 0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)),
            density: table(|x| (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt()),
        }
    }

    /// Share of the point spread that lies below `x`.
    #[inline]
    pub(crate) fn below(&self, x: f32) -> f32 {
        interpolate(&self.below, x)
    }

    /// Coverage at distance `x` from the middle of a strip of half width `half`.
    #[inline]
    pub(crate) fn strip(&self, x: f32, half: f32) -> f32 {
        self.below(x + half) - self.below(x - half)
    }

    /// Light at distance `x` from the middle of a strip of half width `half` whose brightness runs from -1 to 1 across it: the
    /// integral of `y/half` times the point spread, in closed form.
    #[inline]
    pub(crate) fn ramp(&self, x: f32, half: f32) -> f32 {
        let rise = interpolate(&self.density, x + half) - interpolate(&self.density, x - half);
        (x * self.strip(x, half) + rise) / half.max(0.05)
    }
}

#[inline]
fn interpolate(table: &[f32], x: f32) -> f32 {
    let p = ((x + REACH_SIGMA as f32) * STEPS as f32).clamp(0.0, (2.0 * REACH_SIGMA * STEPS) as f32);
    let k = p as usize;
    let (a, b) = (table[k], table[k + 1]);
    a + (b - a) * (p - k as f32)
}

/// The picture of a disc.
#[derive(Debug)]
pub(crate) struct DiscSpread {
    /// For each radius the coverage against the distance, relative to that of the centre.
    table: Vec<f32>,
}

/// Larger discs are edges.
const LARGEST: f64 = 6.0;
const RADII_PER_SIGMA: f64 = 4.0;
const DISTANCES_PER_SIGMA: f64 = 8.0;
const DISTANCES: usize = ((LARGEST + REACH_SIGMA) * DISTANCES_PER_SIGMA) as usize + 2;

impl DiscSpread {
    pub(crate) fn new() -> Self {
        let radii = (LARGEST * RADII_PER_SIGMA) as usize + 2;
        let mut table = Vec::with_capacity(radii * DISTANCES);
        for r in 0..radii {
            for d in 0..DISTANCES {
                table.push(relative_coverage(d as f64 / DISTANCES_PER_SIGMA, r as f64 / RADII_PER_SIGMA) as f32);
            }
        }
        Self { table }
    }

    /// Coverage at `distance` from the centre of a disc of `radius`.
    #[inline]
    pub(crate) fn coverage(&self, distance: f32, radius: f32, edge: &EdgeSpread) -> f32 {
        if radius >= LARGEST as f32 {
            return edge.below(radius - distance);
        }
        let (r, d) = (radius.max(0.0) * RADII_PER_SIGMA as f32, distance * DISTANCES_PER_SIGMA as f32);
        let (i, j) = (r as usize, d as usize);
        if j + 1 >= DISTANCES {
            return 0.0;
        }
        let at = |i: usize| {
            let row = &self.table[i * DISTANCES..];
            row[j] + (row[j + 1] - row[j]) * (d - j as f32)
        };
        let (near, far) = (at(i), at(i + 1));
        // The centre's coverage is exact: it carries the energy of discs far smaller than the point spread.
        (near + (far - near) * (r - i as f32)) * -(-0.5 * radius * radius).exp_m1()
    }
}

/// Coverage at `distance` of a disc of `radius`, relative to that of the centre, `1 - exp(-radius²/2)`.
fn relative_coverage(distance: f64, radius: f64) -> f64 {
    if radius == 0.0 {
        return (-0.5 * distance * distance).exp();
    }
    // Integral over the disc of the Rice density, by Simpson's rule.
    let steps = 96;
    let density = |r: f64| r * (-0.5 * (r - distance).powi(2)).exp() * scaled_bessel_i0(r * distance);
    let h = radius / f64::from(steps);
    let weight = |k: i32| if k == 0 || k == steps { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
    let sum: f64 = (0..=steps).map(|k| weight(k) * density(f64::from(k) * h)).sum();
    sum * h / 3.0 / -(-0.5 * radius * radius).exp_m1()
}

/// `exp(-x) I0(x)` for `x >= 0` (Abramowitz and Stegun 9.8.1 and 9.8.2, good to 2e-7).
fn scaled_bessel_i0(x: f64) -> f64 {
    let horner = |c: &[f64], t: f64| c.iter().rev().fold(0.0, |sum, &a| sum * t + a);
    if x <= 3.75 {
        let t = (x / 3.75).powi(2);
        return horner(&[1.0, 3.515_622_9, 3.089_942_4, 1.206_749_2, 0.265_973_2, 0.036_076_8, 0.004_581_3], t)
            * (-x).exp();
    }
    let c = [
        0.398_942_28,
        0.013_285_92,
        0.002_253_19,
        -0.001_575_65,
        0.009_162_81,
        -0.020_577_06,
        0.026_355_37,
        -0.016_476_33,
        0.003_923_77,
    ];
    horner(&c, 3.75 / x) / x.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disc_has_the_light_of_its_area() {
        let (disc, edge) = (DiscSpread::new(), EdgeSpread::new());
        // Integral of the coverage over the plane is the disc's area, whatever its size. The table is linear between radii.
        for radius in [0.05, 0.4, 1.0, 2.3, 5.9, 7.0] {
            let step = 0.02;
            let ring = |k: i32| {
                let r = (f64::from(k) + 0.5) * step;
                std::f64::consts::TAU * r * step * f64::from(disc.coverage(r as f32, radius as f32, &edge))
            };
            let light: f64 = (0..800).map(ring).sum();
            let area = std::f64::consts::PI * radius * radius;
            assert!((light / area - 1.0).abs() < 0.03, "radius {radius}: {light} of {area}");
        }
        // Centre: the closed form, to single precision.
        let centre = f64::from(disc.coverage(0.0, 1.5, &edge));
        assert!((centre - (1.0 - (-0.5f64 * 2.25).exp())).abs() < 1e-4, "{centre}");
    }

    #[test]
    fn a_ramp_is_the_sum_of_its_strips() {
        // Naive: a thousand thin strips of their own brightness.
        let edge = EdgeSpread::new();
        for (x, half) in [(0.3f64, 1.0f64), (-1.2, 0.5), (2.0, 3.0)] {
            let n = 1000;
            let naive: f64 = (0..n)
                .map(|k| {
                    let y = (f64::from(k) + 0.5) / f64::from(n) * 2.0 * half - half;
                    let density = (-0.5 * (x - y).powi(2)).exp() / std::f64::consts::TAU.sqrt();
                    y / half * density * 2.0 * half / f64::from(n)
                })
                .sum();
            let got = f64::from(edge.ramp(x as f32, half as f32));
            assert!((got - naive).abs() < 1e-5, "{x} {half}: {got} {naive}");
        }
    }
}
