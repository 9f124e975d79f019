//! Invalid files: a clear error or a counted loss, without a panic, a hang or much memory.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use hums_tests::damage::Random;
use hums_tests::flights::{Manifest, own};
use hums_tests::program::{Machine, Recording, hums, hums_with};

/// KiB, for the inputs here.
const MEMORY_KIB_MAX: u64 = 40 << 10;
/// Nearly all of it is a hole.
const ENORMOUS: u64 = 42 << 20;

fn readers(file: &Path, out: &Path) -> [Vec<String>; 3] {
    let (file, out) = (file.display().to_string(), out.display().to_string());
    [
        vec!["info".into(), file.clone()],
        vec!["info".into(), "--verify".into(), file.clone()],
        ["decode", &file, "-o", &out, "--format", "tlog"].map(str::to_owned).into(),
    ]
}

/// Code 1 and a message.
#[track_caller]
fn assert_refused(file: &Path) {
    let dir = tempfile::tempdir().unwrap();
    for arguments in readers(file, &dir.path().join("out")) {
        let outcome = hums(&arguments).expect_clear_failure();
        assert!(outcome.memory_kib_max < MEMORY_KIB_MAX, "{arguments:?} took {} KiB", outcome.memory_kib_max);
    }
}

fn sparse(path: PathBuf, length: u64) -> PathBuf {
    File::create(&path).unwrap().set_len(length).unwrap();
    path
}

#[test]
fn an_image_that_is_no_fat_costs_counted_frames_and_is_left_as_it_was() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    let flight = own("px4_hil_quad_low.tlog");
    let sim = ["sim".as_ref(), "--json".as_ref(), flight.as_os_str()];
    let sim = || hums(sim.into_iter().chain(["--sd".as_ref(), image.as_os_str()]));
    let somebodys = Random::new(6).bytes(40 << 20);
    fs::write(&image, &somebodys).unwrap();
    sim().expect_code(&[1]);
    assert!(fs::read(&image).unwrap() == somebodys, "somebody else's data was overwritten");
    // Like a box without a usable card: all frames count as lost.
    let before = vec![0; 40 << 20];
    fs::write(&image, &before).unwrap();
    let outcome = sim().expect_code(&[3]);
    let json: serde_json::Value = serde_json::from_str(&outcome.text()).unwrap();
    assert!(json["frames_lost"] == json["frames_in"] && json["blocks_written"] == 0, "{json}");
    assert!(json["findings"].to_string().contains("critical"), "it says so: {json}");
    assert!(fs::read(&image).unwrap() == before, "nobody asked for a format");
}

#[test]
fn what_is_no_log_is_refused_in_little_memory_also_if_it_is_enormous() {
    let dir = tempfile::tempdir().unwrap();
    for length in [0, 1, 511, 512, 4096] {
        assert_refused(&sparse(dir.path().join(format!("short-{length}")), length));
    }
    assert_refused(&sparse(dir.path().join("large.img"), 1 << 30));
    // More bytes than 32 bits count.
    let enormous = sparse(dir.path().join("enormous.img"), (4 << 30) + 512);
    let outcome = hums_with("info {}", &[&enormous]).expect_clear_failure();
    assert!(outcome.memory_kib_max < MEMORY_KIB_MAX, "{} KiB", outcome.memory_kib_max);
    let garbage = dir.path().join("garbage.img");
    fs::write(&garbage, Random::new(5).bytes(5_000_000)).unwrap();
    assert_refused(&garbage);
    // Without a frame it is not a recording.
    let raw = sparse(dir.path().join("enormous.raw"), ENORMOUS);
    let flight = fs::read(own("px4_hil_quad_low.tlog")).unwrap();
    let frame = Manifest::own().frames_of(&own("px4_hil_quad_low.tlog"), &flight)[0].bytes;
    File::options().write(true).open(&raw).unwrap().write_all(frame).unwrap();
    let recording = Recording::attempt(Machine::Sim, &raw, &[]);
    let outcome = &recording.outcome;
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(outcome.memory_kib_max < MEMORY_KIB_MAX, "{} KiB", outcome.memory_kib_max);
    assert_eq!(recording.number("bytes_not_frames"), ENORMOUS - frame.len() as u64);
}

#[test]
fn a_folder_that_cannot_be_made_is_a_clear_failure() {
    let recording = Recording::make(Machine::Sim, &own("px4_hil_quad_low.tlog"), &["--card-size", "64"]);
    // A file has the folder's name.
    let blocked = recording.gs().join("out");
    let image = recording.image();
    hums_with("decode {} -o {} --format tlog", &[&image, &blocked]).expect_clear_failure();
    let nowhere = recording.image().with_file_name("nowhere").join("card.img");
    let flight = own("px4_hil_quad_low.tlog");
    hums_with("sim {} --sd {}", &[&flight, &nowhere]).expect_clear_failure();
}
