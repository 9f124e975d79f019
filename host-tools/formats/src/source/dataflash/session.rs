//! One reading of a log, message by message.

use std::sync::Arc;

use anyhow::Result;
use hums_core::clock::Instant;
use hums_link::alert;

use super::ahead::Ahead;
use super::clock::{Clock, Own};
use super::definition::{byte, definition, is_of_itself, words};
use super::epoch::Epoch;
use super::format::{Defined, Format, Formats, Lengths, Role};
use super::message::{Body, Message};
use super::observe::{self, Handlers, Out, SOURCE, Standing, State};
use super::stamp::receiver_us;
use super::table::{self, Tables};
use crate::source::clock::WrongTimes;
use crate::source::counts::NamedCounts;
use crate::source::item::{
    Amount, Cause, Fact, FactKind, Gap, Item, ItemSink, Needs, RecordingSummary, Row, Rows, Table, Text,
    hand_said,
};
use crate::source::pace::Pace;

/// Later messages count as the last log's.
const JOINTS_MAX: u32 = 1_000;

/// Facts about the whole file from its first part.
pub(super) struct First {
    formats: Formats,
    state: State,
    clock: Clock,
    handlers: Handlers,
    /// Types without such facts: the next messages have none either.
    idle: Vec<bool>,
    begins_us: Option<u64>,
    timed: bool,
    /// Firmware of a text log, before its first message.
    banner: Option<String>,
}

impl Default for First {
    fn default() -> Self {
        let (formats, state, clock) = (Formats::new(), State::default(), Clock::default());
        let handlers = Handlers::default();
        let idle = vec![false; 256];
        Self { formats, state, clock, handlers, idle, begins_us: None, timed: false, banner: None }
    }
}

impl First {
    pub(super) fn formats(&self) -> &Formats {
        &self.formats
    }

    pub(super) fn lengths(&mut self) -> &mut Lengths {
        &mut self.formats.lengths
    }

    pub(super) fn banner(&mut self, words: &str) {
        let words = words.trim();
        if self.banner.is_none() && self.state.is_firmware(words) {
            self.banner = Some(words.to_owned());
        }
    }

    pub(super) const fn is_timed(&self) -> bool {
        self.timed
    }

    pub(super) fn is_another(&self, kind: u8, body: Body<'_>) -> bool {
        self.timed && begins_a_log(&self.formats, kind, body)
    }

    /// Takes a message.
    pub(super) fn learn(&mut self, kind: u8, body: Body<'_>) {
        let Self { formats, state, handlers, idle, timed, .. } = self;
        if idle.get(usize::from(kind)) == Some(&true) {
            return;
        }
        if formats.get(kind).is_some_and(|format| format.role != Role::Other) {
            let defined = defined_by(formats, kind, body);
            define(formats, kind, body);
            if let Some((defined, _)) = defined {
                handlers.forget(defined);
                idle.iter_mut().skip(defined.into()).take(1).for_each(|idle| *idle = false);
                formats.get(defined).into_iter().for_each(|format| state.define(format));
            }
        }
        let Some(format) = formats.get(kind) else { return };
        *timed |= tells_time(format);
        let message = Message::new(format, body);
        if let Some(resolved) = handlers.of(format).filter(|resolved| resolved.handler.is_fact) {
            observe::take(state, resolved, &message, (Instant::ZERO, None), &mut Out::new(&mut |_| ()));
        } else if let Some(idle) = idle.get_mut(usize::from(kind)) {
            *idle = format.role == Role::Other;
        }
    }
}

impl First {
    /// Second pass: this message has the time of the log's beginning; only now are all definitions known.
    pub(super) fn begins(&mut self, kind: u8, body: Body<'_>, ahead: Ahead<'_>) -> bool {
        let Self { formats, clock, begins_us, .. } = self;
        let Some(format) = formats.get(kind) else { return false };
        let when = clock.at(&Message::new(format, body), ahead, formats);
        *begins_us = when.boot_us.filter(|_| when.own == Own::Sound);
        begins_us.is_some()
    }
}

fn tells_time(format: &Format) -> bool {
    format.time.is_some() || format.name == "GPS"
}

fn begins_a_log(formats: &Formats, kind: u8, body: Body<'_>) -> bool {
    let fmt = formats.get(kind).filter(|format| format.role == Role::Fmt);
    fmt.is_some_and(|format| is_of_itself(&Message::new(format, body)))
}

fn defined_by(formats: &Formats, kind: u8, body: Body<'_>) -> Option<(u8, String)> {
    let format = formats.get(kind).filter(|format| format.role == Role::Fmt)?;
    let of = u8::try_from(Message::new(format, body).unsigned(0)?).ok()?;
    Some((of, formats.get(of).map(|format| format.name.clone()).unwrap_or_default()))
}

/// Reports its faults.
fn define(formats: &mut Formats, kind: u8, body: Body<'_>) -> Option<Defined> {
    let format = formats.get(kind)?;
    let message = Message::new(format, body);
    match format.role {
        Role::Other => None,
        Role::Fmt => {
            let new = definition(&message)?;
            Some(formats.define(new))
        }
        Role::Unit => {
            let (id, name) = (byte(&message, "Id")?, words(&message, "Label")?);
            formats.define_unit(id, &name);
            None
        }
        Role::Mult => {
            let (id, factor) = (byte(&message, "Id")?, message.number(format.field("Mult")?)?);
            formats.define_multiplier(id, factor);
            None
        }
        Role::Fmtu => {
            let (kind, units) = (byte(&message, "FmtType")?, words(&message, "UnitIds")?);
            let multipliers = words(&message, "MultIds").unwrap_or_default();
            formats.define_units(kind, &units, &multipliers);
            None
        }
    }
}

pub(super) struct Session<'w> {
    want: Needs<'w>,
    formats: Formats,
    state: State,
    clock: Clock,
    handlers: Handlers,
    tables: Tables,
    needed: Vec<Option<bool>>,
    /// Messages and bytes by type, and by former names.
    counts: Vec<Amount>,
    counts_before: NamedCounts,
    epoch: Epoch,
    firmware: String,
    rows_refused: bool,
    /// Changes without a certain time: from the next certain one on.
    later: Option<Standing>,
    wrong: WrongTimes,
    pace: Pace,
    unpaced: u64,
    timed: bool,
    joints: u32,
}

impl<'w> Session<'w> {
    pub(super) fn new(first: First, want: Needs<'w>) -> Self {
        let mut clock = Clock::default();
        if let Some(begins_us) = first.begins_us {
            clock.begin(begins_us);
        }
        Self {
            want,
            formats: first.formats.begun_again(),
            state: State::new(first.state.facts()),
            clock,
            handlers: Handlers::default(),
            tables: Tables::default(),
            needed: vec![None; 256],
            counts: vec![Amount::default(); 256],
            counts_before: NamedCounts::default(),
            epoch: Epoch::default(),
            firmware: first.banner.unwrap_or_default(),
            rows_refused: false,
            later: None,
            wrong: WrongTimes::default(),
            pace: Pace::default(),
            unpaced: 0,
            timed: false,
            joints: 0,
        }
    }

    /// Joined on.
    pub(super) fn is_another(&self, kind: u8, body: Body<'_>) -> bool {
        self.is_timed() && begins_a_log(&self.formats, kind, body)
    }

    pub(super) const fn is_timed(&self) -> bool {
        self.timed && self.joints < JOINTS_MAX
    }

    /// All earlier state is void.
    pub(super) fn begin_another(&mut self, first: First, take: &mut ItemSink<'_>) -> Result<()> {
        self.count_by_name();
        let First { formats, state, begins_us, banner, .. } = first;
        self.formats = formats.begun_again();
        self.state = State::new(state.facts());
        self.handlers = Handlers::default();
        self.needed.fill(None);
        self.epoch = Epoch::default();
        self.firmware = banner.unwrap_or_default();
        (self.later, self.timed, self.unpaced) = (None, false, 0);
        self.pace.begin_another();
        self.joints += 1;
        self.clock.begin_another(begins_us);
        take(self.clock.now(), Item::Joint)?;
        self.tell_banner(take)
    }

    /// Another log has other types.
    fn count_by_name(&mut self) {
        for (kind, count) in (0..=u8::MAX).zip(&mut self.counts) {
            if let Some(format) = self.formats.get(kind).filter(|_| count.count > 0) {
                self.counts_before.add(&format.name, std::mem::take(count));
            }
        }
    }

    pub(super) fn tell_banner(&mut self, take: &mut ItemSink<'_>) -> Result<()> {
        if self.firmware.is_empty() {
            return Ok(());
        }
        take(self.clock.now(), Item::Fact(Fact { about: FactKind::Firmware, words: &self.firmware }))
    }

    pub(super) fn formats(&self) -> &Formats {
        &self.formats
    }

    pub(super) fn lengths(&mut self) -> &mut Lengths {
        &mut self.formats.lengths
    }

    /// Takes a message.
    pub(super) fn message(
        &mut self,
        (kind, body): (u8, Body<'_>),
        place: u64,
        bytes: u64,
        ahead: Ahead<'_>,
        take: &mut ItemSink<'_>,
    ) -> Result<()> {
        let index = usize::from(kind);
        self.unpaced += bytes;
        if let Some(messages) = self.counts.get_mut(index) {
            messages.add(Amount { count: 1, bytes });
        }
        match self.needed.get(index).copied().flatten() {
            Some(false) => return Ok(()),
            Some(true) => {}
            None => {
                if matches!(body, Body::Bytes(_)) || !self.formats.is_only_long(kind) {
                    self.tell_odd(kind, place, take)?;
                }
                self.timed |= self.formats.get(kind).is_some_and(tells_time);
                let needed = self.needs(kind);
                if let Some(slot) = self.needed.get_mut(index) {
                    *slot = Some(needed);
                }
                if !needed {
                    return Ok(());
                }
            }
        }
        self.define(kind, body, place, take)?;
        self.say((kind, body), place, ahead, take)?;
        self.row(kind, body, take)
    }

    fn needs(&mut self, kind: u8) -> bool {
        let Self { want, formats, handlers, .. } = self;
        let Some(format) = formats.get(kind) else { return false };
        let observed =
            handlers.of(format).is_some_and(|resolved| want.observations || resolved.handler.is_said);
        let rows = match want.rows {
            Rows::None => false,
            Rows::All => true,
            // Changed columns give the name a number.
            Rows::Named(names) => {
                let mine = |name: &String| name.starts_with(&table::safe(&format.name));
                names.iter().any(mine)
            }
        };
        format.role != Role::Other || observed || rows
    }

    fn define(&mut self, kind: u8, body: Body<'_>, place: u64, take: &mut ItemSink<'_>) -> Result<()> {
        if self.formats.get(kind).is_none_or(|format| format.role == Role::Other) {
            return Ok(());
        }
        let before = defined_by(&self.formats, kind, body);
        let defined = define(&mut self.formats, kind, body);
        if defined == Some(Defined::New)
            && let Some((kind, name)) = before
        {
            self.forget(kind, &name);
        }
        match defined {
            Some(Defined::Refused(words)) => self.gap(Cause::Damaged, Some(place), 0, words, take),
            _ => Ok(()),
        }
    }

    fn tell_odd(&mut self, kind: u8, place: u64, take: &mut ItemSink<'_>) -> Result<()> {
        match self.formats.take_odd(kind) {
            Some(words) => self.gap(Cause::Damaged, Some(place), 0, words, take),
            None => Ok(()),
        }
    }

    fn forget(&mut self, kind: u8, name: &str) {
        if let Some(needed) = self.needed.get_mut(usize::from(kind)) {
            *needed = None;
        }
        self.handlers.forget(kind);
        let same = self.formats.get(kind).is_some_and(|format| format.name == name);
        let count = self.counts.get_mut(usize::from(kind));
        if let Some(count) = count.filter(|count| !same && count.count > 0) {
            self.counts_before.add(name, std::mem::take(count));
        }
    }

    fn say(
        &mut self,
        (kind, body): (u8, Body<'_>),
        place: u64,
        ahead: Ahead<'_>,
        take: &mut ItemSink<'_>,
    ) -> Result<()> {
        let Self {
            want, formats, state, clock, handlers, epoch, firmware, later, wrong, pace, unpaced, ..
        } = self;
        let Some(format) = formats.get(kind) else { return Ok(()) };
        let message = Message::new(format, body);
        let when = clock.at(&message, ahead, formats);
        let bytes = std::mem::take(unpaced);
        if formats.has_boot_clock && clock.has_begun() {
            pace.at(when.at, place, bytes);
            if let Some(week_us) = receiver_us(&message) {
                pace.witness(when.at, week_us);
            }
            // Parameters come all at once.
            if when.stands && handlers.of(format).is_some_and(|resolved| !resolved.handler.is_said) {
                pace.stood(when.at, place);
            }
        }
        if when.own == Own::Wrong {
            wrong.add(when.at, place);
        }
        if when.restarted {
            pace.fell(when.at);
            take(when.at, Item::Restart)?;
            state.restart();
            *epoch = Epoch::default();
        }
        if let Some(from) = clock.silence() {
            let (cause, words) = if state.is_armed() && !ahead.arms(&message, formats) {
                (Cause::Lost, "nothing was written, though the vehicle was armed")
            } else {
                (Cause::NotKept, "nothing was written")
            };
            let gap = Gap::new(Some(from), cause, words.to_owned());
            take(when.at, Item::Gap(&Gap { to: Some(when.at), ..gap }))?;
        }
        if let Some(standing) = later.take_if(|_| when.own == Own::Sound) {
            state.stand(standing);
        }
        let mut result = Ok(());
        let mut said = ReportSink { at: when.at, observations: want.observations, epoch, firmware, take };
        let mut hand = |item: Item<'_>| {
            if result.is_ok() {
                result = said.hand(item);
            }
        };
        let mut out = Out::new(&mut hand);
        let is_timed = clock.has_begun();
        if is_timed && want.observations {
            state.repeat(when.at, &mut out);
        }
        if let Some(resolved) = handlers.of(format) {
            // An impossible time: likely damaged, but its words are kept.
            let is_said = resolved.handler.is_said;
            if is_said && when.own != Own::Sound {
                let before = state.standing();
                state.stand(later.unwrap_or(before));
                observe::take(state, resolved, &message, (when.at, when.boot_us), &mut out);
                let after = state.standing();
                // Without a time, disarming counts with the message before, arming with the next: a logger pauses in between.
                let waits = if when.own == Own::Wrong { after != before } else { after.arms(&before) };
                *later = waits.then_some(after);
                state.stand(if waits { before } else { after });
            } else if when.own != Own::Wrong {
                observe::take(state, resolved, &message, (when.at, when.boot_us), &mut out);
            }
            if is_timed && is_said && want.observations {
                state.repeat(when.at, &mut out);
            }
        }
        result
    }

    fn row(&mut self, kind: u8, body: Body<'_>, take: &mut ItemSink<'_>) -> Result<()> {
        if matches!(self.want.rows, Rows::None) {
            return Ok(());
        }
        let is_words = matches!(body, Body::Words(_));
        let Some(table) = self.table(kind, is_words) else { return self.refuse_rows(kind, take) };
        if !self.want.rows.has(&table.name) {
            return Ok(());
        }
        let Some(format) = self.formats.get(kind) else { return Ok(()) };
        let at = self.clock.now();
        table::with_values(&Message::new(format, body), |values| {
            take(at, Item::Row(Row { table: &table, values }))
        })
    }

    /// `None` after too many definitions.
    fn table(&mut self, kind: u8, is_words: bool) -> Option<Arc<Table>> {
        let format = self.formats.get(kind)?;
        if let Some(table) = &format.table {
            return Some(Arc::clone(table));
        }
        let table = self.tables.of(format, self.formats.units(kind), is_words)?;
        self.formats.set_table(kind, &table);
        Some(table)
    }

    /// Reports once, after too many definitions.
    fn refuse_rows(&mut self, kind: u8, take: &mut ItemSink<'_>) -> Result<()> {
        if std::mem::replace(&mut self.rows_refused, true) {
            return Ok(());
        }
        let name = self.formats.get(kind).map_or("", |format| &format.name);
        let words = format!("{name} changes its columns again and again: its rows are not read from here on");
        self.gap(Cause::Damaged, None, 0, words, take)
    }

    /// Something is missing.
    pub(super) fn gap(
        &mut self,
        cause: Cause,
        place: Option<u64>,
        bytes: u64,
        words: String,
        take: &mut ItemSink<'_>,
    ) -> Result<()> {
        let now = self.clock.now();
        let from = Some(now).filter(|_| self.clock.has_begun());
        take(now, Item::Gap(&Gap { from, to: None, cause, place, bytes, words, own: None }))
    }

    pub(super) fn end(mut self, take: &mut ItemSink<'_>) -> Result<RecordingSummary> {
        if let Some((_, words)) = self.state.open_text.take() {
            let alert = alert::of_text(None, words.as_bytes());
            take(self.clock.now(), Item::Text(Text { source: SOURCE, severity: 6, words: &words, alert }))?;
        }
        for gap in self.pace.gaps(&self.wrong) {
            take(self.clock.now(), Item::Gap(&gap))?;
        }
        let messages: u64 = self.counts.iter().map(|messages| messages.count).sum();
        // Unwanted messages are not followed.
        let has_time = |(kind, messages): (u8, &Amount)| {
            self.formats.get(kind).filter(|_| messages.count > 0).is_some_and(tells_time)
        };
        let timed =
            self.joints > 0 || self.clock.has_begun() || (0..=u8::MAX).zip(&self.counts).any(has_time);
        if !timed && messages > 0 {
            let words = format!("none of {messages} messages has a time: nothing in the log can be judged");
            self.gap(Cause::NoTimes, None, 0, words, take)?;
        }
        self.count_by_name();
        let messages = self.counts_before.messages();
        Ok(RecordingSummary { messages, ..RecordingSummary::default() })
    }
}

struct ReportSink<'a, 't> {
    at: Instant,
    observations: bool,
    epoch: &'a mut Epoch,
    firmware: &'a mut String,
    take: &'a mut ItemSink<'t>,
}

impl ReportSink<'_, '_> {
    fn hand(&mut self, item: Item<'_>) -> Result<()> {
        let item = match item {
            Item::Observation(..) if !self.observations => return Ok(()),
            Item::Fact(Fact { about: FactKind::Firmware, words }) => {
                if words == self.firmware {
                    return Ok(());
                }
                words.clone_into(self.firmware);
                item
            }
            Item::Epoch(epoch_us) => match self.epoch.take(epoch_us) {
                Some(epoch_us) => Item::Epoch(epoch_us),
                None => return Ok(()),
            },
            item => item,
        };
        hand_said(self.at, item, self.observations, self.take)
    }
}
