//! MCAP files: one, or a folder of them read as one log.

mod records;
mod survey;

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::frame::{FrameError, Payload, RawFrame};
use crate::log::{CameraInLog, LogInfo, LogKind, TimeSource, TopicInfo};
use crate::message::{self, ImageType};
use crate::source::Source;
use records::{Event, Records};
use survey::Survey;

/// Most bytes of one chunk that wait for its checksum. Beyond it they are believed.
const MAX_WAITING: usize = 256 << 20;

/// Files that belong together, looked into.
pub(super) struct McapLog {
    path: PathBuf,
    surveys: Vec<Survey>,
    damage: Vec<String>,
}

impl McapLog {
    /// Looks into the files. One of several that can't be read at all is damage, not the end.
    pub(super) fn open(path: &Path, files: &[PathBuf]) -> Result<Self> {
        let (mut surveys, mut damage) = (Vec::new(), Vec::new());
        for file in files {
            match Survey::of(file) {
                Ok(survey) => surveys.push(survey),
                Err(error) if files.len() > 1 => damage.push(error.to_string()),
                Err(error) => return Err(error),
            }
        }
        // In the order of recording; a file without messages stays where its name puts it.
        surveys.sort_by_key(|s| s.span.map_or(0, |(first, _)| first));
        if surveys.is_empty() {
            return Err(Error::NotALog { path: path.to_owned(), why: damage.join("; ") });
        }
        Ok(Self { path: path.to_owned(), surveys, damage })
    }

    /// What is in the log. `wanted` is the topic that the user asked for.
    pub(super) fn info(&self, wanted: Option<&str>) -> LogInfo {
        let topics = self.topics();
        let images: Vec<&TopicInfo> = topics.iter().filter(|t| t.is_image).collect();
        let only = if let [only] = images[..] { Some(only) } else { None };
        let chosen = wanted.map_or(only, |w| images.iter().find(|t| t.name == w).copied());
        let (topic, frames) = (chosen.map(|t| t.name.clone()), chosen.and_then(|t| t.messages));
        let spans = || self.surveys.iter().filter_map(|s| s.span);
        let ns = |t: u64| i64::try_from(t).unwrap_or(i64::MAX);
        LogInfo {
            path: self.path.clone(),
            kind: LogKind::Mcap,
            camera: self.camera(topic.as_deref()),
            frames,
            span_ns: spans().map(|s| ns(s.0)).min().zip(spans().map(|s| ns(s.1)).max()),
            times: TimeSource::Messages,
            camera_file: None,
            topic,
            topics,
        }
    }

    /// The frames of the topic that [`McapLog::info`] has chosen.
    pub(super) fn frames(self, info: &LogInfo, wanted: Option<&str>) -> Result<McapFrames> {
        let lines = || info.topics.iter().filter(|t| t.is_image).map(TopicInfo::option_line).collect::<Vec<_>>();
        let Some(topic) = &info.topic else {
            let (path, lines) = (self.path, lines());
            return Err(match wanted {
                Some(topic) => Error::NoSuchTopic { path, topic: topic.to_owned(), lines },
                None if lines.is_empty() => Error::NotALog { path, why: no_images(&info.topics) },
                None => Error::SeveralTopics { path, lines },
            });
        };
        Ok(McapFrames {
            topic: Arc::from(topic.as_str()),
            delay: None,
            skip_before: 0,
            files: self.surveys.into_iter(),
            current: None,
            waiting: Vec::new(),
            waiting_bytes: 0,
            ready: VecDeque::new(),
            next_index: 0,
            damage: self.damage,
        })
    }

    fn topics(&self) -> Vec<TopicInfo> {
        let mut topics: BTreeMap<&str, TopicInfo> = BTreeMap::new();
        for survey in &self.surveys {
            for (id, channel) in &survey.channels {
                let count = survey.counts.as_ref().map(|c| c.get(id).copied().unwrap_or(0));
                let topic = topics.entry(&channel.topic).or_insert_with(|| TopicInfo {
                    name: channel.topic.clone(),
                    schema: channel.schema.clone(),
                    encoding: channel.encoding.clone(),
                    messages: Some(0),
                    is_image: false,
                });
                topic.messages = topic.messages.zip(count).map(|(a, b)| a + b);
                topic.is_image |= channel.image_type().is_some();
            }
        }
        topics.into_values().collect()
    }

    /// The camera for an image topic: the one beside it, or the only one there is.
    fn camera(&self, topic: Option<&str>) -> Option<CameraInLog> {
        let mut cameras = BTreeMap::new();
        for survey in &self.surveys {
            for (name, found) in &survey.cameras {
                cameras.entry(name.as_str()).or_insert(found);
            }
        }
        let beside =
            topic.and_then(|t| cameras.iter().find(|(name, _)| message::namespace(name) == message::namespace(t)));
        let only = cameras.iter().next().filter(|_| cameras.len() == 1);
        let Some((&name, &(kind, data))) = beside.or(only) else {
            if cameras.is_empty() {
                return None;
            }
            let names: Vec<&str> = cameras.keys().copied().collect();
            let place = self.path.display().to_string();
            let camera = Err(Error::Calibration {
                place,
                field: "camera".to_owned(),
                value: format!("one of {}", names.join(", ")),
                expected: "one in the namespace of the image topic".to_owned(),
            });
            return Some(CameraInLog { topic: names.join(", "), camera });
        };
        Some(CameraInLog { topic: name.to_owned(), camera: kind.camera(name, data, topic) })
    }
}

/// Why a log without image topics is none, with what is in it.
fn no_images(topics: &[TopicInfo]) -> String {
    if topics.is_empty() {
        return "it holds no topics".to_owned();
    }
    let names: Vec<String> = topics.iter().map(|t| format!("{} ({})", t.name, t.schema)).collect();
    format!("none of its topics holds images: {}", names.join(", "))
}

/// How far header times and times of logging may drift apart before a chunk that is passed over could hold a frame that is
/// wanted, ns.
const MOST_DRIFT: i64 = 60_000_000_000;

/// The frames of one topic.
pub(super) struct McapFrames {
    topic: Arc<str>,
    /// Time of logging less time of exposure of the first frame, ns.
    delay: Option<i64>,
    /// Chunks that end before this time of logging are only counted, ns.
    skip_before: u64,
    /// Files not begun.
    files: std::vec::IntoIter<Survey>,
    current: Option<OpenFile>,
    /// Frames of the chunk being read, until its checksum is known; and their bytes.
    waiting: Vec<RawFrame>,
    waiting_bytes: usize,
    /// Frames to be handed out.
    ready: VecDeque<RawFrame>,
    next_index: u64,
    damage: Vec<String>,
}

/// The file being read.
struct OpenFile {
    records: Records,
    schemas: BTreeMap<u16, String>,
    /// Channels of the topic.
    channels: BTreeMap<u16, ImageType>,
}

impl OpenFile {
    fn new(survey: &Survey, topic: &str) -> Result<Self> {
        let records = Records::open(&survey.path, survey.places_for(topic))?;
        let of_topic = survey.channels.iter().filter(|(_, c)| c.topic == topic);
        let channels = of_topic.filter_map(|(&id, c)| Some((id, c.image_type()?))).collect();
        Ok(Self { records, schemas: BTreeMap::new(), channels })
    }
}

impl Iterator for McapFrames {
    type Item = RawFrame;

    fn next(&mut self) -> Option<RawFrame> {
        loop {
            if let Some(frame) = self.ready.pop_front() {
                return Some(frame);
            }
            let Some(mut file) = self.current.take() else {
                match OpenFile::new(&self.files.next()?, &self.topic) {
                    Ok(mut file) => {
                        file.records.skip_before(self.skip_before);
                        self.current = Some(file);
                    }
                    Err(error) => self.damage.push(error.to_string()),
                }
                continue;
            };
            let OpenFile { records, schemas, channels } = &mut file;
            let goes_on = records.step(&mut |event| match event {
                Event::Schema { id, name } => _ = schemas.insert(id, name),
                Event::Channel { id, schema, topic, encoding } => {
                    if let (true, Some(schema)) = (*topic == *self.topic, schemas.get(&schema))
                        && let Some(kind) = ImageType::of(&encoding, schema)
                    {
                        channels.insert(id, kind);
                    }
                }
                Event::Message { channel, log_time, data, in_chunk } => {
                    let Some(&kind) = channels.get(&channel) else { return };
                    let frame = frame(self.next_index, &self.topic, kind, log_time, data);
                    self.next_index += 1;
                    if let (None, Some(exposed)) = (self.delay, frame.timestamp_ns) {
                        self.delay = i64::try_from(log_time).ok().and_then(|logged| logged.checked_sub(exposed));
                    }
                    if in_chunk && self.waiting_bytes + data.len() <= MAX_WAITING {
                        self.waiting_bytes += data.len();
                        self.waiting.push(frame);
                    } else {
                        self.waiting_bytes = 0;
                        self.ready.extend(self.waiting.drain(..));
                        self.ready.push_back(frame);
                    }
                }
                Event::Skipped { channel, messages } => {
                    self.next_index += if channels.contains_key(&channel) { messages } else { 0 };
                }
                Event::Lost { channel, messages, why } if channels.contains_key(&channel) => {
                    for index in self.next_index..self.next_index + messages {
                        let payload = Payload::Refused(FrameError::Read { why: why.to_owned() });
                        self.ready.push_back(RawFrame {
                            index,
                            name: self.topic.clone(),
                            timestamp_ns: None,
                            time_line: None,
                            payload,
                        });
                    }
                    self.next_index += messages;
                }
                Event::Lost { .. } => {}
                Event::ChunkEnd(sound) => {
                    for mut frame in self.waiting.drain(..) {
                        if let Err(why) = &sound {
                            frame.refuse(FrameError::Read { why: why.clone() });
                        }
                        self.ready.push_back(frame);
                    }
                    self.waiting_bytes = 0;
                }
            });
            self.damage.extend(file.records.take_damage());
            if goes_on {
                self.current = Some(file);
            } else {
                // A file that could not be read to the end of a chunk.
                self.ready.extend(self.waiting.drain(..));
                self.waiting_bytes = 0;
            }
        }
    }
}

/// A message as a frame, timed by its header, or by its logging where that is zero.
fn frame(index: u64, topic: &Arc<str>, kind: ImageType, log_time: u64, data: &[u8]) -> RawFrame {
    let (name, logged) = (topic.clone(), i64::try_from(log_time).ok());
    let refused = |error| RawFrame {
        index,
        name: name.clone(),
        timestamp_ns: logged,
        time_line: None,
        payload: Payload::Refused(error),
    };
    match kind.stamp(data) {
        Err(error) => refused(error),
        Ok(stamp) => match Some(stamp).filter(|&s| s != 0).or(logged) {
            None => refused(FrameError::NoTime {
                why: format!("its time of logging, {log_time} ns, is beyond the year 2262"),
            }),
            time => RawFrame {
                index,
                name,
                timestamp_ns: time,
                time_line: None,
                payload: Payload::Message { kind, data: data.to_vec() },
            },
        },
    }
}

impl Source for McapFrames {
    fn damage(&self) -> &[String] {
        &self.damage
    }

    fn skip_before(&mut self, timestamp_ns: i64) {
        let Some(delay) = self.delay else { return };
        let log_time = timestamp_ns.saturating_add(delay).saturating_sub(MOST_DRIFT);
        self.skip_before = u64::try_from(log_time).unwrap_or(0);
        if let Some(file) = &mut self.current {
            file.records.skip_before(self.skip_before);
        }
    }
}
