//! The ordered content of a group, for formats that are made of quantities rather than of messages.

use hums_core::clock::Instant;
use hums_core::observation::{Observation, Source};

use crate::source::item::Item;

/// A frame's observation, kept until the frames before it have been taken.
#[derive(Clone, Copy, Debug)]
pub struct HeldObservation {
    /// Time of its frame.
    pub at: Instant,
    /// The sender.
    pub source: Source,
    /// The observation.
    pub observation: Observation,
}

/// A text or a parameter.
#[derive(Clone, Debug)]
pub enum StoryEntry {
    /// A text of a component.
    Text {
        /// Time of its first part.
        at: Instant,
        /// `MAV_SEVERITY`: 0 is an emergency, 7 is for debugging.
        severity: u8,
        /// Its words.
        words: String,
    },
    /// A parameter of the autopilot.
    Parameter {
        /// Time of the report.
        at: Instant,
        /// Its name.
        name: String,
        /// Its value.
        value: f64,
    },
}

impl StoryEntry {
    /// That of an item, if it is one.
    pub fn of(at: Instant, item: &Item<'_>) -> Option<Self> {
        match item {
            Item::Text(text) => {
                Some(Self::Text { at, severity: text.severity, words: text.words.to_owned() })
            }
            Item::Parameter(told) => {
                Some(Self::Parameter { at, name: told.name.to_owned(), value: told.value })
            }
            _ => None,
        }
    }

    /// Its time.
    pub const fn at(&self) -> Instant {
        match self {
            Self::Text { at, .. } | Self::Parameter { at, .. } => *at,
        }
    }

    fn held_bytes(&self) -> usize {
        let (Self::Text { words: text, .. } | Self::Parameter { name: text, .. }) = self;
        size_of::<Self>() + text.len()
    }
}

/// Observations and words of a group, each in order.
#[derive(Clone, Debug, Default)]
pub struct Story {
    /// Observations, also from before the wanted time: later ones depend on them.
    pub observed: Vec<HeldObservation>,
    /// Texts and parameters in the wanted time.
    pub said: Vec<StoryEntry>,
}

impl Story {
    /// Bytes of memory that it holds, roughly.
    pub fn held_bytes(&self) -> usize {
        size_of::<HeldObservation>() * self.observed.len()
            + self.said.iter().map(StoryEntry::held_bytes).sum::<usize>()
    }
}
