//! `junctions.parquet`: `frame, u, v, i, j, sigma_px, state`, one row per junction.
//!
//! The file is whole between any two writes: rows go into it in groups, and a group is written together with a new footer over the
//! old one, in one piece. What the old footer was is put down beside the file first, so that a process that is killed within that
//! write, or a disk that fills up, costs this group only: [`recover`] puts the old footer back.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use net_geometry::nalgebra::Vector2;
use net_geometry::{Junction, JunctionState};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::reader::{ColumnReader, get_typed_column_reader};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::{FileMetaData, ParquetMetaDataBuilder, ParquetMetaDataWriter};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{Type, TypePtr};

use crate::error::{Error, Result};

/// A group is written when it has this many rows, about 1.5 MB, or
const GROUP_ROWS: usize = 1 << 15;
/// this many frames with junctions, so that little is lost when the process is killed.
const GROUP_FRAMES: usize = 256;

/// The columns, in the contract's order.
fn schema() -> TypePtr {
    let column = |name, physical, repetition, logical| {
        let built =
            Type::primitive_type_builder(name, physical).with_repetition(repetition).with_logical_type(logical).build();
        // These seven are valid, which every test of this file shows.
        Arc::new(built.expect("a valid column"))
    };
    let (required, optional) = (Repetition::REQUIRED, Repetition::OPTIONAL);
    let columns = vec![
        column("frame", Physical::INT64, required, None),
        column("u", Physical::DOUBLE, required, None),
        column("v", Physical::DOUBLE, required, None),
        column("i", Physical::INT32, optional, None),
        column("j", Physical::INT32, optional, None),
        column("sigma_px", Physical::DOUBLE, required, None),
        column("state", Physical::BYTE_ARRAY, required, Some(LogicalType::String)),
    ];
    Arc::new(Type::group_type_builder("junctions").with_fields(columns).build().expect("a valid schema"))
}

/// The rows of a group by column.
#[derive(Debug, Default)]
struct Columns {
    frame: Vec<i64>,
    u: Vec<f64>,
    v: Vec<f64>,
    /// Only of junctions that have an index.
    i: Vec<i32>,
    j: Vec<i32>,
    /// For every row: 1 with an index, 0 without.
    indexed: Vec<i16>,
    sigma_px: Vec<f64>,
    state: Vec<ByteArray>,
    /// Frames in it.
    frames: usize,
}

impl Columns {
    fn push(&mut self, frame: i64, junction: &Junction) {
        self.frame.push(frame);
        self.u.push(junction.pixel.x);
        self.v.push(junction.pixel.y);
        if let Some((i, j)) = junction.index {
            self.i.push(i);
            self.j.push(j);
        }
        self.indexed.push(i16::from(junction.index.is_some()));
        self.sigma_px.push(junction.sigma_px);
        self.state.push(ByteArray::from(junction.state.as_str()));
    }

    fn clear(&mut self) {
        let Self { frame, u, v, i, j, indexed, sigma_px, state, frames } = self;
        frame.clear();
        [u, v, sigma_px].into_iter().for_each(Vec::clear);
        [i, j].into_iter().for_each(Vec::clear);
        indexed.clear();
        state.clear();
        *frames = 0;
    }
}

/// The file, which is written in whole pieces only.
#[derive(Debug)]
struct Pieces {
    file: File,
    /// First byte behind the groups: where the footer begins.
    groups_end: u64,
    /// What is to be written next.
    piece: Vec<u8>,
    /// The footer that is in the file.
    footer: Vec<u8>,
    /// Where the footer is put down while the file changes.
    journal: PathBuf,
}

impl Write for Pieces {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.piece.extend_from_slice(bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Pieces {
    /// Writes what has been collected, and the footer behind it.
    fn commit(&mut self, footer: Vec<u8>) -> std::io::Result<()> {
        let old = [&self.groups_end.to_le_bytes()[..], &self.footer].concat();
        std::fs::write(&self.journal, old)?;
        let groups = self.piece.len();
        self.piece.extend_from_slice(&footer);
        let written = self.put(&self.piece);
        if written.is_err() {
            // The file as it was: what a full disk held before, it holds again.
            self.piece.truncate(groups);
            self.put(&self.footer)?;
            return written;
        }
        self.groups_end += groups as u64;
        self.footer = footer;
        self.piece.clear();
        Ok(())
    }

    /// Replaces what is behind the groups.
    fn put(&self, tail: &[u8]) -> std::io::Result<()> {
        let mut file = &self.file;
        file.set_len(self.groups_end)?;
        file.seek(SeekFrom::Start(self.groups_end))?;
        file.write_all(tail)
    }
}

/// Where the footer of `path` is put down while the file changes.
pub(crate) fn journal(path: &Path) -> PathBuf {
    path.with_extension("parquet.journal")
}

/// Writes `junctions.parquet`. Memory does not grow with the file, but for about 1 kB per 32,768 rows.
pub struct JunctionsParquet {
    path: PathBuf,
    writer: SerializedFileWriter<Pieces>,
    rows: Columns,
}

impl std::fmt::Debug for JunctionsParquet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("JunctionsParquet").field("path", &self.path).finish_non_exhaustive()
    }
}

impl JunctionsParquet {
    /// Starts a new file; it is valid, and empty, at once.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(Error::io("create", path))?;
        let pieces = Pieces { file, groups_end: 0, piece: Vec::new(), footer: Vec::new(), journal: journal(path) };
        let properties = WriterProperties::builder()
            .set_created_by(concat!("netpose ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_compression(Compression::SNAPPY)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_offset_index_disabled(true)
            .build();
        let writer =
            SerializedFileWriter::new(pieces, schema(), Arc::new(properties)).map_err(failed("write", path))?;
        let mut this = Self { path: path.to_owned(), writer, rows: Columns::default() };
        this.commit()?;
        Ok(this)
    }

    /// Adds the junctions of a frame.
    ///
    /// # Errors
    /// [`Error::Value`] for a junction that is not finite; [`Error::Io`] names the path.
    pub fn write(&mut self, frame: u64, junctions: &[Junction]) -> Result<()> {
        let not_finite = |j: &&Junction| !(j.pixel.x.is_finite() && j.pixel.y.is_finite());
        if let Some(j) = junctions.iter().find(not_finite) {
            let value = format!("({}, {})", j.pixel.x, j.pixel.y);
            return Err(Error::Value { field: "junction", value, expected: "finite pixels" });
        }
        let number = i64::try_from(frame).map_err(|_| Error::Value {
            field: "frame",
            value: frame.to_string(),
            expected: "at most 2^63 - 1",
        })?;
        junctions.iter().for_each(|j| self.rows.push(number, j));
        self.rows.frames += usize::from(!junctions.is_empty());
        if self.rows.frame.len() < GROUP_ROWS && self.rows.frames < GROUP_FRAMES {
            return Ok(());
        }
        self.checkpoint()
    }

    /// Writes what there is, so that all of it is in the file.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn checkpoint(&mut self) -> Result<()> {
        self.write_group()?;
        self.commit()
    }

    /// Writes what is left and closes the file.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn finish(mut self) -> Result<()> {
        self.checkpoint()?;
        let journal = journal(&self.path);
        std::fs::remove_file(&journal).map_err(Error::io("remove", &journal))
    }

    fn write_group(&mut self) -> Result<()> {
        if self.rows.frame.is_empty() {
            return Ok(());
        }
        let rows = &self.rows;
        let write = || -> parquet::errors::Result<()> {
            let mut group = self.writer.next_row_group()?;
            let mut column = 0;
            while let Some(mut writer) = group.next_column()? {
                let present = Some(&rows.indexed[..]);
                match column {
                    0 => writer.typed::<Int64Type>().write_batch(&rows.frame, None, None)?,
                    1 => writer.typed::<DoubleType>().write_batch(&rows.u, None, None)?,
                    2 => writer.typed::<DoubleType>().write_batch(&rows.v, None, None)?,
                    3 => writer.typed::<Int32Type>().write_batch(&rows.i, present, None)?,
                    4 => writer.typed::<Int32Type>().write_batch(&rows.j, present, None)?,
                    5 => writer.typed::<DoubleType>().write_batch(&rows.sigma_px, None, None)?,
                    _ => writer.typed::<ByteArrayType>().write_batch(&rows.state, None, None)?,
                };
                writer.close()?;
                column += 1;
            }
            group.close().map(drop)
        };
        let written = { write }();
        written.map_err(failed("write", &self.path))?;
        self.rows.clear();
        Ok(())
    }

    /// Writes the groups that are not in the file yet, with a footer that covers all groups.
    fn commit(&mut self) -> Result<()> {
        self.writer.flush().map_err(Error::io("write", &self.path))?;
        let groups = self.writer.flushed_row_groups().to_vec();
        let rows = groups.iter().map(|g| g.num_rows()).sum();
        let created_by = Some(self.writer.properties().created_by().to_owned());
        let schema = Arc::new(parquet::schema::types::SchemaDescriptor::new(schema()));
        let metadata = FileMetaData::new(1, rows, created_by, None, schema, None);
        let metadata = ParquetMetaDataBuilder::new(metadata).set_row_groups(groups).build();
        let mut footer = Vec::new();
        ParquetMetaDataWriter::new(&mut footer, &metadata).finish().map_err(failed("write", &self.path))?;
        self.writer.inner_mut().commit(footer).map_err(Error::io("write", &self.path))
    }
}

/// For `map_err`.
fn failed(action: &'static str, path: &Path) -> impl Fn(ParquetError) -> Error + use<> {
    let path = path.to_owned();
    move |error| match error {
        ParquetError::External(e) => {
            let source = e.downcast::<std::io::Error>().map_or_else(std::io::Error::other, |e| *e);
            Error::Io { action, path: path.clone(), source }
        }
        other => Error::Damaged { path: path.clone(), why: other.to_string() },
    }
}

/// Reads `junctions.parquet`, frame after frame, one group of rows in memory at a time.
///
/// # Errors
/// [`Error::Io`] and [`Error::Damaged`] name the path; each item is an error of the same kind.
pub fn read_junctions(path: &Path) -> Result<Junctions> {
    let file = File::open(path).map_err(Error::io("read", path))?;
    let reader = SerializedFileReader::new(file).map_err(failed("read", path))?;
    if reader.metadata().file_metadata().schema().get_fields() != schema().get_fields() {
        let why = "its columns are not frame, u, v, i, j, sigma_px, state".to_owned();
        return Err(Error::Damaged { path: path.to_owned(), why });
    }
    Ok(Junctions { path: path.to_owned(), reader, next_group: 0, rows: Vec::new().into_iter(), pending: None })
}

/// The frames of a `junctions.parquet` that have junctions, in its order.
pub struct Junctions {
    path: PathBuf,
    reader: SerializedFileReader<File>,
    next_group: usize,
    rows: std::vec::IntoIter<(u64, Junction)>,
    /// First row of the next frame.
    pending: Option<(u64, Junction)>,
}

impl Junctions {
    fn next_row(&mut self) -> Option<Result<(u64, Junction)>> {
        loop {
            if let Some(row) = self.rows.next() {
                return Some(Ok(row));
            }
            if self.next_group >= self.reader.num_row_groups() {
                return None;
            }
            match read_group(&self.reader, self.next_group) {
                Ok(rows) => self.rows = rows.into_iter(),
                Err(error) => {
                    self.next_group = usize::MAX;
                    return Some(Err(failed("read", &self.path)(error)));
                }
            }
            self.next_group += 1;
        }
    }
}

impl Iterator for Junctions {
    type Item = Result<(u64, Vec<Junction>)>;

    fn next(&mut self) -> Option<Self::Item> {
        let (frame, first) = match self.pending.take() {
            Some(row) => row,
            None => match self.next_row()? {
                Ok(row) => row,
                Err(error) => return Some(Err(error)),
            },
        };
        let mut junctions = vec![first];
        loop {
            match self.next_row() {
                Some(Ok((f, junction))) if f == frame => junctions.push(junction),
                Some(Ok(row)) => {
                    self.pending = Some(row);
                    return Some(Ok((frame, junctions)));
                }
                Some(Err(error)) => return Some(Err(error)),
                None => return Some(Ok((frame, junctions))),
            }
        }
    }
}

fn read_group(reader: &SerializedFileReader<File>, index: usize) -> parquet::errors::Result<Vec<(u64, Junction)>> {
    let group = reader.get_row_group(index)?;
    let count = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    fn read<T: DataType>(column: ColumnReader, count: usize) -> parquet::errors::Result<(Vec<T::T>, Vec<i16>)> {
        let (mut values, mut levels) = (Vec::new(), Vec::new());
        let mut reader = get_typed_column_reader::<T>(column);
        while levels.len().max(values.len()) < count {
            let left = count - levels.len().max(values.len());
            let (records, _, _) = reader.read_records(left, Some(&mut levels), None, &mut values)?;
            if records == 0 {
                return Err(ParquetError::EOF("a column ends before its group".to_owned()));
            }
        }
        Ok((values, levels))
    }
    let column = |i| group.get_column_reader(i);
    let (frame, _) = read::<Int64Type>(column(0)?, count)?;
    let (u, _) = read::<DoubleType>(column(1)?, count)?;
    let (v, _) = read::<DoubleType>(column(2)?, count)?;
    let (i, indexed) = read::<Int32Type>(column(3)?, count)?;
    let (j, _) = read::<Int32Type>(column(4)?, count)?;
    let (sigma_px, _) = read::<DoubleType>(column(5)?, count)?;
    let (state, _) = read::<ByteArrayType>(column(6)?, count)?;
    let mut indices = i.into_iter().zip(j);
    (0..count)
        .map(|row| {
            let index = if indexed.get(row) == Some(&1) { indices.next() } else { None };
            let word = state[row].as_utf8()?;
            let states = [JunctionState::Seen, JunctionState::Hidden, JunctionState::Fouled, JunctionState::Missing];
            let state = states.into_iter().find(|s| s.as_str() == word);
            let state = state.ok_or_else(|| ParquetError::General(format!("state {word:?} is not known")))?;
            let frame =
                u64::try_from(frame[row]).map_err(|_| ParquetError::General("a frame below zero".to_owned()))?;
            Ok((frame, Junction { pixel: Vector2::new(u[row], v[row]), index, sigma_px: sigma_px[row], state }))
        })
        .collect()
}

/// Puts the old footer back to a file that was torn while a group was written to it. `false` if there is no file, or if it is
/// beyond help.
///
/// # Errors
/// [`Error::Io`] names the path.
pub(crate) fn recover(path: &Path, journal: &Path) -> Result<bool> {
    let whole = || File::open(path).is_ok_and(|f| SerializedFileReader::new(f).is_ok());
    if whole() {
        return Ok(true);
    }
    let Ok(old) = std::fs::read(journal) else { return Ok(false) };
    let Some((groups_end, footer)) = old.split_first_chunk() else { return Ok(false) };
    let mut file = match std::fs::OpenOptions::new().write(true).open(path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(false),
        other => other.map_err(Error::io("write", path))?,
    };
    let groups_end = u64::from_le_bytes(*groups_end);
    let put_back =
        file.set_len(groups_end).and_then(|()| file.seek(SeekFrom::End(0))).and_then(|_| file.write_all(footer));
    put_back.map_err(Error::io("write", path))?;
    Ok(whole())
}
