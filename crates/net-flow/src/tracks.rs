//! Stage 5: the points that are followed, each under its own number.

use nalgebra::Vector2;
use net_image::Pyramid;

use crate::motion::Motion;

/// New points keep this share of the seeds' spacing away from others: tracks wander over the borders of the squares.
const CLEARANCE: f64 = 0.7;

/// How a track's latest position came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrackState {
    /// Seeded in this frame.
    New,
    /// Found by its own match, which agrees with the others.
    Seen,
    /// Carried along by the others: hidden, or its match disagrees.
    Carried,
}

/// A followed point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Track {
    /// Its number: never used twice by one tracker.
    pub id: u64,
    /// Pixel in the latest frame.
    pub pixel: Vector2<f64>,
    /// Pixel in the key frame; `None` for points seeded since.
    pub key_pixel: Option<Vector2<f64>>,
    /// Normalised correlation of its last own match, -1 to 1.
    pub score: f32,
    /// Frames since it was seeded.
    pub age: u32,
    /// Frames in a row that it has been carried.
    pub carried: u32,
    /// How its latest position came about.
    pub state: TrackState,
}

/// The set of tracks, in order of their numbers. Owns its buffers.
#[derive(Debug, Clone)]
pub(crate) struct Tracks {
    pub(crate) list: Vec<Track>,
    next_id: u64,
    /// Squares of the picture that hold a track.
    occupied: Vec<bool>,
    /// Side of the squares, px.
    spacing: f64,
    /// Most tracks that seeding goes up to.
    most: usize,
}

impl Tracks {
    pub(crate) fn new(width: usize, height: usize, spacing: f64) -> Self {
        let squares = (width as f64 / spacing).ceil() as usize * (height as f64 / spacing).ceil() as usize;
        // No more than 2.4 points to a square keep clear of each other.
        let most = 3 * squares;
        Self { list: Vec::with_capacity(most), next_id: 0, occupied: Vec::with_capacity(squares), spacing, most }
    }

    /// Most tracks that seeding goes up to.
    pub(crate) fn most(&self) -> usize {
        self.most
    }

    /// Adds a point; its number.
    pub(crate) fn add(&mut self, pixel: Vector2<f64>, key_pixel: Option<Vector2<f64>>) -> u64 {
        let id = self.next_id;
        self.next_id += 1;
        self.list.push(Track { id, pixel, key_pixel, score: 0.0, age: 0, carried: 0, state: TrackState::New });
        id
    }

    /// Moves all tracks: to `found` where a point has one, else along with `motion`.
    pub(crate) fn advance(&mut self, motion: &Motion, found: impl Fn(usize) -> Option<(Vector2<f64>, f32)>) {
        for (i, track) in self.list.iter_mut().enumerate() {
            track.age = track.age.saturating_add(1);
            match found(i) {
                Some((pixel, score)) => {
                    (track.pixel, track.score, track.carried, track.state) = (pixel, score, 0, TrackState::Seen);
                }
                None => {
                    track.pixel = motion.apply(track.pixel);
                    track.carried = track.carried.saturating_add(1);
                    track.state = TrackState::Carried;
                }
            }
        }
    }

    /// Drops tracks that left the picture or were carried for more than `max_carried` frames.
    pub(crate) fn prune(&mut self, width: usize, height: usize, max_carried: u32) {
        let (w, h) = (width as f64 - 1.0, height as f64 - 1.0);
        self.list.retain(|t| {
            let p = t.pixel;
            p.x >= 0.0 && p.y >= 0.0 && p.x <= w && p.y <= h && t.carried <= max_carried
        });
    }

    /// Adds those of `given` that lie in squares without a track, then one point in each square still empty, where the picture has most to
    /// hold on to, unless a neighbour is near. `key_from_here` says where new points lie in the key frame.
    pub(crate) fn reseed(
        &mut self,
        pyramid: &Pyramid,
        given: &[Vector2<f64>],
        margin: f64,
        key_from_here: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
    ) {
        let Some(view) = pyramid.level(0) else { return };
        let (width, height) = (view.width() as f64, view.height() as f64);
        let (columns, rows) = ((width / self.spacing).ceil() as usize, (height / self.spacing).ceil() as usize);
        self.occupied.clear();
        self.occupied.resize(columns * rows, false);
        let spacing = self.spacing;
        let square = |p: Vector2<f64>| {
            let inside = p.x >= 0.0 && p.y >= 0.0 && p.x <= width - 1.0 && p.y <= height - 1.0;
            inside.then(|| (p.y / spacing) as usize * columns + (p.x / spacing) as usize)
        };
        for track in &self.list {
            if let Some(k) = square(track.pixel) {
                self.occupied[k] = true;
            }
        }
        for &p in given {
            if let Some(k) = square(p).filter(|&k| !self.occupied[k] && self.list.len() < self.most) {
                self.occupied[k] = true;
                self.add(p, key_from_here(p));
            }
        }
        for k in 0..columns * rows {
            if self.occupied[k] || self.list.len() >= self.most {
                continue;
            }
            let corner = Vector2::new((k % columns) as f64, (k / columns) as f64) * spacing;
            let middle = corner.map(|x| x + 0.5 * spacing);
            let inside = |p: &Vector2<f64>| {
                p.x >= margin && p.y >= margin && p.x <= width - 1.0 - margin && p.y <= height - 1.0 - margin
            };
            // The middle and eight places round it.
            let mut best: Option<(f64, Vector2<f64>)> = None;
            for (du, dv) in [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)] {
                let p = (middle + Vector2::new(f64::from(du), f64::from(dv)) * (spacing / 3.0)).map(f64::round);
                let near = |t: &Track| (t.pixel - p).norm_squared() < (CLEARANCE * spacing).powi(2);
                if !inside(&p) || square(p) != Some(k) || self.list.iter().any(near) {
                    continue;
                }
                let hold = corner_strength(pyramid, p);
                if best.is_none_or(|(most, _)| hold > most) {
                    best = Some((hold, p));
                }
            }
            if let Some((_, p)) = best {
                self.add(p, key_from_here(p));
            }
        }
    }
}

/// The smaller eigenvalue of the gradient's covariance round a point (Shi and Tomasi 1994), on the half-size picture: how firmly a template there
/// holds in both directions.
fn corner_strength(pyramid: &Pyramid, pixel: Vector2<f64>) -> f64 {
    const HALF: i64 = 6;
    let level = usize::from(pyramid.len() > 1);
    let Some(view) = pyramid.level(level) else { return 0.0 };
    let scale = f64::from(1u32 << level);
    let (u0, v0) = ((pixel.x / scale).round() as i64, (pixel.y / scale).round() as i64);
    let (w, h) = (view.width() as i64, view.height() as i64);
    let (mut uu, mut uv, mut vv) = (0i64, 0i64, 0i64);
    for v in (v0 - HALF).max(1)..=(v0 + HALF).min(h - 2) {
        let (above, row, below) = (view.row(v as usize - 1), view.row(v as usize), view.row(v as usize + 1));
        for u in (u0 - HALF).max(1)..=(u0 + HALF).min(w - 2) {
            let u = u as usize;
            let gu = i64::from(row[u + 1]) - i64::from(row[u - 1]);
            let gv = i64::from(below[u]) - i64::from(above[u]);
            uu += gu * gu;
            uv += gu * gv;
            vv += gv * gv;
        }
    }
    let (a, b, c) = (uu as f64, uv as f64, vv as f64);
    0.5 * (a + c) - (0.25 * (a - c).powi(2) + b * b).sqrt()
}
