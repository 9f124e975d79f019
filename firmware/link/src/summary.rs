//! Summary stream to the ground station. It forwards the vehicle's frames that a pilot needs, unaltered and at a
//! lower rate. It adds the monitor's own messages: heartbeat, findings as `STATUSTEXT`, levels and usage as
//! `NAMED_VALUE_FLOAT`, and all levels in one `NAMED_VALUE_INT` ([`state`]).
//!
//! An [`Outlet`] guards the byte budget and lets findings overtake. A periodic message is due when its interval is
//! nearly over. Its score is its waiting time in intervals. If the budget is short, a frame is sent only if the frame
//! with the highest score still fits after it. So every score becomes the highest in time, and no message starves. A
//! message that has waited four intervals gets the priority of a heartbeat.

use core::fmt::Write as _;
use hums_dialect::ids;

use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::health::Subsystem;
use hums_core::health::{self, Finding, Health, Level, Orders};
use hums_core::observation::{Feeds, Source};
use hums_core::parameters::{Param, Params};
use hums_core::usage::UsageCounter;
use hums_dialect::wire::SIGNATURE_BYTES;

use crate::frame::Frame;
use crate::messages::{self, ComputerStatus};
use crate::outlet::{Class, Outlet};
use crate::packet::Packet;
use crate::statustext::{Severity, TEXT_BYTES_MAX, Text};
use crate::telling::{self, SendTime, SentFindings, order};
use crate::vocabulary;

/// Forwarded messages: id and how long between two, in milliseconds (0: every one).
const FORWARDED: &[(u32, u16)] = &[
    (ids::HEARTBEAT, 1_000),
    (ids::SYS_STATUS, 2_000),
    (ids::SYSTEM_TIME, 5_000),
    (ids::GPS_RAW_INT, 1_000),
    (ids::ATTITUDE, 250),
    (ids::GLOBAL_POSITION_INT, 500),
    (ids::MISSION_CURRENT, 2_000),
    (ids::MISSION_ITEM_REACHED, 0),
    (ids::RC_CHANNELS, 2_000),
    (ids::VFR_HUD, 500),
    (ids::COMMAND_ACK, 0),
    (ids::RADIO_STATUS, 2_000),
    (ids::BATTERY_STATUS, 2_000),
    (ids::AUTOPILOT_VERSION, 0),
    (ids::EKF_STATUS_REPORT, 2_000),
    (ids::EFI_STATUS, 2_000),
    (ids::RPM, 2_000),
    (ids::ESTIMATOR_STATUS, 2_000),
    (ids::VIBRATION, 2_000),
    (ids::HOME_POSITION, 5_000),
    (ids::EXTENDED_SYS_STATE, 1_000),
    (ids::STATUSTEXT, 0),
    (ids::ESC_INFO, 2_000),
    (ids::ESC_STATUS, 1_000),
    (ids::RAW_RPM, 2_000),
    (ids::ESC_TELEMETRY_1_TO_4, 1_000),
    (ids::ESC_TELEMETRY_5_TO_8, 1_000),
    (ids::ESC_TELEMETRY_9_TO_12, 1_000),
];
const VALUES: usize = FORWARDED.len();
const STATE: usize = VALUES + 1;
const COMPUTER: usize = STATE + 1;
const TURNS: usize = COMPUTER + 1;
const VALUES_MS: u16 = 700;
const STATE_MS: u16 = 2_000;
const COMPUTER_MS: u16 = 10_000;
const VALUE_BYTES: usize = 30;
const COMPUTER_BYTES: usize = 250 + SIGNATURE_BYTES;

/// Bytes that may wait at the port, findings apart: 50 ms at 57,600 baud.
pub const WAITING_BYTES: u32 = 288;
const WAITING_MAX: usize = 16;
const HEARTBEAT: Span = Span::from_secs(1);
const STARVED: u32 = 4;
/// A message without a frame for this many intervals, and [`GONE_MS`], is not waited for.
const GONE: u32 = 3;
const GONE_MS: u32 = 3_000;

#[derive(Clone, Copy, Debug)]
struct Turn {
    /// Milliseconds since power-on, modulo 2^32, as `seen_ms`.
    due_ms: u32,
    seen_ms: u32,
    bytes: u16,
    known: bool,
}

impl Turn {
    fn score(&self, now_ms: u32, interval_ms: u32) -> Option<u32> {
        // Streams jitter, so a frame may be a quarter of the interval early.
        let early = interval_ms / 4;
        let waited = now_ms.wrapping_add(early).wrapping_sub(self.due_ms);
        // The other half of the numbers is the future.
        (waited < u32::MAX / 2).then(|| waited.saturating_mul(16) / interval_ms.max(1) + 1)
    }

    fn is_coming(&self, now_ms: u32, interval_ms: u32) -> bool {
        self.known && now_ms.wrapping_sub(self.seen_ms) <= (interval_ms * GONE).max(GONE_MS)
    }

    fn took(&mut self, now_ms: u32, interval_ms: u32) {
        let late = now_ms.wrapping_sub(self.due_ms);
        let in_step = late < interval_ms / 2 || late > u32::MAX - interval_ms / 2;
        self.due_ms = if in_step { self.due_ms } else { now_ms }.wrapping_add(interval_ms);
    }
}

const fn interval_ms(index: usize) -> u32 {
    (match index {
        VALUES => VALUES_MS,
        STATE => STATE_MS,
        COMPUTER => COMPUTER_MS,
        _ => FORWARDED[index].1,
    }) as u32
}

/// The box's state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OwnFigures {
    /// Processor load of the last second, percent; 0 if not measured.
    pub cpu_percent: f32,
    /// Highest use of the stack, percent.
    pub stack_percent: f32,
    /// Highest fill level of the sector queue, percent.
    pub queue_percent: f32,
    /// Longest call of the card, seconds.
    pub stall_s: f32,
    /// Content of `ONBOARD_COMPUTER_STATUS`.
    pub computer: ComputerStatus,
}

/// Forwarding of the vehicle's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Forwards {
    /// They are not forwarded.
    Nothing,
    /// Within the stream's budget.
    Budgeted,
    /// Each when it is due, to another port than ours, which has a budget of its own.
    Apart,
}

/// The summary stream.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Shared by answers and stream.
    pub outlet: Outlet,
    /// What becomes of the vehicle's frames.
    pub forwards: Forwards,
    /// The box's own status.
    pub own: OwnFigures,
    vehicle: Option<Source>,
    turns: [Turn; TURNS],
    next_value: usize,
    /// The most urgent first, then by age.
    waiting: heapless::Vec<Finding, WAITING_MAX>,
    telling: SentFindings,
    heartbeat_at: Option<Instant>,
}

impl Summary {
    /// Before the first frame.
    pub fn new(params: &Params) -> Self {
        Self {
            outlet: Outlet::new(
                params.get(Param::GsBudget) as u32,
                params.get(Param::GsBaud) as u32,
                WAITING_BYTES,
            ),
            forwards: Forwards::Budgeted,
            own: OwnFigures::default(),
            vehicle: None,
            turns: [Turn { due_ms: 0, seen_ms: 0, bytes: 0, known: false }; TURNS],
            next_value: 0,
            waiting: heapless::Vec::new(),
            telling: SentFindings::new(),
            heartbeat_at: None,
        }
    }

    /// Forwards a frame if it is its turn and within the budget.
    pub fn frame(&mut self, at: Instant, frame: &Frame<'_>, out: &mut impl FnMut(&[u8])) {
        // Heartbeats of the vehicle's other components (gimbal, camera) must not take the autopilot's turn.
        let ours = |vehicle: Source| {
            vehicle.system == frame.system()
                && (frame.id() != ids::HEARTBEAT || vehicle.component == frame.component())
        };
        if self.forwards == Forwards::Nothing || !self.vehicle.is_some_and(ours) {
            return;
        }
        let Ok(index) = FORWARDED.binary_search_by_key(&frame.id(), |(id, _)| *id) else { return };
        let bytes = frame.bytes();
        let is_apart = self.forwards == Forwards::Apart;
        if interval_ms(index) == 0 {
            if is_apart {
                out(bytes);
            } else {
                self.outlet.pass(at, Class::Event, bytes, out);
            }
            return;
        }
        let now_ms = at.as_millis() as u32;
        self.announce(index, now_ms, bytes.len());
        if is_apart {
            if self.turns[index].score(now_ms, interval_ms(index)).is_some() {
                self.turns[index].took(now_ms, interval_ms(index));
                out(bytes);
            }
        } else if self.has_turn(index, at, bytes.len()) {
            let class = if self.is_urgent(index, now_ms) { Class::Own } else { Class::Forward };
            if self.outlet.pass(at, class, bytes, out) {
                self.turns[index].took(now_ms, interval_ms(index));
            }
        }
    }

    fn announce(&mut self, index: usize, now_ms: u32, bytes: usize) {
        let turn = &mut self.turns[index];
        if !turn.known {
            turn.due_ms = now_ms;
        }
        *turn = Turn { seen_ms: now_ms, bytes: bytes as u16, known: true, ..*turn };
    }

    fn is_urgent(&self, index: usize, now_ms: u32) -> bool {
        let score = self.turns[index].score(now_ms, interval_ms(index));
        index == 0 || score.is_some_and(|score| score > 16 * STARVED)
    }

    fn has_turn(&mut self, index: usize, now: Instant, bytes: usize) -> bool {
        let now_ms = now.as_millis() as u32;
        let Some(score) = self.turns[index].score(now_ms, interval_ms(index)) else { return false };
        if index == 0 {
            return true;
        }
        let mut first = (score, 0);
        let shares = |other: usize| self.forwards != Forwards::Apart || other >= VALUES;
        let others = self.turns.iter().enumerate().filter(|(other, _)| *other != index && shares(*other));
        for (other, turn) in others {
            let interval = interval_ms(other);
            if let Some(other_score) = turn.score(now_ms, interval)
                && other_score > first.0
                && turn.is_coming(now_ms, interval)
            {
                first = (other_score, usize::from(turn.bytes));
            }
        }
        let class = if self.is_urgent(index, now_ms) { Class::Own } else { Class::Forward };
        self.outlet.fits_besides(now, class, bytes, first.1)
    }

    /// Now or as soon as budget and event allow (`telling.rs`).
    pub fn finding(&mut self, now: Instant, finding: &Finding, out: &mut impl FnMut(&[u8])) {
        // The waiting text is out of date.
        self.waiting.retain(|other| (other.check, other.instance) != (finding.check, finding.instance));
        let is_news = self.telling.is_news(finding);
        if severity(finding).is_none() || !is_news {
            return;
        }
        if self.waiting.is_full() {
            // The last one is the least urgent of those that wait.
            if self.waiting.last().is_some_and(|last| urgency(last) >= urgency(finding)) {
                return;
            }
            self.waiting.pop();
        }
        let place = self.waiting.iter().position(|other| urgency(other) < urgency(finding));
        let _ = self.waiting.insert(place.unwrap_or(self.waiting.len()), *finding);
        self.tell(now, None, out);
    }

    fn tell(&mut self, now: Instant, health: Option<&Health>, out: &mut impl FnMut(&[u8])) {
        let mut place = 0;
        while let Some(finding) = self.waiting.get(place) {
            let is_critical = finding.level == Level::Critical;
            let check = health::check_named(finding.check);
            // A value of several sensors may recover while it waits for its cause.
            let is_so = |health: &Health| {
                check.is_none_or(|check| {
                    check.role.is_derived() || health.lasts(check, finding.instance, now.into())
                })
            };
            let is_explained = |health: &Health| {
                health.alarm(finding.check, finding.instance).is_some_and(|(_, is_explained)| is_explained)
            };
            let fate = match health {
                _ if is_critical => self.telling.fate(now, finding, None),
                Some(health) if is_explained(health) => SendTime::Never,
                Some(health) if is_so(health) => self.telling.fate(now, finding, Some(health)),
                _ => SendTime::Later,
            };
            match fate {
                SendTime::Now => {}
                SendTime::Later => {
                    place += 1;
                    continue;
                }
                SendTime::Never => {
                    self.waiting.remove(place);
                    continue;
                }
            }
            let class = if is_critical { Class::Critical } else { Class::Finding };
            let severity = severity(finding).unwrap_or(Severity::Notice);
            let revises =
                !is_critical && health.is_some_and(|health| self.telling.has_effect(finding, health));
            let mut cause = if is_critical { telling::cause(finding, &self.waiting) } else { None };
            let mut text = words(cause.as_ref().unwrap_or(finding), finding, revises);
            if cause.is_some() && !text.as_str().ends_with(order(finding)) {
                // The order matters more than the cause.
                (cause, text) = (None, words(finding, finding, revises));
            }
            let packet = messages::status_text(severity, text.as_str());
            if !self.outlet.send(now, class, &packet, out) {
                return;
            }
            let told = self.waiting.remove(place);
            self.telling.told(now, &told);
            if let Some(cause) = cause {
                self.telling.names(&cause);
                self.waiting.retain(|waits| (waits.check, waits.instance) != (cause.check, cause.instance));
            }
            self.waiting.retain(|waits| !SentFindings::is_consequence(&told, waits));
            place = 0;
        }
    }

    /// Periodic work: heartbeat, values, and waiting findings.
    pub fn tick(&mut self, now: Instant, monitor: &Monitor, out: &mut impl FnMut(&[u8])) {
        if let Some(source) = monitor.vehicle().source {
            self.vehicle = Some(source);
            self.outlet.encoder.set_system(source.system);
        }
        let params = monitor.params();
        self.outlet.set(now, params.get(Param::GsBudget) as u32, params.get(Param::GsBaud) as u32);
        self.tell(now, Some(monitor.health()), out);
        if self.heartbeat_at.is_none_or(|at| now.since(at) >= HEARTBEAT)
            && self.outlet.send(now, Class::Own, &heartbeat(monitor), out)
        {
            self.heartbeat_at = Some(now);
        }
        let now_ms = now.as_millis() as u32;
        // A message too long for the backlog limit or for a slow budget would wait for ever.
        let has_room = COMPUTER_BYTES <= self.outlet.bulk_frame_max();
        for (index, bytes) in [(STATE, VALUE_BYTES), (VALUES, VALUE_BYTES), (COMPUTER, COMPUTER_BYTES)] {
            if index == COMPUTER && !has_room {
                continue;
            }
            self.announce(index, now_ms, bytes);
            if !self.has_turn(index, now, bytes) {
                continue;
            }
            let packet = match index {
                STATE => messages::named_int(now, "HUMS_STATE", state(monitor)),
                VALUES => value(now, monitor, &self.own, self.next_value),
                _ => messages::computer_status(now, &self.own.computer),
            };
            if self.outlet.send(now, Class::Forward, &packet, out) {
                self.turns[index].took(now_ms, interval_ms(index));
                if index == VALUES {
                    self.next_value = (self.next_value + 1) % (2 * VALUES_TOLD.len());
                }
            }
        }
    }
}

/// Our heartbeat as the vehicle is.
pub fn heartbeat(monitor: &Monitor) -> Packet {
    messages::heartbeat(match monitor.health().overall() {
        Level::Critical => 5,
        _ if monitor.vehicle().armed() => 4,
        _ => 3,
    })
}

#[derive(Clone, Copy)]
enum ValueSource {
    /// A part's level: 0 ok, 1 advisory, 2 warning, 3 critical, 4 stale.
    Level(Subsystem),
    /// A usage figure.
    Usage(UsageCounter),
    Own(fn(&OwnFigures) -> f32),
}

/// The overall level, on the scale of [`ValueSource::Level`]: every other value, before each of [`VALUES_TOLD`].
const OVERALL: &str = "HUMS_LEVEL";

const VALUES_TOLD: [(&str, ValueSource); 17] = [
    ("L_POWER", ValueSource::Level(Subsystem::Power)),
    ("L_PROPULS", ValueSource::Level(Subsystem::Propulsion)),
    ("L_ENGINE", ValueSource::Level(Subsystem::Engine)),
    ("L_STRUCT", ValueSource::Level(Subsystem::Structure)),
    ("L_NAVIG", ValueSource::Level(Subsystem::Navigation)),
    ("L_LINK", ValueSource::Level(Subsystem::Link)),
    ("L_COMPUT", ValueSource::Level(Subsystem::Computer)),
    ("L_ATTITU", ValueSource::Level(Subsystem::Attitude)),
    ("L_RECORD", ValueSource::Level(Subsystem::Recorder)),
    ("L_MISHAP", ValueSource::Level(Subsystem::Mishap)),
    ("FLT_TIME_S", ValueSource::Usage(UsageCounter::Flight)),
    ("FLIGHTS", ValueSource::Usage(UsageCounter::Flights)),
    ("DIST_M", ValueSource::Usage(UsageCounter::Distance)),
    ("CPU_PCT", ValueSource::Own(|own| own.cpu_percent)),
    ("STACK_PCT", ValueSource::Own(|own| own.stack_percent)),
    ("QUEUE_PCT", ValueSource::Own(|own| own.queue_percent)),
    ("SD_STALL_S", ValueSource::Own(|own| own.stall_s)),
];

fn value(now: Instant, monitor: &Monitor, own: &OwnFigures, turn: usize) -> Packet {
    let (name, value) = match VALUES_TOLD.get(turn / 2).filter(|_| turn % 2 == 1) {
        None => (OVERALL, f32::from(monitor.health().overall() as u8)),
        Some((name, ValueSource::Level(subsystem))) => {
            (*name, f32::from(monitor.health().subsystem(*subsystem) as u8))
        }
        Some((name, ValueSource::Usage(counter))) => {
            (*name, monitor.usage().value(*counter).unwrap_or(0.0) as f32)
        }
        Some((name, ValueSource::Own(figure))) => (*name, figure(own)),
    };
    messages::named_float(now, name, value)
}

/// `HUMS_STATE`: the levels of all subsystems in one number, three bits each, in the order of [`Subsystem::ALL`] from
/// the lowest bits up.
pub fn state(monitor: &Monitor) -> i32 {
    let levels = Subsystem::ALL.into_iter().map(|subsystem| monitor.health().subsystem(subsystem) as i32);
    levels.enumerate().fold(0, |sum, (index, level)| sum | level << (3 * index))
}

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

/// Text of a finding for the pilot: part, fault, value and, if critical, the action: `HUMS: battery 1 low: 6.8 %, LAND NOW`. The
/// end of a finding repeats its name: `HUMS: over: battery 1 low`.
pub fn text(finding: &Finding) -> Text {
    words(finding, finding, false)
}

/// The text of a finding with the order of `orders`. `revises`: it is the cause of an earlier text.
#[inline(never)]
fn words(finding: &Finding, orders: &Finding, revises: bool) -> Text {
    let Finding { check, instance, level, value, feeds, .. } = *finding;
    let Some(said) = vocabulary::said(check) else { return Text::new(format_args!("HUMS: {check}")) };
    match level {
        Level::Ok => return Text::new(format_args!("HUMS: over: {}", said.alarm_of(instance, feeds))),
        Level::Stale => return Text::new(format_args!("HUMS: no data: {}", said.name_of(instance))),
        Level::Advisory | Level::Warning | Level::Critical => {}
    }
    let mut text = if check == "esc_silent" && finding.orders != Orders::Own {
        Text::new(format_args!("HUMS: ESC {} and all others silent", u16::from(instance) + 1))
    } else {
        let cause = if revises { "cause: " } else { "" };
        Text::new(format_args!("HUMS: {cause}{}", said.alarm_of(instance, feeds)))
    };
    // Nobody lands because of a camera's battery.
    let is_told = orders.level == Level::Critical && orders.feeds != Feeds::Payload;
    let order = if is_told { order(orders) } else { "" };
    let advice = if order.is_empty() { Text::default() } else { Text::new(format_args!(", {order}")) };
    if let Some((before, after)) = said.around_value(finding.unit)
        && value.is_finite()
    {
        let value = Text::new(format_args!(": {before}{}{after}", quantity(value, finding.unit).as_str()));
        // The action matters more than the amount.
        if text.as_str().len() + value.as_str().len() + advice.as_str().len() <= TEXT_BYTES_MAX {
            let _ = text.write_str(value.as_str());
        }
    }
    let _ = text.write_str(advice.as_str());
    text
}

fn quantity(value: f32, unit: &str) -> Text {
    let (unit, digits) = match unit {
        "degC" => ("C", 0),
        "V" => ("V", 2),
        "1/min" => ("per min", 0),
        "times" => ("x", 1),
        unit => (unit, u32::from(value.abs() < 100.0)),
    };
    let space = if unit.is_empty() { "" } else { " " };
    let (sign, scaled) = (if value.is_sign_negative() { "-" } else { "" }, scaled(value, digits));
    let (whole, part) = (scaled / 10_u64.pow(digits), scaled % 10_u64.pow(digits));
    match (digits, part) {
        (0, _) | (1, 0) => Text::new(format_args!("{sign}{whole}{space}{unit}")),
        _ => Text::new(format_args!("{sign}{whole}.{part:0width$}{space}{unit}", width = digits as usize)),
    }
}

/// The amount of a finite value in units of its last digit, at most two; from 2^40 on it is garbage, and stays there. Rounded
/// like `{:.2}`: to the nearest, or the even one of two. Formatting would take 12 KB of flash.
fn scaled(value: f32, digits: u32) -> u64 {
    const LARGEST: f32 = (1_u64 << 40) as f32;
    const FRACTION: u32 = 23;
    let bits = value.abs().min(LARGEST).to_bits();
    let exponent = bits >> FRACTION;
    let fraction = u64::from(bits & ((1 << FRACTION) - 1));
    // Subnormal numbers have no leading one, and the exponent of the smallest that have.
    let amount = (if exponent == 0 { fraction } else { fraction | 1 << FRACTION }) * 10_u64.pow(digits);
    let down = 127 + FRACTION as i32 - exponent.max(1) as i32;
    if down <= 0 {
        return amount << -down;
    }
    // An amount has less than 32 bits.
    let down = down.min(40);
    let (whole, rest, half) = (amount >> down, amount & ((1 << down) - 1), 1 << (down - 1));
    whole + u64::from(rest > half || (rest == half && whole & 1 == 1))
}

#[cfg(test)]
mod tests;
