//! Reading tables of frames.

use std::fs::File;
use std::path::{Path, PathBuf};

use net_geometry::{Junction, Twine};
use parquet::data_type::Int64Type;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::writer::LAST_FRAME;
use super::{FrameRow, column, failed, schema};
use crate::error::{Error, Result};

/// Reads `junctions.parquet`, frame after frame, one group of rows in memory at a time.
///
/// # Errors
/// [`Error::Io`] and [`Error::Damaged`] name the path; each item is an error of the same kind.
pub fn read_junctions(path: &Path) -> Result<Frames<Junction>> {
    read(path)
}

/// Reads `twines.parquet`, frame after frame, one group of rows in memory at a time.
///
/// # Errors
/// [`Error::Io`] and [`Error::Damaged`] name the path; each item is an error of the same kind.
pub fn read_twines(path: &Path) -> Result<Frames<Twine>> {
    read(path)
}

pub(crate) fn read<R: FrameRow>(path: &Path) -> Result<Frames<R>> {
    let file = File::open(path).map_err(Error::io("read", path))?;
    let reader = SerializedFileReader::new(file).map_err(failed("read", path))?;
    if reader.metadata().file_metadata().schema().get_fields() != schema::<R>().get_fields() {
        let why = format!("its columns are not {}", R::NAMES);
        return Err(Error::Damaged { path: path.to_owned(), why });
    }
    // The reader takes these for granted.
    let columns = reader.metadata().row_groups().iter().flat_map(|group| group.columns());
    let whole = |c: &parquet::file::metadata::ColumnChunkMetaData| {
        c.dictionary_page_offset().unwrap_or_else(|| c.data_page_offset()) >= 0 && c.compressed_size() >= 0
    };
    if !columns.into_iter().all(whole) {
        let why = "a column begins or ends before the file".to_owned();
        return Err(Error::Damaged { path: path.to_owned(), why });
    }
    Ok(Frames { path: path.to_owned(), reader, next_group: 0, rows: Vec::new().into_iter(), pending: None })
}

/// The frames of a table that have rows, in its order.
pub struct Frames<R> {
    path: PathBuf,
    reader: SerializedFileReader<File>,
    next_group: usize,
    rows: std::vec::IntoIter<(u64, R)>,
    /// First row of the next frame.
    pending: Option<(u64, R)>,
}

impl<R: FrameRow> Frames<R> {
    /// The last frame that the table tells of, though it may have no rows.
    pub fn last_frame(&self) -> Option<u64> {
        let notes = self.reader.metadata().file_metadata().key_value_metadata()?;
        notes.iter().find(|note| note.key == LAST_FRAME)?.value.as_ref()?.parse().ok()
    }

    fn next_row(&mut self) -> Option<Result<(u64, R)>> {
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

impl<R: FrameRow> Iterator for Frames<R> {
    type Item = Result<(u64, Vec<R>)>;

    fn next(&mut self) -> Option<Self::Item> {
        let (frame, first) = match self.pending.take() {
            Some(row) => row,
            None => match self.next_row()? {
                Ok(row) => row,
                Err(error) => return Some(Err(error)),
            },
        };
        let mut rows = vec![first];
        loop {
            match self.next_row() {
                Some(Ok((f, row))) if f == frame => rows.push(row),
                Some(Ok(row)) => {
                    self.pending = Some(row);
                    return Some(Ok((frame, rows)));
                }
                Some(Err(error)) => return Some(Err(error)),
                None => return Some(Ok((frame, rows))),
            }
        }
    }
}

fn read_group<R: FrameRow>(
    reader: &SerializedFileReader<File>,
    index: usize,
) -> parquet::errors::Result<Vec<(u64, R)>> {
    let group = reader.get_row_group(index)?;
    let count = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    let (frame, _) = column::<Int64Type>(group.as_ref(), 0, count)?;
    let number = |frame: i64| u64::try_from(frame).map_err(|_| ParquetError::General("a frame below zero".to_owned()));
    frame.into_iter().zip(R::read(group.as_ref(), count)?).map(|(frame, row)| Ok((number(frame)?, row))).collect()
}
