//! Gauss-Newton on tile coordinates: which sheet puts the lattice where the tiles say it is.

use crate::numeric::Normal;
use crate::picture::view::Site;
use crate::sheet::bumps::Bumps;
use crate::sheet::chart::Point;
use crate::sheet::model::Model;
use crate::sheet::surface::{PARAMETERS, Params, Surface};
use net_image::widely;

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
    pub(crate) fn weigh(self, mut w: [f64; 3], r: [f64; 2]) -> [f64; 3] {
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
    /// Standard deviation of bumps, m, and their correlation length, m.
    pub bumps: [f64; 2],
    /// How many times as much as the prior the bumps of the start count: those of the last picture.
    pub held: f64,
}

/// What a fit ends with.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub surface: Surface,
    /// Formal covariance of a step from the surface, over the parameters fitted.
    pub covariance: [[f64; PARAMETERS]; PARAMETERS],
}

/// Buffers of the fit.
#[derive(Debug, Default)]
pub(crate) struct Fitter {
    pub jacobian: Vec<[Params; 2]>,
    /// Depth at each site.
    pub(crate) depth: Vec<f64>,
    /// Residuals of the last iteration, before its step; NaN where the sheet is not seen.
    pub residuals: Vec<[f64; 2]>,
    whitened: Vec<f64>,
    pub bumps: Bumps,
}

/// Finite-difference steps, in the order of the parameters.
const STEP: Params = {
    let mut s = [1e-4; PARAMETERS];
    s[4] = 1e-3;
    s[5] = 1e-3;
    s
};
/// The same of the crossing angle alone, where all others are in closed form.
const STEP_ANGLE: f64 = 1e-5;

impl Fitter {
    /// Residuals, and the depth at each site.
    fn compare(&mut self, surface: &Surface, observations: &[Observation]) {
        let chart = surface.chart();
        self.residuals.clear();
        self.depth.clear();
        for o in observations {
            let seen = chart
                .at(o.site.ray[0], o.site.ray[1])
                .filter(|p| o.weight[0] + o.weight[2] > 0.0 && chart.described(o.site.ray, p.depth));
            self.depth.push(seen.map_or(0.0, |p| p.depth));
            self.residuals.push(seen.map_or([f64::NAN; 2], |p| [o.s[0] - p.s[0], o.s[1] - p.s[1]]));
        }
    }

    /// Residuals and their derivatives by the first `count` parameters.
    pub(crate) fn linearize(&mut self, surface: &Surface, count: usize, observations: &[Observation]) {
        self.compare(surface, observations);
        self.jacobian.clear();
        self.jacobian.resize(observations.len(), [[0.0; PARAMETERS]; 2]);
        let mut base = [0.0; 2];
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

    /// The same with the derivatives in closed form: a third of the time.
    pub(crate) fn linearize_quickly(&mut self, surface: &Surface, count: usize, observations: &[Observation]) {
        self.compare(surface, observations);
        self.jacobian.clear();
        self.jacobian.resize(observations.len(), [[0.0; PARAMETERS]; 2]);
        let mut d = [0.0; PARAMETERS];
        d[6] = STEP_ANGLE;
        let (chart, wider) = (surface.chart(), surface.stepped(&d).chart());
        for (((o, r), depth), j) in observations.iter().zip(&self.residuals).zip(&self.depth).zip(&mut self.jacobian) {
            if !r[0].is_nan() {
                let point = Point { s: [o.s[0] - r[0], o.s[1] - r[1]], depth: *depth };
                *j = chart.slopes(o.site.ray, &point, &wider, STEP_ANGLE);
                j.iter_mut().for_each(|j| j[count..].fill(0.0));
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
        add_rows(self, count, observations, robust, &mut n);
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

    /// Fits what a model leaves free. `None` when the sheet runs away.
    pub(crate) fn fit_model(
        &mut self,
        start: &Surface,
        model: Model,
        observations: &[Observation],
        robust: Robust,
        prior: &Prior,
        iterations: usize,
    ) -> Option<Fit> {
        match model {
            Model::Bumpy => self.fit_bumps(start, observations, robust, prior, iterations),
            _ => self.fit(start, model.parameters(), observations, robust, prior, iterations),
        }
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
        let mut fit = None;
        let mut surface = *start;
        for _ in 0..iterations {
            self.linearize(&surface, count, observations);
            let step = self.step(&surface, count, observations, robust, prior)?;
            surface = step.surface;
            fit = Some(step);
        }
        fit
    }

    /// The same from a start that is a fraction of a cell off: two steps with the derivatives of the first.
    pub(crate) fn settle(
        &mut self,
        start: &Surface,
        count: usize,
        observations: &[Observation],
        robust: Robust,
        prior: &Prior,
    ) -> Option<Fit> {
        self.linearize_quickly(start, count, observations);
        let near = self.step(start, count, observations, robust, prior)?.surface;
        self.compare(&near, observations);
        self.step(&near, count, observations, robust, prior)
    }

    /// One step by the last derivatives and residuals.
    fn step(
        &self,
        surface: &Surface,
        count: usize,
        observations: &[Observation],
        robust: Robust,
        prior: &Prior,
    ) -> Option<Fit> {
        let (mut d, covariance) = self.normal(surface, count, observations, robust, prior).solve(count)?;
        damped(&mut d);
        let surface = surface.stepped(&d);
        sound(&surface, prior).then_some(Fit { surface, covariance })
    }
}

/// Shortens a step that leads too far; returns the part that is left.
pub(crate) fn damped(d: &mut Params) -> f64 {
    let turn = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
    let limit = |limit: f64, x: f64| limit / (x.abs() + 1e-12);
    let damp = 1f64.min(limit(0.15, turn)).min(limit(0.15, d[3])).min(limit(0.12, d[6]));
    d.iter_mut().for_each(|d| *d *= damp);
    damp
}

/// Whether a sheet is still one that a camera may see.
pub(crate) fn sound(surface: &Surface, prior: &Prior) -> bool {
    surface.rotation[(2, 2)] > 0.12
        && surface.depth > 1.5 * surface.sides[0].min(surface.sides[1])
        && (0.3..=2.84).contains(&surface.angle)
        && (surface.angle - prior.angle).abs() < 0.8
}

widely! {
    /// Adds what the observations say.
    fn add_rows<'a>(
        fitter: &'a Fitter,
        count: usize,
        observations: &'a [Observation],
        robust: Robust,
        n: &'a mut Normal<PARAMETERS>,
    ) -> () {
        for ((o, r), j) in observations.iter().zip(&fitter.residuals).zip(&fitter.jacobian) {
            if r[0].is_nan() {
                continue;
            }
            let w = robust.weigh(o.weight, *r);
            let wr = [w[0] * r[0] + w[1] * r[1], w[1] * r[0] + w[2] * r[1]];
            let [p, q] = j;
            for a in 0..count {
                let wa = [w[0] * p[a] + w[1] * q[a], w[1] * p[a] + w[2] * q[a]];
                // The whole row, though half of it would do: in one go.
                for b in 0..PARAMETERS {
                    n.a[a][b] += wa[0] * p[b] + wa[1] * q[b];
                }
                n.b[a] += p[a] * wr[0] + q[a] * wr[1];
            }
        }
    }
}
