//! Sinking without a command.

use super::*;

fn sinks(ms: u64, quad: &mut Quad, _: &mut Motion) {
    if ms < 2_000 {
        (quad.climb, quad.height) = (-8.0, 200.0 - ms as f32 / 125.0);
    }
}

const SINKS: Come<'_> = (&["sinking"], FLIES);
const IS_NONE: Come<'_> = (&[], FLIES);

/// The same vehicles in a mode in which the pilot has the throttle.
fn by_pilot(vehicles: impl Iterator<Item = Quad>, px4: u32, ardupilot: u32) -> impl Iterator<Item = Quad> {
    let mode = move |quad: &Quad| if quad.autopilot == Autopilot::Px4 { px4 } else { ardupilot };
    vehicles.map(move |quad| Quad { mode: mode(&quad), ..quad })
}

#[test]
fn sinking_is_a_mishap_where_the_autopilot_flies_and_not_where_the_pilot_asks_for_it() {
    judge(rotors(), "the autopilot flies", SINKS, sinks);
    judge(by_pilot(rotors(), 0x0007_0000, 0), "the pilot", IS_NONE, sinks);
    judge(wings(), "on wings", IS_NONE, sinks);
    // Modes made for falling: a helicopter's autorotation, and THROW.
    let helicopter = Quad { mode: 26, ..hovering((Autopilot::ArduPilot, VehicleKind::Rotorcraft, 4)) };
    let thrown = Quad { mode: 18, ..hovering(ROTORS[0]) };
    judge([helicopter, thrown], "autorotation, THROW", IS_NONE, |ms, quad, _| {
        if ms < 5_000 {
            (quad.climb, quad.throttle) = (-10.0, 0.0);
        }
    });
}

#[test]
fn an_estimator_that_does_not_believe_itself_makes_no_mishap_unless_the_air_agrees() {
    // It shakes, climbs by the air, and lands hard and safe while the estimator falls.
    judge(rotors(), "against the air", (&[], ANY), |ms, quad, motion| {
        let seconds = ms as f32 / 1_000.0;
        motion.pressure_hpa = Some(1_000.0 - if ms < 6_000 { 0.4 * seconds } else { 2.4 });
        quad.estimator.velocity = Some(1.5);
        quad.climb = if (1_500..7_900).contains(&ms) { -10.0 } else { 0.0 };
        if ms >= 8_000 {
            motion.load_g = if ms < 8_100 { 4.0 } else { 1.0 };
            (quad.throttle, motion.rates) = (0.0, [0.0; 3]);
        }
    });
    judge(rotors(), "with the air", SINKS, |ms, quad, motion| {
        motion.pressure_hpa = Some(1_000.0 + if ms < 2_000 { ms as f32 / 1_000.0 } else { 2.0 });
        (quad.estimator.velocity, quad.climb) = (Some(1.5), if ms < 2_000 { -8.0 } else { 0.0 });
    });
}

fn sinks_with_thrust(ms: u64, quad: &mut Quad, motion: &mut Motion) {
    motion.ground_mps = 8.0;
    if ms < 8_000 {
        (quad.climb, quad.throttle, quad.height) = (-3.4, 1.0, 60.0 - 3.4 * ms as f32 / 1_000.0);
    }
}

#[test]
fn a_plane_that_sinks_with_all_its_thrust_is_told_and_a_glide_is_not() {
    judge(wings(), "it pulls out", SINKS, |ms, quad, motion| {
        sinks_with_thrust(ms, quad, motion);
        motion.load_g = if (5_000..5_500).contains(&ms) { 4.0 } else { 1.0 };
    });
    let (began_ms, _) = fly(&on_wings(WINGS[0]), sinks_with_thrust).changes[0];
    assert!((AT_MS + 3_000..AT_MS + 4_000).contains(&began_ms), "{began_ms}");
    judge(wings(), "it glides", IS_NONE, |ms, quad, motion| {
        sinks_with_thrust(ms, quad, motion);
        quad.throttle = 0.0;
    });
    judge(by_pilot(wings(), 0x0001_0000, 5), "the pilot dives", IS_NONE, sinks_with_thrust);
    let high = wings().map(|quad| Quad { height: 90.0, ..quad });
    judge(high, "it follows its glide path against the wind", IS_NONE, |ms, quad, motion| {
        (motion.ground_mps, quad.throttle) = (8.0, 1.0);
        (quad.climb, quad.height) = (-0.7, 90.0 - 0.7 * ms as f32 / 1_000.0);
    });
}

#[test]
fn a_multicopter_that_loses_height_with_all_its_thrust_sinks_though_it_sinks_slowly() {
    for (what, throttle, roll_wanted, come) in [
        ("all its thrust", 0.97, None, SINKS),
        ("it is told to", 0.3, None, IS_NONE),
        ("it is told to bank steeply", 0.97, Some(0.8), IS_NONE),
        ("it is told to bank", 0.97, Some(0.3), SINKS),
    ] {
        let high = rotors().map(|quad| Quad { height: 60.0, ..quad });
        // The bank of a vehicle that is not carried by rotors alone is not a cause.
        let judged = high.filter(|quad| roll_wanted.is_none() || quad.kind == VehicleKind::Rotorcraft);
        let judged = judged.filter(|quad| roll_wanted.is_none() || quad.type_number != 4);
        judge(judged, what, come, |ms, quad, motion| {
            if ms < 6_000 {
                (quad.climb, quad.height) = (-4.5, 60.0 - 4.5 * ms as f32 / 1_000.0);
                quad.throttle = throttle;
            }
            motion.roll_wanted = roll_wanted;
        });
    }
}

#[test]
fn an_estimator_alone_makes_no_mishap_against_the_air_or_the_display() {
    type Witness = fn(u64, &Quad, &mut Motion);
    let cases: [(&str, Come<'_>, Witness); 5] = [
        ("its barometer says that it stands", IS_NONE, |ms, _, motion| {
            motion.pressure_hpa = Some(980.0 + (ms / 100 % 5) as f32 * 0.01);
        }),
        ("a barometer that never changes says nothing", SINKS, |_, _, motion| {
            motion.pressure_hpa = Some(980.0);
        }),
        ("its display says that it stands", IS_NONE, |_, _, motion| motion.displayed_mps = Some(0.02)),
        ("its display sinks too", SINKS, |_, quad, motion| motion.displayed_mps = Some(0.5 * quad.climb)),
        ("nothing but zeros is no display", SINKS, |_, _, motion| motion.displayed_mps = Some(0.0)),
    ];
    for (what, come, witness) in cases {
        judge(rotors(), what, come, |ms, quad, motion| {
            quad.climb = if (3_000..8_000).contains(&ms) { -12.0 } else { 0.0 };
            witness(ms, quad, motion);
        });
    }
}

#[test]
fn a_sink_that_the_autopilot_wants_and_follows_is_none() {
    judge(rotors(), "a script asks for it", IS_NONE, |ms, quad, motion| {
        sinks(ms, quad, motion);
        quad.climb_wanted = Some(if ms < 2_000 { -8.5 } else { 0.0 });
    });
    judge(rotors(), "it falls, and was to sink", (&["sinking"], ANY), |ms, quad, motion| {
        fall(ms, quad, motion);
        (motion.load_g, quad.climb_wanted) = (0.5, Some(-6.5));
    });
    judge(rotors(), "it is to sink slowly", SINKS, |ms, quad, _| {
        quad.climb = if ms < 2_000 { -8.0 } else { 0.0 };
        quad.climb_wanted = Some(-2.0);
    });
}

#[test]
fn only_what_hangs_upright_on_rotors_is_told_to_climb() {
    let in_vain: Script = |ms, quad, _| {
        quad.throttle = 1.0;
        if ms < 6_000 {
            (quad.climb, quad.height) = (if ms < 3_000 { -2.0 } else { -8.0 }, 200.0 - ms as f32 / 250.0);
        }
    };
    let quad = hovering(ROTORS[0]);
    let cases: [(&str, &Quad, Orders, Script); 7] = [
        ("it sinks", &quad, Orders::Own, sinks),
        ("it was on its side a second before", &quad, Orders::Disarm, |ms, quad, _| {
            if ms < 3_000 {
                (quad.climb, quad.height) = (if ms < 600 { 0.0 } else { -8.0 }, 200.0 - ms as f32 / 125.0);
            }
            quad.roll = if ms < 500 { 1.9 } else { 0.1 };
        }),
        ("it leans by 50 degrees", &quad, Orders::Disarm, |ms, quad, motion| {
            sinks(ms, quad, motion);
            quad.roll = 0.87;
        }),
        ("it turns by 150 degrees a second", &quad, Orders::Disarm, |ms, quad, motion| {
            sinks(ms, quad, motion);
            motion.rates = [2.6, 0.0, 0.0];
        }),
        ("it has lost a motor", &quad, Orders::Disarm, |ms, quad, motion| {
            if let Some(esc) = &mut quad.escs[1] {
                esc.current = Some(Amperes(0.0));
            }
            sinks(ms.wrapping_sub(2_000), quad, motion);
        }),
        ("all the throttle does not do it", &quad, Orders::Disarm, in_vain),
        // A plane with all its throttle, and a dead motor: it glides.
        ("it hangs on wings", &on_wings(WINGS[0]), Orders::Nothing, in_vain),
    ];
    for (what, vehicle, orders, script) in cases {
        let outcome = fly(vehicle, script);
        let sinking = outcome.findings.iter().find(|one| one.check == "sinking");
        assert_eq!(sinking.map(|one| one.orders), Some(orders), "{what}");
    }
}
