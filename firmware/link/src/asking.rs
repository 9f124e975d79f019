//! Asking the autopilot for the messages that the checks need, for who it is, and for its parameters that tell of batteries.
//!
//! # How
//! First we listen for [`LISTEN`]: what already comes often enough is not asked for, so that nothing is ever made
//! slower. Then one message after the other is asked for with `SET_MESSAGE_INTERVAL`, each answered before the next.
//! Every [`ROUND`] the rates are looked at anew: what has stopped (a reboot that we did not see, a stream that somebody
//! else changed) is asked for again, each time twice as patiently, because an autopilot may well promise a message that
//! it never has. A message that is refused is not asked for again until the autopilot reboots. An ArduPilot that never
//! answers such commands, or knows none, is asked for whole groups with `REQUEST_DATA_STREAM`.
//!
//! ArduPilot tells its pilot of each interval that is asked for of a message that it does not have (that it has "no message" of that number), and refuses
//! `REQUEST_MESSAGE` for it without a word (`GCS_Common.cpp`, 4.1 to 4.6). So it is asked for one of them first, and for the
//! interval of those that it has. `ESC_TELEMETRY_5_TO_8` comes with `ESC_TELEMETRY_1_TO_4`, and has no interval of its own.
//!
//! Parameters are asked for after the messages, each once or twice after the vehicle is heard first or has rebooted. One that the
//! autopilot does not have is not answered, and that says nothing of it.
//!
//! # How much
//! What is asked for takes at most [`SHARE`] percent of the port's line, and all intervals are stretched until it does.

use hums_core::cells::{self, KNOWN};
use hums_core::clock::{Instant, Span};
use hums_core::observation::{Autopilot, Source};

use crate::messages;
use crate::packet::Packet;

/// How long we listen after the vehicle is heard first, or has rebooted.
pub const LISTEN: Span = Span::from_secs(5);
/// How often the rates are looked at.
pub const ROUND: Span = Span::from_secs(10);
/// Of the line, in percent, what all messages asked for may take together.
pub const SHARE: u32 = 50;
/// How long an answer may take.
const ANSWER: Span = Span::from_secs(1);
/// How often a command is repeated when there is no answer.
const TRIES: u8 = 3;
/// Commands without any answer, one after the other, that make an autopilot one that does not answer.
const DEAF: u8 = 6;
/// Rounds doubled at most: 10 s, 20 s ... 10 minutes and a half.
const PATIENCE_MAX: u8 = 6;

/// `MAV_CMD_SET_MESSAGE_INTERVAL`
pub const SET_MESSAGE_INTERVAL: u16 = 511;
/// `MAV_CMD_REQUEST_MESSAGE`
pub const REQUEST_MESSAGE: u16 = 512;
const AUTOPILOT_VERSION: u32 = 148;
/// Of `MAV_RESULT`.
const ACCEPTED: u8 = 0;
/// As above.
const TEMPORARILY: u8 = 1;
/// As above.
const UNSUPPORTED: u8 = 3;
/// As above.
const IN_PROGRESS: u8 = 5;

/// Who sends a message.
#[derive(Clone, Copy, PartialEq, Eq)]
enum By {
    Both,
    Px4,
    ArduPilot,
}

/// id, who sends it, how many a second, bytes of a frame.
type Wanted = (u32, By, u8, u8);

/// What the checks need, the most needed first.
const WANTED: [Wanted; 34] = [
    (1, By::Both, 5, 43),            // SYS_STATUS
    (30, By::Both, 10, 40),          // ATTITUDE
    (33, By::Both, 5, 40),           // GLOBAL_POSITION_INT
    (24, By::Both, 5, 64),           // GPS_RAW_INT
    (147, By::Both, 1, 66),          // BATTERY_STATUS
    (74, By::Both, 4, 32),           // VFR_HUD
    (241, By::Both, 5, 44),          // VIBRATION
    (2, By::Both, 1, 24),            // SYSTEM_TIME
    (65, By::Both, 2, 54),           // RC_CHANNELS
    (245, By::Both, 2, 14),          // EXTENDED_SYS_STATE
    (36, By::Both, 5, 49),           // SERVO_OUTPUT_RAW
    (83, By::Both, 8, 49),           // ATTITUDE_TARGET
    (230, By::Px4, 5, 54),           // ESTIMATOR_STATUS
    (291, By::Px4, 5, 69),           // ESC_STATUS
    (290, By::Px4, 1, 58),           // ESC_INFO
    (105, By::Px4, 20, 75),          // HIGHRES_IMU
    (193, By::ArduPilot, 5, 34),     // EKF_STATUS_REPORT
    (62, By::ArduPilot, 2, 38),      // NAV_CONTROLLER_OUTPUT
    (125, By::ArduPilot, 1, 18),     // POWER_STATUS
    (11_030, By::ArduPilot, 5, 112), // ESC_TELEMETRY_1_TO_4, and 5_TO_8 with it
    (27, By::ArduPilot, 10, 41),     // RAW_IMU
    (226, By::ArduPilot, 2, 20),     // RPM
    (225, By::ArduPilot, 2, 82),     // EFI_STATUS
    (373, By::ArduPilot, 2, 54),     // GENERATOR_STATUS
    (11_039, By::ArduPilot, 1, 22),  // MCU_STATUS
    (29, By::ArduPilot, 5, 28),      // SCALED_PRESSURE
    (178, By::ArduPilot, 5, 36),     // AHRS2
    (116, By::Both, 8, 36),          // SCALED_IMU2
    (129, By::Both, 8, 36),          // SCALED_IMU3
    (137, By::Both, 5, 28),          // SCALED_PRESSURE2
    (143, By::Both, 2, 28),          // SCALED_PRESSURE3
    (124, By::Both, 1, 69),          // GPS2_RAW
    (85, By::Both, 2, 63),           // POSITION_TARGET_LOCAL_NED
    (32, By::Both, 5, 40),           // LOCAL_POSITION_NED
];

/// Groups of `REQUEST_DATA_STREAM` and their rates: raw sensors, extended status, RC, position, extra 1 to 3.
const GROUPS: [(u8, u16); 7] = [(1, 4), (2, 2), (3, 2), (6, 4), (10, 8), (11, 4), (12, 2)];

/// Whether an autopilot has a message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Has {
    /// Nobody knows.
    #[default]
    Perhaps,
    /// It came, or one of them was granted.
    Yes,
    /// It was refused.
    No,
}

#[derive(Clone, Copy, Debug, Default)]
struct Message {
    /// Frames since the last look.
    seen: u8,
    has: Has,
    /// How often it was promised and did not come.
    patience: u8,
    /// Rounds to wait before it is asked for again.
    wait: u8,
    /// To be asked for in this round.
    due: bool,
}

/// What is asked for and not answered yet.
#[derive(Clone, Copy, Debug)]
struct Asked {
    what: What,
    at: Instant,
    tries: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    /// One of a message, to see whether the autopilot has it.
    One(usize),
    Interval(usize),
    Identity,
    /// The place of a parameter in [`KNOWN`].
    Parameter(usize),
}

/// What we ask of the autopilot.
#[derive(Clone, Debug)]
pub struct Asking {
    vehicle: Option<(Source, Autopilot)>,
    reboots: u32,
    messages: [Message; WANTED.len()],
    asked: Option<Asked>,
    /// When rates are looked at next.
    look_at: Instant,
    window: Span,
    /// Commands without an answer, one after the other.
    deaf: u8,
    /// It knows no intervals: the next group to ask for, or how many there are when all are.
    groups: Option<usize>,
    identity: Message,
    /// Parameters that were not told yet, a bit each by their place.
    parameters: u32,
}

impl Default for Asking {
    fn default() -> Self {
        Self::new()
    }
}

/// What the vehicle is, at this moment.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// The autopilot.
    pub source: Source,
    /// Whose it is.
    pub autopilot: Autopilot,
    /// How often it has rebooted.
    pub reboots: u32,
    /// Whether its `AUTOPILOT_VERSION` came.
    pub identified: bool,
    /// The port's line rate.
    pub baud: u32,
}

impl Asking {
    /// Nobody heard yet.
    pub const fn new() -> Self {
        const NONE: Message = Message { seen: 0, has: Has::Perhaps, patience: 0, wait: 0, due: false };
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

    /// Who is asked.
    pub fn of(&self) -> Option<Source> {
        self.vehicle.map(|(source, _)| source)
    }

    /// Whether it was asked for all parameters that it may have, and has answered or let the time for it go by.
    pub fn has_parameters(&self, known: &Known) -> bool {
        known.autopilot != Autopilot::Other
            && self.of() == Some(known.source)
            && self.window == ROUND
            && self.parameter(known).is_none()
    }

    /// A frame of the vehicle came.
    pub fn seen(&mut self, id: u32) {
        if let Some(index) = WANTED.iter().position(|wanted| wanted.0 == id) {
            let message = &mut self.messages[index];
            (message.seen, message.has) = (message.seen.saturating_add(1), Has::Yes);
        }
    }

    /// The autopilot told a parameter's value.
    pub fn told(&mut self, name: &str) {
        if let Some(place) = cells::known(name) {
            self.parameters &= !(1 << place);
            if self.asked.is_some_and(|asked| asked.what == What::Parameter(usize::from(place))) {
                (self.asked, self.deaf) = (None, 0);
            }
        }
    }

    /// The autopilot answered a command.
    pub fn answered(&mut self, command: u16, result: u8) {
        let Some(asked) = self.asked else { return };
        let (expected, message) = match asked.what {
            What::One(index) => (REQUEST_MESSAGE, &mut self.messages[index]),
            What::Interval(index) => (SET_MESSAGE_INTERVAL, &mut self.messages[index]),
            What::Identity => (REQUEST_MESSAGE, &mut self.identity),
            What::Parameter(_) => return,
        };
        if command != expected || result == IN_PROGRESS {
            return;
        }
        // One that does not know the question may know the other one.
        let asks_one = matches!(asked.what, What::One(_));
        let is_granted = matches!(result, ACCEPTED | TEMPORARILY) || (asks_one && result == UNSUPPORTED);
        message.has = if is_granted { Has::Yes } else { Has::No };
        message.due &= asks_one && is_granted;
        self.asked = None;
        self.deaf = 0;
    }

    /// To be called at every tick; at most one message is given to `send`, which says whether it could be sent.
    pub fn tick(&mut self, now: Instant, known: Option<&Known>, send: &mut impl FnMut(&Packet) -> bool) {
        let Some(known) = known else { return };
        if self.vehicle != Some((known.source, known.autopilot)) || self.reboots != known.reboots {
            // It knows nothing of what we asked before.
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

    fn look(&mut self, known: &Known) {
        let stretch = stretch(known);
        let window_ms = self.window.as_millis() as u32;
        let mut missing = false;
        for (message, wanted) in self.messages.iter_mut().zip(&WANTED) {
            // Less than two thirds of what is wanted.
            let expected = u32::from(wanted.2) * window_ms / 1_000 * 2 / 3;
            let is_enough = u32::from(message.seen) * stretch >= expected.clamp(1, 200);
            message.seen = 0;
            if is_enough {
                message.patience = 0;
                message.wait = 0;
                message.due = false;
            } else if is_sent_by(wanted, known.autopilot) && message.has != Has::No {
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
        } else if self.identity.wait == 0 && self.identity.has != Has::No {
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

    fn ask(&mut self, now: Instant, known: &Known, send: &mut impl FnMut(&Packet) -> bool) {
        if let Some(asked) = self.asked {
            if now.since(asked.at) < ANSWER {
                return;
            }
            if asked.tries < TRIES && send(&packet(asked.what, known)) {
                self.asked = Some(Asked { at: now, tries: asked.tries + 1, ..asked });
                return;
            }
            if asked.tries < TRIES {
                return;
            }
            self.asked = None;
            match asked.what {
                What::Parameter(place) => self.parameters &= !(1 << place),
                What::One(index) => {
                    self.messages[index].due = false;
                    self.deaf = self.deaf.saturating_add(TRIES);
                }
                What::Interval(_) | What::Identity => self.deaf = self.deaf.saturating_add(TRIES),
            }
        }
        if let Some(group) = self.groups {
            if let Some((stream, rate)) = GROUPS.get(group) {
                let rate = (*rate / stretch(known) as u16).max(1);
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
                What::Identity => self.identity.due = false,
                What::Interval(index) => self.messages[index].due = false,
                What::One(_) | What::Parameter(_) => {}
            }
            // One that it does not have is asked for once more, and not twice.
            let tries = if matches!(what, What::Parameter(_)) { TRIES - 1 } else { 1 };
            self.asked = Some(Asked { what, at: now, tries });
        }
    }

    /// What is asked for next. One that knows no intervals is asked for parameters only.
    fn next(&self, known: &Known) -> Option<What> {
        let commands = || {
            if self.identity.due {
                return Some(What::Identity);
            }
            let (index, message) = self.messages.iter().enumerate().find(|(_, message)| message.due)?;
            let asks_one = known.autopilot == Autopilot::ArduPilot && message.has == Has::Perhaps;
            Some(if asks_one { What::One(index) } else { What::Interval(index) })
        };
        let command = self.groups.is_none().then(commands).flatten();
        command.or_else(|| self.parameter(known).map(What::Parameter))
    }

    /// The next parameter that this autopilot may have, once the rates were looked at.
    fn parameter(&self, known: &Known) -> Option<usize> {
        let px4 = match known.autopilot {
            Autopilot::Px4 => true,
            Autopilot::ArduPilot => false,
            Autopilot::Other => return None,
        };
        let due = |place: &usize| self.parameters >> place & 1 == 1 && KNOWN[*place].0 == px4;
        (0..KNOWN.len()).find(due).filter(|_| self.window == ROUND)
    }

    /// Everything that any autopilot has was refused.
    fn knows_no_intervals(&self) -> bool {
        let both = self.messages.iter().zip(&WANTED).filter(|(_, wanted)| wanted.1 == By::Both);
        both.filter(|(message, _)| message.has == Has::No).count() >= 3
    }
}

const fn is_sent_by(wanted: &Wanted, autopilot: Autopilot) -> bool {
    matches!(
        (wanted.1, autopilot),
        (By::Both, _) | (By::Px4, Autopilot::Px4) | (By::ArduPilot, Autopilot::ArduPilot)
    )
}

/// By how much all intervals are stretched so that the line carries them.
fn stretch(known: &Known) -> u32 {
    let sent = WANTED.iter().filter(|wanted| is_sent_by(wanted, known.autopilot));
    let bytes_per_s: u32 = sent.map(|wanted| u32::from(wanted.2) * u32::from(wanted.3)).sum();
    let carried = (known.baud / 10 * SHARE / 100).max(1);
    bytes_per_s.div_ceil(carried).max(1)
}

fn packet(what: What, known: &Known) -> Packet {
    let Source { system, component } = known.source;
    match what {
        What::Interval(index) => {
            let (id, _, rate_hz, _) = WANTED[index];
            let interval_us = 1_000_000 / u32::from(rate_hz) * stretch(known);
            messages::command_long(SET_MESSAGE_INTERVAL, &[id as f32, interval_us as f32], system, component)
        }
        What::One(index) => {
            messages::command_long(REQUEST_MESSAGE, &[WANTED[index].0 as f32], system, component)
        }
        What::Identity => {
            messages::command_long(REQUEST_MESSAGE, &[AUTOPILOT_VERSION as f32], system, component)
        }
        What::Parameter(place) => messages::param_request_read(KNOWN[place].1, system, component),
    }
}

#[cfg(test)]
mod tests;
