//! Damaged bytes cost only the frames around them.

use std::fs;
use std::ops::Range;

use hums_tests::damage::{self, Random};
use hums_tests::flights::{Manifest, OWN, own, stream};
use hums_tests::program::{Machine, Recording};

struct Clean {
    stream: Vec<u8>,
    /// Places in the stream.
    frames: Vec<Range<usize>>,
}

impl Clean {
    fn read(name: &str) -> Self {
        let (path, manifest) = (own(name), Manifest::own());
        let data = fs::read(&path).unwrap();
        let input = manifest.frames_of(&path, &data);
        let stream = stream(manifest.found(&path).is_tlog, &data, &input);
        let mut end = 0;
        let frames = input.iter().map(|frame| {
            // In order, with other bytes between those of a raw recording.
            let mut windows = stream[end..].windows(frame.bytes.len());
            let start = end + windows.position(|window| window == frame.bytes).unwrap();
            end = start + frame.bytes.len();
            start..end
        });
        let frames = frames.collect();
        Self { stream, frames }
    }

    /// Keeps each whole frame and next to nothing else; every other byte is counted.
    #[track_caller]
    fn assert_whole_frames_survive(&self, noisy: &[u8], recording: &Recording) {
        assert_eq!(noisy.len(), self.stream.len());
        let whole: Vec<&[u8]> = self
            .frames
            .iter()
            .filter(|range| {
                let covered = range.start..range.start + covered(&self.stream[(*range).clone()]);
                noisy[covered.clone()] == self.stream[covered]
            })
            .map(|range| &noisy[range.clone()])
            .collect();
        assert!(
            whole.len() < self.frames.len() && whole.len() > self.frames.len() / 4,
            "{} whole",
            whole.len()
        );

        assert_eq!(recording.number("frames_lost"), 0);
        let decoded = recording.decode(&[0]);
        let output = decoded.frames(&Manifest::own().seeds);
        let mut survivors = output.iter();
        let mut missing = Vec::new();
        for frame in &whole {
            let before = survivors.clone();
            if !survivors.any(|survivor| survivor.bytes == *frame) {
                missing.push(*frame);
                survivors = before;
            }
        }
        let first = missing.first();
        assert!(
            missing.is_empty(),
            "{} of {} whole frames are missing: {first:02x?}",
            missing.len(),
            whole.len()
        );
        let invented = output.len() - whole.len();
        assert!(invented <= whole.len() / 2000, "{invented} frames came out that never went in whole");
        let framed: usize = output.iter().map(|frame| frame.bytes.len()).sum();
        assert_eq!(recording.number("bytes_not_frames"), (noisy.len() - framed) as u64, "damage is counted");
    }
}

/// The checksum covers these bytes, itself included. Damage to a signature shows only with the key: such a frame
/// counts.
fn covered(frame: &[u8]) -> usize {
    let signed = frame[0] == 0xFD && frame[2] & 1 == 1;
    if signed { frame.len() - 13 } else { frame.len() }
}

#[test]
fn each_frame_that_is_not_itself_damaged_survives() {
    for (seed, name) in OWN.into_iter().enumerate() {
        let clean = Clean::read(name);
        let mut noisy = clean.stream.clone();
        damage::noise(&mut noisy, 0.001, seed as u64);
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("noisy.raw");
        fs::write(&file, &noisy).unwrap();
        clean.assert_whole_frames_survive(&noisy, &Recording::make(Machine::Sim, &file, &[]));
    }
}

#[test]
fn each_frame_that_the_programs_own_noise_leaves_whole_survives() {
    const FLIGHT: &str = "px4_hil_quad_low.tlog";
    let dir = tempfile::tempdir().unwrap();
    let tap = dir.path().join("tap.raw");
    let flags = ["--noise", "0.01", "--seed", "1", "--tap", &tap.display().to_string()];
    let recording = Recording::make(Machine::Sim, &own(FLIGHT), &flags);
    Clean::read(FLIGHT).assert_whole_frames_survive(&fs::read(&tap).unwrap(), &recording);
}

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
fn noise_behind_a_frame_is_counted_and_is_no_flight() {
    let mut random = Random::new(11);
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("noise.raw");
    let clean = Clean::read("px4_hil_quad_low.tlog");
    // Without a frame it is not a recording.
    let noise = [&clean.stream[clean.frames[0].clone()], &random.bytes(3_000_000)].concat();
    fs::write(&file, &noise).unwrap();
    let recording = Recording::make(Machine::Sim, &file, &[]);
    assert_eq!(recording.number("bytes_in"), noise.len() as u64);
    let decoded = recording.decode(&[0]);
    let verified = decoded.frames(&Manifest::own().seeds).iter().filter(|frame| frame.verified).count();
    // One start byte in some 65,536 passes by chance.
    assert!(verified < 20, "{verified} frames in noise");
}
