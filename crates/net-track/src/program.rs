//! The convex program over a window of frames.
//!
//! Minimise, over states, outliers `u`, slips `o`,
//!
//! ```text
//!   sum_k  1/2 |W_k (x_k - m_k - A_k o_k) - u_k|^2 + huber |u_k|      lattice measurements
//! + sum_k  1/2 |V_k (c_k - c_(k-1) - f_k) - y_k|^2 + huber |y_k|      increments
//! + sum_k  1/2 |motion_k|^2                                          white acceleration
//! + price sum_k |o_k - o_(k-1)|                                      slips, few
//! with |v_k| <= speed_max,  |v_k - v_(k-1)| <= acceleration_max dt
//! ```
//!
//! The minimum over `u` of the first two terms is Huber's loss of the length of the whitened residual. Every norm is a second-order cone.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use net_geometry::nalgebra::{Vector3, Vector6};

use crate::config::Config;
use crate::error::{Error, Result};
use crate::sample::Increment;
use crate::state::{
    CENTRE, Linear, ROTATION, Row, STATE, TURNING, VELOCITY, Whitened, increment_rows, motion_rows, rate_rows,
};

/// Rounds of linearisation at the most, and the turn, rad, below which another would change nothing (its square is 25e-6).
const ROUNDS: usize = 4;
const SMALL_TURN: f64 = 5e-3;

/// Rounds of rejection at the most, and how many frames either way a wrong pose may pull.
const REJECTIONS: usize = 4;
const NEAR: usize = 5;

/// A window: frames in order of time.
#[derive(Debug, Clone, Default)]
pub(crate) struct Window {
    /// Number of its first frame among the samples.
    pub first: usize,
    /// Seconds since the frame before, one a frame; the first is not used.
    pub dt: Vec<f64>,
    pub measured: Vec<Option<Whitened>>,
    pub increments: Vec<Option<Increment>>,
    /// Measured frames at which the count may slip.
    pub may_slip: Vec<bool>,
    /// Measured frames whose measurement has no say: they were found too far off.
    pub rejected: Vec<bool>,
}

/// Its solution.
#[derive(Debug, Clone)]
pub(crate) struct Solution {
    pub at: Vec<Linear>,
    pub turning: Vec<Vector3<f64>>,
    pub velocity: Vec<Vector3<f64>>,
    /// Cells to add from this frame on, more than to the frame before.
    pub slips: Vec<[f64; 2]>,
    /// Least cost.
    pub cost: f64,
}

/// Rows and columns under construction.
#[derive(Default)]
struct Builder {
    unknowns: usize,
    linear: Vec<f64>,
    constant: f64,
    /// Upper triangle of the quadratic form.
    p: (Vec<usize>, Vec<usize>, Vec<f64>),
    a: (Vec<usize>, Vec<usize>, Vec<f64>),
    b: Vec<f64>,
    cones: Vec<SupportedConeT<f64>>,
}

impl Builder {
    fn unknowns(&mut self, count: usize) -> usize {
        self.unknowns += count;
        self.linear.resize(self.unknowns, 0.0);
        self.unknowns - count
    }

    /// Adds half the square of a residual.
    fn square(&mut self, row: &Row) {
        for &(i, x) in &row.terms {
            self.linear[i] -= x * row.rhs;
            for &(j, y) in &row.terms {
                if i <= j {
                    self.p.0.push(i);
                    self.p.1.push(j);
                    self.p.2.push(x * y);
                }
            }
        }
        self.constant += 0.5 * row.rhs * row.rhs;
    }

    /// The first expression bounds the length of the others; each is a sum of terms and a constant.
    fn cone(&mut self, expressions: &[(&[(usize, f64)], f64)]) {
        for (terms, constant) in expressions {
            for &(column, factor) in *terms {
                self.a.0.push(self.b.len());
                self.a.1.push(column);
                self.a.2.push(-factor);
            }
            self.b.push(*constant);
        }
        self.cones.push(SupportedConeT::SecondOrderConeT(expressions.len()));
    }

    /// Adds Huber's loss of the length of some residuals together.
    fn huber(&mut self, rows: &[Row], threshold: f64) {
        let outlier = self.unknowns(rows.len());
        let length = self.unknowns(1);
        self.linear[length] = threshold;
        for (r, row) in rows.iter().enumerate() {
            let mut row = row.clone();
            row.terms.push((outlier + r, -1.0));
            self.square(&row);
        }
        let parts: Vec<_> = (0..rows.len()).map(|r| [(outlier + r, 1.0)]).collect();
        let bound = [(length, 1.0)];
        let mut expressions: Vec<(&[(usize, f64)], f64)> = vec![(&bound, 0.0)];
        expressions.extend(parts.iter().map(|p| (&p[..], 0.0)));
        self.cone(&expressions);
    }

    fn solve(self, window: &Window) -> Result<(Vec<f64>, f64)> {
        let failed = |status: String| Error::Solver {
            first: window.first,
            last: window.first + window.dt.len().saturating_sub(1),
            status,
        };
        let (n, m) = (self.unknowns, self.b.len());
        let p = CscMatrix::new_from_triplets(n, n, self.p.0, self.p.1, self.p.2);
        let a = CscMatrix::new_from_triplets(m, n, self.a.0, self.a.1, self.a.2);
        // One thread, one method, no limit of time: the same answer everywhere.
        let settings = DefaultSettings {
            verbose: false,
            max_threads: 1,
            direct_solve_method: "qdldl".into(),
            ..DefaultSettings::default()
        };
        let mut solver = DefaultSolver::new(&p, &self.linear, &a, &self.b, &self.cones, settings)
            .map_err(|e| failed(e.to_string()))?;
        solver.solve();
        let s = &solver.solution;
        let sound = s.x.iter().all(|x| x.is_finite()) && s.obj_val.is_finite();
        match s.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved if sound => Ok((s.x.clone(), s.obj_val + self.constant)),
            status => Err(failed(format!("{status:?}"))),
        }
    }
}

impl Window {
    /// The unmeasured frames' linearisation lies between those of the measured ones.
    pub fn start(&self) -> Vec<Linear> {
        let known: Vec<_> = (0..self.dt.len())
            .filter(|&k| !self.rejected[k])
            .filter_map(|k| Some((k, self.measured[k].as_ref()?.at)))
            .collect();
        let mut time = 0.0;
        let times: Vec<f64> = (0..self.dt.len())
            .map(|k| {
                time += if k > 0 { self.dt[k] } else { 0.0 };
                time
            })
            .collect();
        (0..self.dt.len())
            .map(|k| {
                let next = known.partition_point(|(at, _)| *at < k);
                match (next.checked_sub(1).map(|b| known[b]), known.get(next)) {
                    (_, Some((at, linear))) if *at == k => *linear,
                    (Some((b, before)), Some((a, after))) => {
                        before.between(after, (times[k] - times[b]) / (times[*a] - times[b]))
                    }
                    (Some((_, linear)), None) | (None, Some(&(_, linear))) => linear,
                    // A window without any measurement is never asked for; this keeps it finite.
                    (None, None) => Linear::of(&net_geometry::Pose {
                        rotation: net_geometry::nalgebra::Rotation3::identity(),
                        translation: Vector3::zeros(),
                    }),
                }
            })
            .collect()
    }

    /// Solves it, linearising anew until the turns are small.
    pub fn solve(&self, config: &Config) -> Result<Solution> {
        let mut at = self.start();
        let mut round = 1;
        loop {
            let solution = self.solve_about(&at, config)?;
            let turned = solution.at.iter().zip(&at).map(|(new, old)| new.rotation.angle_to(&old.rotation));
            let largest = turned.fold(0.0, f64::max);
            if largest < SMALL_TURN || round == ROUNDS {
                return Ok(solution);
            }
            at = solution.at;
            round += 1;
        }
    }

    /// Solves it without the measurements that turn out too far off. Huber's loss bounds the pull of a wrong pose, and does not end it; the farthest of each
    /// neighbourhood are taken out until none is too far, and put back where that was too hasty.
    pub fn solve_without_outliers(&mut self, config: &Config) -> Result<Solution> {
        let mut solution = self.solve(config)?;
        for _ in 0..REJECTIONS {
            let residuals: Vec<f64> = (0..self.dt.len()).map(|k| self.residual(k, &solution.at[k])).collect();
            let rejected: Vec<bool> = (0..residuals.len())
                .map(|k| {
                    let around = k.saturating_sub(NEAR)..(k + NEAR + 1).min(residuals.len());
                    let farthest = around.map(|n| residuals[n]).fold(0.0, f64::max);
                    residuals[k] > config.huber_deviations && residuals[k] > 0.5 * farthest
                })
                .collect();
            // A frame that has been taken out stays out as long as it is too far off, however far its neighbours are.
            let rejected: Vec<bool> = (0..residuals.len())
                .map(|k| rejected[k] || (self.rejected[k] && residuals[k] > config.huber_deviations))
                .collect();
            // Something has to be left to stand on.
            let left = (0..residuals.len()).filter(|&k| self.measured[k].is_some() && !rejected[k]).count();
            if rejected == self.rejected || 2 * left < self.measured.iter().flatten().count() {
                break;
            }
            self.rejected = rejected;
            solution = self.solve(config)?;
        }
        Ok(solution)
    }

    fn solve_about(&self, at: &[Linear], config: &Config) -> Result<Solution> {
        let n = self.dt.len();
        let mut builder = Builder::default();
        builder.unknowns(STATE * n);
        rate_rows(config).iter().for_each(|row| builder.square(row));
        // Cells added so far: the unknowns, once the count may have slipped.
        let mut added: Option<usize> = None;
        let mut slip_at = vec![None; n];
        for k in 0..n {
            if k > 0 {
                let dt = self.dt[k];
                motion_rows(k, &at[k - 1], &at[k], dt, config).iter().for_each(|row| builder.square(row));
                if let Some(step) = &self.increments[k]
                    && let Some(rows) = increment_rows(k, &at[k - 1], &at[k], step)
                {
                    builder.huber(&rows, config.huber_deviations);
                }
                let (a, b) = (STATE * (k - 1) + VELOCITY, STATE * k + VELOCITY);
                let steps: Vec<_> = (0..3).map(|i| [(b + i, 1.0), (a + i, -1.0)]).collect();
                builder.cone(&[
                    (&[], config.acceleration_max_m_s2 * dt),
                    (&steps[0], 0.0),
                    (&steps[1], 0.0),
                    (&steps[2], 0.0),
                ]);
            }
            let v = STATE * k + VELOCITY;
            builder.cone(&[
                (&[], config.speed_max_m_s),
                (&[(v, 1.0)], 0.0),
                (&[(v + 1, 1.0)], 0.0),
                (&[(v + 2, 1.0)], 0.0),
            ]);
            let Some(m) = self.measured[k].as_ref().filter(|_| !self.rejected[k]) else { continue };
            if self.may_slip[k] {
                let here = builder.unknowns(2);
                let length = builder.unknowns(1);
                builder.linear[length] = config.slip_price;
                let step = |i: usize| {
                    let mut terms = vec![(here + i, 1.0)];
                    terms.extend(added.map(|before| (before + i, -1.0)));
                    terms
                };
                builder.cone(&[(&[(length, 1.0)], 0.0), (&step(0), 0.0), (&step(1), 0.0)]);
                slip_at[k] = Some((here, added));
                added = Some(here);
            }
            let mut rows = m.rows(k, &at[k]);
            if let Some(cells) = added {
                for (row, factors) in rows.iter_mut().zip(m.cells()) {
                    row.terms.extend([(cells, factors[0]), (cells + 1, factors[1])]);
                }
            }
            builder.huber(&rows, config.huber_deviations);
        }
        let (x, cost) = builder.solve(self)?;
        let three = |k: usize, from: usize| {
            let i = STATE * k + from;
            Vector3::new(x[i], x[i + 1], x[i + 2])
        };
        Ok(Solution {
            at: (0..n).map(|k| at[k].stepped(three(k, ROTATION), three(k, CENTRE))).collect(),
            turning: (0..n).map(|k| three(k, TURNING)).collect(),
            velocity: (0..n).map(|k| three(k, VELOCITY)).collect(),
            slips: slip_at
                .iter()
                .map(|slip| {
                    slip.map_or([0.0; 2], |(here, before)| {
                        [0, 1].map(|i| x[here + i] - before.map_or(0.0, |b: usize| x[b + i]))
                    })
                })
                .collect(),
            cost,
        })
    }

    /// Distance of a frame's solution from its measurement, deviations.
    pub fn residual(&self, k: usize, at: &Linear) -> f64 {
        self.measured[k].as_ref().map_or(0.0, |m| {
            let off: Vector6<f64> = m.white * m.off(at);
            off.norm()
        })
    }
}
