//! Requests to the autopilot: the messages that the checks need, its version, and its battery parameters.
//!
//! # Procedure
//! Listen for [`LISTEN`]. A message that already arrives often enough is not requested, so no stream gets slower.
//! Request the others with `SET_MESSAGE_INTERVAL`, one at a time, each answered before the next. Check the rates
//! every [`ROUND`] and repeat the request for a stream that stopped (unseen reboot, stream changed by someone else).
//! The interval between repeats doubles, because an autopilot may accept a request for a message that it never sends.
//! A refused message is not requested again until the autopilot reboots. An ArduPilot that does not answer these
//! commands gets `REQUEST_DATA_STREAM` for whole groups.
//!
//! ArduPilot warns its pilot ("no message" of that number) if an interval is requested for an unsupported message. It
//! refuses `REQUEST_MESSAGE` silently (`GCS_Common.cpp`, 4.1 to 4.6), so a message is requested first, and its
//! interval only if supported. `ESC_TELEMETRY_5_TO_8` comes with `ESC_TELEMETRY_1_TO_4`, and has no interval of its
//! own.
//!
//! Parameters are requested after the messages, once or twice each after first contact or a reboot. The autopilot
//! does not answer a request for an unknown parameter, so silence proves nothing.
//!
//! # Bandwidth
//! The requested messages take at most [`SHARE`] percent of the port's line. All intervals are stretched to fit.

use hums_core::battery_cells::{self, KNOWN};
use hums_core::clock::{Instant, Span};
use hums_core::observation::{Autopilot, CommandAck, Source};
use hums_dialect::ids;

use crate::mav_cmd::{REQUEST_MESSAGE, SET_MESSAGE_INTERVAL};
use crate::messages;
use crate::packet::Packet;

/// Listening time after first contact or a reboot.
pub const LISTEN: Span = Span::from_secs(5);
/// Interval between checks of the rates.
pub const ROUND: Span = Span::from_secs(10);
/// Share of the line for all requested messages, percent.
pub const SHARE: u32 = 50;
const ANSWER: Span = Span::from_secs(1);
const TRIES: u8 = 3;
const DEAF: u8 = 6;
/// Most doublings of the interval: 10 s, 20 s ... 10.5 min.
const PATIENCE_MAX: u8 = 6;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Senders {
    Both,
    Px4,
    ArduPilot,
}

/// Id, senders, Hz, bytes.
type WantedMessage = (u32, Senders, u8, u8);

/// Most important first.
const WANTED: [WantedMessage; 34] = [
    (ids::SYS_STATUS, Senders::Both, 5, 43),
    (ids::ATTITUDE, Senders::Both, 10, 40),
    (ids::GLOBAL_POSITION_INT, Senders::Both, 5, 40),
    (ids::GPS_RAW_INT, Senders::Both, 5, 64),
    (ids::BATTERY_STATUS, Senders::Both, 1, 66),
    (ids::VFR_HUD, Senders::Both, 4, 32),
    (ids::VIBRATION, Senders::Both, 5, 44),
    (ids::SYSTEM_TIME, Senders::Both, 1, 24),
    (ids::RC_CHANNELS, Senders::Both, 2, 54),
    (ids::EXTENDED_SYS_STATE, Senders::Both, 2, 14),
    (ids::SERVO_OUTPUT_RAW, Senders::Both, 5, 49),
    (ids::ATTITUDE_TARGET, Senders::Both, 8, 49),
    (ids::ESTIMATOR_STATUS, Senders::Px4, 5, 54),
    (ids::ESC_STATUS, Senders::Px4, 5, 69),
    (ids::ESC_INFO, Senders::Px4, 1, 58),
    (ids::HIGHRES_IMU, Senders::Px4, 20, 75),
    (ids::EKF_STATUS_REPORT, Senders::ArduPilot, 5, 34),
    (ids::NAV_CONTROLLER_OUTPUT, Senders::ArduPilot, 2, 38),
    (ids::POWER_STATUS, Senders::ArduPilot, 1, 18),
    (ids::ESC_TELEMETRY_1_TO_4, Senders::ArduPilot, 5, 112), // The autopilot sends 5_TO_8 with it.
    (ids::RAW_IMU, Senders::ArduPilot, 10, 41),
    (ids::RPM, Senders::ArduPilot, 2, 20),
    (ids::EFI_STATUS, Senders::ArduPilot, 2, 82),
    (ids::GENERATOR_STATUS, Senders::ArduPilot, 2, 54),
    (ids::MCU_STATUS, Senders::ArduPilot, 1, 22),
    (ids::SCALED_PRESSURE, Senders::ArduPilot, 5, 28),
    (ids::AHRS2, Senders::ArduPilot, 5, 36),
    (ids::SCALED_IMU2, Senders::Both, 8, 36),
    (ids::SCALED_IMU3, Senders::Both, 8, 36),
    (ids::SCALED_PRESSURE2, Senders::Both, 5, 28),
    (ids::SCALED_PRESSURE3, Senders::Both, 2, 28),
    (ids::GPS2_RAW, Senders::Both, 1, 69),
    (ids::POSITION_TARGET_LOCAL_NED, Senders::Both, 2, 63),
    (ids::LOCAL_POSITION_NED, Senders::Both, 5, 40),
];

/// The messages that the box requests of this autopilot over a line of this rate, the most important first, with their
/// rates in Hz.
pub fn wanted(autopilot: Autopilot, baud: u32) -> impl Iterator<Item = (u32, f32)> {
    let stretch = stretch(autopilot, baud) as f32;
    let sent = WANTED.into_iter().filter(move |wanted| is_sent_by(wanted, autopilot));
    sent.map(move |(id, _, rate_hz, _)| (id, f32::from(rate_hz) / stretch))
}

/// Groups of `REQUEST_DATA_STREAM` and their rates: raw sensors, extended status, RC, position, extra 1 to 3.
const GROUPS: [(u8, u16); 7] = [(1, 4), (2, 2), (3, 2), (6, 4), (10, 8), (11, 4), (12, 2)];

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Support {
    /// Unknown.
    #[default]
    Perhaps,
    Yes,
    /// Refused.
    No,
}

#[derive(Clone, Copy, Debug, Default)]
struct Message {
    seen: u8,
    has: Support,
    patience: u8,
    wait: u8,
    due: bool,
}

#[derive(Clone, Copy, Debug)]
struct PendingRequest {
    what: Requested,
    at: Instant,
    tries: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Requested {
    /// A single message, to test whether the autopilot supports it.
    One(usize),
    Interval(usize),
    Identity,
    /// Index of a parameter in [`KNOWN`].
    Parameter(usize),
}

/// Requests to the autopilot.
#[derive(Clone, Debug)]
pub struct Asking {
    vehicle: Option<(Source, Autopilot)>,
    reboots: u32,
    messages: [Message; WANTED.len()],
    asked: Option<PendingRequest>,
    /// Time of the next check of the rates.
    look_at: Instant,
    window: Span,
    deaf: u8,
    /// For an autopilot without intervals: the next group to request; the number of groups when done.
    groups: Option<usize>,
    identity: Message,
    /// Parameters not yet received, one bit per index.
    parameters: u32,
}

/// Current state of the vehicle.
#[derive(Clone, Copy, Debug)]
pub struct KnownVehicle {
    /// The autopilot.
    pub source: Source,
    /// Its firmware.
    pub autopilot: Autopilot,
    /// Number of reboots.
    pub reboots: u32,
    /// `AUTOPILOT_VERSION` was received.
    pub identified: bool,
    /// Line rate.
    pub baud: u32,
}

impl Asking {
    /// Before first contact.
    pub const fn new() -> Self {
        const NONE: Message = Message { seen: 0, has: Support::Perhaps, patience: 0, wait: 0, due: false };
        Self {
            vehicle: None,
            reboots: 0,
            messages: [NONE; WANTED.len()],
            asked: None,
            look_at: Instant::ZERO,
            window: LISTEN,
            deaf: 0,
            groups: None,
            identity: NONE,
            parameters: (1 << KNOWN.len()) - 1,
        }
    }

    /// Recipient of the requests.
    pub fn of(&self) -> Option<Source> {
        self.vehicle.map(|(source, _)| source)
    }

    /// Whether all parameters were requested, and each was answered or timed out.
    pub fn has_parameters(&self, known: &KnownVehicle) -> bool {
        known.autopilot != Autopilot::Other
            && self.of() == Some(known.source)
            && self.window == ROUND
            && self.parameter(known).is_none()
    }

    /// Processes a frame of the vehicle.
    pub fn seen(&mut self, id: u32) {
        if let Some(index) = WANTED.iter().position(|wanted| wanted.0 == id) {
            let message = &mut self.messages[index];
            (message.seen, message.has) = (message.seen.saturating_add(1), Support::Yes);
        }
    }

    /// A received value.
    pub fn told(&mut self, name: &str) {
        if let Some(place) = battery_cells::known(name) {
            self.parameters &= !(1 << place);
            if self.asked.is_some_and(|asked| asked.what == Requested::Parameter(usize::from(place))) {
                (self.asked, self.deaf) = (None, 0);
            }
        }
    }

    /// Answer to a command.
    pub fn answered(&mut self, command: u16, result: u8) {
        let Some(asked) = self.asked else { return };
        let (expected, message) = match asked.what {
            Requested::One(index) => (REQUEST_MESSAGE, &mut self.messages[index]),
            Requested::Interval(index) => (SET_MESSAGE_INTERVAL, &mut self.messages[index]),
            Requested::Identity => (REQUEST_MESSAGE, &mut self.identity),
            Requested::Parameter(_) => return,
        };
        if command != expected || result == CommandAck::IN_PROGRESS {
            return;
        }
        // An autopilot that does not know this command may know the other one.
        let asks_one = matches!(asked.what, Requested::One(_));
        let is_granted = matches!(result, CommandAck::ACCEPTED | CommandAck::TEMPORARILY_REJECTED)
            || (asks_one && result == CommandAck::UNSUPPORTED);
        message.has = if is_granted { Support::Yes } else { Support::No };
        message.due &= asks_one && is_granted;
        self.asked = None;
        self.deaf = 0;
    }

    /// Call at every tick. Passes at most one message to `send`, which returns whether it was sent.
    pub fn tick(
        &mut self,
        now: Instant,
        known: Option<&KnownVehicle>,
        send: &mut impl FnMut(&Packet) -> bool,
    ) {
        let Some(known) = known else { return };
        if self.vehicle != Some((known.source, known.autopilot)) || self.reboots != known.reboots {
            // A rebooted autopilot has forgotten all earlier requests.
            *self = Self::new();
            self.vehicle = Some((known.source, known.autopilot));
            self.reboots = known.reboots;
            self.look_at = now + LISTEN;
        }
        if now >= self.look_at {
            self.look(known);
            self.look_at = now + ROUND;
            self.window = ROUND;
        }
        self.ask(now, known, send);
    }

    fn look(&mut self, known: &KnownVehicle) {
        let stretch = stretch(known.autopilot, known.baud);
        let window_ms = self.window.as_millis() as u32;
        let mut missing = false;
        for (message, wanted) in self.messages.iter_mut().zip(&WANTED) {
            // Less than two thirds of the requested rate.
            let expected = u32::from(wanted.2) * window_ms / 1_000 * 2 / 3;
            let is_enough = u32::from(message.seen) * stretch >= expected.clamp(1, 200);
            message.seen = 0;
            if is_enough {
                message.patience = 0;
                message.wait = 0;
                message.due = false;
            } else if is_sent_by(wanted, known.autopilot) && message.has != Support::No {
                message.due = message.wait == 0;
                if message.due {
                    message.wait = (1_u8 << message.patience) - 1;
                    message.patience = (message.patience + 1).min(PATIENCE_MAX);
                } else {
                    message.wait -= 1;
                }
                missing |= message.due;
            }
        }
        if known.identified {
            self.identity.due = false;
        } else if self.identity.wait == 0 && self.identity.has != Support::No {
            self.identity.due = true;
            self.identity.wait = (1 << self.identity.patience) - 1;
            self.identity.patience = (self.identity.patience + 1).min(PATIENCE_MAX);
        } else {
            self.identity.wait = self.identity.wait.saturating_sub(1);
        }
        if missing && self.groups.is_some() {
            self.groups = Some(0);
        }
    }

    fn ask(&mut self, now: Instant, known: &KnownVehicle, send: &mut impl FnMut(&Packet) -> bool) {
        if let Some(asked) = self.asked {
            if now.since(asked.at) < ANSWER {
                return;
            }
            if asked.tries < TRIES && send(&packet(asked.what, known)) {
                self.asked = Some(PendingRequest { at: now, tries: asked.tries + 1, ..asked });
                return;
            }
            if asked.tries < TRIES {
                return;
            }
            self.asked = None;
            match asked.what {
                Requested::Parameter(place) => self.parameters &= !(1 << place),
                Requested::One(index) => {
                    self.messages[index].due = false;
                    self.deaf = self.deaf.saturating_add(TRIES);
                }
                Requested::Interval(_) | Requested::Identity => self.deaf = self.deaf.saturating_add(TRIES),
            }
        }
        if let Some(group) = self.groups {
            if let Some((stream, rate)) = GROUPS.get(group) {
                let rate = (*rate / stretch(known.autopilot, known.baud) as u16).max(1);
                let Source { system, component } = known.source;
                if send(&messages::request_data_stream(*stream, rate, system, component)) {
                    self.groups = Some(group + 1);
                }
                return;
            }
        } else if known.autopilot == Autopilot::ArduPilot && (self.deaf >= DEAF || self.knows_no_intervals())
        {
            self.groups = Some(0);
            return;
        }
        let Some(what) = self.next(known) else { return };
        if send(&packet(what, known)) {
            match what {
                Requested::Identity => self.identity.due = false,
                Requested::Interval(index) => self.messages[index].due = false,
                Requested::One(_) | Requested::Parameter(_) => {}
            }
            // An unanswered parameter request is repeated once.
            let tries = if matches!(what, Requested::Parameter(_)) { TRIES - 1 } else { 1 };
            self.asked = Some(PendingRequest { what, at: now, tries });
        }
    }

    fn next(&self, known: &KnownVehicle) -> Option<Requested> {
        let commands = || {
            if self.identity.due {
                return Some(Requested::Identity);
            }
            let (index, message) = self.messages.iter().enumerate().find(|(_, message)| message.due)?;
            let asks_one = known.autopilot == Autopilot::ArduPilot && message.has == Support::Perhaps;
            Some(if asks_one { Requested::One(index) } else { Requested::Interval(index) })
        };
        let command = self.groups.is_none().then(commands).flatten();
        command.or_else(|| self.parameter(known).map(Requested::Parameter))
    }

    fn parameter(&self, known: &KnownVehicle) -> Option<usize> {
        let px4 = match known.autopilot {
            Autopilot::Px4 => true,
            Autopilot::ArduPilot => false,
            Autopilot::Other => return None,
        };
        let due = |place: &usize| self.parameters >> place & 1 == 1 && KNOWN[*place].0 == px4;
        (0..KNOWN.len()).find(due).filter(|_| self.window == ROUND)
    }

    fn knows_no_intervals(&self) -> bool {
        let both = self.messages.iter().zip(&WANTED).filter(|(_, wanted)| wanted.1 == Senders::Both);
        both.filter(|(message, _)| message.has == Support::No).count() >= 3
    }
}

const fn is_sent_by(wanted: &WantedMessage, autopilot: Autopilot) -> bool {
    matches!(
        (wanted.1, autopilot),
        (Senders::Both, _) | (Senders::Px4, Autopilot::Px4) | (Senders::ArduPilot, Autopilot::ArduPilot)
    )
}

fn stretch(autopilot: Autopilot, baud: u32) -> u32 {
    let sent = WANTED.iter().filter(|wanted| is_sent_by(wanted, autopilot));
    let bytes_per_s: u32 = sent.map(|wanted| u32::from(wanted.2) * u32::from(wanted.3)).sum();
    let carried = (baud / 10 * SHARE / 100).max(1);
    bytes_per_s.div_ceil(carried).max(1)
}

fn packet(what: Requested, known: &KnownVehicle) -> Packet {
    let Source { system, component } = known.source;
    match what {
        Requested::Interval(index) => {
            let (id, _, rate_hz, _) = WANTED[index];
            let interval_us = 1_000_000 / u32::from(rate_hz) * stretch(known.autopilot, known.baud);
            messages::command_long(SET_MESSAGE_INTERVAL, &[id as f32, interval_us as f32], system, component)
        }
        Requested::One(index) => {
            messages::command_long(REQUEST_MESSAGE, &[WANTED[index].0 as f32], system, component)
        }
        Requested::Identity => {
            messages::command_long(REQUEST_MESSAGE, &[ids::AUTOPILOT_VERSION as f32], system, component)
        }
        Requested::Parameter(place) => messages::param_request_read(KNOWN[place].1, system, component),
    }
}

#[cfg(test)]
mod tests;
