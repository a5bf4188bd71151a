//! Frames in doubt are held back until the doubt is over: if it is settled, they are written under the names that they should have had.

use std::time::Duration;

use anyhow::Result;
use net_log::RawFrame;
use netpose::{Connection, Mesh};

use super::folder::Folder;
use super::frames::Tracked;

/// What the settlement of a doubt, in its frame `n`, says of frame `k`: cells to be added to its names.
pub fn share(corrected: (i32, i32), k: u32, n: u32) -> (i32, i32) {
    let of = |cells: i32| (i64::from(cells) * i64::from(k) / i64::from(n.max(1))) as i32;
    (of(corrected.0), of(corrected.1))
}

/// Frames on their way into the folder.
#[derive(Default)]
pub struct HeldBack {
    frames: Vec<(RawFrame, Duration, Tracked)>,
}

impl HeldBack {
    /// Writes a frame, or holds it back; `tracked` or why there is none.
    pub fn write(
        &mut self,
        folder: &mut Folder,
        mesh: &Mesh,
        frame: &RawFrame,
        time: Duration,
        tracked: Result<&Tracked, &str>,
    ) -> Result<()> {
        match tracked {
            Ok(t) if t.connection == Connection::Doubted => {
                if t.in_doubt == 1 {
                    // Another doubt: the one before was not settled.
                    self.flush(folder)?;
                }
                self.frames.push((frame.clone(), time, t.clone()));
                return Ok(());
            }
            Ok(t) if t.connection == Connection::Settled => self.settle(t, mesh),
            _ => {}
        }
        self.flush(folder)?;
        folder.write(frame, time, tracked)
    }

    /// Writes what is left, as it is.
    pub fn flush(&mut self, folder: &mut Folder) -> Result<()> {
        for (frame, time, tracked) in self.frames.drain(..) {
            folder.write(&frame, time, Ok(&tracked))?;
        }
        Ok(())
    }

    fn settle(&mut self, by: &Tracked, mesh: &Mesh) {
        for (_, _, tracked) in &mut self.frames {
            let cells = share(by.corrected, tracked.in_doubt, by.in_doubt);
            let moved = |(i, j): (i32, i32)| (i.saturating_add(cells.0), j.saturating_add(cells.1));
            tracked.net = tracked.net.map(|net| net.renumbered(cells, mesh));
            tracked.junctions.iter_mut().for_each(|j| j.index = j.index.map(moved));
            tracked.twines.iter_mut().for_each(|t| t.index = moved(t.index));
            (tracked.track, tracked.connection) = (by.track, Connection::Followed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::share;

    #[test]
    fn each_frame_in_doubt_was_off_by_as_much_more() {
        assert_eq!([1, 2, 3].map(|k| share((-3, 6), k, 3)), [(-1, 2), (-2, 4), (-3, 6)]);
    }
}
