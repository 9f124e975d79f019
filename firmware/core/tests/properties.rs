//! No observation, in any order, at any time and at any rate, panics or overflows, spoils a figure, or makes an
//! unknown value look healthy. (From bytes on: `hums-link`'s `tests/hostile.rs`.)

use core::num::NonZeroU32;

use hums_core::Monitor;
use hums_core::health::{EXPECTED, Level, Subsystem};
use hums_core::lifetime::{ITEM_BYTES_MAX, Room};
use hums_core::observation::{
    Air, Attitude, Autopilot, AutopilotIdentity, Battery, CELLS_MAX, CellVoltage, CommandAck, Engine, Esc,
    EscGroup, Estimator, EstimatorScale, GlobalPosition, Gnss, GnssIntegrity, Heartbeat, Hud, Imu,
    LandedState, LocalPosition, MOTORS_MAX, Observation, Outputs, Processor, RadioControl, Rails,
    SecondEstimate, Sensors, Source, SpeedSensor, SystemStatus, SystemTime, TelemetryRadio, VehicleKind,
    Vibration, VibrationScale, VtolState, Wanted, WantedRates,
};
use hums_core::params::{Params, TABLE};
use hums_core::status::{LinkReading, RecorderStatus, Recording};
use hums_core::time::{BootMs, Millis};
use hums_core::units::{
    AmpereHours, Amperes, Celsius, Fraction, Gauss, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2,
    Position, Radians, RadiansPerSecond, Rpm, Volts, WattHours,
};
use hums_core::usage::FIGURE_FIRST;

const AUTOPILOT: Source = Source { system: 1, component: 1 };

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Values {
    /// Anything: sane, extreme, NaN or infinite.
    Any,
    Unknown,
}

struct Random {
    state: u64,
    values: Values,
}

impl Random {
    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: u64) -> u64 {
        self.next() % bound
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len() as u64) as usize]
    }

    fn f32(&mut self) -> f32 {
        const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        const EXTREME: [f32; 8] = [f32::MAX, f32::MIN, f32::MIN_POSITIVE, -0.0, 0.0, 1e9, -1e9, 65_535.0];
        match self.below(4) {
            _ if self.values == Values::Unknown => self.pick(&BAD),
            0 => self.pick(&BAD),
            1 => self.pick(&EXTREME),
            2 => f32::from_bits(self.next() as u32),
            _ => self.below(2_000) as f32 / 10.0 - 50.0,
        }
    }

    fn u32(&mut self) -> u32 {
        match self.below(3) {
            0 => self.pick(&[0, 1, u32::MAX, u32::MAX - 1, 1 << 31]),
            1 => self.below(100) as u32,
            _ => self.next() as u32,
        }
    }

    fn maybe<T>(&mut self, value: impl FnOnce(&mut Self) -> T) -> Option<T> {
        (self.below(4) != 0).then(|| value(self))
    }

    fn float<T>(&mut self, unit: fn(f32) -> T) -> Option<T> {
        self.maybe(|random| unit(random.f32()))
    }

    /// A whole number, which has no unknown value of its own.
    fn whole<T>(&mut self, from: fn(u32) -> T) -> Option<T> {
        if self.values == Values::Unknown {
            return None;
        }
        self.maybe(|random| from(random.u32()))
    }

    fn vector<T>(&mut self, unit: fn(f32) -> T) -> [T; 3] {
        [(); 3].map(|()| unit(self.f32()))
    }

    fn source(&mut self) -> Source {
        if self.below(8) == 0 {
            Source { system: self.next() as u8, component: self.next() as u8 }
        } else {
            AUTOPILOT
        }
    }

    fn heartbeat(&mut self) -> Heartbeat {
        use VehicleKind::{Other, Plane, Rotorcraft, Surface, Vtol};
        Heartbeat {
            autopilot: self.pick(&[Autopilot::ArduPilot, Autopilot::Px4, Autopilot::Other]),
            kind: self.pick(&[Rotorcraft, Plane, Vtol, Surface, Other]),
            armed: self.below(2) == 0,
            state: self.next() as u8,
            mode: self.u32(),
            ..Heartbeat::default()
        }
    }

    fn battery(&mut self) -> Battery {
        Battery {
            id: self.pick(&[0, 0, 1, 2, 255]),
            cells: [(); CELLS_MAX].map(|()| CellVoltage::from_millivolts(self.u32() as u16)),
            voltage: self.float(Volts),
            current: self.float(Amperes),
            consumed: self.float(AmpereHours),
            energy: self.float(WattHours),
            remaining: self.float(Fraction),
            temperature: self.float(Celsius),
            faults: self.u32(),
            lithium: self.below(4) != 0,
            feeds: hums_core::observation::Feeds::Vehicle,
            charge: self.pick(&[0, 0, 0, 1, 2, 3, 255]) * u8::from(self.values == Values::Any),
        }
    }

    fn escs(&mut self) -> EscGroup {
        let first = self.pick(&[0, 0, 4, 8, 9, 11, 200, 255]);
        let escs = [(); 4].map(|()| {
            self.maybe(|random| Esc {
                rpm: random.float(Rpm),
                voltage: random.float(Volts),
                current: random.float(Amperes),
                temperature: random.float(Celsius),
                failures: random.whole(|number| number as u16),
                errors: random.whole(|number| number),
            })
        });
        EscGroup { first, escs }
    }

    fn gnss(&mut self) -> Gnss {
        Gnss {
            instance: self.pick(&[0, 0, 1, 2, 255]),
            fix: self.whole(|number| number as u8).unwrap_or(0),
            satellites: self.whole(|number| number as u8),
            hdop: self.float(|value| value),
            accuracy: self.float(Metres),
            position: self.maybe(|random| Position {
                latitude_deg: random.u32() as i32 as f64 / 1e7,
                longitude_deg: f64::NAN,
            }),
            altitude: self.float(Metres),
            speed: self.float(MetresPerSecond),
            course: self.float(Radians),
            measured_ms: NonZeroU32::new(self.u32()),
        }
    }

    fn imu(&mut self) -> Imu {
        Imu {
            instance: self.pick(&[0, 0, 1, 2, 255]),
            acceleration: self.maybe(|random| random.vector(MetresPerSecond2)),
            rate: self.maybe(|random| random.vector(RadiansPerSecond)),
            field: self.maybe(|random| random.vector(Gauss)),
            temperature: self.float(Celsius),
        }
    }

    fn air(&mut self) -> Air {
        let instance = self.pick(&[0, 0, 1, 2, 255]);
        Air { instance, pressure: self.float(Hectopascals), temperature: self.float(Celsius) }
    }

    fn outputs(&mut self) -> Observation {
        let pulses = [(); MOTORS_MAX].map(|()| self.pick(&[0, 900, 1_000, 1_100, 1_500, 1_900, 65_535]));
        Observation::Outputs(Outputs { port: self.pick(&[0, 0, 1, 255]), pulses })
    }

    fn observation(&mut self) -> Observation {
        let number = self.below(29);
        match number {
            0..=2 => Observation::Heartbeat(self.heartbeat()),
            3 => Observation::SystemStatus(SystemStatus {
                load: self.float(Fraction),
                voltage: self.float(Volts),
                current: self.float(Amperes),
                remaining: self.float(Fraction),
                sensors: Some(Sensors::of(self.u32(), self.u32(), self.u32())),
            }),
            4 => Observation::SystemTime(SystemTime {
                utc_micros: self.maybe(Self::next),
                boot_ms: self.u32(),
            }),
            5 => Observation::Gnss(self.gnss()),
            6 => {
                let jamming = self.whole(|number| number as u8).unwrap_or(0);
                let spoofing = self.whole(|number| number as u8).unwrap_or(0);
                Observation::GnssIntegrity(GnssIntegrity { jamming, spoofing, ..GnssIntegrity::default() })
            }
            7 => Observation::Imu(self.imu()),
            8 => Observation::Air(self.air()),
            9 => Observation::ImuAndAir(self.imu(), self.air()),
            10 => {
                let [roll, pitch, yaw] = self.vector(Radians);
                let rates = self.maybe(|random| random.vector(RadiansPerSecond));
                Observation::Attitude(Attitude { roll, pitch, yaw, rates, boot_ms: self.maybe(Self::u32) })
            }
            11 => Observation::LocalPosition(LocalPosition {
                position: self.vector(Metres),
                velocity: self.vector(MetresPerSecond),
            }),
            12 | 13 => Observation::GlobalPosition(GlobalPosition {
                relative_altitude: Metres(self.f32()),
                altitude: Metres(self.f32()),
                velocity: self.vector(MetresPerSecond),
                ..GlobalPosition::default()
            }),
            14 => Observation::Hud(Hud {
                airspeed: self.float(MetresPerSecond),
                groundspeed: self.float(MetresPerSecond),
                heading_deg: self.float(|value| value),
                throttle: self.float(Fraction),
                altitude: self.float(Metres),
                climb: self.float(MetresPerSecond),
            }),
            15 => Observation::RadioControl(RadioControl { rssi: self.whole(|number| number as u8) }),
            16 => Observation::TelemetryRadio(TelemetryRadio {
                rssi: self.whole(|number| number as u8),
                remote_rssi: self.whole(|number| number as u8),
                noise: self.whole(|number| number as u8),
                remote_noise: self.whole(|number| number as u8),
                errors: self.u32() as u16,
            }),
            17 => Observation::Rails(Rails { vcc: self.float(Volts), servo: self.float(Volts) }),
            18 => Observation::Battery(self.battery()),
            19..=26 => self.machine(number),
            27 => self.outputs(),
            _ => self.rare(),
        }
    }

    /// The part of [`Self::observation`] that is about the machine: its number from 19 to 26.
    fn machine(&mut self, number: u64) -> Observation {
        use LandedState::{InAir, Landing, OnGround, TakingOff, Unknown};
        match number {
            19 => Observation::Estimator(Estimator {
                scale: self.pick(&[EstimatorScale::Variance, EstimatorScale::TestRatio]),
                velocity: self.float(|value| value),
                position_horizontal: self.float(|value| value),
                position_vertical: self.float(|value| value),
                compass: self.float(|value| value),
                flags: self.u32() as u16,
            }),
            20 => Observation::Vibration(Vibration {
                scale: self.pick(&[VibrationScale::PerAxis, VibrationScale::Px4Metrics]),
                levels: [(); 3].map(|()| self.float(|value| value)),
                clips: [(); 3].map(|()| self.u32()),
            }),
            21 | 22 => Observation::Escs(self.escs()),
            23 => Observation::Engine(Engine {
                healthy: self.below(2) == 0,
                rpm: self.float(Rpm),
                cylinder_head: self.float(Celsius),
                exhaust: self.float(Celsius),
                fuel_pressure: self.float(Hectopascals),
                ..Engine::default()
            }),
            24 => Observation::SpeedSensors([(); 2].map(|()| {
                self.maybe(|random| SpeedSensor { index: random.next() as u8, rpm: Rpm(random.f32()) })
            })),
            25 => Observation::Landed(
                self.pick(&[Unknown, OnGround, InAir, TakingOff, Landing]),
                self.pick(&[VtolState::Unknown, VtolState::Hover, VtolState::Forward, VtolState::Transition]),
            ),
            _ => Observation::Processor(Processor {
                temperature: self.float(Celsius),
                voltage: self.float(Volts),
            }),
        }
    }

    fn rare(&mut self) -> Observation {
        match self.below(8) {
            7 => {
                let of = self.maybe(|random| [(); 4].map(|()| random.f32()));
                let about = self.vector(RadiansPerSecond);
                let [roll, pitch, _] = self.vector(Radians);
                Observation::Wanted(Wanted { roll, pitch, rates: Some(WantedRates { about, of }) })
            }
            6 => Observation::SecondEstimate(SecondEstimate {
                attitude: self.maybe(|random| random.vector(Radians)),
                position: self.maybe(|random| Position {
                    latitude_deg: random.f32().into(),
                    longitude_deg: random.f32().into(),
                }),
                altitude: self.float(Metres),
            }),
            5 => Observation::ClimbWanted(MetresPerSecond(self.f32())),
            4 => Observation::Parameter(self.below(20) as u8, self.f32()),
            0 => Observation::Identity(AutopilotIdentity { uid: self.below(3), firmware: self.u32() }),
            1 => Observation::CommandAck(CommandAck {
                target: None,
                command: self.pick(&[20, 21]),
                result: self.next() as u8,
            }),
            2 => Observation::MissionReached(self.u32() as u16),
            _ => Observation::FlightInformation { flight: self.next(), takeoff_boot_ms: self.u32() },
        }
    }

    fn params(&mut self) -> Params {
        let mut params = Params::defaults();
        for _ in 0..self.below(40) {
            let spec = &TABLE[self.below(TABLE.len() as u64) as usize];
            let part = self.below(1_001) as f32 / 1_000.0;
            // Whole numbers select; a value that rounding moves out of its range is refused.
            let _ = params.set(spec.name, (spec.min + part * (spec.max - spec.min)).round());
        }
        params
    }

    fn link(&mut self) -> LinkReading {
        LinkReading { frames_lost: self.maybe(Self::f32), at: BootMs::from_millis(self.next() >> 30) }
    }

    fn recorder(&mut self) -> RecorderStatus {
        RecorderStatus {
            recording: self.pick(&[Recording::Starting, Recording::Running, Recording::Stopped]),
            queue: self.f32(),
            frames_lost: self.next(),
            stall: Millis::from_millis(self.next() >> 16),
            write_errors: self.next(),
            room: self.maybe(Self::f32),
        }
    }
}

fn check(monitor: &mut Monitor, now: BootMs) {
    let sane = |counter: u8, value: f64| {
        let sign = counter >= FIGURE_FIRST || value >= 0.0;
        assert!(value.is_finite() && sign, "counter {counter} is {value}");
    };
    monitor.for_each_counter(sane);
    monitor.for_each_counter_of_life(sane);
    let health = monitor.health();
    let overall = health.overall();
    for (check, instance, level) in health.levels() {
        assert!(not_better(overall, level), "{overall:?}, but {} {instance} is {level:?}", check.name);
        let subsystem = health.subsystem(check.subsystem);
        assert!(not_better(subsystem, level), "{subsystem:?}, but {} {instance} is {level:?}", check.name);
    }
    for subsystem in Subsystem::ALL {
        let known = health.levels().any(|(check, ..)| check.subsystem == subsystem);
        assert!(known || health.subsystem(subsystem) == Level::Stale, "{subsystem:?}: unknown is not OK");
    }
    if EXPECTED.into_iter().any(|subsystem| health.subsystem(subsystem) == Level::Stale) {
        assert!(matches!(overall, Level::Stale | Level::Critical), "{overall:?}");
    }
    while monitor.take_happening().is_some() {}
    while let Some(snapshot) = monitor.take_snapshot(now) {
        let _ = snapshot.values().count();
    }
    let _ = monitor.take_request();
    while let Some(key) = monitor.save_due(now, Room::Enough) {
        let mut item = [0; ITEM_BYTES_MAX];
        let length = monitor.encode_item(key, &mut item);
        assert_eq!(Monitor::new(Params::defaults()).restore(key, &item[..length]), Ok(()), "{key:?}");
        monitor.saved(key);
    }
}

/// A roll-up is as bad as its part; stale hides a warning, and a danger hides all.
fn not_better(whole: Level, part: Level) -> bool {
    let rank = |level| match level {
        Level::Ok => 0,
        Level::Advisory => 1,
        Level::Warning => 2,
        Level::Stale => 3,
        Level::Critical => 4,
    };
    rank(whole) >= rank(part)
}

fn run(random: &mut Random) -> (Monitor, BootMs) {
    let mut monitor = Monitor::new(random.params());
    // At power-on, and where the clock wraps.
    let start_ms = if random.below(2) == 0 { 0 } else { u64::from(u32::MAX) - random.below(40_000_000) };
    let mut now = BootMs::from_millis(start_ms);
    monitor.observe(now, AUTOPILOT, &Observation::Heartbeat(random.heartbeat()));
    for _ in 0..1_000 {
        let step_ms = match random.below(20) {
            0 => random.below(4_000_000),
            1 => random.below(10_000),
            2 => 0,
            _ => 50,
        };
        now = now + Millis::from_millis(step_ms);
        for _ in 0..random.below(4) {
            // A frame may wait for a while, and the clock may have gone on since it was read.
            let late = Millis::from_millis(random.below(3) * random.below(2_000));
            let at = if random.below(8) == 0 { now + late } else { now };
            let observation = random.observation();
            for _ in 0..=random.below(2) {
                monitor.observe(at, random.source(), &observation);
            }
        }
        let (link, recorder) = (random.link(), random.recorder());
        monitor.tick(now, &link, &recorder, &mut |finding| {
            // An alarm that outlives its cause is reported once more, with its level as it was.
            assert!(finding.level != finding.previous || finding.because.is_empty(), "{finding:?}");
            assert!(finding.value.is_nan() || finding.value.is_finite(), "{finding:?}");
        });
        check(&mut monitor, now);
    }
    (monitor, now)
}

#[test]
fn no_order_time_or_value_of_anything_said_panics_spoils_a_figure_or_betters_the_whole() {
    for seed in 0..40 {
        run(&mut Random { state: seed, values: Values::Any });
    }
}

#[test]
fn after_anything_at_all_a_vehicle_that_falls_silent_is_critical_and_nothing_that_it_said_is_ok() {
    for seed in 40..60 {
        let (mut monitor, end) = run(&mut Random { state: seed, values: Values::Any });
        let mut now = end;
        // Longer than any debounce, and than any observed time in the future.
        for _ in 0..600 {
            now = now + Millis::from_millis(200);
            monitor.tick(now, &LinkReading::default(), &RecorderStatus::default(), &mut |_| {});
        }
        for (check, instance, level) in monitor.health().levels() {
            let said = check.stale_after().is_some();
            assert!(!(said && level == Level::Ok), "seed {seed}: {} {instance} is OK", check.name);
        }
        let overall = monitor.health().overall();
        assert!(matches!(overall, Level::Critical | Level::Stale), "seed {seed}: {overall:?}");
    }
}

/// Checks of whole numbers without an unknown value, of ages, and of the monitor itself.
const KNOWN_ANYWAY: [&str; 8] = [
    "batt_fault",
    "esc_silent",
    "clipping",
    "heartbeat",
    "frames_lost",
    "autopilot_reboot",
    "autopilot_state",
    "gps_fix",
];

#[test]
fn what_is_said_to_be_unknown_is_never_ok() {
    for seed in 0..15 {
        let mut random = Random { state: seed, values: Values::Unknown };
        let mut monitor = Monitor::new(Params::defaults());
        for now_ms in (0..120_000).step_by(50) {
            let now = BootMs::from_millis(now_ms);
            let heartbeat = Heartbeat {
                armed: now_ms > 1_000,
                state: 4,
                kind: VehicleKind::Rotorcraft,
                ..random.heartbeat()
            };
            monitor.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
            let landed = if now_ms > 2_000 { LandedState::InAir } else { LandedState::OnGround };
            monitor.observe(now, AUTOPILOT, &Observation::Landed(landed, VtolState::Unknown));
            for _ in 0..3 {
                let observation = random.observation();
                let known = matches!(observation, Observation::Heartbeat(_) | Observation::Landed(..));
                if !known {
                    monitor.observe(now, AUTOPILOT, &observation);
                }
            }
            let link = LinkReading { frames_lost: Some(0.0), at: now };
            monitor.tick(now, &link, &RecorderStatus::default(), &mut |_| {});
            for (check, instance, level) in monitor.health().levels() {
                let ours = check.subsystem == Subsystem::Recorder || check.alarm_only;
                let known = ours || KNOWN_ANYWAY.contains(&check.name);
                assert!(
                    known || level != Level::Ok,
                    "{now_ms} ms, seed {seed}: {} {instance} is OK",
                    check.name
                );
            }
            assert_ne!(monitor.health().overall(), Level::Ok, "{now_ms} ms, seed {seed}");
            check(&mut monitor, now);
        }
        assert!(monitor.flight().airborne(), "what counts in flight only is not looked at");
    }
}
