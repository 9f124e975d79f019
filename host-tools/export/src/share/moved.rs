//! Places, times and pressures, moved by the same amount in the whole copy; altitudes by the first one of each field.

use std::collections::BTreeMap;

use hums_core::clock::Instant;
use hums_core::observation::{Air, GlobalPosition, Gnss, Hud, Observation};
use hums_core::units::{Hectopascals, Metres, Position};
use hums_dialect::Kind;

use super::rules::{FieldRule, Rule};
use crate::mavlink::ids::{GLOBAL_POSITION_INT, GPS_RAW_INT, VFR_HUD};

/// The first time of each copy: 2020-01-01T00:00:00Z.
pub(super) const SHARED_UTC_US: u64 = 1_577_836_800_000_000;
/// The first place of each copy, degrees: in the Atlantic.
const SHARED: (f64, f64) = (45.0, -30.0);
/// Standard pressure, hPa: the first one of each copy.
const SHARED_HPA: f64 = 1013.25;
/// A step of UTC of at least this long is a clock that was set: an hour.
const SET_US: u64 = 3_600_000_000;
/// A step of an altitude of more metres is another reference: an estimator learns its height above sea level.
const SET_M: f64 = 50.0;
/// A time from here on is UTC in microseconds: 1973. An earlier one counts from power-on.
const UTC_MIN_US: u64 = 100_000_000_000_000;

#[derive(Clone, Debug, Default)]
pub(super) struct Displacement {
    place: Option<(f64, f64)>,
    /// By message and place in it: zero of the copy, and the last altitude, m.
    altitudes: BTreeMap<(u32, usize), [f64; 2]>,
    pressure_hpa: Option<f64>,
    utc_us: Option<u64>,
}

impl Displacement {
    /// The first place is the beginning. Zero is no place.
    pub(super) fn begin(&mut self, latitude_deg: f64, longitude_deg: f64) {
        if latitude_deg != 0.0
            && longitude_deg != 0.0
            && latitude_deg.abs() <= 90.0
            && longitude_deg.abs() <= 180.0
        {
            self.place.get_or_insert((latitude_deg, longitude_deg));
        }
    }

    fn latitude(&self, degrees: f64) -> f64 {
        self.place.map_or(0.0, |(first, _)| (SHARED.0 + degrees - first).clamp(-90.0, 90.0))
    }

    fn longitude(&self, degrees: f64) -> f64 {
        self.place.map_or(0.0, |(latitude, first)| {
            let scale = latitude.to_radians().cos() / SHARED.0.to_radians().cos();
            (SHARED.1 + (degrees - first) * scale).clamp(-180.0, 180.0)
        })
    }

    /// An altitude above sea level counts from the first one of its field: fields have references of their own. A step begins anew,
    /// because it would tell the height of the place. Zero is none.
    fn altitude(&mut self, field: (u32, usize), metres: f64) -> f64 {
        if metres == 0.0 || !metres.is_finite() {
            return 0.0;
        }
        let [zero, last] = self.altitudes.entry(field).or_insert([metres; 2]);
        if (metres - *last).abs() > SET_M {
            *zero = metres;
        }
        *last = metres;
        metres - *zero
    }

    fn pressure(&mut self, hpa: f64) -> f64 {
        if hpa > 0.0 { SHARED_HPA + hpa - *self.pressure_hpa.get_or_insert(hpa) } else { 0.0 }
    }

    fn time(&mut self, at: Instant, us: u64) -> u64 {
        if us < UTC_MIN_US {
            return us;
        }
        let begin_us = us.saturating_sub(at.as_micros());
        // A clock that is set begins the copy's time anew: the step would tell the date.
        let known = self.utc_us.filter(|known| known.abs_diff(begin_us) < SET_US);
        let zero = *self.utc_us.insert(known.unwrap_or(begin_us));
        SHARED_UTC_US.saturating_add(us).saturating_sub(zero)
    }

    /// A field's bytes, moved by its rule; zero if its type is not the rule's.
    pub(super) fn field(
        &mut self,
        at: Instant,
        message: u32,
        field: &FieldRule,
        rule: Rule,
        bytes: &[u8],
    ) -> Vec<u8> {
        let (kind, of) = (field.kind, (message, field.at));
        let degrees = |degrees: f64| ((degrees * 1e7).round() as i32).to_le_bytes().to_vec();
        let whole = || bytes.first_chunk().map_or(0, |bytes| i32::from_le_bytes(*bytes));
        let single = || bytes.first_chunk().map_or(0.0, |bytes| f64::from(f32::from_le_bytes(*bytes)));
        match (rule, kind) {
            // What lies behind the end of a text is no text.
            (Rule::Keep, Kind::Char) => {
                let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
                let mut text = bytes[..end].to_vec();
                text.resize(bytes.len(), 0);
                text
            }
            (Rule::Keep, _) => bytes.to_vec(),
            (Rule::Latitude | Rule::Longitude, Kind::I32) if whole() == 0 => bytes.to_vec(),
            (Rule::Latitude, Kind::I32) => degrees(self.latitude(f64::from(whole()) / 1e7)),
            (Rule::Longitude, Kind::I32) => degrees(self.longitude(f64::from(whole()) / 1e7)),
            (Rule::Altitude, Kind::I32) => {
                ((self.altitude(of, f64::from(whole()) / 1e3) * 1e3).round() as i32).to_le_bytes().to_vec()
            }
            (Rule::Altitude, Kind::F32) => (self.altitude(of, single()) as f32).to_le_bytes().to_vec(),
            (Rule::Pressure, Kind::F32) => (self.pressure(single()) as f32).to_le_bytes().to_vec(),
            (Rule::Time, Kind::U64) => {
                let us = bytes.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
                self.time(at, us).to_le_bytes().to_vec()
            }
            _ => vec![0; bytes.len()],
        }
    }

    fn position(&mut self, position: Option<Position>) -> Option<Position> {
        let Position { latitude_deg, longitude_deg } = position?;
        self.begin(latitude_deg, longitude_deg);
        Some(Position {
            latitude_deg: self.latitude(latitude_deg),
            longitude_deg: self.longitude(longitude_deg),
        })
    }

    fn metres(&mut self, message: u32, altitude: Metres) -> Metres {
        Metres(self.altitude((message, 0), altitude.0.into()) as f32)
    }

    fn air(&mut self, air: &Air) -> Air {
        Air { pressure: air.pressure.map(|hpa| Hectopascals(self.pressure(hpa.0.into()) as f32)), ..*air }
    }

    /// An observation without where and who; `None` if it stays out.
    pub(super) fn observation(&mut self, observation: &Observation) -> Option<Observation> {
        Some(match observation {
            Observation::GlobalPosition(global) => Observation::GlobalPosition(GlobalPosition {
                position: self.position(global.position),
                altitude: self.metres(GLOBAL_POSITION_INT, global.altitude),
                ..*global
            }),
            Observation::Gnss(gnss) => Observation::Gnss(Gnss {
                position: self.position(gnss.position),
                altitude: gnss.altitude.map(|altitude| self.metres(GPS_RAW_INT, altitude)),
                measured_ms: None,
                ..*gnss
            }),
            Observation::Hud(hud) => {
                let altitude = hud.altitude.map(|altitude| self.metres(VFR_HUD, altitude));
                Observation::Hud(Hud { altitude, ..*hud })
            }
            Observation::Air(air) => Observation::Air(self.air(air)),
            Observation::ImuAndAir(imu, air) => Observation::ImuAndAir(*imu, self.air(air)),
            Observation::Heartbeat(_)
            | Observation::SystemStatus(_)
            | Observation::Imu(_)
            | Observation::Attitude(_)
            | Observation::LocalPosition(_)
            | Observation::Outputs(_)
            | Observation::Battery(_)
            | Observation::Landed(..) => *observation,
            _ => return None,
        })
    }
}
