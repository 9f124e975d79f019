//! The monitor's knowledge for the record: identity and time, usage, wear.

use hums_blackbox::record::{
    Boot, Clock, Component as ComponentRecord, Exceedance, LIFETIME_ENTRIES_MAX, Lifetime, Moment, Parameter,
    Record, RecordReason, USAGE_ENTRIES_MAX, Usage, Vehicle as VehicleRecord,
};
use hums_core::clock::Instant;
use hums_core::component::{COMPONENTS_MAX, Component, ComponentFigures, Label, Status};

use crate::journal::{By, Logbook};

/// A UTC that differs by more from the recorded one is recorded anew.
const CLOCK_STEP_MICROS: u64 = 1_000_000;

/// Counters in one record: fewer than all, since they gather on the stack, at 24 bytes each.
const GATHERED: usize = 16;
const _: () = assert!(GATHERED <= USAGE_ENTRIES_MAX && GATHERED <= LIFETIME_ENTRIES_MAX);

/// A full one is written.
struct Counters(heapless::Vec<(u8, f32), GATHERED>);

impl Counters {
    const fn new() -> Self {
        Self(heapless::Vec::new())
    }

    fn push(&mut self, number: u8, value: f64, write: impl FnOnce(&[(u8, f32)])) {
        // There is room: a full record was written.
        let _ = self.0.push((number, value as f32));
        if self.0.is_full() {
            self.flush(write);
        }
    }

    fn flush(&mut self, write: impl FnOnce(&[(u8, f32)])) {
        if !self.0.is_empty() {
            write(&self.0);
            self.0.clear();
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct RecordedState {
    vehicle: VehicleRecord,
    /// UTC of power-on, microseconds since 1970.
    epoch_micros: Option<u64>,
    usage_at: Instant,
}

impl RecordedState {
    pub(crate) fn new() -> Self {
        Self { vehicle: VehicleRecord::default(), epoch_micros: None, usage_at: Instant::ZERO }
    }

    /// The head of each file of a log: the recorder's identity and every parameter that is not at its default. A file
    /// that is read alone, after earlier ones were overwritten, misses only their time.
    pub(crate) fn heading(&mut self, now: Instant, identity: &Boot<'_>, book: &mut Logbook<'_>) {
        let Logbook { monitor, journal, .. } = book;
        journal.record(now, &Record::Boot(*identity));
        for (spec, value) in monitor.params().iter() {
            // Bit for bit: only a value that was set differs from its default.
            if value.to_bits() != spec.default.to_bits() {
                let parameter =
                    Parameter { name: spec.name, value: f64::from(value), changed: false, by: (0, 0) };
                journal.record(now, &Record::Parameter(parameter));
            }
        }
        self.vehicle = VehicleRecord::default();
    }

    #[inline(never)]
    pub(crate) fn vehicle(&mut self, now: Instant, book: &mut Logbook<'_>) {
        let vehicle = book.monitor.vehicle();
        let (Some(source), Some(heartbeat)) = (vehicle.source, vehicle.heartbeat.get()) else { return };
        let identity = vehicle.identity.get().copied().unwrap_or_default();
        let record = VehicleRecord {
            system: source.system,
            component: source.component,
            autopilot: heartbeat.autopilot_number,
            vehicle_type: heartbeat.type_number,
            firmware: identity.firmware,
            uid: identity.uid,
        };
        if record != self.vehicle && book.journal.record(now, &Record::Vehicle(record)) {
            self.vehicle = record;
        }
    }

    /// UTC as soon as the autopilot knows it, which dates the whole session.
    pub(crate) fn clock(&mut self, now: Instant, book: &mut Logbook<'_>) {
        let time = &book.monitor.vehicle().time;
        let (Some(at), Some(utc_micros)) = (time.at(), time.get().and_then(|time| time.utc_micros)) else {
            return;
        };
        let clock = Clock { boot: Instant::of(at, now), utc_micros, source: 1 };
        let epoch_micros = clock.epoch_micros();
        if self.epoch_micros.is_some_and(|known| known.abs_diff(epoch_micros) <= CLOCK_STEP_MICROS) {
            return;
        }
        if book.journal.record(now, &Record::Clock(clock)) {
            self.epoch_micros = Some(epoch_micros);
            book.card.set_utc_secs((utc_micros / 1_000_000).min(u64::from(u32::MAX)) as u32);
        }
    }

    pub(crate) const fn usage_at(&self) -> Instant {
        self.usage_at
    }

    pub(crate) fn usage_anew(&mut self, now: Instant, book: &mut Logbook<'_>) {
        self.usage_at = Instant::ZERO;
        self.usage(now, Moment::Periodic, book);
    }

    /// The session's counters, the airframe's life at the session's start and end, and exceedances.
    pub(crate) fn usage(&mut self, now: Instant, moment: Moment, book: &mut Logbook<'_>) {
        let before = core::mem::replace(&mut self.usage_at, now);
        session(now, moment, book);
        if moment != Moment::Periodic {
            life(now, moment, book);
            for place in 0..COMPONENTS_MAX {
                let why = if moment == Moment::Start { RecordReason::Start } else { RecordReason::Status };
                component(now, place, why, book);
            }
        }
        let since = if moment == Moment::Periodic { before } else { Instant::ZERO };
        exceedances(now, moment, since, book);
    }
}

#[inline(never)]
fn session(now: Instant, moment: Moment, book: &mut Logbook<'_>) {
    let Logbook { monitor, journal, .. } = book;
    let mut counters = Counters::new();
    let mut put = |part: &[_]| {
        journal.record(now, &Record::Usage(Usage::new(moment, part)));
    };
    monitor.for_each_counter(|number, value| counters.push(number, value, &mut put));
    counters.flush(put);
}

#[inline(never)]
fn life(now: Instant, moment: Moment, book: &mut Logbook<'_>) {
    let Logbook { monitor, journal, .. } = book;
    let life = monitor.lifetime();
    let mut counters = Counters::new();
    let mut put = |part: &[_]| {
        journal.record(now, &Record::Lifetime(Lifetime::new(moment, &life, part)));
    };
    life.totals.for_each(|number, value| counters.push(number, value, &mut put));
    counters.flush(put);
}

/// At the start the exceedances of the airframe's life; later those of this session that changed.
#[inline(never)]
fn exceedances(now: Instant, moment: Moment, since: Instant, book: &mut Logbook<'_>) {
    let Logbook { monitor, journal, .. } = book;
    for exceedance in monitor.exceedances().changed(now.into(), since.into()) {
        if moment == Moment::Start || exceedance.session.happened() {
            journal.record(now, &Record::Exceedance(Exceedance::new(moment, &exceedance)));
        }
    }
}

#[inline(never)]
fn component(now: Instant, place: usize, why: RecordReason, book: &mut Logbook<'_>) {
    let Logbook { monitor, journal, .. } = book;
    let Some((figures, status)) = monitor.component_figures(place) else { return };
    let used_percent = monitor.component_used_percent(place);
    let record = component_record(&monitor.components()[place], place, figures, status, used_percent, why);
    journal.record(now, &Record::Component(record));
}

/// Place from 0; records the old one; `false` if there is none.
pub(crate) fn replace_component(
    now: Instant,
    place: usize,
    serial: &str,
    by: By,
    book: &mut Logbook<'_>,
) -> bool {
    let Logbook { monitor, journal, .. } = book;
    let Some((_, status)) = monitor.component_figures(place) else { return false };
    let used_percent = monitor.component_used_percent(place);
    let serial = Label::new(serial);
    let Some(old) = monitor.replace_component(place, serial) else { return false };
    let record = component_record(&old, place, old.ran, status, used_percent, RecordReason::Replaced);
    let record = ComponentRecord { by, new_serial: serial.as_str(), ..record };
    journal.record(now, &Record::Component(record));
    component(now, place, RecordReason::Status, book);
    true
}

fn component_record(
    of: &Component,
    place: usize,
    figures: ComponentFigures,
    status: Status,
    used_percent: Option<f32>,
    why: RecordReason,
) -> ComponentRecord<'_> {
    ComponentRecord {
        why,
        place: place as u8,
        kind: of.kind,
        number: of.number,
        status,
        replaced: u32::from(of.replaced),
        name: of.name.as_str(),
        serial: of.serial.as_str(),
        figures,
        used_percent: used_percent.unwrap_or(f32::NAN),
        by: (0, 0),
        new_serial: "",
    }
}
