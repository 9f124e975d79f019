//! Invalid files: a clear error or a counted loss, without a panic, a hang or much memory.

use std::fs::{self, File, Permissions};
use std::io::Write as _;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};

use hums_tests::damage::Random;
use hums_tests::flights::{Manifest, own};
use hums_tests::program::{Decoded, Machine, Recording, hums};

/// KiB, for any input.
const MEMORY_KIB_MAX: u64 = 120 << 10;
/// Nearly all of it is a hole.
const ENORMOUS: u64 = 140 << 20;

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

/// An exit code of the contract, without a panic.
#[track_caller]
fn assert_survived(file: &Path) {
    let dir = tempfile::tempdir().unwrap();
    for arguments in readers(file, &dir.path().join("out")) {
        let outcome = hums(&arguments).expect_code(&[0, 1, 3]);
        assert!(outcome.memory_kib_max < MEMORY_KIB_MAX, "{arguments:?} took {} KiB", outcome.memory_kib_max);
    }
}

fn sparse(path: PathBuf, length: u64) -> PathBuf {
    File::create(&path).unwrap().set_len(length).unwrap();
    path
}

#[test]
fn a_missing_file_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let missing = dir.path().join("no-such-file.img");
    assert_refused(&missing);
    let outcome = hums(["info".as_ref(), missing.as_os_str()]).expect_clear_failure();
    assert!(outcome.stderr.contains("no-such-file.img"), "{}", outcome.stderr);
    let outcome = Recording::attempt(Machine::Sim, &missing, &[]).outcome.expect_clear_failure();
    assert!(outcome.stderr.contains("no-such-file.img"), "{}", outcome.stderr);
}

#[test]
fn a_folder_is_no_recording() {
    let dir = tempfile::tempdir().unwrap();
    Recording::attempt(Machine::Sim, dir.path(), &[]).outcome.expect_clear_failure();
}

#[test]
fn an_empty_recording_is_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let empty = sparse(dir.path().join("empty.tlog"), 0);
    let outcome = Recording::attempt(Machine::Sim, &empty, &[]).outcome.expect_clear_failure();
    assert!(outcome.stderr.contains("empty.tlog"), "{}", outcome.stderr);
}

#[test]
fn empty_and_short_files_are_no_logs() {
    let dir = tempfile::tempdir().unwrap();
    for length in [0, 1, 511, 512, 4096] {
        assert_refused(&sparse(dir.path().join(format!("short-{length}")), length));
    }
}

#[test]
fn garbage_is_no_log() {
    let dir = tempfile::tempdir().unwrap();
    let garbage = dir.path().join("garbage.img");
    fs::write(&garbage, Random::new(5).bytes(5_000_000)).unwrap();
    assert_refused(&garbage);
}

#[test]
fn text_is_no_recording_and_no_log() {
    let dir = tempfile::tempdir().unwrap();
    let text = dir.path().join("text.tlog");
    fs::write(&text, "this is a text, and not a flight\n".repeat(20_000)).unwrap();
    assert_refused(&text);
    let recording = Recording::attempt(Machine::Sim, &text, &[]);
    assert!(!recording.image().exists(), "a card was made of it");
    let outcome = recording.outcome.expect_clear_failure();
    assert!(outcome.stderr.contains("no MAVLink frame"), "{}", outcome.stderr);
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
fn a_truncated_recording_gives_all_but_its_last_frame() {
    let path = own("px4_hil_quad_low.tlog");
    let manifest = Manifest::own();
    let data = fs::read(&path).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let mut random = Random::new(9);
    for round in 0..5 {
        let length = 100_000 + random.below(100_000) as usize;
        let file = dir.path().join(format!("cut-{round}.tlog"));
        fs::write(&file, &data[..length]).unwrap();
        let expected = hums_tests::frames::of_tlog(&data, &manifest.seeds, true)
            .into_iter()
            .scan(0, |end, frame| {
                *end += 8 + frame.bytes.len();
                (*end <= length).then_some(frame)
            })
            .collect::<Vec<_>>();
        let recording = Recording::attempt(Machine::Sim, &file, &[]).expect_code(&[0, 3]);
        let decoded = recording.decode(&[0]);
        hums_tests::frames::assert_same(&expected, &decoded.frames(&manifest.seeds), &data[..length]);
    }
}

#[test]
fn truncated_images_are_read_as_far_as_they_go() {
    let recording = Recording::make(Machine::Sim, &own("px4_hil_quad_low.tlog"), &["--card-size", "64"]);
    let manifest = Manifest::own();
    let whole = recording.decode(&[0]);
    let whole = whole.frames(&manifest.seeds);
    let dir = tempfile::tempdir().unwrap();
    let mut random = Random::new(10);
    for round in 0..6 {
        let file = dir.path().join(format!("cut-{round}.img"));
        fs::copy(recording.image(), &file).unwrap();
        File::options().write(true).open(&file).unwrap().set_len(random.below(4 << 20)).unwrap();
        assert_survived(&file);
    }
    let data = fs::read(recording.image()).unwrap();
    let end = 512 * data.chunks(512).rposition(|block| block.starts_with(&[0x48, 0xb3])).unwrap();
    let file = dir.path().join("half.img");
    fs::write(&file, &data[..end / 2]).unwrap();
    let half = Decoded::of(&file, &[0, 1, 3]);
    let half = half.frames(&manifest.seeds);
    assert!(
        half.len() < whole.len() && half.iter().zip(&whole).all(|(a, b)| a.bytes == b.bytes),
        "no prefix"
    );
}

#[test]
fn damaged_images_are_survived_and_give_no_wrong_frame() {
    let recording = Recording::make(Machine::Sim, &own("px4_hil_quad_low.tlog"), &["--card-size", "64"]);
    let manifest = Manifest::own();
    let whole = recording.decode(&[0]);
    let whole = whole.frames(&manifest.seeds);
    let good = fs::read(recording.image()).unwrap();
    let used: Vec<usize> =
        (0..good.len()).step_by(512).filter(|at| good[*at..*at + 512].iter().any(|b| *b != 0)).collect();
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("damaged.img");
    let mut random = Random::new(12);
    for _ in 0..8 {
        let mut bad = good.clone();
        for _ in 0..=random.below(8) {
            let at = used[random.below(used.len() as u64) as usize] + random.below(512) as usize;
            let length = 1 + random.below(600) as usize;
            let end = (at + length).min(bad.len());
            let noise = random.bytes(end - at);
            bad[at..end].copy_from_slice(&noise);
        }
        fs::write(&file, &bad).unwrap();
        assert_survived(&file);
        let decoded = Decoded::of(&file, &[0, 1, 3]);
        let mut originals = whole.iter();
        for frame in decoded.frames(&manifest.seeds) {
            assert!(
                originals.any(|original| original.bytes == frame.bytes),
                "a frame that never was: {frame:02x?}"
            );
        }
    }
}

#[test]
fn enormous_files_take_little_memory_and_an_end() {
    let dir = tempfile::tempdir().unwrap();
    assert_refused(&sparse(dir.path().join("enormous.img"), 4 << 30));
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
fn a_read_only_image_is_read_and_not_recorded_to() {
    let recording = Recording::make(Machine::Sim, &own("px4_hil_quad_low.tlog"), &["--card-size", "64"]);
    let frames = recording.number("frames_in");
    let image = recording.image();
    fs::set_permissions(&image, Permissions::from_mode(0o444)).unwrap();
    assert_eq!(recording.decode(&[0]).frames(&Manifest::own().seeds).len() as u64, frames);
    let before = fs::read(&image).unwrap();
    let flight = own("px4_hil_quad_low.tlog");
    let arguments = ["sim".as_ref(), flight.as_os_str(), "--sd".as_ref(), image.as_os_str()];
    // Also for root, who may write to it.
    hums(arguments).expect_clear_failure();
    assert!(fs::read(&image).unwrap() == before, "the image changed");
}

#[test]
fn a_folder_that_cannot_be_made_is_a_clear_failure() {
    let recording = Recording::make(Machine::Sim, &own("px4_hil_quad_low.tlog"), &["--card-size", "64"]);
    // A file has the folder's name.
    let blocked = recording.gs().join("out");
    let image = recording.image();
    let arguments = ["decode".as_ref(), image.as_os_str(), "-o".as_ref(), blocked.as_os_str()];
    hums(arguments.into_iter().chain(["--format".as_ref(), "tlog".as_ref()])).expect_clear_failure();
    let nowhere = recording.image().with_file_name("nowhere").join("card.img");
    let flight = own("px4_hil_quad_low.tlog");
    let arguments = ["sim".as_ref(), flight.as_os_str(), "--sd".as_ref(), nowhere.as_os_str()];
    hums(arguments).expect_clear_failure();
}

#[test]
fn words_that_are_no_command_are_a_usage_error() {
    let flight = own("px4_hil_quad_low.tlog").display().to_string();
    for arguments in [
        vec!["no-such-command"],
        vec!["sim"],
        vec!["sim", &flight],
        vec!["sim", &flight, "--sd", "/tmp/never-made.img", "--speed", "fast"],
        vec!["sim", &flight, "--sd", "/tmp/never-made.img", "--noise", "often"],
        vec!["sim", &flight, "--sd", "/tmp/never-made.img", "--stall", "2500"],
        vec!["decode", &flight],
        vec!["decode", &flight, "-o", "/tmp/never-made", "--format", "docx"],
        vec!["info"],
    ] {
        let outcome = hums(&arguments).expect_code(&[2]);
        assert!(!outcome.stderr.is_empty() && outcome.stdout.is_empty(), "{arguments:?}");
    }
    assert!(!Path::new("/tmp/never-made.img").exists());
}

#[test]
fn help_is_no_error() {
    let outcome = hums(["--help"]).expect_code(&[0]);
    for command in ["check", "report", "live", "decode", "info", "sim", "box"] {
        assert!(outcome.text().contains(command), "{command}");
        let help = hums([command, "--help"]).expect_code(&[0]);
        assert!(help.text().contains("hums "), "{command} --help shows an example");
    }
}
