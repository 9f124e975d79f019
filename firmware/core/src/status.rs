//! What the checks need to know of the monitor itself: its port and its recording.

use crate::time::{Instant, Span};

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
    /// How long the card has been keeping storage waiting, now; zero while it does not.
    pub stall: Span,
    /// Block writes that the card refused since power-on, retries included.
    pub write_errors: u64,
    /// The share of the card that logs can have, 0 to 1: free clusters and what logs have already, because the oldest
    /// log makes room for the newest. What is missing to 1 are other files. `None` until it was counted.
    pub room: Option<f32>,
}
