//! What outlives power and resets, with the firmware itself.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::thread;
use std::time::{Duration, Instant};

use hums_core::usage::UsageCounter;
use hums_tests::flights::own;
use hums_tests::program::{Machine, Recording, command, firmware};
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

/// The programs that work in a folder below this one.
fn working_below(folder: &Path) -> Vec<PathBuf> {
    let processes = fs::read_dir("/proc").unwrap().filter_map(Result::ok);
    let folders = processes.filter_map(|process| fs::read_link(process.path().join("cwd")).ok());
    folders.filter(|working| working.starts_with(folder)).collect()
}

/// Until `is_so`, a minute at most.
#[track_caller]
fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < Duration::from_mins(1), "{what}");
        thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn a_run_that_is_killed_leaves_no_emulator_behind() {
    let dir = tempfile::tempdir().unwrap();
    let mut run = command(["emulate", "--firmware"]);
    run.arg(firmware()).arg("--input").arg(own(FLIGHT)).arg("--sd").arg(dir.path().join("card.img"));
    run.env("TMPDIR", dir.path()).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut run = run.spawn().unwrap();
    wait_until("no emulator was started", || !working_below(dir.path()).is_empty());
    run.kill().unwrap();
    run.wait().unwrap();
    wait_until("the emulator goes on", || working_below(dir.path()).is_empty());
}
