use net_flow::vote::VoteResult;
use net_geometry::nalgebra::{Matrix6, Vector3};
use net_geometry::{Junction, Mesh, Plane, Pose};
use net_junction::Twine;

/// Whether there is a net, and a pose that can be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// A net, and its pose is valid.
    Ok,
    /// No net, or none whose pose can be vouched for.
    NoNet,
}

impl Status {
    /// The word used in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::NoNet => "no_net",
        }
    }
}

/// How the count of cells of a frame goes on from the frames before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Connection {
    /// The first count.
    Started,
    /// From frame to frame.
    Followed,
    /// Named by the best guess from the frame before, perhaps off by whole cells; so is the next such frame against this one. The number is this frame's alone.
    Doubted,
    /// The doubt is over: frames together told what one did not. The count before the doubt goes on, and with it its number.
    Settled,
    /// The net was lost, or in doubt, and what was seen of its cells before told which ones these are: an earlier count goes on, and with it its number.
    Recognised,
    /// The net was lost, or in doubt: a new count, with another origin.
    Restarted,
}

impl Connection {
    /// The word used in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Started => "started",
            Self::Followed => "followed",
            Self::Doubted => "doubted",
            Self::Settled => "settled",
            Self::Recognised => "recognised",
            Self::Restarted => "restarted",
        }
    }
}

/// A net's pose with what follows from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NetPose {
    /// Net to camera.
    pub pose: Pose,
    /// Covariance, rotation (rad) then translation (m), perturbation in the camera frame.
    pub covariance: Matrix6<f64>,
    /// From the camera centre to the net along the optical axis, m.
    pub range_m: f64,
    /// Perpendicular distance, m.
    pub distance_m: f64,
    /// The net's unit normal in the camera frame, positive z.
    pub normal: Vector3<f64>,
    /// One standard deviation of the range, m.
    pub sigma_range_m: f64,
    /// One standard deviation of the normal's direction, root mean square over both axes, rad.
    pub sigma_tilt: f64,
    /// One standard deviation of the place along the net, root mean square over both axes, m.
    pub sigma_xy_m: f64,
    /// How the net hangs, from the methods that estimate it.
    pub sheet: Option<Sheet>,
}

impl NetPose {
    /// The same net with `cells` added to the names of its nodes: for frames in doubt, once that is settled ([`Estimate::corrected`]).
    pub fn renumbered(&self, cells: (i32, i32), mesh: &Mesh) -> Self {
        let (i, j) = (f64::from(cells.0) * mesh.side1(), f64::from(cells.1) * mesh.side2());
        let (sin, cos) = self.sheet.map_or(mesh.angle(), |sheet| sheet.crossing_angle).sin_cos();
        let moved = self.pose.rotation * Vector3::new(i + j * cos, j * sin, 0.0);
        Self { pose: Pose { translation: self.pose.translation - moved, ..self.pose }, ..*self }
    }
}

/// How a net hangs: its meshes sheared, the sheet bent. At the optical axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sheet {
    /// Angle from X to the second mesh direction, rad.
    pub crossing_angle: f64,
    /// One standard deviation of it, rad; `None` when it was held at the mesh's own.
    pub sigma_crossing_angle: Option<f64>,
    /// Principal curvatures, 1/m, larger magnitude first; positive bends away from the camera.
    pub curvatures_per_m: [f64; 2],
    /// One standard deviation of each, 1/m; `None` when the sheet was held flat.
    pub sigma_curvatures_per_m: Option<[f64; 2]>,
    /// The plane through what is seen of the net about the optical axis, camera frame. [`NetPose::pose`] tells of the tangent plane on the axis.
    pub mean_plane: Plane,
    /// How much worse a drawing with the best of other cells (halves, doubles, thirds, sides swapped) explains the picture, as a share of what this one explains; in [-1, 1], negative where the
    /// other is better. A followed net has that of its first picture.
    pub cell_margin: f64,
}

/// One of several nets in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layer {
    /// Where it is. The origin of a net that is not followed is the node nearest to the optical axis, in each frame anew.
    pub net: NetPose,
    /// In [0, 1]: that there is this net and the pose is right. Never below the threshold for [`Status::Ok`].
    pub probability: f64,
    /// Whether it is the one that [`Estimate::net`] tells of and the track follows.
    pub followed: bool,
}

/// What one frame says. Borrows the tracker's buffers: copy what must outlive the next frame.
#[derive(Debug, Clone, Copy)]
pub struct Estimate<'a> {
    /// Whether `net` holds a pose.
    pub status: Status,
    /// In [0, 1]: that this frame shows a net and that the pose is right.
    pub probability: f64,
    /// The pose, when the status is [`Status::Ok`].
    pub net: Option<NetPose>,
    /// Number of the count of cells. Frames of the same number have the same node as the net frame's origin. Each time the net was lost and the count had to start
    /// anew it is one that was not there before; when a place is recognised, or a doubt is settled, it is again that of the earlier count.
    pub track: u32,
    /// How that count goes on from the frames before. What happened to it in frames without a pose, whose cells are counted all the same where their lattice is known, is said with the next pose;
    /// a doubt, and how it is settled, in every frame.
    pub connection: Connection,
    /// Cells that were added to the names of this frame's nodes, which had been carried on from the frame before. Zero where a place was recognised or a count begun.
    pub corrected: (i32, i32),
    /// Which frame of a doubt this is, from 1; 0 without. The one that settles it, the n-th, explains those before: the k-th was named with k n-ths of its `corrected` too little.
    pub in_doubt: u32,
    /// What does not repeat in the picture said of the cells: the likeliest shifts *per frame* of the names that this frame came with (those before [`Estimate::corrected`]), by how many
    /// deviations each stands out, and the odds of the best to the second. `None` where there was nothing to compare with, and from methods that do not count.
    pub vote: Option<VoteResult>,
    /// Junctions found in this frame.
    pub junctions: &'a [Junction],
    /// Twines between neighbouring nodes in view, with the evidence for and against each; from [`crate::Method::Lattice`].
    pub twines: &'a [Twine],
    /// All nets that can be vouched for, nearest first, with [`crate::Config::layers`] set; the followed one is among them.
    pub layers: &'a [Layer],
}
