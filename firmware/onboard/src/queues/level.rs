//! The fill level of a queue, and the state of its reader.

use hums_recorder::shared::Shared;

pub(super) const HEAD_BYTES: usize = 2;

pub(super) type Level = Shared<Fill>;

#[derive(Clone, Copy, Debug)]
pub(super) struct Fill {
    /// They include the queue's own bytes, but not the gap before it wraps to its start, which is shorter than a frame.
    pub(super) bytes: usize,
    pub(super) bytes_max: usize,
    /// A reader takes the bytes. The USB port may have none.
    pub(super) is_open: bool,
    pub(super) dropped: u32,
}

impl Fill {
    pub(super) const EMPTY: Self = Self { bytes: 0, bytes_max: 0, is_open: false, dropped: 0 };

    pub(super) fn rise(&mut self, bytes: usize) {
        self.bytes += HEAD_BYTES + bytes;
        self.bytes_max = self.bytes_max.max(self.bytes);
    }

    pub(super) fn fall(&mut self, bytes: usize) {
        self.bytes -= HEAD_BYTES + bytes;
    }
}
