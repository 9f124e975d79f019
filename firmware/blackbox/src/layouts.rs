//! Message layouts by the hash that a group names, so that a log decodes with the layouts that it was written with.
//!
//! The dialect of this build is one table. The tables of older builds are here in their stored form. A test requires
//! the current table among them, before it becomes an older one. Stored form, ids ascending:
//!
//! ```text
//! message: id u24, checksum seed u8, payload bytes without extensions u8, fields u8, then for each field in wire
//!          order: u8 with the kind in bits 0..=3 (0 u8, 1 i8, 2 char, 3 u16, 4 i16, 5 u32, 6 i32, 7 f32, 8 u64,
//!          9 i64, 10 f64) and the role in bits 4..=5 (0 plain, 1 instance, 2 milliseconds, 3 microseconds),
//!          elements u8 (0: a scalar)
//! ```
//! The hash is the CRC-32C of the stored form.

use core::num::NonZeroU16;

use hums_dialect::{Kind, Message, Role};
use zerocopy::FromZeros;

use crate::crc::Crc32c;

/// Layout tables of builds that wrote logs, newest last.
static STORED: [&[u8]; 1] = [NEWEST];

const NEWEST: &[u8] = include_bytes!("../layouts/table-1.bin");

const MESSAGE_HEAD_BYTES: usize = 6;

/// The hash of this build's table: a constant, so that no flip of memory makes all groups of a session wrong.
pub(crate) const CURRENT: u32 = Crc32c::of_constant(NEWEST);

/// Stores the table.
pub fn store(mut out: impl FnMut(&[u8])) {
    for message in hums_dialect::messages() {
        let [low, middle, high, _] = message.id.to_le_bytes();
        out(&[low, middle, high, message.crc_extra, message.len_base, message.fields.len() as u8]);
        for field in message.fields {
            out(&[field.kind as u8 | (field.role as u8) << 4, field.array]);
        }
    }
}

/// A layout table: this build's, or one of [`STORED`], counted from 1.
#[derive(Clone, Copy, Debug, FromZeros)]
pub(crate) struct Layouts(u8);

/// Small enough for each slot.
pub(crate) type LayoutIndex = NonZeroU16;

/// One message's layout.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Layout {
    Current(&'static Message),
    /// From its head on.
    Stored(&'static [u8]),
}

impl Layouts {
    pub(crate) const CURRENT: Self = Self(0);

    pub(crate) fn by_hash(hash: u32) -> Option<Self> {
        let stored = || STORED.iter().position(|table| hash_of(table) == hash);
        if hash == CURRENT { Some(Self::CURRENT) } else { stored().map(|place| Self(place as u8 + 1)) }
    }

    fn stored(self) -> Option<&'static [u8]> {
        STORED.get(usize::from(self.0).wrapping_sub(1)).copied()
    }

    pub(crate) fn find(self, id: u32) -> Option<LayoutIndex> {
        let place = match self.stored() {
            None => hums_dialect::messages().binary_search_by_key(&id, |message| message.id).ok()?,
            Some(table) => find_stored(table, id)?,
        };
        NonZeroU16::new(u16::try_from(place + 1).ok()?)
    }

    pub(crate) fn at(self, place: LayoutIndex) -> Option<Layout> {
        let place = usize::from(place.get() - 1);
        match self.stored() {
            None => hums_dialect::messages().get(place).map(Layout::Current),
            Some(table) => table.get(place..).map(Layout::Stored),
        }
    }
}

fn hash_of(table: &[u8]) -> u32 {
    let mut crc = Crc32c::new();
    crc.add(table);
    crc.value()
}

fn find_stored(table: &'static [u8], id: u32) -> Option<usize> {
    let mut at = 0;
    while let [low, middle, high, _, _, fields, ..] = table.get(at..)? {
        if u32::from_le_bytes([*low, *middle, *high, 0]) == id {
            return Some(at);
        }
        at += MESSAGE_HEAD_BYTES + 2 * usize::from(*fields);
    }
    None
}

impl Layout {
    pub(crate) fn crc_extra(self) -> u8 {
        match self {
            Self::Current(message) => message.crc_extra,
            Self::Stored(bytes) => bytes.get(3).copied().unwrap_or(0),
        }
    }

    /// The payload length of a MAVLink 1 frame.
    pub(crate) fn len_base(self) -> usize {
        usize::from(match self {
            Self::Current(message) => message.len_base,
            Self::Stored(bytes) => bytes.get(4).copied().unwrap_or(0),
        })
    }

    pub(crate) fn field(self, index: usize) -> Option<FieldLayout> {
        match self {
            Self::Current(message) => message.fields.get(index).map(|field| FieldLayout {
                kind: field.kind,
                role: field.role,
                count: field.array.max(1),
            }),
            Self::Stored(bytes) => {
                if index >= usize::from(*bytes.get(5)?) {
                    return None;
                }
                let at = MESSAGE_HEAD_BYTES + 2 * index;
                let (number, count) = (*bytes.get(at)?, *bytes.get(at + 1)?);
                Some(FieldLayout {
                    kind: *Kind::ALL.get(usize::from(number & 0x0f))?,
                    role: Role::ALL[usize::from(number >> 4 & 3)],
                    count: count.max(1),
                })
            }
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FieldLayout {
    pub(crate) kind: Kind,
    pub(crate) role: Role,
    /// Elements: 1 for a scalar.
    pub(crate) count: u8,
}

impl FieldLayout {
    /// Bytes on the wire.
    pub(crate) const fn size(self) -> usize {
        self.kind.size() * self.count as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_this_build_is_kept_for_readers_to_come() {
        let mut stored = Vec::new();
        store(|bytes| stored.extend_from_slice(bytes));
        assert_eq!(hash_of(&stored), CURRENT);
        assert!(
            STORED.contains(&&stored[..]),
            "the dialect has changed: run `cargo run -p hums-blackbox --example layouts`, \
             add its file as a further table and keep the older ones"
        );
    }

    #[test]
    fn both_forms_of_the_table_say_the_same() {
        let newest = Layouts(STORED.len() as u8);
        let layout = |table: Layouts, id| table.find(id).and_then(|place| table.at(place));
        for message in hums_dialect::messages() {
            let a = layout(Layouts::CURRENT, message.id).expect("in this build");
            let b = layout(newest, message.id).expect("stored");
            assert_eq!((a.crc_extra(), a.len_base()), (b.crc_extra(), b.len_base()));
            for index in 0..=message.fields.len() {
                assert_eq!(a.field(index), b.field(index), "message {} field {index}", message.id);
            }
        }
        assert!(newest.find(0x00ff_ffff).is_none());
    }
}
