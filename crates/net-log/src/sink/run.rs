//! The folder of a run: which files are in it, and how a run that was stopped goes on.
//!
//! Two files hold the results: `poses.csv`, whole after every frame, and `junctions.parquet`, whole after every group of frames.
//! `trajectory.tum` is written along. `annotated.mcap` is made from the first two at the end, so that it never exists half.

use std::path::{Path, PathBuf};

use net_geometry::{Camera, Junction};

use crate::error::{Error, Result};
use crate::sink::annotated::AnnotatedMcap;
use crate::sink::junctions::{JunctionsParquet, journal, read_junctions, recover};
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
            trajectory: TrajectoryTum::create(&paths.trajectory())?,
            paths,
        })
    }

    /// Goes on where an earlier run was stopped, whatever stopped it. Returns the rows that stand: the frames up to the first one
    /// whose row or whose junctions are not all there. The next frame to be written is the one after the last of them.
    ///
    /// # Errors
    /// [`Error::Io`] names the path; [`Error::Table`] if `poses.csv` has other columns.
    pub fn resume(dir: &Path, appended: &[&str]) -> Result<(Self, Vec<PoseRow>)> {
        let paths = RunPaths::new(dir);
        let Some(rows) = PoseRows::open(&paths.poses())? else {
            return Ok((Self::create(dir, appended)?, Vec::new()));
        };
        let mut rows = rows.collect::<Result<Vec<_>>>()?;
        let junctions = junctions_kept(&paths, &mut rows)?;
        let (poses, _) = PosesCsv::resume_behind(&paths.poses(), appended, rows.len() as u64)?;
        let trajectory = resume_trajectory(&paths.trajectory(), &rows)?;
        Ok((Self { paths, poses, junctions, trajectory }, rows))
    }

    /// Where the files are.
    pub fn paths(&self) -> &RunPaths {
        &self.paths
    }

    /// Adds a frame. `row.junctions` must be the number of `junctions`, or `None` for none of them.
    ///
    /// # Errors
    /// [`Error::Value`] for what may not be written; [`Error::Io`] names the path.
    pub fn write(&mut self, row: &PoseRow, junctions: &[Junction]) -> Result<()> {
        if row.junctions.unwrap_or(0) != junctions.len() as u64 {
            let value = format!("{:?} in the row and {} in the list", row.junctions, junctions.len());
            return Err(Error::Value { field: "junctions", value, expected: "the same number" });
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
        let Self { paths, poses, junctions, trajectory } = self;
        drop((poses, trajectory));
        junctions.finish()?;
        replace(&paths.annotated(), |temporary| annotate(&paths, temporary, camera, camera_frame))
    }
}

/// Keeps of `rows` those up to the first one whose junctions are missing, and writes their junctions anew.
fn junctions_kept(paths: &RunPaths, rows: &mut Vec<PoseRow>) -> Result<JunctionsParquet> {
    let (path, old) = (paths.junctions(), paths.dir.join("junctions.parquet.old"));
    // A resume that was itself stopped has left the old file, which has at least as much as the new one.
    if !old.exists() && recover(&path, &journal(&path))? {
        std::fs::rename(&path, &old).map_err(Error::io("write", &old))?;
    }
    let mut new = JunctionsParquet::create(&path)?;
    let mut frames = if old.exists() { Some(read_junctions(&old)?) } else { None };
    let mut next = || frames.as_mut().and_then(Iterator::next).transpose();
    let mut kept = 0;
    let mut found = next()?;
    for row in rows.iter() {
        // Frames without a row in poses.csv can't be placed; they will come again.
        while found.as_ref().is_some_and(|(frame, _)| *frame < row.frame) {
            found = next()?;
        }
        let wanted = row.junctions.unwrap_or(0);
        match &found {
            Some((frame, junctions)) if *frame == row.frame && junctions.len() as u64 == wanted => {
                new.write(row.frame, junctions)?;
            }
            _ if wanted == 0 => {}
            _ => break,
        }
        kept += 1;
    }
    rows.truncate(kept);
    new.checkpoint()?;
    match std::fs::remove_file(&old) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io("remove", &old)(e)),
        _ => Ok(new),
    }
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
    let mut frames = read_junctions(&paths.junctions())?;
    let mut found = frames.next().transpose()?;
    for row in PoseRows::open(&paths.poses())?.into_iter().flatten() {
        let row = row?;
        while found.as_ref().is_some_and(|(frame, _)| *frame < row.frame) {
            found = frames.next().transpose()?;
        }
        let junctions = found.as_ref().filter(|(frame, _)| *frame == row.frame).map_or(&[][..], |(_, j)| j);
        annotated.write(&row, junctions)?;
    }
    annotated.finish()
}
