//! Interrupted, continued, never mixed from two logs.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

use hums_tests::flights::own;
use hums_tests::live::Running;
use hums_tests::program::{command, hums};
use tempfile::TempDir;

use super::board::{Board, assert_on_card, card, on, pulled_log, pulled_logs};

const LOG: &str = "00001_00.HUM";
const NUMBER: &str = "00001";

fn board(dir: TempDir) -> Board {
    let params = dir.path().join("params.txt").display().to_string();
    Board::start_in(dir, &["--params", &params])
}

fn pull(board: &Board, output: &Path, names: &[&str]) -> hums_tests::child::Outcome {
    on(&board.address(), &format!("pull {} -o {}", names.join(" "), output.display()))
}

/// Killed after the first data.
fn begin(board: &Board, output: &Path) -> PathBuf {
    let mut pull = command(["box", "pull", "--link", &board.address(), LOG, "-o"]);
    let mut child = pull.arg(output).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let words = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    let mut pull = Running(child);
    let came = words.into_iter().find(|line| line.contains(" bytes")).expect("something comes");
    pull.signal("KILL");
    pull.end(Duration::from_secs(5));
    let part = only_part(output);
    assert!(part.metadata().unwrap().len() > 5_000 && pulled_logs(output, NUMBER).is_empty(), "{came}");
    part
}

fn only_part(output: &Path) -> PathBuf {
    let names = fs::read_dir(output).unwrap().map(|entry| entry.unwrap().path());
    let is_part = |path: &PathBuf| path.to_string_lossy().ends_with("_00.HUM.pull.hums-part");
    let parts: Vec<PathBuf> = names.filter(is_part).collect();
    assert_eq!(parts.len(), 1, "{parts:?}");
    parts[0].clone()
}

#[test]
fn two_cards_are_never_made_into_one_log() {
    let ((one, one_card), (other, other_card)) = (card(0..90_000, "1"), card(60_000..150_000, "2"));
    let home = tempfile::tempdir().unwrap();
    let output = home.path().join("logs");

    // Another card, whose log has the same name.
    let first = board(one);
    let part = begin(&first, &output);
    let kept = fs::read(&part).unwrap();
    let one = first.switch_off();
    let second = board(other);
    pull(&second, &output, &[LOG]).expect_code(&[0]);
    let others = pulled_log(&output, NUMBER);
    assert_on_card(&others, &other_card);
    assert_eq!(fs::read(&part).unwrap(), kept);

    // Unless another run is using it.
    second.switch_off();
    let first = board(one);
    let lock = fs::File::options().append(true).open(&part).unwrap();
    lock.lock().unwrap();
    let told = pull(&first, &output, &[LOG]).expect_code(&[1]).stderr;
    assert!(told.contains("another run of hums is using it; wait for its end"), "{told}");
    drop(lock);
    let told = pull(&first, &output, &[LOG]).expect_code(&[0]).stderr;
    assert!(told.contains(&format!("goes on after {} bytes", kept.len())), "{told}");
    let both = pulled_logs(&output, NUMBER);
    let log = both.iter().find(|log| **log != others).expect("both are there").clone();
    assert_eq!(both.len(), 2, "{both:?}");
    assert_on_card(&log, &one_card);
    assert_on_card(&others, &other_card);
    let said = pull(&first, &output, &[LOG]).expect_code(&[0]);
    assert!(said.stderr.contains("is there already") && said.stdout.is_empty(), "{}", said.stderr);

    let folder = output.to_str().unwrap();
    let read = hums(["info", "--json", folder]).expect_code(&[0]);
    let read: serde_json::Value = serde_json::from_slice(&read.stdout).unwrap();
    assert_eq!(read["logs"].as_array().unwrap().len(), 2, "{read}");
    let made = home.path().join("made");
    hums(["decode", folder, "-o", made.to_str().unwrap(), "--format", "tlog"]).expect_code(&[0]);
    for log in &both {
        let name = log.file_name().unwrap().to_str().unwrap().strip_suffix("_00.HUM").unwrap();
        assert!(made.join(format!("{name}.tlog")).exists(), "{name}");
    }

    // A file with a changed bit or added bytes may be evidence.
    let whole = fs::read(&log).unwrap();
    let flipped = |at: usize| {
        let mut spoiled = whole.clone();
        spoiled[at] ^= 1;
        spoiled
    };
    for (spoiled, words) in [
        (flipped(600), "differs from the box's log of the same session"),
        (flipped(whole.len() / 2), "differs from the box's log"),
        ([&whole[..], &[0; 5]].concat(), "is the box's log with 5 bytes more, and stays"),
        (fs::read(&others).unwrap()[..10_000].to_vec(), "differs from the box's log"),
    ] {
        fs::write(&log, &spoiled).unwrap();
        let told = pull(&first, &output, &[LOG]).expect_code(&[1]).stderr;
        assert!(told.contains(words), "{told}");
        assert_eq!(fs::read(&log).unwrap(), spoiled);
    }
}

/// Damage is reported each time, even if the log exists already.
#[test]
fn what_is_there_already_is_checked_as_what_comes_is() {
    let (dir, mut card) = card(0..30_000, "1");
    let first = card.chunks(512).position(|block| block.starts_with(&[0x48, 0xb3])).unwrap();
    card[(first + 3) * 512 + 100] ^= 1;
    fs::write(dir.path().join("card.img"), &card).unwrap();
    let board = board(dir);
    let home = tempfile::tempdir().unwrap();
    for words in ["bytes", "is there already"] {
        let told = pull(&board, home.path(), &[LOG]).expect_code(&[3]).stderr;
        assert!(told.contains(words) && told.contains("`hums info --verify` says more"), "{told}");
    }
}

#[test]
fn a_log_in_work_that_has_grown_is_completed() {
    let (dir, _) = card(0..80_000, "1");
    // The log has an end mark after 5 s.
    let flight = fs::read(own("ap_quad_guided.tlog")).unwrap();
    let input = dir.path().join("landed.tlog");
    fs::write(&input, [cut(&flight, 262, 270), cut(&flight, 0, 40)].concat()).unwrap();
    let params = dir.path().join("params.txt").display().to_string();
    let board = Board::start_with(input.as_os_str(), dir, &["--params", &params]);
    let home = tempfile::tempdir().unwrap();
    let name = ["00002_00.HUM"];
    let start = Instant::now();
    loop {
        let pulled = pull(&board, home.path(), &name);
        if pulled.code == Some(0) && !pulled_logs(home.path(), "00002").is_empty() {
            break;
        }
        // Not proved until then; a log without records is not a log.
        let told = pulled.expect_code(&[0, 3]).stderr;
        let words = ["not proved to its end", "has no data, or its first sector cannot be read"];
        assert!(words.iter().any(|words| told.contains(words)), "{told}");
        assert!(start.elapsed() < Duration::from_secs(30), "there is no end mark: {told}");
        std::thread::sleep(Duration::from_millis(500));
    }
    let log = pulled_log(home.path(), "00002");
    let first = fs::read(&log).unwrap();
    std::thread::sleep(Duration::from_secs(5));
    let told = pull(&board, home.path(), &name).expect_code(&[0]).stderr;
    assert!(told.contains(&format!("goes on after {} bytes", first.len())), "{told}");
    let second = fs::read(pulled_log(home.path(), "00002")).unwrap();
    assert!(second.len() > first.len() && second.starts_with(&first));
    let dir = board.switch_off();
    assert_on_card(&log, &fs::read(dir.path().join("card.img")).unwrap());
}

fn cut(tlog: &[u8], from_s: u64, to_s: u64) -> Vec<u8> {
    let (mut at, mut first, mut out) = (0, None, Vec::new());
    while let Some(record) = tlog.get(at..).filter(|record| record.len() > 11) {
        let time = u64::from_be_bytes(record[..8].try_into().unwrap());
        let frame = if record[8] == 0xfd { 12 + 13 * usize::from(record[10] & 1) } else { 8 };
        let bytes = 8 + frame + usize::from(record[9]);
        let after = time - *first.get_or_insert(time);
        if (from_s * 1_000_000..to_s * 1_000_000).contains(&after) {
            out.extend_from_slice(&record[..bytes]);
        }
        at += bytes;
    }
    out
}

fn parts(output: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(output).unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.to_string_lossy().ends_with(".part.HUM")).collect()
}

fn zeros(bytes: &[u8]) -> Vec<usize> {
    let is_zero = |(_, sector): &(usize, &[u8])| sector.iter().all(|byte| *byte == 0);
    bytes.chunks(512).enumerate().filter(is_zero).map(|(place, _)| place).collect()
}

#[test]
fn a_finding_comes_first_as_a_part_that_says_so() {
    const GROUP: usize = 64;
    let dir = tempfile::tempdir().unwrap();
    let (input, image) = (dir.path().join("short.tlog"), dir.path().join("card.img"));
    // The autopilot's failsafe at 35 s is in the log's second group.
    fs::write(&input, cut(&fs::read(own("ap_quad_faults.tlog")).unwrap(), 232, 272)).unwrap();
    fs::write(dir.path().join("params.txt"), "GS_BUDGET 5000\n").unwrap();
    let mut sim = command(["sim", "--card-size", "64"]);
    sim.arg(&input).arg("--sd").arg(&image);
    hums_tests::child::run(&mut sim, Duration::from_mins(1)).expect_code(&[0]);
    let card = fs::read(&image).unwrap();
    let board = board(dir);
    let home = tempfile::tempdir().unwrap();
    let output = home.path();

    let found = pull(&board, output, &[LOG, "--around", "autopilot_state", "--span", "1", "--json"])
        .expect_code(&[0]);
    let found: serde_json::Value = serde_json::from_slice(&found.stdout).unwrap();
    assert_eq!(found["around"]["level"], "critical", "{found}");
    assert!((33.0..37.0).contains(&found["around"]["time_s"].as_f64().unwrap()), "{found}");
    let part = parts(output).pop().expect("a part");
    let bytes = fs::read(&part).unwrap();
    let missing = zeros(&bytes);
    assert!(bytes.len() / 512 > GROUP + 20 && missing.len() > GROUP / 2, "{missing:?} of {}", bytes.len());
    assert!(missing.iter().all(|place| *place < GROUP), "the second group is there: {missing:?}");

    // Every reader accepts and reports the part.
    let name = part.to_str().unwrap();
    for words in [&["info", name][..], &["info", "--verify", name]] {
        let told = hums(words).expect_code(&[3]).text();
        assert!(told.contains("is a part of its log: the rest was not downloaded"), "{told}");
    }
    let made = home.path().join("part.tlog");
    hums(["decode", name, "-o", made.to_str().unwrap(), "--format", "tlog"]).expect_code(&[3]);
    // The flight's last record.
    let (decoded, whole) = (fs::read(&made).unwrap(), fs::read(&input).unwrap());
    let end = |tlog: &[u8]| tlog[tlog.len() - 12..].to_vec();
    assert!(decoded.len() > 10_000 && end(&decoded) == end(&whole), "{} bytes", decoded.len());

    // Another moment needs another folder.
    let told = pull(&board, output, &[LOG, "--around", "0:00.5", "--span", "0.5"]).expect_code(&[1]).stderr;
    assert!(told.contains("exists, and was not overwritten"), "{told}");
    assert_eq!(fs::read(&part).unwrap(), bytes);
    pull(&board, output, &[LOG]).expect_code(&[0]);
    assert_eq!(parts(output).len(), 1);
    assert_on_card(&pulled_log(output, NUMBER), &card);
    let told = pull(&board, output, &[LOG, "--around", "critical"]).expect_code(&[1]).stderr;
    assert!(told.contains("is there already"), "{told}");
    let told = pull(&board, output, &["--around", "no_such_check"]).expect_code(&[2]).stderr;
    assert!(told.contains("is no time (4:20, 260.8, 2026-11-21T10:13:42Z) and no finding"), "{told}");
}
