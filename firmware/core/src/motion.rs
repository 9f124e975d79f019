//! How the vehicle moves, from the best source that is fresh: height, climb, speeds, and the throttle that it does so with.

use crate::observation::Hud;
use crate::time::{BootMs, Millis, PAUSE};
use crate::units::{MetresPerSecond, norm};
use crate::vehicle::Vehicle;

/// Positions and speeds older than this decide nothing.
pub(crate) const MOTION_AGE: Millis = Millis::from_secs(3);
/// Below this part of throttle or output a motor is off, or as slow as it goes.
pub(crate) const OFF: f32 = 0.05;
/// With less throttle no rotors carry anything: hover takes a quarter to three quarters.
pub(crate) const IDLE_THROTTLE: f32 = 0.1;

/// Height above home, or above the local origin without a global position.
pub fn height_m(now: BootMs, vehicle: &Vehicle) -> Option<f32> {
    let global = vehicle.global.within(now, MOTION_AGE).map(|global| global.relative_altitude.0);
    let local = || vehicle.local.within(now, MOTION_AGE).map(|local| -local.position[2].0);
    global.or_else(local).filter(|height_m| height_m.is_finite())
}

fn displayed(now: BootMs, vehicle: &Vehicle, figure: impl FnOnce(&Hud) -> Option<f32>) -> Option<f32> {
    vehicle.hud.within(now, MOTION_AGE).and_then(figure).filter(|figure| figure.is_finite())
}

/// The part of the throttle that the autopilot gives.
pub fn throttle(now: BootMs, vehicle: &Vehicle) -> Option<f32> {
    displayed(now, vehicle, |hud| Some(hud.throttle?.0))
}

pub(crate) fn airspeed_mps(now: BootMs, vehicle: &Vehicle) -> Option<f32> {
    displayed(now, vehicle, |hud| Some(hud.airspeed?.0))
        .filter(|speed| (0.0..=MetresPerSecond::MAX).contains(speed))
}

/// The altitude of the pilot's display, which is the barometer's without a position.
pub(crate) fn altitude_m(now: BootMs, vehicle: &Vehicle) -> Option<f32> {
    displayed(now, vehicle, |hud| Some(hud.altitude?.0))
}

/// Speed upwards from the best source that is fresh, in m/s.
pub fn climb_mps(now: BootMs, vehicle: &Vehicle) -> Option<f32> {
    climb_within(now, vehicle, MOTION_AGE)
}

pub(crate) fn climb_within(now: BootMs, vehicle: &Vehicle, age: Millis) -> Option<f32> {
    let global = vehicle.global.within(now, age).map(|global| -global.velocity[2].0);
    let local = || vehicle.local.within(now, age).map(|local| -local.velocity[2].0);
    let hud = || vehicle.hud.within(now, age).and_then(|hud| hud.climb).map(|climb| climb.0);
    global.or_else(local).or_else(hud).filter(|climb| climb.abs() <= MetresPerSecond::MAX)
}

/// Speed over ground from the best source that is fresh, in m/s.
pub fn ground_speed_mps(now: BootMs, vehicle: &Vehicle) -> Option<f32> {
    let level = |[north, east, _]: [MetresPerSecond; 3]| norm([north.0, east.0]);
    let global = vehicle.global.within(now, MOTION_AGE).map(|global| level(global.velocity));
    let local = || vehicle.local.within(now, MOTION_AGE).map(|local| level(local.velocity));
    let hud = || displayed(now, vehicle, |hud| Some(hud.groundspeed?.0));
    global.or_else(local).or_else(hud).filter(|speed| (0.0..=MetresPerSecond::MAX).contains(speed))
}

/// Beyond 45 degrees of roll or pitch rotors carry less than 0.7 of their thrust upwards. No level flight is there,
/// and a vehicle at rest there has fallen over.
pub(crate) const TILTED_RAD: f32 = core::f32::consts::FRAC_PI_4;
/// Above this height over the place of arming a vehicle is in the air and clear of the ground. Heights of receivers
/// and barometers move by a metre while it stands.
pub(crate) const CLEAR_M: f32 = 1.5;
/// Within this height of the place of arming it is on the ground, m.
pub(crate) const LOW_M: f32 = 1.0;
/// Slower than this it may stand: estimators wander by half of it.
pub(crate) const STILL_MPS: f32 = 1.0;
pub(crate) const MOVES_MPS: f32 = 1.5;
/// A climb or sink slower than this may be none: an estimator of a hover trembles, and has offsets.
pub(crate) const HANGS_MPS: f32 = 0.3;
/// Wings carry a vehicle that is faster, and not one that is slower than half of it.
pub(crate) const WINGS_MPS: f32 = 8.0;
/// Time after which a receiver without speed stands: its speed is a Doppler measurement, good to some tenths of a
/// metre a second.
const STANDS: Millis = Millis::from_secs(3);
/// Heights of a receiver that stands stay within this, m.
const RECEIVER_M: f32 = 3.0;
/// Time for which an estimate that moved against the receiver counts as lost.
const STRAYED: Millis = Millis::from_secs(5);

/// The greatest value of the last half to whole second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct WindowMax {
    now: f32,
    before: f32,
    window: BootMs,
}

impl WindowMax {
    pub(crate) const SPAN: Millis = Millis::from_millis(600);

    pub(crate) fn take(&mut self, at: BootMs, value: f32) {
        if at.since(self.window) >= Self::SPAN {
            (self.before, self.now, self.window) = (self.now(at), 0.0, at);
        }
        self.now = self.now.max(value);
    }

    pub(crate) fn now(&self, at: BootMs) -> f32 {
        if at.since(self.window) <= PAUSE { self.now } else { 0.0 }
    }

    pub(crate) fn greatest(&self, at: BootMs) -> f32 {
        if at.since(self.window) <= PAUSE { self.now.max(self.before) } else { 0.0 }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Kinematics {
    pub(crate) speed: WindowMax,
    pub(crate) sink: WindowMax,
    /// Height of the place of arming, m; `None` if the arming was not received.
    armed_m: Option<f32>,
    idle_m: Option<f32>,
    /// When the receiver moved last, and its altitude since, m.
    moved_at: Option<BootMs>,
    stood_at_m: f32,
    strayed_at: Option<BootMs>,
}

impl Kinematics {
    pub(crate) fn arm(&mut self, now: BootMs, vehicle: &Vehicle, armed: bool) {
        self.armed_m = height_m(now, vehicle).filter(|_| armed);
    }

    pub(crate) fn idle(&mut self, now: BootMs, vehicle: &Vehicle) {
        self.idle_m = altitude_m(now, vehicle).or(self.idle_m);
    }

    /// Above the place of arming, m, by the position; above home if the arming was not received; by the display without a
    /// position.
    pub(crate) fn rise_m(&self, now: BootMs, vehicle: &Vehicle) -> Option<f32> {
        let by_position = height_m(now, vehicle).map(|height_m| height_m - self.armed_m.unwrap_or(0.0));
        let by_display =
            || self.idle_m.zip(altitude_m(now, vehicle)).map(|(stood_m, altitude_m)| altitude_m - stood_m);
        by_position.or_else(by_display)
    }

    pub(crate) fn step(&mut self, now: BootMs, vehicle: &Vehicle) {
        let receiver = vehicle.gnss[0].within(now, PAUSE).filter(|gnss| gnss.is_exact());
        let slow = receiver.and_then(|gnss| gnss.speed).filter(|speed| speed.0 < STILL_MPS);
        let height_m = receiver.and_then(|gnss| gnss.altitude).map_or(0.0, |altitude| altitude.0);
        let Some(speed) = slow.filter(|_| (height_m - self.stood_at_m).abs() <= RECEIVER_M) else {
            (self.moved_at, self.stood_at_m, self.strayed_at) = (Some(now), height_m, None);
            return;
        };
        let ground_mps = ground_speed_mps(now, vehicle).unwrap_or(0.0);
        let stands = self.moved_at.is_some_and(|at| now.since(at) >= STANDS);
        if stands && ground_mps > speed.0 + 2.0 * STILL_MPS {
            self.strayed_at = Some(now);
        }
    }

    pub(crate) fn has_strayed(&self, now: BootMs) -> bool {
        self.strayed_at.is_some_and(|at| now.since(at) <= STRAYED)
    }
}
