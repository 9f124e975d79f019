//! What the checks need to know of the monitor itself: its port and its recording.

use crate::time::Instant;

/// The autopilot's port.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkReading {
    /// Frames of the vehicle that were lost in the last ten seconds, by their sequence numbers, 0 to 1; `None` before
    /// enough came.
    pub frames_lost: Option<f32>,
    /// When that was worked out.
    pub at: Instant,
}

/// What the recording is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Recording {
    /// Just powered on.
    #[default]
    Starting,
    /// Sectors reach the card.
    Running,
    /// There is no card to write to, or it does not take blocks.
    Stopped,
}

/// Our own recording.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RecorderStatus {
    /// What it is doing.
    pub recording: Recording,
    /// How full the sector queue is, 0 to 1.
    pub queue: f32,
    /// Frames lost since power-on, wherever.
    pub frames_lost: u64,
}
