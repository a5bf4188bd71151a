//! A file that is whole between any two writes.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use parquet::file::reader::SerializedFileReader;

use crate::error::{Error, Result};

/// The file, which is written in whole pieces only.
#[derive(Debug)]
pub(super) struct Pieces {
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
    /// Into the empty file of this path.
    pub fn new(file: File, path: &Path) -> Self {
        Self { file, groups_end: 0, piece: Vec::new(), footer: Vec::new(), journal: journal(path) }
    }

    /// Writes what has been collected, and the footer behind it.
    pub fn commit(&mut self, footer: Vec<u8>) -> std::io::Result<()> {
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
