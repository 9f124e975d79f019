//! What of the monitor's knowledge goes into the record: who and when, usage, wear.

use hums_blackbox::record::{
    Clock, Component as ComponentRecord, Exceedance, LIFETIME_ENTRIES_MAX, Lifetime, Moment, Record,
    USAGE_ENTRIES_MAX, Usage, Vehicle as VehicleRecord, Why,
};
use hums_core::component::{COMPONENTS_MAX, Component, Figures, Status};
use hums_core::time::Instant;

use super::Monitoring;
use crate::queues::SectorsIn;

/// A UTC that differs more than this from the one that is recorded is recorded anew.
const CLOCK_STEP_MICROS: u64 = 1_000_000;

/// Counters of a record: fewer than there may be, as they gather on the stack, at 24 bytes each.
const GATHERED: usize = 16;
const _: () = assert!(GATHERED <= USAGE_ENTRIES_MAX && GATHERED <= LIFETIME_ENTRIES_MAX);

/// Counters on their way into records: whenever a record's worth is together it is written.
struct Counters(heapless::Vec<(u8, f32), GATHERED>);

impl Counters {
    const fn new() -> Self {
        Self(heapless::Vec::new())
    }

    fn push(&mut self, number: u8, value: f64, write: impl FnOnce(&[(u8, f32)])) {
        // There is room: a full one was written.
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

impl Monitoring<'_> {
    #[inline(never)]
    pub(super) fn record_vehicle(&mut self, now: Instant, sectors: &mut SectorsIn) {
        let vehicle = self.monitor.vehicle();
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
        if record != self.vehicle && self.record(now, &Record::Vehicle(record), sectors) {
            self.vehicle = record;
        }
    }

    /// UTC as soon as the autopilot knows it; the reader dates the whole session with it.
    pub(super) fn record_clock(&mut self, now: Instant, sectors: &mut SectorsIn) {
        let time = &self.monitor.vehicle().time;
        let (Some(at), Some(utc_micros)) = (time.at(), time.get().and_then(|time| time.utc_micros)) else {
            return;
        };
        let clock = Clock { boot: at, utc_micros, source: 1 };
        let epoch_micros = clock.epoch_micros();
        if self.epoch_micros.is_some_and(|known| known.abs_diff(epoch_micros) <= CLOCK_STEP_MICROS) {
            return;
        }
        if self.record(now, &Record::Clock(clock), sectors) {
            self.epoch_micros = Some(epoch_micros);
            self.card.set_utc_secs((utc_micros / 1_000_000).min(u64::from(u32::MAX)) as u32);
        }
    }

    /// The session's counters, the airframe's life at the session's start and end, and what was exceeded.
    pub(super) fn record_usage(&mut self, now: Instant, moment: Moment, sectors: &mut SectorsIn) {
        let before = core::mem::replace(&mut self.usage_at, now);
        self.record_session(now, moment, sectors);
        if moment != Moment::Periodic {
            self.record_life(now, moment, sectors);
            for place in 0..COMPONENTS_MAX {
                let why = if moment == Moment::Start { Why::Start } else { Why::Status };
                self.record_component(now, place, why, sectors);
            }
        }
        let since = if moment == Moment::Periodic { before } else { Instant::ZERO };
        self.record_exceedances(now, moment, since, sectors);
    }

    // Never within its caller: what each takes of the stack is not taken by all.
    #[inline(never)]
    fn record_session(&mut self, now: Instant, moment: Moment, sectors: &mut SectorsIn) {
        let Self { monitor, writer, losses, .. } = self;
        let mut counters = Counters::new();
        let mut put = |part: &[_]| {
            super::write(now, &Record::Usage(Usage::new(moment, part)), writer, losses, sectors);
        };
        monitor.for_each_counter(|number, value| counters.push(number, value, &mut put));
        counters.flush(put);
    }

    #[inline(never)]
    fn record_life(&mut self, now: Instant, moment: Moment, sectors: &mut SectorsIn) {
        let Self { monitor, writer, losses, .. } = self;
        let life = monitor.lifetime();
        let mut counters = Counters::new();
        let mut put = |part: &[_]| {
            let record = Record::Lifetime(Lifetime::new(moment, &life, part));
            super::write(now, &record, writer, losses, sectors);
        };
        monitor.for_each_counter_of_life(|number, value| counters.push(number, value, &mut put));
        counters.flush(put);
    }

    /// At the start what was exceeded in the airframe's life; later what was in this session, and has changed.
    #[inline(never)]
    fn record_exceedances(&mut self, now: Instant, moment: Moment, since: Instant, sectors: &mut SectorsIn) {
        let Self { monitor, writer, losses, .. } = self;
        for exceedance in monitor.exceedances().changed(now, since) {
            if moment == Moment::Start || exceedance.session.happened() {
                let record = Record::Exceedance(Exceedance::new(moment, &exceedance));
                super::write(now, &record, writer, losses, sectors);
            }
        }
    }

    #[inline(never)]
    pub(super) fn record_component(&mut self, now: Instant, place: usize, why: Why, sectors: &mut SectorsIn) {
        let Some((figures, status)) = self.monitor.component_figures(place) else { return };
        let used_percent = self.monitor.component_used_percent(place);
        let known = self.monitor.components()[place];
        let record = component(&known, place, figures, status, used_percent, why);
        self.record(now, &Record::Component(record), sectors);
    }
}

/// A component's record.
pub(super) fn component(
    of: &Component,
    place: usize,
    figures: Figures,
    status: Status,
    used_percent: Option<f32>,
    why: Why,
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
