//! A card that is missing, full, slow or failing costs at most counted frames.

use hums_tests::fat;
use hums_tests::flights::{Manifest, own};
use hums_tests::program::{Decoded, Machine, Recording};

const FLIGHT: &str = "px4_hil_quad_low.tlog";

/// Each frame is in the log, in order, or counted as lost.
#[track_caller]
fn assert_accounted(flags: &[&str]) -> (Recording, u64) {
    let recording = Recording::attempt(Machine::Sim, &own(FLIGHT), flags).expect_code(&[0, 3]);
    let manifest = Manifest::own();
    let frames_in = recording.number("frames_in");
    assert_eq!(frames_in, manifest.found(&own(FLIGHT)).frames, "the port goes on whatever the card does");
    let (logged, lost) = (recording.number("frames_logged"), recording.number("frames_lost"));
    assert_eq!(logged + lost, frames_in, "each frame is logged or counted as lost");
    let expected_code = if lost == 0 { 0 } else { 3 };
    assert_eq!(recording.outcome.code, Some(expected_code), "{lost} frames lost");

    let data = std::fs::read(own(FLIGHT)).unwrap();
    let mut originals = manifest.frames_of(&own(FLIGHT), &data).into_iter();
    let decoded = Decoded::of(&recording.image(), &[0, 1, 3]);
    let output = decoded.frames(&manifest.seeds);
    assert!(
        output.iter().all(|frame| originals.any(|original| original.bytes == frame.bytes)),
        "a foreign frame"
    );
    assert_eq!(output.len() as u64, logged, "frames in the log");
    (recording, lost)
}

#[test]
fn a_card_that_is_missing_throughout_loses_counted_frames_and_no_more() {
    let recording =
        Recording::attempt(Machine::Sim, &own(FLIGHT), &["--card-out", "0..100000"]).expect_code(&[3]);
    let frames = Manifest::own().found(&own(FLIGHT)).frames;
    assert_eq!(recording.number("frames_in"), frames);
    assert_eq!((recording.number("frames_logged"), recording.number("frames_lost")), (0, frames));
    assert!(recording.number("gs_frames") > 100, "the ground station is served all the same");
}

/// By each row: its options, and the least percentage of frames that are logged.
#[test]
fn trouble_of_a_card_costs_counted_frames_and_leaves_a_good_file_system() {
    for (flags, percent_min) in [
        (&["--card-out", "0..200"][..], 5),
        (&["--card-out", "30..200"], 25),
        // The queue holds that long at the rate of a telemetry port.
        (&["--card-out", "100..130"], 100),
        (&["--stall", "100000@50"], 10),
    ] {
        let (recording, lost) = assert_accounted(&[flags, &["--card-size", "64"]].concat());
        let percent = 100 * recording.number("frames_logged") / recording.number("frames_in");
        assert!(percent >= percent_min && (lost == 0) == (percent_min == 100), "{flags:?}: {lost} lost");
        fat::assert_clean(&recording.image());
    }
}

#[test]
fn write_errors_are_retried_and_what_stays_is_counted() {
    let (recording, _) = assert_accounted(&["--write-error", "0.01", "--seed", "4", "--card-size", "64"]);
    fat::assert_clean(&recording.image());
    // It writes over its own first files: their frames count as lost.
    let (recording, lost) = assert_accounted(&["--write-error", "0.75", "--seed", "3", "--card-size", "40"]);
    assert!(lost > 0 && recording.number("frames_logged") > 0, "{lost} lost");
}

#[test]
fn a_card_that_never_comes_back_holds_what_was_written_and_the_pilot_is_told() {
    let (recording, lost) = assert_accounted(&["--card-out", "60..100000", "--card-size", "64"]);
    assert!(lost > 0 && recording.number("frames_logged") > 0);
    let json: serde_json::Value = serde_json::from_str(&recording.outcome.text()).unwrap();
    assert!(json["findings"].to_string().contains("recording"), "a stopped recorder is told: {json}");
}

#[test]
fn a_card_that_fails_every_write_loses_everything_and_says_so() {
    let recording = Recording::attempt(Machine::Sim, &own(FLIGHT), &["--write-error", "1", "--seed", "4"])
        .expect_code(&[1, 3]);
    if recording.outcome.code == Some(3) {
        assert_eq!(recording.number("frames_lost"), recording.number("frames_in"));
    }
}

/// The smallest card of FAT32 has some 33 MiB: many flights fill it.
#[test]
fn a_small_card_takes_the_newest_data_and_stays_a_good_file_system() {
    let recording = Recording::make(Machine::Sim, &own("ap_quad_faults.tlog"), &["--card-size", "34"]);
    fat::assert_clean(&recording.image());
    let lost = recording.number("frames_lost");
    assert_eq!(lost, 0);
}
