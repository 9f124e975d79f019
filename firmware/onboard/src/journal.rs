//! The record's writing end for the monitor task: frames, records, and losses for lack of room.

use core::fmt::{Arguments, Write as _};

use hums_blackbox::record::{Event, Loss, LossKind, MarkReason, Note, Parameter, Record};
use hums_blackbox::{Counters, Sector, SectorSink as _, Writer};
use hums_core::Monitor;
use hums_core::clock::Instant;
use hums_core::parameters::Param;
use hums_core::time::Millis;
use hums_link::statustext::Text;
use hums_recorder::status::CardStatus;

use crate::ResetCause;
use crate::loss::Losses;
use crate::notices::{Notice, Notices};
use crate::queues::SectorsIn;

/// Number of the event that records an action over a link.
const BY_HAND: u8 = 12;
/// `MAV_SEVERITY` of texts that a pilot need not see, and of milder ones.
const INFO: u8 = 6;

/// Maximum age of a current heartbeat; autopilots send one each second.
const HEARTBEAT_AGE_MAX: Millis = Millis::from_secs(3);

/// The author of an action: MAVLink system and component id; 0, 0 is the monitor itself.
pub(crate) type By = (u8, u8);

pub(crate) struct Journal<'a> {
    writer: &'a mut Writer,
    sectors: SectorsIn<'a>,
    losses: Losses,
    refused: u64,
}

impl<'a> Journal<'a> {
    pub(crate) const fn new(writer: &'a mut Writer, sectors: SectorsIn<'a>) -> Self {
        Self { writer, sectors, losses: Losses::new(), refused: 0 }
    }

    /// Unless only the reserve for records is left.
    pub(crate) fn frame(&mut self, at: Instant, bytes: &[u8], verified: bool) {
        if self.writer.frame(at, bytes, verified, &mut self.sectors).is_err() {
            self.refused += 1;
            self.lose(at, LossKind::QueueFull, 1);
        }
    }

    /// If need be from the reserve; without room it counts as lost.
    pub(crate) fn record(&mut self, now: Instant, record: &Record<'_>) -> bool {
        let written = self.sectors.with_reserve(|sink| self.writer.record(now, record, sink)).is_ok();
        if !written {
            self.lose(now, LossKind::Records, 1);
        }
        written
    }

    /// Without room never lost: it can be written later.
    pub(crate) fn mark(&mut self, now: Instant, why: MarkReason) -> bool {
        self.sectors.with_reserve(|sink| self.writer.mark(now, why, sink)).is_ok()
    }

    /// Text is cut after 50 characters.
    pub(crate) fn by_hand(&mut self, now: Instant, what: Arguments<'_>) {
        let mut text = Text::default();
        let _ = text.write_fmt(what);
        self.event(now, BY_HAND, text.as_str());
    }

    pub(crate) fn event(&mut self, now: Instant, number: u8, text: &str) {
        self.record(now, &Record::Event(Event { number, text }));
    }

    pub(crate) fn lose(&mut self, now: Instant, what: LossKind, count: u64) {
        self.lose_since(now, now, what, count);
    }

    /// May have begun at `since`.
    pub(crate) fn lose_since(&mut self, since: Instant, now: Instant, what: LossKind, count: u64) {
        self.losses.count(since, now, what, count);
    }

    #[inline(never)]
    pub(crate) fn record_losses(&mut self, now: Instant, all: bool) {
        let Self { losses, writer, sectors, .. } = self;
        let mut write =
            |loss: &Loss| sectors.with_reserve(|sink| writer.record(now, &Record::Loss(*loss), sink)).is_ok();
        losses.flush(now, all, &mut write);
    }

    pub(crate) const fn refused(&self) -> u64 {
        self.refused
    }

    /// What was written.
    pub(crate) const fn counters(&self) -> Counters {
        self.writer.counters()
    }

    /// Queue of finished sectors.
    pub(crate) const fn sectors(&self) -> &SectorsIn<'a> {
        &self.sectors
    }

    /// Whether a copy of the sector in progress has room.
    pub(crate) fn has_room(&mut self) -> bool {
        self.sectors.with_reserve(|sink| sink.room()) > 0
    }

    /// The next entry begins a new group; `false` without room.
    pub(crate) fn restart(&mut self) -> bool {
        self.writer.restart(&mut self.sectors)
    }

    /// Ends the session in order.
    pub(crate) fn finish(&mut self) {
        self.sectors.with_reserve(|sink| self.writer.finish(sink));
    }

    /// A copy, if the queue has room and the sector a new entry.
    #[inline(never)]
    pub(crate) fn partial(&mut self) {
        let mut copy = Sector::zeroed();
        if self.has_room() && self.writer.partial(&mut copy) {
            self.sectors.put(&copy);
        }
    }
}

pub(crate) struct Logbook<'a> {
    /// Lent, like the writer: both are too large to be moved over the firmware's stack.
    pub(crate) monitor: &'a mut Monitor,
    pub(crate) journal: Journal<'a>,
    pub(crate) notices: Notices,
    pub(crate) card: &'a CardStatus,
    pub(crate) cause: ResetCause,
}

/// Arming by the vehicle's heartbeats since this start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Arming {
    /// No heartbeat within the last 3 s, and none before with armed.
    Unknown,
    Disarmed,
    /// By the last heartbeat, even an old one: a vehicle on a silent link flies on.
    Armed,
}

impl Logbook<'_> {
    /// Records a text, and sends it unless it is milder than a notice; `severity` is a `MAV_SEVERITY`.
    pub(crate) fn note(&mut self, now: Instant, severity: u8, text: &'static str) {
        self.journal.record(now, &Record::Note(Note { severity, text }));
        if severity < INFO {
            self.notices.push(Notice::Text(severity, text));
        }
    }

    pub(crate) fn arming(&self, now: Instant) -> Arming {
        let heartbeat = &self.monitor.vehicle().heartbeat;
        match (heartbeat.get(), heartbeat.within(now.into(), HEARTBEAT_AGE_MAX)) {
            (Some(last), _) if last.armed => Arming::Armed,
            (_, Some(_)) => Arming::Disarmed,
            _ => Arming::Unknown,
        }
    }

    /// Whether the vehicle may be in flight: it is armed, or of unknown state after a reset that may have come in
    /// flight.
    pub(crate) fn may_fly(&self, now: Instant) -> bool {
        match self.arming(now) {
            Arming::Unknown => self.cause.may_be_in_flight(),
            arming => arming == Arming::Armed,
        }
    }

    /// Whether a parameter may be set now, for any asker: with another rate at its port nothing more is recorded.
    fn may_set(&self, now: Instant, param: Param) -> bool {
        param != Param::ApBaud || !self.may_fly(now)
    }

    /// Sets a parameter for a ground station or the card's file: recorded, and in force at once. `false` if it is
    /// refused.
    pub(crate) fn set_parameter(&mut self, now: Instant, name: &str, value: f32, by: By) -> bool {
        if !Param::find(name).is_some_and(|param| self.may_set(now, param)) {
            return false;
        }
        let params = self.monitor.params_mut();
        let before = params.iter().find(|(spec, _)| spec.name == name).map(|(_, value)| value.to_bits());
        if params.set(name, value).is_err() {
            return false;
        }
        if before != Some(value.to_bits()) {
            let parameter = Parameter { name, value: f64::from(value), changed: true, by };
            self.journal.record(now, &Record::Parameter(parameter));
        }
        true
    }
}
