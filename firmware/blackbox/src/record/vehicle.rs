//! Records of the vehicle, its and our parameters, and the date.

use hums_core::clock::Instant;

use super::stored::{Field, Fields, Sink, record};

record! {
    /// The vehicle that is recorded.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    Vehicle {
        /// MAVLink system id.
        system: u8,
        /// MAVLink component id.
        component: u8,
        /// `MAV_AUTOPILOT`.
        autopilot: u8,
        /// `MAV_TYPE`.
        vehicle_type: u8,
        /// `AUTOPILOT_VERSION.flight_sw_version`, 0 if unknown.
        firmware: u32,
        /// `AUTOPILOT_VERSION.uid`, 0 if unknown.
        uid: u64,
    }
}

record! {
    /// A parameter's value.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    Parameter<'a> {
        /// Its name.
        name: &'a str,
        /// Its value; integers are exact up to 2^53.
        value: f64,
        /// `false`: the table at the start; `true`: just now.
        changed: bool,
        /// MAVLink system and component id; 0, 0 for the monitor.
        by: (u8, u8),
    }
}

record! {
    /// The two clocks at one moment.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    Clock {
        /// The monitor's clock.
        boot: Instant,
        /// Microseconds since 1970.
        utc_micros: u64,
        /// The source of UTC: 0 unknown, 1 `SYSTEM_TIME`, 2 the recording's own times, 3 GNSS.
        source: u8,
    }
}

impl Clock {
    /// UTC at the box's power-on, microseconds since 1970.
    pub const fn epoch_micros(&self) -> u64 {
        self.utc_micros.saturating_sub(self.boot.as_micros())
    }
}
