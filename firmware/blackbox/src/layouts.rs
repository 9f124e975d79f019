//! Message layouts by the hash that a group names, so that a log decodes with the layouts that it was written with.
//!
//! The dialect of this build is one table; the tables of older builds are kept here in their stored form, and a test
//! sees to it that the present one is among them before it can become an older one. Stored form, ids ascending:
//!
//! ```text
//! message: id u24, checksum seed u8, payload bytes without extensions u8, fields u8, then for each field in wire
//!          order: kind u8 (0 u8, 1 i8, 2 char, 3 u16, 4 i16, 5 u32, 6 i32, 7 f32, 8 u64, 9 i64, 10 f64),
//!          elements u8 (0: a scalar)
//! ```
//! The hash is the CRC-32C of the stored form.

use hums_dialect::{Kind, Message};

use crate::crc::Crc32c;

/// Layout tables of builds that wrote logs, newest last.
static STORED: [&[u8]; 1] = [include_bytes!("../layouts/table-1.bin")];

const MESSAGE_HEAD_BYTES: usize = 6;

/// The hash of this build's table.
pub(crate) fn current() -> u32 {
    let mut crc = Crc32c::new();
    store(|bytes| crc.add(bytes));
    crc.value()
}

/// Gives the stored form of this build's table, piece by piece.
pub fn store(mut out: impl FnMut(&[u8])) {
    for message in hums_dialect::messages() {
        let [low, middle, high, _] = message.id.to_le_bytes();
        out(&[low, middle, high, message.crc_extra, message.len_base, message.fields.len() as u8]);
        for field in message.fields {
            out(&[field.kind as u8, field.array]);
        }
    }
}

/// A layout table.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Layouts {
    /// That of this build.
    Current,
    /// One in stored form.
    Stored(&'static [u8]),
}

/// One message's layout.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Layout {
    Current(&'static Message),
    /// From its head on.
    Stored(&'static [u8]),
}

impl Layouts {
    /// The table with this hash, where this build knows it.
    pub(crate) fn by_hash(hash: u32) -> Option<Self> {
        if hash == current() {
            return Some(Self::Current);
        }
        STORED.iter().find(|table| hash_of(table) == hash).map(|table| Self::Stored(table))
    }

    pub(crate) fn find(self, id: u32) -> Option<Layout> {
        match self {
            Self::Current => hums_dialect::message(id).map(Layout::Current),
            Self::Stored(table) => find_stored(table, id).map(Layout::Stored),
        }
    }
}

fn hash_of(table: &[u8]) -> u32 {
    let mut crc = Crc32c::new();
    crc.add(table);
    crc.value()
}

fn find_stored(table: &'static [u8], id: u32) -> Option<&'static [u8]> {
    let mut rest = table;
    while let [low, middle, high, _, _, fields, ..] = rest {
        if u32::from_le_bytes([*low, *middle, *high, 0]) == id {
            return Some(rest);
        }
        rest = rest.get(MESSAGE_HEAD_BYTES + 2 * usize::from(*fields)..)?;
    }
    None
}

impl Layout {
    /// The seed of the frame's checksum.
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

    /// A field's kind and its number of elements, 0 for a scalar; `None` after the last one.
    pub(crate) fn field(self, index: usize) -> Option<(Kind, u8)> {
        match self {
            Self::Current(message) => message.fields.get(index).map(|field| (field.kind, field.array)),
            Self::Stored(bytes) => {
                if index >= usize::from(*bytes.get(5)?) {
                    return None;
                }
                let at = MESSAGE_HEAD_BYTES + 2 * index;
                Some((KINDS.get(usize::from(*bytes.get(at)?)).copied()?, *bytes.get(at + 1)?))
            }
        }
    }
}

/// The kinds by their stored number.
const KINDS: [Kind; 11] = [
    Kind::U8,
    Kind::I8,
    Kind::Char,
    Kind::U16,
    Kind::I16,
    Kind::U32,
    Kind::I32,
    Kind::F32,
    Kind::U64,
    Kind::I64,
    Kind::F64,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_this_build_is_kept_for_readers_to_come() {
        let mut stored = Vec::new();
        store(|bytes| stored.extend_from_slice(bytes));
        assert_eq!(hash_of(&stored), current());
        assert!(
            STORED.contains(&&stored[..]),
            "the dialect has changed: run `cargo run -p hums-blackbox --example layouts`, \
             add its file as a further table and keep the older ones"
        );
    }

    #[test]
    fn both_forms_of_the_table_say_the_same() {
        let table = STORED[STORED.len() - 1];
        for message in hums_dialect::messages() {
            let (a, b) = (
                Layouts::Current.find(message.id).expect("in this build"),
                Layouts::Stored(table).find(message.id).expect("stored"),
            );
            assert_eq!((a.crc_extra(), a.len_base()), (b.crc_extra(), b.len_base()));
            for index in 0..=message.fields.len() {
                assert_eq!(a.field(index), b.field(index), "message {} field {index}", message.id);
            }
        }
        assert!(Layouts::Stored(table).find(0x00ff_ffff).is_none());
    }
}
