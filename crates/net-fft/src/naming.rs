//! Which side comes first.

use net_geometry::Pose;
use net_geometry::nalgebra::Vector3;

use crate::estimate::Side;
use crate::field::LatticeField;

/// One of the four ways to name a lattice's sides: which of its side directions, and which way along it, comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Naming {
    First,
    FirstReversed,
    Second,
    SecondReversed,
}

impl Naming {
    /// The one that brings X nearest to the image's u axis.
    pub(crate) fn along_u(field: &LatticeField) -> Self {
        let turn = |naming: Self| {
            let rotation = naming.of(field).rotation();
            Pose { rotation, translation: Vector3::z() }.in_plane_rotation().abs()
        };
        // At exactly 45 degrees the first: at -45 the second side has +45, which the range (-45, 45] prefers, but rounding decides there anyway.
        let mut best = Self::First;
        for naming in [Self::FirstReversed, Self::Second, Self::SecondReversed] {
            if turn(naming) < turn(best) - 1e-12 {
                best = naming;
            }
        }
        best
    }

    pub(crate) fn of(self, field: &LatticeField) -> LatticeField {
        let [g1, g2] = field.duals;
        let duals = match self {
            Self::First => [g1, g2],
            Self::FirstReversed => [-g1, -g2],
            Self::Second => [g2, -g1],
            Self::SecondReversed => [-g2, g1],
        };
        LatticeField { duals, ..*field }
    }

    pub(crate) fn side(self) -> Side {
        match self {
            Self::First | Self::FirstReversed => Side::First,
            Self::Second | Self::SecondReversed => Side::Second,
        }
    }
}
