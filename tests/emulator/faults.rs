//! Faults of the firmware itself, provoked in the emulator: each leaves a note of what happened, and where; the next start
//! records it, tells the ground station, and goes on recording within a second.
//!
//! The emulator models neither the watchdog nor the supply's detector: the emulated board bites in the watchdog's place,
//! when it was not fed for a second of virtual time or a task has not come back for ten of the processor's, and calls the
//! detector's handler. After a reset it starts anew with the memory that survives one, the same card and the same store;
//! everything else (fault, handlers, note, restart) is the firmware that flies.

use std::fs;
use std::path::Path;

use hums_tests::flights::{Manifest, own};
use hums_tests::frames::{self, Frame};
use hums_tests::program::{Decoded, Machine, Recording, hums};
use serde_json::Value;

const FLIGHT: &str = "px4_hil_quad_low.tlog";
/// Half a minute of it.
const BEGINNING: usize = 150_000;
/// When it goes wrong, in milliseconds.
const AT_MS: u64 = 10_000;
/// From the moment that a task is silent: its second, the watchdog's, and a tick of each.
const NOTICED_MS: u64 = 2_200;
/// Recording goes on within this after a reset, seconds.
const AGAIN_S: f64 = 1.0;
/// What a reset may cost: what was in memory, a quarter of a second, and what the watchdog waits for, at 100 frames a second.
const LOST_MAX: u64 = 40;

/// What is to come of a fault.
struct Expected {
    kind: &'static str,
    task: &'static str,
    /// How the place begins.
    place: &'static str,
    message: &'static str,
    cause: &'static str,
    /// What the ground station is told.
    told: &'static str,
}

/// The records of one log, in order, and when its first frame came, in seconds since its start.
struct Log {
    records: Vec<Value>,
    first_frame_s: Option<f64>,
}

impl Log {
    fn only(&self, table: &str) -> &Value {
        let mut found = self.records.iter().filter(|row| row["record"] == table);
        let first = found.next().unwrap_or_else(|| panic!("no {table}"));
        assert!(found.next().is_none(), "more than one {table}");
        &first["fields"]
    }

    fn all(&self, table: &str) -> Vec<&Value> {
        self.records.iter().filter(|row| row["record"] == table).map(|row| &row["fields"]).collect()
    }

    fn has(&self, table: &str) -> bool {
        self.records.iter().any(|row| row["record"] == table)
    }

    /// The note of what came before a restart.
    fn before(&self) -> &str {
        let notes = self.records.iter().filter(|row| row["record"] == "HUMS_NOTE");
        let mut texts = notes.filter_map(|row| row["fields"]["text"].as_str());
        texts.find(|text| text.starts_with("restart at ")).expect("a note of the last messages")
    }
}

/// The logs of a card in the order of their files' names.
fn logs(image: &Path) -> Vec<Log> {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let arguments = ["decode".as_ref(), image.as_os_str(), "-o".as_ref(), out.as_os_str()];
    hums(arguments.into_iter().chain(["--format".as_ref(), "jsonl".as_ref()])).expect_code(&[0, 3]);
    // One log is one file.
    let mut files = vec![out.clone()];
    if out.is_dir() {
        files = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path()).collect();
    }
    files.sort();
    files.iter().map(|file| log(&fs::read_to_string(file).unwrap())).collect()
}

fn log(text: &str) -> Log {
    let rows: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let first = rows.iter().find(|row| row["message"].is_string());
    let first_frame_s = first.and_then(|row| row["time_boot"].as_f64());
    Log { records: rows.into_iter().filter(|row| row["record"].is_string()).collect(), first_frame_s }
}

/// The last messages that a note names, the newest first: when, in milliseconds, and which.
fn last_messages(note: &str) -> (u64, Vec<(u64, u32)>) {
    let (at, list) = note.strip_prefix("restart at ").unwrap().split_once(" ms; last messages: ").unwrap();
    let messages = list.split(", ").map(|one| {
        let (id, at) = one.split_once(" at ").unwrap();
        (at.parse().unwrap(), id.parse().unwrap())
    });
    (at.parse().unwrap(), messages.collect())
}

/// Those that a recording has around these times: within a millisecond, as both clocks are cut off.
fn assert_came(messages: &[(u64, u32)], input: &[Frame<'_>]) {
    let begin = input[0].time_us.unwrap();
    let came: Vec<(u64, u32)> =
        input.iter().map(|frame| ((frame.time_us.unwrap() - begin) / 1_000, frame.id)).collect();
    for (at, id) in messages {
        assert!(came.iter().any(|(ms, of)| of == id && ms.abs_diff(*at) <= 1), "{id} never came at {at} ms");
    }
}

/// Provokes a fault in the middle of a flight, and looks at what is left of it.
#[track_caller]
fn survives(provoke: &str, expected: &Expected) {
    let dir = tempfile::tempdir().unwrap();
    let short = dir.path().join("short.tlog");
    let data = fs::read(own(FLIGHT)).unwrap();
    fs::write(&short, &data[..BEGINNING]).unwrap();
    let manifest = Manifest::own();
    let input = manifest.frames_of(&own(FLIGHT), &data);
    let recording =
        Recording::attempt(Machine::Emulated, &short, &["--provoke", provoke]).expect_code(&[0, 3]);

    let logs = logs(&recording.image());
    let [first, second] = &logs[..] else { panic!("{} logs", logs.len()) };
    assert!(!first.has("HUMS_FAULT"));
    // The second one is written when the card is open: it knows which log was before.
    let [boot, again] = first.all("HUMS_BOOT")[..] else { panic!("not two boot records") };
    assert_eq!((&boot["boots"], again["before"].as_str()), (&Value::from(1), Some("nothing")));
    let [boot, again] = second.all("HUMS_BOOT")[..] else { panic!("not two boot records") };
    assert_eq!((boot["boots"].as_u64(), boot["reset_name"].as_str()), (Some(2), Some(expected.cause)));
    assert_eq!((again["before"].as_str(), again["before_number"].as_u64()), (Some("frames"), Some(1)));

    let fault = second.only("HUMS_FAULT");
    for (field, text) in [("kind", expected.kind), ("task", expected.task), ("message", expected.message)] {
        assert_eq!(fault[field], text, "{fault}");
    }
    let place = fault["place"].as_str().unwrap();
    assert!(place.starts_with(expected.place), "{fault}");
    if let Some(pc) = place.strip_prefix("pc ").or(place.strip_prefix("called from ")) {
        assert!(pc.starts_with("080"), "not in the program: {fault}");
        assert!(fault["registers"].as_str().unwrap().contains(pc), "{fault}");
    }
    let (at_ms, messages) = last_messages(second.before());
    assert!((AT_MS - 100..AT_MS + NOTICED_MS).contains(&at_ms), "{}", second.before());
    assert_eq!(messages.len(), 8);
    assert!(at_ms - messages[0].0 < 100 && messages.is_sorted_by(|a, b| a.0 >= b.0), "{messages:?}");
    assert_came(&messages, &input);

    let stream = fs::read(recording.gs()).unwrap();
    let texts = frames::of_raw(&stream, &manifest.seeds);
    let mut texts =
        texts.iter().filter(|frame| frame.id == 253).map(|frame| String::from_utf8_lossy(frame.bytes));
    assert!(
        texts.any(|text| text.contains(expected.told)),
        "the ground station never heard «{}»",
        expected.told
    );

    let again_s = second.first_frame_s.expect("it never recorded again");
    assert!(again_s < AGAIN_S, "{again_s} s");
    let decoded = Decoded::of(&recording.image(), &[0, 3]);
    let frames = decoded.frames(&manifest.seeds).len() as u64;
    assert_eq!(recording.number("frames_logged"), frames);
    let lost = recording.number("frames_lost");
    assert!(lost <= LOST_MAX, "{lost} frames lost");
    assert!(frames > 2_000 && frames < input.len() as u64, "{frames}");
}

#[test]
fn a_panic_is_survived_recorded_and_told() {
    survives(
        "panic@10",
        &Expected {
            kind: "panic",
            task: "downlink",
            place: "firmware/app/src/boards/emulated/provoke.rs:",
            message: "provoked",
            cause: "software",
            told: "HUMS: restarted after: panic (downlink)",
        },
    );
}

#[test]
fn a_fault_of_the_processor_is_survived_recorded_and_told() {
    survives(
        "bus-fault:storage@10",
        &Expected {
            kind: "hard_fault",
            task: "storage",
            place: "pc ",
            message: "processor fault",
            cause: "software",
            told: "HUMS: restarted after: processor fault (storage)",
        },
    );
}

#[test]
fn a_full_stack_hurts_nobody_and_is_survived_recorded_and_told() {
    survives(
        "overflow:monitor@10",
        &Expected {
            kind: "hard_fault",
            task: "monitor",
            place: "called from ",
            message: "stack overflow",
            cause: "software",
            told: "HUMS: restarted after: stack overflow (monitor)",
        },
    );
}

#[test]
fn a_transmission_that_does_not_end_is_given_up_and_told() {
    let dir = tempfile::tempdir().unwrap();
    let short = dir.path().join("short.tlog");
    fs::write(&short, &fs::read(own(FLIGHT)).unwrap()[..BEGINNING]).unwrap();
    let recording =
        Recording::attempt(Machine::Emulated, &short, &["--provoke", "silence@10"]).expect_code(&[0]);
    let logs = logs(&recording.image());
    let [only] = &logs[..] else { panic!("{} logs", logs.len()) };
    assert!(!only.has("HUMS_FAULT"));
    let notes = only.all("HUMS_NOTE");
    let texts: Vec<_> = notes.iter().filter_map(|note| note["text"].as_str()).collect();
    assert!(texts.contains(&"HUMS: sending to the radio stands still"), "{texts:?}");
}

#[test]
fn a_task_that_never_comes_back_is_caught_with_its_registers_however_urgent_it_is() {
    for (task, told) in [
        ("reception", "HUMS: restarted after: watchdog (reception)"),
        ("monitor", "HUMS: restarted after: watchdog (monitor)"),
        ("storage", "HUMS: restarted after: watchdog (storage)"),
    ] {
        let (kind, place, message, cause) = ("watchdog", "pc ", "hangs", "watchdog");
        survives(&format!("spin:{task}@10"), &Expected { kind, task, place, message, cause, told });
    }
}

#[test]
fn a_supply_that_sags_is_survived_recorded_and_told() {
    survives(
        "supply:downlink@10",
        &Expected {
            kind: "unknown",
            task: "downlink",
            place: "supply",
            message: "below 2.7 V",
            cause: "software",
            told: "HUMS: restarted after: supply low (downlink)",
        },
    );
}
