//! Counting on: names of nodes carried over from an earlier pose.

use net_geometry::Pose;
use net_geometry::nalgebra::Vector2;

use crate::answer::estimate::{Labels, LatticeEstimate};

impl LatticeEstimate {
    /// The same sheet with the names that `predicted` gives: X along the same direction, nodes counted from the same origin.
    ///
    /// Returns it with the distance, cells, between where the two have the optical axis: up to half a cell it is rounded away, so
    /// above about a third the names are a guess. `None` when the predicted X lies along no direction of the mesh.
    pub fn counted_on(&self, predicted: &Pose) -> Option<(Self, f64)> {
        let ahead = predicted.rotation.matrix().column(0).into_owned();
        let along = |turns: u8| {
            let labels = Labels { turns, ..self.labels };
            labels.pose(&self.surface).rotation.matrix().column(0).dot(&ahead)
        };
        let turns = (0..4).max_by(|&a, &b| along(a).total_cmp(&along(b)))?;
        if along(turns) < (std::f64::consts::PI / 6.0).cos() {
            return None;
        }
        let odd = turns % 2 == 1;
        let angle = if odd { std::f64::consts::PI - self.surface.angle } else { self.surface.angle };
        let sides = if odd { [self.surface.sides[1], self.surface.sides[0]] } else { self.surface.sides };

        // Lattice coordinates on the optical axis, as predicted and as found.
        let axis = predicted.inverse_transform(net_geometry::nalgebra::Vector3::z() * predicted.plane().range()?);
        let expected = Vector2::new((axis.x - axis.y / angle.tan()) / sides[0], axis.y / (sides[1] * angle.sin()));
        let labels = Labels { turns, ..self.labels };
        let missing = expected - labels.net_from_sheet(self.surface.offset);
        let whole = missing.map(f64::round);
        let labels = Labels { turns, origin: labels.sheet_from_net(-whole) };

        let mut named = self.clone();
        named.labels = labels;
        named.pose = labels.pose(&self.surface);
        named.crossing_angle = angle;
        named.sides = sides;
        Some((named, (missing - whole).amax()))
    }

    /// The same sheet with `cells` added to the names of its nodes.
    pub fn renumbered(&self, cells: (i32, i32)) -> Self {
        let back = Vector2::new(-f64::from(cells.0), -f64::from(cells.1));
        let labels = Labels { origin: self.labels.sheet_from_net(back), ..self.labels };
        Self { pose: labels.pose(&self.surface), labels, ..self.clone() }
    }
}
