//! Pymavlink plays an airborne autopilot with an emptying battery, and its pilot.
#![cfg(feature = "oracle")]

use std::fs;

use hums_tests::live::free_port;
use hums_tests::oracle;
use serde_json::Value;

use super::board::Board;

/// The empty battery's debounce, and the tests' delay.
const FOUND_S: f64 = 2.0;
const DELAY_S: f64 = 3.0;

struct Outcome {
    said: Value,
    steps: Vec<(String, u64)>,
}

fn fly(params: &str, pilot: &str) -> Outcome {
    let (dir, autopilot) = (tempfile::tempdir().unwrap(), free_port());
    let file = dir.path().join("hums.param");
    fs::write(&file, params).unwrap();
    let input = format!("udpin:127.0.0.1:{autopilot}");
    let board = Board::start_with(input.as_ref(), dir, &["--params", file.to_str().unwrap()]);
    let said = oracle::autopilot(autopilot, board.port, pilot);
    let record = board.end();
    let steps = record.lines().filter(|line| line.contains("HUMS_PROTECTION")).map(|line| {
        let entry: Value = serde_json::from_str(line).unwrap();
        let fields = &entry["fields"];
        (fields["stage"].as_str().unwrap().to_owned(), fields["detail"].as_u64().unwrap())
    });
    Outcome { said, steps: steps.collect() }
}

impl Outcome {
    /// Seconds, severity, text.
    fn texts(&self, action: &str) -> Vec<(f64, u64, String)> {
        let texts = self.said["texts"].as_array().unwrap().iter().map(|entry| {
            let text = entry[2].as_str().unwrap().to_owned();
            (entry[0].as_f64().unwrap(), entry[1].as_u64().unwrap(), text)
        });
        texts.filter(|(.., text)| text.starts_with(&format!("HUMS: {action}"))).collect()
    }

    fn commands(&self) -> &Vec<Value> {
        self.said["commands"].as_array().unwrap()
    }
}

#[test]
fn an_empty_battery_is_announced_counted_down_and_the_autopilot_told_once_and_its_answer_recorded() {
    for (number, action, command) in [(1, "return", 20), (2, "land", 21)] {
        let outcome = fly(&format!("PROT_ACTION {number}\nPROT_DELAY {DELAY_S}\n"), "nothing");
        let said = &outcome.said;
        let [asked] = &outcome.commands()[..] else { panic!("once: {said}") };
        assert_eq!(asked["command"], command, "{said}");
        assert_eq!(asked["target"], serde_json::json!([1, 1]), "{said}");
        assert_eq!((&asked["confirmation"], &asked["params"][0]), (&0.into(), &0.0.into()), "{said}");
        // The board's ticks, this PC's scheduler and clock.
        let asked_s = asked["s"].as_f64().unwrap() - FOUND_S - DELAY_S;
        assert!((-0.1..1.0).contains(&asked_s), "{said}");
        let texts = outcome.texts(action);
        let words: Vec<&str> = texts.iter().map(|(.., text)| text.as_str()).collect();
        let expected = [
            format!("HUMS: {action} in 3 s, change mode to cancel"),
            format!("HUMS: {action} in 2 s"),
            format!("HUMS: {action} in 1 s"),
            format!("HUMS: {action} asked for"),
            format!("HUMS: {action} accepted"),
        ];
        assert_eq!(words, expected, "{said}");
        assert!(texts[0].1 == 2 && (FOUND_S - 0.1..FOUND_S + 1.0).contains(&texts[0].0), "{said}");
        let steps: Vec<(&str, u64)> =
            outcome.steps.iter().map(|(stage, detail)| (stage.as_str(), *detail)).collect();
        let expected = [("announced", 3), ("counting", 2), ("counting", 1), ("asked", 1), ("answered", 0)];
        assert_eq!(steps, expected, "in the record");
    }
}

#[test]
fn with_another_vehicle_heard_first_on_the_port_the_command_is_for_ours() {
    let outcome = fly(&format!("PROT_ACTION 2\nPROT_DELAY {DELAY_S}\n"), "two_systems");
    let [asked] = &outcome.commands()[..] else { panic!("once: {}", outcome.said) };
    assert_eq!((&asked["command"], &asked["target"]), (&21.into(), &serde_json::json!([1, 1])));
}

#[test]
fn the_pilot_cancels_it_by_command_and_nothing_is_asked() {
    let outcome = fly(&format!("PROT_ACTION 1\nPROT_DELAY {DELAY_S}\n"), "cancels");
    let said = &outcome.said;
    assert!(outcome.commands().is_empty(), "{said}");
    assert_eq!(said["cancel"], 0, "accepted: {said}");
    let last = outcome.texts("return").pop().unwrap();
    assert_eq!(last.2, "HUMS: return cancelled by command", "{said}");
    assert_eq!(outcome.steps.last().unwrap().0, "cancelled_by_command");
}

#[test]
fn by_default_and_on_the_ground_nothing_is_said_or_asked() {
    for (params, pilot) in [("", "nothing"), ("PROT_ACTION 1\nPROT_DELAY 0\n", "on_ground")] {
        let outcome = fly(params, pilot);
        assert!(outcome.commands().is_empty() && outcome.steps.is_empty(), "{pilot}: {}", outcome.said);
        assert!(outcome.texts("return").is_empty(), "{pilot}: {}", outcome.said);
    }
}
