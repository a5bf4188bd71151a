//! The kinds of log. Each yields its frames in order, numbered from 0, with the times it knows.

mod folder;
mod natural;
mod timestamps;

use std::path::Path;

use crate::error::{Error, Result};
use crate::frame::RawFrame;
use crate::log::{LogInfo, OpenOptions};

/// A log being read.
pub(crate) trait Source: Iterator<Item = RawFrame> + Send {
    /// What was wrong with the log itself, so far.
    fn damage(&self) -> &[String];
}

impl Source for Box<dyn Source> {
    fn damage(&self) -> &[String] {
        (**self).damage()
    }
}

/// Opens `path` by what is there.
pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<(LogInfo, Box<dyn Source>)> {
    let (info, folder) = open_folder(path, options)?;
    Ok((info, Box::new(folder)))
}

/// What is at `path`.
pub(crate) fn inspect(path: &Path, options: &OpenOptions) -> Result<LogInfo> {
    Ok(open_folder(path, options)?.0)
}

fn open_folder(path: &Path, options: &OpenOptions) -> Result<(LogInfo, folder::ImageFolder)> {
    if !std::fs::metadata(path).map_err(Error::io("read", path))?.is_dir() {
        return Err(Error::NotALog {
            path: path.to_owned(),
            why: "it is neither a folder nor an MCAP file".to_owned(),
        });
    }
    folder::ImageFolder::open(path, options)
}
