//! The score of one hypothesis on the unblurred spectra: power where the harmonics of both families should be, in all tiles.

use net_geometry::nalgebra::Vector3;
use net_image::widely;

use crate::numeric::log2_rough;
use crate::picture::view::Site;
use crate::search::spectra::{Bank, COLUMNS, HIGHEST, SIZE};
use crate::search::table::{Candidate, NOTHING, Scope};

/// Whitened power from which a wave's vote grows with the logarithm only.
const SOFT: f32 = 4.0;
/// Vote of noise, taken off.
const NOISE: f32 = 1.1;
/// Harmonics that are looked at.
const ORDERS: usize = 6;
/// Fewest periods in a tile of a family that is looked at, and of a harmonic.
const FEWEST: [f32; 2] = [0.4, 2.2];
/// Tiles that are worked on at once.
const LANES: usize = 8;
type Lanes = [f32; LANES];

/// The tiles of a bank side by side: rays, and their derivatives by the pixel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Places {
    /// NaN where there is no tile, or no ray.
    x: Lanes,
    y: Lanes,
    /// Rows x and y, columns u and v.
    jacobian: [[Lanes; 2]; 2],
}

impl Places {
    pub(crate) fn new(sites: &[Site]) -> Vec<Self> {
        let group = |sites: &[Site]| {
            let of = |f: &dyn Fn(&Site) -> f64| {
                std::array::from_fn(|l| sites.get(l).filter(|s| s.valid).map_or(f32::NAN, |s| f(s) as f32))
            };
            let jacobian = |i: usize, k: usize| of(&|s| s.jacobian()[i][k]);
            Self {
                x: of(&|s| s.ray[0]),
                y: of(&|s| s.ray[1]),
                jacobian: [[jacobian(0, 0), jacobian(0, 1)], [jacobian(1, 0), jacobian(1, 1)]],
            }
        };
        sites.chunks(LANES).map(group).collect()
    }
}

/// What the tiles vote for a hypothesis, by family and harmonic: sum, and number of tiles.
#[derive(Default)]
struct Votes {
    sum: [[f32; ORDERS]; 2],
    count: [[f32; ORDERS]; 2],
}

/// Score of one hypothesis, about the number of standard deviations above noise; `scale`: full-resolution px per px of the bank's level.
pub(crate) fn score(bank: &Bank, scale: f64, scope: &Scope, c: &Candidate) -> f64 {
    let d = 0.5 * (std::f64::consts::FRAC_PI_2 - c.angle);
    let (sd, cd) = d.sin_cos();
    let det = cd * cd - sd * sd;
    let (e1, e2) = (c.rotation.column(0), c.rotation.column(1));
    // Of each family the vector whose product with a step in the plane is a number of cells.
    let per_side = scope.sides.map(|side| c.depth * scale / (det * side));
    let dual = [(e1 * cd - e2 * sd) * per_side[0], (e2 * cd - e1 * sd) * per_side[1]];
    let votes = votes(bank, &dual, &c.rotation.column(2).into_owned());
    // Blur leaves the lowest harmonics only: as many are counted as do the hypothesis good.
    let family = |f: usize| {
        let (mut s, mut n, mut best) = (0.0, 0.0, f64::from(NOTHING));
        for (sum, count) in votes.sum[f].iter().zip(&votes.count[f]) {
            s += f64::from(*sum);
            n += f64::from(*count);
            if n >= 4.0 {
                best = f64::max(best, s / n.sqrt());
            }
        }
        best
    };
    let (a, b) = (family(0), family(1));
    if a.min(b) <= f64::from(NOTHING) {
        return f64::from(NOTHING);
    }
    let prior = if scope.angle_sigma > 0.0 { (c.angle - scope.angle) / (1.2 * scope.angle_sigma) } else { 0.0 };
    0.5 * a.min(b) + 0.25 * (a + b) - 0.5 * prior * prior
}

widely! {
    fn votes<'a>(bank: &'a Bank, dual: &'a [Vector3<f64>; 2], normal: &'a Vector3<f64>) -> Votes {
        vote(bank, dual, normal)
    }
}

#[inline(always)]
fn vote(bank: &Bank, dual: &[Vector3<f64>; 2], normal: &Vector3<f64>) -> Votes {
    let [nx, ny, nz] = [normal.x as f32, normal.y as f32, normal.z as f32];
    let n = SIZE as f32;
    let length = bank.length as f32;
    let power = bank.power.as_slice();
    let Some(end) = power.len().checked_sub(SIZE + 2) else { return Votes::default() };
    let mut votes = Votes::default();
    for (group, places) in bank.places.iter().enumerate() {
        for (f, dual) in dual.iter().enumerate() {
            let [ax, ay, az] = [dual.x as f32, dual.y as f32, dual.z as f32];
            // Cycles per px of the level, u made positive, and the lowest and highest harmonic that can be seen.
            let (mut u, mut v, mut low, mut high) = ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]);
            for l in 0..LANES {
                let (x, y) = (places.x[l], places.y[l]);
                let along = nx * x + ny * y + nz;
                let step = ax * x + ay * y + az;
                let far = nz / along;
                let per = far / along;
                let (gx, gy) = (per * (ax * along - nx * step), per * (ay * along - ny * step));
                let j = &places.jacobian;
                let (ku, kv) = (gx * j[0][0][l] + gy * j[1][0][l], gx * j[0][1][l] + gy * j[1][1][l]);
                let sign = 1f32.copysign(ku);
                (u[l], v[l]) = (sign * ku, sign * kv);
                let k = (ku * ku + kv * kv).sqrt();
                // Near grazing, and where there is no tile, nothing is seen.
                let seen = along >= 0.08 && far <= 14.0 && k * length >= FEWEST[0];
                low[l] = FEWEST[1] / (k * length);
                high[l] = if seen { HIGHEST as f32 / k } else { 0.0 };
            }
            for order in 0..ORDERS {
                let h = (order + 1) as f32;
                if !(0..LANES).any(|l| h >= low[l] && h <= high[l]) {
                    continue;
                }
                // One after the other, for the first and the last of these loops become vectors.
                let (mut bin, mut fx, mut fy, mut counts) = ([0; LANES], [0.0; LANES], [0.0; LANES], [false; LANES]);
                for l in 0..LANES {
                    let (px, py) = (h * u[l] * n, h * v[l] * n + 0.5 * n);
                    let inside = px < (COLUMNS - 1) as f32 && py >= 0.0 && py < (SIZE - 1) as f32;
                    counts[l] = h >= low[l] && h <= high[l] && inside;
                    let (ix, iy);
                    ((ix, fx[l]), (iy, fy[l])) = (split(px), split(py));
                    let tile = (group * LANES + l) as u32;
                    bin[l] = (tile * COLUMNS as u32).wrapping_add(ix).wrapping_mul(SIZE as u32).wrapping_add(iy);
                }
                // A bin, the one below, and those to their right.
                let mut corner = [[0.0; LANES]; 4];
                for (l, bin) in bin.into_iter().enumerate() {
                    let k = (bin as usize).min(end);
                    let (left, right) = (&power[k..][..2], &power[k + SIZE..][..2]);
                    (corner[0][l], corner[1][l], corner[2][l], corner[3][l]) = (left[0], left[1], right[0], right[1]);
                }
                let (mut sum, mut count) = ([0.0; LANES], [0.0; LANES]);
                for l in 0..LANES {
                    let between = |a: f32, b: f32, part: f32| a + part * (b - a);
                    let left = between(corner[0][l], corner[1][l], fy[l]);
                    let right = between(corner[2][l], corner[3][l], fy[l]);
                    // Clipped softly: a plateau would hide where strong waves are highest.
                    let vote = SOFT * log2_rough(1.0 + between(left, right, fx[l]) * (1.0 / SOFT)) - NOISE;
                    sum[l] = if counts[l] { vote } else { 0.0 };
                    count[l] = if counts[l] { 1.0 } else { 0.0 };
                }
                votes.sum[f][order] += sum.iter().sum::<f32>();
                votes.count[f][order] += count.iter().sum::<f32>();
            }
        }
    }
    votes
}

/// Whole part and the rest of a number from 0 to some thousands; the whole part may be one less and the rest 1.
#[inline(always)]
fn split(x: f32) -> (u32, f32) {
    // 1.5 x 2^23: whole numbers are what is left of a fraction beside it.
    const MAGIC: f32 = 12_582_912.0;
    let shifted = (x - 0.5) + MAGIC;
    (shifted.to_bits().wrapping_sub(MAGIC.to_bits()), x - (shifted - MAGIC))
}
