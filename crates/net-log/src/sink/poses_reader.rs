//! Reading `poses.csv` back, row after row.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Take};
use std::path::{Path, PathBuf};

use net_geometry::Pose;
use net_geometry::nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};

use crate::error::{Error, Result};
use crate::sink::poses::{COLUMNS, NetColumns, POSES_HEADER, PoseRow, RowStatus};

/// Reads a `poses.csv`, or a truth file of the same columns. A last line that was never finished is left out.
///
/// # Errors
/// [`Error::Table`] names the line, [`Error::Io`] the path.
pub fn read_poses(path: &Path) -> Result<Vec<PoseRow>> {
    let why = "the file is missing or empty".to_owned();
    let rows = PoseRows::open(path)?.ok_or_else(|| Error::Table { path: path.to_owned(), line: 1, why })?;
    rows.collect()
}

/// The rows of a `poses.csv` up to its last complete line, one in memory at a time.
pub struct PoseRows {
    path: PathBuf,
    reader: csv::Reader<Take<File>>,
    header: csv::StringRecord,
    record: csv::StringRecord,
}

impl PoseRows {
    /// Opens the file. `None` if there is none, or no complete line in it.
    ///
    /// # Errors
    /// [`Error::Table`] if the first columns are not those of [`POSES_HEADER`], [`Error::Io`] names the path.
    pub fn open(path: &Path) -> Result<Option<Self>> {
        let mut file = match File::open(path) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            other => other.map_err(Error::io("read", path))?,
        };
        let Some(length) = complete_length(&mut file).map_err(Error::io("read", path))? else { return Ok(None) };
        let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(file.take(length));
        let header = reader.headers().map_err(|e| failed(path, e))?.clone();
        if !header.iter().take(COLUMNS).eq(POSES_HEADER.split(',')) {
            let why = format!("the first columns must be {POSES_HEADER}");
            return Err(Error::Table { path: path.to_owned(), line: 1, why });
        }
        Ok(Some(Self { path: path.to_owned(), reader, header, record: csv::StringRecord::new() }))
    }

    /// Names of all columns.
    pub fn header(&self) -> &csv::StringRecord {
        &self.header
    }

    /// First byte behind the last row that was read.
    pub(crate) fn position(&self) -> u64 {
        self.reader.position().byte()
    }
}

impl Iterator for PoseRows {
    type Item = Result<PoseRow>;

    fn next(&mut self) -> Option<Result<PoseRow>> {
        match self.reader.read_record(&mut self.record) {
            Ok(false) => None,
            Ok(true) => {
                let line = self.record.position().map_or(0, csv::Position::line);
                let path = self.path.clone();
                Some(parse_row(&self.record).map_err(|why| Error::Table { path, line, why }))
            }
            Err(error) => Some(Err(failed(&self.path, error))),
        }
    }
}

fn failed(path: &Path, error: csv::Error) -> Error {
    let line = error.position().map_or(1, csv::Position::line);
    match error.into_kind() {
        csv::ErrorKind::Io(e) => Error::io("read", path)(e),
        csv::ErrorKind::Utf8 { .. } => {
            Error::Table { path: path.to_owned(), line, why: "it is not text in UTF-8".to_owned() }
        }
        other => Error::Table { path: path.to_owned(), line, why: format!("{other:?}") },
    }
}

/// Bytes up to and with the last line feed; the file stands at its beginning then.
fn complete_length(file: &mut File) -> std::io::Result<Option<u64>> {
    const BLOCK: u64 = 1 << 12;
    let mut end = file.seek(SeekFrom::End(0))?;
    let mut block = Vec::new();
    while end > 0 {
        let start = end.saturating_sub(BLOCK);
        file.seek(SeekFrom::Start(start))?;
        block.clear();
        Read::by_ref(file).take(end - start).read_to_end(&mut block)?;
        if let Some(at) = block.iter().rposition(|&b| b == b'\n') {
            file.seek(SeekFrom::Start(0))?;
            return Ok(Some(start + at as u64 + 1));
        }
        end = start;
    }
    Ok(None)
}

fn rotation(q: Quaternion<f64>) -> Option<Rotation3<f64>> {
    UnitQuaternion::try_new(q, 1e-6).map(|unit| unit.to_rotation_matrix())
}

/// The pose as it will be read back, to the last bit: its way through a quaternion rounds.
pub(crate) fn as_read_back(pose: &Pose) -> Pose {
    Pose { rotation: rotation(pose.quaternion().into_inner()).unwrap_or(pose.rotation), ..*pose }
}

fn parse_row(record: &csv::StringRecord) -> std::result::Result<PoseRow, String> {
    let cell = |i: usize| record.get(i).ok_or_else(|| format!("{} columns of {COLUMNS}", record.len()));
    let float = |i: usize| -> std::result::Result<Option<f64>, String> {
        match cell(i)? {
            "" => Ok(None),
            text => text.parse().map(Some).map_err(|_| format!("{text:?} is not a number")),
        }
    };
    let integer = |i: usize| -> std::result::Result<Option<u64>, String> {
        match cell(i)? {
            "" => Ok(None),
            text => text.parse().map(Some).map_err(|_| format!("{text:?} is not a whole number")),
        }
    };
    let word = cell(3)?;
    let status = word.parse().map_err(|()| format!("status {word:?} is none of ok, no_net, unreadable"))?;
    let net = if status == RowStatus::Ok {
        let need =
            |i: usize| float(i)?.filter(|v| v.is_finite()).ok_or_else(|| format!("no number in column {}", i + 1));
        let q = Quaternion::new(need(13)?, need(14)?, need(15)?, need(16)?);
        let rotation = rotation(q).ok_or("the quaternion is zero")?;
        Some(NetColumns {
            range_m: need(5)?,
            distance_m: need(6)?,
            normal: Vector3::new(need(7)?, need(8)?, need(9)?),
            pose: Pose { rotation, translation: Vector3::new(need(10)?, need(11)?, need(12)?) },
            sigma_range_m: float(17)?.unwrap_or(f64::NAN),
            sigma_tilt_deg: float(18)?.unwrap_or(f64::NAN),
            sigma_xy_m: float(19)?.unwrap_or(f64::NAN),
        })
    } else {
        None
    };
    let timestamp = cell(2)?;
    let time = || timestamp.parse().map_err(|_| format!("{timestamp:?} is not a time in ns"));
    let appended = (COLUMNS..record.len()).map(|i| Ok(float(i)?.unwrap_or(f64::NAN)));
    Ok(PoseRow {
        frame: integer(0)?.ok_or("no frame number")?,
        file: cell(1)?.to_owned(),
        timestamp_ns: if timestamp.is_empty() { None } else { Some(time()?) },
        status,
        probability: float(4)?,
        net,
        junctions: integer(20)?,
        latency_ms: float(21)?,
        appended: appended.collect::<std::result::Result<_, String>>()?,
    })
}
