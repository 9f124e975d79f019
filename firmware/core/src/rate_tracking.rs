//! Setpoint tracking: how fast the vehicle turns, and whether it climbs with full throttle.
//!
//! 1. Control makes the body's rates those of the setpoint, within a fraction of a second. A motor, a propeller, a
//!    servo or a surface that fails keeps them apart ([`Comparison::RATES`]). A part of the rates of the setpoint is
//!    allowed: in fast turns a vehicle is late by much.
//! 2. Rates about the axes of the attitude's setpoint are turned to the body's first. In a fast yaw a vehicle lags
//!    that attitude by a quarter of a turn.
//! 3. With full throttle a multicopter climbs, and a plane does not sink ([`FullThrust`]).

use crate::gates::LEANS_RAD;
use crate::latest::{Latest, Reading};
use crate::modes::has_pilots_throttle;
use crate::motion::{HANGS_MPS, climb_mps};
use crate::observation::{Attitude, Hud, WantedRates};
use crate::residual::{Comparison, Residuals};
use crate::rotation;
use crate::thrust::FULL;
use crate::time::{BootMs, Millis, PAUSE};
use crate::units::RadiansPerSecond;
use crate::vehicle::Vehicle;

const FRESH: Millis = Millis::from_millis(150);
/// This part of the rates of the setpoint may be missing.
const LATE_PART: f32 = 0.3;
/// At full throttle planes sink more slowly, m/s.
const SINKS_MPS: f32 = -0.5;
/// Time after which `THRUST_WARN` reports a lasting loss.
const IN_VAIN: Millis = Millis::from_secs(2);

pub(crate) type RateSetpoint = Latest<[RadiansPerSecond; 2]>;

pub(crate) fn take_setpoint(setpoint: &mut RateSetpoint, at: BootMs, rates: WantedRates, vehicle: &Vehicle) {
    let WantedRates { about, of } = rates;
    let [roll, pitch, _] = match of.filter(|_| vehicle.is_ardupilot()) {
        Some(of) => {
            let Some(attitude) = vehicle.attitude.within(at, FRESH) else { return };
            rotation::from_axes_of(of, about.map(|rate| rate.0), attitude).map(RadiansPerSecond)
        }
        None => about,
    };
    setpoint.set(at, [roll, pitch]);
}

pub(crate) fn take_attitude(to: &mut Residuals, at: BootMs, attitude: &Attitude, setpoint: &RateSetpoint) {
    let (Some(setpoint), Some([roll, pitch, _])) = (setpoint.within(at, FRESH), attitude.rates) else {
        return;
    };
    if setpoint.iter().chain(&[roll, pitch]).all(|rate| rate.sane().is_some()) {
        for ((of, setpoint), flown) in Comparison::RATES.into_iter().zip(setpoint).zip([roll, pitch]) {
            to.take(of, at, setpoint.0 - flown.0, LATE_PART * setpoint.0.abs());
        }
    }
}

state! {
    pub(crate) struct FullThrust {
        full_since: Option<BootMs>,
        full_at: Option<BootMs>,
    }
}

impl FullThrust {
    pub(crate) fn take(&mut self, at: BootMs, hud: &Hud, vehicle: &Vehicle, is_settled: bool) {
        let (Some(throttle), Some(climb_mps)) = (hud.throttle, climb_mps(at, vehicle)) else { return };
        let level = vehicle.attitude.get().is_none_or(|attitude| attitude.lean_rad() < LEANS_RAD);
        if self.full_at.is_none_or(|before| at.since(before) > PAUSE) {
            self.full_since = None;
        }
        // After this time a loss lasts until a climb.
        let was_long = self.full_since.is_some_and(|since| at.since(since) >= IN_VAIN);
        let in_vain = match vehicle.hovers(at) {
            Some(_) if was_long => climb_mps < HANGS_MPS,
            Some(true) => level && climb_mps < HANGS_MPS,
            // A pilot may dive with all his throttle.
            Some(false) => climb_mps < SINKS_MPS && !has_pilots_throttle(vehicle),
            None => false,
        };
        let is_full = throttle.0 >= FULL && is_settled;
        self.full_at = Some(at);
        self.full_since = (is_full && in_vain).then(|| self.full_since.unwrap_or(at));
    }

    /// The duration, s.
    pub(crate) fn in_vain(&self) -> Option<Reading> {
        let at = self.full_at?;
        Some(Reading { at, value: self.full_since.map_or(0.0, |since| at.since(since).as_secs_f32()) })
    }
}
