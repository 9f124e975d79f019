use super::*;

const T0: BootMs = BootMs::from_millis(1_000);

fn after(seconds: u64) -> BootMs {
    T0 + Millis::from_secs(seconds)
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
        "0 arm; 20 warning Gnss; 21 over Gnss; 22 Gnss = 0; 23 warning Gnss; 24 disarm; 24 Gnss = 1; 25 arm; 25 Gnss = -",
        "0 arm; 1 disarm; 1 warning Gnss; 2 critical Crash; 2 Crash = 2; 2 Gnss = -",
        "0 arm; 1 disarm; 2 critical Accelerometer; 2 Accelerometer = 2",
        "0 arm; 1 disarm; 5 critical Crash; 5 Crash = -",
        "0 arm; 0 flags; 0 Compass = 0; 1 flags 2; 1 Compass = 0; 2 flags 2; 2 Compass = 1; 3 flags; 3 Compass = 0; \
         4 flags 2; 4 Compass = 0; 5 flags 2; 5 Compass = 1; 10 Compass = 1; 11 Compass = ended; 12 flags; \
         12 Compass = 0; 12 Crash = ended; 13 disarm; 13 Compass = ended",
        "0 arm; 0 flags 16; 0 RemoteControl = ended; 1 flags 16; 1 RemoteControl = ended; 2 flags; 2 RemoteControl = 0; \
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
