//! Persistence over power cuts: the store, and the card's sessions, by `hums sim --firmware`.

use std::fs;
use std::path::{Path, PathBuf};

use hums_tests::chip::frames;
use hums_tests::flights::own;
use hums_tests::program::{Machine, Recording};
use hums_tests::store::Stored;

/// Half a minute.
fn short(dir: &Path) -> PathBuf {
    const BYTES: usize = 150_000;
    let path = dir.join("short.tlog");
    let whole = fs::read(own("px4_hil_quad_low.tlog")).unwrap();
    let mut cut = Vec::new();
    for (time_us, frame) in frames(&whole) {
        cut.extend([&time_us.to_be_bytes()[..], frame].concat());
        if cut.len() >= BYTES {
            break;
        }
    }
    fs::write(&path, cut).unwrap();
    path
}

#[test]
fn the_chip_and_this_pc_go_on_with_the_same_store() {
    let dir = tempfile::tempdir().unwrap();
    let (store, params) = (dir.path().join("store.bin"), dir.path().join("hums.param"));
    fs::write(&params, "CELL_VOLT_WARN 3.9\n").unwrap();
    let flags = ["--store", store.to_str().unwrap()];
    let with_params = [&flags[..], &["--params", params.to_str().unwrap()]].concat();
    let mut boots = Vec::new();
    for (machine, flags) in
        [(Machine::Chip, &with_params[..]), (Machine::Sim, &flags[..]), (Machine::Chip, &flags[..])]
    {
        Recording::make(machine, &short(dir.path()), flags);
        let stored = Stored::read(&store);
        assert_eq!(stored.params, [("CELL_VOLT_WARN".into(), 3.9)], "{machine:?}");
        boots.push(stored.lifetime().boots);
    }
    assert_eq!(boots, [1, 2, 3]);
}

#[test]
fn power_that_goes_for_a_moment_begins_another_session_on_the_chip_and_on_this_pc() {
    for machine in [Machine::Chip, Machine::Sim] {
        let dir = tempfile::tempdir().unwrap();
        let store = dir.path().join("store.bin");
        let flags = ["--reboot-at", "10", "--reboot-at", "20.5", "--store", store.to_str().unwrap()];
        let recording = Recording::attempt(machine, &short(dir.path()), &flags).expect_code(&[0, 3]);
        assert_eq!(recording.json()["log_files"].as_array().unwrap().len(), 3, "{machine:?}");
        assert!(recording.number("frames_lost") <= 60, "{machine:?}: {}", recording.json());
        assert!(recording.number("frames_in") > 2_000, "{machine:?}");
        // A start without a save before the power cut is not counted: nothing is saved in the air.
        let boots = Stored::read(&store).lifetime().boots;
        assert!((2..=3).contains(&boots), "{machine:?}: {boots}");
    }
}
