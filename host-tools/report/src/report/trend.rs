//! The session against those before it on the same card.

use hums_blackbox::record::Vehicle;
use serde::Serialize;

use crate::names::{autopilot_name, type_name};
use crate::summary::Overview;
use crate::utc::iso8601;

/// Sessions before this one that are compared with at most.
const EARLIER_MAX: usize = 30;

/// Counters followed from session to session, with title and decimals. A count over a session is divided by
/// its time in the air if that makes sessions comparable.
const FOLLOWED: [(&str, &str, &str, bool); 9] = [
    ("flight_time_s", "Time in the air", "s", false),
    ("vibration_max_m_s2", "Vibration, highest", "m/s\u{b2}", false),
    ("voltage_min_v", "Battery voltage, lowest", "V", false),
    ("current_max_a", "Battery current, highest", "A", false),
    ("charge_ah", "Charge per hour in the air", "Ah/h", true),
    ("energy_wh", "Energy per hour in the air", "Wh/h", true),
    ("load_factor_max_g", "Load factor, highest", "g", false),
    ("touchdown_max_m_s", "Touchdown, fastest", "m/s", false),
    ("hard_landings", "Hard landings", "", false),
];
/// Shorter flights give no rates per hour, seconds.
const FLIGHT_MIN_S: f64 = 30.0;

/// The comparison.
#[derive(Debug, Serialize)]
pub struct Trend {
    sessions: Vec<SessionJson>,
    rows: Vec<RowJson>,
}

#[derive(Clone, Debug, Serialize)]
struct SessionJson {
    name: String,
    start_utc: Option<String>,
}

#[derive(Debug, Serialize)]
struct RowJson {
    title: &'static str,
    unit: &'static str,
    /// One a session; `null` without one.
    values: Vec<Option<f64>>,
}

/// The data that later sessions are compared with.
#[derive(Clone, Debug)]
pub struct Session {
    json: SessionJson,
    /// System, unique id, autopilot and type, if known.
    vehicle: Option<(u8, u64, u8, u8)>,
    /// The airframe, as far as known: see [`airframe`].
    pub airframe: Option<String>,
    /// By [`FOLLOWED`].
    values: [Option<f64>; FOLLOWED.len()],
    worrying: f64,
}

impl Session {
    /// The trend's entry for a session.
    pub fn of(log: &Overview) -> Self {
        let start_utc = log.ending.summary.first.and_then(|first| log.utc_us(first)).map(iso8601);
        let vehicle = log
            .contents
            .vehicle
            .map(|vehicle| (vehicle.system, vehicle.uid, vehicle.autopilot, vehicle.vehicle_type));
        Self {
            json: SessionJson { name: log.ending.name.clone(), start_utc },
            airframe: log.contents.vehicle.as_ref().map(airframe),
            vehicle,
            values: FOLLOWED.map(|(counter, _, _, hourly)| value(log, counter, hourly)),
            worrying: worrying(log),
        }
    }
}

impl Session {
    /// Its start, UTC, if known.
    pub fn start_utc(&self) -> Option<&str> {
        self.json.start_utc.as_deref()
    }
}

/// The airframe, as a part of a file's name: by the autopilot's unique id, or else by system, autopilot and
/// type.
pub fn airframe(vehicle: &Vehicle) -> String {
    if vehicle.uid != 0 {
        return format!("uid-{:016x}", vehicle.uid);
    }
    let kind = format!("{} {}", autopilot_name(vehicle.autopilot), type_name(vehicle.vehicle_type));
    let kind: String =
        kind.to_lowercase().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    format!("system-{}-{kind}", vehicle.system)
}

/// Compares a session with those before it of the same vehicle, as far as the vehicle is known.
pub fn of(this: &Session, earlier: &[Session]) -> Trend {
    let of_vehicle =
        |other: &&Session| this.vehicle.is_none() || other.vehicle.is_none() || this.vehicle == other.vehicle;
    let mut sessions: Vec<&Session> = earlier.iter().filter(of_vehicle).collect();
    sessions.drain(..sessions.len().saturating_sub(EARLIER_MAX));
    sessions.push(this);
    let followed = FOLLOWED.iter().enumerate();
    let mut rows: Vec<RowJson> = followed
        .map(|(place, &(_, title, unit, _))| RowJson {
            title,
            unit,
            values: sessions.iter().map(|session| session.values.get(place).copied().flatten()).collect(),
        })
        .collect();
    let findings = sessions.iter().map(|session| Some(session.worrying)).collect();
    rows.push(RowJson { title: "Findings, warning or worse", unit: "", values: findings });
    rows.retain(|row| row.values.iter().any(Option::is_some));
    Trend { sessions: sessions.iter().map(|session| session.json.clone()).collect(), rows }
}

fn value(log: &Overview, counter: &str, hourly: bool) -> Option<f64> {
    let value = log.contents.usage.get(counter).copied()?;
    if !hourly {
        return Some(value);
    }
    let flown_s =
        log.contents.usage.get("flight_time_s").copied().filter(|flown_s| *flown_s >= FLIGHT_MIN_S)?;
    Some(value / flown_s * 3600.0)
}

fn worrying(log: &Overview) -> f64 {
    log.contents.findings.iter().filter(|finding| finding.is_bad()).count() as f64
}
