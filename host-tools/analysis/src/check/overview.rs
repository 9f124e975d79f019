//! A recording's contents with findings, for `info` and `report`.
//!
//! A HUMS log has those of the board; others are checked when read: "not checked" is not "good".

use std::collections::BTreeSet;

use anyhow::Result;
use hums_blackbox::record::Vehicle;
use hums_core::Monitor;
use hums_core::clock::Instant;
use hums_core::observation::Observation;
use hums_core::usage::UsageCounter;

use super::flights::Flight;
use super::judge::{HeardAt, Judge, Limits};
use super::judged::Judgement;
use super::problem::{give_worst, problems};
use crate::counters::is_told;
use crate::ending::Ending;
use crate::logs::Log;
use crate::logs::groups::has_start;
use crate::logs::reader;
use crate::names::counter_name;
use crate::outcome::usage;
use crate::progress;
use crate::source::item::{Gap, Item, ItemSink, Needs, RecordingSummary};
use crate::source::recording::{Format, LogPlace};
use crate::summary::{Contents, ExceedanceLine, Overview};

/// Fewer kinds of messages may be too little to judge, though the recorder checks.
const FEW_KINDS: usize = 16;
/// Flight state after first reception, s.
const SEEN_LATE_S: f64 = 3.0;
const LOOK_EVERY: u32 = 4_096;

/// Read and judged.
pub(super) struct Read {
    pub(super) format: Format,
    pub(super) judged: Judgement,
    pub(super) summary: RecordingSummary,
    /// Bytes of the file that were read.
    taken: u64,
}

/// `shows`: progress.
pub(super) fn judge(place: &LogPlace, limits: &Limits, heard: HeardAt, shows: bool) -> Result<Read> {
    judge_telling(place, &|format| Judge::new(limits, format).heard(heard), heard, shows, &mut |_, _| Ok(()))
}

/// With the texts to the pilot.
pub(super) fn judge_texts(place: &LogPlace, limits: &Limits, heard: HeardAt) -> Result<Read> {
    let judge = |format| Judge::new(limits, format).heard(heard).telling();
    judge_telling(place, &judge, heard, false, &mut |_, _| Ok(()))
}

fn judge_telling(
    place: &LogPlace,
    judge: &dyn Fn(Format) -> Judge,
    heard: HeardAt,
    shows: bool,
    take: &mut ItemSink<'_>,
) -> Result<Read> {
    let recording = place.open()?;
    let (format, progress) = (recording.format, recording.progress.clone());
    let bar = progress::bytes(progress.total().filter(|_| shows), &place.title);
    let (mut judge, mut items) = (judge(format), 0_u32);
    let want = Needs { observations: true, frames: heard == HeardAt::OnTheWire, ..Needs::default() };
    let summary = recording.read(want, &mut |at, item| {
        judge.item(at, item);
        items = items.wrapping_add(1);
        if items.is_multiple_of(LOOK_EVERY) {
            bar.set_position(progress.taken());
        }
        take(at, item)
    })?;
    bar.finish_and_clear();
    Ok(Read { format, judged: judge.end(), summary, taken: progress.taken() })
}

/// Checked here if no monitor did.
pub fn overview(place: &LogPlace) -> Result<Overview> {
    read(place, None).map(|(overview, _)| overview)
}

/// The same, and hands on the recording's content in order: one reading for both. Returns the judgement too, if the monitor
/// here checked the recording.
pub fn overview_telling(place: &LogPlace, take: &mut ItemSink<'_>) -> Result<(Overview, Option<Judgement>)> {
    read(place, Some(take))
}

fn read(place: &LogPlace, take: Option<&mut ItemSink<'_>>) -> Result<(Overview, Option<Judgement>)> {
    match place.own() {
        Some(log) => read_own(place, log, take),
        None => read_other(place, take),
    }
}

fn read_own(
    place: &LogPlace,
    log: &Log,
    mut take: Option<&mut ItemSink<'_>>,
) -> Result<(Overview, Option<Judgement>)> {
    let (limits, is_told) = (Limits::default(), take.is_some());
    // A monitor ran: not judged here.
    let has_start = has_start(log);
    let mut here = (!has_start).then(|| Judge::new(&limits, Format::Hums));
    let mut overview = if here.is_none() && !is_told {
        Overview::of(log)?
    } else {
        Overview::told(log, place.system, &mut |at, item| {
            if let Some(here) = &mut here {
                here.item(at, item);
            }
            take.as_mut().map_or(Ok(()), |take| take(at, item))
        })?
    };
    let here = here.map(Judge::end);
    let kept = here.clone().filter(|_| is_told);
    overview.ending.name.clone_from(&place.name);
    let contents = &overview.contents;
    let (is_checked, is_little) = (contents.is_checked(), contents.messages.len() < FEW_KINDS);
    // A box may end its log in flight.
    let marks = &overview.ending.summary.marks;
    let breaks_off = marks.moved.is_some() || marks.took_off == Some(true);
    if is_checked {
        peaks(&mut overview.contents);
    }
    let contents = &overview.contents;
    if contents.frames() > 0 && (!is_checked || is_little || breaks_off) {
        let judged = match here {
            Some(here) => here,
            None => judge(place, &limits, HeardAt::Somewhere, true)?.judged,
        };
        if is_checked && breaks_off {
            give_worst(&mut overview.contents.findings, &judged.problems);
            go_on(&mut overview, &judged);
        }
        if !is_checked {
            fill(&mut overview.contents, judged);
        } else if is_little {
            look(&mut overview.contents, &judged);
        }
    }
    Ok((overview, kept))
}

fn read_other(place: &LogPlace, take: Option<&mut ItemSink<'_>>) -> Result<(Overview, Option<Judgement>)> {
    let (limits, is_told) = (Limits::default(), take.is_some());
    let mut nothing = |_, _: Item<'_>| Ok(());
    let take = take.unwrap_or(&mut nothing);
    let Read { format, judged, summary, taken } =
        judge_telling(place, &|format| Judge::new(&limits, format), HeardAt::Somewhere, true, take)?;
    is_heard(place, judged.vehicle().source.is_some())?;
    let mut contents = Contents {
        messages: summary.messages,
        other_messages: summary.other_messages,
        epoch_us: judged.epochs.whole(),
        gaps: judged.gaps.iter().map(Gap::to_own).collect(),
        gap_words: judged.gaps.iter().map(|gap| (gap.cause, gap.place, gap.words.clone())).collect(),
        ..Contents::default()
    };
    let (first, last) = judged.span.unzip();
    let epochs = judged.epochs.clone();
    let summary = reader::LogSummary {
        epoch_us: judged.epochs.whole(),
        frames: contents.frames(),
        gaps: judged.damages,
        losses: judged.losses,
        first,
        last,
        ..reader::LogSummary::default()
    };
    let (name, files) = (place.name.clone(), vec![place.title.clone()]);
    let kept = is_told.then(|| judged.clone());
    fill(&mut contents, judged);
    let overview = Overview {
        ending: Ending { name, files, summary, ..Ending::default() },
        format: Some(format),
        epochs,
        bytes_on_card: if place.is_standard() { taken } else { place.bytes() },
        contents,
    };
    Ok((overview, kept))
}

fn peaks(contents: &mut Contents) {
    let peaks = contents.exceedances.iter();
    let peaks = peaks.map(|((check, part), line)| (check.as_str(), *part, line.session.peak));
    let problems = problems(&contents.findings, true, peaks);
    give_worst(&mut contents.findings, &problems);
}

pub(super) fn is_heard(place: &LogPlace, heard: bool) -> Result<()> {
    let Some(wanted) = place.system.filter(|_| !heard) else { return Ok(()) };
    let mut systems = BTreeSet::new();
    if !place.is_standard() {
        let mut all = place.clone();
        all.system = None;
        all.open()?.read(Needs { observations: true, ..Needs::default() }, &mut |_, item| {
            if let Item::Observation(source, Observation::Heartbeat(_)) = item {
                systems.insert(source.system);
            }
            Ok(())
        })?;
    }
    let systems: Vec<String> = systems.iter().map(u8::to_string).collect();
    let there = if systems.is_empty() { String::new() } else { format!("; there is {}", systems.join(", ")) };
    Err(usage(format!("--system {wanted}: no autopilot of this system is in {}{there}", place.title)))
}

/// Number of judged checks; removes counters without a source.
fn look(contents: &mut Contents, judged: &Judgement) {
    contents.judged = Some(judged.checks());
    let vehicle = judged.vehicle();
    contents.usage.retain(|name, _| is_told(name, vehicle));
}

/// Ends in the air, or armed: counters go on from the box's last store to the end.
fn go_on(overview: &mut Overview, judged: &Judgement) {
    let is_whole = overview.ending.summary.first_number == Some(0);
    let is_stored = overview.counted_until().is_some();
    let contents = &mut overview.contents;
    contents.ends_in_air = judged.ends_in_air;
    contents.is_recounted = is_whole && is_stored;
    if !contents.is_recounted {
        return;
    }
    for (name, value) in counters(judged) {
        let is_least = name == UsageCounter::VoltageMin.name();
        let stored = contents.usage.entry(name).or_insert(value);
        // Counted also during lost frames.
        *stored = if is_least { stored.min(value) } else { stored.max(value) };
    }
}

/// The monitor's here.
fn counters(judged: &Judgement) -> Vec<(String, f64)> {
    // On the ground until its flight was seen.
    let begins_in_air = judged.begins_in_air();
    let monitor = &judged.monitor;
    let mut counters = Vec::new();
    monitor.for_each_counter(|number, value| {
        let name = counter_name(number);
        let seen_late = begins_in_air && name == UsageCounter::Ground.name() && value < SEEN_LATE_S;
        // The same time in the air everywhere.
        let value =
            if name == UsageCounter::Flight.name() { judged.flown().as_micros() as f64 / 1e6 } else { value };
        if is_told(&name, monitor.vehicle()) && !seen_late {
            counters.push((name, value));
        }
    });
    counters
}

/// The monitor's here.
fn fill(contents: &mut Contents, judged: Judgement) {
    contents.unheard = judged.unheard();
    contents.judged = Some(judged.checks());
    contents.begins_in_air = judged.begins_in_air();
    contents.ends_in_air = judged.ends_in_air;
    contents.moves = moves(&judged.flights);
    contents.is_lossy = judged.is_lossy();
    let is_judged = judged.worst().is_some();
    let counters = counters(&judged);
    let Judgement { monitor, findings, findings_count, span, remarks, .. } = judged;
    contents.remarks = remarks;
    contents.vehicle = vehicle(&monitor);
    contents.checked_here = contents.vehicle.is_some() && is_judged;
    if !contents.checked_here {
        // Zeros would look like measurements.
        return;
    }
    contents.findings_count = findings_count;
    contents.findings = findings;
    contents.usage.extend(counters);
    if let Some((_, last)) = span {
        for exceedance in monitor.exceedances().iter(last.into()) {
            let line = ExceedanceLine {
                session: exceedance.session,
                lifetime: exceedance.lifetime,
                unit: exceedance.check.unit.name().to_owned(),
            };
            contents.exceedances.insert((exceedance.check.name.to_owned(), exceedance.instance), line);
        }
    }
}

fn moves(flights: &[Flight]) -> Vec<(Instant, bool)> {
    let of = |flight: &Flight| {
        let ended = flight.landed || flight.mishap.is_some();
        std::iter::once((flight.from, true)).chain(ended.then_some((flight.to, false)))
    };
    flights.iter().flat_map(of).collect()
}

/// `None` without one.
pub(super) fn vehicle(monitor: &Monitor) -> Option<Vehicle> {
    let vehicle = monitor.vehicle();
    let (source, heartbeat) = vehicle.source.zip(vehicle.heartbeat.get())?;
    let identity = vehicle.identity.get().copied().unwrap_or_default();
    Some(Vehicle {
        system: source.system,
        component: source.component,
        autopilot: heartbeat.autopilot_number,
        vehicle_type: heartbeat.type_number,
        firmware: identity.firmware,
        uid: identity.uid,
    })
}
