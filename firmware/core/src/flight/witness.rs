//! The witnesses of flight: each says that the vehicle flies, that it stands, or neither.
//!
//! | witness | it flies | it stands |
//! |---|---|---|
//! | word | landed state "in air" or "landing", with power | landed state "on ground" |
//! | height | more than 1.5 m above the place of arming, by pressure or position | within 1 m of it; motors off, and the pressure steady for 3 s |
//! | thrust | the throttle carries it ([`crate::thrust`]) | idle, off, all of it without a climb; or it lies over, where rotors carry nothing |
//! | inertial | nothing carries it; it turned fast within a second | on rotors: level and still with idle throttle; no vibration of rotors and no height; it hit something; it lies over |
//! | speed | faster than 1.5 m/s, up, down or over ground; wings: 8 m/s | slow, and no throttle that carries it; the receiver stands and the estimate moves |
//!
//! Pressure and position that contradict each other say nothing of the height. An estimate that the receiver or the pressure contradicts says
//! nothing of height and speed ([`crate::motion`]).

use super::{Flight, Stage};
use crate::gates::{LEVEL_MPS, TURNED};
use crate::mishap::MishapKind;
use crate::motion::{
    CLEAR_M, LOW_M, MOVES_MPS, STILL_MPS, TILTED_RAD, WINGS_MPS, airspeed_mps, climb_mps, ground_speed_mps,
    throttle,
};
use crate::observation::LandedState;
use crate::parameters::Params;
use crate::pressure::NOISE_M;
use crate::thrust::Power;
use crate::time::{BootMs, Millis, PAUSE, SILENT};
use crate::units::{GRAVITY, norm};
use crate::vehicle::Vehicle;

/// Rotors pull upwards: what carries the vehicle from above by more than this, g, is the ground under its back.
const ON_BACK_G: f32 = 0.5;
/// A vehicle with idle throttle, its weight on it and a steady pressure for this long stands. A flare takes its
/// weight from the ground speed for less.
const SUPPORTED: Millis = Millis::from_secs(4);
/// The weight, g, with the scale error of a sensor; more is a bias, which may be what lost the estimate.
const WEIGHT_G: core::ops::Range<f32> = 0.85..2.0;
/// The pressure stays within this meanwhile, m.
const STAYS_M: f32 = 1.2;
/// A vehicle without power that has not sunk for so long, by the pressure, is down.
const STEADY: Millis = Millis::from_secs(3);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Vote {
    Unknown,
    Undecided,
    /// Its height is below the place of arming: a valley, or an estimate that drifts. It does not count.
    Below,
    Flies,
    Stands,
}
use Vote::{Below, Flies, Stands, Undecided, Unknown};

/// A witness: its bit.
pub(super) const WORD: u8 = 1;
pub(super) const HEIGHT: u8 = 2;
pub(super) const THRUST: u8 = 4;
pub(super) const INERTIAL: u8 = 8;
pub(super) const SPEED: u8 = 16;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Votes {
    pub(super) flies: u8,
    pub(super) stands: u8,
    pub(super) known: u8,
    /// Away from the ground, as far as that is known.
    pub(super) is_clear: bool,
}

impl Votes {
    fn take(&mut self, witness: u8, vote: Vote) {
        match vote {
            Unknown => return,
            Undecided | Below => {}
            Flies => self.flies |= witness,
            Stands => self.stands |= witness,
        }
        self.known |= witness;
    }

    pub(super) const fn count(self) -> (u32, u32) {
        (self.flies.count_ones(), self.stands.count_ones())
    }
}

impl Flight {
    /// Asks all witnesses.
    pub(super) fn ask(&self, now: BootMs, vehicle: &Vehicle) -> Votes {
        let heights = self.heights(now, vehicle);
        let (word, height) = (self.word(now, vehicle), self.height(now, heights));
        let is_away = heights.iter().any(|vote| matches!(vote, Flies | Below));
        let is_clear = is_away || (heights == [Unknown; 2] && word != Stands);
        let mut votes = Votes { is_clear, ..Votes::default() };
        votes.take(WORD, word);
        votes.take(HEIGHT, height);
        if self.stage.is_mishap() && self.lies(now, vehicle) {
            votes.take(THRUST, Stands);
            votes.take(INERTIAL, Stands);
            return votes;
        }
        // A hover is slow and still too.
        let may_hover = (height == Flies || (word == Flies && is_away)) && !self.is_supported(now);
        let speed = self.speed(now, vehicle, may_hover);
        votes.take(THRUST, self.thrust_vote(now, vehicle, speed));
        votes.take(INERTIAL, self.inertial(now, vehicle, heights[0], may_hover));
        votes.take(SPEED, speed);
        votes
    }

    fn word(&self, now: BootMs, vehicle: &Vehicle) -> Vote {
        match vehicle.landed.within(now, SILENT) {
            Some(LandedState::OnGround) => Stands,
            Some(LandedState::InAir | LandedState::Landing) if self.arming.is_on => Flies,
            // Taking off: from the spooling up of the motors until the height that was asked for is reached.
            None | Some(LandedState::TakingOff | LandedState::Unknown) => Unknown,
            Some(_) => Undecided,
        }
    }

    pub(super) fn calls_itself_landed(&self, now: BootMs, vehicle: &Vehicle) -> bool {
        self.word(now, vehicle) == Stands
    }

    fn heights(&self, now: BootMs, vehicle: &Vehicle) -> [Vote; 2] {
        let by_position = self.motion.rise_m(now, vehicle).filter(|_| !self.lost_since.is_set());
        [(self.pressure.height_m(now), NOISE_M), (by_position, LOW_M)].map(|(height_m, low_m)| match height_m
        {
            None => Unknown,
            Some(height_m) if height_m > CLEAR_M => Flies,
            Some(height_m) if height_m < -CLEAR_M => Below,
            Some(height_m) if height_m.abs() < low_m => Stands,
            Some(_) => Undecided,
        })
    }

    fn height(&self, now: BootMs, heights: [Vote; 2]) -> Vote {
        if !self.arming.is_on && self.stage.is_mishap() {
            let passed = self.arming.off_at.map_or(Millis::ZERO, |since| now.since(since));
            let steady_for = self.pressure.steady_for(now).map(|span| span.min(passed));
            return steady_for.map_or(Unknown, |span| if span >= STEADY { Stands } else { Flies });
        }
        match heights {
            [Undecided | Below | Unknown, one] if one != Unknown => one,
            [one, Undecided | Below | Unknown] => one,
            [one, other] if one == other => one,
            _ => Undecided,
        }
    }

    /// The effect of the throttle. `None` if it is not reported, or if it is reported as zero while motors shake the vehicle.
    pub(crate) fn power(&self, now: BootMs, vehicle: &Vehicle) -> Option<Power> {
        let power = throttle(now, vehicle).map(|part| self.thrust.power(part));
        power.filter(|power| {
            *power != Power::Idle || self.thrust.has_flown || vehicle.inertial.shakes(now) != Some(true)
        })
    }

    fn thrust_vote(&self, now: BootMs, vehicle: &Vehicle, speed: Vote) -> Vote {
        let climbs = || climb_mps(now, vehicle).is_some_and(|climb_mps| climb_mps.abs() > STILL_MPS);
        match self.power(now, vehicle) {
            _ if !self.arming.is_on => Stands,
            None => Unknown,
            Some(Power::Little) => Undecided,
            // Wings glide.
            Some(Power::Idle) if is_on_wings(now, vehicle) && speed == Flies => Undecided,
            Some(Power::Idle) => Stands,
            // With all its thrust it would climb.
            Some(Power::Full) if !is_on_wings(now, vehicle) && !climbs() => Stands,
            Some(Power::Carries | Power::Full) => Flies,
        }
    }

    fn inertial(&self, now: BootMs, vehicle: &Vehicle, by_pressure: Vote, may_hover: bool) -> Vote {
        if self.stage.has_hit() {
            return Stands;
        }
        if self.felt.at == BootMs::ZERO {
            return Unknown;
        }
        let turns = !vehicle.inertial.turns_little(now, TURNED);
        if self.airborne() && (self.is_unloaded() || turns) {
            return Flies;
        }
        if is_on_wings(now, vehicle) {
            return Undecided;
        }
        let rests =
            self.power(now, vehicle) == Some(Power::Idle) && vehicle.inertial.is_level(now) && !may_hover;
        // Simulators have no vibration.
        let is_quiet = vehicle.inertial.is_calm(now) && by_pressure == Stands;
        if rests || is_quiet || self.is_supported(now) { Stands } else { Undecided }
    }

    fn speed(&self, now: BootMs, vehicle: &Vehicle, may_hover: bool) -> Vote {
        let power = self.power(now, vehicle);
        let climb_mps = climb_mps(now, vehicle);
        let ground_mps = ground_speed_mps(now, vehicle);
        let is_over =
            |speed_mps: Option<f32>, limit_mps| speed_mps.is_some_and(|speed_mps| speed_mps > limit_mps);
        if is_on_wings(now, vehicle) {
            let air_mps = airspeed_mps(now, vehicle);
            // Wind alone makes an air speed too.
            let has_thrust = matches!(power, Some(Power::Carries | Power::Full));
            let by_air = is_over(air_mps, WINGS_MPS) && (self.airborne() || has_thrust);
            return if ground_mps.or(air_mps).is_none() {
                Unknown
            } else if by_air || is_over(ground_mps, WINGS_MPS) {
                Flies
            } else if is_over(ground_mps, WINGS_MPS / 2.0) || is_over(air_mps, WINGS_MPS / 2.0) {
                Undecided
            } else {
                Stands
            };
        }
        if self.lost_since.is_set() {
            return if self.has_strayed(now) { Stands } else { Unknown };
        }
        if ground_mps.or(climb_mps).is_none() || matches!(self.stage, Stage::Ground | Stage::Touched) {
            return Unknown;
        }
        let vertical_mps = climb_mps.map(f32::abs);
        // An estimate is shaken by an impact: only a climb is believed.
        let moves = if self.stage.has_hit() {
            is_over(climb_mps, STILL_MPS)
        } else {
            is_over(ground_mps, MOVES_MPS) || is_over(vertical_mps, MOVES_MPS)
        };
        let is_slow = !is_over(ground_mps, STILL_MPS) && !is_over(vertical_mps, STILL_MPS);
        let hovers =
            self.arming.is_on && (power == Some(Power::Carries) || (may_hover && !self.stage.is_mishap()));
        match (moves, is_slow && !hovers) {
            (true, _) => Flies,
            (false, true) => Stands,
            (false, false) => Undecided,
        }
    }

    /// Whether the estimate of height and speed is lost. The pressure does not follow a climb or a sink; or, in a
    /// mishap, the receiver stands.
    pub(super) fn loses_estimate(&self, now: BootMs, vehicle: &Vehicle) -> bool {
        let climbs = climb_mps(now, vehicle).filter(|climb_mps| climb_mps.abs() > LEVEL_MPS);
        self.has_strayed(now)
            || climbs.is_some_and(|climb_mps| self.pressure.follows(now, climb_mps) == Some(false))
    }

    /// Whether the estimator's attitude is a witness. The pressure contradicts it by the climb, the inertial sensors by the force. The
    /// pressure follows a true fall within a second.
    pub(crate) fn believes_attitude(&self, now: BootMs, vehicle: &Vehicle) -> bool {
        !self.lost_since.older_than(now, TURNED) && !vehicle.inertial.contradicts(now)
    }

    fn has_strayed(&self, now: BootMs) -> bool {
        self.stage.is_mishap() && self.motion.has_strayed(now)
    }

    /// Whether it lies on its side or its back: by an attitude that the sensors do not contradict (the
    /// impact itself may lose the estimate), or by the force that carries it. Wings bank,
    /// and tail-sitters look up.
    pub(super) fn lies(&self, now: BootMs, vehicle: &Vehicle) -> bool {
        let flies = vehicle.hovers(now) == Some(false) && is_fast(now, vehicle);
        let is_over =
            self.arming.stood && on_rotors(now, vehicle) && vehicle.inertial.lies_over(now).is_some();
        (is_tilted(now, vehicle) && !flies)
            || self.lies_on_its_back(vehicle)
            || (is_over && !is_fast(now, vehicle))
    }

    pub(super) fn lies_on_its_back(&self, vehicle: &Vehicle) -> bool {
        vehicle.is_multicopter() && self.felt.from_above_g > ON_BACK_G
    }

    /// Whether something other than its rotors carries it, by no estimate: idle throttle, its weight on it, and a
    /// steady pressure for a while.
    pub(super) fn is_supported(&self, now: BootMs) -> bool {
        self.supported.is_some_and(|(since, _)| now.since(since) >= SUPPORTED)
    }

    /// One step of the same. An autopilot whose estimate climbs takes the thrust away, and flies into the ground.
    pub(super) fn note_support(&mut self, now: BootMs, vehicle: &Vehicle, params: &Params) {
        let rests = self.arming.is_on
            && self.thrust.is_learnt()
            && self.power(now, vehicle) == Some(Power::Idle)
            && now.since(self.felt.at) <= PAUSE
            && WEIGHT_G.contains(&(norm(vehicle.inertial.force) / GRAVITY))
            && self.is_slow_to_turn();
        self.supported = match (self.pressure.now(now).filter(|_| rests), self.supported) {
            (None, _) => None,
            (Some(_), Some((since, hpa))) if self.pressure.is_within(hpa, STAYS_M) => Some((since, hpa)),
            (Some(hpa), _) => Some((now, hpa)),
        };
        if let Some((since, _)) = self.supported
            && self.stage == Stage::Airborne
            && self.is_supported(now)
            && self.lost_since.is_set()
            && (self.pressure.sank_at + TURNED).is_after(since)
        {
            self.hit_at = since;
            self.see(now, MishapKind::Impact, 0.0, params);
        }
    }
}

pub(super) fn on_rotors(now: BootMs, vehicle: &Vehicle) -> bool {
    vehicle.hovers(now) == Some(true)
}

pub(super) fn is_on_wings(now: BootMs, vehicle: &Vehicle) -> bool {
    !vehicle.hovers(now).unwrap_or(!vehicle.has_wings())
}

fn is_tilted(now: BootMs, vehicle: &Vehicle) -> bool {
    !vehicle.inertial.contradicts(now)
        && vehicle.attitude.within(now, PAUSE).is_some_and(|attitude| attitude.lean_rad() > TILTED_RAD)
}

pub(super) fn is_fast(now: BootMs, vehicle: &Vehicle) -> bool {
    const DRAGS_MPS: f32 = 12.0;
    ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > DRAGS_MPS)
}
