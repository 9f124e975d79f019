//! The monitor's own state for the checks: its port and its recording.

use crate::time::{BootMs, Millis};

/// The autopilot's port.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkReading {
    /// Frames of the vehicle that were lost in the last ten seconds, by their sequence numbers, 0 to 1; `None` before
    /// enough came.
    pub frames_lost: Option<f32>,
    /// When that was computed.
    pub at: BootMs,
}

/// The state of the recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Recording {
    /// Just powered on.
    #[default]
    Starting,
    /// Sectors reach the card.
    Running,
    /// No card accepts blocks.
    Stopped,
}

/// Our own recording.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RecorderStatus {
    /// Its state.
    pub recording: Recording,
    /// How full the sector queue is, 0 to 1.
    pub queue: f32,
    /// Frames lost since power-on, anywhere.
    pub frames_lost: u64,
    /// Time for which the card has kept storage waiting now; zero if it does not.
    pub stall: Millis,
    /// Block writes that the card refused since power-on, retries included.
    pub write_errors: u64,
    /// The share of the card that logs can have, 0 to 1: free clusters and existing logs, because the oldest log
    /// makes room for the newest. Other files take the rest. `None` until it was counted.
    pub room: Option<f32>,
}
