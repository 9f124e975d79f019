//! Meanings of the autopilots' texts. Source: common words of the texts of `ArduPilot` (GPL-3.0) and `PX4`
//! (BSD-3-Clause) of 2013 to 2026; no whole text is copied.
//!
//! The first row that fits counts. Its pattern is in small letters; `*` stands for anything, `^` at its beginning for
//! the beginning of the text. Most rows are ruled out without a search: all pairs of letters of a pattern must be in
//! the text ([`PAIRS`]).

use hums_core::cause::{Alert, Cause};

use super::Meaning;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TextScope {
    /// All.
    Everywhere,
    Severe,
    /// Those without a word of failure ([`FAILURES`]).
    Sound,
}

macro_rules! kind {
    (fine) => {
        (Meaning::Fine, TextScope::Everywhere)
    };
    // Only a topic, which texts of failures have too.
    (mild) => {
        (Meaning::Fine, TextScope::Sound)
    };
    // Only the name of a part, which mild texts have too.
    (broad $cause:ident) => {
        (Meaning::Wrong(Alert::warning(Cause::$cause)), TextScope::Severe)
    };
    ($urgency:ident $cause:ident) => {
        (Meaning::Wrong(Alert::$urgency(Cause::$cause)), TextScope::Everywhere)
    };
}

macro_rules! texts {
    ($($kind:tt: $($pattern:literal)+;)*) => {
        const TEXTS: &[(&str, (Meaning, TextScope))] = &[$($(($pattern, kind! $kind),)+)*];
    };
}

/// Words of failure ("fail" alone is in "failsafe" too).
const FAILURES: [&str; 8] =
    ["failed", "failure", "fail:", "error", "lost", "timeout", " fault", "unsuccessful"];

texts! {
    (fine): "^prearm" "^arm:" "^arming" "^disarming motors" "disarm denied" "disarming denied";
    (over RemoteControl): "radio failsafe clear" "throttle failsafe off";
    (over GroundStation): "gcs failsafe clear";
    (over Estimator): "ekf failsafe clear";
    (over Gnss): "gps glitch clear";
    (over Estimator): "glitch clear";
    (over Vibration): "compensation off";
    (fine): "clear" "regained" "recovered";
    (mild): "recover";
    (fine): "failsafe off" "event off" "crash dump" "crashdump" "failure injection";
    (mild): "disabled";
    (fine): "returned to" "re-enabled" "data ok" ": ok" "ok again";
    (mild): "unsupported";
    (fine): "clamping" "hit ground";
    (warning Compass): "compass needs calib";
    (mild): "calib" "initiali";
    (fine): "ground start" "tmode" "autotune" "quicktune";
    (mild): "tune";
    (fine): "motor test" "cruise learn" "yaw re-aligned";
    (warning GroundStation): "mission computer lost";
    // A plan that is not flown, and a log without a hard-fault dump.
    (fine): "mission update failed" "mission check failed" "hardfault handler";
    (mild): "mission";
    (fine): "mode change" "requires position";
    (mild): "param";
    (fine): "landing sequence" "smartrtl" "rally" "fence upload" "log streaming" "log download"
        "avoidance enabled" "avoidance disabled" "avoid: performing" "locate copter"
        "command received" "throttle not zero" "not landed";
    (critical Crash): "crash" "ditching";
    (warning Crash): "hard landing";
    (critical Crash): "parachute*releas" "parachute*deploy";
    // PX4 sends these also after a landing, for a pilot's kill switch. HEARTBEAT decides whether it matters.
    (fine): "flight termination active" "kill-switch engaged";
    (critical Crash): "terminat";
    // Motors, before sensors: "thrust loss", "imbalanced propeller".
    (warning Propulsion): "thrust loss";
    (critical Propulsion): "motor*fail" "engine*stop" "engine*fail" "lost motor";
    (warning Propulsion): "yaw imbalance";
    (broad Propulsion): "prop";
    (warning Propulsion): "esc*fail" "esc*offline";
    (broad Propulsion): "^esc";
    (warning Propulsion): "governor fault";
    (broad Propulsion): "generator";
    (critical Attitude): "attitude failure";
    // Power.
    (critical Power): "critical battery" "emergency battery" "dangerous*battery" "battery*critical";
    (warning Power): "batt*failsafe" "low batt" "batt*is low" "batt*missing";
    (broad Power): "batt" "power module" "power low" "power high";
    (warning Power): "overcurrent";
    (broad Power): "low voltage";
    // Links.
    (warning RemoteControl): "radio failsafe" "rc failsafe" "rc*failsafe" "failsafe. short event"
        "failsafe. long event" "throttle failsafe on" "failsafe - *event on";
    (broad RemoteControl): "manual control";
    (warning RemoteControl): "no rc receiver";
    (warning GroundStation): "gcs*failsafe" "gcs*lost" "link lost" "ground*station*lost";
    // Vibration, before the sensors that it shakes.
    (warning Vibration): "vibration comp" "clipping";
    // The estimator, before the sensors that its words name.
    (critical Estimator): "ekf failsafe";
    (warning Estimator): "ekf*variance" "gps glitch or compass";
    (warning Gnss): "gps glitch" "lost gps";
    (warning Estimator): "lane switch" "emergency yaw" "stopped aiding" "ekf primary changed"
        "primary ekf changed" "hgt timeout" "dead reckoning" "ekf bad" "bad ahrs"
        "not stable" "unstable" "no valid*estimate" "no longer valid" "position error";
    // Sensors.
    (warning Processor): "low on stack";
    (broad Ranging): "rangefinder" "distance sensor" "lidar" "optflow" "optical flow";
    (broad Compass): "compass";
    (warning Compass): "mag *fail";
    // PX4's sensor voter, about the selected sensor: "Accel #0 fail: TIMEOUT!".
    (critical Accelerometer): "accel #*fail";
    (critical Gyro): "gyro #*fail";
    (warning Barometer): "baro #*fail";
    (broad Compass): "magnet";
    (warning Airspeed): "airspeed*fail";
    (broad Airspeed): "airspeed" "diff. pressure";
    (broad Gnss): "gps" "gnss";
    (broad Barometer): "baro" "static pressure";
    (broad Gyro): "gyro";
    (broad Accelerometer): "accel";
    (warning Estimator): "error pos" "error vel";
    (broad Terrain): "terrain";
    (warning Fence): "fence*breach" "geofence violation";
    (warning Logging): "log file";
    (broad Logging): "logg" "sd card";
    (warning Processor): "cpu load" "internal error" "watchdog" "deadlock";
    (broad Failsafe): "failsafe";
}

static PAIRS: [u64; TEXTS.len()] = {
    let mut all = [0; TEXTS.len()];
    let mut row = 0;
    while row < TEXTS.len() {
        all[row] = pairs(TEXTS[row].0.as_bytes());
        row += 1;
    }
    all
};

/// The pairs of letters of a text or a pattern, each as one of 64 bits. A text that fits a pattern has all bits of
/// the pattern.
const fn pairs(text: &[u8]) -> u64 {
    let mut bits = 0;
    let mut rest = text;
    while let [first, second, ..] = rest {
        // Wildcards do not count as letters. (No text's own `*` or `^` is in a pattern.)
        if !matches!(first, b'*' | b'^') && !matches!(second, b'*' | b'^') {
            let sum = first.to_ascii_lowercase() as u32 * 7 + second.to_ascii_lowercase() as u32;
            bits |= 1 << (sum % u64::BITS);
        }
        let [_, next @ ..] = rest else { break };
        rest = next;
    }
    bits
}

pub(super) fn meaning(text: &[u8], is_severe: bool) -> Meaning {
    let has = pairs(text);
    let is_about = |pattern: &str, place: TextScope| match place {
        TextScope::Everywhere => fits(pattern.as_bytes(), text),
        TextScope::Severe => is_severe && fits(pattern.as_bytes(), text),
        TextScope::Sound => {
            fits(pattern.as_bytes(), text)
                && !FAILURES.iter().any(|word| find(text, word.as_bytes()).is_some())
        }
    };
    let mut rows = TEXTS.iter().zip(&PAIRS).filter(|(_, pairs)| has & **pairs == **pairs);
    let row = rows.find(|((pattern, (_, place)), _)| is_about(pattern, *place));
    row.map_or(Meaning::Unknown, |((_, (meaning, _)), _)| *meaning)
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
