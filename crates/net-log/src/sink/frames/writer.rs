//! Writing tables of frames.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::Int64Type;
use parquet::file::metadata::{FileMetaData, KeyValue, ParquetMetaDataBuilder, ParquetMetaDataWriter};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;

use super::pieces::{Pieces, journal};
use super::{FrameRow, failed, schema};
use crate::error::{Error, Result};

/// A group is written when it has this many rows, about 1.5 MB of junctions, or
const GROUP_ROWS: usize = 1 << 15;
/// this many frames with rows, so that little is lost when the process is killed.
const GROUP_FRAMES: usize = 256;
/// Note in the footer: the last frame that was told, with rows or without.
pub(super) const LAST_FRAME: &str = "netpose.last_frame";

/// Writes a table. Memory does not grow with the file, but for about 1 kB per 32,768 rows.
pub struct FramesParquet<R: FrameRow> {
    path: PathBuf,
    writer: SerializedFileWriter<Pieces>,
    /// Frame of each row of the group.
    frame: Vec<i64>,
    rows: R::Columns,
    /// Frames with rows in it.
    frames: usize,
    last_frame: Option<u64>,
}

impl<R: FrameRow> std::fmt::Debug for FramesParquet<R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FramesParquet").field("path", &self.path).finish_non_exhaustive()
    }
}

impl<R: FrameRow> FramesParquet<R> {
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
            SerializedFileWriter::new(pieces, schema::<R>(), Arc::new(properties)).map_err(failed("write", path))?;
        let (frame, rows) = (Vec::new(), R::Columns::default());
        let mut this = Self { path: path.to_owned(), writer, frame, rows, frames: 0, last_frame: None };
        this.commit()?;
        Ok(this)
    }

    /// Whether so many rows of another frame fill the group, so that it is written.
    pub fn is_filled_by(&self, rows: usize) -> bool {
        self.frame.len() + rows >= GROUP_ROWS || self.frames + usize::from(rows > 0) >= GROUP_FRAMES
    }

    /// Adds the rows of a frame.
    ///
    /// # Errors
    /// [`Error::Value`] for a junction that is not finite; [`Error::Io`] names the path.
    pub fn write(&mut self, frame: u64, rows: &[R]) -> Result<()> {
        rows.iter().try_for_each(R::check)?;
        let number = i64::try_from(frame).map_err(|_| Error::Value {
            field: "frame",
            value: frame.to_string(),
            expected: "at most 2^63 - 1",
        })?;
        let filled = self.is_filled_by(rows.len());
        rows.iter().for_each(|row| row.push(&mut self.rows));
        self.frame.extend(rows.iter().map(|_| number));
        self.frames += usize::from(!rows.is_empty());
        self.last_frame = Some(frame);
        if filled { self.checkpoint() } else { Ok(()) }
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
        if self.frame.is_empty() {
            return Ok(());
        }
        let (frame, rows) = (&self.frame, &self.rows);
        let write = || -> parquet::errors::Result<()> {
            let mut group = self.writer.next_row_group()?;
            let mut column = 0_usize;
            while let Some(mut writer) = group.next_column()? {
                match column.checked_sub(1) {
                    None => writer.typed::<Int64Type>().write_batch(frame, None, None)?,
                    Some(index) => R::write(rows, index, &mut writer)?,
                };
                writer.close()?;
                column += 1;
            }
            group.close().map(drop)
        };
        let written = { write }();
        written.map_err(failed("write", &self.path))?;
        R::clear(&mut self.rows);
        self.frame.clear();
        self.frames = 0;
        Ok(())
    }

    /// Writes the groups that are not in the file yet, with a footer that covers all groups.
    fn commit(&mut self) -> Result<()> {
        self.writer.flush().map_err(Error::io("write", &self.path))?;
        let groups = self.writer.flushed_row_groups().to_vec();
        let rows = groups.iter().map(|g| g.num_rows()).sum();
        let created_by = Some(self.writer.properties().created_by().to_owned());
        let schema = Arc::new(parquet::schema::types::SchemaDescriptor::new(schema::<R>()));
        let note = self.last_frame.map(|frame| vec![KeyValue::new(LAST_FRAME.to_owned(), frame.to_string())]);
        let metadata = FileMetaData::new(1, rows, created_by, note, schema, None);
        let metadata = ParquetMetaDataBuilder::new(metadata).set_row_groups(groups).build();
        let mut footer = Vec::new();
        ParquetMetaDataWriter::new(&mut footer, &metadata).finish().map_err(failed("write", &self.path))?;
        self.writer.inner_mut().commit(footer).map_err(Error::io("write", &self.path))
    }
}
