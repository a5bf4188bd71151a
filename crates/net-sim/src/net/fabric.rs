//! Where the knots of a net are meant to be, before jitter: on a plane, or on a bent sheet.

use nalgebra::{Matrix2, SMatrix, Vector2, Vector3};
use net_geometry::Mesh;

use super::drape::Drape;
use super::sheet::Sheet;
use crate::error::Result;
use crate::scene::{Net, Surface};

/// The ideal net: kept from frame to frame, since laying twine on a bent sheet takes time.
#[derive(Debug)]
pub(crate) struct Fabric {
    /// The mesh at the net's origin.
    mesh: Mesh,
    sheet: Sheet,
    drape: Drape,
    /// Whether knots come from the drape; else from the flat lattice, lifted onto the sheet.
    draped: bool,
}

/// A place on the net.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    /// Lattice coordinates, cells.
    pub(crate) cells: Vector2<f64>,
    /// Net frame, m per cell: the mesh's sides there.
    pub(crate) sides: [Vector3<f64>; 2],
}

impl Fabric {
    pub(crate) fn new() -> Result<Self> {
        let mesh = Mesh::square(1.0)?;
        Ok(Self { mesh, sheet: Sheet::new(&Surface::default()), drape: Drape::default(), draped: false })
    }

    /// Turns to `net`.
    pub(crate) fn take(&mut self, net: &Net) -> Result<()> {
        self.mesh = net.hung_mesh()?;
        self.sheet = Sheet::new(&net.surface);
        self.draped = net.surface.isometric && !net.surface.is_flat();
        Ok(())
    }

    /// Makes the knots of these columns and rows ready.
    pub(crate) fn lay(&mut self, net: &Net, columns: [i32; 2], rows: [i32; 2]) {
        if self.draped {
            self.drape.lay(net, &self.sheet, columns, rows);
        }
    }

    pub(crate) fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    pub(crate) fn sheet(&self) -> &Sheet {
        &self.sheet
    }

    /// Knot `(i, j)` in the net frame, m. `None` where no net can lie, or where none was made ready.
    #[inline]
    pub(crate) fn knot(&self, i: i32, j: i32) -> Option<Vector3<f64>> {
        if self.draped {
            return self.drape.point(i, j);
        }
        Some(self.sheet.point(self.mesh.node(f64::from(i), f64::from(j))))
    }

    /// The place over `(X, Y)` of the net frame: the smooth net through the knots, to fourth order.
    pub(crate) fn locate(&self, p: Vector2<f64>) -> Option<Place> {
        let cells_from_net = Matrix2::from_columns(&[self.mesh.a1(), self.mesh.a2()]).try_inverse()?;
        let mut cells = cells_from_net * p;
        if !self.draped {
            let lift = |side: Vector2<f64>| Vector3::new(side.x, side.y, self.sheet.height(p).1.dot(&side));
            return Some(Place { cells, sides: [lift(self.mesh.a1()), lift(self.mesh.a2())] });
        }
        for _ in 0..30 {
            let (point, sides) = self.interpolate(cells)?;
            let jacobian = Matrix2::from_columns(&[sides[0].xy(), sides[1].xy()]);
            let step = jacobian.try_inverse()? * (point.xy() - p);
            // A long step would overshoot where the net is strongly bent.
            cells -= step * (2.0 / step.norm()).min(1.0);
            if step.norm() < 1e-12 {
                return Some(Place { cells, sides: self.interpolate(cells)?.1 });
            }
        }
        None
    }

    /// Point at lattice coordinates `cells` and its derivatives, by cubics through 4 x 4 knots.
    fn interpolate(&self, cells: Vector2<f64>) -> Option<(Vector3<f64>, [Vector3<f64>; 2])> {
        let (i, j) = (cells.x.floor(), cells.y.floor());
        if !(i.abs() < 1e6 && j.abs() < 1e6) {
            return None;
        }
        let ((wx, dx), (wy, dy)) = (cubic(cells.x - i), cubic(cells.y - j));
        let (mut point, mut sides) = (Vector3::zeros(), [Vector3::zeros(); 2]);
        for b in 0..4 {
            for a in 0..4 {
                let knot = self.knot(i as i32 + a as i32 - 1, j as i32 + b as i32 - 1)?;
                point += knot * (wx[a] * wy[b]);
                sides[0] += knot * (dx[a] * wy[b]);
                sides[1] += knot * (wx[a] * dy[b]);
            }
        }
        Some((point, sides))
    }
}

/// Weights of the knots at -1, 0, 1, 2 for a value at `t` in `[0, 1]`, and for its derivative (Lagrange).
fn cubic(t: f64) -> ([f64; 4], [f64; 4]) {
    let powers = SMatrix::<f64, 4, 1>::new(1.0, t, t * t, t * t * t);
    let slopes = SMatrix::<f64, 4, 1>::new(0.0, 1.0, 2.0 * t, 3.0 * t * t);
    #[rustfmt::skip]
    let basis = SMatrix::<f64, 4, 4>::new(
        0.0, -1.0 / 3.0,  0.5, -1.0 / 6.0,
        1.0, -0.5,       -1.0,  0.5,
        0.0,  1.0,        0.5, -0.5,
        0.0, -1.0 / 6.0,  0.0,  1.0 / 6.0,
    );
    ((basis * powers).into(), (basis * slopes).into())
}
