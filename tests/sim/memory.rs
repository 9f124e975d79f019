//! No input makes a command take more than 64 MiB above an empty run, or the lower limit that its test names. Commands and
//! formats come from their definitions: a new one is tested, or fails the tests. One worker; `docs/decode.md` has the figure
//! for more. Most inputs are larger than their limit.

use std::fs;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use clap::CommandFactory as _;
use hums::cli::Cli;
use hums::decode::formats::FORMATS;
use hums_tests::child::{self, Outcome};
use hums_tests::hostile;
use hums_tests::live::Live;
use hums_tests::program::{LIMIT, command};

fn run<A: AsRef<std::ffi::OsStr>>(arguments: &[A]) -> Outcome {
    let mut command = command(arguments);
    command.env("RAYON_NUM_THREADS", "1");
    child::run(&mut command, LIMIT).expect_code(&[0, 1, 2, 3, 4])
}

/// KiB: 16 MiB, which runs with nearly no input take (12 to 16), and `above_mib`.
fn limit(above_mib: u64) -> u64 {
    (16 + above_mib) << 10
}

/// Inputs in a folder that is gone afterwards, each with this limit above an empty run.
#[track_caller]
fn assert_little<const N: usize>(above_mib: u64, inputs: impl FnOnce(&Path) -> [PathBuf; N]) {
    let dir = tempfile::tempdir().unwrap();
    for input in inputs(dir.path()) {
        assert_all_bounded(&input, limit(above_mib));
    }
}

#[track_caller]
fn assert_bounded(what: &str, kib: u64, kib_max: u64) {
    assert!(kib <= kib_max, "{what} took {kib} KiB of {kib_max}, 16 MiB of an empty run included");
}

enum Tried {
    /// `IN` is the input, `OUT/` a folder.
    Lines(Vec<String>),
    Live,
    /// The reason why its input is limited.
    Nothing(#[allow(dead_code, reason = "for the reader")] &'static str),
}

/// Unlisted commands fail the test.
fn tried(command: &str) -> Tried {
    let lines = |lines: &[&str]| Tried::Lines(lines.iter().map(|line| (*line).to_owned()).collect());
    match command {
        // Text and JSON share their data: one of them is enough.
        "info" => {
            lines(&["info --json IN", "info --salvage IN", "info --list IN", "info --verify --json IN"])
        }
        "check" => lines(&["check IN"]),
        "due" => lines(&["due IN"]),
        "logbook" => lines(&["logbook IN -o OUT/logbook.csv -o OUT/logbook.html -o OUT/flights/"]),
        "compact" => Tried::Nothing("tables of its own, whose groups have a limit of values"),
        "share" => lines(&["share IN -o OUT/shared"]),
        "report" => lines(&["report IN -o OUT/page.html", "report IN -o OUT/pages.html --compare"]),
        "decode" => {
            // Together they take most; formats of frames alone, which some logs lack, are tried apart.
            let formats = FORMATS.iter().map(|format| format.about.name);
            let (alone, together): (Vec<_>, Vec<_>) =
                formats.partition(|name| ["hum", "tlog", "thesis"].contains(name));
            let lines = alone.into_iter().map(str::to_owned).chain([together.join(",")]);
            Tried::Lines(lines.map(|names| format!("decode IN -o OUT/{names}/ --format {names}")).collect())
        }
        "sim" => lines(&["sim --json IN --sd OUT/card.img --gs OUT/gs --tap OUT/tap"]),
        "live" => Tried::Live,
        "completions" | "man" => Tried::Nothing("it reads no file"),
        // Of a line's bytes a limited part is kept (host-tools/src/talk), of a key 4 KiB.
        "box" => lines(&["box report IN -o OUT/report.json"]),
        unknown => panic!("how does `hums {unknown}` read a file? Say so in `tried`"),
    }
}

/// Each reading command and format, also if it refuses the input.
fn assert_all_bounded(input: &Path, most: u64) {
    assert_bounded_but(input, most, |_| false);
}

fn assert_bounded_but(input: &Path, most: u64, is_left_out: impl Fn(&str) -> bool) {
    let shown = input.to_str().unwrap();
    for command in Cli::command().get_subcommands() {
        match tried(command.get_name()) {
            Tried::Lines(lines) => {
                for line in lines.iter().filter(|line| !is_left_out(line)) {
                    let dir = tempfile::tempdir().unwrap();
                    let out = dir.path().display().to_string();
                    let put = |word: &str| word.replace("IN", shown).replace("OUT", &out);
                    let words: Vec<String> = line.split(' ').map(put).collect();
                    assert_bounded(&words.join(" "), run(&words).memory_kib_max, most);
                }
            }
            Tried::Live if !is_left_out("live") => assert_live_bounded(input, most),
            Tried::Live | Tried::Nothing(_) => {}
        }
    }
}

fn assert_live_bounded(log: &Path, most: u64) {
    let Some(live) = Live::attempt(&[log.to_str().unwrap()]) else { return };
    let (mut before, mut quiet) = (0.0, 0);
    let taken = loop {
        thread::sleep(Duration::from_millis(300));
        let (seconds, peak) = live.program.cost().expect("it runs");
        // In playback it publishes ten times a second, which takes nearly no time.
        quiet = if seconds - before < 0.06 { quiet + 1 } else { 0 };
        before = seconds;
        if quiet == 4 {
            break peak;
        }
    };
    assert_bounded(&format!("live of {}", log.display()), taken, most);
}

#[test]
fn a_log_that_expands_two_thousand_fold_takes_little_memory_with_any_command() {
    assert_little(32, |dir| {
        let log = hostile::heartbeats(dir, 200_000);
        assert!(fs::metadata(&log).unwrap().len() < 100_000);
        [log]
    });
}

#[test]
fn logs_of_one_kind_of_message_take_little_memory_with_any_command() {
    assert_little(32, |dir| [hostile::texts(dir, 50_000), hostile::parameters(dir, 30_000)]);
}

#[test]
fn a_log_of_many_unknown_ids_takes_little_memory_and_few_files() {
    let dir = tempfile::tempdir().unwrap();
    let most = limit(64);
    let ids = hostile::unknown_ids(dir.path(), 60_000);
    assert_all_bounded(&ids, most);
    let out = dir.path().join("tables");
    let words = ["decode", ids.to_str().unwrap(), "--format", "csv", "-o", out.to_str().unwrap()];
    run(&words);
    let folder = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path()).find(|path| path.is_dir());
    let folder = folder.unwrap_or(out);
    let files: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(files.len() < 10, "{} files", files.len());
    let shared = fs::read_to_string(folder.join("UNKNOWN.csv")).unwrap();
    let ids = shared.lines().skip(1).map(|line| line.split(',').nth(4).unwrap().parse::<u32>().unwrap());
    assert!(ids.eq(70_000..130_000), "{}", shared.lines().take(3).collect::<Vec<_>>().join("\n"));
}

#[test]
fn an_autopilots_log_of_thousands_of_tables_or_columns_takes_little_memory() {
    assert_little(64, |dir| {
        [hostile::wide_ulog(dir), hostile::long_arrays(dir), hostile::wide_dataflash(dir)]
    });
}

#[test]
fn an_autopilots_log_that_is_larger_than_what_may_be_held_takes_little_memory_with_any_command() {
    const ABOVE_MIB: u64 = 40;
    assert_little(ABOVE_MIB, |dir| {
        let logs = [hostile::long_dataflash(dir), hostile::long_ulog(dir)];
        assert!(logs.iter().all(|log| fs::metadata(log).unwrap().len() > ABOVE_MIB << 20));
        logs
    });
}

#[test]
fn the_logs_of_a_large_folder_are_told_one_by_one() {
    let dir = tempfile::tempdir().unwrap();
    let most = limit(64);
    let first = fs::read(hostile::heartbeats(dir.path(), 10)).unwrap();
    let logs = dir.path().join("logs");
    fs::create_dir(&logs).unwrap();
    for number in 0..4_000 {
        fs::write(logs.join(format!("{number:05}.hum")), &first).unwrap();
    }
    for command in [&["info", "--verify", "--json"][..], &["info", "--json"]] {
        let outcome = run(&[command, &[logs.to_str().unwrap()]].concat());
        let command = command.join(" ");
        assert_bounded(&command, outcome.memory_kib_max, most);
        let told: serde_json::Value = serde_json::from_str(&outcome.text()).unwrap();
        assert_eq!(told["logs"].as_array().unwrap().len(), 4_000, "{command}");
        assert_eq!(command.contains("--verify"), told["ok"].is_boolean(), "{command}");
    }
}

#[test]
fn eight_vehicles_with_all_that_is_drawn_take_little_memory_live() {
    let dir = tempfile::tempdir().unwrap();
    assert_live_bounded(&hostile::fleet(dir.path(), 8, 110), limit(64));
}

#[test]
fn what_is_recorded_and_packed_and_a_cards_image_take_little_memory_with_any_command() {
    assert_little(32, |dir| {
        let (tlog, image) = (hostile::fleet(dir, 8, 55), dir.join("card.img"));
        run(&["sim".as_ref(), tlog.as_os_str(), "--sd".as_ref(), image.as_os_str()]);
        [tlog, hostile::raw_heartbeats(dir, 150_000), image]
    });
}

#[test]
fn what_a_compressed_recording_expands_to_and_a_line_without_an_end_take_little_memory() {
    const ABOVE_MIB: u64 = 10;
    assert_little(ABOVE_MIB, |dir| {
        [hostile::expanding(dir, ABOVE_MIB + 2), hostile::long_line(dir, ABOVE_MIB + 2)]
    });
}

#[test]
fn files_of_parameters_keys_and_images_without_an_end_are_refused_and_take_little_memory() {
    let dir = tempfile::tempdir().unwrap();
    let most = limit(64);
    let log = hostile::heartbeats(dir.path(), 10).display().to_string();
    let raw = hostile::raw_heartbeats(dir.path(), 10).display().to_string();
    let image = dir.path().join("card.img").display().to_string();
    let endless = "/dev/zero";
    for words in [
        &["check", "--params", endless, &log][..],
        &["live", "--listen", "127.0.0.1:0", "--params", endless, &log],
        &["sim", "--params", endless, &raw, "--sd", &image],
        &["box", "params", "list", "--link", "tcp:127.0.0.1:1", "--key", endless],
        &["sim", "--firmware", endless, &raw, "--sd", &image],
    ] {
        let outcome = run(words);
        assert!(matches!(outcome.code, Some(1 | 2)), "{words:?}: {}", outcome.stderr);
        assert!(outcome.stderr.contains("/dev/zero: "), "{words:?}: {}", outcome.stderr);
        assert_bounded(&words.join(" "), outcome.memory_kib_max, most);
    }
}

/// Longer than a test may take: `HUMS_SESSIONS=10000000` (5 GB).
#[test]
fn a_log_of_very_many_sessions_takes_little_memory_with_any_command() {
    let count = std::env::var("HUMS_SESSIONS").map_or(70_000, |count| count.parse().unwrap());
    assert_little(32, |dir| [hostile::starts(dir, count)]);
}

/// 16 MiB, the longest file whose lost sectors are rebuilt, which takes twice its size; and a longer one.
#[test]
fn a_file_of_nothing_but_parity_takes_little_memory() {
    for blocks in [(32 << 10) - 1, 70 << 10] {
        assert_little(40, |dir| [hostile::parity(dir, blocks)]);
    }
}

#[test]
fn cards_full_of_entries_or_sessions_take_little_memory() {
    for bogus in [false, true] {
        // 260,000 entries.
        assert_little(20, |dir| [hostile::directories(dir, 4, bogus)]);
    }
    // `decode` would make a file for each of these sessions.
    let dir = tempfile::tempdir().unwrap();
    assert_bounded_but(&hostile::sessions(dir.path(), 30_000), limit(32), |line| line.starts_with("decode "));
}
