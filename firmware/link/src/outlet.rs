//! Transmit scheduler of one port: a byte budget for every window of one second, the port's line rate, and
//! priorities.
//!
//! # The budget
//! A model of the line computes each frame's transmission time: a frame starts when the previous one has left. The
//! outlet accepts a frame if it fits its class's share of the budget. The bytes of the second before its start and
//! its own bytes count. So no window of one second at the port exceeds the budget, whatever the queue holds. Times
//! are counted in slots of 20 ms and a slot counts whole, so at saturation up to 4 % of the budget stay unused.
//!
//! # Priorities
//! Each [`Class`] may fill the budget up to its own mark, so a more urgent class always finds room above it. Only
//! findings may wait behind more than [`BACKLOG`] of the line, so a finding never waits longer than that. Events (the
//! vehicle's texts and answers) get at most half of the budget, bulk (lists, logs) three fifths, so neither starves
//! the forwarded frames. Forwarded frames leave three fifths, and half of the line's backlog, to waiting bulk.

use hums_core::clock::{Instant, Span};
use hums_dialect::wire::SIGNATURE_BYTES;

use crate::encode::{Encoder, FRAME_BYTES_MAX};
use crate::packet::Packet;
use crate::signing::Seal;

/// Rate of a port whose queue is its only limit: each frame leaves at once.
pub const NO_LINE: u32 = u32::MAX;
/// Longest backlog of the line at which a frame other than a finding is accepted.
pub const BACKLOG: Span = Span::from_millis(50);
/// Findings come in bursts. It limits the size of the queue.
const BACKLOG_FINDINGS: Span = Span::from_millis(300);
/// Longer frames find the line free enough.
const BACKLOG_FORWARD: Span = Span::from_millis(25);
/// Bytes of findings that may wait beside everything else: eleven texts, signed.
pub const FINDINGS: u32 = 11 * 92;
/// Room for a critical finding: a text with its header, and a signature.
const RESERVE: u32 = 80;
/// The least budget with such a reserve: below, it would block everything else.
const RESERVE_FROM: u32 = 400;

/// How urgent a frame is, the most urgent first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// A critical finding.
    Critical,
    /// Any other finding.
    Finding,
    /// Heartbeats, and answers.
    Own,
    /// Single messages of the vehicle: texts, answers.
    Event,
    /// Periodic frames of the vehicle, and our values.
    Forward,
    /// Lists and logs.
    Bulk,
}

#[derive(Clone, Copy, Debug)]
struct Bucket {
    /// Times microseconds a second.
    level: u64,
    at: Instant,
}

impl Bucket {
    const FULL: Self = Self { level: u64::MAX, at: Instant::ZERO };

    /// Bytes; the capacity is one second of `bytes_per_s`.
    fn refresh(&mut self, now: Instant, bytes_per_s: u32) -> u32 {
        const UNIT: u64 = 1_000_000;
        let most = u64::from(bytes_per_s) * UNIT;
        let gained = now.since(self.at).as_micros().min(UNIT) * u64::from(bytes_per_s);
        self.level = self.level.min(most).saturating_add(gained).min(most);
        self.at = now;
        (self.level / UNIT) as u32
    }

    fn take(&mut self, bytes: usize) {
        self.level = self.level.saturating_sub(bytes as u64 * 1_000_000);
    }
}

#[derive(Clone, Copy, Debug)]
struct Window {
    slots: [u16; Self::SLOTS],
    newest: u64,
}

impl Window {
    const SLOT_MICROS: u64 = 20_000;
    /// Slots of one second, and one more: a port that is a little ahead of its model, or behind, stays within the budget.
    const SECOND: u64 = 51;
    /// A second, and as much of the future as may be booked: 0.3 s and the longest frame at the slowest rate.
    const SLOTS: usize = 96;

    const fn slot(at: Instant) -> u64 {
        at.as_micros() / Self::SLOT_MICROS
    }

    fn advance(&mut self, slot: u64) {
        for passed in 0..slot.saturating_sub(self.newest).min(Self::SLOTS as u64) {
            self.slots[((slot - passed) % Self::SLOTS as u64) as usize] = 0;
        }
        self.newest = self.newest.max(slot);
    }

    fn sum(&self, start: Instant) -> u32 {
        let first = Self::slot(start).saturating_sub(Self::SECOND);
        let count = (self.newest + 1).saturating_sub(first).min(Self::SLOTS as u64);
        (0..count)
            .map(|back| u32::from(self.slots[((self.newest - back) % Self::SLOTS as u64) as usize]))
            .sum()
    }

    fn book(&mut self, end: Instant, bytes: usize) {
        let slot = Self::slot(end);
        self.advance(slot);
        let place = &mut self.slots[(slot % Self::SLOTS as u64) as usize];
        *place = place.saturating_add(bytes as u16);
    }
}

/// One port's way out.
#[derive(Clone, Debug)]
pub struct Outlet {
    /// Makes our frames.
    pub encoder: Encoder,
    /// Signs our frames, if signing is on.
    pub seal: Option<Seal>,
    window: Window,
    events: Bucket,
    bulk: Bucket,
    /// Budget of forwarded frames while bulk waits.
    forward: Bucket,
    budget: u32,
    baud: u32,
    /// Bytes that may wait, findings apart.
    room: u32,
    /// The line's rate is about to change, and nothing is added until it is empty: waiting bytes would leave at
    /// another time than planned.
    changing: bool,
    /// When the line has sent everything.
    free_at: Instant,
    /// When bulk had something to send last.
    bulk_at: Option<Instant>,
}

const BULK_WAITS: Span = Span::from_secs(1);

impl Outlet {
    /// A port with `budget` bytes a second on a line of `baud`. The queue before it has `room` bytes, and room for
    /// [`FINDINGS`] of findings.
    pub const fn new(budget: u32, baud: u32, room: u32) -> Self {
        Self {
            encoder: Encoder::new(),
            seal: None,
            window: Window { slots: [0; Window::SLOTS], newest: 0 },
            events: Bucket::FULL,
            bulk: Bucket::FULL,
            forward: Bucket::FULL,
            budget,
            baud,
            room,
            changing: false,
            free_at: Instant::ZERO,
            bulk_at: None,
        }
    }

    /// Sets a budget in bytes a second, immediately, and a line rate in baud (9,600 or more), once the line is empty.
    pub fn set(&mut self, now: Instant, budget: u32, baud: u32) {
        self.budget = budget;
        let baud = baud.max(9_600);
        self.changing = baud != self.baud && now < self.free_at;
        if !self.changing {
            self.baud = baud;
        }
    }

    /// The line rate in baud that counts now.
    pub const fn baud(&self) -> u32 {
        self.baud
    }

    /// Bytes a second.
    pub const fn budget(&self) -> u32 {
        self.budget
    }

    fn mark(&self, class: Class) -> u32 {
        let budget = self.budget;
        let (reserve, own) =
            if budget >= RESERVE_FROM { (RESERVE, (budget / 10).clamp(50, 200)) } else { (0, budget / 4) };
        match class {
            Class::Critical => budget,
            Class::Finding | Class::Own | Class::Event => budget - reserve,
            Class::Forward | Class::Bulk => budget - reserve - own,
        }
    }

    /// May go now.
    pub fn fits(&mut self, now: Instant, class: Class, bytes: usize) -> bool {
        self.fits_besides(now, class, bytes, 0)
    }

    pub(crate) fn fits_besides(&mut self, now: Instant, class: Class, bytes: usize, more: usize) -> bool {
        let start = self.free_at.max(now);
        let busy = start.since(now);
        // A fast line would let more wait than the queue holds.
        let waiting = busy.as_micros() * u64::from(self.baud) / 10_200_000;
        let room = match class {
            Class::Critical | Class::Finding => self.room + FINDINGS,
            _ => self.room,
        };
        let waits = waiting + bytes as u64 <= u64::from(room)
            && match class {
                Class::Critical | Class::Finding => busy <= BACKLOG_FINDINGS,
                Class::Forward => busy == Span::ZERO || busy + self.duration(bytes) <= BACKLOG_FORWARD,
                _ => busy == Span::ZERO || busy + self.duration(bytes) <= BACKLOG,
            };
        if class == Class::Bulk {
            self.bulk_at = Some(now);
        }
        if !waits || self.changing || bytes > FRAME_BYTES_MAX {
            return false;
        }
        let share = match class {
            Class::Event => self.events.refresh(now, (self.budget / 2).max(RESERVE.min(self.budget))),
            Class::Bulk => self.bulk.refresh(now, self.mark(class) / 5 * 3),
            Class::Forward => {
                let share = self.forward.refresh(now, self.mark(class) / 5 * 2);
                if self.bulk_at.is_some_and(|at| now.since(at) < BULK_WAITS) { share } else { u32::MAX }
            }
            _ => u32::MAX,
        };
        self.window.advance(Window::slot(start));
        let wanted = (bytes + more) as u32;
        bytes as u32 <= share && self.window.sum(start).saturating_add(wanted) <= self.mark(class)
    }

    /// Ten bits a byte, and 2 % for the pauses between frames. If the budget exceeds the line, a port slower than its model would
    /// fall behind for ever.
    fn duration(&self, bytes: usize) -> Span {
        Span::from_micros(bytes as u64 * 10_200_000 / u64::from(self.baud.max(1)))
    }

    /// The longest frame of bulk that passes, and that delays a finding by at most [`BACKLOG`]. It is the bytes of
    /// the line in that time, and half of a second's share. From 57,600 baud and a budget of 1,130 bytes a second on
    /// it is the longest possible frame.
    pub fn bulk_frame_max(&self) -> usize {
        let line = u64::from(self.baud) * BACKLOG.as_micros() / 10_200_000;
        ((line as u32).min(self.mark(Class::Bulk) / 5 * 3 / 2) as usize).min(FRAME_BYTES_MAX)
    }

    /// Unaltered, if it may go now.
    pub fn pass(&mut self, now: Instant, class: Class, frame: &[u8], out: &mut impl FnMut(&[u8])) -> bool {
        if !self.fits(now, class, frame.len()) {
            return false;
        }
        self.free_at = self.free_at.max(now) + self.duration(frame.len());
        self.window.book(self.free_at, frame.len());
        match class {
            Class::Event => self.events.take(frame.len()),
            Class::Bulk => self.bulk.take(frame.len()),
            Class::Forward => self.forward.take(frame.len()),
            _ => {}
        }
        out(frame);
        true
    }

    /// Sends a message of ours, if it may go now.
    pub fn send(&mut self, now: Instant, class: Class, packet: &Packet, out: &mut impl FnMut(&[u8])) -> bool {
        // Signing is work: not for a frame that will not go.
        let tail = if self.seal.is_some() { SIGNATURE_BYTES } else { 0 };
        if !self.fits(now, class, self.encoder.frame_len(packet) + tail) {
            return false;
        }
        let mut buffer = [0; FRAME_BYTES_MAX];
        let mut encoder = self.encoder;
        let frame = match &mut self.seal {
            Some(seal) => encoder.frame_signed(&mut buffer, packet, now, seal),
            None => encoder.frame(&mut buffer, packet),
        };
        let sent = !frame.is_empty() && self.pass(now, class, frame, out);
        if sent {
            // Only a sent frame uses a sequence number.
            self.encoder = encoder;
        }
        sent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_budget(sent: &[(u64, usize)], budget: u32, baud: u32) {
        let mut free_us = 0;
        let mut spans = Vec::new();
        for (at_us, bytes) in sent {
            let start: u64 = free_us.max(*at_us);
            free_us = start + *bytes as u64 * 10_000_000 / u64::from(baud);
            spans.push((start, free_us, *bytes));
        }
        for (first, (_, end, _)) in spans.iter().enumerate() {
            let window =
                spans[first..].iter().take_while(|(start, ..)| start.saturating_sub(*end) < 1_000_000);
            let bytes: usize = window.map(|(.., bytes)| bytes).sum();
            assert!(bytes <= budget as usize, "{bytes} of {budget} bytes in the second from {end} us");
        }
    }

    proptest::proptest! {
        #[test]
        fn every_window_of_a_second_stays_within_the_budget(
            budget in 100_u32..5_000,
            baud in proptest::sample::select(vec![9_600_u32, 57_600, 921_600]),
            steps in proptest::collection::vec((0_u64..90_000, 12_usize..280, 0_usize..6), 1..400),
        ) {
            let mut outlet = Outlet::new(budget, baud, 288);
            let mut now_us = 0;
            let mut sent = Vec::new();
            for (step_us, bytes, class) in steps {
                now_us += step_us;
                let class = [Class::Critical, Class::Finding, Class::Own, Class::Event, Class::Forward, Class::Bulk][class];
                let frame = vec![0; bytes];
                outlet.pass(Instant::from_micros(now_us), class, &frame, &mut |frame| sent.push((now_us, frame.len())));
            }
            assert_budget(&sent, budget, baud);
        }
    }

    #[test]
    fn no_more_waits_than_the_queue_holds_however_fast_the_line() {
        for baud in [9_600, 57_600, 921_600] {
            let mut outlet = Outlet::new(5_000, baud, 288);
            for tick in 0..200 {
                let now = Instant::from_millis(50 * tick);
                let mut waiting = outlet.free_at.since(now).as_micros() as usize * baud as usize / 10_200_000;
                let before = waiting;
                for class in [Class::Bulk, Class::Forward, Class::Event, Class::Own] {
                    while outlet.pass(now, class, &[0; 60], &mut |frame| waiting += frame.len()) {}
                }
                assert!(waiting <= before.max(300), "{waiting} bytes at {baud} baud");
                while outlet.pass(now, Class::Finding, &[0; 92], &mut |frame| waiting += frame.len()) {}
                assert!(waiting <= 300 + FINDINGS as usize, "{waiting} bytes at {baud} baud");
            }
        }
    }

    #[test]
    fn another_line_rate_waits_until_the_line_is_empty() {
        let mut outlet = Outlet::new(5_000, 9_600, 288);
        assert!(outlet.pass(Instant::ZERO, Class::Own, &[0; 96], &mut |_| {}));
        outlet.set(Instant::from_millis(50), 5_000, 57_600);
        assert!(!outlet.pass(Instant::from_millis(50), Class::Critical, &[0; 12], &mut |_| {}));
        assert_eq!(outlet.baud(), 9_600, "96 bytes take 0.1 s");
        outlet.set(Instant::from_millis(110), 5_000, 57_600);
        assert_eq!(outlet.baud(), 57_600);
        assert!(outlet.pass(Instant::from_millis(110), Class::Critical, &[0; 12], &mut |_| {}));
    }

    #[test]
    fn a_port_without_a_line_takes_its_budget_at_once_and_no_more() {
        let mut outlet = Outlet::new(20_000, NO_LINE, FRAME_BYTES_MAX as u32);
        let mut bytes = 0;
        while outlet
            .pass(Instant::ZERO, Class::Bulk, &[0; FRAME_BYTES_MAX], &mut |frame| bytes += frame.len())
        {
        }
        let share = outlet.mark(Class::Bulk) as usize / 5 * 3;
        assert!(bytes <= share && bytes + FRAME_BYTES_MAX > share, "{bytes} of {share}");
        assert_eq!(outlet.bulk_frame_max(), FRAME_BYTES_MAX);
    }

    #[test]
    fn a_saturated_outlet_uses_its_budget() {
        let mut outlet = Outlet::new(2_000, 57_600, 288);
        let mut bytes = 0;
        for now_ms in 0..60_000 {
            outlet.pass(Instant::from_millis(now_ms), Class::Forward, &[0; 40], &mut |frame| {
                bytes += frame.len();
            });
        }
        let mark = outlet.mark(Class::Forward) as usize;
        assert!(bytes >= 60 * mark * 95 / 100 && bytes <= 61 * mark, "{bytes} of {} bytes", 60 * mark);
    }

    #[test]
    fn what_is_forwarded_leaves_room_for_bulk_and_bulk_for_it() {
        for budget in [500, 2_000, 5_000] {
            let mut outlet = Outlet::new(budget, 57_600, 288);
            let (mut forwarded, mut bulk) = (0, 0);
            let piece = vec![0; outlet.bulk_frame_max()];
            for now_ms in 0..20_000 {
                let now = Instant::from_millis(now_ms);
                outlet.pass(now, Class::Forward, &[0; 40], &mut |frame| forwarded += frame.len());
                if now_ms % 50 == 0 {
                    outlet.pass(now, Class::Bulk, &piece, &mut |frame| bulk += frame.len());
                }
            }
            let share = 20 * outlet.mark(Class::Bulk) as usize / 10;
            assert!(
                bulk > 4 * share && forwarded > 3 * share,
                "{bulk} and {forwarded} bytes at {budget} B/s"
            );
        }
    }

    #[test]
    fn a_critical_finding_finds_room_and_waits_less_than_the_backlog() {
        for budget in [400, 1_000, 5_000] {
            let mut outlet = Outlet::new(budget, 57_600, 288);
            for now_ms in 0..10_000 {
                let now = Instant::from_millis(now_ms);
                for class in [Class::Bulk, Class::Forward, Class::Event, Class::Own] {
                    outlet.pass(now, class, &[0; 60], &mut |_| {});
                }
                if now_ms % 1_500 == 1_499 {
                    let waits = outlet.free_at.since(now);
                    assert!(
                        outlet.pass(now, Class::Critical, &[0; 79], &mut |_| {}),
                        "at {now_ms} ms, {budget} B/s"
                    );
                    assert!(waits <= BACKLOG, "{waits:?} at {now_ms} ms");
                }
            }
        }
    }
}
