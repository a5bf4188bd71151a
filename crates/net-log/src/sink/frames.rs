//! Tables that tell many things of each frame, `junctions.parquet` and `twines.parquet`: a row for each, the frame's number first.
//!
//! The file is whole between any two writes: rows go into it in groups, and a group is written together with a new footer over the
//! old one, in one piece. What the old footer was is put down beside the file first, so that a process that is killed within that
//! write, or a disk that fills up, costs this group only: [`recover`] puts the old footer back. The footer names the last frame that was told, so that frames without rows
//! are known from those that were lost.

mod junctions;
mod pieces;
mod reader;
mod twines;
mod writer;

use std::path::Path;
use std::sync::Arc;

use net_geometry::{Junction, Twine};
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::column::reader::get_typed_column_reader;
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::RowGroupReader;
use parquet::file::writer::SerializedColumnWriter;
use parquet::schema::types::{Type, TypePtr};

use crate::error::{Error, Result};

pub(crate) use pieces::{journal, recover};
pub(crate) use reader::read;
pub use reader::{Frames, read_junctions, read_twines};
pub use writer::FramesParquet;

/// Writes `junctions.parquet`.
pub type JunctionsParquet = FramesParquet<Junction>;
/// Writes `twines.parquet`.
pub type TwinesParquet = FramesParquet<Twine>;
/// The frames of a `junctions.parquet` that have junctions, in its order.
pub type Junctions = Frames<Junction>;
/// The frames of a `twines.parquet` that have twines, in its order.
pub type Twines = Frames<Twine>;

/// What a row tells.
pub trait FrameRow: Sized {
    /// Rows by column, the frame's number left out.
    type Columns: Default;
    /// Name of the table.
    const TABLE: &'static str;
    /// Its columns' names.
    const NAMES: &'static str;

    /// The columns behind `frame`.
    fn fields() -> Vec<TypePtr>;
    /// Refuses what may not be written.
    fn check(&self) -> Result<()>;
    /// Adds a row.
    fn push(&self, columns: &mut Self::Columns);
    /// Forgets all rows.
    fn clear(columns: &mut Self::Columns);
    /// Writes the values of a column, counted from the one behind `frame`.
    fn write(
        columns: &Self::Columns,
        index: usize,
        writer: &mut SerializedColumnWriter<'_>,
    ) -> parquet::errors::Result<usize>;
    /// Reads the `count` rows of a group.
    fn read(group: &dyn RowGroupReader, count: usize) -> parquet::errors::Result<Vec<Self>>;
}

fn schema<R: FrameRow>() -> TypePtr {
    let fields = std::iter::once(field("frame", Physical::INT64, true, None)).chain(R::fields()).collect();
    Arc::new(Type::group_type_builder(R::TABLE).with_fields(fields).build().expect("a valid schema"))
}

fn field(name: &str, physical: Physical, required: bool, logical: Option<LogicalType>) -> TypePtr {
    let repetition = if required { Repetition::REQUIRED } else { Repetition::OPTIONAL };
    let built =
        Type::primitive_type_builder(name, physical).with_repetition(repetition).with_logical_type(logical).build();
    // All of them are valid, which every test of these files shows.
    Arc::new(built.expect("a valid column"))
}

/// Values of a column of a group that has `count` rows, and for each row 1 if it has a value, 0 if not; the latter of optional columns only.
fn column<T: DataType>(
    group: &dyn RowGroupReader,
    index: usize,
    count: usize,
) -> parquet::errors::Result<(Vec<T::T>, Vec<i16>)> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    let mut reader = get_typed_column_reader::<T>(group.get_column_reader(index)?);
    while levels.len().max(values.len()) < count {
        let left = count - levels.len().max(values.len());
        let (records, _, _) = reader.read_records(left, Some(&mut levels), None, &mut values)?;
        if records == 0 {
            return Err(ParquetError::EOF("a column ends before its group".to_owned()));
        }
    }
    Ok((values, levels))
}

fn unknown_state(word: &str) -> ParquetError {
    ParquetError::General(format!("state {word:?} is not known"))
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
