//! One pass over a log.

use std::collections::BTreeMap;
use std::io::Read;
use std::sync::Arc;

use anyhow::{Result, bail};
use hums_core::clock::{Span, UTC_MICROS};
use hums_link::alert::{self, event_name};

use super::fields::Fields;
use super::format::Formats;
use super::message::{
    FILE_HEADER_BYTES, Found, Keyed, MESSAGE_BYTES_MAX, Message, Parser, VERSION_AT, VERSION_MAX, beginning,
    words as text_of,
};
use super::px4::{Px4, Report, Sample};
use super::rows;
use super::times;
use super::topics::Subscriptions;
use crate::mavlink::values::Scalar;
use crate::source::buffer::Buffer;
use crate::source::clock::{self, Clock, Reading, Stamp, WrongTimes};
use crate::source::item::{
    Cause, CellValue, Column, ColumnType, Event, Fact, FactKind, Gap, Item, ItemSink, Mode, Needs, Parameter,
    RecordingSummary, Row, Rows, Table, Text, hand_said,
};
use crate::source::pace::Pace;

/// An older event is from before the log.
const OLD_US: u64 = 1_000_000;

const LOOK_BYTES: usize = MESSAGE_BYTES_MAX + times::AHEAD_BYTES;
const FIND_BYTES: usize = LOOK_BYTES + 64 * 1024;
/// Data was appended.
const APPENDED: [u8; 8] = [1, 0, 0, 0, 0, 0, 0, 0];
/// Waiting offsets: the header has three.
const APPENDED_MAX: usize = 3;
/// Kept on PX4's card, with the time of their boot.
const KEPT_OVER_BOOTS: [&str; 1] = ["mission"];
/// Appended to the last log after a hard fault (`hardfault_log`).
const HARD_FAULT: &str = "hardfault_plain";
/// Words of one piece of information at most.
const WORDS_BYTES_MAX: usize = 256;

pub(super) fn read<R: Read>(
    buffer: &mut Buffer<R>,
    want: Needs<'_>,
    take: &mut ItemSink<'_>,
) -> Result<RecordingSummary> {
    buffer.fill(FILE_HEADER_BYTES);
    let Some((version, time_us)) = beginning(buffer.rest()) else {
        bail!("is no PX4 log: a ULog begins with 16 bytes of header, and this does not");
    };
    buffer.take(FILE_HEADER_BYTES);
    let mut session = Session::new(want, take);
    let first = times::first_in(buffer);
    session.begin(0, time_us, &first, buffer.ended());
    session.version(0, version)?;
    loop {
        buffer.fill(LOOK_BYTES);
        let place = buffer.place();
        let rest = session.part(buffer.rest(), place);
        if rest.is_empty() {
            if !session.next_part(buffer.rest().is_empty()) {
                break;
            }
            continue;
        }
        match session.look(rest) {
            Found::Message(message, bytes) => {
                let after = rest.get(bytes..).unwrap_or_default();
                session.message(place, &message, bytes, after)?;
                buffer.take(bytes);
            }
            found => damage(buffer, &mut session, found == Found::Cut)?,
        }
    }
    if let Some(error) = buffer.take_trouble() {
        let words = format!("an input that cannot be read further: {error}");
        session.gap(Cause::Damaged, Some(buffer.place()), 0, words)?;
    }
    session.end()
}

fn damage<R: Read>(buffer: &mut Buffer<R>, session: &mut Session<'_, '_>, cut: bool) -> Result<()> {
    let place = buffer.place();
    let (mut from, mut bytes, mut zeros, mut found) = (1, 0, true, false);
    while !found {
        buffer.fill(FIND_BYTES);
        let rest = session.part(buffer.rest(), buffer.place());
        let last = buffer.ended() || rest.len() < buffer.rest().len();
        let next = session.find(rest, from, last);
        found = next.is_ok();
        let skipped = next.unwrap_or_else(|none| none);
        zeros &= rest.get(..skipped).unwrap_or_default().iter().all(|&byte| byte == 0);
        bytes += skipped as u64;
        buffer.take(skipped);
        if last {
            break;
        }
        from = 0;
    }
    let (cause, words) = match (found, cut, zeros) {
        (false, _, true) => (Cause::Cut, format!("{bytes} zero bytes to the end, where messages should be")),
        (false, true, _) => (Cause::Cut, "a message that the end cuts off".to_owned()),
        _ => (Cause::Damaged, format!("{bytes} bytes that are no messages")),
    };
    session.gap(cause, Some(place), bytes, words)
}

struct Session<'a, 'b> {
    want: Needs<'a>,
    take: &'a mut ItemSink<'b>,
    formats: Formats,
    subscriptions: Subscriptions,
    clock: Clock,
    px4: Px4,
    own: OwnTables,
    information: BTreeMap<&'static str, String>,
    told_facts: bool,
    told_hard_fault: bool,
    appended: Vec<u64>,
    /// The present log's place.
    base: u64,
    /// Unknown subscriptions: number, first place.
    strays: (u64, u64),
    /// A topic and a logged string may repeat it.
    last_words: String,
    wrong: WrongTimes,
    asked_left: usize,
    pace: Pace,
}

/// Information besides rows.
const KEPT: [&str; 8] = [
    "sys_name",
    "ver_sw",
    "ver_sw_release",
    "ver_hw",
    "ver_hw_subtype",
    "log_type",
    "replay",
    "boot_time_utc_us",
];

impl<'a, 'b> Session<'a, 'b> {
    fn new(want: Needs<'a>, take: &'a mut ItemSink<'b>) -> Self {
        Self {
            want,
            take,
            formats: Formats::default(),
            subscriptions: Subscriptions::default(),
            clock: Clock::new(times::RULES),
            px4: Px4::default(),
            own: OwnTables::new(want.rows),
            information: BTreeMap::new(),
            told_facts: false,
            told_hard_fault: false,
            appended: Vec::new(),
            base: 0,
            strays: (0, 0),
            last_words: String::new(),
            wrong: WrongTimes::default(),
            asked_left: times::ASKED_BYTES,
            pace: Pace::default(),
        }
    }

    /// No message continues over appended data.
    fn part<'r>(&self, rest: &'r [u8], place: u64) -> &'r [u8] {
        let bytes = self
            .appended
            .first()
            .map_or(usize::MAX, |&next| usize::try_from(next.saturating_sub(place)).unwrap_or(usize::MAX));
        rest.get(..bytes).unwrap_or(rest)
    }

    fn next_part(&mut self, ended: bool) -> bool {
        if ended || self.appended.is_empty() {
            return false;
        }
        self.appended.remove(0);
        true
    }

    fn look<'r>(&self, rest: &'r [u8]) -> Found<'r> {
        let fits = |id: u16, bytes: usize| self.subscriptions.fits(id, bytes);
        Parser { fits: &fits }.look(rest)
    }

    fn find(&self, rest: &[u8], from: usize, last: bool) -> Result<usize, usize> {
        let fits = |id: u16, bytes: usize| self.subscriptions.fits(id, bytes);
        Parser { fits: &fits }.find(rest, from, last)
    }

    fn end(mut self) -> Result<RecordingSummary> {
        let (strays, first) = self.strays;
        if strays > 0 {
            let words = format!("{strays} messages of data without a subscription");
            self.gap(Cause::Damaged, Some(first), 0, words)?;
        }
        if let Some(&place) = self.appended.first() {
            let words =
                format!("no appended data at {place}, which the header names: the file ends before it");
            self.gap(Cause::Damaged, Some(place), 0, words)?;
        }
        for gap in self.pace.gaps(&self.wrong) {
            self.tell(Item::Gap(&gap))?;
        }
        self.tell_facts()?;
        Ok(RecordingSummary { messages: self.subscriptions.counts(), ..RecordingSummary::default() })
    }

    fn tell(&mut self, item: Item<'_>) -> Result<()> {
        (self.take)(self.clock.now(), item)
    }

    fn tell_said(&mut self, item: Item<'_>) -> Result<()> {
        hand_said(self.clock.now(), item, self.want.observations, self.take)
    }

    fn gap(&mut self, cause: Cause, place: Option<u64>, bytes: u64, words: String) -> Result<()> {
        let gap = Gap { from: Some(self.clock.now()), to: None, cause, place, bytes, words, own: None };
        self.tell(Item::Gap(&gap))
    }

    fn message(&mut self, place: u64, message: &Message<'_>, bytes: usize, after: &[u8]) -> Result<()> {
        match *message {
            Message::Data { id, data } => self.data(place, (id, data), bytes, after),
            Message::Flags { incompatible, appended } => self.flags(place, incompatible, appended),
            Message::Format(text) => match self.formats.define(text) {
                Ok(()) => Ok(()),
                Err(error) => self.gap(Cause::Damaged, Some(place), bytes as u64, error.to_string()),
            },
            Message::Information { value, multiple } => self.information(&value, multiple),
            Message::Parameter(value) => self.parameter(&value),
            Message::Default { groups, value } => self.default(groups, &value),
            Message::Subscribe { id, instance, name } => self.subscribe(place, id, instance, name),
            Message::Unsubscribe(id) => {
                self.subscriptions.remove(id);
                Ok(())
            }
            Message::Text { level, tag, time_us, words } => {
                self.tell_facts()?;
                if time_us > 0 {
                    self.time(times::of_text(time_us), place, after)?;
                }
                self.text(level, tag, time_us, text_of(words))
            }
            Message::Dropout(milliseconds) => self.dropout(place, milliseconds),
            Message::Beginning { version, time_us } => {
                self.another(place, time_us, after)?;
                self.version(place, version)
            }
            Message::Sync | Message::Unknown => Ok(()),
        }
    }

    /// A newer format may give data another meaning: damage.
    fn version(&mut self, beginning: u64, version: u8) -> Result<()> {
        if version <= VERSION_MAX {
            return Ok(());
        }
        let words = format!(
            "a header of ULog's version {version}: it is read as version {VERSION_MAX}, the newest that is known, and what is made of it may be wrong"
        );
        self.gap(Cause::Damaged, Some(beginning + VERSION_AT as u64), 1, words)
    }

    /// Unknown flags: by the format they must be refused.
    fn flags(&mut self, place: u64, incompatible: [u8; 8], appended: [u64; 3]) -> Result<()> {
        let unknown: Vec<String> = incompatible
            .iter()
            .zip(APPENDED)
            .map(|(flags, known)| format!("{:02x}", flags & !known))
            .collect();
        if unknown.iter().any(|flags| flags != "00") {
            bail!(
                "is a ULog of a kind that this version cannot read: its header has the incompatible flags {} at byte {place}",
                unknown.concat()
            );
        }
        if incompatible != APPENDED {
            return Ok(());
        }
        for offset in appended.into_iter().filter(|&offset| offset != 0) {
            let offset = offset.saturating_add(self.base);
            let leads_on = offset > place && self.appended.last().is_none_or(|&last| offset > last);
            if leads_on && self.appended.len() < APPENDED_MAX {
                self.appended.push(offset);
            } else {
                let why = if leads_on { "is one too many" } else { "leads back" };
                let words = format!("an offset of appended data that {why}, to {offset}");
                self.gap(Cause::Damaged, Some(place), 0, words)?;
            }
        }
        Ok(())
    }

    fn information(&mut self, value: &Keyed<'_>, multiple: bool) -> Result<()> {
        let text = value.words();
        if let Some(key) = KEPT.iter().find(|key| **key == value.name && !multiple) {
            let mut words = text.map_or_else(
                || value.number().map_or_else(String::new, |number| format!("{number:.0}")),
                str::to_owned,
            );
            words.truncate(words.floor_char_boundary(WORDS_BYTES_MAX));
            self.information.insert(*key, words);
            self.epoch_from_boot()?;
        }
        if value.name == HARD_FAULT && !std::mem::replace(&mut self.told_hard_fault, true) {
            let first = text.unwrap_or_default().lines().find(|line| !line.trim().is_empty());
            let first = first.map_or_else(String::new, |line| format!(": {}", line.trim()));
            let words = format!("the autopilot's processor had a hard fault{first}");
            self.tell(Item::Fact(Fact { about: FactKind::ProcessorFault, words: &words }))?;
        }
        let Some(table) = self.own.information.clone() else { return Ok(()) };
        let number =
            value.number().map_or(CellValue::Unknown, |number| CellValue::Number(Scalar::Double(number)));
        let text = text.map_or(CellValue::Unknown, CellValue::Text);
        self.tell(Item::Row(Row { table: &table, values: &[CellValue::Text(value.name), text, number] }))
    }

    fn parameter(&mut self, value: &Keyed<'_>) -> Result<()> {
        let Some(number) = value.number() else { return Ok(()) };
        self.px4.parameter(value.name, number);
        if let Some(table) = self.own.parameters.clone() {
            let values = [CellValue::Text(value.name), CellValue::Number(Scalar::Double(number))];
            self.tell(Item::Row(Row { table: &table, values: &values }))?;
        }
        self.tell(Item::Parameter(Parameter { name: value.name, value: number }))
    }

    fn default(&mut self, groups: u8, value: &Keyed<'_>) -> Result<()> {
        let (Some(table), Some(number)) = (self.own.defaults.clone(), value.number()) else { return Ok(()) };
        let group = |bit: u8| CellValue::Flag(groups & bit != 0);
        let values =
            [CellValue::Text(value.name), CellValue::Number(Scalar::Double(number)), group(1), group(2)];
        self.tell(Item::Row(Row { table: &table, values: &values }))
    }

    fn subscribe(&mut self, place: u64, id: u16, instance: u8, name: &str) -> Result<()> {
        self.tell_facts()?;
        let layout = match self.formats.layout(name) {
            Ok(layout) => layout,
            Err(error) => {
                self.subscriptions.remove(id);
                return self.gap(
                    Cause::Damaged,
                    Some(place),
                    0,
                    format!("a subscription to {name}: {error}"),
                );
            }
        };
        match self.subscriptions.add(id, instance, &layout, self.want.rows) {
            Ok(()) => Ok(()),
            Err(why) => self.gap(Cause::Damaged, Some(place), 0, format!("a subscription to {name}, {why}")),
        }
    }

    fn data(&mut self, place: u64, (id, data): (u16, &[u8]), bytes: usize, after: &[u8]) -> Result<()> {
        let Some(subscription) = self.subscriptions.get_mut(id) else {
            if self.strays.0 == 0 {
                self.strays.1 = place;
            }
            self.strays.0 += 1;
            return Ok(());
        };
        let recorded = subscription.take(data, bytes).filter(|&recorded| recorded > 0);
        let stamp = recorded.map(|us| times::stamp(id, us));
        let is_wrong = match stamp {
            Some(stamp) => self.time(stamp, place, after)?,
            None => false,
        };
        let recorded = recorded.filter(|_| !is_wrong);
        self.pace.at(self.clock.now(), place, bytes as u64);
        if stamp.is_some_and(|stamp| !is_wrong && self.clock.stands(stamp.series)) {
            self.pace.stood(self.clock.now(), place);
        }
        let (now, latest) = (self.clock.now(), self.recorded());
        let Some(subscription) = self.subscriptions.get_mut(id) else { return Ok(()) };
        if let Some(table) = &subscription.table {
            let values = rows::values(&subscription.layout, subscription.instance, data);
            (self.take)(now, Item::Row(Row { table, values: &values }))?;
        }
        let recorded = recorded.unwrap_or(latest);
        if let Some((topic, slots)) = &subscription.topic
            && subscription
                .observed_us
                .is_none_or(|last| recorded < last || recorded - last >= topic.every_us)
        {
            subscription.observed_us = Some(recorded);
            let fields = Fields::new(slots, data);
            self.px4.take(
                topic,
                &Sample {
                    at: now,
                    recorded_us: recorded,
                    is_old: latest.saturating_sub(recorded) > OLD_US,
                    instance: subscription.instance,
                    fields,
                },
            );
        }
        self.px4.step(now, latest);
        self.hand_on()
    }

    /// Counts a wrong time. A topic kept over a boot is excepted until its first new time.
    fn time(&mut self, stamp: Stamp, place: u64, after: &[u8]) -> Result<bool> {
        let (subscriptions, left) = (&self.subscriptions, &mut self.asked_left);
        let ahead = |asks: &dyn Fn(Stamp) -> bool| times::ahead(subscriptions, after, left, asks);
        match self.clock.take(stamp, ahead) {
            Reading::Sound(moment) if moment.restarted => {
                self.pace.fell(moment.at);
                (self.take)(moment.at, Item::Restart)?;
            }
            Reading::Sound(_) | Reading::Old => {}
            Reading::Wrong { known } => {
                let topic = stamp.series.checked_sub(1).and_then(|id| self.subscriptions.name(id));
                if known || topic.is_none_or(|topic| !KEPT_OVER_BOOTS.contains(&topic)) {
                    self.wrong.add(self.clock.now(), place);
                }
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn recorded(&self) -> u64 {
        self.clock.recorded_us().unwrap_or(0)
    }

    /// A log begins, if its first data begin then; `true` if another log came before.
    fn begin(&mut self, place: u64, time_us: u64, first: &[u64], is_end: bool) -> bool {
        let (time_us, is_wrong) = clock::beginning(time_us, first, is_end);
        let again = self.clock.begin_log(time_us);
        if is_wrong {
            self.wrong.add(self.clock.now(), place);
        }
        again
    }

    fn hand_on(&mut self) -> Result<()> {
        if self.px4.reports.is_empty() {
            return Ok(());
        }
        let mut reports = std::mem::take(&mut self.px4.reports);
        for report in reports.drain(..) {
            self.report(report)?;
        }
        // Reused.
        self.px4.reports = reports;
        Ok(())
    }

    fn report(&mut self, report: Report) -> Result<()> {
        let source = self.px4.source();
        match report {
            Report::Observation(_) if !self.want.observations => Ok(()),
            Report::Observation(observation) => self.tell(Item::Observation(source, &observation)),
            Report::Text { severity, words } => self.say(severity, &words),
            Report::Event { number, severity, arguments, is_old } => {
                let words = event_name(number).unwrap_or_default();
                let alert = alert::of_event(number, severity, &arguments).filter(|_| !is_old);
                self.tell_said(Item::Event(Event { source, number, severity, words, alert }))
            }
            Report::Mode { number, name } => self.tell(Item::Mode(Mode { number, name })),
            Report::Failsafes(words) => {
                self.tell(Item::Fact(Fact { about: FactKind::Failsafes, words: &words }))
            }
            Report::Utc { utc_us, recorded_us } => self.epoch(i128::from(utc_us) - i128::from(recorded_us)),
        }
    }

    /// UTC from the autopilot's boot to time zero.
    fn epoch(&mut self, boot_us: i128) -> Result<()> {
        let zero_us = i128::from(self.recorded()) - i128::from(self.clock.now().as_micros());
        match u64::try_from(boot_us + zero_us) {
            Ok(epoch) if UTC_MICROS.contains(&epoch) => self.tell(Item::Epoch(epoch)),
            _ => Ok(()),
        }
    }

    fn epoch_from_boot(&mut self) -> Result<()> {
        match self.information.remove("boot_time_utc_us").and_then(|text| text.parse::<u64>().ok()) {
            Some(boot_us) if boot_us > 0 => self.epoch(i128::from(boot_us)),
            _ => Ok(()),
        }
    }

    fn text(&mut self, level: u8, tag: Option<u16>, time_us: u64, words: &str) -> Result<()> {
        if let Some(table) = self.own.texts.clone() {
            let tag =
                tag.map_or(CellValue::Unknown, |tag| CellValue::Number(Scalar::Unsigned(u64::from(tag))));
            let [level, time_us] = [u64::from(level), time_us].map(Scalar::Unsigned).map(CellValue::Number);
            self.tell(Item::Row(Row {
                table: &table,
                values: &[time_us, level, tag, CellValue::Text(words)],
            }))?;
        }
        self.say(level, words.trim_end())
    }

    fn say(&mut self, severity: u8, words: &str) -> Result<()> {
        if words.is_empty() || words == self.last_words {
            return Ok(());
        }
        words.clone_into(&mut self.last_words);
        let source = self.px4.source();
        let alert = alert::of_text(Some(severity), without_module(words).as_bytes());
        self.tell_said(Item::Text(Text { source, severity, words, alert }))
    }

    fn dropout(&mut self, place: u64, milliseconds: u16) -> Result<()> {
        let now = self.clock.now();
        self.px4.dropout();
        let words = match milliseconds {
            0 => "a dropout: the card was too slow for the logger".to_owned(),
            _ => format!("a dropout of {milliseconds} ms: the card was too slow for the logger"),
        };
        let to = Some(now + Span::from_millis(u64::from(milliseconds)));
        let gap = Gap { to, ..Gap::new(Some(now), Cause::Lost, words).at(place) };
        self.tell(Item::Gap(&gap))
    }

    fn another(&mut self, place: u64, time_us: u64, after: &[u8]) -> Result<()> {
        self.tell_facts()?;
        self.formats = Formats::default();
        self.subscriptions.clear();
        self.px4 = Px4::default();
        self.information.clear();
        self.last_words.clear();
        self.told_facts = false;
        self.base = place;
        self.pace.begin_another();
        self.begin(place, time_us, &times::first(after), false);
        self.tell(Item::Joint)
    }

    fn tell_facts(&mut self) -> Result<()> {
        if std::mem::replace(&mut self.told_facts, true) {
            return Ok(());
        }
        let release = self.information.get("ver_sw_release").and_then(|text| text.parse().ok()).unwrap_or(0);
        self.px4.identity(release);
        let known = |key: &str| self.information.get(key).filter(|words| !words.is_empty());
        let mut facts = Vec::new();
        let name = known("sys_name").map_or("PX4", String::as_str);
        let commit = known("ver_sw").and_then(|commit| commit.get(..8)).map(|commit| format!(" ({commit})"));
        if release != 0 || commit.is_some() {
            let version = if release == 0 { String::new() } else { format!(" v{}", version(release)) };
            facts.push((FactKind::Firmware, format!("{name}{version}{}", commit.unwrap_or_default())));
        }
        if let Some(hardware) = known("ver_hw") {
            let kind = known("ver_hw_subtype").map_or_else(String::new, |kind| format!(" {kind}"));
            facts.push((FactKind::Hardware, format!("{hardware}{kind}")));
        }
        if let Some(kind) = known("log_type") {
            facts.push((FactKind::Recorder, format!("PX4's logger, a log of kind {kind}")));
        }
        if let Some(replayed) = known("replay") {
            facts.push((FactKind::Recorder, format!("PX4's replay of {replayed}")));
        }
        facts.iter().try_for_each(|(about, words)| self.tell(Item::Fact(Fact { about: *about, words })))
    }
}

/// `0xAABBCCTT`: major, minor, patch, type (255 release, 192 candidate, 128 beta, 64 alpha).
fn version(release: u32) -> String {
    let [major, minor, patch, kind] = release.to_be_bytes();
    let kind = match kind {
        255 => "",
        192.. => "-rc",
        128.. => "-beta",
        64.. => "-alpha",
        _ => "-dev",
    };
    format!("{major}.{minor}.{patch}{kind}")
}

struct OwnTables {
    defaults: Option<Arc<Table>>,
    information: Option<Arc<Table>>,
    parameters: Option<Arc<Table>>,
    texts: Option<Arc<Table>>,
}

impl OwnTables {
    fn new(wanted: Rows<'_>) -> Self {
        let table = |name: &str, columns: &[(&str, ColumnType)]| {
            let column = |&(name, kind): &(&str, ColumnType)| Column {
                name: name.to_owned(),
                unit: rows::unit(name).to_owned(),
                kind,
            };
            let table = Table { name: name.to_owned(), columns: columns.iter().map(column).collect() };
            wanted.has(name).then(|| Arc::new(table))
        };
        let (text, flag, number, count) =
            (ColumnType::Text, ColumnType::Flag, ColumnType::Double, ColumnType::Unsigned);
        Self {
            defaults: table(
                rows::DEFAULTS,
                &[("name", text), ("value", number), ("system", flag), ("configuration", flag)],
            ),
            information: table(rows::INFORMATION, &[("key", text), ("text", text), ("number", number)]),
            parameters: table(rows::PARAMETERS, &[("name", text), ("value", number)]),
            texts: table(
                rows::TEXTS,
                &[("timestamp", count), ("severity", count), ("tag", count), ("text", text)],
            ),
        }
    }
}

fn without_module(words: &str) -> &str {
    words.strip_prefix('[').and_then(|words| words.split_once("] ")).map_or(words, |(_, words)| words)
}
