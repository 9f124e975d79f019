use hums_core::fnv1a;

use super::*;

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
