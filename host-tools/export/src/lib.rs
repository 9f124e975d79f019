//! `hums decode`: logs and recordings become files for other tools.
//!
//! Each format is a file in [`formats`].
//!
//! A log is read for its time of day (or its vehicle, if that must be known first), then decoded; an unchecked one is
//! judged in the same reading. Its groups are encoded in parallel, and written in order. Several logs are decoded in parallel,
//! few enough that memory stays bounded.
//!
//! A log's files are named after its session ([`naming`]).
//!
//! An autopilot's log has its own tables (`native`).

#![deny(
    clippy::print_stderr,
    reason = "`eprintln!` panics where standard error lies on a full disk: `output::note`, `output::aside`"
)]

#[macro_use(note)]
extern crate hums_base;

use hums_analysis::soundness::Soundness;
use hums_analysis::{check, manifest, reference, states, summary};
use hums_base::{endpoint, files, hex, outcome, output, plural, printable, utc};
use hums_formats::{ending, followed, logs, loss, mavlink, names, naming, source};

pub mod args;
pub mod checked;
pub mod collect;
pub mod context;
pub mod destination;
pub mod field_names;
pub mod findings;
pub mod fleet;
pub mod format;
pub mod formats;
pub mod identity;
mod journey;
pub mod logbook;
pub mod made;
mod motion;
mod native;
pub mod record;
pub mod row;
pub mod selection;
pub mod share;
pub mod storage;
pub mod story;
pub mod table;
pub mod text;
mod wear;
mod works;
pub mod write;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Result, bail};
use hums_core::clock::Instant;

use args::Decode;
use check::judge::{Judge, Limits};
use checked::Checked;
use collect::CollectedGroup;
use context::{Context, Formats};
use destination::Destination;
use ending::Ending;
use files::{Inputs, means_standard_output, says_directory};
use findings::Findings;
use fleet::Fleet;
use fleet::bucket::Bucket;
use followed::{EndResolver, HasEnding};
use format::{Files, Finished, Way};
use formats::FORMATS;
use formats::influx::Tags;
use identity::{Identity, Sources, identity};
use logs::reader;
use logs::sessions::copy_words;
use logs::side_by_side::side_by_side;
use made::{LogJson, MadeJson, OutputFile};
use manifest::{Manifest, ReadLog};
use naming::LogFileName;
use outcome::{Outcome, or_skipped, usage as usage_error};
use output::Schema;
use plural::count;
use selection::Selection;
use source::epochs::Epochs;
use source::find::{find, sessions_of};
use source::item::{Gap, Item, Needs, RecordingSummary, Rows};
use source::parts::{ItemCollector, PartReceiver};
use source::recording::{Format, LogPlace};
use storage::{Address, Upload};
use story::StoryEntry;
use summary::damaged_places;
use works::{NamedLog, check_forms, without_frames, works};
use write::Writers;

/// Output of `hums decode --json`.
pub const SCHEMA: Schema = Schema::first("hums-decode");

/// Runs `hums decode`. `program`: name and version of this program, for the manifest.
pub fn run(args: &Decode, program: &'static str) -> Result<Outcome> {
    check_request(args)?;
    let Some(address) = Address::of(&args.output)? else { return decode(args, program, None) };
    if args.manifest.is_some() {
        return Err(usage_error("--manifest: lists files on this computer, and -o names object storage"));
    }
    let upload = Upload::new(&address, &args.output, args.force)?;
    let local = Decode { output: upload.path().to_owned(), ..args.clone() };
    let outcome = decode(&local, program, Some(Bucket::open(&address)?))?;
    upload.send(args.force)?;
    Ok(outcome)
}

fn decode(args: &Decode, program: &'static str, bucket: Option<Bucket>) -> Result<Outcome> {
    if let Some(run) = alone(args) {
        return run(args);
    }
    let formats = Formats::new(&args.format, args.split.is_some());
    let found = find(&args.inputs, args.salvage)?;
    found.tell();
    if found.places.is_empty() {
        note!("no log was found, so nothing was written");
    }
    let mut outcome = Outcome::lossy(found.is_lossy());
    let inputs = found.with_inputs(&args.inputs).forcing(args.force);
    let sessions = sessions_of(&found.places);
    let wanted = found.name_of(args.session.as_deref())?;
    let mut works = works(&found.places, &sessions)?;
    [&args.output].into_iter().chain(&args.manifest).try_for_each(|to| inputs.refuse(to))?;
    let is_wanted = |name: &String| wanted.as_ref().is_none_or(|wanted| wanted == name);
    let logs = works.iter().filter(|work| is_wanted(&work.log.name)).count();
    let standard_output = check_output(args, logs, &formats)?;
    check_forms(&mut works, &formats)?;
    let selection = Selection::new(args, works.iter().any(|work| work.is_native))?;
    let mut followed = EndResolver::new(sessions);
    let task = Task {
        formats,
        selection,
        inputs: Arc::new(inputs),
        output: &args.output,
        standard_output,
        logs,
        has_findings: args.findings,
        offset_s: args.offset,
        vehicle: args.vehicle.as_deref(),
        fleet: Arc::new(Fleet::new(&args.output, bucket)),
    };
    let mut written = works.is_empty();
    let mut json = args.json.then(MadeJson::default);
    let (mut manifest, mut made, mut existing) = (Manifest::default(), BTreeSet::new(), Vec::new());
    manifest.images(&found.images, &args.inputs);
    let mut tell = |done: Done| {
        if !is_wanted(&done.name) {
            return Ok(());
        }
        outcome = outcome.and(done.outcome());
        written |= done.written;
        manifest.log(done.of_manifest());
        existing.extend(done.exists.clone());
        made.extend(done.made.iter().flat_map(OutputFile::files).cloned());
        done.tell(json.as_mut(), logs)
    };
    side_by_side(
        &works,
        |work| {
            if is_wanted(&work.log.name) { task.decode_or_skip(work, &works) } else { beside(work) }
        },
        |done| followed.push(done?).into_iter().try_for_each(&mut tell),
    )?;
    followed.finish().try_for_each(&mut tell)?;
    tell_existing(&existing);
    json.map_or(Ok(()), |json| output::json(SCHEMA, &json))?;
    if let Some(to) = &args.manifest {
        let read: BTreeSet<PathBuf> = found.paths().map(Path::to_owned).collect();
        // A longer log of the same session may have replaced the tables of a shorter one.
        made.retain(|path| path.exists());
        let roots: Vec<PathBuf> = args.inputs.iter().chain([&args.output]).cloned().collect();
        manifest.write(program, to, &roots, &read, &made, &task.inputs)?;
    }
    if !written {
        bail!(
            "no data match the selection, so nothing was written; `hums info LOG` lists times and messages"
        );
    }
    Ok(outcome)
}

/// The format of the request that is written alone.
fn alone(args: &Decode) -> Option<fn(&Decode) -> Result<Outcome>> {
    args.format.iter().find_map(|format| if let Way::Alone(run) = format.way { Some(run) } else { None })
}

fn tell_existing(existing: &[String]) {
    match existing {
        [] => {}
        [one] => note!("{one}"),
        all => {
            let sessions = count(all.len() as u64, "session");
            note!("skipped: {sessions} are there already; --force replaces them");
        }
    }
}

fn check_request(args: &Decode) -> Result<()> {
    if args.findings && !args.format.iter().any(|format| format.about.name == "tlog") {
        return Err(usage_error("--findings is for --format tlog; the tables have the findings anyway"));
    }
    if args.manifest.is_some() && alone(args).is_some() {
        return Err(usage_error("--manifest: a log of one recording has none; hums info --verify makes it"));
    }
    let is_of_fleet = |format: &&format::Format| matches!(format.about.files, Files::Fleet(_));
    if args.split.is_some() && args.format.iter().any(is_of_fleet) {
        return Err(usage_error(
            "--split flights: the tables of a fleet hold whole sessions; leave out parquet",
        ));
    }
    if args.manifest.as_ref() == Some(&args.output) {
        return Err(usage_error("--manifest and -o are one file: the manifest would replace the output"));
    }
    Ok(())
}

/// Neighbour of the requested log, which may show how that one ends.
fn beside(work: &NamedLog<'_>) -> Result<Done> {
    let ending = match work.log.own() {
        Some(_) => Some(check::overview(work.log)?.ending),
        None => None,
    };
    Ok(Done { ending, ..Done::of(work.log) })
}

/// Whether the output is standard output. An error if the requested formats cannot go there, or into the
/// given file.
fn check_output(args: &Decode, logs: usize, formats: &Formats) -> Result<bool> {
    let standard_output = means_standard_output(&args.output);
    if standard_output && (logs != 1 || !formats.is_single_file()) {
        let why = match logs {
            1 => "these formats are more than that".to_owned(),
            count => format!("there are {count} logs: --session NAME takes one"),
        };
        let single = FORMATS.iter().filter(|format| matches!(format.about.files, Files::One(_)));
        let single: Vec<&str> = single.map(|format| format.about.name).collect();
        return Err(usage_error(format!(
            "-o -: standard output takes one log in one format of a single file ({}), and {why}; \
             name a file or a directory",
            single.join(", ")
        )));
    }
    let one_file = logs == 1 && formats.is_single_file();
    if args.output.is_file() && !one_file {
        return Err(usage_error(format!(
            "-o {}: is a file, but tables, several formats and several logs need a directory; name one, or a new name, or one log by --session NAME",
            args.output.display()
        )));
    }
    let extension = args.output.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    // A file's name never makes a folder by mistake.
    let is_file_name = extension
        .is_some_and(|extension| FORMATS.iter().any(|format| format.about.extension() == extension.as_str()));
    if !one_file && logs > 0 && is_file_name && !says_directory(&args.output) {
        return Err(usage_error(format!(
            "-o {0}: is the name of a file, but tables, several formats and several logs need a directory; name one log by \
             --session NAME, or say {0}/",
            args.output.display()
        )));
    }
    Ok(standard_output)
}

/// A log that was read into its still incomplete files, with this program's findings if it was judged in the
/// same reading.
type Read<'a> = (RecordingSummary, Writers<'a>, Option<Checked>);

struct Task<'a> {
    formats: Formats,
    selection: Selection,
    inputs: Arc<Inputs>,
    output: &'a Path,
    standard_output: bool,
    logs: usize,
    has_findings: bool,
    offset_s: f64,
    vehicle: Option<&'a str>,
    fleet: Arc<Fleet>,
}

struct Done {
    name: String,
    outcome: Outcome,
    ending: Option<Ending>,
    /// The gaps of a recording of another program.
    lacks: Soundness,
    skipped: bool,
    written: bool,
    /// Session, messages and gaps of another program's recording.
    counts: (Option<String>, u64, u64),
    copy_of: Option<String>,
    /// A sentence: its outputs are there already.
    exists: Option<String>,
    made: Vec<OutputFile>,
    remarks: Vec<String>,
}

impl Done {
    fn of(log: &LogPlace) -> Self {
        let (made, remarks) = (Vec::new(), Vec::new());
        let (name, lacks, outcome) = (log.name.clone(), Soundness::Whole, Outcome::Done);
        let (skipped, written, counts) = (false, false, (None, 0, 0));
        let (ending, copy_of, exists) = (None, None, None);
        Self { name, outcome, ending, lacks, skipped, written, counts, copy_of, exists, made, remarks }
    }

    /// Of a log that was read, with remarks on its losses.
    fn read(log: &LogPlace, summary: RecordingSummary, lacks: Soundness) -> Self {
        let frames = summary.messages.iter().map(|message| message.amount.count).sum::<u64>();
        let counts = (None, frames + summary.other_messages.count, summary.gaps + summary.losses);
        let mut done = Self { lacks, written: true, counts, ..Self::of(log) };
        done.ending = summary.ending.map(|ending| Ending { name: log.name.clone(), ..ending });
        if done.ending.is_none() && summary.gaps > 0 {
            done.outcome = Outcome::Losses;
            done.remarks.push(format!("{}: {}", log.name, damaged_places(summary.gaps)));
        }
        done
    }

    fn add(&mut self, next: Self) {
        self.outcome = self.outcome.and(next.outcome);
        self.ending = next.ending.or_else(|| self.ending.take());
        self.written |= next.written;
        self.counts = next.counts;
        self.lacks = self.lacks.max(next.lacks);
        self.made.extend(next.made);
        let new = next.remarks.into_iter().filter(|remark| !self.remarks.contains(remark));
        self.remarks.extend(new.collect::<Vec<_>>());
    }

    fn of_manifest(&self) -> ReadLog<'_> {
        let ((session, frames, gaps), soundness) = (&self.counts, self.soundness());
        let (copy_of, ending) = (self.copy_of.as_deref(), self.ending.as_ref());
        let (name, session, frames, gaps) = (&self.name, session.as_deref(), *frames, *gaps);
        ReadLog { name, session, frames, gaps, copy_of, soundness, ending, remarks: &self.remarks }
    }

    fn soundness(&self) -> Soundness {
        self.ending.as_ref().map_or(self.lacks, Soundness::of)
    }

    fn outcome(&self) -> Outcome {
        let is_sound = self.ending.as_ref().is_none_or(Ending::is_sound);
        self.outcome.and(Outcome::lossy(!is_sound))
    }

    fn tell(self, json: Option<&mut MadeJson>, logs: usize) -> Result<()> {
        for remark in &self.remarks {
            note!("{remark}");
        }
        let ending = self.ending.as_ref();
        let aside = self.copy_of.as_deref().map(copy_words).or_else(|| ending.and_then(Ending::aside));
        for why in aside.into_iter().chain(ending.into_iter().flat_map(Ending::faults)) {
            note!("{}: {why}", self.name);
        }
        let Some(json) = json else {
            let from = if logs > 1 { format!(", from {}", self.name) } else { String::new() };
            let line = |made: &OutputFile| output::line(&printable::word(&(made.line() + &from)));
            return self.made.iter().try_for_each(line);
        };
        let whole = self.outcome() == Outcome::Done && !self.skipped;
        let state = self.soundness().name();
        json.logs.push(LogJson { name: self.name, state, whole, files: self.made });
        Ok(())
    }
}

impl HasEnding for Done {
    fn ending(&mut self) -> Option<&mut Ending> {
        self.ending.as_mut()
    }
}

/// A remark on the parts of a log without a time of day. A usage error if the request has a time of day and
/// no part has one.
fn check_clock(name: &str, context: &Context) -> Result<Option<String>> {
    let what = match context.epochs.untold() {
        (0, _) => return Ok(None),
        (untold, all) if untold == all => {
            context.selection.check_without_utc(name)?;
            "no frame told the time of day: UTC columns are empty, and tlog times count from power-on as 1970"
                .to_owned()
        }
        (untold, all) => format!(
            "in {untold} of its {all} parts (its clock began anew between them) nothing told the time of day: UTC columns are \
             empty there, and tlog times count from power-on as 1970"
        ),
    };
    Ok(Some(format!("{name}: {what}")))
}

impl Task<'_> {
    fn decode_or_skip(&self, work: &NamedLog<'_>, all: &[NamedLog<'_>]) -> Result<Done> {
        let done = self.decode(work, all);
        // A job of a fleet may be repeated.
        let is_of_fleet = self.formats.about().all(|about| matches!(about.files, Files::Fleet(_)));
        let mut done = if self.logs == 1 && (!is_of_fleet || self.inputs.may_replace()) {
            done?
        } else {
            match or_skipped(done)? {
                Ok(done) => done,
                Err(why) => {
                    let exists = Some(format!("{}: skipped: {why}", work.log.name));
                    Done { skipped: true, exists, ..unwritten(work.log)? }
                }
            }
        };
        done.counts.0 = Some(work.traits.identity());
        Ok(done)
    }

    fn decode(&self, work: &NamedLog<'_>, all: &[NamedLog<'_>]) -> Result<Done> {
        let log = work.log;
        let name = match &work.named {
            LogFileName::As(name, _) => name,
            LogFileName::Copy(of) => {
                let of = all.get(*of).map(|work| work.log.name.clone()).unwrap_or_default();
                return Ok(Done { copy_of: Some(of.clone()), ..unwritten(log)? });
            }
        };
        let remark = without_frames(work, &self.formats)?;
        if remark.is_some() && self.formats.without_frames().is_empty() {
            let remarks = remark.into_iter().collect();
            return Ok(Done { skipped: true, remarks, ..Done::of(log) });
        }
        let mut done = self.decode_flights(work, name)?;
        done.remarks.extend(remark);
        Ok(done)
    }

    fn decode_flights(&self, work: &NamedLog<'_>, name: &str) -> Result<Done> {
        let log = work.log;
        let flights = if self.formats.split { flights(log)? } else { Vec::new() };
        if flights.is_empty() {
            return self.decode_part(work, name, &self.context(work)?);
        }
        let mut done = Done::of(log);
        for (number, span) in (1..).zip(flights) {
            let mut context = self.context(work)?;
            context.selection = context.selection.within(span);
            context.identity.session = format!("{}-flight{number}", context.identity.session);
            context.tags = Tags::new(&context.identity.session, &context.identity.vehicle);
            let name = format!("{name}-flight{number}");
            done.add(self.decode_part(work, &name, &context)?);
        }
        Ok(done)
    }

    fn decode_part(&self, work: &NamedLog<'_>, name: &str, context: &Context) -> Result<Done> {
        let log = work.log;
        let mut remarks = Vec::new();
        remarks.extend(check_clock(&log.name, context)?);
        let (summary, mut writers, checked) = self.read(log, name, context)?;
        if writers.is_empty() && context.selection.is_part() {
            remarks.push(nothing_of(log, &summary, &context.selection));
            return Ok(Done { remarks, ..Done::of(log) });
        }
        let not_checked = writers.checked(summary.span.map(|(_, last)| last), checked.as_ref())?;
        remarks.extend(not_checked.map(|why| format!("{}: {why}", log.name)));
        let (rows_left_out, lacks) = (writers.rows_left_out(), writers.lacks());
        let Finished { made, remarks: left_out } = writers.finish()?;
        let losses = summary.losses;
        let read = Done::read(log, summary, lacks);
        if read.ending.is_none() && losses > 0 {
            let places = count(losses, "place");
            remarks.push(format!("{}: {places} of loss or noise; hums check says what", log.name));
        }
        remarks.extend(read.remarks);
        remarks.extend(left_out.into_iter().map(|words| format!("{}: {words}", log.name)));
        let outcome = read.outcome.and(Outcome::lossy(rows_left_out > 0));
        let made = if self.standard_output { Vec::new() } else { made };
        Ok(Done { outcome, made, remarks, ..read })
    }

    fn context(&self, work: &NamedLog<'_>) -> Result<Context> {
        let mut context = Context {
            formats: if work.is_native { self.formats.without_frames() } else { self.formats.clone() },
            selection: self.selection.clone(),
            inputs: self.inputs.clone(),
            offset_s: self.offset_s,
            fleet: Some(self.fleet.clone()),
            session: work.traits.identity(),
            identity: Identity { session: work.traits.identity(), ..Identity::default() },
            ..Context::default()
        };
        if self.has_findings {
            context.findings = Some(Findings::of(work.log)?);
        }
        // A box's log begins with the record of its start, and its monitor checks.
        let judges = self.formats.has_records() && !work.traits.has_board();
        match work.log.own() {
            Some(log) if !self.formats.about().any(|about| about.needs_identity) => {
                context.epochs = Epochs::of(reader::epoch(log)?);
                context.judges = judges;
            }
            _ => {
                let known = identity(work.log, &work.traits, judges, self.vehicle)?;
                (context.identity, context.checked) = (known.identity, known.checked);
                context.about = Some(known.about);
                context.tags = Tags::new(&context.identity.session, &context.identity.vehicle);
                context.epochs = context.identity.epochs.clone();
            }
        }
        Ok(context)
    }

    fn read<'a>(&self, place: &LogPlace, name: &str, context: &'a Context) -> Result<Read<'a>> {
        let destination = if self.standard_output {
            Destination::Standard
        } else {
            Destination::new(self.output, name, self.logs, &self.formats)
        };
        let mut writers = Writers::new(context, &destination, self.output)?;
        let formats = &context.formats;
        let rows = match context.selection.names() {
            [] if formats.has_records() => Rows::All,
            [] => Rows::None,
            names => Rows::Named(names),
        };
        let observations = formats.about().any(|about| about.has_observations);
        let want = Needs { frames: true, observations, rows, ..Needs::default() };
        let new = || CollectedGroup::new(context);
        let has_words = formats.has_words();
        let Some(log) = place.own().filter(|_| context.judges || has_words) else {
            return Ok((place.in_parts(want, new, &mut writers)?, writers, None));
        };
        let mut judge = context.judges.then(|| Judge::new(&Limits::default(), Format::Hums));
        let (said, mut sources) = (writers.said(), Sources::default());
        let summary = place.in_parts_and_order(log, want, new, &mut writers, &mut |at, item| {
            if let Some(judge) = &mut judge {
                judge.item(at, item);
            }
            sources.take(at, &item);
            if has_words && context.selection.has_time(at, &context.epochs) {
                said.borrow_mut().extend(StoryEntry::of(at, &item));
            }
            Ok(())
        })?;
        writers.vehicle = sources.vehicle(place, self.vehicle);
        Ok((summary, writers, judge.and_then(|judge| Checked::new(judge.end()))))
    }
}

fn flights(log: &LogPlace) -> Result<Vec<(Instant, Instant)>> {
    let flights = check::overview(log)?.contents.flights();
    let middle = |landing: Instant, take_off: Instant| {
        Instant::from_micros(landing.as_micros() + take_off.since(landing).as_micros() / 2)
    };
    let cuts = flights.iter().zip(flights.iter().skip(1));
    let cuts: Vec<Instant> =
        cuts.map(|(flight, next)| middle(flight.to.unwrap_or(next.from), next.from)).collect();
    let after = |cut: &Instant| Instant::from_micros(cut.as_micros() + 1);
    let begins = std::iter::once(Instant::ZERO).chain(cuts.iter().map(after));
    let ends = cuts.iter().copied().chain([Instant::from_micros(u64::MAX)]);
    Ok(if flights.is_empty() { Vec::new() } else { begins.zip(ends).collect() })
}

/// A log whose files are there already. It is read for its losses, which count as if it was written.
fn unwritten(log: &LogPlace) -> Result<Done> {
    // As for its files: gaps show in messages of every kind.
    let want = Needs { frames: true, observations: true, ..Needs::default() };
    let mut gaps = Gaps(Soundness::Whole);
    let summary = log.in_parts(want, || Gaps(Soundness::Whole), &mut gaps)?;
    Ok(Done::read(log, summary, gaps.0))
}

/// Takes no items, and what a recording lacks by its gaps.
struct Gaps(Soundness);

impl ItemCollector for Gaps {
    fn item(&mut self, _: Instant, _: Item<'_>) {}

    fn held_bytes(&self) -> usize {
        0
    }
}

impl PartReceiver<Self> for Gaps {
    fn gap(&mut self, gap: &Gap) -> Result<()> {
        self.0 = self.0.max(Soundness::of_gap(gap));
        Ok(())
    }

    fn part(&mut self, _: Self) -> Result<()> {
        Ok(())
    }
}

fn nothing_of(log: &LogPlace, summary: &RecordingSummary, selection: &Selection) -> String {
    let seconds = |at: Option<Instant>| at.map_or(0.0, |at| at.as_micros() as f64 / 1e6);
    let names = selection.names().join(", ");
    if !selection.has_limits() {
        return format!("{}: no {names} is in it", log.name);
    }
    let what = if names.is_empty() { "nothing of it".to_owned() } else { format!("no {names} of it") };
    format!(
        "{}: {what} is within --from and --to: its times go from {:.3} s to {:.3} s",
        log.name,
        seconds(summary.span.map(|(first, _)| first)),
        seconds(summary.span.map(|(_, last)| last))
    )
}
