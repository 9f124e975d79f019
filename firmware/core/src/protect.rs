//! Protective action, off by default: a critical finding asks the autopilot to return or to land, once a flight.
//!
//! | state | what happens | next |
//! |---|---|---|
//! | Idle | in flight, and critical; a return or landing is under way | `OnItsWay` |
//! | | in flight, and critical | Counting, announced |
//! | Counting | `PROT_DELAY` is over | Asking |
//! | | no longer critical | Idle |
//! | Asking | accepted; refused; no answer to 3 requests | `OnItsWay`; Refused or Done; Done |
//! | Refused | | Asking for a landing |
//! | Counting, Asking, Refused | cancelled by command | Done |
//! | | the autopilot returns or lands | `OnItsWay` |
//! | | the pilot changes the mode | `ModeChanged`, Done after 2 s |
//! | Counting, Refused, `ModeChanged` | the autopilot changes the mode | Idle |
//! | `OnItsWay` | the pilot leaves the returning mode | `ModeChanged` |
//! | | the autopilot leaves it, or the vehicle no longer sinks to land | Idle |
//! | any | the flight is over | Idle |
//!
//! Only in flight and armed. While the vehicle is on the ground for a moment, or in a mishap, the countdown and the requests pause.
//! Each step is a record, with the autopilot's answer.
//!
//! A mode change is the autopilot's own if the autopilot reports a new problem within [`SIGN`] of it, if it enters a mode in which
//! failsafes wait, or if a mission ended. Any other mode change is the pilot's, and cancels the action for the flight.
//!
//! A return that is refused (no position) is followed by a landing, where the vehicle can land as it hangs: multicopters,
//! helicopters, and a VTOL that says that it hovers. Nothing is asked of a vehicle that returns or lands already, by its mode, by its
//! landed state or because it sinks close above the ground. `ArduPlane` and PX4 tell a mission's landing by none of these:
//! a mission that sinks in the last `APPROACH_M` is one (`approaches`). The control structure and what could go wrong with it are in
//! docs/safety.md.

use core::fmt::Write as _;

use heapless::String;

use crate::flight::{Flight, Phase};
use crate::health::{Health, Level, Subsystem};
use crate::latest::Latest;
use crate::motion;
use crate::observation::{
    Autopilot, CommandAck, Feeds, LandedState, OUR_COMPONENT, Source, VehicleKind, VtolState,
};
use crate::params::{Param, Params};
use crate::time::{Instant, Span, Stamp};
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
/// A mission that sinks faster than this below this height may be landing.
const APPROACH_MPS: f32 = 0.5;
const APPROACH_M: f32 = 40.0;
/// A vehicle that showed a sign of landing so lately is landing: it may flare.
const LANDING_LASTS: Span = Span::from_secs(15);
/// A mode change is the autopilot's own if a sign of that comes within this time, before or after.
const SIGN: Span = Span::from_secs(2);
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
    /// The flight is over: it was disarmed, landed, or lies where it came down.
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
        left_ms: u32,
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
    /// The autopilot returns or lands.
    OnItsWay {
        action: Action,
        way: Way,
    },
    /// The pilot cancelled by the mode, unless a sign comes that it was the autopilot.
    ModeChanged,
    /// Nothing more in this flight.
    Done,
}

/// By which sign the autopilot returns or lands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// It accepted the request.
    Accepted,
    /// Its mode.
    Mode,
    /// It sinks as in a landing, or calls it one.
    Landing,
}

/// Who changed the flight mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Changed {
    Pilot,
    Autopilot,
}

/// The protective action's memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Protect {
    state: State,
    request: Option<Request>,
    cancelled: bool,
    /// The autopilot's own mode number, and when it changed last.
    mode: Option<u32>,
    changed_at: Stamp,
    stepped_at: Stamp,
    /// When the vehicle showed a sign of landing last.
    landing_at: Stamp,
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
        Self {
            state: State::Idle,
            request: None,
            cancelled: false,
            mode: None,
            changed_at: Stamp::NONE,
            stepped_at: Stamp::NONE,
            landing_at: Stamp::NONE,
        }
    }

    /// What is to be sent to the autopilot now, once.
    pub(crate) const fn take_request(&mut self) -> Option<Request> {
        self.request.take()
    }

    /// Somebody sent the command to cancel; `true` where there is something to cancel.
    pub(crate) const fn cancel(&mut self) -> bool {
        self.cancelled = self.pending().is_some();
        self.cancelled
    }

    /// The action that is counted down or requested.
    const fn pending(&self) -> Option<Action> {
        match self.state {
            State::Counting { action, .. } | State::Asking { action, .. } => Some(action),
            State::Refused => Some(Action::Land),
            _ => None,
        }
    }

    /// One step, after the checks'.
    pub(crate) fn step(&mut self, situation: &Situation<'_>) -> Option<Step> {
        let Situation { now, vehicle, .. } = *situation;
        let step_ms = self.stepped_at.age_ms(now).unwrap_or(0) as u32;
        self.stepped_at = Stamp::at(now);
        let cancelled = core::mem::take(&mut self.cancelled);
        let left = self.mode.is_some_and(|mode| returns(vehicle, mode));
        let changed = self.note_mode(now, vehicle);
        if is_landing(situation) {
            self.landing_at = Stamp::at(now);
        }
        let pending = self.pending();
        if !situation.flight.is_open() {
            (self.state, self.landing_at) = (State::Idle, Stamp::NONE);
            return pending.map(|action| Step { action, stage: Stage::CancelledOnGround, detail: 0 });
        }
        if let State::Asking { action, attempt, at, .. } = self.state
            && let Some(step) = self.hear(situation, action, attempt, at)
        {
            return Some(step);
        }
        let way = self.way(now, vehicle);
        if let Some(action) = pending {
            if cancelled {
                return Some(self.become_with(State::Done, action, Stage::CancelledByCommand));
            }
            if let Some(way) = way {
                return Some(self.become_with(State::OnItsWay { action, way }, action, Stage::AlreadyDone));
            }
            if changed == Some(Changed::Pilot) {
                return Some(self.become_with(State::ModeChanged, action, Stage::CancelledByMode));
            }
        }
        let flies = situation.flies();
        match self.state {
            State::Idle if flies => self.start(situation, way),
            State::Counting { .. } | State::Refused if changed.is_some() => self.become_idle(),
            State::Counting { action, left_ms, .. } if !flies => {
                self.state = State::Counting { action, left_ms, told_s: u8::MAX };
                None
            }
            State::Counting { action, left_ms, told_s } => {
                self.count(situation, action, left_ms.saturating_sub(step_ms), told_s)
            }
            State::Asking { .. } if flies => self.insist(now),
            State::Refused if flies => Some(self.ask(now, Action::Land, 1)),
            State::OnItsWay { action, way: before } => match way {
                Some(way) => {
                    self.state = State::OnItsWay { action, way };
                    None
                }
                None if left && changed == Some(Changed::Pilot) => {
                    Some(self.become_with(State::ModeChanged, action, Stage::CancelledByMode))
                }
                None if before == Way::Accepted => None,
                None => self.become_idle(),
            },
            State::ModeChanged if self.changed_at.older_than(now, SIGN) => {
                self.state = State::Done;
                None
            }
            State::ModeChanged if vehicle.alerts.have_begun_within(now, SIGN) => self.become_idle(),
            _ => None,
        }
    }

    /// Whether the mode has changed since the last step, and who changed it.
    fn note_mode(&mut self, now: Instant, vehicle: &Vehicle) -> Option<Changed> {
        let after = vehicle.heartbeat.get()?.mode;
        let before = self.mode.replace(after).filter(|before| *before != after)?;
        (self.changed_at, self.landing_at) = (Stamp::at(now), Stamp::NONE);
        let by_itself = vehicle.alerts.have_begun_within(now, SIGN)
            || waits(vehicle, after)
            || mission_ended(now, vehicle, before, after);
        Some(if by_itself { Changed::Autopilot } else { Changed::Pilot })
    }

    /// By which sign the autopilot returns or lands, if it does.
    fn way(&self, now: Instant, vehicle: &Vehicle) -> Option<Way> {
        if self.mode.is_some_and(|mode| returns(vehicle, mode)) {
            return Some(Way::Mode);
        }
        let lands = self.landing_at.age(now).is_some_and(|age| age < LANDING_LASTS);
        lands.then_some(Way::Landing)
    }

    fn become_with(&mut self, state: State, action: Action, stage: Stage) -> Step {
        self.state = state;
        Step { action, stage, detail: 0 }
    }

    /// Should it be critical still, it is announced anew.
    const fn become_idle(&mut self) -> Option<Step> {
        self.state = State::Idle;
        None
    }

    /// Announces the action, once something is critical.
    fn start(&mut self, situation: &Situation<'_>, way: Option<Way>) -> Option<Step> {
        let Situation { vehicle, health, params, .. } = *situation;
        let action = Action::from_number(params.get(Param::ProtAction) as u8)?;
        if self.mode.is_none() || !concerned(vehicle, health, params) {
            return None;
        }
        if let Some(way) = way {
            return Some(self.become_with(State::OnItsWay { action, way }, action, Stage::AlreadyDone));
        }
        let delay_s = params.get(Param::ProtDelay).clamp(0.0, 250.0) as u8;
        self.state = State::Counting { action, left_ms: u32::from(delay_s) * 1_000, told_s: delay_s };
        Some(Step { action, stage: Stage::Announced, detail: delay_s })
    }

    fn count(&mut self, situation: &Situation<'_>, action: Action, left_ms: u32, told_s: u8) -> Option<Step> {
        let Situation { now, vehicle, health, params, .. } = *situation;
        if !concerned(vehicle, health, params) {
            return Some(self.become_with(State::Idle, action, Stage::CancelledClear));
        }
        if left_ms == 0 {
            return Some(self.ask(now, action, 1));
        }
        let left_s = left_ms.div_ceil(1_000).min(255) as u8;
        let tells = left_s < told_s && (left_s.is_multiple_of(5) || left_s <= 3);
        self.state = State::Counting { action, left_ms, told_s: if tells { left_s } else { told_s } };
        tells.then_some(Step { action, stage: Stage::Counting, detail: left_s })
    }

    fn ask(&mut self, now: Instant, action: Action, attempt: u8) -> Step {
        self.state = State::Asking { action, attempt, at: now, progress: false };
        self.request = Some(Request { command: action.command(), confirmation: attempt - 1 });
        Step { action, stage: Stage::Asked, detail: attempt }
    }

    /// The autopilot's answer, once it has come.
    fn hear(&mut self, situation: &Situation<'_>, action: Action, attempt: u8, at: Instant) -> Option<Step> {
        let Situation { vehicle, .. } = *situation;
        let answered_at = vehicle.command_ack.at().filter(|answered_at| !at.is_after(*answered_at))?;
        let ack = vehicle.command_ack.get().filter(|ack| is_ours(ack, vehicle, action))?;
        match ack.result {
            TEMPORARILY_REJECTED if attempt < ATTEMPTS_MAX => return None,
            IN_PROGRESS => {
                // What follows is waited for from here on.
                self.state = State::Asking { action, attempt, at: answered_at, progress: true };
                return None;
            }
            ACCEPTED => self.state = State::OnItsWay { action, way: Way::Accepted },
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

/// Whether the autopilot left a mission by itself because it was flown to its end.
fn mission_ended(now: Instant, vehicle: &Vehicle, before: u32, after: u32) -> bool {
    let Some(heartbeat) = vehicle.heartbeat.get() else { return false };
    let left = match (heartbeat.autopilot, heartbeat.kind) {
        // ArduPlane: from AUTO to LOITER. A mission's end in RTL is a return.
        (Autopilot::ArduPilot, VehicleKind::Plane | VehicleKind::Vtol) => (before, after) == (10, 12),
        // ArduCopter: from AUTO to LOITER or BRAKE.
        (Autopilot::ArduPilot, _) => before == 3 && matches!(after, 5 | 17),
        _ => false,
    };
    left && vehicle.mission_reached.within(now, MISSION_ENDS).is_some()
}

/// Whether failsafes wait in this mode, and PX4 at the end of a mission: a pilot who chooses it has not cancelled.
fn waits(vehicle: &Vehicle, mode: u32) -> bool {
    vehicle.heartbeat.get().is_some_and(|heartbeat| match (heartbeat.autopilot, heartbeat.kind) {
        // PX4: HOLD, which is AUTO (4), LOITER (3).
        (Autopilot::Px4, _) => (mode >> 16) as u16 == 0x0304,
        // ArduPlane: CIRCLE.
        (Autopilot::ArduPilot, VehicleKind::Plane | VehicleKind::Vtol) => mode == 1,
        // ArduCopter: BRAKE.
        (Autopilot::ArduPilot, _) => mode == 17,
        (Autopilot::Other, _) => false,
    })
}

/// Whether the vehicle shows a sign of landing: by its landed state, because it sinks close to the ground, or in a mission.
fn is_landing(situation: &Situation<'_>) -> bool {
    let Situation { now, vehicle, flight, .. } = *situation;
    vehicle.landed.within(now, LANDED_STATE_AGE) == Some(&LandedState::Landing)
        || flight.phase(now, vehicle) == Phase::Landing
        || approaches(situation)
}

/// Whether the autopilot returns or lands in this mode.
fn returns(vehicle: &Vehicle, mode: u32) -> bool {
    vehicle.heartbeat.get().is_some_and(|heartbeat| match (heartbeat.autopilot, heartbeat.kind) {
        // PX4: main mode AUTO (4), sub modes RTL (5), LAND (6), PRECLAND (9).
        (Autopilot::Px4, _) => {
            let [_, _, main, sub] = mode.to_le_bytes();
            main == 4 && matches!(sub, 5 | 6 | 9)
        }
        // ArduPlane: RTL, QLAND, QRTL, LOITER_ALT_QLAND, AUTOLAND.
        (Autopilot::ArduPilot, VehicleKind::Plane | VehicleKind::Vtol) => {
            matches!(mode, 11 | 20 | 21 | 25 | 26)
        }
        // ArduCopter: RTL, LAND, SMART_RTL, AUTO_RTL.
        (Autopilot::ArduPilot, _) => matches!(mode, 6 | 9 | 21 | 27),
        (Autopilot::Other, _) => false,
    })
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
