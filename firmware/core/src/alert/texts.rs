//! What the autopilots' texts mean. Source: the texts of `ArduPilot` (GPL-3.0) and `PX4` (BSD-3-Clause) of 2013 to 2026, as words that
//! they have in common; no text of theirs is here whole.
//!
//! The first row that fits counts. Its pattern is in small letters; `*` stands for anything, `^` at its beginning for the beginning of
//! the text. Most rows are ruled out without a look at the text: a pattern's pairs of letters must be among those of the text ([`PAIRS`]).

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

/// Only what a text is about, which texts of failures have too.
const fn mild(pattern: &'static str) -> Row {
    (pattern, Meaning::Fine, Where::Sound)
}

/// Which texts a row is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Where {
    /// All.
    Everywhere,
    /// Those that are known to be severe.
    Severe,
    /// Those without a word of failure ([`FAILURES`]).
    Sound,
}

type Row = (&'static str, Meaning, Where);

/// Words of failure ("fail" alone is in "failsafe" too).
const FAILURES: [&str; 8] =
    ["failed", "failure", "fail:", "error", "lost", "timeout", " fault", "unsuccessful"];

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
    fine("recovered"),
    mild("recover"),
    fine("failsafe off"),
    fine("event off"),
    fine("crash dump"),
    fine("crashdump"),
    fine("failure injection"),
    mild("disabled"),
    fine("returned to"),
    fine("re-enabled"),
    fine("data ok"),
    fine(": ok"),
    fine("ok again"),
    mild("unsupported"),
    fine("clamping"),
    fine("hit ground"),
    warn("compass needs calib", Cause::Compass),
    mild("calib"),
    mild("initiali"),
    fine("ground start"),
    fine("tmode"),
    fine("autotune"),
    fine("quicktune"),
    mild("tune"),
    fine("motor test"),
    fine("cruise learn"),
    fine("yaw re-aligned"),
    warn("mission computer lost", Cause::GroundStation),
    mild("mission"),
    fine("mode change"),
    fine("requires position"),
    mild("param"),
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
    // PX4's voter of sensors, of the one that it flies by: "Accel #0 fail:  TIMEOUT!".
    act("accel #*fail", Cause::Accelerometer),
    act("gyro #*fail", Cause::Gyro),
    warn("baro #*fail", Cause::Barometer),
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

/// The pairs of letters of each row's pattern.
static PAIRS: [u64; TEXTS.len()] = {
    let mut all = [0; TEXTS.len()];
    let mut row = 0;
    while row < TEXTS.len() {
        all[row] = pairs(TEXTS[row].0.as_bytes());
        row += 1;
    }
    all
};

/// The pairs of letters of a text or a pattern, each as one of 64 bits: a text that a pattern fits has all bits of the pattern.
const fn pairs(text: &[u8]) -> u64 {
    let mut bits = 0;
    let mut rest = text;
    while let [first, second, ..] = rest {
        // What stands for anything is no letter. (No text's own `*` or `^` is in a pattern.)
        if !matches!(first, b'*' | b'^') && !matches!(second, b'*' | b'^') {
            let sum = first.to_ascii_lowercase() as u32 * 7 + second.to_ascii_lowercase() as u32;
            bits |= 1 << (sum % u64::BITS);
        }
        let [_, next @ ..] = rest else { break };
        rest = next;
    }
    bits
}

/// What a text means, known to be severe or not.
pub(super) fn meaning(text: &[u8], is_severe: bool) -> Meaning {
    let has = pairs(text);
    let is_about = |pattern: &str, place: Where| match place {
        Where::Everywhere => fits(pattern.as_bytes(), text),
        Where::Severe => is_severe && fits(pattern.as_bytes(), text),
        Where::Sound => {
            fits(pattern.as_bytes(), text)
                && !FAILURES.iter().any(|word| find(text, word.as_bytes()).is_some())
        }
    };
    let mut rows = TEXTS.iter().zip(&PAIRS).filter(|(_, pairs)| has & **pairs == **pairs);
    let row = rows.find(|((pattern, _, place), _)| is_about(pattern, *place));
    row.map_or(Meaning::Unknown, |((_, meaning, _), _)| *meaning)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_that_a_pattern_fits_has_its_pairs_of_letters() {
        for (pattern, ..) in TEXTS {
            for gap in ["", " ", "*", "^", "of x"] {
                let text = pattern.replace('^', "").replace('*', gap).to_ascii_uppercase();
                assert!(fits(pattern.as_bytes(), text.as_bytes()), "{pattern}: {text}");
                assert_eq!(
                    pairs(text.as_bytes()) & pairs(pattern.as_bytes()),
                    pairs(pattern.as_bytes()),
                    "{text}"
                );
            }
            assert!(
                pattern.is_ascii() && !pattern.bytes().any(|byte| byte.is_ascii_uppercase()),
                "{pattern}"
            );
        }
        assert_ne!(pairs(b"flux"), 0);
        assert_eq!(pairs(b"a"), 0, "one letter is no pair");
    }
}
