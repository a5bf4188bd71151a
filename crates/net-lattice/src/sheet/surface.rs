//! The sheet: state, and the map from a ray to lattice coordinates.
//!
//! Tangent frame at the optical axis: columns `e1, e2, n` of `rotation`, touching the sheet at `(0, 0, depth)`. Above the tangent plane
//! the sheet rises by a polynomial `h(X, Y)` without constant and linear part, so depth and normal *are* the answer on the axis. The two
//! families of twine cross at `angle` on the axis, symmetric about `e1 + e2`: with `d = (pi/2 - angle) / 2` they run along
//! `(cos d, sin d)` and `(sin d, cos d)`. Twine does not stretch: lattice coordinates are arc lengths (a Chebyshev net), to second order in the slope.

use net_geometry::nalgebra::{Matrix3, Rotation3, Vector3};

use crate::config::Config;
use crate::sheet::relief::Relief;

/// Number of parameters of the fullest model: rotation 3, log depth, offsets 2, crossing angle, height 12, thread bending 2.
pub(crate) const PARAMETERS: usize = 21;
/// The first of those that are the sheet's shape: height and thread bending.
pub(crate) const SHAPE: usize = 7;
/// How many of the height's terms are its second derivatives, the first ones.
pub(crate) const QUADRATIC: usize = 3;
/// A step, or a prior's standard deviations, in that order.
pub(crate) type Params = [f64; PARAMETERS];

/// Exponents of the height polynomial's terms; the pure squares carry a factor 1/2, so that they are curvatures.
pub(crate) const TERMS: [(i32, i32); 12] =
    [(2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4)];

/// A hung net: where its tangent plane is, how its lattice lies in it, how it bends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Columns: tangent axes `e1`, `e2` and unit normal (positive z), in the camera frame.
    pub(crate) rotation: Matrix3<f64>,
    /// Depth on the optical axis, m.
    pub(crate) depth: f64,
    /// Lattice coordinates where the optical axis meets the sheet, cells.
    pub(crate) offset: [f64; 2],
    /// Angle from the first family of twine to the second, rad.
    pub(crate) angle: f64,
    /// Height coefficients in the order of [`TERMS`], metres to the matching power.
    pub(crate) height: [f64; 12],
    /// Bumps above that.
    pub(crate) relief: Option<Relief>,
    /// Curvature of the twines within the sheet, 1/m.
    pub(crate) bending: [f64; 2],
    /// Side lengths along the two families, m.
    pub(crate) sides: [f64; 2],
}

impl Surface {
    /// Unit vectors along the two families of twines on the axis, camera frame.
    pub(crate) fn twines(&self) -> [Vector3<f64>; 2] {
        let (sine, cosine) = f64::sin_cos(0.5 * (std::f64::consts::FRAC_PI_2 - self.angle));
        [Vector3::new(cosine, sine, 0.0), Vector3::new(sine, cosine, 0.0)].map(|way| self.rotation * way)
    }

    /// A flat sheet whose nodes are at whole coordinates on the axis.
    pub(crate) fn flat(rotation: Matrix3<f64>, depth: f64, angle: f64, sides: [f64; 2]) -> Self {
        Self { rotation, depth, offset: [0.0; 2], angle, height: [0.0; 12], relief: None, bending: [0.0; 2], sides }
    }

    /// Unit normal of the tangent plane at the optical axis, camera frame.
    pub fn normal(&self) -> Vector3<f64> {
        self.rotation.column(2).into_owned()
    }

    /// Depth on the optical axis, m.
    pub fn range(&self) -> f64 {
        self.depth
    }

    /// The state after a step `d`: rotation from the left, depth in its logarithm, the rest added.
    pub(crate) fn stepped(&self, d: &Params) -> Self {
        let mut next = *self;
        let w = Vector3::new(d[0], d[1], d[2]);
        if w != Vector3::zeros() {
            next.rotation = orthonormal(&(Rotation3::new(w).into_inner() * self.rotation));
        }
        next.depth *= d[3].exp();
        next.offset[0] += d[4];
        next.offset[1] += d[5];
        next.angle += d[6];
        for (c, d) in next.height.iter_mut().zip(&d[7..19]) {
            *c += d;
        }
        next.bending[0] += d[19];
        next.bending[1] += d[20];
        next
    }

    /// Whether nothing rises above the tangent plane.
    pub(crate) fn is_flat(&self) -> bool {
        self.relief.is_none() && self.height.iter().all(|c| *c == 0.0)
    }

    /// Principal curvatures on the axis, 1/m, the larger magnitude first, and their unit directions in the tangent frame. The normal points away from the camera, so a positive one bends away.
    pub(crate) fn principal(&self) -> [(f64, [f64; 2]); 2] {
        let bumps = self.relief.map_or([0.0; QUADRATIC], |relief| relief.curvature());
        let [a, b, c] = std::array::from_fn(|k| self.height[k] + bumps[k]);
        let (mean, half) = (0.5 * (a + c), f64::hypot(0.5 * (a - c), b));
        let (y, x) = (0.5 * f64::atan2(2.0 * b, a - c)).sin_cos();
        let (upper, lower) = ((mean + half, [x, y]), (mean - half, [-y, x]));
        if upper.0.abs() >= lower.0.abs() { [upper, lower] } else { [lower, upper] }
    }

    /// The state without relief, with all parameters from `count` on at their prior mean.
    pub(crate) fn truncated(&self, count: usize, nominal_angle: f64) -> Self {
        let mut cut = Self { relief: None, ..*self };
        for k in 0..12 {
            if 7 + k >= count {
                cut.height[k] = 0.0;
            }
        }
        if count < PARAMETERS {
            cut.bending = [0.0; 2];
        }
        if count < 7 {
            cut.angle = nominal_angle;
        }
        cut
    }

    /// The parameters that have a prior, as deviations from its mean, in the order of a step.
    pub(crate) fn deviation(&self, nominal_angle: f64) -> Params {
        let mut p = [0.0; PARAMETERS];
        p[6] = self.angle - nominal_angle;
        p[7..19].copy_from_slice(&self.height);
        p[19..21].copy_from_slice(&self.bending);
        p
    }

    /// The same picture at another depth: everything grows with it.
    pub(crate) fn scaled(&self, m: f64) -> Self {
        let mut s = *self;
        s.depth *= m;
        for (c, (i, j)) in s.height.iter_mut().zip(TERMS) {
            *c /= m.powi(i + j - 1);
        }
        s.relief = s.relief.map(|relief| relief.scaled(m));
        s.bending[0] /= m;
        s.bending[1] /= m;
        s
    }

    /// The same sheet from a camera that moved: `new = turn * old + shift` maps camera coordinates. Touches the sheet where the new axis
    /// meets it; lattice coordinates go on counting. Exact for a plane, to first order in the slope for the bend. `None` if the axis misses.
    pub(crate) fn seen_from(&self, turn: &Matrix3<f64>, shift: &Vector3<f64>) -> Option<Self> {
        let chart = self.chart();
        let direction = turn.transpose() * Vector3::z();
        let start = -(turn.transpose() * shift) - Vector3::new(0.0, 0.0, self.depth);
        let local = |v: &Vector3<f64>| self.rotation.transpose() * v;
        let (o, d) = (local(&start), local(&direction));
        if d.z < 0.05 {
            return None;
        }
        let mut depth = -o.z / d.z;
        for _ in 0..6 {
            let p = o + d * depth;
            let (h, hx, hy) = chart.height(p.x, p.y);
            let slope = d.z - hx * d.x - hy * d.y;
            if slope < 0.25 * d.z {
                return None;
            }
            depth -= (p.z - h) / slope;
        }
        if !(depth.is_finite() && depth > 0.0) {
            return None;
        }
        let p = o + d * depth;
        let (_, hx, hy) = chart.height(p.x, p.y);
        let normal = Vector3::new(-hx, -hy, 1.0).normalize();
        let e1 = (Vector3::x() - normal * normal.x).normalize();
        let frame = Matrix3::from_columns(&[e1, normal.cross(&e1), normal]);
        let mut moved = *self;
        moved.rotation = orthonormal(&(turn * self.rotation * frame));
        moved.depth = depth;
        moved.offset = chart.lattice(p.x, p.y);
        moved.height = self.height_about(p.x, p.y);
        moved.relief = self.relief.map(|relief| relief.about([p.x, p.y], chart.arcs(p.x, p.y)));
        (moved.rotation[(2, 2)] > 0.1).then_some(moved)
    }

    /// Height coefficients about another point of the tangent plane, without the constant and the linear part.
    fn height_about(&self, x: f64, y: f64) -> [f64; 12] {
        let choose = |n: i32, k: i32| (0..k).fold(1.0, |c, i| c * f64::from(n - i) / f64::from(i + 1));
        let half = |i: i32, j: i32| if i == 2 && j == 0 || i == 0 && j == 2 { 0.5 } else { 1.0 };
        std::array::from_fn(|t| {
            let (k, l) = TERMS[t];
            let mut sum = 0.0;
            for ((i, j), c) in TERMS.into_iter().zip(self.height) {
                if i >= k && j >= l {
                    sum += c * half(i, j) * choose(i, k) * choose(j, l) * x.powi(i - k) * y.powi(j - l);
                }
            }
            sum / half(k, l)
        })
    }
}

/// The rotation nearest to one that rounding has bent, to first order (Gram-Schmidt from the normal). Over a sequence, where each pose
/// is made from the two before, the bend would grow threefold a frame.
fn orthonormal(m: &Matrix3<f64>) -> Matrix3<f64> {
    let n = m.column(2).normalize();
    let e1 = (m.column(0) - n * n.dot(&m.column(0))).normalize();
    Matrix3::from_columns(&[e1, n.cross(&e1), n])
}

/// Standard deviations of the prior, infinite where there is none. Zero fixes a parameter.
pub(crate) fn prior(config: &Config) -> Params {
    // (2n-1)!! and n! for n = 0..4
    let double = |n: i32| [1.0, 1.0, 3.0, 15.0, 105.0][n.clamp(0, 4) as usize];
    let factorial = |n: i32| [1.0, 1.0, 2.0, 6.0, 24.0][n.clamp(0, 4) as usize];
    let mut p = [f64::INFINITY; PARAMETERS];
    p[6] = config.crossing_angle_sigma_deg.to_radians();
    for (k, (i, j)) in TERMS.into_iter().enumerate() {
        let sd = config.height_sigma_m * f64::sqrt(double(i) * double(j))
            / (config.height_length_m.powi(i + j) * factorial(i) * factorial(j));
        p[7 + k] = if k == 0 || k == 2 { 2.0 * sd } else { sd };
    }
    p[19] = config.thread_bending_sigma_per_m;
    p[20] = config.thread_bending_sigma_per_m;
    p
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent() -> Surface {
        let rotation =
            Rotation3::new(Vector3::new(0.3, -0.2, 0.0)) * Rotation3::from_axis_angle(&Vector3::z_axis(), 0.2);
        let mut s = Surface::flat(rotation.into_inner(), 0.8, 80f64.to_radians(), [0.05, 0.05]);
        s.offset = [0.3, -0.2];
        s.height[0] = 0.3;
        s.height[1] = -0.1;
        s.height[4] = 0.2;
        s.height[9] = -0.3;
        s.bending = [0.1, -0.05];
        s
    }

    #[test]
    fn slopes_are_those_of_the_coordinates() {
        let sheet = bent();
        let turned = |d: [f64; PARAMETERS]| sheet.stepped(&d).chart();
        let one = |k: usize, step: f64| std::array::from_fn(|i| if i == k { step } else { 0.0 });
        let (chart, wider) = (sheet.chart(), turned(one(6, 1e-5)));
        for ray in [[0.02, -0.01], [0.5, 0.3], [-0.6, 0.35]] {
            let p = chart.at(ray[0], ray[1]).expect("in view");
            let slopes = chart.slopes(ray, &p, &wider, 1e-5);
            for k in 0..PARAMETERS {
                let at = |step: f64| turned(one(k, step)).at(ray[0], ray[1]).expect("in view").s;
                let (up, down) = (at(1e-4), at(-1e-4));
                for f in 0..2 {
                    let difference = (up[f] - down[f]) / 2e-4;
                    // Newton stops at 1e-7 of the depth: 2e-6 cells over 2e-4.
                    let off = slopes[f][k] - difference;
                    assert!(off.abs() < 0.01 + 1e-3 * difference.abs(), "{k} {f}: {off} of {difference}");
                }
            }
        }
    }

    #[test]
    fn a_sheet_that_is_followed_stays_a_rotation() {
        // Each prediction carries the turn between the last two on: without care, rounding grows threefold a frame.
        let (mut before, mut s) = (bent(), bent());
        s = s
            .seen_from(&Rotation3::new(Vector3::new(1e-3, -2e-3, 5e-4)).into_inner(), &Vector3::zeros())
            .expect("in view");
        for _ in 0..100 {
            let turn = s.rotation * before.rotation.transpose();
            let back = turn.transpose() * Rotation3::new(Vector3::new(1e-4, 0.0, -1e-4)).into_inner();
            before = s;
            s = s
                .seen_from(&turn, &Vector3::zeros())
                .and_then(|s| s.seen_from(&back, &Vector3::zeros()))
                .expect("in view");
        }
        // some hundred roundings of 1e-16
        assert!((s.rotation * s.rotation.transpose() - Matrix3::identity()).amax() < 1e-13);
    }

    #[test]
    fn a_flat_sheet_is_its_plane() {
        let s = Surface { height: [0.0; 12], bending: [0.0; 2], ..bent() };
        let p = s.chart().at(0.2, -0.1).expect("in view");
        let ray = Vector3::new(0.2, -0.1, 1.0);
        let n = s.normal();
        let depth = n.z * s.depth / n.dot(&ray);
        // closed form: rounding only
        assert!((p.depth - depth).abs() < 1e-12);
        let d = ray * depth - Vector3::new(0.0, 0.0, s.depth);
        let half = 0.5 * (std::f64::consts::FRAC_PI_2 - s.angle);
        let (e1, e2) = (s.rotation.column(0), s.rotation.column(1));
        let a1 = (e1 * half.cos() + e2 * half.sin()) * 0.05;
        let a2 = (e1 * half.sin() + e2 * half.cos()) * 0.05;
        let back = a1 * (p.s[0] - s.offset[0]) + a2 * (p.s[1] - s.offset[1]);
        assert!((back - d).norm() < 1e-12, "{back} {d}");
    }

    #[test]
    fn rays_meet_the_bent_sheet_and_twine_keeps_its_length() {
        let s = bent();
        let chart = s.chart();
        let space = |x: f64, y: f64| Vector3::new(x, y, 1.0) * chart.at(x, y).expect("in view").depth;
        for (x, y) in [(0.0, 0.0), (0.3, 0.2), (-0.3, 0.25)] {
            let local = s.rotation.transpose() * (space(x, y) - Vector3::new(0.0, 0.0, s.depth));
            // Newton stops at 1e-9 of the depth
            assert!((local.z - chart.height(local.x, local.y).0).abs() < 1e-8);
            // Length of a step along each family, in cells against metres, with coordinates inverted numerically.
            let h = 1e-5;
            let at = |x, y| chart.at(x, y).expect("in view").s;
            let (p, px, py) = (at(x, y), at(x + h, y), at(x, y + h));
            let j = net_geometry::nalgebra::Matrix2::new(px[0] - p[0], py[0] - p[0], px[1] - p[1], py[1] - p[1]) / h;
            let inverse = j.try_inverse().expect("regular");
            for f in 0..2 {
                let step = inverse.column(f) * h;
                let length = (space(x + step[0], y + step[1]) - space(x, y)).norm() / (h * 0.05);
                // inextensible to second order in the slope: slopes here reach 0.15, what is left is their fourth power and threads bent by 0.1 / m over 0.3 m
                assert!((length - 1.0).abs() < 4e-3, "family {f} at {x} {y}: {length}");
            }
        }
    }

    #[test]
    fn moving_the_camera_keeps_the_lattice() {
        let s = bent();
        let turn = Rotation3::new(Vector3::new(0.02, -0.03, 0.05)).into_inner();
        let shift = Vector3::new(0.03, -0.02, 0.04);
        let moved = s.seen_from(&turn, &shift).expect("in view");
        for (x, y) in [(0.0, 0.0), (0.2, -0.15), (-0.25, 0.2)] {
            let p = s.chart().at(x, y).expect("in view");
            let q = turn * (Vector3::new(x, y, 1.0) * p.depth) + shift;
            let r = moved.chart().at(q.x / q.z, q.y / q.z).expect("in view");
            // the bend is carried to first order in the slope (0.02 here): a few hundredths of a cell at the rim, far below half a cell
            let e = (r.s[0] - p.s[0]).hypot(r.s[1] - p.s[1]);
            assert!(e < 0.05 && (r.depth - q.z).abs() < 2e-3, "{x} {y}: {e} cells, depth {} {}", r.depth, q.z);
        }
        let still = s.seen_from(&Matrix3::identity(), &Vector3::zeros()).expect("in view");
        assert!((still.depth - s.depth).abs() < 1e-9 && (still.rotation - s.rotation).norm() < 1e-9);
    }
}
