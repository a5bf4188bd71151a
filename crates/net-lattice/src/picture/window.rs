//! A round window on the picture.

/// Which part of the picture a lock-in looks at.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window {
    /// Middle, full-resolution px.
    pub centre: [f64; 2],
    /// Standard deviation, full-resolution px.
    pub radius: f64,
}

impl Window {
    /// Everything.
    pub(crate) const ALL: Self = Self { centre: [0.0; 2], radius: f64::INFINITY };

    /// Whether a place has a weight of a hundredth or more.
    pub(crate) fn reaches(&self, pixel: [f64; 2]) -> bool {
        const RADII: f64 = 3.034_854;
        let (u, v) = (pixel[0] - self.centre[0], pixel[1] - self.centre[1]);
        u * u + v * v <= (RADII * self.radius).powi(2)
    }

    /// Whether a place is within one radius.
    pub(crate) fn holds(&self, pixel: [f64; 2]) -> bool {
        (pixel[0] - self.centre[0]).hypot(pixel[1] - self.centre[1]) <= self.radius
    }

    /// Weight of a place.
    pub(crate) fn weight(&self, pixel: [f64; 2]) -> f64 {
        let (u, v) = (pixel[0] - self.centre[0], pixel[1] - self.centre[1]);
        if self.radius.is_finite() { (-(u * u + v * v) / (2.0 * self.radius * self.radius)).exp() } else { 1.0 }
    }
}
