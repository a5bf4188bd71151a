//! Pinhole camera with a lens.

use nalgebra::{Vector2, Vector3};

use crate::error::{Error, Result, finite, positive};

/// How the lens bends the pinhole's rays. Coefficients in OpenCV's order.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Lens {
    /// Straight pinhole.
    #[default]
    None,
    /// `k1, k2, p1, p2, k3` (ROS `plumb_bob`, Brown 1966).
    PlumbBob([f64; 5]),
    /// `k1, k2, p1, p2, k3, k4, k5, k6` (ROS `rational_polynomial`).
    Rational([f64; 8]),
    /// `k1, k2, k3, k4` on the angle off the axis (ROS `equidistant`, Kannala and Brandt 2006).
    KannalaBrandt([f64; 4]),
}

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
}

impl Camera {
    /// Focal lengths `fx, fy` and principal point `cx, cy` in pixels, image size in pixels.
    ///
    /// # Errors
    /// [`Error::Value`] names the field that is not finite, or not above zero where it must be.
    pub fn new(fx: f64, fy: f64, cx: f64, cy: f64, width: u32, height: u32, lens: Lens) -> Result<Self> {
        positive("fx", fx)?;
        positive("fy", fy)?;
        finite("cx", cx)?;
        finite("cy", cy)?;
        positive("image width", f64::from(width))?;
        positive("image height", f64::from(height))?;
        let coefficients: &[f64] = match &lens {
            Lens::None => &[],
            Lens::PlumbBob(k) => k,
            Lens::Rational(k) => k,
            Lens::KannalaBrandt(k) => k,
        };
        for &k in coefficients {
            finite("distortion coefficient", k)?;
        }
        Ok(Self { fx, fy, cx, cy, width, height, lens })
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

    /// Ray `(x, y, 1)` in the camera frame through pixel `(u, v)`. `None` where the lens model has no inverse.
    #[inline]
    pub fn ray_from_pixel(&self, pixel: Vector2<f64>) -> Option<Vector3<f64>> {
        let x = (pixel.x - self.cx) / self.fx;
        let y = (pixel.y - self.cy) / self.fy;
        Some(Vector3::new(x, y, 1.0))
    }

    /// Pixel of a point in the camera frame, m. `None` behind the camera or beyond the lens model's range.
    #[inline]
    pub fn pixel_from_point(&self, point_in_camera: Vector3<f64>) -> Option<Vector2<f64>> {
        if point_in_camera.z <= 0.0 {
            return None;
        }
        let x = point_in_camera.x / point_in_camera.z;
        let y = point_in_camera.y / point_in_camera.z;
        Some(Vector2::new(self.fx * x + self.cx, self.fy * y + self.cy))
    }
}
