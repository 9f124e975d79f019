//! Parameters, texts, modes, events, errors, arming.

use hums_core::cause::Alert;
use hums_link::alert;

use super::handler::{Given, Handler, handler};
use super::out::{Out, SOURCE};
use super::state::{State, version_of};
use super::words::{self, CRASH_CHECK, Craft};
use crate::plural::count;
use crate::source::item::{Cause, Event, FactKind, Gap, Item, Mode, Parameter};

/// `MAV_SEVERITY_INFO`: MSG has no severity.
const INFO: u8 = 6;
/// A text's part that another one follows.
const TEXT_BYTES: usize = 64;
/// `MAV_SEVERITY_NOTICE`
const NOTICE: u8 = 5;
/// `MAV_SEVERITY_ERROR`
const ERROR: u8 = 3;

pub(super) const HANDLERS: &[Handler] = &[
    handler("PARM", "Name Value", parameter).said().fact(),
    handler("MSG", "Message|Msg ID|Id Seq", message).said().fact(),
    handler("VER", "FWS Maj Min Pat FWT BU", version).said().fact(),
    handler("MODE", "ModeNum Mode", mode).said(),
    handler("ARM", "ArmState", arm).said().fact(),
    handler("EV", "Id", event).said().fact(),
    handler("ERR", "Subsys ECode", error).said(),
    handler("WDOG", "FT|FaultType", watchdog).said(),
    handler("DSF", "Dp", dropped).said(),
];

fn parameter(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let (Some(name), Some(value)) = (given.text(0), given.number(1)) else { return };
    let facts = &mut state.facts;
    let number = value.clamp(0.0, 255.0) as u8;
    match name.as_str() {
        "FRAME_CLASS" => facts.frame_class = Some(number),
        // Only if the firmware has no name in the log.
        "SYSID_SW_TYPE" if facts.craft == Craft::Unknown => {
            facts.craft = Craft::of_software(number).unwrap_or_default();
        }
        "Q_ENABLE" => facts.quadplane = number > 0,
        "Q_MAV_TYPE" => facts.quadplane_type = number,
        "LOG_DISARMED" => facts.logs_disarmed = Some(value != 0.0),
        "RSSI_TYPE" => facts.has_rssi = number > 0,
        "AHRS_EKF_TYPE" => facts.estimator = Some(number),
        // Before 2016: 0 for the older estimator (DCM), with the filter beside it.
        "AHRS_EKF_USE" => facts.estimator = if number == 0 { Some(0) } else { facts.estimator },
        // Only helicopters have these; their firmware's name is a copter's.
        "H_RSC_MODE" | "H_SV_MAN" if matches!(facts.craft, Craft::Unknown | Craft::Copter) => {
            facts.craft = Craft::Heli;
        }
        _ => {
            if let Some(battery) = capacity_of(&name)
                && let Some(capacity) = facts.capacity_mah.get_mut(battery)
            {
                *capacity = Some(value as f32).filter(|capacity| *capacity > 0.0);
            }
        }
    }
    out.item(Item::Parameter(Parameter { name: &name, value }));
}

fn capacity_of(name: &str) -> Option<usize> {
    let number = name.strip_prefix("BATT")?.strip_suffix("_CAPACITY")?;
    if number.is_empty() { Some(0) } else { number.parse::<usize>().ok()?.checked_sub(1) }
}

/// Since 4.7 a long text is several messages with one ID (`LogStructure.h`).
fn message(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let Some(part) = given.text(0).filter(|words| !words.is_empty()) else { return };
    let (Some(id), Some(sequence)) = (given.unsigned(1), given.unsigned(2)) else {
        return text(state, &part, out);
    };
    let is_last = part.len() < TEXT_BYTES;
    match &mut state.open_text {
        Some((open, words)) if *open == id && sequence > 0 => words.push_str(&part),
        open => {
            if let Some((_, words)) = open.replace((id, part)) {
                text(state, &words, out);
            }
        }
    }
    if is_last {
        end_text(state, out);
    }
}

fn end_text(state: &mut State, out: &mut Out<'_>) {
    if let Some((_, words)) = state.open_text.take() {
        text(state, &words, out);
    }
}

fn text(state: &mut State, words: &str, out: &mut Out<'_>) {
    if let Some(craft) = Craft::of_firmware(words) {
        firmware(state, craft, words, out);
        if let Some(version) = version_of(words).filter(|_| !state.identified) {
            identify(state, version);
        }
    } else if let Some(frame) = words.strip_prefix("Frame: ") {
        out.fact(FactKind::Frame, frame);
    } else {
        match words {
            "Arming motors" | "ARMING MOTORS" | "Throttle armed" => state.arm(true),
            "Disarming motors" | "DISARMING MOTORS" | "Throttle disarmed" => state.arm(false),
            _ => {}
        }
    }
    // A log keeps no severity.
    out.text(INFO, words, alert::of_text(None, words.as_bytes()));
}

fn firmware(state: &mut State, craft: Craft, words: &str, out: &mut Out<'_>) {
    // VER marks helicopters, the name does not.
    if !(state.facts.craft == Craft::Heli && craft == Craft::Copter) {
        state.facts.craft = craft;
    }
    out.fact(FactKind::Firmware, words);
}

fn identify(state: &mut State, firmware: u32) {
    (state.facts.version, state.identified) = (firmware, true);
}

fn version(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    if let Some(craft) = given.byte(5).and_then(Craft::of_build) {
        state.facts.craft = craft;
    }
    if let Some(words) = given.text(0).filter(|words| !words.is_empty()) {
        if let Some(craft) = Craft::of_firmware(&words) {
            firmware(state, craft, &words, out);
        } else {
            out.fact(FactKind::Firmware, &words);
        }
    }
    if let (Some(major), Some(minor), Some(patch)) = (given.byte(1), given.byte(2), given.byte(3)) {
        let kind = given.byte(4).unwrap_or(0);
        identify(state, u32::from_be_bytes([major, minor, patch, kind]));
    }
}

fn mode(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let numbered = [0, 1].into_iter().find_map(|slot| given.unsigned(slot));
    let named = || given.text(1).and_then(|name| state.facts.craft.mode_number(&name));
    let Some(number) = numbered.and_then(|number| u32::try_from(number).ok()).or_else(named) else { return };
    state.mode = number;
    out.item(Item::Mode(Mode { number, name: state.craft().mode_name(number) }));
}

fn arm(state: &mut State, given: &Given<'_>, _: &mut Out<'_>) {
    if let Some(armed) = given.unsigned(0) {
        state.arm(armed != 0);
    }
}

fn event(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let Some(number) = given.byte(0) else { return };
    // `LogEvent` (`AP_Logger.h`): armed, disarmed, auto-armed, land complete, not landed.
    match number {
        10 => {
            state.arm_again(given.at);
            state.arm(true);
        }
        11 => state.arm(false),
        15 => state.arming.tell(true),
        18 => state.land(),
        28 => state.leave_ground(),
        _ => {}
    }
    tell_event(out, number.into(), NOTICE, words::event(number), None);
}

fn error(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let (Some(subsystem), Some(code)) = (given.byte(0), given.byte(1)) else { return };
    if words::is_failsafe(subsystem) {
        let bit = 1 << subsystem;
        state.failsafes = if code == 0 { state.failsafes & !bit } else { state.failsafes | bit };
    }
    if subsystem == CRASH_CHECK && code != 0 {
        out.fact(FactKind::Emergency, words::subsystem(CRASH_CHECK));
    }
    let severity = if code == 0 { NOTICE } else { ERROR };
    let number = u32::from(subsystem) << 8 | u32::from(code);
    let alert = words::alert(subsystem, code);
    tell_event(out, number, severity, &words::error(subsystem, code), alert);
}

fn tell_event(out: &mut Out<'_>, number: u32, severity: u8, words: &str, alert: Option<Alert>) {
    out.item(Item::Event(Event { source: SOURCE, number, severity, words, alert }));
}

/// Written once, after the watchdog's restart (`AP_Scheduler`, `persistent_data`). The fault's number is the
/// processor's exception (Armv7-M manual, B1.5.2).
fn watchdog(_: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let fault = match given.unsigned(0) {
        Some(3) => ", after a hard fault",
        Some(4) => ", after a memory fault",
        Some(5) => ", after a bus fault",
        Some(6) => ", after a usage fault",
        _ => "",
    };
    out.fact(FactKind::ProcessorFault, &format!("the watchdog restarted the autopilot{fault}"));
}

/// Messages without room in the logger.
fn dropped(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let Some(lost) = given.unsigned(0) else { return };
    // Losses before the first report may be of another log.
    if let Some(more) =
        state.messages_lost.and_then(|before| lost.checked_sub(before)).filter(|more| *more > 0)
    {
        let words = format!("{} that the autopilot's logger had no room for", count(more, "message"));
        out.item(Item::Gap(&Gap::new(Some(given.at), Cause::Lost, words)));
    }
    state.messages_lost = Some(lost);
}
