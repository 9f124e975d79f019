//! The protective action, scripted: when it is asked for, and everything that keeps it from being asked for.
#![expect(clippy::unwrap_used, reason = "that is how a test fails")]

mod common;

use common::{AUTOPILOT, Quad};
use hums_core::Monitor;
use hums_core::cause::{Alert, Cause, Urgency};
use hums_core::happening::Happening;
use hums_core::observation::{
    Autopilot, Battery, CommandAck, Feeds, Imu, LandedState, Observation, Source, VehicleKind, VtolState,
};
use hums_core::params::Params;
use hums_core::protect::{Action, Request, Stage};
use hums_core::status::LinkReading;
use hums_core::time::Instant;
use hums_core::units::{Fraction, MetresPerSecond2, RadiansPerSecond};

/// The battery is empty from here on; two seconds of debounce.
const EMPTY_MS: u64 = 20_000;
const FOUND_MS: u64 = EMPTY_MS + 2_000;

/// What came of a flight: steps and requests with their times in milliseconds.
#[derive(Default)]
struct Outcome {
    steps: Vec<(u64, Stage, u8)>,
    requests: Vec<(u64, Request)>,
}

type Script = fn(u64, &mut Quad, &mut Monitor);

fn params(action: Action) -> Params {
    let mut params = Params::defaults();
    params.set("PROT_ACTION", f32::from(action as u8)).unwrap();
    params
}

fn fly(params: &Params, script: impl Fn(u64, &mut Quad, &mut Monitor)) -> Outcome {
    let mut monitor = Monitor::new(*params);
    let mut outcome = Outcome::default();
    for now_ms in (0..60_000).step_by(50) {
        let now = Instant::from_millis(now_ms);
        let mut quad = Quad::healthy();
        if now_ms >= EMPTY_MS {
            quad.battery.remaining = Some(Fraction(0.05));
        }
        script(now_ms, &mut quad, &mut monitor);
        if now_ms.is_multiple_of(100) {
            for observation in quad.says(now_ms) {
                monitor.observe(now, AUTOPILOT, &observation);
            }
        }
        let link = LinkReading { frames_lost: Some(0.0), at: now };
        monitor.tick(now, &link, &quad.recorder, &mut |_| {});
        while let Some(happening) = monitor.take_happening() {
            if let Happening::Protect(step) = happening {
                let asked_for = Action::from_number(params.get(hums_core::params::Param::ProtAction) as u8);
                assert!(Some(step.action) == asked_for || step.action == Action::Land);
                outcome.steps.push((now_ms, step.stage, step.detail));
            }
        }
        outcome.requests.extend(monitor.take_request().map(|request| (now_ms, request)));
    }
    outcome
}

fn answer(at_ms: u64, result: u8) -> impl Fn(u64, &mut Quad, &mut Monitor) {
    move |now_ms, _, monitor| {
        if now_ms == at_ms {
            let ack = Observation::CommandAck(CommandAck { command: 20, result, target: None });
            monitor.observe(Instant::from_millis(now_ms), AUTOPILOT, &ack);
        }
    }
}

#[test]
fn by_default_nothing_is_asked_for() {
    let outcome = fly(&Params::defaults(), |_, _, _| {});
    assert!(outcome.steps.is_empty() && outcome.requests.is_empty());
}

#[test]
fn an_empty_battery_is_announced_counted_down_asked_for_and_answered_once() {
    let outcome = fly(&params(Action::Return), answer(FOUND_MS + 10_300, 0));
    let expected = [
        (FOUND_MS, Stage::Announced, 10),
        (FOUND_MS + 5_000, Stage::Counting, 5),
        (FOUND_MS + 7_000, Stage::Counting, 3),
        (FOUND_MS + 8_000, Stage::Counting, 2),
        (FOUND_MS + 9_000, Stage::Counting, 1),
        (FOUND_MS + 10_000, Stage::Asked, 1),
        (FOUND_MS + 10_300, Stage::Answered, 0),
    ];
    assert_eq!(outcome.steps, expected);
    assert_eq!(outcome.requests, [(FOUND_MS + 10_000, Request { command: 20, confirmation: 0 })]);
}

#[test]
fn an_autopilot_that_does_not_answer_is_asked_three_times() {
    let outcome = fly(&params(Action::Land), |_, _, _| {});
    let asked: Vec<_> = outcome.requests.iter().map(|(at_ms, request)| (*at_ms, request.command)).collect();
    let first = FOUND_MS + 10_000;
    assert_eq!(asked, [(first, 21), (first + 1_000, 21), (first + 2_000, 21)]);
    assert_eq!(outcome.steps.last(), Some(&(first + 3_000, Stage::Unanswered, 3)));
}

#[test]
fn an_answer_to_something_else_or_from_before_is_none() {
    let outcome = fly(&params(Action::Land), answer(FOUND_MS + 10_300, 0));
    assert_eq!(outcome.requests.len(), 3, "20 is not 21");
    let outcome = fly(&params(Action::Return), answer(FOUND_MS + 9_000, 0));
    assert_eq!(outcome.requests.len(), 3, "before it was asked");
}

fn ack(now_ms: u64, monitor: &mut Monitor, at_ms: u64, command: u16, result: u8, target: Option<Source>) {
    if now_ms == at_ms {
        let ack = Observation::CommandAck(CommandAck { command, result, target });
        monitor.observe(Instant::from_millis(now_ms), AUTOPILOT, &ack);
    }
}

const ASKED_MS: u64 = FOUND_MS + 10_000;

#[test]
fn a_return_that_is_refused_is_followed_by_a_landing_of_what_hangs_on_rotors() {
    let outcome = fly(&params(Action::Return), |now_ms, _, monitor| {
        ack(now_ms, monitor, ASKED_MS + 300, 20, 4, None);
        ack(now_ms, monitor, ASKED_MS + 700, 21, 0, None);
    });
    let commands: Vec<_> = outcome.requests.iter().map(|(_, request)| request.command).collect();
    assert_eq!(commands, [20, 21]);
    let stages: Vec<_> = outcome.steps.iter().skip(5).map(|(_, stage, detail)| (*stage, *detail)).collect();
    let expected = [(Stage::Asked, 1), (Stage::Answered, 4), (Stage::Asked, 1), (Stage::Answered, 0)];
    assert_eq!(stages, expected);
}

#[test]
fn a_plane_or_a_vtol_whose_return_is_refused_is_not_landed_where_it_is() {
    for (kind, type_number) in [(VehicleKind::Plane, 1), (VehicleKind::Vtol, 22)] {
        let outcome = fly(&params(Action::Return), |now_ms, quad, monitor| {
            (quad.kind, quad.type_number) = (kind, type_number);
            ack(now_ms, monitor, ASKED_MS + 300, 20, 4, None);
        });
        assert_eq!(outcome.requests.len(), 1, "{kind:?}");
        assert_eq!(outcome.steps.last(), Some(&(ASKED_MS + 300, Stage::Answered, 4)));
    }
}

#[test]
fn progress_is_no_refusal_and_the_answer_that_follows_counts() {
    let outcome = fly(&params(Action::Return), |now_ms, _, monitor| {
        ack(now_ms, monitor, ASKED_MS + 300, 20, 5, None);
        ack(now_ms, monitor, ASKED_MS + 6_000, 20, 0, None);
    });
    assert_eq!(outcome.requests.len(), 1, "it is not asked again meanwhile");
    assert_eq!(outcome.steps.last(), Some(&(ASKED_MS + 6_000, Stage::Answered, 0)));
}

#[test]
fn an_answer_to_the_ground_station_is_not_ours() {
    let station = Source { system: 255, component: 190 };
    let us = Source { system: 1, component: 191 };
    let outcome = fly(&params(Action::Return), |now_ms, _, monitor| {
        ack(now_ms, monitor, ASKED_MS + 300, 20, 0, Some(station));
        ack(now_ms, monitor, ASKED_MS + 1_700, 20, 0, Some(us));
    });
    assert_eq!(outcome.requests.len(), 2, "asked again after a second");
    assert_eq!(outcome.steps.last(), Some(&(ASKED_MS + 1_700, Stage::Answered, 0)));
}

#[test]
fn an_answer_that_is_lost_is_seen_in_the_mode_and_nothing_is_repeated() {
    let outcome = fly(&params(Action::Return), |now_ms, quad, _| {
        if now_ms >= ASKED_MS + 500 {
            quad.mode = 6;
        }
    });
    assert_eq!(outcome.requests.len(), 1);
    assert_eq!(outcome.steps.last().map(|(_, stage, _)| *stage), Some(Stage::AlreadyDone));
}

#[test]
fn any_landing_under_way_is_left_alone() {
    let landings: [Script; 4] = [
        // A mission's landing, by the autopilot's landed state: PX4 and ArduPilot.
        |_, quad, _| {
            (quad.autopilot, quad.mode, quad.landed) =
                (Autopilot::Px4, 0x0404_0000, Some(LandedState::Landing));
        },
        |_, quad, _| (quad.mode, quad.landed) = (3, Some(LandedState::Landing)),
        // The pilot's own, close above the ground.
        |_, quad, _| (quad.height, quad.climb) = (2.5, -0.6),
        // PX4's precision landing.
        |_, quad, _| (quad.autopilot, quad.mode) = (Autopilot::Px4, 0x0904_0000),
    ];
    for (number, landing) in landings.into_iter().enumerate() {
        let outcome = fly(&params(Action::Return), landing);
        assert!(outcome.requests.is_empty(), "{number}");
        assert_eq!(outcome.steps.last().map(|(_, stage, _)| *stage), Some(Stage::AlreadyDone), "{number}");
    }
}

#[test]
fn a_mission_that_ends_during_the_countdown_cancels_nothing_and_a_pilot_who_leaves_it_does() {
    use Autopilot::{ArduPilot, Px4};
    use VehicleKind::{Plane, Rotorcraft};
    // Failsafes wait in HOLD and in BRAKE too: a pilot who chooses them has not cancelled.
    for (autopilot, kind, mission, after, waits) in [
        (Px4, Rotorcraft, 0x0404_0000, 0x0304_0000, true),
        (Px4, Plane, 0x0404_0000, 0x0304_0000, true),
        (Px4, Plane, 0x0404_0000, 0x0003_0000, false),
        (ArduPilot, Plane, 10, 12, false),
        (ArduPilot, Rotorcraft, 3, 5, false),
        (ArduPilot, Rotorcraft, 3, 17, true),
    ] {
        for reached in [true, false] {
            let is_end = reached && after != 0x0003_0000;
            let requests = if is_end || waits { 3 } else { 0 };
            let outcome = fly(&params(Action::Return), |now_ms, quad, monitor| {
                (quad.autopilot, quad.kind) = (autopilot, kind);
                quad.landed = Some(if now_ms < 2_000 { LandedState::OnGround } else { LandedState::InAir });
                quad.mode = if now_ms < FOUND_MS + 5_000 { mission } else { after };
                if reached && now_ms == FOUND_MS + 4_000 {
                    let item = Observation::MissionReached(12);
                    monitor.observe(Instant::from_millis(now_ms), AUTOPILOT, &item);
                }
            });
            assert_eq!(
                outcome.requests.len(),
                requests,
                "{autopilot:?} {kind:?} {after}: {:?}",
                outcome.steps
            );
        }
    }
}

/// In the air by its landed state, in a mission or not, from 80 m down at 1.5 m/s from the fourth second on; it flares.
fn sinks(now_ms: u64, quad: &mut Quad, (autopilot, kind, mode): (Autopilot, VehicleKind, u32)) {
    (quad.autopilot, quad.kind, quad.mode) = (autopilot, kind, mode);
    quad.landed = Some(if now_ms < 2_000 { LandedState::OnGround } else { LandedState::InAir });
    let sunk_m = now_ms.saturating_sub(4_000) as f32 * 0.001_5;
    (quad.height, quad.climb) = match 80.0 - sunk_m {
        low_m if low_m < 3.0 => (2.0, -0.2),
        height_m => (height_m, if now_ms < 4_000 { 0.0 } else { -1.5 }),
    };
}

#[test]
fn a_missions_landing_that_no_landed_state_tells_is_left_alone() {
    for vehicle in [
        (Autopilot::ArduPilot, VehicleKind::Plane, 10),
        (Autopilot::ArduPilot, VehicleKind::Vtol, 10),
        (Autopilot::Px4, VehicleKind::Plane, 0x0404_0000),
        (Autopilot::Px4, VehicleKind::Rotorcraft, 0x0404_0000),
    ] {
        let outcome = fly(&params(Action::Return), |now_ms, quad, _| sinks(now_ms, quad, vehicle));
        assert!(outcome.requests.is_empty(), "{vehicle:?}: {:?}", outcome.steps);
        // At 40 m. The touch-down follows; nothing is announced in the flare.
        let last = outcome.steps.last().map(|(at_ms, stage, _)| (*at_ms, *stage));
        assert!(matches!(last, Some((30_600..30_900, Stage::AlreadyDone))), "{vehicle:?}: {last:?}");
    }
    // A pilot who sinks is no mission, and a landing of ArduCopter's mission is told by its landed state.
    for vehicle in
        [(Autopilot::ArduPilot, VehicleKind::Plane, 5), (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 3)]
    {
        let outcome = fly(&params(Action::Return), |now_ms, quad, _| sinks(now_ms, quad, vehicle));
        assert_eq!(outcome.requests.len(), 3, "{vehicle:?}: {:?}", outcome.steps);
    }
}

#[test]
fn a_mission_that_only_goes_lower_is_waited_for_and_protected_where_it_flies_on() {
    let outcome = fly(&params(Action::Return), |now_ms, quad, _| {
        (quad.kind, quad.mode) = (VehicleKind::Plane, 10);
        quad.landed = Some(if now_ms < 2_000 { LandedState::OnGround } else { LandedState::InAir });
        (quad.height, quad.climb) = if now_ms < 30_000 { (35.0, -1.0) } else { (20.0, 0.0) };
    });
    let [waits, announced, ..] = outcome.steps[..] else { panic!("{:?}", outcome.steps) };
    assert_eq!(waits, (FOUND_MS, Stage::AlreadyDone, 0));
    assert!(matches!(announced, (44_900..45_300, Stage::Announced, 10)), "{announced:?}");
    assert_eq!(outcome.requests.len(), 3);
}

#[test]
fn a_vtol_that_says_that_it_hovers_is_landed_when_its_return_is_refused() {
    for (vtol, commands) in [
        (VtolState::Hover, vec![20, 21]),
        (VtolState::Forward, vec![20]),
        (VtolState::Transition, vec![20]),
        (VtolState::Unknown, vec![20]),
    ] {
        let outcome = fly(&params(Action::Return), |now_ms, quad, monitor| {
            (quad.kind, quad.type_number, quad.vtol) = (VehicleKind::Vtol, 22, vtol);
            quad.landed = Some(if now_ms < 2_000 { LandedState::OnGround } else { LandedState::InAir });
            ack(now_ms, monitor, ASKED_MS + 300, 20, 4, None);
            ack(now_ms, monitor, ASKED_MS + 700, 21, 0, None);
        });
        let asked: Vec<_> = outcome.requests.iter().map(|(_, request)| request.command).collect();
        assert_eq!(asked, commands, "{vtol:?}");
    }
}

#[test]
fn a_link_that_falls_silent_half_way_ends_nothing_and_a_pilot_who_takes_over_afterwards_is_left_alone() {
    let outcome = fly(&params(Action::Return), |now_ms, quad, _| {
        quad.silent = (FOUND_MS + 3_000..FOUND_MS + 6_000).contains(&now_ms);
    });
    assert_eq!(outcome.requests.len(), 3, "{:?}", outcome.steps);
    let taken_over = fly(&params(Action::Return), |now_ms, quad, monitor| {
        ack(now_ms, monitor, ASKED_MS + 300, 20, 0, None);
        quad.mode = if (ASKED_MS + 500..ASKED_MS + 5_000).contains(&now_ms) { 6 } else { 4 };
    });
    assert_eq!(taken_over.requests.len(), 1, "{:?}", taken_over.steps);
}

#[test]
fn one_cancel_holds_for_the_flight_and_the_next_flight_is_protected_again() {
    let outcome = fly(&params(Action::Return), |now_ms, quad, monitor| {
        if now_ms == FOUND_MS + 3_000 {
            assert!(monitor.cancel_protection());
        }
        // Well again and empty again, in the same flight; then down, and up once more.
        if (27_000..30_000).contains(&now_ms) {
            quad.battery.remaining = Some(Fraction(0.5));
        }
        if (36_000..42_000).contains(&now_ms) {
            (quad.height, quad.armed) = (0.0, !(38_000..40_000).contains(&now_ms));
        }
    });
    let announced = outcome.steps.iter().filter(|(_, stage, _)| *stage == Stage::Announced);
    let announced: Vec<_> = announced.map(|(at_ms, ..)| *at_ms).collect();
    assert!(matches!(announced[..], [FOUND_MS, 42_000..44_000]), "{announced:?}");
}

#[test]
fn a_battery_of_the_payload_or_of_another_component_is_no_reason_to_come_down() {
    let payload = fly(&params(Action::Land), |now_ms, quad, monitor| {
        quad.battery.remaining = Some(Fraction(0.8));
        let battery =
            Battery { id: 0, feeds: Feeds::Payload, remaining: Some(Fraction(0.05)), ..Battery::default() };
        let gimbal = Source { system: 1, component: 181 };
        monitor.observe(Instant::from_millis(now_ms), gimbal, &Observation::Battery(battery));
    });
    assert!(payload.steps.is_empty(), "{:?}", payload.steps);
    // One that does not say what it feeds: of a gimbal, and of a battery's own component.
    for (component, comes_down) in [(154, false), (180, true), (181, true), (1, true)] {
        let unsaid = fly(&params(Action::Land), |now_ms, quad, monitor| {
            quad.battery.remaining = Some(Fraction(0.8));
            let battery = Battery { id: 3, remaining: Some(Fraction(0.05)), ..Battery::default() };
            let source = Source { system: 1, component };
            monitor.observe(Instant::from_millis(now_ms), source, &Observation::Battery(battery));
        });
        assert_eq!(!unsaid.requests.is_empty(), comes_down, "{component}: {:?}", unsaid.steps);
    }
    let other_vehicle = fly(&params(Action::Land), |now_ms, quad, monitor| {
        quad.battery.remaining = Some(Fraction(0.8));
        let battery = Battery { remaining: Some(Fraction(0.05)), ..Battery::default() };
        let source = Source { system: 2, component: 1 };
        monitor.observe(Instant::from_millis(now_ms), source, &Observation::Battery(battery));
    });
    assert!(other_vehicle.steps.is_empty(), "{:?}", other_vehicle.steps);
}

#[test]
fn one_message_of_nonsense_brings_nobody_down() {
    let mut at_once = params(Action::Land);
    at_once.set("PROT_DELAY", 0.0).unwrap();
    let outcome = fly(&at_once, |now_ms, quad, _| {
        // The battery is told of once in 2.5 s.
        quad.battery.remaining = Some(Fraction(if now_ms == EMPTY_MS { 0.0 } else { 0.8 }));
    });
    assert!(outcome.requests.is_empty(), "{:?}", outcome.steps);
}

#[test]
fn nothing_is_ever_asked_of_a_vehicle_that_does_not_fly() {
    for type_number in [10, 11, 12] {
        let outcome = fly(&params(Action::Land), |_, quad, _| {
            (quad.autopilot, quad.kind, quad.type_number) =
                (Autopilot::Px4, VehicleKind::Surface, type_number);
            quad.landed = Some(LandedState::InAir);
        });
        assert!(outcome.steps.is_empty(), "{type_number}: {:?}", outcome.steps);
    }
}

#[test]
fn a_box_that_restarts_in_the_air_protects_at_once() {
    let outcome = fly(&params(Action::Land), |_, quad, _| {
        quad.start_height = 50.0;
        quad.height = 50.0;
        quad.battery.remaining = Some(Fraction(0.05));
    });
    assert!(matches!(outcome.steps.first(), Some((0..4_000, Stage::Announced, _))), "{:?}", outcome.steps);
}

#[test]
fn a_vehicle_that_is_disarmed_while_it_is_asked_is_not_asked_again() {
    let outcome = fly(&params(Action::Land), |now_ms, quad, _| quad.armed = now_ms < ASKED_MS + 500);
    assert_eq!(outcome.requests.len(), 1);
    assert_eq!(outcome.steps.last().map(|(_, stage, _)| *stage), Some(Stage::CancelledOnGround));
}

#[test]
fn whatever_the_pilot_does_cancels_it_for_this_flight() {
    let cases: [(Stage, Script); 5] = [
        (Stage::CancelledByMode, |now_ms, quad, _| {
            if now_ms >= FOUND_MS + 4_000 {
                quad.mode = 5;
            }
        }),
        (Stage::AlreadyDone, |now_ms, quad, _| {
            if now_ms >= FOUND_MS + 4_000 {
                quad.mode = 6;
            }
        }),
        (Stage::AlreadyDone, |_, quad, _| quad.mode = 9),
        (Stage::CancelledByCommand, |now_ms, _, monitor| {
            if now_ms == FOUND_MS + 3_000 {
                assert!(monitor.cancel_protection());
            } else if now_ms == FOUND_MS - 3_000 {
                assert!(!monitor.cancel_protection(), "there is nothing to cancel");
            }
        }),
        (Stage::CancelledOnGround, |now_ms, quad, _| {
            if now_ms >= FOUND_MS + 4_000 {
                (quad.armed, quad.height) = (false, 0.0);
            }
        }),
    ];
    for (stage, script) in cases {
        let outcome = fly(&params(Action::Return), script);
        assert_eq!(outcome.steps.last().unwrap().1, stage);
        assert!(outcome.requests.is_empty(), "{stage:?}");
    }
}

#[test]
fn what_is_no_longer_critical_is_announced_again_when_it_is() {
    let outcome = fly(&params(Action::Return), |now_ms, quad, _| {
        if (FOUND_MS + 3_000..FOUND_MS + 8_000).contains(&now_ms) {
            quad.battery.remaining = Some(Fraction(0.5));
        }
    });
    let stages: Vec<_> = outcome.steps.iter().map(|(_, stage, _)| *stage).collect();
    let again = [Stage::Announced, Stage::CancelledClear, Stage::Announced, Stage::Counting];
    assert!(stages.starts_with(&again), "{stages:?}");
}

#[test]
fn on_the_ground_nothing_is_asked_for() {
    for armed in [false, true] {
        let outcome = fly(&params(Action::Land), |_, quad, _| (quad.height, quad.armed) = (0.0, armed));
        assert!(outcome.steps.is_empty(), "{:?}", outcome.steps);
    }
}

#[test]
fn a_chosen_subsystem_triggers_it_and_others_do_not() {
    let mut chosen = params(Action::Land);
    chosen.set("PROT_CHECK", 4.0).unwrap();
    let battery = fly(&chosen, |_, _, _| {});
    assert!(battery.requests.is_empty());
    let vibration = fly(&chosen, |now_ms, quad, _| {
        if now_ms >= EMPTY_MS {
            quad.vibration.levels[0] = Some(70.0);
        }
    });
    assert_eq!(vibration.steps[0], (EMPTY_MS + 1_000, Stage::Announced, 10));
    assert_eq!(vibration.requests.len(), 3);
}

/// Who flies: autopilot, kind, `MAV_TYPE`, and a mode that neither returns nor waits.
const VEHICLES: [(Autopilot, VehicleKind, u8, u32); 5] = [
    (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 2, 4),
    (Autopilot::ArduPilot, VehicleKind::Plane, 1, 5),
    (Autopilot::ArduPilot, VehicleKind::Vtol, 22, 5),
    (Autopilot::Px4, VehicleKind::Rotorcraft, 13, 0x0003_0000),
    (Autopilot::Px4, VehicleKind::Plane, 1, 0x0003_0000),
];

/// As [`fly`], with each vehicle of [`VEHICLES`], whose landed state is sent.
fn fly_each(script: impl Fn(u64, &mut Quad, &mut Monitor)) -> Vec<Outcome> {
    let each = VEHICLES.into_iter().map(|(autopilot, kind, type_number, mode)| {
        fly(&params(Action::Return), |now_ms, quad, monitor| {
            (quad.autopilot, quad.kind, quad.type_number, quad.mode) = (autopilot, kind, type_number, mode);
            quad.landed = Some(if now_ms < 2_000 { LandedState::OnGround } else { LandedState::InAir });
            script(now_ms, quad, monitor);
        })
    });
    each.collect()
}

/// The return is requested of every vehicle, at this time or up to so much later.
fn all_ask(outcomes: &[Outcome], at_ms: u64, late_ms: u64, what: &dyn std::fmt::Debug) {
    for (outcome, vehicle) in outcomes.iter().zip(VEHICLES) {
        let first = outcome.requests.first().map(|(asked_ms, request)| (*asked_ms, request.command));
        let in_time = matches!(first, Some((asked_ms, 20)) if (at_ms..=at_ms + late_ms).contains(&asked_ms));
        assert!(in_time, "{what:?} {vehicle:?}: {:?}", outcome.steps);
    }
}

#[test]
fn a_wrong_landed_state_delays_the_action_by_no_more_than_it_lasts() {
    for height in [3.0, 20.0, 300.0, -15.0] {
        for from_ms in [FOUND_MS - 3_000, FOUND_MS - 500, FOUND_MS + 4_000, ASKED_MS - 500] {
            for lasts_ms in [500, 2_000, 4_000] {
                let outcomes = fly_each(|now_ms, quad, _| {
                    quad.height = height;
                    if (from_ms..from_ms + lasts_ms).contains(&now_ms) {
                        quad.landed = Some(LandedState::OnGround);
                    }
                });
                // The vehicle is in the air again 0.6 s after its autopilot says so, twice a second.
                all_ask(&outcomes, ASKED_MS, lasts_ms + 1_200, &(height, from_ms, lasts_ms));
            }
        }
    }
}

#[test]
fn a_touch_and_go_in_the_countdown_pauses_it() {
    let outcomes = fly_each(|now_ms, quad, _| {
        if (FOUND_MS + 4_000..FOUND_MS + 8_000).contains(&now_ms) {
            (quad.landed, quad.height, quad.throttle) = (Some(LandedState::OnGround), 0.0, 0.05);
        }
    });
    all_ask(&outcomes, ASKED_MS + 4_000, 2_000, &"touch and go");
}

#[test]
fn what_sinks_and_flies_on_is_protected_below_home_and_close_to_the_ground() {
    // Height where it begins, and how fast it sinks for four seconds as the battery turns critical. Within 3 m of the height of the
    // take-off it may be a landing, for 15 s.
    for (height, sink, late_ms) in [
        (-10.0, 0.6, 0),
        (-30.0, 0.6, 0),
        (-30.0, 2.0, 0),
        (-200.0, 1.5, 0),
        (60.0, 1.5, 0),
        (4.0, 0.6, 16_000),
        (1.0, 0.5, 16_000),
    ] {
        let outcomes = fly_each(|now_ms, quad, _| {
            let sunk_ms = now_ms.clamp(FOUND_MS - 2_000, FOUND_MS + 2_000) - (FOUND_MS - 2_000);
            let sinks = (1..4_000).contains(&sunk_ms);
            (quad.height, quad.climb) =
                (height - sink * sunk_ms as f32 / 1_000.0, if sinks { -sink } else { 0.0 });
        });
        let until = if late_ms > 0 { late_ms + 2_000 } else { 100 };
        all_ask(&outcomes, ASKED_MS, until, &(height, sink));
    }
}

#[test]
fn a_tumble_that_is_survived_pauses_the_countdown() {
    for from_ms in [FOUND_MS - 1_000, FOUND_MS + 3_000, ASKED_MS - 200] {
        for lasts_ms in [600, 800, 1_200] {
            for load_g in [0.5_f32, 1.0, 5.0] {
                let outcome = fly(&params(Action::Return), |now_ms, quad, monitor| {
                    quad.landed =
                        Some(if now_ms < 2_000 { LandedState::OnGround } else { LandedState::InAir });
                    let tumbles = (from_ms..from_ms + lasts_ms).contains(&now_ms);
                    let force = if tumbles { load_g } else { 1.0 + (now_ms % 7) as f32 * 0.002 };
                    quad.acceleration_down = -9.806_65 * force;
                    let imu = Imu {
                        acceleration: Some([0.0, 0.0, quad.acceleration_down].map(MetresPerSecond2)),
                        rate: Some([if tumbles { 6.2 } else { 0.01 }, 0.0, 0.0].map(RadiansPerSecond)),
                        ..Imu::default()
                    };
                    monitor.observe(Instant::from_millis(now_ms), AUTOPILOT, &Observation::Imu(imu));
                });
                let first = outcome.requests.first().map(|(at_ms, _)| *at_ms);
                let at_most = ASKED_MS + lasts_ms + 6_000;
                assert!(
                    first.is_some_and(|at_ms| (ASKED_MS..=at_most).contains(&at_ms)),
                    "{from_ms} {lasts_ms} {load_g}: {:?}",
                    outcome.steps
                );
            }
        }
    }
}

/// The stages of an outcome up to the first request.
fn stages(outcome: &Outcome) -> Vec<Stage> {
    let all = outcome.steps.iter().map(|(_, stage, _)| *stage).filter(|stage| *stage != Stage::Counting);
    all.take_while(|stage| *stage != Stage::Asked).collect()
}

#[test]
fn the_autopilots_own_change_of_mode_is_announced_anew_and_a_pilot_still_cancels() {
    const CHANGED_MS: u64 = FOUND_MS + 4_000;
    let text = Alert { cause: Cause::RemoteControl, urgency: Urgency::Warning };
    // A mode that a failsafe enters and a pilot could too; how long before or after the change the autopilot speaks, and whether it
    // does so by a text or by its state. PX4's ALTCTL, ArduCopter's ALT_HOLD, ArduPlane's FBWA.
    for (autopilot, kind, before, after) in [
        (Autopilot::Px4, VehicleKind::Rotorcraft, 0x0003_0000, 0x0002_0000),
        (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 5, 2),
        (Autopilot::ArduPilot, VehicleKind::Plane, 12, 5),
    ] {
        for spoken_ms in [CHANGED_MS - 1_500, CHANGED_MS, CHANGED_MS + 1_500] {
            for by_text in [true, false] {
                for pilot in [false, true] {
                    let outcome = fly(&params(Action::Return), |now_ms, quad, monitor| {
                        (quad.autopilot, quad.kind) = (autopilot, kind);
                        quad.mode = if now_ms < CHANGED_MS { before } else { after };
                        if pilot && now_ms >= CHANGED_MS + 6_000 {
                            quad.mode = before;
                        }
                        if by_text && now_ms == spoken_ms {
                            let now = Instant::from_millis(now_ms);
                            monitor.observe(now, AUTOPILOT, &Observation::Alert(text));
                        }
                        if !by_text && now_ms >= spoken_ms {
                            quad.state = 5;
                        }
                    });
                    let what = (autopilot, kind, spoken_ms, by_text, pilot);
                    let stages = stages(&outcome);
                    let announced = stages.iter().filter(|stage| **stage == Stage::Announced).count();
                    assert_eq!(announced, 2, "{what:?}: {stages:?}");
                    assert_eq!(outcome.requests.is_empty(), pilot, "{what:?}: {stages:?}");
                }
            }
        }
    }
    // A failsafe that began long before says nothing of who changed the mode.
    let outcome = fly(&params(Action::Return), |now_ms, quad, _| {
        quad.state = if now_ms < FOUND_MS { 4 } else { 5 };
        quad.mode = if now_ms < CHANGED_MS { 4 } else { 5 };
    });
    assert_eq!(stages(&outcome), [Stage::Announced, Stage::CancelledByMode]);
}

#[test]
fn a_mode_in_which_failsafes_wait_is_no_cancel_and_another_one_after_it_is() {
    for (autopilot, kind, before, waits) in [
        (Autopilot::Px4, VehicleKind::Rotorcraft, 0x0003_0000, 0x0304_0000),
        (Autopilot::Px4, VehicleKind::Plane, 0x0001_0000, 0x0304_0000),
        (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 5, 17),
        (Autopilot::ArduPilot, VehicleKind::Plane, 5, 1),
    ] {
        for pilot in [false, true] {
            let outcome = fly(&params(Action::Return), |now_ms, quad, _| {
                (quad.autopilot, quad.kind) = (autopilot, kind);
                quad.mode = match now_ms {
                    0..26_000 => before,
                    30_000.. if pilot => before,
                    _ => waits,
                };
            });
            assert_eq!(outcome.requests.is_empty(), pilot, "{autopilot:?} {kind:?}: {:?}", outcome.steps);
        }
    }
}

#[test]
fn a_return_under_way_that_the_autopilot_gives_up_is_announced_anew_and_a_pilots_is_not() {
    let text = Alert { cause: Cause::Gnss, urgency: Urgency::Warning };
    for by_itself in [true, false] {
        let outcome = fly(&params(Action::Return), |now_ms, quad, monitor| {
            quad.mode = if (15_000..30_000).contains(&now_ms) { 6 } else { 2 };
            if by_itself && now_ms == 30_000 {
                monitor.observe(Instant::from_millis(now_ms), AUTOPILOT, &Observation::Alert(text));
            }
        });
        let (last, asked) = if by_itself { (Stage::Announced, 3) } else { (Stage::CancelledByMode, 0) };
        assert_eq!(stages(&outcome), [Stage::AlreadyDone, last]);
        assert_eq!(outcome.requests.len(), asked, "{:?}", outcome.steps);
    }
}

#[test]
fn a_pilot_who_changes_the_mode_while_it_is_asked_is_not_asked_against() {
    let outcome = fly(&params(Action::Return), |now_ms, quad, _| {
        quad.mode = if now_ms < ASKED_MS + 500 { 4 } else { 5 };
    });
    assert_eq!(outcome.requests.len(), 1, "{:?}", outcome.steps);
    assert_eq!(outcome.steps.last().map(|(_, stage, _)| *stage), Some(Stage::CancelledByMode));
}
