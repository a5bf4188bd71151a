//! Gauss-Newton on tile coordinates with bumps: the relief's coefficients are eliminated, what is left are the sheet's own parameters.

use crate::numeric::Normal;
use crate::sheet::chart::Point;
use crate::sheet::fit::{Fit, Fitter, Observation, Prior, Robust, damped, sound};
use crate::sheet::relief::{COEFFICIENTS, Relief, Row};
use crate::sheet::surface::{PARAMETERS, Params, QUADRATIC, SHAPE, Surface};
use net_image::widely;

/// Normal equations of the coefficients, and what they share with the parameters.
#[derive(Debug, Default)]
pub(crate) struct Bumps {
    /// Derivatives of both coordinates of each tile.
    rows: Vec<[Row; 2]>,
    /// Lower triangle, row by row; its Cholesky factor once eliminated.
    a: Vec<Row>,
    cross: Vec<[f64; PARAMETERS]>,
    b: Vec<f64>,
}

/// Sum of products, in lanes.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    rest + sums.iter().sum::<f64>()
}

impl Bumps {
    /// Room for so many tiles.
    pub(crate) fn reserve(&mut self, tiles: usize) {
        self.rows.reserve(tiles);
        self.clear();
    }

    /// Equations of nothing yet.
    fn clear(&mut self) {
        self.a.clear();
        self.a.resize(COEFFICIENTS, [0.0; COEFFICIENTS]);
        self.cross.clear();
        self.cross.resize(COEFFICIENTS, [0.0; PARAMETERS]);
        self.b.clear();
        self.b.resize(COEFFICIENTS, 0.0);
    }

    /// Factors the equations: `cross` and `b` become what the factor's inverse makes of them.
    fn eliminate(&mut self) -> Option<()> {
        for i in 0..COEFFICIENTS {
            for j in 0..=i {
                let (row, other) = (&self.a[i], &self.a[j]);
                let sum = row[j] - dot(&row[..j], &other[..j]);
                self.a[i][j] = if i > j {
                    sum / self.a[j][j]
                } else if sum > 0.0 && sum.is_finite() {
                    sum.sqrt()
                } else {
                    return None;
                };
            }
        }
        for i in 0..COEFFICIENTS {
            let (done, rest) = self.cross.split_at_mut(i);
            for (l, above) in self.a[i].iter().zip(done.iter()) {
                rest[0].iter_mut().zip(above).for_each(|(x, y)| *x -= l * y);
            }
            let per = 1.0 / self.a[i][i];
            rest[0].iter_mut().for_each(|x| *x *= per);
            let known = dot(&self.a[i][..i], &self.b[..i]);
            self.b[i] = (self.b[i] - known) * per;
        }
        Some(())
    }

    /// Takes from the parameters' equations what the coefficients answer for.
    fn reduce(&self, n: &mut Normal<PARAMETERS>) {
        for (y, b) in self.cross.iter().zip(&self.b) {
            for i in 0..PARAMETERS {
                (0..PARAMETERS).for_each(|j| n.a[i][j] -= y[i] * y[j]);
                n.b[i] -= y[i] * b;
            }
        }
    }

    /// Adds to a function's derivatives by the parameters what the coefficients, by which it has the derivatives `row`, change with them, once they were eliminated and put
    /// back; returns the variance that they leave open by themselves.
    pub(crate) fn carry(&self, row: &Row, own: &mut Params) -> f64 {
        for (r, x) in row.iter().zip(&self.cross) {
            own.iter_mut().zip(x).for_each(|(d, x)| *d -= r * x);
        }
        let mut solved = [0.0; COEFFICIENTS];
        for (i, factor) in self.a.iter().enumerate() {
            solved[i] = (row[i] - dot(&factor[..i], &solved[..i])) / factor[i];
        }
        dot(&solved, &solved)
    }

    /// What the factor's transpose, inverted, makes of `b - cross d`, in the place of `b`; and of `cross`, in its place.
    fn substitute(&mut self, d: &[f64; PARAMETERS]) {
        for (b, y) in self.b.iter_mut().zip(&self.cross) {
            *b -= y.iter().zip(d).map(|(y, d)| y * d).sum::<f64>();
        }
        for i in (0..COEFFICIENTS).rev() {
            let per = 1.0 / self.a[i][i];
            self.b[i] *= per;
            self.cross[i].iter_mut().for_each(|x| *x *= per);
            let (before, rest) = self.cross.split_at_mut(i);
            for (k, above) in before.iter_mut().enumerate() {
                let l = self.a[i][k];
                self.b[k] -= l * self.b[i];
                above.iter_mut().zip(&rest[0]).for_each(|(x, y)| *x -= l * y);
            }
        }
    }
}

impl Fitter {
    /// Fits tangent plane, offsets, crossing angle, quadratic bend, thread bending and the relief's coefficients. The derivatives left behind are those of
    /// the parameters once the coefficients follow them. `None` when the sheet runs away, or has no relief.
    pub(crate) fn fit_bumps(
        &mut self,
        start: &Surface,
        observations: &[Observation],
        robust: Robust,
        prior: &Prior,
        iterations: usize,
    ) -> Option<Fit> {
        let mut fixed = *prior;
        fixed.sigma[SHAPE + QUADRATIC..SHAPE + start.height.len()].fill(0.0);
        let mut surface = *start;
        surface.height[QUADRATIC..].fill(0.0);
        let before = *start.relief.as_ref()?.coefficients();
        let mut fit = None;
        for _ in 0..iterations {
            self.linearize_quickly(&surface, PARAMETERS, observations);
            let n = self.normal(&surface, PARAMETERS, observations, robust, &fixed);
            self.relief_rows(&surface, observations);
            let relief = surface.relief?;
            let held = (prior.held, &before);
            let (mut d, mut covariance) = self.eliminated(&relief, observations, robust, prior, held, &n)?;
            let damp = damped(&mut d);
            let next = relief.stepped(&self.bumps.b, damp);
            if prior.held > 0.0 {
                // What was held is no new evidence.
                covariance = self.eliminated(&relief, observations, robust, prior, (0.0, &before), &n)?.1;
            }
            surface = Surface { relief: Some(next), ..surface.stepped(&d) };
            if !sound(&surface, prior) {
                return None;
            }
            fit = Some(Fit { surface, covariance });
        }
        for (j, rows) in self.jacobian.iter_mut().zip(&self.bumps.rows) {
            for (j, row) in j.iter_mut().zip(rows) {
                for (r, x) in row.iter().zip(&self.bumps.cross).filter(|(r, _)| **r != 0.0) {
                    j.iter_mut().zip(x).for_each(|(j, x)| *j -= r * x);
                }
            }
        }
        fit
    }

    /// Derivatives by the coefficients at the last linearization.
    fn relief_rows(&mut self, surface: &Surface, observations: &[Observation]) {
        let chart = surface.chart();
        self.bumps.rows.clear();
        for ((o, r), depth) in observations.iter().zip(&self.residuals).zip(&self.depth) {
            let mut rows = [[0.0; COEFFICIENTS]; 2];
            if !r[0].is_nan() {
                let point = Point { s: [o.s[0] - r[0], o.s[1] - r[1]], depth: *depth };
                chart.relief_slopes(o.site.ray, &point, &mut rows);
            }
            self.bumps.rows.push(rows);
        }
    }

    /// Step of the parameters, and their covariance, with the coefficients eliminated, whose step is left in `bumps.b`. `held`: how many times as much as the prior, and which
    /// coefficients.
    fn eliminated(
        &mut self,
        relief: &Relief,
        observations: &[Observation],
        robust: Robust,
        prior: &Prior,
        (held, before): (f64, &Row),
        n: &Normal<PARAMETERS>,
    ) -> Option<(Params, [[f64; PARAMETERS]; PARAMETERS])> {
        let mut bumps = std::mem::take(&mut self.bumps);
        bumps.clear();
        let [deviation, length] = prior.bumps;
        relief.add_precision(deviation, length, &mut bumps.a);
        let c = relief.coefficients();
        let off: Row = std::array::from_fn(|k| (1.0 + held) * c[k] - held * before[k]);
        for (row, b) in bumps.a.iter_mut().zip(&mut bumps.b) {
            *b = -row.iter().zip(&off).map(|(a, c)| a * c).sum::<f64>();
            row.iter_mut().for_each(|a| *a *= 1.0 + held);
        }
        add_products(self, observations, robust, &mut bumps);
        self.bumps = bumps;
        let mut left = n.clone();
        self.bumps.eliminate()?;
        self.bumps.reduce(&mut left);
        let (d, covariance) = left.solve(PARAMETERS)?;
        self.bumps.substitute(&d);
        Some((d, covariance))
    }
}

widely! {
    /// Adds what the observations say.
    fn add_products<'a>(fitter: &'a Fitter, observations: &'a [Observation], robust: Robust, bumps: &'a mut Bumps) -> () {
        let Bumps { rows, a, cross, b } = bumps;
        for (((o, r), j), [p, q]) in observations.iter().zip(&fitter.residuals).zip(&fitter.jacobian).zip(rows.iter()) {
            if r[0].is_nan() {
                continue;
            }
            let w = robust.weigh(o.weight, *r);
            let wr = [w[0] * r[0] + w[1] * r[1], w[1] * r[0] + w[2] * r[1]];
            for k in 0..COEFFICIENTS {
                let wk = [w[0] * p[k] + w[1] * q[k], w[1] * p[k] + w[2] * q[k]];
                if wk == [0.0; 2] {
                    continue;
                }
                // Of the lower triangle, in whole vectors.
                for l in 0..COEFFICIENTS.min((k | 7) + 1) {
                    a[k][l] += wk[0] * p[l] + wk[1] * q[l];
                }
                for l in 0..PARAMETERS {
                    cross[k][l] += wk[0] * j[0][l] + wk[1] * j[1][l];
                }
                b[k] += p[k] * wr[0] + q[k] * wr[1];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use net_geometry::nalgebra::{Rotation3, Vector3};
    use net_geometry::{Camera, Lens};

    use super::*;
    use crate::picture::view::Site;

    /// A sheet that rises and falls by some centimetres over a view 1.4 m wide, and its threads by a millimetre or two.
    fn bumpy() -> Surface {
        let rotation = Rotation3::new(Vector3::new(0.25, -0.4, 0.1)).into_inner();
        let mut s = Surface::flat(rotation, 1.2, 1.5, [0.05; 2]);
        s.height[0] = 0.2;
        s.bending = [0.05, -0.1];
        let steps: Vec<f64> = (0..COEFFICIENTS)
            .map(|k| if k < COEFFICIENTS - 24 { 0.025 } else { 0.002 } * f64::sin(2.3 * k as f64 + 0.4))
            .collect();
        s.relief = Some(Relief::level([-0.9, -0.6], [0.9, 0.6], 0.36).stepped(&steps, 1.0));
        s
    }

    fn observations(surface: &Surface) -> Vec<Observation> {
        let camera = Camera::new(735.0, 735.0, 423.5, 239.5, 848, 480, Lens::None).expect("fixed and sound");
        let chart = surface.chart();
        (0..16 * 9)
            .map(|t| Site::new(&camera, 26.0 + 53.0 * f64::from(t % 16), 28.0 + 53.0 * f64::from(t / 16)))
            .map(|site| {
                let s = chart.at(site.ray[0], site.ray[1]).expect("in view").s;
                Observation { site, s, weight: [1e5, 0.0, 1e5] }
            })
            .collect()
    }

    #[test]
    fn rows_are_the_slopes_of_the_coordinates() {
        let sheet = bumpy();
        let relief = sheet.relief.expect("it has one");
        let chart = sheet.chart();
        for ray in [[0.02, -0.01], [0.5, 0.3], [-0.45, 0.28]] {
            let p = chart.at(ray[0], ray[1]).expect("in view");
            let mut rows = [[0.0; COEFFICIENTS]; 2];
            chart.relief_slopes(ray, &p, &mut rows);
            for k in 0..COEFFICIENTS {
                let at = |step: f64| {
                    let steps: Vec<f64> = (0..COEFFICIENTS).map(|i| if i == k { step } else { 0.0 }).collect();
                    let moved = Surface { relief: Some(relief.stepped(&steps, 1.0)), ..sheet };
                    moved.chart().at(ray[0], ray[1]).expect("in view").s
                };
                let (up, down) = (at(1e-4), at(-1e-4));
                for f in 0..2 {
                    let difference = (up[f] - down[f]) / 2e-4;
                    // Newton stops at 1e-7 of the depth: 2e-6 cells over 2e-4. Where the sheet slopes its coordinates are drawn in to second order.
                    let off = rows[f][k] - difference;
                    assert!(off.abs() < 0.02 + 2e-3 * difference.abs(), "{k} {f}: {off} of {difference}");
                }
            }
        }
    }

    #[test]
    fn the_sheet_that_was_observed_is_found() {
        let truth = bumpy();
        let observations = observations(&truth);
        let mut prior = Prior { sigma: [f64::INFINITY; PARAMETERS], angle: 1.5, bumps: [0.022, 0.36], held: 0.0 };
        prior.sigma[SHAPE..].fill(0.3);
        let relief = Relief::level([-0.9, -0.6], [0.9, 0.6], 0.36);
        let turned = Rotation3::new(Vector3::new(0.04, -0.03, 0.01)).into_inner() * truth.rotation;
        let start = Surface { relief: Some(relief), ..Surface::flat(turned, 1.23, 1.45, [0.05; 2]) };
        let mut fitter = Fitter::default();
        let fit = fitter.fit_bumps(&start, &observations, Robust::Tile(0.5), &prior, 12).expect("a sheet");
        let off = fit.surface.normal().angle(&truth.normal()).to_degrees();
        let sigma = (fit.covariance[0][0] + fit.covariance[1][1]).sqrt().to_degrees();
        // Tiles known to 0.003 of a cell leave the normal open by what bumps between them may do: within three of what the fit says, which is no more than half a degree.
        assert!(sigma < 0.5 && off < 3.0 * sigma, "normal off by {off}, of {sigma}");
        assert!((fit.surface.depth / truth.depth - 1.0).abs() < 1e-3, "{}", fit.surface.depth);
        let seen: Vec<f64> = fitter.residuals.iter().flatten().copied().filter(|r| r.is_finite()).collect();
        assert!(seen.len() > 240, "{} of 288 residuals are on what the relief describes", seen.len());
        let rms = seen.iter().map(|r| r * r).sum::<f64>() / seen.len() as f64;
        // What the prior keeps back is small beside a tile's error.
        assert!(rms.sqrt() < 2e-3, "{} cells", rms.sqrt());
        assert!(
            fitter.fit_bumps(&Surface { relief: None, ..start }, &observations, Robust::Tile(0.5), &prior, 1).is_none()
        );
    }

    #[test]
    fn derivatives_left_behind_follow_the_coefficients() {
        let truth = bumpy();
        let observations = observations(&truth);
        let mut prior = Prior { sigma: [f64::INFINITY; PARAMETERS], angle: 1.5, bumps: [0.022, 0.36], held: 0.0 };
        prior.sigma[SHAPE..].fill(0.3);
        let mut fitter = Fitter::default();
        let fit_to = |fitter: &mut Fitter, observations: &[Observation]| {
            fitter.fit_bumps(&truth, observations, Robust::Tile(1e3), &prior, 1).expect("a sheet")
        };
        let fit = fit_to(&mut fitter, &observations);
        let rows: Vec<_> = fitter.jacobian.clone();
        for tile in [3, 40, 71, 100] {
            let mut moved = observations.clone();
            moved[tile].s[1] += 1e-3;
            let next = fit_to(&mut Fitter::default(), &moved);
            let foretold = |k: usize| {
                let by: f64 = (0..PARAMETERS).map(|l| fit.covariance[k][l] * rows[tile][1][l]).sum();
                by * observations[tile].weight[2] * 1e-3
            };
            let done = (next.surface.depth / fit.surface.depth).ln();
            // one step is linear in what is observed, but for the weights' 1e-12 and the solver's ridge of 1e-9
            assert!((done - foretold(3)).abs() < 1e-3 * done.abs() + 1e-12, "{done} and {}", foretold(3));
            let done = next.surface.angle - fit.surface.angle;
            assert!((done - foretold(6)).abs() < 1e-3 * done.abs() + 1e-12, "{done} and {}", foretold(6));
        }
    }
}
