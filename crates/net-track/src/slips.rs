//! Slips: found by the L1 part of the program, rounded, weighed one by one.

use crate::config::Config;
use crate::error::{Error, Result};
use crate::program::Window;
use crate::result::Suspect;
use crate::sample::Sample;
use crate::state::Whitened;

/// Shortest time between frames that the motion model takes at its word, s: closer ones would make it singular.
const SHORTEST_S: f64 = 1e-4;
/// Length, cells, from which a step of the priced program counts as a slip: the price takes some tenths away.
const SLIPS: f64 = 0.25;
/// Measured frames that a count may be wrong and right again without being called a slip.
const EXCURSION: usize = 3;
/// Part of the price that is left for the second look: what makes the program have one answer.
const CHARGE: f64 = 1e-3;

/// Consecutive samples with the cells to be added to each; the first and the last are measured.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stretch<'a> {
    /// Number of the first among all samples.
    pub first: usize,
    pub samples: &'a [Sample],
    pub corrections: &'a [(i32, i32)],
}

impl<'a> Stretch<'a> {
    /// Some of it.
    pub fn part(&self, range: std::ops::Range<usize>) -> Self {
        Self {
            first: self.first + range.start,
            samples: &self.samples[range.clone()],
            corrections: &self.corrections[range],
        }
    }

    /// Whether a sample's measurement counts.
    pub fn counts(sample: &Sample, config: &Config) -> bool {
        sample.measurement.is_some_and(|m| m.probability >= config.min_probability)
    }

    /// Its convex program, `more` cells added to the corrections. `slips` tells which steps may slip.
    fn window(
        &self,
        config: &Config,
        slips: impl Fn(usize) -> bool,
        more: impl Fn(usize) -> (i32, i32),
    ) -> Result<Window> {
        let mut window = Window { first: self.first, ..Window::default() };
        let mut begun = false;
        for (k, sample) in self.samples.iter().enumerate() {
            let before = if k > 0 { self.samples[k - 1].timestamp_ns } else { sample.timestamp_ns };
            window.dt.push((sample.timestamp_ns.saturating_sub(before) as f64 * 1e-9).max(SHORTEST_S));
            let measured = match sample.measurement.filter(|_| Self::counts(sample, config)) {
                None => None,
                Some(m) => {
                    let (c, d) = (self.corrections[k], more(k));
                    let cells = (c.0.saturating_add(d.0), c.1.saturating_add(d.1));
                    Some(Whitened::new(&m, cells).ok_or(Error::Sample {
                        index: self.first + k,
                        field: "covariance",
                        value: m.covariance.determinant(),
                        expected: "positive definite as a covariance of the camera's place too",
                    })?)
                }
            };
            window.may_slip.push(begun && measured.is_some() && slips(k));
            begun |= measured.is_some();
            window.measured.push(measured);
            window.rejected.push(false);
            window.increments.push(sample.increment);
        }
        Ok(window)
    }

    /// The program that is solved for the poses.
    pub fn plain_window(&self, config: &Config) -> Result<Window> {
        self.window(config, |_| false, |_| (0, 0))
    }

    /// Steps that whole cells explain and motion does not, in order of time.
    pub fn suspects(&self, config: &Config) -> Result<Vec<Suspect>> {
        // 1. At a price: which steps slip at all.
        let solution = self.window(config, |_| true, |_| (0, 0))?.solve(config)?;
        let steps: Vec<usize> =
            (0..self.samples.len()).filter(|&k| solution.slips[k][0].hypot(solution.slips[k][1]) > SLIPS).collect();
        if steps.is_empty() {
            return Ok(Vec::new());
        }
        // 2. Those steps alone, all but free of charge: by how many cells. The price had made them too small.
        let free = Config { slip_price: CHARGE * config.slip_price, ..config.clone() };
        let solution = self.window(&free, |k| steps.contains(&k), |_| (0, 0))?.solve(&free)?;
        let found = self.whole(&steps, &solution.slips, config);
        self.weigh(found, config)
    }

    /// Steps by whole cells. A wrong pose is a step there and one back: what is undone within a few measured frames is left out, and what remains of such a
    /// group counts from its last frame on.
    fn whole(&self, steps: &[usize], slips: &[[f64; 2]], config: &Config) -> Vec<Suspect> {
        let rounded = |sum: [f64; 2]| {
            let cells = (sum[0].round(), sum[1].round());
            // What is undone may be so to within half a cell: a wrong pose is rarely wrong by whole cells.
            let most = if cells == (0.0, 0.0) { 0.75 } else { config.slip_max_rounding_cells };
            ((sum[0] - cells.0).hypot(sum[1] - cells.1) <= most).then_some((cells.0 as i32, cells.1 as i32))
        };
        let mut found = Vec::new();
        let mut n = 0;
        while n < steps.len() {
            let mut sum = [0.0; 2];
            let (mut alone, mut group) = (None, None);
            for (m, &k) in steps.iter().enumerate().skip(n) {
                let between = (steps[n]..k).filter(|&k| Self::counts(&self.samples[k], config)).count();
                if between > EXCURSION {
                    break;
                }
                sum = [sum[0] + slips[k][0], sum[1] + slips[k][1]];
                let cells = rounded(sum);
                if m == n {
                    alone = cells.map(|cells| (m, cells));
                } else if cells == Some((0, 0)) {
                    group = Some((m, (0, 0)));
                    break;
                } else if alone.is_none() && group.is_none() {
                    group = cells.map(|cells| (m, cells));
                }
            }
            let taken = group.or(alone);
            if let Some((m, cells)) = taken.filter(|(_, cells)| *cells != (0, 0)) {
                let k = steps[m];
                let before = (0..k).rev().find(|&b| Self::counts(&self.samples[b], config)).unwrap_or(0);
                let estimate = steps[n..=m].iter().fold([0.0; 2], |s, &k| [s[0] + slips[k][0], s[1] + slips[k][1]]);
                found.push(Suspect { sample: self.first + k, before: self.first + before, cells, estimate, gain: 0.0 });
            }
            n = taken.map_or(n, |(m, _)| m) + 1;
        }
        found
    }

    /// Gives each suspect its gain: the least cost with all but it, less that with all. Leaves out what gains too little.
    fn weigh(&self, mut found: Vec<Suspect>, config: &Config) -> Result<Vec<Suspect>> {
        let cost = |without: Option<usize>| {
            let more = |k: usize| {
                let so_far =
                    found.iter().enumerate().filter(|(n, s)| Some(*n) != without && s.sample <= self.first + k);
                so_far.fold((0, 0), |sum, (_, s)| (sum.0 + s.cells.0, sum.1 + s.cells.1))
            };
            Ok::<_, Error>(self.window(config, |_| false, more)?.solve(config)?.cost)
        };
        if found.is_empty() {
            return Ok(found);
        }
        let with_all = cost(None)?;
        let gains: Vec<f64> = (0..found.len()).map(|n| Ok(cost(Some(n))? - with_all)).collect::<Result<_>>()?;
        found.iter_mut().zip(gains).for_each(|(s, gain)| s.gain = gain);
        found.retain(|s| s.gain >= config.slip_min_gain);
        Ok(found)
    }
}
