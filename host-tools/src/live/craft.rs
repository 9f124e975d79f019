//! One vehicle: the monitor of the board, fed on this PC, and further reports.
//!
//! Small: playback keeps copies to go back to. Growing data are in [`crate::page::history`].

use std::collections::BTreeMap;
use std::sync::LazyLock;

use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::component::{COMPONENTS_MAX, Component};
use hums_core::flight::Phase;
use hums_core::happening::Happening;
use hums_core::health::exceedance::Exceedance;
use hums_core::health::{Finding, Level, Subsystem};
use hums_core::observation::{Autopilot, Observation, Source};
use hums_core::parameters::Params;
use hums_core::status::{RecorderStatus, Recording};
use hums_core::usage::UsageCounter;
use hums_link::sequence::Sequences;
use hums_link::vocabulary::{Scope, VOCABULARY};
use hums_link::{Check, Frame, observe};

use super::companion::Companion;
use crate::mavlink::ids::STATUSTEXT;
use crate::mavlink::values::Scalar;
use crate::page::history::History;
use crate::page::note::Note;
use crate::part;
use crate::reference::{Quantity, Reference};
use crate::source::parameter;
use crate::source::told;
use crate::statustext::{StatusText, Texts};

/// A HUMS on board has reported itself by then.
const SETTLE: Span = Span::from_secs(5);
/// Silent ESCs are no finding after the whole vehicle's silence of this length.
const SILENT: Span = Span::from_secs(1);
const ESC_SILENT: &str = "esc_silent";
const HEARTBEAT: &str = "heartbeat";
/// Time after the first heartbeat: flight is detected with a delay.
const JOINED: Span = Span::from_secs(5);
/// Period of the limits' update.
const LIMITS_EVERY: Span = Span::from_secs(1);

/// By check and instance.
type Findings = BTreeMap<(&'static str, u8), Finding>;

/// State of a vehicle.
#[derive(Clone, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
pub struct Craft {
    /// Vehicle, flight, health, usage.
    pub monitor: Monitor,
    /// The reference system's view of it.
    pub reference: Reference,
    /// Last values by quantity of the reference system.
    pub latest: BTreeMap<Quantity, (Instant, Scalar)>,
    /// A HUMS on board.
    pub companion: Companion,
    /// `RPM`, `RAW_RPM`: the first two sensors.
    pub speed_sensors: [Option<(Instant, f32)>; 2],
    /// Findings by check that is not well.
    pub worries: Findings,
    /// Bad, and no longer judged, until armed again or good.
    pub unjudged: Findings,
    /// Cells unknown, and the vehicle flies or will not report it.
    pub cells_unknown: bool,
    /// That was reported.
    cells_said: bool,
    /// A box recorded the autopilot's own wire: elsewhere missing frames are a fault of the link.
    pub on_the_wire: bool,
    /// It was armed when first received.
    joined: bool,
    /// Time of its autopilot's last message.
    pub heard: Instant,
    /// Frames, and those missing by their own count.
    pub frames: u64,
    /// See [`Self::frames`].
    pub missing: u64,
    /// Lost part in the last ten seconds.
    pub loss: Option<f32>,
    texts: Texts,
    sequences: Sequences,
    began: Instant,
    limits_at: Option<Instant>,
    /// Air data in an inertial message are then another sensor's.
    barometer: bool,
    /// Parts with known hours before this session.
    lives: [bool; COMPONENTS_MAX],
    /// Seconds by usage: on the ground last, and before the last flight.
    grounded_s: f64,
    before_flight_s: f64,
}

impl Craft {
    /// A vehicle whose autopilot was just received for the first time.
    pub fn new(at: Instant, params: &Params, on_the_wire: bool) -> Self {
        Self {
            monitor: Monitor::new(*params),
            reference: Reference::default(),
            latest: BTreeMap::new(),
            companion: Companion::default(),
            speed_sensors: [None; 2],
            worries: BTreeMap::new(),
            unjudged: BTreeMap::new(),
            cells_unknown: false,
            cells_said: false,
            on_the_wire,
            joined: false,
            heard: at,
            frames: 0,
            missing: 0,
            loss: None,
            texts: Texts::default(),
            sequences: Sequences::new(),
            began: at,
            limits_at: None,
            barometer: false,
            lives: [false; COMPONENTS_MAX],
            grounded_s: 0.0,
            before_flight_s: 0.0,
        }
    }

    /// Seconds, by usage; the flight may go on.
    pub fn flown_s(&self) -> f64 {
        self.airborne_s() - self.before_flight_s
    }

    fn airborne_s(&self) -> f64 {
        self.monitor.usage().value(UsageCounter::Flight).unwrap_or(0.0)
    }

    /// A part with all its hours, from a log.
    pub fn learn_part(&mut self, place: usize, part: Component) {
        self.monitor.learn_component(place, part);
        if let Some(known) = self.lives.get_mut(place) {
            *known = true;
        }
    }

    /// Hours of its whole life are known.
    pub fn knows_life(&self, place: usize) -> bool {
        self.lives.get(place).copied().unwrap_or(false)
    }

    /// Takes a frame of its system.
    pub fn frame(&mut self, at: Instant, frame: &Frame<'_>, history: &mut Option<&mut History>) {
        self.frames += 1;
        let lost = self.sequences.frame(at, frame);
        if Some(frame.source()) == self.counted(at) {
            self.missing += u64::from(lost);
        }
        let before = self.companion.known();
        self.companion.frame(at, frame);
        if !before && self.companion.known() {
            // It left out the frames missing so far.
            self.missing = 0;
        }
        if frame.id() == STATUSTEXT && frame.check() == Check::Verified {
            let source = Source { system: frame.system(), component: frame.component() };
            let text = StatusText::of(at, source, frame.payload());
            self.texts.take(text, &mut |text| say(history, text));
        }
        if let Some((source, observation)) = observe(frame) {
            self.observe(at, source, &observation, history);
        }
        if let Some(history) = history {
            history.frame(at, frame, self.monitor.vehicle().source);
        }
        self.parameter(at, frame, history);
    }

    /// Missing from the recording: sequence numbers start again.
    pub fn miss(&mut self, frames: u64) {
        self.missing = self.missing.saturating_add(frames);
        self.sequences = Sequences::new();
    }

    /// A reported parameter.
    pub fn parameter(&self, at: Instant, frame: &Frame<'_>, history: &mut Option<&mut History>) {
        if let Some(history) = history
            && let Some((name, value)) = parameter(frame, self.autopilot())
        {
            history.parameter(at, &name, value);
        }
    }

    fn autopilot(&self) -> Autopilot {
        self.monitor.vehicle().heartbeat.get().map_or(Autopilot::Other, |heartbeat| heartbeat.autopilot)
    }

    /// A text of the vehicle.
    pub fn text(&mut self, text: StatusText, history: &mut Option<&mut History>) {
        self.texts.take(text, &mut |text| say(history, text));
    }

    /// An observation of the vehicle.
    pub fn observe(
        &mut self,
        at: Instant,
        source: Source,
        observation: &Observation,
        history: &mut Option<&mut History>,
    ) {
        if !self.monitor.observe(at.into(), source, observation)
            || !self.reference.observe(at, source, observation)
        {
            return;
        }
        self.heard = at;
        if let Observation::Heartbeat(heartbeat) = observation {
            self.joined |= heartbeat.armed && at == self.began;
        }
        self.barometer |= matches!(observation, Observation::Air(_));
        let other = self.barometer && matches!(observation, Observation::ImuAndAir(..));
        for (_, quantities) in self.reference.told_by(observation) {
            let of_air = |quantity: &Quantity| matches!(quantity, Quantity::Temperature | Quantity::Pressure);
            for quantity in quantities.into_iter().filter(|quantity| !(other && of_air(quantity))) {
                if let Some(value) = self.reference.value(at, quantity) {
                    self.latest.insert(quantity, (at, value));
                }
            }
        }
        if let Observation::SpeedSensors(sensors) = observation {
            for sensor in sensors.iter().flatten() {
                if let Some(slot) = self.speed_sensors.get_mut(usize::from(sensor.index)) {
                    *slot = Some((at, sensor.rpm.0));
                }
            }
        }
        if let Some(history) = history {
            history.sample(at, &self.reference, observation);
            history.phase(at, self.monitor.flight(), self.phase(at));
            if let Observation::Vibration(_) = observation {
                history.vibration_limit(at, self.monitor.vibration_limit());
            }
        }
    }

    /// Observations of other components that are the vehicle's: a battery's, an ESC's.
    pub fn told_by_part(&self, source: Source, observation: &Observation) -> bool {
        let part = observation.may_be_of_another_component()
            && !matches!(observation, Observation::TelemetryRadio(_));
        part && self.monitor.vehicle().source.is_some_and(|vehicle| vehicle.system == source.system)
    }

    /// The component whose sequence numbers show the link's losses, known after seconds. A HUMS on board thins out
    /// forwarded frames: its own numbers count.
    fn counted(&self, now: Instant) -> Option<Source> {
        let autopilot = self.monitor.vehicle().source?;
        if self.companion.known() {
            return Some(Source { component: hums_link::encode::COMPONENT, ..autopilot });
        }
        (now.since(self.began) >= SETTLE).then_some(autopilot)
    }

    /// A step of time, every [`hums_core::monitor::TICK`].
    pub fn tick(
        &mut self,
        now: Instant,
        history: &mut Option<&mut History>,
        findings: &mut impl FnMut(&Finding),
    ) {
        let link = self.sequences.reading(now, self.counted(now));
        self.loss = link.frames_lost;
        // The box reports the recording's state.
        let recorder = RecorderStatus { recording: Recording::Running, ..RecorderStatus::default() };
        // A HUMS forwards what the radio carries: a slow stream is no fault.
        let thin = self.companion.present(now);
        let cut_off = now.since(self.heard) >= SILENT;
        let Self { monitor, worries, unjudged, on_the_wire, .. } = self;
        let mut found = Vec::new();
        monitor.tick(now.into(), &link, &recorder, &mut |finding| {
            let silence = finding.level == Level::Stale
                || (finding.level == Level::Ok && finding.previous == Level::Stale);
            if finding.subsystem == Subsystem::Recorder
                || (thin && silence)
                || (!*on_the_wire && is_of_wire(finding.check))
            {
                return;
            }
            if cut_off && finding.check == ESC_SILENT {
                return;
            }
            let key = (finding.check, finding.instance);
            // Unseen during a silence.
            if cut_off && finding.level == Level::Ok {
                unjudged.extend(worries.remove(&key).map(|before| (key, before)));
                return;
            }
            // A silent link is one fault, of the link.
            let echo = match finding.level {
                Level::Stale => finding.because == HEARTBEAT,
                _ => silence && !worries.contains_key(&key),
            };
            if !*on_the_wire && echo {
                return;
            }
            judge(worries, unjudged, *finding);
            found.push(*finding);
            findings(finding);
        });
        for finding in found {
            let mut peaks = self.monitor.exceedances().iter(now.into());
            let is_it = |of: &Exceedance| (of.check.name, of.instance) == (finding.check, finding.instance);
            let worst = peaks.find(is_it).map(|of| of.session.peak);
            let note = Note::finding(now, &finding, worst).of_part(self.due(&finding).as_ref());
            keep(history, now, note);
        }
        self.happenings(now, history);
        self.texts.pass(now, &mut |text| say(history, text));
        if let Some(history) = history {
            history.pass(now);
        }
        if self.limits_at.is_none_or(|at| now.since(at) >= LIMITS_EVERY) {
            self.limits_at = Some(now);
            if let Some(history) = history {
                history.judged_by(self.monitor.params(), self.monitor.cell_count());
            }
        }
    }

    fn happenings(&mut self, now: Instant, history: &mut Option<&mut History>) {
        let mut cells_come = self.cells_said;
        while let Some(happening) = self.monitor.take_happening() {
            let joined = self.joined && now.since(self.began) <= JOINED;
            if matches!(happening, Happening::TakeOff | Happening::FlightResumed) {
                self.before_flight_s = self.grounded_s;
            }
            if happening == Happening::CellsUnknown {
                cells_come = true;
                continue;
            }
            if happening == Happening::Armed {
                self.unjudged.clear();
            }
            if let Some(note) = Note::event(now, happening, joined) {
                keep(history, now, note);
            }
        }
        if !self.monitor.flight().airborne() {
            self.grounded_s = self.airborne_s();
        }
        // A box reports unknown counts itself.
        if !self.on_the_wire {
            let flies = self.monitor.flight().airborne();
            self.cells_unknown = self.monitor.lacks_cells() && (flies || cells_come);
            if self.cells_unknown {
                self.say_cells_unknown(now, history);
            }
        }
    }

    /// Unknown cells, once.
    pub fn say_cells_unknown(&mut self, now: Instant, history: &mut Option<&mut History>) {
        self.cells_unknown = true;
        if !std::mem::replace(&mut self.cells_said, true)
            && let Some(note) = Note::event(now, Happening::CellsUnknown, false)
        {
            keep(history, now, note);
        }
    }

    /// The due part and its limit; `None` for another check.
    pub fn due(&self, finding: &Finding) -> Option<(String, Option<String>)> {
        part::is_due(finding.check).then(|| part::due(&self.monitor, finding.subsystem)).flatten()
    }

    /// This check of a part had something to judge.
    pub fn judges(&self, check: &str, instance: u8) -> bool {
        self.monitor.health().levels().any(|(known, of, _)| known.name == check && of == instance)
    }

    /// A box's finding that no check here can make: from its store or its cell count.
    pub fn found_on_board(&mut self, finding: &told::Finding) -> bool {
        let Some(finding) = finding.of_box() else { return false };
        let is_new = !self.judges(finding.check, finding.instance);
        if is_new {
            judge(&mut self.worries, &mut self.unjudged, finding);
        }
        is_new
    }

    /// Its phase of flight.
    pub fn phase(&self, now: Instant) -> Phase {
        self.monitor.flight().phase(now.into(), self.monitor.vehicle())
    }
}

fn judge(worries: &mut Findings, unjudged: &mut Findings, finding: Finding) {
    let key = (finding.check, finding.instance);
    unjudged.remove(&key);
    let before = worries.remove(&key);
    if finding.level != Level::Ok {
        worries.insert(key, finding);
    } else if finding.value.is_nan() {
        unjudged.extend(before.map(|before| (key, before)));
    }
}

/// Whether a check is about the autopilot's own wire.
pub fn is_of_wire(check: &str) -> bool {
    static WIRE: LazyLock<Vec<&str>> = LazyLock::new(|| {
        let of_wire = VOCABULARY.iter().filter(|words| words.scope == Scope::Wire);
        of_wire.map(|words| words.said.check).collect()
    });
    WIRE.contains(&check)
}

fn keep(history: &mut Option<&mut History>, at: Instant, note: Note) {
    if let Some(history) = history {
        history.note(at, note);
    }
}

fn say(history: &mut Option<&mut History>, text: StatusText) {
    keep(history, text.at, Note::text(text));
}
