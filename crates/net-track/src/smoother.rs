//! A whole run: parted where nothing connects it, repaired, smoothed window by window.

use crate::config::Config;
use crate::error::{Error, Result};
use crate::marginals;
use crate::result::{Answer, Gap, GapReason, Origin, Repair, Smoothed, Suspect, Trajectory, Verdict};
use crate::sample::{self, Sample};
use crate::slips::Stretch;
use crate::state::shift_covariance;

/// Samples behind a suspected slip without which it cannot be told from an outlier.
pub(crate) const BEHIND: usize = 3;

/// Smooths a run. `verify` is asked about every suspected slip, in order of time; what it confirms is applied, at everything else the run is parted.
///
/// Memory grows with the run by a few hundred bytes a sample; each convex program is bounded by the window.
///
/// # Errors
/// [`Error::Parameter`], [`Error::Sample`] and [`Error::TimeOrder`] name what is wrong with the input; [`Error::Solver`] names the window that could
/// not be solved.
pub fn smooth(samples: &[Sample], config: &Config, mut verify: impl FnMut(&Suspect) -> Answer) -> Result<Trajectory> {
    config.validate()?;
    for (k, s) in samples.iter().enumerate() {
        sample::check(k, s, k.checked_sub(1).map(|b| samples[b].timestamp_ns))?;
    }
    let mut trajectory = Trajectory { poses: vec![None; samples.len()], ..Trajectory::default() };
    let mut corrections = vec![(0, 0); samples.len()];
    let mut segment = 0;
    let (stretches, gaps) = part(samples, config);
    for (n, range) in stretches.into_iter().enumerate() {
        if n > 0 {
            trajectory.gaps.push(gaps[n - 1]);
            segment += 1;
            // The count goes on over a gap in time, corrected as before it.
            if gaps[n - 1].reason == GapReason::Time {
                let so_far = corrections[gaps[n - 1].before];
                corrections[range.clone()].fill(so_far);
            }
        }
        let cuts = repair(samples, &mut corrections, range.clone(), config, &mut verify, &mut trajectory)?;
        let mut start = range.start;
        for end in cuts.into_iter().chain([range.end]) {
            if start > range.start {
                segment += 1;
            }
            // Frames between the last measured one and a cut are known from one side only: left out.
            let last = (start..end).rev().find(|&k| Stretch::counts(&samples[k], config)).unwrap_or(start);
            let stretch =
                Stretch { first: start, samples: &samples[start..=last], corrections: &corrections[start..=last] };
            smooth_stretch(&stretch, segment, config, &mut trajectory.poses)?;
            start = end;
        }
    }
    Ok(trajectory)
}

/// Ranges of samples that belong together, from a measured sample to behind a measured one, and what lies between them.
fn part(samples: &[Sample], config: &Config) -> (Vec<std::ops::Range<usize>>, Vec<Gap>) {
    let (mut stretches, mut gaps): (Vec<std::ops::Range<usize>>, Vec<Gap>) = (Vec::new(), Vec::new());
    for (k, s) in samples.iter().enumerate() {
        let Some(m) = s.measurement.filter(|_| Stretch::counts(s, config)) else { continue };
        let Some(last) = stretches.last_mut() else {
            stretches.push(k..k + 1);
            continue;
        };
        let before = last.end - 1;
        match why_parted(&samples[before], s, m.track, config) {
            None => last.end = k + 1,
            Some(reason) => {
                gaps.push(Gap { before, after: k, reason });
                stretches.push(k..k + 1);
            }
        }
    }
    (stretches, gaps)
}

/// Why two measured samples do not belong together.
pub(crate) fn why_parted(before: &Sample, here: &Sample, track: u32, config: &Config) -> Option<GapReason> {
    if before.measurement.is_some_and(|m| m.track != track) {
        return Some(GapReason::Track);
    }
    let gap_s = here.timestamp_ns.saturating_sub(before.timestamp_ns) as f64 * 1e-9;
    (gap_s > config.longest_gap_s).then_some(GapReason::Time)
}

/// Finds slips and has them verified. Corrects what is confirmed; returns where the run has to be parted.
fn repair(
    samples: &[Sample],
    corrections: &mut [(i32, i32)],
    range: std::ops::Range<usize>,
    config: &Config,
    verify: &mut impl FnMut(&Suspect) -> Answer,
    trajectory: &mut Trajectory,
) -> Result<Vec<usize>> {
    let mut cuts = Vec::new();
    let mut start = range.start;
    loop {
        let end = (start + config.window).min(range.end);
        let window = Stretch { first: start, samples: &samples[start..end], corrections: &corrections[start..end] };
        // The newest are left to the next window, which sees more of what follows.
        let judged = if end == range.end { end } else { end - (config.overlap / 2).max(BEHIND) };
        let suspects = window.suspects(config)?;
        let mut next = None;
        for suspect in suspects.into_iter().filter(|s| s.sample < judged) {
            let answer = verify(&suspect);
            trajectory.repairs.push(Repair { suspect, answer });
            if answer.verdict == Verdict::Confirmed {
                corrections[suspect.sample..range.end].iter_mut().for_each(|c| {
                    *c = (c.0.saturating_add(suspect.cells.0), c.1.saturating_add(suspect.cells.1));
                });
            } else {
                cuts.push(suspect.sample);
                trajectory.gaps.push(Gap { before: suspect.before, after: suspect.sample, reason: GapReason::Slip });
                // What lies behind is judged anew, without what lies before.
                next = Some(suspect.sample);
                break;
            }
        }
        if end == range.end && next.is_none() {
            return Ok(cuts);
        }
        start = next.unwrap_or_else(|| measured_from(samples, end - config.overlap, config));
    }
}

/// The first measured sample from here on; callers know that there is one.
fn measured_from(samples: &[Sample], from: usize, config: &Config) -> usize {
    (from..samples.len()).find(|&k| Stretch::counts(&samples[k], config)).unwrap_or(from)
}

/// Smooths a stretch in windows that share samples; each gives the poses of its middle.
pub(crate) fn smooth_stretch(
    stretch: &Stretch,
    segment: u32,
    config: &Config,
    poses: &mut [Option<Smoothed>],
) -> Result<()> {
    let n = stretch.samples.len();
    let (mut start, mut done) = (0, 0);
    while done < n {
        let end = (start + config.window).min(n);
        let until = if end == n { n } else { end - config.overlap / 2 };
        let solved = smooth_window(&stretch.part(start..end), segment, config)?;
        for k in done..until {
            poses[stretch.first + k] = Some(solved[k - start]);
        }
        done = until;
        start = end.saturating_sub(config.overlap);
    }
    Ok(())
}

/// Smooths one window.
pub(crate) fn smooth_window(stretch: &Stretch, segment: u32, config: &Config) -> Result<Vec<Smoothed>> {
    let mut window = stretch.plain_window(config)?;
    let solution = window.solve_without_outliers(config)?;
    let covariances = marginals::covariances(&window, &solution, config).ok_or_else(|| Error::Solver {
        first: stretch.first,
        last: stretch.first + stretch.samples.len() - 1,
        status: "a normal matrix that is not positive definite".into(),
    })?;
    Ok((0..stretch.samples.len())
        .map(|k| {
            let pose = solution.at[k].pose();
            let residual = window.residual(k, &solution.at[k]);
            let origin = match &window.measured[k] {
                None => Origin::Interpolated,
                Some(_) if window.rejected[k] || residual > config.huber_deviations => Origin::Outlier,
                Some(_) => Origin::Smoothed,
            };
            Smoothed {
                origin,
                pose,
                covariance: shift_covariance(&pose, &covariances[k]),
                velocity: solution.velocity[k],
                turning: solution.turning[k],
                residual,
                correction: stretch.corrections[k],
                segment,
            }
        })
        .collect())
}
