//! What a run came to, for the board to tell once the log is closed.

use hums_blackbox::record::Stats;

use crate::costs::STAGES;

/// The figures of a run.
pub(crate) struct Report {
    /// The pipeline's own.
    pub(crate) stats: Stats,
    /// Frames that were still queued when the log was closed: there was no card.
    pub(crate) frames_left: u64,
    /// What each stage cost, in the order of `costs::Stage::NAMES`.
    pub(crate) costs: [u64; STAGES],
    /// Bytes of stack that were ever used, and bytes there are.
    pub(crate) stack: (usize, usize),
}
