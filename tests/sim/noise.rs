//! Damaged bytes cost the frames that they are in, and no others.

use std::fs;

use hums_tests::damage::{self, Random};
use hums_tests::flights::{Manifest, OWN, own, stream};
use hums_tests::program::{Machine, Recording};

/// Damages the bytes of each flight by itself, so that it is known which frames are whole, and expects each of those.
#[test]
fn each_frame_that_is_not_itself_damaged_survives() {
    let manifest = Manifest::own();
    for (seed, name) in OWN.into_iter().enumerate() {
        let path = own(name);
        let data = fs::read(&path).unwrap();
        let input = manifest.frames_of(&path, &data);
        let clean = stream(manifest.found(&path).is_tlog, &data, &input);
        let mut noisy = clean.clone();
        let hits = damage::noise(&mut noisy, 0.001, seed as u64);

        // Where each frame lies in the stream: its frames are in order, with other bytes between those of a raw file.
        let mut at = 0;
        let mut whole = Vec::new();
        for frame in &input {
            let start =
                at + clean[at..].windows(frame.bytes.len()).position(|window| window == frame.bytes).unwrap();
            at = start + frame.bytes.len();
            if !hits[start..at].contains(&true) {
                whole.push(frame.bytes);
            }
        }
        assert!(whole.len() < input.len() && whole.len() > input.len() / 2, "{} whole", whole.len());

        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("noisy.raw");
        fs::write(&file, &noisy).unwrap();
        let recording = Recording::make(Machine::Sim, &file, &[]);
        assert_eq!(recording.number("frames_lost"), 0, "{name}");
        let decoded = recording.decode(&[0]);
        let output = decoded.frames(&manifest.seeds);

        let mut survivors = output.iter();
        let mut missing = Vec::new();
        for (index, frame) in whole.iter().enumerate() {
            let before = survivors.clone();
            if !survivors.any(|survivor| survivor.bytes == *frame) {
                missing.push((index, *frame));
                survivors = before;
            }
        }
        let first = missing.first();
        assert!(
            missing.is_empty(),
            "{name}: {} of {} whole frames are missing, first {first:02x?}",
            missing.len(),
            whole.len()
        );
        let invented = output.len() - whole.len();
        assert!(
            invented <= whole.len() / 1000,
            "{name}: {invented} frames came out that never went in whole"
        );
        let framed: usize = output.iter().map(|frame| frame.bytes.len()).sum();
        assert_eq!(
            recording.number("bytes_not_frames"),
            (noisy.len() - framed) as u64,
            "{name}: damage is counted"
        );
    }
}

/// As many frames survive the program's own noise as chance lets: within five standard deviations.
#[test]
fn the_noise_flag_damages_as_much_as_it_says_and_all_of_it_is_counted() {
    let path = own("px4_hil_quad_low.tlog");
    let manifest = Manifest::own();
    let data = fs::read(&path).unwrap();
    let input = manifest.frames_of(&path, &data);
    for (probability, seed) in [("0.001", "1"), ("0.001", "2"), ("0.01", "3")] {
        let p: f64 = probability.parse().unwrap();
        let chances = || input.iter().map(|frame| (1.0 - p).powi(frame.bytes.len() as i32));
        let expected: f64 = chances().sum();
        let deviation = chances().map(|chance| chance * (1.0 - chance)).sum::<f64>().sqrt();

        let recording = Recording::make(Machine::Sim, &path, &["--noise", probability, "--seed", seed]);
        assert_eq!(recording.number("frames_lost"), 0);
        let decoded = recording.decode(&[0]);
        let output = decoded.frames(&manifest.seeds);
        let difference = (output.len() as f64 - expected).abs();
        assert!(
            difference < 5.0 * deviation,
            "{} survive, expected {expected:.0} +- {deviation:.0}",
            output.len()
        );
        assert_eq!(recording.number("frames_logged"), output.len() as u64);
        assert!(recording.number("bytes_not_frames") > 0);

        // What survives is from the flight, in its order.
        let mut originals = input.iter();
        let strange = output.iter().filter(|frame| {
            let before = originals.clone();
            let found = originals.any(|original| original.bytes == frame.bytes);
            if !found {
                originals = before;
            }
            !found
        });
        assert!(strange.count() <= output.len() / 1000, "frames that never went in");
    }
}

#[test]
fn pure_noise_is_counted_and_is_no_flight() {
    let mut random = Random::new(11);
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("noise.raw");
    let noise = random.bytes(3_000_000);
    fs::write(&file, &noise).unwrap();
    let recording = Recording::make(Machine::Sim, &file, &[]);
    assert_eq!(recording.number("bytes_in"), noise.len() as u64);
    let decoded = recording.decode(&[0]);
    let verified = decoded.frames(&Manifest::own().seeds).iter().filter(|frame| frame.verified).count();
    // Chance alone lets one start byte in some 65,536 through.
    assert!(verified < 20, "{verified} frames in noise");
}
