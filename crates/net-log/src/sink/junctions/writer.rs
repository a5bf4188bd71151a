//! Writing `junctions.parquet`.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use net_geometry::Junction;
use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type, Int64Type};
use parquet::file::metadata::{FileMetaData, ParquetMetaDataBuilder, ParquetMetaDataWriter};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;

use super::pieces::{Pieces, journal};
use super::{failed, schema};
use crate::error::{Error, Result};

/// A group is written when it has this many rows, about 1.5 MB, or
const GROUP_ROWS: usize = 1 << 15;
/// this many frames with junctions, so that little is lost when the process is killed.
const GROUP_FRAMES: usize = 256;

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
        let pieces = Pieces::new(file, path);
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
