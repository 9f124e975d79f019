//! From a message's columns to observations.

use hums_core::clock::Instant;

use super::out::Out;
use super::state::State;
use crate::source::dataflash::format::{Field, FieldKind};
use crate::source::dataflash::message::Message;

/// Columns that one handler reads at most.
const SLOTS_MAX: usize = 16;

pub(in crate::source::dataflash) type Slots = [Option<u8>; SLOTS_MAX];

pub(in crate::source::dataflash) struct Handler {
    /// Separated by spaces, with a sensor's number if not 0: `IMU IMU2:1`.
    names: &'static str,
    /// Separated by spaces; for each slot the labels it has had: `T|Temp`.
    columns: &'static str,
    /// About the whole log: searched for in a file's first part.
    pub(in crate::source::dataflash) is_fact: bool,
    /// Needed also without observations.
    pub(in crate::source::dataflash) is_said: bool,
    /// Does it.
    pub(super) take: fn(&mut State, &Given<'_>, &mut Out<'_>),
}

pub(super) const fn handler(
    names: &'static str,
    columns: &'static str,
    take: fn(&mut State, &Given<'_>, &mut Out<'_>),
) -> Handler {
    Handler { names, columns, is_fact: false, is_said: false, take }
}

impl std::fmt::Debug for Handler {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.names)
    }
}

impl Handler {
    pub(super) const fn fact(self) -> Self {
        Self { is_fact: true, ..self }
    }

    /// Needed without observations too.
    pub(super) const fn said(self) -> Self {
        Self { is_said: true, ..self }
    }

    /// `None` for messages of other handlers.
    pub(super) fn sensor(&self, name: &str) -> Option<u8> {
        let names = self.names.split(' ').map(|name| name.split_once(':').unwrap_or((name, "0")));
        names.into_iter().find(|(known, _)| *known == name).and_then(|(_, number)| number.parse().ok())
    }

    pub(in crate::source::dataflash) fn resolve(&self, fields: &[Field]) -> Slots {
        let mut slots = [None; SLOTS_MAX];
        for (slot, labels) in slots.iter_mut().zip(self.columns.split(' ')) {
            let known = |label: &str| fields.iter().position(|field| field.name == label);
            *slot = labels.split('|').find_map(known).and_then(|column| u8::try_from(column).ok());
        }
        slots
    }
}

pub(super) struct Given<'a> {
    pub(super) message: &'a Message<'a>,
    pub(super) slots: &'a Slots,
    /// The sensor in the message's name.
    pub(super) base: u8,
    pub(super) at: Instant,
    /// Microseconds since power-on, if the log has them.
    pub(super) boot_us: Option<u64>,
}

impl Given<'_> {
    pub(super) fn column(&self, slot: usize) -> Option<usize> {
        self.slots.get(slot).copied().flatten().map(usize::from)
    }

    /// A finite number.
    pub(super) fn number(&self, slot: usize) -> Option<f64> {
        self.message.number(self.column(slot)?)
    }

    /// Finite.
    pub(super) fn single(&self, slot: usize) -> Option<f32> {
        self.message.single(self.column(slot)?)
    }

    /// All or none.
    pub(super) fn singles<const N: usize>(&self, first: usize) -> Option<[f32; N]> {
        let mut numbers = [0.0; N];
        for (offset, number) in numbers.iter_mut().enumerate() {
            *number = self.single(first + offset)?;
        }
        Some(numbers)
    }

    pub(super) fn unsigned(&self, slot: usize) -> Option<u64> {
        self.message.unsigned(self.column(slot)?)
    }

    pub(super) fn byte(&self, slot: usize) -> Option<u8> {
        self.unsigned(slot)?.try_into().ok()
    }

    pub(super) fn text(&self, slot: usize) -> Option<String> {
        self.message.text(self.column(slot)?).map(std::borrow::Cow::into_owned)
    }

    /// Older versions used whole hundredths and thousandths.
    pub(super) fn is_integer(&self, slot: usize) -> bool {
        let column = self.column(slot);
        let kind = column.and_then(|column| self.message.format().fields.get(column)).map(|field| field.kind);
        kind.is_some_and(FieldKind::is_integer)
    }

    pub(super) fn instance(&self, slot: usize) -> u8 {
        self.byte(slot).unwrap_or(self.base)
    }
}
