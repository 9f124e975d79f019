//! A card that is missing, slow or failing costs at most counted frames. `cargo xtask prove endurance` fills one.

use hums_tests::fat;
use hums_tests::flights::{Manifest, own};
use hums_tests::frames::Frame;
use hums_tests::program::{Decoded, Machine, Recording};

/// Options, the range of the percentage of logged frames, and what findings say.
const TROUBLE: [(&str, [u64; 2], &str); 8] = [
    ("--card-out 0..100000 --card-size 64", [0, 0], "recording"),
    ("--card-out 0..200 --card-size 64", [5, 99], ""),
    ("--card-out 30..200 --card-size 64", [25, 99], ""),
    // The queue holds that long at the rate of a telemetry port.
    ("--card-out 100..130 --card-size 64", [100, 100], ""),
    ("--card-out 60..100000 --card-size 64", [1, 99], "recording"),
    ("--stall 100000@50 --card-size 64", [10, 99], ""),
    ("--write-error 0.01 --seed 4 --card-size 64", [1, 100], ""),
    // It writes over its own first files: their frames count as lost.
    ("--write-error 0.75 --seed 3 --card-size 40", [1, 99], ""),
];

/// Each frame is in the log, in order, or counted as lost.
#[test]
fn trouble_of_a_card_costs_counted_frames_and_leaves_a_good_file_system() {
    let (flight, manifest) = (own("px4_hil_quad_low.tlog"), Manifest::own());
    let data = std::fs::read(&flight).unwrap();
    for (flags, [least, most], told) in TROUBLE {
        let words: Vec<&str> = flags.split(' ').collect();
        let recording = Recording::attempt(Machine::Sim, &flight, &words).expect_code(&[0, 3]);
        let [frames, logged, lost, to_ground] =
            ["frames_in", "frames_logged", "frames_lost", "gs_frames"].map(|name| recording.number(name));
        assert_eq!(frames, manifest.found(&flight).frames, "{flags}: the port goes on");
        assert!(to_ground > 100, "{flags}: the ground station is served all the same");
        assert_eq!(logged + lost, frames, "{flags}: each frame is logged or counted as lost");
        assert_eq!(recording.outcome.code, Some(if lost == 0 { 0 } else { 3 }), "{flags}: {lost} lost");
        assert!((least * frames..=most * frames).contains(&(100 * logged)), "{flags}: {lost} lost");
        assert!(recording.json()["findings"].to_string().contains(told), "{flags}: not told");

        let mut originals = manifest.frames_of(&flight, &data).into_iter();
        let decoded = Decoded::of(&recording.image(), &[0, 1, 3]);
        let output = decoded.frames(&manifest.seeds);
        let is_original = |frame: &Frame<'_>| originals.any(|original| original.bytes == frame.bytes);
        assert!(output.iter().all(is_original), "{flags}: a foreign frame");
        assert_eq!(output.len() as u64, logged, "{flags}: frames in the log");
        fat::assert_clean(&recording.image());
    }
}

#[test]
fn a_card_that_fails_every_write_loses_everything_and_says_so() {
    let flags = ["--write-error", "1", "--seed", "4"];
    let recording =
        Recording::attempt(Machine::Sim, &own("px4_hil_quad_low.tlog"), &flags).expect_code(&[1, 3]);
    if recording.outcome.code == Some(3) {
        assert_eq!(recording.number("frames_lost"), recording.number("frames_in"));
    }
}
