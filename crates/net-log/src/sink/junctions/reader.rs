//! Reading `junctions.parquet`.

use std::fs::File;
use std::path::{Path, PathBuf};

use net_geometry::nalgebra::Vector2;
use net_geometry::{Junction, JunctionState};
use parquet::column::reader::{ColumnReader, get_typed_column_reader};
use parquet::data_type::{ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::{failed, schema};
use crate::error::{Error, Result};

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
            let states = [
                JunctionState::Seen,
                JunctionState::Hidden,
                JunctionState::Fouled,
                JunctionState::Missing,
                JunctionState::Inferred,
            ];
            let state = states.into_iter().find(|s| s.as_str() == word);
            let state = state.ok_or_else(|| ParquetError::General(format!("state {word:?} is not known")))?;
            let frame =
                u64::try_from(frame[row]).map_err(|_| ParquetError::General("a frame below zero".to_owned()))?;
            Ok((frame, Junction { pixel: Vector2::new(u[row], v[row]), index, sigma_px: sigma_px[row], state }))
        })
        .collect()
}
