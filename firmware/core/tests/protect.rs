//! The protective action, scripted: when it is requested, and all reasons against it.

use crate::common::{self, AUTOPILOT, Quad, Run, Said, Script, observe, rows};
use hums_core::Monitor;
use hums_core::cause::{Alert, Cause};
use hums_core::happening::Happening;
use hums_core::observation::{Battery, CommandAck, Feeds, Imu, Observation, Source};
use hums_core::parameters::Params;
use hums_core::protect::{Action, Request, Stage, Step};
use hums_core::time::BootMs;
use hums_core::units::{Fraction, MetresPerSecond2, RadiansPerSecond};

const FOUND_MS: u64 = 22_000;
const ASKED_MS: u64 = FOUND_MS + 10_000;
/// No answer comes.
const UNANSWERED: &str = "announced, asked, asked, asked, unanswered";
const SENT: &str = "0-2 landed=ground; 2 landed=air; ";
const VEHICLES: [&str; 5] = [
    "* ap quad mode=4; ",
    "* ap plane mode=5; ",
    "* ap vtol mode=5; ",
    "* px4 quad mode=posctl; ",
    "* px4 plane mode=posctl; ",
];

struct Outcome {
    steps: Vec<(u64, Step)>,
    requests: Vec<(u64, Request)>,
}

impl Outcome {
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

    fn first_ms(&self) -> u64 {
        self.requests.first().map_or(0, |(at_ms, _)| *at_ms)
    }
}

fn params(action: Action, more: &[(&str, f32)]) -> Params {
    common::params(&[&[("PROT_ACTION", f32::from(action as u8))], more].concat())
}

fn fly(script: &str) -> Outcome {
    fly_with(&params(Action::Return, &[]), script)
}

fn fly_with(params: &Params, script: &str) -> Outcome {
    let (mut run, script) = (Run::new(params), Script::new(&format!("20 rem=0.05; {script}")));
    run.steps(0..60_000, |now_ms, monitor| {
        let mut quad = Quad::healthy();
        script.play(now_ms as i64, |said| {
            assert!(quad.take(said) || take(said, now_ms, &mut quad, monitor), "{}: no word", said.name());
        });
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

/// Answers (command, result, and whom to), alerts, a mission's end, a pilot's command, forces (g) and rates, and batteries (system,
/// component, number, consumer) that are empty.
fn take(said: &Said<'_>, now_ms: u64, quad: &mut Quad, monitor: &mut Monitor) -> bool {
    let mut source = AUTOPILOT;
    let observation = match said.name() {
        "ack" => {
            let [command, result] = said.list();
            let target = match said.more(2) {
                [system, component] => Some(Source { system: *system as u8, component: *component as u8 }),
                _ => None,
            };
            Observation::CommandAck(CommandAck { command: command as u16, result: result as u8, target })
        }
        "alert" => Observation::Alert(Alert::warning(match said.text() {
            "rc" => Cause::RemoteControl,
            _ => Cause::Gnss,
        })),
        "reached" => Observation::MissionReached(12),
        "cancel" | "nothing" => {
            assert_eq!(monitor.cancel_protection(), said.name() == "cancel");
            return true;
        }
        "imu" => {
            let [load_g, rate] = said.list();
            quad.acceleration_down = -9.806_65 * (load_g + (now_ms / 50 % 7) as f32 * 0.002);
            Observation::Imu(Imu {
                acceleration: Some([0.0, 0.0, quad.acceleration_down].map(MetresPerSecond2)),
                rate: Some([rate, 0.0, 0.0].map(RadiansPerSecond)),
                ..Imu::default()
            })
        }
        "battery" => {
            let [system, component, id, of] = said.list().map(|number: f32| number as u8);
            source = Source { system, component };
            let feeds = if of == 1 { Feeds::Payload } else { Feeds::Unsaid };
            Observation::Battery(Battery { id, feeds, remaining: Some(Fraction(0.05)), ..Battery::default() })
        }
        _ => return false,
    };
    monitor.observe(BootMs::from_millis(now_ms), source, &observation);
    true
}

fn all_are_asked(at_ms: u64, late_ms: u64, script: &str) {
    for vehicle in VEHICLES {
        let outcome = fly(&format!("{vehicle}{SENT}{script}"));
        let first = outcome.requests.first().map(|(asked_ms, request)| (*asked_ms, request.command));
        let is_in_time =
            matches!(first, Some((asked_ms, 20)) if (at_ms..=at_ms + late_ms).contains(&asked_ms));
        assert!(is_in_time, "{vehicle}{script}: {:?}", outcome.steps);
    }
}

#[test]
fn the_action_is_off_by_default() {
    let outcome = fly_with(&Params::defaults(), "");
    assert!(outcome.steps.is_empty() && outcome.requests.is_empty());
}

#[test]
fn an_empty_battery_is_announced_counted_down_and_requested() {
    let outcome = fly("@32.3 ack=20,0; 32.35 mode=21");
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
    let outcome = fly_with(&params(Action::Land, &[]), "");
    let asked =
        |number: u8| (ASKED_MS + 1_000 * u64::from(number), Request { command: 21, confirmation: number });
    assert_eq!(outcome.requests, [0, 1, 2].map(asked));
    assert_eq!(outcome.story(), UNANSWERED);
}

/// A flight, its outcome (`unanswered`: [`UNANSWERED`]), and its script.
const STORIES: &str = "
an answer to another command | unanswered | @32.3 ack=21,0
an answer before the request | unanswered | @31 ack=20,0
an answer to a ground station | unanswered | @32.3 ack=20,0,255,190
an answer to us | announced, asked, accepted | @32.3 ack=20,0,1,191; 32.35 mode=21
an answer after the second request | announced, asked, asked, accepted | @33.7 ack=20,0,1,191; 33.75 mode=21
an answer in progress | announced, asked, accepted | @32.3 ack=20,5; @38 ack=20,0; 38.05 mode=21
a lost answer shows in the mode | announced, asked, already_done | 32.5 mode=6
a mission's landing by the landed state | already_done | * px4 mode=mission landed=landing
that of ArduCopter | already_done | * mode=3 landed=landing
the pilot's own landing, close to the ground | already_done | * h=2.5 c=-0.6
PX4's precision landing | already_done | * px4 mode=precland
a pilot who takes over from an accepted return | announced, asked, accepted, cancelled_by_mode | @32.3 ack=20,0; 32.5-37 mode=6
a silent link | unanswered | 25-28 silent
another mode | announced, cancelled_by_mode | 26 mode=5
the pilot's own return | announced, already_done | 26 mode=6
the pilot's command | announced, cancelled_by_command | @20 nothing; @26 cancel
disarming | announced, cancelled_on_ground | 26 off h=0
disarming while it is asked | announced, asked, cancelled_on_ground | 32.5 off
another mode while it is asked | announced, asked, cancelled_by_mode | 32.5 mode=5
a rover that is called flying | - | * px4 rover landed=air
a boat | - | * px4 boat landed=air
a submarine | - | * px4 submarine landed=air
on the ground, disarmed | - | * h=0 off
on the ground, armed | - | * h=0
a payload's battery | - | * rem=0.8 battery=1,181,0,1
a gimbal's battery | - | * rem=0.8 battery=1,154,3,0
a battery's own component | unanswered | * rem=0.8 battery=1,180,3,0
a second one | unanswered | * rem=0.8 battery=1,181,3,0
the autopilot's second battery | unanswered | * rem=0.8 battery=1,1,3,0
another vehicle's battery | - | * rem=0.8 battery=2,1,0,0
a failsafe that began long before a change of mode | announced, cancelled_by_mode | 22 state=5; 26 mode=5
a return that the autopilot gives up | already_done, announced, asked, asked, asked, unanswered | * mode=2; 15-30 mode=6; @30 alert=gnss
a return that the pilot gives up | already_done, cancelled_by_mode | * mode=2; 15-30 mode=6
a mission far below home that goes lower | unanswered | * ap plane mode=10; 0-2 landed=ground; 2 landed=air; 0-60 h=-50..-110 c=-1
";

#[test]
fn each_flight_has_its_story() {
    for [what, story, script] in rows(STORIES) {
        let story = if story == "unanswered" { UNANSWERED } else { story };
        assert_eq!(fly(script).story(), story, "{what}");
    }
}

#[test]
fn a_refused_return_is_followed_by_a_landing_only_on_rotors() {
    let lands = "announced, asked, refused, land asked, land accepted";
    let ends = "announced, asked, refused";
    for (kind, story) in [
        ("quad", lands),
        ("plane", ends),
        ("vtol", ends),
        ("vtol hover", lands),
        ("vtol forward", ends),
        ("vtol transition", ends),
    ] {
        let outcome = fly(&format!("* {kind}; {SENT}@32.3 ack=20,4; @32.7 ack=21,0; 32.75 mode=21"));
        assert_eq!(outcome.story(), story, "{kind}");
    }
}

#[test]
fn a_landing_in_a_mission_is_left_alone() {
    for (vehicle, is_told) in [
        ("ap plane mode=10", true),
        ("ap vtol mode=10", true),
        ("px4 plane mode=mission", true),
        ("px4 quad mode=mission", true),
        ("ap plane mode=5", false),
        ("ap quad mode=3", false),
    ] {
        let outcome = fly(&format!("* {vehicle} h=80 c=0; {SENT}4-55.4 h=80..2.9 c=-1.5; 55.4 h=2 c=-0.2"));
        let story = if is_told { "announced, already_done" } else { UNANSWERED };
        assert_eq!(outcome.story(), story, "{vehicle}");
        let at_ms = outcome.steps.last().unwrap().0;
        assert!(!is_told || (32_600..32_900).contains(&at_ms), "{vehicle}: {at_ms}");
    }
}

#[test]
fn a_mission_that_goes_lower_is_announced_once_it_flies_on() {
    let outcome = fly(&format!("* ap plane mode=10; {SENT}0-30 h=35 c=-1; 30 h=20 c=0"));
    assert_eq!(outcome.story(), format!("already_done, {UNANSWERED}"));
    assert!(matches!(outcome.announced_ms()[..], [44_900..45_300]), "{:?}", outcome.steps);
}

#[test]
fn the_end_of_a_mission_is_no_cancel() {
    for (vehicle, mission, after, is_waiting) in [
        ("px4 quad", "mission", "hold", true),
        ("px4 plane", "mission", "hold", true),
        ("ap plane", "10", "12", false),
        ("ap quad", "3", "5", false),
        ("ap quad", "3", "17", true),
    ] {
        for reached in ["@26 reached", ""] {
            let outcome = fly(&format!("* {vehicle} mode={mission}; {SENT}27 mode={after}; {reached}"));
            let end = if is_waiting || !reached.is_empty() { UNANSWERED } else { "cancelled_by_mode" };
            assert_eq!(outcome.story(), format!("announced, {end}"), "{vehicle} {after} {reached}");
        }
    }
}

#[test]
fn one_cancel_holds_for_the_flight_and_not_for_the_next_one() {
    let outcome = fly("@25 cancel; 27-30 rem=0.5; 36-42 h=0; 38-40 off");
    let announced = outcome.announced_ms();
    assert!(matches!(announced[..], [FOUND_MS, 42_000..44_000]), "{announced:?}");
}

#[test]
fn one_wrong_message_of_a_battery_is_no_cause() {
    let at_once = params(Action::Land, &[("PROT_DELAY", 0.0)]);
    assert_eq!(fly_with(&at_once, "* rem=0.8; @20 rem=0").story(), "");
}

#[test]
fn a_box_that_restarts_in_the_air_protects_at_once() {
    let outcome = fly("* start=50 h=50 rem=0.05");
    assert!(matches!(outcome.announced_ms()[..], [0..4_000]), "{:?}", outcome.steps);
}

#[test]
fn a_battery_that_is_well_and_empty_again_is_announced_again() {
    let story = fly("25-30 rem=0.5").story();
    assert!(story.starts_with("announced, cancelled_clear, announced, asked"), "{story}");
}

#[test]
fn only_the_chosen_subsystem_counts() {
    let chosen = params(Action::Return, &[("PROT_CHECK", 4.0)]);
    assert_eq!(fly_with(&chosen, "").story(), "");
    let vibration = fly_with(&chosen, "20 vibe=70,5,5");
    assert_eq!((vibration.announced_ms(), vibration.story()), (vec![21_000], UNANSWERED.to_owned()));
}

#[test]
fn a_wrong_landed_state_delays_the_action_by_no_more_than_it_lasts() {
    for height in [3.0, 20.0, 300.0, -15.0] {
        for from_s in [19.0, 21.5, 26.0, 31.5] {
            for lasts_s in [0.5, 2.0, 4.0] {
                let late_ms = (lasts_s * 1_000.0) as u64 + 1_200;
                let script = format!("* h={height}; {from_s}-{} landed=ground", from_s + lasts_s);
                all_are_asked(ASKED_MS, late_ms, &script);
            }
        }
    }
}

#[test]
fn a_touch_and_go_pauses_the_countdown() {
    all_are_asked(ASKED_MS + 4_000, 2_000, "26-30 landed=ground h=0 thr=0.05");
}

#[test]
fn a_sink_that_ends_in_the_air_is_no_landing() {
    for (height, sink, late_ms) in [
        (-10.0, 0.6, 100),
        (-30.0, 0.6, 100),
        (-30.0, 2.0, 100),
        (-200.0, 1.5, 100),
        (60.0, 1.5, 100),
        (4.0, 0.6, 18_000),
        (1.0, 0.5, 18_000),
    ] {
        let end = height - 4.0 * sink;
        let script = format!("* h={height} c=0; 20.05-24 c=-{sink}; 20-24 h={height}..{end}; 24 h={end}");
        all_are_asked(ASKED_MS, late_ms, &script);
    }
}

#[test]
fn a_tumble_that_is_survived_pauses_the_countdown() {
    for from_s in [21.0, 25.0, 31.8] {
        for lasts_s in [0.6, 0.8, 1.2] {
            for load_g in [0.5, 1.0, 5.0] {
                let until_s = from_s + lasts_s;
                let script = format!("* imu=1,0.01; {SENT}{from_s}-{until_s} imu={load_g},6.2");
                let outcome = fly(&script);
                let in_time = ASKED_MS..=ASKED_MS + (lasts_s * 1_000.0) as u64 + 6_000;
                assert!(in_time.contains(&outcome.first_ms()), "{script}: {:?}", outcome.steps);
            }
        }
    }
}

#[test]
fn the_autopilots_own_change_of_mode_is_announced_anew() {
    // A mode that a failsafe enters and a pilot could too: PX4's ALTCTL, ArduCopter's ALT_HOLD, ArduPlane's FBWA. The autopilot speaks
    // before or after the change, by a text or by its state; a pilot changes the mode afterwards, or not.
    for (vehicle, before, after) in
        [("px4 quad", "posctl", "altctl"), ("ap quad", "5", "2"), ("ap plane", "12", "5")]
    {
        for (spoken_s, lead) in
            [("24.5", "announced"), ("26", "announced"), ("27.5", "announced, cancelled_by_mode")]
        {
            for speaks in [format!("@{spoken_s} alert=rc"), format!("{spoken_s} state=5")] {
                for (pilots, end) in [
                    (format!("32 mode={before}"), "announced, cancelled_by_mode"),
                    (String::new(), UNANSWERED),
                ] {
                    let script =
                        format!("* {vehicle} mode={before}; {SENT}26 mode={after}; {speaks}; {pilots}");
                    assert_eq!(fly(&script).story(), format!("{lead}, {end}"), "{script}");
                }
            }
        }
    }
}

#[test]
fn a_mode_in_which_failsafes_wait_is_no_cancel() {
    for (vehicle, before, waits) in [
        ("px4 quad", "posctl", "hold"),
        ("px4 plane", "altctl", "hold"),
        ("ap quad", "5", "17"),
        ("ap plane", "5", "1"),
    ] {
        for (until, end) in [("-30", "announced, cancelled_by_mode"), ("", UNANSWERED)] {
            let outcome = fly(&format!("* {vehicle} mode={before}; {SENT}26{until} mode={waits}"));
            assert_eq!(outcome.story(), format!("announced, {end}"), "{vehicle}");
        }
    }
}

fn disturbances(seed: u64, from_ms: u64) -> String {
    let random = |of: u64| (seed * 64 + of).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
    let pieces = (6..14_u64).filter_map(|slot| {
        let (begins_ms, ends_ms) = (2_500 * slot, 2_500 * slot + 500 + random(slot) % 1_800);
        let words = ["landed=ground", "h=2 c=-0.8", "silent", "h=-20 c=-2", "rem=0.6", "imu=1,7"];
        let word = words[(random(slot + 32) % 6) as usize];
        let seconds = |ms: u64| ms.max(from_ms) as f64 / 1_000.0;
        (ends_ms > from_ms).then(|| format!("{}-{} {word}; ", seconds(begins_ms), seconds(ends_ms)))
    });
    pieces.collect()
}

#[test]
fn whatever_disturbs_a_flight_the_action_comes_unless_the_pilot_cancels() {
    for seed in 0..60 {
        let vehicle = VEHICLES[seed as usize % VEHICLES.len()];
        for (pilots, from_ms, is_asked) in [("", 0, true), ("27 mode=2", 27_000, false)] {
            let script = format!("{vehicle}{SENT}{}{pilots}", disturbances(seed, from_ms));
            let outcome = fly(&script);
            assert_eq!(!outcome.requests.is_empty(), is_asked, "{script}: {:?}", outcome.steps);
        }
    }
}

#[test]
fn single_messages_of_a_sink_do_not_hold_the_action_off() {
    for (vehicle, height, sink) in [
        ("ap plane mode=10", 35.0, "c=-0.6"),
        ("px4 quad mode=mission", 35.0, "c=-0.6"),
        ("ap quad mode=5", 2.5, "c=-0.4"),
    ] {
        for every_s in [3, 10] {
            for shows in [sink, "landed=landing"] {
                let script = format!("* {vehicle} h={height} c=0.01; {SENT}3%{every_s}:0-0.05 {shows}");
                let outcome = fly(&script);
                let in_time = ASKED_MS..ASKED_MS + 6_000;
                assert!(in_time.contains(&outcome.first_ms()), "{script}: {:?}", outcome.steps);
                assert_eq!(outcome.story(), UNANSWERED, "{script}");
            }
        }
    }
}

#[test]
fn a_battery_that_falls_silent_keeps_the_countdown() {
    // The battery alone or the whole link, until the end or for 14 s.
    let slow = params(Action::Return, &[("PROT_DELAY", 15.0)]);
    for script in ["22.5 mute", "22.5-36.5 mute", "22.5-36.5 silent"] {
        let outcome = fly_with(&slow, script);
        assert_eq!(
            (outcome.story().as_str(), outcome.first_ms()),
            (UNANSWERED, ASKED_MS + 5_000),
            "{script}"
        );
    }
}

#[test]
fn an_accepted_return_that_the_mode_does_not_show_is_announced_anew() {
    for (autopilot, is_known) in [("ap", true), ("px4", true), ("other", false)] {
        let outcome = fly(&format!("* {autopilot}; {SENT}@32.3 ack=20,0"));
        let end = if is_known { format!(", {UNANSWERED}") } else { String::new() };
        assert_eq!(outcome.story(), format!("announced, asked, accepted{end}"), "{autopilot}");
        let announced = outcome.announced_ms();
        let again_ms = announced.get(1).map(|again_ms| again_ms - ASKED_MS);
        assert_eq!(again_ms.map(|ms| ms / 100), is_known.then_some(54), "{announced:?}");
    }
}

#[test]
fn what_the_pilot_cancelled_stays_so_after_a_fall_and_a_silence() {
    for until_s in ["36.5", "47.7"] {
        let outcome = fly(&format!("{SENT}25 mode=5; 30-30.7 imu=0.05,0.01; 30.7-{until_s} silent"));
        assert_eq!(outcome.story(), "announced, cancelled_by_mode", "{until_s}");
    }
}

#[test]
fn a_bad_inertial_sensor_does_not_hold_the_action_off() {
    for bad in ["imu=0.05,0.01", "imu=1,7"] {
        let outcome = fly(&format!("* mode=5 c=0; {SENT}0-10 imu=1,0.01; 10 {bad}"));
        assert_eq!((outcome.story().as_str(), outcome.announced_ms()), (UNANSWERED, vec![FOUND_MS]), "{bad}");
    }
}

#[test]
fn a_hover_with_little_throttle_is_protected() {
    for throttle in [0.09, 0.06] {
        for seen in [SENT, "* landed=air start=20; "] {
            for vehicle in ["ap quad mode=5", "px4 quad mode=posctl"] {
                let script = format!("* {vehicle} thr={throttle}; {seen}");
                let outcome = fly(&script);
                assert_eq!(outcome.story(), UNANSWERED, "{script}: {:?}", outcome.steps);
                assert_eq!(outcome.announced_ms(), [FOUND_MS], "{script}");
            }
        }
    }
}
