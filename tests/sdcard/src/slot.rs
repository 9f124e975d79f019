//! The bus, its clock and time, and events of the card.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use hums_core::clock::Instant;
use hums_recorder::spi::{Clock, Port, PortFailure};

use crate::card::SdCard;
use crate::model::Model;

/// An event of the card in the slot.
#[derive(Clone, Debug)]
pub enum Event {
    /// A block that it is programming is torn.
    Pull,
    /// A card is put in.
    Insert(Model),
    /// Power is lost for a moment, as by a pull.
    Bounce,
}

/// Traffic of the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Bytes.
    pub bytes: u64,
    /// Of them, those with no card selected.
    pub unselected: u64,
    /// Falls of the select pin.
    pub selects: u64,
}

struct Inner {
    card: Option<SdCard>,
    now_ns: u64,
    hz: u32,
    /// Of one byte.
    byte_ns: u64,
    selected: bool,
    counts: Counts,
    at_time: Vec<(u64, Event)>,
    at_byte: Vec<(u64, Event)>,
    /// Times for a fast check at every byte.
    soonest: (u64, u64),
    violations: BTreeMap<String, u32>,
    /// Bytes on the bus.
    stop_at: Option<u64>,
}

/// A clone is the same slot.
#[derive(Clone)]
pub struct Slot(Rc<RefCell<Inner>>);

impl Slot {
    /// A slot with this card in it, at 0 s.
    pub fn new(card: Option<Model>) -> Self {
        Self(Rc::new(RefCell::new(Inner {
            card: card.map(SdCard::new),
            now_ns: SdCard::POWER_UP_NS,
            hz: 0,
            byte_ns: 8_000_000_000,
            selected: false,
            counts: Counts::default(),
            at_time: Vec::new(),
            at_byte: Vec::new(),
            soonest: (u64::MAX, u64::MAX),
            violations: BTreeMap::new(),
            stop_at: None,
        })))
    }

    /// Schedules an event, nanoseconds.
    pub fn at(&self, ns: u64, event: Event) {
        let mut inner = self.0.borrow_mut();
        inner.at_time.push((ns, event));
        inner.find_soonest();
    }

    /// Schedules an event after this many bytes.
    pub fn at_byte(&self, bytes: u64, event: Event) {
        let mut inner = self.0.borrow_mut();
        inner.at_byte.push((bytes, event));
        inner.find_soonest();
    }

    /// Stops the bus after this many bytes, like a processor's restart; `None`: runs on.
    pub fn stop_at(&self, bytes: Option<u64>) {
        self.0.borrow_mut().stop_at = bytes;
    }

    /// Event now.
    pub fn event(&self, event: Event) {
        self.0.borrow_mut().happen(event);
    }

    /// Whether a card is in it.
    pub fn has_card(&self) -> bool {
        self.0.borrow().card.is_some()
    }

    /// Nanoseconds since 0 s.
    pub fn now_ns(&self) -> u64 {
        self.0.borrow().now_ns
    }

    /// The time for the driver.
    pub fn now(&self) -> Instant {
        Instant::from_micros(self.now_ns() / 1_000)
    }

    /// The bus is idle meanwhile.
    pub fn advance_to(&self, ns: u64) {
        let mut inner = self.0.borrow_mut();
        inner.now_ns = inner.now_ns.max(ns);
        inner.happen_what_is_due();
    }

    /// Traffic so far.
    pub fn counts(&self) -> Counts {
        self.0.borrow().counts
    }

    /// Violations so far.
    pub fn violations(&self) -> BTreeMap<String, u32> {
        self.0.borrow().violations.clone()
    }

    /// The driver's port.
    pub fn port(&self) -> SimPort {
        SimPort { slot: self.clone(), transfer_hz: 21_000_000 }
    }
}

impl Slot {
    pub(crate) fn begin(&self) -> u8 {
        let mut inner = self.0.borrow_mut();
        inner.happen_what_is_due();
        let Inner { card, now_ns, selected, .. } = &mut *inner;
        card.as_mut().filter(|_| *selected).map_or(0xFF, |card| card.begin(*now_ns))
    }
}

impl Inner {
    fn happen(&mut self, event: Event) {
        if let (Some(card), Event::Pull | Event::Bounce) = (&self.card, &event) {
            card.power_off(self.now_ns);
        }
        match event {
            Event::Pull => self.card = None,
            Event::Insert(model) => self.card = Some(SdCard::new(model)),
            Event::Bounce => self.card = self.card.take().map(|card| SdCard::new(card.model)),
        }
    }

    fn find_soonest(&mut self) {
        let soonest = |events: &[(u64, Event)]| events.iter().map(|(at, _)| *at).min().unwrap_or(u64::MAX);
        self.soonest = (soonest(&self.at_time), soonest(&self.at_byte));
    }

    fn happen_what_is_due(&mut self) {
        let (now_ns, bytes) = (self.now_ns, self.counts.bytes);
        if now_ns < self.soonest.0 && bytes < self.soonest.1 {
            return;
        }
        let (mut due, later): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.at_time).into_iter().partition(|(at, _)| *at <= now_ns);
        self.at_time = later;
        let (now, later): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.at_byte).into_iter().partition(|(at, _)| *at <= bytes);
        self.at_byte = later;
        self.find_soonest();
        due.sort_by_key(|(at, _)| *at);
        for (_, event) in due.into_iter().chain(now) {
            self.happen(event);
        }
    }

    fn exchange(&mut self, sent: u8) -> u8 {
        self.happen_what_is_due();
        self.now_ns += self.byte_ns;
        if self.stop_at.is_some_and(|at| self.counts.bytes >= at) {
            return 0xFF;
        }
        self.counts.bytes += 1;
        self.counts.unselected += u64::from(!self.selected);
        let Self { card, now_ns, hz, selected, violations, .. } = self;
        let mut wrong = |what: String| *violations.entry(what).or_default() += 1;
        // The line is pulled up.
        card.as_mut().map_or(0xFF, |card| card.exchange(*now_ns, *hz, *selected, sent, &mut wrong))
    }

    fn select(&mut self, selected: bool) {
        self.counts.selects += u64::from(selected && !self.selected);
        if self.selected
            && !selected
            && let Some(card) = &mut self.card
        {
            let violations = &mut self.violations;
            card.deselected(&mut |what| *violations.entry(what).or_default() += 1);
        }
        self.selected = selected;
    }
}

/// The slot for [`hums_recorder::spi::SpiCard`]: the F405 board's clocks.
pub struct SimPort {
    slot: Slot,
    transfer_hz: u32,
}

impl Port for SimPort {
    fn select(&mut self, selected: bool) {
        self.slot.0.borrow_mut().select(selected);
    }

    fn exchange(&mut self, bytes: &mut [u8]) -> Result<(), PortFailure> {
        let mut inner = self.slot.0.borrow_mut();
        for byte in bytes {
            *byte = inner.exchange(*byte);
        }
        Ok(())
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortFailure> {
        let mut inner = self.slot.0.borrow_mut();
        for byte in bytes {
            inner.exchange(*byte);
        }
        Ok(())
    }

    fn set_clock(&mut self, clock: Clock) {
        let mut inner = self.slot.0.borrow_mut();
        inner.hz = match clock {
            Clock::Identification => 328_125,
            Clock::Transfer => self.transfer_hz,
        };
        inner.byte_ns = 8_000_000_000 / u64::from(inner.hz);
    }

    fn now(&self) -> Instant {
        self.slot.now()
    }
}
