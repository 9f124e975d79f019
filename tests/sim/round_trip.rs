//! Every valid frame leaves the card bit for bit, in order, with its arrival time.

use std::fs;
use std::path::Path;

use hums_tests::child;
use hums_tests::flights::{Manifest, OWN, assert_found, own, stream};
use hums_tests::frames::{self, Frame, build_v2};
use hums_tests::program::{self, Decoded, LIMIT, Machine, Recording};

#[track_caller]
fn round_trip(path: &Path, manifest: &Manifest) {
    let data = fs::read(path).unwrap();
    let input = manifest.frames_of(path, &data);
    let found = manifest.found(path);
    assert_found(found, &input);

    let recording = Recording::make(Machine::Sim, path, &[]);
    let decoded = recording.decode(&[0]);
    let output = decoded.frames(&manifest.seeds);
    let bytes = stream(found.is_tlog, &data, &input);
    frames::assert_same(&input, &output, &bytes);
    assert_found(found, &output);

    assert_eq!(recording.number("frames_lost"), 0);
    assert_eq!(recording.number("frames_logged"), output.len() as u64, "logged, and found in the log");
    assert_eq!(recording.number("frames_in"), output.len() as u64);
    // A damaged tlog's bytes outside its records count too.
    assert!(recording.number("bytes_in") >= bytes.len() as u64, "every byte arrives");
    let framed: u64 = output.iter().map(|frame| frame.bytes.len() as u64).sum();
    assert_eq!(
        recording.number("bytes_in"),
        framed + recording.number("bytes_not_frames"),
        "each byte is accounted for"
    );
    assert!(recording.number("queue_bytes_max") <= recording.number("queue_bytes_capacity"));
    assert_times_kept(&input, &output);
}

/// To 1 ms, and 1 ms for rounding at either end. A clock that was set back leaves only the order.
#[track_caller]
fn assert_times_kept(input: &[Frame<'_>], output: &[Frame<'_>]) {
    let times = |frames: &[Frame<'_>]| -> Option<Vec<u64>> {
        frames.iter().filter(|frame| frame.verified).map(|frame| frame.time_us).collect()
    };
    let (Some(before), Some(after)) = (times(input), times(output)) else { return };
    let monotonic = before.windows(2).take_while(|pair| pair[0] <= pair[1]).count();
    let Some((first_before, first_after)) = before.first().zip(after.first()) else { return };
    for index in 0..monotonic {
        let (elapsed_before, elapsed_after) =
            (before[index] - first_before, after[index].wrapping_sub(*first_after));
        let difference = elapsed_before.abs_diff(elapsed_after);
        assert!(difference <= 2_000, "frame {index}: {elapsed_before} us became {elapsed_after} us");
    }
}

/// Of both autopilots, one signed with boot text.
#[test]
fn each_flight_comes_out_bit_for_bit() {
    OWN.map(own).iter().for_each(|path| round_trip(path, Manifest::own()));
}

#[cfg(feature = "oracle")]
#[test]
#[ignore = "further recordings (HUMS_FLIGHTS names no folder of them)"]
fn every_further_recording_comes_out_bit_for_bit() {
    let files = hums_tests::flights::further();
    let manifest = hums_tests::oracle::manifest(&files);
    for file in files {
        eprintln!("{}", file.display());
        round_trip(&file, &manifest);
    }
}

/// `HUMS_WRITE_DOCS=1 cargo xtask test --only sim` writes the manifest.
#[cfg(feature = "oracle")]
#[test]
fn the_manifest_is_what_pymavlink_finds() {
    let files: Vec<_> = OWN.into_iter().map(own).collect();
    let text = hums_tests::oracle::manifest_text(&files);
    if std::env::var_os("HUMS_WRITE_DOCS").is_some() {
        fs::write(own("manifest.json"), &text).unwrap();
    }
    let fresh = Manifest::parse(&text);
    for file in &files {
        assert_eq!(fresh.found(file), Manifest::own().found(file), "{}", file.display());
    }
    assert_eq!(fresh.seeds, Manifest::own().seeds);
}

#[test]
fn two_runs_are_the_same_to_the_byte_and_their_counters_add_up() {
    let flight = own("px4_hil_quad_low.tlog");
    let flags = ["--noise", "0.001", "--stall", "700@20", "--write-error", "0.001", "--seed", "5"];
    let [first, second] = [(); 2].map(|()| Recording::make(Machine::Sim, &flight, &flags));
    assert_eq!(first.outcome.text(), second.outcome.text(), "--json");
    let gs = fs::read(first.gs()).unwrap();
    assert!(fs::read(first.image()).unwrap() == fs::read(second.image()).unwrap(), "the images differ");
    assert!(gs == fs::read(second.gs()).unwrap(), "the ground station's bytes differ");
    assert_eq!(first.number("frames_in"), first.number("frames_logged") + first.number("frames_lost"));
    assert_eq!(first.number("gs_bytes"), gs.len() as u64);
    assert!(first.number("bytes_not_frames") > 0);
    // A write begins at the latest 200 ms after the stall's start.
    assert!((500..=750).contains(&first.number("sd_stall_ms_max")), "{}", first.number("sd_stall_ms_max"));
    assert!(first.number("queue_bytes_max") <= first.number("queue_bytes_capacity"));
}

#[test]
fn a_second_flight_on_the_same_card_leaves_the_first_as_it_was() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    for flight in ["px4_hil_quad_low.tlog", "ap_quad_guided.tlog"] {
        let mut command = program::command(["sim", "--speed", "max"]);
        child::run(command.arg(own(flight)).arg("--sd").arg(&image), LIMIT).expect_code(&[0]);
    }
    let manifest = Manifest::own();
    let decoded = Decoded::of(&image, &[0]);
    let all = decoded.frames(&manifest.seeds);
    let first = manifest.found(&own("px4_hil_quad_low.tlog"));
    let second = manifest.found(&own("ap_quad_guided.tlog"));
    assert_eq!(all.len() as u64, first.frames + second.frames);
    assert_found(first, &all[..first.frames as usize]);
    assert_found(second, &all[first.frames as usize..]);
}

#[test]
fn ids_that_no_dialect_knows_come_out_among_those_that_it_knows() {
    let seeds = &Manifest::own().seeds;
    assert!(!seeds.contains_key(&0x00AB_CDEF));
    let mut data = Vec::new();
    for sequence in 0..200_u8 {
        data.extend(build_v2(sequence, 0, &[4, 0, 0, 0, 2, 3, 0x51, 4, 3], seeds[&0]));
        data.extend(build_v2(sequence, 0x00AB_CDEF, &[sequence; 40], 99));
    }
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("unknown.raw");
    fs::write(&file, &data).unwrap();
    let recording = Recording::make(Machine::Sim, &file, &[]);
    let decoded = recording.decode(&[0]);
    let output: Vec<u8> = decoded.frames(seeds).iter().flat_map(|frame| frame.bytes).copied().collect();
    assert!(output == data, "{} of {} bytes came out", output.len(), data.len());
    assert_eq!(recording.number("bytes_not_frames"), 0);
}
