//! From twine between two knots to strokes in the picture: where it runs, how wide and how bright it looks.

use nalgebra::{Vector2, Vector3};
use net_geometry::Lens;

use super::layer::Subject;
use super::stroke::{End, Stroke, Vertex};
use crate::net::damage::Edge;
use crate::net::lattice::Node;
use crate::random::{Addressed, Stream};

/// Longest piece of straight twine drawn in one, px: light and width are linear along it.
pub(super) const PIECE_PX: f64 = 32.0;
/// Longest piece of curved twine: a parabola follows it to 0.001 px through any lens that keeps a picture together.
const CURVED_PIECE_PX: f64 = 20.0;
/// Over the last quarter of the way to where they are out of sight twines fade, lest the net seem to end there.
const FADE: f64 = 0.25;

/// Cuts twine into strokes.
pub(super) struct Pieces<'a> {
    subject: &'a Subject<'a>,
    /// Whether straight lines stay straight, so that neighbouring meshes of a twine may be drawn in one.
    pub(super) straight: bool,
    /// Whether a stroke needs its middle looked up.
    curved: bool,
    slack: [Addressed; 2],
    brightness: Addressed,
}

impl<'a> Pieces<'a> {
    pub(super) fn of(subject: &'a Subject<'a>) -> Self {
        let net = subject.net;
        let bent_by_lens = *subject.medium.camera().lens() != Lens::None;
        Self {
            subject,
            straight: net.is_straight() && !bent_by_lens,
            curved: bent_by_lens || net.slack > 0.0,
            slack: [Addressed::new(net.seed, Stream::SlackIn), Addressed::new(net.seed, Stream::SlackOut)],
            brightness: Addressed::new(net.seed, Stream::TwineGrey),
        }
    }

    /// Appends the strokes of the twine from one node to another, which is (or begins at) `edge`.
    pub(super) fn push(&self, edge: Edge, from: &Node, to: &Node, strokes: &mut Vec<Stroke>) {
        let Subject { net, pose, medium, far_m, .. } = *self.subject;
        let camera = medium.camera();
        let chord = to.point - from.point;
        let length_px = (to.pixel - from.pixel).norm();
        let piece_px = if self.curved { CURVED_PIECE_PX } else { PIECE_PX };
        // Far outside the picture a piece is not worth cutting.
        let count = if length_px > 5000.0 { 1 } else { (length_px / piece_px).ceil().max(1.0) as usize };
        let (a, b, c) = edge.address(0);
        let bow = if net.slack > 0.0 {
            let across = pose.normal().cross(&chord);
            let [inward, outward] = self.slack.map(|s| net.slack * s.normal(a, b, c));
            across * inward + pose.normal() * (chord.norm() * outward)
        } else {
            Vector3::zeros()
        };
        let brightness = if net.twine.variation > 0.0 {
            (1.0 + net.twine.variation * self.brightness.normal(a, b, c)).clamp(0.2, 2.0)
        } else {
            1.0
        };
        let at = |t: f64| from.point + chord * t + bow * (4.0 * t * (1.0 - t));
        let vertex = |t: f64, node: Option<&Node>| {
            let point = node.map_or_else(|| at(t), |n| n.point);
            let pixel = node.map_or_else(|| camera.pixel_from_point(point), |n| Some(n.pixel))?;
            let direction = chord + bow * (4.0 - 8.0 * t);
            let fade = ((1.0 - point.norm() / far_m) / FADE).clamp(0.0, 1.0);
            let width_px = self.apparent_width(point, pixel, direction) * fade;
            let place = pose.inverse_transform(point).xy();
            let grey = medium.seen(net.twine.grey * brightness, point, pixel, place);
            Some(Vertex { pixel, width_px, grey })
        };
        let Some(mut start) = vertex(0.0, Some(from)) else { return };
        for k in 1..=count {
            let t = k as f64 / count as f64;
            let Some(end) = vertex(t, if k == count { Some(to) } else { None }) else { return };
            let bow_px = if self.curved { self.bow(at(t - 0.5 / count as f64), start.pixel, end.pixel) } else { 0.0 };
            let along = (end.pixel - start.pixel).try_normalize(1e-9).unwrap_or(Vector2::x());
            let shade = net.twine.shading * Vector2::new(-along.y, along.x).dot(&medium.towards_light());
            strokes.push(Stroke { from: start, to: end, bow_px, shade, start: End::Free, end: End::Free });
            start = end;
        }
    }

    /// How far the picture of `middle` lies off the chord, brought to the chord's middle by a parabola.
    fn bow(&self, middle: Vector3<f64>, from: Vector2<f64>, to: Vector2<f64>) -> f64 {
        let bow = || {
            let pixel = self.subject.medium.camera().pixel_from_point(middle)?;
            let chord = to - from;
            let along = chord.try_normalize(1e-9)?;
            let t = (pixel - from).dot(&along) / chord.norm();
            let bend = 4.0 * t * (1.0 - t);
            (bend > 0.2).then(|| along.perp(&(pixel - from)) / bend)
        };
        bow().unwrap_or(0.0)
    }

    /// Width in the picture, px, of a cylinder through `point`: its outline is where the line of sight touches it, half a diameter
    /// to either side of the axis, across both the twine and the line of sight.
    fn apparent_width(&self, point: Vector3<f64>, pixel: Vector2<f64>, direction: Vector3<f64>) -> f64 {
        let camera = self.subject.medium.camera();
        let width = || {
            let side = direction.cross(&point).try_normalize(1e-12)?;
            let radius = 0.5 * self.subject.net.twine.diameter_m;
            let edge = camera.pixel_from_point(point + side * radius)? - pixel;
            let step = direction.try_normalize(1e-12)? * (1e-3 * point.z);
            let ahead = (camera.pixel_from_point(point + step)? - pixel).try_normalize(1e-12)?;
            Some(2.0 * ahead.perp(&edge).abs())
        };
        width().unwrap_or(0.0)
    }
}
