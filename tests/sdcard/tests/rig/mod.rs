//! The firmware's monitor and storage over the simulated card, in virtual time. Storage waits for the card while more
//! urgent tasks run: frames and ticks of a service's time come before the next service.
#![allow(dead_code, missing_docs, unreachable_pub)]

#[path = "../../../../firmware/blackbox/tests/common/log.rs"]
mod log;

use std::collections::BTreeMap;

use hums_blackbox::record::{Boot, MarkReason, Record};
use hums_blackbox::{Entry, Gap, Writer};
use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::health::Level;
use hums_core::parameters::Params;
use hums_link::frame::{Check, Frame};
use hums_link::request::Port;
use hums_onboard::queues::{Ends, FRAME_BYTES_MAX, Queues};
use hums_onboard::storage::{self, NO_CARD_RETRY};
use hums_onboard::{Monitoring, PortStatus, ResetCause, Service, Supervisor, Task};
use hums_recorder::card::{LogEntry, Segment};
use hums_recorder::{BLOCK_BYTES, Buffers, Card, CardState, CardStatus, Recorder, SpiCard};
use hums_sdcard::{MS, Medium, Model, SimPort, Slot};
use log::Item;

/// 2.5 kB/s of log.
const FRAME_EVERY: Span = Span::from_millis(40);
const TICK: Span = Span::from_millis(50);
const NOISE_ID: u32 = 0xC0DE;
pub const FILE_TRANSFER_PROTOCOL: u32 = 110;
pub const LOG_ENTRY: u32 = 118;
pub const LOG_DATA: u32 = 120;

pub struct Rig {
    pub slot: Slot,
    pub status: &'static CardStatus,
    pub texts: Vec<(Instant, String)>,
    pub acks: Vec<(u16, u8)>,
    /// Logs: message, payload.
    pub logs: Vec<(u32, Vec<u8>)>,
    pub findings: Vec<(Instant, &'static str, Level)>,
    pub armed: bool,
    pub is_silent: bool,
    /// The longest service of the card.
    pub longest: Span,
    supervisor: Supervisor,
    port: &'static PortStatus,
    ends: Ends<'static>,
    monitoring: Monitoring<'static>,
    recorder: Recorder<'static, SpiCard<SimPort>>,
    frame_at: Instant,
    tick_at: Instant,
    frames: u32,
    heartbeats: u32,
    said: u32,
}

#[derive(Debug, Default)]
pub struct Found {
    /// Frame numbers in the order of sessions.
    pub frames: Vec<u32>,
    pub all_frames: u64,
    pub gaps: Vec<Gap>,
    pub sessions: usize,
    pub segments: usize,
    /// Events' numbers and texts, and reasons of end marks.
    pub events: Vec<(u8, String)>,
    pub marks: Vec<MarkReason>,
}

impl Rig {
    pub fn new(card: impl Into<Option<Model>>) -> Self {
        let slot = Slot::new(card.into());
        let status: &CardStatus = Box::leak(Box::default());
        let port: &PortStatus = Box::leak(Box::default());
        let monitor = Box::leak(Box::new(Monitor::new(Params::defaults())));
        let writer = Box::leak(Box::new(Writer::new()));
        let identity = Boot { version: "1.2.3", board: "rig", ..Boot::default() };
        let held = Box::leak(Box::new(Buffers::new()));
        let queues = Box::leak(Box::new(Queues::new()));
        let (out, ends) = queues.split();
        let card = Box::leak(Box::new(SpiCard::new(slot.port())));
        let mut rig = Self {
            status,
            port,
            texts: Vec::new(),
            acks: Vec::new(),
            logs: Vec::new(),
            findings: Vec::new(),
            armed: false,
            is_silent: false,
            longest: Span::ZERO,
            supervisor: Supervisor::new(),
            ends,
            monitoring: Monitoring::new(monitor, writer, identity, ResetCause::PowerOn, status, port, out),
            recorder: Recorder::new(card, status, held, 77),
            frame_at: Instant::ZERO,
            tick_at: Instant::ZERO + TICK,
            frames: 0,
            heartbeats: 0,
            said: 0,
            slot,
        };
        rig.monitoring.start(Instant::ZERO);
        rig
    }

    pub fn run_to(&mut self, ms: u64) {
        while self.slot.now_ns() < ms * MS {
            self.service();
        }
    }

    fn service(&mut self) -> Service {
        let begun = self.slot.now();
        self.supervisor.report(Task::Storage, begun);
        let service = storage::service(&mut self.recorder, begun, &mut self.ends.sectors_out);
        if service == Service::Idle {
            self.ends.shelf.serve(&mut self.recorder);
        }
        let took = self.slot.now().since(begun);
        self.longest = self.longest.max(took);
        self.meanwhile();
        let now_ns = self.slot.now_ns();
        match service {
            Service::Wrote => self.slot.advance_to(now_ns + 1_000),
            Service::Idle => self.slot.advance_to(now_ns + 5 * MS),
            Service::NoCard => self.slot.advance_to(now_ns + NO_CARD_RETRY.as_micros() * 1_000),
        }
        self.meanwhile();
        service
    }

    fn meanwhile(&mut self) {
        let now = self.slot.now();
        while self.frame_at.min(self.tick_at) <= now {
            if self.frame_at <= self.tick_at {
                if !self.is_silent {
                    self.frame();
                }
                self.frame_at = self.frame_at + FRAME_EVERY;
            } else {
                self.tick();
                self.tick_at = self.tick_at + TICK;
            }
            self.listen();
        }
    }

    fn frame(&mut self) {
        let index = self.frames;
        self.frames += 1;
        let mut state = index.wrapping_mul(0x9E37_79B9) | 1;
        let mut payload: Vec<u8> = index.to_le_bytes().into();
        payload.extend((0..96).map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        }));
        self.give(NOISE_ID, &payload);
        if index.is_multiple_of(25) {
            self.heartbeats += 1;
            let mode = if self.armed { 0x81 } else { 0x01 };
            self.give(0, &[0, 0, 0, 0, 2, 3, mode, 4, 3]);
        }
    }

    fn give(&mut self, id: u32, payload: &[u8]) {
        let bytes = frame(1, 1, id, payload);
        let frame = Frame::parse(&bytes).expect("a frame");
        assert!(self.ends.frames_in.put(self.frame_at.as_micros(), &frame));
        while self.monitoring.drain(&mut self.ends.frames_out) {}
    }

    fn tick(&mut self) {
        let Self { monitoring, findings, tick_at, supervisor, .. } = self;
        for task in [Task::Reception, Task::Monitor, Task::Downlink] {
            supervisor.report(task, *tick_at);
        }
        assert_eq!(supervisor.silent(*tick_at), None, "the watchdog would bite");
        monitoring.tick(*tick_at, &mut |finding| {
            findings.push((Instant::of(finding.at, *tick_at), finding.check, finding.level));
        });
    }

    fn listen(&mut self) {
        let mut bytes = [0; FRAME_BYTES_MAX];
        while let Some(length) = self.ends.gs_out.take(&mut bytes) {
            let Some(frame) = Frame::again(&bytes[..length], Check::Verified) else { continue };
            let mut payload = frame.payload().to_vec();
            payload.resize(payload.len().max(60), 0);
            match frame.id() {
                253 => {
                    let text = payload[1..51].iter().take_while(|byte| **byte != 0).copied().collect();
                    self.texts.push((self.tick_at, String::from_utf8(text).expect("our texts are ASCII")));
                }
                FILE_TRANSFER_PROTOCOL | LOG_ENTRY | LOG_DATA => {
                    payload.resize(254, 0);
                    self.logs.push((frame.id(), payload));
                }
                77 => self.acks.push((u16::from_le_bytes([payload[0], payload[1]]), payload[2])),
                _ => {}
            }
        }
        while self.ends.autopilot_out.take(&mut bytes).is_some() {}
    }

    pub fn say(&mut self, id: u32, payload: &[u8]) {
        self.said += 1;
        self.give(id, payload);
    }

    pub fn command(&mut self, command: u16, params: [f32; 2]) -> Option<u8> {
        let mut payload: Vec<u8> = params.iter().flat_map(|param| param.to_le_bytes()).collect();
        payload.resize(28, 0);
        payload.extend(command.to_le_bytes());
        payload.extend([1, 191, 0]);
        let before = self.acks.len();
        self.ask(76, &payload);
        self.run_to(self.slot.now_ns() / MS + 1_000);
        self.acks[before..].iter().find(|(number, _)| *number == command).map(|(_, result)| *result)
    }

    pub fn ask(&mut self, id: u32, payload: &[u8]) {
        let bytes = frame(255, 190, id, payload);
        let now = self.slot.now();
        let frame = Frame::parse(&bytes).expect("a frame");
        assert!(self.ends.uplink_in.put(Port::Gs as u64, &frame));
        while self.monitoring.uplink(now, &mut self.ends.uplink_out) {}
    }

    pub fn state(&self) -> CardState {
        self.status.read().state
    }

    pub fn was_told(&self, text: &str, since_ms: u64) -> bool {
        self.texts.iter().any(|(at, told)| at.as_millis() >= since_ms && told.contains(text))
    }

    #[track_caller]
    pub fn assert_told(&self, text: &str, since_ms: u64) {
        assert!(self.was_told(text, since_ms), "not told {text:?} since {since_ms} ms: {:?}", self.texts);
    }

    #[track_caller]
    pub fn assert_state(&self, state: CardState) {
        assert_eq!(self.state(), state, "{:?}", self.texts);
    }

    /// Every frame is on one of these cards, once and in order, or counted as lost. Returns the lost ones.
    #[track_caller]
    pub fn finish(mut self, cards: &[&Medium]) -> (Vec<Found>, u64) {
        self.monitoring.finish(self.slot.now());
        let end = self.slot.now() + Span::from_secs(10);
        while !storage::finish_after(&mut self.recorder, &self.ends.sectors_out) && self.slot.now() < end {
            let begun = self.slot.now();
            storage::service(&mut self.recorder, begun, &mut self.ends.sectors_out);
            self.slot.advance_to(self.slot.now_ns() + 10 * MS);
        }
        let left = self.ends.sectors_out.abandon();
        let card_lost = u64::from(self.status.read().frames_lost);
        let refused = self.monitoring.stats().frames_lost;
        let lost = refused.max(card_lost) + left;
        let found: Vec<Found> = cards.iter().map(|medium| read(medium)).collect();
        let on_cards: u64 = found.iter().map(|found| found.all_frames).sum();
        let sent = u64::from(self.frames + self.heartbeats + self.said);
        // A copy of a sector in progress on the first card may hold frames that count as lost for the second.
        let twice = 10 * (cards.len() as u64 - 1);
        let accounted = on_cards + lost;
        assert!(
            (sent..=sent + twice).contains(&accounted),
            "{sent} sent, {on_cards} on cards, {lost} lost ({left} left)"
        );
        for found in &found {
            assert!(found.frames.windows(2).all(|pair| pair[0] < pair[1]), "out of order");
        }
        (found, lost)
    }

    /// Finishes without losses, and without violations on the bus.
    #[track_caller]
    pub fn finish_whole(self, medium: &Medium) -> Found {
        let slot = self.slot.clone();
        let (mut found, lost) = self.finish(&[medium]);
        assert_eq!(lost, 0);
        let found = found.remove(0);
        assert!(found.gaps.is_empty(), "{:?}", found.gaps);
        assert!(slot.violations().is_empty(), "{:?}", slot.violations());
        found
    }
}

fn frame(system: u8, component: u8, id: u32, payload: &[u8]) -> Vec<u8> {
    let [a, b, c, _] = id.to_le_bytes();
    let mut bytes = vec![0xFD, payload.len() as u8, 0, 0, 0, system, component, a, b, c];
    bytes.extend(payload);
    // CRC-16/MCRF4XX over all but the first byte, and a byte for the definition.
    let seed = match id {
        0 => 50,
        23 => 168,
        30 => 39,
        33 => 104,
        76 => 152,
        110 => 84,
        117 => 128,
        119 => 116,
        121 => 237,
        122 => 203,
        245 => 130,
        _ => 0,
    };
    let crc = bytes[1..].iter().chain([&seed]).fold(0xFFFF_u16, |crc, byte| {
        let low = byte ^ crc as u8;
        let low = u16::from(low ^ low << 4);
        crc >> 8 ^ low << 8 ^ low << 3 ^ low >> 4
    });
    bytes.extend(crc.to_le_bytes());
    bytes
}

/// Like `hums`: segments in order.
#[track_caller]
pub fn read(medium: &Medium) -> Found {
    let (status, held) = (CardStatus::new(), Buffers::new());
    let mounted = Card::mount(medium, &status, &held);
    let card = mounted.map_err(|error| error.to_string()).expect("the card is in order");
    let mut sessions: BTreeMap<u32, Vec<LogEntry>> = BTreeMap::new();
    card.logs(|log| sessions.entry(log.name.session).or_default().push(log)).expect("it lists");
    let mut found = Found { sessions: sessions.len(), ..Found::default() };
    for mut logs in sessions.into_values() {
        logs.sort_unstable_by_key(|log| log.name);
        found.segments += logs.len();
        let mut blocks = Vec::new();
        for log in logs {
            let mut segment = Segment::of(&log);
            // The newest copy of the last sector may be at the place after it.
            let mut empty = 0;
            for index in 0..segment.blocks() {
                let mut block = [0; BLOCK_BYTES];
                card.read(&mut segment, index, &mut block).expect("it reads");
                empty = if block == [0; 512] { empty + 1 } else { 0 };
                if empty > 1 {
                    break;
                }
                blocks.push(block);
            }
        }
        log::read(&blocks, |item| take(&item, &mut found));
    }
    found
}

fn take(item: &Item<'_>, found: &mut Found) {
    match item {
        Item::Entry(Entry::Frame { bytes, .. }) => {
            found.all_frames += 1;
            if let Some(frame) = Frame::again(bytes, Check::Unverified).filter(|frame| frame.id() == NOISE_ID)
            {
                let payload = frame.payload();
                found.frames.push(u32::from_le_bytes([payload[0], payload[1], payload[2], payload[3]]));
            }
        }
        Item::Gap(gap) => found.gaps.push(*gap),
        Item::Entry(Entry::Record { record: Record::Event(event), .. }) => {
            found.events.push((event.number, event.text.to_owned()));
        }
        Item::Entry(Entry::Record { record: Record::Mark(mark), .. }) => found.marks.push(mark.why),
        Item::Entry(Entry::Record { .. }) => {}
    }
}
