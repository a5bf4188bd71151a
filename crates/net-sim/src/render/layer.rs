//! One net on the picture: twines of both directions as strokes, then knots and growth over them.

use nalgebra::{Vector2, Vector3};
use net_geometry::Pose;

use super::profile::{DiscSpread, EdgeSpread};
use super::spot::Spot;
use super::stroke::{End, Family, Stroke};
use super::twine::{PIECE_PX, Pieces};
use super::water::Medium;
use crate::net::damage::{Damage, Edge};
use crate::net::fabric::Fabric;
use crate::net::lattice::{Lattice, Node};
use crate::random::{Addressed, Stream};
use crate::scene::Net;

/// A net to be drawn, and where.
#[derive(Clone, Copy)]
pub(crate) struct Subject<'a> {
    pub(crate) net: &'a Net,
    pub(crate) fabric: &'a Fabric,
    pub(crate) lattice: &'a Lattice,
    pub(crate) pose: &'a Pose,
    pub(crate) medium: &'a Medium<'a>,
    /// Distance at which the net is out of sight, m.
    pub(crate) far_m: f64,
}

/// Draws nets onto pictures; owns what that takes.
#[derive(Debug)]
pub(crate) struct LayerPainter {
    edge: EdgeSpread,
    disc: DiscSpread,
    /// Twines along the first and along the second mesh direction.
    families: [Family; 2],
    /// The unbroken stretch of twine being drawn.
    stretch: Vec<Stroke>,
    /// Knots under growth, sorted.
    fouled: Vec<(i32, i32)>,
}

impl LayerPainter {
    pub(crate) fn new() -> Self {
        Self {
            edge: EdgeSpread::new(),
            disc: DiscSpread::new(),
            families: Default::default(),
            stretch: Vec::new(),
            fouled: Vec::new(),
        }
    }

    pub(crate) fn edge(&self) -> &EdgeSpread {
        &self.edge
    }

    pub(crate) fn disc(&self) -> &DiscSpread {
        &self.disc
    }

    /// Whether growth covers knot `index` of the net drawn last.
    pub(crate) fn is_fouled(&self, index: (i32, i32)) -> bool {
        self.fouled.binary_search(&index).is_ok()
    }

    /// Share of the pixel nearest to `p` that twines of the net drawn last cover.
    pub(crate) fn cover(&self, p: Vector2<f64>) -> f32 {
        1.0 - self.families.iter().map(|f| 1.0 - f.at(p).min(1.0)).product::<f32>()
    }

    /// Draws a net over what `picture` shows.
    pub(crate) fn paint(&mut self, subject: &Subject, picture: &mut [f32]) {
        let camera = subject.medium.camera();
        for family in &mut self.families {
            family.clear(camera.width() as usize, camera.height() as usize);
        }
        let (first_row, last_row) = subject.lattice.row_range();
        let (first_column, last_column) = subject.lattice.column_range();
        for j in first_row..=last_row {
            self.follow(subject, 0, (first_column..=last_column).map(|i| (i, j)));
        }
        for i in first_column..=last_column {
            self.follow(subject, 1, (first_row..=last_row).map(|j| (i, j)));
        }
        let [first, second] = &self.families;
        let twines = first.coverage.iter().zip(&first.light).zip(second.coverage.iter().zip(&second.light));
        for (out, ((&c1, &l1), (&c2, &l2))) in picture.iter_mut().zip(twines) {
            let sum = c1 + c2;
            if sum > 0.0 {
                // The blurred union of two strips that cross at right angles.
                let cover = 1.0 - (1.0 - c1.min(1.0)) * (1.0 - c2.min(1.0));
                *out += cover * ((l1 + l2) / sum - *out);
            }
        }
        if subject.net.twine.knot > 1.0 {
            self.knots(subject, picture);
        }
        self.fouled.clear();
        if subject.net.growth.density > 0.0 {
            self.growth(subject, picture);
        }
    }

    /// Draws one twine through these knots; it is interrupted where it is broken or where there is none.
    fn follow(&mut self, subject: &Subject, family: usize, knots: impl Iterator<Item = (i32, i32)>) {
        let damage = Damage::of(subject.net);
        let pieces = Pieces::of(subject);
        // Straight twine is drawn several meshes at a time: from this knot.
        let mut anchor: Option<&Node> = None;
        let mut last: Option<((i32, i32), &Node)> = None;
        self.stretch.clear();
        for index in knots.map(Some).chain(std::iter::once(None)) {
            let node = index.and_then(|(i, j)| Some(((i, j), subject.lattice.node(i, j)?)));
            let Some(((from_index, from), to)) = last.map(|l| (l, node)) else {
                last = node;
                anchor = node.map(|n| n.1);
                continue;
            };
            let edge = Edge { i: from_index.0, j: from_index.1, family };
            let Some((_, to)) = to else {
                self.end_stretch(subject, family, anchor, from, edge, &pieces);
                (last, anchor) = (None, None);
                continue;
            };
            if damage.broken(edge) {
                self.end_stretch(subject, family, anchor, from, edge, &pieces);
                self.stubs(subject, edge, [from, to], &damage);
                anchor = Some(to);
            } else if pieces.straight {
                if let Some(start) = anchor.filter(|a| (to.pixel - a.pixel).norm() > PIECE_PX) {
                    if !std::ptr::eq(start, from) {
                        pieces.push(edge, start, from, &mut self.stretch);
                    }
                    anchor = Some(from);
                }
            } else {
                pieces.push(edge, from, to, &mut self.stretch);
                anchor = Some(to);
            }
            last = node;
        }
    }

    /// Draws the collected stretch, which ends at `to`.
    fn end_stretch(
        &mut self,
        subject: &Subject,
        family: usize,
        anchor: Option<&Node>,
        to: &Node,
        edge: Edge,
        pieces: &Pieces,
    ) {
        if let Some(start) = anchor.filter(|a| !std::ptr::eq(*a, to)) {
            pieces.push(edge, start, to, &mut self.stretch);
        }
        let strokes = &mut self.stretch;
        for k in 1..strokes.len() {
            let (back, ahead) = (strokes[k - 1].tangents()[1], strokes[k].tangents()[0]);
            let cut = End::Joint((back + ahead).try_normalize(1e-9).unwrap_or(ahead));
            strokes[k - 1].end = cut;
            strokes[k].start = cut;
        }
        let sigma = subject.medium.scene().sensor.psf_px;
        for stroke in strokes.drain(..) {
            stroke.draw(&mut self.families[family], &self.edge, sigma);
        }
    }

    /// Draws what is left of a broken piece of twine.
    fn stubs(&mut self, subject: &Subject, edge: Edge, nodes: [&Node; 2], damage: &Damage) {
        let pieces = Pieces::of(subject);
        for end in 0..2 {
            let Some((share, [turn, lift])) = damage.stub(edge, end) else { continue };
            let (root, other) = (nodes[end].point, nodes[1 - end].point);
            let out = subject.pose.normal();
            let way = other - root;
            let sideways = out.cross(&way);
            // Frayed twine leaves its old direction by up to 60 degrees and curls out of the net.
            let direction = way + sideways * (1.7 * turn) + out * (0.6 * lift * way.norm());
            let tip = root + direction * (share * way.norm() / direction.norm().max(1e-12));
            let Some(pixel) = subject.medium.camera().pixel_from_point(tip) else { continue };
            let tip = Node { point: tip, pixel };
            pieces.push(edge, nodes[end], &tip, &mut self.stretch);
            let sigma = subject.medium.scene().sensor.psf_px;
            for stroke in self.stretch.drain(..) {
                stroke.draw(&mut self.families[edge.family], &self.edge, sigma);
            }
        }
    }

    /// Draws the knots.
    fn knots(&mut self, subject: &Subject, picture: &mut [f32]) {
        let damage = Damage::of(subject.net);
        let size = Addressed::new(subject.net.seed, Stream::Knot);
        for (index, node) in subject.lattice.iter() {
            if damage.gone(index.0, index.1) {
                continue;
            }
            // Tied by hand or machine, they differ by a tenth.
            let vary = 1.0 + 0.1 * size.normal(i64::from(index.0), i64::from(index.1), 0).clamp(-2.0, 2.0);
            let diameter = subject.net.twine.diameter_m * subject.net.twine.knot * vary;
            self.blob(subject, node.point, 0.5 * diameter, subject.net.twine.grey, picture);
        }
    }

    /// Draws tufts, and notes which knots they cover.
    fn growth(&mut self, subject: &Subject, picture: &mut [f32]) {
        let growth = &subject.net.growth;
        let (place, tuft) =
            (Addressed::new(subject.net.seed, Stream::Growth), Addressed::new(subject.net.seed, Stream::Tuft));
        let damage = Damage::of(subject.net);
        let inverse = subject.pose.rotation.inverse();
        for (index, node) in subject.lattice.iter() {
            for family in 0..2 {
                let edge = Edge { i: index.0, j: index.1, family };
                let [_, (i, j)] = edge.ends();
                let Some(next) = subject.lattice.node(i, j) else { continue };
                let (a, b, c) = edge.address(0);
                let lot = place.uniform(a, b, c);
                // A smooth field of mean 1, as uneven as asked for and never above 8: most pieces need not ask it.
                if lot >= 8.0 * growth.density || damage.broken(edge) {
                    continue;
                }
                let at = (inverse * (node.point - subject.pose.translation)).xy() / growth.patch_m;
                let patch = (1.0 + growth.patchiness * 1.6 * place.fractal(at.x, at.y, 2)).clamp(0.0, 8.0);
                if lot >= growth.density * patch {
                    continue;
                }
                let number = |k: i64, low: f64, high: f64| {
                    let (a, b, c) = edge.address(k);
                    tuft.between(low, high, a, b, c)
                };
                let centre = node.point + (next.point - node.point) * number(0, 0.0, 1.0);
                let size = growth.size_m * number(1, 0.4, 1.6);
                for k in 0..5 {
                    let spread = 0.45 * size;
                    let off = Vector3::new(
                        number(10 + 4 * k, -spread, spread),
                        number(11 + 4 * k, -spread, spread),
                        -number(12 + 4 * k, 0.0, spread),
                    );
                    let radius = size * number(13 + 4 * k, 0.15, 0.38);
                    let grey = growth.grey * (0.8 + 0.1 * k as f64);
                    let Some(spot) = self.blob(subject, centre + off, radius, grey, picture) else { continue };
                    for (end, knot) in edge.ends().into_iter().zip([node, next]) {
                        if (knot.pixel - spot.pixel).norm() < spot.radius_px {
                            self.fouled.push(end);
                        }
                    }
                }
            }
        }
        self.fouled.sort_unstable();
        self.fouled.dedup();
    }

    /// Draws a ball of this brightness; where it is in the picture.
    fn blob(
        &self,
        subject: &Subject,
        point: Vector3<f64>,
        radius_m: f64,
        grey: f64,
        picture: &mut [f32],
    ) -> Option<Spot> {
        let camera = subject.medium.camera();
        let pixel = camera.pixel_from_point(point).filter(|_| point.z > 0.02)?;
        let radius_px = radius_m * 0.5 * (camera.fx() + camera.fy()) / point.z;
        let place = subject.pose.inverse_transform(point).xy();
        let grey = subject.medium.seen(grey, point, pixel, place) as f32;
        let spot = Spot { pixel, radius_px, grey, strength: 1.0 };
        let sigma = subject.medium.scene().sensor.psf_px;
        spot.draw(&self.disc, &self.edge, sigma, camera.width() as usize, picture);
        Some(spot)
    }
}
