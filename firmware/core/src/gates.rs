//! Conditions of the flight, as bits: computed once a step.

use crate::flight::Flight;
use crate::motion::{STILL_MPS, climb_mps, ground_speed_mps};
use crate::observation::{Gnss, VehicleKind};
use crate::thrust::Power;
use crate::time::{BootMs, Millis, PAUSE, Stamp};
use crate::vehicle::Vehicle;

/// In the air.
pub(crate) const AIRBORNE: u16 = 1 << 0;
/// In the air for three seconds.
pub(crate) const SETTLED: u16 = 1 << 1;
/// Away from the ground, as far as that is known: near it legs shake sensors, and hold the vehicle.
pub(crate) const CLEAR: u16 = 1 << 2;
/// It turned slower than 40 degrees a second for a second.
pub(crate) const STILL: u16 = 1 << 3;
/// It climbs or sinks slower than 2 m/s and leans less than 34 degrees, as far as that is known. It may be fast.
pub(crate) const LEVEL: u16 = 1 << 4;
pub(crate) const ROTORS: u16 = 1 << 5;
/// A rotorcraft or a plane: one set of axes. A tail-sitter has two.
pub(crate) const ONE_FRAME: u16 = 1 << 6;
/// The vehicle flies on rotors; so may a VTOL.
pub(crate) const HOVERS: u16 = 1 << 7;
/// Wings control it, or rotors with thrust, as far as that is known. In its transition a VTOL has both.
pub(crate) const CONTROLLED: u16 = 1 << 8;
/// The first receiver has been exact for 15 s: `AHRS_RP_P` 0.2 makes DCM level within three time constants of 5 s.
pub(crate) const EXACT: u16 = 1 << 9;

/// Its rotors move it: with all their thrust a vehicle in the air is faster than one that is held or carried.
pub(crate) const DRIVEN: u16 = 1 << 10;

pub(crate) const TURNED: Millis = Millis::from_secs(1);
const EXACT_FOR: Millis = Millis::from_secs(15);
/// A faster climb or sink is not level, and shows in the pressure.
pub(crate) const LEVEL_MPS: f32 = 2.0;
/// 34 degrees: a bank in which all the thrust may not carry a multicopter.
pub(crate) const LEANS_RAD: f32 = 0.6;

state! {
    pub(crate) struct Gates {
        open: u16,
        inexact_at: Stamp,
    }
}

impl Gates {
    /// Only these gates are open.
    #[cfg(test)]
    pub(crate) fn open(open: u16) -> Self {
        Self { open, ..Self::default() }
    }

    pub(crate) const fn are(self, all: u16) -> bool {
        self.open & all == all
    }

    pub(crate) fn step(&mut self, now: BootMs, vehicle: &Vehicle, flight: &Flight) {
        let receiver = &vehicle.gnss[0];
        let exact = receiver.within(now, PAUSE).is_some_and(Gnss::is_exact);
        if !exact && receiver.get().is_some() {
            self.inexact_at = Stamp::at(now);
        }
        let kind = vehicle.kind();
        let hovers = vehicle.hovers(now) == Some(true);
        let rotors = kind == VehicleKind::Rotorcraft;
        let power = flight.power(now, vehicle);
        let has_thrust = !flight.thrust.has_flown || power != Some(Power::Idle);
        let moves = |mps: Option<f32>| mps.is_none_or(|mps| mps.abs() > STILL_MPS);
        let moves = || moves(climb_mps(now, vehicle)) || moves(ground_speed_mps(now, vehicle));
        self.open = 0;
        for (gate, is_open) in [
            (AIRBORNE, flight.airborne()),
            (SETTLED, flight.is_settled(now)),
            (CLEAR, flight.is_clear),
            (STILL, vehicle.inertial.turns_little(now, TURNED)),
            (LEVEL, is_level(now, vehicle)),
            (ROTORS, rotors),
            (ONE_FRAME, rotors || kind == VehicleKind::Plane),
            (HOVERS, hovers),
            (CONTROLLED, if hovers { has_thrust } else { kind != VehicleKind::Vtol }),
            (DRIVEN, !hovers || power != Some(Power::Full) || moves()),
            (EXACT, exact && self.inexact_at.age(now).is_none_or(|age| age > EXACT_FOR)),
        ] {
            self.open |= if is_open { gate } else { 0 };
        }
    }
}

fn is_level(now: BootMs, vehicle: &Vehicle) -> bool {
    let climbs = climb_mps(now, vehicle).is_some_and(|climb| climb.abs() > LEVEL_MPS);
    !climbs && !vehicle.attitude.get().is_some_and(|attitude| attitude.lean_rad() > LEANS_RAD)
}
