//! Protective action, off by default: a critical finding asks the autopilot to return or to land, once a flight.
//!
//! ```text
//!        critical, in flight          PROT_DELAY over              COMMAND_ACK
//! Idle ----------------------> Counting -------------> Asking ------------------> Done
//!   ^  <-----------------------  |                       \--- 3 times unanswered --> Done
//!   |     clear again            \-- mode changed, disarmed, cancelled, already on its way: Done
//!   \--- landed: the next flight ---------------------------------------------------/
//! ```
//! Only in flight and armed. It is announced with a countdown; the pilot cancels it by changing the flight mode, by
//! disarming, or by a command. Each step is a record, with the autopilot's answer.

use core::fmt::Write as _;

use heapless::String;

use crate::flight::FlightEvent;
use crate::health::{Health, Level, Subsystem};
use crate::observation::{Autopilot, CommandAck, VehicleKind};
use crate::params::{Param, Params};
use crate::time::{Instant, Span};
use crate::vehicle::Vehicle;

/// Bytes of a text that a ground station shows to the pilot as it comes: those of one `STATUSTEXT`.
pub const TEXT_BYTES_MAX: usize = 50;

/// Between two requests that are not answered.
const AGAIN: Span = Span::from_secs(1);
/// Requests at most.
const ATTEMPTS_MAX: u8 = 3;
/// `MAV_RESULT_IN_PROGRESS` and lower: accepted, or refused for good; both are answers.
const RESULT_TEMPORARILY_REJECTED: u8 = 1;

/// What is asked for. The numbers are those of `PROT_ACTION`, and are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Action {
    /// `MAV_CMD_NAV_RETURN_TO_LAUNCH`
    Return = 1,
    /// `MAV_CMD_NAV_LAND`
    Land = 2,
}

impl Action {
    /// The action of `PROT_ACTION`.
    pub fn from_number(number: u8) -> Option<Self> {
        match number {
            1 => Some(Self::Return),
            2 => Some(Self::Land),
            _ => None,
        }
    }

    /// `MAV_CMD`
    pub const fn command(self) -> u16 {
        match self {
            Self::Return => 20,
            Self::Land => 21,
        }
    }

    /// The name that reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Return => "return",
            Self::Land => "land",
        }
    }
}

/// What happened. The numbers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Stage {
    /// It will be asked for in `detail` seconds.
    Announced = 1,
    /// `detail` seconds are left.
    Counting = 2,
    /// The pilot changed the flight mode.
    CancelledByMode = 3,
    /// It was disarmed or landed.
    CancelledOnGround = 4,
    /// Somebody sent the command to cancel.
    CancelledByCommand = 5,
    /// What was critical no longer is; it may be announced again.
    CancelledClear = 6,
    /// The autopilot is on its way already.
    AlreadyDone = 7,
    /// It was asked for, the `detail`-th time.
    Asked = 8,
    /// The autopilot answered: `detail` is the `MAV_RESULT`.
    Answered = 9,
    /// The autopilot did not answer.
    Unanswered = 10,
}

impl Stage {
    /// All stages, by number.
    pub const ALL: [Self; 10] = [
        Self::Announced,
        Self::Counting,
        Self::CancelledByMode,
        Self::CancelledOnGround,
        Self::CancelledByCommand,
        Self::CancelledClear,
        Self::AlreadyDone,
        Self::Asked,
        Self::Answered,
        Self::Unanswered,
    ];

    /// The stage of a stored number.
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|stage| *stage as u8 == number)
    }

    /// The name that reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Announced => "announced",
            Self::Counting => "counting",
            Self::CancelledByMode => "cancelled_by_mode",
            Self::CancelledOnGround => "cancelled_on_ground",
            Self::CancelledByCommand => "cancelled_by_command",
            Self::CancelledClear => "cancelled_clear",
            Self::AlreadyDone => "already_done",
            Self::Asked => "asked",
            Self::Answered => "answered",
            Self::Unanswered => "unanswered",
        }
    }
}

/// A step of the protective action: to be recorded, and told where it has a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// What it is about.
    pub action: Action,
    /// What happened.
    pub stage: Stage,
    /// Seconds, attempt or `MAV_RESULT`, as the stage says.
    pub detail: u8,
}

impl Step {
    /// What the pilot is told, with its `MAV_SEVERITY`.
    pub fn text(&self) -> (u8, String<TEXT_BYTES_MAX>) {
        let name = self.action.name();
        let mut text = String::new();
        // Cut where it does not fit, which a test rules out.
        let _ = match self.stage {
            Stage::Announced => {
                write!(text, "HUMS: {name} in {} s, change mode to cancel", self.detail)
            }
            Stage::Counting => write!(text, "HUMS: {name} in {} s", self.detail),
            Stage::CancelledByMode => write!(text, "HUMS: {name} cancelled: mode changed"),
            Stage::CancelledOnGround => write!(text, "HUMS: {name} cancelled: on the ground"),
            Stage::CancelledByCommand => write!(text, "HUMS: {name} cancelled by command"),
            Stage::CancelledClear => write!(text, "HUMS: {name} cancelled: ok again"),
            Stage::AlreadyDone => write!(text, "HUMS: {name}: already on its way"),
            Stage::Asked => write!(text, "HUMS: {name} asked for"),
            Stage::Answered if self.detail == 0 => write!(text, "HUMS: {name} accepted"),
            Stage::Answered => write!(text, "HUMS: {name} refused (result {})", self.detail),
            Stage::Unanswered => write!(text, "HUMS: {name}: the autopilot does not answer"),
        };
        let severity = match self.stage {
            Stage::Announced | Stage::Counting | Stage::Asked | Stage::Unanswered => 2,
            Stage::Answered if self.detail != 0 => 2,
            _ => 5,
        };
        (severity, text)
    }
}

/// What to send to the autopilot: a `COMMAND_LONG` to its system and component, all parameters zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// `MAV_CMD`
    pub command: u16,
    /// `confirmation`: 0 the first time, then counted up.
    pub confirmation: u8,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    #[default]
    Idle,
    Counting {
        action: Action,
        until: Instant,
        mode: u32,
        told_s: u8,
    },
    Asking {
        action: Action,
        attempt: u8,
        at: Instant,
    },
    /// Nothing more in this flight.
    Done,
}

/// The protective action's memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Protect {
    state: State,
    request: Option<Request>,
    cancelled: bool,
}

impl Protect {
    /// Nothing to do.
    pub const fn new() -> Self {
        Self { state: State::Idle, request: None, cancelled: false }
    }

    /// What is to be sent to the autopilot now, once.
    pub(crate) const fn take_request(&mut self) -> Option<Request> {
        self.request.take()
    }

    /// Somebody sent the command to cancel; `true` where there is something to cancel.
    pub(crate) const fn cancel(&mut self) -> bool {
        self.cancelled = matches!(self.state, State::Counting { .. } | State::Asking { .. });
        self.cancelled
    }

    /// One step, after the checks'.
    pub(crate) fn step(
        &mut self,
        now: Instant,
        vehicle: &Vehicle,
        airborne: bool,
        event: Option<FlightEvent>,
        health: &Health,
        params: &Params,
    ) -> Option<Step> {
        if event == Some(FlightEvent::TakeOff) && self.state == State::Done {
            self.state = State::Idle;
        }
        let cancelled = core::mem::take(&mut self.cancelled);
        match self.state {
            State::Done => None,
            State::Idle => {
                let action = Action::from_number(params.get(Param::ProtAction) as u8)?;
                let flies = airborne && vehicle.armed();
                let starts = flies && concerned(health, params);
                starts.then(|| self.announce(now, vehicle, action, params)).flatten()
            }
            State::Counting { action, until, mode, told_s } => {
                let end = |stage| Some(Step { action, stage, detail: 0 });
                if !airborne || !vehicle.armed() {
                    self.state = State::Done;
                    return end(Stage::CancelledOnGround);
                }
                if cancelled {
                    self.state = State::Done;
                    return end(Stage::CancelledByCommand);
                }
                if on_its_way(vehicle) {
                    self.state = State::Done;
                    return end(Stage::AlreadyDone);
                }
                if vehicle.heartbeat.get().is_some_and(|heartbeat| heartbeat.mode != mode) {
                    self.state = State::Done;
                    return end(Stage::CancelledByMode);
                }
                if !concerned(health, params) {
                    self.state = State::Idle;
                    return end(Stage::CancelledClear);
                }
                if now >= until {
                    return Some(self.ask(now, action, 1));
                }
                let left_s = until.since(now).as_millis().div_ceil(1_000).min(255) as u8;
                let tells = left_s < told_s && (left_s.is_multiple_of(5) || left_s <= 3);
                if tells {
                    self.state = State::Counting { action, until, mode, told_s: left_s };
                }
                tells.then_some(Step { action, stage: Stage::Counting, detail: left_s })
            }
            State::Asking { action, attempt, at } => {
                self.wait_for_answer(now, vehicle, action, attempt, at, cancelled || !vehicle.armed())
            }
        }
    }

    fn announce(&mut self, now: Instant, vehicle: &Vehicle, action: Action, params: &Params) -> Option<Step> {
        if on_its_way(vehicle) {
            self.state = State::Done;
            return Some(Step { action, stage: Stage::AlreadyDone, detail: 0 });
        }
        let mode = vehicle.heartbeat.get()?.mode;
        let delay_s = params.get(Param::ProtDelay).clamp(0.0, 250.0) as u8;
        let until = now + Span::from_secs(u64::from(delay_s));
        self.state = State::Counting { action, until, mode, told_s: delay_s };
        Some(Step { action, stage: Stage::Announced, detail: delay_s })
    }

    fn ask(&mut self, now: Instant, action: Action, attempt: u8) -> Step {
        self.state = State::Asking { action, attempt, at: now };
        self.request = Some(Request { command: action.command(), confirmation: attempt - 1 });
        Step { action, stage: Stage::Asked, detail: attempt }
    }

    fn wait_for_answer(
        &mut self,
        now: Instant,
        vehicle: &Vehicle,
        action: Action,
        attempt: u8,
        at: Instant,
        cancelled: bool,
    ) -> Option<Step> {
        let mine = |ack: &&CommandAck| ack.command == action.command();
        let answered = vehicle.command_ack.at().is_some_and(|answered| answered >= at);
        let answer = vehicle.command_ack.get().filter(mine).filter(|_| answered);
        if let Some(ack) = answer
            && (ack.result != RESULT_TEMPORARILY_REJECTED || attempt >= ATTEMPTS_MAX)
        {
            self.state = State::Done;
            return Some(Step { action, stage: Stage::Answered, detail: ack.result });
        }
        if cancelled {
            self.state = State::Done;
            return Some(Step { action, stage: Stage::CancelledByCommand, detail: 0 });
        }
        if now.since(at) < AGAIN {
            return None;
        }
        if attempt < ATTEMPTS_MAX {
            return Some(self.ask(now, action, attempt + 1));
        }
        self.state = State::Done;
        Some(Step { action, stage: Stage::Unanswered, detail: attempt })
    }
}

/// Whether a check that `PROT_CHECK` names is critical: 0 an empty battery (by what remains or by its cells), from 1 on
/// any check of a subsystem.
fn concerned(health: &Health, params: &Params) -> bool {
    let chosen = params.get(Param::ProtCheck) as u8;
    health.levels().any(|(check, _, level)| {
        let concerned = match chosen.checked_sub(1) {
            None => matches!(check.name, "batt_remaining" | "cell_voltage"),
            Some(subsystem) => Subsystem::from_number(subsystem) == Some(check.subsystem),
        };
        concerned && level == Level::Critical
    })
}

/// Whether the autopilot returns or lands already, by its own mode number.
fn on_its_way(vehicle: &Vehicle) -> bool {
    let Some(heartbeat) = vehicle.heartbeat.get() else { return false };
    match (heartbeat.autopilot, heartbeat.kind) {
        // PX4: main mode AUTO (4), sub modes RTL (5), LAND (6), PRECLAND (9).
        (Autopilot::Px4, _) => {
            let [_, _, main, sub] = heartbeat.mode.to_le_bytes();
            main == 4 && matches!(sub, 5 | 6 | 9)
        }
        // ArduPlane: RTL, QLAND, QRTL, AUTOLAND.
        (Autopilot::ArduPilot, VehicleKind::Plane | VehicleKind::Vtol) => {
            matches!(heartbeat.mode, 11 | 20 | 21 | 26)
        }
        // ArduCopter: RTL, LAND, SMART_RTL, AUTO_RTL.
        (Autopilot::ArduPilot, _) => matches!(heartbeat.mode, 6 | 9 | 21 | 27),
        (Autopilot::Other, _) => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_text_fits_with_the_largest_number() {
        for action in [Action::Return, Action::Land] {
            for stage in Stage::ALL {
                let (_, text) = Step { action, stage, detail: 255 }.text();
                assert!(text.len() < TEXT_BYTES_MAX, "{text}");
                assert!(!text.ends_with(':'), "{text}");
            }
        }
    }
}
