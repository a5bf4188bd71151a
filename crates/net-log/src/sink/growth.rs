//! `growth.parquet`: one row per mesh of the net that was seen.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Compression, Repetition, Type as Physical};
use parquet::data_type::{FloatType, Int32Type, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::error::{Error, Result};

/// Rows of a group.
const GROUP_ROWS: usize = 1 << 15;

/// A mesh that was seen: the cell between the nodes `(i, j)` and `(i + 1, j + 1)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GrowthRow {
    /// Number of the count of cells.
    pub track: u32,
    /// Lattice indices of its first node.
    pub i: i32,
    /// See `i`.
    pub j: i32,
    /// Frames that show it.
    pub frames: u32,
    /// First and last of them.
    pub first_frame: u32,
    /// See `first_frame`.
    pub last_frame: u32,
    /// Height of the cell in the best view, px; 0 where something hides it in all of them.
    pub best_px: f32,
    /// Depth along the optical axis in the best view, m; 0 likewise.
    pub best_depth_m: f32,
    /// How far twine stands out in the best view, grey levels; 0 likewise.
    pub contrast: f32,
    /// Blocked share of the mesh, twine included, mean over the frames that could measure it.
    pub blocked_share: Option<f32>,
    /// The same less that of a clean mesh of this net.
    pub excess_share: Option<f32>,
}

/// Writes `growth.parquet`, which is whole once [`GrowthParquet::finish`] has returned.
pub struct GrowthParquet {
    path: PathBuf,
    writer: SerializedFileWriter<File>,
    rows: Vec<GrowthRow>,
}

impl GrowthParquet {
    /// Starts a new file.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(Error::io("create", path))?;
        let column = |name, physical, repetition| {
            // These columns are valid, which the test shows.
            Arc::new(
                Type::primitive_type_builder(name, physical)
                    .with_repetition(repetition)
                    .build()
                    .expect("a valid column"),
            )
        };
        let (required, optional) = (Repetition::REQUIRED, Repetition::OPTIONAL);
        let columns = vec![
            column("track", Physical::INT32, required),
            column("i", Physical::INT32, required),
            column("j", Physical::INT32, required),
            column("frames", Physical::INT64, required),
            column("first_frame", Physical::INT64, required),
            column("last_frame", Physical::INT64, required),
            column("best_px", Physical::FLOAT, required),
            column("best_depth_m", Physical::FLOAT, required),
            column("contrast", Physical::FLOAT, required),
            column("blocked_share", Physical::FLOAT, optional),
            column("excess_share", Physical::FLOAT, optional),
        ];
        let schema = Arc::new(Type::group_type_builder("growth").with_fields(columns).build().expect("a valid schema"));
        let properties = WriterProperties::builder()
            .set_created_by(concat!("netpose ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_compression(Compression::SNAPPY)
            .build();
        let writer = SerializedFileWriter::new(file, schema, Arc::new(properties)).map_err(failed(path))?;
        Ok(Self { path: path.to_owned(), writer, rows: Vec::new() })
    }

    /// Adds a mesh.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn write(&mut self, row: &GrowthRow) -> Result<()> {
        self.rows.push(*row);
        if self.rows.len() >= GROUP_ROWS { self.write_group() } else { Ok(()) }
    }

    /// Writes what is left and closes the file.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn finish(mut self) -> Result<()> {
        self.write_group()?;
        let path = self.path;
        self.writer.close().map_err(failed(&path)).map(drop)
    }

    fn write_group(&mut self) -> Result<()> {
        if self.rows.is_empty() {
            return Ok(());
        }
        let rows = std::mem::take(&mut self.rows);
        let write = |writer: &mut SerializedFileWriter<File>| -> parquet::errors::Result<()> {
            let mut group = writer.next_row_group()?;
            let mut column = 0;
            while let Some(mut writer) = group.next_column()? {
                // A count of cells beyond 2^31 is beyond any log.
                let small = |f: fn(&GrowthRow) -> i32| rows.iter().map(f).collect::<Vec<i32>>();
                let large = |f: fn(&GrowthRow) -> u32| rows.iter().map(|r| i64::from(f(r))).collect::<Vec<i64>>();
                let real = |f: fn(&GrowthRow) -> f32| rows.iter().map(f).collect::<Vec<f32>>();
                let maybe = |f: fn(&GrowthRow) -> Option<f32>| {
                    let values: Vec<f32> = rows.iter().filter_map(f).collect();
                    (values, rows.iter().map(|r| i16::from(f(r).is_some())).collect::<Vec<i16>>())
                };
                match column {
                    0 => writer.typed::<Int32Type>().write_batch(&small(|r| r.track as i32), None, None)?,
                    1 => writer.typed::<Int32Type>().write_batch(&small(|r| r.i), None, None)?,
                    2 => writer.typed::<Int32Type>().write_batch(&small(|r| r.j), None, None)?,
                    3 => writer.typed::<Int64Type>().write_batch(&large(|r| r.frames), None, None)?,
                    4 => writer.typed::<Int64Type>().write_batch(&large(|r| r.first_frame), None, None)?,
                    5 => writer.typed::<Int64Type>().write_batch(&large(|r| r.last_frame), None, None)?,
                    6 => writer.typed::<FloatType>().write_batch(&real(|r| r.best_px), None, None)?,
                    7 => writer.typed::<FloatType>().write_batch(&real(|r| r.best_depth_m), None, None)?,
                    8 => writer.typed::<FloatType>().write_batch(&real(|r| r.contrast), None, None)?,
                    k => {
                        let (values, present) = maybe(if k == 9 { |r| r.blocked_share } else { |r| r.excess_share });
                        writer.typed::<FloatType>().write_batch(&values, Some(&present), None)?
                    }
                };
                writer.close()?;
                column += 1;
            }
            group.close().map(drop)
        };
        write(&mut self.writer).map_err(failed(&self.path))
    }
}

/// For `map_err`.
fn failed(path: &Path) -> impl Fn(ParquetError) -> Error + use<> {
    let path = path.to_owned();
    move |error| Error::Io { action: "write", path: path.clone(), source: std::io::Error::other(error) }
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    use super::*;

    #[test]
    fn rows_read_back() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("growth.parquet");
        let mut file = GrowthParquet::create(&path).expect("a file");
        let row = GrowthRow {
            track: 1,
            i: -5,
            j: 7,
            frames: 3,
            first_frame: 10,
            last_frame: 12,
            best_px: 25.5,
            best_depth_m: 1.25,
            contrast: 40.0,
            blocked_share: Some(0.125),
            excess_share: None,
        };
        file.write(&row).expect("written");
        file.write(&GrowthRow { i: 6, blocked_share: None, ..row }).expect("written");
        file.finish().expect("closed");
        let reader = SerializedFileReader::new(File::open(&path).expect("a file")).expect("parquet");
        let rows: Vec<_> = reader.get_row_iter(None).expect("rows").map(|r| r.expect("a row")).collect();
        assert_eq!(rows.len(), 2);
        assert_eq!((rows[0].get_int(1).ok(), rows[0].get_float(9).ok()), (Some(-5), Some(0.125)));
        assert_eq!((rows[1].get_int(1).ok(), rows[1].get_float(9).ok()), (Some(6), None));
    }
}
