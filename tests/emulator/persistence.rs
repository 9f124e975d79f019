//! What outlives power and resets, with the firmware itself.

use std::fs;
use std::path::Path;

use hums_core::usage::UsageCounter;
use hums_tests::flights::{Manifest, own};
use hums_tests::program::{Decoded, Machine, Recording, hums};
use hums_tests::store::Stored;

const FLIGHT: &str = "px4_hil_quad_low.tlog";
/// Half a minute of it.
const BEGINNING: usize = 150_000;

/// All records of a card, as text.
fn records(image: &Path) -> String {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let arguments = ["decode".as_ref(), image.as_os_str(), "-o".as_ref(), out.as_os_str()];
    hums(arguments.into_iter().chain(["--format".as_ref(), "jsonl".as_ref()])).expect_code(&[0, 3]);
    let mut files: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|file| fs::read_to_string(file).unwrap()).collect()
}

#[test]
fn both_machines_go_on_with_the_same_store() {
    let dir = tempfile::tempdir().unwrap();
    let (store, params) = (dir.path().join("store.bin"), dir.path().join("hums.param"));
    fs::write(&params, "CELL_VOLT_WARN 3.9\n").unwrap();
    let flags = ["--store", store.to_str().unwrap()];
    let with_params = [&flags[..], &["--params", params.to_str().unwrap()]].concat();
    let mut counters = Vec::new();
    for (machine, flags) in
        [(Machine::Emulated, &with_params[..]), (Machine::Sim, &flags), (Machine::Emulated, &flags)]
    {
        let recording = Recording::make(machine, &own(FLIGHT), flags);
        let findings = recording.json()["findings"].to_string();
        assert!(findings.contains("cell_voltage"), "{machine:?} has not the parameter: {findings}");
        let stored = Stored::read(&store);
        assert_eq!(stored.params, [("CELL_VOLT_WARN".into(), 3.9)]);
        let lifetime = stored.lifetime();
        counters.push((lifetime.boots, lifetime.totals.raw(UsageCounter::Flights) as u32));
    }
    assert_eq!(counters, [(1, 1), (2, 2), (3, 3)]);
}

#[test]
fn each_fault_is_survived_recorded_and_the_record_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let short = dir.path().join("short.tlog");
    let data = fs::read(own(FLIGHT)).unwrap();
    fs::write(&short, &data[..BEGINNING]).unwrap();
    let manifest = Manifest::own();
    let input = manifest.frames_of(&own(FLIGHT), &data);
    for (what, kind, message, cause) in [
        ("panic", "panic", "provoked", "software"),
        ("bus-fault", "hard_fault", "processor fault", "software"),
        ("silence", "watchdog", "silent", "watchdog"),
    ] {
        let recording =
            Recording::attempt(Machine::Emulated, &short, &["--provoke", what]).expect_code(&[0, 3]);
        let records = records(&recording.image());
        let fault =
            records.lines().find(|line| line.contains("HUMS_FAULT")).unwrap_or_else(|| panic!("{what}"));
        for part in [message, "downlink"] {
            assert!(fault.contains(part), "{what}: {fault}");
        }
        assert!(fault.contains(&format!("\"kind\":\"{kind}\"")), "{what}: {fault}");
        assert!(records.contains(&format!("\"{cause}\"")), "{what}: the second start does not say {cause}");
        // What the reset took is what was in memory: a quarter of a second, and what the watchdog waits for.
        let decoded = Decoded::of(&recording.image(), &[0, 3]);
        let frames = decoded.frames(&manifest.seeds).len() as u64;
        assert_eq!(recording.number("frames_logged"), frames, "{what}");
        let lost = recording.number("frames_lost");
        assert!(lost <= 40, "{what}: {lost} frames lost");
        assert!(frames > 2_000 && frames < input.len() as u64, "{what}: {frames}");
    }
}

#[test]
fn power_that_goes_for_a_moment_begins_another_session_on_both_machines() {
    for machine in [Machine::Emulated, Machine::Sim] {
        let dir = tempfile::tempdir().unwrap();
        let store = dir.path().join("store.bin");
        let flags = ["--reboot-at", "60", "--reboot-at", "120.5", "--store", store.to_str().unwrap()];
        let recording = Recording::attempt(machine, &own(FLIGHT), &flags).expect_code(&[0, 3]);
        assert_eq!(recording.json()["log_files"].as_array().unwrap().len(), 3, "{machine:?}");
        assert!(recording.number("frames_lost") <= 40, "{machine:?}: {}", recording.json());
        assert_eq!(recording.number("frames_in"), 16_645, "{machine:?}");
        assert_eq!(Stored::read(&store).lifetime().boots, 3, "{machine:?}");
    }
}
