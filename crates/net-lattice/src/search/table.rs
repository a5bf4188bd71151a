//! Cold search: which planes, turns, depths and crossing angles put the harmonics of both families of twine on power in all tiles.
//!
//! A family's wave vectors depend on the normal, on the direction of its dual vector in the plane and on depth over spacing only, so the
//! score is tabulated per family over (normal, direction, depth) and hypotheses are pairs of entries. Depths are a twelfth of an octave
//! apart: harmonics 2, 3, 4, 5 and 6 are 12, 19.02, 24, 27.86 and 31.02 steps up, so harmonics are looked up as well.

use net_geometry::nalgebra::{Matrix3, Rotation3, Vector3};
use net_image::widely;

use crate::picture::view::View;
use crate::search::coarse::VARIANCE;
use crate::search::spectra::{Bank, COLUMNS, HIGHEST, SIZE};

/// Directions of dual vectors: every 5 degrees of the half circle.
const DIRECTIONS: usize = 36;
/// Tilts of the normals, degrees, that are tried.
const TILTS: [f64; 8] = [0.0, 11.0, 22.0, 33.0, 44.0, 54.0, 63.0, 70.0];
/// Steps of the depth scale to harmonic 1..6.
const HARMONICS: [usize; 6] = [0, 12, 19, 24, 28, 31];

/// Most steps of a table: from 3.7 px to 0.378 of a tile's 256 px they are 89.
const STEPS: usize = 96;

/// Score where too few tiles can tell.
pub(crate) const NOTHING: f32 = -9.0;

/// A plane worth a lock-in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    /// Score, about the number of standard deviations above noise.
    pub score: f64,
    /// The same above what other hypotheses of that depth have, in standard deviations.
    pub above: f64,
    pub rotation: Matrix3<f64>,
    pub depth: f64,
    pub angle: f64,
}

/// What the search may look for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scope {
    /// The mesh's sides, m.
    pub sides: [f64; 2],
    /// Nominal crossing angle and its standard deviation, rad.
    pub angle: f64,
    pub angle_sigma: f64,
}

/// One tile's wave of one (normal, direction): where it runs over the spectrum.
#[derive(Debug, Clone, Copy)]
struct Walk {
    /// Bin at step 0 along x and y.
    x: f32,
    y: f32,
    first: u16,
    end: u16,
}

/// The table for one bank.
pub(crate) struct Search {
    pub normals: Vec<Matrix3<f64>>,
    /// Depth over spacing, cells, at step 0, and how many steps.
    base: f64,
    steps: usize,
    /// Steps that are hypotheses' fundamentals.
    depths: std::ops::Range<usize>,
    walks: Vec<Walk>,
    power_of_step: Vec<f32>,
    sums: Vec<f32>,
    counts: Vec<u16>,
    scores: Vec<f32>,
    ranking: Ranking,
}

/// Buffers for ranking hypotheses.
#[derive(Default)]
struct Ranking {
    /// Score, normal, step of the depth, direction.
    best: Vec<(f32, usize, usize, usize)>,
    /// Normals and depths of those that are kept.
    kept: Vec<(usize, usize)>,
    /// How many more each octave of the depth may keep.
    room: Vec<usize>,
    /// Of the first family, all that are not another's by a quarter turn.
    directions: Vec<usize>,
}

fn basis(tilt: f64, azimuth: f64) -> Matrix3<f64> {
    Rotation3::new(Vector3::new(tilt * azimuth.cos(), tilt * azimuth.sin(), 0.0)).into_inner()
}

/// Gradient of the tangent-plane coordinates by the pixel, per metre of depth: rows X and Y, columns u and v. `None` near grazing.
fn gradient(r: &Matrix3<f64>, site: &crate::picture::view::Site) -> Option<[[f64; 2]; 2]> {
    let d = Vector3::new(site.ray[0], site.ray[1], 1.0);
    let n = r.column(2);
    let nd = n.dot(&d);
    if !site.valid || nd < 0.08 || n[2] / nd > 14.0 {
        return None;
    }
    let lambda = n[2] / nd;
    let j = site.jacobian();
    let row = |i: usize| {
        let rd = r.column(i).dot(&d);
        let g = [lambda / nd * (r[(0, i)] * nd - n[0] * rd), lambda / nd * (r[(1, i)] * nd - n[1] * rd)];
        [g[0] * j[0][0] + g[1] * j[1][0], g[0] * j[0][1] + g[1] * j[1][1]]
    };
    Some([row(0), row(1)])
}

impl Search {
    /// For cells of `smallest..largest` full-resolution px on the optical axis.
    pub(crate) fn new(view: &View, bank: &Bank, smallest: f64, largest: f64) -> Self {
        let mut normals = Vec::new();
        for tilt in TILTS {
            let t = tilt.to_radians();
            let count =
                if tilt == 0.0 { 1 } else { (std::f64::consts::TAU * t.sin() / 13f64.to_radians()).round() as usize };
            for a in 0..count {
                normals.push(basis(t, std::f64::consts::TAU * a as f64 / count as f64 + 0.01 * tilt));
            }
        }
        let scale = view.levels[bank.level].scale;
        let base = view.focal / largest;
        let last = (12.0 * (largest / smallest).log2()).ceil() as usize + 1;
        let steps = last + HARMONICS[5] + 1;
        debug_assert!(steps <= STEPS);
        let mut walks = Vec::with_capacity(bank.searched().count() * normals.len() * DIRECTIONS);
        for site in bank.searched() {
            for r in &normals {
                let g = gradient(r, site);
                for k in 0..DIRECTIONS {
                    let Some(g) = g else {
                        walks.push(Walk { x: 0.0, y: 0.0, first: 0, end: 0 });
                        continue;
                    };
                    let (s, c) = (k as f64 * std::f64::consts::PI / DIRECTIONS as f64).sin_cos();
                    // cycles per level px at step 0
                    let mut x = (c * g[0][0] + s * g[1][0]) * scale * base;
                    let mut y = (c * g[0][1] + s * g[1][1]) * scale * base;
                    if x < 0.0 {
                        (x, y) = (-x, -y);
                    }
                    let len = x.hypot(y).max(1e-12);
                    let n = SIZE as f64;
                    let first = (12.0 * (2.2 / bank.length as f64 / len).log2()).ceil().clamp(0.0, steps as f64);
                    let mut end = (12.0 * (HIGHEST / len).log2()).floor() + 1.0;
                    // Columns and rows end before the corner of the spectrum does.
                    end = end.min((12.0 * ((COLUMNS as f64 - 1.0) / n / x.max(1e-12)).log2()).floor());
                    let end = end.clamp(0.0, steps as f64).max(first);
                    walks.push(Walk { x: (x * n) as f32, y: (y * n) as f32, first: first as u16, end: end as u16 });
                }
            }
        }
        let cells = normals.len() * DIRECTIONS;
        let mut counts = vec![0u16; cells * steps];
        for (w, cell) in walks.iter().zip((0..cells).cycle()) {
            for c in &mut counts[cell * steps..][usize::from(w.first)..usize::from(w.end)] {
                *c += 1;
            }
        }
        Self {
            base,
            steps,
            depths: 0..last,
            power_of_step: (0..steps).map(|k| (k as f64 / 12.0).exp2() as f32).collect(),
            sums: vec![0.0; cells * steps],
            scores: vec![0.0; cells * steps],
            ranking: Ranking::default(),
            normals,
            walks,
            counts,
        }
    }

    /// Nearest and farthest depth of the table for a side of `side` m.
    pub(crate) fn depths_m(&self, side: f64) -> (f64, f64) {
        let of = |k: usize| self.base * f64::from(self.power_of_step[k]) * side;
        (of(0), of(self.depths.end - 1))
    }

    /// Scores every (normal, direction, depth) for one family.
    #[inline(always)]
    fn tabulate(&mut self, bank: &Bank) {
        let cells = self.normals.len() * DIRECTIONS;
        let steps = self.steps;
        self.sums.fill(0.0);
        let mut bins = [0; STEPS];
        let (tiles, _) = bank.coarse.as_chunks::<{ COLUMNS * SIZE }>();
        for (power, walks) in tiles.iter().zip(self.walks.chunks_exact(cells)) {
            for (w, sums) in walks.iter().zip(self.sums.chunks_exact_mut(steps)) {
                let range = usize::from(w.first)..usize::from(w.end);
                // First where, which becomes vectors, then what is there.
                let bins = &mut bins[..range.len()];
                for (bin, p) in bins.iter_mut().zip(&self.power_of_step[range.clone()]) {
                    let (ix, iy) = (nearest(w.x * p), nearest(w.y * p + (SIZE / 2) as f32));
                    *bin = ix.wrapping_mul(SIZE as u32).wrapping_add(iy);
                }
                for (sum, bin) in sums[range].iter_mut().zip(bins) {
                    *sum += power[(*bin as usize).min(COLUMNS * SIZE - 1)];
                }
            }
        }
        // Harmonics, and the score of one family: as many harmonics as do it good, since blur leaves only the lowest.
        for c in 0..cells {
            let (sums, counts) = (&self.sums[c * steps..][..steps], &self.counts[c * steps..][..steps]);
            let out = &mut self.scores[c * steps..][..steps];
            for i in self.depths.clone() {
                let (mut s, mut n) = (0.0f32, 0u32);
                out[i] = NOTHING;
                for h in HARMONICS {
                    s += sums[i + h];
                    n += u32::from(counts[i + h]);
                    if n >= 4 {
                        out[i] = out[i].max(s / (n as f32 * VARIANCE as f32).sqrt());
                    }
                }
            }
        }
    }

    /// The best hypotheses, refined, best first.
    pub(crate) fn run(&mut self, bank: &Bank, scope: &Scope, per_octave: usize, found: &mut Vec<Candidate>) {
        tabulate(self, bank);
        let steps = self.steps;
        let step_angle = 180.0 / DIRECTIONS as f64;
        let nominal = scope.angle.to_degrees();
        let spread = (1.5 * scope.angle_sigma.to_degrees()).min(15.0);
        let angles = [0.0, -spread, spread].map(|d| ((nominal + d) / step_angle).round() * step_angle);
        // Without a spread all three are one.
        let angles = if angles[1] == angles[0] { &angles[..1] } else { &angles[..] };
        let [a, b] = scope.sides;
        // A quarter turn changes nothing on a square mesh but the crossing angle's name.
        let square = (a / b - 1.0).abs() < 1e-6 && (nominal - 90.0).abs() < 1e-6;
        let shift = (12.0 * (a / b).log2()).round() as isize;
        let Ranking { best, kept, room, directions } = &mut self.ranking;
        for &angle in angles.iter().filter(|a| (20.0..=160.0).contains(*a)) {
            let half_skew = 0.5 * (90.0 - angle);
            let turn = ((180.0 - angle) / step_angle).round() as usize;
            // First and second family's depths with the other in the table, and the directions that differ.
            let first = self.depths.start.max((-shift).max(0) as usize);
            let end = self.depths.end.min((self.depths.end as isize - shift).max(0) as usize);
            let other = |i: usize| (i as isize + shift) as usize;
            let roll = |k: usize| (k as f64 * step_angle + half_skew + 90.0).rem_euclid(180.0) - 90.0;
            directions.clear();
            directions.extend((0..DIRECTIONS).filter(|k| !square || (-45.0..45.0).contains(&roll(*k))));
            best.clear();
            for (n, scores) in self.scores.chunks_exact(DIRECTIONS * steps).enumerate() {
                let from = best.len();
                best.extend((first..end).map(|i| (f32::NEG_INFINITY, n, i, 0)));
                for &k in directions.iter() {
                    let one = &scores[k * steps..][..steps];
                    let two = &scores[(k + turn) % DIRECTIONS * steps..][..steps];
                    for top in &mut best[from..] {
                        let (p, q) = (one[top.2], two[other(top.2)]);
                        let s = 0.5 * p.min(q) + 0.25 * (p + q);
                        if s > top.0 {
                            (top.0, top.3) = (s, k);
                        }
                    }
                }
            }
            best.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
            // Every octave of the cell's size has its best: fish are many waves as long as they are, and would leave no room for short ones.
            kept.clear();
            room.clear();
            room.resize(self.depths.end.div_ceil(12), per_octave);
            for &(score, n, i, k) in best.iter() {
                let near = |(m, l): &(usize, usize)| {
                    i.abs_diff(*l) <= 1
                        && self.normals[n].column(2).dot(&self.normals[*m].column(2)).clamp(-1.0, 1.0).acos() < 0.2
                };
                if room[i / 12] == 0 || kept.iter().any(near) {
                    continue;
                }
                room[i / 12] -= 1;
                kept.push((n, i));
                let gamma = angle.to_radians();
                let d = 0.5 * (std::f64::consts::FRAC_PI_2 - gamma);
                let roll = k as f64 * step_angle.to_radians() + d;
                let rotation = self.normals[n] * Rotation3::new(Vector3::new(0.0, 0.0, roll)).into_inner();
                let depth = self.base * f64::from(self.power_of_step[i]) * a * gamma.sin();
                found.push(Candidate { score: f64::from(score), above: 0.0, rotation, depth, angle: gamma });
                if room.iter().all(|r| *r == 0) {
                    break;
                }
            }
        }
    }
}

widely! {
    fn tabulate<'a>(search: &'a mut Search, bank: &'a Bank) -> () {
        search.tabulate(bank);
    }
}

/// The whole number nearest to one from 0 to some thousands, without a library call.
#[inline(always)]
fn nearest(x: f32) -> u32 {
    // 2^23: what is left of a fraction beside it are whole numbers.
    const MAGIC: f32 = 8_388_608.0;
    (x + MAGIC).to_bits().wrapping_sub(MAGIC.to_bits())
}

impl std::fmt::Debug for Search {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Search over {} normals", self.normals.len())
    }
}
