//! The tracker: all stages in a row.

use nalgebra::Vector2;
use net_image::{GrayView, Pyramid};

use crate::block_match::{Guess, Match, MatchState, Matcher, Reach, SMALLEST_SIDE_PX};
use crate::config::{Config, Mode};
use crate::consensus::{Consensus, Fit};
use crate::error::{Error, Result};
use crate::flatten::Flatten;
use crate::motion::Motion;
use crate::result::{Estimate, FlowResult, Status};
use crate::rivals::{Candidates, Evidence, Expectation, Lattice, MAX_RIVALS, Rival, Rivals};
use crate::surface::{Surface, SurfacePeak};
use crate::tracks::{Track, TrackState, Tracks};

/// Standard deviations that a prior may be off.
const PRIOR_REACH: f64 = 4.0;
/// Times that a rival may take the winner's place before it is left at that.
const MAX_SWITCHES: usize = 3;
/// A summed surface is believed when its peak is this high, or stands out this far.
const SURFACE_SCORE: f32 = 0.35;
const SURFACE_PROMINENCE: f64 = 6.0;
/// A secondary peak below this share of the highest is no rival.
const RIVAL_PEAK_SHARE: f32 = 0.4;
/// Peaks nearer than this are one, px of their level.
const MAIN_LOBE_PX: f64 = 1.5;

/// What the caller knows of the coming frame. All of it is optional.
#[derive(Debug, Clone, Copy, Default)]
pub struct Hints<'a> {
    /// Expected motion from the frame before.
    pub prior: Option<Prior>,
    /// The lattice in the frame before: makes the test of rival cells sharper and cheaper.
    pub lattice: Option<Lattice>,
    /// Pixels in the *coming* frame where new points are welcome, such as detected junctions; elsewhere they are seeded on a grid.
    pub seeds: &'a [Vector2<f64>],
}

/// An expected motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// From the frame before to the coming one.
    pub motion: Motion,
    /// One standard deviation of where it carries a pixel, px, each axis. Honest figures matter: a prior of a tenth of a cell decides alone which cell
    /// it is.
    pub sigma_px: f64,
}

/// Follows points of a net from frame to frame. Owns all buffers: after the first frames an update allocates nothing.
#[derive(Debug)]
pub struct FlowTracker {
    config: Config,
    width: usize,
    height: usize,
    flatten: Flatten,
    prev: Pyramid,
    next: Pyramid,
    key: Pyramid,
    matcher: Matcher,
    surface: Surface,
    consensus: Consensus,
    step_rivals: Rivals,
    direct_rivals: Rivals,
    tracks: Tracks,
    scratch: Scratch,
    /// Number of the coming frame.
    frame: u64,
    key_frame: u64,
    /// Motion of the last step, the prediction of the next.
    velocity: Motion,
    from_key: Motion,
    /// Whether a step since the key frame was ambiguous and no direct match has settled it.
    unsettled: bool,
    /// Whether there is a frame before.
    running: bool,
}

/// Lists that one frame needs.
#[derive(Debug)]
struct Scratch {
    /// Points looked for, and what came of it.
    points: Vec<Vector2<f64>>,
    expected: Vec<Vector2<f64>>,
    matches: Vec<Match>,
    /// Found pairs, and which of the points they are.
    from: Vec<Vector2<f64>>,
    to: Vec<Vector2<f64>>,
    which: Vec<usize>,
    /// Per point, its place in the pairs if it agrees.
    agreed: Vec<bool>,
}

/// Rivals found on the surfaces.
#[derive(Debug, Clone, Copy, Default)]
struct RivalPeaks {
    peaks: [SurfacePeak; MAX_RIVALS],
    count: usize,
}

impl RivalPeaks {
    /// Adds a peak that is neither the winner's own nor, within `lobe_px`, one that is there already.
    fn add(&mut self, peak: SurfacePeak, lobe_px: f64) {
        let apart = |shift: Vector2<f64>| (peak.shift - shift).norm() > lobe_px;
        if self.count < MAX_RIVALS && apart(Vector2::zeros()) && self.iter().all(|p| apart(p.shift)) {
            self.peaks[self.count] = peak;
            self.count += 1;
        }
    }
}

impl std::ops::Deref for RivalPeaks {
    type Target = [SurfacePeak];
    fn deref(&self) -> &[SurfacePeak] {
        &self.peaks[..self.count]
    }
}

impl Scratch {
    /// Lists for `most` points.
    fn new(most: usize) -> Self {
        Self {
            points: Vec::with_capacity(most),
            expected: Vec::with_capacity(most),
            matches: Vec::with_capacity(most),
            from: Vec::with_capacity(most),
            to: Vec::with_capacity(most),
            which: Vec::with_capacity(most),
            agreed: Vec::with_capacity(most),
        }
    }
}

/// Numbers of an estimate; its rivals are kept apart.
#[derive(Debug, Clone, Copy)]
struct Outcome {
    status: Status,
    fit: Option<Fit>,
    points: usize,
    matched: usize,
    coverage: f64,
}

impl FlowTracker {
    /// A tracker for pictures of `width` x `height` px.
    ///
    /// # Errors
    /// [`Error::Value`] for a parameter out of range or a picture without pixels.
    pub fn new(width: usize, height: usize, config: &Config) -> Result<Self> {
        config.validate()?;
        for (field, value) in [("width", width), ("height", height)] {
            if value == 0 {
                return Err(Error::Value { field, value: 0.0, expected: "at least one pixel" });
            }
        }
        let pyramid = Pyramid::new(config.matching.levels);
        let tracks = Tracks::new(width, height, config.seed_spacing_px);
        let most = tracks.most();
        let mut consensus = Consensus::new(&config.consensus)?;
        consensus.reserve(most);
        Ok(Self {
            config: config.clone(),
            width,
            height,
            flatten: Flatten::new(config.flatten_radius_px)?,
            prev: pyramid.clone(),
            next: pyramid.clone(),
            key: pyramid,
            matcher: Matcher::new(&config.matching)?,
            surface: Surface::default(),
            consensus,
            step_rivals: Rivals::new(config.vote_points),
            direct_rivals: Rivals::new(config.vote_points),
            tracks,
            scratch: Scratch::new(most),
            frame: 0,
            key_frame: 0,
            velocity: Motion::identity(),
            from_key: Motion::identity(),
            unsettled: false,
            running: false,
        })
    }

    /// The points that are followed.
    pub fn tracks(&self) -> &[Track] {
        &self.tracks.list
    }

    /// Follows further points of the latest frame, given exactly; the number of the first (the others count up from it). Points outside the
    /// picture are dropped at the next update.
    pub fn add_points(&mut self, pixels: &[Vector2<f64>]) -> Option<u64> {
        let inverse = self.from_key.inverse();
        let mut first = None;
        for &p in pixels {
            let key_pixel = self.key_pixel(&inverse, p);
            let id = self.tracks.add(p, key_pixel);
            first.get_or_insert(id);
        }
        first
    }

    /// The next frame.
    ///
    /// # Errors
    /// [`Error::ImageSize`] for a picture of another size, [`Error::Value`] for a prior that is not a finite, positive deviation. The tracker is then as it was.
    pub fn update(&mut self, view: GrayView<'_>, hints: &Hints<'_>) -> Result<FlowResult<'_>> {
        let (width, height) = (view.width(), view.height());
        if (width, height) != (self.width, self.height) {
            let (expected_width, expected_height) = (self.width, self.height);
            return Err(Error::ImageSize { width, height, expected_width, expected_height });
        }
        if let Some(prior) = &hints.prior {
            crate::error::in_range("sigma_px", prior.sigma_px, 1e-3, 1e6, "a deviation of 0.001 to 1e6 px")?;
        }
        self.next.build(self.flatten.apply(view), SMALLEST_SIDE_PX);
        let frame = self.frame;
        self.frame += 1;
        self.step_rivals.clear();
        self.direct_rivals.clear();
        if !self.running {
            let points = self.tracks.list.len();
            self.start(frame, hints.seeds);
            return Ok(self.report(Status::Started, frame, Outcome::none(Status::Started, points), None, frame, None));
        }
        let step = self.step(hints);
        let key_frame = self.key_frame;
        let (Some(fit), false) = (step.fit, step.status == Status::Lost) else {
            self.start(frame, hints.seeds);
            return Ok(self.report(Status::Lost, frame, step, None, key_frame, None));
        };
        self.unsettled |= step.status == Status::Ambiguous;
        self.velocity = fit.motion;
        {
            let s = &self.scratch;
            self.tracks.advance(&fit.motion, |i| s.agreed[i].then(|| (s.matches[i].pixel, s.matches[i].score)));
        }
        let summed = self.from_key.then(&fit.motion);
        let mut direct = None;
        let mut renew = summed.is_none();
        self.from_key = summed.unwrap_or_default();
        if self.config.mode == Mode::KeyFrame && !renew {
            // The frame after the key frame was matched with it already.
            if self.key_frame + 1 < frame {
                let outcome = self.direct(hints);
                renew = outcome.fit.is_none()
                    || (outcome.fit.map_or(0, |f| f.agreed) as f64)
                        < self.config.min_key_share * self.tracks.list.len() as f64;
                direct = Some(outcome);
            }
        }
        let from_key = Some(self.from_key);
        let status = if self.unsettled { Status::Ambiguous } else { Status::Tracked };
        self.tracks.prune(self.width, self.height, self.config.max_carried_frames);
        if renew && self.config.mode == Mode::KeyFrame {
            self.renew_key(frame);
        }
        let inverse = self.from_key.inverse();
        let (w, h, summed_mode) = (self.width, self.height, self.config.mode == Mode::Summed);
        self.tracks.reseed(&self.next, hints.seeds, self.config.matching.half_window_px as f64 / 2.0, |p| {
            key_pixel(summed_mode, w, h, &inverse, p)
        });
        std::mem::swap(&mut self.prev, &mut self.next);
        Ok(self.report(status, frame, step, direct, key_frame, from_key))
    }

    /// Begins anew with the frame in `next`.
    fn start(&mut self, frame: u64, seeds: &[Vector2<f64>]) {
        self.tracks.list.clear();
        self.velocity = Motion::identity();
        self.running = true;
        self.tracks.reseed(&self.next, seeds, self.config.matching.half_window_px as f64 / 2.0, Some);
        self.renew_key(frame);
        std::mem::swap(&mut self.prev, &mut self.next);
    }

    /// Makes the frame in `next` the key frame.
    fn renew_key(&mut self, frame: u64) {
        self.key_frame = frame;
        self.from_key = Motion::identity();
        self.unsettled = false;
        if let Some(view) = self.next.level(0).filter(|_| self.config.mode == Mode::KeyFrame) {
            self.key.build(view, SMALLEST_SIDE_PX);
        }
        self.tracks.list.iter_mut().for_each(|t| t.key_pixel = Some(t.pixel));
    }

    fn key_pixel(&self, inverse: &Option<Motion>, p: Vector2<f64>) -> Option<Vector2<f64>> {
        key_pixel(self.config.mode == Mode::Summed, self.width, self.height, inverse, p)
    }

    /// From the frame before to the coming one.
    fn step(&mut self, hints: &Hints<'_>) -> Outcome {
        let expectation =
            Expectation { prior: hints.prior.map(|p| (p.motion, p.sigma_px)), max_step_px: self.config.max_step_px };
        self.scratch.points.clear();
        self.scratch.points.extend(self.tracks.list.iter().map(|t| t.pixel));
        let predicted = hints.prior.map_or(self.velocity, |p| p.motion);
        let search =
            self.config.matching.search_px.min(hints.prior.map_or(f64::INFINITY, |p| PRIOR_REACH * p.sigma_px + 1.0));
        let (mut guess, reach) = self.common_shift(&predicted, search);
        let mut switches = 0;
        loop {
            let outcome = self.match_and_agree(Pictures::Step, &guess, reach);
            let Some(fit) = outcome.fit.filter(|_| outcome.status != Status::Lost) else { return outcome };
            let mut known = false;
            if let Some(lattice) = &hints.lattice {
                self.compare(Pictures::Step, &fit.motion, Candidates::Lattice(lattice), &expectation);
                // A lattice that makes no sense has no neighbours to name.
                known = !self.step_rivals.list().is_empty();
            }
            if !known {
                let peaks = self.rival_peaks(&fit.motion, search);
                self.compare(Pictures::Step, &fit.motion, Candidates::Peaks(&peaks), &expectation);
            }
            if let Some(worst) = self.step_rivals.list().first()
                && worst.log_odds < -1.0
                && switches < MAX_SWITCHES
            {
                switches += 1;
                guess = fit.motion.shifted(worst.shift_px);
                continue;
            }
            return self.judge(outcome, Pictures::Step);
        }
    }

    /// Tests `winner` against rivals.
    fn compare(&mut self, pictures: Pictures, winner: &Motion, candidates: Candidates<'_>, expectation: &Expectation) {
        let s = &self.scratch;
        let evidence = Evidence {
            from: &s.from,
            to: &s.to,
            agrees: self.consensus.agrees(),
            threshold_px: self.config.consensus.threshold_px,
            most: self.config.vote_points,
        };
        let (earlier, rivals) = match pictures {
            Pictures::Step => (&self.prev, &mut self.step_rivals),
            Pictures::Direct => (&self.key, &mut self.direct_rivals),
        };
        rivals.compare(&mut self.matcher, earlier, &self.next, winner, &evidence, candidates, expectation);
    }

    /// Other peaks of the summed surfaces round `winner`, of all levels: each shows cells of its own size.
    fn rival_peaks(&mut self, winner: &Motion, search_px: f64) -> RivalPeaks {
        let mut found = RivalPeaks::default();
        let top = self.config.matching.full_reach(self.next.len());
        for level in 0..=top.level {
            let scale = f64::from(1u32 << level);
            let radius = ((search_px / scale).ceil() as usize + 1).clamp(2, top.radius.max(12));
            let reach = Reach { level, radius };
            let (points, most) = (&self.scratch.points, self.config.vote_points.div_ceil(2));
            if !self.surface.sum(&mut self.matcher, &self.prev, &self.next, points, most, winner, reach) {
                continue;
            }
            let peaks = self.surface.peaks();
            let highest = peaks.first().map_or(0.0, |p| p.score);
            for peak in peaks.iter().filter(|p| p.score >= RIVAL_PEAK_SHARE * highest) {
                found.add(*peak, MAIN_LOBE_PX * scale);
            }
        }
        found
    }

    /// From the key frame directly, starting from the sum.
    fn direct(&mut self, hints: &Hints<'_>) -> Outcome {
        self.scratch.points.clear();
        self.scratch.expected.clear();
        for track in &self.tracks.list {
            let Some(key) = track.key_pixel else { continue };
            self.scratch.points.push(key);
            self.scratch.expected.push(track.pixel);
        }
        let reach = Reach { level: 0, radius: self.config.direct_search_px };
        let guess = self.from_key;
        let mut outcome = self.match_and_agree(Pictures::Direct, &guess, reach);
        let Some(fit) = outcome.fit.filter(|_| outcome.status != Status::Lost) else { return outcome };
        if let Some(lattice) = self.lattice_of_key(hints) {
            let none = Expectation::default();
            self.compare(Pictures::Direct, &fit.motion, Candidates::Lattice(&lattice), &none);
            outcome = self.judge(outcome, Pictures::Direct);
            let settled = outcome.status == Status::Tracked && !self.direct_rivals.list().is_empty();
            self.unsettled &= !settled;
        } else if self.unsettled {
            outcome.status = Status::Ambiguous;
        }
        let worst = self.direct_rivals.list().first().map_or(f64::INFINITY, |r| r.log_odds);
        if worst < -self.config.min_log_odds {
            // The key frame says that the sum has slipped: believe neither.
            outcome.status = Status::Ambiguous;
            self.unsettled = true;
            return outcome;
        }
        self.from_key = fit.motion;
        let mut k = 0;
        for track in &mut self.tracks.list {
            let Some(key) = track.key_pixel else { continue };
            if self.scratch.agreed[k] {
                track.pixel = self.scratch.matches[k].pixel;
                track.score = self.scratch.matches[k].score;
                (track.state, track.carried) = (TrackState::Seen, 0);
            } else {
                // The sum would drift where the key frame is not seen.
                track.pixel = fit.motion.apply(key);
            }
            k += 1;
        }
        outcome
    }

    /// The lattice in the key frame, from the one in the frame before: on to this frame by the last step, back by the motion since.
    fn lattice_of_key(&self, hints: &Hints<'_>) -> Option<Lattice> {
        let key_from_prev = self.velocity.then(&self.from_key.inverse()?)?;
        hints.lattice.map(|lattice| lattice.carried(&key_from_prev, self.width, self.height))
    }

    /// Where the whole picture went, as far as the summed surface tells: the start of the points' own search, and how far that goes.
    fn common_shift(&mut self, predicted: &Motion, search_px: f64) -> (Motion, Reach) {
        let fine = self.config.matching.fine_search_px;
        if search_px <= fine as f64 + 1.0 {
            return (*predicted, Reach { level: 0, radius: fine + 1 });
        }
        let top = self.config.matching.full_reach(self.next.len());
        for level in (0..=top.level).rev() {
            let scale = f64::from(1u32 << level);
            let radius = ((search_px / scale).ceil() as usize + 1).min(top.radius.max(12));
            let reach = Reach { level, radius };
            let most = self.config.vote_points;
            let points = &self.scratch.points;
            if !self.surface.sum(&mut self.matcher, &self.prev, &self.next, points, most, predicted, reach) {
                continue;
            }
            let Some(&best) = self.surface.peaks().first() else { continue };
            if best.score >= SURFACE_SCORE || self.surface.prominence() >= SURFACE_PROMINENCE {
                return (predicted.shifted(best.shift), Reach { level, radius: 3 });
            }
        }
        (*predicted, self.config.matching.full_reach(self.next.len()))
    }

    /// Matches the points in `scratch` and finds what they agree on. Twice when the first motion shows that the points' search began too far off.
    fn match_and_agree(&mut self, pictures: Pictures, guess: &Motion, reach: Reach) -> Outcome {
        let mut outcome = self.match_once(pictures, guess, reach);
        if pictures == Pictures::Step
            && let Some(fit) = outcome.fit
            && (fit.agreed as f64) < 0.8 * outcome.points as f64
        {
            let again = Reach { level: reach.level.min(1), radius: self.config.matching.fine_search_px };
            let second = self.match_once(pictures, &fit.motion, again);
            if second.fit.map_or(0, |f| f.agreed) >= fit.agreed {
                outcome = second;
            } else {
                // Its buffers are those of the second try.
                outcome = self.match_once(pictures, guess, reach);
            }
        }
        outcome
    }

    fn match_once(&mut self, pictures: Pictures, guess: &Motion, reach: Reach) -> Outcome {
        let s = &mut self.scratch;
        let (prev, start) = match pictures {
            Pictures::Step => (&self.prev, Guess::Motion(guess)),
            Pictures::Direct => (&self.key, Guess::PixelsAlong(&s.expected, guess)),
        };
        // Equal sizes and lengths by construction, so there is no error to lose; an empty list would be lost.
        if self.matcher.match_within(prev, &self.next, &s.points, start, reach, &mut s.matches).is_err() {
            s.matches.clear();
        }
        s.from.clear();
        s.to.clear();
        s.which.clear();
        for (i, m) in s.matches.iter().enumerate().filter(|(_, m)| m.state == MatchState::Found) {
            s.from.push(s.points[i]);
            s.to.push(m.pixel);
            s.which.push(i);
        }
        s.agreed.clear();
        s.agreed.resize(s.points.len(), false);
        let points = s.matches.iter().filter(|m| m.state != MatchState::Outside).count();
        let fit = self.consensus.fit(&s.from, &s.to, Some(guess));
        let (mut tried, mut held) = ([false; 12], [false; 12]);
        for (m, p) in s.matches.iter().zip(&s.points) {
            if m.state != MatchState::Outside {
                tried[block(*p, self.width, self.height)] = true;
            }
        }
        if fit.is_some() {
            for (&i, &agrees) in s.which.iter().zip(self.consensus.agrees()) {
                s.agreed[i] = agrees;
                held[block(s.points[i], self.width, self.height)] |= agrees;
            }
        }
        let count = |blocks: &[bool]| blocks.iter().filter(|&&b| b).count() as f64;
        let coverage = count(&held) / count(&tried).max(1.0);
        let enough = fit.is_some_and(|f| f.agreed as f64 >= self.config.min_agreed * points as f64)
            && coverage >= self.config.min_coverage;
        let status = if enough { Status::Tracked } else { Status::Lost };
        Outcome { status, fit, points, matched: s.which.len(), coverage }
    }

    /// Tracked, or ambiguous where a rival is not ruled out.
    fn judge(&self, mut outcome: Outcome, pictures: Pictures) -> Outcome {
        let rivals = if pictures == Pictures::Step { &self.step_rivals } else { &self.direct_rivals };
        let agreed = outcome.fit.map_or(0, |f| f.agreed);
        let alive =
            |r: &Rival| r.log_odds < self.config.min_log_odds || (r.log_odds.is_finite() && 2 * r.support > agreed);
        if rivals.list().iter().any(alive) {
            outcome.status = Status::Ambiguous;
        }
        outcome
    }

    fn report(
        &self,
        status: Status,
        frame: u64,
        step: Outcome,
        direct: Option<Outcome>,
        key_frame: u64,
        from_key: Option<Motion>,
    ) -> FlowResult<'_> {
        FlowResult {
            status,
            frame,
            step: step.with(&self.step_rivals),
            direct: direct.map(|d| d.with(&self.direct_rivals)),
            key_frame,
            from_key,
            tracks: &self.tracks.list,
        }
    }
}

/// Which two pictures are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pictures {
    Step,
    Direct,
}

impl Outcome {
    fn none(status: Status, points: usize) -> Self {
        Self { status, fit: None, points, matched: 0, coverage: 0.0 }
    }

    fn with(self, rivals: &Rivals) -> Estimate<'_> {
        let lost = matches!(self.status, Status::Lost | Status::Started);
        Estimate {
            motion: self.fit.map(|f| f.motion).filter(|_| !lost),
            matched: self.matched,
            agreed: self.fit.map_or(0, |f| f.agreed),
            spread_px: self.fit.map_or(0.0, |f| f.spread_px),
            coverage: self.coverage,
            rivals: rivals.list(),
            ..Estimate::none(self.status, self.points)
        }
    }
}

/// Where a pixel of the latest frame lies in the key frame, if it is in there.
fn key_pixel(
    summed: bool,
    width: usize,
    height: usize,
    key_from_here: &Option<Motion>,
    p: Vector2<f64>,
) -> Option<Vector2<f64>> {
    let q = key_from_here.as_ref().filter(|_| !summed)?.apply(p);
    (q.x >= 0.0 && q.y >= 0.0 && q.x <= width as f64 - 1.0 && q.y <= height as f64 - 1.0).then_some(q)
}

/// Which of 4 x 3 blocks of the picture.
fn block(p: Vector2<f64>, width: usize, height: usize) -> usize {
    let u = (p.x / width as f64 * 4.0) as usize;
    let v = (p.y / height as f64 * 3.0) as usize;
    v.min(2) * 4 + u.min(3)
}
