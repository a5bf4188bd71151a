//! `poses.csv`: one row per frame of the log, in its order.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use net_geometry::Pose;
use net_geometry::nalgebra::Vector3;

use crate::error::{Error, Result};
use crate::sink::poses_reader::PoseRows;

/// The columns that every `poses.csv` has, in this order. More may follow them.
pub const POSES_HEADER: &str = "frame,file,timestamp_ns,status,probability,range_m,distance_m,normal_x,normal_y,normal_z,\
                                tx,ty,tz,qw,qx,qy,qz,sigma_range_m,sigma_tilt_deg,sigma_xy_m,junctions,latency_ms";

/// Number of columns in [`POSES_HEADER`].
pub(super) const COLUMNS: usize = 22;

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RowStatus {
    /// A net, and its pose is valid.
    Ok,
    /// No net, or none whose pose can be vouched for.
    NoNet,
    /// The frame could not be read.
    Unreadable,
}

impl RowStatus {
    /// The word used in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::NoNet => "no_net",
            Self::Unreadable => "unreadable",
        }
    }
}

impl std::str::FromStr for RowStatus {
    type Err = ();

    fn from_str(word: &str) -> std::result::Result<Self, ()> {
        [Self::Ok, Self::NoNet, Self::Unreadable].into_iter().find(|s| s.as_str() == word).ok_or(())
    }
}

/// The columns that only rows of status [`RowStatus::Ok`] fill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NetColumns {
    /// From the camera centre to the net along the optical axis, m.
    pub range_m: f64,
    /// Perpendicular distance, m.
    pub distance_m: f64,
    /// The net's unit normal in the camera frame, positive z.
    pub normal: Vector3<f64>,
    /// Net to camera.
    pub pose: Pose,
    /// One standard deviation of the range, m.
    pub sigma_range_m: f64,
    /// One standard deviation of the normal's direction, degrees.
    pub sigma_tilt_deg: f64,
    /// One standard deviation of the position along the net, m, each axis.
    pub sigma_xy_m: f64,
}

/// One row.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseRow {
    /// Number of the frame in the log, from 0.
    pub frame: u64,
    /// File or topic that the frame came from.
    pub file: String,
    /// ns since the Unix epoch; `None`, an empty cell, for a frame that has no time.
    pub timestamp_ns: Option<i64>,
    /// What became of the frame.
    pub status: RowStatus,
    /// In [0, 1]: that the frame shows a net and that the pose is right. `None` for an unreadable frame.
    pub probability: Option<f64>,
    /// The pose: with [`RowStatus::Ok`], and with no other.
    pub net: Option<NetColumns>,
    /// Number of junctions found. `None` for an unreadable frame.
    pub junctions: Option<u64>,
    /// From the decoded picture to its result, ms. `None` for an unreadable frame.
    pub latency_ms: Option<f64>,
    /// Values of the appended columns, as many as there are; NaN is an empty cell.
    pub appended: Vec<f64>,
}

impl PoseRow {
    /// The row of a frame that could not be read.
    pub fn unreadable(frame: u64, file: &str, timestamp_ns: Option<i64>) -> Self {
        Self {
            frame,
            file: file.to_owned(),
            timestamp_ns,
            status: RowStatus::Unreadable,
            probability: None,
            net: None,
            junctions: None,
            latency_ms: None,
            appended: Vec::new(),
        }
    }

    /// The cells as text. Numbers have as many digits as it takes to read back the same value, and never an exponent.
    fn cells(&self, appended: usize) -> Result<Vec<String>> {
        let wrong = |field, value: String, expected| Err(Error::Value { field, value, expected });
        if (self.status == RowStatus::Ok) != self.net.is_some() {
            return wrong("pose", format!("in a row of status {}", self.status.as_str()), "one for ok, none otherwise");
        }
        if let Some(p) = self.probability.filter(|p| !(0.0..=1.0).contains(p)) {
            return wrong("probability", p.to_string(), "between 0 and 1");
        }
        let mut cells = Vec::with_capacity(COLUMNS + appended);
        cells.push(self.frame.to_string());
        cells.push(self.file.clone());
        cells.push(self.timestamp_ns.map_or_else(String::new, |t| t.to_string()));
        cells.push(self.status.as_str().to_owned());
        cells.push(number(self.probability));
        match &self.net {
            None => cells.extend(std::iter::repeat_n(String::new(), 15)),
            Some(net) => {
                let (n, t, q) = (net.normal, net.pose.translation, net.pose.quaternion());
                let pose = [net.range_m, net.distance_m, n.x, n.y, n.z, t.x, t.y, t.z, q.w, q.i, q.j, q.k];
                if let Some(value) = pose.iter().find(|v| !v.is_finite()) {
                    return wrong("pose", value.to_string(), "finite numbers");
                }
                cells.extend(pose.map(|v| number(Some(v))));
                // A sigma that is not known is an empty cell.
                cells.extend([net.sigma_range_m, net.sigma_tilt_deg, net.sigma_xy_m].map(|v| number(Some(v))));
            }
        }
        cells.push(self.junctions.map_or_else(String::new, |n| n.to_string()));
        cells.push(number(self.latency_ms));
        if self.appended.len() > appended {
            return wrong("appended columns", self.appended.len().to_string(), "as many as the header has, at most");
        }
        cells.extend((0..appended).map(|i| number(self.appended.get(i).copied())));
        Ok(cells)
    }
}

/// A cell; empty for what is unknown or not finite.
fn number(value: Option<f64>) -> String {
    value.filter(|v| v.is_finite()).map_or_else(String::new, |v| v.to_string())
}

/// Writes `poses.csv`. Every row is in the file when [`PosesCsv::write`] returns, so that a run may be stopped at any time.
#[derive(Debug)]
pub struct PosesCsv {
    path: PathBuf,
    writer: csv::Writer<BufWriter<File>>,
    appended: usize,
}

/// What an earlier run left behind.
#[derive(Debug, Clone, PartialEq)]
pub struct Resumed {
    /// Rows that are complete.
    pub rows: u64,
    /// Number of the last frame that has a row.
    pub last_frame: Option<u64>,
}

impl PosesCsv {
    /// Starts a new file, with the names of the columns that follow the usual ones.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn create(path: &Path, appended: &[&str]) -> Result<Self> {
        let file = File::create(path).map_err(Error::io("create", path))?;
        let mut this = Self::over(path, file, appended.len());
        let header = POSES_HEADER.split(',').chain(appended.iter().copied());
        this.writer.write_record(header).map_err(|e| this.failed(e))?;
        this.flush()?;
        Ok(this)
    }

    /// Goes on behind the last complete row of an earlier run; a line that was never finished is cut off. Starts a new file if
    /// there is none, or if not even its header is complete.
    ///
    /// # Errors
    /// [`Error::Table`] if the columns are others, or a row can't be read; [`Error::Io`] names the path.
    pub fn resume(path: &Path, appended: &[&str]) -> Result<(Self, Resumed)> {
        Self::resume_behind(path, appended, u64::MAX)
    }

    /// As [`PosesCsv::resume`], keeping no more than the first `most` rows.
    pub(crate) fn resume_behind(path: &Path, appended: &[&str], most: u64) -> Result<(Self, Resumed)> {
        let nothing = Resumed { rows: 0, last_frame: None };
        let Some(mut rows) = PoseRows::open(path)? else {
            return Ok((Self::create(path, appended)?, nothing));
        };
        if !rows.header().iter().eq(POSES_HEADER.split(',').chain(appended.iter().copied())) {
            let header: Vec<&str> = std::iter::once(POSES_HEADER).chain(appended.iter().copied()).collect();
            let why = format!("the columns are not those of this version, which are {}", header.join(","));
            return Err(Error::Table { path: path.to_owned(), line: 1, why });
        }
        let mut resumed = nothing;
        while resumed.rows < most
            && let Some(row) = rows.next()
        {
            resumed = Resumed { rows: resumed.rows + 1, last_frame: Some(row?.frame) };
        }
        let end = rows.position();
        let mut file = OpenOptions::new().write(true).open(path).map_err(Error::io("write", path))?;
        file.set_len(end).map_err(Error::io("write", path))?;
        file.seek(SeekFrom::End(0)).map_err(Error::io("write", path))?;
        Ok((Self::over(path, file, appended.len()), resumed))
    }

    fn over(path: &Path, file: File, appended: usize) -> Self {
        Self { path: path.to_owned(), writer: csv::Writer::from_writer(BufWriter::new(file)), appended }
    }

    /// Writes one row and hands it to the system.
    ///
    /// # Errors
    /// [`Error::Value`] for a pose that is not finite, or that does not go with the status; [`Error::Io`] names the path.
    pub fn write(&mut self, row: &PoseRow) -> Result<()> {
        let cells = row.cells(self.appended)?;
        self.writer.write_record(cells).map_err(|e| self.failed(e))?;
        self.flush()
    }

    fn flush(&mut self) -> Result<()> {
        self.writer.flush().map_err(Error::io("write", &self.path))
    }

    fn failed(&self, error: csv::Error) -> Error {
        Error::io("write", &self.path)(match error.into_kind() {
            csv::ErrorKind::Io(e) => e,
            other => std::io::Error::other(format!("{other:?}")),
        })
    }
}
