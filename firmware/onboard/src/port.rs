//! Counters of reception for the monitor.

use hums_recorder::shared::Shared;

/// Shared by reception and the port, which count, and the monitor.
pub type PortStatus = Shared<PortReading>;

/// Counters of the autopilot's port since power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortReading {
    /// Bytes received.
    pub bytes: u64,
    /// Bytes that belong to no frame.
    pub bytes_not_frames: u64,
    /// Frames of known shape with a wrong checksum; their bytes count as bytes outside frames.
    pub damaged: u64,
    /// Frames found.
    pub frames: u64,
    /// The frame queue was full.
    pub frames_lost: u64,
    /// Times that bytes were lost before reception fetched them.
    pub overrun: u64,
    /// The sum of the times within which those losses came, ms.
    pub blind_ms: u64,
    /// The most bytes in the frame queue at once.
    pub queue_bytes_max: u32,
}

impl PortReading {
    /// Before the first byte.
    pub const NONE: Self = Self {
        bytes: 0,
        bytes_not_frames: 0,
        damaged: 0,
        frames: 0,
        frames_lost: 0,
        overrun: 0,
        blind_ms: 0,
        queue_bytes_max: 0,
    };
}
