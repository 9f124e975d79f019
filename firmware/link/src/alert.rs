//! Alerts in the autopilots' texts and in PX4's events: texts in `texts.rs`, events in `events.rs`. A new one is one row there. A
//! severe report that is in no table is [`Cause::Other`].

mod events;
mod texts;

pub use events::name as event_name;

use hums_core::cause::{Alert, Cause};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meaning {
    /// Something is wrong.
    Wrong(Alert),
    /// No fault in flight: arming, set-up, a command, or the end of a fault.
    Fine,
    Unknown,
}

/// The alert in a text of the autopilot.
///
/// `severity` is a `MAV_SEVERITY`; a notice, or less, does not count. It is `None` for a log that stores no severity. Then only
/// known texts count that are severe by their words.
///
/// `MAV_SEVERITY_ALERT` is treated as unknown. `ArduPilot` until 3.2 (2015) counted from 1 for low to 4 for critical,
/// and sent "Reached Command #1" with it. Later versions use it for a parachute, a fuel cell's states and developers'
/// messages, PX4 never.
///
/// Repeated texts do not count: our own, if a script forwards them to the pilot's radio
/// (`docs/stations/hums_texts.lua`), and marked texts of others in `ArduPilot`'s log
/// (`GCS_MAVLINK::handle_statustext`).
pub fn of_text(severity: Option<u8>, text: &[u8]) -> Option<Alert> {
    const REPEATED: [&[u8]; 3] = [b"HUMS: ", b"SRC=", b"GCS:"];
    if REPEATED.iter().any(|mark| text.starts_with(mark)) {
        return None;
    }
    // MAV_SEVERITY: 1 is alert, 4 warning, 5 notice.
    let severity = match severity {
        Some(1) => None,
        Some(5..) => return None,
        severity => severity,
    };
    match texts::meaning(text, severity.is_some()) {
        Meaning::Wrong(alert) => Some(alert),
        Meaning::Fine => None,
        Meaning::Unknown => severity.filter(|severity| *severity < 4).map(|_| Alert::warning(Cause::Other)),
    }
}

/// The alert in an event of PX4. `severity` is the low nibble of `log_levels`, its external level.
pub fn of_event(id: u32, severity: u8, arguments: &[u8]) -> Option<Alert> {
    const CRITICAL: u8 = 2;
    match events::meaning(id, arguments) {
        Meaning::Wrong(alert) => Some(alert),
        Meaning::Fine => None,
        Meaning::Unknown => (severity <= CRITICAL).then_some(Alert::warning(Cause::Other)),
    }
}

#[cfg(test)]
mod tests;
