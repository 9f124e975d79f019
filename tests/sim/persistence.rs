//! What outlives power: counters and parameters go on from flight to flight, whatever word of the store power went at,
//! and whichever card is in the slot.

use std::fs;
use std::path::Path;

use hums_core::usage::UsageCounter;
use hums_tests::damage::Random;
use hums_tests::flights::own;
use hums_tests::program::{Machine, Recording, hums};
use hums_tests::store::Stored;

const FLIGHT: &str = "px4_hil_quad_low.tlog";

fn fly(store: &Path, flags: &[&str]) -> Recording {
    let flags = [&["--store", store.to_str().unwrap()][..], flags].concat();
    Recording::attempt(Machine::Sim, &own(FLIGHT), &flags)
}

/// A whole flight, in order.
fn flown(store: &Path) {
    let _ = fly(store, &[]).expect_code(&[0]);
}

#[test]
fn two_flights_add_up_in_the_store_whatever_card_is_in_the_slot() {
    let dir = tempfile::tempdir().unwrap();
    let store = dir.path().join("store.bin");
    let once = {
        // Each recording has a card of its own.
        flown(&store);
        *Stored::read(&store).lifetime()
    };
    flown(&store);
    let twice = *Stored::read(&store).lifetime();
    assert_eq!((once.boots, twice.boots), (1, 2));
    assert_eq!((once.sessions, twice.sessions), (1, 2));
    for counter in [UsageCounter::Flights, UsageCounter::Flight, UsageCounter::Distance, UsageCounter::Energy]
    {
        let (once, twice) = (once.totals.raw(counter), twice.totals.raw(counter));
        assert!(once > 0.9, "{}: {once}", counter.name());
        assert!((twice - 2.0 * once).abs() < 0.11, "{}: {once}, then {twice}", counter.name());
    }
    let [once, twice] = [once, twice].map(|lifetime| lifetime.totals.raw(UsageCounter::HeightMax).to_bits());
    assert_eq!(once, twice, "a maximum is no sum");
}

#[test]
fn a_run_without_a_store_begins_anew() {
    let dir = tempfile::tempdir().unwrap();
    let recording = Recording::make(Machine::Sim, &own(FLIGHT), &[]);
    assert!(records(&recording.image(), dir.path()).contains("the store is new"));
}

#[test]
fn whatever_word_of_the_store_power_goes_at_the_counters_are_the_old_or_the_new_ones() {
    let dir = tempfile::tempdir().unwrap();
    let store = dir.path().join("store.bin");
    flown(&store);
    let mut random = Random::new(4);
    let mut cuts = 0;
    for cut in 0..40 {
        let before = *Stored::read(&store).lifetime();
        // A flight writes some 400 words; behind those no cut is met, and the flight counts.
        let at = (1 + random.below(500)).to_string();
        let flags = ["--cut-store-after", &at, "--seed", &cut.to_string()];
        let recording = fly(&store, &flags).expect_code(&[0, 3]);
        let was_cut = recording.json()["power_cut"] == true;
        cuts += u32::from(was_cut);
        let after = *Stored::read(&store).lifetime();
        assert!(
            after == before || after.boots == before.boots + 1,
            "cut at {at}: {before:?}, then {after:?}"
        );
        assert!(was_cut || after.boots == before.boots + 1, "{at}");
        let flights = |lifetime: &hums_core::lifetime::Lifetime| lifetime.totals.raw(UsageCounter::Flights);
        let more = flights(&after) - flights(&before);
        assert!((0.0..=1.0).contains(&more), "cut at {at}: {more} flights more");
    }
    assert!(cuts >= 20, "{cuts} of 40 cuts were met");
}

#[test]
fn parameters_that_were_set_once_stay() {
    let dir = tempfile::tempdir().unwrap();
    let (store, file) = (dir.path().join("store.bin"), dir.path().join("hums.param"));
    fs::write(&file, "# lipo\nCELL_VOLT_WARN,3.9\nGS_BUDGET 1000\n").unwrap();
    let warned = |recording: &Recording| recording.json()["findings"].to_string().contains("cell_voltage");
    assert!(!warned(&Recording::make(Machine::Sim, &own(FLIGHT), &[])), "the default does not warn");
    let first = fly(&store, &["--params", file.to_str().unwrap()]).expect_code(&[0]);
    assert!(warned(&first));
    assert_eq!(Stored::read(&store).params, [("CELL_VOLT_WARN".into(), 3.9), ("GS_BUDGET".into(), 1000.0)]);
    assert!(warned(&fly(&store, &[]).expect_code(&[0])), "also without the file");
}

#[test]
fn a_parameter_file_that_is_wrong_is_told_with_line_and_range_and_leaves_nothing_behind() {
    let dir = tempfile::tempdir().unwrap();
    let (file, image) = (dir.path().join("hums.param"), dir.path().join("card.img"));
    for (text, why) in [
        ("\nNO_SUCH 1\n", "line 2: there is no parameter NO_SUCH"),
        ("CELL_VOLT_WARN 3.6\nCELL_VOLT_CRIT,12\n", "line 2: CELL_VOLT_CRIT takes 0 to 4.5 V, not 12"),
        ("CELL_VOLT_WARN\n", "line 1: wants NAME VALUE"),
    ] {
        fs::write(&file, text).unwrap();
        for command in ["sim", "emulate"] {
            let arguments =
                [command.as_ref(), "--input".as_ref(), own(FLIGHT).as_os_str().to_owned().as_os_str()]
                    .map(std::ffi::OsStr::to_owned);
            let more = ["--sd".into(), image.clone().into(), "--params".into(), file.clone().into()];
            let outcome = hums(arguments.into_iter().chain(more)).expect_code(&[1, 2]);
            // Where there is no emulator, it is that what is told.
            assert!(outcome.stderr.contains(why) || command == "emulate", "{}", outcome.stderr);
        }
        assert!(!image.exists());
    }
}

#[test]
fn flash_with_something_else_in_it_is_recorded_and_told_and_the_flight_counts() {
    let dir = tempfile::tempdir().unwrap();
    let store = dir.path().join("store.bin");
    fs::write(&store, vec![0x5A; 32_768]).unwrap();
    let recording = fly(&store, &[]).expect_code(&[0]);
    let text = "HUMS: store unreadable, counters begin anew";
    assert!(records(&recording.image(), dir.path()).contains(text));
    let gs = fs::read(recording.gs()).unwrap();
    assert!(gs.windows(text.len()).any(|window| window == text.as_bytes()), "the ground station is not told");
    assert_eq!(Stored::read(&store).lifetime().boots, 1);
    fs::write(&store, b"too short").unwrap();
    let outcome = fly(&store, &[]).expect_code(&[1]).outcome;
    assert!(outcome.stderr.contains("is no store"), "{}", outcome.stderr);
    assert_eq!(fs::read(&store).unwrap(), b"too short");
}

/// All records of a card, as text.
fn records(image: &Path, dir: &Path) -> String {
    let out = dir.join("records.jsonl");
    let [decode, image, to, out_name] =
        ["decode".as_ref(), image.as_os_str(), "-o".as_ref(), out.as_os_str()];
    hums([decode, image, to, out_name, "--format".as_ref(), "jsonl".as_ref()]).expect_code(&[0, 3]);
    fs::read_to_string(out).unwrap()
}
