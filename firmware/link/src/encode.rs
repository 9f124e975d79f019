//! Our own frames: system id of the vehicle we ride on, component 191 (`MAV_COMP_ID_ONBOARD_COMPUTER`), MAVLink 2.

use core::fmt::{self, Write as _};

use hums_core::time::Instant;
use mavlink::dialects::ardupilotmega::{
    HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavSeverity, MavState, MavType, NAMED_VALUE_FLOAT_DATA,
    STATUSTEXT_DATA,
};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MessageData};

/// `MAV_COMP_ID_ONBOARD_COMPUTER`
pub const COMPONENT: u8 = 191;
/// The longest frame: 10 bytes of header, 255 of payload, 2 of checksum, 13 of signature.
pub const GS_FRAME_BYTES_MAX: usize = 280;
/// The system id until the vehicle's is known: what most autopilots have by default.
const SYSTEM_DEFAULT: u8 = 1;
/// Bytes of text in one STATUSTEXT.
pub const TEXT_BYTES_MAX: usize = 50;
/// Bytes of the name in a `NAMED_VALUE_FLOAT`.
const NAME_BYTES: usize = 10;

/// Makes our frames and counts them.
#[derive(Clone, Copy, Debug)]
pub struct Encoder {
    system: u8,
    sequence: u8,
}

impl Default for Encoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Encoder {
    /// Before the vehicle's system id is known.
    pub const fn new() -> Self {
        Self { system: SYSTEM_DEFAULT, sequence: 0 }
    }

    /// Takes on the vehicle's system id.
    pub const fn set_system(&mut self, system: u8) {
        self.system = system;
    }

    /// The sequence number of the next frame.
    pub const fn set_sequence(&mut self, sequence: u8) {
        self.sequence = sequence;
    }

    /// Our heartbeat; `state` is a `MAV_STATE`: 3 standby, 4 active, 5 critical, 6 emergency.
    pub fn heartbeat<'a>(&mut self, out: &'a mut [u8; GS_FRAME_BYTES_MAX], state: u8) -> &'a [u8] {
        let system_status = match state {
            3 => MavState::MAV_STATE_STANDBY,
            5 => MavState::MAV_STATE_CRITICAL,
            6 => MavState::MAV_STATE_EMERGENCY,
            _ => MavState::MAV_STATE_ACTIVE,
        };
        let data = HEARTBEAT_DATA {
            custom_mode: 0,
            mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
            autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
            base_mode: MavModeFlag::empty(),
            system_status,
            mavlink_version: 3,
        };
        self.encode(out, &data)
    }

    /// A text for the pilot; longer than [`TEXT_BYTES_MAX`] bytes is cut.
    pub fn status_text<'a>(
        &mut self,
        out: &'a mut [u8; GS_FRAME_BYTES_MAX],
        severity: Severity,
        text: &str,
    ) -> &'a [u8] {
        let mut data = STATUSTEXT_DATA { severity: severity.into(), ..STATUSTEXT_DATA::DEFAULT };
        let len = text.len().min(TEXT_BYTES_MAX);
        let mut bytes = [0; TEXT_BYTES_MAX];
        bytes[..len].copy_from_slice(&text.as_bytes()[..len]);
        data.text = bytes.into();
        self.encode(out, &data)
    }

    /// A value that ground stations plot by its name (at most 10 bytes).
    pub fn named_value<'a>(
        &mut self,
        out: &'a mut [u8; GS_FRAME_BYTES_MAX],
        now: Instant,
        name: &str,
        value: f32,
    ) -> &'a [u8] {
        let len = name.len().min(NAME_BYTES);
        let mut bytes = [0; NAME_BYTES];
        bytes[..len].copy_from_slice(&name.as_bytes()[..len]);
        let data = NAMED_VALUE_FLOAT_DATA { time_boot_ms: now.as_millis() as u32, value, name: bytes.into() };
        self.encode(out, &data)
    }

    fn encode<'a>(&mut self, out: &'a mut [u8; GS_FRAME_BYTES_MAX], data: &impl MessageData) -> &'a [u8] {
        let header =
            MavHeader { system_id: u32::from(self.system), component_id: COMPONENT, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let mut raw = MAVLinkV2MessageRaw::new();
        raw.serialize_message_data(header, data);
        let bytes = raw.raw_bytes();
        let len = bytes.len().min(out.len());
        out[..len].copy_from_slice(&bytes[..len]);
        &out[..len]
    }
}

/// How urgent a text is (`MAV_SEVERITY`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Act now.
    Critical,
    /// Act soon.
    Warning,
    /// Worth knowing.
    Notice,
    /// All is well again.
    Info,
}

impl From<Severity> for MavSeverity {
    fn from(severity: Severity) -> Self {
        match severity {
            Severity::Critical => Self::MAV_SEVERITY_CRITICAL,
            Severity::Warning => Self::MAV_SEVERITY_WARNING,
            Severity::Notice => Self::MAV_SEVERITY_NOTICE,
            Severity::Info => Self::MAV_SEVERITY_INFO,
        }
    }
}

/// A text that is put together; what does not fit is cut.
#[derive(Clone, Debug, Default)]
pub struct Text(heapless::String<TEXT_BYTES_MAX>);

impl Text {
    /// Formats a text.
    pub fn new(arguments: fmt::Arguments<'_>) -> Self {
        let mut text = Self::default();
        // Cut where it is full: that is what a text of 50 bytes is.
        let _ = text.write_fmt(arguments);
        text
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            self.0.push(character).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Check, Frame};

    #[test]
    fn our_frames_check_and_count() {
        let mut encoder = Encoder::new();
        encoder.set_system(7);
        let mut buffer = [0; GS_FRAME_BYTES_MAX];
        for sequence in 0..3 {
            let frame = Frame::parse(encoder.heartbeat(&mut buffer, 4)).expect("a frame");
            assert_eq!(frame.check(), Check::Verified);
            assert_eq!((frame.id(), frame.system(), frame.component()), (0, 7, COMPONENT));
            assert_eq!(frame.sequence(), sequence);
        }
        let long = "x".repeat(80);
        let frame =
            Frame::parse(encoder.status_text(&mut buffer, Severity::Warning, &long)).expect("a frame");
        assert_eq!((frame.check(), frame.id()), (Check::Verified, 253));
        assert_eq!(frame.payload(), [&[4][..], &[b'x'; TEXT_BYTES_MAX]].concat());
        let frame =
            Frame::parse(encoder.named_value(&mut buffer, Instant::ZERO, "HUMS", 1.0)).expect("a frame");
        assert_eq!((frame.check(), frame.id()), (Check::Verified, 251));
    }

    #[test]
    fn a_text_is_cut_at_fifty_bytes_between_characters() {
        let text = Text::new(format_args!("{}é", "a".repeat(49)));
        assert_eq!(text.as_str(), "a".repeat(49));
    }
}
