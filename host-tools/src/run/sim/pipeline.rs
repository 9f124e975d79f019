//! A power-on's tasks, and their events.

mod ending;

use std::path::Path;

use anyhow::Result;
use hums_blackbox::record::Boot;
use hums_core::clock::{Instant, Span};
use hums_link::request::Port;
use hums_onboard::monitoring::TICK;
use hums_onboard::persist::SaveStep;
use hums_onboard::queues::{Ends, FRAME_BYTES_MAX};
use hums_onboard::uplink::{self, Uplink};
use hums_onboard::{Handover, Monitoring, PortStatus, Reception, ResetCause, Service, StoreWriter, storage};
use hums_recorder::{CardStatus, Recorder};

use super::outside::{Memory, Outside, Slot};
use crate::files::settle;
use crate::run::Machine;
use crate::run::store::FileFlash;
use crate::source::Chunk;
use crate::source::told::Finding;

/// A line silent for this long will not finish its frame.
const SILENCE: Span = Span::from_millis(20);
/// Time until storage looks for a card again.
const NO_CARD_RETRY: Span = Span::from_millis(100);

pub(super) struct Pipeline<'a, 'w> {
    outside: Outside<'a, 'w>,
    slot_status: &'a CardStatus,
    port_status: &'a PortStatus,
    ends: Ends<'a>,
    reception: Reception<'a>,
    uplink: Uplink,
    monitoring: Monitoring<'a>,
    recorder: Recorder<'a, Slot<'a>>,
    store_writer: StoreWriter<'a, FileFlash>,
    handover: Handover<'a>,
    /// Since this power-on, as all that follow.
    now: Instant,
    tick_at: Instant,
    /// `None` while it waits for a sector.
    storage_at: Option<Instant>,
    /// The card keeps storage.
    busy_until: Instant,
    /// When the GS port can take the next frame.
    gs_at: Instant,
    silent_at: Option<Instant>,
    uplink_silent_at: Option<Instant>,
}

/// The next event.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Event {
    Silence,
    UplinkSilence,
    Tick,
    /// The port has room for a frame.
    Port,
    Storage,
}

impl Machine for Pipeline<'_, '_> {
    fn arrive(&mut self, chunk: &Chunk) -> Result<bool> {
        if self.outside.reboot_at_us.is_some_and(|at| chunk.at_us >= at) {
            return Ok(false);
        }
        let at = Instant::from_micros(chunk.at_us.saturating_sub(self.outside.slot.power_on_us));
        if !self.advance(at)? {
            return Ok(false);
        }
        if !chunk.bytes.is_empty() {
            self.reception.bytes(self.now, &chunk.bytes, &mut self.ends.frames_in);
            self.silent_at = Some(self.now + SILENCE);
            self.drain()?;
        }
        Ok(!self.is_dead())
    }

    fn hear(&mut self, chunk: &Chunk) -> Result<bool> {
        if self.outside.reboot_at_us.is_some_and(|at| chunk.at_us >= at) {
            // Nobody listens while the power is off.
            return Ok(true);
        }
        let at = Instant::from_micros(chunk.at_us.saturating_sub(self.outside.slot.power_on_us));
        if !self.advance(at)? {
            return Ok(false);
        }
        self.uplink.bytes(&chunk.bytes, &self.ends.uplink_in);
        self.uplink_silent_at = Some(self.now + uplink::SILENCE);
        self.listen()?;
        Ok(!self.is_dead())
    }
}

impl<'a, 'w> Pipeline<'a, 'w> {
    pub(super) fn new(
        outside: Outside<'a, 'w>,
        memory: &'a mut Memory,
        identity: Boot<'a>,
        entropy: u32,
    ) -> Self {
        let Memory { card_status, port_status, store_status, mailbox, held, queues, writer, monitor } =
            memory;
        let (items_in, items_out) = mailbox.split();
        let mut store_writer = StoreWriter::mount(outside.flash.clone(), items_out, store_status);
        store_writer.turn_ahead();
        store_writer.load(monitor);
        let handover = Handover::new(items_in, store_status, monitor);
        let (out, ends) = queues.split();
        let cause = ResetCause::PowerOn;
        let mut monitoring = Monitoring::new(monitor, writer, identity, cause, card_status, port_status, out);
        monitoring.restore_signing(&mut store_writer);
        Self {
            slot_status: card_status,
            port_status,
            ends,
            store_writer,
            handover,
            reception: Reception::new(port_status),
            uplink: Uplink::new(Port::Gs),
            monitoring,
            recorder: Recorder::new(outside.slot, card_status, held, entropy),
            outside,
            now: Instant::ZERO,
            tick_at: Instant::ZERO + TICK,
            storage_at: Some(Instant::ZERO),
            busy_until: Instant::ZERO,
            gs_at: Instant::ZERO,
            silent_at: None,
            uplink_silent_at: None,
        }
    }

    pub(super) fn start(&mut self) -> Result<()> {
        self.monitoring.start(self.now);
        self.after_monitor()
    }

    /// Runs all events up to `to`. `false`: power went.
    fn advance(&mut self, to: Instant) -> Result<bool> {
        while let Some((at, event)) = self.next_event().filter(|(at, _)| *at <= to) {
            self.now = self.now.max(at);
            match event {
                Event::Silence => {
                    self.silent_at = None;
                    self.reception.idle(self.now, &mut self.ends.frames_in);
                    self.drain()?;
                }
                Event::UplinkSilence => {
                    self.uplink_silent_at = None;
                    self.uplink.idle(&self.ends.uplink_in);
                    self.listen()?;
                }
                Event::Tick => {
                    self.tick_at = self.tick_at + TICK;
                    self.tick()?;
                }
                Event::Port => self.send_gs()?,
                Event::Storage => self.storage(),
            }
            if self.is_dead() {
                return Ok(false);
            }
        }
        self.now = self.now.max(to);
        self.send_gs()?;
        Ok(true)
    }

    fn next_event(&self) -> Option<(Instant, Event)> {
        let silence = self.silent_at.map(|at| (at, Event::Silence));
        let storage = self.storage_at.map(|at| (at, Event::Storage));
        let uplink = self.uplink_silent_at.map(|at| (at, Event::UplinkSilence));
        let port = (self.gs_at > self.now).then_some((self.gs_at, Event::Port));
        let events = [silence, Some((self.tick_at, Event::Tick)), uplink, port, storage];
        // `min_by_key` keeps the first of equals.
        events.into_iter().flatten().min_by_key(|(at, _)| *at)
    }

    fn drain(&mut self) -> Result<()> {
        while self.monitoring.drain(&mut self.ends.frames_out) {}
        self.after_monitor()
    }

    fn listen(&mut self) -> Result<()> {
        while self.monitoring.uplink(self.now, &mut self.ends.uplink_out) {}
        self.after_monitor()
    }

    fn tick(&mut self) -> Result<()> {
        let Self { monitoring, outside, now, .. } = self;
        let Outside { findings, slot, .. } = outside;
        monitoring.tick(*now, &mut |finding| {
            let at = Instant::from_micros(slot.power_on_us.saturating_add(now.as_micros()));
            findings(Finding { at, ..Finding::new(*now, finding) });
        });
        let frames = self.port_status.read().frames;
        self.handover.step(self.now, self.monitoring.monitor_mut(), frames);
        self.monitoring.save_signing(self.now, &mut self.handover);
        self.note();
        self.keep(false);
        self.after_monitor()
    }

    fn after_monitor(&mut self) -> Result<()> {
        let work = !self.ends.sectors_out.is_empty() || self.ends.shelf.is_wanted();
        if self.storage_at.is_none() && work {
            self.storage_at = Some(self.now);
        }
        self.send_gs()
    }

    /// Bytes, as much as the port had time for.
    fn send_gs(&mut self) -> Result<()> {
        let mut frame = [0; FRAME_BYTES_MAX];
        while let Some(length) = self.ends.autopilot_out.take(&mut frame) {
            // An autopilot that has gone receives nothing.
            let _ = self.outside.autopilot.write_all(frame.get(..length).unwrap_or_default());
            let _ = self.outside.autopilot.flush();
        }
        let baud = u64::from(self.monitoring.bauds().0.max(1));
        while self.gs_at <= self.now {
            let Some(length) = self.ends.gs_out.take(&mut frame) else { break };
            let bits = length as u64 * 10;
            self.gs_at = self.now.max(self.gs_at) + Span::from_micros(bits * 1_000_000 / baud);
            let bytes = frame.get(..length).unwrap_or_default();
            let sent = self.outside.gs.write_all(bytes).and_then(|()| self.outside.gs.flush());
            settle(sent, Path::new("--gs"))?;
        }
        Ok(())
    }

    fn storage(&mut self) {
        let begin_us = self.outside.slot.power_on_us.saturating_add(self.now.as_micros());
        self.outside.slot.card.set_clock(begin_us);
        let service = storage::service(&mut self.recorder, self.now, &mut self.ends.sectors_out);
        let served = service == Service::Idle && self.ends.shelf.serve(&mut self.recorder);
        let took = Span::from_micros(self.outside.slot.card.clock().saturating_sub(begin_us));
        self.busy_until = self.now + took;
        self.storage_at = match service {
            Service::Idle if self.ends.sectors_out.is_empty() && !served => None,
            Service::Wrote | Service::Idle => Some(self.now + took),
            Service::NoCard => Some(self.now + took + NO_CARD_RETRY),
        };
    }

    fn is_dead(&self) -> bool {
        self.outside.slot.card.is_dead() || self.outside.flash.is_dead()
    }

    fn keep(&mut self, may_erase: bool) {
        while !self.is_dead() && self.store_writer.service(may_erase) == SaveStep::Took {}
    }

    fn note(&mut self) {
        while let Some(news) = self.handover.news() {
            self.monitoring.note(self.now, news.severity, news.text);
        }
    }
}
