//! The picture as the estimator sees it: a pyramid of brightness, the rays through its grid, and the tiles that gather evidence.

use net_geometry::Camera;
use net_geometry::nalgebra::Vector2;
use net_image::{GrayView, Image};

use crate::picture::smooth::Smoother;
use net_image::widely;

/// Pixels along a side of the blocks within which lattice coordinates are linear.
pub(crate) const BLOCK: usize = 4;

/// Most levels of the pyramid.
pub(crate) const LEVELS: usize = 4;

/// A place in the picture with the ray through it and through the places one pixel right and below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Site {
    /// Full-resolution pixel.
    pub pixel: [f64; 2],
    /// `(x, y)` of the ray `(x, y, 1)`.
    pub ray: [f64; 2],
    /// Rays one full-resolution pixel further along u, along v.
    pub next: [[f64; 2]; 2],
    /// Whether the lens has rays here.
    pub valid: bool,
}

impl Site {
    pub(crate) fn new(camera: &Camera, u: f64, v: f64) -> Self {
        let at = |u, v| camera.ray_from_pixel(Vector2::new(u, v)).filter(|r| r.iter().all(|x| x.is_finite()));
        let (a, b, c) = (at(u, v), at(u + 1.0, v), at(u, v + 1.0));
        match (a, b, c) {
            (Some(a), Some(b), Some(c)) => {
                Self { pixel: [u, v], ray: [a.x, a.y], next: [[b.x, b.y], [c.x, c.y]], valid: true }
            }
            _ => Self { pixel: [u, v], ray: [0.0; 2], next: [[0.0; 2]; 2], valid: false },
        }
    }

    /// Derivative of the ray by the pixel: rows x and y, columns u and v.
    pub(crate) fn jacobian(&self) -> [[f64; 2]; 2] {
        let d = |k: usize, i: usize| self.next[k][i] - self.ray[i];
        [[d(0, 0), d(1, 0)], [d(0, 1), d(1, 1)]]
    }
}

/// Tiles over one level: which block belongs to which, and where their middles are.
#[derive(Debug, Clone)]
pub(crate) struct TileGrid {
    pub nx: usize,
    pub ny: usize,
    /// Tile column of each block column, tile row of each block row.
    pub column: Vec<u16>,
    pub row: Vec<u16>,
    pub sites: Vec<Site>,
    /// Pixels of the level in a whole tile.
    pub area: f64,
}

/// One level of the pyramid.
#[derive(Debug)]
pub(crate) struct Level {
    /// Full-resolution pixels per pixel of this level.
    pub scale: f64,
    /// Brightness, 0 to 1, rows and columns cut to whole blocks.
    pub raw: Image<f32>,
    /// The same without what is smooth, filled by whoever needs it: for drawing, and for the lock-in.
    pub high: Image<f32>,
    pub thin: Image<f32>,
    /// Corners of blocks.
    pub nodes_x: usize,
    pub nodes_y: usize,
    /// Ray through each corner; NaN where there is none.
    pub rays: Vec<[f64; 2]>,
    /// Small and large tiles.
    pub tiles: [TileGrid; 2],
}

impl Level {
    /// Fills `high`: brightness less what is smooth over `sigma` full-resolution px.
    pub(crate) fn filter_high(&mut self, sigma: f64, smoother: &mut Smoother) {
        smoother.subtract_blur(&self.raw, (sigma / self.scale) as f32, &mut self.high);
    }

    /// Fills `thin` in the same way, with contrast made alike over the picture.
    pub(crate) fn filter_thin(&mut self, sigma: f64, smoother: &mut Smoother, histogram: &mut Vec<u32>) {
        smoother.subtract_blur(&self.raw, (sigma / self.scale) as f32, &mut self.thin);
        smoother.equalize(&mut self.thin, (sigma / self.scale) as f32, histogram);
    }

    pub(crate) fn blocks(&self) -> (usize, usize) {
        (self.nodes_x - 1, self.nodes_y - 1)
    }
}

/// The pyramid, made once per camera.
#[derive(Debug)]
pub(crate) struct View {
    pub levels: Vec<Level>,
    /// Full-resolution pixels per pixel of the lowest level.
    pub reduction: usize,
    /// Where the window of a cold start is centred: the optical axis, or the nearest point in the picture, full-resolution px.
    pub centre: [f64; 2],
    /// Focal length near the centre, full-resolution px.
    pub focal: f64,
    /// Lengths that were tuned on 848 x 480 px grow with this, full-resolution px over those.
    pub size: f64,
}

impl View {
    /// `None` when the picture is too small to hold a few cells.
    pub(crate) fn new(camera: &Camera, working_pixels: usize) -> Option<Self> {
        let (w, h) = (camera.width() as usize, camera.height() as usize);
        let mut reduction = 1;
        while (w / reduction) * (h / reduction) > working_pixels {
            reduction += 1;
        }
        if w / reduction < 64 || h / reduction < 48 {
            return None;
        }
        let size = f64::sqrt((w * h) as f64 / (848.0 * 480.0));
        let centre = [camera.cx().clamp(0.0, (w - 1) as f64), camera.cy().clamp(0.0, (h - 1) as f64)];
        let focal = {
            let j = Site::new(camera, centre[0], centre[1]).jacobian();
            let det = (j[0][0] * j[1][1] - j[0][1] * j[1][0]).abs();
            if det > 0.0 && det.is_finite() { 1.0 / det.sqrt() } else { (camera.fx() * camera.fy()).sqrt() }
        };
        let mut levels = Vec::new();
        for l in 0..LEVELS {
            let scale = (reduction << l) as f64;
            let (lw, lh) = ((w / reduction) >> l, (h / reduction) >> l);
            let (bx, by) = (lw / BLOCK, lh / BLOCK);
            if l > 0 && (bx < 16 || by < 10) {
                break;
            }
            let (lw, lh) = (bx * BLOCK, by * BLOCK);
            let edge = |g: usize| (g * BLOCK) as f64 * scale - 0.5;
            let mut rays = Vec::with_capacity((bx + 1) * (by + 1));
            for gy in 0..=by {
                for gx in 0..=bx {
                    let site = Site::new(camera, edge(gx), edge(gy));
                    rays.push(if site.valid { site.ray } else { [f64::NAN; 2] });
                }
            }
            let grid = |target: f64| {
                let count = |blocks: usize| {
                    ((blocks as f64 * BLOCK as f64 * scale / (target * size)).round() as usize).clamp(2, blocks)
                };
                let (nx, ny) = (count(bx), count(by));
                let of = |blocks: usize, n: usize| (0..blocks).map(|b| (b * n / blocks) as u16).collect::<Vec<_>>();
                let (column, row) = (of(bx, nx), of(by, ny));
                let middle = |of: &[u16], t: usize| {
                    let first = of.iter().position(|c| usize::from(*c) == t).unwrap_or(0);
                    let last = of.iter().rposition(|c| usize::from(*c) == t).unwrap_or(0);
                    0.5 * (edge(first) + edge(last + 1))
                };
                let sites = (0..ny)
                    .flat_map(|ty| (0..nx).map(move |tx| (tx, ty)))
                    .map(|(tx, ty)| Site::new(camera, middle(&column, tx), middle(&row, ty)))
                    .collect();
                TileGrid { nx, ny, area: (lw * lh) as f64 / (nx * ny) as f64, column, row, sites }
            };
            levels.push(Level {
                scale,
                raw: Image::new(lw, lh),
                high: Image::new(lw, lh),
                thin: Image::new(lw, lh),
                nodes_x: bx + 1,
                nodes_y: by + 1,
                rays,
                tiles: [grid(52.0), grid(104.0)],
            });
        }
        Some(Self { levels, reduction, centre, focal, size })
    }

    /// Takes a picture in: brightness 0 to 1, averaged down level by level.
    pub(crate) fn load(&mut self, image: GrayView<'_>) {
        take_in(image, self.reduction, &mut self.levels[0].raw);
        self.average_down();
    }

    /// Fills the levels above the lowest from it.
    pub(crate) fn average_down(&mut self) {
        for l in 1..self.levels.len() {
            let (below, above) = self.levels.split_at_mut(l);
            average(&below[l - 1].raw, &mut above[0].raw);
        }
    }

    /// The level on which a cell of `cell` full-resolution px still has `wanted` px.
    pub(crate) fn level_for(&self, cell: f64, wanted: f64) -> usize {
        let mut l = 0;
        while l + 1 < self.levels.len() && cell / self.levels[l + 1].scale >= wanted {
            l += 1;
        }
        l
    }

    /// Small tiles (0) or large ones (1) for a cell of `cell` full-resolution px.
    pub(crate) fn tiling_for(&self, cell: f64) -> usize {
        usize::from(cell >= 30.0 * self.size)
    }

    /// Length scale, full-resolution px, of the high-pass filter of the lock-in: shorter than the other, so that of a fish only its outline
    /// is left, and of clouds next to nothing, and still longer than what twine is wide.
    pub(crate) fn thin_px(&self, cell: f64) -> f64 {
        stepped((0.2 * cell).max(4.0 * self.size.max(self.reduction as f64)))
    }

    /// Length scale, full-resolution px, of the high-pass filter of the drawing's comparison for a cell of that many px.
    pub(crate) fn high_pass_px(&self, cell: f64) -> f64 {
        stepped((0.9 * cell).max(8.0 * self.size.max(self.reduction as f64)))
    }
}

widely! {
    /// Brightness of a picture, 0 to 1, averaged over squares of `d` px.
    fn take_in<'a>(image: GrayView<'a>, d: usize, out: &'a mut Image<f32>) -> () {
        let width = out.width();
        for v in 0..out.height() {
            let row = out.row_mut(v);
            if d == 1 {
                for (out, p) in row.iter_mut().zip(image.row(v)) {
                    *out = f32::from(*p) * (1.0 / 255.0);
                }
                continue;
            }
            let norm = 1.0 / (255 * d * d) as f32;
            row.fill(0.0);
            for dv in 0..d {
                let src = image.row(v * d + dv);
                for (out, block) in row.iter_mut().zip(src[..width * d].chunks_exact(d)) {
                    *out += norm * block.iter().map(|p| u32::from(*p)).sum::<u32>() as f32;
                }
            }
        }
    }
}
widely! {
    /// The mean of every two by two.
    fn average<'a>(src: &'a Image<f32>, dst: &'a mut Image<f32>) -> () {
        for v in 0..dst.height() {
            let (a, b) = (src.row(2 * v), src.row(2 * v + 1));
            for ((out, a), b) in dst.row_mut(v).iter_mut().zip(a.chunks_exact(2)).zip(b.chunks_exact(2)) {
                *out = 0.25 * (a[0] + a[1] + b[0] + b[1]);
            }
        }
    }
}

/// The next quarter of an octave: cells that are nearly alike share a filtered picture.
fn stepped(px: f64) -> f64 {
    (0.25 * (4.0 * px.log2()).round()).exp2()
}
