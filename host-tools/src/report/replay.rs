//! A log read in order: what the vehicle told becomes series, flights, phases and a track.

use anyhow::Result;
use hums_blackbox::{Entry, Gap};
use hums_core::flight::{Phase, ground_speed_mps};
use hums_core::observation::{Autopilot, Esc, Observation, Source};
use hums_core::time::{Instant, Span};
use hums_core::units::Position;
use hums_link::{Check, Frame, observe};
use serde::Serialize;

use super::series::{Key, Store};
use crate::decode::influx::Observed;
use crate::decode::reference::Reference;
use crate::logs::Log;
use crate::logs::reader::{Collect, Deliver, read};
use crate::mavlink::values::{Payload, Value};

/// Kept one by one at most.
const FLIGHTS_MAX: usize = 500;
const PHASES_MAX: usize = 2_000;
const TEXTS_MAX: usize = 1_000;
const TRACK_MAX: usize = 4_096;
/// A phase that lasts less is part of the one before.
const PHASE_MIN: Span = Span::from_secs(2);
/// `STATUSTEXT`
const STATUSTEXT: u32 = 253;

/// The plots, in the order of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the names say it; `PLOTS` has title and unit of each")]
pub enum Plot {
    Height,
    Speed,
    Vertical,
    Attitude,
    PackVolts,
    CellVolts,
    PackAmperes,
    PackPercent,
    MotorRpm,
    MotorAmperes,
    MotorVolts,
    MotorCelsius,
    EscErrors,
    SpeedSensors,
    Engine,
    Vibration,
    Clips,
    Estimator,
    Satellites,
    Dilution,
    Link,
    Frames,
    Temperature,
    Load,
}

/// What a log told, sampled.
#[derive(Debug, Default)]
pub struct Replay {
    /// The series.
    pub store: Store,
    /// Who speaks, as far as scales depend on it.
    pub autopilot: Autopilot,
    /// The flights.
    pub flights: Vec<Flight>,
    /// The phases.
    pub phases: Vec<PhaseSpan>,
    /// Where it was, in order.
    pub track: Vec<TrackPoint>,
    /// What the vehicle said in words.
    pub texts: Vec<Text>,
    /// How many there were.
    pub texts_count: u64,
    reference: Reference,
    link: Link,
    track_every: Span,
    text: Option<Text>,
}

/// One flight: from take-off to landing, or to the end of the log.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Flight {
    from_s: f64,
    to_s: f64,
    landed: bool,
    height_max_m: f32,
    speed_max_m_s: f32,
    percent_from: Option<f32>,
    percent_to: Option<f32>,
}

/// A time in one phase.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PhaseSpan {
    phase: &'static str,
    from_s: f64,
    to_s: f64,
}

/// A place at a time.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct TrackPoint {
    at_s: f64,
    latitude: f64,
    longitude: f64,
    height_m: Option<f32>,
}

/// Words of the vehicle.
#[derive(Clone, Debug, Serialize)]
pub struct Text {
    at_s: f64,
    severity: u8,
    #[serde(rename = "text")]
    words: String,
    /// Of a text in several parts.
    #[serde(skip)]
    id: u64,
}

/// How many frames came in a second, and how many of the vehicle's are missing by its own count.
#[derive(Debug, Default)]
struct Link {
    second: Option<u64>,
    received: u32,
    missing: u32,
    last: Option<u8>,
}

impl Replay {
    /// Reads a log.
    pub fn of(log: &Log) -> Result<Self> {
        let mut replay = Self { track_every: Span::from_millis(100), ..Self::default() };
        read(log, Told::default, &mut replay, |_| ())?;
        let end = replay.reference.heard();
        if let Some(text) = replay.text.take() {
            replay.keep_text(text);
        }
        if let Some(end) = end {
            replay.extend_phase(end);
            if replay.reference.flight().airborne() {
                replay.extend_flight(end, false);
            }
        }
        Ok(replay)
    }

    fn observe(&mut self, observed: &Observed) {
        let Observed { at, source, observation } = *observed;
        let airborne = self.reference.flight().airborne();
        if !self.reference.observe(at, source, &observation) {
            return;
        }
        if let Observation::Heartbeat(heartbeat) = observation {
            self.autopilot = heartbeat.autopilot;
        }
        self.sample(at, source, &observation);
        match (airborne, self.reference.flight().airborne_since()) {
            (false, Some(since)) if self.flights.len() < FLIGHTS_MAX => self.begin_flight(since, at),
            (true, None) => self.extend_flight(at, true),
            (true, Some(_)) => self.extend_flight(at, false),
            _ => {}
        }
        self.extend_phase(at);
    }

    fn percent(&self, at: Instant) -> Option<f32> {
        let value = self.reference.value(at, crate::decode::reference::Quantity::BatteryPercent)?;
        Some(value.as_f64() as f32)
    }

    fn begin_flight(&mut self, since: Instant, at: Instant) {
        self.flights.push(Flight {
            from_s: since.as_secs_f64(),
            to_s: at.as_secs_f64(),
            landed: false,
            height_max_m: 0.0,
            speed_max_m_s: 0.0,
            percent_from: self.percent(at),
            percent_to: None,
        });
    }

    fn extend_flight(&mut self, at: Instant, landed: bool) {
        let vehicle = self.reference.vehicle();
        let height_m = vehicle.global.get().map(|global| global.relative_altitude.0);
        let speed = ground_speed_mps(at, vehicle);
        let percent = self.percent(at);
        if let Some(flight) = self.flights.last_mut().filter(|flight| !flight.landed) {
            (flight.to_s, flight.landed) = (at.as_secs_f64(), landed);
            flight.height_max_m = flight.height_max_m.max(height_m.unwrap_or(0.0));
            flight.speed_max_m_s = flight.speed_max_m_s.max(speed.unwrap_or(0.0));
            flight.percent_to = percent.or(flight.percent_to);
        }
    }

    /// The phase goes on, or another begins; one too short to matter is taken back.
    fn extend_phase(&mut self, at: Instant) {
        let phase = phase_name(self.reference.flight().phase(at, self.reference.vehicle()));
        let at_s = at.as_secs_f64();
        let full = self.phases.len() >= PHASES_MAX;
        if let Some(last) = self.phases.last_mut() {
            last.to_s = last.to_s.max(at_s);
            if last.phase == phase || full {
                return;
            }
            let short = at_s - last.from_s < f64::from(PHASE_MIN.as_secs_f32());
            if short && self.phases.len() > 1 {
                self.phases.pop();
                if let Some(before) = self.phases.last_mut() {
                    before.to_s = at_s;
                    if before.phase == phase {
                        return;
                    }
                }
            }
        }
        self.phases.push(PhaseSpan { phase, from_s: at_s, to_s: at_s });
    }

    fn sample(&mut self, at: Instant, source: Source, observation: &Observation) {
        let store = &mut self.store;
        let mut push = |plot, line: u8, value: Option<f32>| {
            if let Some(value) = value {
                store.push(at, Key { plot, line }, value);
            }
        };
        match observation {
            Observation::GlobalPosition(global) => {
                push(Plot::Height, 0, Some(global.relative_altitude.0));
                push(Plot::Vertical, 0, Some(-global.velocity[2].0));
                let [north, east, _] = global.velocity.map(|speed| speed.0);
                push(Plot::Speed, 0, Some(north.hypot(east)));
                if let Some(position) = global.position {
                    self.place(at, position, Some(global.relative_altitude.0));
                }
            }
            Observation::LocalPosition(local) if self.reference.vehicle().global.get().is_none() => {
                push(Plot::Height, 0, Some(-local.position[2].0));
                push(Plot::Vertical, 0, Some(-local.velocity[2].0));
                push(Plot::Speed, 0, Some(local.velocity[0].0.hypot(local.velocity[1].0)));
            }
            Observation::Hud(hud) => push(Plot::Speed, 1, hud.airspeed.map(|speed| speed.0)),
            Observation::Gnss(gnss) => {
                let receiver = gnss.instance;
                push(Plot::Satellites, 2 * receiver, gnss.satellites.map(f32::from));
                push(Plot::Satellites, 2 * receiver + 1, Some(f32::from(gnss.fix)));
                push(Plot::Dilution, 2 * receiver, gnss.hdop);
                push(Plot::Dilution, 2 * receiver + 1, gnss.accuracy.map(|accuracy| accuracy.0));
                if receiver == 0 {
                    push(Plot::Speed, 2, gnss.speed.map(|speed| speed.0));
                }
                let alone = receiver == 0 && self.reference.vehicle().global.get().is_none();
                if let Some(position) = gnss.position.filter(|_| alone) {
                    self.place(at, position, None);
                }
            }
            Observation::Attitude(attitude) => {
                push(Plot::Attitude, 0, Some(attitude.roll.0.to_degrees()));
                push(Plot::Attitude, 1, Some(attitude.pitch.0.to_degrees()));
            }
            Observation::Battery(battery) => {
                let place = battery.id.min(3);
                push(Plot::PackVolts, place, battery.voltage.map(|volts| volts.0));
                push(Plot::PackAmperes, place, battery.current.map(|amperes| amperes.0));
                push(Plot::PackPercent, place, battery.remaining.map(|part| part.0 * 100.0));
                push(Plot::Temperature, 4 + place, battery.temperature.map(|celsius| celsius.0));
                if place == 0 {
                    for (cell, volts) in battery.cells.iter().enumerate() {
                        push(Plot::CellVolts, cell as u8, volts.map(|volts| volts.0));
                    }
                }
            }
            Observation::SystemStatus(system) => {
                push(Plot::Load, 0, system.load.map(|part| part.0 * 100.0));
                if self.reference.vehicle().batteries[0].get().is_none() {
                    push(Plot::PackVolts, 0, system.voltage.map(|volts| volts.0));
                    push(Plot::PackAmperes, 0, system.current.map(|amperes| amperes.0));
                    push(Plot::PackPercent, 0, system.remaining.map(|part| part.0 * 100.0));
                }
            }
            Observation::Escs(group) => {
                for (place, esc) in group.escs.iter().enumerate() {
                    if let Some(esc) = esc {
                        self.motor(at, group.first.saturating_add(place as u8), esc);
                    }
                }
            }
            Observation::Vibration(vibration) => {
                for axis in 0..3_u8 {
                    push(Plot::Vibration, axis, vibration.levels[usize::from(axis)]);
                    push(Plot::Clips, axis, Some(vibration.clips[usize::from(axis)] as f32));
                }
            }
            Observation::Estimator(estimator) => {
                push(Plot::Estimator, 0, estimator.velocity);
                push(Plot::Estimator, 1, estimator.position_horizontal);
                push(Plot::Estimator, 2, estimator.position_vertical);
                push(Plot::Estimator, 3, estimator.compass);
            }
            _ => self.sample_rest(at, source, observation),
        }
    }

    fn sample_rest(&mut self, at: Instant, _: Source, observation: &Observation) {
        let mut push = |plot, line: u8, value: Option<f32>| {
            if let Some(value) = value {
                self.store.push(at, Key { plot, line }, value);
            }
        };
        match observation {
            Observation::RadioControl(rc) => push(Plot::Link, 0, rc.rssi.map(f32::from)),
            Observation::TelemetryRadio(radio) => {
                push(Plot::Link, 1, radio.rssi.map(f32::from));
                push(Plot::Link, 2, radio.remote_rssi.map(f32::from));
                push(Plot::Link, 3, radio.noise.map(f32::from));
                push(Plot::Link, 4, radio.remote_noise.map(f32::from));
            }
            Observation::Air(air) => push(Plot::Temperature, 0, air.temperature.map(|celsius| celsius.0)),
            Observation::Imu(imu) if imu.instance == 0 => {
                push(Plot::Temperature, 1, imu.temperature.map(|celsius| celsius.0));
            }
            Observation::ImuAndAir(imu, _) if imu.instance == 0 => {
                push(Plot::Temperature, 1, imu.temperature.map(|celsius| celsius.0));
            }
            Observation::Processor(processor) => {
                push(Plot::Temperature, 2, processor.temperature.map(|celsius| celsius.0));
            }
            Observation::Engine(engine) => {
                push(Plot::Engine, 0, engine.rpm.map(|rpm| rpm.0));
                push(Plot::Engine, 1, engine.load.map(|part| part.0 * 100.0));
                push(Plot::Engine, 2, engine.fuel_flow);
                push(Plot::Engine, 3, engine.cylinder_head.map(|celsius| celsius.0));
            }
            Observation::SpeedSensors(sensors) => {
                for sensor in sensors.iter().flatten() {
                    push(Plot::SpeedSensors, sensor.index, Some(sensor.rpm.0));
                }
            }
            _ => {}
        }
    }

    fn motor(&mut self, at: Instant, motor: u8, esc: &Esc) {
        let values = [
            (Plot::MotorRpm, esc.rpm.map(|rpm| rpm.0)),
            (Plot::MotorVolts, esc.voltage.map(|volts| volts.0)),
            (Plot::MotorAmperes, esc.current.map(|amperes| amperes.0)),
            (Plot::MotorCelsius, esc.temperature.map(|celsius| celsius.0)),
            (Plot::EscErrors, esc.errors.map(|errors| errors as f32)),
        ];
        for (plot, value) in values {
            if let Some(value) = value {
                self.store.push(at, Key { plot, line: motor }, value);
            }
        }
    }

    /// A place on the track: the first of each interval, whose length doubles when the track is full.
    fn place(&mut self, at: Instant, position: Position, height_m: Option<f32>) {
        let at_s = at.as_secs_f64();
        let every_s = self.track_every.as_micros() as f64 / 1e6;
        if self.track.last().is_some_and(|last| at_s - last.at_s < every_s) {
            return;
        }
        if self.track.len() >= TRACK_MAX {
            let mut index = 0;
            self.track.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.track_every = Span::from_micros(self.track_every.as_micros().saturating_mul(2));
        }
        let (latitude, longitude) = (position.latitude_deg, position.longitude_deg);
        self.track.push(TrackPoint { at_s, latitude, longitude, height_m });
    }

    /// Long texts come in parts of one number.
    fn take_text(&mut self, next: Text) {
        if let Some(text) = &mut self.text {
            let goes_on = next.id != 0 && text.id == next.id && text.words.len() < 1_000;
            if goes_on {
                text.words.push_str(&next.words);
                return;
            }
        }
        if let Some(text) = self.text.replace(next) {
            self.keep_text(text);
        }
    }

    fn keep_text(&mut self, text: Text) {
        self.texts_count += 1;
        if self.texts.len() < TEXTS_MAX {
            self.texts.push(text);
        }
    }

    fn count(&mut self, sign: &Sign) {
        let second = sign.at.as_micros() / 1_000_000;
        if let Some(before) = self.link.second.filter(|before| *before != second) {
            // The middle of that second.
            let at = Instant::from_millis(before.saturating_mul(1000).saturating_add(500));
            let counts = [self.link.received, self.link.missing];
            for (line, count) in counts.into_iter().enumerate() {
                self.store.push(at, Key { plot: Plot::Frames, line: line as u8 }, count as f32);
            }
            (self.link.received, self.link.missing) = (0, 0);
        }
        self.link.second = Some(second);
        self.link.received += 1;
        if self.reference.vehicle().source == Some(sign.source) {
            let missing = self.link.last.map_or(0, |last| sign.sequence.wrapping_sub(last).wrapping_sub(1));
            // A step back is reordering or a restart, not 250 frames.
            self.link.missing += if missing < 128 { u32::from(missing) } else { 0 };
            self.link.last = Some(sign.sequence);
        }
    }
}

fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Ground => "ground",
        Phase::TakeOff => "take-off",
        Phase::Hover => "hover",
        Phase::Climb => "climb",
        Phase::Cruise => "cruise",
        Phase::Descent => "descent",
        Phase::Landing => "landing",
    }
}

/// Who sent a frame, and its number.
#[derive(Clone, Copy, Debug)]
struct Sign {
    at: Instant,
    source: Source,
    sequence: u8,
}

/// What one group told.
#[derive(Debug, Default)]
struct Told {
    observed: Vec<Observed>,
    signs: Vec<Sign>,
    texts: Vec<Text>,
}

impl Collect for Told {
    fn entry(&mut self, entry: &Entry<'_>) {
        let Entry::Frame { at, bytes, verified: true, .. } = *entry else { return };
        let Some(frame) = Frame::again(bytes, Check::Verified) else { return };
        let source = frame.source();
        self.signs.push(Sign { at, source, sequence: frame.sequence() });
        if frame.id() == STATUSTEXT {
            self.texts.extend(text(at, source, frame.payload()));
        } else if let Some((source, observation)) = observe(&frame) {
            self.observed.push(Observed { at, source, observation });
        }
    }
}

fn text(at: Instant, source: Source, payload: &[u8]) -> Option<Text> {
    let payload = Payload::new(hums_dialect::message(STATUSTEXT)?, payload);
    let words = payload.fields().find_map(|(_, value)| match value {
        Value::Text(text) => Some(String::from_utf8_lossy(text).into_owned()),
        _ => None,
    })?;
    let number = payload.number("id").unwrap_or(0.0) as u64;
    // Parts belong together by their number and their sender.
    let sender = u64::from(source.system) << 8 | u64::from(source.component);
    let id = if number == 0 { 0 } else { number << 16 | sender };
    let severity = payload.number("severity").unwrap_or(0.0) as u8;
    Some(Text { at_s: at.as_secs_f64(), severity, words, id })
}

impl Deliver<Told> for Replay {
    fn gap(&mut self, _: &Gap) -> Result<()> {
        // What follows a gap follows no number before it.
        self.link.last = None;
        Ok(())
    }

    fn group(&mut self, told: Told) -> Result<()> {
        told.observed.iter().for_each(|observed| self.observe(observed));
        told.signs.iter().for_each(|sign| self.count(sign));
        told.texts.into_iter().for_each(|text| self.take_text(text));
        Ok(())
    }
}
