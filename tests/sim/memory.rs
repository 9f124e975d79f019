//! Memory: no input makes a command take more than 64 MiB above what it takes for nearly nothing.
//!
//! One worker; `docs/decode.md` says what each further one adds. The inputs are larger than what may be held.

use std::fs;
use std::path::Path;
use std::thread;
use std::time::Duration;

use hums_tests::child::{self, Outcome};
use hums_tests::hostile;
use hums_tests::live::Live;
use hums_tests::program::{LIMIT, command};

/// What a command may take beyond an empty run, KiB.
const ABOVE_KIB_MAX: u64 = 64 << 10;

fn run(arguments: &[&str]) -> Outcome {
    child::run(command(arguments).env("RAYON_NUM_THREADS", "1"), LIMIT).expect_code(&[0, 1, 3])
}

/// What a run takes that has nearly nothing to do, KiB.
fn empty_run(dir: &Path) -> u64 {
    let log = hostile::heartbeats(dir, 10);
    // A run that has ended before it was looked at seems to take nothing.
    let of_one = |_| run(&["info", log.to_str().unwrap()]).memory_kib_max;
    (0..500).map(of_one).find(|kib| *kib > 4 << 10).expect("a look at an empty run")
}

#[track_caller]
fn assert_bounded(what: &str, kib: u64, empty: u64) {
    assert!(kib <= empty + ABOVE_KIB_MAX, "{what} took {kib} KiB, an empty run {empty} KiB");
}

/// Each command that reads a log, and each format.
fn assert_all_bounded(log: &Path, empty: u64) {
    let log = log.to_str().unwrap();
    let dir = tempfile::tempdir().unwrap();
    let page = dir.path().join("page.html");
    let page = page.to_str().unwrap();
    for arguments in [
        &["info", log][..],
        &["info", "--json", log],
        &["verify", log],
        &["check", log],
        &["report", log, "-o", page],
    ] {
        assert_bounded(&arguments.join(" "), run(arguments).memory_kib_max, empty);
    }
    for format in ["tlog", "csv", "jsonl", "influx", "parquet", "thesis"] {
        let out = format!("{}/{format}/", dir.path().display());
        let outcome = run(&["decode", log, "-o", &out, "--format", format]);
        assert_bounded(&format!("{format} of {log}"), outcome.memory_kib_max, empty);
        let _ = fs::remove_dir_all(out);
    }
}

/// `hums live`, until it has read all.
fn assert_live_bounded(log: &Path, empty: u64) {
    let live = Live::start(&["--input", log.to_str().unwrap()]);
    let mut before = (-1.0, 0);
    let most = loop {
        let (seconds, _, most) = live.program.cost().expect("it runs");
        // It publishes ten times a second once it plays, which takes next to nothing.
        if seconds - before.0 < 0.1 && seconds > 0.1 {
            break most;
        }
        before = (seconds, most);
        thread::sleep(Duration::from_millis(500));
    };
    assert_bounded(&format!("live of {}", log.display()), most, empty);
}

#[test]
fn a_log_that_expands_two_thousand_fold_takes_little_memory_with_any_command() {
    let dir = tempfile::tempdir().unwrap();
    let empty = empty_run(dir.path());
    let log = hostile::heartbeats(dir.path(), 600_000);
    assert!(fs::metadata(&log).unwrap().len() < 200_000);
    assert_all_bounded(&log, empty);
    assert_live_bounded(&log, empty);
}

#[test]
fn logs_of_one_kind_of_message_take_little_memory_with_any_command() {
    let dir = tempfile::tempdir().unwrap();
    let empty = empty_run(dir.path());
    for log in [hostile::texts(dir.path(), 100_000), hostile::parameters(dir.path(), 60_000)] {
        assert_all_bounded(&log, empty);
        assert_live_bounded(&log, empty);
    }
}

#[test]
fn a_log_of_many_unknown_ids_takes_little_memory_and_few_files() {
    let dir = tempfile::tempdir().unwrap();
    let empty = empty_run(dir.path());
    let ids = hostile::unknown_ids(dir.path(), 60_000);
    assert_all_bounded(&ids, empty);
    assert_live_bounded(&ids, empty);
    let out = dir.path().join("tables");
    let words = ["decode", ids.to_str().unwrap(), "--format", "csv", "-o", out.to_str().unwrap()];
    let said = run(&words).text();
    assert!(said.contains("UNKNOWN.csv"), "{said}");
    let folder = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path()).find(|path| path.is_dir());
    let folder = folder.unwrap_or(out);
    let files: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!((512..600).contains(&files.len()), "{} files", files.len());
    // Each frame is in one table: the first 512 ids in their own, the others in order with their ids.
    let shared = fs::read_to_string(folder.join("UNKNOWN.csv")).unwrap();
    let ids = shared.lines().skip(1).map(|line| line.split(',').nth(4).unwrap().parse::<u32>().unwrap());
    assert!(ids.eq(70_512..130_000), "{}", shared.lines().take(3).collect::<Vec<_>>().join("\n"));
    assert_eq!(fs::read_to_string(folder.join("UNKNOWN_70511.csv")).unwrap().lines().count(), 2);
}

#[test]
fn an_autopilots_log_of_thousands_of_tables_or_columns_takes_little_memory() {
    let dir = tempfile::tempdir().unwrap();
    let empty = empty_run(dir.path());
    for log in [
        hostile::wide_ulog(dir.path()),
        hostile::long_arrays(dir.path()),
        hostile::wide_dataflash(dir.path()),
    ] {
        let shown = log.display().to_string();
        assert_bounded(&format!("check {shown}"), run(&["check", &shown]).memory_kib_max, empty);
        for format in ["csv", "jsonl", "parquet"] {
            let out = format!("{}/{format}/", dir.path().display());
            let outcome = run(&["decode", &shown, "-o", &out, "--format", format]);
            assert_bounded(&format!("{format} of {shown}"), outcome.memory_kib_max, empty);
            let _ = fs::remove_dir_all(out);
        }
    }
}

#[test]
fn an_autopilots_log_that_is_larger_than_what_may_be_held_takes_little_memory_with_any_command() {
    let dir = tempfile::tempdir().unwrap();
    let empty = empty_run(dir.path());
    let (page, out) = (dir.path().join("page.html"), dir.path().join("out/"));
    let (page, out) = (page.to_str().unwrap(), out.to_str().unwrap());
    // The formats are made of rows, which both logs are read as: each of one, and the plainest of the other.
    let all = ["csv", "jsonl", "influx", "parquet"];
    for (log, formats) in
        [(hostile::long_dataflash(dir.path()), &all[..1]), (hostile::long_ulog(dir.path()), &all[..])]
    {
        assert!(fs::metadata(&log).unwrap().len() > ABOVE_KIB_MAX << 10);
        let shown = log.to_str().unwrap();
        for words in [&["check", shown][..], &["info", shown], &["report", shown, "-o", page]] {
            assert_bounded(&words.join(" "), run(words).memory_kib_max, empty);
        }
        for format in formats {
            let outcome = run(&["decode", shown, "-o", out, "--format", format]);
            assert_bounded(&format!("{format} of {shown}"), outcome.memory_kib_max, empty);
            fs::remove_dir_all(out).unwrap();
        }
        let _ = (fs::remove_file(page), fs::remove_file(log));
    }
}

#[test]
fn the_logs_of_a_large_folder_are_told_one_by_one() {
    let dir = tempfile::tempdir().unwrap();
    let empty = empty_run(dir.path());
    let first = fs::read(hostile::heartbeats(dir.path(), 10)).unwrap();
    let logs = dir.path().join("logs");
    fs::create_dir(&logs).unwrap();
    for number in 0..4_000 {
        fs::write(logs.join(format!("{number:05}.hum")), &first).unwrap();
    }
    for command in ["verify", "info"] {
        let outcome = run(&[command, "--json", logs.to_str().unwrap()]);
        assert_bounded(&format!("{command} --json"), outcome.memory_kib_max, empty);
        let told: serde_json::Value = serde_json::from_str(&outcome.text()).unwrap();
        assert_eq!(told["logs"].as_array().unwrap().len(), 4_000, "{command}");
        assert_eq!(command == "verify", told["ok"].is_boolean(), "{command}");
    }
}

#[test]
fn eight_vehicles_with_all_that_is_drawn_take_little_memory_live() {
    let dir = tempfile::tempdir().unwrap();
    let empty = empty_run(dir.path());
    assert_live_bounded(&hostile::fleet(dir.path(), 8, 110), empty);
}

#[test]
fn what_is_recorded_and_packed_and_a_cards_image_take_little_memory_with_any_command() {
    let dir = tempfile::tempdir().unwrap();
    let empty = empty_run(dir.path());
    let at = |name: &str| dir.path().join(name).display().to_string();
    let tlog = hostile::fleet(dir.path(), 8, 110).display().to_string();
    let raw = hostile::raw_heartbeats(dir.path(), 600_000).display().to_string();
    for (number, input) in [&tlog, &raw].into_iter().enumerate() {
        let image = at(&format!("{number}.img"));
        let [log, gs, tap] = ["hum", "gs", "tap"].map(|name| at(&format!("{number}.{name}")));
        let sim = ["sim", "--json", "--input", input, "--sd", &image, "--gs", &gs, "--tap", &tap];
        for words in [&["pack", input, "-o", &log][..], &sim] {
            assert_bounded(&words.join(" "), run(words).memory_kib_max, empty);
        }
        assert_all_bounded(Path::new(&image), empty);
    }
}

/// Ten million are tried by hand (5 GB): `HUMS_SESSIONS=10000000`.
#[test]
fn a_log_of_very_many_sessions_takes_little_memory_with_any_command() {
    let dir = tempfile::tempdir().unwrap();
    let empty = empty_run(dir.path());
    let count = std::env::var("HUMS_SESSIONS").map_or(100_000, |count| count.parse().unwrap());
    assert_all_bounded(&hostile::starts(dir.path(), count), empty);
}

/// The longest file in which lost sectors are made again, 16 MiB, and a longer one.
#[test]
fn a_file_of_nothing_but_parity_takes_little_memory() {
    let dir = tempfile::tempdir().unwrap();
    let empty = empty_run(dir.path());
    for blocks in [(32 << 10) - 1, 200 << 10] {
        let log = hostile::parity(dir.path(), blocks);
        for command in ["info", "verify"] {
            let words = [command, log.to_str().unwrap()];
            assert_bounded(
                &format!("{command} of {blocks} parity sectors"),
                run(&words).memory_kib_max,
                empty,
            );
        }
    }
}

#[test]
fn cards_full_of_entries_or_sessions_take_little_memory() {
    let dir = tempfile::tempdir().unwrap();
    let empty = empty_run(dir.path());
    let cards = [
        hostile::directories(dir.path(), 12, false),
        hostile::directories(dir.path(), 12, true),
        hostile::sessions(dir.path(), 60_000),
    ];
    for card in &cards {
        for flag in ["--json", "--salvage"] {
            let outcome = run(&["info", flag, card.to_str().unwrap()]);
            assert_bounded(&format!("info {flag} {}", card.display()), outcome.memory_kib_max, empty);
        }
    }
    // Every command looks for logs in the same way; of each session of the last card it would make a file.
    let page = dir.path().join("page.html");
    let out = dir.path().join("out");
    for card in cards[..2].iter().map(|card| card.to_str().unwrap()) {
        for words in [
            &["verify", "--json", card][..],
            &["check", card],
            &["report", card, "-o", page.to_str().unwrap()],
            &["decode", card, "-o", out.to_str().unwrap(), "--format", "jsonl"],
        ] {
            assert_bounded(&words.join(" "), run(words).memory_kib_max, empty);
        }
        assert_live_bounded(Path::new(card), empty);
    }
}
