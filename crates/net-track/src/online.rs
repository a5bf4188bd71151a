//! The same as frames come in, some frames late.

use crate::config::Config;
use crate::error::Result;
use crate::result::{Answer, Gap, GapReason, Repair, Smoothed, Suspect, Verdict};
use crate::sample::{self, Sample};
use crate::slips::Stretch;
use crate::smoother::{BEHIND, smooth_window, why_parted};

/// What a new sample brought to light.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ready {
    /// Numbers of samples, in order, with their poses; `None` where nothing is known.
    pub poses: Vec<(usize, Option<Smoothed>)>,
    /// Suspected slips that were judged.
    pub repairs: Vec<Repair>,
    /// Where the run was parted.
    pub gaps: Vec<Gap>,
}

/// Smooths with a fixed lag. A pose comes out when `lag` samples have come after it, from a program over the last `online_window` samples; what is older counts no more,
/// so its poses are a little less sure than those of [`crate::smooth`].
#[derive(Debug)]
pub struct FixedLag {
    config: Config,
    samples: Vec<Sample>,
    corrections: Vec<(i32, i32)>,
    /// Number of the first of `samples` among all.
    first: usize,
    /// How many of `samples` have come out, and before which of them slips have been judged.
    out: usize,
    judged: usize,
    last_ns: Option<i64>,
    segment: u32,
    /// The last measured sample of an earlier stretch: its number, itself, its correction.
    left: Option<(usize, Sample, (i32, i32))>,
}

impl FixedLag {
    /// A smoother without a sample yet.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] for a parameter out of range.
    pub fn new(config: &Config) -> Result<Self> {
        config.validate()?;
        Ok(Self {
            config: config.clone(),
            samples: Vec::new(),
            corrections: Vec::new(),
            first: 0,
            out: 0,
            judged: 0,
            last_ns: None,
            segment: 0,
            left: None,
        })
    }

    /// The next sample. `verify` as in [`crate::smooth`].
    ///
    /// # Errors
    /// As [`crate::smooth`]. The smoother is then as it was, but for samples that could not be solved: those are lost.
    pub fn push(&mut self, sample: &Sample, mut verify: impl FnMut(&Suspect) -> Answer) -> Result<Ready> {
        let index = self.first + self.samples.len();
        sample::check(index, sample, self.last_ns)?;
        self.last_ns = Some(sample.timestamp_ns);
        let mut ready = Ready::default();
        let measured = sample.measurement.filter(|_| Stretch::counts(sample, &self.config));
        let before = self.last_measured().map(|k| (self.first + k, self.samples[k], self.corrections[k])).or(self.left);
        // A stretch ends with a new count, or when too long a time has passed.
        let parted = before.and_then(|(number, last, _)| {
            let track = measured.or(last.measurement).map_or(0, |m| m.track);
            Some((number, why_parted(&last, sample, track, &self.config)?))
        });
        if parted.is_some() && !self.samples.is_empty() {
            self.finish(&mut verify, &mut ready)?;
        }
        if measured.is_none() && self.samples.is_empty() {
            ready.poses.push((index, None));
            self.first = index + 1;
            return Ok(ready);
        }
        let mut correction = before.map_or((0, 0), |(_, _, c)| c);
        if let Some((before, reason)) = parted {
            ready.gaps.push(Gap { before, after: index, reason });
            self.segment += 1;
            if reason == GapReason::Track {
                correction = (0, 0);
            }
        }
        self.samples.push(*sample);
        self.corrections.push(correction);
        if measured.is_some() && self.samples.len() > self.out + self.config.lag {
            self.judge(self.samples.len() - BEHIND.min(self.config.lag), &mut verify, &mut ready)?;
            self.emit(self.samples.len().saturating_sub(self.config.lag), &mut ready)?;
            self.trim();
        }
        Ok(ready)
    }

    /// Brings out what is left, at the end of a run. The next sample begins a new stretch.
    ///
    /// # Errors
    /// As [`FixedLag::push`].
    pub fn flush(&mut self, mut verify: impl FnMut(&Suspect) -> Answer) -> Result<Ready> {
        let mut ready = Ready::default();
        self.finish(&mut verify, &mut ready)?;
        Ok(ready)
    }

    fn last_measured(&self) -> Option<usize> {
        (0..self.samples.len()).rev().find(|&k| Stretch::counts(&self.samples[k], &self.config))
    }

    fn stretch(&self, end: usize) -> Stretch<'_> {
        Stretch { first: self.first, samples: &self.samples[..end], corrections: &self.corrections[..end] }
    }

    /// Samples up to the last measured one of the first `end`.
    fn measured_end(&self, end: usize) -> usize {
        (0..end).rev().find(|&k| Stretch::counts(&self.samples[k], &self.config)).map_or(0, |k| k + 1)
    }

    /// Judges slips before the sample `until`.
    fn judge(&mut self, until: usize, verify: &mut impl FnMut(&Suspect) -> Answer, ready: &mut Ready) -> Result<()> {
        let mut until = until;
        loop {
            let end = self.measured_end(self.samples.len());
            if end < 2 {
                return Ok(());
            }
            let suspects = self.stretch(end).suspects(&self.config)?;
            let news = |s: &Suspect| s.sample >= self.first + self.judged && s.sample < self.first + until;
            let mut cut = None;
            for suspect in suspects.into_iter().filter(news) {
                let answer = verify(&suspect);
                ready.repairs.push(Repair { suspect, answer });
                let at = suspect.sample - self.first;
                if answer.verdict == Verdict::Confirmed {
                    self.corrections[at..].iter_mut().for_each(|c| {
                        *c = (c.0.saturating_add(suspect.cells.0), c.1.saturating_add(suspect.cells.1));
                    });
                } else {
                    ready.gaps.push(Gap { before: suspect.before, after: suspect.sample, reason: GapReason::Slip });
                    cut = Some(at);
                    break;
                }
            }
            let Some(at) = cut else {
                self.judged = self.judged.max(until);
                return Ok(());
            };
            self.emit(at, ready)?;
            self.drop_first(at);
            self.segment += 1;
            until -= at;
        }
    }

    /// Brings out the poses before the sample `until`.
    fn emit(&mut self, until: usize, ready: &mut Ready) -> Result<()> {
        if until <= self.out {
            return Ok(());
        }
        // A slip further on parts the stretch: what lies behind it then says nothing here. Otherwise all that is known counts.
        let cut_here = ready.gaps.iter().any(|g| g.reason == GapReason::Slip && g.after == self.first + until);
        let end = self.measured_end(if cut_here { until } else { self.samples.len() });
        let solved = smooth_window(&self.stretch(end), self.segment, &self.config)?;
        for k in self.out..until {
            ready.poses.push((self.first + k, solved.get(k).copied()));
        }
        self.out = until;
        Ok(())
    }

    fn finish(&mut self, verify: &mut impl FnMut(&Suspect) -> Answer, ready: &mut Ready) -> Result<()> {
        if self.samples.is_empty() {
            return Ok(());
        }
        self.judge(self.samples.len(), verify, ready)?;
        self.left = self.last_measured().map(|k| (self.first + k, self.samples[k], self.corrections[k]));
        self.emit(self.samples.len(), ready)?;
        self.drop_first(self.samples.len());
        Ok(())
    }

    /// Forgets what is older than the window: it begins with a measured sample.
    fn trim(&mut self) {
        let most = self.samples.len().saturating_sub(self.config.online_window).min(self.out);
        if most > 0
            && let Some(at) =
                (most..=self.out).find(|&k| k < self.samples.len() && Stretch::counts(&self.samples[k], &self.config))
        {
            self.drop_first(at);
        }
    }

    fn drop_first(&mut self, count: usize) {
        self.samples.drain(..count);
        self.corrections.drain(..count);
        self.first += count;
        self.out = self.out.saturating_sub(count);
        self.judged = self.judged.saturating_sub(count);
    }
}
