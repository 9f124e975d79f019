//! Departures from the usual level of a flight are named in time: sensors against each other, vibration, a motor's
//! output, the estimator's compass. Offsets from the beginning, wind, load, turns and missing parts raise nothing.
#![expect(clippy::panic, reason = "that is how a test fails")]

use crate::common::{AUTOPILOT, Quad};
use hums_core::Monitor;
use hums_core::health::{Finding, Level};
use hums_core::observation::{
    Air, Attitude, Autopilot, Estimator, EstimatorScale, Imu, MOTORS_MAX, Observation, Outputs,
    SecondEstimate, VehicleKind, Wanted, WantedRates,
};
use hums_core::params::Params;
use hums_core::status::LinkReading;
use hums_core::time::Instant;
use hums_core::units::{
    Gauss, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2, Position, Radians, RadiansPerSecond,
};

/// Take-off at 4 s; faults begin at 30 s.
const OFF_MS: u64 = 4_000;
const FAULT_MS: u64 = 30_000;
const END_MS: u64 = 60_000;

/// A vehicle with three sensors of each kind, and the outputs of its motors.
#[derive(Clone)]
struct Fitted {
    quad: Quad,
    force: [[f32; 3]; 3],
    rate: [[f32; 3]; 3],
    field: [[f32; 3]; 3],
    pressure: [f32; 3],
    pulses: [f32; MOTORS_MAX],
    yaw_rate: f32,
    /// Body rates about roll and pitch, and their setpoints, rad/s.
    turns: [f32; 2],
    wanted: [f32; 2],
    /// The attitude whose axes these are about.
    wanted_of: Option<[f32; 4]>,
    /// Whether setpoints come now.
    wants: bool,
    /// Height of GPS above sea level, m.
    altitude: f32,
    /// Amplitude of the attitude's noise, rad.
    attitude_noise: f32,
    /// The climb of `VFR_HUD`, m/s.
    hud_climb: Option<f32>,
    /// A second after this, GPS repeats its position.
    gps_until_ms: u64,
    /// Speed northwards, m/s.
    speed: f32,
    /// The receiver's speed northwards, m/s, if it sends one, and the way north since, m.
    gps_speed: Option<f32>,
    gps_north: f32,
    /// Whether positions come now.
    places: bool,
    /// Offset of the second estimator: roll, rad; height and north, m.
    second: Option<[f32; 3]>,
    /// The sensors whose messages come now.
    speaks: [bool; 3],
    /// The first sensor's message is `HIGHRES_IMU`.
    selects: bool,
    /// Time without any message, ms.
    silence: core::ops::Range<u64>,
}

/// A number between -1 and 1 for a moment and a sensor: the same one each time.
fn noise(now_ms: u64, seed: u64) -> f32 {
    let mut state = (now_ms << 8 | seed).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    state = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    ((state >> 40) as f32 / (1_u64 << 23) as f32) - 1.0
}

impl Fitted {
    fn healthy(now_ms: u64) -> Self {
        let mut quad = Quad::healthy();
        quad.height = if now_ms < OFF_MS { 0.0 } else { 20.0 };
        quad.throttle = if now_ms < OFF_MS { 0.0 } else { 0.5 };
        let mut pulses = [0.0; MOTORS_MAX];
        for (motor, pulse) in (0..4).zip(&mut pulses) {
            *pulse = if now_ms < OFF_MS { 1_000.0 } else { 1_500.0 + 20.0 * noise(now_ms, motor) };
        }
        // Each has its own offset and its own noise.
        let shaken = |seed| noise(now_ms, seed) * 2.0;
        let force =
            [0, 1, 2].map(|sensor| [0.2 * sensor as f32, shaken(sensor + 10), -9.8 + shaken(sensor + 20)]);
        let rate = [0, 1, 2].map(|sensor| [0.01 * sensor as f32, 0.05 * noise(now_ms, sensor + 30), 0.0]);
        let field =
            [0, 1, 2].map(|sensor| [0.2, 0.05 * sensor as f32, 0.4 + 0.01 * noise(now_ms, sensor + 40)]);
        let pressure =
            [0, 1, 2].map(|sensor| 1_000.0 + 0.3 * sensor as f32 + 0.05 * noise(now_ms, sensor + 50));
        let turns = [0.1 * noise(now_ms, 70), 0.1 * noise(now_ms, 71)];
        let altitude = 120.0 + noise(now_ms, 72);
        Self {
            quad,
            force,
            rate,
            field,
            pressure,
            pulses,
            yaw_rate: 0.0,
            turns,
            wanted: [0.0; 2],
            wanted_of: None,
            wants: true,
            altitude,
            attitude_noise: 0.01,
            hud_climb: None,
            gps_until_ms: u64::MAX,
            speed: 1.0,
            gps_speed: None,
            gps_north: 0.0,
            places: true,
            second: None,
            speaks: [true; 3],
            selects: false,
            silence: 0..0,
        }
    }

    fn says(&self, now_ms: u64) -> Vec<Observation> {
        if self.silence.contains(&now_ms) {
            return Vec::new();
        }
        if !now_ms.is_multiple_of(100) {
            return self.sensors_say().collect();
        }
        let mut said = self.quad.says(now_ms);
        said.retain(|said| match said {
            Observation::Imu(_) | Observation::Attitude(_) => false,
            Observation::GlobalPosition(_) | Observation::LocalPosition(_) => self.places,
            _ => true,
        });
        for observation in &mut said {
            if let Observation::GlobalPosition(global) = observation {
                global.velocity[0] = MetresPerSecond(self.speed);
                global.position = Some(Position { latitude_deg: 47.0, longitude_deg: 8.0 });
                global.altitude = Metres(120.0);
            }
            if let Observation::Hud(hud) = observation {
                hud.climb = self.hud_climb.map(MetresPerSecond);
            }
            if let Observation::Gnss(gnss) = observation {
                let moment = now_ms.min(self.gps_until_ms);
                let latitude_deg =
                    47.0 + f64::from(noise(moment, 73)) * 1e-6 + f64::from(self.gps_north) / 111_320.0;
                gnss.speed = self.gps_speed.map(MetresPerSecond);
                gnss.course = self.gps_speed.map(|_| Radians(0.0));
                gnss.position = Some(Position { latitude_deg, longitude_deg: 8.0 });
                gnss.altitude = Some(Metres(if moment == now_ms { self.altitude } else { 120.0 }));
            }
        }
        let [roll, pitch] = self.turns;
        let rates = Some([roll, pitch, self.yaw_rate].map(RadiansPerSecond));
        if self.wants {
            let [roll, pitch] = self.wanted;
            let about = [roll, pitch, 0.0].map(RadiansPerSecond);
            let rates = Some(WantedRates { about, of: self.wanted_of });
            said.push(Observation::Wanted(Wanted { rates, ..Wanted::default() }));
        }
        said.push(Observation::Attitude(Attitude {
            roll: Radians(self.quad.roll + self.attitude_noise * noise(now_ms, 74)),
            rates,
            boot_ms: Some((now_ms + 100_000) as u32),
            ..Attitude::default()
        }));
        said.extend(self.sensors_say());
        if let Some([roll, up, north]) = self.second {
            let latitude_deg = 47.0 + f64::from(north) / 111_320.0;
            said.push(Observation::SecondEstimate(SecondEstimate {
                attitude: Some([roll, 0.0, 2.0].map(Radians)),
                position: Some(Position { latitude_deg, longitude_deg: 8.0 }),
                altitude: Some(Metres(170.0 + up)),
            }));
        }
        let pulses = self.pulses.map(|pulse| pulse as u16);
        said.push(Observation::Outputs(Outputs { port: 0, pulses }));
        said
    }

    fn sensors_say(&self) -> impl Iterator<Item = Observation> + '_ {
        (0..3_u8).filter(|instance| self.speaks[usize::from(*instance)]).flat_map(|instance| {
            let sensor = usize::from(instance);
            let imu = Imu {
                instance,
                acceleration: Some(self.force[sensor].map(MetresPerSecond2)),
                rate: Some(self.rate[sensor].map(RadiansPerSecond)),
                field: Some(self.field[sensor].map(Gauss)),
                temperature: None,
            };
            let pressure = Some(Hectopascals(self.pressure[sensor]));
            let air = Air { instance, pressure, temperature: None };
            let selected = self.selects && instance == 0;
            let apart = [Observation::Imu(imu), Observation::Air(air)];
            let both = selected.then_some(Observation::ImuAndAir(imu, air));
            both.into_iter().chain(apart.into_iter().filter(move |_| !selected))
        })
    }
}

fn fly(script: impl Fn(u64, &mut Fitted)) -> Vec<Finding> {
    fly_with([(100, 0); 3], script)
}

/// The same with a period and an offset of each sensor's messages, ms.
fn fly_with(rhythm: [(u64, u64); 3], script: impl Fn(u64, &mut Fitted)) -> Vec<Finding> {
    let mut monitor = Monitor::new(Params::defaults());
    let mut findings = Vec::new();
    for now_ms in (0..END_MS).step_by(if rhythm == [(100, 0); 3] { 50 } else { 25 }) {
        let now = Instant::from_millis(now_ms);
        let mut fitted = Fitted::healthy(now_ms);
        fitted.speaks = rhythm.map(|(every_ms, from_ms)| now_ms % every_ms == from_ms);
        script(now_ms, &mut fitted);
        for observation in fitted.says(now_ms) {
            monitor.observe(now, AUTOPILOT, &observation);
        }
        let link = LinkReading { frames_lost: Some(0.0), at: now };
        monitor.tick(now, &link, &fitted.quad.recorder, &mut |finding| findings.push(*finding));
    }
    findings
}

#[track_caller]
fn finds(check: &str, instance: u8, level: Level, within_ms: u64, fault: impl Fn(u64, &mut Fitted)) {
    let findings = fly(|now_ms, fitted| {
        if now_ms >= FAULT_MS {
            fault(now_ms, fitted);
        }
    });
    let found = findings.iter().find(|finding| finding.level == level);
    let found = found.unwrap_or_else(|| panic!("{check} never {level:?}: {findings:?}"));
    assert!(findings.iter().all(|one| (one.check, one.instance) == (check, instance)), "{findings:?}");
    let after_ms = found.at.as_millis().saturating_sub(FAULT_MS);
    assert!((1..=within_ms).contains(&after_ms), "{check} after {after_ms} ms: {findings:?}");
}

#[track_caller]
fn is_quiet(script: impl Fn(u64, &mut Fitted)) {
    assert_eq!(fly(script), []);
}

#[test]
fn accelerometers_that_are_wrong_alike_are_told_by_the_velocity_of_gps() {
    let finds = |fault: fn(&mut Fitted)| {
        let findings = fly(|now_ms, fitted| {
            fitted.gps_speed = Some(0.0);
            if now_ms >= FAULT_MS {
                fault(fitted);
            }
        });
        let found = findings.first().map(|found| (found.check, found.level));
        assert_eq!(found, Some(("imu_gps", Level::Warning)), "{findings:?}");
        let after_ms = findings[0].at.as_millis() - FAULT_MS;
        assert!((500..=3_000).contains(&after_ms), "{after_ms} ms");
        assert_eq!(findings.len(), 1, "{findings:?}");
    };
    finds(|fitted| fitted.force.iter_mut().for_each(|force| force[2] += 4.0));
    finds(|fitted| fitted.force.iter_mut().for_each(|force| force[0] -= 4.0));
    // A gyro that led the attitude astray.
    finds(|fitted| {
        fitted.quad.roll += 0.4;
        // Near the equator, where a false lean does not turn the compass's heading.
        fitted.field.iter_mut().for_each(|field| field[2] -= 0.4);
    });
}

#[test]
fn a_force_that_changes_the_velocity_is_no_fault_and_a_leap_of_the_velocity_is_none_of_the_force() {
    is_quiet(|now_ms, fitted| {
        let pulled_s = (now_ms.saturating_sub(FAULT_MS) as f32 / 1e3).min(6.0);
        let coasted_s = (now_ms.saturating_sub(FAULT_MS) as f32 / 1e3) - pulled_s;
        fitted.gps_speed = Some(3.0 * pulled_s);
        fitted.gps_north = 3.0 * pulled_s * (pulled_s / 2.0 + coasted_s);
        if pulled_s > 0.0 && coasted_s <= 0.0 {
            fitted.force.iter_mut().for_each(|force| force[0] += 3.0);
        }
    });
    let leaps = fly(|now_ms, fitted| {
        fitted.gps_speed = Some(if now_ms >= FAULT_MS { 8.0 } else { 0.0 });
    });
    assert!(leaps.iter().all(|finding| finding.check == "gps_speed"), "{leaps:?}");
}

#[test]
fn of_three_sensors_the_one_that_comes_apart_is_named() {
    for sensor in 0..3_u8 {
        let place = usize::from(sensor);
        finds("accel_mismatch", sensor, Level::Warning, 3_200, |_, fitted| fitted.force[place][2] += 3.0);
        finds("gyro_mismatch", sensor, Level::Warning, 1_000, |_, fitted| fitted.rate[place][0] += 0.4);
        finds("compass_mismatch", sensor, Level::Warning, 1_000, |_, fitted| {
            fitted.field[place] = [0.5, 0.1 * fitted.field[place][2], -0.1];
        });
        // The first one leaves the height of GPS too.
        if sensor > 0 {
            finds("baro_mismatch", sensor, Level::Warning, 1_300, |_, fitted| fitted.pressure[place] += 2.5);
        }
    }
}

#[test]
fn of_two_sensors_the_second_stands_for_both() {
    let two = |fitted: &mut Fitted| {
        (fitted.force[2], fitted.rate[2], fitted.field[2], fitted.pressure[2]) =
            ([0.0; 3], [0.0; 3], [0.0; 3], 0.0);
    };
    is_quiet(|_, fitted| two(fitted));
    for wrong in [0, 1] {
        let findings = fly(|now_ms, fitted| {
            two(fitted);
            if now_ms >= FAULT_MS {
                fitted.force[wrong][0] += 3.0;
            }
        });
        let [found] = findings[..] else { panic!("{findings:?}") };
        assert_eq!((found.check, found.instance, found.level), ("accel_mismatch", 1, Level::Warning));
    }
}

fn gusts(now_ms: u64, fitted: &mut Fitted) {
    let strong = if now_ms < FAULT_MS { 0.05 } else { 1.0 };
    let wave = |period_ms: f32| (now_ms as f32 / period_ms).sin();
    fitted.rate.iter_mut().for_each(|rate| rate[0] += strong * 0.4 * wave(70.0));
    fitted.force.iter_mut().for_each(|force| force[1] += strong * 3.0 * wave(110.0));
}

#[test]
fn sensors_that_are_not_sampled_at_one_moment_are_not_apart_in_gusts() {
    let slow = [(1_000, 0), (1_000, 500), (1_000, 250)];
    for rhythm in [[(100, 0), (125, 0), (125, 25)], [(50, 0), (250, 25), (250, 25)], slow] {
        assert_eq!(fly_with(rhythm, gusts), [], "{rhythm:?}");
    }
}

#[test]
fn sensors_that_are_sampled_at_one_moment_are_compared_however_slow_they_are() {
    for (every_ms, within_ms) in [(500, 4_000), (1_000, 6_000)] {
        let findings = fly_with([(every_ms, 0), (every_ms, 25), (every_ms, 25)], |now_ms, fitted| {
            for (force, seed) in fitted.force.iter_mut().zip(10..) {
                *force = [0.0, 0.4 * noise(now_ms, seed), -9.8 + 0.4 * noise(now_ms, seed + 10)];
            }
            if now_ms >= FAULT_MS {
                fitted.force[2][0] += 3.0;
            }
        });
        let [found] = findings[..] else { panic!("{findings:?}") };
        assert_eq!((found.check, found.instance), ("accel_mismatch", 2));
        assert!(found.at.as_millis() <= FAULT_MS + within_ms, "{found:?}");
    }
}

#[test]
fn one_wrong_sample_is_no_mismatch() {
    for every_ms in [100, 500, 1_000] {
        for sensor in 0..3 {
            let findings = fly_with([(every_ms, 0); 3], |now_ms, fitted| {
                if now_ms == FAULT_MS {
                    fitted.force[sensor] = [314.0; 3];
                    fitted.rate[sensor] = [30.0; 3];
                    fitted.field[sensor] = [-3.0; 3];
                    if sensor > 0 {
                        fitted.pressure[sensor] = 700.0;
                    }
                }
            });
            assert_eq!(findings, [], "{sensor} every {every_ms} ms");
        }
    }
}

#[test]
fn where_one_of_three_sensors_falls_silent_the_other_two_are_compared_as_two() {
    for silent in 0..3 {
        let (first, second) = ([1, 0, 0][silent], [2, 2, 1][silent]);
        for wrong in [first, second] {
            let findings = fly(|now_ms, fitted| {
                fitted.speaks[silent] = now_ms < 20_000;
                if now_ms >= FAULT_MS {
                    fitted.force[wrong][1] += 3.0;
                    fitted.pressure[wrong] += 2.5;
                }
            });
            for check in ["accel_mismatch", "baro_mismatch"] {
                let mut told =
                    findings.iter().filter(|one| one.check == check && one.at.as_millis() > FAULT_MS);
                let found = told.next().unwrap_or_else(|| panic!("{check} without {silent}: {findings:?}"));
                assert_eq!((usize::from(found.instance), found.level), (second, Level::Warning));
                assert!(found.at.as_millis() < FAULT_MS + 3_000, "{found:?}");
            }
        }
    }
}

#[test]
fn a_hole_is_no_mismatch() {
    for speaks in [[false; 3], [true, false, false]] {
        let findings = fly(|now_ms, fitted| {
            gusts(now_ms, fitted);
            if (FAULT_MS..FAULT_MS + 8_000).contains(&now_ms) {
                fitted.speaks = speaks;
            }
        });
        assert!(findings.iter().all(|one| !one.check.ends_with("mismatch")), "{findings:?}");
    }
}

#[test]
fn what_px4_has_selected_and_taken_an_offset_off_is_no_measure_of_the_other_sensors() {
    let px4 = |_: u64, fitted: &mut Fitted| {
        (fitted.selects, fitted.quad.autopilot) = (true, Autopilot::Px4);
        fitted.quad.vibration.levels = [Some(0.0), Some(0.0), Some(1.0)];
    };
    is_quiet(|now_ms, fitted| {
        px4(now_ms, fitted);
        if now_ms >= FAULT_MS {
            fitted.rate[0][0] += 0.3;
            fitted.force[0][0] += 2.0;
            // Their own axes lie otherwise, and the vehicle has turned.
            let [_, [_, y, z], [.., down]] = fitted.field;
            (fitted.field[1], fitted.field[2]) = ([-0.3, y, z], [0.3, -0.2, -down]);
        }
    });
    let findings = fly(|now_ms, fitted| {
        px4(now_ms, fitted);
        if now_ms >= FAULT_MS {
            fitted.rate[2][0] += 0.4;
        }
    });
    let [found] = findings[..] else { panic!("{findings:?}") };
    assert_eq!((found.check, found.instance), ("gyro_mismatch", 2));
    assert!(found.at.as_millis() < FAULT_MS + 1_500, "{found:?}");
}

#[test]
fn gyros_that_become_noisy_are_apart_though_they_seem_to_turn_fast() {
    for kind in [(VehicleKind::Plane, 1), (VehicleKind::Rotorcraft, 2)] {
        let findings = fly(|now_ms, fitted| {
            ((fitted.quad.kind, fitted.quad.type_number), fitted.speed) = (kind, 15.0);
            (fitted.force[2], fitted.rate[2], fitted.field[2], fitted.pressure[2]) =
                ([0.0; 3], [0.0; 3], [0.0; 3], 0.0);
            if now_ms >= FAULT_MS {
                for (rate, seed) in fitted.rate.iter_mut().zip(90..) {
                    *rate = [0, 10, 20].map(|axis| 1.6 * noise(now_ms, seed + axis));
                }
            }
        });
        let found = findings.iter().find(|one| one.check == "gyro_mismatch");
        let found = found.unwrap_or_else(|| panic!("{findings:?}"));
        assert_eq!((found.instance, found.level), (1, Level::Warning));
        assert!(found.at.as_millis() < FAULT_MS + 4_000, "{found:?}");
    }
    // Hard turns at one moment make no difference, even with a scale error of a hundredth in one gyro.
    is_quiet(|now_ms, fitted| {
        let turns = if now_ms < FAULT_MS { 0.0 } else { 4.0 * (now_ms as f32 / 300.0).sin() };
        for (rate, scale) in fitted.rate.iter_mut().zip([1.0, 1.01, 0.99]) {
            rate[0] += scale * turns;
        }
        fitted.turns = [turns, 0.0];
        fitted.wanted = fitted.turns;
    });
}

#[test]
fn one_wrong_pressure_is_no_climb_and_no_noise() {
    for every_ms in [100, 500, 1_000] {
        for wrong_hpa in [980.0, 1_020.0, 500.0] {
            let findings = fly_with([(every_ms, 0); 3], |now_ms, fitted| {
                fitted.hud_climb = Some(0.02);
                if now_ms == FAULT_MS || now_ms == FAULT_MS + 10_000 {
                    fitted.pressure[0] = wrong_hpa;
                }
            });
            assert_eq!(findings, [], "{wrong_hpa} hPa every {every_ms} ms");
        }
    }
}

#[test]
fn a_plane_that_stands_after_a_hole_has_no_stuck_sensors() {
    let still = Fitted::healthy(0);
    let findings = fly(|now_ms, fitted| {
        (fitted.quad.kind, fitted.quad.type_number, fitted.speed) = (VehicleKind::Plane, 1, 15.0);
        fitted.silence = FAULT_MS..FAULT_MS + 6_000;
        if now_ms >= FAULT_MS + 6_000 {
            (fitted.force, fitted.rate, fitted.field) = (still.force, still.rate, still.field);
            (fitted.attitude_noise, fitted.quad.roll) = (0.0, 0.3);
        }
    });
    assert!(findings.iter().all(|one| !one.check.ends_with("_stuck")), "{findings:?}");
}

#[test]
fn what_was_so_before_a_hole_is_not_held_through_it() {
    let findings = fly(|now_ms, fitted| {
        let since_ms = now_ms.saturating_sub(FAULT_MS);
        fitted.silence = FAULT_MS + 500..FAULT_MS + 5_500;
        if (1..500).contains(&since_ms) || (5_500..5_900).contains(&since_ms) {
            fitted.quad.throttle = 1.0;
        }
        if (1..500).contains(&since_ms) {
            fitted.wanted[0] = -2.5;
        }
    });
    let held = |one: &&Finding| matches!(one.check, "thrust_lost" | "roll_rate");
    assert_eq!(findings.iter().find(held), None, "{findings:?}");
}

#[test]
fn what_is_so_from_the_beginning_is_usual() {
    is_quiet(|_, fitted| {
        fitted.force[1][0] += 3.0;
        fitted.rate[1][0] += 0.4;
        fitted.field[1] = [0.5, 0.0, -0.1];
        fitted.pressure[1] += 5.0;
        fitted.pulses[2] += 150.0;
        fitted.quad.vibration.levels = [Some(20.0); 3];
    });
}

#[test]
fn a_fast_turn_and_a_vtol_say_nothing_about_sensors() {
    let apart = |now_ms: u64, fitted: &mut Fitted| {
        if now_ms >= FAULT_MS {
            fitted.force[1][0] += 3.0;
            fitted.field[1] = [0.5, 0.1 * fitted.field[1][2], -0.1];
        }
    };
    is_quiet(|now_ms, fitted| {
        apart(now_ms, fitted);
        fitted.yaw_rate = if now_ms >= FAULT_MS { 1.0 } else { 0.0 };
    });
    is_quiet(|now_ms, fitted| {
        apart(now_ms, fitted);
        fitted.rate[1][0] += if now_ms >= FAULT_MS { 0.4 } else { 0.0 };
        (fitted.quad.kind, fitted.quad.type_number) = (VehicleKind::Vtol, 20);
    });
}

#[test]
fn on_a_fast_leg_sensors_and_vibration_are_judged_too() {
    const QUADROTOR: u8 = 2;
    const HELICOPTER: u8 = 4;
    let first = |type_number, fault: fn(&mut Fitted)| {
        let findings = fly(|now_ms, fitted| {
            (fitted.quad.type_number, fitted.speed) = (type_number, 10.0);
            if now_ms >= FAULT_MS {
                fault(fitted);
            }
        });
        let [found] = findings[..] else { panic!("{findings:?}") };
        assert!((FAULT_MS..FAULT_MS + 6_000).contains(&found.at.as_millis()), "{found:?}");
        (found.check, found.instance)
    };
    assert_eq!(first(QUADROTOR, |fitted| fitted.force[1][2] += 3.0), ("accel_mismatch", 1));
    assert_eq!(first(HELICOPTER, |fitted| fitted.rate[2][0] += 0.4), ("gyro_mismatch", 2));
    let shakes = |fitted: &mut Fitted| fitted.quad.vibration.levels[0] = Some(18.0);
    assert_eq!(first(HELICOPTER, shakes), ("vibration_rise", 0));
    is_quiet(|_, fitted| fitted.speed = 10.0);
}

#[test]
fn position_messages_that_stop_are_told() {
    let findings = fly(|now_ms, fitted| fitted.places = now_ms < FAULT_MS);
    let found = findings.first().expect("something");
    assert_eq!((found.check, found.level), ("position_silent", Level::Warning));
    assert!(found.at.as_millis() < FAULT_MS + 3_500, "{found:?}");
    assert!(findings.iter().skip(1).all(|one| one.level == Level::Stale), "{findings:?}");
}

#[test]
fn of_two_heights_the_one_that_leapt_is_named() {
    let fly = |fault: fn(u64, &mut Fitted)| {
        fly(|now_ms, fitted| {
            if now_ms >= FAULT_MS {
                fault(now_ms - FAULT_MS, fitted);
            }
        })
    };
    for leap_m in [15.0, -15.0] {
        let findings = if leap_m > 0.0 {
            fly(|_, fitted| fitted.altitude += 15.0)
        } else {
            fly(|_, fitted| fitted.altitude -= 15.0)
        };
        let found = findings.first().expect("something");
        assert_eq!((found.check, found.because), ("gps_height", ""), "{findings:?}");
        assert!(found.at.as_millis() < FAULT_MS + 600, "{found:?}");
        let height = findings.iter().find(|one| one.check == "baro_height").expect("they are apart");
        assert_eq!(height.because, "gps_height");
    }
    // A slow drift is blamed on neither, and a leap of the barometer belongs to another check.
    let drifts = fly(|since_ms, fitted| fitted.altitude += since_ms as f32 * 0.0005);
    assert!(drifts.iter().all(|one| one.check == "baro_height"), "{drifts:?}");
    let leaps = fly(|_, fitted| fitted.pressure.iter_mut().for_each(|pressure| *pressure -= 1.8));
    assert!(leaps.iter().all(|one| one.check == "baro_height"), "{leaps:?}");
}

#[test]
fn an_estimator_that_leaves_the_second_one_is_named() {
    const POSITION_ABSOLUTE: u16 = 16;
    let fly = |flags: u16, apart: [f32; 3], kind: VehicleKind| {
        fly(|now_ms, fitted| {
            (fitted.quad.estimator.flags, fitted.quad.kind) = (flags, kind);
            fitted.second = Some(if now_ms >= FAULT_MS { apart } else { [0.2, 0.0, 2.0] });
        })
    };
    let rotors = VehicleKind::Rotorcraft;
    for (apart, check) in [
        ([0.7, 0.0, 0.0], "ahrs2_tilt"),
        ([0.0, -11.0, 0.0], "ahrs2_height"),
        ([0.0, 0.0, 25.0], "ahrs2_position"),
    ] {
        let findings = fly(POSITION_ABSOLUTE, apart, rotors);
        let [found] = findings[..] else { panic!("{findings:?}") };
        assert_eq!((found.check, found.level), (check, Level::Warning));
        assert!((FAULT_MS + 1_000..FAULT_MS + 2_500).contains(&found.at.as_millis()), "{found:?}");
        assert_eq!(fly(POSITION_ABSOLUTE, apart, VehicleKind::Vtol), [], "it has two sets of axes");
    }
    let falls = fly(POSITION_ABSOLUTE, [0.0, -20.0, 0.0], rotors);
    assert!(falls.iter().any(|one| (one.check, one.level) == ("ahrs2_height", Level::Critical)), "{falls:?}");
    assert_eq!(
        fly(POSITION_ABSOLUTE, [0.4, 5.0, 8.0], rotors),
        [],
        "as manoeuvres, weather and a receiver do"
    );
    assert_eq!(fly(0, [0.0, 0.0, 25.0], rotors), [], "it flies by optical flow");
}

#[test]
fn a_second_estimator_without_an_exact_receiver_is_no_witness() {
    let inexact = |until_ms: u64| {
        move |now_ms: u64, fitted: &mut Fitted| {
            fitted.second = Some([0.7, 15.0, 0.0]);
            // A receiver without an accuracy has its dilution only.
            (fitted.quad.gnss.accuracy, fitted.quad.gnss.hdop) = (None, Some(1.0));
            if (20_000..until_ms).contains(&now_ms) {
                fitted.quad.gnss.fix = 1;
            }
        }
    };
    let checks = |findings: Vec<Finding>| findings.into_iter().map(|one| one.check).collect::<Vec<_>>();
    let tilts = checks(fly(inexact(0)));
    assert_eq!(tilts, ["ahrs2_tilt"], "and a height that was so from the beginning is usual");
    let none = checks(fly(|now_ms, fitted| {
        inexact(0)(now_ms, fitted);
        fitted.quad.gnss.fix = 1;
    }));
    assert_eq!(none, [""; 0], "it never had a fix");
    // It takes a while to level out.
    let late = fly(|now_ms, fitted| {
        inexact(30_000)(now_ms, fitted);
        fitted.second = fitted.second.filter(|_| now_ms >= 20_000);
    });
    let tilt = late.iter().find(|one| one.check == "ahrs2_tilt").expect("found");
    assert!((45_000..48_000).contains(&tilt.at.as_millis()), "{late:?}");
}

#[test]
fn satellites_that_go_are_told_while_the_receiver_is_still_exact() {
    finds("gps_sats_fall", 0, Level::Warning, 2_500, |_, fitted| fitted.quad.gnss.satellites = Some(9));
    finds("gps_hdop_rise", 0, Level::Warning, 2_500, |_, fitted| fitted.quad.gnss.hdop = Some(2.2));
    is_quiet(|now_ms, fitted| {
        fitted.quad.gnss.satellites = Some(if now_ms / 3_000 % 2 == 0 { 9 } else { 7 });
        fitted.quad.gnss.hdop = Some(if now_ms / 3_000 % 2 == 0 { 1.5 } else { 2.0 });
    });
    let findings = fly(|now_ms, fitted| {
        if now_ms >= FAULT_MS {
            (fitted.quad.gnss.satellites, fitted.quad.gnss.accuracy) = (Some(5), Some(Metres(2.0)));
        }
    });
    let told: Vec<(&str, &str)> = findings.iter().map(|one| (one.check, one.because)).collect();
    assert_eq!(told, [("gps_satellites", ""), ("gps_sats_fall", "gps_satellites")]);
}

#[test]
fn vibration_that_jumps_is_named_and_gusts_are_not() {
    finds("vibration_rise", 0, Level::Warning, 1_000, |_, fitted| {
        fitted.quad.vibration.levels = [Some(5.0), Some(18.0), Some(5.0)];
    });
    is_quiet(|now_ms, fitted| {
        let gust = 5.0 + 3.0 * noise(now_ms / 2_000, 1) + noise(now_ms, 2);
        fitted.quad.vibration.levels = [Some(gust); 3];
    });
    is_quiet(|now_ms, fitted| {
        let is_shock = (FAULT_MS..FAULT_MS + 100).contains(&now_ms);
        fitted.quad.vibration.levels = [Some(if is_shock { 200.0 } else { 5.0 }); 3];
    });
}

fn turned(fitted: &mut Fitted, degrees: f32) {
    let (sin, cos) = degrees.to_radians().sin_cos();
    for field in &mut fitted.field {
        let [x, y, z] = *field;
        *field = [cos * x - sin * y, sin * x + cos * y, z];
    }
}

#[test]
fn a_compass_whose_heading_leaves_the_estimators_is_named_and_declination_and_turns_are_not() {
    for degrees in [-25.0, 25.0, 170.0] {
        finds("compass_heading", 0, Level::Warning, 1_000, |_, fitted| turned(fitted, degrees));
    }
    is_quiet(|_, fitted| turned(fitted, 175.0));
    is_quiet(|now_ms, fitted| turned(fitted, if now_ms < FAULT_MS { 0.0 } else { 8.0 }));
    // While it turns the two are not of one moment.
    is_quiet(|now_ms, fitted| {
        if now_ms >= FAULT_MS {
            turned(fitted, 25.0);
            fitted.yaw_rate = 0.3;
        }
    });
}

#[test]
fn a_compass_that_stood_still_for_a_whole_turn_is_good_again() {
    let findings = fly(|now_ms, fitted| {
        let turned_s = (now_ms.clamp(FAULT_MS, FAULT_MS + 20_000) - FAULT_MS) as f32 / 1e3;
        turned(fitted, 18.0 * turned_s);
    });
    let mine = findings.iter().filter(|one| one.check == "compass_heading");
    let told: Vec<_> = mine.map(|one| one.level).collect();
    assert_eq!(told, [Level::Warning, Level::Ok], "{findings:?}");
}

#[test]
fn a_weak_motor_of_a_quadrotor_is_named() {
    for motor in 0..4_u8 {
        finds("motor_output", motor, Level::Warning, 1_500, |_, fitted| {
            fitted.pulses[usize::from(motor)] += 150.0;
        });
        finds("motor_output", motor, Level::Critical, 5_000, |_, fitted| {
            fitted.pulses[usize::from(motor)] += 400.0;
        });
    }
    finds("motor_off", 1, Level::Critical, 6_000, |_, fitted| fitted.pulses[1] = 1_000.0);
}

#[test]
fn a_motor_that_is_a_little_weak_is_named_once_it_has_been_so_for_long() {
    // Its output stands out by 6 to 8 %, which is not a warning at once.
    finds("motor_output", 2, Level::Warning, 28_000, |_, fitted| fitted.pulses[2] += 44.0);
    is_quiet(|now_ms, fitted| {
        let is_gust = (FAULT_MS..FAULT_MS + 4_000).contains(&now_ms);
        fitted.pulses[2] += if is_gust { 44.0 } else { 0.0 };
    });
    is_quiet(|now_ms, fitted| {
        let yaws = now_ms >= FAULT_MS;
        (fitted.yaw_rate, fitted.pulses[2]) =
            if yaws { (1.0, fitted.pulses[2] + 60.0) } else { (0.0, fitted.pulses[2]) };
    });
}

/// A hexarotor's commands after one motor lost thrust worth `loss` us: the projection on thrust, roll, pitch and yaw.
fn hexa(fitted: &mut Fitted, now_ms: u64, shift: [f32; 6]) {
    fitted.quad.type_number = 13;
    for (motor, pulse) in (0..6).zip(&mut fitted.pulses) {
        let flies = 1_500.0 + 15.0 * noise(now_ms, motor + 60) + shift[motor as usize];
        *pulse = if now_ms < OFF_MS { 1_000.0 } else { flies };
    }
}

#[test]
fn a_weak_motor_of_a_hexarotor_is_named() {
    // Round the frame from the weak one on: 2/3, 1/6, 1/6, -1/3, 1/6, 1/6 of the loss.
    let weak = [267.0, 67.0, 67.0, -133.0, 67.0, 67.0];
    let findings =
        fly(|now_ms, fitted| hexa(fitted, now_ms, if now_ms < FAULT_MS { [0.0; 6] } else { weak }));
    let found = findings.iter().find(|one| one.level == Level::Warning).unwrap();
    assert_eq!((found.check, found.instance), ("motor_output", 0));
    assert!((FAULT_MS..FAULT_MS + 4_000).contains(&found.at.as_millis()), "{found:?}");
}

#[test]
fn a_dead_motor_at_its_end_stop_stays_the_weak_one_while_the_one_opposite_idles() {
    let findings = fly(|now_ms, fitted| {
        let dead = [-350.0, 450.0, 130.0, 130.0, 130.0, 130.0];
        hexa(fitted, now_ms, if now_ms < FAULT_MS { [0.0; 6] } else { dead });
    });
    let told: Vec<_> = findings.iter().filter(|one| one.check.starts_with("motor_o")).collect();
    let last = told.last().expect("it is dead");
    assert!(told.iter().all(|one| (one.check, one.instance) == ("motor_output", 1)), "{told:?}");
    assert_eq!(last.level, Level::Critical);
}

#[test]
fn a_motor_that_is_given_nothing_is_off_and_not_weak() {
    let findings = fly(|now_ms, fitted| {
        let cut = [125.0, 125.0, -500.0, 125.0, 125.0, -480.0];
        hexa(fitted, now_ms, if now_ms < FAULT_MS { [0.0; 6] } else { cut });
    });
    let told: Vec<_> = findings.iter().filter(|one| one.check.starts_with("motor_o")).collect();
    assert!(told.iter().all(|one| (one.check, one.instance) == ("motor_off", 2)), "{told:?}");
    assert_eq!(told.last().map(|one| one.level), Some(Level::Critical));
}

/// An octocopter's commands round the frame, or of its four arms one after the other (`arms`: two motors each, which turn against each other).
fn octa(fitted: &mut Fitted, now_ms: u64, shift: [f32; 8]) {
    fitted.quad.type_number = 14;
    for (motor, pulse) in (0..8).zip(&mut fitted.pulses) {
        let flies = 1_500.0 + 15.0 * noise(now_ms, motor + 80) + shift[motor as usize];
        *pulse = if now_ms < OFF_MS { 1_000.0 } else { flies };
    }
}

/// Changes of the commands of eight motors that make up for these amounts of thrust, tilt towards an arm, and yaw.
fn eight(arms: bool, thrust: f32, tilt: f32, yaw: f32) -> [f32; 8] {
    core::array::from_fn(|motor| {
        let round = if arms { (motor / 2) as f32 / 4.0 } else { motor as f32 / 8.0 };
        let turns = if (motor + usize::from(arms) * (motor / 2)) % 2 == 0 { 1.0 } else { -1.0 };
        thrust / 8.0 + tilt / 4.0 * (round * core::f32::consts::TAU).cos() + yaw / 8.0 * turns
    })
}

#[test]
fn a_weak_motor_of_an_octocopter_is_named() {
    for arms in [false, true] {
        // The projection of a motor that lost thrust worth 200 us on thrust, roll, pitch and yaw.
        let weak = eight(arms, 200.0, 200.0, 200.0);
        for place in [0, 1, 7] {
            let mut shift = weak;
            shift.rotate_right(place);
            let shift = |now_ms| if now_ms < FAULT_MS { [0.0; 8] } else { shift };
            // A frame that is put together by parameters may call itself a quadrotor.
            for type_number in [14, 2] {
                let findings = fly(|now_ms, fitted| {
                    octa(fitted, now_ms, shift(now_ms));
                    fitted.quad.type_number = type_number;
                });
                let found = findings.iter().find(|one| one.level == Level::Warning).unwrap();
                assert_eq!((found.check, usize::from(found.instance)), ("motor_output", place));
                assert!((FAULT_MS..FAULT_MS + 5_000).contains(&found.at.as_millis()), "{found:?}");
            }
        }
        for shift in [
            eight(arms, 600.0, 0.0, 0.0),
            eight(arms, 0.0, 400.0, 0.0),
            eight(arms, 0.0, 0.0, 600.0),
            eight(arms, 200.0, 400.0, 0.0),
        ] {
            is_quiet(|now_ms, fitted| {
                octa(fitted, now_ms, if now_ms < FAULT_MS { [0.0; 8] } else { shift });
            });
        }
    }
}

#[test]
fn load_wind_and_yaw_change_outputs_in_pairs_and_say_nothing() {
    let quad =
        [[150.0, -150.0, 0.0, 0.0], [100.0, -100.0, 100.0, -100.0], [90.0, 90.0, -90.0, -90.0], [150.0; 4]];
    for shift in quad {
        is_quiet(|now_ms, fitted| {
            if now_ms >= FAULT_MS {
                fitted.pulses.iter_mut().zip(shift).for_each(|(pulse, shift)| *pulse += shift);
            }
        });
    }
    let hexas = [
        [150.0, 75.0, -75.0, -150.0, -75.0, 75.0],
        [130.0, 0.0, -130.0, -130.0, 0.0, 130.0],
        [80.0, -80.0, 80.0, -80.0, 80.0, -80.0],
    ];
    for shift in hexas {
        is_quiet(|now_ms, fitted| hexa(fitted, now_ms, if now_ms < FAULT_MS { [0.0; 6] } else { shift }));
    }
}

#[test]
fn a_servo_among_the_first_outputs_and_a_flight_that_was_not_seen_to_begin_are_not_judged() {
    let weak = |now_ms: u64, fitted: &mut Fitted| {
        if now_ms >= FAULT_MS {
            fitted.pulses[0] += 400.0;
        }
    };
    is_quiet(|now_ms, fitted| {
        weak(now_ms, fitted);
        fitted.pulses[3] = 1_500.0;
    });
    is_quiet(|now_ms, fitted| {
        weak(now_ms, fitted);
        if now_ms < OFF_MS {
            fitted.pulses = [0.0; MOTORS_MAX];
        }
    });
}

#[test]
fn px4_that_stops_using_its_compass_is_named() {
    let px4 = |compass| Estimator {
        scale: EstimatorScale::TestRatio,
        velocity: Some(0.1),
        position_horizontal: Some(0.1),
        position_vertical: Some(0.1),
        compass,
        ..Estimator::default()
    };
    let stops = |degrees: f32| {
        fly(move |now_ms, fitted| {
            fitted.quad.estimator = px4(if now_ms < FAULT_MS { Some(0.1) } else { None });
            turned(fitted, if now_ms < FAULT_MS { 0.0 } else { degrees });
        })
    };
    // It pauses the use of sound ones too.
    let paused = stops(0.0);
    assert!(paused.iter().all(|finding| finding.level == Level::Stale), "{paused:?}");
    let findings = stops(11.0);
    // Its test ratio is not sent any more.
    let told: Vec<_> = findings.iter().filter(|finding| finding.level != Level::Stale).collect();
    let [found] = told[..] else { panic!("{findings:?}") };
    assert_eq!((found.check, found.level), ("compass_unused", Level::Warning));
    assert!((FAULT_MS + 500..FAULT_MS + 900).contains(&found.at.as_millis()), "{found:?}");
    is_quiet(|_, fitted| {
        (fitted.quad.autopilot, fitted.quad.estimator) = (Autopilot::Px4, px4(None));
        fitted.quad.vibration.levels = [Some(0.0), Some(0.0), Some(1.0)];
    });
}

#[test]
fn a_sensor_that_repeats_one_value_is_named() {
    for sensor in 0..3_u8 {
        let place = usize::from(sensor);
        let held = Fitted::healthy(FAULT_MS);
        finds("accel_stuck", sensor, Level::Warning, 1_500, |_, fitted| {
            fitted.force[place] = held.force[place];
        });
        finds("gyro_stuck", sensor, Level::Warning, 1_500, |_, fitted| fitted.rate[place] = held.rate[place]);
        finds("compass_stuck", sensor, Level::Warning, 1_500, |_, fitted| {
            fitted.field[place] = held.field[place];
        });
        // It sinks with half a metre a second.
        finds("baro_stuck", sensor, Level::Warning, 2_500, |now_ms, fitted| {
            fitted.pressure[place] = held.pressure[place];
            if now_ms >= FAULT_MS {
                fitted.quad.climb = -0.5;
            }
        });
    }
    finds("gps_stuck", 0, Level::Warning, 1_500, |_, fitted| fitted.gps_until_ms = FAULT_MS);
}

#[test]
fn compasses_that_all_repeat_their_values_are_stuck_once_the_vehicle_turns() {
    let held = Fitted::healthy(FAULT_MS);
    // A vehicle that holds still, with an estimator that drifts.
    is_quiet(|now_ms, fitted| {
        if now_ms >= FAULT_MS {
            (fitted.field, fitted.attitude_noise) = (held.field, 0.0);
            fitted.quad.roll = (now_ms - FAULT_MS).min(5_000) as f32 * 0.008 / 1_000.0;
        }
    });
    is_quiet(|now_ms, fitted| {
        let late_ms = [200, 0, 0];
        for (field, late_ms) in fitted.field.iter_mut().zip(late_ms) {
            let is_changed = now_ms >= FAULT_MS + 3_000 + late_ms;
            let still_ms = if is_changed { FAULT_MS + 3_000 } else { now_ms.min(FAULT_MS) };
            field[2] = 0.4 + 0.01 * noise(still_ms, 40);
        }
        fitted.attitude_noise = if now_ms < FAULT_MS { 0.01 } else { 0.0 };
        let drifts_ms = now_ms.clamp(FAULT_MS, FAULT_MS + 5_000) - FAULT_MS;
        fitted.quad.roll = drifts_ms as f32 * 0.008 / 1_000.0;
    });
    let findings = fly(|now_ms, fitted| {
        if now_ms >= FAULT_MS {
            fitted.field = held.field;
            fitted.attitude_noise = 0.05;
        }
    });
    for part in 0..3 {
        let told = |finding: &Finding| finding.check == "compass_stuck" && finding.instance == part;
        let at_ms = findings.iter().find(|finding| told(finding)).map(|finding| finding.at.as_millis());
        assert!(at_ms.is_some_and(|at_ms| at_ms < FAULT_MS + 3_000), "{part}: {findings:?}");
    }
}

#[test]
fn a_slow_sensor_and_one_that_always_says_the_same_are_not_stuck() {
    is_quiet(|now_ms, fitted| {
        let slow = Fitted::healthy(now_ms / 2_000 * 2_000);
        (fitted.field, fitted.pressure, fitted.gps_until_ms) =
            (slow.field, slow.pressure, now_ms / 2_000 * 2_000);
    });
    let first = Fitted::healthy(0);
    is_quiet(|_, fitted| (fitted.field, fitted.force) = (first.field, first.force));
}

#[test]
fn a_barometer_that_leaves_the_height_of_gps_is_named() {
    // 10 m, at once and at half a metre a second.
    finds("baro_height", 0, Level::Warning, 3_000, |_, fitted| {
        fitted.pressure.iter_mut().for_each(|pressure| *pressure += 1.5);
    });
    finds("baro_height", 0, Level::Warning, 25_000, |now_ms, fitted| {
        let drift_hpa = (now_ms - FAULT_MS) as f32 * 0.06 / 1_000.0;
        fitted.pressure.iter_mut().for_each(|pressure| *pressure -= drift_hpa);
    });
}

#[test]
fn weather_a_warm_day_and_the_wind_of_the_flight_move_a_healthy_barometer() {
    // 0.05 hPa in 10 s: 2 hPa in seven minutes.
    is_quiet(|now_ms, fitted| {
        let weather = now_ms as f32 * 0.005 / 1_000.0;
        fitted.pressure.iter_mut().for_each(|pressure| *pressure += weather);
    });
    // 100 m up, by a scale that is wrong by 8 %.
    is_quiet(|now_ms, fitted| {
        let up_m = (now_ms.saturating_sub(10_000) as f32 / 1_000.0 * 1.8).min(100.0);
        (fitted.quad.height, fitted.quad.climb) = (20.0 + up_m, if up_m < 100.0 { 1.8 } else { 0.0 });
        fitted.altitude += up_m;
        fitted.pressure.iter_mut().for_each(|pressure| *pressure -= up_m * 1.08 * 0.118);
    });
}

#[test]
fn a_noisy_barometer_is_named() {
    finds("baro_noise", 0, Level::Warning, 2_000, |now_ms, fitted| {
        fitted.pressure[0] += 0.6 * noise(now_ms, 80);
    });
}

#[test]
fn messages_that_come_late_make_no_noise_of_a_fast_descent() {
    is_quiet(|now_ms, fitted| {
        let fallen_s = (now_ms.saturating_sub(FAULT_MS) as f32 / 1_000.0).min(8.0);
        let falls = fallen_s > 0.0 && fallen_s < 8.0;
        let late_s = if falls { 0.25 * noise(now_ms, 81) } else { 0.0 };
        fitted.quad.climb = if falls { -10.0 } else { 0.0 };
        fitted.quad.climb_wanted = Some(fitted.quad.climb);
        fitted.quad.height = 120.0 - 10.0 * fallen_s;
        fitted.altitude -= 10.0 * fallen_s;
        fitted.pressure.iter_mut().for_each(|pressure| *pressure += 1.18 * (fallen_s + late_s));
    });
}

#[test]
fn what_does_not_turn_as_it_is_told_is_named_and_what_turns_fast_is_not() {
    for (axis, check) in ["roll_rate", "pitch_rate"].into_iter().enumerate() {
        finds(check, 0, Level::Critical, 2_500, |_, fitted| fitted.wanted[axis] = -2.5);
    }
    is_quiet(|now_ms, fitted| {
        // Hard turns to and fro, a tenth of a second late.
        let turning = |now_ms: u64| [3.0 * (now_ms as f32 / 400.0).sin(), 0.0];
        (fitted.wanted, fitted.turns) = (turning(now_ms), turning(now_ms.saturating_sub(100)));
    });
    is_quiet(|now_ms, fitted| {
        // An old setpoint differs from the present one, which was not received.
        fitted.wants = now_ms.is_multiple_of(400);
        fitted.turns = [if fitted.wants { 3.0 } else { -1.0 }, 0.0];
        fitted.wanted = fitted.turns;
    });
}

#[test]
fn rates_about_the_axes_of_the_wanted_attitude_are_turned_to_the_bodys() {
    // A quarter of a turn behind the heading setpoint: to pitch is to roll to the left, a tenth of a second late.
    let lags = |now_ms: u64, fitted: &mut Fitted| {
        let turning = |now_ms: u64| 3.0 * (now_ms as f32 / 2_000.0).sin();
        let half = core::f32::consts::FRAC_1_SQRT_2;
        fitted.wanted_of = Some([half, 0.0, 0.0, half]);
        (fitted.wanted, fitted.turns) = ([0.0, turning(now_ms)], [-turning(now_ms.saturating_sub(100)), 0.0]);
    };
    is_quiet(lags);
    // PX4's are about the body's own axes.
    let findings = fly(|now_ms, fitted| {
        lags(now_ms, fitted);
        fitted.quad.autopilot = Autopilot::Px4;
    });
    assert!(findings.iter().any(|one| one.check == "roll_rate"), "{findings:?}");
}

#[test]
fn full_throttle_without_a_climb_is_named() {
    finds("thrust_lost", 0, Level::Warning, 2_500, |_, fitted| fitted.quad.throttle = 1.0);
    is_quiet(|now_ms, fitted| {
        if now_ms >= FAULT_MS {
            (fitted.quad.throttle, fitted.quad.climb) = (1.0, 3.0);
        }
    });
}

#[test]
fn full_throttle_that_was_in_vain_is_until_it_climbs() {
    let findings = fly(|now_ms, fitted| {
        if now_ms >= FAULT_MS {
            fitted.quad.throttle = 1.0;
            fitted.quad.roll = if now_ms < FAULT_MS + 5_000 { 0.02 } else { 0.6 };
            fitted.quad.climb = if now_ms < FAULT_MS + 15_000 { 0.1 } else { 1.0 };
        }
    });
    let mine = findings.iter().filter(|one| one.check == "thrust_lost");
    let told: Vec<_> = mine.map(|one| (one.level, one.at.as_millis().div_ceil(1_000) * 1_000)).collect();
    let over_ms = FAULT_MS + 17_000;
    assert_eq!(told.first().map(|one| one.0), Some(Level::Warning), "{told:?}");
    assert!(told[1..].iter().all(|(_, at_ms)| *at_ms >= over_ms) && told.len() == 2, "{told:?}");
}

/// Pressures and pilot's display of a climb, in m/s by pressure and by the estimator.
fn climbs(fitted: &mut Fitted, seconds: f32, by_pressure: f32, by_estimator: f32) {
    fitted.pressure.iter_mut().for_each(|pressure| *pressure -= 0.12 * by_pressure * seconds);
    fitted.hud_climb = Some(by_estimator + 0.01);
    fitted.altitude += by_pressure * seconds;
    fitted.quad.climb = by_pressure;
}

#[test]
fn an_estimator_that_falls_while_the_barometer_climbs_is_named() {
    let climb = |now_ms: u64, by_estimator: f32| {
        move |fitted: &mut Fitted| {
            let seconds = now_ms.saturating_sub(FAULT_MS) as f32 / 1_000.0;
            let (by_pressure, by_estimator) =
                if now_ms < FAULT_MS { (0.0, 0.0) } else { (3.0, by_estimator) };
            climbs(fitted, seconds, by_pressure, by_estimator);
        }
    };
    is_quiet(|now_ms, fitted| climb(now_ms, 3.0)(fitted));
    is_quiet(|now_ms, fitted| climb(now_ms, 0.0)(fitted));
    for (by_estimator, level, within_ms) in [(-7.0, Level::Warning, 3_000), (-17.0, Level::Critical, 3_000)] {
        finds("ekf_climb", 0, level, within_ms, |now_ms, fitted| climb(now_ms, by_estimator)(fitted));
    }
    is_quiet(|now_ms, fitted| {
        climb(now_ms, -15.0)(fitted);
        (fitted.quad.kind, fitted.quad.type_number) = (VehicleKind::Vtol, 20);
    });
}

#[test]
fn a_simulator_without_noise_that_trembles_in_a_hover_has_no_stuck_sensors() {
    is_quiet(|now_ms, fitted| {
        if now_ms >= FAULT_MS {
            let still = Fitted::healthy(FAULT_MS);
            (fitted.force, fitted.rate, fitted.field) = (still.force, still.rate, still.field);
            fitted.pressure = still.pressure;
            // An estimator's attitude in its last digits, and a climb with an offset.
            (fitted.attitude_noise, fitted.quad.climb) = (0.001, -0.11);
        }
    });
}
