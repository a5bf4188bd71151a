//! Refuses the frames whose times are out of order, and keeps all others.

use crate::frame::{FrameError, RawFrame};
use crate::source::Source;

/// Passes frames on in their order. A frame whose time does not come after that of the last frame in order is refused. Where the
/// frame *after* it would fit in, it is the frame with the later time that is out of order, and it is refused instead:
/// of the times 1, 9, 2, 3 only the 9 goes.
pub(crate) struct TimeOrder<S> {
    source: S,
    /// The frame after the one that is judged.
    ahead: Option<RawFrame>,
    /// Index and time of the last frame in order.
    last: Option<(u64, i64)>,
}

impl<S: Source> TimeOrder<S> {
    pub(crate) fn new(source: S) -> Self {
        Self { source, ahead: None, last: None }
    }

    pub(crate) fn source(&self) -> &S {
        &self.source
    }

    pub(crate) fn source_mut(&mut self) -> &mut S {
        &mut self.source
    }
}

impl<S: Source> Iterator for TimeOrder<S> {
    type Item = RawFrame;

    fn next(&mut self) -> Option<RawFrame> {
        let mut frame = self.ahead.take().or_else(|| self.source.next())?;
        self.ahead = self.source.next();
        let Some(timestamp_ns) = frame.timestamp_ns else { return Some(frame) };
        let line = frame.time_line;
        if let Some((previous, previous_ns)) = self.last.filter(|&(_, ns)| timestamp_ns <= ns) {
            frame.refuse(FrameError::TimeOrder { timestamp_ns, line, previous, previous_ns });
            return Some(frame);
        }
        let next_ns = self.ahead.as_ref().and_then(|f| f.timestamp_ns);
        // Equal times: the first of the two frames stays.
        if let (Some(next_ns), Some((_, previous_ns))) = (next_ns, self.last)
            && previous_ns < next_ns
            && next_ns < timestamp_ns
        {
            frame.refuse(FrameError::TimeAhead { timestamp_ns, line, next_ns });
            return Some(frame);
        }
        if !frame.is_refused() {
            self.last = Some((frame.index, timestamp_ns));
        }
        Some(frame)
    }
}
