//! `hums check --json`: an object a line. Its names are a contract: `docs/json.md`.

use hums_core::clock::Instant;
use serde::Serialize;

use super::checked::Checked;
use super::flights::Flight;
use super::judged::{JudgedBy, Judgement};
use super::problem::Problem;
use super::text::firmware;
use crate::log_json::{FindingJson, finite};
use crate::names::{autopilot_name, type_name, vocabulary};
use crate::source::item::{FactKind, Gap};
use crate::states;
use crate::utc::iso8601;

/// Rises when a name goes or changes its meaning.
const VERSION: u32 = 1;

#[derive(Serialize)]
struct LogJson<'a> {
    schema: &'static str,
    version: u32,
    /// Path, with the session of a card: `card.img:00002`.
    log: &'a str,
    /// `hums`, `tlog`, `raw`, `dataflash`, `ulog`.
    format: &'static str,
    /// `ok`, `warning`, `critical`; `too_little`: no finding, and fewer than one check in ten had data; `unknown`: no autopilot,
    /// or no times.
    verdict: &'static str,
    /// `whole`, `repaired` (nothing is lost), `not_proved`, or `lacks` for a log with losses or damage.
    state: &'static str,
    damaged: bool,
    /// Sentences: why a log of HUMS is not proved complete, and sectors rebuilt from parity.
    not_proved: Vec<String>,
    /// `hums` (this program), `board`, or `nobody` if the verdict is `unknown`; `checked_by` in `hums info`.
    judged_by: &'static str,
    /// `null` without an autopilot.
    vehicle: Option<VehicleJson>,
    /// UTC of the first observation.
    start_utc: Option<String>,
    /// First observation, in the recording's time.
    from_s: Option<f64>,
    /// Last observation.
    to_s: Option<f64>,
    /// Without gaps.
    armed_s: f64,
    /// In the air, without gaps.
    flight_s: f64,
    flights: Vec<FlightJson>,
    /// The last state, if the log ends in the air.
    ends_in_air: Option<EndsInAirJson>,
    /// Restarts of the clock, joined recordings included.
    clock_restarts: u64,
    /// The worst first.
    problems: Vec<ProblemJson<'a>>,
    /// Changes of level.
    findings_count: u64,
    /// In order, at most 10,000.
    findings: Vec<FindingJson>,
    /// Checks that had data; an `_alert` only if it was raised.
    judged: &'a [&'static str],
    not_judged: Vec<NotJudgedJson<'a>>,
    /// Sentences about other things that were not judged.
    remarks: &'a [String],
    /// Damaged places.
    damage_count: u64,
    /// Losses reported by the recorder. `not_kept` is in neither count.
    loss_count: u64,
    /// At most 10,000.
    gaps: Vec<GapJson<'a>>,
}

#[derive(Serialize)]
struct VehicleJson {
    system: u8,
    component: u8,
    autopilot: String,
    r#type: String,
    version: Option<String>,
    firmware: Option<String>,
    hardware: Option<String>,
    uid: Option<String>,
}

#[derive(Serialize)]
struct FlightJson {
    /// Take-off.
    from_s: f64,
    /// Last time in the air.
    to_s: f64,
    /// Without stops and gaps.
    air_s: f64,
    /// False if the log begins in the air.
    took_off: bool,
    landed: bool,
    /// Height of a disarming in the air.
    disarmed_at_m: Option<f32>,
    /// Time of an impact.
    impact_s: Option<f64>,
    /// Time of a mishap with or without an impact.
    down_s: Option<f64>,
    /// Last message before a crash in a radio gap.
    unheard_from_s: Option<f64>,
}

#[derive(Serialize)]
struct EndsInAirJson {
    time_s: f64,
    /// Above home.
    height_m: Option<f32>,
    climb_mps: Option<f32>,
    speed_mps: Option<f32>,
    latitude_deg: Option<f64>,
    longitude_deg: Option<f64>,
}

#[derive(Serialize)]
struct ProblemJson<'a> {
    subsystem: &'static str,
    check: &'a str,
    /// From 0.
    instance: u8,
    level: &'static str,
    time_s: f64,
    time_utc: Option<String>,
    /// In all.
    seconds: f64,
    times: u32,
    to_the_end: bool,
    /// Value at `time_s`.
    onset: Option<f32>,
    /// The worst.
    value: Option<f32>,
    /// Word for a value without a unit.
    state: Option<&'static str>,
    limit: Option<f32>,
    unit: &'a str,
    /// The check that caused it.
    because: Option<&'a str>,
    /// Texts, failsafes or sensors.
    detail: Option<String>,
    meaning: &'static str,
    action: &'static str,
}

#[derive(Serialize)]
struct NotJudgedJson<'a> {
    check: &'static str,
    why: &'a str,
}

#[derive(Serialize)]
struct GapJson<'a> {
    /// `damaged`, `cut`, `lost`, `not_kept`, `silent`, `no_times`.
    cause: &'static str,
    from_s: Option<f64>,
    to_s: Option<f64>,
    /// Byte of the uncompressed file.
    place: Option<u64>,
    bytes: u64,
    why: &'a str,
}

#[derive(Serialize)]
struct ErrorJson<'a> {
    schema: &'static str,
    version: u32,
    log: &'a str,
    error: String,
}

const SCHEMA: &str = "hums-check";

/// A log's object.
pub fn line(checked: &Checked) -> serde_json::Result<String> {
    let judged = &checked.judged;
    let utc = |at: Instant| judged.epochs.utc_us(at).map(iso8601);
    serde_json::to_string(&LogJson {
        schema: SCHEMA,
        version: VERSION,
        log: &checked.name,
        format: checked.format.name(),
        verdict: judged.verdict(),
        state: checked.soundness().name(),
        damaged: judged.damages > 0,
        not_proved: checked.faults(),
        judged_by: match judged.by {
            JudgedBy::Board => "board",
            JudgedBy::Here if judged.worst().is_none() => "nobody",
            JudgedBy::Here => "hums",
        },
        vehicle: vehicle(judged),
        start_utc: judged.span.and_then(|(first, _)| utc(first)),
        from_s: judged.span.map(|(first, _)| first.as_secs_f64()),
        to_s: judged.span.map(|(_, last)| last.as_secs_f64()),
        armed_s: seconds(judged.armed),
        flight_s: seconds(judged.flown()),
        flights: judged.flights.iter().map(flight).collect(),
        ends_in_air: judged.ends_in_air.map(|end| EndsInAirJson {
            time_s: end.at.as_secs_f64(),
            height_m: end.height_m,
            climb_mps: end.climb_mps,
            speed_mps: end.speed_mps,
            latitude_deg: end.place_deg.map(|(north, _)| north),
            longitude_deg: end.place_deg.map(|(_, east)| east),
        }),
        clock_restarts: judged.restarts,
        problems: judged.problems.iter().map(|problem| self::problem(problem, utc(problem.at))).collect(),
        findings_count: judged.findings_count,
        findings: judged
            .findings
            .iter()
            .map(|finding| FindingJson::new(finding, judged.epochs.utc_us(finding.at)))
            .collect(),
        judged: &judged.judged,
        not_judged: judged.not_judged.iter().map(|(check, why)| NotJudgedJson { check, why }).collect(),
        remarks: &judged.remarks,
        damage_count: judged.damages,
        loss_count: judged.losses,
        gaps: judged.gaps.iter().map(gap).collect(),
    })
}

/// The object of an unreadable log.
pub fn error(log: &str, error: &anyhow::Error) -> String {
    let object = ErrorJson { schema: SCHEMA, version: VERSION, log, error: format!("{error:#}") };
    serde_json::to_string(&object).unwrap_or_default()
}

fn seconds(span: hums_core::clock::Span) -> f64 {
    span.as_micros() as f64 / 1e6
}

fn vehicle(judged: &Judgement) -> Option<VehicleJson> {
    let (source, heartbeat) = judged.vehicle().source.zip(judged.vehicle().heartbeat.get())?;
    let identity = judged.vehicle().identity.get();
    let fact = |about| judged.facts.get(&about).cloned();
    Some(VehicleJson {
        system: source.system,
        component: source.component,
        autopilot: autopilot_name(heartbeat.autopilot_number),
        r#type: type_name(heartbeat.type_number),
        version: identity.and_then(|identity| firmware(identity.firmware)),
        firmware: fact(FactKind::Firmware),
        hardware: fact(FactKind::Hardware),
        uid: identity.filter(|identity| identity.uid != 0).map(|identity| format!("{:016x}", identity.uid)),
    })
}

fn flight(flight: &Flight) -> FlightJson {
    FlightJson {
        from_s: flight.from.as_secs_f64(),
        to_s: flight.to.as_secs_f64(),
        air_s: flight.air.as_micros() as f64 / 1e6,
        took_off: flight.took_off,
        landed: flight.landed,
        disarmed_at_m: flight.disarmed_at_m,
        impact_s: flight.mishap_s(true),
        down_s: flight.mishap_s(false),
        unheard_from_s: flight.unheard_s(),
    }
}

fn problem(problem: &Problem, time_utc: Option<String>) -> ProblemJson<'_> {
    let words = vocabulary(&problem.check);
    ProblemJson {
        subsystem: problem.subsystem.name(),
        check: &problem.check,
        instance: problem.instance,
        level: problem.level.name(),
        time_s: problem.at.as_secs_f64(),
        time_utc,
        seconds: seconds(problem.lasted),
        times: problem.times,
        to_the_end: problem.lasting,
        onset: finite(problem.onset),
        value: finite(problem.value),
        state: states::name(&problem.check, problem.value),
        limit: finite(problem.limit),
        unit: &problem.unit,
        because: problem.because.as_deref(),
        detail: (!problem.details.is_empty()).then(|| problem.details.join(", ")),
        meaning: states::meaning(&problem.check),
        action: words.map_or("", |words| words.action),
    }
}

fn gap(gap: &Gap) -> GapJson<'_> {
    GapJson {
        cause: gap.cause.name(),
        from_s: gap.from.map(Instant::as_secs_f64),
        to_s: gap.to.map(Instant::as_secs_f64),
        place: gap.place,
        bytes: gap.bytes,
        why: &gap.words,
    }
}
