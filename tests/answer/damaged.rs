//! Damaged, cut and foreign files: exit code 3 or 1, and the saved part is in every format.

use std::fs;
use std::path::Path;

use hums_tests::child;
use hums_tests::flights::own;
use hums_tests::program::{LIMIT, command, hums_with};

const FORMATS: &str = "tlog,csv,jsonl,influx,parquet,thesis,mcap,ulog,kml,gpx,srt";

#[test]
fn what_is_left_of_a_damaged_log_is_in_every_format_and_in_its_report() {
    let dir = tempfile::tempdir().unwrap();
    let log = dir.path().join("log.hum");
    hums_with("decode --format hum {} -o {}", &[&own("px4_hil_quad_low.tlog"), &log]).expect_code(&[0]);
    let whole = fs::read(&log).unwrap();
    let middle = whole.len() / 1024 * 512;
    let mut zeroed = whole.clone();
    zeroed[middle..middle + 20 * 512].fill(0);
    let mut noisy = whole.clone();
    noisy[middle..middle + 700].iter_mut().for_each(|byte| *byte ^= 0x5a);
    let cases = [
        ("zeroed", zeroed, 3),
        ("noisy", noisy, 3),
        ("cut", whole[..middle + 100].to_vec(), 3),
        ("headless", whole[40 * 512..].to_vec(), 3),
        ("foreign", b"GIF89a".repeat(2000), 1),
    ];
    for (name, bytes, code) in cases {
        let (damaged, out) = (dir.path().join(format!("{name}.hum")), dir.path().join(name));
        fs::write(&damaged, bytes).unwrap();
        let page = dir.path().join(format!("{name}.html"));
        let mut decode = command(["decode".as_ref(), damaged.as_os_str(), "-o".as_ref(), out.as_os_str()]);
        child::run(decode.args(["--format", FORMATS]), LIMIT).expect_code(&[code]);
        hums_with("report {} -o {}", &[&damaged, &page]).expect_code(&[code]);
        if code == 1 {
            assert!(!page.exists() && !out.exists(), "{name}: nothing is made of nothing");
            continue;
        }
        let entries =
            fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let jsonl = entries.filter_map(|file| Some(file.strip_suffix(".jsonl")?.to_owned()));
        let stem = jsonl.last().unwrap_or_else(|| panic!("{name}: a log"));
        assert!(stem.starts_with(&format!("{name}-s")), "{stem}");
        let read = |ending: &str| {
            fs::read_to_string(out.join(format!("{stem}{ending}")))
                .unwrap_or_else(|_| panic!("{stem}{ending}"))
        };
        let jsonl = read(".jsonl");
        assert!(jsonl.lines().filter(|line| line.contains("\"message\"")).count() > 5_000, "{name}");
        assert!(jsonl.contains("\"HUMS_GAP\""), "{name}");
        assert!(read(".lp").lines().any(|line| line.starts_with("HUMS_GAP,")), "{name}");
        assert_eq!(read("/HUMS_GAP.csv").lines().count(), 2, "{name}");
        assert_eq!(read(".thesis/gaps.csv").lines().count(), 2, "{name}");
        assert_eq!(read(".tlog.gaps.csv").lines().count(), 2, "{name}");
        assert!(out.join("HUMS_GAP").is_dir(), "{name}: a table in Parquet");
        let values = read(".thesis/flightvalues.csv");
        let seconds: Vec<u64> =
            values.lines().skip(1).filter_map(|row| row.split_once('s')?.0.parse().ok()).collect();
        let is_gap = |pair: &[u64]| pair[1] > pair[0] + 1;
        assert!(seconds.windows(2).any(is_gap) || name == "headless" || name == "cut", "{name}: {seconds:?}");
        let html = fs::read_to_string(page).unwrap();
        assert!(html.contains("\"gaps_count\":1"), "{name}");
    }
    beside_a_tlog(&dir.path().join("zeroed.hum"), dir.path());
}

/// Reported if no second output is possible; no tlog is written without it if a file is in its way.
fn beside_a_tlog(damaged: &Path, dir: &Path) {
    let (tlog, gaps) = (dir.join("one.tlog"), dir.join("one.tlog.gaps.csv"));
    let decode = |output: &Path| {
        let mut decode = command(["decode".as_ref(), damaged.as_os_str(), "-o".as_ref(), output.as_os_str()]);
        decode.args(["--format", "tlog"]);
        decode
    };
    let made = |code: i32| child::run(&mut decode(&tlog), LIMIT).expect_code(&[code]);
    made(3);
    let (frames, table) = (fs::read(&tlog).unwrap(), fs::read_to_string(&gaps).unwrap());
    let mut piped = std::process::Command::new("sh");
    piped.args(["-c", "{ \"$@\" 3>&1 1>&2; echo code $? >&2; } | cat", "sh"]);
    let decode_to_pipe = decode("/dev/fd/3".as_ref());
    piped.arg(decode_to_pipe.get_program()).args(decode_to_pipe.get_args());
    let piped = child::run(&mut piped, LIMIT).expect_code(&[0]);
    assert!(piped.stdout == frames, "the same frames");
    for words in ["1 gap, ", "1 gap without a table", "code 3\n"] {
        assert!(piped.stderr.contains(words), "{}", piped.stderr);
    }
    for other in ["mine".to_owned(), format!("{table}mine\n")] {
        fs::remove_file(&tlog).unwrap();
        fs::write(&gaps, &other).unwrap();
        let said = made(1).stderr;
        assert!(said.contains("one.tlog.gaps.csv: exists") && said.contains("move it away"), "{said}");
        assert!(!tlog.exists() && fs::read_to_string(&gaps).unwrap() == other);
        fs::remove_file(&gaps).unwrap();
        made(3);
    }
}
