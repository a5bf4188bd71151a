//! The thesis's virtual net (Algorithm 1), as printed and mended.
//!
//! Printed, the lattice is half a cell off centre (`n / 2` instead of `(n - 1) / 2`) and lines run between whole pixels with a width
//! that does not know distance; on small cells they alias to half frequencies. Mended, it is a [`Scene`] of this crate: centred, twine of
//! a physical width, antialiased.

use nalgebra::{Vector2, Vector3};
use net_geometry::{Camera, Mesh, Pose};
use net_image::Image;

use crate::error::{Error, Result};
use crate::scene::{Extent, Layer, NetPose, Scene, Sensor, Twine, Water};

/// Brightness of background and lines.
const BACKGROUND: u8 = 30;
const LINE: u8 = 220;

/// The knots of a printed grid, row by row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Grid {
    /// In the net frame, m.
    pub points: Vec<Vector3<f64>>,
    /// In the picture; NaN behind the camera.
    pub pixels: Vec<Vector2<f64>>,
}

/// Algorithm 1 to the letter: `rows` x `columns` knots of a square mesh, lines 2 px thick between whole pixels.
///
/// # Errors
/// [`Error::Value`] for fewer than two or more than 5000 rows or columns.
pub fn create_grid(
    rows: u32,
    columns: u32,
    mesh: &Mesh,
    camera: &Camera,
    pose: &Pose,
    image: &mut Image<u8>,
) -> Result<Grid> {
    for count in [rows, columns] {
        if !(2..=5000).contains(&count) {
            let value = f64::from(count);
            return Err(Error::Value { field: "rows or columns", value, expected: "between 2 and 5000" });
        }
    }
    let mut grid = Grid::default();
    for row in 0..rows {
        for column in 0..columns {
            // As printed: n / 2 puts the middle between the last but one knot and the middle one.
            let i = f64::from(column) - f64::from(columns) / 2.0;
            let j = f64::from(row) - f64::from(rows) / 2.0;
            let flat = mesh.node(i, j);
            let point = Vector3::new(flat.x, flat.y, 0.0);
            let pixel = camera.pixel_from_point(pose.transform(point)).filter(|p| p.amax() < 6000.0);
            grid.points.push(point);
            grid.pixels.push(pixel.unwrap_or(Vector2::repeat(f64::NAN)));
        }
    }
    image.resize(camera.width() as usize, camera.height() as usize);
    image.fill(BACKGROUND);
    let at = |row: u32, column: u32| grid.pixels[(row * columns + column) as usize];
    for row in 0..rows {
        for column in 0..columns {
            if row + 1 < rows {
                line(image, at(row, column), at(row + 1, column));
            }
            if column + 1 < columns {
                line(image, at(row, column), at(row, column + 1));
            }
        }
    }
    Ok(grid)
}

/// A line two pixels thick between the pixels nearest to `a` and `b` (Bresenham 1965).
fn line(image: &mut Image<u8>, a: Vector2<f64>, b: Vector2<f64>) {
    if !(a.x.is_finite() && b.x.is_finite()) {
        return;
    }
    let (mut u, mut v) = (a.x.round() as i64, a.y.round() as i64);
    let (end_u, end_v) = (b.x.round() as i64, b.y.round() as i64);
    let (du, dv) = ((end_u - u).abs(), -(end_v - v).abs());
    let (step_u, step_v) = ((end_u - u).signum(), (end_v - v).signum());
    let steep = -dv > du;
    let mut error = du + dv;
    let mut set = |u: i64, v: i64| {
        if let (Ok(u), Ok(v)) = (usize::try_from(u), usize::try_from(v))
            && u < image.width()
            && v < image.height()
        {
            image.row_mut(v)[u] = LINE;
        }
    };
    loop {
        set(u, v);
        if steep {
            set(u - 1, v)
        } else {
            set(u, v - 1)
        }
        if (u, v) == (end_u, end_v) {
            return;
        }
        let twice = 2 * error;
        if twice >= dv {
            error += dv;
            u += step_u;
        }
        if twice <= du {
            error += du;
            v += step_v;
        }
    }
}

/// Algorithm 1 mended: `rows` x `columns` knots around the point that `pose` looks at, in the thesis's colours without noise.
/// `line_px` is how thick lines are at the optical axis.
///
/// # Errors
/// [`Error::Geometry`] for a mesh that is none.
pub fn mended_grid(
    rows: u32,
    columns: u32,
    mesh: &Mesh,
    pose: NetPose,
    line_px: f64,
    camera: &Camera,
) -> Result<Scene> {
    let mut layer = Layer::planar(mesh, centred(rows, columns, mesh, pose));
    layer.net.extent = Extent::centred(columns, rows);
    layer.net.twine =
        Twine { diameter_m: line_px * pose.range_m / camera.fx(), grey: f64::from(LINE), ..Twine::default() };
    Ok(Scene {
        layers: vec![layer],
        water: Water { veil_grey: f64::from(BACKGROUND), ..Water::default() },
        sensor: Sensor { read_noise_grey: 0.0, ..Sensor::default() },
        ..Scene::empty()
    })
}

/// `pose` moved so that it looks at the middle of the net and not at its knot `(0, 0)`: half a cell aside where the number of
/// knots is even.
pub fn centred(rows: u32, columns: u32, mesh: &Mesh, pose: NetPose) -> NetPose {
    let half = |n: u32| if n.is_multiple_of(2) { 0.5 } else { 0.0 };
    let aside = mesh.node(half(columns), half(rows));
    NetPose { x_m: pose.x_m + aside.x, y_m: pose.y_m + aside.y, ..pose }
}
