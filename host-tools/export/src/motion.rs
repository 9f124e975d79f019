//! Place, attitude and motion of the vehicle, from its observations: for formats that draw a track.

use hums_core::observation::{Attitude, Battery, Observation, SystemStatus};
use hums_core::units::Position;
use hums_core::vehicle::Vehicle;

use crate::story::HeldObservation;

/// Metres of a degree of latitude, on the sphere of the mean radius of the earth (6,371,009 m).
const DEGREE_M: f64 = 111_195.08;

/// A place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fix {
    /// Degrees, north positive.
    pub latitude_deg: f64,
    /// Degrees, east positive.
    pub longitude_deg: f64,
    /// Above mean sea level, m.
    pub altitude_m: f32,
    /// Above home, m; `None` if the vehicle does not report it.
    pub height_m: Option<f32>,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Motion {
    vehicle: Vehicle,
    /// The first place.
    origin: Option<Fix>,
}

impl Motion {
    pub(crate) fn observe(&mut self, observed: &HeldObservation) -> bool {
        let own = self.vehicle.observe(observed.at.into(), observed.source, &observed.observation);
        if own {
            self.origin = self.origin.or_else(|| self.fix_by(&observed.observation));
        }
        own
    }

    pub(crate) const fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// The place that an observation reports: the fused one, or that of the first receiver if the autopilot sends no fused one.
    pub(crate) fn fix_by(&self, observation: &Observation) -> Option<Fix> {
        let of = |position: Position, altitude_m, height_m| {
            let Position { latitude_deg, longitude_deg } = position;
            Fix { latitude_deg, longitude_deg, altitude_m, height_m }
        };
        match observation {
            Observation::GlobalPosition(global) => {
                Some(of(global.position?, global.altitude.0, Some(global.relative_altitude.0)))
            }
            Observation::Gnss(gnss) if gnss.instance == 0 && self.vehicle.global.get().is_none() => {
                Some(of(gnss.position?, gnss.altitude?.0, None))
            }
            _ => None,
        }
    }

    /// The battery of an observation: the autopilot's own figures are the first battery's while none reports itself.
    pub(crate) fn battery_by(&self, observation: &Observation) -> Option<Battery> {
        match observation {
            Observation::Battery(battery) => Some(*battery),
            &Observation::SystemStatus(SystemStatus { voltage, current, remaining, .. }) => {
                let is_alone = self.vehicle.batteries.iter().all(|slot| slot.get().is_none());
                let battery = Battery { voltage, current, remaining, ..Battery::default() };
                voltage.filter(|_| is_alone).map(|_| battery)
            }
            _ => None,
        }
    }

    /// North, east and down of the local origin, m: the estimator's, or from the first place on.
    pub(crate) fn local(&self) -> Option<[f64; 3]> {
        if let Some(local) = self.vehicle.local.get() {
            return Some(local.position.map(|part| f64::from(part.0)));
        }
        let (origin, global) = (self.origin?, self.vehicle.global.get()?);
        Some(between(origin, self.fix_by(&Observation::GlobalPosition(*global))?))
    }

    pub(crate) fn velocity(&self) -> Option<[f32; 3]> {
        let local = self.vehicle.local.get().map(|local| local.velocity);
        let velocity = local.or_else(|| self.vehicle.global.get().map(|global| global.velocity))?;
        Some(velocity.map(|part| part.0))
    }
}

/// North, east and down from one place to another, m. Exact to a thousandth for some ten kilometres.
fn between(from: Fix, to: Fix) -> [f64; 3] {
    let north = (to.latitude_deg - from.latitude_deg) * DEGREE_M;
    let east = (to.longitude_deg - from.longitude_deg) * DEGREE_M * from.latitude_deg.to_radians().cos();
    [north, east, f64::from(from.altitude_m - to.altitude_m)]
}

/// The rotation from the body (forward, right, down) to north, east, down, as a quaternion, real part first.
pub(crate) fn quaternion(attitude: &Attitude) -> [f64; 4] {
    of_angles([attitude.roll, attitude.pitch, attitude.yaw].map(|angle| f64::from(angle.0)))
}

/// The rotation from the body (forward, left, up) to east, north, up, as a quaternion, real part first.
pub(crate) fn quaternion_up(attitude: &Attitude) -> [f64; 4] {
    let [roll, pitch, yaw] = [attitude.roll, attitude.pitch, attitude.yaw].map(|angle| f64::from(angle.0));
    of_angles([roll, -pitch, std::f64::consts::FRAC_PI_2 - yaw])
}

fn of_angles(angles: [f64; 3]) -> [f64; 4] {
    let [(sr, cr), (sp, cp), (sy, cy)] = angles.map(|angle| (angle / 2.0).sin_cos());
    [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
}
