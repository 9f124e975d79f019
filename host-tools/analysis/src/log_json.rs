//! Output of `hums info --json`. Names carry units; times are since power-on or UTC.

use std::path::Path;

use hums_core::clock::Instant;
use serde::Serialize;

use crate::ending::{BlocksJson, EndJson};
use crate::logs;
use crate::loss;
use crate::names::{autopilot_name, check_name, type_name};
use crate::printable::path;
use crate::source::item::MessageCount;
use crate::source::recording::Format;
use crate::source::told::Finding;
use crate::states;
use crate::summary::{BootLine, Contents, FlightLine, Overview};
use crate::utc::iso8601;

/// A card image's file system.
#[derive(Debug, Serialize)]
pub struct ImageJson {
    /// Card, or image of a card.
    path: String,
    /// Sentences about damage of the file system.
    damage: Vec<String>,
    /// Clusters without a file.
    lost_clusters: u64,
    /// The logs were found by a scan of all blocks.
    found_by_scan: bool,
    /// Sentence about sectors that were not read.
    not_looked_at: Option<String>,
}

impl ImageJson {
    /// With this name.
    pub fn of(image: &logs::find::Image, path: &Path) -> Self {
        Self {
            path: path.display().to_string(),
            damage: image.damage.clone(),
            lost_clusters: image.lost_clusters,
            found_by_scan: image.scanned,
            not_looked_at: image.not_looked_at(),
        }
    }
}

/// An image for people, with this name.
pub fn image_text(image: &logs::find::Image, name: &Path) -> String {
    let scan = image.scanned.then(|| "the logs were found by looking at every block".to_owned());
    let damage = image.damage.iter().map(|damage| format!("damaged: {damage}"));
    let lines = damage.chain(scan).chain(image.lost_words()).chain(image.not_looked_at());
    lines.fold(format!("Card {}", path(name)), |text, line| format!("{text}\n  {line}"))
}

/// The images of a run.
#[derive(Debug, Serialize)]
pub struct ImagesJson {
    images: Vec<ImageJson>,
}

/// The images of a run as JSON.
pub fn images_json(images: &[logs::find::Image]) -> ImagesJson {
    let json = |image: &logs::find::Image| ImageJson::of(image, &image.path);
    ImagesJson { images: images.iter().map(json).collect() }
}

/// One log.
#[derive(Debug, Serialize)]
pub struct LogJson {
    /// Name for `--session`.
    name: String,
    /// `hums`, `tlog`, `raw`, `dataflash`, `ulog`.
    format: &'static str,
    files: Vec<String>,
    /// Session number of its sectors, hexadecimal.
    session: Option<String>,
    /// The log ended in order.
    closed: bool,
    /// `null` for recordings of other programs.
    end: Option<EndJson>,
    /// First entry.
    start_utc: Option<String>,
    /// Last entry.
    end_utc: Option<String>,
    /// First entry.
    start_s: Option<f64>,
    /// Last entry.
    end_s: Option<f64>,
    duration_s: f64,
    /// The recorder.
    monitor: Option<BootLine>,
    /// `null` without an autopilot.
    vehicle: Option<VehicleJson>,
    /// MAVLink frames.
    frames: u64,
    frame_bytes: u64,
    /// Records of the monitor.
    records: u64,
    messages: Vec<MessageJson>,
    /// Frames with ids beyond the listed ones.
    frames_of_other_messages: u64,
    gaps_count: u64,
    /// Known number of frames in gaps.
    frames_missing: u64,
    /// Gaps with an unknown number of frames.
    gaps_uncounted: u64,
    /// At most 10,000.
    gaps: Vec<GapJson>,
    /// Losses of the recorder.
    losses: Vec<LossJson>,
    /// `board`, `hums` (this program), `nobody`.
    checked_by: &'static str,
    /// As in `hums-info-list`.
    checks_judged: Option<usize>,
    /// As in `hums-info-list`.
    checks_all: Option<usize>,
    /// Sentence about the vehicle's last state.
    ends_in_air: Option<String>,
    /// Take-offs and landings.
    flights: Vec<FlightJson>,
    /// Changes of level.
    findings_count: u64,
    /// At most 10,000.
    findings: Vec<FindingJson>,
    /// Counters of the session (`docs/usage.md`); those without data are left out.
    usage: serde_json::Map<String, serde_json::Value>,
    /// Counters of the airframe's life.
    lifetime: serde_json::Map<String, serde_json::Value>,
    /// Limits that were exceeded.
    exceedances: Vec<ExceedanceJson>,
    /// Parts that wear.
    components: Vec<ComponentJson>,
    /// Bytes of its sectors.
    log_bytes: u64,
    /// Bytes of a tlog with the same frames.
    tlog_bytes: u64,
    /// `null` for recordings of other programs.
    ratio: Option<f64>,
    /// Room of its files.
    bytes_on_card: u64,
    sectors: u64,
    sectors_damaged: u64,
    /// All blocks of its files.
    blocks: BlocksJson,
}

/// The vehicle of a recording.
#[derive(Debug, Serialize)]
pub struct VehicleJson {
    /// MAVLink system id.
    pub system: u8,
    /// MAVLink component id.
    pub component: u8,
    /// For instance `PX4`.
    pub autopilot: String,
    /// For instance `quadrotor`.
    pub r#type: String,
    /// The autopilot's version.
    pub firmware: Option<String>,
    /// Hexadecimal.
    pub uid: Option<String>,
}

#[derive(Debug, Serialize)]
struct MessageJson {
    /// The id, for MAVLink messages.
    id: Option<u32>,
    name: String,
    /// The checksum fits a known definition.
    verified: bool,
    frames: u64,
    bytes: u64,
}

#[derive(Debug, Serialize)]
struct GapJson {
    from_s: Option<f64>,
    to_s: Option<f64>,
    /// `missing`, `damaged`, `unknown_layouts`, `corrupt`, `altered`, `disarmed`.
    cause: &'static str,
    sectors_lost: Option<u32>,
    sectors_skipped: u32,
    frames_missing: Option<u32>,
}

#[derive(Debug, Serialize)]
struct LossJson {
    what: &'static str,
    count: u64,
    from_s: f64,
    to_s: f64,
}

#[derive(Debug, Serialize)]
struct FlightJson {
    from_s: f64,
    /// `null` if the landing is not in the log.
    to_s: Option<f64>,
}

/// A check's change of level, in all JSON of the program.
#[derive(Debug, Serialize)]
pub struct FindingJson {
    subsystem: &'static str,
    check: String,
    /// From 0.
    instance: u8,
    level: &'static str,
    /// Level before.
    previous: &'static str,
    time_s: f64,
    time_utc: Option<String>,
    /// `null` if the input stopped.
    value: Option<f32>,
    /// Worst value of this check and part in the log; only in the finding from which the problem counts.
    worst: Option<f32>,
    /// Word for a value without a unit.
    state: Option<&'static str>,
    limit: Option<f32>,
    unit: String,
}

impl FindingJson {
    /// The JSON of a finding at this UTC, microseconds since 1970.
    pub fn new(finding: &Finding, utc_us: Option<u64>) -> Self {
        Self {
            subsystem: finding.subsystem.name(),
            check: finding.check.clone(),
            instance: finding.instance,
            level: finding.level.name(),
            previous: finding.previous.name(),
            time_s: finding.at.as_secs_f64(),
            time_utc: utc_us.map(iso8601),
            value: finite(finding.value),
            worst: finding.worst,
            state: states::name(&finding.check, finding.value),
            limit: finite(finding.limit),
            unit: finding.unit.clone(),
        }
    }
}

#[derive(Debug, Serialize)]
struct ExceedanceJson {
    check: String,
    instance: u8,
    /// For people.
    name: String,
    unit: String,
    session: CrossingsJson,
    /// `null` in recordings of other programs.
    lifetime: Option<CrossingsJson>,
}

#[derive(Debug, Serialize)]
struct CrossingsJson {
    /// Number of warnings.
    warnings: u16,
    /// Number of criticals.
    criticals: u16,
    /// Duration of warnings.
    warning_s: f64,
    /// Duration of criticals.
    critical_s: f64,
    /// Worst value.
    peak: Option<f32>,
    /// Word for a peak without a unit.
    state: Option<&'static str>,
}

#[derive(Debug, Serialize)]
struct ComponentJson {
    /// Component, from 1.
    place: u8,
    kind: &'static str,
    number: u8,
    name: String,
    serial: String,
    /// `green`, `yellow`, `red`.
    status: &'static str,
    /// Of the limit that it reaches first.
    used_percent: Option<f32>,
    /// The limit that it reaches first, in words.
    limit: Option<String>,
    powered_s: f64,
    flight_s: f64,
    motor_s: f64,
    flights: f64,
    cycles: f64,
    replaced: u32,
}

fn exceedances(contents: &Contents) -> Vec<ExceedanceJson> {
    let crossings = |check: &str, of: &hums_core::health::exceedance::Crossings| CrossingsJson {
        state: states::name(check, of.peak),
        warnings: of.warnings,
        criticals: of.criticals,
        warning_s: f64::from(of.warning_tenths) / 10.0,
        critical_s: f64::from(of.critical_tenths) / 10.0,
        peak: finite(of.peak),
    };
    let json = |((check, instance), line): (&(String, u8), &crate::summary::ExceedanceLine)| ExceedanceJson {
        check: check.clone(),
        instance: *instance,
        name: check_name(check, &[*instance]),
        unit: line.unit.clone(),
        session: crossings(check, &line.session),
        lifetime: (!contents.checked_here).then(|| crossings(check, &line.lifetime)),
    };
    contents.exceedances.iter().map(json).collect()
}

fn components(contents: &Contents) -> Vec<ComponentJson> {
    let json = |(place, line): (&u8, &crate::summary::ComponentLine)| ComponentJson {
        place: *place,
        kind: line.kind,
        number: line.number,
        name: line.name.clone(),
        serial: line.serial.clone(),
        status: line.status,
        used_percent: finite(line.used_percent),
        limit: contents.part(*place, line).1,
        powered_s: line.figures.powered_s,
        flight_s: line.figures.flight_s,
        motor_s: line.figures.motor_s,
        flights: line.figures.flights,
        cycles: line.figures.cycles,
        replaced: line.replaced,
    };
    contents.components.iter().map(json).collect()
}

/// A number that JSON has.
pub fn finite(value: f32) -> Option<f32> {
    value.is_finite().then_some(value)
}

impl LogJson {
    /// A log's contents.
    pub fn new(log: &Overview) -> Self {
        let (summary, contents) = (&log.ending.summary, &log.contents);
        let utc = |at: Option<Instant>| at.and_then(|at| log.utc_us(at)).map(iso8601);
        let seconds = |at: Instant| at.as_secs_f64();
        Self {
            name: log.ending.name.clone(),
            format: log.format.map_or("hums", Format::name),
            files: log.ending.files.clone(),
            session: summary.session.map(|session| format!("{session:08x}")),
            closed: summary.closed,
            end: log.format.is_none().then(|| EndJson::new(&log.ending)),
            start_utc: utc(summary.first),
            end_utc: utc(summary.last),
            start_s: summary.first.map(seconds),
            end_s: summary.last.map(seconds),
            duration_s: duration_s(log),
            monitor: contents.boot.clone(),
            vehicle: vehicle(log),
            frames: contents.frames(),
            frame_bytes: contents.frame_bytes(),
            records: contents.records,
            messages: messages(contents),
            frames_of_other_messages: contents.other_messages.count,
            gaps_count: summary.gaps + summary.losses,
            frames_missing: summary.frames_missing,
            gaps_uncounted: summary.gaps_uncounted,
            gaps: gaps(contents),
            losses: losses(contents),
            checked_by: contents.checked_by(),
            checks_judged: contents.judged.map(|checks| checks.judged),
            checks_all: contents.judged.map(|checks| checks.all),
            ends_in_air: contents.ends_in_air.map(|end| end.to_string()),
            flights: contents.flights().into_iter().map(flight).collect(),
            findings_count: contents.findings_count,
            findings: findings(log),
            usage: contents.usage.iter().map(|(name, value)| (name.clone(), (*value).into())).collect(),
            lifetime: contents.lifetime.iter().map(|(name, value)| (name.clone(), (*value).into())).collect(),
            exceedances: exceedances(contents),
            components: components(contents),
            log_bytes: log.log_bytes(),
            tlog_bytes: contents.tlog_bytes(),
            ratio: log.ratio(),
            bytes_on_card: log.bytes_on_card,
            sectors: summary.blocks.sectors,
            sectors_damaged: summary.blocks.damaged,
            blocks: BlocksJson::new(&summary.blocks),
        }
    }
}

fn flight(flight: FlightLine) -> FlightJson {
    FlightJson { from_s: flight.from.as_secs_f64(), to_s: flight.to.map(Instant::as_secs_f64) }
}

fn messages(contents: &Contents) -> Vec<MessageJson> {
    let json = |message: &MessageCount| MessageJson {
        id: message.id.map(|(id, _)| id),
        name: message.name.clone(),
        verified: message.id.is_none_or(|(_, verified)| verified),
        frames: message.amount.count,
        bytes: message.amount.bytes,
    };
    contents.messages.iter().map(json).collect()
}

fn gaps(contents: &Contents) -> Vec<GapJson> {
    let json = |gap: &hums_blackbox::Gap| GapJson {
        from_s: gap.from.map(Instant::as_secs_f64),
        to_s: gap.to.map(Instant::as_secs_f64),
        cause: gap.cause.name(),
        sectors_lost: loss::sectors_lost(gap),
        sectors_skipped: gap.sectors_skipped,
        frames_missing: gap.frames,
    };
    contents.gaps.iter().map(json).collect()
}

fn losses(contents: &Contents) -> Vec<LossJson> {
    let json = |loss: &hums_blackbox::record::Loss| LossJson {
        what: loss.what.name(),
        count: loss.count,
        from_s: loss.from.as_secs_f64(),
        to_s: loss.to.as_secs_f64(),
    };
    contents.losses.values().map(json).collect()
}

fn findings(log: &Overview) -> Vec<FindingJson> {
    let json = |finding: &Finding| FindingJson::new(finding, log.utc_us(finding.at));
    log.contents.findings.iter().map(json).collect()
}

/// First to last time, seconds; 0 if unknown.
pub fn duration_s(log: &Overview) -> f64 {
    match (log.ending.summary.first, log.ending.summary.last) {
        (Some(first), Some(last)) => last.since(first).as_micros() as f64 / 1e6,
        _ => 0.0,
    }
}

/// The vehicle, if it was received.
pub fn vehicle(log: &Overview) -> Option<VehicleJson> {
    let vehicle = log.contents.vehicle?;
    let [major, minor, patch, _] = vehicle.firmware.to_be_bytes();
    Some(VehicleJson {
        system: vehicle.system,
        component: vehicle.component,
        autopilot: autopilot_name(vehicle.autopilot),
        r#type: type_name(vehicle.vehicle_type),
        firmware: (vehicle.firmware != 0).then(|| format!("{major}.{minor}.{patch}")),
        uid: (vehicle.uid != 0).then(|| format!("{:016x}", vehicle.uid)),
    })
}
