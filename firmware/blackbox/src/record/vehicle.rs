//! Records of the vehicle, its and our parameters, and the date.

use hums_core::clock::Instant;

use super::stored::{Fields, Sink};

/// The vehicle that is recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Vehicle {
    /// MAVLink system id.
    pub system: u8,
    /// MAVLink component id.
    pub component: u8,
    /// `MAV_AUTOPILOT`.
    pub autopilot: u8,
    /// `MAV_TYPE`.
    pub vehicle_type: u8,
    /// `AUTOPILOT_VERSION.flight_sw_version`, 0 if unknown.
    pub firmware: u32,
    /// `AUTOPILOT_VERSION.uid`, 0 if unknown.
    pub uid: u64,
}

impl Vehicle {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(2).u32(self.firmware).u64(self.uid);
        sink.u8(self.system).u8(self.component).u8(self.autopilot).u8(self.vehicle_type);
    }

    pub(super) fn read(fields: &mut Fields<'_>) -> Self {
        Self {
            system: fields.u8(),
            component: fields.u8(),
            autopilot: fields.u8(),
            vehicle_type: fields.u8(),
            firmware: fields.u32(),
            uid: fields.u64(),
        }
    }
}

/// A parameter's value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parameter<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its value; integers are exact up to 2^53.
    pub value: f64,
    /// `false`: the table at the start; `true`: just now.
    pub changed: bool,
    /// MAVLink system and component id; 0, 0 for the monitor.
    pub by: (u8, u8),
}

impl<'a> Parameter<'a> {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(3).f64(self.value).name(self.name).u8(u8::from(self.changed));
        sink.u8(self.by.0).u8(self.by.1);
    }

    pub(super) fn read(fields: &mut Fields<'a>) -> Self {
        Self {
            name: fields.text(),
            value: fields.f64(),
            changed: fields.u8() != 0,
            by: (fields.u8(), fields.u8()),
        }
    }
}

/// The two clocks at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clock {
    /// The monitor's clock.
    pub boot: Instant,
    /// Microseconds since 1970.
    pub utc_micros: u64,
    /// The source of UTC: 0 unknown, 1 `SYSTEM_TIME`, 2 the recording's own times, 3 GNSS.
    pub source: u8,
}

impl Clock {
    /// UTC at the box's power-on, microseconds since 1970.
    pub const fn epoch_micros(&self) -> u64 {
        self.utc_micros.saturating_sub(self.boot.as_micros())
    }

    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(4).time(self.boot).u64(self.utc_micros).u8(self.source);
    }

    pub(super) fn read(fields: &mut Fields<'_>) -> Self {
        Self { boot: fields.instant(), utc_micros: fields.u64(), source: fields.u8() }
    }
}
