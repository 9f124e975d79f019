//! A simulated quad, driven by scripts.
#![allow(
    dead_code,
    unused_imports,
    missing_docs,
    unreachable_pub,
    reason = "each test file uses its own part of this"
)]

mod script;

pub use script::{Said, Script};

use hums_core::Monitor;
use hums_core::happening::Happening;
use hums_core::health::Finding;
use hums_core::mishap::Report;
use hums_core::observation::{
    Attitude, Autopilot, Battery, Esc, EscGroup, Estimator, EstimatorScale, GlobalPosition, Gnss,
    GnssIntegrity, Heartbeat, Hud, Imu, LandedState, Observation, Sensors, Source, SystemStatus, SystemTime,
    VehicleKind, Vibration, VtolState,
};
use hums_core::parameters::Params;
use hums_core::protect::Request;
use hums_core::status::{LinkReading, RecorderStatus, Recording};
use hums_core::time::BootMs;
use hums_core::units::{
    Amperes, Celsius, Fraction, Metres, MetresPerSecond, MetresPerSecond2, Radians, Rpm, Volts,
};
use hums_core::usage::UsageCounter;

pub const AUTOPILOT: Source = Source { system: 1, component: 1 };

/// A healthy quad in hover; a script changes its messages.
#[derive(Clone)]
pub struct Quad {
    pub silent: bool,
    /// Its battery sends nothing.
    pub battery_silent: bool,
    pub armed: bool,
    pub boot_offset_ms: i64,
    pub battery: Battery,
    pub escs: [Option<Esc>; 4],
    pub estimator: Estimator,
    pub gnss: Gnss,
    pub integrity: GnssIntegrity,
    pub vibration: Vibration,
    pub acceleration_down: f32,
    pub roll: f32,
    pub system: SystemStatus,
    pub recorder: RecorderStatus,
    pub lost: f32,
    /// Metres above home.
    pub height: f32,
    pub throttle: f32,
    /// `MAV_STATE`
    pub state: u8,
    /// The autopilot's climb setpoint, upwards, if it sends one.
    pub climb_wanted: Option<f32>,
    /// The autopilot's own mode number.
    pub mode: u32,
    pub autopilot: Autopilot,
    pub kind: VehicleKind,
    /// `MAV_TYPE`
    pub type_number: u8,
    /// Metres a second, upwards.
    pub climb: f32,
    /// `EXTENDED_SYS_STATE`, if it is sent.
    pub landed: Option<LandedState>,
    /// Rotors or wings of a VTOL.
    pub vtol: VtolState,
    /// Metres above home before the flight, for its first two seconds.
    pub start_height: f32,
}

impl Default for Quad {
    fn default() -> Self {
        Self::healthy()
    }
}

impl Quad {
    pub fn healthy() -> Self {
        let esc = Esc {
            rpm: Some(Rpm(5_000.0)),
            voltage: Some(Volts(15.5)),
            current: Some(Amperes(5.0)),
            temperature: Some(Celsius(45.0)),
            failures: Some(0),
            errors: Some(u32::MAX - 3),
        };
        Self {
            silent: false,
            battery_silent: false,
            armed: true,
            boot_offset_ms: 100_000,
            battery: Battery {
                voltage: Some(Volts(15.5)),
                current: Some(Amperes(20.0)),
                remaining: Some(Fraction(0.8)),
                temperature: Some(Celsius(35.0)),
                ..Battery::default()
            },
            escs: [Some(esc); 4],
            estimator: Estimator {
                scale: EstimatorScale::Variance,
                velocity: Some(0.05),
                position_horizontal: Some(0.04),
                position_vertical: Some(0.03),
                compass: Some(0.06),
                ..Estimator::default()
            },
            gnss: Gnss {
                fix: 3,
                satellites: Some(16),
                hdop: Some(0.8),
                accuracy: Some(Metres(0.5)),
                ..Gnss::default()
            },
            integrity: GnssIntegrity { jamming: 1, spoofing: 1, ..GnssIntegrity::default() },
            vibration: Vibration { levels: [Some(5.0); 3], clips: [7; 3], ..Vibration::default() },
            acceleration_down: -9.8,
            roll: 0.02,
            system: SystemStatus {
                load: Some(Fraction(0.3)),
                sensors: Some(Sensors::of(u32::MAX, u32::MAX, u32::MAX)),
                ..SystemStatus::default()
            },
            recorder: RecorderStatus {
                recording: Recording::Running,
                room: Some(0.9),
                ..RecorderStatus::default()
            },
            lost: 0.0,
            height: 20.0,
            throttle: 0.5,
            state: 4,
            climb_wanted: None,
            mode: 4,
            autopilot: Autopilot::ArduPilot,
            kind: VehicleKind::Rotorcraft,
            type_number: 2,
            climb: -0.1,
            landed: None,
            vtol: VtolState::Unknown,
            start_height: 0.0,
        }
    }

    /// Its messages, every 100 ms.
    pub fn says(&self, now_ms: u64) -> Vec<Observation> {
        if self.silent {
            return Vec::new();
        }
        let boot_ms = (now_ms as i64 + self.boot_offset_ms).max(0) as u32;
        let height = if now_ms < 2_000 { self.start_height } else { self.height };
        let heartbeat = Heartbeat {
            autopilot: self.autopilot,
            kind: self.kind,
            type_number: self.type_number,
            armed: self.armed,
            state: self.state,
            mode: self.mode,
            ..Heartbeat::default()
        };
        let acceleration = [0.0, 0.0, self.acceleration_down].map(MetresPerSecond2);
        let mut said = vec![
            Observation::Attitude(Attitude {
                roll: Radians(self.roll),
                boot_ms: Some(boot_ms),
                ..Attitude::default()
            }),
            Observation::GlobalPosition(GlobalPosition {
                relative_altitude: Metres(height),
                velocity: [0.1, 0.1, -self.climb].map(MetresPerSecond),
                ..GlobalPosition::default()
            }),
            Observation::Hud(Hud { throttle: Some(Fraction(self.throttle)), ..Hud::default() }),
            Observation::Imu(Imu { acceleration: Some(acceleration), ..Imu::default() }),
            Observation::Escs(EscGroup { first: 0, escs: self.escs }),
            Observation::Estimator(self.estimator),
            Observation::Gnss(self.gnss),
            Observation::GnssIntegrity(self.integrity),
            Observation::Vibration(self.vibration),
            Observation::SystemStatus(self.system),
        ];
        said.extend((!self.battery_silent).then_some(Observation::Battery(self.battery)));
        said.extend(self.climb_wanted.map(|climb| Observation::ClimbWanted(MetresPerSecond(climb))));
        if now_ms.is_multiple_of(500) {
            said.push(Observation::Heartbeat(heartbeat));
            said.push(Observation::SystemTime(SystemTime { boot_ms, utc_micros: None }));
            said.extend(self.landed.map(|landed| Observation::Landed(landed, self.vtol)));
        }
        said
    }
}

/// A monitor and all its reports, with times in milliseconds.
pub struct Run {
    pub monitor: Monitor,
    pub findings: Vec<Finding>,
    pub happenings: Vec<(u64, Happening)>,
    pub requests: Vec<(u64, Request)>,
    /// The report to the ground for each change of a mishap.
    pub reports: Vec<(u64, Report)>,
}

impl Run {
    pub fn new(params: &Params) -> Self {
        let monitor = Monitor::new(*params);
        let (findings, happenings, requests, reports) = Default::default();
        Self { monitor, findings, happenings, requests, reports }
    }

    /// The same with a monitor that has a past.
    pub fn of(monitor: &Monitor) -> Self {
        Self { monitor: *monitor, ..Self::new(&Params::defaults()) }
    }

    fn tick(&mut self, now_ms: u64, quad: &Quad) {
        let now = BootMs::from_millis(now_ms);
        let link = LinkReading { frames_lost: Some(quad.lost), at: now };
        self.monitor.tick(now, &link, &quad.recorder, &mut |finding| self.findings.push(*finding));
        while let Some(happening) = self.monitor.take_happening() {
            if let Happening::Mishap(change) = happening {
                self.reports.push((now_ms, self.monitor.flight().report(change)));
            }
            self.happenings.push((now_ms, happening));
        }
        self.requests.extend(self.monitor.take_request().map(|request| (now_ms, request)));
    }

    /// Steps the monitor every 50 ms; before each step the script feeds it.
    pub fn steps(&mut self, times_ms: core::ops::Range<u64>, mut script: impl FnMut(u64, &mut Monitor)) {
        for now_ms in times_ms.step_by(50) {
            script(now_ms, &mut self.monitor);
            self.tick(now_ms, &Quad::healthy());
        }
    }

    /// The same, with a healthy quad's messages every 100 ms; the script changes the quad, and adds observations.
    pub fn flies(
        &mut self,
        times_ms: core::ops::Range<u64>,
        mut script: impl FnMut(u64, &mut Quad, &mut Vec<Observation>),
    ) {
        for now_ms in times_ms.step_by(50) {
            let (mut quad, mut more) = (Quad::healthy(), Vec::new());
            script(now_ms, &mut quad, &mut more);
            if now_ms.is_multiple_of(100) {
                observe(&mut self.monitor, now_ms, AUTOPILOT, quad.says(now_ms).into_iter().chain(more));
            }
            self.tick(now_ms, &quad);
        }
    }

    /// The same, with the autopilot's messages every 100 ms.
    pub fn says(&mut self, times_ms: core::ops::Range<u64>, mut says: impl FnMut(u64) -> Vec<Observation>) {
        self.steps(times_ms, |now_ms, monitor| {
            if now_ms.is_multiple_of(100) {
                observe(monitor, now_ms, AUTOPILOT, says(now_ms));
            }
        });
    }

    /// The findings of a check.
    pub fn of_check(&self, check: &str) -> impl DoubleEndedIterator<Item = &Finding> + Clone {
        self.findings.iter().filter(move |finding| finding.check == check)
    }

    /// The names of the checks with a finding, each once, in alphabetical order.
    pub fn checks(&self) -> Vec<&'static str> {
        let mut checks: Vec<_> = self.findings.iter().map(|finding| finding.check).collect();
        checks.sort_unstable();
        checks.dedup();
        checks
    }

    pub fn counts(&self, counters: [UsageCounter; 3]) -> [u32; 3] {
        counters.map(|counter| self.monitor.usage().value(counter).unwrap_or(0.0) as u32)
    }
}

/// The rows of a table: one a line, with bars between the columns. A line that begins with `#` is a comment; `-` is nothing.
pub fn rows<const N: usize>(table: &str) -> impl Iterator<Item = [&str; N]> {
    let lines = table.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(|line| {
        let columns: Vec<_> =
            line.split(" | ").map(|column| if column == "-" { "" } else { column }).collect();
        columns.try_into().expect(line)
    })
}

/// The defaults with these settings.
pub fn params(settings: &[(&str, f32)]) -> Params {
    let mut params = Params::defaults();
    for (name, value) in settings {
        params.set(name, *value).expect(name);
    }
    params
}

/// Feeds these observations of a source.
pub fn observe(
    monitor: &mut Monitor,
    now_ms: u64,
    source: Source,
    said: impl IntoIterator<Item = Observation>,
) {
    for observation in said {
        monitor.observe(BootMs::from_millis(now_ms), source, &observation);
    }
}
