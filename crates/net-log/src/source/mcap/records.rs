//! The records of one MCAP file from front to back, whatever is broken in it.
//!
//! The file is read once, forwards, chunk by chunk, so that memory does not grow with it. A chunk is handed to the `mcap` crate's
//! reader by itself: one that is broken costs its own messages only, and the next one starts afresh.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::error::{Error, Result};
use crate::source::mcap::survey::Place;

/// Largest record that is read, bytes: 100 Mpx of four channels.
const MAX_RECORD: usize = 400 << 20;
/// Most that is asked of the file at once, bytes.
const READ_SIZE: u64 = 1 << 20;
/// Opcode and length of a record, bytes.
const RECORD_HEADER: u64 = 9;

/// What a step through the file found.
pub(super) enum Event<'a> {
    /// A message type.
    Schema { id: u16, name: String },
    /// A topic.
    Channel { id: u16, schema: u16, topic: String, encoding: String },
    /// A message; one in a chunk is to be trusted once the chunk has ended well.
    Message { channel: u16, log_time: u64, data: &'a [u8], in_chunk: bool },
    /// A chunk was passed over with so many messages of a channel in it.
    Skipped { channel: u16, messages: u64 },
    /// The chunk is over; its checksum was right, or why its messages can't be trusted.
    ChunkEnd(std::result::Result<(), String>),
    /// So many messages of a channel were in a damaged chunk, by its index, and did not come out of it.
    Lost { channel: u16, messages: u64, why: &'a str },
}

/// One file being read.
pub(super) struct Records {
    name: String,
    file: BufReader<File>,
    length: u64,
    /// Where the next record outside of chunks begins, byte.
    position: u64,
    chunk: Option<Chunk>,
    /// Chunks by their first byte, from the summary: where to go on behind damage. Empty without a summary.
    places: BTreeMap<u64, Place>,
    /// Chunks that end before this time of logging are only counted, ns.
    skip_before: u64,
    /// What is wrong with the file.
    damage: Vec<String>,
    ended: bool,
}

/// The chunk being read.
struct Chunk {
    reader: LinearReader,
    /// Messages of each channel that came out of it so far.
    shown: BTreeMap<u16, u64>,
    /// Bytes of it that are still in the file.
    remaining: u64,
    /// Whether the file ends inside of it.
    cut_off: bool,
}

impl Records {
    /// Opens a file; `places` comes from its summary, if it has one.
    pub(super) fn open(path: &Path, places: BTreeMap<u64, Place>) -> Result<Self> {
        let file = File::open(path).map_err(Error::io("read", path))?;
        let length = file.metadata().map_err(Error::io("read", path))?.len();
        let mut file = BufReader::with_capacity(64 << 10, file);
        let mut magic = [0; 8];
        let is_mcap = file.read_exact(&mut magic).is_ok() && magic == mcap::MAGIC;
        if !is_mcap {
            let why = if length == 0 { "it is empty" } else { "it does not begin as an MCAP file does" };
            return Err(Error::NotALog { path: path.to_owned(), why: why.to_owned() });
        }
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let position = magic.len() as u64;
        Ok(Self { name, file, length, position, chunk: None, places, skip_before: 0, damage: Vec::new(), ended: false })
    }

    /// Only counts the messages of chunks that end before this time of logging, ns, where an index tells how many they are.
    pub(super) fn skip_before(&mut self, log_time: u64) {
        self.skip_before = log_time;
    }

    /// What is wrong with the file, as far as it has been read.
    pub(super) fn take_damage(&mut self) -> Vec<String> {
        std::mem::take(&mut self.damage)
    }

    /// Goes one step on and shows what it found, if anything. `false` at the end of the file.
    pub(super) fn step(&mut self, visit: &mut dyn FnMut(Event<'_>)) -> bool {
        if self.ended {
            return false;
        }
        let step = if self.chunk.is_some() { self.step_in_chunk(visit) } else { self.step_outside(visit) };
        if let Err(error) = step {
            self.damage.push(format!("{}: cannot read on from byte {}: {error}", self.name, self.position));
            self.ended = true;
        }
        true
    }

    fn step_in_chunk(&mut self, visit: &mut dyn FnMut(Event<'_>)) -> std::io::Result<()> {
        let Some(chunk) = &mut self.chunk else { return Ok(()) };
        let sound = match chunk.reader.next_event() {
            Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                let size = (wanted.max(1) as u64).min(chunk.remaining).min(READ_SIZE) as usize;
                let read = self.file.read(chunk.reader.insert(size))?;
                chunk.reader.notify_read(read);
                chunk.remaining -= read as u64;
                return Ok(());
            }
            Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                let shown = &mut chunk.shown;
                show(opcode, data, true, &mut |event| {
                    if let Event::Message { channel, .. } = event {
                        *shown.entry(channel).or_default() += 1;
                    }
                    visit(event);
                });
                return Ok(());
            }
            None => Ok(()),
            // Of a chunk that is cut off, what came out of it before its end is good.
            Some(Err(_)) if chunk.cut_off => Ok(()),
            Some(Err(error)) => Err(format!("the chunk at byte {} is damaged: {error}", self.position)),
        };
        if chunk.cut_off {
            self.damage.push(format!("{}: cut off at byte {}, inside of a chunk", self.name, self.length));
            self.ended = true;
        }
        let (start, remaining, shown) = (self.position, chunk.remaining, std::mem::take(&mut chunk.shown));
        self.chunk = None;
        self.position = self.file.seek(SeekFrom::Current(remaining as i64))?;
        let why = sound.clone().err();
        visit(Event::ChunkEnd(sound));
        if let Some(why) = why {
            self.damage.push(format!("{}: {why}", self.name));
            self.tell_lost(start, &shown, &why, visit)?;
        }
        Ok(())
    }

    fn step_outside(&mut self, visit: &mut dyn FnMut(Event<'_>)) -> std::io::Result<()> {
        let left = self.length.saturating_sub(self.position);
        if left < RECORD_HEADER {
            let how = if left == 0 { "its end is missing" } else { "cut off inside of a record" };
            self.damage.push(format!("{}: {how}, at byte {}", self.name, self.length));
            self.ended = true;
            return Ok(());
        }
        let mut header = [0; RECORD_HEADER as usize];
        self.file.read_exact(&mut header)?;
        let opcode = header[0];
        let mut length = [0; 8];
        length.copy_from_slice(&header[1..]);
        let (length, left) = (u64::from_le_bytes(length), left - RECORD_HEADER);
        let cut_off = length > left;
        match opcode {
            // The summary at the file's end is there, so it is the length that is wrong.
            op::CHUNK if cut_off && self.places.range(self.position + 1..).next().is_some() => {
                self.resume_behind(
                    format!("the chunk at byte {} is damaged: its length is {length}", self.position),
                    visit,
                )?;
            }
            op::CHUNK if self.places.get(&self.position).is_some_and(|p| p.skip) && !cut_off => self.skip(length)?,
            op::CHUNK if !cut_off && self.count_messages(visit)? => {
                // Reading the indexes has moved the file's position.
                self.position += RECORD_HEADER + length;
                self.file.seek(SeekFrom::Start(self.position))?;
            }
            op::CHUNK if !self.lengths_agree(length)? => {
                let start = self.position;
                let why = format!("the chunk at byte {start} is damaged: its records do not take {length} bytes");
                self.position += RECORD_HEADER + length.min(left);
                self.file.seek(SeekFrom::Start(self.position))?;
                self.damage.push(format!("{}: {why}", self.name));
                self.tell_lost(start, &BTreeMap::new(), &why, visit)?;
            }
            op::CHUNK => {
                let options = LinearReaderOptions::default()
                    .with_skip_start_magic(true)
                    .with_skip_end_magic(true)
                    .with_validate_chunk_crcs(true)
                    .with_record_length_limit(MAX_RECORD);
                let mut reader = LinearReader::new_with_options(options);
                reader.insert(header.len()).copy_from_slice(&header);
                reader.notify_read(header.len());
                self.chunk = Some(Chunk { reader, shown: BTreeMap::new(), remaining: length.min(left), cut_off });
            }
            op::DATA_END | op::FOOTER => self.ended = true,
            _ if cut_off => {
                self.resume_behind(format!("cut off at byte {}, inside of a record", self.length), visit)?
            }
            op::SCHEMA | op::CHANNEL | op::MESSAGE if length <= MAX_RECORD as u64 => {
                let mut body = vec![0; length as usize];
                self.file.read_exact(&mut body)?;
                self.position += RECORD_HEADER + length;
                show(opcode, &body, false, visit);
            }
            op::HEADER | op::MESSAGE_INDEX..=op::SUMMARY_OFFSET | 0x80.. => self.skip(length)?,
            _ => self.resume_behind(format!("no record at byte {}", self.position), visit)?,
        }
        Ok(())
    }

    /// Whether the two lengths that a plain chunk is told to have agree; the file is then where it was. The reader of the `mcap` crate
    /// relies on it, and subtracts below zero where records go on behind the inner length.
    fn lengths_agree(&mut self, length: u64) -> std::io::Result<bool> {
        // Two times, a size and a checksum, none of them of use here; then the length of the compression's name.
        const BEFORE: usize = 28;
        let mut head = [0; BEFORE + 4 + 8];
        let whole = length >= head.len() as u64 && self.file.read_exact(&mut head).is_ok();
        self.file.seek(SeekFrom::Start(self.position + RECORD_HEADER))?;
        // What is cut off or compressed is the reader's to judge.
        if !whole || head[BEFORE..BEFORE + 4] != [0; 4] {
            return Ok(true);
        }
        let mut inner = [0; 8];
        inner.copy_from_slice(&head[BEFORE + 4..]);
        Ok(u64::from_le_bytes(inner) == length - head.len() as u64)
    }

    /// Counts the messages of the chunk at hand by its indexes, if it ends before what is wanted. `false`, with the file where it was,
    /// if it must be read.
    fn count_messages(&mut self, visit: &mut dyn FnMut(Event<'_>)) -> std::io::Result<bool> {
        let Some(place) = self.places.get(&self.position).filter(|p| p.last_time < self.skip_before) else {
            return Ok(false);
        };
        let starts: Vec<u64> = place.indexes.values().copied().collect();
        let mut counts = BTreeMap::new();
        for start in starts {
            self.file.seek(SeekFrom::Start(start))?;
            let Some((channel, messages)) = self.read_index()? else {
                counts.clear();
                break;
            };
            counts.insert(channel, messages);
        }
        if counts.is_empty() {
            self.file.seek(SeekFrom::Start(self.position + RECORD_HEADER))?;
            return Ok(false);
        }
        counts.into_iter().for_each(|(channel, messages)| visit(Event::Skipped { channel, messages }));
        Ok(true)
    }

    /// The message index where the file is: its channel, and how many messages it lists. `None`, if there is no such record.
    fn read_index(&mut self) -> std::io::Result<Option<(u16, u64)>> {
        // Opcode and length of the record; channel; bytes that the entries take, 16 each.
        let mut head = [0; 15];
        if let Err(error) = self.file.read_exact(&mut head) {
            return if error.kind() == std::io::ErrorKind::UnexpectedEof { Ok(None) } else { Err(error) };
        }
        let [opcode, l0, l1, l2, l3, l4, l5, l6, l7, id0, id1, b0, b1, b2, b3] = head;
        let length = u64::from_le_bytes([l0, l1, l2, l3, l4, l5, l6, l7]);
        let bytes = u64::from(u32::from_le_bytes([b0, b1, b2, b3]));
        let whole = opcode == op::MESSAGE_INDEX && bytes % 16 == 0 && length == bytes + 6 && bytes <= self.length;
        if !whole {
            return Ok(None);
        }
        self.file.seek_relative(bytes as i64)?;
        Ok(Some((u16::from_le_bytes([id0, id1]), bytes / 16)))
    }

    /// Tells what the chunk at byte `start` held, by its indexes, besides the messages that were `shown`. The file is then where it was.
    fn tell_lost(
        &mut self,
        start: u64,
        shown: &BTreeMap<u16, u64>,
        why: &str,
        visit: &mut dyn FnMut(Event<'_>),
    ) -> std::io::Result<()> {
        let known = self.places.get(&start).map(|place| place.indexes.values().copied().collect::<Vec<_>>());
        let mut counts = BTreeMap::new();
        match known.filter(|indexes| !indexes.is_empty()) {
            Some(indexes) => {
                for index in indexes {
                    self.file.seek(SeekFrom::Start(index))?;
                    counts.extend(self.read_index()?);
                }
            }
            // Without a summary: they follow the chunk.
            None => {
                while let Some((channel, messages)) = self.read_index()? {
                    counts.insert(channel, messages);
                }
            }
        }
        self.file.seek(SeekFrom::Start(self.position))?;
        for (channel, messages) in counts {
            let messages = messages.saturating_sub(shown.get(&channel).copied().unwrap_or(0));
            if messages > 0 {
                visit(Event::Lost { channel, messages, why });
            }
        }
        Ok(())
    }

    /// Passes over the body of a record.
    fn skip(&mut self, length: u64) -> std::io::Result<()> {
        // A record lies within the file, so its length fits.
        self.file.seek_relative(length as i64)?;
        self.position += RECORD_HEADER + length;
        Ok(())
    }

    /// Notes damage and goes on with the next chunk that the summary knows; ends if there is none.
    fn resume_behind(&mut self, why: String, visit: &mut dyn FnMut(Event<'_>)) -> std::io::Result<()> {
        let next = self.places.range(self.position + 1..).next().map(|(&start, _)| start);
        match next.filter(|&start| start < self.length) {
            Some(next) => {
                if self.places.contains_key(&self.position) {
                    self.tell_lost(self.position, &BTreeMap::new(), &why, visit)?;
                }
                self.position = self.file.seek(SeekFrom::Start(next))?;
            }
            None => self.ended = true,
        }
        self.damage.push(format!("{}: {why}", self.name));
        Ok(())
    }
}

/// Shows a record, if it is of a kind that matters. One that does not parse is passed over: a chunk's checksum has the last word.
fn show(opcode: u8, body: &[u8], in_chunk: bool, visit: &mut dyn FnMut(Event<'_>)) {
    if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
        return;
    }
    match mcap::parse_record(opcode, body) {
        Ok(Record::Schema { header, .. }) => visit(Event::Schema { id: header.id, name: header.name }),
        Ok(Record::Channel(c)) => {
            visit(Event::Channel { id: c.id, schema: c.schema_id, topic: c.topic, encoding: c.message_encoding });
        }
        Ok(Record::Message { header, data }) => {
            visit(Event::Message { channel: header.channel_id, log_time: header.log_time, data: &data, in_chunk });
        }
        _ => {}
    }
}
