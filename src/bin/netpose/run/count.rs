//! Which cells: the vote on what does not repeat in the picture, frame after frame. It connects counts that the tracker began anew, and corrects one that slipped.
//!
//! `count.csv` has the outcome, a row for each frame with a pose. Doubt is resolved backwards where the vote says how; where it does not, a new stretch begins, unless the cells
//! in view are recognised: every stretch keeps a map of its own.

use std::collections::VecDeque;
use std::fs::File;
use std::path::Path;

use anyhow::{Context, Result};
use net_flow::vote::{CellMap, CellVote, RecallConfig, ShiftScore, Verdict, VoteConfig};
use net_geometry::nalgebra::Vector2;
use net_image::GrayView;
use netpose::{Connection, Tracker};

use super::doubt::share;
use super::frames::Tracked;

/// The columns of `count.csv`.
pub const HEADER: [&str; 14] = [
    "frame", "track", "stretch", "offset_i", "offset_j", "verdict", "z", "sure", "best_i", "best_j", "rival_i",
    "rival_j", "rival_z", "log_odds",
];

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

/// What is said of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Said {
    /// By the vote, against the frame before.
    Voted(Verdict),
    /// By the map of an earlier stretch.
    Recognised,
}

/// How the tracker named the nodes of a frame.
#[derive(Debug, Clone, Copy)]
struct Named {
    track: u32,
    connection: Connection,
    corrected: (i32, i32),
    in_doubt: u32,
}

impl From<&Tracked> for Named {
    fn from(t: &Tracked) -> Self {
        Self { track: t.track, connection: t.connection, corrected: t.corrected, in_doubt: t.in_doubt }
    }
}

/// What is known of a frame's lattice coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counted {
    pub frame: u64,
    /// The tracker's number.
    pub track: u32,
    /// Lattice coordinates of one stretch are of one lattice.
    pub stretch: u32,
    /// Cells to add to the tracker's.
    pub offset: (i32, i32),
    said: Said,
    z: f64,
    /// The likeliest shift a frame and its rival, of the coordinates that the frame came with, and the logarithm of their odds; `None` where nothing was compared.
    shifts: Option<([ShiftScore; 2], f64)>,
    /// Which of the frames in doubt this is to the tracker, from 1; 0 if it is none.
    doubt: u32,
    /// Whether this is certain: an undecided frame is left out of the map.
    pub sure: bool,
}

/// Cells that a map holds along each direction.
const MAP_CELLS: usize = 256;
/// Stretches whose maps are kept.
const MAPS: usize = 4;
/// Times that a young stretch is looked up in them, and frames between.
const LOOK_UPS: u32 = 8;
const LOOK_UP_EVERY: u32 = 4;

/// An earlier stretch.
struct Earlier {
    stretch: u32,
    map: CellMap,
    /// Cells to be added to the present stretch's coordinates where the search begins.
    around: (i32, i32),
}

/// Follows the count of a run.
pub struct Count {
    vote: CellVote,
    memory: usize,
    /// The present stretch, and the first number that none has.
    stretch: u32,
    next: u32,
    /// Certain frames of it, its map, and the cell at the optical axis in the last one.
    age: u32,
    map: CellMap,
    middle: (i32, i32),
    earlier: Vec<Earlier>,
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
        Ok(Self {
            vote,
            memory,
            stretch: 0,
            next: 1,
            age: 0,
            map: new_map()?,
            middle: (0, 0),
            earlier: Vec::new(),
            offset: (0, 0),
            doubted: VecDeque::new(),
            table,
        })
    }

    /// The frame that the tracker did last, which has a pose. `None` if its method knows no lattice.
    pub fn update(
        &mut self,
        frame: u64,
        tracked: &Tracked,
        image: GrayView<'_>,
        tracker: &Tracker,
    ) -> Result<Option<Counted>> {
        let Some(axis) = tracker.lattice_at_axis().filter(|a| a.amax() < 1e8) else { return Ok(None) };
        let middle = (axis.x.round() as i32, axis.y.round() as i32);
        self.step(frame, &Named::from(tracked), middle, image, |at| tracker.pixel_by_knots(at)).map(Some)
    }

    fn step(
        &mut self,
        frame: u64,
        named: &Named,
        middle: (i32, i32),
        image: GrayView<'_>,
        pixel: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
    ) -> Result<Counted> {
        if named.connection == Connection::Settled {
            // The doubted are written by the right names, so that nothing is to be added to them for that.
            for doubted in self.doubted.iter_mut().filter(|d| d.doubt > 0) {
                doubted.offset = minus(doubted.offset, share(named.corrected, doubted.doubt, named.in_doubt));
                doubted.track = named.track;
            }
        }
        let changed = matches!(named.connection, Connection::Restarted | Connection::Recognised);
        if changed && !self.doubted.is_empty() {
            // What has been added up was about another count.
            self.break_off()?;
        }
        if named.in_doubt == 1 {
            // What was added up before was about something else.
            self.give_up()?;
            self.vote.drop_doubt();
        }
        // As the names were before the tracker corrected them: what frames in doubt add up to is to be found here too.
        let mut offset = minus(self.offset, named.corrected);
        let vote = |this: &mut Self, offset: (i32, i32)| {
            let middle = plus(middle, offset);
            let shift = Vector2::new(f64::from(offset.0), f64::from(offset.1));
            this.vote.update(image, middle, |at| pixel(at - shift))
        };
        let mut result = vote(self, offset);
        let ambiguous = result.verdict == Verdict::Ambiguous;
        if ambiguous && (changed || named.corrected != (0, 0)) {
            // A count begun anew is off once, not more in every frame: one look has to decide.
            self.break_off()?;
            offset = self.offset;
            result = vote(self, offset);
        }
        let track = named.track;
        // Doubt that was longer than the memory breaks the count, unless the tracker's names were right in the end.
        let broken = result.dropped > 0 && result.correction().is_some_and(|cells| changed || cells != (0, 0));
        let begins = result.verdict == Verdict::Started && self.age > 0;
        if broken || begins || result.verdict == Verdict::Blind {
            self.give_up()?;
        }
        if let Some(correction) = result.correction() {
            let k = result.shifts[0].cells;
            // Each undecided frame was off by k more than the one before.
            for (n, doubted) in self.doubted.iter_mut().enumerate() {
                let n = n as i32 + 1;
                doubted.offset = plus(doubted.offset, (n * k.0, n * k.1));
                doubted.sure = true;
            }
            self.give_up()?;
            offset = plus(offset, correction);
        }
        self.offset = offset;
        let sure = matches!(result.verdict, Verdict::Decided | Verdict::Started);
        let (mut said, mut z) = (Said::Voted(result.verdict), result.shifts[0].z);
        let here = plus(middle, self.offset);
        if broken || begins {
            self.begin_stretch(here)?;
        }
        if sure {
            if self.age.is_multiple_of(LOOK_UP_EVERY)
                && self.age < LOOK_UPS * LOOK_UP_EVERY
                && let Some(recognised) = self.look_up()
            {
                (said, z) = (Said::Recognised, recognised);
            }
            self.age = self.age.saturating_add(1);
            self.vote.remember(&mut self.map);
            self.middle = plus(middle, self.offset);
        }
        let (stretch, doubt) = (self.stretch, named.in_doubt);
        let compared = matches!(result.verdict, Verdict::Decided | Verdict::Ambiguous);
        let shifts = compared.then_some(([result.shifts[0], result.shifts[1]], result.log_odds));
        let counted = Counted { frame, track, stretch, offset: self.offset, said, z, shifts, doubt, sure };
        if sure || result.verdict == Verdict::Blind {
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

    /// From here on nothing is known of how the count goes on. `here`: cell at the optical axis, in numbers that mean nothing yet.
    fn begin_stretch(&mut self, here: (i32, i32)) -> Result<()> {
        let around = minus(self.middle, here);
        for earlier in &mut self.earlier {
            earlier.around = plus(earlier.around, around);
        }
        if self.map.cells() > 0 {
            let map = std::mem::replace(&mut self.map, new_map()?);
            self.earlier.push(Earlier { stretch: self.stretch, map, around });
            if self.earlier.len() > MAPS {
                // The smallest is missed least.
                let least = (0..self.earlier.len()).min_by_key(|&k| self.earlier[k].map.cells()).unwrap_or(0);
                self.earlier.remove(least);
            }
        }
        (self.stretch, self.age) = (self.next, 0);
        self.next += 1;
        Ok(())
    }

    /// If what is in view was seen in an earlier stretch, goes on with that one; by how many deviations it stood out.
    fn look_up(&mut self) -> Option<f64> {
        let found = (0..self.earlier.len()).rev().find_map(|k| {
            let earlier = &mut self.earlier[k];
            let place = self.vote.recall(&mut earlier.map, earlier.around).filter(|r| r.recognised)?;
            Some((k, place))
        });
        let (k, place) = found?;
        let known = self.earlier.remove(k);
        self.vote.renumber(place.cells);
        self.offset = plus(self.offset, place.cells);
        (self.stretch, self.map) = (known.stretch, known.map);
        for earlier in &mut self.earlier {
            earlier.around = minus(earlier.around, place.cells);
        }
        self.age = LOOK_UPS * LOOK_UP_EVERY;
        Some(place.z)
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
        let verdict = match c.said {
            Said::Recognised => "recognised",
            Said::Voted(Verdict::Started) => "started",
            Said::Voted(Verdict::Decided) => "decided",
            Said::Voted(Verdict::Ambiguous) => "ambiguous",
            Said::Voted(Verdict::Blind) => "blind",
        };
        let compared = !matches!(c.said, Said::Voted(Verdict::Started | Verdict::Blind));
        let z = if compared { format!("{:.2}", c.z) } else { String::new() };
        let cells =
            [c.offset.0.to_string(), c.offset.1.to_string(), verdict.to_owned(), z, u8::from(c.sure).to_string()];
        let names = [c.frame.to_string(), c.track.to_string(), c.stretch.to_string()];
        let odds = c.shifts.map_or_else(Default::default, |([best, rival], log_odds)| {
            let [b, r] = [best, rival].map(|s| [s.cells.0.to_string(), s.cells.1.to_string()]);
            let [[b_i, b_j], [r_i, r_j]] = [b, r];
            [b_i, b_j, r_i, r_j, format!("{:.2}", rival.z), format!("{log_odds:.2}")]
        });
        Ok(self.table.write_record(names.into_iter().chain(cells).chain(odds))?)
    }
}

fn new_map() -> net_flow::Result<CellMap> {
    CellMap::new(&RecallConfig { side_cells: MAP_CELLS, ..RecallConfig::default() })
}

fn plus(a: (i32, i32), b: (i32, i32)) -> (i32, i32) {
    (a.0.saturating_add(b.0), a.1.saturating_add(b.1))
}

fn minus(a: (i32, i32), b: (i32, i32)) -> (i32, i32) {
    (a.0.saturating_sub(b.0), a.1.saturating_sub(b.1))
}

#[cfg(test)]
mod tests {
    use net_geometry::nalgebra::Vector3;
    use net_geometry::{Camera, Lens, Mesh};
    use net_image::Image;
    use net_sim::{Layer, Net, NetPose, Scene, Simulator};

    use super::*;

    #[test]
    fn a_count_begun_anew_is_connected_also_over_a_blind_frame_and_far_away() {
        let dir = tempfile::tempdir().expect("a folder");
        let camera = Camera::new(450.0, 450.0, 239.5, 159.5, 480, 320, Lens::None).expect("a camera");
        let mesh = Mesh::square(0.05).expect("a mesh");
        let net = Net { jitter: 0.03, seed: 3, ..Net::default() };
        let mut simulator = Simulator::new(camera);
        let mut count = Count::new(dir.path()).expect("a table");
        let mut counted = Vec::new();
        for frame in 0..11_i32 {
            let pose = NetPose { range_m: 1.0, tilt_y_deg: 8.0, x_m: 0.03 * f64::from(frame), ..NetPose::default() };
            let scene = Scene { layers: vec![Layer { net: net.clone(), pose }], ..Scene::default() };
            let mut image = Image::default();
            simulator.render(&scene, 1 + u64::from(frame.unsigned_abs()), &mut image).expect("a scene");
            if frame == 5 {
                image = Image::new(480, 320);
            }
            // From the third frame on the tracker calls every cell by two less and one more.
            let off = match frame {
                0..2 => Vector2::zeros(),
                2..8 => Vector2::new(2.0, -1.0),
                // Farther off than the vote looks.
                _ => Vector2::new(-21.0, 17.0),
            };
            let pose = pose.pose();
            let axis = mesh.coordinates(pose.net_from_ray(Vector3::z()).expect("in view")) - off;
            let pixel = |at: Vector2<f64>| {
                let at = at + off;
                camera.pixel_from_point(pose.transform(mesh.node(at.x, at.y).push(0.0)))
            };
            let middle = (axis.x.round() as i32, axis.y.round() as i32);
            let (track, corrected) = (u32::from(frame >= 2) + u32::from(frame >= 8), (0, 0));
            let begun = matches!(frame, 2 | 8);
            let connection = if begun { Connection::Restarted } else { Connection::Followed };
            let named = Named { track, connection, corrected, in_doubt: 0 };
            let view = image.view().expect("pixels");
            counted.push(count.step(u64::from(frame.unsigned_abs()), &named, middle, view, pixel).expect("written"));
        }
        count.finish().expect("written");
        let told: Vec<_> = counted.iter().map(|c| (c.stretch, c.offset, c.sure)).collect();
        let (before, after, far) = ((0, (0, 0), true), (0, (2, -1), true), (0, (-21, 17), true));
        let blind = (0, (2, -1), false);
        assert_eq!(told, [before, before, after, after, after, blind, after, after, far, far, far]);
        assert_eq!(counted[8].said, Said::Recognised);
        assert!(counted[8].z > 10.0, "{}", counted[8].z);
        let table = std::fs::read_to_string(dir.path().join("count.csv")).expect("a table");
        assert_eq!(table.lines().count(), 12, "{table}");
    }
}
