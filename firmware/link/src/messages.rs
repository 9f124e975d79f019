//! Our messages, fields in wire order (`common.xml`).

use hums_core::clock::Instant;
use hums_dialect::ids;

use crate::encode::COMPONENT;
use crate::packet::Packet;
use crate::statustext::{Severity, TEXT_BYTES_MAX};

/// `MAV_TYPE_ONBOARD_CONTROLLER`
const TYPE: u8 = 18;
/// `MAV_AUTOPILOT_INVALID`: marks a component that is not an autopilot.
const AUTOPILOT: u8 = 8;
/// `MAV_PARAM_TYPE_REAL32`
const REAL32: u8 = 9;
/// Bits of `MAV_PROTOCOL_CAPABILITY`: `COMMAND_INT`, `FTP`, `MAVLINK2`, `PARAM_ENCODE_C_CAST`.
const CAPABILITIES: u64 = 8 | 32 | 8_192 | 131_072;

/// HEARTBEAT; `state` is a `MAV_STATE`: 3 standby, 4 active, 5 critical, 6 emergency.
pub fn heartbeat(state: u8) -> Packet {
    Packet::new(ids::HEARTBEAT).u8(4, TYPE).u8(5, AUTOPILOT).u8(7, state).u8(8, 3)
}

/// STATUSTEXT: a text for the pilot; longer than [`TEXT_BYTES_MAX`] bytes is cut.
pub fn status_text(severity: Severity, text: &str) -> Packet {
    Packet::new(ids::STATUSTEXT).u8(0, severity as u8).text(1, TEXT_BYTES_MAX, text)
}

/// `NAMED_VALUE_FLOAT`: a value that ground stations plot by its name (at most 10 bytes).
pub fn named_float(now: Instant, name: &str, value: f32) -> Packet {
    Packet::new(ids::NAMED_VALUE_FLOAT).u32(0, now.as_millis() as u32).f32(4, value).text(8, 10, name)
}

/// `NAMED_VALUE_INT`
pub fn named_int(now: Instant, name: &str, value: i32) -> Packet {
    Packet::new(ids::NAMED_VALUE_INT).u32(0, now.as_millis() as u32).u32(4, value as u32).text(8, 10, name)
}

pub(crate) fn param_request_read(name: &str, system: u8, component: u8) -> Packet {
    Packet::new(ids::PARAM_REQUEST_READ).u16(0, u16::MAX).u8(2, system).u8(3, component).text(4, 16, name)
}

pub(crate) fn request_event(first: u16, last: u16, system: u8, component: u8) -> Packet {
    Packet::new(ids::REQUEST_EVENT).u16(0, first).u16(2, last).u8(4, system).u8(5, component)
}

/// `PARAM_VALUE`
pub fn param_value(name: &str, value: f32, index: u16, count: u16) -> Packet {
    Packet::new(ids::PARAM_VALUE).f32(0, value).u16(4, count).u16(6, index).text(8, 16, name).u8(24, REAL32)
}

/// `COMMAND_ACK` to the asker; `result` is a `MAV_RESULT`.
pub fn command_ack(command: u16, result: u8, system: u8, component: u8) -> Packet {
    Packet::new(ids::COMMAND_ACK).u16(0, command).u8(2, result).u8(8, system).u8(9, component)
}

/// `COMMAND_LONG` with the first parameters given and the others zero.
pub fn command_long(command: u16, params: &[f32], system: u8, component: u8) -> Packet {
    let packet = Packet::new(ids::COMMAND_LONG).u16(28, command).u8(30, system).u8(31, component);
    params.iter().take(7).enumerate().fold(packet, |packet, (index, value)| packet.f32(4 * index, *value))
}

/// `REQUEST_DATA_STREAM`: all messages of a group at `rate_hz`.
pub(crate) fn request_data_stream(stream: u8, rate_hz: u16, system: u8, component: u8) -> Packet {
    Packet::new(ids::REQUEST_DATA_STREAM)
        .u16(0, rate_hz)
        .u8(2, system)
        .u8(3, component)
        .u8(4, stream)
        .u8(5, 1)
}

/// Our `AUTOPILOT_VERSION`: capabilities, version (major, minor, patch), the chip's own number.
pub fn autopilot_version(version: [u8; 3], git: &str, uid: &[u8; 12]) -> Packet {
    let [major, minor, patch] = version;
    // The lowest byte is FIRMWARE_VERSION_TYPE: 255 is official, 0 development.
    let number = u32::from_be_bytes([major, minor, patch, 0]);
    let short = uid.iter().fold(0_u64, |sum, byte| sum.rotate_left(8) ^ u64::from(*byte));
    Packet::new(ids::AUTOPILOT_VERSION)
        .u64(0, CAPABILITIES)
        .u64(8, short)
        .u32(16, number)
        .text(36, 8, git)
        .bytes(60, uid)
}

/// The state of a computer; `None` is sent as unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ComputerStatus {
    /// Busy, percent.
    pub cpu_percent: u8,
    /// Used and total room on the card, MiB.
    pub storage_mib: Option<(u32, u32)>,
    /// The autopilot's port and the ground station's.
    pub links: [LinkStatus; 2],
}

/// Traffic of a port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkStatus {
    /// Line rate, baud.
    pub baud: u32,
    /// Bytes per second.
    pub tx: Option<u32>,
    /// Bytes per second.
    pub rx: Option<u32>,
}

/// `ONBOARD_COMPUTER_STATUS`. Memory is left out, because its unit is MiB; temperatures and fans, because there are
/// none.
#[inline(never)]
pub fn computer_status(now: Instant, status: &ComputerStatus) -> Packet {
    /// Storage of this kind: a card that can be taken out.
    const CARD: u32 = 4;
    // The largest number means unknown, or unused.
    let mut payload = [0xFF_u8; 238];
    let mut put = |at: usize, bytes: &[u8]| payload[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &now.as_micros().to_le_bytes());
    put(8, &(now.as_millis() as u32).to_le_bytes());
    if let Some((used, total)) = status.storage_mib {
        for (at, value) in [(20, CARD), (36, used), (52, total)] {
            put(at, &value.to_le_bytes());
        }
    }
    // Both are UARTs: type 0, and 1 for the second one.
    put(68, &[0; 24]);
    for (link, LinkStatus { baud, tx, rx }) in (0_u8..).zip(&status.links) {
        let place = 4 * usize::from(link);
        put(68 + place, &[link]);
        let kib = |bytes: u32| bytes.div_ceil(1_024);
        let most = kib(baud / 10);
        let values =
            [(92, tx.map_or(u32::MAX, kib)), (116, rx.map_or(u32::MAX, kib)), (140, most), (164, most)];
        for (at, value) in values {
            put(at + place, &value.to_le_bytes());
        }
    }
    for fan in 0..4 {
        put(188 + 2 * fan, &i16::MAX.to_le_bytes());
    }
    put(196, &[0, status.cpu_percent]);
    put(229, &[i8::MAX as u8; 9]);
    Packet::new(ids::ONBOARD_COMPUTER_STATUS).bytes(0, &payload)
}

/// `COMPONENT_METADATA`: the address of the component information's general file, and its checksum.
pub fn component_metadata(now: Instant, crc: u32, uri: &str) -> Packet {
    // The text ends with a zero: it is shorter than its 100 bytes.
    Packet::new(ids::COMPONENT_METADATA).u32(0, now.as_millis() as u32).u32(4, crc).text(8, 99, uri)
}

/// `PROTOCOL_VERSION`: MAVLink 2.0 only.
pub fn protocol_version() -> Packet {
    Packet::new(ids::PROTOCOL_VERSION).u16(0, 200).u16(2, 200).u16(4, 200)
}

/// `LOG_ENTRY`
pub fn log_entry(id: u16, count: u16, last: u16, bytes: u32, utc_s: u32) -> Packet {
    Packet::new(ids::LOG_ENTRY).u32(0, utc_s).u32(4, bytes).u16(8, id).u16(10, count).u16(12, last)
}

/// `LOG_DATA`: at most 90 bytes.
pub fn log_data(id: u16, offset: u32, data: &[u8]) -> Packet {
    let data = data.get(..90).unwrap_or(data);
    // The count is set last, so that a block that ends in zeros is sent whole.
    Packet::new(ids::LOG_DATA).u32(0, offset).u16(4, id).bytes(7, data).u8(6, data.len() as u8)
}

/// `FILE_TRANSFER_PROTOCOL` to the asker.
pub fn file_transfer(system: u8, component: u8, payload: &[u8]) -> Packet {
    let payload = payload.get(..251).unwrap_or(payload);
    Packet::new(ids::FILE_TRANSFER_PROTOCOL).u8(1, system).u8(2, component).bytes(3, payload)
}

/// Our component, our system, or all.
pub const fn concerns_us(target: (u8, u8), system: u8) -> bool {
    (target.0 == system || target.0 == 0) && (target.1 == COMPONENT || target.1 == 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode::{Encoder, FRAME_BYTES_MAX};
    use crate::frame::{Check, Frame};

    #[test]
    fn every_message_of_ours_is_as_long_as_its_definition_allows() {
        let name = "SIXTEEN_LETTERS_";
        let packets = [
            heartbeat(4),
            status_text(Severity::Warning, &"x".repeat(80)),
            named_float(Instant::from_millis(1), "HUMS_LEVEL", 1.0),
            named_int(Instant::from_millis(1), "HUMS_STATE", -1),
            param_value(name, 1.0, 1, 2),
            param_request_read(name, 1, 1),
            request_event(1, 2, 1, 1),
            command_ack(512, 3, 255, 190),
            command_long(511, &[1.0; 9], 1, 1),
            request_data_stream(1, 4, 1, 1),
            autopilot_version([0, 1, 2], "0123456789", &[7; 12]),
            computer_status(Instant::from_millis(1), &ComputerStatus::default()),
            protocol_version(),
            component_metadata(Instant::from_millis(1), 1, &"x".repeat(120)),
            log_entry(1, 1, 1, 1, 1),
            log_data(1, 0, &[1; 100]),
            file_transfer(255, 190, &[1; 300]),
        ];
        let mut buffer = [0; FRAME_BYTES_MAX];
        for packet in packets {
            let message = hums_dialect::message(packet.id()).expect("a message of the dialect");
            assert!(packet.payload().len() <= usize::from(message.len_max), "{}", packet.id());
            let mut encoder = Encoder::new();
            let frame = Frame::parse(encoder.frame(&mut buffer, &packet)).expect("a frame");
            assert_eq!(frame.check(), Check::Verified, "{}", packet.id());
        }
    }
}
