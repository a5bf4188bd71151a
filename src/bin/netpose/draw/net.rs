//! The net as its pose says it hangs, drawn over the picture: where lines and twine part, the pose is wrong.

use std::ops::RangeInclusive;

use net_geometry::nalgebra::{Matrix2, Vector2, Vector3};
use net_log::Knots;
use netpose::{Camera, Junction, JunctionState, Mesh, Pose, Twine, TwineState};

use super::canvas::{Canvas, Colour};

const LINE: Colour = [60, 220, 255];
const JUNCTION: Colour = [255, 190, 40];
const MISSING: Colour = [255, 40, 40];
const HIDDEN: Colour = [150, 150, 160];
const FOULED: Colour = [70, 210, 70];
const AXES: [Colour; 3] = [[255, 70, 70], [70, 230, 70], [90, 130, 255]];

/// Lattice lines drawn at most on each side of the origin; past it the picture would be nothing but lines.
const MOST_LINES: f64 = 400.0;
/// Cells smaller than this, px, are drawn every second, fourth, ... line.
const LEAST_GAP_PX: f64 = 7.0;

/// Dashes of twine that looks gone but may not be.
const DASHES: usize = 3;

/// How each state of a twine is drawn: colour, width in px, opacity, and in how many strokes.
fn stroke(state: TwineState) -> (Colour, f64, f64, usize) {
    match state {
        TwineState::Present => (LINE, 1.0, 0.6, 1),
        TwineState::Unknown => (LINE, 1.0, 0.25, 1),
        TwineState::Missing => (MISSING, 2.0, 0.9, 1),
        TwineState::Doubtful => (MISSING, 2.0, 0.9, DASHES),
        TwineState::Hidden => (HIDDEN, 1.0, 0.7, 1),
        TwineState::Fouled => (FOULED, 2.0, 0.7, 1),
    }
}

/// Draws the twine between junctions that have a name, each in the colour of its state: follows a bent net, which no plane does. False if none has a name.
pub fn draw_twine(canvas: &mut Canvas, junctions: &[Junction], twines: &[Twine]) -> bool {
    let knots = Knots::new(junctions);
    let mut line = |twine: &Twine| {
        if let Some([from, to]) = knots.ends(twine) {
            let (colour, width, opacity, dashes) = stroke(twine.state);
            // As wide as the gaps between them, with a dash at either end.
            let part = (to - from) / (2 * dashes - 1) as f64;
            for dash in 0..dashes {
                let start = from + part * (2 * dash) as f64;
                canvas.line(start, start + part, width, colour, opacity);
            }
        }
    };
    // In the order of lists: a map's own order differs from run to run, and so would the overlapping strokes.
    if twines.is_empty() {
        let state = TwineState::Present;
        for index in junctions.iter().filter_map(|junction| junction.index) {
            (0..2).for_each(|direction| {
                line(&Twine { index, direction, state, llr: 0.0, contrast: 0.0, width_px: None })
            });
        }
    } else {
        twines.iter().for_each(line);
    }
    !knots.is_empty()
}

/// Draws the lattice lines.
pub fn draw_lattice(canvas: &mut Canvas, camera: &Camera, mesh: &Mesh, pose: &Pose) {
    NetView { camera, mesh, pose }.lines(canvas);
}

/// Draws the axes of the net frame, two cells long: X red, Y green, Z (away from the camera) blue. Where the origin is out of view,
/// they stand on the node nearest to the optical axis.
pub fn draw_axes(canvas: &mut Canvas, camera: &Camera, mesh: &Mesh, pose: &Pose) {
    NetView { camera, mesh, pose }.axes(canvas);
}

/// A mark for a junction: a ring where it was seen, a cross where it is known to be but not seen, in the colour of what is amiss.
pub fn draw_junction(canvas: &mut Canvas, junction: &Junction) {
    let p = junction.pixel;
    if junction.state == JunctionState::Seen {
        canvas.ring(p, 3.0, 1.2, JUNCTION, 0.9);
        return;
    }
    for d in [Vector2::new(3.0, 3.0), Vector2::new(3.0, -3.0)] {
        let colour = match junction.state {
            JunctionState::Missing => MISSING,
            JunctionState::Hidden => HIDDEN,
            JunctionState::Fouled => FOULED,
            _ => JUNCTION,
        };
        canvas.line(p - d, p + d, 1.2, colour, 0.8);
    }
}

/// The net seen by the camera.
struct NetView<'a> {
    camera: &'a Camera,
    mesh: &'a Mesh,
    pose: &'a Pose,
}

impl NetView<'_> {
    fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>> {
        let node = self.mesh.node(i, j);
        self.camera.pixel_from_point(self.pose.transform(Vector3::new(node.x, node.y, 0.0)))
    }

    /// Ranges of lattice indices `(i, j)` that the picture shows, from rays through its border.
    fn indices_in_view(&self) -> Option<(RangeInclusive<i64>, RangeInclusive<i64>)> {
        const STEPS: u32 = 16;
        let (w, h) = (f64::from(self.camera.width()), f64::from(self.camera.height()));
        let lattice_from_plane = Matrix2::from_columns(&[self.mesh.a1(), self.mesh.a2()]).try_inverse()?;
        let plane = self.pose.plane();
        let mut low = Vector2::repeat(f64::INFINITY);
        let mut high = -low;
        for k in 0..=STEPS {
            let s = f64::from(k) / f64::from(STEPS);
            for pixel in [(s * w, 0.0), (s * w, h), (0.0, s * h), (w, s * h)] {
                // A ray that does not meet the net leaves the rest of the border to say how far it goes.
                let Some(ray) = self.camera.ray_from_pixel(Vector2::new(pixel.0, pixel.1)) else { continue };
                let Some(depth) = plane.depth_along(ray) else { continue };
                let index = lattice_from_plane * self.pose.inverse_transform(ray * depth).xy();
                low = low.inf(&index);
                high = high.sup(&index);
            }
        }
        if !(low.x.is_finite() && low.y.is_finite()) {
            return None;
        }
        let range = |k: usize| {
            let (a, b) = (low[k].floor() - 1.0, high[k].ceil() + 1.0);
            a.max(-MOST_LINES) as i64..=b.min(MOST_LINES) as i64
        };
        Some((range(0), range(1)))
    }

    /// Every n-th line is drawn, so that lines stay apart where the optical axis meets the net.
    fn every(&self) -> i64 {
        let plane = self.pose.plane();
        let cell_px = plane.range().map_or(f64::INFINITY, |z| {
            self.camera.fx() * self.mesh.side1().min(self.mesh.side2()) * plane.normal.z / z
        });
        let mut every = 1;
        while cell_px * (every as f64) < LEAST_GAP_PX && every < 64 {
            every *= 2;
        }
        every
    }

    fn lines(&self, canvas: &mut Canvas) {
        let Some((is, js)) = self.indices_in_view() else { return };
        let every = self.every();
        for i in is.clone().filter(|i| i % every == 0) {
            self.polyline(canvas, js.clone().map(|j| (i as f64, j as f64)));
        }
        for j in js.filter(|j| j % every == 0) {
            self.polyline(canvas, is.clone().map(|i| (i as f64, j as f64)));
        }
    }

    /// Node to node: short enough to follow the bend of any lens.
    fn polyline(&self, canvas: &mut Canvas, nodes: impl Iterator<Item = (f64, f64)>) {
        let (w, h) = (canvas.width() as f64, canvas.height() as f64);
        let near = |p: &Vector2<f64>| (-w..2.0 * w).contains(&p.x) && (-h..2.0 * h).contains(&p.y);
        let mut last: Option<Vector2<f64>> = None;
        for (i, j) in nodes {
            let pixel = self.pixel(i, j).filter(near);
            if let (Some(a), Some(b)) = (last, pixel) {
                canvas.line(a, b, 1.0, LINE, 0.6);
            }
            last = pixel;
        }
    }

    fn axes(&self, canvas: &mut Canvas) {
        let plane = self.pose.plane();
        let Some(range) = plane.range() else { return };
        let Some(lattice_from_plane) = Matrix2::from_columns(&[self.mesh.a1(), self.mesh.a2()]).try_inverse() else {
            return;
        };
        let inside = |p: &Vector2<f64>| {
            (0.0..canvas.width() as f64).contains(&p.x) && (0.0..canvas.height() as f64).contains(&p.y)
        };
        let (i, j) = if self.pixel(0.0, 0.0).as_ref().is_some_and(inside) {
            (0.0, 0.0)
        } else {
            let on_axis = lattice_from_plane * self.pose.inverse_transform(Vector3::z() * range).xy();
            (on_axis.x.round(), on_axis.y.round())
        };
        let node = self.mesh.node(i, j);
        let origin = Vector3::new(node.x, node.y, 0.0);
        let length = 2.0 * self.mesh.side1().max(self.mesh.side2());
        let Some(from) = self.camera.pixel_from_point(self.pose.transform(origin)) else { return };
        for (k, colour) in AXES.into_iter().enumerate() {
            let mut end = origin;
            end[k] += length;
            if let Some(to) = self.camera.pixel_from_point(self.pose.transform(end)) {
                canvas.line(from, to, 3.0, colour, 1.0);
            }
        }
    }
}
