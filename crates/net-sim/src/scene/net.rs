use net_geometry::Mesh;
use serde::{Deserialize, Serialize};

use super::{Growth, Hole, NetPose, Surface};
use crate::error::{Error, Result, within};

/// A net and where it is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Layer {
    /// The net.
    pub net: Net,
    /// Where it is.
    pub pose: NetPose,
}

impl Layer {
    /// A flat net of this mesh at this pose, all else by default.
    pub fn planar(mesh: &Mesh, pose: NetPose) -> Self {
        Self { net: Net::of(mesh), pose }
    }

    pub(crate) fn validate(&self) -> Result<()> {
        self.net.validate()?;
        self.pose.validate()
    }
}

/// A net: how it was made, how it hangs, and what has become of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Net {
    /// Knot to knot along the first mesh direction, m. Default 0.05.
    pub side1_m: f64,
    /// Knot to knot along the second mesh direction, m. Default 0.05.
    pub side2_m: f64,
    /// Angle from the first to the second mesh direction as made, degrees. Default 90.
    pub angle_deg: f64,
    /// What load has added to that angle at the net's origin, degrees: the meshes become rhombs, their sides keep their length.
    /// Default 0.
    pub shear_deg: f64,
    /// The twine.
    pub twine: Twine,
    /// How far it reaches.
    pub extent: Extent,
    /// How it bends.
    pub surface: Surface,
    /// Knots off their places as made: standard deviation along each mesh direction, share of a side. Default 0; real nets have
    /// 0.01 to 0.05.
    pub jitter: f64,
    /// Twines that hang through instead of being taut: standard deviation of the middle's way off the straight line, share of a
    /// side, sideways and out of the net alike. Default 0.
    pub slack: f64,
    /// Torn places.
    pub holes: Vec<Hole>,
    /// Share of single twines broken anywhere. Default 0.
    pub broken: f64,
    /// What grows on it.
    pub growth: Growth,
    /// Which net of this kind it is: jitter, breaks and growth follow from it. Default 0.
    pub seed: u64,
}

impl Default for Net {
    fn default() -> Self {
        Self {
            side1_m: 0.05,
            side2_m: 0.05,
            angle_deg: 90.0,
            shear_deg: 0.0,
            twine: Twine::default(),
            extent: Extent::Full,
            surface: Surface::default(),
            jitter: 0.0,
            slack: 0.0,
            holes: Vec::new(),
            broken: 0.0,
            growth: Growth::default(),
            seed: 0,
        }
    }
}

impl Net {
    /// A net of this mesh, all else by default.
    pub fn of(mesh: &Mesh) -> Self {
        let angle_deg = if mesh.is_right_angled() { 90.0 } else { mesh.angle().to_degrees() };
        Self { side1_m: mesh.side1(), side2_m: mesh.side2(), angle_deg, ..Self::default() }
    }

    /// The mesh as made: what its user knows.
    ///
    /// # Errors
    /// [`Error::Geometry`] for sides or an angle that make no mesh.
    pub fn mesh(&self) -> Result<Mesh> {
        Ok(Mesh::oblique(self.side1_m, self.side2_m, self.angle_deg.to_radians())?)
    }

    /// The mesh as it hangs at the net's origin.
    ///
    /// # Errors
    /// As [`Net::mesh`].
    pub fn hung_mesh(&self) -> Result<Mesh> {
        Ok(Mesh::oblique(self.side1_m, self.side2_m, (self.angle_deg + self.shear_deg).to_radians())?)
    }

    /// Whether all twines along a mesh direction lie on straight lines.
    pub(crate) fn is_straight(&self) -> bool {
        self.jitter == 0.0 && self.slack == 0.0 && self.surface.is_flat() && self.twine.variation == 0.0
    }

    fn validate(&self) -> Result<()> {
        within("net.side1_m", self.side1_m, 1e-3, 10.0, "metres between 0.001 and 10")?;
        within("net.side2_m", self.side2_m, 1e-3, 10.0, "metres between 0.001 and 10")?;
        within("net.angle_deg", self.angle_deg, 20.0, 160.0, "degrees between 20 and 160")?;
        let hung = self.angle_deg + self.shear_deg;
        within("net.angle_deg + net.shear_deg", hung, 20.0, 160.0, "degrees between 20 and 160")?;
        within("net.jitter", self.jitter, 0.0, 0.3, "a share of a side between 0 and 0.3")?;
        within("net.slack", self.slack, 0.0, 0.3, "a share of a side between 0 and 0.3")?;
        within("net.broken", self.broken, 0.0, 1.0, "a share between 0 and 1")?;
        for hole in &self.holes {
            hole.validate()?;
        }
        self.twine.validate()?;
        self.extent.validate()?;
        self.surface.validate()?;
        self.growth.validate()
    }
}

/// How far a net reaches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Extent {
    /// As far as the eye sees.
    #[default]
    Full,
    /// Knots `i` and `j` from `[first, last]`, both included.
    Cells {
        /// First and last knot along the first mesh direction.
        i: [i32; 2],
        /// First and last knot along the second mesh direction.
        j: [i32; 2],
    },
}

impl Extent {
    /// `columns` x `rows` knots with the lattice origin in the middle, or half a cell right and down of it where the number is even.
    pub fn centred(columns: u32, rows: u32) -> Self {
        let range = |n: u32| {
            let last = (n / 2) as i32;
            [last + 1 - n as i32, last]
        };
        Self::Cells { i: range(columns), j: range(rows) }
    }

    /// First and last column; `None` for an endless net.
    pub(crate) fn columns(&self) -> Option<[i32; 2]> {
        match self {
            Self::Full => None,
            Self::Cells { i, .. } => Some(*i),
        }
    }

    /// First and last row; `None` for an endless net.
    pub(crate) fn rows(&self) -> Option<[i32; 2]> {
        match self {
            Self::Full => None,
            Self::Cells { j, .. } => Some(*j),
        }
    }

    fn validate(&self) -> Result<()> {
        let Self::Cells { i, j } = self else { return Ok(()) };
        for [first, last] in [i, j] {
            let count = i64::from(*last) - i64::from(*first);
            if !(1..=5000).contains(&count) {
                let expected = "2 to 5001 knots along each direction, the first before the last";
                return Err(Error::Value { field: "net.extent", value: count as f64 + 1.0, expected });
            }
        }
        Ok(())
    }
}

/// The twine a net is made of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Twine {
    /// Diameter, m. Default 0.002, common in 50 mm mesh.
    pub diameter_m: f64,
    /// Diameter of the knots in diameters of the twine. Default 1: knotless. Tied knots have 1.8 to 2.6.
    pub knot: f64,
    /// Brightness close by and fully lit, grey levels. Default 200; below the water's it is a dark net.
    pub grey: f64,
    /// Brightness from piece to piece: standard deviation, share of it. Default 0.
    pub variation: f64,
    /// How much brighter the side towards the light is than the middle, and darker the other: share. Moves the centre of
    /// brightness off the axis, up to a third of a diameter at 1. Default 0. See [`super::Light::from_deg`].
    pub shading: f64,
}

impl Default for Twine {
    fn default() -> Self {
        Self { diameter_m: 0.002, knot: 1.0, grey: 200.0, variation: 0.0, shading: 0.0 }
    }
}

impl Twine {
    fn validate(&self) -> Result<()> {
        within("net.twine.diameter_m", self.diameter_m, 1e-5, 0.5, "metres between 0.00001 and 0.5")?;
        within("net.twine.knot", self.knot, 0.0, 10.0, "diameters between 0 and 10")?;
        within("net.twine.grey", self.grey, 0.0, 1000.0, "grey levels between 0 and 1000 (above 255 overexposes)")?;
        within("net.twine.variation", self.variation, 0.0, 1.0, "a share between 0 and 1")?;
        within("net.twine.shading", self.shading, 0.0, 1.0, "a share between 0 and 1")
    }
}
