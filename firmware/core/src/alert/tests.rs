use super::*;
use crate::bytes::fnv1a;

const T0: BootMs = BootMs::from_millis(1_000);

fn after(seconds: u64) -> BootMs {
    T0 + Millis::from_secs(seconds)
}

#[test]
fn texts_are_told_by_what_they_mean() {
    let warn = |cause| Some(Alert::warning(cause));
    let act = |cause| Some(Alert::critical(cause));
    let over = |cause| Some(Alert::over(cause));
    for (severity, text, said) in [
        (2, "EKF3 lane switch 1", warn(Cause::Estimator)),
        (2, "EKF Failsafe: changed to LAND Mode", act(Cause::Estimator)),
        (2, "EKF Failsafe Cleared", over(Cause::Estimator)),
        (2, "GPS Glitch or Compass error", warn(Cause::Estimator)),
        (2, "GPS Glitch", warn(Cause::Gnss)),
        (2, "GPS Glitch cleared", over(Cause::Gnss)),
        (2, "Error compass variance", warn(Cause::Compass)),
        (2, "PreArm: Compass not healthy", None),
        (2, "Arm: Gyros inconsistent", None),
        (0, "Potential Thrust Loss (2)", warn(Cause::Propulsion)),
        (0, "Crash: Disarming", act(Cause::Crash)),
        (4, "Radio Failsafe - Disarming", warn(Cause::RemoteControl)),
        (4, "Radio Failsafe Cleared", over(Cause::RemoteControl)),
        (4, "Battery 1 is low 10.50V used 100 mAh", warn(Cause::Power)),
        (3, "Airspeed sensor 1 failure. Disabling", warn(Cause::Airspeed)),
        (2, "Vibration compensation ON", warn(Cause::Vibration)),
        (2, "Vibration compensation OFF", over(Cause::Vibration)),
        (3, "DISARMING MOTORS", None),
        (2, "Auto mission changed, restarted command", None),
        (3, "[navigator] mission update failed", None),
        (3, "[logger] Failed to register ULog file to the hardfault handler (-2)", None),
        (3, "[logger] Failed to open log file", warn(Cause::Logging)),
        (2, "Preflight Fail: Attitude failure (roll)", act(Cause::Attitude)),
        (4, "[health_and_arming_checks] Preflight Fail: Flight termination active", None),
        (2, "AFS: terminating due to fence", act(Cause::Crash)),
        (2, "Accel 0 clipping, not safe to fly!\t", warn(Cause::Vibration)),
        (3, "MAG #0 failed:  TIMEOUT!", warn(Cause::Compass)),
        (3, "Accel #0 fail:  TIMEOUT!\t", act(Cause::Accelerometer)),
        (0, "Gyro #1 fail:  HIGH ERRCOUNT!", act(Cause::Gyro)),
        (0, "Baro #0 fail:  TIMEOUT!", warn(Cause::Barometer)),
        (2, "Terrain failsafe recovery failure: No Rangefinder!", warn(Cause::Ranging)),
        (2, "Terrain failsafe recovery timeout!", warn(Cause::Terrain)),
        (2, "ILAB: Diff. pressure sensor unsuccessful initialization", warn(Cause::Airspeed)),
        (3, "Mission storage failed", warn(Cause::Other)),
        (3, "param auto save failed (-1)", warn(Cause::Other)),
        (2, "Compass 2 failed, disabled", warn(Cause::Compass)),
        (2, "Compass disabled", None),
        (4, "Throttle failsafe disabled", None),
        (4, "GCS failsafe disabled", None),
        (2, "AutoTune: Rate D Gain Determination Failed", None),
        (2, "RC not calibrated", None),
        (2, "Failsafe activated\t", warn(Cause::Failsafe)),
        (2, "[load_mon] gps low on stack! (100 bytes left)", warn(Cause::Processor)),
        (3, "Rangefinder: no data, using baro", warn(Cause::Ranging)),
        (4, "RC Short Failsafe: switched to CIRCLE", warn(Cause::RemoteControl)),
        (2, "Compass needs calibration - Land now!", warn(Cause::Compass)),
        (4, "Crash check disabled", None),
        (4, "Terrain: clamping offset -22 to -15", None),
        (2, "HUMS: battery 1 low: 6.8 %, LAND NOW", None),
        (2, "SRC=1/191:HUMS: motor 3 lost: 2 % of normal amps, LAND NOW", None),
        (2, "GCS:battery low", None),
        (2, "Flux capacitor drained", warn(Cause::Other)),
        (2, "script error", warn(Cause::Other)),
        (2, "Lua: a.lua:1: attempt to index a nil value", warn(Cause::Other)),
        (4, "Flux capacitor low", None),
        (6, "EKF3 IMU0 is using GPS", None),
    ] {
        assert_eq!(of_text(Some(severity), text.as_bytes()), said, "{text}");
    }
    assert_eq!(of_text(None, b"Flux capacitor drained"), None, "a log that keeps no severity");
    assert_eq!(of_text(None, b"EKF3 IMU0 is using GPS"), None, "names a part and is mild");
    assert_eq!(of_text(None, b"GPS Glitch"), warn(Cause::Gnss));
}

#[test]
fn the_lowest_severity_of_old_autopilots_is_no_alert() {
    for text in ["Reached Command #1", "init home", "gps alt: 25", "Nav command index updated to #1"] {
        assert_eq!(of_text(Some(1), text.as_bytes()), None, "{text}");
    }
    assert_eq!(
        of_text(Some(1), b"Parachute: Released"),
        Some(Alert::critical(Cause::Crash)),
        "known by itself"
    );
    assert_eq!(of_text(Some(1), b"Throttle failsafe on 900"), Some(Alert::warning(Cause::RemoteControl)));
}

#[test]
fn patterns_fit_what_they_say_and_never_panic() {
    for text in ["", "^", "*", "e", "EKF", "\u{0}\u{ff}", "esc"] {
        let _ = of_text(Some(0), text.as_bytes());
    }
    assert_eq!(of_text(Some(4), b"Descending"), None, "^esc is a beginning");
}

#[test]
fn an_event_tells_its_cause_by_its_number_and_its_arguments() {
    // commander_failsafe_enter_hold: modes, action, delay, cause.
    let hold = 1 << 24 | 0x00FF_FFFF & fnv1a("commander_failsafe_enter_hold");
    for (cause, told) in
        [(1, Cause::RemoteControl), (2, Cause::GroundStation), (3, Cause::Power), (0, Cause::Failsafe)]
    {
        let said = of_event(hold, 2, &[0, 0, 0, 0, 5, 5, 0, cause]);
        assert_eq!(said, Some(Alert::warning(told)), "{cause}");
    }
    assert_eq!(of_event(hold, 2, &[]), Some(Alert::warning(Cause::Failsafe)), "cut short");
    for name in ["commander_kill_sw_engaged", "check_system_flight_term_active"] {
        let killed = 1 << 24 | 0x00FF_FFFF & fnv1a(name);
        assert_eq!(of_event(killed, 2, &[]), None, "the pilot's kill switch, also after a landing: {name}");
    }
    assert_eq!(of_event(7, 2, &[]), Some(Alert::warning(Cause::Other)), "not known and severe");
    assert_eq!(of_event(7, 3, &[]), None, "not known");
}

fn armed() -> Alerts {
    let mut alerts = Alerts::default();
    alerts.take_armed(T0, true);
    alerts
}

/// Plays a script of steps, each with its second:
///
/// - `arm`, `disarm`;
/// - a text (`critical Gnss`);
/// - flags of `SYS_STATUS` (`flags`, and the bit of an unhealthy sensor);
/// - the expected level of a cause (`Gnss = 2`; `-` if it was never reported).
fn play(script: &str) {
    let mut alerts = Alerts::default();
    for step in script.split("; ") {
        let words: Vec<&str> = step.split(' ').collect();
        let at = after(words[0].parse().unwrap());
        let cause = |name: &str| Cause::ALL.into_iter().find(|cause| format!("{cause:?}") == name).unwrap();
        match words[1..] {
            ["arm"] => alerts.take_armed(at, true),
            ["disarm"] => alerts.take_armed(at, false),
            ["flags"] => alerts.take_sensors(at, &Sensors::of(u32::MAX, u32::MAX, u32::MAX)),
            ["flags", bit] => {
                let bit = 1 << bit.parse::<u32>().unwrap();
                alerts.take_sensors(at, &Sensors::of(u32::MAX, u32::MAX, !bit));
            }
            [name, "=", level] => {
                let level = match level {
                    "-" => None,
                    "ended" => Some(ENDED),
                    level => Some(level.parse().unwrap()),
                };
                assert_eq!(alerts.level(at, cause(name), false), level, "{step} of {script}");
            }
            ["warning", name] => alerts.tell(at, Alert::warning(cause(name))),
            ["critical", name] => alerts.tell(at, Alert::critical(cause(name))),
            ["over", name] => alerts.tell(at, Alert::over(cause(name))),
            _ => panic!("{step}"),
        }
    }
}

#[test]
fn words_and_flags_hold_as_long_as_they_should() {
    for script in [
        // Texts before arming do not count. A text holds for 10 s, the worst one of that time.
        "0 Gnss = -; 0 warning Gnss; 0 Gnss = -; 0 arm; 0 critical Gnss; 5 warning Gnss; 0 Gnss = 2; 14 Gnss = 2; \
         15 Gnss = 2; 16 Gnss = ended; 5 Gyro = -",
        // It ends by a text; it outlasts disarming, but not the next arming.
        "0 arm; 20 warning Gnss; 21 over Gnss; 22 Gnss = 0; 23 warning Gnss; 24 disarm; 24 Gnss = 1; 25 arm; 25 Gnss = -",
        "0 arm; 1 disarm; 1 warning Gnss; 2 critical Crash; 2 Crash = 2; 2 Gnss = -",
        "0 arm; 1 disarm; 2 critical Accelerometer; 2 Accelerometer = 2",
        "0 arm; 1 disarm; 5 critical Crash; 5 Crash = -",
        // A flag counts when two messages have it, and while messages come. No flag reports a crash.
        "0 arm; 0 flags; 0 Compass = 0; 1 flags 2; 1 Compass = 0; 2 flags 2; 2 Compass = 1; 3 flags; 3 Compass = 0; \
         4 flags 2; 4 Compass = 0; 5 flags 2; 5 Compass = 1; 10 Compass = 1; 11 Compass = ended; 12 flags; \
         12 Compass = 0; 12 Crash = ended; 13 disarm; 13 Compass = ended",
        "0 arm; 0 flags 16; 0 RemoteControl = 0; 1 flags 16; 1 RemoteControl = ended; 2 flags; 2 RemoteControl = 0; \
         3 flags 16; 3 RemoteControl = 0; 4 flags 16; 4 RemoteControl = 1",
    ] {
        play(script);
    }
}

#[test]
fn a_sensor_that_is_lost_heals_with_the_word_that_it_is_healthy() {
    const RECEIVER: u32 = 1 << 16;
    const GNSS: u32 = 1 << 5;
    let mut alerts = armed();
    let mut says = |second, [unhealthy, lost, healthy]: [u32; 3]| {
        alerts.take_sensors(after(second), &Sensors { unhealthy, lost, healthy });
        [Cause::Gnss, Cause::RemoteControl].map(|cause| alerts.level(after(second), cause, false))
    };
    let good = [Some(0.0), Some(0.0)];
    assert_eq!(says(0, [0, RECEIVER, GNSS]), [Some(0.0), Some(ENDED)]);
    assert_eq!(
        says(1, [0, RECEIVER, GNSS]),
        [Some(0.0), Some(ENDED)],
        "never switched on: not lost, and not good"
    );
    assert_eq!(says(2, [0, 0, GNSS | RECEIVER]), good);
    assert_eq!(says(3, [GNSS, RECEIVER, 0]), good, "one message is no alarm");
    for second in 4..20 {
        assert_eq!(says(second, [0, GNSS | RECEIVER, 0]), [Some(1.0), Some(1.0)], "PX4 calls it not present");
    }
    assert_eq!(says(20, [0, 0, 0]), [Some(ENDED), Some(ENDED)], "nothing is said of them");
    assert_eq!(says(21, [0, 0, GNSS | RECEIVER]), good);
}

#[test]
fn the_estimators_flags_are_read_on_either_scale() {
    const GOOD: u16 = 0x37F;
    let with = |has_fix, in_air, scale, flags: [u16; 3]| {
        let mut alerts = armed();
        for (second, flags) in (0..).zip(flags) {
            let told = Estimator { scale, flags, ..Estimator::default() };
            alerts.take_estimator(after(second), &told, has_fix, in_air);
        }
        let level = |cause| alerts.level(after(2), cause, false) == Some(1.0);
        (level(Cause::Gnss), level(Cause::Accelerometer), level(Cause::Estimator))
    };
    let says = |scale, flags| with(true, false, scale, flags);
    let (px4, ardupilot) = (EstimatorScale::TestRatio, EstimatorScale::Variance);
    assert_eq!(says(px4, [GOOD; 3]), (false, false, false));
    assert_eq!(says(px4, [GOOD, GOOD | 1 << 10, GOOD | 1 << 10]), (true, false, false));
    assert_eq!(says(ardupilot, [0x80A7; 3]), (false, false, false), "no GPS, and the glitch bit set");
    let glitches = [GOOD | 1 << 15; 3];
    assert_eq!(
        with(false, false, ardupilot, glitches),
        (false, false, false),
        "it flies by beacons, and no receiver has a fix"
    );
    assert_eq!(with(true, false, ardupilot, glitches), (true, false, false));
    assert_eq!(says(px4, [GOOD, GOOD | 1 << 11, GOOD | 1 << 11]), (false, true, false));
    assert_eq!(says(ardupilot, [GOOD, GOOD | 1 << 15, GOOD | 1 << 15]), (true, false, false));
    assert_eq!(says(ardupilot, [GOOD, 0xA7, 0xA7]), (false, false, true), "position lost");
    assert_eq!(says(ardupilot, [0xA7; 3]), (false, false, false), "it had none from the beginning");
    for landed in [0x1A5, 0x2A5, 0x3A5] {
        let said = says(ardupilot, [GOOD, landed, landed]);
        assert_eq!(said, (false, false, false), "{landed:#x}: position held fixed after a landing");
        let said = with(true, true, ardupilot, [GOOD, landed, landed]);
        assert_eq!(said, (false, false, true), "{landed:#x}: position lost in the air");
        let said = says(ardupilot, [landed, 0xA5, 0xA5]);
        assert_eq!(said, (false, false, false), "{landed:#x}: a predicted position is none yet");
    }
    assert_eq!(says(ardupilot, [GOOD, 0x3A4, 0x3A4]), (false, false, true), "attitude lost");
}
