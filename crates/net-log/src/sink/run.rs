//! The folder of a run: which files are in it, and how a run that was stopped goes on.
//!
//! Three files hold the results: `poses.csv`, whole after every frame, and `junctions.parquet` and `twines.parquet`, whole after every group of frames. A frame's twines are in
//! their file before its junctions are in theirs. `trajectory.tum` is written along. `annotated.mcap` is made from the first three at the end, so that it never exists half.

use std::path::{Path, PathBuf};

use net_geometry::{Camera, Junction, Twine};

use crate::error::{Error, Result};
use crate::sink::annotated::AnnotatedMcap;
use crate::sink::frames::{FrameRow, Frames, JunctionsParquet, TwinesParquet, journal, read, recover};
use crate::sink::poses::{PoseRow, PosesCsv};
use crate::sink::poses_reader::{PoseRows, as_read_back};
use crate::sink::summary::replace;
use crate::sink::trajectory::TrajectoryTum;

/// Paths of the files of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunPaths {
    /// The folder.
    pub dir: PathBuf,
}

impl RunPaths {
    /// Of the run in `dir`.
    pub fn new(dir: &Path) -> Self {
        Self { dir: dir.to_owned() }
    }
    /// One row per frame.
    pub fn poses(&self) -> PathBuf {
        self.dir.join("poses.csv")
    }
    /// One row per junction.
    pub fn junctions(&self) -> PathBuf {
        self.dir.join("junctions.parquet")
    }
    /// One row per twine.
    pub fn twines(&self) -> PathBuf {
        self.dir.join("twines.parquet")
    }
    /// The camera's way in the net frame.
    pub fn trajectory(&self) -> PathBuf {
        self.dir.join("trajectory.tum")
    }
    /// Annotations for Foxglove and Rerun.
    pub fn annotated(&self) -> PathBuf {
        self.dir.join("annotated.mcap")
    }
    /// Plots and example overlays.
    pub fn report(&self) -> PathBuf {
        self.dir.join("report.html")
    }
    /// What was run, on what, and how it went.
    pub fn summary(&self) -> PathBuf {
        self.dir.join("run.json")
    }
}

/// Writes the files of a run, frame after frame.
#[derive(Debug)]
pub struct RunFiles {
    paths: RunPaths,
    poses: PosesCsv,
    junctions: JunctionsParquet,
    twines: TwinesParquet,
    trajectory: TrajectoryTum,
}

impl RunFiles {
    /// Makes the folder, if it is not there, and starts all files anew. `appended` names columns that follow the usual ones of
    /// `poses.csv`.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn create(dir: &Path, appended: &[&str]) -> Result<Self> {
        std::fs::create_dir_all(dir).map_err(Error::io("create", dir))?;
        let paths = RunPaths::new(dir);
        // What an earlier run has left must not stand beside the results of this one.
        for stale in [paths.annotated(), paths.report(), paths.summary()] {
            match std::fs::remove_file(&stale) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::io("remove", &stale)(e)),
                _ => {}
            }
        }
        Ok(Self {
            poses: PosesCsv::create(&paths.poses(), appended)?,
            junctions: JunctionsParquet::create(&paths.junctions())?,
            twines: TwinesParquet::create(&paths.twines())?,
            trajectory: TrajectoryTum::create(&paths.trajectory())?,
            paths,
        })
    }

    /// Goes on where an earlier run was stopped, whatever stopped it. Returns the rows that stand: the frames up to the first one
    /// whose row, junctions or twines are not all there. The next frame to be written is the one after the last of them.
    ///
    /// # Errors
    /// [`Error::Io`] names the path; [`Error::Table`] if `poses.csv` has other columns.
    pub fn resume(dir: &Path, appended: &[&str]) -> Result<(Self, Vec<PoseRow>)> {
        let paths = RunPaths::new(dir);
        let Some(rows) = PoseRows::open(&paths.poses())? else {
            return Ok((Self::create(dir, appended)?, Vec::new()));
        };
        let mut rows = rows.collect::<Result<Vec<_>>>()?;
        let told = Earlier::<Twine>::of(&paths.twines())?;
        let last = told.rows.frames.as_ref().and_then(Frames::last_frame);
        // Frames without junctions have no twines.
        let there = |row: &PoseRow| row.junctions.unwrap_or(0) == 0 || last.is_some_and(|last| row.frame <= last);
        rows.truncate(rows.iter().position(|row| !there(row)).unwrap_or(rows.len()));
        let junctions = junctions_kept(&paths, &mut rows)?;
        let twines = twines_kept(&paths, told, &rows)?;
        let (poses, _) = PosesCsv::resume_behind(&paths.poses(), appended, rows.len() as u64)?;
        let trajectory = resume_trajectory(&paths.trajectory(), &rows)?;
        Ok((Self { paths, poses, junctions, twines, trajectory }, rows))
    }

    /// Where the files are.
    pub fn paths(&self) -> &RunPaths {
        &self.paths
    }

    /// Adds a frame. `row.junctions` must be the number of `junctions`, or `None` for none of them; without junctions, twines are not written.
    ///
    /// # Errors
    /// [`Error::Value`] for what may not be written; [`Error::Io`] names the path.
    pub fn write(&mut self, row: &PoseRow, junctions: &[Junction], twines: &[Twine]) -> Result<()> {
        if row.junctions.unwrap_or(0) != junctions.len() as u64 {
            let value = format!("{:?} in the row and {} in the list", row.junctions, junctions.len());
            return Err(Error::Value { field: "junctions", value, expected: "the same number" });
        }
        let filled = self.junctions.is_filled_by(junctions.len());
        self.twines.write(row.frame, if junctions.is_empty() { &[] } else { twines })?;
        if filled {
            self.twines.checkpoint()?;
        }
        self.junctions.write(row.frame, junctions)?;
        self.poses.write(row)?;
        if let (Some(net), Some(time)) = (&row.net, row.timestamp_ns) {
            // A resumed run may have to make this line anew from poses.csv: then, too, byte for byte.
            self.trajectory.write(time, &as_read_back(&net.pose))?;
        }
        Ok(())
    }

    /// Closes the files and makes `annotated.mcap` from them. To be called at the end and after a stop alike.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn finish(self, camera: &Camera, camera_frame: &str) -> Result<()> {
        let Self { paths, poses, junctions, twines, trajectory } = self;
        drop((poses, trajectory));
        // Each as far as it goes: if one fails, the other is whole.
        twines.finish().and(junctions.finish())?;
        replace(&paths.annotated(), |temporary| annotate(&paths, temporary, camera, camera_frame))
    }
}

/// A table read in step with `poses.csv`.
struct InStep<R: FrameRow> {
    frames: Option<Frames<R>>,
    next: Option<(u64, Vec<R>)>,
}

impl<R: FrameRow> InStep<R> {
    /// Opens the table at `path`; one that is not there is empty.
    fn open(path: &Path) -> Result<Self> {
        let mut frames = if path.exists() { Some(read(path)?) } else { None };
        let next = frames.as_mut().and_then(Iterator::next).transpose()?;
        Ok(Self { frames, next })
    }

    /// The rows of a frame; frames are asked for in order. What lies between them can't be placed, and is passed over.
    fn of_frame(&mut self, frame: u64) -> Result<&[R]> {
        while self.next.as_ref().is_some_and(|(number, _)| *number < frame) {
            self.next = self.frames.as_mut().and_then(Iterator::next).transpose()?;
        }
        Ok(self.next.as_ref().filter(|(number, _)| *number == frame).map_or(&[], |(_, rows)| rows))
    }
}

/// A table of an earlier run, out of the way of the new one until this is finished.
struct Earlier<R: FrameRow> {
    path: PathBuf,
    rows: InStep<R>,
}

impl<R: FrameRow> Earlier<R> {
    /// Moves the table at `path`, if there is one that can be read.
    fn of(path: &Path) -> Result<Self> {
        let old = path.with_extension("parquet.old");
        // A resume that was itself stopped has left the old file, which has at least as much as the new one.
        if !old.exists() && recover(path, &journal(path))? {
            std::fs::rename(path, &old).map_err(Error::io("write", &old))?;
        }
        let rows = InStep::open(&old)?;
        Ok(Self { path: old, rows })
    }

    fn finish(self) -> Result<()> {
        match std::fs::remove_file(&self.path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io("remove", &self.path)(e)),
            _ => Ok(()),
        }
    }
}

/// Keeps of `rows` those up to the first one whose junctions are missing, and writes their junctions anew.
fn junctions_kept(paths: &RunPaths, rows: &mut Vec<PoseRow>) -> Result<JunctionsParquet> {
    let mut old = Earlier::<Junction>::of(&paths.junctions())?;
    let mut new = JunctionsParquet::create(&paths.junctions())?;
    let mut kept = 0;
    for row in rows.iter() {
        let wanted = row.junctions.unwrap_or(0);
        let junctions = old.rows.of_frame(row.frame)?;
        if junctions.len() as u64 == wanted {
            new.write(row.frame, junctions)?;
        } else if wanted > 0 {
            break;
        }
        kept += 1;
    }
    rows.truncate(kept);
    new.checkpoint()?;
    old.finish().map(|()| new)
}

/// Writes the twines of `rows` anew.
fn twines_kept(paths: &RunPaths, mut old: Earlier<Twine>, rows: &[PoseRow]) -> Result<TwinesParquet> {
    let mut new = TwinesParquet::create(&paths.twines())?;
    for row in rows {
        new.write(row.frame, old.rows.of_frame(row.frame)?)?;
    }
    new.checkpoint()?;
    old.finish().map(|()| new)
}

/// Goes on behind the lines of `rows`; makes them anew if they are not all there.
fn resume_trajectory(path: &Path, rows: &[PoseRow]) -> Result<TrajectoryTum> {
    let poses = || rows.iter().filter_map(|row| Some((row.timestamp_ns?, row.net.as_ref()?)));
    if let Some(trajectory) = TrajectoryTum::resume_behind(path, poses().count())? {
        return Ok(trajectory);
    }
    let mut trajectory = TrajectoryTum::create(path)?;
    poses().try_for_each(|(time, net)| trajectory.write(time, &net.pose))?;
    Ok(trajectory)
}

fn annotate(paths: &RunPaths, out: &Path, camera: &Camera, camera_frame: &str) -> Result<()> {
    let mut annotated = AnnotatedMcap::create(out, camera, camera_frame)?;
    let (mut junctions, mut twines) =
        (InStep::<Junction>::open(&paths.junctions())?, InStep::<Twine>::open(&paths.twines())?);
    for row in PoseRows::open(&paths.poses())?.into_iter().flatten() {
        let row = row?;
        annotated.write(&row, junctions.of_frame(row.frame)?, twines.of_frame(row.frame)?)?;
    }
    annotated.finish()
}
