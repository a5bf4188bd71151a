//! Fields of ROS messages in order: the two ways in which ROS lays them out.

use re_cdr::{BigEndian, CdrReader, LittleEndian};

use crate::frame::FrameError;

type Result<T> = std::result::Result<T, FrameError>;

/// A message of which one field after the other is read.
pub(crate) trait Fields<'a> {
    /// Whether the message's header begins with a sequence number, as it does in ROS 1.
    const HEADER_HAS_SEQUENCE: bool;
    fn u8(&mut self) -> Result<u8>;
    fn u32(&mut self) -> Result<u32>;
    fn f64(&mut self) -> Result<f64>;
    fn str(&mut self) -> Result<&'a str>;
    /// A sequence of bytes, borrowed.
    fn bytes(&mut self) -> Result<&'a [u8]>;
    /// A sequence of numbers, of at most `most`.
    fn f64s(&mut self, most: u32) -> Result<Vec<f64>> {
        let count = self.u32()?;
        if count > most {
            return Err(bad(format!("a sequence of {count} numbers where at most {most} are expected")));
        }
        (0..count).map(|_| self.f64()).collect()
    }
}

/// `std_msgs/Header`: time in ns, 0 if there is none. The frame's name is passed over.
pub(crate) fn header<'a>(fields: &mut impl Fields<'a>) -> Result<i64> {
    let stamp_ns = stamp(fields)?;
    fields.str()?;
    Ok(stamp_ns)
}

/// The time of a header, ns, which every stamped message begins with.
pub(crate) fn stamp<'a, F: Fields<'a>>(fields: &mut F) -> Result<i64> {
    if F::HEADER_HAS_SEQUENCE {
        fields.u32()?;
    }
    // Seconds are signed in ROS 2 and unsigned in ROS 1; both agree until 2038.
    let (seconds, nanoseconds) = (fields.u32()?, fields.u32()?);
    let seconds = if F::HEADER_HAS_SEQUENCE { i64::from(seconds) } else { i64::from(seconds as i32) };
    if nanoseconds >= 1_000_000_000 {
        return Err(bad(format!("a stamp of {nanoseconds} ns past the second")));
    }
    // At most 2^32 s, which is 4.3e18 ns: no overflow.
    Ok(seconds * 1_000_000_000 + i64::from(nanoseconds))
}

/// A message that does not follow its type.
fn bad(why: impl ToString) -> FrameError {
    FrameError::Message { schema: "message".to_owned(), why: why.to_string() }
}

/// ROS 2.
pub(crate) enum Cdr<'a> {
    Little(CdrReader<'a, LittleEndian>),
    Big(CdrReader<'a, BigEndian>),
}

impl<'a> Cdr<'a> {
    /// Reads the encapsulation header; offsets count from behind it.
    pub(crate) fn new(message: &'a [u8]) -> Result<Self> {
        match message {
            [0, 0, _, _, body @ ..] => Ok(Self::Big(CdrReader::new(body))),
            [0, 1, _, _, body @ ..] => Ok(Self::Little(CdrReader::new(body))),
            [a, b, _, _, ..] => {
                Err(bad(format!("CDR encapsulation {a:02x} {b:02x} is not known; known are 00 00 and 00 01")))
            }
            _ => Err(bad(format!("{} bytes are not even a CDR header", message.len()))),
        }
    }
}

macro_rules! cdr {
    ($self:ident, $r:ident, $read:expr) => {
        match $self {
            Self::Little($r) => $read,
            Self::Big($r) => $read,
        }
        .map_err(bad)
    };
}

impl<'a> Fields<'a> for Cdr<'a> {
    const HEADER_HAS_SEQUENCE: bool = false;
    fn u8(&mut self) -> Result<u8> {
        cdr!(self, r, r.read_u8())
    }
    fn u32(&mut self) -> Result<u32> {
        cdr!(self, r, r.read_u32())
    }
    fn f64(&mut self) -> Result<f64> {
        cdr!(self, r, r.read_f64())
    }
    fn str(&mut self) -> Result<&'a str> {
        cdr!(self, r, r.read_str())
    }
    fn bytes(&mut self) -> Result<&'a [u8]> {
        cdr!(self, r, r.read_byte_sequence())
    }
}

/// ROS 1: little-endian, without padding.
pub(crate) struct Ros1<'a> {
    rest: &'a [u8],
}

impl<'a> Ros1<'a> {
    pub(crate) fn new(message: &'a [u8]) -> Self {
        Self { rest: message }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or_else(|| bad("unexpected end of input"))?;
        self.rest = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }
}

impl<'a> Fields<'a> for Ros1<'a> {
    const HEADER_HAS_SEQUENCE: bool = true;
    fn u8(&mut self) -> Result<u8> {
        Ok(self.array::<1>()?[0])
    }
    fn u32(&mut self) -> Result<u32> {
        self.array().map(u32::from_le_bytes)
    }
    fn f64(&mut self) -> Result<f64> {
        self.array().map(f64::from_le_bytes)
    }
    fn str(&mut self) -> Result<&'a str> {
        std::str::from_utf8(self.bytes()?).map_err(bad)
    }
    fn bytes(&mut self) -> Result<&'a [u8]> {
        let count = self.u32()? as usize;
        self.take(count)
    }
}
