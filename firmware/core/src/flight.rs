//! On the ground or in the air, and since when.
//!
//! The autopilot's own word ([`LandedState`]) counts where it is given. Otherwise, armed and one metre above the place
//! of arming (or a plane at flying speed) for half a second is a take-off; disarmed, or below half a metre and still for
//! two seconds, is a landing. Vehicles that do not fly are never in the air.

use crate::observation::{LandedState, VehicleKind};
use crate::time::{Instant, Span};
use crate::vehicle::Vehicle;

const TAKEOFF_HEIGHT_M: f32 = 1.0;
const LANDED_HEIGHT_M: f32 = 0.5;
const PLANE_FLYING_MPS: f32 = 8.0;
/// Nothing that is watched here is faster: garbage, which must not get into sums and maxima.
const SPEED_MAX_MPS: f32 = 1_000.0;
const STILL_MPS: f32 = 0.5;
const TAKEOFF_DEBOUNCE: Span = Span::from_millis(500);
const LANDING_DEBOUNCE: Span = Span::from_secs(2);
/// `EXTENDED_SYS_STATE` comes at 1 Hz or faster where it comes at all.
const LANDED_STATE_AGE: Span = Span::from_secs(5);
/// Positions and speeds older than this decide nothing.
const MOTION_AGE: Span = Span::from_secs(3);

/// What the vehicle is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// On the ground.
    Ground,
    /// The first metres up.
    TakeOff,
    /// Standing in the air.
    Hover,
    /// Going up.
    Climb,
    /// Going somewhere.
    Cruise,
    /// Going down.
    Descent,
    /// The last metres down.
    Landing,
}

impl Phase {
    /// The name that records and reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ground => "ground",
            Self::TakeOff => "take_off",
            Self::Hover => "hover",
            Self::Climb => "climb",
            Self::Cruise => "cruise",
            Self::Descent => "descent",
            Self::Landing => "landing",
        }
    }
}

/// Vertical speed from which it is a climb or a descent; half of it near the ground.
const VERTICAL_MPS: f32 = 0.7;
/// Speed over ground from which it is a cruise.
const CRUISE_MPS: f32 = 1.5;
/// Below this height above the place of arming it takes off or lands.
const NEAR_GROUND_M: f32 = 3.0;

/// A change between ground and air.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlightEvent {
    /// The vehicle left the ground.
    TakeOff,
    /// The vehicle is back on the ground.
    Landing,
}

/// Whether the vehicle flies.
#[derive(Clone, Copy, Debug, Default)]
pub struct Flight {
    airborne_since: Option<Instant>,
    armed_since: Option<Instant>,
    /// Height above home where it was armed.
    armed_height_m: Option<f32>,
    changing_since: Option<Instant>,
}

impl Flight {
    /// On the ground.
    pub const fn grounded() -> Self {
        Self { airborne_since: None, armed_since: None, armed_height_m: None, changing_since: None }
    }

    /// Whether it is in the air.
    pub const fn airborne(&self) -> bool {
        self.airborne_since.is_some()
    }

    /// When it took off, while it is in the air.
    pub const fn airborne_since(&self) -> Option<Instant> {
        self.airborne_since
    }

    /// One step, at least every 50 ms.
    pub fn step(&mut self, now: Instant, vehicle: &Vehicle) -> Option<FlightEvent> {
        let height_m = vehicle.global.within(now, MOTION_AGE).map(|global| global.relative_altitude.0);
        if !vehicle.armed() {
            self.armed_since = None;
            self.armed_height_m = None;
        } else if self.armed_since.is_none() {
            self.armed_since = Some(now);
            self.armed_height_m = height_m;
        }
        let says = Self::autopilot_says(now, vehicle);
        let debounce = match (says, self.airborne()) {
            (Some(_), _) => Span::ZERO,
            (None, false) => TAKEOFF_DEBOUNCE,
            (None, true) if !vehicle.armed() => Span::ZERO,
            (None, true) => LANDING_DEBOUNCE,
        };
        let flies = says.unwrap_or_else(|| self.seems_to_fly(now, vehicle, height_m));
        if flies == self.airborne() {
            self.changing_since = None;
            return None;
        }
        let since = *self.changing_since.get_or_insert(now);
        if now.since(since) < debounce {
            return None;
        }
        self.changing_since = None;
        self.airborne_since = flies.then_some(since);
        Some(if flies { FlightEvent::TakeOff } else { FlightEvent::Landing })
    }

    /// What the vehicle is doing now.
    pub fn phase(&self, now: Instant, vehicle: &Vehicle) -> Phase {
        if !self.airborne() {
            return Phase::Ground;
        }
        let climb_mps = climb_mps(now, vehicle).unwrap_or(0.0);
        let height_m = vehicle.global.within(now, MOTION_AGE).map(|global| global.relative_altitude.0);
        let height_m = height_m.map(|height_m| height_m - self.armed_height_m.unwrap_or(0.0));
        let near_ground = height_m.is_some_and(|height_m| height_m < NEAR_GROUND_M);
        if near_ground && climb_mps > VERTICAL_MPS / 2.0 {
            Phase::TakeOff
        } else if near_ground && climb_mps < -VERTICAL_MPS / 2.0 {
            Phase::Landing
        } else if climb_mps > VERTICAL_MPS {
            Phase::Climb
        } else if climb_mps < -VERTICAL_MPS {
            Phase::Descent
        } else if ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > CRUISE_MPS) {
            Phase::Cruise
        } else {
            Phase::Hover
        }
    }

    fn autopilot_says(now: Instant, vehicle: &Vehicle) -> Option<bool> {
        match vehicle.landed.within(now, LANDED_STATE_AGE)? {
            LandedState::OnGround => Some(false),
            // Sent from the spooling up of the motors on the ground until the height that was asked for is reached:
            // the height decides.
            LandedState::TakingOff | LandedState::Unknown => None,
            LandedState::InAir | LandedState::Landing => Some(true),
        }
    }

    fn seems_to_fly(&self, now: Instant, vehicle: &Vehicle, height_m: Option<f32>) -> bool {
        let Some(heartbeat) = vehicle.heartbeat.get() else { return false };
        if !heartbeat.armed || heartbeat.kind == VehicleKind::Surface {
            return false;
        }
        let speed_mps = ground_speed_mps(now, vehicle).unwrap_or(0.0);
        let height_m = height_m.map(|height_m| height_m - self.armed_height_m.unwrap_or(0.0));
        if self.airborne() {
            return height_m.is_none_or(|height_m| height_m > LANDED_HEIGHT_M) || speed_mps > STILL_MPS;
        }
        let plane = matches!(heartbeat.kind, VehicleKind::Plane | VehicleKind::Vtol);
        height_m.is_some_and(|height_m| height_m > TAKEOFF_HEIGHT_M)
            || (plane && speed_mps > PLANE_FLYING_MPS)
    }
}

/// Speed upwards from the best source that is fresh, in m/s.
pub(crate) fn climb_mps(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let global = vehicle.global.within(now, MOTION_AGE).map(|global| -global.velocity[2].0);
    let local = || vehicle.local.within(now, MOTION_AGE).map(|local| -local.velocity[2].0);
    let hud = || vehicle.hud.within(now, MOTION_AGE).and_then(|hud| hud.climb).map(|climb| climb.0);
    global.or_else(local).or_else(hud).filter(|climb| climb.abs() <= SPEED_MAX_MPS)
}

/// Speed over ground from the best source that is fresh, in m/s.
pub fn ground_speed_mps(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let norm = |north: f32, east: f32| libm::sqrtf(north * north + east * east);
    let global =
        vehicle.global.within(now, MOTION_AGE).map(|global| norm(global.velocity[0].0, global.velocity[1].0));
    let local =
        || vehicle.local.within(now, MOTION_AGE).map(|local| norm(local.velocity[0].0, local.velocity[1].0));
    let hud = || vehicle.hud.within(now, MOTION_AGE).and_then(|hud| hud.groundspeed).map(|speed| speed.0);
    global.or_else(local).or_else(hud).filter(|speed| (0.0..=SPEED_MAX_MPS).contains(speed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::{GlobalPosition, Heartbeat, Observation, Source};
    use crate::units::Metres;

    const AUTOPILOT: Source = Source { system: 1, component: 1 };

    fn fly(kind: VehicleKind, heights_m: &[(u64, f32)]) -> Vec<(u64, FlightEvent)> {
        let mut vehicle = Vehicle::unknown();
        let mut flight = Flight::grounded();
        let mut events = Vec::new();
        let mut now_ms = 0;
        for (until_ms, height_m) in heights_m {
            while now_ms < *until_ms {
                let now = Instant::from_millis(now_ms);
                let heartbeat = Heartbeat { armed: now_ms >= 1_000, kind, ..Heartbeat::default() };
                vehicle.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
                let global =
                    GlobalPosition { relative_altitude: Metres(*height_m), ..GlobalPosition::default() };
                vehicle.observe(now, AUTOPILOT, &Observation::GlobalPosition(global));
                events.extend(flight.step(now, &vehicle).map(|event| (now_ms, event)));
                now_ms += 50;
            }
        }
        events
    }

    #[test]
    fn height_above_the_place_of_arming_is_a_take_off() {
        let heights = [(5_000, 20.0), (10_000, 25.0), (20_000, 20.1)];
        let expected = [(5_500, FlightEvent::TakeOff), (12_000, FlightEvent::Landing)];
        assert_eq!(fly(VehicleKind::Rotorcraft, &heights), expected);
    }

    #[test]
    fn a_submarine_never_flies() {
        assert_eq!(fly(VehicleKind::Surface, &[(5_000, 0.0), (10_000, 25.0)]), []);
    }

    #[test]
    fn the_autopilots_own_word_counts() {
        let mut vehicle = Vehicle::unknown();
        let mut flight = Flight::grounded();
        let heartbeat = Heartbeat { armed: true, kind: VehicleKind::Rotorcraft, ..Heartbeat::default() };
        vehicle.observe(Instant::ZERO, AUTOPILOT, &Observation::Heartbeat(heartbeat));
        for (landed, event) in [
            (LandedState::OnGround, None),
            (LandedState::TakingOff, None),
            (LandedState::InAir, Some(FlightEvent::TakeOff)),
            (LandedState::Landing, None),
            (LandedState::OnGround, Some(FlightEvent::Landing)),
        ] {
            vehicle.observe(Instant::ZERO, AUTOPILOT, &Observation::Landed(landed));
            assert_eq!(flight.step(Instant::ZERO, &vehicle), event, "{landed:?}");
        }
    }
}
