//! No observation, in any order, at any time and at any rate, panics or overflows, spoils a figure, or makes an
//! unknown value look healthy. (From bytes on: `hums-link`'s `tests/hostile.rs`.)

use core::num::NonZeroU32;

use hums_core::Monitor;
use hums_core::health::{EXPECTED, Level, Subsystem};
use hums_core::lifetime::{ITEM_BYTES_MAX, Room};
use hums_core::observation::{
    Air, Attitude, AttitudeSetpoint, Autopilot, AutopilotIdentity, Battery, CellVoltage, CommandAck, Engine,
    Esc, EscGroup, Estimator, EstimatorScale, Feeds, Generator, GlobalPosition, Gnss, GnssIntegrity,
    Heartbeat, Hud, Imu, LandedState, LocalPosition, MOTORS_MAX, Observation, Outputs, Processor,
    RadioControl, Rails, SecondEstimate, Sensors, Source, SpeedSensor, SystemStatus, SystemTime,
    TelemetryRadio, VehicleKind, Vibration, VibrationScale, VtolState, WantedRates,
};
use hums_core::parameters::{Params, TABLE};
use hums_core::status::{LinkReading, RecorderStatus, Recording};
use hums_core::time::{BootMs, Millis};
use hums_core::units::{
    AmpereHours, Amperes, Celsius, Fraction, Gauss, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2,
    Position, Radians, RadiansPerSecond, Rpm, Volts,
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

    fn any<T: Any>(&mut self) -> T {
        T::any(self)
    }

    /// An instance, mostly of a part that exists.
    fn instance(&mut self) -> u8 {
        self.pick(&[0, 0, 1, 2, 255])
    }

    fn imu(&mut self) -> Imu {
        Imu { instance: self.instance(), ..self.any() }
    }

    fn air(&mut self) -> Air {
        Air { instance: self.instance(), ..self.any() }
    }

    fn source(&mut self) -> Source {
        if self.below(8) == 0 { Source { system: self.any(), component: self.any() } } else { AUTOPILOT }
    }

    fn observation(&mut self) -> Observation {
        match self.below(32) {
            0..=2 => Observation::Heartbeat(self.any()),
            3 => Observation::SystemStatus(self.any()),
            4 => Observation::SystemTime(self.any()),
            5 => Observation::Gnss(Gnss { instance: self.instance(), ..self.any() }),
            6 => Observation::GnssIntegrity(GnssIntegrity { instance: self.instance(), ..self.any() }),
            7 => Observation::Imu(self.imu()),
            8 => Observation::Air(self.air()),
            9 => Observation::ImuAndAir(self.imu(), self.air()),
            10 => Observation::Attitude(self.any()),
            11 => Observation::LocalPosition(self.any()),
            12 | 13 => Observation::GlobalPosition(self.any()),
            14 => Observation::Hud(self.any()),
            15 => Observation::RadioControl(self.any()),
            16 => Observation::TelemetryRadio(self.any()),
            17 => Observation::Rails(self.any()),
            18 | 19 => Observation::Battery(Battery { id: self.instance(), ..self.any() }),
            20 => Observation::Estimator(self.any()),
            21 => Observation::Vibration(self.any()),
            22 | 23 => {
                let first = self.pick(&[0, 0, 4, 8, 9, 11, 200, 255]);
                Observation::Escs(EscGroup { first, ..self.any() })
            }
            24 => Observation::Engine(self.any()),
            25 if self.any() => Observation::Generator(self.any()),
            25 => Observation::SpeedSensors(self.any()),
            26 => Observation::Landed(self.any(), self.any()),
            27 => Observation::Processor(self.any()),
            28 => {
                let pulses =
                    [(); MOTORS_MAX].map(|()| self.pick(&[0, 900, 1_000, 1_100, 1_500, 1_900, 65_535]));
                Observation::Outputs(Outputs { port: self.pick(&[0, 0, 1, 255]), pulses })
            }
            _ => self.rare(),
        }
    }

    fn rare(&mut self) -> Observation {
        match self.below(8) {
            0 => Observation::Identity(AutopilotIdentity { uid: self.below(3), firmware: self.any() }),
            1 => Observation::CommandAck(CommandAck { command: self.pick(&[20, 21]), ..self.any() }),
            2 => Observation::MissionReached(self.any()),
            3 => Observation::Parameter(self.below(20) as u8, self.any()),
            4 => Observation::ClimbWanted(self.any()),
            5 => Observation::SecondEstimate(self.any()),
            6 => Observation::AttitudeSetpoint(self.any()),
            _ => Observation::Shock(self.any()),
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
        LinkReading { frames_lost: self.any(), at: BootMs::from_millis(self.next() >> 30) }
    }

    fn recorder(&mut self) -> RecorderStatus {
        RecorderStatus {
            recording: self.pick(&[Recording::Starting, Recording::Running, Recording::Stopped]),
            queue: self.any(),
            frames_lost: self.next(),
            stall: Millis::from_millis(self.next() >> 16),
            write_errors: self.next(),
            room: self.any(),
        }
    }
}

/// Any value of a type; what has a value for "unknown" is that and nothing else where values are unknown.
trait Any: Sized {
    const HAS_UNKNOWN: bool = true;

    fn any(random: &mut Random) -> Self;
}

impl Any for f32 {
    fn any(random: &mut Random) -> Self {
        const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        const EXTREME: [f32; 8] = [f32::MAX, f32::MIN, f32::MIN_POSITIVE, -0.0, 0.0, 1e9, -1e9, 65_535.0];
        match random.below(4) {
            _ if random.values == Values::Unknown => random.pick(&BAD),
            0 => random.pick(&BAD),
            1 => random.pick(&EXTREME),
            2 => Self::from_bits(random.next() as u32),
            _ => random.below(2_000) as Self / 10.0 - 50.0,
        }
    }
}

impl Any for u32 {
    const HAS_UNKNOWN: bool = false;

    fn any(random: &mut Random) -> Self {
        match random.below(3) {
            0 => random.pick(&[0, 1, Self::MAX, Self::MAX - 1, 1 << 31]),
            1 => random.below(100) as Self,
            _ => random.next() as Self,
        }
    }
}

/// 0 where values are unknown: that is "unknown" of a fix, a state of jamming and a state of charge.
impl Any for u8 {
    const HAS_UNKNOWN: bool = false;

    fn any(random: &mut Random) -> Self {
        if random.values == Values::Unknown { 0 } else { random.any::<u32>() as Self }
    }
}

impl<T: Any> Any for Option<T> {
    fn any(random: &mut Random) -> Self {
        let may_be_known = T::HAS_UNKNOWN || random.values == Values::Any;
        (may_be_known && random.below(4) != 0).then(|| random.any())
    }
}

impl<T: Any, const N: usize> Any for [T; N] {
    fn any(random: &mut Random) -> Self {
        [(); N].map(|()| random.any())
    }
}

macro_rules! any {
    ($($type:ty $(, $unknown:literal)?: $random:ident $value:expr;)*) => {
        $(impl Any for $type {
            $(const HAS_UNKNOWN: bool = $unknown;)?

            fn any($random: &mut Random) -> Self {
                $value
            }
        })*
    };
}

any! {
    bool: random random.below(2) == 0;
    u16, false: random random.any::<u32>() as Self;
    u64, false: random random.next();
    f64: random random.any::<f32>().into();
    NonZeroU32, false: random Self::MIN | random.any::<u32>();
    CellVoltage, false: random Self::from_millivolts(random.any::<u16>() | 1).expect("not 0");
    Autopilot: random random.pick(&[Self::ArduPilot, Self::Px4, Self::Other]);
    VehicleKind: random random.pick(&[Self::Rotorcraft, Self::Plane, Self::Vtol, Self::Surface, Self::Other]);
    Feeds: random random.pick(&[Self::Vehicle, Self::Vehicle, Self::Unsaid, Self::Payload]);
    EstimatorScale: random random.pick(&[Self::Variance, Self::TestRatio]);
    VibrationScale: random random.pick(&[Self::PerAxis, Self::Px4Metrics]);
    LandedState: random random.pick(&[Self::Unknown, Self::OnGround, Self::InAir, Self::TakingOff, Self::Landing]);
    VtolState: random random.pick(&[Self::Unknown, Self::Hover, Self::Forward, Self::Transition]);
}

macro_rules! any_unit {
    ($($unit:ident)*) => { any! { $($unit: random Self(random.any());)* } };
}

any_unit! {
    AmpereHours Amperes Celsius Fraction Gauss Hectopascals Metres MetresPerSecond MetresPerSecond2 Radians
    RadiansPerSecond Rpm Volts
}

macro_rules! any_of {
    ($($struct:ident { $($field:ident)* })*) => {
        any! { $($struct: random Self { $($field: random.any()),* };)* }
    };
}

any_of! {
    Heartbeat { autopilot autopilot_number kind type_number armed state mode }
    SystemStatus { load voltage current remaining sensors }
    Sensors { unhealthy lost healthy }
    SystemTime { utc_micros boot_ms }
    Gnss { instance fix satellites hdop accuracy position altitude speed course measured_ms }
    GnssIntegrity { instance jamming spoofing }
    Imu { instance acceleration rate field temperature }
    Air { instance pressure temperature }
    Attitude { roll pitch yaw rates boot_ms }
    LocalPosition { position velocity }
    GlobalPosition { position altitude relative_altitude velocity }
    Position { latitude_deg longitude_deg }
    Hud { airspeed groundspeed heading_deg throttle altitude climb }
    RadioControl { rssi }
    TelemetryRadio { rssi remote_rssi noise remote_noise errors }
    Rails { vcc servo }
    Battery { id cells voltage current consumed remaining temperature faults lithium feeds charge }
    Estimator { scale velocity position_horizontal position_vertical compass flags }
    Vibration { scale levels clips }
    Esc { rpm voltage current temperature failures errors }
    EscGroup { first escs }
    Engine { healthy rpm load fuel_consumed fuel_flow cylinder_head exhaust fuel_pressure }
    Generator { is_off speed }
    SpeedSensor { index rpm }
    Processor { temperature }
    CommandAck { command result target }
    Source { system component }
    SecondEstimate { attitude position altitude }
    AttitudeSetpoint { roll pitch rates }
    WantedRates { about of }
}

fn check(monitor: &mut Monitor, now: BootMs) {
    let sane = |counter: u8, value: f64| {
        let sign = counter >= FIGURE_FIRST || value >= 0.0;
        assert!(value.is_finite() && sign, "counter {counter} is {value}");
    };
    monitor.for_each_counter(sane);
    monitor.lifetime().totals.for_each(sane);
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
    let _ = monitor.take_request();
    while let Some(key) = monitor.save_due(now, Room::Enough) {
        let mut item = [0; ITEM_BYTES_MAX];
        let length = monitor.encode_item(key, &mut item);
        assert_eq!(Monitor::new(Params::defaults()).restore(key, &item[..length]), Ok(()), "{key:?}");
        monitor.saved(key);
    }
}

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
    let start_ms = if random.below(2) == 0 { 0 } else { u64::from(u32::MAX) - random.below(40_000_000) };
    let mut now = BootMs::from_millis(start_ms);
    monitor.observe(now, AUTOPILOT, &Observation::Heartbeat(random.any()));
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
            let heartbeat =
                Heartbeat { armed: now_ms > 1_000, state: 4, kind: VehicleKind::Rotorcraft, ..random.any() };
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
