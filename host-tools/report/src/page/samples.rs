//! The vehicle's values as points of series and of the track.

use hums_core::clock::Instant;
use hums_core::observation::{Air, Battery, CELLS_MAX, Esc, Imu, MOTORS_MAX, Observation};
use hums_core::units::{Metres, Position};

use super::more::{self, compass_deg};
use super::plots::{Line, Plot};
use crate::reference::Reference;
use crate::series::Store;
use crate::track::Track;

/// An altitude; before an estimator knows it, it is 0.
fn told(altitude: Option<Metres>) -> Option<f32> {
    altitude.map(|metres| metres.0).filter(|metres| metres.abs() > 0.0)
}

/// Series and track.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// The series.
    pub store: Store<Plot>,
    /// Its track.
    pub track: Track,
    /// Number of times that every second place was dropped, because the track is bounded.
    pub thinned: u64,
}

impl Samples {
    /// Takes an observation.
    pub fn take(&mut self, at: Instant, reference: &Reference, observation: &Observation) {
        self.motion(at, reference, observation);
        self.power(at, reference, observation);
        self.condition(at, observation);
        self.radio(at, observation);
    }

    fn motion(&mut self, at: Instant, reference: &Reference, observation: &Observation) {
        let mut push = |plot, line: u8, value: Option<f32>| self.put(at, (plot, line), value);
        match observation {
            Observation::GlobalPosition(global) => {
                push(Plot::Height, 0, Some(global.relative_altitude.0));
                push(Plot::Vertical, 0, Some(-global.velocity[2].0));
                let [north, east, down] = global.velocity.map(|speed| speed.0);
                push(Plot::Speed, 0, Some(north.hypot(east)));
                if reference.vehicle().local.get().is_none() {
                    (0..)
                        .zip([north, east, down])
                        .for_each(|(axis, speed)| push(Plot::Velocity, axis, Some(speed)));
                }
                // Before the position is known, its altitude is 0.
                push(Plot::Altitude, 1, global.position.map(|_| global.altitude.0));
                if let Some(position) = global.position {
                    self.place(at, position, Some(global.relative_altitude.0));
                }
            }
            Observation::LocalPosition(local) => {
                let [north, east, down] = local.velocity.map(|speed| speed.0);
                (0..)
                    .zip([north, east, down])
                    .for_each(|(axis, speed)| push(Plot::Velocity, axis, Some(speed)));
                if reference.vehicle().global.get().is_none() {
                    push(Plot::Height, 0, Some(-local.position[2].0));
                    push(Plot::Vertical, 0, Some(-down));
                    push(Plot::Speed, 0, Some(north.hypot(east)));
                }
            }
            Observation::Hud(hud) => push(Plot::Speed, 1, hud.airspeed.map(|speed| speed.0)),
            Observation::Gnss(gnss) => {
                let receiver = gnss.instance;
                push(Plot::Satellites, receiver, gnss.satellites.map(f32::from));
                push(Plot::Fix, receiver, Some(f32::from(gnss.fix)));
                push(Plot::Hdop, receiver, gnss.hdop);
                push(Plot::Accuracy, receiver, gnss.accuracy.map(|accuracy| accuracy.0));
                if receiver == 0 {
                    push(Plot::Altitude, 0, gnss.altitude.map(|metres| metres.0));
                    push(Plot::Speed, 2, gnss.speed.map(|speed| speed.0));
                }
                let alone = receiver == 0 && reference.vehicle().global.get().is_none();
                if let Some(position) = gnss.position.filter(|_| alone) {
                    self.place(at, position, None);
                }
            }
            Observation::Attitude(attitude) => {
                push(Plot::Attitude, 0, Some(attitude.roll.0.to_degrees()));
                push(Plot::Attitude, 1, Some(attitude.pitch.0.to_degrees()));
                push(Plot::Heading, 0, Some(compass_deg(attitude.yaw.0)));
                for (axis, rate) in (0..).zip(attitude.rates.into_iter().flatten()) {
                    push(Plot::Rates, axis, Some(rate.0.to_degrees()));
                }
            }
            Observation::SecondEstimate(second) => {
                if let Some([roll, pitch, yaw]) = second.attitude {
                    push(Plot::Attitude, 4, Some(roll.0.to_degrees()));
                    push(Plot::Attitude, 5, Some(pitch.0.to_degrees()));
                    push(Plot::Heading, 3, Some(compass_deg(yaw.0)));
                }
                push(Plot::Altitude, 3, told(second.altitude));
            }
            Observation::AttitudeSetpoint(wanted) => {
                push(Plot::Attitude, 2, Some(wanted.roll.0.to_degrees()));
                push(Plot::Attitude, 3, Some(wanted.pitch.0.to_degrees()));
                for (axis, rate) in (3..).zip(wanted.rates.into_iter().flat_map(|rates| rates.about)) {
                    push(Plot::Rates, axis, Some(rate.0.to_degrees()));
                }
            }
            Observation::ClimbWanted(climb) => push(Plot::Vertical, 1, Some(climb.0)),
            _ => {}
        }
    }

    fn power(&mut self, at: Instant, reference: &Reference, observation: &Observation) {
        let mut push = |plot, line: u8, value: Option<f32>| self.put(at, (plot, line), value);
        match observation {
            Observation::Battery(battery) => self.battery(at, battery),
            Observation::Rails(rails) => {
                push(Plot::Rail, 0, rails.vcc.map(|volts| volts.0));
                push(Plot::ServoRail, 0, rails.servo.map(|volts| volts.0));
            }
            Observation::SystemStatus(system) => {
                push(Plot::Load, 0, system.load.map(|part| part.0 * 100.0));
                if reference.vehicle().batteries[0].get().is_none() {
                    push(Plot::PackVolts, 0, system.voltage.map(|volts| volts.0));
                    push(Plot::PackAmperes, 0, system.current.map(|amperes| amperes.0));
                    push(Plot::PackPercent, 0, system.remaining.map(|part| part.0 * 100.0));
                }
            }
            Observation::Outputs(outputs) => {
                // Autopilots have two ports at most; a line is a byte.
                let first = outputs.port.min(15) * MOTORS_MAX as u8;
                for (line, pulse) in (first..).zip(outputs.pulses) {
                    push(Plot::Outputs, line, (pulse > 0).then_some(f32::from(pulse)));
                }
            }
            Observation::Escs(group) => {
                for (place, esc) in group.escs.iter().enumerate() {
                    if let Some(esc) = esc {
                        self.motor(at, group.first.saturating_add(place as u8), esc);
                    }
                }
            }
            _ => {}
        }
    }

    fn condition(&mut self, at: Instant, observation: &Observation) {
        let mut push = |plot, line: u8, value: Option<f32>| self.put(at, (plot, line), value);
        match observation {
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
            Observation::Air(air) if air.instance == 0 => self.air(at, air, [0, 0]),
            Observation::Imu(imu) if imu.instance == 0 => self.imu(at, imu),
            Observation::ImuAndAir(imu, air) if imu.instance == 0 => {
                self.imu(at, imu);
                // From another sensor than the barometer's own messages.
                self.air(at, air, [3, 1]);
            }
            Observation::Processor(processor) => {
                push(Plot::Temperature, 2, processor.temperature.map(|celsius| celsius.0));
            }
            Observation::Engine(engine) => {
                push(Plot::EngineRpm, 0, engine.rpm.map(|rpm| rpm.0));
                push(Plot::EngineLoad, 0, engine.load.map(|part| part.0 * 100.0));
                push(Plot::EngineFuelFlow, 0, engine.fuel_flow);
                push(Plot::EngineCelsius, 0, engine.cylinder_head.map(|celsius| celsius.0));
            }
            Observation::SpeedSensors(sensors) => {
                for sensor in sensors.iter().flatten() {
                    push(Plot::SpeedSensors, sensor.index, Some(sensor.rpm.0));
                }
            }
            _ => {}
        }
    }

    /// Signals.
    fn radio(&mut self, at: Instant, observation: &Observation) {
        let mut push = |plot, line: u8, value: Option<f32>| self.put(at, (plot, line), value);
        match observation {
            Observation::RadioControl(rc) => push(Plot::Link, 0, rc.rssi.map(f32::from)),
            Observation::TelemetryRadio(radio) => {
                push(Plot::Link, 1, radio.rssi.map(f32::from));
                push(Plot::Link, 2, radio.remote_rssi.map(f32::from));
                push(Plot::Link, 3, radio.noise.map(f32::from));
                push(Plot::Link, 4, radio.remote_noise.map(f32::from));
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
            self.put(at, (plot, motor), value);
        }
    }

    fn imu(&mut self, at: Instant, imu: &Imu) {
        let force = imu.acceleration.map(|axes| axes.map(|axis| axis.0));
        self.put(at, (Plot::Acceleration, 0), force.map(|[x, y, z]| (x * x + y * y + z * z).sqrt()));
        self.put(at, (Plot::Temperature, 1), imu.temperature.map(|celsius| celsius.0));
    }

    fn air(&mut self, at: Instant, air: &Air, lines: [u8; 2]) {
        self.put(at, (Plot::Temperature, lines[0]), air.temperature.map(|celsius| celsius.0));
        self.put(at, (Plot::Pressure, lines[1]), air.pressure.map(|pressure| pressure.0));
    }

    fn battery(&mut self, at: Instant, battery: &Battery) {
        let values = [
            (Plot::PackVolts, battery.voltage.map(|volts| volts.0)),
            (Plot::PackAmperes, battery.current.map(|amperes| amperes.0)),
            (Plot::PackPercent, battery.remaining.map(|part| part.0 * 100.0)),
            (Plot::PackCelsius, battery.temperature.map(|celsius| celsius.0)),
        ];
        for (plot, value) in values {
            self.put(at, (plot, battery.id), value);
        }
        let first = battery.id.checked_mul(CELLS_MAX as u8);
        let lines = first.into_iter().flat_map(|first| first..=u8::MAX);
        for (line, volts) in lines.zip(battery.cells) {
            self.put(at, (Plot::CellVolts, line), volts.map(|cell| cell.volts().0));
        }
    }

    /// Takes values of a message that are not observations: sticks, wind, setpoints.
    pub fn message(&mut self, at: Instant, id: u32, payload: &[u8]) {
        more::of_message(id, payload, &mut |line, value| self.put(at, line, Some(value)));
    }

    /// Takes the same of an autopilot's own log.
    pub fn values(&mut self, at: Instant, values: &[(Line, f32)]) {
        for (line, value) in values {
            self.put(at, *line, Some(*value));
        }
    }

    fn put(&mut self, at: Instant, line: Line, value: Option<f32>) {
        if let Some(value) = value {
            self.store.push(at, line, value);
        }
    }

    fn place(&mut self, at: Instant, position: Position, height_m: Option<f32>) {
        self.thinned += u64::from(self.track.push(at, position, height_m));
    }
}
