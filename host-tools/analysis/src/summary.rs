//! A log's contents, in one pass.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::path::Path;

use anyhow::Result;
use hums_blackbox::record::{Loss, Moment, RecordReason, Stats, Vehicle};
use hums_blackbox::{Cause, Gap, Record};
use hums_core::clock::{Instant, Span};
use hums_core::component::{COMPONENTS_MAX, ComponentFigures, ComponentKind};
use hums_core::health::Level;
use hums_core::health::exceedance::Crossings;
use hums_core::usage::UsageCounter;
use hums_link as link;
use serde::Serialize;

use crate::ending::Ending;
use crate::followed::HasEnding;
use crate::logs::board::Board;
use crate::logs::{Log, marks};
use crate::mavlink::frame::is_bad;
use crate::names::counter_name;
use crate::part;
use crate::plural::are;
use crate::progress;
use crate::soundness::Soundness;
use crate::source::epochs::Epochs;
use crate::source::item::{self, Amount, Item, ItemSink, MessageCount, Needs};
use crate::source::own::OwnReader;
use crate::source::parts::{ItemCollector, PartReceiver};
use crate::source::recording::Format;
use crate::source::told::Finding;
use crate::utc::moment;

/// Kept one by one; further ones are counted: bounded memory.
pub const LISTED_MAX: usize = 10_000;

/// Life and session counters.
const STORED_WITH: Span = Span::from_secs(5);

/// Counters may come later than the log's start by this time.
const COUNTED_LATE: Span = Span::from_secs(1);

/// Four times the possible ones.
const EXCEEDANCES_MAX: usize = 1_000;

/// Start of the monitor.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct BootLine {
    /// Built from.
    pub version: String,
    /// The commit it was built from.
    pub git: String,
    /// The board.
    pub board: String,
    /// Why it started.
    pub reset: String,
    /// Number of power-ons.
    pub boots: u32,
    /// The box's unique id; zeros if unknown.
    #[serde(skip)]
    pub uid: Board,
}

/// Judged checks of those for the vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JudgedChecks {
    /// These had.
    pub judged: usize,
    /// Checks of box, card and wire only.
    pub of_box: usize,
    /// All.
    pub all: usize,
}

impl JudgedChecks {
    /// Fewer than one in ten: no finding means nothing.
    pub const fn is_little(self) -> bool {
        self.judged.saturating_sub(self.of_box) * 10 < self.all
    }
}

impl Display for JudgedChecks {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} of {} checks", self.judged, self.all)
    }
}

/// Ended in the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndsInAir {
    /// When.
    pub at: Instant,
    /// Above home or local origin, m.
    pub height_m: Option<f32>,
    /// m/s; negative: sank.
    pub climb_mps: Option<f32>,
    /// Speed over ground, m/s.
    pub speed_mps: Option<f32>,
    /// Last, degrees north and east.
    pub place_deg: Option<(f64, f64)>,
}

/// A sensor's number in any unit: others are damaged.
pub fn is_possible(value: &f32) -> bool {
    const IMPOSSIBLE: f32 = 1e9;
    value.abs() < IMPOSSIBLE
}

impl Display for EndsInAir {
    /// A sentence, without impossible numbers.
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let mut known = Vec::new();
        known.extend(self.height_m.filter(is_possible).map(|height_m| format!("{height_m:.1} m above home")));
        known.extend(self.climb_mps.filter(is_possible).map(|climb_mps| {
            let way = if climb_mps < 0.0 { "sinking" } else { "climbing" };
            format!("{way} at {:.1} m/s", climb_mps.abs())
        }));
        known.extend(
            self.speed_mps.filter(is_possible).map(|speed_mps| format!("{speed_mps:.1} m/s over ground")),
        );
        known.extend(self.place_deg.map(|(north, east)| format!("at {north:.7}, {east:.7}")));
        let known = if known.is_empty() { String::new() } else { format!(": {}", known.join(", ")) };
        write!(formatter, "the recording ends in the air{known}; what became of the vehicle is not in it")
    }
}

/// Crossed limits.
#[derive(Clone, Debug, PartialEq)]
pub struct ExceedanceLine {
    /// In this session.
    pub session: Crossings,
    /// In the airframe's life.
    pub lifetime: Crossings,
    /// The unit of the peaks.
    pub unit: String,
}

/// A flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlightLine {
    /// Take-off, or first seen.
    pub from: Instant,
    /// Landing, if it is in the log.
    pub to: Option<Instant>,
}

/// A wearing part.
#[derive(Clone, Debug, PartialEq)]
pub struct ComponentLine {
    /// Its kind.
    pub kind: &'static str,
    /// Which of its kind, from 1; 0 is all.
    pub number: u8,
    /// The operator's name.
    pub name: String,
    /// Its serial number.
    pub serial: String,
    /// Green, yellow or red.
    pub status: &'static str,
    /// The part of its life that is used.
    pub used_percent: f32,
    /// Its figures.
    pub figures: ComponentFigures,
    /// Replacements.
    pub replaced: u32,
}

/// How a box counts time in the air.
pub const BOX_COUNTS: &str = "in the air: as the box counts it, to the time at which it recognised the landing; the check says when it touched down";

/// The seconds of one log, from a counter at its end and at its beginning, with the number of its first sector in the
/// power-on.
pub fn since_power_on(all: f64, before: f64, first_number: Option<u32>) -> f64 {
    let is_later = first_number.is_some_and(|first| first > 0);
    (all - if is_later { before } else { 0.0 }).max(0.0)
}

/// Why a recording of another program is not whole, as a part of a sentence.
pub fn damaged_places(count: u64) -> String {
    format!("{} damaged or cut", are(count, "place"))
}

/// A log, counted.
#[derive(Clone, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
pub struct Contents {
    /// Messages by id, or name.
    pub messages: Vec<MessageCount>,
    /// Unverified: distinguished ids are limited.
    pub other_messages: Amount,
    /// Records of the monitor's own.
    pub records: u64,
    /// The first boot record.
    pub boot: Option<BootLine>,
    /// The last vehicle record.
    pub vehicle: Option<Vehicle>,
    /// UTC at power-on, microseconds since 1970.
    pub epoch_us: Option<u64>,
    /// Changes of level, in order, up to [`LISTED_MAX`].
    pub findings: Vec<Finding>,
    /// All findings.
    pub findings_count: u64,
    /// Its recorder ran no checks.
    pub checked_here: bool,
    /// If known: for a checking recorder only with few kinds of messages.
    pub judged: Option<JudgedChecks>,
    /// In the air at first reception.
    pub begins_in_air: bool,
    /// `true`: take-off; in order, up to [`LISTED_MAX`].
    pub moves: Vec<(Instant, bool)>,
    /// The last flight goes on, judged here.
    pub ends_in_air: Option<EndsInAir>,
    /// Unrecorded time, by report or evidence.
    pub is_lossy: bool,
    /// Seconds in the air before the log, by the box's first counters.
    pub flight_before_s: Option<f64>,
    /// Latest values.
    pub usage: BTreeMap<String, f64>,
    /// `None`: counted here.
    pub usage_at: Option<Instant>,
    /// Breaks off: counted on to its end.
    pub is_recounted: bool,
    /// Last recorded.
    pub lifetime: BTreeMap<String, f64>,
    /// See [`Self::lifetime`].
    pub lifetime_at: Option<Instant>,
    /// Crossed limits by check and instance, last recorded.
    pub exceedances: BTreeMap<(String, u8), ExceedanceLine>,
    /// Components by place, from 1, as recorded last.
    pub components: BTreeMap<u8, ComponentLine>,
    /// Limits of use of each part, by place from 0.
    pub part_limits: [part::ServiceLimits; COMPONENTS_MAX],
    /// Count, first and last time.
    pub losses: BTreeMap<&'static str, Loss>,
    /// The recorder's last statistics.
    pub stats: Option<Stats>,
    /// Gaps, in order, up to [`LISTED_MAX`].
    pub gaps: Vec<Gap>,
    /// Cause, offset and words, in another format.
    pub gap_words: Vec<(item::Cause, Option<u64>, String)>,
    /// No vehicle, judged here.
    pub unheard: Option<String>,
    /// Remarks, as sentences.
    pub remarks: Vec<String>,
    /// Entries that are not frames.
    pub not_frames: u64,
    /// Verified on board, wrong here.
    pub bad_frames: u64,
}

impl Contents {
    /// Frames of all messages.
    pub fn frames(&self) -> u64 {
        self.all_frames().count
    }

    fn all_frames(&self) -> Amount {
        let mut all = self.other_messages;
        let frames = self.messages.iter().filter(|message| message.id.is_some());
        frames.for_each(|message| all.add(message.amount));
        all
    }

    /// Checks by the recorder: only a checking recorder writes these records.
    pub fn is_checked(&self) -> bool {
        self.boot.is_some() || !self.usage.is_empty() || self.findings_count > 0
    }

    /// `board`, `hums` (this program), `nobody`.
    pub fn checked_by(&self) -> &'static str {
        match (self.checked_here, self.is_checked()) {
            (true, _) => "hums",
            (false, true) => "board",
            (false, false) => "nobody",
        }
    }

    /// The box's, or as seen here.
    pub fn flights(&self) -> Vec<FlightLine> {
        let mut flights: Vec<FlightLine> = Vec::new();
        for (at, is_take_off) in &self.moves {
            match flights.last_mut() {
                Some(last) if !is_take_off => last.to = last.to.or(Some(*at)),
                _ if *is_take_off => flights.push(FlightLine { from: *at, to: None }),
                _ => {}
            }
        }
        flights
    }

    /// Bytes of all frames.
    pub fn frame_bytes(&self) -> u64 {
        self.all_frames().bytes
    }

    /// Bytes that the frames take in a tlog.
    pub fn tlog_bytes(&self) -> u64 {
        self.frame_bytes() + 8 * self.frames()
    }

    /// Little judged, nothing found: no good news.
    pub fn is_little(&self) -> bool {
        self.judged.is_some_and(JudgedChecks::is_little) && !self.findings.iter().any(Finding::is_bad)
    }

    /// A part and its first limit; place from 1.
    pub fn part(&self, place: u8, line: &ComponentLine) -> (String, Option<String>) {
        let name = part::name(line.kind, line.number, &line.name);
        (name, self.first_limit(place, line).map(|limit| limit.to_string()))
    }

    /// Reached first; place from 1.
    pub fn first_limit(&self, place: u8, line: &ComponentLine) -> Option<part::Limit> {
        let limits = self.part_limits.get(usize::from(place).wrapping_sub(1)).copied().unwrap_or_default();
        part::first_limit(line.kind, &line.figures, &limits)
    }

    /// `None` for another check.
    pub fn due(&self, finding: &Finding) -> Option<(String, Option<String>)> {
        let of = |line: &ComponentLine| {
            let kind = ComponentKind::ALL.into_iter().find(|kind| kind.name() == line.kind);
            kind.and_then(ComponentKind::subsystem) == Some(finding.subsystem)
        };
        let mine = self.components.iter().filter(|(_, line)| part::is_due(&finding.check) && of(line));
        let (place, line) =
            mine.max_by(|(_, one), (_, other)| one.used_percent.total_cmp(&other.used_percent))?;
        Some(self.part(*place, line))
    }

    /// Reported by the box.
    pub fn did_not_record(&self, gap: &Gap) -> bool {
        let (from, to) = (gap.from.unwrap_or(Instant::ZERO), gap.to);
        let is_ok = |finding: &Finding| finding.level == Level::Ok;
        let mut changes = self.findings.iter().filter(|finding| finding.check == "recording");
        let before = changes.clone().rfind(|change| change.at <= from);
        before.is_some_and(|change| !is_ok(change))
            || changes.any(|change| !is_ok(change) && change.at > from && to.is_none_or(|to| change.at <= to))
    }

    /// Life before session.
    pub fn is_life_before(&self) -> bool {
        self.lifetime_at.zip(self.usage_at).is_some_and(|(life, usage)| usage.since(life) >= STORED_WITH)
    }

    fn record(&mut self, at: Instant, record: &Record<'_>) {
        self.records += 1;
        match record {
            Record::Boot(boot) => {
                self.boot.get_or_insert_with(|| BootLine {
                    version: boot.version.to_owned(),
                    git: boot.git.to_owned(),
                    board: boot.board.to_owned(),
                    reset: boot.reset_name.to_owned(),
                    boots: boot.boots,
                    uid: boot.uid,
                });
            }
            Record::Vehicle(vehicle) => self.vehicle = Some(*vehicle),
            Record::Event(event) => self.event(at, event.number),
            Record::Finding(finding) => {
                self.findings_count += 1;
                if self.findings.len() < LISTED_MAX {
                    self.findings.push(Finding::from(finding));
                }
            }
            // Of the sessions before.
            Record::Usage(snapshot) if snapshot.moment != Moment::Start || self.usage.is_empty() => {
                self.usage.extend(named(snapshot.iter()));
                self.usage_at = Some(at);
                let flight_s = self.usage.get(UsageCounter::Flight.name()).copied();
                self.flight_before_s = self.flight_before_s.or(flight_s);
            }
            Record::Lifetime(life) => {
                self.lifetime_at = Some(at);
                self.lifetime.extend(named(life.iter()));
                self.lifetime.insert("boots".to_owned(), f64::from(life.boots));
                self.lifetime.insert("sessions".to_owned(), f64::from(life.sessions));
            }
            Record::Exceedance(record) => {
                let line = ExceedanceLine {
                    session: record.session,
                    lifetime: record.lifetime,
                    unit: record.unit.to_owned(),
                };
                self.exceeded((record.check.to_owned(), record.instance), line);
            }
            // Its successor is recorded after it.
            Record::Component(record) if record.why != RecordReason::Replaced => {
                let line = ComponentLine {
                    kind: record.kind.name(),
                    number: record.number,
                    name: record.name.to_owned(),
                    serial: record.serial.to_owned(),
                    status: record.status.name(),
                    used_percent: record.used_percent,
                    figures: record.figures,
                    replaced: record.replaced,
                };
                self.components.insert(record.place.saturating_add(1), line);
            }
            Record::Parameter(parameter) => {
                if let Some((place, which)) = part::limit_of(parameter.name)
                    && let Some(limit) = self.part_limits.get_mut(place).and_then(|of| of.get_mut(which))
                {
                    *limit = parameter.value;
                }
            }
            Record::Loss(loss) => add_loss(&mut self.losses, loss),
            Record::Stats(stats) => self.stats = Some(*stats),
            _ => {}
        }
    }

    fn event(&mut self, at: Instant, number: u8) {
        self.begins_in_air |= number == marks::RESUMED;
        let is_move = [marks::RESUMED, marks::TAKE_OFF, marks::LANDING].contains(&number);
        if is_move && self.moves.len() < LISTED_MAX {
            self.moves.push((at, number != marks::LANDING));
        }
    }

    fn exceeded(&mut self, key: (String, u8), line: ExceedanceLine) {
        if self.exceedances.len() < EXCEEDANCES_MAX || self.exceedances.contains_key(&key) {
            self.exceedances.insert(key, line);
        }
    }

    fn add(&mut self, next: Self) {
        self.records += next.records;
        self.boot = self.boot.take().or(next.boot);
        self.vehicle = next.vehicle.or(self.vehicle);
        self.begins_in_air |= next.begins_in_air;
        let room = LISTED_MAX.saturating_sub(self.moves.len());
        self.moves.extend(next.moves.into_iter().take(room));
        self.findings_count += next.findings_count;
        let room = LISTED_MAX.saturating_sub(self.findings.len());
        self.findings.extend(next.findings.into_iter().take(room));
        self.flight_before_s = self.flight_before_s.or(next.flight_before_s);
        self.usage.extend(next.usage);
        self.usage_at = next.usage_at.or(self.usage_at);
        self.lifetime.extend(next.lifetime);
        self.lifetime_at = next.lifetime_at.or(self.lifetime_at);
        next.exceedances.into_iter().for_each(|(key, line)| self.exceeded(key, line));
        self.components.extend(next.components);
        for (known, next) in self.part_limits.iter_mut().zip(next.part_limits) {
            *known = if next.iter().any(|limit| *limit > 0.0) { next } else { *known };
        }
        for loss in next.losses.values() {
            add_loss(&mut self.losses, loss);
        }
        self.stats = next.stats.or(self.stats);
        self.bad_frames += next.bad_frames;
    }
}

fn named(counters: impl Iterator<Item = (u8, f32)>) -> impl Iterator<Item = (String, f64)> {
    counters.map(|(number, value)| (counter_name(number), f64::from(value)))
}

fn add_loss(losses: &mut BTreeMap<&'static str, Loss>, loss: &Loss) {
    let sum = losses.entry(loss.what.name()).or_insert(Loss { count: 0, ..*loss });
    sum.count += loss.count;
    sum.from = sum.from.min(loss.from);
    sum.to = sum.to.max(loss.to);
}

impl ItemCollector for Contents {
    fn item(&mut self, at: Instant, item: Item<'_>) {
        match item {
            Item::Record(record) => self.record(at, record),
            Item::Frame(frame) if frame.check() == link::Check::Verified => {
                self.bad_frames += u64::from(is_bad(frame));
            }
            _ => {}
        }
    }

    fn held_bytes(&self) -> usize {
        // With texts on the heap.
        const ENTRY_BYTES: usize = 256;
        ENTRY_BYTES * (self.findings.len() + self.exceedances.len() + self.moves.len())
    }
}

impl PartReceiver<Self> for Contents {
    fn gap(&mut self, gap: &item::Gap) -> Result<()> {
        if self.gaps.len() < LISTED_MAX {
            self.gaps.push(gap.to_own());
        }
        Ok(())
    }

    fn part(&mut self, collected: Self) -> Result<()> {
        self.add(collected);
        Ok(())
    }
}

/// A log's overview.
#[derive(Clone, Debug, Default)]
pub struct Overview {
    /// Counts and proofs.
    pub ending: Ending,
    /// `None` for a HUMS log.
    pub format: Option<Format>,
    /// Set aside for it.
    pub bytes_on_card: u64,
    /// UTC by the clock of each part.
    pub epochs: Epochs,
    /// Its contents.
    pub contents: Contents,
}

impl HasEnding for Overview {
    fn ending(&mut self) -> Option<&mut Ending> {
        Some(&mut self.ending)
    }
}

impl Overview {
    /// Its first file's name, without folders.
    pub fn file_name(&self) -> Option<String> {
        let file = Path::new(self.ending.files.first()?).file_name()?;
        Some(file.to_string_lossy().into_owned())
    }

    /// Only the record shows whose frames they are; see [`Overview::verified`].
    pub fn of(log: &Log) -> Result<Self> {
        Self::read(log, Needs::default(), None)
    }

    /// Hands on the content in order; of several vehicles this system id.
    pub fn told(log: &Log, system: Option<u8>, take: &mut ItemSink<'_>) -> Result<Self> {
        Self::read(log, Needs { system, ..Needs::default() }, Some(take))
    }

    /// Reads a log with every frame's checksum.
    pub fn verified(log: &Log) -> Result<Self> {
        Self::read(log, Needs { frames: true, ..Needs::default() }, None)
    }

    fn read(log: &Log, want: Needs<'_>, take: Option<&mut ItemSink<'_>>) -> Result<Self> {
        let bar = progress::bytes(Some(log.bytes()), &log.name);
        let mut contents = Contents::default();
        let (reader, seen) = (OwnReader::new(log.clone()), |bytes| bar.set_position(bytes));
        let summary = match take {
            Some(take) => reader.in_parts_and_order(want, Contents::default, &mut contents, take, seen)?,
            None => reader.in_parts(want, Contents::default, &mut contents, seen)?,
        };
        bar.finish_and_clear();
        (contents.messages, contents.other_messages) = (summary.messages, summary.other_messages);
        contents.not_frames = summary.not_frames;
        let ending = summary.ending.unwrap_or_default();
        contents.epoch_us = ending.summary.epoch_us;
        let epochs = Epochs::of(ending.summary.epoch_us);
        Ok(Self { ending, format: None, epochs, bytes_on_card: log.bytes(), contents })
    }

    /// No loss or damage, proved at least to the last end mark; another format has no proof.
    pub fn is_sound(&self) -> bool {
        self.faults().is_empty()
    }

    /// Losses, damage, missing proof.
    pub fn soundness(&self) -> Soundness {
        match self.format {
            None => Soundness::of(&self.ending),
            Some(_) if self.ending.summary.gaps > 0 => Soundness::Damaged,
            Some(_) if self.contents.is_lossy => Soundness::Lossy,
            Some(_) => Soundness::Whole,
        }
    }

    /// Faults in words.
    pub fn faults(&self) -> Vec<String> {
        match (self.format, self.ending.summary.gaps) {
            (None, _) => self.ending.faults(),
            (Some(_), 0) => Vec::new(),
            (Some(_), gaps) => vec![damaged_places(gaps)],
        }
    }

    /// UTC at this time, if known.
    pub fn utc_us(&self, at: Instant) -> Option<u64> {
        self.epochs.utc_us(at)
    }

    /// Sectors, without the file's rest.
    pub fn log_bytes(&self) -> u64 {
        self.ending.summary.blocks.sectors * 512
    }

    /// Tlog's size by the log's.
    pub fn ratio(&self) -> Option<f64> {
        let bytes = self.log_bytes();
        (self.format.is_none() && bytes > 0).then(|| self.contents.tlog_bytes() as f64 / bytes as f64)
    }

    /// Stored counters' time, if armed or in the air after it: a log may end before a landing's store.
    pub fn counted_until(&self) -> Option<Instant> {
        let summary = &self.ending.summary;
        let flew = summary.marks.moved.is_some() || summary.marks.took_off == Some(true);
        let last = summary.last.filter(|_| flew)?;
        self.contents.usage_at.filter(|at| last.since(*at) >= COUNTED_LATE)
    }

    /// Time in the air by the usage counters, seconds. They count from power-on: a later log of one power-on begins with
    /// the counts of the logs before it.
    pub fn flight_s(&self) -> Option<f64> {
        let contents = &self.contents;
        contents.usage.get(UsageCounter::Flight.name()).map(|all| {
            since_power_on(*all, contents.flight_before_s.unwrap_or(0.0), self.ending.summary.first_number)
        })
    }

    /// How the counters count, as a sentence; `None` if this program counted them all.
    pub fn counted_words(&self) -> Option<String> {
        let until = self.counted_until().map(moment);
        match until {
            Some(at) if self.contents.is_recounted => {
                Some(format!("counted here to the end of the log; the box had stored its own last at {at}"))
            }
            Some(at) => Some(format!("as the box stored it at {at}: the log goes on after that")),
            None => {
                (self.contents.boot.is_some() && self.flight_s() > Some(0.0)).then(|| BOX_COUNTS.to_owned())
            }
        }
    }

    /// Whether a group could not be read because this program is too old for it.
    pub fn needs_newer_program(&self) -> bool {
        self.contents.gaps.iter().any(|gap| matches!(gap.cause, Cause::UnknownLayouts(_)))
    }
}
