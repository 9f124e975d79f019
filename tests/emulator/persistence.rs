//! What outlives power and resets, with the firmware itself.

use std::fs;

use hums_core::usage::UsageCounter;
use hums_tests::flights::own;
use hums_tests::program::{Machine, Recording};
use hums_tests::store::Stored;

const FLIGHT: &str = "px4_hil_quad_low.tlog";

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
