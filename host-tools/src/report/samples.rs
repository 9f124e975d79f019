//! What the vehicle told, sampled for the plots and the track.

use hums_core::observation::{Esc, Observation};
use hums_core::time::Instant;

use super::plots::Plot;
use crate::decode::reference::Reference;
use crate::series::Store;
use crate::track::Track;

/// Series and track.
#[derive(Debug, Default)]
pub struct Samples {
    /// The series.
    pub store: Store<Plot>,
    /// Where it was.
    pub track: Track,
}

impl Samples {
    /// Takes what an observation told.
    pub fn take(&mut self, at: Instant, reference: &Reference, observation: &Observation) {
        self.motion(at, reference, observation);
        self.power(at, reference, observation);
        self.condition(at, observation);
        self.radio(at, observation);
    }

    /// Attitude, height, speed, place.
    fn motion(&mut self, at: Instant, reference: &Reference, observation: &Observation) {
        let mut push = |plot, line: u8, value: Option<f32>| {
            if let Some(value) = value {
                self.store.push(at, (plot, line), value);
            }
        };
        match observation {
            Observation::GlobalPosition(global) => {
                push(Plot::Height, 0, Some(global.relative_altitude.0));
                push(Plot::Vertical, 0, Some(-global.velocity[2].0));
                let [north, east, _] = global.velocity.map(|speed| speed.0);
                push(Plot::Speed, 0, Some(north.hypot(east)));
                if let Some(position) = global.position {
                    self.track.push(at, position, Some(global.relative_altitude.0));
                }
            }
            Observation::LocalPosition(local) if reference.vehicle().global.get().is_none() => {
                push(Plot::Height, 0, Some(-local.position[2].0));
                push(Plot::Vertical, 0, Some(-local.velocity[2].0));
                push(Plot::Speed, 0, Some(local.velocity[0].0.hypot(local.velocity[1].0)));
            }
            Observation::Hud(hud) => push(Plot::Speed, 1, hud.airspeed.map(|speed| speed.0)),
            Observation::Gnss(gnss) => {
                let receiver = gnss.instance;
                // Two lines for each receiver; a damaged log may name one that nobody has.
                let line = receiver.saturating_mul(2);
                let other = line.saturating_add(1);
                push(Plot::Satellites, line, gnss.satellites.map(f32::from));
                push(Plot::Satellites, other, Some(f32::from(gnss.fix)));
                push(Plot::Dilution, line, gnss.hdop);
                push(Plot::Dilution, other, gnss.accuracy.map(|accuracy| accuracy.0));
                if receiver == 0 {
                    push(Plot::Speed, 2, gnss.speed.map(|speed| speed.0));
                }
                let alone = receiver == 0 && reference.vehicle().global.get().is_none();
                if let Some(position) = gnss.position.filter(|_| alone) {
                    self.track.push(at, position, None);
                }
            }
            Observation::Attitude(attitude) => {
                push(Plot::Attitude, 0, Some(attitude.roll.0.to_degrees()));
                push(Plot::Attitude, 1, Some(attitude.pitch.0.to_degrees()));
            }
            _ => {}
        }
    }

    /// Batteries, motors, the autopilot's load.
    fn power(&mut self, at: Instant, reference: &Reference, observation: &Observation) {
        let mut push = |plot, line: u8, value: Option<f32>| {
            if let Some(value) = value {
                self.store.push(at, (plot, line), value);
            }
        };
        match observation {
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
                if reference.vehicle().batteries[0].get().is_none() {
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
            _ => {}
        }
    }

    /// Vibration, estimator, temperatures, engine.
    fn condition(&mut self, at: Instant, observation: &Observation) {
        let mut push = |plot, line: u8, value: Option<f32>| {
            if let Some(value) = value {
                self.store.push(at, (plot, line), value);
            }
        };
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
            Observation::Air(air) if air.instance == 0 => {
                push(Plot::Temperature, 0, air.temperature.map(|celsius| celsius.0));
            }
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

    /// Signals.
    fn radio(&mut self, at: Instant, observation: &Observation) {
        let mut push = |plot, line: u8, value: Option<f32>| {
            if let Some(value) = value {
                self.store.push(at, (plot, line), value);
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
                self.store.push(at, (plot, motor), value);
            }
        }
    }
}
