//! Commands of a ground station, and the waiting answers as messages.
//!
//! | `MAV_CMD` | does |
//! |---|---|
//! | 246 `PREFLIGHT_REBOOT_SHUTDOWN`, param 1 = 5 | ends the log and restarts in card-reader mode: while disarmed |
//! | 401 `RUN_PREARM_CHECKS` | tells what stands against a flight; accepted when nothing does |
//! | 512 `REQUEST_MESSAGE` | `HEARTBEAT`, `AUTOPILOT_VERSION`, `PROTOCOL_VERSION`, `COMPONENT_METADATA` |
//! | 519, 520 | the same by their older commands |
//! | 526 `STORAGE_FORMAT` | formats a card that cannot be recorded on as it is: while disarmed |
//! | 2510, 2511 `LOGGING_START`, `_STOP` | records again; stops recording, while disarmed |
//! | 31010 `USER_1` | another part is in a component's place, from 1, with its serial number in params 2 to 7 ([`characters`]); 0 and, as param 2, 1: propellers, a battery or the payload changed: while disarmed |
//! | 31011 `USER_2` | cancels the protective action that is announced |

use hums_blackbox::record::Boot;
use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::component::Label;
use hums_core::health::Level;
use hums_core::observation::{CommandAck, Feeds};
use hums_core::parameters::TABLE;
use hums_link::ids;
use hums_link::mav_cmd::{
    LOGGING_START, LOGGING_STOP, PREFLIGHT_REBOOT_SHUTDOWN, REBOOT_TO_MASS_STORAGE,
    REQUEST_AUTOPILOT_CAPABILITIES, REQUEST_MESSAGE, REQUEST_PROTOCOL_VERSION, RUN_PREARM_CHECKS,
    STORAGE_FORMAT, USER_1_REPLACED, USER_2_CANCEL,
};
use hums_link::messages;
use hums_link::packet::Packet;
use hums_link::request::{Port, Replies, Reply};
use hums_link::statustext::{Severity, Text};
use hums_link::summary;
use hums_link::vocabulary;
use hums_recorder::CardState;

use super::library::builtin::{self, BuiltinFile};
use super::limiter::{Limiter, Requester};
use crate::journal::{By, Journal, Logbook};
use crate::monitoring::PARTS_CHANGED;
use crate::records;

/// From the command to the end of the log: time for our answer.
const ANSWERED: Span = Span::from_millis(500);

fn characters(params: &[f32; 7]) -> [u8; 18] {
    let mut text = [0; 18];
    for (characters, value) in text.chunks_exact_mut(3).zip(params.iter().skip(1)) {
        characters.copy_from_slice(&(*value as u32).to_be_bytes()[1..]);
    }
    text
}

/// Changes nothing.
pub(crate) const fn only_asks(command: u16) -> bool {
    matches!(
        command,
        REQUEST_MESSAGE | REQUEST_PROTOCOL_VERSION | REQUEST_AUTOPILOT_CAPABILITIES | RUN_PREARM_CHECKS
    )
}

#[derive(Clone, Debug)]
pub(crate) struct Commands {
    pub(crate) replies: Replies,
    limits: [Limiter; Port::ALL.len()],
    stopped: bool,
    card_reader_asked: Option<Instant>,
}

impl Commands {
    pub(crate) const fn new() -> Self {
        Self {
            replies: Replies::new(),
            limits: [Limiter::new(); Port::ALL.len()],
            stopped: false,
            card_reader_asked: None,
        }
    }

    pub(crate) fn allows(&mut self, now: Instant, port: Port) -> bool {
        self.limits[port as usize].allows(now)
    }

    pub(crate) const fn stopped(&self) -> bool {
        self.stopped
    }

    /// Whether the board is to restart in card-reader mode: our answer was sent, and the vehicle is still disarmed.
    pub(crate) fn wants_card_reader(&mut self, now: Instant, is_armed: bool) -> bool {
        self.card_reader_asked = self.card_reader_asked.filter(|_| !is_armed);
        self.card_reader_asked.is_some_and(|asked| now.since(asked) >= ANSWERED)
    }

    /// Returns its `MAV_RESULT`.
    pub(crate) fn command(
        &mut self,
        now: Instant,
        asker: Requester,
        command: u16,
        params: [f32; 7],
        book: &mut Logbook<'_>,
    ) -> u8 {
        let mut reply = |reply| {
            self.replies.push(asker.port, reply);
            CommandAck::ACCEPTED
        };
        match (command, params[0] as u32) {
            (REQUEST_AUTOPILOT_CAPABILITIES, _) | (REQUEST_MESSAGE, ids::AUTOPILOT_VERSION) => {
                reply(Reply::Version)
            }
            (REQUEST_PROTOCOL_VERSION, _) | (REQUEST_MESSAGE, ids::PROTOCOL_VERSION) => {
                reply(Reply::Protocol)
            }
            (REQUEST_MESSAGE, ids::HEARTBEAT) => reply(Reply::Heartbeat),
            (REQUEST_MESSAGE, ids::COMPONENT_METADATA) => reply(Reply::Metadata),
            (RUN_PREARM_CHECKS, _) => {
                reply(Reply::Preflight);
                if preflight(book.monitor).is_none() { CommandAck::ACCEPTED } else { CommandAck::FAILED }
            }
            // The storage number and a confirmation: a command sent by mistake has neither.
            (STORAGE_FORMAT, storage) if storage > 1 || params[1].to_bits() != 1.0_f32.to_bits() => {
                CommandAck::DENIED
            }
            // Likewise: the ground station's button without numbers must not reset the baselines.
            (USER_1_REPLACED, 0) if params[0].to_bits() != 0 || params[1].to_bits() != 1.0_f32.to_bits() => {
                CommandAck::DENIED
            }
            // Other restarts are the autopilot's.
            (PREFLIGHT_REBOOT_SHUTDOWN, action) if action != REBOOT_TO_MASS_STORAGE => {
                CommandAck::UNSUPPORTED
            }
            (
                LOGGING_START
                | LOGGING_STOP
                | STORAGE_FORMAT
                | USER_1_REPLACED
                | USER_2_CANCEL
                | PREFLIGHT_REBOOT_SHUTDOWN,
                number,
            ) => {
                if !self.allows(now, asker.port) {
                    return CommandAck::TEMPORARILY_REJECTED;
                }
                self.act(now, asker, (command, number, &params), book)
            }
            _ => CommandAck::UNSUPPORTED,
        }
    }

    fn act(
        &mut self,
        now: Instant,
        asker: Requester,
        (command, number, params): (u16, u32, &[f32; 7]),
        book: &mut Logbook<'_>,
    ) -> u8 {
        let by = asker.by;
        match command {
            USER_2_CANCEL => {
                let cancelled = book.monitor.cancel_protection();
                book.journal.by_hand(now, format_args!("cancel by {}/{}", by.0, by.1));
                if cancelled { CommandAck::ACCEPTED } else { CommandAck::FAILED }
            }
            LOGGING_STOP | STORAGE_FORMAT | USER_1_REPLACED | PREFLIGHT_REBOOT_SHUTDOWN
                if book.may_fly(now) =>
            {
                CommandAck::TEMPORARILY_REJECTED
            }
            STORAGE_FORMAT => format(now, by, book),
            PREFLIGHT_REBOOT_SHUTDOWN => {
                if self.card_reader_asked.is_none() {
                    self.card_reader_asked = Some(now);
                    book.journal.by_hand(now, format_args!("card reader by {}/{}", by.0, by.1));
                    self.replies.push(asker.port, Reply::CardReader);
                }
                CommandAck::ACCEPTED
            }
            USER_1_REPLACED if number == 0 => {
                book.journal.by_hand(now, format_args!("{PARTS_CHANGED} by {}/{}", by.0, by.1));
                CommandAck::ACCEPTED
            }
            USER_1_REPLACED => {
                let place = (number as usize).wrapping_sub(1);
                // The component's record names the sender.
                let serial = characters(params);
                let serial = core::str::from_utf8(&serial).unwrap_or_default();
                let (new, known) =
                    (Label::new(serial), book.monitor.components().get(place).map(|part| part.serial));
                let is_done = new != Label::default() && known == Some(new);
                if is_done || records::replace_component(now, place, serial, by, book) {
                    CommandAck::ACCEPTED
                } else {
                    CommandAck::DENIED
                }
            }
            _ => {
                self.stop_or_record(now, command == LOGGING_STOP, asker, &mut book.journal);
                CommandAck::ACCEPTED
            }
        }
    }

    /// A stop is visible: an event in the record, a text on the ground station, and a finding for as long as
    /// it lasts. It ends when the vehicle is armed.
    pub(crate) fn stop_or_record(
        &mut self,
        now: Instant,
        stop: bool,
        Requester { port, by }: Requester,
        journal: &mut Journal<'_>,
    ) {
        if self.stopped == stop {
            return;
        }
        self.stopped = stop;
        let what = if stop { "stopped" } else { "started" };
        journal.by_hand(now, format_args!("recording {what} by {}/{}", by.0, by.1));
        if stop {
            self.replies.push(port, Reply::Stopped);
        }
    }
}

/// Formats only a card without HUMS logs: no radio command may destroy logs.
fn format(now: Instant, by: By, book: &mut Logbook<'_>) -> u8 {
    let state = book.card.read().state;
    let may = state.wants_format();
    let what = if may { "card is formatted" } else { "formatting refused, asked" };
    book.journal.by_hand(now, format_args!("{what} by {}/{}", by.0, by.1));
    match state {
        _ if may => {
            book.card.want_format();
            CommandAck::ACCEPTED
        }
        CardState::Formatting => CommandAck::ACCEPTED,
        CardState::Recording | CardState::Finished | CardState::Full => CommandAck::DENIED,
        _ => CommandAck::FAILED,
    }
}

fn preflight(monitor: &Monitor) -> Option<(&'static str, u8)> {
    let bad = |level| matches!(level, Level::Warning | Level::Critical);
    if monitor.vehicle().armed() {
        return Some(("armed", 0));
    }
    monitor.health().levels().find(|(_, _, level)| bad(*level)).map(|(check, part, _)| (check.name, part))
}

#[inline(never)]
fn not_ready(check: &str, part: u8) -> Text {
    match vocabulary::said(check) {
        Some(said) => Text::new(format_args!("HUMS: not ready: {}", said.alarm_of(part, Feeds::Unsaid))),
        None => Text::new(format_args!("HUMS: not ready: {check}")),
    }
}

pub(crate) fn packet(now: Instant, reply: Reply, monitor: &Monitor, identity: &Boot<'_>) -> Packet {
    match reply {
        Reply::Param(index) => match monitor.params().iter().nth(usize::from(index)) {
            Some((spec, value)) => messages::param_value(spec.name, value, index, TABLE.len() as u16),
            // Only indices of the table are queued.
            None => messages::heartbeat(0),
        },
        Reply::Ack(command, result, (system, component)) => {
            messages::command_ack(command, result, system, component)
        }
        Reply::Version => messages::autopilot_version(version(identity.version), identity.git, &identity.uid),
        Reply::Protocol => messages::protocol_version(),
        Reply::Metadata => {
            messages::component_metadata(now, BuiltinFile::General.crc(), builtin::GENERAL_URI)
        }
        Reply::Heartbeat => summary::heartbeat(monitor),
        Reply::Preflight => match preflight(monitor) {
            Some((check, part)) => messages::status_text(Severity::Warning, not_ready(check, part).as_str()),
            None => messages::status_text(Severity::Info, "HUMS: ready"),
        },
        Reply::Keyed(true) => messages::status_text(Severity::Notice, "HUMS: signing key set"),
        Reply::Keyed(false) => messages::status_text(Severity::Notice, "HUMS: signing key removed"),
        Reply::Erased => messages::status_text(Severity::Notice, "HUMS: earlier logs are erased"),
        Reply::LogGone => messages::status_text(Severity::Warning, "HUMS: this log is gone: download ended"),
        Reply::LogsChanged => {
            messages::status_text(Severity::Notice, "HUMS: logs have changed: list them again")
        }
        Reply::LogsUnread => {
            messages::status_text(Severity::Warning, "HUMS: card did not give all logs: list again")
        }
        Reply::CardReader => {
            messages::status_text(Severity::Warning, "HUMS: card reader, nothing is recorded")
        }
        Reply::Stopped => messages::status_text(Severity::Warning, "HUMS: recording stopped by command"),
    }
}

/// `1.2.3` as three numbers.
fn version(text: &str) -> [u8; 3] {
    let mut numbers = text.split(['.', '-', '+']).map(|part| part.parse().unwrap_or(0));
    [(); 3].map(|()| numbers.next().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_version_is_three_numbers_whatever_it_says() {
        assert_eq!(version("1.22.3"), [1, 22, 3]);
        assert_eq!((version("0.1.0-rc1"), version("")), ([0, 1, 0], [0, 0, 0]));
    }
}
