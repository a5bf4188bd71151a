//! Gauss-Newton on tile coordinates: which sheet puts the lattice where the tiles say it is.

use crate::numeric::Normal;
use crate::surface::{PARAMETERS, Params, Surface};
use crate::view::Site;

/// Lattice coordinates measured at a site, with their information matrix (xx, xy, yy), 1 / cells².
#[derive(Debug, Clone, Copy)]
pub(crate) struct Observation {
    pub site: Site,
    pub s: [f64; 2],
    pub weight: [f64; 3],
}

/// How residuals lose their weight.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Robust {
    /// Each family by itself, scale in cells.
    Family(f64),
    /// Both families of a tile together, scale in cells.
    Tile(f64),
}

impl Robust {
    /// The information left to a tile with residuals `r`.
    fn weigh(self, mut w: [f64; 3], r: [f64; 2]) -> [f64; 3] {
        match self {
            Self::Family(scale) => {
                let down = |r: f64| 1.0 / (1.0 + (r / scale).powi(2)).powi(2);
                w[0] *= down(r[0]);
                w[2] *= down(r[1]);
                w[1] = 0.0;
            }
            Self::Tile(scale) => {
                let down = 1.0 / (1.0 + (r[0] * r[0] + r[1] * r[1]) / (scale * scale)).powi(2);
                w.iter_mut().for_each(|w| *w *= down);
            }
        }
        w
    }
}

/// Prior: standard deviations (infinite: none; zero: fixed) and the nominal crossing angle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Prior {
    pub sigma: Params,
    pub angle: f64,
}

/// What a fit ends with.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub surface: Surface,
    /// Formal covariance of a step from the surface, over the parameters fitted.
    pub covariance: [[f64; PARAMETERS]; PARAMETERS],
}

/// What one tile does to the parameters.
#[derive(Debug, Clone)]
pub(crate) struct Influence {
    pixel: [f64; 2],
    /// Derivatives of both coordinates by the parameters.
    row: [Params; 2],
    /// Change of the parameters by one cell of each coordinate.
    by: [Params; 2],
    /// Change of the parameters by the tile's residuals.
    shift: Params,
    /// `by` summed over the tiles that are alike.
    near: [Params; 2],
}

/// Share of a parameter's variance that the residuals show, below which it is not raised any more.
const LEFT: f64 = 0.1;

/// The first `count` parameters from a function, the others zero.
fn from(count: usize, of: impl Fn(usize) -> f64) -> Params {
    std::array::from_fn(|k| if k < count { of(k) } else { 0.0 })
}

fn dot(count: usize, a: &Params, b: &Params) -> f64 {
    a.iter().zip(b).take(count).map(|(a, b)| a * b).sum()
}

fn add(count: usize, sum: &mut Params, w: f64, a: &Params) {
    sum.iter_mut().zip(a).take(count).for_each(|(s, a)| *s += w * a);
}

/// Buffers of the fit.
#[derive(Debug, Default)]
pub(crate) struct Fitter {
    jacobian: Vec<[[f64; PARAMETERS]; 2]>,
    /// Depth at each site.
    depth: Vec<f64>,
    /// Residuals of the last iteration, before its step; NaN where the sheet is not seen.
    pub residuals: Vec<[f64; 2]>,
    whitened: Vec<f64>,
}

/// Finite-difference steps, in the order of the parameters.
const STEP: Params = {
    let mut s = [1e-4; PARAMETERS];
    s[4] = 1e-3;
    s[5] = 1e-3;
    s
};

impl Fitter {
    /// Residuals and their derivatives by the first `count` parameters.
    pub(crate) fn linearize(&mut self, surface: &Surface, count: usize, observations: &[Observation]) {
        self.residuals.clear();
        self.jacobian.clear();
        self.jacobian.resize(observations.len(), [[0.0; PARAMETERS]; 2]);
        let chart = surface.chart();
        let mut base = [0.0; 2];
        self.depth.clear();
        for o in observations {
            let seen = chart.at(o.site.ray[0], o.site.ray[1]).filter(|_| o.weight[0] + o.weight[2] > 0.0);
            self.depth.push(seen.map_or(0.0, |p| p.depth));
            self.residuals.push(seen.map_or([f64::NAN; 2], |p| [o.s[0] - p.s[0], o.s[1] - p.s[1]]));
        }
        for k in 0..count {
            if k == 4 || k == 5 {
                for j in &mut self.jacobian {
                    j[k - 4][k] = 1.0;
                }
                continue;
            }
            let mut d = [0.0; PARAMETERS];
            d[k] = STEP[k];
            let chart = surface.stepped(&d).chart();
            let rows = observations.iter().zip(&self.residuals).zip(&self.depth).zip(&mut self.jacobian);
            for (((o, r), depth), j) in rows {
                if r[0].is_nan() {
                    continue;
                }
                base[0] = o.s[0] - r[0];
                base[1] = o.s[1] - r[1];
                if let Some(p) = chart.at_from(o.site.ray[0], o.site.ray[1], Some(*depth)) {
                    j[0][k] = (p.s[0] - base[0]) / STEP[k];
                    j[1][k] = (p.s[1] - base[1]) / STEP[k];
                }
            }
        }
    }

    /// Normal equations of the last linearization.
    pub(crate) fn normal(
        &self,
        surface: &Surface,
        count: usize,
        observations: &[Observation],
        robust: Robust,
        prior: &Prior,
    ) -> Normal<PARAMETERS> {
        let mut n = Normal::new();
        for ((o, r), j) in observations.iter().zip(&self.residuals).zip(&self.jacobian) {
            if r[0].is_nan() {
                continue;
            }
            let w = robust.weigh(o.weight, *r);
            let wr = [w[0] * r[0] + w[1] * r[1], w[1] * r[0] + w[2] * r[1]];
            for a in 0..count {
                let wa = [w[0] * j[0][a] + w[1] * j[1][a], w[1] * j[0][a] + w[2] * j[1][a]];
                for b in 0..=a {
                    n.a[a][b] += wa[0] * j[0][b] + wa[1] * j[1][b];
                }
                n.b[a] += j[0][a] * wr[0] + j[1][a] * wr[1];
            }
        }
        let deviation = surface.deviation(prior.angle);
        for k in 0..count {
            if prior.sigma[k].is_finite() {
                let information = prior.sigma[k].max(1e-9).powi(-2);
                n.a[k][k] += information;
                n.b[k] -= information * deviation[k];
            }
        }
        n
    }

    /// Magnitudes of the last residuals in units of what the observations claim.
    pub(crate) fn whiten(&mut self, observations: &[Observation]) -> &[f64] {
        let seen = observations.iter().zip(&self.residuals).filter(|(_, r)| !r[0].is_nan());
        self.whitened.clear();
        self.whitened.extend(seen.map(|(o, r)| {
            let [a, b, c] = o.weight;
            (a * r[0] * r[0] + 2.0 * b * r[0] * r[1] + c * r[1] * r[1]).max(0.0).sqrt()
        }));
        &self.whitened
    }

    /// Gradient that a change of the predicted coordinates would make in the normal equations of the last linearization: J' W change.
    pub(crate) fn pull(
        &self,
        count: usize,
        observations: &[Observation],
        robust: Robust,
        change: impl Fn(&Observation) -> [f64; 2],
    ) -> Params {
        let mut pull = [0.0; PARAMETERS];
        for ((o, r), j) in observations.iter().zip(&self.residuals).zip(&self.jacobian) {
            if r[0].is_nan() {
                continue;
            }
            let w = robust.weigh(o.weight, *r);
            let c = change(o);
            let wc = [w[0] * c[0] + w[1] * c[1], w[1] * c[0] + w[2] * c[1]];
            for (k, p) in pull.iter_mut().enumerate().take(count) {
                *p += j[0][k] * wc[0] + j[1][k] * wc[1];
            }
        }
        pull
    }

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
        for ((o, r), j) in observations.iter().zip(&self.residuals).zip(&self.jacobian) {
            if r[0].is_nan() {
                continue;
            }
            let w = robust.weigh(o.weight, *r);
            let score =
                [[w[0], w[1]], [w[1], w[2]]].map(|w| -> Params { from(count, |k| w[0] * j[0][k] + w[1] * j[1][k]) });
            let by = score.map(|s| -> Params { from(count, |k| dot(count, &formal[k], &s)) });
            let shift = from(count, |k| by[0][k] * r[0] + by[1][k] * r[1]);
            influences.push(Influence { pixel: o.site.pixel, row: *j, by, shift, near: [[0.0; PARAMETERS]; 2] });
        }
        let kernel = |a: &Influence, b: &Influence| {
            let along = |axis: usize| (1.0 - (a.pixel[axis] - b.pixel[axis]).abs() / reach).max(0.0);
            along(0) * along(1)
        };
        let mut sum = [[0.0; PARAMETERS]; PARAMETERS];
        // What the parameters' covariance would be of a field of variance 1.
        let mut field = [[0.0; PARAMETERS]; PARAMETERS];
        for t in 0..influences.len() {
            let (mut shift, mut near) = ([0.0; PARAMETERS], [[0.0; PARAMETERS]; 2]);
            for other in influences.iter() {
                let w = kernel(&influences[t], other);
                if w > 0.0 {
                    add(count, &mut shift, w, &other.shift);
                    near.iter_mut().zip(&other.by).for_each(|(n, b)| add(count, n, w, b));
                }
            }
            let tile = &mut influences[t];
            tile.near = near;
            for a in 0..count {
                add(count, &mut sum[a], tile.shift[a], &shift);
                (0..2).for_each(|f| add(count, &mut field[a], tile.by[f][a], &near[f]));
            }
        }
        // What of it the residuals that the fit leaves would make.
        let mut left = [0.0; PARAMETERS];
        for one in influences.iter() {
            let through: [Params; 2] = one.row.map(|row| from(count, |k| dot(count, &row, &field[k])));
            for other in influences.iter() {
                let w = kernel(one, other);
                if w <= 0.0 {
                    continue;
                }
                for f in 0..2 {
                    for g in 0..2 {
                        let together = if f == g { w } else { 0.0 }
                            - dot(count, &one.row[f], &other.near[g])
                            - dot(count, &one.near[f], &other.row[g])
                            + dot(count, &through[f], &other.row[g]);
                        for k in 0..count {
                            left[k] += w * together * one.by[f][k] * other.by[g][k];
                        }
                    }
                }
            }
        }
        let raise: Params =
            from(count, |k| (field[k][k] / left[k].max(LEFT * field[k][k]).max(f64::MIN_POSITIVE)).sqrt());
        for (a, row) in sum.iter_mut().enumerate() {
            row.iter_mut().zip(&raise).for_each(|(s, r)| *s *= raise[a] * r);
        }
        sum
    }

    /// Fits the first `count` parameters. `None` when the sheet runs away.
    pub(crate) fn fit(
        &mut self,
        start: &Surface,
        count: usize,
        observations: &[Observation],
        robust: Robust,
        prior: &Prior,
        iterations: usize,
    ) -> Option<Fit> {
        let mut surface = *start;
        let mut covariance = [[0.0; PARAMETERS]; PARAMETERS];
        for _ in 0..iterations {
            self.linearize(&surface, count, observations);
            let normal = self.normal(&surface, count, observations, robust, prior);
            let (mut d, inverse) = normal.solve(count)?;
            covariance = inverse;
            let turn = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            let limit = |limit: f64, x: f64| limit / (x.abs() + 1e-12);
            let damp = 1f64.min(limit(0.15, turn)).min(limit(0.15, d[3])).min(limit(0.12, d[6]));
            d.iter_mut().for_each(|d| *d *= damp);
            surface = surface.stepped(&d);
            let sound = surface.rotation[(2, 2)] > 0.12
                && surface.depth > 1.5 * surface.sides[0].min(surface.sides[1])
                && (0.3..=2.84).contains(&surface.angle)
                && (surface.angle - prior.angle).abs() < 0.8;
            if !sound {
                return None;
            }
        }
        Some(Fit { surface, covariance })
    }
}
