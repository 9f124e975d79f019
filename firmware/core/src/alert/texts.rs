//! What the autopilots' texts mean. Source: the texts of `ArduPilot` (GPL-3.0) and `PX4` (BSD-3-Clause) of 2013 to 2026, as words that
//! they have in common; no text of theirs is here whole.
//!
//! The first row that fits counts. Its pattern is in small letters; `*` stands for anything, `^` at its beginning for the beginning of
//! the text.

use crate::cause::{Alert, Cause, Meaning};

const fn warn(pattern: &'static str, cause: Cause) -> Row {
    (pattern, Meaning::Wrong(Alert::warning(cause)), Where::Everywhere)
}

const fn act(pattern: &'static str, cause: Cause) -> Row {
    (pattern, Meaning::Wrong(Alert::critical(cause)), Where::Everywhere)
}

/// The end of what was wrong.
const fn over(pattern: &'static str, cause: Cause) -> Row {
    (pattern, Meaning::Wrong(Alert::over(cause)), Where::Everywhere)
}

/// Only the name of a part, which mild texts have too.
const fn broad(pattern: &'static str, cause: Cause) -> Row {
    (pattern, Meaning::Wrong(Alert::warning(cause)), Where::Severe)
}

const fn fine(pattern: &'static str) -> Row {
    (pattern, Meaning::Fine, Where::Everywhere)
}

/// Which texts a row is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Where {
    /// All.
    Everywhere,
    /// Those that are known to be severe.
    Severe,
}

type Row = (&'static str, Meaning, Where);

const TEXTS: &[Row] = &[
    fine("^prearm"),
    fine("^arm:"),
    fine("^arming"),
    fine("disarm denied"),
    fine("disarming denied"),
    over("radio failsafe clear", Cause::RemoteControl),
    over("throttle failsafe off", Cause::RemoteControl),
    over("gcs failsafe clear", Cause::GroundStation),
    over("ekf failsafe clear", Cause::Estimator),
    over("gps glitch clear", Cause::Gnss),
    over("glitch clear", Cause::Estimator),
    over("compensation off", Cause::Vibration),
    fine("clear"),
    fine("regained"),
    fine("recover"),
    fine("failsafe off"),
    fine("event off"),
    fine("crash dump"),
    fine("crashdump"),
    fine("disabled"),
    fine("returned to"),
    fine("re-enabled"),
    fine("data ok"),
    fine(": ok"),
    fine("ok again"),
    fine("unsupported"),
    fine("clamping"),
    fine("hit ground"),
    warn("compass needs calib", Cause::Compass),
    fine("calib"),
    fine("initiali"),
    fine("ground start"),
    fine("tmode"),
    fine("tune"),
    fine("motor test"),
    fine("cruise learn"),
    fine("yaw re-aligned"),
    warn("mission computer lost", Cause::GroundStation),
    fine("mission"),
    fine("mode change"),
    fine("requires position"),
    fine("param"),
    fine("landing sequence"),
    fine("smartrtl"),
    fine("rally"),
    fine("fence upload"),
    fine("log streaming"),
    fine("log download"),
    fine("avoidance enabled"),
    fine("avoidance disabled"),
    fine("avoid: performing"),
    fine("locate copter"),
    fine("command received"),
    fine("throttle not zero"),
    fine("not landed"),
    // Mishaps and what ends a flight.
    act("crash", Cause::Crash),
    act("ditching", Cause::Crash),
    warn("hard landing", Cause::Crash),
    act("parachute*releas", Cause::Crash),
    act("parachute*deploy", Cause::Crash),
    // PX4, also of a pilot's kill switch, after a landing too: its HEARTBEAT says the same, and whether that matters is seen there.
    fine("flight termination active"),
    act("terminat", Cause::Crash),
    // Motors, before sensors: "thrust loss", "imbalanced propeller".
    warn("thrust loss", Cause::Propulsion),
    act("motor*fail", Cause::Propulsion),
    act("engine*stop", Cause::Propulsion),
    act("engine*fail", Cause::Propulsion),
    act("lost motor", Cause::Propulsion),
    warn("yaw imbalance", Cause::Propulsion),
    broad("prop", Cause::Propulsion),
    warn("esc*fail", Cause::Propulsion),
    warn("esc*offline", Cause::Propulsion),
    broad("^esc", Cause::Propulsion),
    warn("governor fault", Cause::Propulsion),
    broad("generator", Cause::Propulsion),
    act("attitude failure", Cause::Attitude),
    // Power.
    act("critical battery", Cause::Power),
    act("emergency battery", Cause::Power),
    act("dangerous*battery", Cause::Power),
    act("battery*critical", Cause::Power),
    warn("batt*failsafe", Cause::Power),
    warn("low batt", Cause::Power),
    warn("batt*is low", Cause::Power),
    warn("batt*missing", Cause::Power),
    broad("batt", Cause::Power),
    broad("power module", Cause::Power),
    broad("power low", Cause::Power),
    broad("power high", Cause::Power),
    warn("overcurrent", Cause::Power),
    broad("low voltage", Cause::Power),
    // Links.
    warn("radio failsafe", Cause::RemoteControl),
    warn("rc failsafe", Cause::RemoteControl),
    warn("rc*failsafe", Cause::RemoteControl),
    warn("failsafe. short event", Cause::RemoteControl),
    warn("failsafe. long event", Cause::RemoteControl),
    warn("throttle failsafe on", Cause::RemoteControl),
    warn("failsafe - *event on", Cause::RemoteControl),
    broad("manual control", Cause::RemoteControl),
    warn("no rc receiver", Cause::RemoteControl),
    warn("gcs*failsafe", Cause::GroundStation),
    warn("gcs*lost", Cause::GroundStation),
    warn("link lost", Cause::GroundStation),
    warn("ground*station*lost", Cause::GroundStation),
    // What shakes, before the sensors that it shakes.
    warn("vibration comp", Cause::Vibration),
    warn("clipping", Cause::Vibration),
    // The estimator, before the sensors that its words name.
    act("ekf failsafe", Cause::Estimator),
    warn("ekf*variance", Cause::Estimator),
    warn("gps glitch or compass", Cause::Estimator),
    warn("gps glitch", Cause::Gnss),
    warn("lost gps", Cause::Gnss),
    warn("lane switch", Cause::Estimator),
    warn("emergency yaw", Cause::Estimator),
    warn("stopped aiding", Cause::Estimator),
    warn("ekf primary changed", Cause::Estimator),
    warn("primary ekf changed", Cause::Estimator),
    warn("hgt timeout", Cause::Estimator),
    warn("dead reckoning", Cause::Estimator),
    warn("ekf bad", Cause::Estimator),
    warn("bad ahrs", Cause::Estimator),
    warn("not stable", Cause::Estimator),
    warn("unstable", Cause::Estimator),
    warn("no valid*estimate", Cause::Estimator),
    warn("no longer valid", Cause::Estimator),
    warn("position error", Cause::Estimator),
    // Sensors.
    warn("low on stack", Cause::Processor),
    broad("rangefinder", Cause::Ranging),
    broad("distance sensor", Cause::Ranging),
    broad("lidar", Cause::Ranging),
    broad("optflow", Cause::Ranging),
    broad("optical flow", Cause::Ranging),
    broad("compass", Cause::Compass),
    warn("mag *fail", Cause::Compass),
    broad("magnet", Cause::Compass),
    warn("airspeed*fail", Cause::Airspeed),
    broad("airspeed", Cause::Airspeed),
    broad("diff. pressure", Cause::Airspeed),
    broad("gps", Cause::Gnss),
    broad("gnss", Cause::Gnss),
    broad("baro", Cause::Barometer),
    broad("static pressure", Cause::Barometer),
    broad("gyro", Cause::Gyro),
    broad("accel", Cause::Accelerometer),
    warn("error pos", Cause::Estimator),
    warn("error vel", Cause::Estimator),
    broad("terrain", Cause::Terrain),
    // The rest of the autopilot.
    warn("fence*breach", Cause::Fence),
    warn("geofence violation", Cause::Fence),
    warn("log file", Cause::Logging),
    broad("logg", Cause::Logging),
    broad("sd card", Cause::Logging),
    warn("cpu load", Cause::Processor),
    warn("internal error", Cause::Processor),
    warn("watchdog", Cause::Processor),
    warn("deadlock", Cause::Processor),
    broad("failsafe", Cause::Failsafe),
];

/// What a text means, known to be severe or not.
pub(super) fn meaning(text: &[u8], is_severe: bool) -> Meaning {
    let counts = |place: Where| is_severe || place == Where::Everywhere;
    let row = TEXTS.iter().find(|(pattern, _, place)| counts(*place) && fits(pattern.as_bytes(), text));
    row.map_or(Meaning::Unknown, |(_, meaning, _)| *meaning)
}

fn fits(pattern: &[u8], text: &[u8]) -> bool {
    let (pattern, anchored) = match pattern {
        [b'^', rest @ ..] => (rest, true),
        _ => (pattern, false),
    };
    let mut rest = text;
    let mut first = true;
    for part in pattern.split(|byte| *byte == b'*') {
        let found = if anchored && first { starts(rest, part).then_some(0) } else { find(rest, part) };
        let Some(at) = found else { return false };
        rest = rest.get(at + part.len()..).unwrap_or_default();
        first = false;
    }
    true
}

fn find(text: &[u8], part: &[u8]) -> Option<usize> {
    (0..=text.len().checked_sub(part.len())?).find(|at| starts(&text[*at..], part))
}

fn starts(text: &[u8], part: &[u8]) -> bool {
    text.get(..part.len()).is_some_and(|beginning| beginning.eq_ignore_ascii_case(part))
}
