//! Layouts of MAVLink messages on the wire: one table, generated at build time from the message definitions (XML) of
//! the `mavlink` crate.
//!
//! Three readers share it. The framer needs length and checksum seed; the black box the kind of each field, to
//! predict it; the host tools names and units (feature `names`).
//!
//! Messages that are read field by field are structures from the `mavlink` crate's generator ([`ardupilotmega`]).
#![cfg_attr(not(test), no_std)]

pub mod crc;
pub mod wire;

// The generated code uses this name for the core that `mavlink` re-exports.
extern crate mavlink as mavlink_core;

pub use mavlink::{MavlinkVersion, MessageData};
pub use structures::ardupilotmega;

#[allow(warnings, clippy::all, clippy::pedantic, rustdoc::all, reason = "it is generated")]
mod structures {
    include!(concat!(env!("OUT_DIR"), "/structures.rs"));
}

/// The type of one field, or of each element of an array field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Kind {
    /// `uint8_t`
    U8,
    /// `int8_t`
    I8,
    /// `char`: an array of it is text, padded with zeros
    Char,
    /// `uint16_t`, little endian as all that follow
    U16,
    /// `int16_t`
    I16,
    /// `uint32_t`
    U32,
    /// `int32_t`
    I32,
    /// `float`, IEEE 754 binary32
    F32,
    /// `uint64_t`
    U64,
    /// `int64_t`
    I64,
    /// `double`, IEEE 754 binary64
    F64,
}

impl Kind {
    /// The size of one element in bytes: 1, 2, 4 or 8.
    pub const fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 | Self::Char => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }
}

/// The purpose of a field for the recorder's prediction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Role {
    /// Anything else.
    Plain,
    /// Tells several sources of one message apart, for instance a battery's id.
    Instance,
    /// A time that advances with the clock, in milliseconds.
    Millis,
    /// A time that advances with the clock, in microseconds.
    Micros,
}

/// One field of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// The type of the field or of its elements.
    pub kind: Kind,
    /// The number of elements of an array; 0 for a scalar.
    pub array: u8,
    /// Its purpose.
    pub role: Role,
    /// As in the definition, for instance `time_boot_ms`.
    #[cfg(feature = "names")]
    pub name: &'static str,
    /// As in the definition, for instance `degE7`; empty if it has none.
    #[cfg(feature = "names")]
    pub units: &'static str,
    /// The enum of the field's values, for instance `MAV_TYPE`; empty if it has none.
    #[cfg(feature = "names")]
    pub enumeration: &'static str,
}

impl Field {
    /// The number of elements: 1 for a scalar.
    pub const fn count(&self) -> usize {
        if self.array == 0 { 1 } else { self.array as usize }
    }

    /// Bytes on the wire.
    pub const fn size(&self) -> usize {
        self.kind.size() * self.count()
    }
}

/// One message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message {
    /// The message id, 24 bits.
    pub id: u32,
    /// The seed of the frame's checksum: a frame made with another definition of this id does not check.
    pub crc_extra: u8,
    /// Payload bytes without the extension fields: the payload length of a MAVLink 1 frame.
    pub len_base: u8,
    /// Payload bytes with the extension fields: the longest payload of a MAVLink 2 frame (0 to 255).
    pub len_max: u8,
    /// Offset of the target system in the payload; [`Message::NO_TARGET`] if there is none.
    pub target_system: u8,
    /// The same for the component.
    pub target_component: u8,
    /// As in the definition, for instance `HEARTBEAT`.
    #[cfg(feature = "names")]
    pub name: &'static str,
    /// The fields in wire order, extensions last.
    pub fields: &'static [Field],
}

impl Message {
    /// No field of the message is a target.
    pub const NO_TARGET: u8 = u8::MAX;
}

/// The definition of a message id; `None` if the dialect has none.
pub fn message(id: u32) -> Option<&'static Message> {
    MESSAGES.get(usize::from(index(id)?))
}

/// The place of a message id in [`messages`].
pub fn index(id: u32) -> Option<u16> {
    MESSAGES.binary_search_by_key(&id, |message| message.id).ok().map(|index| index as u16)
}

/// All messages, by ascending id.
pub fn messages() -> &'static [Message] {
    MESSAGES
}

include!(concat!(env!("OUT_DIR"), "/table.rs"));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksum_seeds_are_those_of_the_published_table() {
        // From the C library's MAVLINK_MESSAGE_CRCS (common, ardupilotmega).
        for (id, extra) in
            [(0, 50), (1, 124), (24, 24), (30, 39), (74, 20), (147, 154), (253, 83), (11030, 144)]
        {
            assert_eq!(message(id).map(|message| message.crc_extra), Some(extra), "message id {id}");
        }
    }

    #[test]
    fn lengths_count_extensions_apart() {
        let heartbeat = message(ids::HEARTBEAT).expect("HEARTBEAT");
        assert_eq!((heartbeat.len_base, heartbeat.len_max), (9, 9));
        let gps = message(ids::GPS_RAW_INT).expect("GPS_RAW_INT");
        assert_eq!((gps.len_base, gps.len_max), (30, 52));
    }

    #[test]
    fn roles_come_from_the_definitions() {
        let role = |id: u32, index: usize| message(id).map(|message| message.fields[index].role);
        assert_eq!(role(30, 0), Some(Role::Millis));
        assert_eq!(role(24, 0), Some(Role::Micros));
        assert_eq!(role(251, 2), Some(Role::Instance));
        assert_eq!(role(30, 1), Some(Role::Plain));
    }

    #[test]
    fn every_layout_adds_up() {
        for message in messages() {
            let total: usize = message.fields.iter().map(Field::size).sum();
            assert!(total > 0 && total == message.len_max as usize, "message id {}", message.id);
        }
    }

    #[test]
    fn ids_are_sorted_and_unknown_ones_are_none() {
        assert!(messages().is_sorted_by(|a, b| a.id < b.id));
        assert_eq!(message(0x00ff_ffff), None);
    }
}
