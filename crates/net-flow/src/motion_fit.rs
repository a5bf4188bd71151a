//! Motions through pairs of points: through as few as determine them, and of least squares through many.

use nalgebra::{Matrix3, SMatrix, SVector, Vector2};

use crate::motion::Motion;

/// Coordinates near one, so that the normal equations are well scaled: `(pixel - centre) / scale`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub centre: Vector2<f64>,
    pub scale: f64,
}

impl Frame {
    pub fn around(points: &[Vector2<f64>]) -> Self {
        let centre = points.iter().sum::<Vector2<f64>>() / points.len().max(1) as f64;
        let scale = points.iter().map(|p| (p - centre).amax()).fold(0.0, f64::max);
        Self { centre, scale: scale.max(1.0) }
    }

    pub fn normalise(&self, p: Vector2<f64>) -> Vector2<f64> {
        (p - self.centre) / self.scale
    }

    /// The homography in this frame's coordinates on both sides back in pixels.
    pub fn to_pixels(self, h: &Matrix3<f64>) -> Option<Motion> {
        let (c, s) = (self.centre, self.scale);
        let out = Matrix3::new(s, 0.0, c.x, 0.0, s, c.y, 0.0, 0.0, 1.0);
        let into = Matrix3::new(1.0 / s, 0.0, -c.x / s, 0.0, 1.0 / s, -c.y / s, 0.0, 0.0, 1.0);
        Motion::from_matrix(out * h * into)
    }

    pub fn corners(&self) -> [Vector2<f64>; 4] {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(u, v)| self.centre + Vector2::new(u, v) * self.scale)
    }
}

/// The similarity through two pairs.
pub(crate) fn similarity_of_two(p: &[Vector2<f64>; 4], q: &[Vector2<f64>; 4]) -> Option<Motion> {
    let (dp, dq) = (p[1] - p[0], q[1] - q[0]);
    let square = dp.norm_squared();
    // Close points say little on turn and scale.
    if square < 100.0 {
        return None;
    }
    let (a, b) = (dp.dot(&dq) / square, dp.perp(&dq) / square);
    let turned = Vector2::new(a * p[0].x - b * p[0].y, b * p[0].x + a * p[0].y);
    Some(Motion::similarity(a, b, q[0] - turned))
}

/// The homography through four pairs.
pub(crate) fn homography_of_four(p: &[Vector2<f64>; 4], q: &[Vector2<f64>; 4], frame: &Frame) -> Option<Motion> {
    let (p, q) = (p.map(|x| frame.normalise(x)), q.map(|x| frame.normalise(x)));
    // Three points near a line determine nothing; nor may the order of turns change.
    for (i, j, k) in [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)] {
        let (a, b) = ((p[j] - p[i]).perp(&(p[k] - p[i])), (q[j] - q[i]).perp(&(q[k] - q[i])));
        if a.abs() < 0.02 || a * b <= 0.0 {
            return None;
        }
    }
    let mut a = SMatrix::<f64, 8, 8>::zeros();
    let mut b = SVector::<f64, 8>::zeros();
    for k in 0..4 {
        let (x, y, u, v) = (p[k].x, p[k].y, q[k].x, q[k].y);
        a.set_row(2 * k, &SMatrix::<f64, 1, 8>::from([[x], [y], [1.0], [0.0], [0.0], [0.0], [-u * x], [-u * y]]));
        a.set_row(2 * k + 1, &SMatrix::<f64, 1, 8>::from([[0.0], [0.0], [0.0], [x], [y], [1.0], [-v * x], [-v * y]]));
        (b[2 * k], b[2 * k + 1]) = (u, v);
    }
    let h = a.lu().solve(&b)?;
    frame.to_pixels(&Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0))
}

/// The weighted least-squares similarity, in closed form.
pub(crate) fn weighted_similarity(
    pairs: impl Iterator<Item = (Vector2<f64>, Vector2<f64>, f64)> + Clone,
    frame: &Frame,
) -> Option<Motion> {
    let mut total = 0.0;
    let (mut mean_p, mut mean_q) = (Vector2::zeros(), Vector2::zeros());
    for (p, q, w) in pairs.clone() {
        total += w;
        mean_p += (p - frame.centre) * w;
        mean_q += (q - frame.centre) * w;
    }
    if total < 1e-9 {
        return None;
    }
    let (mean_p, mean_q) = (frame.centre + mean_p / total, frame.centre + mean_q / total);
    let (mut dot, mut cross, mut square) = (0.0, 0.0, 0.0);
    for (p, q, w) in pairs {
        let (p, q) = (p - mean_p, q - mean_q);
        dot += w * p.dot(&q);
        cross += w * p.perp(&q);
        square += w * p.norm_squared();
    }
    let (a, b) = (dot / square, cross / square);
    let turned = Vector2::new(a * mean_p.x - b * mean_p.y, b * mean_p.x + a * mean_p.y);
    let motion = Motion::similarity(a, b, mean_q - turned);
    Motion::from_matrix(*motion.matrix())
}

/// One Gauss-Newton step on the reprojection error of a homography.
pub(crate) fn homography_step(
    pairs: impl Iterator<Item = (Vector2<f64>, Vector2<f64>, f64)>,
    motion: &Motion,
    frame: &Frame,
) -> Option<Motion> {
    let (c, s) = (frame.centre, frame.scale);
    let into = Matrix3::new(1.0 / s, 0.0, -c.x / s, 0.0, 1.0 / s, -c.y / s, 0.0, 0.0, 1.0);
    let out = Matrix3::new(s, 0.0, c.x, 0.0, s, c.y, 0.0, 0.0, 1.0);
    let h = into * motion.matrix() * out;
    let h = h / h[(2, 2)];
    let mut normal = SMatrix::<f64, 8, 8>::zeros();
    let mut right = SVector::<f64, 8>::zeros();
    for (p, q, weight) in pairs {
        let (p, q) = (frame.normalise(p), frame.normalise(q));
        let w = h[(2, 0)] * p.x + h[(2, 1)] * p.y + 1.0;
        let u = (h[(0, 0)] * p.x + h[(0, 1)] * p.y + h[(0, 2)]) / w;
        let v = (h[(1, 0)] * p.x + h[(1, 1)] * p.y + h[(1, 2)]) / w;
        let (x, y, o) = (p.x / w, p.y / w, 1.0 / w);
        let ju = SVector::<f64, 8>::from([x, y, o, 0.0, 0.0, 0.0, -u * x, -u * y]);
        let jv = SVector::<f64, 8>::from([0.0, 0.0, 0.0, x, y, o, -v * x, -v * y]);
        normal += (ju * ju.transpose() + jv * jv.transpose()) * weight;
        right += (ju * (q.x - u) + jv * (q.y - v)) * weight;
    }
    let step = normal.cholesky()?.solve(&right);
    let h = Matrix3::new(
        h[(0, 0)] + step[0],
        h[(0, 1)] + step[1],
        h[(0, 2)] + step[2],
        h[(1, 0)] + step[3],
        h[(1, 1)] + step[4],
        h[(1, 2)] + step[5],
        h[(2, 0)] + step[6],
        h[(2, 1)] + step[7],
        1.0,
    );
    frame.to_pixels(&h)
}
