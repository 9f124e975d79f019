//! Reports of a mishap: kind and place.

use crate::motion::height_m;
use crate::parameters::Param;
use crate::time::BootMs;
use crate::vehicle::Vehicle;

numbered! {
    /// What was seen. The numbers are those of the checks in their table.
    pub enum MishapKind {
        /// Nothing carries the vehicle; in seconds.
        FreeFall "free_fall",
        /// It hit something; load factor in g.
        Impact "impact",
        /// It turns over and over; in degrees a second.
        Tumbling "tumbling",
        /// It was disarmed in the air; height above home in metres.
        Disarmed "disarmed_in_air",
        /// It sinks without a command; in m/s.
        Sinking "sinking",
        /// It was turned over by its own rotors, or lies over; degrees of tilt.
        Overturned "overturned",
    }
}

impl MishapKind {
    pub(crate) const fn limit(self) -> Param {
        match self {
            Self::FreeFall => Param::MisFallTime,
            Self::Impact => Param::MisImpact,
            Self::Tumbling => Param::MisTumble,
            Self::Disarmed => Param::MisDisarm,
            Self::Sinking => Param::MisSink,
            Self::Overturned => Param::MisOverturn,
        }
    }
}

/// A place that can be told: 1e-7 degrees, and metres above home.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Location {
    /// Latitude and longitude in 1e-7 degrees, north and east positive; `None` where it is not known.
    pub position: Option<(i32, i32)>,
    /// Above home.
    pub height_m: i16,
}

impl Location {
    pub(crate) fn of(now: BootMs, vehicle: &Vehicle) -> Self {
        let e7 = |degrees: f64| (degrees * 1e7) as i32;
        let global = vehicle.global.get().and_then(|global| global.position);
        let position = global.map(|position| (e7(position.latitude_deg), e7(position.longitude_deg)));
        Self { position, height_m: height_m(now, vehicle).unwrap_or(0.0) as i16 }
    }
}

/// A mishap begins or ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MishapChange {
    /// It was seen in a flight.
    Began(MishapKind),
    /// The vehicle is down.
    Down,
    /// It flies on.
    FliesOn,
    /// A vehicle that was down flies again.
    FliesAgain,
    /// It was seen, but not in a flight.
    OnBench(MishapKind),
}

/// A report to the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Report {
    /// What happened.
    pub change: MishapChange,
    /// Where.
    pub place: Location,
    /// How fast it touched, tenths of a metre a second.
    pub touch: u16,
}
