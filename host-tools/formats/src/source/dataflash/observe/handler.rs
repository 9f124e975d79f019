//! From one message to its observations: its columns, and their values.

use hums_core::clock::Instant;

use super::say::Out;
use super::state::State;
use crate::source::dataflash::format::{Field, FieldKind};
use crate::source::dataflash::message::Message;

/// Columns that one handler reads at most.
const SLOTS_MAX: usize = 16;

/// The column of each slot; `None` if the file does not have it.
pub(in crate::source::dataflash) type Slots = [Option<u8>; SLOTS_MAX];

/// The handler of a message.
pub(in crate::source::dataflash) struct Handler {
    /// The names of the message with spaces between, each with the number of its sensor if that is not 0: `IMU IMU2:1`.
    names: &'static str,
    /// The columns with spaces between: for each slot the labels that it has had, as in `T|Temp`.
    columns: &'static str,
    /// Whether it reports a fact about the whole log: the first part of a file is searched for these.
    pub(in crate::source::dataflash) is_fact: bool,
    /// Whether it is needed also without observations.
    pub(in crate::source::dataflash) is_said: bool,
    /// Does it.
    pub(super) take: fn(&mut State, &Given<'_>, &mut Out<'_>),
}

/// A row of a table of handlers.
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
    /// The same for a fact about the whole log.
    pub(super) const fn fact(self) -> Self {
        Self { is_fact: true, ..self }
    }

    /// The same for texts and numbers, which are needed without observations too.
    pub(super) const fn said(self) -> Self {
        Self { is_said: true, ..self }
    }

    /// The number of the sensor of a message of this name; `None` for messages of other handlers.
    pub(super) fn sensor(&self, name: &str) -> Option<u8> {
        let names = self.names.split(' ').map(|name| name.split_once(':').unwrap_or((name, "0")));
        names.into_iter().find(|(known, _)| *known == name).and_then(|(_, number)| number.parse().ok())
    }

    /// Which columns of a message are which slot.
    pub(in crate::source::dataflash) fn resolve(&self, fields: &[Field]) -> Slots {
        let mut slots = [None; SLOTS_MAX];
        for (slot, labels) in slots.iter_mut().zip(self.columns.split(' ')) {
            let known = |label: &str| fields.iter().position(|field| field.name == label);
            *slot = labels.split('|').find_map(known).and_then(|column| u8::try_from(column).ok());
        }
        slots
    }
}

/// A message for its handler.
pub(super) struct Given<'a> {
    pub(super) message: &'a Message<'a>,
    pub(super) slots: &'a Slots,
    /// The sensor in the message's name.
    pub(super) base: u8,
    /// When it was written.
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

    /// A finite number in single precision.
    pub(super) fn single(&self, slot: usize) -> Option<f32> {
        self.message.single(self.column(slot)?)
    }

    /// Numbers of consecutive slots, all or none.
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

    /// Whether the column holds whole steps, which older versions used for hundredths and thousandths.
    pub(super) fn is_integer(&self, slot: usize) -> bool {
        let column = self.column(slot);
        let kind = column.and_then(|column| self.message.format().fields.get(column)).map(|field| field.kind);
        kind.is_some_and(FieldKind::is_integer)
    }

    /// The sensor: from the column if there is one, otherwise from the message's name.
    pub(super) fn instance(&self, slot: usize) -> u8 {
        self.byte(slot).unwrap_or(self.base)
    }
}
