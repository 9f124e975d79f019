//! The board's monitor over a recording, stepped every 50 ms of its time.
//!
//! So debounce and staleness follow the clock. The rest of a silence after `SILENCE_MAX` changes nothing, and is left out. A
//! gap is not a silence: the monitor's time stops (`super::clock`).

use std::collections::BTreeMap;

use hums_blackbox::Record;
use hums_blackbox::record::Usage;
use hums_core::Monitor;
use hums_core::cause::{Alert, Cause};
use hums_core::clock::{Instant, Span};
use hums_core::flight::{Flight as FlightState, Phase};
use hums_core::happening::Happening;
use hums_core::health::Level;
use hums_core::motion::{climb_mps, ground_speed_mps, height_m};
use hums_core::observation::{Estimator, LandedState, Observation, Source, SystemStatus, VehicleKind};
use hums_core::parameters::Params;
use hums_core::status::{LinkReading, RecorderStatus};
use hums_core::usage::UsageCounter;
use hums_core::vehicle::Vehicle;
use hums_link::sequence::Sequences;
use hums_link::vocabulary::Scope;
use hums_onboard::monitoring::TICK;

use super::cells::Cells;
use super::clock::{Clock, SETTLE};
use super::coverage::{Coverage, Recording};
use super::details::{self, Details};
use super::flights::{Flight, Flights, begin_in_air, is_in_air};
use super::judged::{BoxAir, Holes, JudgedBy, Judgement};
use super::link_loss::{LinkLoss, Verdict};
use super::problem::{IMPACT, LISTED_MAX, Problems};
use super::radio::Radio;
use super::trends::{self, Episode, FlightFigures};
use crate::names::vocabulary;
pub use crate::params::Limits;
use crate::part;
use crate::source::epochs::Epochs;
use crate::source::item::{Cause as Why, Event, Fact, FactKind, Gap, Item, Text};
use crate::source::recording::Format;
use crate::source::repairs::Repairs;
use crate::source::told::{Finding, MonitorRecord};
use crate::summary::EndsInAir;

/// Longer than each debounce and stale time.
const SILENCE_MAX: Span = Span::from_secs(75);

/// Reported after three heartbeats of a link ...
const SILENT: Span = Span::from_secs(3);
/// ... and for an autopilot's log, with topics once a second.
const NOT_WRITTEN: Span = Span::from_secs(2);
/// Armed on the ground: may hide a flight.
const HIDES_FLIGHT: Span = Span::from_secs(10);
/// Flight seen after a silence: longer than a landing takes to be seen.
const SEEN: Span = Span::from_secs(3);

const DISARMED: &str = "disarmed_in_air";

/// Place of reception.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HeardAt {
    /// Checks of the wire are not judged.
    #[default]
    Somewhere,
    /// The telemetry port: silence and lost frames are the wire's.
    OnTheWire,
}

#[derive(Clone, Copy, Debug)]
struct Last {
    at: Instant,
    airborne: bool,
}

/// Its meaning is open.
#[derive(Clone, Copy, Debug)]
struct Silence {
    to: Instant,
    airborne: bool,
    gap: usize,
}

/// Item by item.
pub struct Judge {
    monitor: Box<Monitor>,
    earlier: Option<Box<Monitor>>,
    limits: Limits,
    format: Format,
    wire: Option<Sequences>,
    clock: Clock,
    first: Option<Instant>,
    last: Instant,
    /// A box also writes during a silence.
    recorded_to: Instant,
    last_heard: Option<Last>,
    silence: Option<Silence>,
    link_loss: LinkLoss,
    repairs: Repairs,
    coverage: Coverage,
    /// Here, and on board.
    here: Problems,
    board: Problems,
    checked_on_board: bool,
    cells: Cells,
    flights: Flights,
    episodes: Vec<Episode>,
    facts: BTreeMap<FactKind, String>,
    details: Details,
    epochs: Epochs,
    gaps: Vec<Gap>,
    holes: Holes,
    damages: u64,
    losses: u64,
    restarts: u64,
    /// The listed ones.
    restarted: Vec<Instant>,
    joints: Vec<Instant>,
    /// No times from here on.
    no_times: Option<Instant>,
    /// See [`Judgement::box_air`].
    box_air: Option<BoxAir>,
    radio: Option<Box<Radio>>,
}

impl Judge {
    /// Before the first item.
    pub fn new(limits: &Limits, format: Format) -> Self {
        Self {
            monitor: Box::new(Monitor::new(*limits.params())),
            earlier: None,
            limits: limits.clone(),
            format,
            wire: None,
            clock: Clock::default(),
            first: None,
            last: Instant::ZERO,
            recorded_to: Instant::ZERO,
            last_heard: None,
            silence: None,
            link_loss: LinkLoss::default(),
            repairs: Repairs::default(),
            coverage: Coverage::new(),
            here: Problems::default(),
            board: Problems::of_box(),
            checked_on_board: false,
            cells: Cells::default(),
            flights: Flights::default(),
            episodes: Vec::new(),
            facts: BTreeMap::new(),
            details: Details::default(),
            epochs: Epochs::default(),
            gaps: Vec::new(),
            holes: Holes::default(),
            damages: 0,
            losses: 0,
            restarts: 0,
            restarted: Vec::new(),
            joints: Vec::new(),
            no_times: None,
            box_air: None,
            radio: None,
        }
    }

    /// Also selects the texts to the pilot: [`Judgement::told`].
    #[must_use]
    pub fn telling(self) -> Self {
        let radio = Some(Box::new(Radio::new(self.limits.params())));
        Self { radio, ..self }
    }

    /// Received at this place.
    #[must_use]
    pub fn heard(self, heard: HeardAt) -> Self {
        Self { wire: (heard == HeardAt::OnTheWire).then(Sequences::new), ..self }
    }

    /// Flight from 0, as in [`Judgement::flights`].
    pub fn flight(&self) -> Option<usize> {
        self.flights.going_on()
    }

    /// Flight state and phase at the last item.
    pub fn phase(&self) -> (&FlightState, Phase) {
        let flight = self.monitor.flight();
        (flight, flight.phase(self.clock.now().into(), self.monitor.vehicle()))
    }

    /// The limits that hold now.
    pub fn params(&self) -> &Params {
        self.monitor.params()
    }

    /// Risen from here on.
    pub fn vibration_limit(&self) -> Option<f32> {
        self.monitor.vibration_limit()
    }

    /// Cell count of the single battery; 0 if unknown.
    pub fn cell_count(&self) -> u8 {
        self.monitor.cell_count()
    }

    /// Takes the next item.
    pub fn item(&mut self, at: Instant, item: Item<'_>) {
        self.epochs.take(at, &item);
        match item {
            Item::Observation(source, observation) => {
                let observation = &self.repairs.mend(at, source, observation);
                if self.is_vehicle(source) {
                    self.hear(at);
                }
                self.advance(at);
                match observation {
                    Observation::SystemStatus(status) => self.sensors(source, status),
                    Observation::Estimator(estimator) => self.doubts(source, estimator),
                    Observation::Gnss(gnss) if self.is_vehicle(source) => self.details.gnss(at, gnss),
                    Observation::Battery(battery) => self.details.battery(source, battery.id),
                    Observation::Heartbeat(heartbeat) => self.details.heartbeat(source, heartbeat),
                    Observation::Identity(identity) => self.details.identity(source, identity),
                    _ => {}
                }
                let steps = self.clock.monitor(at).into();
                if self.monitor.observe(steps, source, observation) {
                    self.link_loss.observe(steps, observation, self.monitor.vehicle());
                }
            }
            Item::Fact(Fact { about: FactKind::Failsafes, words }) => {
                self.details.failsafes(words);
                self.tell(details::FAILSAFE);
            }
            Item::Fact(Fact { about: about @ (FactKind::Emergency | FactKind::ProcessorFault), words }) => {
                self.reported(at, about, words);
            }
            Item::Fact(fact) => {
                self.facts.insert(fact.about, fact.words.to_owned());
            }
            Item::Record(record) => self.record(at, record),
            Item::Gap(gap) => self.gap(gap),
            Item::Restart => self.restart(at),
            Item::Joint => self.joint(at),
            Item::Frame(frame) if self.wire.is_some() => {
                self.advance(at);
                let at = self.clock.monitor(at);
                if let Some(wire) = &mut self.wire {
                    wire.frame(at, frame);
                }
            }
            Item::Parameter(parameter) => {
                self.monitor.learn_parameter(parameter.name, parameter.value as f32);
            }
            Item::Text(Text { source, words, alert: Some(alert), .. }) => {
                self.said(at, source, alert, format!("\"{words}\""));
            }
            Item::Event(Event { source, number, words, alert: Some(alert), .. }) => {
                let words = if words.is_empty() { format!("event {number}") } else { words.to_owned() };
                self.said(at, source, alert, words);
            }
            Item::Epoch(_)
            | Item::Text(_)
            | Item::Event(_)
            | Item::Frame(_)
            | Item::Mode(_)
            | Item::Row(_) => {}
        }
    }

    /// Perhaps after an unreported silence. A HUMS log's wire has its own check, unless packed on a PC.
    fn hear(&mut self, at: Instant) {
        let (armed, airborne) = (self.monitor.vehicle().armed(), self.monitor.flight().airborne());
        let before = self.last_heard.replace(Last { at, airborne });
        let is_told = match self.format {
            Format::DataFlash => true,
            Format::Hums => self.checked_on_board,
            Format::Ulog | Format::Tlog | Format::Raw => false,
        };
        let Some(Last { at: last, airborne }) = before.filter(|_| !is_told && self.wire.is_none()) else {
            return;
        };
        let from = last.max(self.clock.gap_end());
        let length = at.since(from);
        let is_own = self.format == Format::Ulog;
        if !(armed || airborne) || length < if is_own { NOT_WRITTEN } else { SILENT } {
            return;
        }
        let seconds = length.as_secs_f32();
        let how = if airborne { "in the air" } else { "while armed" };
        let words = format!(
            "the recording says nothing of the vehicle for {seconds:.1} s {how}: what happened then is not known"
        );
        let (to, cause) = (Some(at), Why::Lost);
        let gap = Gap { from: Some(from), to, cause, place: None, bytes: 0, words, own: None };
        if is_own {
            // The logger paused.
            self.gap(&gap);
        } else {
            self.holes.silence(from, at);
            let place = self.list(&gap);
            self.doubt(place, at, airborne, length);
        }
    }

    fn doubt(&mut self, gap: Option<usize>, to: Instant, airborne: bool, length: Span) {
        self.settle();
        let hides =
            airborne || (length >= HIDES_FLIGHT && self.monitor.vehicle().kind() != VehicleKind::Surface);
        if let Some(gap) = gap.filter(|_| hides) {
            self.flights.silent(true);
            self.silence = Some(Silence { to, airborne, gap });
        }
    }

    fn settle(&mut self) {
        let Some(Silence { airborne, gap, .. }) = self.silence.take() else { return };
        // A disarmed vehicle that may fall, or one on-ground, does not fly.
        let vehicle = self.monitor.vehicle();
        let flies = vehicle.armed()
            && vehicle.landed.get() != Some(&LandedState::OnGround)
            && !self.monitor.flight().is_watched();
        if airborne && flies && self.monitor.flight().airborne() {
            self.flights.silent(false);
        } else if let Some(gap) = self.gaps.get_mut(gap).filter(|gap| !gap.cause.is_damage()) {
            self.losses = self.losses.saturating_sub(u64::from(gap.cause == Why::Lost));
            self.damages += 1;
            gap.cause = Why::Silent;
        }
    }

    fn system(&self) -> Option<u8> {
        self.monitor.vehicle().source.map(|source| source.system)
    }

    fn is_vehicle(&self, source: Source) -> bool {
        self.monitor.vehicle().source == Some(source)
    }

    fn sensors(&mut self, source: Source, status: &SystemStatus) {
        if self.is_vehicle(source) && self.details.sensors(status) {
            for cause in Cause::ALL {
                self.tell(cause.name());
            }
        }
    }

    fn doubts(&mut self, source: Source, estimator: &Estimator) {
        if self.is_vehicle(source) && self.details.estimator(estimator) {
            self.tell(Cause::Gnss.name());
            self.tell(Cause::Accelerometer.name());
        }
    }

    fn said(&mut self, at: Instant, source: Source, alert: Alert, words: String) {
        if self.is_vehicle(source) && self.details.said(at, alert, words) {
            self.tell(alert.cause.name());
        }
    }

    fn tell(&mut self, check: &str) {
        self.details.tell(check, &mut self.here);
        self.details.tell(check, &mut self.board);
    }

    fn record(&mut self, at: Instant, record: &Record<'_>) {
        self.recorded_to = self.recorded_to.max(at);
        if trends::is_change(record) {
            self.episodes.push(Episode::Changed);
        }
        if let Record::Usage(usage) = record {
            self.box_counted(at, usage);
        }
        if let Some(told) = MonitorRecord::of(record) {
            self.told(&told);
        }
    }

    fn box_counted(&mut self, at: Instant, usage: &Usage<'_>) {
        let mut counters = usage.iter();
        if let Some((_, seconds)) = counters.find(|(number, _)| *number == UsageCounter::Flight.number()) {
            let last_s = f64::from(seconds);
            let first_s = self.box_air.map_or(last_s, |air| air.first_s);
            self.box_air = Some(BoxAir { first_s, last_s, at });
        }
    }

    fn told(&mut self, told: &MonitorRecord) {
        match told {
            MonitorRecord::Parameter { name, value, .. } => {
                self.limits.take(self.monitor.params_mut(), name, *value);
            }
            MonitorRecord::Finding(finding) => {
                self.checked_on_board = true;
                let at = self.hit_at(finding);
                self.board.take(&Finding { at, ..Finding::clone(finding) }, Span::ZERO);
                self.details.tell(&finding.check, &mut self.board);
            }
            MonitorRecord::Peak { check, instance, value } => self.board.peak(check, *instance, *value),
            MonitorRecord::Checked => self.checked_on_board = true,
            MonitorRecord::CellsUnknown => self.cells.told_unknown(),
            MonitorRecord::StoreNew => self.cells.nothing_stored(),
            MonitorRecord::Part { place, component } => self.monitor.learn_component(*place, *component),
            MonitorRecord::Missing { .. } => {}
        }
    }

    fn hit_at(&mut self, finding: &Finding) -> Instant {
        const LIES_STILL: Span = Span::from_secs(5);
        if !is_hit(finding) {
            return finding.at;
        }
        self.advance(finding.at);
        let steps = self.clock.monitor(finding.at);
        let hit_at = Instant::of(self.monitor.flight().hit_at(), steps);
        let is_its = hit_at > Instant::ZERO && steps.since(hit_at) <= LIES_STILL;
        if is_its { Clock::recording(finding.at, steps, hit_at).min(finding.at) } else { finding.at }
    }

    /// Another power-on in an autopilot's log or raw frames. No clock measures the time between: the flight is over. An autopilot that restarts
    /// in flight begins another log, so the same log has been joined. A box's restart, or a set clock, ends no flight.
    fn restart(&mut self, at: Instant) {
        self.restarts += 1;
        if self.restarted.len() < LISTED_MAX {
            self.restarted.push(at);
        }
        if matches!(self.format, Format::DataFlash | Format::Ulog | Format::Raw) {
            self.leave_off(at);
            if self.format == Format::Raw {
                self.monitor.begin_anew();
            } else {
                self.monitor.begin_another_recording();
            }
        }
    }

    fn leave_off(&mut self, at: Instant) {
        if self.first.is_some() {
            self.advance(self.last);
        }
        self.settle();
        self.last_heard = None;
        self.flights.end_of_recording(&self.monitor);
        self.clock.skip_to(at + SETTLE);
    }

    fn joint(&mut self, at: Instant) {
        self.leave_off(at);
        self.here.break_off(self.last, self.clock.behind());
        if self.monitor.vehicle().source.is_some() {
            self.earlier = Some(self.monitor.clone());
        }
        self.distrust_disarming();
        self.facts.clear();
        self.details.begin_another(self.system());
        self.restarts += 1;
        if self.joints.len() < LISTED_MAX {
            self.joints.push(at);
        }
        self.repairs = Repairs::default();
        self.monitor.begin_another_recording();
    }

    /// An end at its report: motors stop, or the processor restarts.
    fn reported(&mut self, at: Instant, about: FactKind, words: &str) {
        let is_emergency = about == FactKind::Emergency;
        let what = if is_emergency { details::EMERGENCY } else { details::PROCESSOR_FAULT };
        self.advance(at);
        if self.here.is_open(what.0) {
            self.here.detail(what.0, words);
            return;
        }
        for finding in details::reported(at, what, self.monitor.params()) {
            self.here.take(&finding, self.clock.behind());
            self.here.detail(what.0, words);
        }
    }

    fn gap(&mut self, gap: &Gap) {
        // Begins before the last observation: a count over the recording.
        if let (Some(from), Some(to)) = (gap.from.filter(|from| *from >= self.last), gap.to)
            && self.first.is_some()
        {
            self.advance(from);
            let (airborne, length) = (self.monitor.flight().airborne(), to.since(from));
            if to.since(from) >= SETTLE {
                // A landing or disarming counts.
                self.tick(from);
            }
            self.clock.pause(from, to);
            if gap.cause == Why::Lost {
                self.link_loss.lose(length.into(), &self.monitor, self.here.is_in_mishap());
            }
            self.holes.pause(from, to);
            let place = self.list(gap);
            if gap.cause == Why::Lost && airborne && length >= NOT_WRITTEN {
                self.doubt(place, to, airborne, length);
            }
            return;
        }
        self.list(gap);
    }

    fn list(&mut self, gap: &Gap) -> Option<usize> {
        self.damages += u64::from(gap.cause.is_damage());
        self.losses += u64::from(gap.cause == Why::Lost);
        if gap.cause == Why::NoTimes {
            self.no_times.get_or_insert(gap.from.unwrap_or(Instant::ZERO));
        }
        let place = Some(self.gaps.len()).filter(|place| *place < LISTED_MAX)?;
        self.gaps.push(gap.clone());
        Some(place)
    }

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
        if self.silence.is_some_and(|silence| now >= silence.to + SEEN) {
            self.settle();
        }
        let steps = self.clock.monitor(now);
        let of = |at| Instant::of(at, steps);
        let (link, recorder) = (self.link(steps), RecorderStatus::default());
        let mut found = Vec::new();
        let (format, on_the_wire) = (self.format, self.wire.is_some());
        self.monitor.tick(steps.into(), &link, &recorder, &mut |finding| {
            if is_of(finding.check, format, on_the_wire) {
                if let Some(radio) = &mut self.radio {
                    radio.finding(steps, Clock::recording(now, steps, of(finding.at)), finding);
                }
                found.push(Finding::new(steps, finding));
            }
        });
        if let Some(radio) = &mut self.radio {
            radio.tick(steps, now, &self.monitor);
        }
        for finding in found {
            // Seen seconds after an impact.
            let hit_at = if is_hit(&finding) { of(self.monitor.flight().hit_at()) } else { finding.at };
            let at = Clock::recording(now, steps, hit_at.min(finding.at));
            self.here.take(&Finding { at, ..finding.clone() }, self.clock.behind());
            self.details.tell(&finding.check, &mut self.here);
        }
        while let Some(happening) = self.monitor.take_happening() {
            match happening {
                Happening::TakeOff | Happening::FlightResumed => {
                    let since = self.monitor.flight().airborne_since();
                    let from = since.map_or(now, |since| Clock::recording(now, steps, of(since)));
                    self.flights.take_off(now, from, self.monitor.flight().was_on_ground());
                }
                Happening::Landing => {
                    self.flights.landing();
                    self.episodes.push(Episode::Flown(Box::new(FlightFigures::of(now, true, &self.monitor))));
                }
                Happening::OtherVehicle => {
                    self.flights.break_off();
                    self.episodes.clear();
                }
                Happening::Mishap(change) => {
                    let hit_at = self.monitor.flight().struck_at();
                    let hit_at = hit_at.map(|at| Clock::recording(now, steps, of(at)));
                    self.flights.mishap(change, now, hit_at, &self.monitor);
                }
                _ => {}
            }
        }
        if let Some((level, verdict)) =
            self.link_loss.step(steps.into(), &self.monitor, self.here.is_in_mishap())
        {
            self.came_down(now, steps, level, verdict);
        }
        if self.monitor.flight().airborne() && self.monitor.lacks_cells() {
            self.cells.lack(now);
        }
        let heard_at = self.monitor.vehicle().heartbeat.at();
        self.flights.step(now, steps, steps.since(heard_at.map_or(steps, of)), &self.monitor);
        self.coverage.note(now, steps, &self.monitor, &link, &recorder);
    }

    fn came_down(&mut self, now: Instant, steps: Instant, level: Level, verdict: Verdict) {
        let recording = |at| Clock::recording(now, steps, Instant::of(at, steps));
        let (at, from) = (recording(verdict.at), verdict.from.map(recording));
        let Some(finding) = verdict.finding(at, level, self.monitor.params()) else { return };
        for problems in [&mut self.here, &mut self.board] {
            problems.take(&finding, self.clock.behind());
            if let Some(from) = from.filter(|_| is_hit(&finding)) {
                problems.unheard(verdict.check, from, at);
            }
        }
        if let Some(from) = from.filter(|_| level == Level::Critical) {
            self.flights.came_down(at, verdict.check == IMPACT, from);
        }
    }

    fn link(&mut self, steps: Instant) -> LinkReading {
        let source = self.monitor.vehicle().source;
        self.wire.as_mut().map_or_else(LinkReading::default, |wire| wire.reading(steps, source))
    }

    /// Guessed arming: a closed throttle does not disarm.
    fn distrust_disarming(&mut self) {
        if self.facts.get(&FactKind::Arming).is_some_and(|words| !words.is_empty()) {
            self.here.drop_checks(|check| check == DISARMED);
            self.flights.forget_disarming();
        }
    }

    fn peaks(&mut self, at: Instant) {
        let steps = self.clock.monitor(at);
        for exceedance in self.monitor.exceedances().iter(steps.into()) {
            for problems in [&mut self.here, &mut self.board] {
                problems.peak(exceedance.check.name, exceedance.instance, exceedance.session.peak);
            }
        }
    }

    fn parts_due(&mut self) {
        for problems in [&mut self.here, &mut self.board] {
            problems.name_parts(|subsystem| part::due(&self.monitor, subsystem));
        }
    }

    fn ends_in_air(&mut self) -> Option<EndsInAir> {
        self.flights.going_on().filter(|_| is_in_air(&self.monitor))?;
        let steps = self.clock.monitor(self.last).into();
        let vehicle = self.monitor.vehicle();
        Some(EndsInAir {
            at: self.last,
            height_m: height_m(steps, vehicle),
            climb_mps: climb_mps(steps, vehicle),
            speed_mps: ground_speed_mps(steps, vehicle),
            place_deg: place_deg(vehicle),
        })
    }

    /// Sentences.
    fn remarks(&mut self, by: JudgedBy, flights: &[Flight]) -> Vec<String> {
        let (of_cells, of_vehicles) =
            (self.cells.words(by, begin_in_air(flights)), self.details.remarks(self.system()));
        let of_file = [FactKind::Beginning, FactKind::Unchecked].map(|about| self.facts.remove(&about));
        let remarks = joined(&self.joints).into_iter().chain(of_cells).chain(of_vehicles);
        remarks.chain(of_file.into_iter().flatten()).collect()
    }

    /// A landing or disarming counts.
    fn step_to_end(&mut self) {
        if self.first.is_some() {
            self.advance(self.last);
            if self.flights.going_on().is_some() {
                self.tick(self.last);
            }
            if self.monitor.flight().is_open() {
                self.episodes.push(Episode::Flown(Box::new(FlightFigures::of(
                    self.last,
                    false,
                    &self.monitor,
                ))));
            }
        }
    }

    /// Ends the judging.
    pub fn end(mut self) -> Judgement {
        self.step_to_end();
        self.settle();
        let ends_in_air = self.ends_in_air();
        self.distrust_disarming();
        if self.monitor.vehicle().source.is_none()
            && let Some(earlier) = self.earlier.take()
        {
            self.monitor = earlier;
        }
        self.peaks(self.last);
        self.parts_due();
        let mut flights = std::mem::take(&mut self.flights).end(&self.monitor);
        let armed = armed(&self.monitor);
        let by =
            if self.checked_on_board && !self.limits.are_given() { JudgedBy::Board } else { JudgedBy::Here };
        if !self.checked_on_board && self.wire.is_none() {
            // A packed recording may be a ground station's.
            self.here.drop_checks(|check| vocabulary(check).is_some_and(|words| words.scope == Scope::Wire));
        }
        if by == JudgedBy::Board {
            for flight in &mut flights {
                flight.was_hit(self.board.findings.iter().filter(|finding| is_hit(finding)));
            }
        }
        let remarks = self.remarks(by, &flights);
        let (mut problems, end, behind) = match by {
            JudgedBy::Board => (self.board, self.last.max(self.recorded_to), Span::ZERO),
            JudgedBy::Here => (self.here, self.last, self.clock.behind()),
        };
        problems.end(end, behind);
        let (findings_count, findings, worst_first) = problems.all();
        let (judged, not_judged) = self.coverage.lists(&Recording {
            by,
            monitor: &self.monitor,
            is_of_link: self.format.is_of_link(),
            on_the_wire: self.wire.is_some(),
            armed,
            arming: self.facts.get(&FactKind::Arming).map(String::as_str).filter(|words| !words.is_empty()),
            flew: !flights.is_empty(),
            cells_unknown: self.cells.are_unknown(by),
            problems: &worst_first,
        });
        let judged = Judgement {
            by,
            monitor: self.monitor,
            facts: self.facts,
            epochs: self.epochs,
            span: self.first.map(|first| (first, self.last)),
            armed,
            flights,
            box_air: self.box_air,
            told: self.radio.map_or_else(Vec::new, |radio| radio.end()),
            ends_in_air,
            findings_count,
            findings,
            problems: worst_first,
            judged,
            not_judged,
            episodes: self.episodes,
            systems: self.details.systems(),
            remarks,
            cells_unknown: self.cells.unknown_since(by),
            gaps: self.gaps,
            holes: self.holes,
            damages: self.damages,
            losses: self.losses,
            restarts: self.restarts,
            is_timeless: false,
        };
        judged.what_is_known(self.no_times, &self.joints, &self.restarted)
    }
}

fn place_deg(vehicle: &Vehicle) -> Option<(f64, f64)> {
    let estimated = vehicle.global.get().and_then(|global| global.position);
    let received = || vehicle.gnss.first()?.get()?.position;
    estimated.or_else(received).map(|position| (position.latitude_deg, position.longitude_deg))
}

fn armed(monitor: &Monitor) -> Span {
    let mut seconds = 0.0;
    monitor.for_each_counter(|number, value| {
        if number == UsageCounter::Armed.number() {
            seconds = value;
        }
    });
    // Not exact.
    Span::from_millis((seconds * 100.0).round() as u64 * 10)
}

/// A sentence.
fn joined(joints: &[Instant]) -> Option<String> {
    const NAMED: usize = 3;
    let named: Vec<String> =
        joints.iter().take(NAMED).map(|at| format!("{:.1} s", at.as_secs_f64())).collect();
    let more = if joints.len() > NAMED { " and later" } else { "" };
    (!joints.is_empty()).then(|| {
        format!(
            "the file is {} recordings, joined at {}{more}: each is judged by itself",
            joints.len() + 1,
            named.join(", ")
        )
    })
}

fn is_hit(finding: &Finding) -> bool {
    finding.check == IMPACT && matches!(finding.level, Level::Warning | Level::Critical)
}

/// One recording shows neither earlier flights nor worn parts.
fn is_of(check: &str, format: Format, on_the_wire: bool) -> bool {
    let scope = vocabulary(check).map(|words| words.scope);
    !matches!(scope, Some(Scope::Recorder | Scope::Stored))
        && (format == Format::Hums || on_the_wire || scope != Some(Scope::Wire))
}

#[cfg(test)]
mod tests;
