//! The ways to a pose: same inputs, same [`Found`].

mod count;
pub(crate) mod lattice;
pub(crate) mod thesis;

use net_flow::vote::VoteResult;

use crate::estimate::{Connection, NetPose};

/// What a method says of one frame, before the decision whether to vouch for it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Found {
    /// The pose, however doubtful.
    pub net: NetPose,
    /// In [0, 1]: that there is a net and this is its pose.
    pub probability: f64,
    /// Number of the count of cells; another number, another origin.
    pub track: u32,
    /// How the count goes on from the frames before.
    pub connection: Connection,
    /// [`crate::Estimate::corrected`].
    pub corrected: (i32, i32),
    /// [`crate::Estimate::in_doubt`].
    pub in_doubt: u32,
    /// [`crate::Estimate::vote`].
    pub vote: Option<VoteResult>,
}

/// Numbers the counts of cells: each has an origin of its own.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Track(Option<u32>);

impl Track {
    /// A new count begins.
    pub fn start(&mut self) -> Connection {
        let first = self.0.is_none();
        self.0 = Some(self.number() + u32::from(!first));
        if first { Connection::Started } else { Connection::Restarted }
    }

    /// The present count; the first is 0.
    pub fn number(&self) -> u32 {
        self.0.unwrap_or(0)
    }
}
