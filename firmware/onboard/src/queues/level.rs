//! How full a queue was.

use core::sync::atomic::{AtomicU32, Ordering};

/// How full a queue is, and was at most.
#[derive(Debug, Default)]
pub(super) struct Level {
    bytes: AtomicU32,
    bytes_max: AtomicU32,
}

impl Level {
    pub(super) const fn new() -> Self {
        Self { bytes: AtomicU32::new(0), bytes_max: AtomicU32::new(0) }
    }

    pub(super) fn rise(&self, bytes: usize) {
        let before = self.bytes.fetch_add(bytes as u32, Ordering::Relaxed);
        self.bytes_max.fetch_max(before.wrapping_add(bytes as u32), Ordering::Relaxed);
    }

    pub(super) fn fall(&self, bytes: usize) {
        self.bytes.fetch_sub(bytes as u32, Ordering::Relaxed);
    }

    pub(super) fn max(&self) -> u32 {
        self.bytes_max.load(Ordering::Relaxed)
    }
}
