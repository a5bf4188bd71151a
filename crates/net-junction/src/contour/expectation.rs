//! What a cell of the net should look like at a place of the picture.

use net_geometry::nalgebra::Vector2;
use net_geometry::{Basis, Camera, Mesh, Plane, Pose};

/// Expected area of a cell at every pixel (Algorithm 5).
#[derive(Debug, Clone, PartialEq)]
pub struct CellArea(Kind);

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Uniform(f64),
    /// Area on the optical axis, px², and the plane it was found on.
    Plane {
        axis_area: f64,
        plane: Plane,
        camera: Camera,
    },
    /// Areas at (0, 0), (0, h), (w, 0), (w, h), px², and w, h, px.
    Corners {
        areas: [f64; 4],
        width: f64,
        height: f64,
    },
}

impl CellArea {
    /// The same area, px², everywhere: a net that faces the camera.
    pub fn uniform(area: f64) -> Self {
        Self(Kind::Uniform(area))
    }

    /// Area `axis_area`, px², on the optical axis of a planar net, elsewhere `axis_area / n³` with `n = Z / Z_axis`: a surface element's
    /// picture shrinks with its distance twice and with its foreshortening once more. `1 / n` is linear over a pinhole's image.
    /// (The thesis's eq 4.43, mended.)
    pub fn on_plane(axis_area: f64, plane: Plane, camera: Camera) -> Self {
        Self(Kind::Plane { axis_area, plane, camera })
    }

    /// Algorithm 5 as printed: `axis_area / n²` (eq 4.43) at the four corners of the image, the *area* interpolated linearly between.
    /// `None` where a corner's ray does not meet the plane.
    pub fn as_printed(axis_area: f64, plane: Plane, camera: &Camera) -> Option<Self> {
        let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
        let range = plane.range()?;
        let area = |u, v| {
            let depth = plane.depth_along(camera.ray_from_pixel(Vector2::new(u, v))?)?;
            Some(axis_area * (range / depth).powi(2))
        };
        let areas = [area(0.0, 0.0)?, area(0.0, height)?, area(width, 0.0)?, area(width, height)?];
        Some(Self(Kind::Corners { areas, width, height }))
    }

    /// Area, px², at a pixel; `None` where the net cannot be.
    pub fn at(&self, pixel: Vector2<f64>) -> Option<f64> {
        let area = match &self.0 {
            Kind::Uniform(area) => *area,
            Kind::Plane { axis_area, plane, camera } => {
                let depth = plane.depth_along(camera.ray_from_pixel(pixel)?)?;
                axis_area * (plane.range()? / depth).powi(3)
            }
            Kind::Corners { areas, width, height } => {
                // `linspace` over the rows and columns of the image: its last row and column have the corner's value.
                let a = pixel.x / (width - 1.0).max(1.0);
                let b = pixel.y / (height - 1.0).max(1.0);
                let (left, right) = (areas[0] + b * (areas[1] - areas[0]), areas[2] + b * (areas[3] - areas[2]));
                left + a * (right - left)
            }
        };
        (area.is_finite() && area > 0.0).then_some(area)
    }
}

/// A net that is expected to be seen: lattice and pose.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpectedNet {
    /// The camera that took the picture.
    pub camera: Camera,
    /// The net's mesh.
    pub mesh: Mesh,
    /// Net to camera. Without `anchored` its place along the net (two of the translation's numbers) need not be known.
    pub pose: Pose,
    /// Whether the pose is good to a third of a cell along the net, so that node `(0, 0)` is the pose's origin. Otherwise
    /// `(0, 0)` is the junction nearest to the principal point.
    pub anchored: bool,
}

impl ExpectedNet {
    /// Lattice coordinates `(i, j)` of the net's point seen at a pixel; `None` where the net cannot be.
    pub fn lattice_at(&self, pixel: Vector2<f64>) -> Option<Vector2<f64>> {
        let ray = self.camera.ray_from_pixel(pixel)?;
        let depth = self.pose.plane().depth_along(ray)?;
        let point = self.pose.inverse_transform(ray * depth).xy();
        let (a1, a2) = (self.mesh.a1(), self.mesh.a2());
        let area = a1.perp(&a2);
        let lattice = Vector2::new(point.perp(&a2) / area, a1.perp(&point) / area);
        (lattice.x.is_finite() && lattice.y.is_finite()).then_some(lattice)
    }

    /// Pixel of a lattice point; `None` behind the camera or beyond the lens model.
    pub fn pixel_at(&self, lattice: Vector2<f64>) -> Option<Vector2<f64>> {
        let point = self.mesh.node(lattice.x, lattice.y);
        self.camera.pixel_from_point(self.pose.transform(point.push(0.0)))
    }

    /// The two sides, px, of the cell around a pixel.
    pub fn basis_at(&self, pixel: Vector2<f64>) -> Option<Basis> {
        let at = self.lattice_at(pixel)?;
        let side = |d: Vector2<f64>| Some(self.pixel_at(at + d)? - self.pixel_at(at - d)?);
        Some(Basis { b1: side(Vector2::new(0.5, 0.0))?, b2: side(Vector2::new(0.0, 0.5))? })
    }
}

/// What is known of the net before its junctions are looked for.
#[derive(Debug, Clone, PartialEq)]
pub enum Expectation {
    /// The cells' size only, as the thesis passes it on from the spectrum.
    Area(CellArea),
    /// A predicted pose and the mesh: sizes, directions and foreshortening.
    Net(ExpectedNet),
}

/// A cell at a place of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ExpectedCell {
    /// Area, px².
    pub area: f64,
    /// Sides, px, when a pose gives them.
    pub basis: Option<Basis>,
}

impl ExpectedCell {
    /// Side of the square of the same area, px.
    pub fn side(&self) -> f64 {
        self.area.sqrt()
    }

    /// Least distance between neighbouring junctions, px.
    pub fn spacing(&self) -> f64 {
        self.basis.map_or_else(|| self.side(), |b| b.b1.norm().min(b.b2.norm()))
    }
}

impl Expectation {
    /// The cell expected at a pixel; `None` where the net cannot be.
    pub(crate) fn cell_at(&self, pixel: Vector2<f64>) -> Option<ExpectedCell> {
        match self {
            Self::Area(area) => Some(ExpectedCell { area: area.at(pixel)?, basis: None }),
            Self::Net(net) => {
                let basis = net.basis_at(pixel)?;
                let area = basis.cell_area().abs();
                (area.is_finite() && area > 0.0).then_some(ExpectedCell { area, basis: Some(basis) })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use net_geometry::Lens;
    use net_geometry::nalgebra::{Rotation3, Vector3};

    use super::*;

    fn net(tilt: f64) -> ExpectedNet {
        ExpectedNet {
            camera: Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None).expect("a good camera"),
            mesh: Mesh::square(0.05).expect("a good mesh"),
            pose: Pose {
                rotation: Rotation3::from_axis_angle(&Vector3::y_axis(), tilt),
                translation: Vector3::new(0.01, -0.02, 1.5),
            },
            anchored: true,
        }
    }

    #[test]
    fn lattice_and_pixel_are_inverse() {
        let net = net(0.5);
        for node in [Vector2::new(0.0, 0.0), Vector2::new(3.0, -4.0), Vector2::new(-6.5, 2.25)] {
            let pixel = net.pixel_at(node).expect("in front of the camera");
            let back = net.lattice_at(pixel).expect("on the net");
            // A pinhole's way there and back: rounding only.
            assert!((back - node).norm() < 1e-9, "{back} for {node}");
        }
    }

    /// Area of the picture of the cell whose middle is at a lattice point.
    fn true_area(net: &ExpectedNet, at: Vector2<f64>) -> f64 {
        let corner = |i: f64, j: f64| net.pixel_at(at + Vector2::new(i, j)).expect("in front of the camera");
        let (a, b, c, d) = (corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5));
        0.5 * ((c - a).perp(&(d - b))).abs()
    }

    #[test]
    fn area_falls_with_the_cube_of_the_depth() {
        for tilt in [0.0, 0.35, 0.7] {
            let net = net(tilt);
            let axis = Vector2::new(net.camera.cx(), net.camera.cy());
            let axis_lattice = net.lattice_at(axis).expect("the axis meets the net");
            let axis_area = true_area(&net, axis_lattice);
            let mended = CellArea::on_plane(axis_area, net.pose.plane(), net.camera);
            let printed =
                CellArea::as_printed(axis_area, net.pose.plane(), &net.camera).expect("all corners on the net");
            let (mut worst_mended, mut worst_printed) = (0.0_f64, 0.0_f64);
            for pixel in [(30.0, 40.0), (30.0, 440.0), (424.0, 100.0), (800.0, 60.0), (820.0, 400.0)] {
                let pixel = Vector2::new(pixel.0, pixel.1);
                let truth = true_area(&net, net.lattice_at(pixel).expect("on the net"));
                worst_mended = worst_mended.max((mended.at(pixel).expect("on the net") / truth - 1.0).abs());
                worst_printed = worst_printed.max((printed.at(pixel).expect("on the net") / truth - 1.0).abs());
            }
            // A cell is not infinitely small: its area differs from the element's by the square of side over depth.
            assert!(worst_mended < 2e-3, "tilt {tilt}: {worst_mended}");
            if tilt > 0.0 {
                assert!(worst_printed > 0.1, "tilt {tilt}: the printed form is off by {worst_printed} only");
            }
        }
    }

    #[test]
    fn no_area_where_the_net_cannot_be() {
        let plane = Plane { normal: Vector3::new(1.0, 0.0, 0.2).normalize(), distance: 1.0 };
        let camera = net(0.0).camera;
        let area = CellArea::on_plane(400.0, plane, camera);
        assert_eq!(area.at(Vector2::new(0.0, 240.0)), None);
        assert!(area.at(Vector2::new(800.0, 240.0)).is_some());
        assert_eq!(CellArea::as_printed(400.0, plane, &camera), None);
        assert_eq!(CellArea::uniform(f64::NAN).at(Vector2::zeros()), None);
    }
}
