//! How full a queue was.

use core::sync::atomic::{AtomicU32, Ordering};

/// What the queue puts before each frame: its length.
const HEAD_BYTES: usize = 2;

/// How full a queue is, and was at most, with the queue's own bytes but without the gap that it leaves before it begins again at its
/// start, which is shorter than a frame.
#[derive(Debug, Default)]
pub(super) struct Level {
    bytes: AtomicU32,
    bytes_max: AtomicU32,
}

impl Level {
    pub(super) const fn new() -> Self {
        Self { bytes: AtomicU32::new(0), bytes_max: AtomicU32::new(0) }
    }

    /// A frame of so many bytes is put in.
    pub(super) fn rise(&self, bytes: usize) {
        let bytes = (HEAD_BYTES + bytes) as u32;
        let before = self.bytes.fetch_add(bytes, Ordering::Relaxed);
        self.bytes_max.fetch_max(before.wrapping_add(bytes), Ordering::Relaxed);
    }

    /// A frame of so many bytes was taken out.
    pub(super) fn fall(&self, bytes: usize) {
        self.bytes.fetch_sub((HEAD_BYTES + bytes) as u32, Ordering::Relaxed);
    }

    pub(super) fn max(&self) -> u32 {
        self.bytes_max.load(Ordering::Relaxed)
    }
}
