//! What is in an MCAP file: from its summary, or from reading all of it where there is none.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};

use crate::error::{Error, Result};
use crate::message::{CameraType, ImageType};
use crate::source::mcap::records::{Event, Records};

/// Most of a summary that is read as one record, bytes.
const MAX_SUMMARY_RECORD: usize = 64 << 20;

/// Where a chunk is.
#[derive(Debug, Clone)]
pub(super) struct Place {
    /// Where the index of each channel that has messages in it is, byte; empty if they are not indexed.
    pub(super) indexes: BTreeMap<u16, u64>,
    /// Time of logging of its last message, ns.
    pub(super) last_time: u64,
    /// Whether it may be passed over.
    pub(super) skip: bool,
}

/// A topic's type and encoding.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) topic: String,
    pub(super) schema: String,
    pub(super) encoding: String,
}

impl Channel {
    pub(super) fn image_type(&self) -> Option<ImageType> {
        ImageType::of(&self.encoding, &self.schema)
    }

    pub(super) fn camera_type(&self) -> Option<CameraType> {
        CameraType::of(&self.encoding, &self.schema)
    }
}

/// What is in one file.
#[derive(Debug)]
pub(super) struct Survey {
    pub(super) path: PathBuf,
    pub(super) channels: BTreeMap<u16, Channel>,
    /// Messages by channel, where known.
    pub(super) counts: Option<BTreeMap<u16, u64>>,
    /// First and last time of logging, ns.
    pub(super) span: Option<(u64, u64)>,
    /// Chunks by their first byte; empty without a summary.
    pub(super) places: BTreeMap<u64, Place>,
    /// The first message of each camera topic.
    pub(super) cameras: BTreeMap<String, (CameraType, Vec<u8>)>,
}

impl Survey {
    /// Looks into a file. Damage is left to be reported by whoever reads the frames.
    pub(super) fn of(path: &Path) -> Result<Self> {
        let mut survey = match read_summary(path)? {
            Some(summary) => Self::from_summary(path, summary),
            None => return Self::by_reading(path),
        };
        survey.find_cameras()?;
        Ok(survey)
    }

    /// The chunks, those marked that hold nothing of `topic`.
    pub(super) fn places_for(&self, topic: &str) -> BTreeMap<u64, Place> {
        let ids: BTreeSet<u16> = self.channels.iter().filter(|(_, c)| c.topic == topic).map(|(&id, _)| id).collect();
        self.places_with(&ids)
    }

    fn places_with(&self, ids: &BTreeSet<u16>) -> BTreeMap<u64, Place> {
        let mut places = self.places.clone();
        for place in places.values_mut() {
            place.skip = !place.indexes.is_empty() && place.indexes.keys().all(|id| !ids.contains(id));
        }
        places
    }

    fn from_summary(path: &Path, summary: mcap::Summary) -> Self {
        let channels = summary.channels.iter().map(|(&id, channel)| {
            let schema = channel.schema.as_ref().map_or_else(String::new, |s| s.name.clone());
            (id, Channel { topic: channel.topic.clone(), schema, encoding: channel.message_encoding.clone() })
        });
        let places = summary.chunk_indexes.iter().map(|index| {
            let (indexes, last_time) = (index.message_index_offsets.clone(), index.message_end_time);
            (index.chunk_start_offset, Place { indexes, last_time, skip: false })
        });
        let stats = summary.stats.as_ref();
        Self {
            path: path.to_owned(),
            channels: channels.collect(),
            counts: stats.map(|s| s.channel_message_counts.clone()),
            span: stats.filter(|s| s.message_count > 0).map(|s| (s.message_start_time, s.message_end_time)),
            places: places.collect(),
            cameras: BTreeMap::new(),
        }
    }

    /// Reads the first message of every camera topic.
    fn find_cameras(&mut self) -> Result<()> {
        let some = |id: &u16| self.counts.as_ref().is_none_or(|c| c.get(id).is_some_and(|&n| n > 0));
        let mut missing: BTreeMap<u16, CameraType> = self
            .channels
            .iter()
            .filter(|(id, _)| some(id))
            .filter_map(|(&id, c)| Some((id, c.camera_type()?)))
            .collect();
        let mut records = Records::open(&self.path, self.places_with(&missing.keys().copied().collect()))?;
        let (channels, cameras) = (&self.channels, &mut self.cameras);
        while !missing.is_empty()
            && records.step(&mut |event| {
                if let Event::Message { channel, data, .. } = event
                    && let Some(kind) = missing.remove(&channel)
                {
                    cameras.insert(channels[&channel].topic.clone(), (kind, data.to_vec()));
                }
            })
        {}
        Ok(())
    }

    /// Reads the whole file: the price of a summary that is missing or broken.
    fn by_reading(path: &Path) -> Result<Self> {
        let mut records = Records::open(path, BTreeMap::new())?;
        let mut schemas: BTreeMap<u16, String> = BTreeMap::new();
        let mut channels: BTreeMap<u16, Channel> = BTreeMap::new();
        let mut counts: BTreeMap<u16, u64> = BTreeMap::new();
        let mut span: Option<(u64, u64)> = None;
        let mut cameras = BTreeMap::new();
        while records.step(&mut |event| match event {
            Event::Schema { id, name } => _ = schemas.insert(id, name),
            Event::Channel { id, schema, topic, encoding } => {
                let schema = schemas.get(&schema).cloned().unwrap_or_default();
                channels.insert(id, Channel { topic, schema, encoding });
            }
            Event::Message { channel, log_time, data, .. } => {
                *counts.entry(channel).or_default() += 1;
                let (first, last) = span.unwrap_or((log_time, log_time));
                span = Some((first.min(log_time), last.max(log_time)));
                if let Some(channel) = channels.get(&channel)
                    && let Some(kind) = channel.camera_type()
                    && !cameras.contains_key(&channel.topic)
                {
                    cameras.insert(channel.topic.clone(), (kind, data.to_vec()));
                }
            }
            Event::Lost { channel, messages, .. } => *counts.entry(channel).or_default() += messages,
            Event::ChunkEnd(_) | Event::Skipped { .. } => {}
        }) {}
        Ok(Self { path: path.to_owned(), channels, counts: Some(counts), span, places: BTreeMap::new(), cameras })
    }
}

/// The summary at the file's end. `None` if it is missing, broken or does not name the topics.
fn read_summary(path: &Path) -> Result<Option<mcap::Summary>> {
    let mut file = File::open(path).map_err(Error::io("read", path))?;
    let length = file.metadata().map_err(Error::io("read", path))?.len();
    let options = SummaryReaderOptions::default().with_file_size(length).with_record_length_limit(MAX_SUMMARY_RECORD);
    let mut reader = SummaryReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event {
            Ok(SummaryReadEvent::ReadRequest(size)) => {
                let read = file.read(reader.insert(size)).map_err(Error::io("read", path))?;
                reader.notify_read(read);
            }
            Ok(SummaryReadEvent::SeekRequest(to)) => {
                // A footer may point anywhere.
                if matches!(to, SeekFrom::Start(at) if at > length) {
                    return Ok(None);
                }
                reader.notify_seeked(file.seek(to).map_err(Error::io("read", path))?);
            }
            Err(_) => return Ok(None),
        }
    }
    let names_topics =
        |s: &mcap::Summary| !s.channels.is_empty() || s.stats.as_ref().is_some_and(|s| s.message_count == 0);
    Ok(reader.finish().filter(names_topics))
}
