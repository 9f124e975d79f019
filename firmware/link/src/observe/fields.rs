//! Decoding of message fields, and the values that stand for "unknown".

use hums_core::clock::UTC_MICROS;
use hums_core::units::{Amperes, Fraction, Volts};
use hums_dialect::wire::PAYLOAD_BYTES_MAX;
use hums_dialect::{MavlinkVersion, MessageData};

/// `enumerations`: offsets; an unknown number is read as zero.
pub(super) fn read<M: MessageData>(payload: &[u8], enumerations: &[usize]) -> Option<M> {
    if let Ok(message) = M::deser(MavlinkVersion::V2, payload) {
        return Some(message);
    }
    let mut bytes = [0; PAYLOAD_BYTES_MAX];
    bytes.get_mut(..payload.len())?.copy_from_slice(payload);
    for &at in enumerations {
        *bytes.get_mut(at)? = 0;
    }
    M::deser(MavlinkVersion::V2, &bytes).ok()
}

/// `unknown` stands for none.
pub(super) fn unless<T: PartialEq + Copy>(value: T, unknown: T) -> Option<T> {
    (value != unknown).then_some(value)
}

/// UTC, if it can be: the field also holds the time since boot, and a receiver without a fix reports the date of its
/// firmware or of an earlier GPS week.
pub(super) fn unix_time(micros: u64) -> Option<u64> {
    UTC_MICROS.contains(&micros).then_some(micros)
}

/// Millivolts; 65535 is unknown, and nothing runs from 0 V.
pub(super) fn voltage(millivolts: u16) -> Option<Volts> {
    (millivolts != 0 && millivolts != u16::MAX).then(|| Volts(f32::from(millivolts) / 1e3))
}

/// Centiamperes; -1 is unknown, and PX4 scales its own -1 A for unknown to -100.
pub(super) fn current(centiamperes: i16) -> Option<Amperes> {
    (centiamperes != -1 && centiamperes != -100).then(|| Amperes(f32::from(centiamperes) / 100.0))
}

/// -1 is unknown.
pub(super) fn percent(percent: i8) -> Option<Fraction> {
    (0..=100).contains(&percent).then(|| Fraction(f32::from(percent) / 100.0))
}
