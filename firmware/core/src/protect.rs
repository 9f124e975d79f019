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
//! disarming, or by a command, and one cancel holds for the flight. Each step is a record, with the autopilot's answer.
//!
//! A return that is refused (no position) is followed by a landing, where the vehicle can land as it hangs: multicopters,
//! helicopters, and a VTOL that says that it hovers. Nothing is asked of a vehicle that returns or lands already, by its mode, by its
//! landed state or because it sinks close above the ground. `ArduPlane` and PX4 tell a mission's landing by none of these:
//! while the mission sinks in the last `APPROACH_M` it is waited (`approaches`). The control structure and what could go wrong with it are in docs/safety.md.

use core::fmt::Write as _;

use heapless::String;

use crate::flight::{Flight, FlightEvent, Phase};
use crate::health::{Health, Level, Subsystem};
use crate::latest::Latest;
use crate::motion;
use crate::observation::{
    Autopilot, CommandAck, Feeds, LandedState, OUR_COMPONENT, Source, VehicleKind, VtolState,
};
use crate::params::{Param, Params};
use crate::time::{Instant, Span};
use crate::vehicle::{BATTERIES_MAX, LANDED_STATE_AGE, Vehicle};

/// Bytes of a text that a ground station shows to the pilot as it comes: those of one `STATUSTEXT`.
pub const TEXT_BYTES_MAX: usize = 50;

/// Between two requests that are not answered.
const AGAIN: Span = Span::from_secs(1);
/// Requests at most.
const ATTEMPTS_MAX: u8 = 3;
/// How long `MAV_RESULT_IN_PROGRESS` is waited for.
const PROGRESS: Span = Span::from_secs(10);
/// A mission's last item is reached this long before the autopilot leaves the mission by itself.
const MISSION_ENDS: Span = Span::from_secs(3);
/// A mission that sinks faster than this below this height, or did so of late (it flares), may be landing.
const APPROACH_MPS: f32 = 0.5;
const APPROACH_M: f32 = 40.0;
const APPROACH_LASTS: Span = Span::from_secs(15);
/// `MAV_RESULT_ACCEPTED`
const ACCEPTED: u8 = 0;
/// `MAV_RESULT_TEMPORARILY_REJECTED`: asked again.
const TEMPORARILY_REJECTED: u8 = 1;
/// `MAV_RESULT_IN_PROGRESS`: the answer is to come.
const IN_PROGRESS: u8 = 5;

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
        /// It was understood; the answer is to come.
        progress: bool,
    },
    /// A return was refused: a landing is asked for next.
    Refused,
    /// Nothing more in this flight.
    Done,
}

/// The protective action's memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Protect {
    state: State,
    request: Option<Request>,
    cancelled: bool,
    /// When it came down as a mission's landing does.
    approached_at: Option<Instant>,
}

/// What a step looks at.
#[derive(Clone, Copy)]
pub(crate) struct Situation<'a> {
    pub(crate) now: Instant,
    pub(crate) vehicle: &'a Vehicle,
    pub(crate) flight: &'a Flight,
    /// It falls, tumbles or lies: no command helps.
    pub(crate) mishap: bool,
    pub(crate) health: &'a Health,
    pub(crate) params: &'a Params,
}

impl Situation<'_> {
    fn flies(&self) -> bool {
        self.flight.airborne()
            && !self.mishap
            && self.vehicle.armed()
            && self.vehicle.kind() != VehicleKind::Surface
    }
}

impl Protect {
    /// Nothing to do.
    pub const fn new() -> Self {
        Self { state: State::Idle, request: None, cancelled: false, approached_at: None }
    }

    /// What is to be sent to the autopilot now, once.
    pub(crate) const fn take_request(&mut self) -> Option<Request> {
        self.request.take()
    }

    /// Somebody sent the command to cancel; `true` where there is something to cancel.
    pub(crate) const fn cancel(&mut self) -> bool {
        self.cancelled = matches!(self.state, State::Counting { .. } | State::Asking { .. } | State::Refused);
        self.cancelled
    }

    /// One step, after the checks'.
    pub(crate) fn step(&mut self, situation: &Situation<'_>, event: Option<FlightEvent>) -> Option<Step> {
        let Situation { now, health, params, vehicle, .. } = *situation;
        if event.is_some_and(|event| event != FlightEvent::Landing) && self.state == State::Done {
            self.state = State::Idle;
        }
        let cancelled = core::mem::take(&mut self.cancelled);
        if approaches(situation) {
            self.approached_at = Some(now);
        }
        let lands =
            in_mission(vehicle) && self.approached_at.is_some_and(|at| now.since(at) < APPROACH_LASTS);
        match self.state {
            State::Done => None,
            State::Idle => {
                let action = Action::from_number(params.get(Param::ProtAction) as u8)?;
                let starts = !lands && situation.flies() && concerned(vehicle, health, params);
                starts.then(|| self.announce(situation, action)).flatten()
            }
            State::Counting { action, until, mode, told_s } => {
                if let Some(stage) = Self::ends(situation, cancelled) {
                    return Some(self.done(action, stage));
                }
                let mode_now = vehicle.heartbeat.get().map_or(mode, |heartbeat| heartbeat.mode);
                if mode_now != mode && !mission_ended(now, vehicle, mode, mode_now) {
                    return Some(self.done(action, Stage::CancelledByMode));
                }
                if lands {
                    // Should it fly on, it is announced anew.
                    self.state = State::Idle;
                    return Some(Step { action, stage: Stage::AlreadyDone, detail: 0 });
                }
                if !concerned(vehicle, health, params) {
                    self.state = State::Idle;
                    return Some(Step { action, stage: Stage::CancelledClear, detail: 0 });
                }
                if now >= until {
                    return Some(self.ask(now, action, 1));
                }
                let left_s = until.since(now).as_millis().div_ceil(1_000).min(255) as u8;
                let tells = left_s < told_s && (left_s.is_multiple_of(5) || left_s <= 3);
                let told_s = if tells { left_s } else { told_s };
                self.state = State::Counting { action, until, mode: mode_now, told_s };
                tells.then_some(Step { action, stage: Stage::Counting, detail: left_s })
            }
            State::Asking { action, attempt, at, .. } => self
                .hear(situation, action, attempt, at)
                .or_else(|| Self::ends(situation, cancelled).map(|stage| self.done(action, stage)))
                .or_else(
                    || if lands { Some(self.done(action, Stage::AlreadyDone)) } else { self.insist(now) },
                ),
            State::Refused => match Self::ends(situation, cancelled) {
                Some(stage) => Some(self.done(Action::Land, stage)),
                None => Some(self.ask(now, Action::Land, 1)),
            },
        }
    }

    /// What ends it before the autopilot has answered.
    fn ends(situation: &Situation<'_>, cancelled: bool) -> Option<Stage> {
        if !situation.flies() {
            Some(Stage::CancelledOnGround)
        } else if cancelled {
            Some(Stage::CancelledByCommand)
        } else if on_its_way(situation) {
            Some(Stage::AlreadyDone)
        } else {
            None
        }
    }

    fn done(&mut self, action: Action, stage: Stage) -> Step {
        self.state = State::Done;
        Step { action, stage, detail: 0 }
    }

    fn announce(&mut self, situation: &Situation<'_>, action: Action) -> Option<Step> {
        let Situation { now, vehicle, params, .. } = *situation;
        if on_its_way(situation) {
            return Some(self.done(action, Stage::AlreadyDone));
        }
        let mode = vehicle.heartbeat.get()?.mode;
        let delay_s = params.get(Param::ProtDelay).clamp(0.0, 250.0) as u8;
        let until = now + Span::from_secs(u64::from(delay_s));
        self.state = State::Counting { action, until, mode, told_s: delay_s };
        Some(Step { action, stage: Stage::Announced, detail: delay_s })
    }

    fn ask(&mut self, now: Instant, action: Action, attempt: u8) -> Step {
        self.state = State::Asking { action, attempt, at: now, progress: false };
        self.request = Some(Request { command: action.command(), confirmation: attempt - 1 });
        Step { action, stage: Stage::Asked, detail: attempt }
    }

    /// The autopilot's answer, once it has come.
    fn hear(&mut self, situation: &Situation<'_>, action: Action, attempt: u8, at: Instant) -> Option<Step> {
        let Situation { vehicle, .. } = *situation;
        let answered_at = vehicle.command_ack.at().filter(|answered_at| *answered_at >= at)?;
        let ack = vehicle.command_ack.get().filter(|ack| is_ours(ack, vehicle, action))?;
        match ack.result {
            TEMPORARILY_REJECTED if attempt < ATTEMPTS_MAX => return None,
            IN_PROGRESS => {
                // What follows is waited for from here on.
                self.state = State::Asking { action, attempt, at: answered_at, progress: true };
                return None;
            }
            ACCEPTED => self.state = State::Done,
            _ => {
                let lands = action == Action::Return && hovers(situation);
                self.state = if lands { State::Refused } else { State::Done };
            }
        }
        Some(Step { action, stage: Stage::Answered, detail: ack.result })
    }

    /// Asks again where there is no answer.
    fn insist(&mut self, now: Instant) -> Option<Step> {
        let State::Asking { action, attempt, at, progress } = self.state else { return None };
        if now.since(at) < if progress { PROGRESS } else { AGAIN } {
            return None;
        }
        if attempt < ATTEMPTS_MAX {
            return Some(self.ask(now, action, attempt + 1));
        }
        self.state = State::Done;
        Some(Step { action, stage: Stage::Unanswered, detail: attempt })
    }
}

/// Whether it can come down where it is. A VTOL has to say that it hovers: a wind that stops it over the ground is no hover.
fn hovers(situation: &Situation<'_>) -> bool {
    let Situation { now, vehicle, .. } = *situation;
    vehicle.hovers(now) == Some(true)
        && (vehicle.kind() != VehicleKind::Vtol || vehicle.vtol == VtolState::Hover)
}

/// Whether it flies a mission whose landing the autopilot tells by no mode and no landed state. `ArduCopter` does tell it.
fn in_mission(vehicle: &Vehicle) -> bool {
    vehicle.heartbeat.get().is_some_and(|heartbeat| match (heartbeat.autopilot, vehicle.kind()) {
        (Autopilot::Px4, _) => (heartbeat.mode >> 16) as u16 == 0x0404,
        (Autopilot::ArduPilot, VehicleKind::Plane | VehicleKind::Vtol) => heartbeat.mode == 10,
        _ => false,
    })
}

/// Whether it comes down as a mission's landing does. A mission that goes to a lower place looks the same, and is waited for too.
fn approaches(situation: &Situation<'_>) -> bool {
    let Situation { now, vehicle, .. } = *situation;
    in_mission(vehicle)
        && motion::climb_mps(now, vehicle).is_some_and(|climb_mps| climb_mps < -APPROACH_MPS)
        && motion::height_m(now, vehicle).is_some_and(|height_m| height_m < APPROACH_M)
}

/// An answer to our command, and not to what somebody else asked.
fn is_ours(ack: &CommandAck, vehicle: &Vehicle, action: Action) -> bool {
    let system = vehicle.source.map_or(0, |source| source.system);
    let us = Source { system, component: OUR_COMPONENT };
    ack.command == action.command() && ack.target.is_none_or(|target| target == us)
}

/// Whether a check that `PROT_CHECK` names is critical: 0 an empty battery (by what remains or by its cells), from 1 on
/// any check of a subsystem. A battery that feeds the avionics or the payload alone, or nobody knows what, is no reason to come
/// down.
fn concerned(vehicle: &Vehicle, health: &Health, params: &Params) -> bool {
    let chosen = params.get(Param::ProtCheck) as u8;
    health.levels().any(|(check, instance, level)| {
        let concerned = match chosen.checked_sub(1) {
            None => matches!(check.name, "batt_remaining" | "cell_voltage" | "batt_state"),
            Some(subsystem) => Subsystem::from_number(subsystem) == Some(check.subsystem),
        };
        let battery = vehicle.batteries.get(usize::from(instance)).and_then(Latest::get);
        let other = check.subsystem == Subsystem::Power
            && check.instances as usize == BATTERIES_MAX
            && battery.is_some_and(|battery| battery.feeds != Feeds::Vehicle);
        concerned && level == Level::Critical && !other
    })
}

/// Whether the autopilot left a mission by itself because it was flown to its end: then nobody has cancelled anything.
fn mission_ended(now: Instant, vehicle: &Vehicle, before: u32, after: u32) -> bool {
    let Some(heartbeat) = vehicle.heartbeat.get() else { return false };
    let left = match (heartbeat.autopilot, heartbeat.kind) {
        // PX4: AUTO (4) from MISSION (4) to LOITER (3).
        (Autopilot::Px4, _) => {
            let main_and_sub = |mode: u32| (mode >> 16) as u16;
            (main_and_sub(before), main_and_sub(after)) == (0x0404, 0x0304)
        }
        // ArduPlane: from AUTO to LOITER. A mission's end in RTL is a return.
        (Autopilot::ArduPilot, VehicleKind::Plane | VehicleKind::Vtol) => (before, after) == (10, 12),
        // ArduCopter: from AUTO to LOITER or BRAKE.
        (Autopilot::ArduPilot, _) => before == 3 && matches!(after, 5 | 17),
        (Autopilot::Other, _) => false,
    };
    left && vehicle.mission_reached.within(now, MISSION_ENDS).is_some()
}

/// Whether the autopilot returns or lands already: by its own mode number, by its landed state, or because it sinks close
/// above the ground.
fn on_its_way(situation: &Situation<'_>) -> bool {
    let Situation { now, vehicle, flight, .. } = *situation;
    let Some(heartbeat) = vehicle.heartbeat.get() else { return false };
    let lands = vehicle.landed.within(now, LANDED_STATE_AGE) == Some(&LandedState::Landing)
        || flight.phase(now, vehicle) == Phase::Landing;
    lands
        || match (heartbeat.autopilot, heartbeat.kind) {
            // PX4: main mode AUTO (4), sub modes RTL (5), LAND (6), PRECLAND (9).
            (Autopilot::Px4, _) => {
                let [_, _, main, sub] = heartbeat.mode.to_le_bytes();
                main == 4 && matches!(sub, 5 | 6 | 9)
            }
            // ArduPlane: RTL, QLAND, QRTL, LOITER_ALT_QLAND, AUTOLAND.
            (Autopilot::ArduPilot, VehicleKind::Plane | VehicleKind::Vtol) => {
                matches!(heartbeat.mode, 11 | 20 | 21 | 25 | 26)
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
