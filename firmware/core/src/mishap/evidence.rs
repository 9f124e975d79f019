//! What a mishap is seen by: how long something lasts, what was greatest of late, what the vehicle hangs on and who flies it.

use crate::flight::FLYING_THROTTLE;
use crate::motion::height_m;
use crate::observation::{EstimatorScale, LandedState};
use crate::params::{Param, Params};
use crate::time::{Instant, Span, Stamp};
use crate::vehicle::{LANDED_STATE_AGE, Vehicle};

/// So long what falls is carried by next to nothing; a bounce is shorter.
pub(super) const UNCARRIED: Span = Span::from_millis(200);

/// Samples, one after the other, before anything is believed.
const SAMPLES: u8 = 3;
/// 45 degrees: what rests at a greater tilt than that does not fly.
const TILTED_RAD: f32 = 0.785;

/// Older values decide nothing.
pub(super) const FRESH: Span = Span::from_secs(2);
/// A speed has broken off when it is below this part of it within [`BREAKS_OFF`].
pub(super) const BROKEN_OFF: f32 = 0.4;
pub(super) const BREAKS_OFF: Span = Span::from_secs(1);
/// Near the ground.
const HPA_PER_METRE: f32 = 0.12;
/// Above this nobody asks to sink, and what is still does not fly.
pub(super) const FULL_THROTTLE: f32 = 0.9;

/// How long it is seen whether what was disarmed falls.
pub(super) const FALL_SHOWS: Span = Span::from_secs(3);
/// What was disarmed and moves so fast sinks through the air.
pub(super) const FALLING_MPS: f32 = 2.5;

/// The throttle of a hover is known after so long in it, s; and its time constant, s.
pub(super) const LEARNT_S: f32 = 10.0;
const HOVER_S: f32 = 10.0;
/// Throttles come more often than this, s.
const STEP_MAX_S: f32 = 2.0;

/// Below this part of the throttle that it hovers with, a fall is what the throttle asks for, and what does not fall stands.
pub(super) const THRUST_PART: f32 = 0.5;

/// The ground is no flatter than this, m.
const STEP_M: f32 = 2.0;

/// How long something has been so, and in how many samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lasting {
    since: Instant,
    samples: u8,
    last: Stamp,
}

impl Lasting {
    pub(super) const NOT: Self = Self { since: Instant::ZERO, samples: 0, last: Stamp::NONE };

    /// For how long it has been so, once there were enough samples.
    pub(super) fn take(&mut self, at: Instant, so: bool) -> Option<Span> {
        if !so {
            self.samples = 0;
            return None;
        }
        let goes_on = self.last.age(at).is_some_and(|age| age <= FRESH);
        if self.samples == 0 || !goes_on {
            (self.since, self.samples) = (at, 0);
        }
        self.last = Stamp::at(at);
        self.samples = self.samples.saturating_add(1);
        (self.samples >= SAMPLES).then(|| at.since(self.since))
    }

    /// Whether it was so in the last samples, for so long.
    pub(super) fn lasts(&self, now: Instant, span: Span) -> bool {
        self.samples >= 2
            && self.last.age(now).is_some_and(|age| age <= FRESH)
            && now.since(self.since) >= span
    }
}

/// The greatest of the last half to whole second.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recent {
    now: f32,
    before: f32,
    window: Instant,
}

impl Recent {
    pub(super) const WINDOW: Span = Span::from_millis(600);
    pub(super) const NOTHING: Self = Self { now: 0.0, before: 0.0, window: Instant::ZERO };

    pub(super) fn take(&mut self, at: Instant, value: f32) {
        if at.since(self.window) >= Self::WINDOW {
            (self.before, self.now, self.window) = (self.now(at), 0.0, at);
        }
        self.now = self.now.max(value);
    }

    /// The greatest of this window; nothing that was told long ago.
    pub(super) fn now(&self, at: Instant) -> f32 {
        if at.since(self.window) <= FRESH { self.now } else { 0.0 }
    }

    /// The greatest of this window and the one before.
    pub(super) fn greatest(&self, at: Instant) -> f32 {
        if at.since(self.window) <= FRESH { self.now.max(self.before) } else { 0.0 }
    }
}

/// The air pressure of one to two seconds ago, and of now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pressure {
    before_hpa: f32,
    began_hpa: f32,
    now_hpa: f32,
    window: Instant,
    changed_at: Instant,
    /// When it rose last as it does under a parachute.
    rose_at: Instant,
}

impl Pressure {
    const WINDOW: Span = Span::from_secs(1);
    /// Parachutes of drones let them down at 4 to 6 m/s (ASTM F3322 leaves it to the impact's energy).
    const PARACHUTE_MPS: f32 = 4.0;
    pub(super) const NOTHING: Self = Self {
        before_hpa: 0.0,
        began_hpa: 0.0,
        now_hpa: 0.0,
        window: Instant::ZERO,
        changed_at: Instant::ZERO,
        rose_at: Instant::ZERO,
    };

    pub(super) fn take(&mut self, at: Instant, hpa: f32) {
        if at.since(self.window) >= Self::WINDOW {
            let goes_on = at.since(self.window) <= FRESH;
            let before_hpa = if goes_on { self.began_hpa } else { 0.0 };
            (self.before_hpa, self.began_hpa, self.window) = (before_hpa, hpa, at);
        }
        if hpa.to_bits() != self.now_hpa.to_bits() {
            self.changed_at = at;
        }
        self.now_hpa = hpa;
        // The pressure before is at least a second old.
        if self.before_hpa > 0.0 && hpa > self.before_hpa + HPA_PER_METRE * Self::PARACHUTE_MPS {
            self.rose_at = at;
        }
    }

    /// When it rose last as it does under a parachute.
    pub(super) const fn rose_at(&self) -> Instant {
        self.rose_at
    }

    /// How long it has not risen as it does under a parachute; `None` where there is no pressure, or one that never changes.
    pub(super) fn steady_for(&self, now: Instant) -> Option<Span> {
        self.now(now).map(|_| now.since(self.rose_at))
    }

    /// What it is, where it is told and changes at all.
    pub(super) fn now(&self, at: Instant) -> Option<f32> {
        let known = at.since(self.window) <= FRESH && at.since(self.changed_at) <= FRESH;
        known.then_some(self.now_hpa)
    }

    /// Whether it rises as it does in a vehicle that sinks so fast, or began to within the last second; `None` where there is no
    /// pressure, or one that never changes.
    pub(super) fn agrees(&self, at: Instant, sink_mps: f32) -> Option<bool> {
        /// Of the height that is lost in a second: it may have begun to sink within it, and its pressures are as old as their
        /// stream is slow.
        const PART_S: f32 = 0.3;
        /// Wind and propellers make as much.
        const NOISE_M: f32 = 0.8;
        let least_hpa = HPA_PER_METRE * (PART_S * sink_mps).max(NOISE_M);
        let now_hpa = self.now(at).filter(|_| self.before_hpa > 0.0)?;
        Some(now_hpa > self.before_hpa + least_hpa)
    }
}

/// Whether the estimator's speeds are to be believed, by its own word: shaking sensors mislead it.
pub(super) fn is_believed(vehicle: &Vehicle, params: &Params) -> bool {
    vehicle.estimator.get().is_none_or(|estimator| {
        let limit = match estimator.scale {
            EstimatorScale::Variance => Param::EkfVarWarn,
            EstimatorScale::TestRatio => Param::EkfRatioCrit,
        };
        let of_motion = [estimator.velocity, estimator.position_vertical].into_iter().flatten();
        of_motion.reduce(f32::max).is_none_or(|worst| worst <= params.get(limit))
    })
}

/// A shock, and what came of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shock {
    pub(super) at: Instant,
    pub(super) load_g: f32,
    /// The speed just before it; 0 where the estimator is not to be believed.
    pub(super) speed_mps: f32,
    /// The sink just before it.
    pub(super) sink_mps: f32,
    /// The speed broke off.
    pub(super) stopped: bool,
    /// It hit something, if it lies still soon.
    pub(super) hit: bool,
    /// Little carried it just before.
    pub(super) dropped: bool,
}

/// Disarmed or terminated out of a flight, or terminated when it was heard first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doubt {
    pub(super) since: Instant,
    /// Above home, where that is known.
    pub(super) height_m: Option<f32>,
    /// Above mean sea level.
    pub(super) altitude_m: Option<f32>,
    /// Nothing has carried it since.
    pub(super) uncarried: bool,
    /// Its flight was terminated while nobody listened: the fall may be over.
    pub(super) unseen: bool,
    /// It stood still and level since, or nobody saw it fly.
    pub(super) stood: bool,
}

/// The vehicle was not heard, in the air.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unheard {
    /// When it was heard last; with what a recording lost meanwhile, in which no time passed here, taken off.
    pub(super) from: Instant,
    /// The same without that.
    pub(super) last_heard_at: Instant,
    /// When it was heard again.
    pub(super) again_at: Option<Instant>,
    /// When its forces and its place were heard again, or the first of them where it tells no other.
    pub(super) state_known_at: Option<Instant>,
    /// It is disarmed, or calls itself landed, since.
    pub(super) calls_itself_down: bool,
    /// When it did last what is no sign of a crash, since it is heard again.
    pub(super) no_sign_at: Instant,
    /// Its height above mean sea level, and its sink, when it was heard last.
    pub(super) altitude_m: Option<f32>,
    pub(super) sink_mps: f32,
}

impl Unheard {
    /// How long it was not heard.
    pub(super) fn lasted(&self, now: Instant) -> Span {
        self.again_at.unwrap_or(now).since(self.from)
    }

    /// The shortest time in which what flies by itself comes down so far, stands and is disarmed: from its sink to the fastest descent that
    /// can be set, or its own if that was faster, as gently as autopilots do, the last metres no faster than legs take, and disarmed when
    /// its autopilot has seen for so long that it stands (`ArduPilot` 1 s, PX4 longer).
    pub(super) fn least_s(&self, lost_m: f32, limit_mps: f32, armed: bool) -> f32 {
        const SEES_S: f32 = 1.0;
        const LAST_M: f32 = 5.0;
        const LAST_MPS: f32 = 2.5;
        const GENTLY_MPS2: f32 = 2.0;
        let last_m = lost_m.min(LAST_M);
        let fastest_mps = limit_mps.max(self.sink_mps);
        let faster_mps = fastest_mps - self.sink_mps.max(0.0);
        let sees_s = if armed { 0.0 } else { SEES_S };
        last_m / LAST_MPS + (lost_m - last_m) / fastest_mps + faster_mps / (2.0 * GENTLY_MPS2) + sees_s
    }
}

/// What is known of what carries it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Support {
    /// It is in the air.
    pub(super) flies: bool,
    /// The part of the throttle that it hovers with, smoothed; 0 where it is not known.
    hover_throttle: f32,
    /// How long it has hovered.
    pub(super) hovered_s: f32,
    throttle_at: Instant,
    /// Since when something carries it that is not its rotors, and the pressure then, hPa.
    pub(super) since: Stamp,
    pub(super) hpa: f32,
}

impl Support {
    pub(super) const NOTHING: Self = Self {
        flies: false,
        hover_throttle: 0.0,
        hovered_s: 0.0,
        throttle_at: Instant::ZERO,
        since: Stamp::NONE,
        hpa: 0.0,
    };

    /// It is armed anew, perhaps with another payload.
    pub(super) fn forget(&mut self) {
        self.hovered_s = 0.0;
    }

    /// A throttle came, while it hovers or not.
    pub(super) fn take_throttle(&mut self, at: Instant, part: f32, hovers: bool) {
        let step_s = at.since(core::mem::replace(&mut self.throttle_at, at)).as_secs_f32().min(STEP_MAX_S);
        if hovers {
            let weight = if self.hover_throttle > 0.0 { step_s / (HOVER_S + step_s) } else { 1.0 };
            self.hover_throttle += weight * (part - self.hover_throttle);
            self.hovered_s += step_s;
        }
    }

    /// The throttle from which on rotors may carry it: half of what it hovers with, once that is known.
    pub(super) fn flying_throttle(&self) -> f32 {
        let is_known = self.hovered_s >= LEARNT_S;
        if is_known { FLYING_THROTTLE.min(THRUST_PART * self.hover_throttle) } else { FLYING_THROTTLE }
    }

    /// Below this throttle nothing flies.
    pub(super) fn idle_throttle(&self) -> f32 {
        self.flying_throttle() / 2.0
    }

    /// Whether this throttle carries less than half of the weight.
    pub(super) fn is_little(&self, part: f32) -> bool {
        part < THRUST_PART * self.hover_throttle
    }
}

pub(super) fn is_known(vector: [f32; 3]) -> bool {
    vector.into_iter().all(f32::is_finite)
}

/// Whether it hangs on rotors now.
pub(super) fn on_rotors(now: Instant, vehicle: &Vehicle) -> bool {
    vehicle.hovers(now) == Some(true)
}

/// Whether its autopilot says that it is on the ground.
pub(super) fn calls_itself_landed(now: Instant, vehicle: &Vehicle) -> bool {
    vehicle.landed.within(now, LANDED_STATE_AGE) == Some(&LandedState::OnGround)
}

/// Whether it is as high as where it took off, but for a step. Below that there may be a valley.
pub(super) fn is_near_ground(now: Instant, vehicle: &Vehicle) -> bool {
    height_m(now, vehicle).is_some_and(|height_m| height_m.abs() < STEP_M)
}

/// Whether it is known to be above or below the place where it took off.
pub(super) fn is_off_ground(now: Instant, vehicle: &Vehicle) -> bool {
    height_m(now, vehicle).is_some_and(|height_m| height_m.abs() >= STEP_M)
}

/// Whether it lies on its side or its back, by an attitude that the sensors do not contradict.
pub(super) fn is_tilted(now: Instant, vehicle: &Vehicle) -> bool {
    !vehicle.inertial.contradicts(now)
        && vehicle
            .attitude
            .within(now, FRESH)
            .is_some_and(|attitude| attitude.roll.0.abs() > TILTED_RAD || attitude.pitch.0.abs() > TILTED_RAD)
}
