//! `hums info`: what is in a log, for people and as JSON.

use std::fmt::Write as _;

use anyhow::Result;
use hums_core::time::Instant;
use serde::Serialize;

use crate::cli;
use crate::logs::{self, Found};
use crate::outcome::Outcome;
use crate::output;
use crate::summary::{Contents, LISTED_MAX, Overview};
use crate::utc::iso8601;

/// Findings and gaps that people are shown; the rest is counted, and is in `--json` and `hums decode`.
const SHOWN_MAX: usize = 40;

/// Runs `hums info`.
pub fn run(args: &cli::Info) -> Result<Outcome> {
    let found = logs::find(&args.inputs)?;
    for remark in &found.remarks {
        eprintln!("hums: {remark}");
    }
    let mut logs = Vec::new();
    let mut outcome = Outcome::lossy(found.images.iter().any(|image| !image.damage.is_empty()));
    if !args.json {
        for image in &found.images {
            output::line(&image_text(image))?;
        }
    }
    for log in &found.logs {
        let overview = Overview::of(log)?;
        outcome = outcome.and(Outcome::lossy(overview.is_lossy()));
        if args.json {
            logs.push(LogJson::new(&overview));
        } else {
            output::line(text(&overview).trim_end())?;
            output::line("")?;
        }
    }
    if args.json {
        output::json(&InfoJson { images: images_json(&found), logs })?;
    } else if found.logs.is_empty() {
        output::line("no log is on it")?;
    }
    Ok(outcome)
}

/// What `info --json` prints.
#[derive(Debug, Serialize)]
struct InfoJson {
    images: Vec<ImageJson>,
    logs: Vec<LogJson>,
}

/// A card image's file system.
#[derive(Debug, Serialize)]
pub struct ImageJson {
    path: String,
    damage: Vec<String>,
    lost_clusters: u64,
    found_by_scan: bool,
}

/// The images of a run as JSON.
pub fn images_json(found: &Found) -> Vec<ImageJson> {
    let json = |image: &logs::find::Image| ImageJson {
        path: image.path.display().to_string(),
        damage: image.damage.clone(),
        lost_clusters: image.lost_clusters,
        found_by_scan: image.scanned,
    };
    found.images.iter().map(json).collect()
}

#[derive(Debug, Serialize)]
struct LogJson {
    name: String,
    files: Vec<String>,
    /// As its sectors name it, hexadecimal.
    session: Option<String>,
    closed: bool,
    start_utc: Option<String>,
    end_utc: Option<String>,
    /// Seconds since the monitor's power-on.
    start_s: Option<f64>,
    end_s: Option<f64>,
    duration_s: f64,
    monitor: Option<MonitorJson>,
    vehicle: Option<VehicleJson>,
    frames: u64,
    frame_bytes: u64,
    records: u64,
    messages: Vec<MessageJson>,
    gaps_count: u64,
    frames_missing: u64,
    gaps: Vec<GapJson>,
    losses: Vec<LossJson>,
    findings_count: u64,
    findings: Vec<FindingJson>,
    usage: serde_json::Map<String, serde_json::Value>,
    log_bytes: u64,
    tlog_bytes: u64,
    ratio: f64,
    bytes_on_card: u64,
    sectors: u64,
    sectors_damaged: u64,
}

#[derive(Debug, Serialize)]
struct MonitorJson {
    version: String,
    git: String,
    board: String,
    reset: String,
    boots: u32,
}

#[derive(Debug, Serialize)]
struct VehicleJson {
    system: u8,
    component: u8,
    autopilot: String,
    r#type: String,
    firmware: Option<String>,
    uid: Option<String>,
}

#[derive(Debug, Serialize)]
struct MessageJson {
    id: u32,
    name: String,
    verified: bool,
    frames: u64,
    bytes: u64,
}

#[derive(Debug, Serialize)]
struct GapJson {
    from_s: Option<f64>,
    to_s: Option<f64>,
    cause: &'static str,
    sectors_lost: u32,
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
struct FindingJson {
    subsystem: &'static str,
    check: String,
    instance: u8,
    level: &'static str,
    previous: &'static str,
    time_s: f64,
    time_utc: Option<String>,
    /// `null` where the input stopped.
    value: Option<f32>,
    limit: Option<f32>,
    unit: String,
}

fn finite(value: f32) -> Option<f32> {
    value.is_finite().then_some(value)
}

impl LogJson {
    fn new(log: &Overview) -> Self {
        let (summary, contents) = (&log.summary, &log.contents);
        let utc = |at: Option<Instant>| at.and_then(|at| log.utc_us(at)).map(iso8601);
        let seconds = |at: Instant| at.as_secs_f64();
        Self {
            name: log.name.clone(),
            files: log.files.clone(),
            session: summary.session.map(|session| format!("{session:08x}")),
            closed: summary.closed,
            start_utc: utc(summary.first),
            end_utc: utc(summary.last),
            start_s: summary.first.map(seconds),
            end_s: summary.last.map(seconds),
            duration_s: duration_s(log),
            monitor: contents.boot.as_ref().map(|boot| MonitorJson {
                version: boot.version.clone(),
                git: boot.git.clone(),
                board: boot.board.clone(),
                reset: boot.reset.clone(),
                boots: boot.boots,
            }),
            vehicle: vehicle(log),
            frames: contents.frames(),
            frame_bytes: contents.frame_bytes(),
            records: contents.records,
            messages: messages(contents),
            gaps_count: summary.gaps,
            frames_missing: summary.frames_missing,
            gaps: gaps(contents),
            losses: losses(contents),
            findings_count: contents.findings_count,
            findings: findings(log),
            usage: contents.usage.iter().map(|(name, value)| (name.clone(), (*value).into())).collect(),
            log_bytes: log.log_bytes(),
            tlog_bytes: contents.tlog_bytes(),
            ratio: log.ratio(),
            bytes_on_card: log.bytes_on_card,
            sectors: summary.blocks.sectors,
            sectors_damaged: summary.blocks.damaged,
        }
    }
}

fn messages(contents: &Contents) -> Vec<MessageJson> {
    let json = |(&(id, verified), count): (&(u32, bool), &crate::summary::MessageCount)| MessageJson {
        id,
        name: Contents::message_name(id, true),
        verified,
        frames: count.frames,
        bytes: count.bytes,
    };
    contents.messages.iter().map(json).collect()
}

fn gaps(contents: &Contents) -> Vec<GapJson> {
    let json = |gap: &hums_blackbox::Gap| GapJson {
        from_s: gap.from.map(Instant::as_secs_f64),
        to_s: gap.to.map(Instant::as_secs_f64),
        cause: gap.cause.name(),
        sectors_lost: gap.sectors_lost,
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
    let json = |finding: &crate::summary::FindingLine| FindingJson {
        subsystem: finding.subsystem,
        check: finding.check.clone(),
        instance: finding.instance,
        level: finding.level,
        previous: finding.previous,
        time_s: finding.at.as_secs_f64(),
        time_utc: log.utc_us(finding.at).map(iso8601),
        value: finite(finding.value),
        limit: finite(finding.limit),
        unit: finding.unit.clone(),
    };
    log.contents.findings.iter().map(json).collect()
}

fn duration_s(log: &Overview) -> f64 {
    match (log.summary.first, log.summary.last) {
        (Some(first), Some(last)) => last.since(first).as_micros() as f64 / 1e6,
        _ => 0.0,
    }
}

fn vehicle(log: &Overview) -> Option<VehicleJson> {
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

/// The names of `MAV_AUTOPILOT` that are met in the field.
fn autopilot_name(number: u8) -> String {
    match number {
        0 => "generic".into(),
        3 => "ArduPilot".into(),
        12 => "PX4".into(),
        other => format!("MAV_AUTOPILOT {other}"),
    }
}

/// The names of `MAV_TYPE` that are met in the field.
fn type_name(number: u8) -> String {
    let name = match number {
        0 => "generic",
        1 => "fixed wing",
        2 => "quadrotor",
        3 => "coaxial helicopter",
        4 => "helicopter",
        10 => "ground rover",
        11 => "surface boat",
        12 => "submarine",
        13 => "hexarotor",
        14 => "octorotor",
        15 => "tricopter",
        19..=25 => "VTOL",
        29 => "dodecarotor",
        _ => return format!("MAV_TYPE {number}"),
    };
    name.into()
}

fn image_text(image: &logs::find::Image) -> String {
    let mut text = format!("Card {}", image.path.display());
    for damage in &image.damage {
        let _ = write!(text, "\n  damaged: {damage}");
    }
    if image.scanned {
        text.push_str("\n  the logs were found by looking at every block");
    }
    if image.lost_clusters > 0 {
        let _ = write!(text, "\n  {} clusters belong to no file (lost space, no data)", image.lost_clusters);
    }
    text
}

/// A log for people to read.
pub fn text(log: &Overview) -> String {
    let mut text = String::new();
    heading(&mut text, log);
    findings_text(&mut text, log);
    gaps_text(&mut text, log);
    usage_text(&mut text, log);
    messages_text(&mut text, log);
    text
}

// Writing to a String cannot fail; the results are dropped on purpose in all of the following.
fn heading(text: &mut String, log: &Overview) {
    let (summary, contents) = (&log.summary, &log.contents);
    let _ = writeln!(text, "Session {} ({}), {}", log.name, log.files.join(", "), log.ending());
    match (summary.first, summary.last) {
        (Some(first), Some(last)) => {
            let utc = |at| {
                log.utc_us(at).map_or_else(|| "UTC unknown".to_owned(), |utc| iso8601(utc / 1000 * 1000))
            };
            let _ = writeln!(text, "  from     {:>10.3} s  {}", first.as_secs_f64(), utc(first));
            let _ = writeln!(text, "  to       {:>10.3} s  {}", last.as_secs_f64(), utc(last));
        }
        _ => text.push_str("  nothing in it can be read\n"),
    }
    if let Some(vehicle) = vehicle(log) {
        let firmware = vehicle.firmware.map_or_else(String::new, |version| format!(" {version}"));
        let uid = vehicle.uid.map_or_else(String::new, |uid| format!(", uid {uid}"));
        let (autopilot, kind) = (vehicle.autopilot, vehicle.r#type);
        let _ = writeln!(text, "  vehicle  system {}, {autopilot}{firmware}, {kind}{uid}", vehicle.system);
    }
    if let Some(boot) = &contents.boot {
        let _ = writeln!(
            text,
            "  monitor  {} {} on {}, started by {}",
            boot.version, boot.git, boot.board, boot.reset
        );
    }
    let _ = writeln!(
        text,
        "  frames   {} in {} bytes, {} records; as a tlog {} bytes: {:.2} times smaller",
        contents.frames(),
        log.log_bytes(),
        contents.records,
        contents.tlog_bytes(),
        log.ratio()
    );
}

fn findings_text(text: &mut String, log: &Overview) {
    let contents = &log.contents;
    if contents.findings_count == 0 {
        text.push_str("  findings none\n");
        return;
    }
    let _ = writeln!(text, "  findings {}", contents.findings_count);
    for finding in contents.findings.iter().take(SHOWN_MAX) {
        let FindingJsonText { value, limit } = finding_numbers(finding);
        let _ = writeln!(
            text,
            "    {:>9.3} s  {:<8}  {} {}[{}]  was {}{value}{limit}",
            finding.at.as_secs_f64(),
            finding.level,
            finding.subsystem,
            finding.check,
            finding.instance,
            finding.previous
        );
    }
    more(text, contents.findings_count, contents.findings.len());
}

struct FindingJsonText {
    value: String,
    limit: String,
}

fn finding_numbers(finding: &crate::summary::FindingLine) -> FindingJsonText {
    let unit = &finding.unit;
    let number = |before: &str, value: f32| match finite(value) {
        Some(value) => format!(", {before}{value:.6} {unit}").trim_end().to_owned(),
        None => String::new(),
    };
    FindingJsonText { value: number("", finding.value), limit: number("limit ", finding.limit) }
}

fn more(text: &mut String, count: u64, listed: usize) {
    let shown = listed.min(SHOWN_MAX) as u64;
    if count > shown {
        let _ = writeln!(
            text,
            "    … and {} more (see --json, up to {LISTED_MAX}, or hums decode)",
            count - shown
        );
    }
}

fn gaps_text(text: &mut String, log: &Overview) {
    let (summary, contents) = (&log.summary, &log.contents);
    if summary.gaps == 0 && summary.blocks.damaged == 0 {
        text.push_str("  gaps     none\n");
    } else {
        let (missing, damaged) = (summary.frames_missing, summary.blocks.damaged);
        let _ = writeln!(
            text,
            "  gaps     {}, {missing} frames missing, {damaged} damaged sectors",
            summary.gaps
        );
    }
    for gap in contents.gaps.iter().take(SHOWN_MAX) {
        let time = |at: Option<Instant>, none: &str| {
            at.map_or_else(|| none.to_owned(), |at| format!("{:.3} s", at.as_secs_f64()))
        };
        let frames =
            gap.frames.map_or_else(|| "an unknown number of".to_owned(), |frames| frames.to_string());
        let _ = writeln!(
            text,
            "    from {} to {}: {}, {} sectors lost, {} more of no use, {frames} frames missing",
            time(gap.from, "the beginning"),
            time(gap.to, "the end"),
            gap.cause.name(),
            gap.sectors_lost,
            gap.sectors_skipped
        );
    }
    more(text, summary.gaps, contents.gaps.len());
    for loss in losses(contents) {
        let _ = writeln!(
            text,
            "  lost     {} {} between {:.3} and {:.3} s",
            loss.count, loss.what, loss.from_s, loss.to_s
        );
    }
}

fn usage_text(text: &mut String, log: &Overview) {
    if !log.contents.usage.is_empty() {
        text.push_str("  usage\n");
    }
    for (name, value) in &log.contents.usage {
        let number = if value.fract() == 0.0 { format!("{value:.0}") } else { format!("{value:.3}") };
        let _ = writeln!(text, "    {name:<28} {number:>14}");
    }
}

fn messages_text(text: &mut String, log: &Overview) {
    let contents = &log.contents;
    let seconds = duration_s(log);
    text.push_str("  messages                                   frames     per s      bytes\n");
    for (&(id, verified), count) in &contents.messages {
        let rate = if seconds > 0.0 { count.frames as f64 / seconds } else { 0.0 };
        let name = Contents::message_name(id, verified);
        let _ = writeln!(text, "    {name:<36} {:>10} {rate:>9.2} {:>10}", count.frames, count.bytes);
    }
}
