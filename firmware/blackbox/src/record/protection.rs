//! The request of the protective action to the autopilot.

use hums_core::protect::{Action, Stage};

use super::stored::{Field, Fields, Sink, record};

record! {
    /// A step of the protective action.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    Protection {
        /// Requested action.
        action: Action,
        /// The stage.
        stage: Stage,
        /// Seconds, attempt or `MAV_RESULT`, by the stage.
        detail: u8,
        /// `MAV_CMD`
        command: u16,
    }
}

impl Protection {
    /// To be written.
    pub const fn new(step: &hums_core::protect::Step) -> Self {
        Self { action: step.action, stage: step.stage, detail: step.detail, command: step.action.command() }
    }
}
