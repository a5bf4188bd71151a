//! Where rays meet the sheet, and the lattice coordinates there.

use crate::surface::Surface;

impl Surface {
    /// Everything about the sheet that does not change from ray to ray.
    pub(crate) fn chart(&self) -> Chart {
        let r = &self.rotation;
        let d = 0.5 * (std::f64::consts::FRAC_PI_2 - self.angle);
        let (sd, cd) = d.sin_cos();
        Chart {
            e1: [r[(0, 0)], r[(1, 0)], r[(2, 0)]],
            e2: [r[(0, 1)], r[(1, 1)], r[(2, 1)]],
            n: [r[(0, 2)], r[(1, 2)], r[(2, 2)]],
            z: self.depth,
            cd,
            sd,
            det: cd * cd - sd * sd,
            height: self.height,
            bending: self.bending,
            bent: self.height.iter().any(|c| *c != 0.0),
            per_side: [1.0 / self.sides[0], 1.0 / self.sides[1]],
            offset: self.offset,
            far: 240.0 * self.sides[0].max(self.sides[1]),
        }
    }
}

/// A [`Surface`] prepared for many rays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chart {
    e1: [f64; 3],
    e2: [f64; 3],
    n: [f64; 3],
    z: f64,
    cd: f64,
    sd: f64,
    det: f64,
    height: [f64; 12],
    bending: [f64; 2],
    bent: bool,
    per_side: [f64; 2],
    offset: [f64; 2],
    far: f64,
}

/// Lattice coordinates, cells, and depth, m, of the sheet along a ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Point {
    pub s: [f64; 2],
    pub depth: f64,
}

impl Chart {
    /// Height and its gradient at `(x, y)` of the tangent plane.
    #[inline]
    pub(crate) fn height(&self, x: f64, y: f64) -> (f64, f64, f64) {
        let c = &self.height;
        let (x2, y2, xy) = (x * x, y * y, x * y);
        let h = 0.5 * c[0] * x2
            + c[1] * xy
            + 0.5 * c[2] * y2
            + x2 * (c[3] * x + c[4] * y)
            + y2 * (c[5] * x + c[6] * y)
            + x2 * (c[7] * x2 + c[8] * xy + c[9] * y2)
            + y2 * (c[10] * xy + c[11] * y2);
        let (hx, hy) = self.slope(x, y);
        (h, hx, hy)
    }

    #[inline]
    fn slope(&self, x: f64, y: f64) -> (f64, f64) {
        let c = &self.height;
        let (x2, y2, xy) = (x * x, y * y, x * y);
        let hx = c[0] * x
            + c[1] * y
            + 3.0 * c[3] * x2
            + 2.0 * c[4] * xy
            + c[5] * y2
            + 4.0 * c[7] * x2 * x
            + 3.0 * c[8] * x2 * y
            + 2.0 * c[9] * x * y2
            + c[10] * y2 * y;
        let hy = c[1] * x
            + c[2] * y
            + c[4] * x2
            + 2.0 * c[5] * xy
            + 3.0 * c[6] * y2
            + c[8] * x2 * x
            + 2.0 * c[9] * x2 * y
            + 3.0 * c[10] * x * y2
            + 4.0 * c[11] * y2 * y;
        (hx, hy)
    }

    /// Where the ray `(x, y, 1)` meets the sheet. `None` where it is edge-on, behind or too far to be resolved.
    #[inline]
    pub(crate) fn at(&self, x: f64, y: f64) -> Option<Point> {
        self.at_from(x, y, None)
    }

    /// The same with a depth to start from, for sheets that differ little.
    #[inline]
    pub(crate) fn at_from(&self, x: f64, y: f64, start: Option<f64>) -> Option<Point> {
        let nd = self.n[0] * x + self.n[1] * y + self.n[2];
        if nd < 0.06 {
            return None;
        }
        let znz = self.z * self.n[2];
        let mut depth = znz / nd;
        if depth > self.far {
            return None;
        }
        let a1 = self.e1[0] * x + self.e1[1] * y + self.e1[2];
        let a2 = self.e2[0] * x + self.e2[1] * y + self.e2[2];
        let (b1, b2) = (self.e1[2] * self.z, self.e2[2] * self.z);
        if self.bent {
            depth = start.unwrap_or(depth);
            for _ in 0..4 {
                let (h, hx, hy) = self.height(a1 * depth - b1, a2 * depth - b2);
                let slope = nd - hx * a1 - hy * a2;
                // The sheet turns edge-on, or is out of this world.
                if !(slope >= 0.25 * nd && h.is_finite()) {
                    return None;
                }
                let step = (depth * nd - znz - h) / slope;
                depth -= step.clamp(-0.3 * depth, 0.3 * depth);
                if step.abs() < 1e-7 * depth {
                    break;
                }
            }
            if !(depth < self.far && depth > 0.05 * self.z) {
                return None;
            }
        }
        Some(Point { s: self.lattice(a1 * depth - b1, a2 * depth - b2), depth })
    }

    /// Lattice coordinates of the point above `(x, y)` of the tangent plane.
    #[inline]
    pub(crate) fn lattice(&self, x: f64, y: f64) -> [f64; 2] {
        let (cd, sd, per_det) = (self.cd, self.sd, 1.0 / self.det);
        let s1 = (cd * x - sd * y) * per_det;
        let s2 = (cd * y - sd * x) * per_det;
        let mut w1 = 0.5 * self.bending[0] * s2 * s2;
        let mut w2 = 0.5 * self.bending[1] * s1 * s1;
        if self.bent {
            // Inextensible twine: the sheet is drawn in by half the squared slope along each twine, integrated from the axis (3-point Gauss).
            const GAUSS: [(f64, f64); 3] =
                [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
            for (t, weight) in GAUSS {
                let (p, q) = (t * s1, s2);
                let (hx, hy) = self.slope(cd * p + sd * q, sd * p + cd * q);
                let e = cd * hx + sd * hy;
                w1 -= 0.5 * s1 * weight * e * e;
                let (p, q) = (s1, t * s2);
                let (hx, hy) = self.slope(cd * p + sd * q, sd * p + cd * q);
                let e = sd * hx + cd * hy;
                w2 -= 0.5 * s2 * weight * e * e;
            }
        }
        let x = x - (cd * w1 - sd * w2) * per_det;
        let y = y - (cd * w2 - sd * w1) * per_det;
        [
            (cd * x - sd * y) * per_det * self.per_side[0] + self.offset[0],
            (cd * y - sd * x) * per_det * self.per_side[1] + self.offset[1],
        ]
    }
}
