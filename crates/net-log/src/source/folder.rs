//! A folder of images.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::calibration::camera_beside;
use crate::error::{Error, Result};
use crate::frame::{FrameError, Payload, RawFrame};
use crate::log::{LogInfo, LogKind, OpenOptions, TimeSource};
use crate::picture;
use crate::source::timestamps::TIMESTAMPS_CSV;
use crate::source::{Source, first_bytes, natural, timestamps};

/// Endings that make a file a frame, whatever is in it: if it is no picture, it is an unreadable frame, not a stray file.
const IMAGE_ENDINGS: [&str; 8] = ["png", "jpg", "jpeg", "jpe", "tif", "tiff", "bmp", "webp"];

/// The frames of a folder, in natural order of their names.
pub(crate) struct ImageFolder {
    path: PathBuf,
    frames: std::vec::IntoIter<(String, std::result::Result<Timed, FrameError>)>,
    next_index: u64,
}

/// A frame's time.
#[derive(Debug, Clone, Copy)]
struct Timed {
    /// Since the Unix epoch, ns.
    ns: i64,
    /// Line of `timestamps.csv` that tells it.
    line: Option<u64>,
}

impl ImageFolder {
    /// Lists the folder; opens no image.
    pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<(LogInfo, Self)> {
        if !(options.fps.is_finite() && options.fps > 0.0) {
            let value = options.fps.to_string();
            return Err(Error::Value { field: "fps", value, expected: "frames per second above zero" });
        }
        let mut names = image_names(path)?;
        let table = path.join(TIMESTAMPS_CSV);
        let table = if table.exists() { Some(timestamps::read_csv(&table)?) } else { None };
        // A file that the table names and that is gone is a frame all the same, an unreadable one.
        let gone: Vec<String> = table.iter().flat_map(|t| t.keys()).filter(|n| !names.contains(*n)).cloned().collect();
        names.extend(gone);
        names.sort_by(|a, b| natural::compare(a, b));
        if names.is_empty() {
            let why = "the folder holds no images (PNG, JPEG, TIFF, BMP, WebP)".to_owned();
            return Err(Error::NotALog { path: path.to_owned(), why });
        }
        let (times, source) = match (table, timestamps::from_names(&names)) {
            (Some(table), _) => {
                let missing = || FrameError::NoTime { why: format!("{TIMESTAMPS_CSV} does not name it") };
                let time = |name| match table.get(name) {
                    Some(Ok(told)) => Ok(Timed { ns: told.ns, line: Some(told.line) }),
                    Some(Err(why)) => Err(FrameError::NoTime { why: why.clone() }),
                    None => Err(missing()),
                };
                (names.iter().map(time).collect::<Vec<_>>(), TimeSource::TimestampsCsv)
            }
            (None, Some(times)) => {
                let none = || FrameError::NoTime {
                    why: "its name is not a time in ns, as those of the others are".to_owned(),
                };
                let time = |time: Option<i64>| time.map(|ns| Timed { ns, line: None }).ok_or_else(none);
                (times.into_iter().map(time).collect(), TimeSource::FileNames)
            }
            (None, None) => {
                let time = |i: usize| Ok(Timed { ns: (i as f64 * 1e9 / options.fps).round() as i64, line: None });
                ((0..names.len()).map(time).collect(), TimeSource::MadeUp { fps: options.fps })
            }
        };
        let known = || times.iter().flatten().map(|time| time.ns);
        let camera_file = camera_beside(path);
        let info = LogInfo {
            path: path.to_owned(),
            kind: LogKind::ImageFolder,
            topics: Vec::new(),
            topic: None,
            frames: Some(names.len() as u64),
            span_ns: known().min().zip(known().max()),
            times: source,
            camera: None,
            camera_file,
        };
        let frames = names.into_iter().zip(times).collect::<Vec<_>>().into_iter();
        Ok((info, Self { path: path.to_owned(), frames, next_index: 0 }))
    }
}

impl Iterator for ImageFolder {
    type Item = RawFrame;

    fn next(&mut self) -> Option<RawFrame> {
        let (name, time) = self.frames.next()?;
        let index = self.next_index;
        self.next_index += 1;
        let (timestamp_ns, time_line) = match &time {
            Ok(time) => (Some(time.ns), time.line),
            Err(_) => (None, None),
        };
        let payload = match time {
            Ok(_) => Payload::File(self.path.join(&name)),
            Err(error) => Payload::Refused(error),
        };
        Some(RawFrame { index, name: Arc::from(name), timestamp_ns, time_line, payload })
    }
}

impl Source for ImageFolder {
    fn damage(&self) -> &[String] {
        &[]
    }
}

/// Names of the files that are images by their ending or else by their first bytes. Hidden files are not.
fn image_names(path: &Path) -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(path).map_err(Error::io("read", path))? {
        let entry = entry.map_err(Error::io("read", path))?;
        let Ok(name) = entry.file_name().into_string() else { continue };
        if name.starts_with('.') || entry.path().is_dir() {
            continue;
        }
        let ending = name.rsplit_once('.').map_or(String::new(), |(_, e)| e.to_ascii_lowercase());
        if IMAGE_ENDINGS.contains(&ending.as_str()) || begins_like_an_image(&entry.path()) {
            names.push(name);
        }
    }
    Ok(names)
}

/// Looks at the first bytes of a file of unknown ending; one that can't be read is none of ours.
fn begins_like_an_image(path: &Path) -> bool {
    first_bytes(path).is_ok_and(|first| picture::sniff(&first).is_some())
}
