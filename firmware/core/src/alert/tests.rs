use super::*;
use crate::bytes::fnv1a;

const T0: Instant = Instant::from_millis(1_000);

fn after(seconds: u64) -> Instant {
    T0 + Span::from_secs(seconds)
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
        (2, "Auto mission changed, restarted command", None),
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

/// Alerts of a vehicle that is armed.
fn armed() -> Alerts {
    let mut alerts = Alerts::new();
    alerts.take_armed(T0, true);
    alerts
}

#[test]
fn what_was_said_holds_for_a_while_and_only_while_armed() {
    let mut alerts = Alerts::new();
    assert_eq!(alerts.level(T0, Cause::Gnss, false), None);
    alerts.tell(T0, Alert::warning(Cause::Gnss));
    assert_eq!(alerts.level(T0, Cause::Gnss, false), None, "said before arming");
    alerts.take_armed(T0, true);
    alerts.tell(T0, Alert::critical(Cause::Gnss));
    alerts.tell(after(5), Alert::warning(Cause::Gnss));
    for (seconds, level) in [(0, 2.0), (14, 2.0), (15, 2.0), (16, ENDED)] {
        assert_eq!(alerts.level(after(seconds), Cause::Gnss, false), Some(level), "{seconds} s");
    }
    assert_eq!(alerts.level(after(5), Cause::Gyro, false), None, "of the gyro nothing was said");
    alerts.tell(after(20), Alert::warning(Cause::Gnss));
    alerts.tell(after(21), Alert::over(Cause::Gnss));
    assert_eq!(alerts.level(after(22), Cause::Gnss, false), Some(0.0), "it is over by its own word");
    alerts.tell(after(23), Alert::warning(Cause::Gnss));
    alerts.take_armed(after(24), false);
    assert_eq!(alerts.level(after(24), Cause::Gnss, false), Some(1.0), "it was said while armed");
    alerts.take_armed(after(25), true);
    assert_eq!(alerts.level(after(25), Cause::Gnss, false), None, "another arming");
}

#[test]
fn a_crash_is_heard_though_the_autopilot_disarms_with_the_word() {
    let mut alerts = armed();
    alerts.take_armed(after(1), false);
    alerts.tell(after(1), Alert::warning(Cause::Gnss));
    alerts.tell(after(2), Alert::critical(Cause::Crash));
    assert_eq!(
        (alerts.level(after(2), Cause::Crash, false), alerts.level(after(2), Cause::Gnss, false)),
        (Some(2.0), None)
    );
    let mut alerts = armed();
    alerts.take_armed(after(1), false);
    alerts.tell(after(2), Alert::critical(Cause::Accelerometer));
    assert_eq!(alerts.level(after(2), Cause::Accelerometer, false), Some(2.0), "what broke");
    let mut alerts = armed();
    alerts.take_armed(after(1), false);
    alerts.tell(after(5), Alert::critical(Cause::Crash));
    assert_eq!(alerts.level(after(5), Cause::Crash, false), None, "long after");
}

/// All sensors are there, and these are not healthy.
const fn unhealthy(bits: u32) -> Sensors {
    Sensors::of(u32::MAX, u32::MAX, !bits)
}

#[test]
fn flags_count_when_two_messages_have_them_and_while_they_come() {
    const COMPASS: u32 = 1 << 2;
    let mut alerts = armed();
    for (seconds, bits, level) in
        [(0, 0, 0.0), (1, COMPASS, 0.0), (2, COMPASS, 1.0), (3, 0, 0.0), (4, COMPASS, 0.0), (5, COMPASS, 1.0)]
    {
        alerts.take_sensors(after(seconds), &unhealthy(bits));
        assert_eq!(alerts.level(after(seconds), Cause::Compass, false), Some(level), "{seconds} s");
    }
    assert_eq!(alerts.level(after(10), Cause::Compass, false), Some(1.0));
    assert_eq!(alerts.level(after(11), Cause::Compass, false), Some(ENDED), "no message for more than 5 s");
    alerts.take_sensors(after(12), &unhealthy(0));
    assert_eq!(alerts.level(after(12), Cause::Compass, false), Some(0.0));
    assert_eq!(alerts.level(after(12), Cause::Crash, false), Some(ENDED), "no flag tells of a crash");
    alerts.take_armed(after(13), false);
    assert_eq!(alerts.level(after(13), Cause::Compass, false), Some(ENDED), "disarmed");
}

#[test]
fn a_remote_control_is_lost_only_where_there_was_one() {
    const RECEIVER: u32 = 1 << 16;
    let mut alerts = armed();
    let mut says = |second, bits| {
        alerts.take_sensors(after(second), &unhealthy(bits));
        alerts.level(after(second), Cause::RemoteControl, false)
    };
    assert_eq!([says(0, RECEIVER), says(1, RECEIVER)], [Some(0.0), Some(ENDED)], "never switched on");
    assert_eq!([says(2, 0), says(3, RECEIVER), says(4, RECEIVER)], [Some(0.0), Some(0.0), Some(1.0)]);
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
    let with = |has_fix, scale, flags: [u16; 3]| {
        let mut alerts = armed();
        for (second, flags) in (0..).zip(flags) {
            let told = Estimator { scale, flags, ..Estimator::default() };
            alerts.take_estimator(after(second), &told, has_fix);
        }
        let level = |cause| alerts.level(after(2), cause, false) == Some(1.0);
        (level(Cause::Gnss), level(Cause::Accelerometer), level(Cause::Estimator))
    };
    let says = |scale, flags| with(true, scale, flags);
    let (px4, ardupilot) = (EstimatorScale::TestRatio, EstimatorScale::Variance);
    assert_eq!(says(px4, [GOOD; 3]), (false, false, false));
    assert_eq!(says(px4, [GOOD, GOOD | 1 << 10, GOOD | 1 << 10]), (true, false, false));
    assert_eq!(says(ardupilot, [0x80A7; 3]), (false, false, false), "no GPS, and the glitch bit set");
    let glitches = [GOOD | 1 << 15; 3];
    assert_eq!(
        with(false, ardupilot, glitches),
        (false, false, false),
        "it flies by beacons, and no receiver has a fix"
    );
    assert_eq!(with(true, ardupilot, glitches), (true, false, false));
    assert_eq!(says(px4, [GOOD, GOOD | 1 << 11, GOOD | 1 << 11]), (false, true, false));
    assert_eq!(says(ardupilot, [GOOD, GOOD | 1 << 15, GOOD | 1 << 15]), (true, false, false));
    assert_eq!(says(ardupilot, [GOOD, 0xA7, 0xA7]), (false, false, true), "position lost");
    assert_eq!(says(ardupilot, [0xA7; 3]), (false, false, false), "it had none from the beginning");
}
