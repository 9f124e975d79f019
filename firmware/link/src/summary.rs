//! The summary stream to the ground station: the vehicle's own frames that matter to a pilot, unaltered and less often,
//! and what the monitor has to say: heartbeat, findings as `STATUSTEXT`, levels and flight time as `NAMED_VALUE_FLOAT`.
//!
//! A byte budget holds in every window of one second, whatever comes in: [`Budget`] remembers what was sent lately and
//! lets nothing pass that would exceed it. Forwarded frames may use four fifths of it, so that a finding never finds the
//! link full; findings that must wait do so in order, the most urgent first.

use hums_core::Monitor;
use hums_core::health::{self, Finding, Level};
use hums_core::observation::Source;
use hums_core::params::{Param, Params};
use hums_core::time::{Instant, Span};
use hums_core::usage::UsageCounter;

use crate::encode::{Encoder, GS_FRAME_BYTES_MAX, Severity, Text};
use crate::frame::Frame;

/// Forwarded messages: id and the least time between two, in milliseconds (0: every one).
const FORWARDED: &[(u32, u16)] = &[
    (0, 500),        // HEARTBEAT: each of a sender's one a second, early ones too
    (1, 2_000),      // SYS_STATUS
    (2, 5_000),      // SYSTEM_TIME
    (24, 1_000),     // GPS_RAW_INT
    (30, 250),       // ATTITUDE
    (33, 500),       // GLOBAL_POSITION_INT
    (42, 2_000),     // MISSION_CURRENT
    (46, 0),         // MISSION_ITEM_REACHED
    (65, 2_000),     // RC_CHANNELS
    (74, 500),       // VFR_HUD
    (77, 0),         // COMMAND_ACK
    (109, 2_000),    // RADIO_STATUS
    (147, 2_000),    // BATTERY_STATUS
    (148, 0),        // AUTOPILOT_VERSION
    (193, 2_000),    // EKF_STATUS_REPORT
    (225, 2_000),    // EFI_STATUS
    (226, 2_000),    // RPM
    (230, 2_000),    // ESTIMATOR_STATUS
    (241, 2_000),    // VIBRATION
    (242, 5_000),    // HOME_POSITION
    (245, 1_000),    // EXTENDED_SYS_STATE
    (253, 0),        // STATUSTEXT
    (290, 2_000),    // ESC_INFO
    (291, 1_000),    // ESC_STATUS
    (339, 2_000),    // RAW_RPM
    (11_030, 1_000), // ESC_TELEMETRY_1_TO_4
    (11_031, 1_000), // ESC_TELEMETRY_5_TO_8
    (11_032, 1_000), // ESC_TELEMETRY_9_TO_12
];

/// Findings that wait for their turn.
const WAITING_MAX: usize = 16;
const HEARTBEAT: Span = Span::from_secs(1);
const VALUES: Span = Span::from_secs(2);
/// Of the budget, what forwarded frames may use, in fifths.
const FORWARDED_FIFTHS: u32 = 4;

/// What was sent in the last second, in slots.
#[derive(Clone, Copy, Debug)]
struct Budget {
    bytes_per_s: u32,
    slots: [u16; Self::SLOTS],
    newest: u64,
}

impl Budget {
    /// One more than a second has, so that the oldest slot, of which a part is still within the second, counts whole.
    const SLOTS: usize = 21;
    const SLOT_MICROS: u64 = 50_000;

    const fn new(bytes_per_s: u32) -> Self {
        Self { bytes_per_s, slots: [0; Self::SLOTS], newest: 0 }
    }

    fn advance(&mut self, now: Instant) {
        let slot = now.as_micros() / Self::SLOT_MICROS;
        for passed in 0..slot.saturating_sub(self.newest).min(Self::SLOTS as u64) {
            self.slots[((slot - passed) % Self::SLOTS as u64) as usize] = 0;
        }
        self.newest = self.newest.max(slot);
    }

    /// Takes `bytes` from `share` fifths of the budget; `false` where they would exceed it.
    fn take(&mut self, now: Instant, bytes: usize, share: u32) -> bool {
        self.advance(now);
        let sent: u32 = self.slots.iter().map(|bytes| u32::from(*bytes)).sum();
        let fits = sent + bytes as u32 <= self.bytes_per_s * share / 5;
        if fits {
            let slot = &mut self.slots[(self.newest % Self::SLOTS as u64) as usize];
            *slot = slot.saturating_add(bytes as u16);
        }
        fits
    }
}

/// The summary stream.
#[derive(Clone, Debug)]
pub struct Summary {
    encoder: Encoder,
    budget: Budget,
    vehicle: Option<Source>,
    sent_at: [Option<Instant>; FORWARDED.len()],
    /// The most urgent first, then in order.
    waiting: heapless::Vec<Finding, WAITING_MAX>,
    dropped: u32,
    heartbeat_at: Option<Instant>,
    values_at: Option<Instant>,
}

impl Summary {
    /// Before the first frame.
    pub fn new(params: &Params) -> Self {
        Self {
            encoder: Encoder::new(),
            budget: Budget::new(params.get(Param::GsBudget) as u32),
            vehicle: None,
            sent_at: [None; FORWARDED.len()],
            waiting: heapless::Vec::new(),
            dropped: 0,
            heartbeat_at: None,
            values_at: None,
        }
    }

    /// Forwards a frame of the vehicle if it is its turn and within the budget.
    pub fn frame(&mut self, at: Instant, frame: &Frame<'_>, out: &mut impl FnMut(&[u8])) {
        // Heartbeats of the vehicle's other components (gimbal, camera) must not take the autopilot's turn.
        let ours = |vehicle: Source| {
            vehicle.system == frame.system() && (frame.id() != 0 || vehicle.component == frame.component())
        };
        if !self.vehicle.is_some_and(ours) {
            return;
        }
        let Ok(index) = FORWARDED.binary_search_by_key(&frame.id(), |(id, _)| *id) else { return };
        let interval = Span::from_millis(u64::from(FORWARDED[index].1));
        let turn = self.sent_at[index].is_none_or(|sent_at| at.since(sent_at) >= interval);
        if turn && self.budget.take(at, frame.bytes().len(), FORWARDED_FIFTHS) {
            self.sent_at[index] = Some(at);
            out(frame.bytes());
        }
    }

    /// Tells a finding that a pilot should hear of, now or as soon as the budget allows.
    pub fn finding(&mut self, now: Instant, finding: &Finding, out: &mut impl FnMut(&[u8])) {
        if severity(finding).is_none() {
            return;
        }
        if self.waiting.is_full() {
            // The last one is the least urgent.
            self.waiting.pop();
            self.dropped = self.dropped.saturating_add(1);
        }
        let place = self.waiting.iter().position(|other| urgency(other) < urgency(finding));
        // There is room: one was taken out.
        let _ = self.waiting.insert(place.unwrap_or(self.waiting.len()), *finding);
        self.tell(now, out);
    }

    fn tell(&mut self, now: Instant, out: &mut impl FnMut(&[u8])) {
        while let Some(finding) = self.waiting.first().copied() {
            let mut buffer = [0; GS_FRAME_BYTES_MAX];
            let severity = severity(&finding).unwrap_or(Severity::Notice);
            let before = self.encoder;
            let bytes = self.encoder.status_text(&mut buffer, severity, text(&finding).as_str());
            if !self.budget.take(now, bytes.len(), 5) {
                // Not sent: its sequence number is not used either.
                self.encoder = before;
                return;
            }
            out(bytes);
            self.waiting.remove(0);
        }
    }

    /// What time alone asks for: heartbeat, values, and findings that wait.
    pub fn tick(&mut self, now: Instant, monitor: &Monitor, out: &mut impl FnMut(&[u8])) {
        if let Some(source) = monitor.vehicle().source {
            self.vehicle = Some(source);
            self.encoder.set_system(source.system);
        }
        self.budget.bytes_per_s = monitor.params().get(Param::GsBudget) as u32;
        self.tell(now, out);
        let due = |at: Option<Instant>, every: Span| at.is_none_or(|at| now.since(at) >= every);
        if due(self.heartbeat_at, HEARTBEAT) {
            self.heartbeat_at = Some(now);
            let state = match monitor.health().overall() {
                Level::Critical => 5,
                _ if monitor.vehicle().armed() => 4,
                _ => 3,
            };
            self.own(now, out, |encoder, buffer| encoder.heartbeat(buffer, state).len());
        }
        if due(self.values_at, VALUES) {
            self.values_at = Some(now);
            let level = f32::from(monitor.health().overall() as u8);
            let flight_s = monitor.usage().value(UsageCounter::Flight).unwrap_or(0.0) as f32;
            self.own(now, out, |encoder, buffer| encoder.named_value(buffer, now, "HUMS_LEVEL", level).len());
            self.own(now, out, |encoder, buffer| {
                encoder.named_value(buffer, now, "FLT_TIME_S", flight_s).len()
            });
        }
    }

    fn own(
        &mut self,
        now: Instant,
        out: &mut impl FnMut(&[u8]),
        make: impl FnOnce(&mut Encoder, &mut [u8; GS_FRAME_BYTES_MAX]) -> usize,
    ) {
        let mut buffer = [0; GS_FRAME_BYTES_MAX];
        let before = self.encoder;
        let len = make(&mut self.encoder, &mut buffer);
        if self.budget.take(now, len, 5) {
            out(&buffer[..len]);
        } else {
            self.encoder = before;
        }
    }

    /// Findings that were not told because more urgent ones took all room.
    pub const fn dropped(&self) -> u32 {
        self.dropped
    }
}

/// How a finding is told, or `None` where a pilot need not hear of it.
fn severity(finding: &Finding) -> Option<Severity> {
    match (finding.level, finding.previous) {
        (Level::Critical, _) => Some(Severity::Critical),
        (Level::Warning, _) => Some(Severity::Warning),
        (Level::Advisory | Level::Stale, _) => Some(Severity::Notice),
        (Level::Ok, Level::Warning | Level::Critical) => Some(Severity::Info),
        (Level::Ok, _) => None,
    }
}

fn urgency(finding: &Finding) -> u8 {
    match finding.level {
        Level::Critical => 4,
        Level::Warning => 3,
        Level::Stale => 2,
        Level::Advisory => 1,
        Level::Ok => 0,
    }
}

/// A finding in words a pilot understands, for instance `HUMS: battery low 14.9 % (limit 15)`.
pub fn text(finding: &Finding) -> Text {
    let words = health::words(finding.check);
    let number = finding.instance + 1;
    let Finding { value, limit, unit, .. } = *finding;
    match (finding.level, health::instances(finding.check)) {
        (Level::Ok, 0 | 1) => Text::new(format_args!("HUMS: ok again: {words}")),
        (Level::Ok, _) => Text::new(format_args!("HUMS: ok again: {words} #{number}")),
        (Level::Stale, 0 | 1) => Text::new(format_args!("HUMS: no data: {words}")),
        (Level::Stale, _) => Text::new(format_args!("HUMS: no data: {words} #{number}")),
        (_, 0 | 1) => Text::new(format_args!("HUMS: {words} {value:.2} {unit} (limit {limit})")),
        _ => Text::new(format_args!("HUMS: {words} #{number} {value:.2} {unit} (limit {limit})")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hums_core::health::Subsystem;

    fn finding(level: Level) -> Finding {
        Finding {
            at: Instant::ZERO,
            subsystem: Subsystem::Power,
            check: "batt_remaining",
            instance: 0,
            level,
            previous: Level::Ok,
            value: 14.9,
            limit: 15.0,
            unit: "%",
        }
    }

    #[test]
    fn a_finding_reads_as_a_sentence_and_fits() {
        assert_eq!(text(&finding(Level::Warning)).as_str(), "HUMS: battery low #1 14.90 % (limit 15)");
        for check in health::checks() {
            for level in Level::ALL {
                let finding =
                    Finding { check: check.name, unit: check.unit, value: -1234.5, ..finding(level) };
                assert!(text(&finding).as_str().len() < 50, "{}", text(&finding).as_str());
            }
        }
    }

    #[test]
    fn forwarded_ids_are_sorted_for_the_search() {
        assert!(FORWARDED.is_sorted_by(|a, b| a.0 < b.0));
    }

    #[test]
    fn the_budget_holds_in_every_window_of_a_second() {
        let params = Params::defaults();
        let mut summary = Summary::new(&params);
        let monitor = Monitor::new(params);
        let mut sent: Vec<(u64, usize)> = Vec::new();
        let mut encoder = Encoder::new();
        let mut buffer = [0; GS_FRAME_BYTES_MAX];
        summary.vehicle = Some(Source { system: 1, component: 1 });
        for now_ms in 0..10_000 {
            let now = Instant::from_millis(now_ms);
            let mut out = |bytes: &[u8]| sent.push((now_ms, bytes.len()));
            let text =
                encoder.status_text(&mut buffer, Severity::Info, "a text of the vehicle, as long as it gets");
            summary.frame(now, &Frame::parse(text).expect("a frame"), &mut out);
            summary.finding(now, &finding(Level::Warning), &mut out);
            summary.tick(now, &monitor, &mut out);
        }
        let budget = params.get(Param::GsBudget) as usize;
        for (start, _) in &sent {
            let window = sent.iter().filter(|(at, _)| at >= start && *at < start + 1_000);
            let bytes: usize = window.map(|(_, bytes)| bytes).sum();
            assert!(bytes <= budget, "{bytes} bytes in the second from {start} ms");
        }
        let total: usize = sent.iter().map(|(_, bytes)| bytes).sum();
        assert!(total > budget * 9, "the budget is used: {total} bytes");
    }

    #[test]
    fn a_critical_finding_overtakes_those_that_wait() {
        let mut summary = Summary::new(&Params::defaults());
        summary.budget.bytes_per_s = 0;
        for level in [Level::Warning, Level::Stale, Level::Critical, Level::Warning] {
            summary.finding(Instant::ZERO, &finding(level), &mut |_| panic!("there is no budget"));
        }
        let order: Vec<_> = summary.waiting.iter().map(|finding| finding.level).collect();
        assert_eq!(order, [Level::Critical, Level::Warning, Level::Warning, Level::Stale]);
    }
}
