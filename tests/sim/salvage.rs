//! Cards without a file system, deleted files, partly overwritten logs.

use std::fs::{self, File};
use std::os::unix::fs::FileExt as _;
use std::path::Path;
use std::process::Command;

use hums_tests::flights::{Manifest, OWN, own, stream};
use hums_tests::frames::{self, Frame};
use hums_tests::program::{Decoded, Machine, Recording, hums, hums_with};
use serde_json::Value;

const BLOCK: u64 = 512;

/// Bytes on the card; the first cluster is the directory.
struct Places {
    partition: u64,
    fat: u64,
    data: u64,
    cluster_bytes: u64,
}

fn places(image: &Path) -> Places {
    let file = File::open(image).unwrap();
    let number = |at: u64, bytes: usize| {
        let mut word = [0; 8];
        file.read_exact_at(&mut word[..bytes], at).unwrap();
        u64::from_le_bytes(word)
    };
    let partition = number(446 + 8, 4) * BLOCK;
    let fat = partition + number(partition + 14, 2) * BLOCK;
    let data = fat + number(partition + 36, 4) * number(partition + 16, 1) * BLOCK;
    Places { partition, fat, data, cluster_bytes: number(partition + 13, 1) * BLOCK }
}

fn zero(image: &Path, from: u64, to: u64) {
    let file = File::options().write(true).open(image).unwrap();
    file.write_all_at(&vec![0; (to - from) as usize], from).unwrap();
}

fn json(command: &str, image: &Path, flags: &[&str], code: i32) -> Value {
    let words = command.split(' ').chain(["--json"]).chain(flags.iter().copied()).map(AsRef::as_ref);
    let outcome = hums(words.chain([image.as_os_str()])).expect_code(&[code]);
    serde_json::from_str(&outcome.text()).unwrap()
}

type Wreck = fn(&Path);

const WRECKS: [(&str, Wreck); 5] = [
    ("the FAT is zeros", |image| {
        let Places { fat, data, .. } = places(image);
        zero(image, fat, data);
    }),
    ("the directory is zeros", |image| {
        let Places { data, cluster_bytes, .. } = places(image);
        zero(image, data, data + cluster_bytes);
    }),
    ("the partition table is zeros", |image| zero(image, 0, BLOCK)),
    ("the volume's first blocks are zeros", |image| {
        let Places { partition, .. } = places(image);
        zero(image, partition, partition + 8 * BLOCK);
    }),
    // Valid and empty, and may have had more data than remains.
    ("its file system knows of no log, and sectors of logs are there", |image| {
        let Places { fat, data, cluster_bytes, .. } = places(image);
        zero(image, fat, data + cluster_bytes);
        // Media, flags, root directory.
        let head = [0x0fff_fff8_u32, 0x0fff_ffff, 0x0fff_ffff].map(u32::to_le_bytes).concat();
        File::options().write(true).open(image).unwrap().write_all_at(&head, fat).unwrap();
    }),
];

#[test]
fn a_card_without_a_file_system_gives_all_that_is_on_it() {
    let manifest = Manifest::own();
    // A flight for each.
    for (name, (what, wreck)) in OWN.into_iter().cycle().zip(WRECKS) {
        let recording = Recording::make(Machine::Sim, &own(name), &["--card-size", "64"]);
        let data = fs::read(own(name)).unwrap();
        let input = manifest.frames_of(&own(name), &data);
        let stream = stream(manifest.found(&own(name)).is_tlog, &data, &input);
        let image = recording.image();
        wreck(&image);
        eprintln!("{name}: {what}");
        // An empty directory alone means an empty card; the FAT contradicts.
        let info = json("info", &image, &[], 3);
        let told = &info["images"][0]["damage"];
        let is_told =
            if what.starts_with("its") { told == &serde_json::json!([what]) } else { told[0].is_string() };
        assert!(is_told, "{what}: {told}");
        assert_eq!(info["logs"].as_array().unwrap().len(), 1, "{what}: {info}");
        assert_eq!(info["logs"][0]["gaps_count"], 0, "{what}: the log itself is whole");
        for command in ["info", "info --verify", "check"] {
            changes_nothing(command, &image, what);
        }
        let decoded = Decoded::of(&image, &[3]);
        frames::assert_same(&input, &decoded.frames(&manifest.seeds), &stream);
    }
}

/// Evidence: no output advises a change.
#[track_caller]
fn changes_nothing(command: &str, image: &Path, what: &str) {
    let words = command.split(' ').map(AsRef::as_ref).chain([image.as_os_str()]);
    let outcome = hums(words).expect_code(&[3, 4]);
    let said = format!("{}{}", outcome.text(), outcome.stderr).to_ascii_lowercase();
    let words: Vec<&str> = said.split(|character: char| !character.is_ascii_alphabetic()).collect();
    for advice in ["format", "reformat", "erase", "delete", "fsck", "chkdsk", "repair"] {
        assert!(!words.contains(&advice), "{what}: {command} says `{advice}`: {said}");
    }
}

/// Its clusters are not free: it was not deleted.
#[test]
fn a_log_whose_directory_entry_is_lost_is_found_and_told_beside_others() {
    let recording = Recording::make(Machine::Sim, &own("px4_hil_quad_low.tlog"), &["--card-size", "64"]);
    let image = recording.image();
    record_more(&image, &own("ap_quad_guided.tlog"));
    let mut content = fs::read(&image).unwrap();
    let entry = content.windows(11).position(|name| name == b"00001_00HUM").unwrap();
    content[entry] = 0xe5;
    fs::write(&image, &content).unwrap();
    let info = json("info", &image, &[], 3);
    assert_eq!(info["logs"].as_array().unwrap().len(), 2, "{info}");
    assert!(info["images"][0]["damage"][0].as_str().unwrap().contains("belong to no file"), "{info}");
    assert_eq!(json("info --verify", &image, &[], 3)["logs"].as_array().unwrap().len(), 2);

    // Only parity remains, in clusters without a file.
    let Places { fat, data, cluster_bytes, .. } = places(&image);
    let first = entry_word(&content, entry + 26);
    let start = data as usize + (first - 2) * cluster_bytes as usize;
    let is_sector = |block: &&[u8]| block.starts_with(&[0x48, 0xB3]);
    let sectors = content[start..].chunks(BLOCK as usize).take_while(is_sector).count();
    let clusters = (sectors * BLOCK as usize).div_ceil(cluster_bytes as usize);
    content[entry..entry + 32].fill(0);
    content[fat as usize + 4 * first..][..4 * clusters].fill(0);
    // An entry of zeros ends the directory.
    content.copy_within(entry + 32..entry + 64, entry);
    content[entry + 32..entry + 64].fill(0);
    fs::write(&image, &content).unwrap();
    let info = json("info", &image, &[], 3);
    assert_eq!(info["logs"].as_array().unwrap().len(), 2, "{info}");
    assert!(info["images"][0]["damage"][0].as_str().unwrap().contains("sectors of logs in them"), "{info}");
    json("info --verify", &image, &[], 3);
}

fn entry_word(image: &[u8], at: usize) -> usize {
    usize::from(u16::from_le_bytes([image[at], image[at + 1]]))
}

#[test]
fn a_deleted_log_is_found_again() {
    let manifest = Manifest::own();
    for name in ["px4_hil_quad_low.tlog", "ap_quad_signed.raw"] {
        let recording = Recording::make(Machine::Sim, &own(name), &["--card-size", "64"]);
        let whole = recording.decode(&[0]);
        let whole = whole.frames(&manifest.seeds);
        let image = recording.image();
        record_more(&image, &own("px4_hil_quad_low.tlog"));
        let drive = format!("{}@@{}", image.display(), places(&image).partition);
        let deleted = Command::new("mdel").args(["-i", &drive, "::/00001_00.HUM"]).status().unwrap();
        assert!(deleted.success());
        let logs = json("info", &image, &[], 0);
        assert_eq!(logs["logs"].as_array().unwrap().len(), 1, "the file system knows of one");
        let found = json("info", &image, &["--salvage"], 0);
        assert_eq!(found["logs"].as_array().unwrap().len(), 2, "{name}: {found}");
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        hums_with("decode {} --salvage -o {} --format tlog", &[&image, &out]).expect_code(&[0]);
        let tlogs: Vec<_> =
            fs::read_dir(&out).unwrap().map(|file| fs::read(file.unwrap().path()).unwrap()).collect();
        let is_whole = |tlog: &Vec<u8>| {
            let frames = frames::of_tlog(tlog, &manifest.seeds, true);
            frames.len() == whole.len() && frames.iter().zip(&whole).all(|(a, b)| a.bytes == b.bytes)
        };
        assert!(tlogs.iter().any(is_whole), "{name}: the deleted log is not among them");
    }
}

fn record_more(image: &Path, flight: &Path) {
    let flags = ["--json", "--overwrite-oldest"].map(std::ffi::OsStr::new);
    let sim = ["sim".as_ref(), flags[0], flags[1], flight.as_os_str(), "--sd".as_ref()];
    hums(sim.into_iter().chain([image.as_os_str()])).expect_code(&[0]);
}

#[test]
fn an_older_log_that_a_newer_one_overwrites_gives_what_is_left_of_it_and_never_mixes_with_it() {
    let manifest = Manifest::own();
    let dir = tempfile::tempdir().unwrap();
    let (short, old) = (dir.path().join("short.raw"), own("px4_hil_quad_low.tlog"));
    let data = fs::read(&old).unwrap();
    let input = manifest.frames_of(&old, &data);
    fs::write(&short, stream(true, &data, &input[..400])).unwrap();
    // The last session overwrites the first one.
    let recording = Recording::make(Machine::Sim, &old, &["--card-size", "34"]);
    let image = recording.image();
    for _ in 0..40 {
        record_more(&image, &short);
        let logs = json("info", &image, &[], 0)["logs"].as_array().unwrap().clone();
        if logs[0]["name"] != "00001" {
            break;
        }
    }
    let logs = json("info", &image, &[], 0)["logs"].as_array().unwrap().clone();
    assert_ne!(logs[0]["name"], "00001", "the oldest is not overwritten yet");
    let newest = Decoded::of(&image, &[0]);
    let newest = frames::of_tlog(newest.tlogs().last().unwrap(), &manifest.seeds, true);
    assert_eq!(newest.len(), 400);
    assert!(newest.iter().zip(&input).all(|(a, b)| a.bytes == b.bytes));

    // From the next group on; no damage of the card.
    let found = json("info", &image, &["--salvage"], 0);
    let verify = hums_with("info --verify --salvage {}", &[&image]).expect_code(&[0]).text();
    assert!(
        verify.contains(
            "is in no file: it was deleted, its file lost its name, or newer sessions have written over it; "
        ),
        "{verify}"
    );
    let with_gaps: Vec<&Value> =
        found["logs"].as_array().unwrap().iter().filter(|log| log["gaps_count"] != 0).collect();
    assert_eq!(with_gaps.len(), 1, "only the oldest misses anything: {found}");
    let gap = &with_gaps[0]["gaps"][0];
    assert_eq!((&gap["from_s"], &gap["cause"]), (&Value::Null, &"missing".into()), "its beginning");
    assert!(gap["to_s"].as_f64().unwrap() > 0.0 && gap["frames_missing"].as_u64().unwrap() > 0, "{gap}");
    let out = dir.path().join("out");
    let decoded = hums_with("decode {} --salvage -o {} --format tlog", &[&image, &out]);
    let told = decoded.expect_code(&[0]).stderr;
    assert!(told.contains("is in no file: "), "{told}");
    let session = with_gaps[0]["name"].as_str().unwrap().strip_prefix("session-").unwrap();
    let files = fs::read_dir(&out).unwrap().map(|file| file.unwrap().path());
    let ending = format!("-s{session}.tlog");
    let rest = files.filter(|path| path.to_string_lossy().ends_with(&ending)).last().unwrap();
    let rest = fs::read(rest).unwrap();
    let rest: Vec<Frame<'_>> = frames::of_tlog(&rest, &manifest.seeds, true);
    let from = input.len() - rest.len();
    assert!(from > 0 && !rest.is_empty());
    assert!(rest.iter().zip(&input[from..]).all(|(a, b)| a.bytes == b.bytes), "the end of the flight");
    assert_eq!(gap["frames_missing"].as_u64(), Some(from as u64), "as many as the gap says are missing");
}

#[test]
fn a_file_that_held_something_else_before_is_no_damage() {
    let manifest = Manifest::own();
    let path = own("px4_hil_quad_low.tlog");
    let recording = Recording::make(Machine::Sim, &path, &["--card-size", "64"]);
    let image = recording.image();
    // Free clusters are full of a photograph.
    let Places { data, .. } = places(&image);
    let mut content = fs::read(&image).unwrap();
    let noise = hums_tests::damage::Random::new(3).bytes(1 << 20);
    for (index, block) in content[data as usize + (64 << 10)..].chunks_exact_mut(512).enumerate() {
        if block == [0; 512] {
            let at = index * 512 % noise.len();
            block.copy_from_slice(&noise[at..at + 512]);
        }
    }
    fs::write(&image, &content).unwrap();
    let info = json("info", &image, &[], 0);
    assert_eq!(info["logs"][0]["gaps_count"], 0, "{info}");
    json("info --verify", &image, &[], 0);
    let input = fs::read(&path).unwrap();
    assert_eq!(
        Decoded::of(&image, &[0]).frames(&manifest.seeds).len(),
        manifest.frames_of(&path, &input).len()
    );
}

#[test]
fn a_damaged_sector_is_told_as_such_on_a_card_without_a_file_system_too() {
    let recording = Recording::make(Machine::Sim, &own("px4_hil_quad_low.tlog"), &["--card-size", "64"]);
    let image = recording.image();
    let blocks = fs::read(&image).unwrap();
    let is_sector = |block: &[u8]| block.starts_with(&[0x48, 0xB3]);
    let sectors: Vec<_> = (0_u64..).zip(blocks.chunks(512)).filter(|(_, block)| is_sector(block)).collect();
    let (at, block) = sectors[100];
    let file = File::options().write(true).open(&image).unwrap();
    file.write_all_at(&[!block[100]], at * BLOCK + 100).unwrap();
    zero(&image, 0, BLOCK);
    let text = hums_with("info {}", &[&image]).expect_code(&[3]).text();
    assert!(text.contains("1 damaged sector") && text.contains("sectors are damaged"), "{text}");
}
