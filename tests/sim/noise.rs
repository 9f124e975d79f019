//! Damaged bytes cost only the frames around them.

use std::fs;
use std::ops::Range;

use hums_tests::damage::Random;
use hums_tests::flights::{Manifest, own, stream};
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

/// `cargo xtask prove noise` has all recordings.
#[test]
fn the_programs_own_noise_damages_as_much_as_it_says_and_each_whole_frame_survives() {
    const FLIGHT: &str = "px4_hil_quad_low.tlog";
    let (clean, dir) = (Clean::read(FLIGHT), tempfile::tempdir().unwrap());
    for (probability, seed) in [(0.001, "1"), (0.01, "3")] {
        let tap = dir.path().join(format!("{seed}.raw"));
        let (p, to) = (probability.to_string(), tap.display().to_string());
        let flags = ["--noise", &p, "--seed", seed, "--tap", &to];
        let recording = Recording::make(Machine::Sim, &own(FLIGHT), &flags);
        clean.assert_whole_frames_survive(&fs::read(&tap).unwrap(), &recording);
        let chances = || clean.frames.iter().map(|frame| (1.0_f64 - probability).powi(frame.len() as i32));
        let expected: f64 = chances().sum();
        let deviation = chances().map(|chance| chance * (1.0 - chance)).sum::<f64>().sqrt();
        let survived = recording.number("frames_logged") as f64;
        assert!(
            (survived - expected).abs() < 5.0 * deviation,
            "{survived} survive, expected {expected:.0} +- {deviation:.0}"
        );
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
