//! Which cells: the vote on what does not repeat in the picture, frame after frame. It connects counts that the tracker began anew, and corrects one that slipped.
//!
//! `count.csv` has the outcome, a row for each frame with a pose. Doubt is resolved backwards where the vote says how; where it does not, a new stretch begins.

use std::collections::VecDeque;
use std::fs::File;
use std::path::Path;

use anyhow::{Context, Result};
use net_flow::vote::{CellVote, Verdict, VoteConfig};
use net_geometry::nalgebra::Vector2;
use net_image::GrayView;
use netpose::Tracker;

use super::nodes::Nodes;

/// The columns of `count.csv`.
pub const HEADER: [&str; 8] = ["frame", "track", "stretch", "offset_i", "offset_j", "verdict", "z", "sure"];

/// Removes the table of an earlier run.
pub fn forget(dir: &Path) -> Result<()> {
    let path = dir.join("count.csv");
    match std::fs::remove_file(&path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            Err(e).with_context(|| format!("cannot remove {}", path.display()))
        }
        _ => Ok(()),
    }
}

/// What the vote says of a frame's lattice coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counted {
    pub frame: u64,
    /// The tracker's number.
    pub track: u32,
    /// Lattice coordinates of one stretch are of one lattice.
    pub stretch: u32,
    /// Cells to add to the tracker's.
    pub offset: (i32, i32),
    verdict: Verdict,
    z: f64,
    /// Whether this is certain: an undecided frame is left out of the map.
    pub sure: bool,
}

/// Follows the count of a run.
pub struct Count {
    vote: CellVote,
    memory: usize,
    last_track: Option<u32>,
    stretch: u32,
    offset: (i32, i32),
    /// Frames in doubt, oldest first.
    doubted: VecDeque<Counted>,
    table: csv::Writer<File>,
}

impl Count {
    /// Starts with an empty table in the folder of a run.
    pub fn new(dir: &Path) -> Result<Self> {
        let path = dir.join("count.csv");
        let mut table = csv::Writer::from_path(&path).with_context(|| format!("cannot write {}", path.display()))?;
        table.write_record(HEADER)?;
        let config = VoteConfig::default();
        let memory = config.memory_frames;
        let vote = CellVote::new(&config)?;
        Ok(Self { vote, memory, last_track: None, stretch: 0, offset: (0, 0), doubted: VecDeque::new(), table })
    }

    /// The frame that the tracker did last, which has a pose. `None` if its method knows no lattice.
    pub fn update(
        &mut self,
        frame: u64,
        track: u32,
        image: GrayView<'_>,
        tracker: &Tracker,
        nodes: &Nodes,
    ) -> Result<Option<Counted>> {
        let Some(axis) = tracker.lattice_at_axis().filter(|a| a.amax() < 1e8) else { return Ok(None) };
        let middle = (axis.x.round() as i32, axis.y.round() as i32);
        self.step(frame, track, middle, image, |at| nodes.pixel(at)).map(Some)
    }

    fn step(
        &mut self,
        frame: u64,
        track: u32,
        middle: (i32, i32),
        image: GrayView<'_>,
        pixel: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
    ) -> Result<Counted> {
        let changed = self.last_track.is_some_and(|last| last != track);
        let first = self.last_track.is_none();
        self.last_track = Some(track);
        if changed && !self.doubted.is_empty() {
            // What has been added up was about another count.
            self.break_off()?;
        }
        let offset = self.offset;
        let vote = |this: &mut Self| {
            let middle = (middle.0.saturating_add(offset.0), middle.1.saturating_add(offset.1));
            let shift = Vector2::new(f64::from(offset.0), f64::from(offset.1));
            this.vote.update(image, middle, |at| pixel(at - shift))
        };
        let mut result = vote(self);
        if changed && result.verdict == Verdict::Ambiguous {
            // A count begun anew is off once, not more in every frame: one look has to decide.
            self.break_off()?;
            result = vote(self);
        }
        let broken = result.verdict == Verdict::Decided && result.dropped > 0;
        if (result.verdict == Verdict::Started && !first) || broken {
            self.give_up()?;
            self.stretch += 1;
        }
        if result.verdict == Verdict::Blind {
            // Whatever comes next is connected with this frame at best, and this one with none.
            self.break_off()?;
        }
        let sure = match result.verdict {
            Verdict::Decided | Verdict::Started => true,
            Verdict::Ambiguous | Verdict::Blind => false,
        };
        if let Some(correction) = result.correction() {
            let k = result.shifts[0].cells;
            // Each undecided frame was off by k more than the one before.
            for (n, doubted) in self.doubted.iter_mut().enumerate() {
                let n = n as i32 + 1;
                doubted.offset = (doubted.offset.0.saturating_add(n * k.0), doubted.offset.1.saturating_add(n * k.1));
                doubted.sure = true;
            }
            self.give_up()?;
            self.offset = (offset.0.saturating_add(correction.0), offset.1.saturating_add(correction.1));
        }
        let z = if sure && result.verdict == Verdict::Started { f64::NAN } else { result.shifts[0].z };
        let (stretch, offset) = (self.stretch, self.offset);
        let counted = Counted { frame, track, stretch, offset, verdict: result.verdict, z, sure };
        if sure {
            self.write(&counted)?;
        } else {
            self.doubted.push_back(counted);
            if self.doubted.len() > self.memory
                && let Some(oldest) = self.doubted.pop_front()
            {
                self.write(&oldest)?;
            }
        }
        Ok(counted)
    }

    /// The next frame begins a new stretch.
    fn break_off(&mut self) -> Result<()> {
        self.give_up()?;
        self.vote.reset();
        Ok(())
    }

    /// Writes the frames in doubt as they are.
    fn give_up(&mut self) -> Result<()> {
        while let Some(doubted) = self.doubted.pop_front() {
            self.write(&doubted)?;
        }
        Ok(())
    }

    /// Writes what is left.
    pub fn finish(mut self) -> Result<()> {
        self.give_up()?;
        Ok(self.table.flush()?)
    }

    fn write(&mut self, c: &Counted) -> Result<()> {
        let verdict = match c.verdict {
            Verdict::Started => "started",
            Verdict::Decided => "decided",
            Verdict::Ambiguous => "ambiguous",
            Verdict::Blind => "blind",
        };
        let z = if c.z.is_finite() { format!("{:.2}", c.z) } else { String::new() };
        let cells =
            [c.offset.0.to_string(), c.offset.1.to_string(), verdict.to_owned(), z, u8::from(c.sure).to_string()];
        let names = [c.frame.to_string(), c.track.to_string(), c.stretch.to_string()];
        Ok(self.table.write_record(names.into_iter().chain(cells))?)
    }
}

#[cfg(test)]
mod tests {
    use net_geometry::nalgebra::Vector3;
    use net_geometry::{Camera, Lens, Mesh};
    use net_image::Image;
    use net_sim::{Layer, Net, NetPose, Scene, Simulator};

    use super::*;

    #[test]
    fn a_count_begun_anew_is_connected_and_a_blind_frame_parts() {
        let dir = tempfile::tempdir().expect("a folder");
        let camera = Camera::new(450.0, 450.0, 239.5, 159.5, 480, 320, Lens::None).expect("a camera");
        let mesh = Mesh::square(0.05).expect("a mesh");
        let net = Net { jitter: 0.03, seed: 3, ..Net::default() };
        let mut simulator = Simulator::new(camera);
        let mut count = Count::new(dir.path()).expect("a table");
        let mut counted = Vec::new();
        for frame in 0..7_i32 {
            let pose = NetPose { range_m: 1.0, tilt_y_deg: 8.0, x_m: 0.03 * f64::from(frame), ..NetPose::default() };
            let scene = Scene { layers: vec![Layer { net: net.clone(), pose }], ..Scene::default() };
            let mut image = Image::default();
            simulator.render(&scene, 1 + u64::from(frame.unsigned_abs()), &mut image).expect("a scene");
            if frame == 5 {
                image = Image::new(480, 320);
            }
            // From the third frame on the tracker calls every cell by two less and one more.
            let off = if frame < 2 { Vector2::zeros() } else { Vector2::new(2.0, -1.0) };
            let pose = pose.pose();
            let axis = mesh.coordinates(pose.net_from_ray(Vector3::z()).expect("in view")) - off;
            let pixel = |at: Vector2<f64>| {
                let at = at + off;
                camera.pixel_from_point(pose.transform(mesh.node(at.x, at.y).push(0.0)))
            };
            let (middle, track) = ((axis.x.round() as i32, axis.y.round() as i32), u32::from(frame >= 2));
            let view = image.view().expect("pixels");
            counted.push(count.step(u64::from(frame.unsigned_abs()), track, middle, view, pixel).expect("written"));
        }
        count.finish().expect("written");
        let told: Vec<_> = counted.iter().map(|c| (c.stretch, c.offset, c.sure)).collect();
        let (before, after) = ((0, (0, 0), true), (0, (2, -1), true));
        assert_eq!(told[..5], [before, before, after, after, after]);
        assert!(!told[5].2 && told[6].0 == 1 && told[6].2, "{told:?}");
        let table = std::fs::read_to_string(dir.path().join("count.csv")).expect("a table");
        assert_eq!(table.lines().count(), 8, "{table}");
    }
}
