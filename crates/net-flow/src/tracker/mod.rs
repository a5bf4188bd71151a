//! The tracker: all stages in a row.

mod agree;
mod contest;
mod direct;
mod step;

use nalgebra::Vector2;
use net_image::{GrayView, Pyramid};

use crate::block_match::{Match, Matcher, SMALLEST_SIDE_PX};
use crate::config::{Config, Mode};
use crate::consensus::{Consensus, Fit};
use crate::error::{Error, Result};
use crate::flatten::Flatten;
use crate::motion::Motion;
use crate::result::{Estimate, FlowResult, Status};
use crate::rivals::{Lattice, Rivals};
use crate::snap::snap;
use crate::surface::Surface;
use crate::tracks::{Track, Tracks};

/// Longest side of a picture.
const LARGEST_PX: usize = 16384;

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
    /// [`Error::Value`] for a parameter out of range, or a side that is not 1 to 16384 px.
    pub fn new(width: usize, height: usize, config: &Config) -> Result<Self> {
        config.validate()?;
        for (field, value) in [("width", width), ("height", height)] {
            if !(1..=LARGEST_PX).contains(&value) {
                return Err(Error::Value { field, value: value as f64, expected: "1 to 16384 pixels" });
            }
        }
        // The vote wants a fourth.
        let pyramid = Pyramid::new(config.matching.levels.max(crate::vote::LEVELS));
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

    /// Puts tracks on the nearest of the latest frame's detected `junctions` within `radius_px`; how many moved. Worth it for summed tracks that drift
    /// only: see [`crate::snap`].
    pub fn snap_tracks(&mut self, junctions: &[Vector2<f64>], radius_px: f64) -> usize {
        let mut pixels: Vec<_> = self.tracks.list.iter().map(|t| t.pixel).collect();
        let moved = snap(&mut pixels, junctions, radius_px);
        self.tracks.list.iter_mut().zip(pixels).for_each(|(track, pixel)| track.pixel = pixel);
        moved
    }

    /// The next frame, for a caller who need not know how it moved: nothing is followed into it, and the next update begins from it. Takes a
    /// fraction of the time.
    ///
    /// # Errors
    /// [`Error::ImageSize`] for a picture of another size. The tracker is then as it was.
    pub fn pass(&mut self, view: GrayView<'_>) -> Result<()> {
        self.check_size(view)?;
        self.next.build(self.flatten.apply(view), SMALLEST_SIDE_PX);
        let frame = self.frame;
        self.frame += 1;
        self.begin(frame);
        std::mem::swap(&mut self.prev, &mut self.next);
        Ok(())
    }

    /// The latest frame, less the light's slow changes, and halved again and again.
    pub fn picture(&self) -> &Pyramid {
        &self.prev
    }

    fn check_size(&self, view: GrayView<'_>) -> Result<()> {
        let (width, height) = (view.width(), view.height());
        let (expected_width, expected_height) = (self.width, self.height);
        if (width, height) == (expected_width, expected_height) {
            return Ok(());
        }
        Err(Error::ImageSize { width, height, expected_width, expected_height })
    }

    /// The next frame.
    ///
    /// # Errors
    /// [`Error::ImageSize`] for a picture of another size, [`Error::Value`] for a prior that is not a finite, positive deviation. The tracker is then as it was.
    pub fn update(&mut self, view: GrayView<'_>, hints: &Hints<'_>) -> Result<FlowResult<'_>> {
        self.check_size(view)?;
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
        if self.tracks.list.is_empty() {
            // The frame before was passed by.
            self.tracks.reseed(&self.prev, &[], self.margin(), Some);
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
        self.begin(frame);
        self.tracks.reseed(&self.next, seeds, self.margin(), Some);
        std::mem::swap(&mut self.prev, &mut self.next);
    }

    /// Forgets all tracks; the frame in `next` is the key frame.
    fn begin(&mut self, frame: u64) {
        self.tracks.list.clear();
        self.velocity = Motion::identity();
        self.running = true;
        self.renew_key(frame);
    }

    /// Distance from the picture's edge within which no point is seeded, px.
    fn margin(&self) -> f64 {
        self.config.matching.half_window_px as f64 / 2.0
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
