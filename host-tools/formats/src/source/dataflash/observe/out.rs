//! The receiver of the items that handlers make.

use hums_core::cause::Alert;
use hums_core::observation::{Observation, Source};

use crate::source::item::{Fact, FactKind, Item, Text};

/// The autopilot.
pub(in crate::source::dataflash) const SOURCE: Source = Source { system: 1, component: 1 };

pub(in crate::source::dataflash) struct Out<'a>(&'a mut dyn FnMut(Item<'_>));

impl<'a> Out<'a> {
    /// To this function.
    pub(in crate::source::dataflash) fn new(take: &'a mut dyn FnMut(Item<'_>)) -> Self {
        Self(take)
    }

    pub(super) fn item(&mut self, item: Item<'_>) {
        (self.0)(item);
    }

    pub(super) fn observe(&mut self, observation: &Observation) {
        self.item(Item::Observation(SOURCE, observation));
    }

    pub(super) fn fact(&mut self, about: FactKind, words: &str) {
        self.item(Item::Fact(Fact { about, words }));
    }

    pub(super) fn text(&mut self, severity: u8, words: &str, alert: Option<Alert>) {
        self.item(Item::Text(Text { source: SOURCE, severity, words, alert }));
    }
}
