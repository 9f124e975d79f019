//! What a run came to, for the board to tell once the log is closed: figures, and what each stage cost.

use hums_blackbox::record::Stats;

/// The parts that are measured apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    /// Nothing else; also the interrupts of ports and clock.
    Idle,
    /// Everything in a task that is none of the below: the executors, waiting and waking.
    Tasks,
    /// Bytes to frames.
    Framer,
    /// Frames out of their queue.
    Monitor,
    /// Frames to sectors.
    Encode,
    /// Frames to observations, and those to what the monitor knows.
    Observe,
    /// Frames on to the ground station.
    Summary,
    /// What happens by the clock: checks for silence, the summary.
    Tick,
    /// Sectors to the card.
    Storage,
}

/// Number of stages.
pub(crate) const STAGES: usize = 9;

impl Stage {
    /// All of them, in the order of their numbers, with their names.
    pub(crate) const NAMES: [(Self, &str); STAGES] = [
        (Self::Idle, "idle"),
        (Self::Tasks, "tasks"),
        (Self::Framer, "framer"),
        (Self::Monitor, "monitor"),
        (Self::Encode, "encode"),
        (Self::Observe, "observe"),
        (Self::Summary, "summary"),
        (Self::Tick, "tick"),
        (Self::Storage, "storage"),
    ];
}

/// The figures of a run.
pub(crate) struct Report {
    /// The pipeline's own.
    pub(crate) stats: Stats,
    /// Frames that were still queued when the log was closed: there was no card.
    pub(crate) frames_left: u64,
    /// What each stage cost, in the order of [`Stage::NAMES`].
    pub(crate) costs: [u64; STAGES],
    /// Bytes of stack that were ever used, and bytes there are.
    pub(crate) stack: (usize, usize),
}
