//! The protective action, scripted: when it is requested, and all reasons against it.
#![expect(clippy::unwrap_used, reason = "that is how a test fails")]

use crate::common::{AUTOPILOT, Quad, Run, observe};
use hums_core::Monitor;
use hums_core::cause::{Alert, Cause, Urgency};
use hums_core::happening::Happening;
use hums_core::observation::{
    Autopilot, Battery, CommandAck, Feeds, Imu, LandedState, Observation, Source, VehicleKind, VtolState,
};
use hums_core::params::Params;
use hums_core::protect::{Action, Request, Stage, Step};
use hums_core::time::BootMs;
use hums_core::units::{Fraction, MetresPerSecond2, RadiansPerSecond};

use Autopilot::{ArduPilot, Px4};
use VehicleKind::{Plane, Rotorcraft, Surface, Vtol};

/// The battery is empty from here on, and critical after two seconds; the countdown takes ten.
const EMPTY_MS: u64 = 20_000;
const FOUND_MS: u64 = EMPTY_MS + 2_000;
const ASKED_MS: u64 = FOUND_MS + 10_000;
/// No answer comes.
const UNANSWERED: &str = "announced, asked, asked, asked, unanswered";
/// PX4's POSCTL, ALTCTL, HOLD, MISSION and PRECLAND.
const POSCTL: u32 = 0x0003_0000;
const ALTCTL: u32 = 0x0002_0000;
const HOLD: u32 = 0x0304_0000;
const MISSION: u32 = 0x0404_0000;
const PRECLAND: u32 = 0x0904_0000;

struct Outcome {
    steps: Vec<(u64, Step)>,
    requests: Vec<(u64, Request)>,
}

impl Outcome {
    /// The stages in words, without the countdown; a landing after a refused return with its name.
    fn story(&self) -> String {
        let first = self.steps.first().map(|(_, step)| step.action);
        let words = self.steps.iter().filter(|(_, step)| step.stage != Stage::Counting).map(|(_, step)| {
            let land = if Some(step.action) == first { "" } else { "land " };
            let stage = match (step.stage, step.detail) {
                (Stage::Answered, 0) => "accepted",
                (Stage::Answered, _) => "refused",
                (stage, _) => stage.name(),
            };
            format!("{land}{stage}")
        });
        words.collect::<Vec<_>>().join(", ")
    }

    fn announced_ms(&self) -> Vec<u64> {
        let announced = self.steps.iter().filter(|(_, step)| step.stage == Stage::Announced);
        announced.map(|(at_ms, _)| *at_ms).collect()
    }
}

fn params(action: Action) -> Params {
    let mut params = Params::defaults();
    params.set("PROT_ACTION", f32::from(action as u8)).unwrap();
    params
}

fn fly(script: impl Fn(u64, &mut Quad, &mut Monitor)) -> Outcome {
    fly_with(&params(Action::Return), script)
}

fn fly_with(params: &Params, script: impl Fn(u64, &mut Quad, &mut Monitor)) -> Outcome {
    let mut run = Run::new(params);
    run.steps(0..60_000, |now_ms, monitor| {
        let mut quad = Quad::healthy();
        if now_ms >= EMPTY_MS {
            quad.battery.remaining = Some(Fraction(0.05));
        }
        script(now_ms, &mut quad, monitor);
        if now_ms.is_multiple_of(100) {
            observe(monitor, now_ms, AUTOPILOT, quad.says(now_ms));
        }
    });
    let step = |(at_ms, happening)| match happening {
        Happening::Protect(step) => Some((at_ms, step)),
        _ => None,
    };
    Outcome { steps: run.happenings.into_iter().filter_map(step).collect(), requests: run.requests }
}

fn say(now_ms: u64, monitor: &mut Monitor, at_ms: u64, source: Source, observation: Observation) {
    if now_ms == at_ms {
        monitor.observe(BootMs::from_millis(now_ms), source, &observation);
    }
}

fn ack(now_ms: u64, monitor: &mut Monitor, at_ms: u64, command: u16, result: u8) {
    let ack = CommandAck { command, result, target: None };
    say(now_ms, monitor, at_ms, AUTOPILOT, Observation::CommandAck(ack));
}

fn accept(now_ms: u64, quad: &mut Quad, monitor: &mut Monitor, at_ms: u64, command: u16) {
    ack(now_ms, monitor, at_ms, command, 0);
    if now_ms > at_ms {
        quad.mode = 21;
    }
}

/// A vehicle whose landed state is sent, with the mode that it is in.
fn become_vehicle(now_ms: u64, quad: &mut Quad, (autopilot, kind, mode): (Autopilot, VehicleKind, u32)) {
    (quad.autopilot, quad.kind, quad.mode) = (autopilot, kind, mode);
    quad.landed = Some(if now_ms < 2_000 { LandedState::OnGround } else { LandedState::InAir });
}

/// Modes that neither return nor land, and in which no failsafe waits.
const VEHICLES: [(Autopilot, VehicleKind, u32); 5] = [
    (ArduPilot, Rotorcraft, 4),
    (ArduPilot, Plane, 5),
    (ArduPilot, Vtol, 5),
    (Px4, Rotorcraft, POSCTL),
    (Px4, Plane, POSCTL),
];

fn all_are_asked(
    at_ms: u64,
    late_ms: u64,
    what: &dyn std::fmt::Debug,
    script: impl Fn(u64, &mut Quad, &mut Monitor),
) {
    for vehicle in VEHICLES {
        let outcome = fly(|now_ms, quad, monitor| {
            become_vehicle(now_ms, quad, vehicle);
            script(now_ms, quad, monitor);
        });
        let first = outcome.requests.first().map(|(asked_ms, request)| (*asked_ms, request.command));
        let is_in_time =
            matches!(first, Some((asked_ms, 20)) if (at_ms..=at_ms + late_ms).contains(&asked_ms));
        assert!(is_in_time, "{what:?} {vehicle:?}: {:?}", outcome.steps);
    }
}

#[test]
fn the_action_is_off_by_default() {
    let outcome = fly_with(&Params::defaults(), |_, _, _| {});
    assert!(outcome.steps.is_empty() && outcome.requests.is_empty());
}

#[test]
fn an_empty_battery_is_announced_counted_down_and_requested() {
    let outcome = fly(|now_ms, quad, monitor| accept(now_ms, quad, monitor, ASKED_MS + 300, 20));
    let steps: Vec<_> = outcome.steps.iter().map(|(at_ms, step)| (*at_ms, step.stage, step.detail)).collect();
    let expected = [
        (FOUND_MS, Stage::Announced, 10),
        (FOUND_MS + 5_000, Stage::Counting, 5),
        (FOUND_MS + 7_000, Stage::Counting, 3),
        (FOUND_MS + 8_000, Stage::Counting, 2),
        (FOUND_MS + 9_000, Stage::Counting, 1),
        (ASKED_MS, Stage::Asked, 1),
        (ASKED_MS + 300, Stage::Answered, 0),
    ];
    assert_eq!(steps, expected);
    assert_eq!(outcome.requests, [(ASKED_MS, Request { command: 20, confirmation: 0 })]);
}

#[test]
fn an_autopilot_that_does_not_answer_is_asked_three_times() {
    let outcome = fly_with(&params(Action::Land), |_, _, _| {});
    let asked =
        |number: u8| (ASKED_MS + 1_000 * u64::from(number), Request { command: 21, confirmation: number });
    assert_eq!(outcome.requests, [0, 1, 2].map(asked));
    assert_eq!(outcome.story(), UNANSWERED);
}

#[test]
fn an_answer_that_is_not_for_our_request_does_not_count() {
    let station = Source { system: 255, component: 190 };
    let us = Source { system: 1, component: 191 };
    for (at_ms, command, target, story) in [
        (ASKED_MS + 300, 21, None, UNANSWERED),
        (FOUND_MS + 9_000, 20, None, UNANSWERED),
        (ASKED_MS + 300, 20, Some(station), UNANSWERED),
        (ASKED_MS + 300, 20, Some(us), "announced, asked, accepted"),
        (ASKED_MS + 1_700, 20, Some(us), "announced, asked, asked, accepted"),
    ] {
        let ack = Observation::CommandAck(CommandAck { command, result: 0, target });
        let outcome = fly(|now_ms, quad, monitor| {
            say(now_ms, monitor, at_ms, AUTOPILOT, ack);
            if story != UNANSWERED && now_ms > at_ms {
                quad.mode = 21;
            }
        });
        assert_eq!(outcome.story(), story, "{at_ms} {command} {target:?}");
    }
}

#[test]
fn an_answer_in_progress_is_waited_for() {
    let outcome = fly(|now_ms, quad, monitor| {
        ack(now_ms, monitor, ASKED_MS + 300, 20, 5);
        accept(now_ms, quad, monitor, ASKED_MS + 6_000, 20);
    });
    assert_eq!(outcome.story(), "announced, asked, accepted");
}

#[test]
fn a_lost_answer_shows_in_the_mode() {
    let outcome = fly(|now_ms, quad, _| quad.mode = if now_ms >= ASKED_MS + 500 { 6 } else { 4 });
    assert_eq!(outcome.story(), "announced, asked, already_done");
}

#[test]
fn a_refused_return_is_followed_by_a_landing_only_on_rotors() {
    let lands = "announced, asked, refused, land asked, land accepted";
    let ends = "announced, asked, refused";
    for (kind, vtol, story) in [
        (Rotorcraft, VtolState::Unknown, lands),
        (Plane, VtolState::Unknown, ends),
        (Vtol, VtolState::Unknown, ends),
        (Vtol, VtolState::Hover, lands),
        (Vtol, VtolState::Forward, ends),
        (Vtol, VtolState::Transition, ends),
    ] {
        let outcome = fly(|now_ms, quad, monitor| {
            become_vehicle(now_ms, quad, (ArduPilot, kind, 4));
            quad.vtol = vtol;
            ack(now_ms, monitor, ASKED_MS + 300, 20, 4);
            if story == lands {
                accept(now_ms, quad, monitor, ASKED_MS + 700, 21);
            }
        });
        assert_eq!(outcome.story(), story, "{kind:?} {vtol:?}");
    }
}

#[test]
fn a_landing_under_way_is_left_alone() {
    for (autopilot, mode, landed, height, climb) in [
        // A mission's landing by the landed state, the pilot's own close to the ground, and PX4's precision landing.
        (Px4, MISSION, Some(LandedState::Landing), 20.0, -0.1),
        (ArduPilot, 3, Some(LandedState::Landing), 20.0, -0.1),
        (ArduPilot, 4, None, 2.5, -0.6),
        (Px4, PRECLAND, None, 20.0, -0.1),
    ] {
        let outcome = fly(|_, quad, _| {
            (quad.autopilot, quad.mode, quad.landed) = (autopilot, mode, landed);
            (quad.height, quad.climb) = (height, climb);
        });
        assert_eq!(outcome.story(), "already_done", "{autopilot:?} {mode}");
    }
}

#[test]
fn a_landing_in_a_mission_is_left_alone() {
    for (vehicle, is_told) in [
        ((ArduPilot, Plane, 10), true),
        ((ArduPilot, Vtol, 10), true),
        ((Px4, Plane, MISSION), true),
        ((Px4, Rotorcraft, MISSION), true),
        // A pilot's sink is not a mission, and ArduCopter's landed state reports the landing.
        ((ArduPilot, Plane, 5), false),
        ((ArduPilot, Rotorcraft, 3), false),
    ] {
        // From 80 m down at 1.5 m/s from the fourth second on; it flares.
        let outcome = fly(|now_ms, quad, _| {
            become_vehicle(now_ms, quad, vehicle);
            (quad.height, quad.climb) = match 80.0 - now_ms.saturating_sub(4_000) as f32 * 0.001_5 {
                low_m if low_m < 3.0 => (2.0, -0.2),
                height_m => (height_m, if now_ms < 4_000 { 0.0 } else { -1.5 }),
            };
        });
        assert_eq!(
            outcome.story(),
            if is_told { "announced, already_done" } else { UNANSWERED },
            "{vehicle:?}"
        );
        // 2 s after it was at 40 m; no step comes in the flare.
        let at_ms = outcome.steps.last().unwrap().0;
        assert!(!is_told || (32_600..32_900).contains(&at_ms), "{vehicle:?}: {at_ms}");
    }
}

#[test]
fn a_mission_that_goes_lower_is_announced_once_it_flies_on() {
    let outcome = fly(|now_ms, quad, _| {
        become_vehicle(now_ms, quad, (ArduPilot, Plane, 10));
        (quad.height, quad.climb) = if now_ms < 30_000 { (35.0, -1.0) } else { (20.0, 0.0) };
    });
    assert_eq!(outcome.story(), format!("already_done, {UNANSWERED}"));
    assert!(matches!(outcome.announced_ms()[..], [44_900..45_300]), "{:?}", outcome.steps);
    let far_below_home = fly(|now_ms, quad, _| {
        become_vehicle(now_ms, quad, (ArduPilot, Plane, 10));
        (quad.height, quad.climb) = (-50.0 - now_ms as f32 / 1_000.0, -1.0);
    });
    assert_eq!(far_below_home.story(), UNANSWERED);
}

#[test]
fn the_end_of_a_mission_is_no_cancel() {
    // HOLD and BRAKE are not the pilot's choice either: failsafes wait in them.
    for (autopilot, kind, mission, after, is_waiting) in [
        (Px4, Rotorcraft, MISSION, HOLD, true),
        (Px4, Plane, MISSION, HOLD, true),
        (ArduPilot, Plane, 10, 12, false),
        (ArduPilot, Rotorcraft, 3, 5, false),
        (ArduPilot, Rotorcraft, 3, 17, true),
    ] {
        for is_reached in [true, false] {
            let outcome = fly(|now_ms, quad, monitor| {
                let mode = if now_ms < FOUND_MS + 5_000 { mission } else { after };
                become_vehicle(now_ms, quad, (autopilot, kind, mode));
                let at_ms = if is_reached { FOUND_MS + 4_000 } else { u64::MAX };
                say(now_ms, monitor, at_ms, AUTOPILOT, Observation::MissionReached(12));
            });
            let is_asked = is_reached || is_waiting;
            let end = if is_asked { UNANSWERED } else { "cancelled_by_mode" };
            assert_eq!(
                outcome.story(),
                format!("announced, {end}"),
                "{autopilot:?} {kind:?} {after} {is_reached}"
            );
        }
    }
}

#[test]
fn a_pilot_who_takes_over_from_an_accepted_return_is_left_alone() {
    let outcome = fly(|now_ms, quad, monitor| {
        ack(now_ms, monitor, ASKED_MS + 300, 20, 0);
        quad.mode = if (ASKED_MS + 500..ASKED_MS + 5_000).contains(&now_ms) { 6 } else { 4 };
    });
    assert_eq!(outcome.story(), "announced, asked, accepted, cancelled_by_mode");
}

#[test]
fn a_silent_link_ends_no_countdown() {
    let outcome = fly(|now_ms, quad, _| quad.silent = (FOUND_MS + 3_000..FOUND_MS + 6_000).contains(&now_ms));
    assert_eq!(outcome.story(), UNANSWERED);
}

#[test]
fn a_pilot_cancels_by_mode_command_or_disarming() {
    const MS: u64 = FOUND_MS + 4_000;
    for (story, mode, command, disarms) in [
        ("announced, cancelled_by_mode", 5, false, false),
        ("announced, already_done", 6, false, false),
        ("announced, cancelled_by_command", 4, true, false),
        ("announced, cancelled_on_ground", 4, false, true),
    ] {
        let outcome = fly(|now_ms, quad, monitor| {
            if now_ms >= MS {
                quad.mode = mode;
                quad.armed = !disarms;
                quad.height = if disarms { 0.0 } else { 20.0 };
            }
            assert!(!command || now_ms != EMPTY_MS || !monitor.cancel_protection(), "nothing to cancel");
            assert!(!command || now_ms != MS || monitor.cancel_protection());
        });
        assert_eq!(outcome.story(), story);
    }
}

#[test]
fn one_cancel_holds_for_the_flight_and_not_for_the_next_one() {
    let outcome = fly(|now_ms, quad, monitor| {
        assert!(now_ms != FOUND_MS + 3_000 || monitor.cancel_protection());
        // Well again and empty again, in the same flight; then down, and up once more.
        if (27_000..30_000).contains(&now_ms) {
            quad.battery.remaining = Some(Fraction(0.5));
        }
        if (36_000..42_000).contains(&now_ms) {
            (quad.height, quad.armed) = (0.0, !(38_000..40_000).contains(&now_ms));
        }
    });
    let announced = outcome.announced_ms();
    assert!(matches!(announced[..], [FOUND_MS, 42_000..44_000]), "{announced:?}");
}

#[test]
fn only_the_battery_of_the_vehicle_counts() {
    let empty = |id, feeds| Battery { id, feeds, remaining: Some(Fraction(0.05)), ..Battery::default() };
    let unsaid = Battery::default().feeds;
    for (system, component, battery, is_ours) in [
        (1, 181, empty(0, Feeds::Payload), false),
        // Batteries of unknown consumers: a gimbal's, a battery's own component, the autopilot's, another vehicle's.
        (1, 154, empty(3, unsaid), false),
        (1, 180, empty(3, unsaid), true),
        (1, 181, empty(3, unsaid), true),
        (1, 1, empty(3, unsaid), true),
        (2, 1, empty(0, unsaid), false),
    ] {
        let outcome = fly(|now_ms, quad, monitor| {
            quad.battery.remaining = Some(Fraction(0.8));
            say(now_ms, monitor, now_ms, Source { system, component }, Observation::Battery(battery));
        });
        assert_eq!(outcome.story(), if is_ours { UNANSWERED } else { "" }, "{system} {component}");
    }
}

#[test]
fn one_wrong_message_of_a_battery_is_no_cause() {
    let mut at_once = params(Action::Land);
    at_once.set("PROT_DELAY", 0.0).unwrap();
    let outcome = fly_with(&at_once, |now_ms, quad, _| {
        quad.battery.remaining = Some(Fraction(if now_ms == EMPTY_MS { 0.0 } else { 0.8 }));
    });
    assert_eq!(outcome.story(), "");
}

#[test]
fn nothing_is_requested_of_surface_vehicles() {
    for type_number in [10, 11, 12] {
        let outcome = fly(|_, quad, _| {
            (quad.autopilot, quad.kind, quad.type_number) = (Px4, Surface, type_number);
            quad.landed = Some(LandedState::InAir);
        });
        assert_eq!(outcome.story(), "", "{type_number}");
    }
}

#[test]
fn nothing_is_requested_on_the_ground() {
    for armed in [false, true] {
        assert_eq!(fly(|_, quad, _| (quad.height, quad.armed) = (0.0, armed)).story(), "");
    }
}

#[test]
fn a_box_that_restarts_in_the_air_protects_at_once() {
    let outcome = fly(|_, quad, _| {
        (quad.start_height, quad.height) = (50.0, 50.0);
        quad.battery.remaining = Some(Fraction(0.05));
    });
    assert!(matches!(outcome.announced_ms()[..], [0..4_000]), "{:?}", outcome.steps);
}

#[test]
fn a_vehicle_that_is_disarmed_while_it_is_asked_is_not_asked_again() {
    let outcome = fly(|now_ms, quad, _| quad.armed = now_ms < ASKED_MS + 500);
    assert_eq!(outcome.story(), "announced, asked, cancelled_on_ground");
}

#[test]
fn a_battery_that_is_well_and_empty_again_is_announced_again() {
    let outcome = fly(|now_ms, quad, _| {
        if (FOUND_MS + 3_000..FOUND_MS + 8_000).contains(&now_ms) {
            quad.battery.remaining = Some(Fraction(0.5));
        }
    });
    let story = outcome.story();
    assert!(story.starts_with("announced, cancelled_clear, announced, asked"), "{story}");
}

#[test]
fn only_the_chosen_subsystem_counts() {
    let mut chosen = params(Action::Return);
    chosen.set("PROT_CHECK", 4.0).unwrap();
    assert_eq!(fly_with(&chosen, |_, _, _| {}).story(), "");
    let vibration = fly_with(&chosen, |now_ms, quad, _| {
        if now_ms >= EMPTY_MS {
            quad.vibration.levels[0] = Some(70.0);
        }
    });
    assert_eq!(
        (vibration.announced_ms(), vibration.story()),
        (vec![EMPTY_MS + 1_000], UNANSWERED.to_owned())
    );
}

#[test]
fn a_wrong_landed_state_delays_the_action_by_no_more_than_it_lasts() {
    for height in [3.0, 20.0, 300.0, -15.0] {
        for from_ms in [FOUND_MS - 3_000, FOUND_MS - 500, FOUND_MS + 4_000, ASKED_MS - 500] {
            for lasts_ms in [500, 2_000, 4_000] {
                // The vehicle flies again 0.6 s after its autopilot's report, which comes twice a second.
                let late_ms = lasts_ms + 1_200;
                all_are_asked(ASKED_MS, late_ms, &(height, from_ms, lasts_ms), |now_ms, quad, _| {
                    quad.height = height;
                    if (from_ms..from_ms + lasts_ms).contains(&now_ms) {
                        quad.landed = Some(LandedState::OnGround);
                    }
                });
            }
        }
    }
}

#[test]
fn a_touch_and_go_pauses_the_countdown() {
    all_are_asked(ASKED_MS + 4_000, 2_000, &"touch and go", |now_ms, quad, _| {
        if (FOUND_MS + 4_000..FOUND_MS + 8_000).contains(&now_ms) {
            (quad.landed, quad.height, quad.throttle) = (Some(LandedState::OnGround), 0.0, 0.05);
        }
    });
}

#[test]
fn a_sink_that_ends_in_the_air_is_no_landing() {
    // Height at its start, and sink rate for four seconds as the battery turns critical. Within 3 m of the take-off
    // height it may be a landing, for 15 s.
    for (height, sink, late_ms) in [
        (-10.0, 0.6, 100),
        (-30.0, 0.6, 100),
        (-30.0, 2.0, 100),
        (-200.0, 1.5, 100),
        (60.0, 1.5, 100),
        (4.0, 0.6, 18_000),
        (1.0, 0.5, 18_000),
    ] {
        all_are_asked(ASKED_MS, late_ms, &(height, sink), |now_ms, quad, _| {
            let sunk_ms = now_ms.clamp(FOUND_MS - 2_000, FOUND_MS + 2_000) - (FOUND_MS - 2_000);
            quad.climb = if (1..4_000).contains(&sunk_ms) { -sink } else { 0.0 };
            quad.height = height - sink * sunk_ms as f32 / 1_000.0;
        });
    }
}

#[test]
fn a_tumble_that_is_survived_pauses_the_countdown() {
    for from_ms in [FOUND_MS - 1_000, FOUND_MS + 3_000, ASKED_MS - 200] {
        for lasts_ms in [600, 800, 1_200] {
            for load_g in [0.5_f32, 1.0, 5.0] {
                let outcome = fly(|now_ms, quad, monitor| {
                    become_vehicle(now_ms, quad, (ArduPilot, Rotorcraft, 4));
                    let tumbles = (from_ms..from_ms + lasts_ms).contains(&now_ms);
                    let force = if tumbles { load_g } else { 1.0 + (now_ms % 7) as f32 * 0.002 };
                    quad.acceleration_down = -9.806_65 * force;
                    let imu = Imu {
                        acceleration: Some([0.0, 0.0, quad.acceleration_down].map(MetresPerSecond2)),
                        rate: Some([if tumbles { 6.2 } else { 0.01 }, 0.0, 0.0].map(RadiansPerSecond)),
                        ..Imu::default()
                    };
                    say(now_ms, monitor, now_ms, AUTOPILOT, Observation::Imu(imu));
                });
                let first_ms = outcome.requests.first().map_or(0, |(at_ms, _)| *at_ms);
                let in_time = ASKED_MS..=ASKED_MS + lasts_ms + 6_000;
                assert!(in_time.contains(&first_ms), "{from_ms} {lasts_ms} {load_g}: {:?}", outcome.steps);
            }
        }
    }
}

#[test]
fn the_autopilots_own_change_of_mode_is_announced_anew() {
    const CHANGED_MS: u64 = FOUND_MS + 4_000;
    let text = Observation::Alert(Alert { cause: Cause::RemoteControl, urgency: Urgency::Warning });
    // A mode that a failsafe enters and a pilot could too: PX4's ALTCTL, ArduCopter's ALT_HOLD, ArduPlane's FBWA. The autopilot speaks
    // before or after the change, by a text or by its state; a pilot changes the mode afterwards, or not.
    for (autopilot, kind, before, after) in
        [(Px4, Rotorcraft, POSCTL, ALTCTL), (ArduPilot, Rotorcraft, 5, 2), (ArduPilot, Plane, 12, 5)]
    {
        for (spoken_ms, lead) in [
            (CHANGED_MS - 1_500, "announced"),
            (CHANGED_MS, "announced"),
            (CHANGED_MS + 1_500, "announced, cancelled_by_mode"),
        ] {
            for (by_text, pilot) in [(true, true), (true, false), (false, true), (false, false)] {
                let outcome = fly(|now_ms, quad, monitor| {
                    let pilots_ms = if pilot { CHANGED_MS + 6_000 } else { u64::MAX };
                    let mode = if (CHANGED_MS..pilots_ms).contains(&now_ms) { after } else { before };
                    become_vehicle(now_ms, quad, (autopilot, kind, mode));
                    say(now_ms, monitor, if by_text { spoken_ms } else { u64::MAX }, AUTOPILOT, text);
                    quad.state = if !by_text && now_ms >= spoken_ms { 5 } else { 4 };
                });
                let end = if pilot { "announced, cancelled_by_mode" } else { UNANSWERED };
                let what = (autopilot, kind, spoken_ms, by_text);
                assert_eq!(outcome.story(), format!("{lead}, {end}"), "{what:?}");
            }
        }
    }
    // A failsafe that began long before does not tell who changed the mode.
    let outcome = fly(|now_ms, quad, _| {
        quad.state = if now_ms < FOUND_MS { 4 } else { 5 };
        quad.mode = if now_ms < CHANGED_MS { 4 } else { 5 };
    });
    assert_eq!(outcome.story(), "announced, cancelled_by_mode");
}

#[test]
fn a_mode_in_which_failsafes_wait_is_no_cancel() {
    for (autopilot, kind, before, waits) in [
        (Px4, Rotorcraft, POSCTL, HOLD),
        (Px4, Plane, ALTCTL, HOLD),
        (ArduPilot, Rotorcraft, 5, 17),
        (ArduPilot, Plane, 5, 1),
    ] {
        for (pilots_ms, end) in [(30_000, "announced, cancelled_by_mode"), (u64::MAX, UNANSWERED)] {
            let outcome = fly(|now_ms, quad, _| {
                let mode = if (26_000..pilots_ms).contains(&now_ms) { waits } else { before };
                become_vehicle(now_ms, quad, (autopilot, kind, mode));
            });
            assert_eq!(outcome.story(), format!("announced, {end}"), "{autopilot:?} {kind:?}");
        }
    }
}

#[test]
fn a_return_that_the_autopilot_gives_up_is_announced_anew() {
    let text = Observation::Alert(Alert { cause: Cause::Gnss, urgency: Urgency::Warning });
    for (spoken_ms, end) in [(30_000, UNANSWERED), (u64::MAX, "cancelled_by_mode")] {
        let outcome = fly(|now_ms, quad, monitor| {
            quad.mode = if (15_000..30_000).contains(&now_ms) { 6 } else { 2 };
            say(now_ms, monitor, spoken_ms, AUTOPILOT, text);
        });
        assert_eq!(outcome.story(), format!("already_done, {end}"));
    }
}

#[test]
fn a_pilot_who_changes_the_mode_while_it_is_asked_is_not_asked_against() {
    let outcome = fly(|now_ms, quad, _| quad.mode = if now_ms < ASKED_MS + 500 { 4 } else { 5 });
    assert_eq!(outcome.story(), "announced, asked, cancelled_by_mode");
}

/// Disturbances of a flight, each for a while, one after the other, until 35 s; a number chooses them.
fn disturb(seed: u64, now_ms: u64, quad: &mut Quad, monitor: &mut Monitor) {
    // The high bits of a multiplication by the golden ratio are as good as random.
    let random = |of: u64| (seed * 64 + of).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
    let slot = now_ms / 2_500;
    if !(6..14).contains(&slot) || now_ms % 2_500 > 500 + random(slot) % 1_800 {
        return;
    }
    match random(slot + 32) % 6 {
        0 => quad.landed = Some(LandedState::OnGround),
        1 => (quad.height, quad.climb) = (2.0, -0.8),
        2 => quad.silent = true,
        3 => (quad.height, quad.climb) = (-20.0, -2.0),
        4 => quad.battery.remaining = Some(Fraction(0.6)),
        _ => {
            let imu = Imu { rate: Some([7.0, 0.0, 0.0].map(RadiansPerSecond)), ..Imu::default() };
            say(now_ms, monitor, now_ms, AUTOPILOT, Observation::Imu(imu));
        }
    }
}

#[test]
fn whatever_disturbs_a_flight_the_action_comes_unless_the_pilot_cancels() {
    for seed in 0..60 {
        let vehicle = VEHICLES[seed as usize % VEHICLES.len()];
        for (pilots_ms, is_asked) in [(u64::MAX, true), (FOUND_MS + 5_000, false)] {
            let outcome = fly(|now_ms, quad, monitor| {
                become_vehicle(now_ms, quad, vehicle);
                if is_asked || now_ms >= pilots_ms {
                    disturb(seed, now_ms, quad, monitor);
                }
                quad.mode += u32::from(now_ms >= pilots_ms);
            });
            assert_eq!(!outcome.requests.is_empty(), is_asked, "{seed} {vehicle:?}: {:?}", outcome.steps);
        }
    }
}

#[test]
fn single_messages_of_a_sink_do_not_hold_the_action_off() {
    for (vehicle, height, sink) in [
        ((ArduPilot, Plane, 10), 35.0, 0.6),
        ((Px4, Rotorcraft, MISSION), 35.0, 0.6),
        ((ArduPilot, Rotorcraft, 5), 2.5, 0.4),
    ] {
        for every_ms in [3_000, 10_000] {
            for by_word in [false, true] {
                let outcome = fly(|now_ms, quad, _| {
                    become_vehicle(now_ms, quad, vehicle);
                    let shows = now_ms > 2_000 && now_ms.is_multiple_of(every_ms);
                    (quad.height, quad.climb) = (height, if shows && !by_word { -sink } else { 0.01 });
                    if shows && by_word {
                        quad.landed = Some(LandedState::Landing);
                    }
                });
                let first_ms = outcome.requests.first().map_or(0, |(at_ms, _)| *at_ms);
                let what = (vehicle, every_ms, by_word);
                assert!((ASKED_MS..ASKED_MS + 6_000).contains(&first_ms), "{what:?}: {:?}", outcome.steps);
                assert_eq!(outcome.story(), UNANSWERED, "{what:?}");
            }
        }
    }
}

#[test]
fn a_battery_that_falls_silent_keeps_the_countdown() {
    let mut slow = params(Action::Return);
    slow.set("PROT_DELAY", 15.0).unwrap();
    // The battery alone or the whole link, until the end or for 14 s.
    for (alone, until_ms) in [(true, u64::MAX), (true, 36_500), (false, 36_500)] {
        let outcome = fly_with(&slow, |now_ms, quad, _| {
            let silent = (FOUND_MS + 500..until_ms).contains(&now_ms);
            (quad.silent, quad.battery_silent) = (silent && !alone, silent && alone);
        });
        assert_eq!(outcome.story(), UNANSWERED, "{alone} {until_ms}");
        assert_eq!(outcome.requests[0].0, ASKED_MS + 5_000, "{alone} {until_ms}");
    }
}

#[test]
fn an_accepted_return_that_the_mode_does_not_show_is_announced_anew() {
    for (autopilot, is_known) in [(ArduPilot, true), (Px4, true), (Autopilot::Other, false)] {
        let outcome = fly(|now_ms, quad, monitor| {
            become_vehicle(now_ms, quad, (autopilot, Rotorcraft, 4));
            ack(now_ms, monitor, ASKED_MS + 300, 20, 0);
        });
        let end = if is_known { format!(", {UNANSWERED}") } else { String::new() };
        assert_eq!(outcome.story(), format!("announced, asked, accepted{end}"), "{autopilot:?}");
        let announced = outcome.announced_ms();
        let again_ms = announced.get(1).map(|again_ms| again_ms - ASKED_MS);
        assert_eq!(again_ms.map(|ms| ms / 100), is_known.then_some(54), "{announced:?}");
    }
}

#[test]
fn what_the_pilot_cancelled_stays_so_after_a_fall_and_a_silence() {
    for silent_ms in [5_800, 17_000] {
        let outcome = fly(|now_ms, quad, _| {
            let mode = if now_ms < FOUND_MS + 3_000 { 4 } else { 5 };
            become_vehicle(now_ms, quad, (ArduPilot, Rotorcraft, mode));
            if (30_000..30_700).contains(&now_ms) {
                quad.acceleration_down = -0.5 - (now_ms / 100 % 7) as f32 * 0.01;
            }
            quad.silent = (30_700..30_700 + silent_ms).contains(&now_ms);
        });
        assert_eq!(outcome.story(), "announced, cancelled_by_mode", "{silent_ms}");
    }
}

#[test]
fn a_bad_inertial_sensor_does_not_hold_the_action_off() {
    for falls in [true, false] {
        let outcome = fly(|now_ms, quad, monitor| {
            become_vehicle(now_ms, quad, (ArduPilot, Rotorcraft, 5));
            quad.climb = 0.0;
            let bad = now_ms >= 10_000;
            quad.acceleration_down =
                if bad && falls { -0.5 } else { -9.8 } - (now_ms / 100 % 7) as f32 * 0.01;
            let imu = Imu {
                acceleration: Some([0.0, 0.0, quad.acceleration_down].map(MetresPerSecond2)),
                rate: Some([if bad && !falls { 7.0 } else { 0.01 }, 0.0, 0.0].map(RadiansPerSecond)),
                ..Imu::default()
            };
            say(now_ms, monitor, now_ms, AUTOPILOT, Observation::Imu(imu));
        });
        assert_eq!(
            (outcome.story(), outcome.announced_ms()),
            (UNANSWERED.to_owned(), vec![FOUND_MS]),
            "{falls}"
        );
    }
}

#[test]
fn a_hover_with_little_throttle_is_protected() {
    for throttle in [0.09, 0.06] {
        for is_seen_on_ground in [true, false] {
            for vehicle in [(ArduPilot, Rotorcraft, 5), (Px4, Rotorcraft, POSCTL)] {
                let outcome = fly(|now_ms, quad, _| {
                    become_vehicle(if is_seen_on_ground { now_ms } else { 2_000 }, quad, vehicle);
                    quad.throttle = throttle;
                    if !is_seen_on_ground {
                        quad.start_height = quad.height;
                    }
                });
                let what = (throttle, is_seen_on_ground, vehicle);
                assert_eq!(outcome.story(), UNANSWERED, "{what:?}: {:?}", outcome.steps);
                assert_eq!(outcome.announced_ms(), [FOUND_MS], "{what:?}");
            }
        }
    }
}
