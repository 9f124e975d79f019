//! Departures from the usual level of a flight are named in time: sensors against each other, vibration, a motor's
//! output, the estimator's compass. Offsets from the beginning, wind, load, turns and missing parts raise nothing.
#![expect(clippy::panic, reason = "that is how a test fails")]

use crate::common::{AUTOPILOT, Quad};
use hums_core::Monitor;
use hums_core::health::Finding;
use hums_core::health::Level::{self, Critical, Warning};
use hums_core::observation::{
    Air, Attitude, AttitudeSetpoint, Autopilot, Estimator, EstimatorScale, Imu, LandedState, MOTORS_MAX,
    Observation, Outputs, SecondEstimate, VehicleKind, WantedRates,
};
use hums_core::parameters::Params;
use hums_core::status::LinkReading;
use hums_core::time::BootMs;
use hums_core::units::{
    Gauss, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2, Position, Radians, RadiansPerSecond,
};

/// Take-off at 4 s; faults begin at 30 s.
const OFF_MS: u64 = 4_000;
const FAULT_MS: u64 = 30_000;
const END_MS: u64 = 60_000;

#[derive(Clone, Default)]
struct Fitted {
    quad: Quad,
    force: [[f32; 3]; 3],
    rate: [[f32; 3]; 3],
    field: [[f32; 3]; 3],
    pressure: [f32; 3],
    pulses: [f32; MOTORS_MAX],
    yaw_rate: f32,
    turns: [f32; 2],
    wanted: [f32; 2],
    /// The attitude whose axes these are about.
    wanted_of: Option<[f32; 4]>,
    wants: bool,
    altitude: f32,
    attitude_noise: f32,
    /// The climb of `VFR_HUD`, m/s.
    hud_climb: Option<f32>,
    gps_until_ms: u64,
    speed: f32,
    gps_speed: Option<f32>,
    gps_north: f32,
    places: bool,
    second: Option<[f32; 3]>,
    speaks: [bool; 3],
    /// The first sensor's message is `HIGHRES_IMU`.
    selects: bool,
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
        let (attitude_noise, gps_until_ms, speed, speaks) = (0.01, u64::MAX, 1.0, [true; 3]);
        let (wants, places) = (true, true);
        let sensors = Self { quad, force, rate, field, pressure, pulses, turns, altitude, ..Self::default() };
        Self { wants, attitude_noise, gps_until_ms, speed, places, speaks, ..sensors }
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
            said.push(Observation::AttitudeSetpoint(AttitudeSetpoint {
                rates,
                ..AttitudeSetpoint::default()
            }));
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

fn fly_after(fault: impl Fn(u64, &mut Fitted)) -> Vec<Finding> {
    fly(|now_ms, it| {
        if now_ms >= FAULT_MS {
            fault(now_ms, it);
        }
    })
}

fn fly_with(rhythm: [(u64, u64); 3], script: impl Fn(u64, &mut Fitted)) -> Vec<Finding> {
    let mut monitor = Monitor::new(Params::defaults());
    let mut findings = Vec::new();
    for now_ms in (0..END_MS).step_by(if rhythm == [(100, 0); 3] { 50 } else { 25 }) {
        let now = BootMs::from_millis(now_ms);
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
fn only(findings: &[Finding]) -> (&'static str, u8, u64) {
    let [found] = findings[..] else { panic!("{findings:?}") };
    assert_eq!(found.level, Warning);
    (found.check, found.instance, found.at.as_millis().saturating_sub(FAULT_MS))
}

type Fault = fn(u64, &mut Fitted, usize);

fn held() -> Fitted {
    Fitted::healthy(FAULT_MS)
}

fn since_s(now_ms: u64) -> f32 {
    now_ms.saturating_sub(FAULT_MS) as f32 / 1_000.0
}

/// The check that finds a fault, of each of these instances, its level, the time until then, ms, and the fault.
type Found = (&'static str, &'static [usize], Level, u64, Fault);

const FOUND: &[Found] = &[
    ("accel_mismatch", &[0, 1, 2], Warning, 3_200, |_, it, of| it.force[of][2] += 3.0),
    ("gyro_mismatch", &[0, 1, 2], Warning, 1_000, |_, it, of| it.rate[of][0] += 0.4),
    ("compass_mismatch", &[0, 1, 2], Warning, 1_000, |_, it, of| {
        it.field[of] = [0.5, 0.1 * it.field[of][2], -0.1];
    }),
    ("baro_mismatch", &[1, 2], Warning, 1_300, |_, it, of| it.pressure[of] += 2.5),
    ("accel_stuck", &[0, 1, 2], Warning, 1_500, |_, it, of| it.force[of] = held().force[of]),
    ("gyro_stuck", &[0, 1, 2], Warning, 1_500, |_, it, of| it.rate[of] = held().rate[of]),
    ("compass_stuck", &[0, 1, 2], Warning, 1_500, |_, it, of| it.field[of] = held().field[of]),
    ("baro_stuck", &[0, 1, 2], Warning, 2_500, |_, it, of| {
        (it.pressure[of], it.quad.climb) = (held().pressure[of], -0.5);
    }),
    ("gps_stuck", &[0], Warning, 1_500, |_, it, _| it.gps_until_ms = FAULT_MS),
    ("gps_sats_fall", &[0], Warning, 2_500, |_, it, _| it.quad.gnss.satellites = Some(9)),
    ("gps_hdop_rise", &[0], Warning, 2_500, |_, it, _| it.quad.gnss.hdop = Some(2.2)),
    ("vibration_rise", &[0], Warning, 1_000, |_, it, _| {
        it.quad.vibration.levels = [Some(5.0), Some(18.0), Some(5.0)];
    }),
    ("compass_heading", &[0], Warning, 1_000, |_, it, _| turned(it, -25.0)),
    ("compass_heading", &[0], Warning, 1_000, |_, it, _| turned(it, 170.0)),
    ("baro_height", &[0], Warning, 3_000, |_, it, _| rises(it, -1.5)),
    ("baro_height", &[0], Warning, 25_000, |ms, it, _| rises(it, 0.06 * since_s(ms))),
    ("baro_noise", &[0], Warning, 2_000, |ms, it, _| it.pressure[0] += 0.6 * noise(ms, 80)),
    ("motor_output", &[0, 1, 2, 3], Warning, 1_500, |_, it, of| it.pulses[of] += 150.0),
    ("motor_output", &[0, 1, 2, 3], Critical, 5_000, |_, it, of| it.pulses[of] += 400.0),
    // It stands out by 6 to 8 %, which is not a warning at once.
    ("motor_output", &[2], Warning, 28_000, |_, it, of| it.pulses[of] += 44.0),
    ("roll_rate", &[0], Critical, 2_500, |_, it, _| it.wanted[0] = -2.5),
    ("thrust_lost", &[0], Warning, 2_500, |_, it, _| it.quad.throttle = 1.0),
    ("ekf_climb", &[0], Warning, 3_000, |ms, it, _| climbs(it, since_s(ms), 3.0, -7.0)),
    ("ekf_climb", &[0], Critical, 3_000, |ms, it, _| climbs(it, since_s(ms), 3.0, -17.0)),
];

type Begins = fn(&mut Fitted);

/// The same of a vehicle that is so from the beginning.
const FOUND_OF: &[(Begins, Found)] = &[
    (stands_by_gps, ("imu_gps", &[0], Warning, 3_000, |_, it, _| pull(it, 2, 4.0))),
    (stands_by_gps, ("imu_gps", &[0], Warning, 3_000, |_, it, _| pull(it, 0, -4.0))),
    (
        stands_by_gps,
        ("imu_gps", &[0], Warning, 3_000, |_, it, _| {
            it.quad.roll += 0.4;
            it.field.iter_mut().for_each(|field| field[2] -= 0.4);
        }),
    ),
    (has_two, ("accel_mismatch", &[1], Warning, 4_000, |_, it, _| it.force[0][0] += 3.0)),
    (has_two, ("accel_mismatch", &[1], Warning, 4_000, |_, it, _| it.force[1][0] += 3.0)),
    (selects, ("gyro_mismatch", &[2], Warning, 1_500, |_, it, of| it.rate[of][0] += 0.4)),
    (|it| it.speed = 10.0, ("accel_mismatch", &[1], Warning, 6_000, |_, it, of| it.force[of][2] += 3.0)),
    (helicopter, ("gyro_mismatch", &[2], Warning, 6_000, |_, it, of| it.rate[of][0] += 0.4)),
    (
        helicopter,
        ("vibration_rise", &[0], Warning, 6_000, |_, it, _| it.quad.vibration.levels[0] = Some(18.0)),
    ),
    (|it| it.quad.throttle = 0.0, ("roll_rate", &[0], Critical, 2_500, |_, it, _| it.wanted[0] = -2.5)),
    (
        |it| it.quad.landed = Some(LandedState::Landing),
        ("pitch_rate", &[0], Critical, 2_500, |_, it, _| it.wanted[1] = -2.5),
    ),
    (has_second, ("ahrs2_tilt", &[0], Warning, 2_500, |_, it, _| it.second = Some([0.7, 0.0, 0.0]))),
    (has_second, ("ahrs2_height", &[0], Warning, 2_500, |_, it, _| it.second = Some([0.0, -11.0, 0.0]))),
    (has_second, ("ahrs2_height", &[0], Critical, 2_500, |_, it, _| it.second = Some([0.0, -20.0, 0.0]))),
    (has_second, ("ahrs2_position", &[0], Warning, 2_500, |_, it, _| it.second = Some([0.0, 0.0, 25.0]))),
];

fn stands_by_gps(it: &mut Fitted) {
    it.gps_speed = Some(0.0);
}

fn pull(it: &mut Fitted, axis: usize, mps2: f32) {
    it.force.iter_mut().for_each(|force| force[axis] += mps2);
}

fn helicopter(it: &mut Fitted) {
    (it.quad.type_number, it.speed) = (4, 10.0);
}

/// Its estimator calls the position absolute.
fn has_second(it: &mut Fitted) {
    (it.quad.estimator.flags, it.second) = (16, Some([0.2, 0.0, 2.0]));
}

#[test]
fn a_fault_is_found_in_time_under_its_own_name_and_number_and_no_other() {
    let plain = FOUND.iter().map(|found| (&((|_| ()) as Begins), found));
    let all = plain.chain(FOUND_OF.iter().map(|(begins, found)| (begins, found)));
    for (begins, (check, instances, level, within_ms, fault)) in all {
        for instance in *instances {
            let findings = fly(|now_ms, it| {
                begins(it);
                if now_ms >= FAULT_MS {
                    fault(now_ms, it, *instance);
                }
            });
            let found = findings.iter().find(|finding| finding.level == *level);
            let found = found.unwrap_or_else(|| panic!("{check} never {level:?}: {findings:?}"));
            let is_mine = |one: &Finding| (one.check, usize::from(one.instance)) == (*check, *instance);
            assert!(findings.iter().all(is_mine), "{check} {instance}: {findings:?}");
            let after_ms = found.at.as_millis().saturating_sub(FAULT_MS);
            assert!((1..=*within_ms).contains(&after_ms), "{check} after {after_ms} ms: {findings:?}");
        }
    }
}

#[test]
fn a_rise_of_vibration_explains_other_alarms_at_once() {
    let findings = fly_after(|_, it| {
        (it.quad.vibration.levels, it.force[1][2]) = ([Some(20.0); 3], it.force[1][2] + 3.0);
    });
    let found: Vec<_> = findings.iter().map(|one| (one.check, one.because)).collect();
    assert_eq!(found, [("vibration_rise", ""), ("accel_mismatch", "vibration_rise")]);
}

#[test]
fn a_rise_of_vibration_in_hover_lasts_in_motion_and_damage_at_the_first_motion_is_told() {
    for moves_ms in [FAULT_MS, FAULT_MS + 8_000] {
        let findings = fly_after(|ms, it| {
            (it.quad.vibration.levels, it.speed) = ([Some(18.0); 3], if ms < moves_ms { 1.0 } else { 10.0 });
        });
        assert!(matches!(only(&findings), ("vibration_rise", 0, 1..=1_000)), "{moves_ms}: {findings:?}");
    }
}

#[test]
fn one_wrong_message_before_the_baseline_is_known_hides_no_mismatch() {
    for wrong_ms in (7_000..9_000).step_by(400) {
        let wrong = |ms| [if ms == wrong_ms { 60.0 } else { 0.0 }, 3.0][usize::from(ms >= FAULT_MS)];
        let findings = fly(|ms, it| it.force[1][2] += wrong(ms));
        assert!(matches!(only(&findings), ("accel_mismatch", 1, 1..=5_000)), "{wrong_ms}: {findings:?}");
    }
}

/// Its name, and a script from the beginning on.
type Quiet = (&'static str, fn(u64, &mut Fitted));

const QUIET: &[Quiet] = &[
    ("one motor of four idle, and level: it stands", |_, it| it.pulses[1] = 1_000.0),
    ("rates that idle rotors cannot follow", |ms, it| {
        (it.wanted[0], it.quad.throttle) = if ms < FAULT_MS { (0.0, 0.5) } else { (-2.5, 0.08) };
    }),
    ("offsets from the beginning", |_, it| {
        (it.force[1][0], it.rate[1][0]) = (it.force[1][0] + 3.0, it.rate[1][0] + 0.4);
        (it.field[1], it.pressure[1]) = ([0.5, 0.0, -0.1], it.pressure[1] + 5.0);
        it.pulses[2] += 150.0;
        it.quad.vibration.levels = [Some(20.0); 3];
    }),
    ("a force that changes the velocity", |ms, it| {
        let pulled_s = since_s(ms).min(6.0);
        let coasted_s = since_s(ms) - pulled_s;
        it.gps_speed = Some(3.0 * pulled_s);
        it.gps_north = 3.0 * pulled_s * (pulled_s / 2.0 + coasted_s);
        if pulled_s > 0.0 && coasted_s <= 0.0 {
            it.force.iter_mut().for_each(|force| force[0] += 3.0);
        }
    }),
    ("a third sensor that is not fitted", |_, it| has_two(it)),
    ("a sensor of PX4's choice, less an offset", |ms, it| {
        selects(it);
        if ms >= FAULT_MS {
            (it.rate[0][0], it.force[0][0]) = (it.rate[0][0] + 0.3, it.force[0][0] + 2.0);
            let [_, [_, y, z], [.., down]] = it.field;
            (it.field[1], it.field[2]) = ([-0.3, y, z], [0.3, -0.2, -down]);
        }
    }),
    ("hard turns at one moment with scale errors of a hundredth", |ms, it| {
        let turns = if ms < FAULT_MS { 0.0 } else { 4.0 * (ms as f32 / 300.0).sin() };
        for (rate, scale) in it.rate.iter_mut().zip([1.0, 1.01, 0.99]) {
            rate[0] += scale * turns;
        }
        (it.turns, it.wanted) = ([turns, 0.0], [turns, 0.0]);
    }),
    ("sensors apart in a fast turn", |ms, it| {
        are_apart(ms, it);
        it.yaw_rate = if ms >= FAULT_MS { 1.0 } else { 0.0 };
    }),
    ("sensors apart on a VTOL", |ms, it| {
        are_apart(ms, it);
        it.rate[1][0] += if ms >= FAULT_MS { 0.4 } else { 0.0 };
        become_vtol(it);
    }),
    ("a fast leg", |_, it| it.speed = 10.0),
    ("few satellites, and now and then one or two fewer", |ms, it| {
        let (satellites, hdop) = if ms / 3_000 % 2 == 0 { (9, 1.5) } else { (7, 2.0) };
        (it.quad.gnss.satellites, it.quad.gnss.hdop) = (Some(satellites), Some(hdop));
    }),
    ("gusts that shake", |ms, it| {
        let gust = 5.0 + 3.0 * noise(ms / 2_000, 1) + noise(ms, 2);
        it.quad.vibration.levels = [Some(gust); 3];
    }),
    ("a shock", |ms, it| {
        let is_shock = (FAULT_MS..FAULT_MS + 100).contains(&ms);
        it.quad.vibration.levels = [Some(if is_shock { 200.0 } else { 5.0 }); 3];
    }),
    ("a declination", |_, it| turned(it, 175.0)),
    ("a heading that is off by a little", |ms, it| turned(it, if ms < FAULT_MS { 0.0 } else { 8.0 })),
    ("a heading that is off in a turn", |ms, it| {
        if ms >= FAULT_MS {
            turned(it, 25.0);
            it.yaw_rate = 0.3;
        }
    }),
    ("a motor that works harder in a gust", |ms, it| {
        let is_gust = (FAULT_MS..FAULT_MS + 4_000).contains(&ms);
        it.pulses[2] += if is_gust { 44.0 } else { 0.0 };
    }),
    ("a pilot who yaws for long", |ms, it| {
        if ms >= FAULT_MS {
            (it.yaw_rate, it.pulses[2]) = (1.0, it.pulses[2] + 60.0);
        }
    }),
    ("a servo among the first outputs", |ms, it| {
        it.pulses[0] += if ms >= FAULT_MS { 400.0 } else { 0.0 };
        it.pulses[3] = 1_500.0;
    }),
    ("outputs that come only in the air", |ms, it| {
        it.pulses[0] += if ms >= FAULT_MS { 400.0 } else { 0.0 };
        it.pulses = if ms < OFF_MS { [0.0; MOTORS_MAX] } else { it.pulses };
    }),
    ("a compass that PX4 never used", |_, it| {
        (it.quad.autopilot, it.quad.estimator) = (Autopilot::Px4, px4_estimator(None));
        it.quad.vibration.levels = [Some(0.0), Some(0.0), Some(1.0)];
    }),
    ("compasses that repeat their values while an estimator drifts", |ms, it| {
        if ms >= FAULT_MS {
            (it.field, it.attitude_noise) = (held().field, 0.0);
            it.quad.roll = since_s(ms).min(5.0) * 0.008;
        }
    }),
    ("a change of all compasses that comes 0.2 s later in the first one's message", |ms, it| {
        for (field, late_ms) in it.field.iter_mut().zip([200, 0, 0]) {
            let is_changed = ms >= FAULT_MS + 3_000 + late_ms;
            let still_ms = if is_changed { FAULT_MS + 3_000 } else { ms.min(FAULT_MS) };
            field[2] = 0.4 + 0.01 * noise(still_ms, 40);
        }
        it.attitude_noise = if ms < FAULT_MS { 0.01 } else { 0.0 };
        it.quad.roll = since_s(ms).min(5.0) * 0.008;
    }),
    ("slow sensors", |ms, it| {
        let slow = Fitted::healthy(ms / 2_000 * 2_000);
        (it.field, it.pressure, it.gps_until_ms) = (slow.field, slow.pressure, ms / 2_000 * 2_000);
    }),
    ("sensors that always measure the same", |_, it| {
        let first = Fitted::healthy(0);
        (it.field, it.force) = (first.field, first.force);
    }),
    ("a simulator without noise that trembles in a hover", |ms, it| {
        if ms >= FAULT_MS {
            (it.force, it.rate, it.field) = (held().force, held().rate, held().field);
            (it.pressure, it.attitude_noise, it.quad.climb) = (held().pressure, 0.001, -0.11);
        }
    }),
    // 0.05 hPa in 10 s: 2 hPa in seven minutes.
    ("weather", |ms, it| rises(it, -0.005 * ms as f32 / 1_000.0)),
    ("100 m up, by a scale that is wrong by 8 %", |ms, it| {
        let up_m = (ms.saturating_sub(10_000) as f32 / 1_000.0 * 1.8).min(100.0);
        (it.quad.height, it.quad.climb) = (20.0 + up_m, if up_m < 100.0 { 1.8 } else { 0.0 });
        it.altitude += up_m;
        rises(it, up_m * 1.08 * 0.118);
    }),
    ("late messages in a fast descent", |ms, it| {
        let fallen_s = since_s(ms).min(8.0);
        let falls = fallen_s > 0.0 && fallen_s < 8.0;
        let late_s = if falls { 0.25 * noise(ms, 81) } else { 0.0 };
        it.quad.climb = if falls { -10.0 } else { 0.0 };
        it.quad.climb_wanted = Some(it.quad.climb);
        it.quad.height = 120.0 - 10.0 * fallen_s;
        it.altitude -= 10.0 * fallen_s;
        rises(it, -1.18 * (fallen_s + late_s));
    }),
    ("hard turns to and fro, a tenth of a second late", |ms, it| {
        let turning = |ms: u64| [3.0 * (ms as f32 / 400.0).sin(), 0.0];
        (it.wanted, it.turns) = (turning(ms), turning(ms.saturating_sub(100)));
    }),
    ("an old setpoint that differs from the present one, which was not received", |ms, it| {
        it.wants = ms.is_multiple_of(400);
        it.turns = [if it.wants { 3.0 } else { -1.0 }, 0.0];
        it.wanted = it.turns;
    }),
    ("rates about the axes of the wanted attitude", lags),
    ("full throttle in a climb", |ms, it| {
        if ms >= FAULT_MS {
            (it.quad.throttle, it.quad.climb) = (1.0, 3.0);
        }
    }),
    ("a climb", |ms, it| climbs_after(ms, it, 3.0)),
    ("a climb that the estimator misses", |ms, it| climbs_after(ms, it, 0.0)),
    ("a climb of a VTOL whose estimator falls", |ms, it| {
        climbs_after(ms, it, -15.0);
        become_vtol(it);
    }),
];

#[test]
fn offsets_wind_load_turns_and_missing_parts_raise_nothing() {
    for (what, script) in QUIET {
        assert_eq!(fly(script), [], "{what}");
    }
}

/// Lowers all pressures.
fn rises(it: &mut Fitted, hpa: f32) {
    it.pressure.iter_mut().for_each(|pressure| *pressure -= hpa);
}

fn has_two(it: &mut Fitted) {
    (it.force[2], it.rate[2], it.field[2], it.pressure[2]) = ([0.0; 3], [0.0; 3], [0.0; 3], 0.0);
}

fn selects(it: &mut Fitted) {
    (it.selects, it.quad.autopilot) = (true, Autopilot::Px4);
    it.quad.vibration.levels = [Some(0.0), Some(0.0), Some(1.0)];
}

fn become_vtol(it: &mut Fitted) {
    (it.quad.kind, it.quad.type_number) = (VehicleKind::Vtol, 20);
}

fn are_apart(now_ms: u64, it: &mut Fitted) {
    if now_ms >= FAULT_MS {
        it.force[1][0] += 3.0;
        it.field[1] = [0.5, 0.1 * it.field[1][2], -0.1];
    }
}

/// Turns all compasses by these degrees.
fn turned(it: &mut Fitted, degrees: f32) {
    let (sin, cos) = degrees.to_radians().sin_cos();
    for field in &mut it.field {
        let [x, y, z] = *field;
        *field = [cos * x - sin * y, sin * x + cos * y, z];
    }
}

fn lags(now_ms: u64, it: &mut Fitted) {
    let turning = |now_ms: u64| 3.0 * (now_ms as f32 / 2_000.0).sin();
    let half = core::f32::consts::FRAC_1_SQRT_2;
    it.wanted_of = Some([half, 0.0, 0.0, half]);
    (it.wanted, it.turns) = ([0.0, turning(now_ms)], [-turning(now_ms.saturating_sub(100)), 0.0]);
}

fn climbs(it: &mut Fitted, seconds: f32, by_pressure: f32, by_estimator: f32) {
    rises(it, 0.12 * by_pressure * seconds);
    it.hud_climb = Some(by_estimator + 0.01);
    it.altitude += by_pressure * seconds;
    it.quad.climb = by_pressure;
}

fn climbs_after(now_ms: u64, it: &mut Fitted, by_estimator: f32) {
    let [by_pressure, by_estimator] = if now_ms < FAULT_MS { [0.0; 2] } else { [3.0, by_estimator] };
    climbs(it, since_s(now_ms), by_pressure, by_estimator);
}

fn px4_estimator(compass: Option<f32>) -> Estimator {
    let [velocity, position_horizontal, position_vertical] = [Some(0.1); 3];
    let scale = EstimatorScale::TestRatio;
    Estimator { scale, velocity, position_horizontal, position_vertical, compass, ..Estimator::default() }
}

#[test]
fn a_leap_of_the_velocity_of_gps_is_the_receivers() {
    let leaps = fly(|now_ms, it| it.gps_speed = Some(if now_ms >= FAULT_MS { 8.0 } else { 0.0 }));
    assert!(leaps.iter().all(|finding| finding.check == "gps_speed"), "{leaps:?}");
}

fn gusts(now_ms: u64, it: &mut Fitted) {
    let strong = if now_ms < FAULT_MS { 0.05 } else { 1.0 };
    let wave = |period_ms: f32| (now_ms as f32 / period_ms).sin();
    it.rate.iter_mut().for_each(|rate| rate[0] += strong * 0.4 * wave(70.0));
    it.force.iter_mut().for_each(|force| force[1] += strong * 3.0 * wave(110.0));
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
        let findings = fly_with([(every_ms, 0), (every_ms, 25), (every_ms, 25)], |now_ms, it| {
            for (force, seed) in it.force.iter_mut().zip(10..) {
                *force = [0.0, 0.4 * noise(now_ms, seed), -9.8 + 0.4 * noise(now_ms, seed + 10)];
            }
            it.force[2][0] += if now_ms >= FAULT_MS { 3.0 } else { 0.0 };
        });
        let (check, instance, after_ms) = only(&findings);
        assert!((check, instance) == ("accel_mismatch", 2) && after_ms <= within_ms, "{findings:?}");
    }
}

#[test]
fn one_wrong_sample_is_no_mismatch_no_climb_and_no_noise() {
    for every_ms in [100, 500, 1_000] {
        for sensor in 0..3 {
            let findings = fly_with([(every_ms, 0); 3], |now_ms, it| {
                if now_ms == FAULT_MS {
                    (it.force[sensor], it.rate[sensor], it.field[sensor]) =
                        ([314.0; 3], [30.0; 3], [-3.0; 3]);
                    it.pressure[sensor] = if sensor > 0 { 700.0 } else { it.pressure[sensor] };
                }
            });
            assert_eq!(findings, [], "{sensor} every {every_ms} ms");
        }
        for wrong_hpa in [980.0, 1_020.0, 500.0] {
            let findings = fly_with([(every_ms, 0); 3], |now_ms, it| {
                it.hud_climb = Some(0.02);
                if now_ms == FAULT_MS || now_ms == FAULT_MS + 10_000 {
                    it.pressure[0] = wrong_hpa;
                }
            });
            assert_eq!(findings, [], "{wrong_hpa} hPa every {every_ms} ms");
        }
    }
}

#[test]
fn where_one_of_three_sensors_falls_silent_the_other_two_are_compared_as_two() {
    for silent in 0..3 {
        let (first, second) = ([1, 0, 0][silent], [2, 2, 1][silent]);
        for wrong in [first, second] {
            let findings = fly(|now_ms, it| {
                it.speaks[silent] = now_ms < 20_000;
                if now_ms >= FAULT_MS {
                    it.force[wrong][1] += 3.0;
                    it.pressure[wrong] += 2.5;
                }
            });
            for check in ["accel_mismatch", "baro_mismatch"] {
                let mut told =
                    findings.iter().filter(|one| one.check == check && one.at.as_millis() > FAULT_MS);
                let found = told.next().unwrap_or_else(|| panic!("{check} without {silent}: {findings:?}"));
                assert_eq!((usize::from(found.instance), found.level), (second, Warning));
                assert!(found.at.as_millis() < FAULT_MS + 3_000, "{found:?}");
            }
        }
    }
}

#[test]
fn a_hole_is_no_mismatch() {
    for speaks in [[false; 3], [true, false, false]] {
        let findings = fly(|now_ms, it| {
            gusts(now_ms, it);
            if (FAULT_MS..FAULT_MS + 8_000).contains(&now_ms) {
                it.speaks = speaks;
            }
        });
        assert!(findings.iter().all(|one| !one.check.ends_with("mismatch")), "{findings:?}");
    }
}

#[test]
fn gyros_that_become_noisy_are_apart_though_they_seem_to_turn_fast() {
    for kind in [(VehicleKind::Plane, 1), (VehicleKind::Rotorcraft, 2)] {
        let findings = fly(|now_ms, it| {
            ((it.quad.kind, it.quad.type_number), it.speed) = (kind, 15.0);
            has_two(it);
            if now_ms >= FAULT_MS {
                for (rate, seed) in it.rate.iter_mut().zip(90..) {
                    *rate = [0, 10, 20].map(|axis| 1.6 * noise(now_ms, seed + axis));
                }
            }
        });
        let found = findings.iter().find(|one| one.check == "gyro_mismatch");
        let found = found.unwrap_or_else(|| panic!("{findings:?}"));
        assert_eq!((found.instance, found.level), (1, Warning));
        assert!(found.at.as_millis() < FAULT_MS + 4_000, "{found:?}");
    }
}

#[test]
fn what_was_so_before_a_hole_is_not_held_through_it_and_sensors_are_not_stuck_after_it() {
    let still = Fitted::healthy(0);
    let findings = fly(|now_ms, it| {
        (it.quad.kind, it.quad.type_number, it.speed) = (VehicleKind::Plane, 1, 15.0);
        it.silence = FAULT_MS..FAULT_MS + 6_000;
        if now_ms >= FAULT_MS + 6_000 {
            // A simulator without noise.
            (it.force, it.rate, it.field) = (still.force, still.rate, still.field);
            (it.attitude_noise, it.quad.roll) = (0.0, 0.3);
        }
    });
    assert!(findings.iter().all(|one| !one.check.ends_with("_stuck")), "{findings:?}");
    let findings = fly(|now_ms, it| {
        let since_ms = now_ms.saturating_sub(FAULT_MS);
        it.silence = FAULT_MS + 500..FAULT_MS + 5_500;
        if (1..500).contains(&since_ms) || (5_500..5_900).contains(&since_ms) {
            it.quad.throttle = 1.0;
        }
        if (1..500).contains(&since_ms) {
            it.wanted[0] = -2.5;
        }
    });
    let held = |one: &&Finding| matches!(one.check, "thrust_lost" | "roll_rate");
    assert_eq!(findings.iter().find(held), None, "{findings:?}");
}

#[test]
fn position_messages_that_stop_are_told() {
    let findings = fly_after(|_, it| it.places = false);
    let found = findings.first().expect("something");
    assert_eq!((found.check, found.level), ("position_silent", Warning));
    assert!(found.at.as_millis() < FAULT_MS + 3_500, "{found:?}");
    assert!(findings.iter().skip(1).all(|one| one.level == Level::Stale), "{findings:?}");
}

#[test]
fn of_two_heights_the_one_that_leapt_is_named() {
    for leap_m in [15.0, -15.0] {
        let findings = fly_after(|_, it| it.altitude += leap_m);
        let found = findings.first().expect("something");
        assert_eq!((found.check, found.because), ("gps_height", ""), "{findings:?}");
        assert!(found.at.as_millis() < FAULT_MS + 600, "{found:?}");
        let height = findings.iter().find(|one| one.check == "baro_height").expect("they are apart");
        assert_eq!(height.because, "gps_height");
    }
    let drifts = fly_after(|now_ms, it| it.altitude += 0.5 * since_s(now_ms));
    assert!(drifts.iter().all(|one| one.check == "baro_height"), "{drifts:?}");
    let leaps = fly_after(|_, it| rises(it, 1.8));
    assert!(leaps.iter().all(|one| one.check == "baro_height"), "{leaps:?}");
}

#[test]
fn a_second_estimator_of_a_vtol_or_by_optical_flow_or_in_a_manoeuvre_says_nothing() {
    for (what, flags, apart, kind) in [
        ("two sets of axes", 16, [0.7, 0.0, 0.0], VehicleKind::Vtol),
        ("two sets of axes", 16, [0.0, -11.0, 0.0], VehicleKind::Vtol),
        ("two sets of axes", 16, [0.0, 0.0, 25.0], VehicleKind::Vtol),
        ("as manoeuvres, weather and a receiver do", 16, [0.4, 5.0, 8.0], VehicleKind::Rotorcraft),
        ("it flies by optical flow", 0, [0.0, 0.0, 25.0], VehicleKind::Rotorcraft),
    ] {
        let findings = fly(|now_ms, it| {
            (it.quad.estimator.flags, it.quad.kind) = (flags, kind);
            it.second = Some(if now_ms >= FAULT_MS { apart } else { [0.2, 0.0, 2.0] });
        });
        assert_eq!(findings, [], "{what}");
    }
}

#[test]
fn a_second_estimator_without_an_exact_receiver_is_no_witness() {
    let inexact = |until_ms: u64| {
        move |now_ms: u64, it: &mut Fitted| {
            it.second = Some([0.7, 15.0, 0.0]);
            // A receiver without an accuracy has its dilution only.
            (it.quad.gnss.accuracy, it.quad.gnss.hdop) = (None, Some(1.0));
            if (20_000..until_ms).contains(&now_ms) {
                it.quad.gnss.fix = 1;
            }
        }
    };
    let checks = |findings: Vec<Finding>| findings.into_iter().map(|one| one.check).collect::<Vec<_>>();
    let tilts = checks(fly(inexact(0)));
    assert_eq!(tilts, ["ahrs2_tilt"], "and a height that was so from the beginning is usual");
    let none = checks(fly(|now_ms, it| {
        inexact(0)(now_ms, it);
        it.quad.gnss.fix = 1;
    }));
    assert_eq!(none, [""; 0], "it never had a fix");
    let late = fly(|now_ms, it| {
        inexact(30_000)(now_ms, it);
        it.second = it.second.filter(|_| now_ms >= 20_000);
    });
    let tilt = late.iter().find(|one| one.check == "ahrs2_tilt").expect("found");
    assert!((45_000..48_000).contains(&tilt.at.as_millis()), "{late:?}");
}

#[test]
fn too_few_satellites_for_any_flight_have_a_check_of_their_own() {
    let findings = fly_after(|_, it| {
        (it.quad.gnss.satellites, it.quad.gnss.accuracy) = (Some(5), Some(Metres(2.0)));
    });
    let told: Vec<(&str, &str)> = findings.iter().map(|one| (one.check, one.because)).collect();
    assert_eq!(told, [("gps_satellites", ""), ("gps_sats_fall", "gps_satellites")]);
}

#[test]
fn a_compass_that_stood_still_for_a_whole_turn_is_good_again() {
    let findings = fly(|now_ms, it| turned(it, 18.0 * since_s(now_ms).min(20.0)));
    let mine = findings.iter().filter(|one| one.check == "compass_heading");
    let told: Vec<_> = mine.map(|one| one.level).collect();
    assert_eq!(told, [Warning, Level::Ok], "{findings:?}");
}

/// Commands of the first motors of a frame, with a shift of each, us, from the fault on.
fn frame<const N: usize>(it: &mut Fitted, now_ms: u64, (type_number, shift): (u8, [f32; N])) {
    it.quad.type_number = type_number;
    let shift = if now_ms < FAULT_MS { [0.0; N] } else { shift };
    for ((motor, pulse), shift) in (0..).zip(&mut it.pulses).zip(shift) {
        let flies = 1_500.0 + 15.0 * noise(now_ms, motor + if N == 6 { 60 } else { 80 }) + shift;
        *pulse = if now_ms < OFF_MS { 1_000.0 } else { flies };
    }
}

fn hexa(shift: [f32; 6]) -> Vec<Finding> {
    let findings = fly(|now_ms, it| frame(it, now_ms, (13, shift)));
    findings.into_iter().filter(|one| one.check.starts_with("motor_o")).collect()
}

#[test]
fn a_weak_a_dead_and_a_shut_off_motor_of_a_hexarotor_are_named() {
    // Round the frame from the weak one on: 2/3, 1/6, 1/6, -1/3, 1/6, 1/6 of the loss.
    let weak = hexa([267.0, 67.0, 67.0, -133.0, 67.0, 67.0]);
    let found = weak.iter().find(|one| one.level == Warning).unwrap();
    assert_eq!((found.check, found.instance), ("motor_output", 0));
    assert!((FAULT_MS..FAULT_MS + 4_000).contains(&found.at.as_millis()), "{found:?}");
    for (shift, check, instance) in [
        ([-350.0, 450.0, 130.0, 130.0, 130.0, 130.0], "motor_output", 1),
        ([125.0, 125.0, -500.0, 125.0, 125.0, -480.0], "motor_off", 2),
    ] {
        let told = hexa(shift);
        assert!(told.iter().all(|one| (one.check, one.instance) == (check, instance)), "{told:?}");
        assert_eq!(told.last().map(|one| one.level), Some(Critical), "{check}");
    }
    let idles = hexa([125.0, 125.0, -385.0, 125.0, 125.0, -365.0]);
    assert!(idles.iter().all(|one| one.check != "motor_off"), "it turns: {idles:?}");
}

fn eight(arms: bool, thrust: f32, tilt: f32, yaw: f32) -> [f32; 8] {
    core::array::from_fn(|motor| {
        let round = if arms { (motor / 2) as f32 / 4.0 } else { motor as f32 / 8.0 };
        let turns = if (motor + usize::from(arms) * (motor / 2)) % 2 == 0 { 1.0 } else { -1.0 };
        thrust / 8.0 + tilt / 4.0 * (round * core::f32::consts::TAU).cos() + yaw / 8.0 * turns
    })
}

#[test]
fn a_weak_motor_of_an_octocopter_is_named() {
    // `arms`: its motors are those of four arms one after the other, two each, which turn against each other.
    for arms in [false, true] {
        for place in [0, 1, 7] {
            let mut shift = eight(arms, 200.0, 200.0, 200.0);
            shift.rotate_right(place);
            for type_number in [14, 2] {
                let findings = fly(|now_ms, it| frame(it, now_ms, (type_number, shift)));
                let found = findings.iter().find(|one| one.level == Warning).unwrap();
                assert_eq!((found.check, usize::from(found.instance)), ("motor_output", place));
                assert!((FAULT_MS..FAULT_MS + 5_000).contains(&found.at.as_millis()), "{found:?}");
            }
        }
        for (thrust, tilt, yaw) in
            [(600.0, 0.0, 0.0), (0.0, 400.0, 0.0), (0.0, 0.0, 600.0), (200.0, 400.0, 0.0)]
        {
            assert_eq!(fly(|now_ms, it| frame(it, now_ms, (14, eight(arms, thrust, tilt, yaw)))), []);
        }
    }
}

#[test]
fn load_wind_and_yaw_change_outputs_in_pairs_and_say_nothing() {
    for shift in
        [[150.0, -150.0, 0.0, 0.0], [100.0, -100.0, 100.0, -100.0], [90.0, 90.0, -90.0, -90.0], [150.0; 4]]
    {
        let findings =
            fly_after(|_, it| it.pulses.iter_mut().zip(shift).for_each(|(pulse, shift)| *pulse += shift));
        assert_eq!(findings, [], "{shift:?}");
    }
    for shift in [
        [150.0, 75.0, -75.0, -150.0, -75.0, 75.0],
        [130.0, 0.0, -130.0, -130.0, 0.0, 130.0],
        [80.0, -80.0, 80.0, -80.0, 80.0, -80.0],
    ] {
        assert_eq!(fly(|now_ms, it| frame(it, now_ms, (13, shift))), [], "{shift:?}");
    }
}

#[test]
fn px4_that_stops_using_its_compass_is_named() {
    let stops = |degrees: f32| {
        fly(move |now_ms, it| {
            it.quad.estimator = px4_estimator((now_ms < FAULT_MS).then_some(0.1));
            turned(it, if now_ms < FAULT_MS { 0.0 } else { degrees });
        })
    };
    let paused = stops(0.0);
    assert!(paused.iter().all(|finding| finding.level == Level::Stale), "{paused:?}");
    let told: Vec<_> = stops(11.0).into_iter().filter(|finding| finding.level != Level::Stale).collect();
    assert!(matches!(only(&told), ("compass_unused", 0, 500..900)), "{told:?}");
}

#[test]
fn compasses_that_all_repeat_their_values_are_stuck_once_the_vehicle_turns() {
    let findings = fly_after(|_, it| (it.field, it.attitude_noise) = (held().field, 0.05));
    for part in 0..3 {
        let told = |finding: &Finding| finding.check == "compass_stuck" && finding.instance == part;
        let at_ms = findings.iter().find(|finding| told(finding)).map(|finding| finding.at.as_millis());
        assert!(at_ms.is_some_and(|at_ms| at_ms < FAULT_MS + 3_000), "{part}: {findings:?}");
    }
}

#[test]
fn rates_of_px4_are_about_the_bodys_own_axes() {
    let findings = fly(|now_ms, it| {
        lags(now_ms, it);
        it.quad.autopilot = Autopilot::Px4;
    });
    assert!(findings.iter().any(|one| one.check == "roll_rate"), "{findings:?}");
}

#[test]
fn full_throttle_that_was_in_vain_is_until_it_climbs() {
    let findings = fly_after(|now_ms, it| {
        it.quad.throttle = 1.0;
        it.quad.roll = if now_ms < FAULT_MS + 5_000 { 0.02 } else { 0.7 };
        it.quad.climb = if now_ms < FAULT_MS + 15_000 { 0.1 } else { 1.0 };
    });
    let mine = findings.iter().filter(|one| one.check == "thrust_lost");
    let told: Vec<_> = mine.map(|one| (one.level, one.at.as_millis().div_ceil(1_000) * 1_000)).collect();
    let over_ms = FAULT_MS + 17_000;
    assert_eq!(told.first().map(|one| one.0), Some(Warning), "{told:?}");
    assert!(told[1..].iter().all(|(_, at_ms)| *at_ms >= over_ms) && told.len() == 2, "{told:?}");
}
