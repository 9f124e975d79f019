//! Sinking without being told to.

use super::*;

#[test]
fn sinking_is_a_mishap_where_the_autopilot_flies_and_not_where_the_pilot_asks_for_it() {
    let sinks: Script = |ms, quad, _| {
        if ms < 2_000 {
            (quad.climb, quad.height) = (-8.0, 200.0 - ms as f32 / 125.0);
        }
    };
    for of in ROTORS {
        assert_eq!(fly(&hovering(of), sinks).told(), ["sinking"], "{of:?}");
        let pilots_mode = if of.0 == Autopilot::Px4 { 0x0007_0000 } else { 0 };
        let pilots = Quad { mode: pilots_mode, ..hovering(of) };
        assert!(fly(&pilots, sinks).told().is_empty(), "{of:?}");
    }
    for of in WINGS {
        assert!(fly(&on_wings(of), sinks).told().is_empty(), "{of:?}");
    }
}

#[test]
fn an_estimator_that_does_not_believe_itself_makes_no_mishap_unless_the_air_agrees() {
    // It shakes, climbs by the air, and lands hard and safe while the estimator says that it falls.
    let shaken: Script = |ms, quad, motion| {
        let seconds = ms as f32 / 1_000.0;
        motion.pressure_hpa = Some(1_000.0 - if ms < 6_000 { 0.4 * seconds } else { 2.4 });
        quad.estimator.velocity = Some(1.5);
        quad.climb = if (1_500..7_900).contains(&ms) { -10.0 } else { 0.0 };
        if ms >= 8_000 {
            motion.load_g = if ms < 8_100 { 4.0 } else { 1.0 };
            (quad.throttle, motion.rates) = (0.0, [0.0; 3]);
        }
    };
    for of in ROTORS {
        assert!(fly(&hovering(of), shaken).told().is_empty(), "{of:?}");
        let sinks = fly(&hovering(of), |ms, quad, motion| {
            motion.pressure_hpa = Some(1_000.0 + if ms < 2_000 { ms as f32 / 1_000.0 } else { 2.0 });
            (quad.estimator.velocity, quad.climb) = (Some(1.5), if ms < 2_000 { -8.0 } else { 0.0 });
        });
        assert_eq!(sinks.told(), ["sinking"], "{of:?}");
    }
}

#[test]
fn what_is_made_for_falling_is_not_told() {
    let autorotation: Script = |ms, quad, _| {
        if ms < 5_000 {
            (quad.climb, quad.throttle) = (-10.0, 0.0);
        }
    };
    let helicopter = Quad { mode: 26, ..hovering((Autopilot::ArduPilot, VehicleKind::Rotorcraft, 4)) };
    let thrown = Quad { mode: 18, ..hovering(ROTORS[0]) };
    for quad in [helicopter, thrown] {
        assert!(fly(&quad, autorotation).told().is_empty(), "{}", quad.mode);
    }
}

#[test]
fn a_plane_that_sinks_with_all_its_thrust_is_told_and_a_glide_is_not() {
    let pulls_out: Script = |ms, quad, motion| {
        sinks_with_thrust(ms, quad, motion);
        motion.load_g = if (5_000..5_500).contains(&ms) { 4.0 } else { 1.0 };
    };
    let glides: Script = |ms, quad, motion| {
        sinks_with_thrust(ms, quad, motion);
        quad.throttle = 0.0;
    };
    for of in WINGS {
        let outcome = fly(&on_wings(of), pulls_out);
        assert_eq!(outcome.told(), ["sinking"], "{of:?}");
        let (began_ms, _) = outcome.changes[0];
        assert!((AT_MS + 3_000..AT_MS + 4_000).contains(&began_ms), "{of:?}: {began_ms}");
        assert_eq!(outcome.flights(), (1, 0, 0), "{of:?}: it flies on");
        assert!(fly(&on_wings(of), glides).told().is_empty(), "{of:?}");
        let pilots_mode = if of.0 == Autopilot::Px4 { 0x0001_0000 } else { 5 };
        let dives = Quad { mode: pilots_mode, ..on_wings(of) };
        assert!(fly(&dives, sinks_with_thrust).told().is_empty(), "{of:?}: the pilot dives");
    }
}

fn sinks_with_thrust(ms: u64, quad: &mut Quad, motion: &mut Motion) {
    motion.ground_mps = 8.0;
    if ms < 8_000 {
        (quad.climb, quad.throttle, quad.height) = (-3.4, 1.0, 60.0 - 3.4 * ms as f32 / 1_000.0);
    }
}

#[test]
fn a_plane_that_follows_its_glide_path_against_the_wind_with_all_its_thrust_is_none() {
    let descends: Script = |ms, quad, motion| {
        (motion.ground_mps, quad.throttle) = (8.0, 1.0);
        (quad.climb, quad.height) = (-0.7, 90.0 - 0.7 * ms as f32 / 1_000.0);
    };
    for of in WINGS {
        assert!(fly(&Quad { height: 90.0, ..on_wings(of) }, descends).told().is_empty(), "{of:?}");
    }
}

fn sinks_slowly(ms: u64, quad: &mut Quad, _: &mut Motion) {
    if ms < 6_000 {
        (quad.climb, quad.height, quad.throttle) = (-4.5, 60.0 - 4.5 * ms as f32 / 1_000.0, 0.97);
    }
}

#[test]
fn a_multicopter_that_loses_height_with_all_its_thrust_sinks_though_it_sinks_slowly() {
    for of in ROTORS {
        assert_eq!(fly(&Quad { height: 60.0, ..hovering(of) }, sinks_slowly).told(), ["sinking"], "{of:?}");
        let told_to = fly(&Quad { height: 60.0, ..hovering(of) }, |ms, quad, motion| {
            sinks_slowly(ms, quad, motion);
            quad.throttle = 0.3;
        });
        assert!(told_to.told().is_empty(), "{of:?}");
    }
}

#[test]
fn a_multicopter_that_is_told_to_bank_steeply_may_lose_height_with_all_its_thrust() {
    let of = ROTORS[0];
    let banks = |wanted: Script| fly(&Quad { height: 60.0, ..hovering(of) }, wanted).told();
    let told_to = banks(|ms, quad, motion| {
        sinks_slowly(ms, quad, motion);
        motion.roll_wanted = Some(0.8);
    });
    assert!(told_to.is_empty(), "{told_to:?}");
    let falls = banks(|ms, quad, motion| {
        sinks_slowly(ms, quad, motion);
        motion.roll_wanted = Some(0.3);
    });
    assert_eq!(falls, ["sinking"]);
}

/// It stands in the air, its barometer says so, and the estimator falls.
fn falls_by_estimate(ms: u64, quad: &mut Quad, motion: &mut Motion) {
    motion.pressure_hpa = Some(980.0 + (ms / 100 % 5) as f32 * 0.01);
    quad.climb = if (3_000..8_000).contains(&ms) { -12.0 } else { 0.0 };
}

#[test]
fn an_estimator_that_believes_itself_makes_no_mishap_against_the_air() {
    for of in ROTORS {
        assert!(fly(&hovering(of), falls_by_estimate).told().is_empty(), "{of:?}");
        let stuck = fly(&hovering(of), |ms, quad, motion| {
            falls_by_estimate(ms, quad, motion);
            motion.pressure_hpa = Some(980.0);
        });
        assert_eq!(stuck.told(), ["sinking"], "{of:?}: a barometer that never changes says nothing");
    }
}

#[test]
fn a_receiver_alone_makes_no_mishap_against_the_display() {
    fn by_receiver(ms: u64, quad: &mut Quad, motion: &mut Motion) {
        quad.climb = if (3_000..8_000).contains(&ms) { -12.0 } else { 0.0 };
        motion.displayed_mps = Some(0.02);
    }
    for of in ROTORS {
        assert!(fly(&hovering(of), by_receiver).told().is_empty(), "{of:?}");
        let both = fly(&hovering(of), |ms, quad, motion| {
            by_receiver(ms, quad, motion);
            motion.displayed_mps = Some(0.5 * quad.climb);
        });
        assert_eq!(both.told(), ["sinking"], "{of:?}");
        let no_display = fly(&hovering(of), |ms, quad, motion| {
            by_receiver(ms, quad, motion);
            motion.displayed_mps = Some(0.0);
        });
        assert_eq!(no_display.told(), ["sinking"], "{of:?}: nothing but zeros is no display");
    }
}

#[test]
fn a_sink_that_the_autopilot_wants_and_follows_is_none() {
    let sinks: Script = |ms, quad, _| {
        if ms < 2_000 {
            (quad.climb, quad.height) = (-8.0, 200.0 - ms as f32 / 125.0);
        }
        quad.climb_wanted = Some(if ms < 2_000 { -8.5 } else { 0.0 });
    };
    for of in ROTORS {
        assert!(fly(&hovering(of), sinks).told().is_empty(), "{of:?}: a script asks for it");
        let faster = fly(&hovering(of), |ms, quad, motion| {
            fall(ms, quad, motion);
            (motion.load_g, quad.climb_wanted) = (0.5, Some(-6.5));
        });
        assert_eq!(faster.told(), ["sinking"], "{of:?}: it falls, and was to sink");
        let wants_little = fly(&hovering(of), |ms, quad, _| {
            quad.climb = if ms < 2_000 { -8.0 } else { 0.0 };
            quad.climb_wanted = Some(-2.0);
        });
        assert_eq!(wants_little.told(), ["sinking"], "{of:?}");
    }
}

#[test]
fn only_what_hangs_upright_on_rotors_is_told_to_climb() {
    let orders = |vehicle: &Quad, script| {
        let outcome = fly(vehicle, script);
        let sinking = outcome.findings.iter().find(|one| one.check == "sinking").copied();
        sinking.map(|one| one.orders)
    };
    let sinks: Script = |ms, quad, _| {
        if ms < 2_000 {
            (quad.climb, quad.height) = (-8.0, 200.0 - ms as f32 / 125.0);
        }
    };
    assert_eq!(orders(&hovering(ROTORS[0]), sinks), Some(Orders::Own));
    let rolled: Script = |ms, quad, _| {
        if ms < 3_000 {
            (quad.climb, quad.height) = (if ms < 600 { 0.0 } else { -8.0 }, 200.0 - ms as f32 / 125.0);
        }
        quad.roll = if ms < 500 { 1.9 } else { 0.1 };
    };
    assert_eq!(
        orders(&hovering(ROTORS[0]), rolled),
        Some(Orders::Disarm),
        "it was on its side a second before"
    );
    let leans: Script = |ms, quad, _| {
        if ms < 2_000 {
            (quad.climb, quad.height) = (-8.0, 200.0 - ms as f32 / 125.0);
        }
        quad.roll = 0.87;
    };
    assert_eq!(orders(&hovering(ROTORS[0]), leans), Some(Orders::Disarm), "50 degrees");
    let turns: Script = |ms, quad, motion| {
        if ms < 2_000 {
            (quad.climb, quad.height) = (-8.0, 200.0 - ms as f32 / 125.0);
        }
        motion.rates = [2.6, 0.0, 0.0];
    };
    assert_eq!(orders(&hovering(ROTORS[0]), turns), Some(Orders::Disarm), "150 degrees a second");
    let motor: Script = |ms, quad, _| {
        if let Some(esc) = &mut quad.escs[1] {
            esc.current = Some(Amperes(0.0));
        }
        if (2_000..4_000).contains(&ms) {
            (quad.climb, quad.height) = (-8.0, 200.0 - ms as f32 / 125.0);
        }
    };
    assert_eq!(orders(&hovering(ROTORS[0]), motor), Some(Orders::Disarm), "it has lost a motor");
    let in_vain: Script = |ms, quad, _| {
        quad.throttle = 1.0;
        if ms < 6_000 {
            (quad.climb, quad.height) = (if ms < 3_000 { -2.0 } else { -8.0 }, 200.0 - ms as f32 / 250.0);
        }
    };
    assert_eq!(
        orders(&hovering(ROTORS[0]), in_vain),
        Some(Orders::Disarm),
        "all the throttle does not do it"
    );
    // A plane with all its throttle, and a dead motor: it glides.
    assert_eq!(orders(&on_wings(WINGS[0]), in_vain), Some(Orders::Nothing));
}
