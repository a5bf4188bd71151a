//! Where rays meet the sheet, and the lattice coordinates there.

use crate::sheet::relief::{Relief, Row, Rows};
use crate::sheet::surface::{PARAMETERS, Params, SHAPE, Surface};

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
            relief: self.relief,
            bent: !self.is_flat(),
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
    relief: Option<Relief>,
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

/// Where a ray meets the sheet.
struct Meeting {
    /// The ray along both axes of the tangent plane, per depth.
    along: [f64; 2],
    /// Place in the tangent plane, m, and the sheet's slope there.
    at: [f64; 2],
    slope: [f64; 2],
    /// Lattice coordinates, cells, a step, m, further along x, and along y.
    step: f64,
    beside: [[f64; 2]; 2],
    /// How much farther along the ray, in depth, the sheet is met that is higher by so much.
    farther: f64,
}

/// Three-point Gauss: places of [0, 1] and their weights.
const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// The same with six points, for what bumps draw in.
const GAUSS_BUMPS: [(f64, f64); 6] = {
    const HALVES: [(f64, f64); 3] = [
        (0.238_619_186_083_196_9, 0.467_913_934_572_691),
        (0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
        (0.932_469_514_203_152, 0.171_324_492_379_170_3),
    ];
    let mut points = [(0.0, 0.0); 6];
    let mut k = 0;
    while k < 3 {
        let (place, weight) = HALVES[k];
        points[k] = (0.5 - 0.5 * place, 0.5 * weight);
        points[k + 3] = (0.5 + 0.5 * place, 0.5 * weight);
        k += 1;
    }
    points
};

/// The height polynomial's terms at a point, in the order of [`crate::sheet::surface::TERMS`].
fn terms(x: f64, y: f64) -> [f64; 12] {
    let (x2, y2, xy) = (x * x, y * y, x * y);
    [0.5 * x2, xy, 0.5 * y2, x2 * x, x2 * y, x * y2, y2 * y, x2 * x2, x2 * xy, x2 * y2, xy * y2, y2 * y2]
}

/// Their derivatives by x, and by y.
fn terms_slope(x: f64, y: f64) -> ([f64; 12], [f64; 12]) {
    let (x2, y2, xy) = (x * x, y * y, x * y);
    (
        [x, y, 0.0, 3.0 * x2, 2.0 * xy, y2, 0.0, 4.0 * x2 * x, 3.0 * x2 * y, 2.0 * x * y2, y2 * y, 0.0],
        [0.0, x, y, 0.0, x2, 2.0 * xy, 3.0 * y2, 0.0, x2 * x, 2.0 * x2 * y, 3.0 * x * y2, 4.0 * y2 * y],
    )
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
        let (hx, hy) = self.polynomial_slope(x, y);
        match &self.relief {
            None => (h, hx, hy),
            Some(relief) => {
                let [r, rx, ry] = relief.at(x, y);
                (h + r, hx + rx, hy + ry)
            }
        }
    }

    #[inline]
    fn slope(&self, x: f64, y: f64) -> (f64, f64) {
        let (hx, hy) = self.polynomial_slope(x, y);
        self.relief.as_ref().map_or((hx, hy), |relief| {
            let [_, rx, ry] = relief.at(x, y);
            (hx + rx, hy + ry)
        })
    }

    /// Places along a twine from the axis, parts of the way, at which its slope is looked at, and their weights.
    #[inline]
    fn quadrature(&self) -> &'static [(f64, f64)] {
        if self.relief.is_some() { &GAUSS_BUMPS } else { &GAUSS }
    }

    #[inline]
    fn polynomial_slope(&self, x: f64, y: f64) -> (f64, f64) {
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

    /// Where a ray meets the sheet at this depth, m, and what its derivatives are made of.
    fn meeting(&self, ray: [f64; 2], depth: f64) -> Meeting {
        let d = [ray[0], ray[1], 1.0];
        let along = |axis: &[f64; 3]| axis[0] * d[0] + axis[1] * d[1] + axis[2] * d[2];
        let (a1, a2, z) = (along(&self.e1), along(&self.e2), self.z);
        let (x, y) = (a1 * depth - self.e1[2] * z, a2 * depth - self.e2[2] * z);
        let (hx, hy) = self.slope(x, y);
        let step = 1e-6 * depth;
        let beside = [self.lattice(x + step, y), self.lattice(x, y + step)];
        let farther = 1.0 / (along(&self.n) - hx * a1 - hy * a2);
        Meeting { along: [a1, a2], at: [x, y], slope: [hx, hy], step, beside, farther }
    }

    /// Derivatives of the coordinates of a point that a ray meets by all parameters, in their order. `wider`: the same sheet with its crossing angle larger by
    /// `step`.
    pub(crate) fn slopes(&self, ray: [f64; 2], point: &Point, wider: &Self, step: f64) -> [Params; 2] {
        let (d, depth, z) = ([ray[0], ray[1], 1.0], point.depth, self.z);
        let Meeting { along: [a1, a2], at: [x, y], slope: [hx, hy], step: h, beside: [right, below], farther } =
            self.meeting(ray, depth);
        // Coordinates by the place in the tangent plane.
        let by_place: [[f64; 2]; 2] = std::array::from_fn(|f| [right, below].map(|s| (s[f] - point.s[f]) / h));
        let mut out = [[0.0; PARAMETERS]; 2];
        let mut set = |k: usize, rise: f64, dx: f64, dy: f64| {
            // Both lie in the tangent plane; the sheet is higher there than the point by `rise`.
            let deeper = (rise + hx * dx + hy * dy) * farther;
            for (out, by) in out.iter_mut().zip(&by_place) {
                out[k] = by[0] * (dx + a1 * deeper) + by[1] * (dy + a2 * deeper);
            }
        };
        // A turn moves what is fixed to the sheet's axes: the point less where the axis meets the sheet.
        let p = [d[0] * depth, d[1] * depth, depth - z];
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let turned = |axis: &[f64; 3]| axis[i] * p[j] - axis[j] * p[i];
            set(k, -turned(&self.n), turned(&self.e1), turned(&self.e2));
        }
        set(3, self.n[2] * z, -self.e1[2] * z, -self.e2[2] * z);
        for (k, term) in terms(x, y).into_iter().enumerate() {
            set(SHAPE + k, term, 0.0, 0.0);
        }
        (out[0][4], out[1][5]) = (1.0, 1.0);
        let turned = wider.lattice(x, y);
        (0..2).for_each(|f| out[f][6] = (turned[f] - point.s[f]) / step);
        self.draw_in(x, y, &mut out);
        out
    }

    /// Adds to the derivatives what the shape does to the coordinates of a fixed place: see `lattice`.
    fn draw_in(&self, x: f64, y: f64, out: &mut [Params; 2]) {
        let (cd, sd) = (self.cd, self.sd);
        let (s1, s2) = ((cd * x - sd * y) / self.det, (cd * y - sd * x) / self.det);
        let mut w = [[0.0; PARAMETERS - SHAPE]; 2];
        (w[0][12], w[1][13]) = (0.5 * s2 * s2, 0.5 * s1 * s1);
        if self.bent {
            for &(t, weight) in self.quadrature() {
                let [first, second] = [(t * s1, s2), (s1, t * s2)];
                let places = [(first, s1, (cd, sd)), (second, s2, (sd, cd))];
                for (w, ((p, q), length, (cx, cy))) in w.iter_mut().zip(places) {
                    let (x, y) = (cd * p + sd * q, sd * p + cd * q);
                    let (tx, ty) = terms_slope(x, y);
                    let rise: [f64; 12] = std::array::from_fn(|k| cx * tx[k] + cy * ty[k]);
                    let mut e: f64 = rise.iter().zip(&self.height).map(|(r, c)| r * c).sum();
                    if let Some(relief) = &self.relief {
                        let [_, rx, ry] = relief.at(x, y);
                        e += cx * rx + cy * ry;
                    }
                    w.iter_mut().zip(rise).for_each(|(w, r)| *w -= length * weight * e * r);
                }
            }
        }
        let (twice, per) = (2.0 * cd * sd, 1.0 / (self.det * self.det));
        for (f, out) in out.iter_mut().enumerate() {
            for (k, out) in out[SHAPE..].iter_mut().enumerate() {
                *out -= self.per_side[f] * per * (w[f][k] - twice * w[1 - f][k]);
            }
        }
    }

    /// Lengths along the two families to a place of the tangent plane, m.
    pub(crate) fn arcs(&self, x: f64, y: f64) -> [f64; 2] {
        [(self.cd * x - self.sd * y) / self.det, (self.cd * y - self.sd * x) / self.det]
    }

    /// Whether what describes bumps, if anything does, reaches as far as where a ray meets the sheet.
    pub(crate) fn described(&self, ray: [f64; 2], depth: f64) -> bool {
        let Some(relief) = &self.relief else { return true };
        let along = |axis: &[f64; 3]| (axis[0] * ray[0] + axis[1] * ray[1] + axis[2]) * depth - axis[2] * self.z;
        relief.covers(along(&self.e1), along(&self.e2))
    }

    /// Derivatives of the coordinates of a point that a ray meets by the relief's coefficients, into `rows`, which are zero.
    pub(crate) fn relief_slopes(&self, ray: [f64; 2], point: &Point, rows: &mut [Row; 2]) {
        let Some(relief) = &self.relief else { return };
        let Meeting { along: [a1, a2], at: [x, y], step: h, beside: [right, below], farther, .. } =
            self.meeting(ray, point.depth);
        let by = std::array::from_fn(|f| ((right[f] - point.s[f]) * a1 + (below[f] - point.s[f]) * a2) / h * farther);
        let mut rows = Rows::new(relief, rows);
        // Higher, the point is met farther along the ray, ..
        rows.add_height(x, y, by);
        // .. and both twines that lead to it, from threads that may stray, are longer.
        let (cd, sd) = (self.cd, self.sd);
        let [s1, s2] = self.arcs(x, y);
        let per = 1.0 / (self.det * self.det);
        let through = [[1.0, -2.0 * cd * sd], [-2.0 * cd * sd, 1.0]];
        let by = |twine: usize, by: f64| std::array::from_fn(|f| self.per_side[f] * per * through[f][twine] * by);
        for (twine, s) in [s2, s1].into_iter().enumerate() {
            rows.add_aside(twine, s, by(twine, -1.0));
        }
        for &(t, weight) in self.quadrature() {
            let places = [((t * s1, s2), s1, [cd, sd]), ((s1, t * s2), s2, [sd, cd])];
            for (twine, ((p, q), length, way)) in places.into_iter().enumerate() {
                let (x, y) = (cd * p + sd * q, sd * p + cd * q);
                let (hx, hy) = self.slope(x, y);
                let drawn = length * weight * (way[0] * hx + way[1] * hy);
                rows.add_slope(x, y, way, by(twine, drawn));
            }
        }
        rows.settle();
    }

    /// Lattice coordinates of the point above `(x, y)` of the tangent plane.
    #[inline]
    pub(crate) fn lattice(&self, x: f64, y: f64) -> [f64; 2] {
        let (cd, sd, per_det) = (self.cd, self.sd, 1.0 / self.det);
        let s1 = (cd * x - sd * y) * per_det;
        let s2 = (cd * y - sd * x) * per_det;
        let mut w1 = 0.5 * self.bending[0] * s2 * s2;
        let mut w2 = 0.5 * self.bending[1] * s1 * s1;
        if let Some(relief) = &self.relief {
            w1 += relief.aside(0, s2);
            w2 += relief.aside(1, s1);
        }
        if self.bent {
            // Inextensible twine: the sheet is drawn in by half the squared slope along each twine, integrated from the axis (3-point Gauss).
            for &(t, weight) in self.quadrature() {
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
