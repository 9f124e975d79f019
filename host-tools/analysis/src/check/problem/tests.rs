//! Problems from findings made by hand.

use super::*;

pub(in crate::check) fn change(at_s: u64, level: Level, value: f32) -> Finding {
    Finding {
        at: Instant::from_millis(at_s * 1000),
        subsystem: Subsystem::Power,
        check: "cell_voltage".to_owned(),
        instance: 0,
        level,
        previous: Level::Ok,
        value,
        worst: None,
        limit: if level == Level::Critical { 3.5 } else { 3.6 },
        unit: "V".to_owned(),
    }
}

#[test]
fn what_a_box_found_to_lie_still_hit_something_before_and_in_a_mishap_that_goes_on_just_then() {
    let at = Instant::from_millis(90_000);
    assert_eq!(began(IMPACT, at, std::iter::empty()), Instant::from_millis(89_000));
    let open = [(Instant::from_millis(89_500), "tumbling"), (at, IMPACT)];
    assert_eq!(began(IMPACT, at, open.into_iter()), at);
    let open = [(Instant::from_millis(89_500), "pitch_rate"), (at, IMPACT)];
    assert_eq!(began(IMPACT, at, open.into_iter()), Instant::from_millis(89_000));
    assert_eq!(began("pitch_rate", at, std::iter::empty()), at);
}

#[test]
fn what_leads_to_a_mishap_that_nobody_heard_begins_before_the_silence() {
    let mut problems = Problems::default();
    let lost = Finding { subsystem: Subsystem::Propulsion, ..change(20, Level::Warning, 0.0) };
    problems.take(&lost, Span::ZERO);
    let hit = Finding {
        check: IMPACT.to_owned(),
        subsystem: Subsystem::Mishap,
        ..change(40, Level::Critical, 9.0)
    };
    problems.take(&hit, Span::ZERO);
    let leads = |problems: &[Problem]| {
        let mishaps = mishaps(problems);
        problems.iter().any(|problem| problem.leads_to(&mishaps))
    };
    assert!(!leads(&problems.worst_first()));
    let mut problems = Problems::default();
    problems.take(&lost, Span::ZERO);
    problems.take(&hit, Span::ZERO);
    problems.unheard(IMPACT, Instant::from_millis(25_000), Instant::from_millis(40_000));
    let found = problems.worst_first();
    assert!(leads(&found));
    assert!(
        found.iter().any(|problem| problem.details == ["not heard, between 0:25.0 and 0:40.0"]),
        "{found:?}"
    );
}

#[test]
fn an_impact_that_nobody_heard_has_no_value() {
    let hit = |value: f32| {
        let mut problems = Problems::default();
        let at = Finding { check: IMPACT.to_owned(), ..change(10, Level::Critical, value) };
        problems.take(&at, Span::ZERO);
        problems.peak(IMPACT, 0, value);
        problems.open[&(IMPACT.to_owned(), 0)].problem.value
    };
    assert!(hit(3.5_f32.next_up()).is_nan());
    assert!((hit(12.6) - 12.6).abs() < 0.01);
}

#[test]
fn a_dip_that_came_back_twice_is_one_problem_with_its_worst() {
    let mut problems = Problems::default();
    for (at, level, value) in [
        (10, Level::Warning, 3.55),
        (15, Level::Critical, 3.4),
        (20, Level::Ok, 3.8),
        (30, Level::Warning, 3.58),
        (34, Level::Stale, f32::NAN),
    ] {
        problems.take(&change(at, level, value), Span::ZERO);
    }
    problems.end(Instant::from_millis(90_000), Span::ZERO);
    assert_eq!(problems.findings_count, 5);
    let worst = problems.worst_first();
    let [problem] = worst.as_slice() else { panic!("{worst:?}") };
    assert_eq!((problem.level, problem.at), (Level::Critical, Instant::from_millis(15_000)));
    assert_eq!((problem.times, problem.lasted, problem.lasting), (2, Span::from_secs(14), false));
    assert_eq!((problem.value, problem.limit), (3.4, 3.5));
}

#[test]
fn what_another_alarm_explains_each_time_names_it_also_where_it_was_seen_first() {
    let of = |check: &str, at_s: u64, level: Level| Finding {
        check: check.to_owned(),
        subsystem: Subsystem::Navigation,
        ..change(at_s, level, 1.0)
    };
    let because = |alone_at_s: Option<u64>| {
        let mut problems = Problems::default();
        let effect = |at_s, level| of("ekf_variance", at_s, level);
        for finding in [
            effect(10, Level::Warning),
            of("gps_fix", 11, Level::Critical),
            of("gps_fix", 20, Level::Ok),
            effect(25, Level::Ok),
        ] {
            problems.take(&finding, Span::ZERO);
        }
        if let Some(at_s) = alone_at_s {
            problems.take(&effect(at_s, Level::Warning), Span::ZERO);
        }
        problems.end(Instant::from_millis(40_000), Span::ZERO);
        let found = problems.worst_first();
        found.iter().map(|one| (one.check.clone(), one.because.clone())).collect::<Vec<_>>()
    };
    let gps = ("gps_fix".to_owned(), None);
    let explained = |cause: Option<&str>| ("ekf_variance".to_owned(), cause.map(str::to_owned));
    assert_eq!(because(None), [gps.clone(), explained(Some("gps_fix"))]);
    assert_eq!(because(Some(30)), [gps, explained(None)]);
}

#[test]
fn what_began_long_before_is_no_consequence() {
    let because = |cause_at_s: u64| {
        let mut problems = Problems::default();
        for (check, at_s) in [("vibration", 10), ("sinking", cause_at_s)] {
            let subsystem = if check == "sinking" { Subsystem::Mishap } else { Subsystem::Structure };
            let check = check.to_owned();
            let finding = Finding { subsystem, check, ..change(at_s, Level::Critical, 9.0) };
            problems.take(&finding, Span::ZERO);
        }
        problems.end(Instant::from_millis(90_000), Span::ZERO);
        let found = problems.worst_first();
        found.iter().find(|one| one.check == "vibration").and_then(|one| one.because.clone())
    };
    assert_eq!(because(8), Some("sinking".to_owned()));
    assert_eq!(because(10), Some("sinking".to_owned()));
    assert_eq!(because(15), None, "it shook, and then it sank");
    assert_eq!(because(72), None);
}

#[test]
fn what_was_wrong_several_times_stands_with_the_cause_of_the_first_one() {
    let mut problems = Problems::default();
    for (check, at_s, level) in [
        ("ekf_variance", 10, Level::Warning),
        ("gps_fix", 11, Level::Warning),
        ("ekf_variance", 15, Level::Ok),
        ("gps_fix", 16, Level::Ok),
        ("sinking", 50, Level::Critical),
        ("ekf_variance", 51, Level::Warning),
    ] {
        let subsystem = if check == "sinking" { Subsystem::Mishap } else { Subsystem::Navigation };
        let check = check.to_owned();
        problems.take(&Finding { subsystem, check, ..change(at_s, level, 1.0) }, Span::ZERO);
    }
    problems.end(Instant::from_millis(90_000), Span::ZERO);
    let found = problems.worst_first();
    let effect = found.iter().find(|one| one.check == "ekf_variance").expect("it was wrong");
    assert_eq!((effect.times, effect.because.as_deref()), (2, Some("gps_fix")));
}

#[test]
fn critical_stands_before_what_came_earlier_and_good_news_is_no_problem() {
    let mut problems = Problems::default();
    problems.take(&Finding { instance: 1, ..change(1, Level::Warning, 3.55) }, Span::ZERO);
    problems.take(&change(9, Level::Critical, 3.4), Span::ZERO);
    problems.take(&Finding { instance: 2, ..change(2, Level::Ok, 4.0) }, Span::ZERO);
    problems.end(Instant::from_millis(10_000), Span::ZERO);
    let order: Vec<u8> = problems.worst_first().iter().map(|problem| problem.instance).collect();
    assert_eq!(order, [0, 1]);
}

#[test]
fn a_gap_of_the_recording_is_no_time_of_a_problem() {
    let mut problems = Problems::default();
    problems.take(&change(10, Level::Critical, 3.4), Span::from_secs(5));
    problems.take(&change(320, Level::Ok, 3.8), Span::from_secs(305));
    problems.end(Instant::from_millis(400_000), Span::from_secs(305));
    assert_eq!(problems.worst_first()[0].lasted, Span::from_secs(10));
}
