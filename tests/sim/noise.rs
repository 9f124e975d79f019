//! Damaged bytes cost only the frames around them. `cargo xtask prove noise` shows that each whole frame is recorded.

use std::fs;

use hums_tests::damage::Random;
use hums_tests::flights::{Manifest, own, stream};
use hums_tests::program::{Machine, Recording};

const FLIGHT: &str = "px4_hil_quad_low.tlog";

#[test]
fn the_programs_own_noise_damages_as_much_as_it_says_and_the_rest_is_counted() {
    let (path, manifest, dir) = (own(FLIGHT), Manifest::own(), tempfile::tempdir().unwrap());
    let data = fs::read(&path).unwrap();
    let input = manifest.frames_of(&path, &data);
    let clean = stream(true, &data, &input);
    for (probability, seed) in [(0.001, "1"), (0.01, "3")] {
        let tap = dir.path().join(format!("{seed}.raw"));
        let (p, to) = (probability.to_string(), tap.display().to_string());
        let recording = Recording::make(Machine::Sim, &path, &["--noise", &p, "--seed", seed, "--tap", &to]);
        let noisy = fs::read(&tap).unwrap();
        let hit = noisy.iter().zip(&clean).filter(|(noisy, clean)| noisy != clean).count();
        let within = |found: f64, chances: &mut dyn Iterator<Item = f64>| {
            let (expected, variance) = chances.fold((0.0, 0.0), |(sum, variance), chance| {
                (sum + chance, variance + chance * (1.0 - chance))
            });
            assert!((found - expected).abs() < 5.0 * variance.sqrt(), "{p}: {found}, expected {expected:.0}");
        };
        assert_eq!(noisy.len(), clean.len());
        within(hit as f64, &mut clean.iter().map(|_| probability));
        let survives = |frame: &[u8]| (1.0_f64 - probability).powi(frame.len() as i32);
        within(
            recording.number("frames_logged") as f64,
            &mut input.iter().map(|frame| survives(frame.bytes)),
        );
        assert_eq!(recording.number("frames_lost"), 0);
        let decoded = recording.decode(&[0]);
        let framed: usize = decoded.frames(&manifest.seeds).iter().map(|frame| frame.bytes.len()).sum();
        assert_eq!(recording.number("bytes_not_frames"), (noisy.len() - framed) as u64, "damage is counted");
    }
}

#[test]
fn noise_behind_a_frame_is_counted_and_is_no_flight() {
    let (dir, manifest) = (tempfile::tempdir().unwrap(), Manifest::own());
    let file = dir.path().join("noise.raw");
    let data = fs::read(own(FLIGHT)).unwrap();
    // Without a frame it is not a recording.
    let noise =
        [manifest.frames_of(&own(FLIGHT), &data)[0].bytes, &Random::new(11).bytes(3_000_000)].concat();
    fs::write(&file, &noise).unwrap();
    let recording = Recording::make(Machine::Sim, &file, &[]);
    assert_eq!(recording.number("bytes_in"), noise.len() as u64);
    let decoded = recording.decode(&[0]);
    let verified = decoded.frames(&manifest.seeds).iter().filter(|frame| frame.verified).count();
    // One start byte in some 65,536 passes by chance.
    assert!(verified < 20, "{verified} frames in noise");
}
