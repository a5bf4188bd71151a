//! The picture in sections (thesis 4.3.6): a grid of any rows and columns, with overlap.

use net_geometry::nalgebra::{Matrix2, Vector2, Vector3};
use net_geometry::{Camera, WaveVector};

use crate::error::{Error, Result};

/// How a picture is divided.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GridConfig {
    /// Rows of sections.
    pub rows: usize,
    /// Columns of sections.
    pub columns: usize,
    /// How much of its length a section shares with the next one: 0 side by side (thesis), below 1. Sections' sides are rounded down to numbers that
    /// transform fast: with overlap products of 2, 3 and 5; side by side of 7 as well, so that next to nothing is left out (of 424 px 4, which took half as long again).
    pub overlap: f64,
}

impl Default for GridConfig {
    /// The thesis's four sections.
    fn default() -> Self {
        Self { rows: 2, columns: 2, overlap: 0.0 }
    }
}

impl GridConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the field.
    pub fn validate(&self) -> Result<()> {
        for (field, value) in [("rows", self.rows), ("columns", self.columns)] {
            if !(1..=64).contains(&value) {
                return Err(Error::Parameter { field, value: value as f64, expected: "1 to 64 sections" });
            }
        }
        if !(0.0..1.0).contains(&self.overlap) {
            return Err(Error::Parameter { field: "overlap", value: self.overlap, expected: "0 or more, below 1" });
        }
        Ok(())
    }

    /// Width and height of a section of a picture of `width` x `height` px; at least 1.
    pub fn section_size(&self, width: usize, height: usize) -> (usize, usize) {
        let side = |length: usize, count: usize| {
            let shared = count as f64 - (count as f64 - 1.0) * self.overlap;
            let longest = ((length as f64 / shared).floor() as usize).max(1);
            let factors: &[usize] = if self.overlap == 0.0 { &[2, 3, 5, 7] } else { &[2, 3, 5] };
            fast_size_up_to(longest, factors)
        };
        (side(width, self.columns), side(height, self.rows))
    }

    /// Top-left pixels of the sections, row by row, spread evenly from border to border.
    pub fn corners(&self, width: usize, height: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (section_width, section_height) = self.section_size(width, height);
        let (rows, columns) = (self.rows, self.columns);
        let start = |index: usize, count: usize, length: usize, side: usize| {
            let room = length.saturating_sub(side);
            if count > 1 { (room * index + (count - 1) / 2) / (count - 1) } else { room / 2 }
        };
        (0..rows).flat_map(move |row| {
            (0..columns).map(move |column| {
                (start(column, columns, width, section_width), start(row, rows, height, section_height))
            })
        })
    }
}

/// The largest product of `factors` that does not exceed `length`, and is even where it can be.
fn fast_size_up_to(length: usize, factors: &[usize]) -> usize {
    let is_fast = |mut n: usize| {
        for &factor in factors {
            while n.is_multiple_of(factor) {
                n /= factor;
            }
        }
        n == 1
    };
    (1..=length).rev().find(|&n| is_fast(n) && (n.is_multiple_of(2) || n == 1)).unwrap_or(1)
}

/// Where within a section the wave vectors' change is followed: the part of it that the window lets through.
pub const GRID: [f64; 5] = [-0.25, -0.125, 0.0, 0.125, 0.25];

/// Where a section looks: what turns its bins into directions in the camera frame.
///
/// A wave vector belongs to the section's centre. Of the lens only the Jacobian there matters: it maps wave vectors of the picture to those an ideal pinhole of
/// focal length 1 would see (`k = Jᵀ q`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionView {
    /// Centre, px of the whole picture.
    pub centre: Vector2<f64>,
    /// Ray `(x, y, 1)` through the centre.
    pub ray: Vector3<f64>,
    /// Cycles per pixel of the whole picture for one bin, along u and v.
    pub wave_per_bin: Vector2<f64>,
    /// Rays `(x, y, 1)` through a grid of points, row by row: those [`GRID`] parts of the section's width and height from its centre, along u and v.
    pub grid_rays: [Vector3<f64>; GRID.len() * GRID.len()],
    /// `d(x, y) / d(u, v)` at the centre, 1 / px.
    jacobian: Matrix2<f64>,
    inverse: Matrix2<f64>,
}

impl SectionView {
    /// The section of `width` x `height` px with its top-left pixel at `corner`, of a picture reduced `reduction` times.
    /// `None` where the lens model has no inverse.
    pub fn new(camera: &Camera, corner: (usize, usize), width: usize, height: usize, reduction: usize) -> Option<Self> {
        let factor = reduction as f64;
        // A reduced pixel's centre is that of the square it averages.
        let centre_of =
            |start: usize, side: usize| factor * (start as f64 + (side as f64 - 1.0) / 2.0) + (factor - 1.0) / 2.0;
        let centre = Vector2::new(centre_of(corner.0, width), centre_of(corner.1, height));
        let (ray, jacobian) = camera.ray_from_pixel_with_jacobian(centre)?;
        let inverse = jacobian.try_inverse()?;
        let side = Vector2::new(width as f64 * factor, height as f64 * factor);
        let mut grid_rays = [ray; GRID.len() * GRID.len()];
        for (index, to) in grid_rays.iter_mut().enumerate() {
            let part = Vector2::new(GRID[index % GRID.len()], GRID[index / GRID.len()]);
            let ray = camera.ray_from_pixel(centre + part.component_mul(&side))?;
            *to = ray / ray.z;
        }
        let wave_per_bin = Vector2::new(1.0 / (width as f64 * factor), 1.0 / (height as f64 * factor));
        Some(Self { centre, ray: ray / ray.z, wave_per_bin, grid_rays, jacobian, inverse })
    }

    /// Ray `(x, y, 1)` through the point so many widths and heights of the section from its centre, by the lens's Jacobian there.
    #[inline]
    pub fn ray_at(&self, part: Vector2<f64>) -> Vector3<f64> {
        let shift = self.jacobian * part.component_div(&self.wave_per_bin);
        self.ray + Vector3::new(shift.x, shift.y, 0.0)
    }

    /// Cycles per pixel of the whole picture.
    #[inline]
    pub fn wave_from_bin(&self, bin: Vector2<f64>) -> WaveVector {
        bin.component_mul(&self.wave_per_bin)
    }

    /// Cycles per unit of `x` and `y` of the ray: what a pinhole of focal length 1 sees.
    #[inline]
    pub fn ideal_from_bin(&self, bin: Vector2<f64>) -> Vector2<f64> {
        self.inverse.tr_mul(&self.wave_from_bin(bin))
    }

    /// A step of so many pixels of the whole picture, seen by that pinhole.
    #[inline]
    pub fn ideal_step(&self, pixels: Vector2<f64>) -> Vector2<f64> {
        self.jacobian * pixels
    }

    /// [`Self::ideal_from_bin`] the other way.
    #[inline]
    pub fn bin_from_ideal(&self, ideal: Vector2<f64>) -> Vector2<f64> {
        self.jacobian.tr_mul(&ideal).component_div(&self.wave_per_bin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use net_geometry::Lens;

    #[test]
    fn four_sections_are_the_thesiss_but_for_a_strip_in_the_middle() {
        let grid = GridConfig::default();
        assert_eq!(grid.section_size(848, 480), (420, 240));
        assert_eq!(grid.corners(848, 480).collect::<Vec<_>>(), [(0, 0), (428, 0), (0, 240), (428, 240)]);
        assert_eq!(grid.section_size(849, 481), (420, 240));
        assert_eq!(grid.section_size(1280, 720), (640, 360));
        assert_eq!(grid.section_size(3, 1), (1, 1));
    }

    #[test]
    fn overlapping_sections_reach_from_border_to_border() {
        for (rows, columns, overlap) in [(3, 5, 0.3), (1, 3, 0.5), (1, 1, 0.2), (2, 2, 0.25)] {
            let grid = GridConfig { rows, columns, overlap };
            let (width, height) = grid.section_size(848, 480);
            let corners: Vec<_> = grid.corners(848, 480).collect();
            assert_eq!(corners.len(), rows * columns);
            assert!(corners.iter().all(|&(u, v)| u + width <= 848 && v + height <= 480));
            if columns > 1 && rows > 1 {
                assert_eq!((corners[0], corners[rows * columns - 1]), ((0, 0), (848 - width, 480 - height)));
            }
        }
        assert_eq!(fast_size_up_to(231, &[2, 3, 5]), 216);
        assert_eq!(fast_size_up_to(1, &[2]), 1);
    }

    #[test]
    fn a_wave_through_a_lens_is_a_wave_of_the_pinhole() {
        let lens = Lens::PlumbBob([-0.3, 0.1, 0.001, -0.002, 0.0]);
        let camera = Camera::new(600.0, 590.0, 424.0, 240.0, 848, 480, lens).unwrap();
        let view = SectionView::new(&camera, (10, 20), 216, 200, 1).unwrap();
        // A plane wave of the ideal picture, and its phase one pixel to the right and one below.
        let ideal = Vector2::new(17.0, -9.0);
        let wave = view.wave_from_bin(view.bin_from_ideal(ideal));
        let phase = |du: f64, dv: f64| {
            let ray = camera.ray_from_pixel(view.centre + Vector2::new(du, dv)).unwrap();
            ideal.dot(&ray.xy())
        };
        // Curvature over one pixel: 1e-6 of a cycle.
        assert!((phase(0.5, 0.0) - phase(-0.5, 0.0) - wave.x).abs() < 1e-6);
        assert!((phase(0.0, 0.5) - phase(0.0, -0.5) - wave.y).abs() < 1e-6);
        let back = view.ideal_from_bin(view.bin_from_ideal(ideal));
        assert!((back - ideal).norm() < 1e-9);
    }

    #[test]
    fn a_reduced_picture_has_the_same_centre() {
        let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None).unwrap();
        let whole = SectionView::new(&camera, (0, 0), 848, 480, 1).unwrap();
        let half = SectionView::new(&camera, (0, 0), 424, 240, 2).unwrap();
        assert_eq!((whole.centre, whole.wave_per_bin), (half.centre, half.wave_per_bin));
    }
}
