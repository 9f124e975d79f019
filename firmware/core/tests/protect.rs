//! The protective action, scripted: when it is asked for, and everything that keeps it from being asked for.
#![expect(clippy::unwrap_used, reason = "that is how a test fails")]

mod common;

use common::{AUTOPILOT, Quad};
use hums_core::Monitor;
use hums_core::happening::Happening;
use hums_core::observation::{CommandAck, Observation};
use hums_core::params::Params;
use hums_core::protect::{Action, Request, Stage};
use hums_core::status::LinkReading;
use hums_core::time::Instant;
use hums_core::units::Fraction;

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
                assert_eq!(
                    Some(step.action),
                    Action::from_number(params.get(hums_core::params::Param::ProtAction) as u8)
                );
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
            let ack = Observation::CommandAck(CommandAck { command: 20, result });
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

#[test]
fn a_refusal_is_an_answer() {
    let outcome = fly(&params(Action::Return), answer(FOUND_MS + 10_300, 4));
    assert_eq!(outcome.steps.last(), Some(&(FOUND_MS + 10_300, Stage::Answered, 4)));
    assert_eq!(outcome.requests.len(), 1);
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
