//! Recording by arming: what is around the times when the vehicle is armed is kept, and the rest is no damage.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use hums_blackbox::Sector;
use hums_tests::fat;
use hums_tests::flights::{Manifest, own};
use hums_tests::frames::{self, Frame};
use hums_tests::program::{Machine, Recording, hums};
use tempfile::TempDir;

/// The vehicle is armed after some 44 s.
const FLIGHT: &str = "ap_quad_guided.tlog";
const ARMED_BIT: u8 = 0x80;
const SECTOR: usize = 512;

/// Records a flight by arming, with these settings besides.
fn record(dir: &Path, flight: &Path, settings: &str) -> Recording {
    let params = dir.join("params");
    fs::write(&params, format!("REC_MODE 1\n{settings}")).unwrap();
    Recording::make(Machine::Sim, flight, &["--card-size", "64", "--params", &params.display().to_string()])
}

/// A tlog of these frames, at the times when they came.
fn tlog_of<'a>(frames: impl IntoIterator<Item = &'a Frame<'a>>) -> Vec<u8> {
    let entry = |frame: &Frame<'_>| [&frame.time_us.unwrap().to_be_bytes()[..], frame.bytes].concat();
    frames.into_iter().flat_map(entry).collect()
}

/// The end of what came is there, so many seconds of it, and the card holds.
#[track_caller]
fn assert_keeps_the_end(
    recording: &Recording,
    manifest: &Manifest,
    input: &[&Frame<'_>],
    seconds: &std::ops::Range<f64>,
) {
    let decoded = recording.decode(&[0]);
    let output = decoded.frames(&manifest.seeds);
    let from = input.len() - output.len();
    assert!(output.iter().zip(&input[from..]).all(|(a, b)| a.bytes == b.bytes), "not its end");
    let kept_s = (input.last().unwrap().time_us.unwrap() - input[from].time_us.unwrap()) as f64 / 1e6;
    assert!(seconds.contains(&kept_s), "{kept_s} s are kept");
    hums(["verify".as_ref(), recording.image().as_os_str()]).expect_code(&[0]);
}

/// Whether a frame is the autopilot's heartbeat, and whether it says armed.
fn armed(frame: &Frame<'_>) -> Option<bool> {
    let header = if frame.bytes[0] == 0xFE { 6 } else { 10 };
    // MAVLink 2 sends no zeros at a payload's end.
    let byte = |at: usize| frame.bytes.get(header + at).copied().unwrap_or(0);
    let is_autopilot = byte(5) != 8;
    (frame.id == 0 && is_autopilot).then(|| byte(6) & ARMED_BIT != 0)
}

fn tlogs(image: &Path, dir: &Path) -> Vec<Vec<u8>> {
    let out = dir.join("out");
    let decode = ["decode".as_ref(), image.as_os_str(), "-o".as_ref(), out.as_os_str()];
    hums(decode.into_iter().chain(["--format".as_ref(), "tlog".as_ref()])).expect_code(&[0]);
    if out.is_file() {
        return vec![fs::read(out).unwrap()];
    }
    let mut files: Vec<_> = fs::read_dir(out).unwrap().map(|file| file.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "tlog"));
    files.sort();
    files.iter().map(|file| fs::read(file).unwrap()).collect()
}

#[test]
fn the_time_before_arming_is_kept_and_what_is_not_kept_is_told_as_such() {
    let dir = tempfile::tempdir().unwrap();
    let recording = record(dir.path(), &own(FLIGHT), "REC_BEFORE 5\n");
    fat::assert_clean(&recording.image());
    let manifest = Manifest::own();
    let data = fs::read(own(FLIGHT)).unwrap();
    let input = manifest.frames_of(&own(FLIGHT), &data);
    let decoded = recording.decode(&[0]);
    let output = decoded.frames(&manifest.seeds);
    let from = input.len() - output.len();
    assert!(from > 0, "everything was kept");
    assert!(output.iter().zip(&input[from..]).all(|(a, b)| a.bytes == b.bytes), "not the end of the flight");
    let arming = input.iter().position(|frame| armed(frame) == Some(true)).expect("it is armed");
    let seconds = |index: usize| (input[index].time_us.unwrap() - input[0].time_us.unwrap()) as f64 / 1e6;
    let before_s = seconds(arming) - seconds(from);
    assert!((5.0..25.0).contains(&before_s), "{before_s} s before arming are kept");

    let image = recording.image();
    let verify = hums(["verify".as_ref(), image.as_os_str()]).expect_code(&[0]);
    assert!(verify.text().contains("not recorded while disarmed"), "{}", verify.text());
    let info = hums(["info".as_ref(), image.as_os_str()]).expect_code(&[0]).text();
    assert!(info.contains("not recorded: disarmed") && info.contains("gaps     none"), "{info}");
    // The file can be read by itself: what its first one said is said again.
    assert!(info.contains("vehicle  system 1") && info.contains("on sim"), "{info}");
}

#[test]
fn each_armed_time_is_a_log_of_its_own() {
    let dir = tempfile::tempdir().unwrap();
    let manifest = Manifest::own();
    let data = fs::read(own(FLIGHT)).unwrap();
    let input = manifest.frames_of(&own(FLIGHT), &data);
    let (first, last) = (input[0].time_us.unwrap(), input.last().unwrap().time_us.unwrap());
    // The same flight again ten seconds later, on the same power-on.
    let twice: Vec<u8> = [0, last - first + 10_000_000]
        .iter()
        .flat_map(|later| input.iter().map(move |frame| (frame.time_us.unwrap() + later, frame.bytes)))
        .flat_map(|(time_us, bytes)| [&time_us.to_be_bytes()[..], bytes].concat())
        .collect();
    let flight = dir.path().join("twice.tlog");
    fs::write(&flight, twice).unwrap();
    let recording = record(dir.path(), &flight, "REC_BEFORE 5\nREC_AFTER 5\n");
    let logs = tlogs(&recording.image(), dir.path());
    assert_eq!(logs.len(), 2, "two times armed");
    for tlog in &logs {
        let frames = frames::of_tlog(tlog, &manifest.seeds, true);
        let changes: Vec<bool> = frames.iter().filter_map(armed).collect();
        assert!(!changes[0] && changes.contains(&true), "it begins disarmed and is armed then");
        assert!(frames.len() < input.len(), "not all of the time before is kept");
        let armed_frames =
            |frames: &[Frame<'_>]| frames.iter().filter(|frame| armed(frame) == Some(true)).count();
        assert_eq!(armed_frames(&frames), armed_frames(&input), "the whole armed time");
    }
    hums(["verify".as_ref(), recording.image().as_os_str()]).expect_code(&[0]);
}

#[test]
fn a_vehicle_that_is_never_armed_leaves_the_last_while() {
    let dir = tempfile::tempdir().unwrap();
    let manifest = Manifest::own();
    let data = fs::read(own(FLIGHT)).unwrap();
    let input = manifest.frames_of(&own(FLIGHT), &data);
    let arming = input.iter().position(|frame| armed(frame) == Some(true)).expect("it is armed");
    let disarmed: Vec<_> = input[..arming].iter().collect();
    let flight = dir.path().join("disarmed.tlog");
    fs::write(&flight, tlog_of(disarmed.iter().copied())).unwrap();
    let recording = record(dir.path(), &flight, "REC_BEFORE 10\n");
    assert_keeps_the_end(&recording, manifest, &disarmed, &(10.0..35.0));
}

/// The card is out for a moment while the vehicle waits, or until it was armed: what was in work goes on behind it, and the card is
/// sound.
#[test]
fn a_card_that_is_out_while_the_vehicle_waits_costs_nothing() {
    let manifest = Manifest::own();
    let data = fs::read(own(FLIGHT)).unwrap();
    let input = manifest.frames_of(&own(FLIGHT), &data);
    for out in ["20..21.5", "40..43.5", "43..44"] {
        let dir = tempfile::tempdir().unwrap();
        let params = dir.path().join("params");
        fs::write(&params, "REC_MODE 1\nREC_BEFORE 5\n").unwrap();
        let flags = ["--card-size", "64", "--params", &params.display().to_string(), "--card-out", out];
        let recording = Recording::make(Machine::Sim, &own(FLIGHT), &flags);
        hums(["verify".as_ref(), recording.image().as_os_str()]).expect_code(&[0]);
        let logs = tlogs(&recording.image(), dir.path());
        let last = frames::of_tlog(logs.last().unwrap(), &manifest.seeds, true);
        let from = input.len() - last.len();
        assert!(last.iter().zip(&input[from..]).all(|(a, b)| a.bytes == b.bytes), "{out}: not its end");
        let arming = input.iter().position(|frame| armed(frame) == Some(true)).unwrap();
        let before_us = input[arming].time_us.unwrap() - input[from].time_us.unwrap();
        assert!(before_us >= 5_000_000, "{out}: {before_us} us before arming are kept");
    }
}

/// The card is out twice while the vehicle waits: each log says which one of the power-on it follows, together and alone.
#[test]
fn logs_between_which_the_card_was_out_follow_each_other() {
    let dir = tempfile::tempdir().unwrap();
    let params = dir.path().join("params");
    fs::write(&params, "REC_MODE 1\nREC_BEFORE 30\n").unwrap();
    let params = params.display().to_string();
    let out = ["--card-out", "20..21.5", "--card-out", "30..30.5"];
    let flags = [&["--card-size", "64", "--params", &params], &out[..]].concat();
    let recording = Recording::make(Machine::Sim, &own(FLIGHT), &flags);
    let image = recording.image();
    let said = readers(&image, 0);
    assert_eq!(said.matches("it goes on where the one before it ends").count(), 2, "{said}");
    assert!(!said.contains("not recorded"), "all of it is there: {said}");
    let folder = dir.path().join("copy");
    fs::create_dir(&folder).unwrap();
    fat::copy_files(&image, &folder);
    for (number, other) in [("3", "00003_"), ("2", "00002_")] {
        let out = dir.path().join("one/");
        let decode = ["decode".as_ref(), image.as_os_str(), "--session".as_ref(), number.as_ref()];
        let to = ["--format".as_ref(), "tlog".as_ref(), "-o".as_ref(), out.as_os_str()];
        hums(decode.into_iter().chain(to)).expect_code(&[0]);
        let alone = dir.path().join(number);
        fs::create_dir(&alone).unwrap();
        for file in fs::read_dir(&folder).unwrap().map(|file| file.unwrap().path()) {
            let name = file.file_name().unwrap();
            if name.to_string_lossy().starts_with(other) {
                fs::copy(&file, alone.join(name)).unwrap();
            }
        }
        readers(&alone, 0);
    }
}

/// Each command that reads logs ends with this code; what all of them say.
#[track_caller]
fn readers(log: &Path, code: i32) -> String {
    let dir = tempfile::tempdir().unwrap();
    let (tables, pages) = (dir.path().join("tables/"), dir.path().join("pages/"));
    let mut said = String::new();
    for (command, out) in [
        ("verify", None),
        ("info", None),
        ("check", None),
        ("decode", Some(&tables)),
        ("report", Some(&pages)),
    ] {
        let mut arguments: Vec<&OsStr> = vec![OsStr::new(command), log.as_os_str()];
        if let Some(out) = out {
            arguments.extend([OsStr::new("-o"), out.as_os_str()]);
        }
        if command == "decode" {
            arguments.extend([OsStr::new("--format"), OsStr::new("csv")]);
        }
        let outcome = hums(arguments);
        let told = format!("{}{}", outcome.text(), outcome.stderr);
        // Findings are no damage.
        let ended = outcome.code.map(|ended| if ended == 4 { 0 } else { ended });
        assert_eq!(ended, Some(code), "hums {command}: {told}");
        said.push_str(&told);
    }
    said
}

#[test]
fn what_is_taken_from_a_log_by_arming_is_missing_and_not_called_disarmed() {
    let dir = tempfile::tempdir().unwrap();
    let recording = record(dir.path(), &own(FLIGHT), "REC_BEFORE 30\n");
    let copy = dir.path().join("copy");
    fs::create_dir(&copy).unwrap();
    fat::copy_files(&recording.image(), &copy);
    let files = ["00001_00.HUM", "00001_01.HUM", "00001_02.HUM"].map(|name| copy.join(name));
    let whole = files.each_ref().map(|file| fs::read(file).unwrap());
    let said = readers(&copy, 0);
    assert!(!said.contains("not recorded"), "all of it is there: {said}");
    // The last sector of the first file, without what was set aside behind it.
    let end = whole[0].chunks(SECTOR).rposition(|block| block.starts_with(&[0x48, 0xB3])).unwrap() + 1;
    let cases: [(usize, std::ops::Range<usize>); 7] = [
        (1, 0..usize::MAX),
        (0, 0..usize::MAX),
        (1, 1..usize::MAX),
        (0, 1..usize::MAX),
        (0, end - 9..end),
        (0, end - 30..end),
        (1, 0..64),
    ];
    for (file, blocks) in cases {
        if blocks == (0..usize::MAX) {
            fs::remove_file(&files[file]).unwrap();
        } else {
            let mut spoiled = whole[file].clone();
            let end = spoiled.len().min(blocks.end.saturating_mul(SECTOR));
            spoiled[blocks.start * SECTOR..end].fill(0);
            // Few sectors would be made again.
            let parity = |block: &&mut [u8]| matches!(block, [0x48, 0xc3 | 0xd3, ..]);
            spoiled.chunks_mut(SECTOR).filter(parity).for_each(|block| block.fill(0));
            fs::write(&files[file], spoiled).unwrap();
        }
        let said = readers(&copy, 3);
        assert!(!said.contains("not recorded"), "{blocks:?} of file {file}: {said}");
        assert!(said.contains("sectors lost") && !said.contains(" 0 frames missing"), "{said}");
        fs::write(&files[file], &whole[file]).unwrap();
    }
    assert!(!readers(&copy, 0).contains("not recorded"));
}

/// A vehicle that is armed three times in one power-on, of which every fourth frame came.
fn three_times_armed(dir: &Path) -> PathBuf {
    let manifest = Manifest::own();
    let data = fs::read(own(FLIGHT)).unwrap();
    let input = manifest.frames_of(&own(FLIGHT), &data);
    let (first, last) = (input[0].time_us.unwrap(), input.last().unwrap().time_us.unwrap());
    let kept = |index: usize, frame: &Frame<'_>| index.is_multiple_of(4) || frame.id == 0;
    let entry = |later: u64, frame: &Frame<'_>| {
        [&(frame.time_us.unwrap() + later).to_be_bytes()[..], frame.bytes].concat()
    };
    let once = |nth: u64| {
        let later = nth * (last - first + 10_000_000);
        input
            .iter()
            .enumerate()
            .filter(|(index, frame)| kept(*index, frame))
            .map(move |(_, frame)| entry(later, frame))
    };
    let flight = dir.join("three.tlog");
    fs::write(&flight, (0..3).flat_map(once).flatten().collect::<Vec<u8>>()).unwrap();
    flight
}

/// The blocks of a file up to its last sector and the copy behind it.
fn used(file: &[u8]) -> &[u8] {
    let end = file.chunks(SECTOR).rposition(|block| block.starts_with(&[0x48, 0xB3])).unwrap() + 1;
    &file[..end * SECTOR]
}

/// What is wrong with the logs in a folder, as `verify` says it.
#[track_caller]
fn verified(folder: &Path, code: i32, case: &str) -> String {
    let verify = hums(["verify".as_ref(), folder.as_os_str()]);
    assert_eq!(verify.code, Some(code), "{case}: {}", verify.text());
    verify.text().lines().filter(|line| line.contains("FAILED")).collect::<Vec<_>>().join("\n")
}

/// A file of a log.
type Segment = (PathBuf, Vec<u8>);

/// The logs of one power-on, copied off the card.
struct PowerOn {
    _dir: TempDir,
    image: PathBuf,
    folder: PathBuf,
    whole: Vec<Segment>,
    /// The files of the three armed times, each up to its last sector: without its parity.
    logs: [Vec<Segment>; 3],
}

impl PowerOn {
    fn record() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let recording = record(dir.path(), &three_times_armed(dir.path()), "REC_BEFORE 5\nREC_AFTER 5\n");
        let folder = dir.path().join("copy");
        fs::create_dir(&folder).unwrap();
        let image = dir.path().join("card.img");
        fs::copy(recording.image(), &image).unwrap();
        fat::copy_files(&image, &folder);
        let mut files: Vec<_> = fs::read_dir(&folder).unwrap().map(|file| file.unwrap().path()).collect();
        files.retain(|file| file.extension().is_some_and(|extension| extension == "HUM"));
        files.sort();
        let segment = |file: PathBuf| (file.clone(), fs::read(file).unwrap());
        let whole: Vec<Segment> = files.into_iter().map(segment).collect();
        let logs = [1, 2, 3].map(|log| {
            let name = format!("{log:05}_");
            let is_of = |(path, _): &&Segment| path.file_name().unwrap().to_string_lossy().starts_with(&name);
            let up_to_end = |(path, bytes): &Segment| (path.clone(), used(bytes).to_vec());
            whole.iter().filter(is_of).map(up_to_end).collect::<Vec<_>>()
        });
        assert!(
            logs[0].len() > 1 && logs[1].len() == 2 && logs[2].len() == 2,
            "the recording is another one"
        );
        Self { _dir: dir, image, folder, whole, logs }
    }

    /// The card, of which the sectors of a file are zeros.
    fn without_sectors(&self, (_, bytes): &Segment) -> PathBuf {
        let (mut card, spoiled) = (fs::read(&self.image).unwrap(), self.image.with_extension("spoiled.img"));
        let sectors: BTreeSet<&[u8]> =
            bytes.chunks(SECTOR).filter(|block| block.starts_with(&[0x48, 0xB3])).collect();
        card.chunks_mut(SECTOR).filter(|block| sectors.contains(*block)).for_each(|block| block.fill(0));
        fs::write(&spoiled, card).unwrap();
        spoiled
    }

    /// These files are all that there is.
    fn put(&self, files: &[Segment]) {
        fs::remove_dir_all(&self.folder).unwrap();
        fs::create_dir(&self.folder).unwrap();
        for (path, bytes) in files {
            fs::write(path, bytes).unwrap();
        }
    }

    /// The second log is joined to the first one, and is there by itself too.
    fn joined(&self) -> Vec<Segment> {
        let [one, two, three] = &self.logs;
        let (path, last) = one.last().unwrap();
        let joined = [&last[..], &two[0].1, &two[1].1].concat();
        [&one[..one.len() - 1], &[(path.clone(), joined)], two, three].concat()
    }

    /// A file joined to another one, and what is said of it: of another card, whose numbers go on, behind a log that ended in
    /// order and behind a file that is not its last one; and of the same power-on, between two of a log's files.
    fn joined_within(&self) -> Vec<(Vec<Segment>, &'static str)> {
        let [one, two, three] = &self.logs;
        let foreign = |(_, bytes): &Segment| {
            let sectors = bytes.as_chunks::<SECTOR>().0.iter().map(|sector| {
                let mut sector = Sector::from_bytes(*sector);
                sector.seal(7);
                *sector.bytes()
            });
            sectors.flatten().collect::<Vec<u8>>()
        };
        let with = |file: usize, behind: &[u8]| {
            let mut files = one.clone();
            files[file].1.extend(behind);
            [&files[..], two, three].concat()
        };
        let (last, other) = (one.len() - 1, foreign(&three[0]));
        let longest = (0..last).max_by_key(|file| one[*file].1.len()).unwrap();
        let sectors = one.iter().map(|(_, bytes)| bytes.len() / SECTOR).collect::<Vec<_>>();
        assert!(sectors[longest] > 4 && sectors[last] > 4, "the recording is another one: {sectors:?}");
        let words = "are of another session (session 00000007): logs were joined into one file";
        vec![
            (with(last, &other), words),
            (with(longest, &other), words),
            (
                with(longest, &three[0].1),
                "of another file of the same power-on: logs were joined into one file",
            ),
        ]
    }

    /// Files under other names, and what is said of them.
    fn renamed(&self) -> Vec<(Vec<Segment>, &'static str)> {
        let [one, two, three] = &self.logs;
        let (first, last) = (&two[0], &two[1]);
        let fourth = self.folder.join("00004_00.HUM");
        let higher = self.folder.join("00002_40.HUM");
        let as_other = |to: &Segment, from: &Segment| (to.0.clone(), from.1.clone());
        let exchanged = [
            as_other(first, &three[0]),
            as_other(last, &three[1]),
            as_other(&three[0], first),
            as_other(&three[1], last),
        ];
        vec![
            (
                [&one[..1], &[(fourth.clone(), one[1].1.clone())], two, three].concat(),
                "were recorded before the end of session 00003",
            ),
            (
                [&one[..], two, three, &[(fourth, last.1.clone())]].concat(),
                "were recorded before the end of session 00003",
            ),
            ([&one[..], &exchanged].concat(), "were recorded before the end of session 00002"),
            (
                [&one[..], &[as_other(first, last), as_other(last, first)], three].concat(),
                "are older than the log's first one",
            ),
            (
                [&one[..], &two[..1], &[(higher, last.1.clone())], three].concat(),
                "00002_40.HUM: one was taken away, or files were renamed",
            ),
        ]
    }

    /// Sectors of the second log's first file that are not there, or twice, and what is said of that.
    fn damaged(&self) -> Vec<(Vec<Segment>, &'static str)> {
        let [one, two, three] = &self.logs;
        let (path, first) = &two[0];
        let doubled = [&first[..first.len() - 2 * SECTOR], &first[4 * SECTOR..]].concat();
        let mut zeroed = first.clone();
        zeroed[..SECTOR].fill(0);
        let with = |bytes: Vec<u8>| [&one[..], &[(path.clone(), bytes)], &two[1..], three].concat();
        vec![
            ([&one[..], &two[1..], three].concat(), "sector sequence"),
            (with(zeroed), "sector sequence"),
            (with(doubled), "sectors there twice"),
        ]
    }

    /// Frames of all its logs.
    fn frames(&self, code: i32) -> u64 {
        let info = hums(["info".as_ref(), "--json".as_ref(), self.folder.as_os_str()]).expect_code(&[code]);
        let info: serde_json::Value = serde_json::from_str(&info.text()).unwrap();
        info["logs"].as_array().unwrap().iter().map(|log| log["frames"].as_u64().unwrap()).sum()
    }
}

#[test]
fn what_is_taken_from_the_logs_of_one_power_on_or_mixed_up_is_told() {
    let power_on = PowerOn::record();
    let folder = &power_on.folder;
    let [one, two, three] = &power_on.logs;
    power_on.put(&power_on.whole);
    verified(folder, 0, "all of it");
    let frames = power_on.frames(0);
    // Of a card all of whose blocks are looked at no more is said than of its files.
    let salvaged = |image: &Path, code: i32| {
        for flags in [&[][..], &["--salvage".as_ref()]] {
            hums(["verify".as_ref(), image.as_os_str()].iter().chain(flags)).expect_code(&[code]);
        }
    };
    salvaged(&power_on.image, 0);
    for file in [one.last(), two.first(), two.last(), three.first()] {
        salvaged(&power_on.without_sectors(file.unwrap()), 3);
    }

    // All of a log.
    power_on.put(&[&one[..], three].concat());
    let said = readers(folder, 3);
    assert!(said.contains("after session 00001 in the same power-on is not there: up to "), "{said}");
    let is_newer = |(path, _): &&Segment| one.iter().all(|(other, _)| other != path);
    power_on.put(&power_on.whole.iter().filter(is_newer).cloned().collect::<Vec<_>>());
    verified(folder, 0, "the oldest logs make room");

    // What is joined is read once: from its own file.
    power_on.put(&power_on.joined());
    let said = readers(folder, 3);
    assert!(said.contains("of another file of the same power-on: logs were joined into one file"), "{said}");
    assert_eq!(power_on.frames(3), frames);

    // A full card's oldest file was given the next name, and power went before anything was written into it.
    power_on
        .put(&[&two[..], three, &[(folder.join("00004_00.HUM"), one.last().unwrap().1.clone())]].concat());
    let said = readers(folder, 3);
    assert!(
        said.contains("begun to write this file anew when power went: what is in it is session 00001"),
        "{said}"
    );
    assert!(!said.contains("renamed, exchanged or copied"), "{said}");
    let page = folder.with_extension("html");
    let said =
        hums(["report".as_ref(), folder.as_os_str(), "-o".as_ref(), page.as_os_str()]).expect_code(&[3]);
    assert!(said.text().contains("session 00003"), "{}", said.text());

    let joined = power_on.joined_within();
    for (nth, (files, _)) in joined.iter().enumerate() {
        power_on.put(files);
        assert_eq!(power_on.frames(3), frames, "joined {nth}");
    }
    let others = power_on.renamed().into_iter().chain(power_on.damaged());
    for (nth, (files, words)) in others.chain(joined).enumerate() {
        power_on.put(&files);
        let said = verified(folder, 3, &format!("case {nth}: {words}"));
        assert!(said.contains(words), "case {nth}, {words}: {said}");
    }
}

#[test]
fn what_a_file_of_the_ring_held_before_is_no_damage() {
    let dir = tempfile::tempdir().unwrap();
    let manifest = Manifest::own();
    let data = fs::read(own(FLIGHT)).unwrap();
    let input = manifest.frames_of(&own(FLIGHT), &data);
    let first_us = input[0].time_us.unwrap();
    // A quarter of the frames after the first five seconds: less than the first file held before it was written anew.
    let frames = input.iter().enumerate().filter(|(index, frame)| match frame.time_us.unwrap() - first_us {
        ..5_000_000 => true,
        time_us => time_us < 18_000_000 && index % 4 == 0,
    });
    let frames: Vec<_> = frames.map(|(_, frame)| frame).collect();
    let flight = dir.path().join("thin.tlog");
    fs::write(&flight, tlog_of(frames.iter().copied())).unwrap();
    let recording = record(dir.path(), &flight, "REC_BEFORE 5\n");
    assert_keeps_the_end(&recording, manifest, &frames, &(5.0..15.0));
}
