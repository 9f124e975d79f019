//! The monitor of the board over a recording: the same checks, the same limits, the recording's own time.
//!
//! The monitor is stepped every 50 ms of the recording's time, whatever the rate of what it holds: debounce and staleness
//! follow the clock, not the number of samples. Where nothing was recorded for longer than `SILENCE_MAX` everything
//! has grown stale and every debounce has run out, so what follows is left out. A gap of the recording itself is no silence
//! of the vehicle: the monitor's time stands still over it (`super::clock`).

use std::collections::BTreeMap;

use hums_core::Monitor;
use hums_core::happening::Happening;
use hums_core::health::{Check, Level, Scope, Side, VOCABULARY, When, checks, vocabulary};
use hums_core::monitor::TICK;
use hums_core::observation::{Autopilot, Heartbeat};
use hums_core::params::{Param, Params};
use hums_core::status::{LinkReading, RecorderStatus};
use hums_core::time::{Instant, Span};
use hums_core::vehicle::Vehicle;
use hums_link::sequence::Sequences;

use super::clock::Clock;
use super::epochs::Epochs;
use super::problem::{LISTED_MAX, Problem, Problems};
use crate::source::item::{About, Gap, Item};
use crate::source::recording::Format;
use crate::source::told::{Finding, Told};

/// Silence that is stepped through: longer than each debounce and each time after which a value is stale.
const SILENCE_MAX: Span = Span::from_secs(75);
/// How often it is noted which checks have something to judge.
const NOTE_EVERY: Span = Span::from_millis(500);

/// Who judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JudgedBy {
    /// The monitor on board: its findings are in the log.
    Board,
    /// This program.
    Here,
}

/// Where a recording was heard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Heard {
    /// Nobody knows: what tells of the wire is not judged.
    #[default]
    Somewhere,
    /// At the monitor's own place, the autopilot's telemetry port: silence and lost frames are those of its wire.
    OnTheWire,
}

/// Whose limits count.
#[derive(Clone, Debug, Default)]
pub struct Limits {
    params: Params,
    /// Names that the user gave: what a log says of them does not count.
    given: Vec<&'static str>,
}

impl Limits {
    /// These are given; all others are the defaults, or what a log of ours says.
    pub fn new(given: &[(&'static hums_core::params::ParamSpec, f32)]) -> Self {
        let mut limits = Self::default();
        for (spec, value) in given {
            // Whoever read the file has checked name and range.
            let _ = limits.params.set(spec.name, *value);
            limits.given.push(spec.name);
        }
        limits
    }
}

/// A flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Take-off.
    pub from: Instant,
    /// Landing, or the recording's end.
    pub to: Instant,
    /// It landed.
    pub landed: bool,
    /// It was disarmed in the air, at this height above home, m.
    pub disarmed_at_m: Option<f32>,
}

/// What came of a recording.
#[derive(Clone, Debug)]
pub struct Judged {
    /// Who judged.
    pub by: JudgedBy,
    /// The monitor as it was at the end: the vehicle, its usage, what it exceeded.
    pub monitor: Box<Monitor>,
    /// Facts besides, the last of each kind.
    pub facts: BTreeMap<About, String>,
    /// UTC of each part of the recording.
    pub epochs: Epochs,
    /// The first and the last time.
    pub span: Option<(Instant, Instant)>,
    /// How long it was armed.
    pub armed: Span,
    /// Flights, in order.
    pub flights: Vec<Flight>,
    /// Changes of level, in order, up to [`LISTED_MAX`].
    pub findings: Vec<Finding>,
    /// How many there are.
    pub findings_count: u64,
    /// What was wrong, worst first.
    pub problems: Vec<Problem>,
    /// Checks that had something to judge.
    pub judged: Vec<&'static str>,
    /// Checks that had not, with the reason. Checks that are made for another autopilot are in neither list.
    pub not_judged: Vec<(&'static str, String)>,
    /// What is missing, in order, up to [`LISTED_MAX`].
    pub gaps: Vec<Gap>,
    /// How many gaps are damage.
    pub damages: u64,
    /// How many gaps are what the recorder lost while it recorded.
    pub losses: u64,
    /// How often the recording's clock began again.
    pub restarts: u64,
}

impl Judged {
    /// The vehicle, as it was known at the end.
    pub fn vehicle(&self) -> &Vehicle {
        self.monitor.vehicle()
    }

    /// Whether so few checks had something to judge that nothing found is no good news: fewer than one in ten.
    pub fn is_little(&self) -> bool {
        self.judged.len() * 10 < self.judged.len() + self.not_judged.len()
    }

    /// The worst level that was found; `None` where nothing could be judged.
    pub fn worst(&self) -> Option<Level> {
        match self.problems.first() {
            Some(problem) => Some(problem.level),
            None if self.vehicle().source.is_none() => None,
            None => Some(Level::Ok),
        }
    }
}

/// What a check had to judge.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// It had a value.
    value: bool,
    /// It had a level.
    level: bool,
}

/// Judges a recording, item by item.
pub struct Judge {
    monitor: Box<Monitor>,
    limits: Limits,
    format: Format,
    /// The sequence numbers of the frames, where the recording was heard on the monitor's wire.
    wire: Option<Sequences>,
    clock: Clock,
    note: Instant,
    first: Option<Instant>,
    last: Instant,
    seen: Vec<Seen>,
    armed: Span,
    was_armed: bool,
    /// When it was in the air last.
    flew_at: Option<Instant>,
    /// When it was disarmed above home right out of the air, and how high.
    disarmed: Option<(Instant, f32)>,
    /// What the monitor here found, and what the one on board did.
    here: Problems,
    board: Problems,
    checked_on_board: bool,
    flights: Vec<Flight>,
    facts: BTreeMap<About, String>,
    epochs: Epochs,
    gaps: Vec<Gap>,
    damages: u64,
    losses: u64,
    restarts: u64,
}

impl Judge {
    /// Before the first item.
    pub fn new(limits: &Limits, format: Format) -> Self {
        Self {
            monitor: Box::new(Monitor::new(limits.params)),
            limits: limits.clone(),
            format,
            wire: None,
            clock: Clock::default(),
            note: Instant::ZERO,
            first: None,
            last: Instant::ZERO,
            seen: vec![Seen::default(); VOCABULARY.len()],
            armed: Span::ZERO,
            was_armed: false,
            flew_at: None,
            disarmed: None,
            here: Problems::default(),
            board: Problems::default(),
            checked_on_board: false,
            flights: Vec::new(),
            facts: BTreeMap::new(),
            epochs: Epochs::default(),
            gaps: Vec::new(),
            damages: 0,
            losses: 0,
            restarts: 0,
        }
    }

    /// With a recording that was heard there.
    #[must_use]
    pub fn heard(self, heard: Heard) -> Self {
        Self { wire: (heard == Heard::OnTheWire).then(Sequences::new), ..self }
    }

    /// Takes the next item.
    pub fn item(&mut self, at: Instant, item: Item<'_>) {
        match item {
            Item::Observation(source, observation) => {
                self.advance(at);
                self.monitor.observe(self.clock.monitor(at), source, observation);
            }
            Item::Epoch(epoch_us) => self.epochs.epoch(epoch_us),
            Item::Fact(fact) => {
                self.facts.insert(fact.about, fact.words.to_owned());
            }
            Item::Record(told) => self.told(told),
            Item::Gap(gap) => self.gap(gap),
            Item::Restart => {
                self.restarts += 1;
                self.epochs.restart(at);
            }
            Item::Frame(frame) if self.wire.is_some() => {
                self.advance(at);
                let at = self.clock.monitor(at);
                if let Some(wire) = &mut self.wire {
                    wire.frame(at, frame);
                }
            }
            Item::Frame(_)
            | Item::Parameter(_)
            | Item::Text(_)
            | Item::Mode(_)
            | Item::Event(_)
            | Item::Row(_) => {}
        }
    }

    fn told(&mut self, told: &Told) {
        match told {
            Told::Parameter { name, value, .. } if !self.limits.given.contains(&name.as_str()) => {
                // What is out of range, or no parameter of ours, changes nothing.
                let _ = self.monitor.params_mut().set(name, *value);
            }
            Told::Finding(finding) => {
                self.checked_on_board = true;
                self.board.take(finding);
            }
            Told::Checked => self.checked_on_board = true,
            Told::Parameter { .. } | Told::Part { .. } => {}
        }
    }

    fn gap(&mut self, gap: &Gap) {
        // One that begins before the last observation is a count over the whole recording.
        if let (Some(from), Some(to)) = (gap.from.filter(|from| *from >= self.last), gap.to)
            && self.first.is_some()
        {
            self.advance(from);
            self.clock.pause(from, to);
        }
        self.damages += u64::from(gap.cause.is_damage());
        self.losses += u64::from(gap.cause == crate::source::item::Cause::Lost);
        if self.gaps.len() < LISTED_MAX {
            self.gaps.push(gap.clone());
        }
    }

    /// Steps the monitor up to a time.
    fn advance(&mut self, to: Instant) {
        self.first.get_or_insert(to);
        self.last = self.last.max(to);
        let silence = to.since(self.clock.begin(to));
        let pause = (silence > SILENCE_MAX).then(|| self.clock.begin(to) + SILENCE_MAX);
        while let Some(now) = self.clock.step(to) {
            self.tick(now);
            if pause.is_some_and(|pause| now + TICK > pause) {
                self.clock.skip_to(to);
            }
        }
    }

    fn tick(&mut self, now: Instant) {
        let steps = self.clock.monitor(now);
        let (link, recorder) = (self.link(steps), RecorderStatus::default());
        let Self { monitor, here, format, wire, .. } = self;
        monitor.tick(steps, &link, &recorder, &mut |finding| {
            if is_of(finding.check, *format, wire.is_some()) {
                here.take(&Finding {
                    at: Clock::recording(now, steps, finding.at),
                    ..Finding::from(finding)
                });
            }
        });
        let armed = monitor.vehicle().armed();
        if monitor.flight().airborne() {
            self.flew_at = Some(now);
        }
        if armed && self.was_armed {
            self.armed = self.armed + TICK;
        }
        self.was_armed = armed;
        while let Some(happening) = self.monitor.take_happening() {
            self.happening(now, steps, happening);
        }
        self.watch_fall(now);
        if now >= self.note {
            self.note = now + NOTE_EVERY;
            self.note_seen(steps, &link, &recorder);
        }
    }

    /// What is lost of the vehicle's frames, where that is known.
    fn link(&mut self, steps: Instant) -> LinkReading {
        let source = self.monitor.vehicle().source;
        self.wire.as_mut().map_or_else(LinkReading::default, |wire| wire.reading(steps, source))
    }

    fn happening(&mut self, now: Instant, steps: Instant, happening: Happening) {
        match happening {
            Happening::TakeOff if self.flights.len() < LISTED_MAX => {
                let since = self.monitor.flight().airborne_since();
                let from = since.map_or(now, |since| Clock::recording(now, steps, since));
                self.flights.push(Flight { from, to: now, landed: false, disarmed_at_m: None });
            }
            Happening::Landing => {
                self.end_flight(now, true);
                self.disarmed = self.disarmed_at_m(now).map(|height_m| (now, height_m));
            }
            _ => {}
        }
    }

    /// The height above home where a flight that ends now was ended by disarming, not well after a landing.
    fn disarmed_at_m(&self, now: Instant) -> Option<f32> {
        /// Lower is a landing whose last metre the autopilot or its height has missed.
        const LANDING_M: f32 = 3.0;
        /// The autopilot says that it stands when it disarms, and its heartbeat comes at 1 Hz.
        const SINCE_AIR: Span = Span::from_secs(2);
        let flew = self.flew_at.is_some_and(|at| now.since(at) <= SINCE_AIR);
        let disarmed = flew && !self.monitor.vehicle().armed();
        self.height_m().filter(|height_m| disarmed && *height_m > LANDING_M)
    }

    /// What was disarmed above home falls if it was in the air, and stays where it is if it stands on a hill or a roof.
    fn watch_fall(&mut self, now: Instant) {
        const WATCHED: Span = Span::from_secs(4);
        const FALLEN_M: f32 = 2.0;
        let Some((at, from_m)) = self.disarmed else { return };
        if self.height_m().is_some_and(|height_m| height_m < from_m - FALLEN_M) {
            if let Some(flight) = self.flights.last_mut() {
                (flight.landed, flight.disarmed_at_m) = (false, Some(from_m));
            }
            self.disarmed = None;
        } else if now.since(at) > WATCHED {
            self.disarmed = None;
        }
    }

    /// Height above home, as it was told last.
    fn height_m(&self) -> Option<f32> {
        self.monitor.vehicle().global.get().map(|position| position.relative_altitude.0)
    }

    fn end_flight(&mut self, at: Instant, landed: bool) {
        if let Some(flight) =
            self.flights.last_mut().filter(|flight| !flight.landed && flight.disarmed_at_m.is_none())
        {
            (flight.to, flight.landed) = (at, landed);
        }
    }

    /// Notes which checks have a value, and which have a level.
    fn note_seen(&mut self, now: Instant, link: &LinkReading, recorder: &RecorderStatus) {
        if self.monitor.vehicle().source.is_none() {
            return;
        }
        let inputs = self.monitor.inputs(now, link, recorder);
        for (seen, check) in self.seen.iter_mut().zip(checks()).filter(|(seen, _)| !seen.value) {
            seen.value = (0..check.instances).any(|instance| {
                (check.read)(&inputs, instance).is_some_and(|reading| reading.value.is_finite())
            });
        }
        if self.seen.iter().all(|seen| seen.level) {
            return;
        }
        for (check, ..) in self.monitor.health().levels().filter(|(.., level)| *level != Level::Stale) {
            let place = checks().position(|known| std::ptr::eq(known, check));
            if let Some(seen) = place.and_then(|place| self.seen.get_mut(place)) {
                seen.level = true;
            }
        }
    }

    /// The recording has ended.
    pub fn end(mut self) -> Judged {
        if self.first.is_some() {
            self.advance(self.last);
        }
        if self.monitor.flight().airborne() {
            self.end_flight(self.last, false);
        }
        let given = !self.limits.given.is_empty();
        let by = if self.checked_on_board && !given { JudgedBy::Board } else { JudgedBy::Here };
        if !self.checked_on_board && self.wire.is_none() {
            // Nobody knows where it was heard: a packed recording may be that of a ground station.
            self.here.drop_checks(|check| vocabulary(check).is_some_and(|words| words.scope == Scope::Wire));
        }
        let (judged, not_judged) = self.coverage(by);
        let last = self.last;
        let mut problems = match by {
            JudgedBy::Board => self.board,
            JudgedBy::Here => {
                let steps = self.clock.monitor(last);
                for exceedance in self.monitor.exceedances().iter(steps) {
                    self.here.peak(exceedance.check.name, exceedance.instance, exceedance.session.peak);
                }
                self.here
            }
        };
        problems.end(last);
        Judged {
            by,
            monitor: self.monitor,
            facts: self.facts,
            epochs: self.epochs,
            span: self.first.map(|first| (first, last)),
            armed: self.armed,
            flights: self.flights,
            findings_count: problems.findings_count,
            findings: std::mem::take(&mut problems.findings),
            problems: problems.worst_first(),
            judged,
            not_judged,
            gaps: self.gaps,
            damages: self.damages,
            losses: self.losses,
            restarts: self.restarts,
        }
    }

    /// Which checks had something to judge, and why the others had not.
    fn coverage(&self, by: JudgedBy) -> (Vec<&'static str>, Vec<(&'static str, String)>) {
        let (mut judged, mut not_judged) = (Vec::new(), Vec::new());
        for (check, seen) in checks().zip(&self.seen) {
            match self.why_not(check, *seen, by) {
                Verdict::Judged => judged.push(check.name),
                Verdict::NotJudged(why) => not_judged.push((check.name, why)),
                Verdict::NotMeant => {}
            }
        }
        (judged, not_judged)
    }

    /// How arming is known, where the recording does not tell it.
    fn arming(&self) -> Option<&str> {
        self.facts.get(&About::Arming).map(String::as_str).filter(|words| !words.is_empty())
    }

    fn why_not(&self, check: &Check, seen: Seen, by: JudgedBy) -> Verdict {
        let Some(words) = vocabulary(check.name) else { return Verdict::NotMeant };
        let autopilot = self.monitor.vehicle().heartbeat.get().map(|Heartbeat { autopilot, .. }| *autopilot);
        let not = |why: &str| Verdict::NotJudged(why.to_owned());
        if by == JudgedBy::Board && matches!(words.scope, Scope::Wire | Scope::Recorder | Scope::Stored) {
            // The board had its own wire and card; what it had stored is not in the log.
            return if words.scope == Scope::Stored && !seen.level {
                Verdict::NotMeant
            } else {
                Verdict::Judged
            };
        }
        match words.scope {
            Scope::ArduPilot if autopilot == Some(Autopilot::Px4) => return Verdict::NotMeant,
            Scope::Px4 if autopilot == Some(Autopilot::ArduPilot) => return Verdict::NotMeant,
            _ if autopilot.is_none() => return not("no heartbeat of an autopilot"),
            Scope::Wire | Scope::Recorder if words.scope == Scope::Recorder || self.wire.is_none() => {
                return not(match (words.scope, self.format.is_of_link()) {
                    (Scope::Recorder, _) => "no monitor recorded this",
                    (_, true) => {
                        "this tells of the link to whoever recorded it, not of the autopilot's own wire"
                    }
                    (_, false) => "the autopilot recorded this itself, without a link",
                });
            }
            _ => {}
        }
        if is_off(check, self.monitor.params()) {
            return not("its limit is off");
        }
        if words.scope == Scope::Stored {
            return not("only a monitor on board knows earlier flights and parts that wear");
        }
        if seen.level {
            return Verdict::Judged;
        }
        match check.when {
            When::Armed | When::InFlight if self.armed == Span::ZERO => {
                not(self.arming().unwrap_or("never armed"))
            }
            When::InFlight if self.flights.is_empty() => not("never in the air"),
            _ if seen.value => not("only for a moment in this recording"),
            _ => Verdict::NotJudged(format!("no {}", words.needs)),
        }
    }
}

enum Verdict {
    Judged,
    NotJudged(String),
    /// It is made for another autopilot, or for parts that nobody registered.
    NotMeant,
}

/// Whether a check says anything in a recording of this format, judged here: one recording tells neither of earlier flights
/// nor of parts that wear.
fn is_of(check: &str, format: Format, on_the_wire: bool) -> bool {
    let scope = vocabulary(check).map(|words| words.scope);
    !matches!(scope, Some(Scope::Recorder | Scope::Stored))
        && (format == Format::Hums || on_the_wire || scope != Some(Scope::Wire))
}

/// Whether no value can be beyond the limits: they stand at the end of their range.
fn is_off(check: &Check, params: &Params) -> bool {
    let off = |param: Param| {
        let (limit, spec) = (params.get(param), param.spec());
        limit.is_nan()
            || match check.side {
                Side::Above => limit >= spec.max,
                Side::Below => limit <= spec.min,
            }
    };
    [check.warn, check.critical].into_iter().flatten().all(off)
}

#[cfg(test)]
mod tests {
    use hums_core::observation::{Battery, Esc, EscGroup, Observation, Source};
    use hums_core::units::{Fraction, Rpm, Volts};

    use super::*;
    use crate::source::item::Cause;

    const AUTOPILOT: Source = Source { system: 1, component: 1 };

    fn heartbeat(armed: bool) -> Observation {
        let autopilot = Autopilot::ArduPilot;
        Observation::Heartbeat(Heartbeat { autopilot, armed, state: 4, ..Heartbeat::default() })
    }

    fn battery(remaining: f32) -> Observation {
        let (voltage, remaining) = (Some(Volts(12.0)), Some(Fraction(remaining)));
        Observation::Battery(Battery { voltage, remaining, ..Battery::default() })
    }

    /// Heartbeats and battery levels, so many a second, from this second to that.
    fn fly(judge: &mut Judge, from_s: u64, to_s: u64, per_s: u64, remaining: f32) {
        for tick in from_s * per_s..to_s * per_s {
            let at = Instant::from_micros(tick * 1_000_000 / per_s);
            judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(true)));
            judge.item(at, Item::Observation(AUTOPILOT, &battery(remaining)));
        }
    }

    fn found(judged: &Judged) -> Vec<(String, Level, f64)> {
        let line = |finding: &Finding| (finding.check.clone(), finding.level, finding.at.as_secs_f64());
        judged.findings.iter().map(line).collect()
    }

    #[test]
    fn debounce_follows_the_recordings_time_and_not_the_number_of_samples() {
        for per_s in [1, 10, 400] {
            let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
            fly(&mut judge, 100, 110, per_s, 0.5);
            fly(&mut judge, 110, 120, per_s, 0.1);
            let found = found(&judge.end());
            let [(check, Level::Warning, at)] = found.as_slice() else { panic!("{per_s}: {found:?}") };
            assert_eq!(check, "batt_remaining");
            assert!((at - 112.0).abs() < 0.11, "{per_s} samples a second: {at}");
        }
    }

    #[test]
    fn a_gap_of_hours_is_not_stepped_through_and_what_was_known_is_stale_after_it() {
        let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
        fly(&mut judge, 0, 20, 10, 0.1);
        let years = 3 * 365 * 24 * 3_600;
        let wall = std::time::Instant::now();
        fly(&mut judge, years, years + 10, 10, 0.1);
        assert!(wall.elapsed().as_secs() < 5, "three years are not stepped through");
        let judged = judge.end();
        let levels: Vec<Level> = judged
            .findings
            .iter()
            .filter(|finding| finding.check == "batt_remaining")
            .map(|finding| finding.level)
            .collect();
        assert_eq!(levels, [Level::Warning, Level::Stale, Level::Warning]);
        let [problem] = judged.problems.as_slice() else { panic!("{:?}", judged.problems) };
        assert_eq!((problem.times, problem.lasting), (2, true));
        assert!(problem.lasted < Span::from_secs(50), "{:?}", problem.lasted);
    }

    #[test]
    fn each_check_is_judged_or_says_why_not() {
        let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
        fly(&mut judge, 0, 20, 10, 0.9);
        let judged = judge.end();
        assert!(judged.judged.contains(&"batt_remaining"), "{:?}", judged.judged);
        let why = |check: &str| {
            let reason = judged.not_judged.iter().find(|(name, _)| *name == check);
            reason.map_or("", |(_, why)| why.as_str())
        };
        assert_eq!(why("esc_silent"), "no ESC telemetry");
        assert_eq!(why("ekf_variance"), "never in the air");
        assert_eq!(why("frames_lost"), "the autopilot recorded this itself, without a link");
        assert_eq!(why("record_lost"), "no monitor recorded this");
        assert_eq!(why("rc_rssi"), "its limit is off");
        // PX4's are not meant for ArduPilot.
        assert_eq!(why("vibration_px4"), "");
        let named = judged.judged.len() + judged.not_judged.len();
        assert_eq!(named, VOCABULARY.iter().filter(|words| words.scope != Scope::Px4).count());
    }

    /// A flight at 30 m that is disarmed at 20 s, and falls or stays.
    fn disarmed_high(falls: bool) -> Judged {
        use hums_core::observation::GlobalPosition;
        use hums_core::units::{Metres, MetresPerSecond};
        let mut judge = Judge::new(&Limits::default(), Format::Tlog);
        for tick in 0..300_u64 {
            let (at, armed) = (Instant::from_millis(tick * 100), (20..200).contains(&tick));
            let fallen = if falls { tick.saturating_sub(200) as f32 } else { 0.0 };
            let height = if tick < 30 { 0.0 } else { (30.0 - fallen).max(0.0) };
            let position = Observation::GlobalPosition(GlobalPosition {
                position: None,
                altitude: Metres(height),
                relative_altitude: Metres(height),
                velocity: [MetresPerSecond(0.0); 3],
            });
            judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(armed)));
            judge.item(at, Item::Observation(AUTOPILOT, &position));
        }
        judge.end()
    }

    #[test]
    fn a_vehicle_that_falls_after_it_is_disarmed_did_not_land() {
        let flights = disarmed_high(true).flights;
        let [flight] = flights.as_slice() else { panic!("{flights:?}") };
        assert_eq!((flight.landed, flight.disarmed_at_m), (false, Some(30.0)));
        let flights = disarmed_high(false).flights;
        let [flight] = flights.as_slice() else { panic!("{flights:?}") };
        assert_eq!((flight.landed, flight.disarmed_at_m), (true, None), "it stands on a hill");
    }

    #[test]
    fn trends_over_flights_are_not_judged_from_one_recording() {
        for format in [Format::DataFlash, Format::Tlog, Format::Hums] {
            let stored = VOCABULARY.iter().filter(|words| words.scope == Scope::Stored);
            assert!(stored.clone().count() > 3);
            for words in stored {
                assert!(!is_of(words.check, format, false), "{}", words.check);
            }
        }
        let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
        fly(&mut judge, 0, 20, 10, 0.9);
        let judged = judge.end();
        let why = judged.not_judged.iter().find(|(check, _)| *check == "batt_resistance");
        assert!(why.is_some_and(|(_, why)| why.contains("only a monitor on board")), "{why:?}");
    }

    #[test]
    fn a_recording_that_does_not_tell_arming_says_so_and_not_never() {
        use crate::source::item::Fact;
        let words = "the log does not tell whether it was armed";
        let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
        judge.item(Instant::ZERO, Item::Fact(Fact { about: About::Arming, words }));
        for second in 0..20 {
            let at = Instant::from_millis(second * 1_000);
            judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(false)));
        }
        let judged = judge.end();
        assert!(!judged.not_judged.is_empty());
        for (check, why) in judged.not_judged {
            assert!(!why.contains("never"), "{check}: {why}");
        }
    }

    #[test]
    fn nothing_of_a_vehicle_is_no_good_news() {
        let mut judge = Judge::new(&Limits::default(), Format::Tlog);
        let gap = Gap {
            from: None,
            to: None,
            cause: Cause::Cut,
            place: Some(7),
            bytes: 3,
            words: "cut".to_owned(),
        };
        judge.item(Instant::ZERO, Item::Gap(&gap));
        let judged = judge.end();
        assert_eq!((judged.worst(), judged.damages), (None, 1));
        assert!(judged.judged.is_empty(), "{:?}", judged.judged);
    }

    /// Heartbeats at 10 Hz, of which so many in a hundred are lost on the wire after 20 s, and none from 40 to 48 s.
    fn link_faults(heard: Heard) -> Judged {
        use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
        use hums_link::{Frame, messages};
        let mut judge = Judge::new(&Limits::default(), Format::Tlog).heard(heard);
        let mut encoder = Encoder::of(AUTOPILOT.system, AUTOPILOT.component);
        for tick in 0..600_u64 {
            encoder.set_sequence(tick as u8);
            let mut buffer = [0; FRAME_BYTES_MAX];
            let frame = Frame::parse(encoder.frame(&mut buffer, &messages::heartbeat(4))).expect("ours");
            if (200..400).contains(&tick) && tick % 5 == 0 || (400..480).contains(&tick) {
                continue;
            }
            let at = Instant::from_millis(tick * 100);
            judge.item(at, Item::Frame(&frame));
            judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(true)));
        }
        judge.end()
    }

    #[test]
    fn the_wire_is_judged_where_the_recording_was_heard_at_the_monitors_own_place() {
        let judged = link_faults(Heard::OnTheWire);
        let first = |check: &str| {
            let finding = judged.findings.iter().find(|finding| finding.check == check);
            finding.map(|finding| (finding.level, finding.at.as_secs_f64()))
        };
        let Some((Level::Warning | Level::Critical, at)) = first("frames_lost") else {
            panic!("{:?}", judged.findings)
        };
        assert!((20.0..26.0).contains(&at), "{at}");
        let Some((Level::Warning, at)) = first("heartbeat") else { panic!("{:?}", judged.findings) };
        assert!((41.9..42.1).contains(&at), "{at}");
        assert!(judged.judged.contains(&"frames_lost"), "{:?}", judged.judged);
        let judged = link_faults(Heard::Somewhere);
        assert!(
            judged.findings.iter().all(|finding| finding.check != "frames_lost"),
            "{:?}",
            judged.findings
        );
    }

    #[test]
    fn silence_of_a_link_is_no_finding_where_nobody_knows_which_link_it_was() {
        for (checked, heartbeats) in [(false, 0), (true, 1)] {
            let given = [(Param::BatRemWarn.spec(), 15.0)];
            let mut judge = Judge::new(&Limits::new(&given), Format::Hums);
            if checked {
                judge.item(Instant::ZERO, Item::Record(&Told::Checked));
            }
            fly(&mut judge, 0, 10, 10, 0.9);
            fly(&mut judge, 30, 40, 10, 0.9);
            let problems = judge.end().problems;
            let of_link = problems.iter().filter(|problem| problem.check == "heartbeat").count();
            assert_eq!(of_link, heartbeats, "{problems:?}");
        }
    }

    fn escs(judge: &mut Judge, from_ms: u64, to_ms: u64) {
        let esc = Some(Esc { rpm: Some(Rpm(5_000.0)), ..Esc::default() });
        let told = Observation::Escs(EscGroup { first: 0, escs: [esc, None, None, None] });
        for tick in from_ms / 100..to_ms / 100 {
            let at = Instant::from_millis(tick * 100);
            judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(true)));
            judge.item(at, Item::Observation(AUTOPILOT, &told));
        }
    }

    #[test]
    fn a_pause_of_the_recording_is_no_silence_of_an_esc_and_one_that_falls_silent_is_found() {
        for (told, cause, silent) in [
            (true, Cause::NotKept, 0),
            (true, Cause::Lost, 0),
            (true, Cause::Damaged, 0),
            (false, Cause::Lost, 1),
        ] {
            let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
            escs(&mut judge, 0, 10_000);
            let (from, to) = (Some(Instant::from_millis(9_900)), Some(Instant::from_millis(30_000)));
            let gap = Gap { from, to, cause, place: None, bytes: 0, words: String::new() };
            if told {
                judge.item(Instant::from_millis(30_000), Item::Gap(&gap));
            }
            escs(&mut judge, 30_000, 40_000);
            // A count over the whole recording, told at its end, is no pause.
            let whole = Gap { from: Some(Instant::ZERO), to: Some(Instant::from_millis(39_900)), ..gap };
            judge.item(Instant::from_millis(39_900), Item::Gap(&whole));
            let judged = judge.end();
            let found = judged.problems.iter().filter(|problem| problem.check == "esc_silent").count();
            assert_eq!(found, silent, "{cause:?}: {:?}", judged.findings);
            assert_eq!(judged.span.map(|(_, last)| last.as_millis()), Some(39_900));
        }
    }

    #[test]
    fn findings_after_a_pause_have_the_recordings_time() {
        let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
        fly(&mut judge, 0, 10, 10, 0.9);
        let (from, to) = (Some(Instant::from_millis(9_900)), Some(Instant::from_millis(30_000)));
        let words = String::new();
        let gap = Gap { from, to, cause: Cause::NotKept, place: None, bytes: 0, words };
        judge.item(Instant::from_millis(30_000), Item::Gap(&gap));
        fly(&mut judge, 30, 40, 10, 0.1);
        let found = found(&judge.end());
        let [(check, Level::Warning, at)] = found.as_slice() else { panic!("{found:?}") };
        assert_eq!(check, "batt_remaining");
        assert!((32.0..33.2).contains(at), "{at}");
    }

    #[test]
    fn what_the_board_found_counts_unless_other_limits_are_asked_for() {
        let finding = Finding {
            at: Instant::from_millis(7_000),
            subsystem: hums_core::health::Subsystem::Recorder,
            check: "card_stall".to_owned(),
            instance: 0,
            level: Level::Critical,
            previous: Level::Ok,
            value: 3000.0,
            limit: 2500.0,
            unit: "ms".to_owned(),
        };
        let spec = Param::BatRemWarn.spec();
        for (given, by, check) in
            [(vec![], JudgedBy::Board, "card_stall"), (vec![(spec, 95.0)], JudgedBy::Here, "batt_remaining")]
        {
            let mut judge = Judge::new(&Limits::new(&given), Format::Hums);
            judge.item(Instant::ZERO, Item::Record(&Told::Checked));
            let other = Told::Parameter { name: spec.name.to_owned(), value: 1.0, start: true };
            judge.item(Instant::ZERO, Item::Record(&other));
            fly(&mut judge, 0, 10, 10, 0.9);
            judge.item(Instant::from_millis(7_000), Item::Record(&Told::Finding(Box::new(finding.clone()))));
            let judged = judge.end();
            assert_eq!(judged.by, by);
            assert_eq!(
                judged.problems.iter().map(|problem| problem.check.as_str()).collect::<Vec<_>>(),
                [check]
            );
        }
    }
}
