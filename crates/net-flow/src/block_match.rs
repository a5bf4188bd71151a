//! Stage 2: where each point's neighbourhood is in the next picture.
//!
//! Per point, from the coarsest level of the pyramid to the finest: cut the template at the point's sub-pixel position, score it over a
//! window of whole-pixel shifts round the expectation, take the quadratic peak, and hand it down. At full size the peak is refined,
//! and matched back: a point that does not return to where it came from is not believed.

use nalgebra::{Matrix2, Vector2};
use net_image::{GrayView, Pyramid};

use crate::config::MatchConfig;
use crate::error::{Error, Result};
use crate::motion::Motion;
use crate::refine::Refine;
use crate::zncc::{MAX_RADIUS, Zncc};

/// Shortest side of a pyramid's coarsest level, px: below it a template no longer fits.
pub(crate) const SMALLEST_SIDE_PX: usize = 24;

/// Half width of the templates that vote for the common shift, px of their level: many points make up for small windows.
const SURFACE_HALF_PX: usize = 7;

/// Times that a search follows a peak on its border.
const MAX_WALKS: usize = 3;

/// How a point's match ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MatchState {
    /// Found, and found its way back.
    Found,
    /// Nothing alike: the score is below the threshold, or there is nothing to see round the point.
    Weak,
    /// The way back ends elsewhere.
    NotReturned,
    /// The point, or where it went, is not in the picture.
    Outside,
}

/// Where one point went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Pixel in the next picture; the expectation where nothing was found.
    pub pixel: Vector2<f64>,
    /// Normalised correlation at the peak, -1 to 1.
    pub score: f32,
    /// Distance between the point and where the way back ended, px; infinite where it was not tried.
    pub round_trip_px: f64,
    /// How it ended.
    pub state: MatchState,
}

/// What is known of the motion before matching.
#[derive(Debug, Clone, Copy)]
pub enum Guess<'a> {
    /// Points stay where they are.
    Still,
    /// Points follow this motion; templates are stretched and turned along.
    Motion(&'a Motion),
    /// Each point's expected pixel in the next picture.
    Pixels(&'a [Vector2<f64>]),
    /// Each point's expected pixel; templates are stretched and turned along with the motion.
    PixelsAlong(&'a [Vector2<f64>], &'a Motion),
}

/// How far to search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Reach {
    /// Coarsest level to begin at.
    pub level: usize,
    /// Radius there, px of that level.
    pub radius: usize,
}

/// Matches points between two pyramids (`net_image::Pyramid`, of [`MatchConfig::levels`] levels). Owns its buffers.
#[derive(Debug, Clone)]
pub struct Matcher {
    config: MatchConfig,
    zncc: Zncc,
    refine: Refine,
}

impl Matcher {
    /// A matcher.
    ///
    /// # Errors
    /// [`Error::Value`] for a parameter out of range.
    pub fn new(config: &MatchConfig) -> Result<Self> {
        config.validate()?;
        Ok(Self { config: config.clone(), zncc: Zncc::new(), refine: Refine::default() })
    }

    /// The matcher's parameters.
    pub fn config(&self) -> &MatchConfig {
        &self.config
    }

    /// Finds each of `points` (pixels of `prev`) in `next`; `matches` is replaced by one entry per point. Points that are not finite
    /// or not in the picture end as [`MatchState::Outside`].
    ///
    /// # Errors
    /// [`Error::Length`] if guessed pixels are not as many as the points, [`Error::ImageSize`] for pyramids of unequal size.
    pub fn match_points(
        &mut self,
        prev: &Pyramid,
        next: &Pyramid,
        points: &[Vector2<f64>],
        guess: Guess<'_>,
        matches: &mut Vec<Match>,
    ) -> Result<()> {
        self.match_within(prev, next, points, guess, self.config.full_reach(prev.len()), matches)
    }

    /// [`Matcher::match_points`] with a search of its own.
    pub(crate) fn match_within(
        &mut self,
        prev: &Pyramid,
        next: &Pyramid,
        points: &[Vector2<f64>],
        guess: Guess<'_>,
        reach: Reach,
        matches: &mut Vec<Match>,
    ) -> Result<()> {
        same_size(prev, next)?;
        if let Guess::Pixels(pixels) | Guess::PixelsAlong(pixels, _) = guess
            && pixels.len() != points.len()
        {
            return Err(Error::Length { what: "guessed pixels", expected: points.len(), got: pixels.len() });
        }
        matches.clear();
        for (i, &point) in points.iter().enumerate() {
            let (expected, next_from_prev) = match guess {
                Guess::Still => (point, Matrix2::identity()),
                Guess::Motion(motion) => (motion.apply(point), motion.jacobian(point)),
                Guess::Pixels(pixels) => (pixels[i], Matrix2::identity()),
                Guess::PixelsAlong(pixels, motion) => (pixels[i], motion.jacobian(point)),
            };
            matches.push(self.match_point(prev, next, point, expected, &next_from_prev, reach));
        }
        Ok(())
    }

    /// One point there and back. `next_from_prev` stretches the template.
    fn match_point(
        &mut self,
        prev: &Pyramid,
        next: &Pyramid,
        point: Vector2<f64>,
        expected: Vector2<f64>,
        next_from_prev: &Matrix2<f64>,
        reach: Reach,
    ) -> Match {
        let mut found = Match { pixel: expected, score: 0.0, round_trip_px: f64::INFINITY, state: MatchState::Outside };
        let stretch = usable_stretch(next_from_prev, self.config.half_window_px);
        let Some(inverse) = stretch.try_inverse() else { return found };
        if !(inside(prev, point) && inside(next, expected)) {
            return found;
        }
        let mut at = expected;
        for level in (0..=reach.level).rev() {
            let radius = if level == reach.level { reach.radius } else { self.config.fine_search_px };
            match self.match_level(prev, next, level, point, at, &inverse, radius, self.config.refine_iterations > 0) {
                Some((pixel, score)) => {
                    at = pixel;
                    found.score = score;
                }
                // A coarse level may show nothing where the full size does.
                None if level > 0 => {}
                None => {
                    found.state = MatchState::Weak;
                    return found;
                }
            }
        }
        found.pixel = at;
        if !inside(next, at) {
            return found;
        }
        if f64::from(found.score) < self.config.min_score {
            found.state = MatchState::Weak;
            return found;
        }
        // The way back asks whether it leads here, not how exactly: it needs no stretch.
        let still = Matrix2::identity();
        let back = self.match_level(next, prev, 0, at, point, &still, self.config.fine_search_px, false);
        found.round_trip_px = back.map_or(f64::INFINITY, |(pixel, _)| (pixel - point).norm());
        let returned = found.round_trip_px <= self.config.max_round_trip_px;
        found.state = if returned { MatchState::Found } else { MatchState::NotReturned };
        found
    }

    /// One level: the template of `point` in `from`, searched in `to` round `expected`. Pixels are those of level 0.
    fn match_level(
        &mut self,
        from: &Pyramid,
        to: &Pyramid,
        level: usize,
        point: Vector2<f64>,
        expected: Vector2<f64>,
        from_template: &Matrix2<f64>,
        radius: usize,
        refine: bool,
    ) -> Option<(Vector2<f64>, f32)> {
        let scale = f64::from(1u32 << level);
        let (from, to) = (from.level(level)?, to.level(level)?);
        if !self.zncc.cut(from, point / scale, from_template, self.config.half_window(level)) {
            return None;
        }
        let mut centre = (expected / scale).map(f64::round);
        let mut walked = 0;
        loop {
            self.zncc.search(to, (centre.x as i64, centre.y as i64), radius.clamp(1, MAX_RADIUS));
            let peak = self.zncc.peak();
            // A peak on the border of the search: look beyond it, a little.
            if peak.on_border && walked < MAX_WALKS {
                walked += 1;
                centre += peak.shift;
                continue;
            }
            // Refined where it counts: on the way there, at full size.
            let refined = (refine && level == 0).then(|| self.refine.align(&self.zncc, self.config.refine_iterations));
            let shift = refined.flatten().unwrap_or(peak.shift);
            return Some(((centre + shift) * scale, peak.score));
        }
    }

    /// Scores of all whole-pixel shifts of one point at `level` within `radius` px of the level, for the sum over points; `None` where
    /// nothing shows.
    pub(crate) fn surface(
        &mut self,
        prev: &Pyramid,
        next: &Pyramid,
        point: Vector2<f64>,
        motion: &Motion,
        reach: Reach,
    ) -> Option<&[f32]> {
        let expected = motion.apply(point);
        if !(inside(prev, point) && inside(next, expected)) {
            return None;
        }
        let stretch = usable_stretch(&motion.jacobian(point), self.config.half_window_px);
        let scale = f64::from(1u32 << reach.level);
        let (from, to) = (prev.level(reach.level)?, next.level(reach.level)?);
        // A template cut where its partner will be on whole pixels: then all points share one grid of shifts.
        let centre = (expected / scale).map(f64::round);
        let inverse = stretch.try_inverse()?;
        let point = point / scale + inverse * (centre - expected / scale);
        let half = self.config.half_window_px.min(SURFACE_HALF_PX);
        if !self.zncc.cut(from, point, &inverse, half) {
            return None;
        }
        self.zncc.search(to, (centre.x as i64, centre.y as i64), reach.radius);
        Some(self.zncc.scores())
    }

    /// Cuts the template of `point` at full size for [`Matcher::score_at`]; false outside the picture or where nothing shows.
    pub(crate) fn hold(&mut self, prev: &Pyramid, point: Vector2<f64>, next_from_prev: &Matrix2<f64>) -> bool {
        let stretch = usable_stretch(next_from_prev, self.config.half_window_px);
        let (Some(view), Some(inverse)) = (prev.level(0), stretch.try_inverse()) else { return false };
        inside(prev, point) && self.zncc.cut(view, point, &inverse, self.config.half_window(0))
    }

    /// Score of the held template at the best shift within a pixel of `expected`, or of that one's neighbour; `None` where the template would leave the
    /// picture.
    pub(crate) fn score_at(&mut self, next: &Pyramid, expected: Vector2<f64>) -> Option<f32> {
        let view = next.level(0).filter(|_| well_inside(next, expected, self.config.half_window_px as f64))?;
        let centre = expected.map(f64::round);
        self.zncc.search(view, (centre.x as i64, centre.y as i64), 1);
        let peak = self.zncc.peak();
        if !peak.on_border {
            return Some(peak.score);
        }
        // One step of a hill climb costs less than a larger search for all.
        let centre = centre + peak.shift;
        self.zncc.search(view, (centre.x as i64, centre.y as i64), 1);
        Some(self.zncc.peak().score)
    }
}

/// The convenient form: finds each of `points` of `prev` in `next`. Builds pyramids and buffers; a loop over frames keeps a
/// [`Matcher`] and two [`Pyramid`]s instead.
///
/// # Errors
/// [`Error::ImageSize`] for pictures of unequal size, [`Error::Value`] for a bad parameter, [`Error::Length`] for guessed pixels that
/// are not as many as the points.
pub fn match_points(
    prev: GrayView<'_>,
    next: GrayView<'_>,
    points: &[Vector2<f64>],
    guess: Guess<'_>,
    config: &MatchConfig,
) -> Result<Vec<Match>> {
    let mut matcher = Matcher::new(config)?;
    let (mut from, mut to) = (Pyramid::new(config.levels), Pyramid::new(config.levels));
    from.build(prev, SMALLEST_SIDE_PX);
    to.build(next, SMALLEST_SIDE_PX);
    let mut matches = Vec::with_capacity(points.len());
    matcher.match_points(&from, &to, points, guess, &mut matches)?;
    Ok(matches)
}

/// Refuses pyramids that do not belong together.
pub(crate) fn same_size(a: &Pyramid, b: &Pyramid) -> Result<()> {
    let ((width, height), (expected_width, expected_height)) = (size(b), size(a));
    if (width, height) == (expected_width, expected_height) && a.len() == b.len() {
        return Ok(());
    }
    Err(Error::ImageSize { width, height, expected_width, expected_height })
}

/// Width and height of level 0, px; zero while a pyramid holds no picture.
fn size(pyramid: &Pyramid) -> (usize, usize) {
    pyramid.level(0).map_or((0, 0), |view| (view.width(), view.height()))
}

/// Whether a pixel is in the picture; NaN is not.
pub(crate) fn inside(pyramid: &Pyramid, pixel: Vector2<f64>) -> bool {
    well_inside(pyramid, pixel, 0.0)
}

/// Whether a pixel is in the picture and at least `margin` px from its edge; NaN is not.
pub(crate) fn well_inside(pyramid: &Pyramid, pixel: Vector2<f64>, margin: f64) -> bool {
    let (width, height) = size(pyramid);
    let (w, h) = (width as f64 - 1.0 - margin, height as f64 - 1.0 - margin);
    pixel.x >= margin && pixel.y >= margin && pixel.x <= w && pixel.y <= h
}

/// The stretch of a template, or none where it matters by less than a fifth of a pixel at the template's edge, or is absurd.
fn usable_stretch(next_from_prev: &Matrix2<f64>, half: usize) -> Matrix2<f64> {
    let change = (next_from_prev - Matrix2::identity()).norm();
    let matters = change * half as f64 > 0.2;
    let sane = change < 0.8 && next_from_prev.determinant() > 0.1;
    if matters && sane { *next_from_prev } else { Matrix2::identity() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A smooth picture without repetition, and the same moved by `shift`, gain and offset of the light changed.
    fn pair(shift: Vector2<f64>) -> (Vec<u8>, Vec<u8>) {
        let value = |u: f64, v: f64| {
            (u * 0.21 + 0.9 * (v * 0.05).sin()).sin()
                + (v * 0.17 + 1.3 * (u * 0.043).sin()).sin()
                + (u * v * 4e-4).cos()
        };
        let draw = |shift: Vector2<f64>, gain: f64, offset: f64| {
            let pixel = |i: usize| {
                let (u, v) = ((i % WIDTH) as f64 - shift.x, (i / WIDTH) as f64 - shift.y);
                (offset + gain * value(u, v)).round() as u8
            };
            (0..WIDTH * HEIGHT).map(pixel).collect()
        };
        (draw(Vector2::zeros(), 40.0, 125.0), draw(shift, 27.0, 150.0))
    }
    const WIDTH: usize = 220;
    const HEIGHT: usize = 160;

    fn grid() -> Vec<Vector2<f64>> {
        (0..20).map(|i| Vector2::new(50.0 + 29.3 * (i % 5) as f64, 45.0 + 22.7 * (i / 5) as f64)).collect()
    }

    fn view(data: &[u8]) -> GrayView<'_> {
        GrayView::packed(data, WIDTH, HEIGHT).expect("a view")
    }

    #[test]
    fn finds_shifts_under_other_light() {
        for shift in [Vector2::zeros(), Vector2::new(0.5, -0.25), Vector2::new(-17.3, 11.8)] {
            let (a, b) = pair(shift);
            let matches =
                match_points(view(&a), view(&b), &grid(), Guess::Still, &MatchConfig::default()).expect("valid");
            for (m, p) in matches.iter().zip(grid()) {
                assert_eq!(m.state, MatchState::Found, "{m:?}");
                // Rounding to grey levels is noise of 0.3 levels on a gradient of several levels per pixel, over 961 pixels; bilinear
                // sampling of waves of 30 px adds about 0.01 px.
                assert!((m.pixel - p - shift).norm() < 0.03, "{} {}", m.pixel - p, shift);
            }
        }
    }

    #[test]
    fn refinement_is_nearer_than_the_quadratic_alone() {
        let shift = Vector2::new(0.27, -0.31);
        let (a, b) = pair(shift);
        let worst = |refine_iterations| {
            let config = MatchConfig { refine_iterations, ..MatchConfig::default() };
            let matches = match_points(view(&a), view(&b), &grid(), Guess::Still, &config).expect("valid");
            matches.iter().zip(grid()).map(|(m, p)| (m.pixel - p - shift).norm()).fold(0.0, f64::max)
        };
        let (quadratic, refined) = (worst(0), worst(3));
        // The quadratic alone stays within a tenth of a pixel (what the method asks of it), refinement beats it.
        assert!(quadratic < 0.1 && refined < quadratic, "{quadratic} {refined}");
    }

    #[test]
    fn a_guess_carries_beyond_the_search() {
        let shift = Vector2::new(45.0, -38.0);
        let (a, b) = pair(shift);
        let points = &grid()[8..9];
        let motion = Motion::translation(shift + Vector2::new(3.0, 2.0));
        let pixels = [points[0] + shift];
        for guess in [Guess::Motion(&motion), Guess::Pixels(&pixels)] {
            let m = match_points(view(&a), view(&b), points, guess, &MatchConfig::default()).expect("valid")[0];
            assert!((m.pixel - pixels[0]).norm() < 0.03, "{m:?}");
        }
    }

    #[test]
    fn bad_input_is_an_error_or_a_state() {
        let (a, _) = pair(Vector2::zeros());
        let config = MatchConfig::default();
        let nan = [Vector2::new(f64::NAN, 3.0), Vector2::new(1e300, -1e300), Vector2::new(-1.0, 5.0)];
        let matches = match_points(view(&a), view(&a), &nan, Guess::Still, &config).expect("no error");
        assert!(matches.iter().all(|m| m.state == MatchState::Outside));
        let short = match_points(view(&a), view(&a), &nan, Guess::Pixels(&nan[..1]), &config);
        assert!(matches!(short, Err(Error::Length { expected: 3, got: 1, .. })));
        let small = GrayView::packed(&a[..1], 1, 1).expect("a view");
        assert!(matches!(match_points(view(&a), small, &nan, Guess::Still, &config), Err(Error::ImageSize { .. })));
        let one = match_points(small, small, &[Vector2::zeros()], Guess::Still, &config).expect("no error");
        assert_eq!(one[0].state, MatchState::Weak);
        for bad in [f64::NAN, 0.0, 1e9] {
            let config = MatchConfig { search_px: bad, ..MatchConfig::default() };
            assert!(matches!(config.validate(), Err(Error::Value { field: "search_px", .. })));
        }
    }

    #[test]
    fn a_constant_picture_matches_nothing() {
        let flat = vec![90u8; WIDTH * HEIGHT];
        let matches =
            match_points(view(&flat), view(&flat), &grid(), Guess::Still, &MatchConfig::default()).expect("valid");
        assert!(matches.iter().all(|m| m.state == MatchState::Weak));
    }
}
