//! Speeds and currents of motors against each other: frames, turning, standing and pushing motors.

use crate::common::{AUTOPILOT, Quad, Run, observe};
use hums_core::health::{Finding, Level};
use hums_core::observation::{
    Attitude, Autopilot, Esc, EscGroup, LandedState, MOTORS_MAX, Observation, Outputs, VehicleKind, VtolState,
};
use hums_core::params::Params;
use hums_core::units::{Amperes, Celsius, Radians, RadiansPerSecond, Rpm};

/// A minute of flight; the findings about motors. `script` gives the vehicle, its ESCs and its yaw rate.
fn told(script: impl Fn(u64) -> (Quad, Vec<Esc>, f32)) -> Vec<(&'static str, u8)> {
    told_given(script, |_| None)
}

fn told_given(
    script: impl Fn(u64) -> (Quad, Vec<Esc>, f32),
    given: impl Fn(u64) -> Option<[u16; MOTORS_MAX]>,
) -> Vec<(&'static str, u8)> {
    let mut run = Run::new(&Params::defaults());
    run.says(0..60_000, |now_ms| {
        let (quad, escs, yaw_rate) = script(now_ms);
        let group = |first: usize| EscGroup {
            first: first as u8,
            escs: [0, 1, 2, 3].map(|place| escs.get(first + place).copied()),
        };
        let own = |said: &Observation| !matches!(said, Observation::Escs(_) | Observation::Attitude(_));
        let rates = [0.0, 0.0, yaw_rate].map(RadiansPerSecond);
        let attitude = Attitude { roll: Radians(0.02), rates: Some(rates), ..Attitude::default() };
        let more =
            [Observation::Attitude(attitude), Observation::Escs(group(0)), Observation::Escs(group(4))];
        let given = given(now_ms).map(|pulses| Observation::Outputs(Outputs { port: 0, pulses }));
        quad.says(now_ms).into_iter().filter(own).chain(more).chain(given).collect()
    });
    let of_motors = run.findings.iter().filter(|finding| finding.check.starts_with("motor"));
    let mut told: Vec<_> = of_motors.map(|finding| (finding.check, finding.instance)).collect();
    told.dedup();
    told
}

/// With these speeds, and turning with `yaw_rate`, from 20 s on.
fn flies(vehicle: &Quad, speeds: &[f32], yaw_rate: f32) -> Vec<(&'static str, u8)> {
    let esc = vehicle.escs[0].unwrap_or_default();
    told(|now_ms| {
        let begun = now_ms >= 20_000;
        let rpm = |speed: &f32| Rpm(if begun { *speed } else { 5_000.0 });
        let escs = speeds.iter().map(|speed| Esc { rpm: Some(rpm(speed)), ..esc }).collect();
        (vehicle.clone(), escs, if begun { yaw_rate } else { 0.0 })
    })
}

fn escs_of(currents: &[f32]) -> Vec<Esc> {
    currents.iter().map(|current| Esc { current: Some(Amperes(*current)), ..Esc::default() }).collect()
}

#[test]
fn an_esc_whose_messages_come_once_a_second_is_silent_after_five_of_them() {
    let told = |lost: u64| {
        let mut run = Run::new(&Params::defaults());
        run.flies(0..60_000, |now_ms, quad, more| {
            let is_heard = now_ms % 1_000 == 0 && !(30_000..30_000 + 1_000 * lost).contains(&now_ms);
            let second = Observation::Escs(EscGroup { first: 4, escs: quad.escs });
            more.extend(is_heard.then_some(second));
        });
        let critical = run.of_check("esc_silent").filter(|finding| finding.level == Level::Critical);
        critical.map(|one| ((one.at.as_millis() - 29_000) / 1_000, one.instance)).collect::<Vec<_>>()
    };
    assert_eq!(told(4), []);
    assert_eq!(told(6), [(5, 4), (5, 5), (5, 6), (5, 7)]);
}

#[test]
fn motors_that_carry_different_loads_in_groups_are_none_of_them_off() {
    // A Y6's upper and lower motors, and a yawing quad; both turn slower than the limit of a turn.
    let y6 = Quad { type_number: 13, ..Quad::healthy() };
    assert_eq!(flies(&y6, &[5_100.0, 3_550.0, 5_050.0, 3_500.0, 3_520.0, 5_080.0], 0.4), []);
    assert_eq!(flies(&Quad::healthy(), &[4_200.0, 4_150.0, 5_900.0, 5_950.0], 0.5), []);
    // The front motors of a quad whose load hangs before its middle.
    assert_eq!(flies(&Quad::healthy(), &[5_800.0, 4_300.0, 5_750.0, 4_250.0], 0.0), []);
}

#[test]
fn a_motor_that_is_alone_with_its_speed_is_off_in_groups_too() {
    let y6 = Quad { type_number: 13, ..Quad::healthy() };
    assert_eq!(
        flies(&y6, &[5_100.0, 3_550.0, 5_050.0, 3_500.0, 3_520.0, 7_900.0], 0.0),
        [("motor_imbalance", 5)]
    );
    assert_eq!(flies(&Quad::healthy(), &[5_000.0, 6_700.0, 5_050.0, 4_950.0], 0.0), [("motor_imbalance", 1)]);
}

#[test]
fn what_turns_fast_drives_each_motor_as_it_needs_to_and_a_motor_that_stopped_is_found_all_the_same() {
    let torn = [3_200.0, 4_300.0, 5_300.0, 6_500.0];
    assert_eq!(flies(&Quad::healthy(), &torn, 1.8), []);
    assert_eq!(flies(&Quad::healthy(), &torn, 0.1), [("motor_imbalance", 3)]);
    let hexa = Quad { type_number: 13, ..Quad::healthy() };
    let dead = [5_900.0, 6_000.0, 300.0, 6_200.0, 6_100.0, 900.0];
    assert_eq!(flies(&hexa, &dead, 1.8), [("motor_imbalance", 2)]);
}

#[test]
fn motors_that_idle_on_the_ground_are_not_compared() {
    // The autopilot goes on to call it in the air.
    let stands = Quad { throttle: 0.02, height: 12.0, landed: Some(LandedState::InAir), ..Quad::healthy() };
    assert_eq!(flies(&stands, &[2_200.0, 2_050.0, 2_900.0, 800.0], 0.0), []);
}

#[test]
fn a_motor_whose_command_was_cut_is_not_lost_and_one_that_stands_or_has_no_propeller_is() {
    let loses = |rpm: f32| {
        told(|now_ms| {
            // Hard braking: half a second and more without current, every 20 s.
            let cut = now_ms >= 20_000 && now_ms % 20_000 < 1_500;
            let mut escs = escs_of(&[5.0, if cut { 0.0 } else { 5.0 }, 5.0, 5.0]);
            let speeds = [5_000.0, if cut { rpm } else { 5_000.0 }, 5_000.0, 5_000.0].map(Rpm);
            escs.iter_mut().zip(speeds).for_each(|(esc, speed)| esc.rpm = Some(speed));
            (Quad::healthy(), escs, 0.0)
        })
    };
    assert_eq!(loses(3_900.0), []);
    for rpm in [0.0, 1_500.0, 6_500.0] {
        assert!(loses(rpm).contains(&("motor_loss", 1)), "{rpm}");
    }
}

/// A quadplane in the air from 2 s on, on rotors or wings.
fn quadplane(now_ms: u64, vtol: VtolState) -> Quad {
    let landed = Some(if now_ms < 2_000 { LandedState::OnGround } else { LandedState::InAir });
    Quad { kind: VehicleKind::Vtol, type_number: 22, mode: 10, landed, vtol, ..Quad::healthy() }
}

#[test]
fn the_motor_that_pushes_a_vtol_is_not_lost_while_it_hovers() {
    let lifted = |pusher: f32| escs_of(&[5.0, 5.0, 5.0, 5.0, pusher]);
    let hovers = |now_ms| (quadplane(now_ms, VtolState::Hover), lifted(0.0), 0.0);
    assert_eq!(told(hovers), []);
    let helped = |now_ms| {
        let pusher = if (10_000..30_000).contains(&now_ms) { 6.0 } else { 0.0 };
        (quadplane(now_ms, VtolState::Hover), lifted(pusher), 0.0)
    };
    assert_eq!(told(helped), []);
    // Heard first on its wings, and back in hover.
    let returns = |now_ms| match now_ms {
        0..20_000 => {
            (quadplane(now_ms + 2_000, VtolState::Forward), escs_of(&[0.0, 0.0, 0.0, 0.0, 12.0]), 0.0)
        }
        20_000..25_000 => (quadplane(now_ms, VtolState::Transition), lifted(12.0), 0.0),
        _ => (quadplane(now_ms, VtolState::Hover), lifted(if now_ms < 26_000 { 3.0 } else { 0.0 }), 0.0),
    };
    assert_eq!(told(returns), []);
    let lost = |now_ms| {
        let escs = escs_of(&[5.0, 5.0, if now_ms < 40_000 { 5.0 } else { 0.1 }, 5.0, 0.0]);
        (quadplane(now_ms, VtolState::Hover), escs, 0.0)
    };
    assert_eq!(told(lost), [("motor_loss", 2)]);
}

#[test]
fn motors_that_the_autopilot_stops_to_turn_are_not_lost_and_a_vehicle_that_lost_them_spins() {
    let turns = |yaw_rate: f32, currents: [f32; 4]| {
        told(|now_ms| {
            let begun = now_ms >= 20_000;
            let escs = escs_of(if begun { &currents } else { &[5.0; 4] });
            (quadplane(now_ms, VtolState::Hover), escs, if begun { yaw_rate } else { 0.0 })
        })
    };
    assert_eq!(turns(0.3, [0.05, 0.2, 9.0, 8.0]), []);
    assert_eq!(turns(2.0, [0.05, 0.2, 9.0, 8.0]).len(), 2, "two of four are lost");
    assert_eq!(turns(0.3, [0.05, 4.0, 9.0, 8.0]), [("motor_loss", 0)], "one is lost");
}

#[test]
fn a_motor_that_is_idled_opposite_to_a_dead_one_is_not_a_second_dead_one() {
    let dead = |idled: u16| {
        let script = |now_ms: u64| {
            let quad = Quad { height: if now_ms < 4_000 { 0.0 } else { 20.0 }, ..Quad::healthy() };
            let currents = if now_ms < 20_000 { [5.0; 6] } else { [6.0, 0.05, 6.0, 6.0, 0.05, 6.0] };
            (quad, escs_of(&currents), 0.3)
        };
        told_given(script, |now_ms| {
            let mut pulses = [900; MOTORS_MAX];
            pulses[..6].copy_from_slice(&match now_ms {
                0..4_000 => [1_000; 6],
                4_000..20_000 => [1_500; 6],
                _ => [1_550, 2_000, 1_550, 1_550, idled, 1_550],
            });
            Some(pulses)
        })
    };
    let lost =
        |idled| dead(idled).into_iter().filter(|(check, _)| *check == "motor_loss").collect::<Vec<_>>();
    assert_eq!(lost(1_000), [("motor_loss", 1)], "the autopilot gives it nothing");
    assert_eq!(lost(1_500), [("motor_loss", 1), ("motor_loss", 4)], "it is given as much as the others");
}

/// A quad with these pulses from 20 s on for a time, and these speeds and a sink from then on.
fn quad_given(speeds: [f32; 4], given: [u16; 4], for_ms: u64) -> Vec<(&'static str, u8)> {
    quad_given_on(|pulse| pulse, speeds, given, for_ms)
}

fn quad_given_on(
    driver: fn(u16) -> u16,
    speeds: [f32; 4],
    given: [u16; 4],
    for_ms: u64,
) -> Vec<(&'static str, u8)> {
    let esc = Quad::healthy().escs[0].unwrap_or_default();
    let script = |now_ms: u64| {
        let begun = now_ms >= 20_000;
        let height = if now_ms < 4_000 { 0.0 } else { 200.0 };
        let climb = if begun { -4.0 } else { 0.0 };
        let speeds = if begun { speeds } else { [5_000.0; 4] };
        let escs = speeds.map(|speed| Esc { rpm: Some(Rpm(speed)), ..esc }).to_vec();
        (Quad { height, climb, autopilot: Autopilot::Px4, ..Quad::healthy() }, escs, 0.3)
    };
    told_given(script, |now_ms| {
        let mut pulses = [900; MOTORS_MAX];
        pulses[5] = 2_000;
        pulses[..4].copy_from_slice(&match now_ms {
            0..4_000 => [1_000; 4],
            at if (20_000..20_000 + for_ms).contains(&at) => given,
            _ => [1_500; 4],
        });
        Some(pulses.map(driver))
    })
}

/// `PX4`'s numbers for `DShot` and for ESCs on CAN, whose motors idle above zero.
const NUMBERS: [fn(u16) -> u16; 2] = [
    |pulse| ((f32::from(pulse) - 1_000.0) * 1.999).max(if pulse < 1_000 { 0.0 } else { 110.0 }) as u16,
    |pulse| ((f32::from(pulse) - 1_000.0) * 8.191).max(if pulse < 1_000 { 0.0 } else { 1.0 }) as u16,
];

#[test]
fn a_motor_that_stands_while_it_is_given_all_is_lost_whatever_current_is_told() {
    let lost = |speeds, given| {
        quad_given(speeds, given, 60_000).into_iter().find(|(check, _)| *check == "motor_loss")
    };
    assert_eq!(lost([5_600.0, 0.0, 5_400.0, 5_300.0], [1_700, 1_950, 1_700, 1_700]), Some(("motor_loss", 1)));
    let hovers = [1_500; 4];
    assert_eq!(lost([5_600.0, 0.0, 5_400.0, 5_300.0], hovers), None, "it carries: its speed is not told");
    assert_eq!(lost([0.0; 4], [1_700, 1_950, 1_700, 1_700]), None, "no ESC tells its speed");
    assert_eq!(lost([5_600.0, 5_900.0, 5_400.0, 5_300.0], [1_700, 1_950, 1_700, 1_700]), None, "it turns");
}

#[test]
fn a_motor_that_alone_is_given_all_is_weak_also_while_the_vehicle_sinks() {
    let weak_for = |given, for_ms| {
        let told = quad_given([5_000.0; 4], given, for_ms);
        told.into_iter().filter(|(check, _)| *check == "motor_output").collect::<Vec<_>>()
    };
    let weak = |given| weak_for(given, 60_000);
    assert_eq!(weak_for([2_000, 1_300, 1_350, 1_350], 100), [], "a moment");
    assert_eq!(weak([2_000, 1_300, 1_350, 1_350])[..1], [("motor_output", 0)]);
    assert_eq!(weak([2_000, 1_800, 1_350, 1_350]), [], "two share a turn");
    assert_eq!(weak([2_000, 2_000, 2_000, 2_000]), [], "all the thrust");
}

#[test]
fn what_a_driver_calls_its_outputs_changes_nothing() {
    for driver in NUMBERS {
        let told = |speeds, given| quad_given_on(driver, speeds, given, 60_000);
        let turns = [5_000.0; 4];
        assert_eq!(told(turns, [1_950, 1_300, 1_350, 1_350])[..1], [("motor_output", 0)], "alone at its end");
        assert_eq!(told(turns, [2_000, 1_800, 1_350, 1_350]), [], "two share a turn");
        assert_eq!(told(turns, [1_525; 4]), [], "it hovers with about 1000 of DShot");
        let stands = [5_600.0, 0.0, 5_400.0, 5_300.0];
        assert!(told(stands, [1_650, 1_950, 1_650, 1_650]).contains(&("motor_loss", 1)));
        let out = told(stands, [1_525, 900, 1_525, 1_525]);
        assert!(!out.contains(&("motor_loss", 1)) && !out.contains(&("motor_imbalance", 1)), "{out:?}");
    }
}

/// Findings about a hexarotor that is first received in the air, with these pulses and speeds. Pulses within the
/// range vary by `varies_us`.
fn heard_in_the_air(pulses: [u16; 6], varies_us: u16, speeds: [f32; 6]) -> Vec<(&'static str, u8)> {
    let hexa =
        Quad { type_number: 13, start_height: 20.0, landed: Some(LandedState::InAir), ..Quad::healthy() };
    let esc = hexa.escs[0].unwrap_or_default();
    let escs: Vec<Esc> = speeds.iter().map(|speed| Esc { rpm: Some(Rpm(*speed)), ..esc }).collect();
    let given = |now_ms: u64| {
        let mut given = [0; MOTORS_MAX];
        given[..6].copy_from_slice(&pulses);
        let more = if (now_ms / 1_000).is_multiple_of(2) { 0 } else { varies_us };
        given.iter_mut().filter(|pulse| (1_000..1_900).contains(*pulse)).for_each(|pulse| *pulse += more);
        Some(given)
    };
    told_given(|_| (hexa.clone(), escs.clone(), 0.0), given)
}

#[test]
fn a_motor_is_found_by_outputs_that_are_heard_in_the_air_first() {
    let told = |pulses: [u16; 6]| {
        let script = |now_ms: u64| {
            let height = if now_ms < 4_000 { 0.0 } else { 20.0 };
            (Quad { type_number: 13, height, ..Quad::healthy() }, Vec::new(), 0.0)
        };
        told_given(script, |now_ms| {
            let mut given = [0; MOTORS_MAX];
            given[..6].copy_from_slice(&pulses);
            let more = if (now_ms / 1_000).is_multiple_of(2) { 0 } else { 30 };
            given.iter_mut().filter(|pulse| (1_000..1_900).contains(*pulse)).for_each(|pulse| *pulse += more);
            (now_ms >= 10_000).then_some(given)
        })
    };
    assert_eq!(told([1_500, 1_480, 1_950, 1_510, 1_530, 1_600]), [("motor_output", 2)]);
    assert_eq!(told([1_500, 1_480, 1_520, 1_510, 1_530, 1_600]), []);
}

#[test]
fn a_motor_that_was_dead_before_the_vehicle_was_heard_is_found_by_its_output() {
    let turns = [5_000.0; 6];
    assert_eq!(heard_in_the_air([1_500, 1_480, 900, 1_510, 1_530, 1_600], 30, turns), [("motor_off", 2)]);
    assert_eq!(
        heard_in_the_air([1_500, 1_480, 1_950, 1_510, 1_530, 1_600], 30, turns),
        [("motor_output", 2)]
    );
    let stands = [5_000.0, 5_000.0, 0.0, 5_000.0, 5_000.0, 5_000.0];
    let told = heard_in_the_air([1_500, 1_480, 1_950, 1_510, 1_530, 1_600], 30, stands);
    assert!(told.contains(&("motor_loss", 2)), "{told:?}");
    assert_eq!(heard_in_the_air([1_500, 1_480, 1_520, 1_510, 1_530, 1_600], 30, turns), []);
    let gimbal_and_gear = heard_in_the_air([1_500, 1_480, 1_950, 1_510, 1_530, 1_600], 0, turns);
    assert_eq!(gimbal_and_gear, [], "what stands still is a servo");
    assert_eq!(heard_in_the_air([1_500, 1_480, 0, 1_510, 1_530, 1_600], 30, turns), [], "it is not used");
    assert_eq!(
        heard_in_the_air([1_500, 1_480, 1_950, 1_700, 1_750, 1_600], 30, turns),
        [],
        "others are near it"
    );
}

#[test]
fn a_motor_that_alone_is_given_all_in_wind_that_tilts_the_vehicle_is_weak() {
    // It never flies level, so no level is usual.
    let script = |now_ms: u64| {
        let height = if now_ms < 4_000 { 0.0 } else { 40.0 };
        (Quad { height, roll: 0.6, ..Quad::healthy() }, Vec::new(), 0.0)
    };
    let told = told_given(script, |now_ms| {
        let mut pulses = [900; MOTORS_MAX];
        pulses[..4].copy_from_slice(&match now_ms {
            0..4_000 => [1_000; 4],
            4_000..30_000 => [1_620, 1_600, 1_610, 1_630],
            _ => [1_620, 1_600, 1_610, 2_000],
        });
        Some(pulses)
    });
    assert!(told.contains(&("motor_output", 3)), "{told:?}");
}

/// Findings about PX4's ESCs with two messages: speeds ten times a second, and states by `info` at a time in ms.
fn px4_escs(info: impl Fn(u64) -> Option<Esc>) -> Vec<Finding> {
    let mut run = Run::new(&Params::defaults());
    run.flies(0..90_000, |now_ms, quad, more| {
        quad.autopilot = Autopilot::Px4;
        for esc in quad.escs.iter_mut().flatten() {
            *esc = Esc { temperature: None, failures: None, errors: None, ..*esc };
        }
        let info = info(now_ms).map(|esc| EscGroup { first: 0, escs: [Some(esc); 4] });
        more.extend(info.map(Observation::Escs));
    });
    run.findings.into_iter().filter(|finding| finding.check.starts_with("esc")).collect()
}

#[test]
fn the_state_of_an_esc_is_as_old_as_its_own_message_however_often_its_speed_comes() {
    let good = Esc { temperature: Some(Celsius(45.0)), failures: Some(0), errors: Some(0), ..Esc::default() };
    let bad = [
        ("esc_failure", Esc { failures: Some(32), ..good }),
        ("esc_failure", Esc { failures: Some(4), ..good }),
        ("esc_temperature", Esc { temperature: Some(Celsius(140.0)), ..good }),
    ];
    for every_ms in [200, 1_000, 2_000, 4_000] {
        for (check, bad) in bad {
            let told = |messages: u64, last_ms: u64| {
                px4_escs(|now_ms| {
                    let is_bad = (30_000..30_000 + messages * every_ms).contains(&now_ms);
                    let is_sent = now_ms.is_multiple_of(every_ms) && now_ms < last_ms;
                    is_sent.then_some(if is_bad { bad } else { good })
                })
            };
            assert_eq!(told(1, 90_000), [], "one message is no alarm: {check} every {every_ms} ms");
            let more = told(2 + 2_000 / every_ms, 90_000);
            let alarms =
                |one: &&Finding| one.check == check && matches!(one.level, Level::Warning | Level::Critical);
            assert_eq!(more.iter().filter(alarms).count(), 4, "{check} every {every_ms} ms: {more:?}");
            let ends = told(0, 40_000);
            let mut stale = ends.iter().filter(|one| one.check == "esc_temperature");
            assert!(stale.all(|one| one.level == Level::Stale && one.at.as_millis() < 53_000), "{ends:?}");
            assert!(ends.iter().any(|one| one.check == "esc_temperature"), "stale every {every_ms} ms");
        }
    }
}

#[test]
fn a_temperature_that_is_no_longer_in_the_message_is_no_longer_known() {
    let info = |now_ms: u64| {
        let temperature = (now_ms < 30_000).then_some(Celsius(45.0));
        let esc = Esc { temperature, failures: Some(0), errors: Some(0), ..Esc::default() };
        now_ms.is_multiple_of(1_000).then_some(esc)
    };
    let told: Vec<_> = px4_escs(info).iter().map(|one| (one.check, one.level)).collect();
    assert_eq!(told, [("esc_temperature", Level::Stale); 4]);
}

#[test]
fn escs_on_a_link_that_slows_all_messages_alike_are_not_silent() {
    // Two groups of ESCs report five times a second, other parts ten times. After 30 s all report an eighth as often, or the ESCs stop.
    let silent = |is_slowed: bool| {
        let mut run = Run::new(&Params::defaults());
        run.steps(0..60_000, |now_ms, monitor| {
            let is_late = now_ms >= 30_000;
            let times = if is_late && is_slowed { 8 } else { 1 };
            let quad = Quad::healthy();
            let is_of_escs = |said: &Observation| matches!(said, Observation::Escs(_));
            let mut said = if now_ms % (100 * times) == 0 { quad.says(now_ms) } else { Vec::new() };
            said.retain(|one| !is_of_escs(one));
            for (first, after_ms) in [(0, 0), (4, 50)] {
                let reports = now_ms % (200 * times) == after_ms && (is_slowed || !is_late);
                said.extend(reports.then_some(Observation::Escs(EscGroup { first, escs: quad.escs })));
            }
            observe(monitor, now_ms, AUTOPILOT, said);
        });
        run.of_check("esc_silent").any(|one| matches!(one.level, Level::Warning | Level::Critical))
    };
    assert!(!silent(true));
    assert!(silent(false));
}
