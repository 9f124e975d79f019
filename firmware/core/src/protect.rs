//! Protective action, off by default: a critical finding asks the autopilot to return or to land, once a flight.
//!
//! | state | input | next |
//! |---|---|---|
//! | idle | in flight, and critical | counting: announced; on its way, if it returns or lands already |
//! | counting | `PROT_DELAY` is over | asking |
//! | counting | measured as no longer critical; the autopilot changes the mode | idle |
//! | asking | accepted; no answer to 3 requests | on its way; done |
//! | asking | refused | asking for a landing, or done |
//! | counting, asking | cancelled by command | done |
//! | counting, asking | the autopilot returns or lands | on its way |
//! | counting, asking | the pilot changes the mode | mode changed, and after 2 s done |
//! | on its way | accepted, and the mode has not changed within 5 s | idle |
//! | on its way | the pilot leaves the mode that returns | mode changed |
//! | on its way | the autopilot leaves it, or there is no sign of landing any more | idle |
//! | mode changed | the autopilot reports a problem | idle |
//! | mode changed, done | the flight is over, and it is armed | done |
//! | any other | the flight is over | idle |
//!
//! Only in flight and armed. While the vehicle is on the ground for a moment, or in a mishap, the countdown and the
//! requests pause. Each step is a record, with the autopilot's answer.
//!
//! A mode change is the autopilot's own in three cases: a new problem appears within `SIGN` of it, failsafes wait in
//! the mode, or a mission ended. Any other mode change is the pilot's, and cancels the action for the flight.
//!
//! If a return is refused (no position), a landing follows on multicopters, helicopters, and a VTOL that reports a
//! hover. A vehicle that returns or lands already gets no request, once a sign of that has lasted 2 s; until then the
//! action waits. The signs are its mode, its landed state, and a sink close above the ground. `ArduPlane` and PX4
//! show a mission's landing by none of these: a mission that sinks in the last `APPROACH_M` is one (`approaches`).
//! The control structure and its hazards are in docs/safety.md.

use crate::flight::Phase;
use crate::health::{Health, Inputs, Level, Subsystem};
use crate::latest::Latest;
use crate::motion;
use crate::observation::{
    Autopilot, CommandAck, Feeds, LandedState, OUR_COMPONENT, Source, VehicleKind, VtolState,
};
use crate::parameters::Param;
use crate::time::{BootMs, Millis, PAUSE, SILENT, Stamp};
use crate::vehicle::{BATTERIES_MAX, Vehicle};

const AGAIN: Millis = Millis::from_secs(1);
/// Requests at most.
const ATTEMPTS_MAX: u8 = 3;
/// How long `MAV_RESULT_IN_PROGRESS` is waited for.
const PROGRESS: Millis = Millis::from_secs(10);
/// An accepted request shows in the mode within this time, or nothing came of it.
const HEEDED: Millis = Millis::from_secs(5);
/// A mission's last item is reached this long before the autopilot leaves the mission by itself.
const MISSION_ENDS: Millis = Millis::from_secs(3);
/// A mission that sinks faster than this, within this height of home, may be landing.
const APPROACH_MPS: f32 = 0.5;
const APPROACH_M: f32 = 40.0;
/// Time after the last sign of landing in which a vehicle still lands: it may flare.
const LANDING_LASTS: Millis = Millis::from_secs(15);
/// A mode change is the autopilot's own if a sign of that comes within this time, before or after.
const SIGN: Millis = Millis::from_secs(2);

numbered! {
    /// A requested action. The numbers are those of `PROT_ACTION`, and are stored.
    #[derive(Default)]
    pub enum Action {
        /// `MAV_CMD_NAV_RETURN_TO_LAUNCH`
        #[default]
        Return = 1 "return",
        /// `MAV_CMD_NAV_LAND`
        Land "land",
    }
}

impl Action {
    /// `MAV_CMD`
    pub const fn command(self) -> u16 {
        match self {
            Self::Return => 20,
            Self::Land => 21,
        }
    }
}

numbered! {
    /// A stage of a protective action. The numbers are stored.
    pub enum Stage {
        /// The action follows in `detail` seconds.
        Announced = 1 "announced",
        /// `detail` seconds are left.
        Counting "counting",
        /// The pilot changed the flight mode.
        CancelledByMode "cancelled_by_mode",
        /// The flight is over: it was disarmed, landed, or lies where it came down.
        CancelledOnGround "cancelled_on_ground",
        /// The cancel command was received.
        CancelledByCommand "cancelled_by_command",
        /// The critical level is over; it may be announced again.
        CancelledClear "cancelled_clear",
        /// The autopilot is on its way already.
        AlreadyDone "already_done",
        /// The action was requested, for the `detail`-th time.
        Asked "asked",
        /// The autopilot answered: `detail` is the `MAV_RESULT`.
        Answered "answered",
        /// The autopilot did not answer.
        Unanswered "unanswered",
    }
}

/// A step of the protective action: for the record, and for the pilot if it has a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// The action.
    pub action: Action,
    /// What happened.
    pub stage: Stage,
    /// Seconds, attempt or `MAV_RESULT`, as the stage says.
    pub detail: u8,
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
        left_ms: u32,
        told_s: u8,
    },
    Asking {
        /// Requests so far; 0: a return was refused, and a landing is asked for next.
        attempt: u8,
        at: BootMs,
        /// The autopilot is working on it; its result is to come.
        progress: bool,
    },
    OnItsWay(Way, BootMs),
    /// The pilot cancelled by the mode, unless a sign comes that it was the autopilot.
    ModeChanged,
    /// Nothing more in this flight.
    Done,
}

/// The sign that the autopilot returns or lands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Accepted,
    Mode,
    Landing,
}

/// The first of these that holds moves the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Input {
    FlightOver,
    /// `MAV_RESULT`
    Answer(u8),
    Command,
    Way(Way),
    ModeByPilot,
    ModeByAutopilot,
    /// In the air, and in no mishap.
    Flies,
    /// On the ground for a moment, in a mishap, or with a sign of landing that has to last yet.
    Waits,
}

type Move = (State, Option<(Stage, u8)>);

/// The protective action's memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Protect {
    state: State,
    action: Action,
    request: Option<Request>,
    cancelled: bool,
    /// The autopilot's own mode number, and when it changed last.
    mode: Option<u32>,
    changed_at: Stamp,
    stepped_at: Stamp,
    /// Since when the vehicle has shown a sign of landing, and when it showed one last that lasted.
    lands_since: Stamp,
    landing_at: Stamp,
    /// The number of the critical check that is the reason.
    reason: Option<u16>,
}

impl Protect {
    pub(crate) const fn take_request(&mut self) -> Option<Request> {
        self.request.take()
    }

    pub(crate) const fn cancel(&mut self) -> bool {
        self.cancelled = matches!(self.state, State::Counting { .. } | State::Asking { .. });
        self.cancelled
    }

    pub(crate) fn step(&mut self, inputs: &Inputs<'_>, health: &Health) -> Option<Step> {
        use Input::{Answer, Command, Flies, FlightOver, ModeByAutopilot, ModeByPilot, Waits};
        use State::{Asking, Counting, Done, Idle, ModeChanged, OnItsWay};
        let Inputs { now, vehicle, .. } = *inputs;
        let step_ms = self.stepped_at.age(now).map_or(0, Millis::as_millis) as u32;
        self.stepped_at = Stamp::at(now);
        let (next, told) = match (self.state, self.input(inputs)) {
            (Counting { .. } | Asking { .. }, FlightOver) => (Idle, Some((Stage::CancelledOnGround, 0))),
            (Asking { attempt, .. }, Answer(result)) => self.hear(inputs, attempt, result),
            (Counting { .. } | Asking { .. }, Command) => (Done, Some((Stage::CancelledByCommand, 0))),
            (Counting { .. } | Asking { .. }, Input::Way(way)) => {
                (OnItsWay(way, now), Some((Stage::AlreadyDone, 0)))
            }
            (Counting { .. } | Asking { .. } | OnItsWay(Way::Mode, _), ModeByPilot) => {
                (ModeChanged, Some((Stage::CancelledByMode, 0)))
            }
            (OnItsWay(..), Input::Way(way)) => (OnItsWay(way, now), None),
            // A flight that ended in a silence may go on. The pilot's cancel holds until disarming.
            (ModeChanged | Done, FlightOver) if vehicle.armed() => (Done, None),
            (OnItsWay(Way::Accepted, at), Flies)
                if now.since(at) > HEEDED && !self.has_changed_since(now, vehicle, at) =>
            {
                (Idle, None)
            }
            (_, FlightOver)
            | (Counting { .. }, ModeByAutopilot)
            | (OnItsWay(Way::Mode | Way::Landing, _), _) => (Idle, None),
            (ModeChanged, _) if self.changed_at.older_than(now, SIGN) => (Done, None),
            (ModeChanged, _) if vehicle.alerts.have_begun_within(now, SIGN) => (Idle, None),
            (Counting { left_ms, .. }, Waits) => (Counting { left_ms, told_s: u8::MAX }, None),
            (Idle, input) if flies(inputs) => self.start(inputs, health, input),
            (Counting { left_ms, told_s }, Flies) => {
                self.count(inputs, health, left_ms.saturating_sub(step_ms), told_s)
            }
            (Asking { attempt, at, progress }, Flies) => self.insist(now, attempt, at, progress),
            (state, _) => (state, None),
        };
        self.state = next;
        told.map(|(stage, detail)| Step { action: self.action, stage, detail })
    }

    fn input(&mut self, inputs: &Inputs<'_>) -> Input {
        let Inputs { now, vehicle, flight, .. } = *inputs;
        let cancelled = core::mem::take(&mut self.cancelled);
        let changed = self.note_mode(now, vehicle);
        let lands_now = is_landing(inputs);
        // One message proves nothing, nor do the pauses of a stream at 1 Hz.
        if self.lands_since.run(lands_now, now, PAUSE) {
            self.landing_at = Stamp::at(now);
        }
        if !flight.is_open() {
            self.landing_at = Stamp::NONE;
            return Input::FlightOver;
        }
        if let Some(result) = self.answer(vehicle) {
            return Input::Answer(result);
        }
        if cancelled {
            return Input::Command;
        }
        let returns =
            modes(vehicle).zip(self.mode).is_some_and(|(modes, mode)| modes.returns.contains(&mode));
        if returns {
            return Input::Way(Way::Mode);
        }
        let lands = self.landing_at.age(now).is_some_and(|age| age < LANDING_LASTS);
        changed.unwrap_or(match (lands, flies(inputs) && !lands_now) {
            (true, _) => Input::Way(Way::Landing),
            (false, true) => Input::Flies,
            (false, false) => Input::Waits,
        })
    }

    fn note_mode(&mut self, now: BootMs, vehicle: &Vehicle) -> Option<Input> {
        let after = vehicle.heartbeat.get()?.mode;
        let before = self.mode.replace(after).filter(|before| *before != after)?;
        (self.changed_at, self.landing_at) = (Stamp::at(now), Stamp::NONE);
        let by_itself =
            vehicle.alerts.have_begun_within(now, SIGN) || is_own_change(now, vehicle, before, after);
        Some(if by_itself { Input::ModeByAutopilot } else { Input::ModeByPilot })
    }

    fn has_changed_since(&self, now: BootMs, vehicle: &Vehicle, at: BootMs) -> bool {
        modes(vehicle).is_none() || self.changed_at.age(now).is_some_and(|age| age <= now.since(at))
    }

    fn answer(&self, vehicle: &Vehicle) -> Option<u8> {
        let State::Asking { attempt, at, .. } = self.state else { return None };
        vehicle.command_ack.at().filter(|answered_at| attempt > 0 && !at.is_after(*answered_at))?;
        let ack = vehicle.command_ack.get().filter(|ack| is_ours(ack, vehicle, self.action))?;
        Some(ack.result)
            .filter(|result| *result != CommandAck::TEMPORARILY_REJECTED || attempt == ATTEMPTS_MAX)
    }

    fn start(&mut self, inputs: &Inputs<'_>, health: &Health, input: Input) -> Move {
        let Inputs { now, params, .. } = *inputs;
        let action = Action::from_number(params.get(Param::ProtAction) as u8);
        let Some(action) = action.filter(|_| self.mode.is_some()) else { return (State::Idle, None) };
        self.reason = reason(inputs, health, None);
        if self.reason.is_none() {
            return (State::Idle, None);
        }
        self.action = action;
        if let Input::Way(way) = input {
            return (State::OnItsWay(way, now), Some((Stage::AlreadyDone, 0)));
        }
        let delay_s = params.get(Param::ProtDelay).clamp(0.0, 250.0) as u8;
        let left_ms = u32::from(delay_s) * 1_000;
        (State::Counting { left_ms, told_s: delay_s }, Some((Stage::Announced, delay_s)))
    }

    fn count(&mut self, inputs: &Inputs<'_>, health: &Health, left_ms: u32, told_s: u8) -> Move {
        self.reason = reason(inputs, health, self.reason);
        if self.reason.is_none() {
            return (State::Idle, Some((Stage::CancelledClear, 0)));
        }
        if left_ms == 0 {
            return self.ask(inputs.now, 1);
        }
        let left_s = left_ms.div_ceil(1_000).min(255) as u8;
        let tells = left_s < told_s && (left_s.is_multiple_of(5) || left_s <= 3);
        let told_s = if tells { left_s } else { told_s };
        (State::Counting { left_ms, told_s }, tells.then_some((Stage::Counting, left_s)))
    }

    fn ask(&mut self, now: BootMs, attempt: u8) -> Move {
        self.request = Some(Request { command: self.action.command(), confirmation: attempt - 1 });
        (State::Asking { attempt, at: now, progress: false }, Some((Stage::Asked, attempt)))
    }

    fn hear(&self, inputs: &Inputs<'_>, attempt: u8, result: u8) -> Move {
        let at = inputs.now;
        let next = match result {
            // What follows is waited for from here on.
            CommandAck::IN_PROGRESS => return (State::Asking { attempt, at, progress: true }, None),
            CommandAck::ACCEPTED => State::OnItsWay(Way::Accepted, at),
            _ if self.action == Action::Return && hovers(inputs) => {
                State::Asking { attempt: 0, at, progress: false }
            }
            _ => State::Done,
        };
        (next, Some((Stage::Answered, result)))
    }

    fn insist(&mut self, now: BootMs, attempt: u8, at: BootMs, progress: bool) -> Move {
        if attempt == 0 {
            self.action = Action::Land;
        } else if now.since(at) < if progress { PROGRESS } else { AGAIN } {
            return (self.state, None);
        }
        if attempt < ATTEMPTS_MAX {
            return self.ask(now, attempt + 1);
        }
        (State::Done, Some((Stage::Unanswered, attempt)))
    }
}

fn flies(inputs: &Inputs<'_>) -> bool {
    let Inputs { vehicle, flight, .. } = inputs;
    let in_air = flight.airborne() && !flight.in_mishap();
    in_air && vehicle.armed() && vehicle.kind() != VehicleKind::Surface
}

/// A VTOL has to report a hover: a headwind can stop it over the ground.
fn hovers(inputs: &Inputs<'_>) -> bool {
    let Inputs { now, vehicle, .. } = *inputs;
    vehicle.hovers(now) == Some(true)
        && (vehicle.kind() != VehicleKind::Vtol || vehicle.vtol == VtolState::Hover)
}

/// A mission to a lower place looks like its landing, and is waited for too.
fn approaches(inputs: &Inputs<'_>) -> bool {
    let Inputs { now, vehicle, .. } = *inputs;
    let mode = vehicle.heartbeat.get().map(|heartbeat| heartbeat.mode);
    modes(vehicle).is_some_and(|modes| Some(modes.mission) == mode && !modes.tells_landing)
        && motion::climb_mps(now, vehicle).is_some_and(|climb_mps| climb_mps < -APPROACH_MPS)
        && motion::height_m(now, vehicle).is_some_and(|height_m| height_m.abs() < APPROACH_M)
}

fn is_ours(ack: &CommandAck, vehicle: &Vehicle, action: Action) -> bool {
    let system = vehicle.source.map_or(0, |source| source.system);
    let us = Source { system, component: OUR_COMPONENT };
    ack.command == action.command() && ack.target.is_none_or(|target| target == us)
}

/// The critical check, of those that `PROT_CHECK` selects: 0 an empty battery (by its remaining charge or its cells), from 1 on
/// any check of a subsystem. A check that becomes stale stays the reason. Batteries of avionics, of a payload or of an unknown
/// consumer do not count.
fn reason(inputs: &Inputs<'_>, health: &Health, before: Option<u16>) -> Option<u16> {
    let Inputs { vehicle, params, .. } = *inputs;
    let chosen = params.get(Param::ProtCheck) as u8;
    let reasons = health.numbered_levels().filter_map(|(number, check, instance, level)| {
        let concerned = match chosen.checked_sub(1) {
            None => matches!(check.name, "batt_remaining" | "cell_voltage" | "batt_state"),
            Some(subsystem) => Subsystem::from_number(subsystem) == Some(check.subsystem),
        };
        let battery = vehicle.batteries.get(usize::from(instance)).and_then(Latest::get);
        let other = check.subsystem == Subsystem::Power
            && check.instances as usize == BATTERIES_MAX
            && battery.is_some_and(|battery| battery.feeds != Feeds::Vehicle);
        (concerned && !other).then_some((number, level))
    });
    let critical = reasons.clone().find(|(_, level)| *level == Level::Critical);
    let silent = || reasons.clone().find(|(number, level)| *level == Level::Stale && before == Some(*number));
    critical.or_else(silent).map(|(number, _)| number)
}

struct Modes {
    returns: &'static [u32],
    /// Failsafes wait in it: a pilot's choice of it cancels nothing.
    waits: u32,
    mission: u32,
    after_mission: &'static [u32],
    tells_landing: bool,
}

/// Main mode AUTO (4) with the sub modes RTL (5), LAND (6), PRECLAND (9); HOLD, which is LOITER (3), also after a mission; MISSION (4).
const PX4: Modes = Modes {
    returns: &[0x0504_0000, 0x0604_0000, 0x0904_0000],
    waits: 0x0304_0000,
    mission: 0x0404_0000,
    after_mission: &[],
    tells_landing: false,
};
/// RTL, QLAND, QRTL, `LOITER_ALT_QLAND`, AUTOLAND; CIRCLE; AUTO; LOITER. A mission's end in RTL is a return.
const PLANE: Modes = Modes {
    returns: &[11, 20, 21, 25, 26],
    waits: 1,
    mission: 10,
    after_mission: &[12],
    tells_landing: false,
};
/// RTL, LAND, `SMART_RTL`, `AUTO_RTL`; BRAKE; AUTO; LOITER, BRAKE.
const COPTER: Modes =
    Modes { returns: &[6, 9, 21, 27], waits: 17, mission: 3, after_mission: &[5, 17], tells_landing: true };

fn modes(vehicle: &Vehicle) -> Option<&'static Modes> {
    let heartbeat = vehicle.heartbeat.get()?;
    match (heartbeat.autopilot, heartbeat.kind) {
        (Autopilot::Px4, _) => Some(&PX4),
        (Autopilot::ArduPilot, VehicleKind::Plane | VehicleKind::Vtol) => Some(&PLANE),
        (Autopilot::ArduPilot, _) => Some(&COPTER),
        (Autopilot::Other, _) => None,
    }
}

/// Reasons of its own: a failsafe may wait in the mode, or a mission was flown to its end.
fn is_own_change(now: BootMs, vehicle: &Vehicle, before: u32, after: u32) -> bool {
    modes(vehicle).is_some_and(|modes| {
        let is_end = before == modes.mission && modes.after_mission.contains(&after);
        after == modes.waits || (is_end && vehicle.mission_reached.within(now, MISSION_ENDS).is_some())
    })
}

fn is_landing(inputs: &Inputs<'_>) -> bool {
    let Inputs { now, vehicle, flight, .. } = *inputs;
    vehicle.landed.within(now, SILENT) == Some(&LandedState::Landing)
        || flight.phase(now, vehicle) == Phase::Landing
        || approaches(inputs)
}
