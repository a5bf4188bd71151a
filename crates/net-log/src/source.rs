//! The kinds of log. Each yields its frames in order, numbered from 0, with the times it knows.

mod folder;
mod mcap;
mod natural;
mod timestamps;

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::frame::{RawFrame, check_regular};
use crate::log::{LogInfo, OpenOptions};
use crate::picture;
pub(crate) use timestamps::TIMESTAMPS_CSV;

/// A log being read.
pub(crate) trait Source: Iterator<Item = RawFrame> + Send {
    /// What was wrong with the log itself, so far.
    fn damage(&self) -> &[String];

    /// Frames before this time need not come, if that saves work. They count all the same: the frames behind keep their numbers.
    fn skip_before(&mut self, _timestamp_ns: i64) {}
}

impl Source for Box<dyn Source> {
    fn damage(&self) -> &[String] {
        (**self).damage()
    }

    fn skip_before(&mut self, timestamp_ns: i64) {
        (**self).skip_before(timestamp_ns);
    }
}

/// What there is at a path.
enum Found {
    Images(Box<LogInfo>, folder::ImageFolder),
    Mcap(mcap::McapLog),
}

/// Opens `path` by what is there.
pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<(LogInfo, Box<dyn Source>)> {
    match find(path, options)? {
        Found::Images(info, frames) => Ok((*info, Box::new(frames))),
        Found::Mcap(log) => {
            let wanted = options.topic.as_deref();
            let info = log.info(wanted);
            let frames = log.frames(&info, wanted)?;
            Ok((info, Box::new(frames)))
        }
    }
}

/// What is at `path`.
pub(crate) fn inspect(path: &Path, options: &OpenOptions) -> Result<LogInfo> {
    match find(path, options)? {
        Found::Images(info, _) => Ok(*info),
        Found::Mcap(log) => Ok(log.info(options.topic.as_deref())),
    }
}

fn find(path: &Path, options: &OpenOptions) -> Result<Found> {
    if !std::fs::metadata(path).map_err(Error::io("read", path))?.is_dir() {
        return find_file(path);
    }
    let mcaps = mcap_files(path)?;
    let images = folder::ImageFolder::open(path, options);
    match (mcaps.is_empty(), images) {
        (true, images) => {
            let (info, frames) = images?;
            if let Some(topic) = &options.topic {
                let expected = "the image topic of an MCAP; a folder of images has none, leave it out";
                return Err(Error::Value { field: "topic", value: format!("{topic:?}"), expected });
            }
            Ok(Found::Images(Box::new(info), frames))
        }
        (false, Err(_)) => mcap::McapLog::open(path, &mcaps).map(Found::Mcap),
        (false, Ok((info, _))) => {
            let (images, mcaps) = (info.frames.unwrap_or(0), mcaps.len());
            let why =
                format!("it holds {images} images and {mcaps} MCAP files; give an MCAP file, or a folder of one kind");
            Err(Error::NotALog { path: path.to_owned(), why })
        }
    }
}

fn find_file(path: &Path) -> Result<Found> {
    let first = first_bytes(path).map_err(Error::io("read", path))?;
    let is = |start: &[u8]| first.starts_with(start);
    let why = if is(b"\x89MCAP") || path.extension().is_some_and(|e| e == "mcap") {
        return mcap::McapLog::open(path, &[path.to_owned()]).map(Found::Mcap);
    } else if picture::sniff(&first).is_some() {
        "it is a single image; give the folder that holds it"
    } else if is(b"#ROSBAG V") {
        "it is a ROS 1 bag, which is not supported; convert it to MCAP"
    } else if is(b"SQLite format 3") {
        "it is an SQLite file, perhaps of ROS 2, which is not supported; convert it to MCAP"
    } else {
        "it is neither a folder of images nor an MCAP file"
    };
    Err(Error::NotALog { path: path.to_owned(), why: why.to_owned() })
}

/// The MCAP files of a folder in natural order of their names.
fn mcap_files(path: &Path) -> Result<Vec<PathBuf>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(path).map_err(Error::io("read", path))? {
        let entry = entry.map_err(Error::io("read", path))?;
        if let Ok(name) = entry.file_name().into_string()
            && name.ends_with(".mcap")
            && !name.starts_with('.')
            && entry.path().is_file()
        {
            names.push(name);
        }
    }
    names.sort_by(|a, b| natural::compare(a, b));
    Ok(names.into_iter().map(|n| path.join(n)).collect())
}

/// Enough of a regular file's beginning to tell what it is.
fn first_bytes(path: &Path) -> std::io::Result<Vec<u8>> {
    use std::io::Read;
    check_regular(path)?;
    let mut first = Vec::new();
    std::fs::File::open(path)?.take(16).read_to_end(&mut first)?;
    Ok(first)
}
