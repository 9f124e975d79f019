//! The contents of a log, in one pass: for `info`, `verify` and `demo`.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

use anyhow::Result;
use hums_blackbox::record::{Loss, Moment, Stats, Vehicle, Why};
use hums_blackbox::{Cause, Gap, Record};
use hums_core::clock::{Instant, Span};
use hums_core::component::{COMPONENTS_MAX, Figures, Kind};
use hums_core::health::Level;
use hums_core::health::exceedance::Crossings;
use hums_core::usage::UsageCounter;
use hums_link as link;
use serde::Serialize;

use crate::ending::Ending;
use crate::followed::HasEnding;
use crate::logs::{Log, marks};
use crate::mavlink::frame::{Check, Peek, peek};
use crate::names::counter_name;
use crate::part;
use crate::plural::are;
use crate::progress;
use crate::soundness::Soundness;
use crate::source::epochs::Epochs;
use crate::source::item::{self, Amount, Item, MessageCount, Take, Want};
use crate::source::own::OwnReader;
use crate::source::parts::{Collect, Deliver};
use crate::source::recording::Format;
use crate::source::told::Finding;
use crate::utc::moment;

/// Findings, gaps and losses that are kept one by one; beyond this they are only counted, so that memory is bounded.
pub const LISTED_MAX: usize = 10_000;

/// The airframe's life and the counters of a session are stored together within this.
const STORED_WITH: Span = Span::from_secs(5);

/// From this time on, counts after the counters were stored are reported.
const COUNTED_LATE: Span = Span::from_secs(1);

/// Checks with exceedances that are kept: four times those that there are, with all their instances.
const EXCEEDANCES_MAX: usize = 1_000;

/// How the monitor started.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct BootLine {
    /// The product's version.
    pub version: String,
    /// The commit it was built from.
    pub git: String,
    /// The board.
    pub board: String,
    /// Why it started.
    pub reset: String,
    /// Number of power-ons.
    pub boots: u32,
}

/// How many checks had something to judge, of those that are meant for the vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JudgedChecks {
    /// These had.
    pub judged: usize,
    /// The number of those that concern the box, its card and its wire only.
    pub of_box: usize,
    /// All.
    pub all: usize,
}

impl JudgedChecks {
    /// Whether so few of the vehicle's checks were judged that no finding means nothing: fewer than one in ten.
    pub const fn is_little(self) -> bool {
        self.judged.saturating_sub(self.of_box) * 10 < self.all
    }
}

impl Display for JudgedChecks {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} of {} checks", self.judged, self.all)
    }
}

/// The vehicle's last state, if a recording ends in the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndsInAir {
    /// When.
    pub at: Instant,
    /// Height above home, or above the local origin, m.
    pub height_m: Option<f32>,
    /// Climb rate, m/s; negative where it sank.
    pub climb_mps: Option<f32>,
    /// Speed over ground, m/s.
    pub speed_mps: Option<f32>,
    /// The last position, degrees north and east.
    pub place_deg: Option<(f64, f64)>,
}

/// A number that a sensor can have, in whatever unit: another one is damaged.
pub fn is_possible(value: &f32) -> bool {
    const IMPOSSIBLE: f32 = 1e9;
    value.abs() < IMPOSSIBLE
}

impl Display for EndsInAir {
    /// As a sentence. A number that no sensor can have is left out.
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

/// Limits of a check that were crossed.
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
    /// Take-off, or when the vehicle was seen first.
    pub from: Instant,
    /// Landing, if it is in the log.
    pub to: Option<Instant>,
}

/// A part that wears.
#[derive(Clone, Debug, PartialEq)]
pub struct ComponentLine {
    /// Its kind.
    pub kind: &'static str,
    /// Which of its kind, from 1; 0 is all.
    pub number: u8,
    /// The operator's name for it.
    pub name: String,
    /// Its serial number.
    pub serial: String,
    /// Green, yellow or red.
    pub status: &'static str,
    /// The part of its life that is used.
    pub used_percent: f32,
    /// Its figures.
    pub figures: Figures,
    /// How often it was replaced.
    pub replaced: u32,
}

/// Why a recording of another program is not whole, as a part of a sentence.
pub fn damaged_places(count: u64) -> String {
    format!("{} damaged or cut; hums check says where", are(count, "place"))
}

/// All that a log holds, counted.
#[derive(Clone, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
pub struct Contents {
    /// Messages by their ids, or by their names where they have none.
    pub messages: Vec<MessageCount>,
    /// Frames of further messages, all unverified: the number of distinguished ids is limited.
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
    /// How many there are.
    pub findings_count: u64,
    /// They were found by this program when it read the log, because its recorder ran no checks.
    pub checked_here: bool,
    /// The number of judged checks, if it is known. For a log checked by its recorder it is known only if few kinds
    /// of messages are in it.
    pub judged: Option<JudgedChecks>,
    /// The vehicle was in the air when it was first received.
    pub begins_in_air: bool,
    /// Take-offs (`true`) and landings, in order, up to [`LISTED_MAX`].
    pub moves: Vec<(Instant, bool)>,
    /// The last flight goes on at its end, in a recording that was judged here.
    pub ends_in_air: Option<EndsInAir>,
    /// Part of the time was not recorded: by the recorder's report, or by the evidence of another program's
    /// recording.
    pub is_lossy: bool,
    /// Seconds in the air before the log, by the box's first counters.
    pub flight_before_s: Option<f64>,
    /// The latest values of the usage counters, and when they were so.
    pub usage: BTreeMap<String, f64>,
    /// See [`Self::usage`]; `None` where this program counted them.
    pub usage_at: Option<Instant>,
    /// The log breaks off, and this program counted the usage on to its end.
    pub is_recounted: bool,
    /// The airframe's life, as recorded last, and when that was.
    pub lifetime: BTreeMap<String, f64>,
    /// See [`Self::lifetime`].
    pub lifetime_at: Option<Instant>,
    /// Limits that were crossed, by check and instance, as recorded last.
    pub exceedances: BTreeMap<(String, u8), ExceedanceLine>,
    /// Components by place, from 1, as recorded last.
    pub components: BTreeMap<u8, ComponentLine>,
    /// Limits of use of each part, by place from 0.
    pub part_limits: [part::Limits; COMPONENTS_MAX],
    /// Losses by kind: count, first and last time.
    pub losses: BTreeMap<&'static str, Loss>,
    /// The recorder's last statistics.
    pub stats: Option<Stats>,
    /// Gaps, in order, up to [`LISTED_MAX`].
    pub gaps: Vec<Gap>,
    /// For each of them its offset in the file and its cause, in a recording of another format.
    pub gap_words: Vec<(Option<u64>, String)>,
    /// The reason why no vehicle was found, if this program judged the recording.
    pub unheard: Option<String>,
    /// Further remarks on the vehicles, as sentences.
    pub remarks: Vec<String>,
    /// Entries that are not frames.
    pub not_frames: u64,
    /// Frames that were verified on board, whose checksum fails here.
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

    /// Whether the recorder checked the vehicle's health: only such a recorder writes these records.
    pub fn is_checked(&self) -> bool {
        self.boot.is_some() || !self.usage.is_empty() || self.findings_count > 0
    }

    /// The checker: `board`, `hums` (this program), `nobody`.
    pub fn checked_by(&self) -> &'static str {
        match (self.checked_here, self.is_checked()) {
            (true, _) => "hums",
            (false, true) => "board",
            (false, false) => "nobody",
        }
    }

    /// Its flights, as the box recorded them or as this program saw them.
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

    /// Whether little was judged without a finding: that is not good news.
    pub fn is_little(&self) -> bool {
        self.judged.is_some_and(JudgedChecks::is_little) && !self.findings.iter().any(Finding::is_bad)
    }

    /// The name of a part, and the limit that it reaches first, by its place from 1.
    pub fn part(&self, place: u8, line: &ComponentLine) -> (String, Option<String>) {
        let name = part::name(line.kind, line.number, &line.name);
        (name, self.first_limit(place, line).map(|limit| limit.to_string()))
    }

    /// The limit that a part reaches first, by its place from 1.
    pub fn first_limit(&self, place: u8, line: &ComponentLine) -> Option<part::Limit> {
        let limits = self.part_limits.get(usize::from(place).wrapping_sub(1)).copied().unwrap_or_default();
        part::first_limit(line.kind, &line.figures, &limits)
    }

    /// The due part of a finding; `None` for another check.
    pub fn due(&self, finding: &Finding) -> Option<(String, Option<String>)> {
        let of = |line: &ComponentLine| {
            let kind = Kind::ALL.into_iter().find(|kind| kind.name() == line.kind);
            kind.and_then(Kind::subsystem) == Some(finding.subsystem)
        };
        let mine = self.components.iter().filter(|(_, line)| part::is_due(&finding.check) && of(line));
        let (place, line) =
            mine.max_by(|(_, one), (_, other)| one.used_percent.total_cmp(&other.used_percent))?;
        Some(self.part(*place, line))
    }

    /// Whether the box reports that it did not record somewhere in a gap.
    pub fn did_not_record(&self, gap: &Gap) -> bool {
        let (from, to) = (gap.from.unwrap_or(Instant::ZERO), gap.to);
        let is_ok = |finding: &Finding| finding.level == Level::Ok;
        let mut changes = self.findings.iter().filter(|finding| finding.check == "recording");
        let before = changes.clone().rfind(|change| change.at <= from);
        before.is_some_and(|change| !is_ok(change))
            || changes.any(|change| !is_ok(change) && change.at > from && to.is_none_or(|to| change.at <= to))
    }

    /// Whether the airframe's life was stored before the counters of this session: it is without them.
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
            // The counters at the start are those of the sessions before.
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
            // A part that was replaced is not there any more; its successor is recorded after it.
            Record::Component(record) if record.why != Why::Replaced => {
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

    /// Adds the next part.
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

impl Collect for Contents {
    fn item(&mut self, at: Instant, item: Item<'_>) {
        match item {
            Item::Record(record) => self.record(at, record),
            Item::Frame(frame) if frame.check() == link::Check::Verified => {
                let is_bad = matches!(peek(frame.bytes()), Peek::Frame(frame) if frame.check() == Check::Bad);
                self.bad_frames += u64::from(is_bad);
            }
            _ => {}
        }
    }

    fn held_bytes(&self) -> usize {
        // Size of a tree's entry, with its texts on the heap.
        const ENTRY_BYTES: usize = 256;
        ENTRY_BYTES * (self.findings.len() + self.exceedances.len() + self.moves.len())
    }
}

impl Deliver<Self> for Contents {
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

/// A log, read through.
#[derive(Clone, Debug, Default)]
pub struct Overview {
    /// The reader's counts, and the proofs of completeness.
    pub ending: Ending,
    /// Its format; `None` for a HUMS log.
    pub format: Option<Format>,
    /// Bytes of these files that are set aside for it.
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
    /// Reads a log through. Only the record itself shows that frames are those of the monitor; see
    /// [`Overview::verified`].
    pub fn of(log: &Log) -> Result<Self> {
        Self::read(log, Want::default(), None)
    }

    /// The same, and hands on the log's content in order: one reading for both. Of several vehicles it is the one
    /// with this system id.
    pub fn told(log: &Log, system: Option<u8>, take: &mut Take<'_>) -> Result<Self> {
        Self::read(log, Want { system, ..Want::default() }, Some(take))
    }

    /// Reads a log through and looks at every frame's own checksum again.
    pub fn verified(log: &Log) -> Result<Self> {
        Self::read(log, Want { frames: true, ..Want::default() }, None)
    }

    fn read(log: &Log, want: Want<'_>, take: Option<&mut Take<'_>>) -> Result<Self> {
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

    /// Whether nothing was lost or damaged, and the log is proved to its end or at least to its last end mark. A recording
    /// of another format has nothing that could prove its end.
    pub fn is_sound(&self) -> bool {
        self.faults().is_empty()
    }

    /// Its losses, damage and missing proof.
    pub fn soundness(&self) -> Soundness {
        match self.format {
            None => Soundness::of(&self.ending),
            Some(_) if self.ending.summary.gaps > 0 => Soundness::Damaged,
            Some(_) if self.contents.is_lossy => Soundness::Lossy,
            Some(_) => Soundness::Whole,
        }
    }

    /// Why it is not, as parts of sentences.
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

    /// Size of the log: its sectors, without the rest of the file.
    pub fn log_bytes(&self) -> u64 {
        self.ending.summary.blocks.sectors * 512
    }

    /// The size of the same frames as a tlog, divided by that of a HUMS log.
    pub fn ratio(&self) -> Option<f64> {
        let bytes = self.log_bytes();
        (self.format.is_none() && bytes > 0).then(|| self.contents.tlog_bytes() as f64 / bytes as f64)
    }

    /// The time of the session's stored counters, if the vehicle was armed or in the air after that: they end there.
    /// The counters are stored at a landing, which a log may lack that ends soon after a touchdown.
    pub fn counted_until(&self) -> Option<Instant> {
        let summary = &self.ending.summary;
        let flew = summary.marks.moved.is_some() || summary.marks.took_off == Some(true);
        let last = summary.last.filter(|_| flew)?;
        self.contents.usage_at.filter(|at| last.since(*at) >= COUNTED_LATE)
    }

    /// The time up to which the counters count, as a sentence; `None` if they cover all.
    pub fn counted_words(&self) -> Option<String> {
        let at = moment(self.counted_until()?);
        Some(if self.contents.is_recounted {
            format!("counted here to the end of the log; the box had stored its own last at {at}")
        } else {
            format!("as the box stored it at {at}: the log goes on after that")
        })
    }

    /// Whether a group could not be read because this program is too old for it.
    pub fn needs_newer_program(&self) -> bool {
        self.contents.gaps.iter().any(|gap| matches!(gap.cause, Cause::UnknownLayouts(_)))
    }
}
