//! The fill level of a queue, and the state of its reader.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

pub(super) const HEAD_BYTES: usize = 2;

/// It includes the queue's own bytes, but not the gap before it wraps to its start, which is shorter than a
/// frame.
#[derive(Debug, Default)]
pub(super) struct Level {
    bytes: AtomicU32,
    bytes_max: AtomicU32,
    /// A reader takes the bytes. The USB port may have none.
    is_open: AtomicBool,
    dropped: AtomicU32,
}

impl Level {
    pub(super) const fn new() -> Self {
        Self {
            bytes: AtomicU32::new(0),
            bytes_max: AtomicU32::new(0),
            is_open: AtomicBool::new(false),
            dropped: AtomicU32::new(0),
        }
    }

    pub(super) fn rise(&self, bytes: usize) {
        let bytes = (HEAD_BYTES + bytes) as u32;
        let before = self.bytes.fetch_add(bytes, Ordering::Relaxed);
        self.bytes_max.fetch_max(before.wrapping_add(bytes), Ordering::Relaxed);
    }

    pub(super) fn fall(&self, bytes: usize) {
        self.bytes.fetch_sub((HEAD_BYTES + bytes) as u32, Ordering::Relaxed);
    }

    pub(super) fn bytes(&self) -> usize {
        self.bytes.load(Ordering::Relaxed) as usize
    }

    pub(super) fn set_open(&self, is_open: bool) {
        self.is_open.store(is_open, Ordering::Relaxed);
    }

    pub(super) fn is_open(&self) -> bool {
        self.is_open.load(Ordering::Relaxed)
    }

    pub(super) fn drop_one(&self) {
        self.dropped.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn dropped(&self) -> u32 {
        self.dropped.load(Ordering::Relaxed)
    }

    pub(super) fn max(&self) -> u32 {
        self.bytes_max.load(Ordering::Relaxed)
    }
}
