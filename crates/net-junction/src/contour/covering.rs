//! The rectangle around all junctions, and the net's place across the optical axis that the thesis reads from it.

use net_geometry::nalgebra::{Vector2, Vector3};
use net_geometry::{Camera, Junction, Plane};

use crate::contour::rectangle::{Rectangle, convex_hull, min_area_rectangle};

/// Part of the image that the rectangle covers when the net counts as filling the view.
const FILLS_VIEW: f64 = 0.8;

/// The smallest rectangle around all junctions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Covering {
    /// The rectangle.
    pub rectangle: Rectangle,
    /// Where the thesis puts the net's origin: the rectangle's centre, or the image's when the net fills the view. Pixels.
    pub centre: Vector2<f64>,
    /// Whether the rectangle covers more than 80 % of the image.
    pub fills_view: bool,
}

impl Covering {
    /// Covering of at least three junctions that are not on a line, in an image of `width` x `height` px.
    pub fn of(junctions: &[Junction], width: usize, height: usize) -> Option<Self> {
        let mut points: Vec<_> = junctions.iter().map(|j| j.pixel).collect();
        let mut hull = Vec::new();
        convex_hull(&mut points, &mut hull);
        let rectangle = min_area_rectangle(&hull)?;
        let (width, height) = (width as f64, height as f64);
        let fills_view = rectangle.area() > FILLS_VIEW * width * height;
        let middle = Vector2::new((width - 1.0) * 0.5, (height - 1.0) * 0.5);
        Some(Self { rectangle, centre: if fills_view { middle } else { rectangle.centre }, fills_view })
    }

    /// The point of the plane seen at the centre, m, in the camera frame: the translation of the thesis's pose. `None` where the ray
    /// does not meet the plane.
    pub fn translation(&self, camera: &Camera, plane: &Plane) -> Option<Vector3<f64>> {
        let ray = camera.ray_from_pixel(self.centre)?;
        Some(ray * plane.depth_along(ray)?)
    }
}

#[cfg(test)]
mod tests {
    use net_geometry::{JunctionState, Lens};

    use super::*;

    fn junctions(nodes: impl IntoIterator<Item = (f64, f64)>) -> Vec<Junction> {
        nodes
            .into_iter()
            .map(|(u, v)| Junction {
                pixel: Vector2::new(u, v),
                index: None,
                sigma_px: 0.1,
                state: JunctionState::Seen,
            })
            .collect()
    }

    #[test]
    fn a_small_net_has_its_own_centre_and_a_large_one_the_image_centre() {
        let small = junctions([(100.0, 100.0), (200.0, 100.0), (200.0, 160.0), (100.0, 160.0), (140.0, 120.0)]);
        let covering = Covering::of(&small, 848, 480).expect("five junctions");
        assert!(!covering.fills_view);
        assert!((covering.centre - Vector2::new(150.0, 130.0)).norm() < 1e-9);
        let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None).expect("a good camera");
        let plane = Plane { normal: Vector3::z(), distance: 1.2 };
        let t = covering.translation(&camera, &plane).expect("in front of the camera");
        assert!((t - Vector3::new(-274.0 / 500.0, -110.0 / 500.0, 1.2)).norm() < 1e-9);
        let large = junctions([(10.0, 10.0), (840.0, 10.0), (840.0, 470.0), (10.0, 470.0)]);
        let covering = Covering::of(&large, 848, 480).expect("four junctions");
        assert!(covering.fills_view);
        assert_eq!(covering.centre, Vector2::new(423.5, 239.5));
    }

    #[test]
    fn two_junctions_cover_nothing() {
        assert_eq!(Covering::of(&junctions([(1.0, 1.0), (5.0, 5.0)]), 848, 480), None);
        assert_eq!(Covering::of(&[], 848, 480), None);
    }
}
