//! Residuals of neighbouring tiles that are alike, and what they do to the parameters of a fit.

use crate::sheet::fit::{Fitter, Observation, Robust};
use crate::sheet::surface::{PARAMETERS, Params};
use net_image::widely;

/// Distance over which residuals of small and of large tiles may be alike, px of an 848 x 480 px picture: three tiles.
pub(crate) const REACH_PX: [f64; 2] = [160.0, 320.0];

/// Tiles whose residuals are alike, small ones and large ones, which are twice as wide: on simulated nets with uneven knots four small ones counted as one
/// find the flat model, and bent nets lose nothing by it; large ones counted so miss bends.
pub(crate) const ALIKE: [f64; 2] = [4.0, 1.0];

/// Room for the parameters in whole vectors.
const WIDE: usize = PARAMETERS.next_multiple_of(4);
type Wide = [f64; WIDE];

/// What one tile does to the parameters; zero from the first on that is not fitted.
#[derive(Debug, Clone)]
pub(crate) struct Influence {
    /// Its middle, full-resolution px.
    pixel: [f64; 2],
    /// Derivatives of both coordinates by the parameters.
    row: [Wide; 2],
    /// Change of the parameters by one cell of each coordinate.
    by: [Wide; 2],
    /// Change of the parameters by the tile's residuals.
    shift: Wide,
    /// `by` summed over the tiles that are alike.
    near: [Wide; 2],
    /// `row` through the covariance of a field of variance 1, less `near`.
    through: [Wide; 2],
}

/// Share of a parameter's variance that the residuals show, below which it is not raised any more.
const LEFT: f64 = 0.1;

/// The first `count` parameters from a function, the others zero.
fn from<const N: usize>(count: usize, of: impl Fn(usize) -> f64) -> [f64; N] {
    std::array::from_fn(|k| if k < count { of(k) } else { 0.0 })
}

#[inline(always)]
fn dot(a: &Wide, b: &Wide) -> f64 {
    let mut sums = [0.0; 4];
    for k in (0..WIDE).step_by(4) {
        for (lane, sum) in sums.iter_mut().enumerate() {
            *sum += a[k + lane] * b[k + lane];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}

#[inline(always)]
fn add(sum: &mut Wide, w: f64, a: &Wide) {
    for k in 0..WIDE {
        sum[k] += w * a[k];
    }
}

/// Bartlett's kernel along u and v.
#[inline(always)]
fn kernel(a: &Influence, b: &Influence, reach: f64) -> f64 {
    let along = |axis: usize| (1.0 - (a.pixel[axis] - b.pixel[axis]).abs() / reach).max(0.0);
    along(0) * along(1)
}

impl Fitter {
    /// Covariance of the parameters by residuals of the last linearization that are alike over `reach` px: a sheet that bends in a way the model cannot leaves
    /// such (Conley 1999, Bartlett's kernel along u and v). A fit leaves less of them than there were, the less the richer the model: each parameter's share is
    /// raised by what this fit would take from a field of residuals alike as the kernel says. `formal`: covariance of the fit.
    pub(crate) fn alike(
        &self,
        count: usize,
        observations: &[Observation],
        robust: Robust,
        formal: &[[f64; PARAMETERS]; PARAMETERS],
        reach: f64,
        influences: &mut Vec<Influence>,
    ) -> [[f64; PARAMETERS]; PARAMETERS] {
        influences.clear();
        influences.reserve(observations.len());
        let formal: [Wide; PARAMETERS] = std::array::from_fn(|a| from(count, |k| formal[a][k]));
        for ((o, r), j) in observations.iter().zip(&self.residuals).zip(&self.jacobian) {
            if r[0].is_nan() {
                continue;
            }
            let w = robust.weigh(o.weight, *r);
            let row = j.map(|j| -> Wide { from(count, |k| j[k]) });
            let by = [[w[0], w[1]], [w[1], w[2]]].map(|w| -> Wide {
                let score: Wide = from(count, |k| w[0] * row[0][k] + w[1] * row[1][k]);
                from(count, |k| dot(&formal[k], &score))
            });
            let shift = from(count, |k| by[0][k] * r[0] + by[1][k] * r[1]);
            let none = [[0.0; WIDE]; 2];
            influences.push(Influence { pixel: o.site.pixel, row, by, shift, near: none, through: none });
        }
        let mut sums = Sums { by: [[0.0; WIDE]; PARAMETERS], field: [[0.0; WIDE]; PARAMETERS], left: [0.0; WIDE] };
        sum_alike(influences, count, reach, &mut sums);
        let Sums { by, field, left } = sums;
        let raise: Params =
            from(count, |k| (field[k][k] / left[k].max(LEFT * field[k][k]).max(f64::MIN_POSITIVE)).sqrt());
        std::array::from_fn(|a| from(count, |k| by[a][k] * raise[a] * raise[k]))
    }
}

/// Sums over all pairs of tiles that are alike.
struct Sums {
    /// Covariance by the residuals.
    by: [Wide; PARAMETERS],
    /// What the parameters' covariance would be of a field of variance 1.
    field: [Wide; PARAMETERS],
    /// What of its diagonal the residuals that the fit leaves would make.
    left: Wide,
}

widely! {
    /// Fills the sums, and what the influences lack.
    fn sum_alike<'a>(influences: &'a mut [Influence], count: usize, reach: f64, sums: &'a mut Sums) -> () {
        for t in 0..influences.len() {
            let (mut shift, mut near) = ([0.0; WIDE], [[0.0; WIDE]; 2]);
            for other in influences.iter() {
                let w = kernel(&influences[t], other, reach);
                if w > 0.0 {
                    add(&mut shift, w, &other.shift);
                    (0..2).for_each(|f| add(&mut near[f], w, &other.by[f]));
                }
            }
            let tile = &mut influences[t];
            tile.near = near;
            for a in 0..count {
                add(&mut sums.by[a], tile.shift[a], &shift);
                (0..2).for_each(|f| add(&mut sums.field[a], tile.by[f][a], &near[f]));
            }
        }
        for tile in influences.iter_mut() {
            for f in 0..2 {
                let mut through = [0.0; WIDE];
                (0..count).for_each(|a| add(&mut through, tile.row[f][a], &sums.field[a]));
                add(&mut through, -1.0, &tile.near[f]);
                tile.through[f] = through;
            }
        }
        // Two tiles say the same of each other.
        for (t, one) in influences.iter().enumerate() {
            for (k, other) in influences[t..].iter().enumerate() {
                let w = kernel(one, other, reach);
                if w <= 0.0 {
                    continue;
                }
                let times = if k == 0 { w } else { 2.0 * w };
                let mut m = [[w, 0.0], [0.0, w]];
                for f in 0..2 {
                    for g in 0..2 {
                        let swallowed = dot(&one.row[f], &other.near[g]) - dot(&one.through[f], &other.row[g]);
                        m[f][g] = times * (m[f][g] - swallowed);
                    }
                }
                let [p, q] = &other.by;
                for k in 0..WIDE {
                    let first = one.by[0][k] * (m[0][0] * p[k] + m[0][1] * q[k]);
                    sums.left[k] += first + one.by[1][k] * (m[1][0] * p[k] + m[1][1] * q[k]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use net_geometry::nalgebra::Matrix3;
    use net_geometry::{Camera, Lens};

    use super::*;
    use crate::picture::view::Site;
    use crate::sheet::fit::Prior;
    use crate::sheet::surface::Surface;

    /// Tiles along u and v, as in a picture of 848 x 480 px.
    const TILES: [usize; 2] = [16, 9];
    const SPACING: f64 = 53.0;
    const TRIALS: usize = 300;

    /// A field of variance 1 whose covariance is Bartlett's kernel over three tiles: the mean of 3 x 3 independent values.
    fn field(random: &mut impl FnMut() -> f64) -> Vec<f64> {
        let wide = TILES[0] + 2;
        let white: Vec<f64> = (0..wide * (TILES[1] + 2)).map(|_| random()).collect();
        let at = |x: usize, y: usize| (0..9).map(|k| white[(y + k / 3) * wide + x + k % 3]).sum::<f64>() / 3.0;
        (0..TILES[1]).flat_map(|y| (0..TILES[0]).map(move |x| (x, y))).map(|(x, y)| at(x, y)).collect()
    }

    #[test]
    fn what_a_fit_swallows_is_counted() {
        let camera = Camera::new(600.0, 600.0, 423.5, 239.5, 848, 480, Lens::None).expect("fixed and sound");
        let truth = Surface::flat(Matrix3::identity(), 1.0, 1.5, [0.05; 2]);
        let chart = truth.chart();
        let sites: Vec<Site> = (0..TILES[0] * TILES[1])
            .map(|t| {
                let (x, y) = ((t % TILES[0]) as f64, (t / TILES[0]) as f64);
                Site::new(&camera, 26.0 + SPACING * x, 28.0 + SPACING * y)
            })
            .collect();
        let mut prior = Prior { sigma: [f64::INFINITY; PARAMETERS], angle: 1.5, bumps: [0.0; 2], held: 0.0 };
        prior.sigma[7..].fill(10.0);
        let (mut fitter, mut influences) = (Fitter::default(), Vec::new());
        // Knuth's linear congruence, to uniform values of variance 1.
        let mut state = 7u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 12f64.sqrt()
        };
        // Flat and rhombic, quartic.
        for count in [7, 19] {
            let (mut said, mut done) = ([0.0; PARAMETERS], [0.0; PARAMETERS]);
            for _ in 0..TRIALS {
                let fields = [field(&mut random), field(&mut random)];
                let observations: Vec<Observation> = sites
                    .iter()
                    .enumerate()
                    .map(|(t, site)| {
                        let s = chart.at(site.ray[0], site.ray[1]).expect("in view").s;
                        let s = std::array::from_fn(|f| s[f] + 0.001 * fields[f][t]);
                        Observation { site: *site, s, weight: [1e6, 0.0, 1e6] }
                    })
                    .collect();
                let robust = Robust::Tile(1e3);
                let fit = fitter.fit(&truth, count, &observations, robust, &prior, 2).expect("a sheet");
                let c = fitter.alike(count, &observations, robust, &fit.covariance, 3.0 * SPACING, &mut influences);
                let off = fit.surface.deviation(1.5);
                let off = |k: usize| if k == 3 { fit.surface.depth.ln() } else { off[k] };
                for k in (3..count).filter(|k| *k != 4 && *k != 5) {
                    said[k] += c[k][k];
                    done[k] += off(k).powi(2);
                }
            }
            for k in (3..count).filter(|k| *k != 4 && *k != 5) {
                let ratio = said[k] / done[k];
                // A variance of 300 trials is known to 8 %, and the mean of what is said to as much.
                assert!((0.75..1.33).contains(&ratio), "{ratio} of parameter {k} of {count}");
            }
        }
    }
}
