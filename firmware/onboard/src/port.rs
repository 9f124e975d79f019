//! Counters of reception for the monitor: plain atomics, so that neither side ever waits.
//!
//! They have 32 bits, read at once; the monitor adds up differences in 64 bits. A difference is right if it
//! is read more often than once in 2^32 bytes (13 hours at 921,600 baud).

use core::sync::atomic::{AtomicU32, Ordering};

/// Counters of the autopilot's port since power-on, each modulo 2^32.
#[derive(Debug, Default)]
pub struct PortStatus {
    bytes: AtomicU32,
    bytes_not_frames: AtomicU32,
    damaged: AtomicU32,
    frames: AtomicU32,
    frames_lost: AtomicU32,
    overrun: AtomicU32,
    blind_ms: AtomicU32,
    queue_bytes_max: AtomicU32,
}

/// A reading of [`PortStatus`], or a difference of two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortReading {
    /// Bytes received.
    pub bytes: u32,
    /// Bytes that belong to no frame.
    pub bytes_not_frames: u32,
    /// Frames of known shape with a wrong checksum; their bytes count as bytes outside frames.
    pub damaged: u32,
    /// Frames found.
    pub frames: u32,
    /// The frame queue was full.
    pub frames_lost: u32,
    /// Times that bytes were lost before reception fetched them.
    pub overrun: u32,
}

impl PortReading {
    /// Counts since `earlier`.
    pub const fn since(self, earlier: Self) -> Self {
        Self {
            bytes: self.bytes.wrapping_sub(earlier.bytes),
            bytes_not_frames: self.bytes_not_frames.wrapping_sub(earlier.bytes_not_frames),
            damaged: self.damaged.wrapping_sub(earlier.damaged),
            frames: self.frames.wrapping_sub(earlier.frames),
            frames_lost: self.frames_lost.wrapping_sub(earlier.frames_lost),
            overrun: self.overrun.wrapping_sub(earlier.overrun),
        }
    }
}

impl PortStatus {
    /// All zero.
    pub const fn new() -> Self {
        Self {
            bytes: AtomicU32::new(0),
            bytes_not_frames: AtomicU32::new(0),
            damaged: AtomicU32::new(0),
            frames: AtomicU32::new(0),
            frames_lost: AtomicU32::new(0),
            overrun: AtomicU32::new(0),
            blind_ms: AtomicU32::new(0),
            queue_bytes_max: AtomicU32::new(0),
        }
    }

    /// The most bytes in the frame queue at once.
    pub fn queue_bytes_max(&self) -> u32 {
        self.queue_bytes_max.load(Ordering::Relaxed)
    }

    pub(crate) fn set_queue_bytes_max(&self, bytes: u32) {
        self.queue_bytes_max.store(bytes, Ordering::Relaxed);
    }

    /// The values; each may be of another moment.
    pub fn read(&self) -> PortReading {
        PortReading {
            bytes: self.bytes.load(Ordering::Relaxed),
            bytes_not_frames: self.bytes_not_frames.load(Ordering::Relaxed),
            damaged: self.damaged.load(Ordering::Relaxed),
            frames: self.frames.load(Ordering::Relaxed),
            frames_lost: self.frames_lost.load(Ordering::Relaxed),
            overrun: self.overrun.load(Ordering::Relaxed),
        }
    }

    pub(crate) fn store(&self, reading: PortReading) {
        self.bytes.store(reading.bytes, Ordering::Relaxed);
        self.bytes_not_frames.store(reading.bytes_not_frames, Ordering::Relaxed);
        self.damaged.store(reading.damaged, Ordering::Relaxed);
        self.frames.store(reading.frames, Ordering::Relaxed);
        self.frames_lost.store(reading.frames_lost, Ordering::Relaxed);
    }

    /// A loss before reception, within this time in ms.
    pub fn count_overrun(&self, blind_ms: u32) {
        self.blind_ms.fetch_add(blind_ms, Ordering::Relaxed);
        self.overrun.fetch_add(1, Ordering::Relaxed);
    }

    /// Modulo 2^32.
    pub(crate) fn blind_ms(&self) -> u32 {
        self.blind_ms.load(Ordering::Relaxed)
    }
}
