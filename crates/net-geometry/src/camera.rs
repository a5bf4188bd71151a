//! Pinhole camera with a lens.

use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use crate::error::{Error, Result, finite, positive};
use crate::lens::Lens;

/// A calibrated camera: intrinsics in pixels, image size, lens. See the crate's conventions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: u32,
    height: u32,
    lens: Lens,
    /// Radius on the plane `z = 1` out to which the lens model is one-to-one.
    valid_radius: f64,
    /// See [`Camera::view_box`].
    view_box: [f64; 4],
}

/// Rays looked at along each side of the image to find the bounds of its view.
const VIEW_BOX_STEPS: u32 = 32;

/// Widening of these bounds, as a share of the view, for the bulge of a bent border between two such rays.
const VIEW_BOX_MARGIN: f64 = 0.01;

/// Pixels looked at along each side of the image to tell whether the lens can be one.
const SEEN_STEPS: u32 = 16;

/// Least share of them that must have a ray. Of the circle of a 250 degree fisheye that fits into a picture of 16:9, the 180
/// degrees that a ray `(x, y, 1)` can have are 0.23 of the picture: no real camera has less.
const LEAST_SEEN: f64 = 0.125;

/// A ray of a distorting lens so many times nearer to the axis than the pinhole's is none that a lens has: pincushion stays
/// below 1.5. Coefficients of another unit have a ray for every pixel, all of them in a needle's eye about the axis.
const MOST_SPREAD: f64 = 2.0;

impl Camera {
    /// Focal lengths `fx, fy` and principal point `cx, cy` in pixels, image size in pixels.
    ///
    /// # Errors
    /// [`Error::Value`] names the field that is not finite, or not above zero where it must be; [`Error::NearlyBlind`] is for a
    /// lens by which fewer than one in eight pixels of the image have a ray.
    pub fn new(fx: f64, fy: f64, cx: f64, cy: f64, width: u32, height: u32, lens: Lens) -> Result<Self> {
        positive("fx", fx)?;
        positive("fy", fy)?;
        finite("cx", cx)?;
        finite("cy", cy)?;
        positive("image width", f64::from(width))?;
        positive("image height", f64::from(height))?;
        for &k in lens.coefficients() {
            finite("distortion coefficient", k)?;
        }
        let camera =
            Self { fx, fy, cx, cy, width, height, lens, valid_radius: lens.valid_radius(), view_box: [0.0; 4] };
        let seen = camera.seen();
        if seen < LEAST_SEEN {
            let percent = 100.0 * seen;
            let expected = format!(
                "a lens that, with this focal length, gives the picture's pixels rays; {percent:.0} % of them have one that makes sense"
            );
            return Err(Error::NearlyBlind {
                model: lens.model(),
                coefficients: lens.coefficients().to_vec(),
                expected,
            });
        }
        Ok(camera.with_view_box())
    }

    /// Focal length along u, px.
    pub fn fx(&self) -> f64 {
        self.fx
    }
    /// Focal length along v, px.
    pub fn fy(&self) -> f64 {
        self.fy
    }
    /// Principal point, u, px.
    pub fn cx(&self) -> f64 {
        self.cx
    }
    /// Principal point, v, px.
    pub fn cy(&self) -> f64 {
        self.cy
    }
    /// Image width, px.
    pub fn width(&self) -> u32 {
        self.width
    }
    /// Image height, px.
    pub fn height(&self) -> u32 {
        self.height
    }
    /// The lens.
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// Refuses an image of another size than the calibration's.
    ///
    /// # Errors
    /// [`Error::ImageSize`] with both sizes.
    pub fn check_image_size(&self, width: u32, height: u32) -> Result<()> {
        if (width, height) == (self.width, self.height) {
            return Ok(());
        }
        Err(Error::ImageSize {
            camera_width: self.width,
            camera_height: self.height,
            image_width: width,
            image_height: height,
        })
    }

    /// The same camera without its lens.
    pub fn pinhole(&self) -> Self {
        Self { lens: Lens::None, valid_radius: f64::INFINITY, ..*self }.with_view_box()
    }

    /// The camera of the part of the picture of `width` x `height` px whose top-left pixel is `(u, v)`.
    ///
    /// # Errors
    /// [`Error::Value`] for an empty part.
    pub fn cropped(&self, u: u32, v: u32, width: u32, height: u32) -> Result<Self> {
        positive("image width", f64::from(width))?;
        positive("image height", f64::from(height))?;
        let part = Self { cx: self.cx - f64::from(u), cy: self.cy - f64::from(v), width, height, ..*self };
        Ok(part.with_view_box())
    }

    /// Whether `pixel` lies on the image: at most half a pixel from the centre of an outermost one.
    #[inline]
    pub fn contains(&self, pixel: Vector2<f64>) -> bool {
        let inside = |x: f64, size: u32| x >= -0.5 && x < f64::from(size) - 0.5;
        inside(pixel.x, self.width) && inside(pixel.y, self.height)
    }

    /// Bounds of `x` and of `y`, least and greatest, of all rays `(x, y, 1)` that the image sees.
    pub fn view_box(&self) -> [f64; 4] {
        self.view_box
    }

    /// Share of the image's pixels that have a ray which a lens can have.
    fn seen(&self) -> f64 {
        if matches!(self.lens, Lens::None) {
            return 1.0;
        }
        let at = |k: u32, size: u32| (f64::from(k) + 0.5) / f64::from(SEEN_STEPS) * f64::from(size) - 0.5;
        let pixels = (0..SEEN_STEPS).flat_map(|row| {
            (0..SEEN_STEPS).map(move |column| Vector2::new(at(column, self.width), at(row, self.height)))
        });
        let seen = pixels.filter(|&pixel| {
            let pinhole = self.plane_from_pixel(pixel).norm();
            self.ray_from_pixel(pixel).is_some_and(|ray| pinhole <= MOST_SPREAD * ray.xy().norm())
        });
        seen.count() as f64 / f64::from(SEEN_STEPS * SEEN_STEPS)
    }

    /// Works out `view_box` from rays along the border.
    fn with_view_box(self) -> Self {
        let (right, bottom) = (f64::from(self.width) - 0.5, f64::from(self.height) - 0.5);
        let mut bounds = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
        let mut seen = true;
        for k in 0..=VIEW_BOX_STEPS {
            let share = f64::from(k) / f64::from(VIEW_BOX_STEPS);
            let (u, v) = (-0.5 + (right + 0.5) * share, -0.5 + (bottom + 0.5) * share);
            for (u, v) in [(u, -0.5), (u, bottom), (-0.5, v), (right, v)] {
                let Some(ray) = self.ray_from_pixel(Vector2::new(u, v)) else {
                    seen = false;
                    continue;
                };
                bounds = [bounds[0].min(ray.x), bounds[1].max(ray.x), bounds[2].min(ray.y), bounds[3].max(ray.y)];
            }
        }
        let view_box = if !seen {
            // The lens model ends inside the image.
            [-self.valid_radius, self.valid_radius, -self.valid_radius, self.valid_radius]
        } else if matches!(self.lens, Lens::None) {
            bounds
        } else {
            // A bent border bulges between the rays looked at.
            let margin = VIEW_BOX_MARGIN * (bounds[1] - bounds[0]).max(bounds[3] - bounds[2]);
            [bounds[0] - margin, bounds[1] + margin, bounds[2] - margin, bounds[3] + margin]
        };
        Self { view_box, ..self }
    }

    /// Ray `(x, y, 1)` in the camera frame through pixel `(u, v)`. `None` where the lens model has no inverse, or more
    /// than 89.9 degrees off the axis.
    #[inline]
    pub fn ray_from_pixel(&self, pixel: Vector2<f64>) -> Option<Vector3<f64>> {
        let distorted = self.plane_from_pixel(pixel);
        match self.lens {
            Lens::None => Some(distorted.push(1.0)),
            lens => lens.undistort(distorted, self.valid_radius).map(|point| point.push(1.0)),
        }
    }

    /// As [`Camera::ray_from_pixel`], with the Jacobian `d(x, y) / d(u, v)`.
    #[inline]
    pub fn ray_from_pixel_with_jacobian(&self, pixel: Vector2<f64>) -> Option<(Vector3<f64>, Matrix2<f64>)> {
        let point = self.lens.undistort(self.plane_from_pixel(pixel), self.valid_radius)?;
        let (_, distortion) = self.lens.distort(point);
        let scale = Matrix2::from_diagonal(&Vector2::new(1.0 / self.fx, 1.0 / self.fy));
        Some((point.push(1.0), distortion.try_inverse()? * scale))
    }

    /// Pixel of a point in the camera frame, m. `None` behind the camera or beyond the lens model's range.
    #[inline]
    pub fn pixel_from_point(&self, point_in_camera: Vector3<f64>) -> Option<Vector2<f64>> {
        let undistorted = self.plane_from_point(point_in_camera)?;
        match self.lens {
            Lens::None => Some(self.pixel_from_plane(undistorted)),
            lens => Some(self.pixel_from_plane(lens.distort(undistorted).0)),
        }
    }

    /// As [`Camera::pixel_from_point`], with the Jacobian `d(u, v) / d(x, y, z)`, px per m.
    #[inline]
    pub fn pixel_from_point_with_jacobian(
        &self,
        point_in_camera: Vector3<f64>,
    ) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let undistorted = self.plane_from_point(point_in_camera)?;
        let (distorted, distortion) = self.lens.distort(undistorted);
        let (x, y, w) = (undistorted.x, undistorted.y, 1.0 / point_in_camera.z);
        let projection = Matrix2x3::new(w, 0.0, -x * w, 0.0, w, -y * w);
        let scale = Matrix2::from_diagonal(&Vector2::new(self.fx, self.fy));
        Some((self.pixel_from_plane(distorted), scale * distortion * projection))
    }

    /// Where the lens puts what the pinhole of the same intrinsics would see at `pixel`: what an undistorted picture is
    /// read from.
    pub fn pixel_from_pinhole(&self, pixel: Vector2<f64>) -> Option<Vector2<f64>> {
        self.pixel_from_point(self.plane_from_pixel(pixel).push(1.0))
    }

    /// Where the pinhole of the same intrinsics would see what the lens puts at `pixel`.
    pub fn pinhole_from_pixel(&self, pixel: Vector2<f64>) -> Option<Vector2<f64>> {
        self.ray_from_pixel(pixel).map(|ray| self.pixel_from_plane(ray.xy()))
    }

    /// Pixel to the plane `z = 1`, lens and all.
    #[inline]
    fn plane_from_pixel(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        Vector2::new((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy)
    }

    #[inline]
    fn pixel_from_plane(&self, point: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.fx * point.x + self.cx, self.fy * point.y + self.cy)
    }

    /// A point in front of the camera, and within the lens model's range, to the plane `z = 1`.
    #[inline]
    fn plane_from_point(&self, point: Vector3<f64>) -> Option<Vector2<f64>> {
        let on_plane = point.xy() / point.z;
        // NaN is neither in front nor within.
        let seen = point.z > 0.0 && (matches!(self.lens, Lens::None) || on_plane.norm() <= self.valid_radius);
        seen.then_some(on_plane)
    }
}
