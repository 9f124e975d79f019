//! `hums check`: one verdict from every kind of recording.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
use hums_link::packet::Packet;

use super::support::{
    attempt, end_of, flight, frames_of, hums, json, piped, px4, recorded, records, run, stderr, text,
};

/// Checks of the place on a link, which other recordings lack.
const OF_THE_WIRE: [&str; 2] = ["heartbeat", "frames_lost"];

fn faults(dir: &Path) {
    fs::copy(flight("ap_quad_faults.tlog"), dir.join("faults.tlog")).expect("a copy");
}

fn findings(object: &serde_json::Value) -> Vec<(String, u64, String, f64)> {
    let findings = object["findings"].as_array().expect("an array");
    let own = |finding: &serde_json::Value| {
        let text = |name: &str| finding[name].as_str().expect("text").to_owned();
        let instance = finding["instance"].as_u64().expect("a number");
        (text("check"), instance, text("level"), finding["time_s"].as_f64().expect("a time"))
    };
    findings.iter().map(own).filter(|(check, ..)| !OF_THE_WIRE.contains(&check.as_str())).collect()
}

#[track_caller]
fn assert_same(left: &serde_json::Value, right: &serde_json::Value) {
    let (left, right) = (findings(left), findings(right));
    assert!(!left.is_empty());
    assert_eq!(left.len(), right.len(), "{left:#?}\n{right:#?}");
    for (one, other) in left.iter().zip(&right) {
        assert_eq!((&one.0, one.1, &one.2), (&other.0, other.1, &other.2));
        assert!((one.3 - other.3).abs() < 0.25, "{one:?} {other:?}");
    }
}

#[test]
fn a_recording_its_compressed_form_its_pack_and_its_card_are_found_alike() {
    let dir = tempfile::tempdir().expect("directory");
    faults(dir.path());
    let plain = fs::read(dir.path().join("faults.tlog")).expect("the recording");
    let file = fs::File::create(dir.path().join("named_by_nobody")).expect("a file");
    let mut packed = flate2::write::GzEncoder::new(file, flate2::Compression::fast());
    packed.write_all(&plain).and_then(|()| packed.finish().map(drop)).expect("written");
    let sim = json(&run(dir.path(), "sim faults.tlog --sd card.img --json", 0));
    run(dir.path(), "decode --format hum faults.tlog -o packed.hum", 0);
    for (input, format, by) in [
        ("faults.tlog", "tlog", "hums"),
        ("named_by_nobody", "tlog", "hums"),
        ("packed.hum", "hums", "hums"),
        ("card.img", "hums", "board"),
    ] {
        let checked = json(&run(dir.path(), &format!("check --json {input}"), 4));
        let said = ["schema", "format", "judged_by", "verdict"].map(|name| checked[name].as_str());
        assert_eq!(said, [Some("hums-check"), Some(format), Some(by), Some("critical")], "{input}");
        assert_same(&checked, &sim);
    }
}

#[test]
fn a_screen_says_what_it_was_what_it_means_and_what_to_do_and_what_was_not_judged() {
    let dir = tempfile::tempdir().expect("directory");
    faults(dir.path());
    let screen = text(&run(dir.path(), "check faults.tlog", 4));
    for words in [
        "quadrotor, ArduPilot",
        "in 1 flight",
        "faults.tlog: battery 1 cell low, 3.4 V at 4:20.8; do not fly before this is cleared up (2 critical findings, 3 warnings)\n",
        "CRITICAL    4:20.8  battery 1 cell low: 3.4 V (limit 3.5 V), for 1:36",
        "The weakest cell was close to empty",
        "Check the pack under load",
    ] {
        assert!(screen.contains(words), "{words}\n{screen}");
    }
    let place = |words: &str| screen.rfind(words).expect(words);
    assert!(place("cell low") < place("autopilot warns: battery"), "worst first: {screen}");
    assert!(screen.lines().count() < 30, "one screen: {screen}");
    assert_eq!(screen.matches("not judged: ").count(), 1, "{screen}");
    assert!(!screen.contains("battery temperature") && !screen.contains("failure flags"), "{screen}");
    let verbose = text(&run(dir.path(), "faults.tlog -v", 4));
    for words in ["no battery temperature: battery hot", "no failure flags of ESCs"] {
        assert!(verbose.contains(words), "{words}\n{verbose}");
    }
}

#[test]
fn nothing_wrong_is_exit_code_0_and_counts_what_could_be_judged() {
    let dir = recorded();
    let screen = text(&run(dir.path(), "check PX4", 0));
    assert!(screen.contains("nothing wrong in ") && screen.contains("not judged: "), "{screen}");
    assert!(text(&run(dir.path(), "check card.img", 0)).contains("nothing wrong in "));
}

#[test]
fn damage_is_said_with_its_place_and_a_finding_is_exit_code_4_all_the_same() {
    let dir = tempfile::tempdir().expect("directory");
    faults(dir.path());
    let mut bytes = fs::read(dir.path().join("faults.tlog")).expect("the recording");
    bytes[1_000_000..1_000_200].fill(0);
    fs::write(dir.path().join("hit.tlog"), &bytes).expect("written");
    let checked = json(&run(dir.path(), "check --json hit.tlog", 4));
    assert_eq!((checked["verdict"].as_str(), checked["damaged"].as_bool()), (Some("critical"), Some(true)));
    let place = checked["gaps"][0]["place"].as_u64().expect("a place");
    assert!((999_600..1_000_200).contains(&place), "{place}");
    let screen = text(&run(dir.path(), "check hit.tlog", 4));
    let verdict = screen.lines().next().unwrap_or_default();
    assert!(verdict.ends_with("; part of it is missing or damaged, and was not judged"), "{screen}");

    // A log whose recorder lost its power ends within a message: that is no damage.
    fs::write(dir.path().join("cut.tlog"), &bytes[..999_001]).expect("written");
    assert!(text(&run(dir.path(), "check cut.tlog", 4)).contains("\n  cut  "));
    run(dir.path(), "info cut.tlog", 0);
    let both = text(&run(dir.path(), "check hit.tlog cut.tlog", 4));
    let line = |name: &str| both.lines().find(|line| line.contains(name)).unwrap_or_default().to_owned();
    assert!(
        line("hit.tlog").ends_with("; part of it is missing or damaged")
            && line("cut.tlog").ends_with("; ends in the air"),
        "{both}"
    );
    assert!(both.contains("1  part of it is missing or damaged (counted above too)"), "{both}");
}

#[test]
fn a_log_whose_middle_is_gone_is_not_called_all_right_anywhere() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "decode --format hum PX4 -o log.hum", 0);
    let log = fs::read(dir.path().join("log.hum")).expect("a log");
    let from = log.len() / 1024 * 512;
    let missing = [&log[..from - 20 * 512], &log[from..]].concat();
    fs::write(dir.path().join("log.hum"), missing).expect("written");
    let words = "; part of it is missing or damaged, and was not judged";
    let screen = text(&run(dir.path(), "check log.hum", 3));
    assert!(screen.contains(words), "{screen}");
    fs::copy(px4(), dir.path().join("calm.tlog")).expect("a copy");
    let table = text(&run(dir.path(), "check log.hum calm.tlog", 3));
    let line = |name: &str| table.lines().find(|line| line.contains(name)).unwrap_or_default().to_owned();
    assert!(line("log.hum").starts_with("damaged ") && line("calm.tlog").starts_with("ok "), "{table}");
    assert!(line("log.hum").ends_with("part of it is missing or damaged"), "{table}");
    fs::write(dir.path().join("log.hum"), [&log[..512], &log[from..]].concat()).expect("written");
    for command in ["check", "info", "info --verify", "decode -o out --format tlog"] {
        let ended = run(dir.path(), &format!("{command} log.hum"), 3);
        let said = [ended.stdout, ended.stderr].concat();
        let said = String::from_utf8_lossy(&said);
        assert!(!said.contains("0 frames missing"), "{command}: {said}");
    }
}

#[test]
fn a_folder_gives_a_line_for_each_and_a_table_and_what_is_none_is_passed_over() {
    let dir = recorded();
    faults(dir.path());
    fs::create_dir(dir.path().join("more")).expect("a directory");
    fs::copy(flight("px4_hil_quad_low.tlog"), dir.path().join("more/calm.tlog")).expect("a copy");
    fs::write(dir.path().join("notes.txt"), "no recording").expect("a file");
    let lines = text(&run(dir.path(), "check .", 4));
    let of = |name: &str| lines.lines().find(|line| line.contains(name)).unwrap_or_default().to_owned();
    assert!(
        of("faults.tlog").starts_with("critical") && of("faults.tlog").contains("battery cell low"),
        "{lines}"
    );
    assert!(of("calm.tlog").starts_with("ok") && of("card").starts_with("ok"), "{lines}");
    assert!(!lines.contains("notes.txt") && lines.contains("3 logs checked"), "{lines}");
    let objects = text(&run(dir.path(), "check --json .", 4));
    assert_eq!(objects.lines().count(), 3);
}

#[test]
fn other_limits_give_other_findings() {
    let dir = recorded();
    fs::write(dir.path().join("strict.param"), "BAT_REM_WARN 90\n").expect("a file");
    for input in ["PX4", "card.img"] {
        let checked = json(&run(dir.path(), &format!("check --json --params strict.param {input}"), 4));
        assert_eq!(checked["problems"][0]["check"].as_str(), Some("batt_remaining"), "{input}");
    }
}

#[test]
fn a_recording_and_its_pack_are_a_summary_and_a_page_with_what_is_found() {
    let dir = tempfile::tempdir().expect("directory");
    faults(dir.path());
    run(dir.path(), "decode --format hum faults.tlog -o packed.hum", 0);
    for (input, format, words) in [
        ("faults.tlog", "tlog", "ground station's log (tlog)"),
        ("packed.hum", "hums", "checked here: what recorded this ran no checks"),
    ] {
        let log = json(&run(dir.path(), &format!("info --json {input}"), 0))["logs"][0].clone();
        assert_eq!((log["format"].as_str(), log["checked_by"].as_str()), (Some(format), Some("hums")));
        assert_eq!((&log["frames"], &log["messages"][0]["name"]), (&77_633.into(), &"HEARTBEAT".into()));
        let flight_s = log["usage"]["flight_time_s"].as_f64().expect("seconds");
        assert!((300.0..310.0).contains(&flight_s) && log["findings_count"].as_u64() > Some(3), "{log}");
        assert!(text(&run(dir.path(), &format!("info {input}"), 0)).contains(words), "{input}");
        run(dir.path(), &format!("report {input} -o {input}.html"), 0);
        let page = fs::read_to_string(dir.path().join(format!("{input}.html"))).expect("the page");
        for words in ["\"checked_by\":\"hums\"", "\"check\":\"cell_voltage\"", "Battery 1 is low"] {
            assert!(page.contains(words), "{input}: {words}");
        }
    }
    run(dir.path(), "report faults.tlog -o pages/", 0);
    let pages = fs::read_dir(dir.path().join("pages")).expect("a directory");
    let mut names = pages.map(|page| page.expect("a page").file_name().into_string().expect("UTF-8"));
    assert!(names.any(|name| name.starts_with("faults.tlog-r")));
}

#[test]
fn a_recording_is_decoded_without_a_log_of_ours_between() {
    let dir = tempfile::tempdir().expect("directory");
    faults(dir.path());
    run(dir.path(), "decode faults.tlog -o back.tlog --format tlog", 0);
    assert_eq!(frames_of(&dir.path().join("back.tlog")), frames_of(&flight("ap_quad_faults.tlog")));
    run(dir.path(), "decode faults.tlog -o out --format csv,jsonl,parquet", 0);
    run(dir.path(), "decode --format hum faults.tlog -o packed.hum", 0);
    run(dir.path(), "decode packed.hum -o packed --format csv", 0);
    let table = |folder: &str| {
        let folders = fs::read_dir(dir.path().join(folder)).expect("a folder");
        let folder = folders
            .map(|entry| entry.expect("an entry").path())
            .find(|path| path.join("ATTITUDE.csv").is_file());
        fs::read_to_string(folder.expect("tables").join("ATTITUDE.csv")).expect("a table")
    };
    let columns = |text: String| -> Vec<String> {
        // Without both times: a HUMS log keeps milliseconds.
        text.lines().map(|line| line.splitn(3, ',').nth(2).unwrap_or_default().to_owned()).collect()
    };
    assert_eq!(columns(table("out")), columns(table("packed")));
}

#[test]
fn a_recording_of_two_vehicles_is_told_as_that() {
    let dir = tempfile::tempdir().expect("directory");
    let both = [px4(), flight("ap_quad_guided.tlog")].map(|path| fs::read(path).expect("a recording"));
    fs::write(dir.path().join("both.tlog"), both.concat()).expect("written");
    let words = "more than one vehicle is in it: system 1 (PX4";
    let screen = text(&attempt(dir.path(), "check both.tlog"));
    assert!(screen.contains(words) && screen.contains("), system 1 (ArduPilot"), "{screen}");
    assert!(json(&attempt(dir.path(), "check --json both.tlog"))["remarks"][0].as_str().is_some());
    let info = text(&attempt(dir.path(), "info both.tlog"));
    assert!(info.contains(words), "{info}");
    fs::write(dir.path().join("one.tlog"), &both[0]).expect("written");
    fs::write(dir.path().join("two.tlog"), &both[1]).expect("written");
    let objects = text(&attempt(dir.path(), "check --json one.tlog two.tlog"));
    assert!(objects.lines().count() == 2 && !objects.contains("more than one vehicle"), "{objects}");
}

#[test]
fn a_folder_says_how_many_of_its_files_are_no_log() {
    let dir = tempfile::tempdir().expect("directory");
    faults(dir.path());
    fs::write(dir.path().join("notes.txt"), "nothing of a vehicle").expect("written");
    let told = stderr(&run(dir.path(), "check .", 4));
    assert!(told.contains("1 file passed over: no log of a known kind\n  ./notes.txt\n"), "{told}");
}

#[test]
fn a_log_without_times_is_not_called_good_and_its_page_neither() {
    let dir = tempfile::tempdir().expect("directory");
    let log = "ArduCopter V3.0.1\nFMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\nFMT, 13, 4, EV, B, Id\n\
        FMT, 1, 17, ATT, ccc, Roll,Pitch,Yaw\nEV, 10\nATT, 0.00, 0.47, 0.00\n";
    fs::write(dir.path().join("old.log"), log).expect("written");
    let screen = text(&run(dir.path(), "check old.log", 3));
    assert!(screen.contains("unknown: the log has no times, and nothing was judged"), "{screen}");
    assert!(screen.contains("ArduCopter V3.0.1") && !screen.contains("never armed"), "{screen}");
    run(dir.path(), "report old.log -o old.html", 3);
    let info = text(&run(dir.path(), "info old.log", 3));
    assert!(info.contains(" none of 5 messages has a time"), "{info}");
    assert!(!info.contains("sector"), "{info}");
}

fn dataflash(messages: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut log = Vec::new();
    for (kind, payload) in
        [(128, format_of(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"))].iter().chain(messages)
    {
        log.extend([0xA3, 0x95, *kind]);
        log.extend(payload);
    }
    log
}

fn format_of(kind: u8, length: u8, name: &str, characters: &str, columns: &str) -> Vec<u8> {
    let mut payload = vec![kind, length];
    for (words, size) in [(name, 4), (characters, 16), (columns, 64)] {
        payload.extend(words.bytes().chain(std::iter::repeat(0)).take(size));
    }
    payload
}

/// Control characters of terminals, and marks of writing direction.
fn obeyed(text: &str) -> Vec<char> {
    let is_bad = |c: &char| (c.is_control() && *c != '\n') || matches!(c, '\u{202a}'..='\u{202e}');
    text.chars().filter(is_bad).collect()
}

#[test]
fn no_word_of_a_log_and_no_name_of_a_file_is_obeyed_by_a_terminal() {
    let dir = tempfile::tempdir().expect("directory");
    let padded = |words: &str| words.bytes().chain(std::iter::repeat(0)).take(64).collect::<Vec<u8>>();
    let words = padded("ArduCopter V4.5.0 \u{1b}[2J\u{9b}31m\u{202e}evil");
    let messages = [
        (128, format_of(160, 75, "MSG", "QZ", "TimeUS,Message")),
        (128, format_of(161, 12, "\u{1b}]0", "QB", "TimeUS,=x\u{1b}<b>")),
        (160, [&1_000_000_u64.to_le_bytes()[..], &words].concat()),
        (161, [&2_000_000_u64.to_le_bytes()[..], &[1]].concat()),
    ];
    let name = "a\u{1b}[31m\nok 1:00 \u{202e}.bin";
    fs::create_dir(dir.path().join("logs")).expect("a directory");
    fs::write(dir.path().join("logs").join(name), dataflash(&messages)).expect("written");
    fs::write(dir.path().join("logs").join("b\u{1b}c\nd.bin"), "nothing").expect("written");
    fs::copy(flight("px4_hil_quad_low.tlog"), dir.path().join("logs/calm.tlog")).expect("a copy");
    let one = format!("logs/{name}");
    for arguments in [
        vec!["check", "logs"],
        vec!["check", "--json", "logs"],
        vec!["check", &one],
        vec!["info", "logs"],
        vec!["info", "--json", "logs"],
        vec!["report", &one, "-o", "page.html"],
        vec!["decode", &one, "-o", "out", "--format", "csv"],
        vec!["check", "logs/\u{1b}none"],
        vec!["info", "--verify", "logs/\u{1b}none"],
    ] {
        let output =
            super::support::hums().current_dir(dir.path()).args(&arguments).output().expect("it runs");
        for said in [&output.stdout, &output.stderr] {
            let said = String::from_utf8_lossy(said);
            assert!(obeyed(&said).is_empty(), "hums {arguments:?}\n{said:?}");
            assert!(!said.contains("\nok 1:00") && !said.contains("\nd.bin"), "{arguments:?}: {said}");
        }
    }
    let output = run(dir.path(), "check --json logs", 3);
    let names: Vec<String> = text(&output)
        .lines()
        .map(|line| {
            serde_json::from_str::<serde_json::Value>(line).expect("JSON")["log"]
                .as_str()
                .expect("a name")
                .to_owned()
        })
        .collect();
    assert!(names.contains(&one), "JSON has the name as it is: {names:?}");
}

#[test]
fn a_column_that_would_be_a_formula_is_none_in_the_header_either() {
    let dir = tempfile::tempdir().expect("directory");
    let messages = [
        (128, format_of(161, 12, "X", "QB", "TimeUS,=x<b>")),
        (161, [&2_000_000_u64.to_le_bytes()[..], &[1]].concat()),
    ];
    fs::write(dir.path().join("x.bin"), dataflash(&messages)).expect("written");
    run(dir.path(), "decode x.bin -o out --format csv", 0);
    let folder =
        fs::read_dir(dir.path().join("out")).expect("a folder").next().expect("tables").expect("an entry");
    let table = fs::read_to_string(folder.path().join("X.csv")).expect("a table");
    assert!(table.starts_with("time_boot[s],time_utc,TimeUS,'=x<b>\n"), "{table}");
}

#[test]
fn words_in_a_column_of_numbers_are_in_text_and_json_and_do_no_harm_in_columns() {
    let dir = tempfile::tempdir().expect("directory");
    let log = "ArduCopter V3.1\nFMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
        FMT, 4, 10, ODD, Ihh, TimeMS,A,B\nODD, 1000, high, 7\nODD, 2000, 5, 8\nODD, 3000, nan, 8\n";
    fs::write(dir.path().join("old.log"), log).expect("written");
    run(dir.path(), "decode old.log -o out --format csv,jsonl,parquet,influx", 0);
    let path = super::support::contents(&dir.path().join("out"));
    let of = |end: &str| {
        let (_, bytes) = path.iter().find(|(name, _)| name.ends_with(end)).expect("a file");
        String::from_utf8_lossy(bytes).into_owned()
    };
    assert!(
        of("ODD.csv").contains(",1000,high,7\n") && of("ODD.csv").contains(",2000,5,8\n"),
        "{}",
        of("ODD.csv")
    );
    assert!(of(".jsonl").contains("\"A\":\"high\",\"B\":7"), "{}", of(".jsonl"));
    assert!(!of(".lp").contains("high"), "a field of the line protocol has one type");
    assert!(path.iter().any(|(name, _)| name.starts_with("ODD/")));
}

#[test]
fn standard_input_is_read_once() {
    let dir = tempfile::tempdir().expect("directory");
    for command in ["check - -", "info - -", "decode - - -o out --format csv"] {
        let told = stderr(&run(dir.path(), command, 2));
        assert!(told.contains("standard input is named twice"), "{told}");
    }
    let bytes = fs::read(flight("px4_hil_quad_low.tlog")).expect("the recording");
    let length = bytes.len();
    let output = piped(hums().args(["info", "-"]), &bytes);
    assert!(text(&output).contains(&format!(" in {length} bytes")), "{}", text(&output));
}

#[test]
fn a_log_in_which_there_was_nothing_to_judge_does_not_look_good_to_a_script() {
    let dir = tempfile::tempdir().expect("directory");
    let padded = |words: &str| words.bytes().chain(std::iter::repeat(0)).take(64).collect::<Vec<u8>>();
    let definition = (128, format_of(160, 75, "MSG", "QZ", "TimeUS,Message"));
    let message =
        |second: u64, words: &str| (160, [&(second * 1_000_000).to_le_bytes()[..], &padded(words)].concat());
    let little: Vec<_> = std::iter::once(definition.clone())
        .chain((1..60).map(|second| message(second, "ArduCopter V4.6.3 (92b0cd78)")))
        .collect();
    fs::write(dir.path().join("little.bin"), dataflash(&little)).expect("written");
    let tracker = [definition, message(1, "AntennaTracker V4.5.0"), message(5, "x")];
    fs::write(dir.path().join("nobody.bin"), dataflash(&tracker)).expect("written");
    fs::write(dir.path().join("nobody.ulg"), ulog_of_nothing_known()).expect("written");
    let nobody = "unknown: no autopilot was heard, and nothing was judged";
    for (name, verdict, words) in [
        ("little.bin", "too_little", "not enough to judge: "),
        ("nobody.bin", "unknown", nobody),
        ("nobody.ulg", "unknown", nobody),
    ] {
        let checked = json(&run(dir.path(), &format!("check --json {name}"), 0));
        assert_eq!((checked["verdict"].as_str(), checked["damaged"].as_bool()), (Some(verdict), Some(false)));
        assert!(checked["vehicle"].is_null() == (verdict == "unknown"), "{checked}");
        assert!(text(&run(dir.path(), &format!("check {name}"), 0)).contains(words));
    }
    faults(dir.path());
    let table = text(&run(dir.path(), "check little.bin faults.tlog", 4));
    assert!(table.contains("1  not enough in it to judge") && !table.contains("nothing wrong"), "{table}");
    let table = text(&run(dir.path(), "check nobody.bin faults.tlog little.bin", 4));
    assert!(table.contains("1  no vehicle in it"), "{table}");
}

/// A ULog's header.
fn ulog_begun() -> Vec<u8> {
    [&b"ULog\x01\x12\x35\x01"[..], &1_000_000_u64.to_le_bytes()].concat()
}

fn ulog_message(log: &mut Vec<u8>, kind: u8, body: &[u8]) {
    log.extend((body.len() as u16).to_le_bytes());
    log.push(kind);
    log.extend(body);
}

fn ulog_of_nothing_known() -> Vec<u8> {
    let mut log = ulog_begun();
    let mut message = |kind: u8, body: &[u8]| ulog_message(&mut log, kind, body);
    message(b'F', b"camera_stuff:uint64_t timestamp;uint8_t shots;");
    message(b'A', &[&[0, 0, 0][..], b"camera_stuff"].concat());
    for second in 1..20_u64 {
        message(b'D', &[&[0, 0][..], &(second * 1_000_000).to_le_bytes(), &[7]].concat());
    }
    log
}

fn ulog_with_a_dropout() -> Vec<u8> {
    let mut log = ulog_begun();
    let mut message = |kind: u8, body: &[u8]| ulog_message(&mut log, kind, body);
    message(
        b'F',
        b"vehicle_status:uint64_t timestamp;uint8_t arming_state;uint8_t nav_state;uint8_t system_type;",
    );
    message(b'F', b"cpuload:uint64_t timestamp;float load;float ram_usage;");
    message(b'A', &[&[0, 0, 0][..], b"vehicle_status"].concat());
    message(b'A', &[&[0, 1, 0][..], b"cpuload"].concat());
    for second in 1..20_u64 {
        let time = (second * 1_000_000).to_le_bytes();
        message(b'D', &[&[0, 0][..], &time, &[1, 4, 2]].concat());
        message(b'D', &[&[1, 0][..], &time, &0.3_f32.to_le_bytes(), &0.3_f32.to_le_bytes()].concat());
        if second == 10 {
            message(b'O', &120_u16.to_le_bytes());
        }
    }
    log
}

#[test]
fn what_a_logger_itself_lost_is_said_and_is_no_damage_to_any_command() {
    let dir = tempfile::tempdir().expect("directory");
    fs::write(dir.path().join("drop.ulg"), ulog_with_a_dropout()).expect("written");
    let checked = json(&super::support::attempt(dir.path(), "check --json drop.ulg"));
    assert_eq!((checked["loss_count"].as_u64(), checked["damaged"].as_bool()), (Some(1), Some(false)));
    let info = text(&run(dir.path(), "info drop.ulg", 0));
    assert!(info.contains("1 place of loss or noise"), "{info}");
    run(dir.path(), "report drop.ulg -o page.html", 0);
    run(dir.path(), "check --system 1 drop.ulg", 2);
    let told = stderr(&run(dir.path(), "decode drop.ulg -o out --format csv", 0));
    assert!(told.contains("1 place of loss or noise; hums check says what"), "{told}");
}

#[test]
fn what_is_read_by_other_programs_is_told_with_what_to_do() {
    let dir = tempfile::tempdir().expect("directory");
    for (start, words) in [
        (&b"PK\x03\x04aaaa"[..], "ZIP archive; unpack it"),
        (b"\xfd7zXZ\0aaaa", "compressed with xz"),
        (b"ULogEnc\x01aaaa", "encrypted log of PX4"),
        (b"\xff\xfeF\0M\0T\0,\0", "UTF-16"),
    ] {
        fs::write(dir.path().join("x.bin"), start).expect("written");
        let told = stderr(&run(dir.path(), "check x.bin", 1));
        assert!(told.contains("x.bin: is ") && told.contains(words), "{told}");
        assert_eq!(told.lines().count(), 1, "{told}");
    }
}

#[test]
fn a_failsafe_and_a_crash_are_found_by_their_names() {
    let dir = tempfile::tempdir().expect("directory");
    let padded = |words: &str| words.bytes().chain(std::iter::repeat(0)).take(64).collect::<Vec<u8>>();
    let at = |ms: u64| (ms * 1_000).to_le_bytes();
    let mut messages = vec![
        (128, format_of(160, 75, "MSG", "QZ", "TimeUS,Message")),
        (128, format_of(161, 12, "EV", "QB", "TimeUS,Id")),
        (128, format_of(162, 13, "ERR", "QBB", "TimeUS,Subsys,ECode")),
        (160, [&at(500)[..], &padded("ArduCopter V4.6.3 (92b0cd78)")].concat()),
        (161, [&at(1_000)[..], &[10]].concat()),
        (162, [&at(5_000)[..], &[29, 1]].concat()),
        (162, [&at(9_000)[..], &[29, 0]].concat()),
        (162, [&at(15_000)[..], &[12, 1]].concat()),
        (161, [&at(15_000)[..], &[11]].concat()),
    ];
    // A stream that never pauses.
    messages.extend((0..200_u64).map(|step| (160, [&at(1_000 + 100 * step)[..], &padded("x")].concat())));
    messages.sort_by_key(|(kind, payload)| {
        if *kind == 128 { 0 } else { u64::from_le_bytes(*payload.first_chunk().expect("a time")) }
    });
    fs::write(dir.path().join("crash.bin"), dataflash(&messages)).expect("written");
    let checked = json(&super::support::attempt(dir.path(), "check --json crash.bin"));
    let problems = checked["problems"].as_array().expect("an array");
    let state = problems.iter().find(|problem| problem["check"] == "autopilot_state").expect("found");
    assert_eq!(state["detail"], "vibration failsafe, crash check");
    assert_eq!((state["level"].as_str(), state["times"].as_u64()), (Some("critical"), Some(2)));
    let screen = text(&super::support::attempt(dir.path(), "check crash.bin"));
    assert!(screen.contains("autopilot in failsafe (vibration failsafe, crash check)"), "{screen}");
}

fn with_times(log: &[u8], time: impl Fn(usize, u64) -> u64) -> Vec<u8> {
    let records = records(log).into_iter().enumerate();
    records.flat_map(|(index, (us, frame))| [&time(index, us).to_be_bytes()[..], frame].concat()).collect()
}

fn an_hour_ahead(log: &[u8]) -> Vec<u8> {
    with_times(log, |_, us| us + 3_600_000_000)
}

#[test]
fn what_is_decoded_of_joined_recordings_has_the_time_of_day_of_its_own_part() {
    let dir = tempfile::tempdir().expect("directory");
    let [first, second] = ["ap_quad_guided.tlog", "ap_quad_faults.tlog"]
        .map(|name| fs::read(flight(name)).expect("the recording"));
    let day = 24 * 3_600_000_000;
    let both = [with_times(&first, |_, us| us + 3 * day), with_times(&second, |_, us| us + day)].concat();
    fs::write(dir.path().join("both.tlog"), &both).expect("written");
    attempt(dir.path(), "decode both.tlog -o back.tlog --format tlog");
    let back = fs::read(dir.path().join("back.tlog")).expect("decoded");
    let (told, decoded) = (records(&both), records(&back));
    assert_eq!(told.len(), decoded.len());
    for (index, (told, decoded)) in told.iter().zip(&decoded).enumerate() {
        assert!(told.0.abs_diff(decoded.0) < 1_000_000, "record {index}: {} as {}", told.0, decoded.0);
    }
}

#[test]
fn one_wrong_time_changes_no_other_time_of_what_is_packed() {
    let dir = tempfile::tempdir().expect("directory");
    faults(dir.path());
    let log = fs::read(dir.path().join("faults.tlog")).expect("the recording");
    fs::write(
        dir.path().join("wrong.tlog"),
        with_times(&log, |index, us| if index == 999 { us ^ 1 << 36 } else { us }),
    )
    .expect("written");
    let told = stderr(&run(dir.path(), "decode --format hum wrong.tlog -o wrong.hum", 3));
    assert!(told.contains("1 message with a wrong time"), "{told}");
    run(dir.path(), "decode --format hum faults.tlog -o faults.hum", 0);
    let info = |name: &str| json(&attempt(dir.path(), &format!("info --json {name}")))["logs"][0].clone();
    let (wrong, right) = (info("wrong.hum"), info("faults.hum"));
    assert_eq!(wrong["duration_s"], right["duration_s"]);
}

#[test]
fn two_recordings_with_the_same_first_time_are_not_packed_as_one_session() {
    let dir = tempfile::tempdir().expect("directory");
    for (name, of) in
        [("one", "ap_quad_guided.tlog"), ("two", "ap_quad_faults.tlog"), ("again", "ap_quad_faults.tlog")]
    {
        let log = fs::read(flight(of)).expect("the recording");
        let first = records(&log)[0].0;
        let log = with_times(&log, |_, us| us - first + 1_800_000_000_000_000);
        fs::write(dir.path().join(format!("{name}.tlog")), log).expect("written");
        run(dir.path(), &format!("decode --format hum {name}.tlog -o {name}.hum"), 0);
    }
    let packed = |name: &str| fs::read(dir.path().join(format!("{name}.hum"))).expect("packed");
    let session = |name: &str| {
        json(&attempt(dir.path(), &format!("info --json {name}.hum")))["logs"][0]["session"].clone()
    };
    assert_ne!(session("one"), session("two"));
    assert_eq!(packed("two"), packed("again"));
}

#[test]
fn a_problem_has_the_time_of_day_of_its_own_part_of_the_recording() {
    let dir = tempfile::tempdir().expect("directory");
    faults(dir.path());
    let [quiet, faults] = ["ap_quad_guided.tlog", "ap_quad_faults.tlog"]
        .map(|name| fs::read(flight(name)).expect("the recording"));
    fs::write(dir.path().join("both.tlog"), [an_hour_ahead(&quiet), faults].concat()).expect("written");
    let alone = json(&run(dir.path(), "check --json faults.tlog", 4));
    let both = json(&run(dir.path(), "check --json both.tlog", 4));
    assert_eq!(both["clock_restarts"], 1);
    let of_cells = |checked: &serde_json::Value| {
        let problems = checked["problems"].as_array().expect("an array");
        let mut found = problems.iter().filter(|problem| problem["check"] == "cell_voltage");
        let at =
            found.next().expect("a problem with the cells")["time_utc"].as_str().expect("UTC").to_owned();
        // To ten seconds: the step of the monitor may fall otherwise.
        at[..18].to_owned()
    };
    assert_eq!(of_cells(&both), of_cells(&alone));
}

#[test]
fn a_packed_recording_has_the_times_the_damage_and_the_joints_that_check_sees() {
    let dir = tempfile::tempdir().expect("directory");
    let tlog = fs::read(px4()).expect("a recording");
    let write = |name: &str, bytes: &[u8]| fs::write(dir.path().join(name), bytes).expect("written");
    write("flight.raw", &frames_of(&px4()).concat());
    let middle = tlog.len() / 2;
    write("damaged.tlog", &[&tlog[..middle], &[7; 100], &tlog[middle + 300..]].concat());
    // The same vehicle, a day earlier.
    write("joined.tlog", &[tlog.clone(), with_times(&tlog, |_, us| us - 86_400_000_000)].concat());
    write("cut.tlog", &tlog[..tlog.len() - 5]);
    for (name, code) in [("flight.raw", 0), ("damaged.tlog", 3), ("joined.tlog", 0), ("cut.tlog", 0)] {
        run(dir.path(), &format!("decode --format hum {name} -o {name}.hum"), code);
        let of = |input: &str| {
            let checked = json(&attempt(dir.path(), &format!("check --json {input}")));
            let problems: Vec<String> = checked["problems"]
                .as_array()
                .expect("problems")
                .iter()
                .map(|problem| problem["check"].as_str().unwrap_or_default().to_owned())
                .collect();
            let joints = checked["clock_restarts"].as_u64();
            (checked["flight_s"].as_f64().expect("seconds"), problems, joints)
        };
        let (plain, packed) = (of(name), of(&format!("{name}.hum")));
        assert!((plain.0 - packed.0).abs() < 0.3, "{name}: {plain:?} {packed:?}");
        assert_eq!((&plain.1, plain.2), (&packed.1, packed.2), "{name}");
    }
    run(dir.path(), "check damaged.tlog.hum", 3);
    run(dir.path(), "info cut.tlog.hum", 0);
    run(dir.path(), "sim damaged.tlog --sd card.img", 3);
    // A frame whose checksum does not fit is damage of a tlog too.
    let first = frames_of(&px4())[0].len();
    let mut wrong = tlog.clone();
    wrong[8 + first - 1] ^= 1;
    write("wrong.tlog", &wrong);
    let told = stderr(&run(dir.path(), "decode --format hum wrong.tlog -o wrong.hum", 3));
    assert!(told.contains("1 frame with a wrong checksum"), "{told}");
    let checked = json(&run(dir.path(), "check --json wrong.hum", 3));
    assert_eq!((&checked["loss_count"], &checked["damage_count"]), (&1.into(), &0.into()));
    assert_eq!(checked["gaps"][0]["why"], "1 frame with a wrong checksum, which is not read");
}

#[test]
fn a_frame_whose_id_is_not_known_is_kept_bit_for_bit() {
    let dir = tempfile::tempdir().expect("directory");
    let mut tlog = fs::read(px4()).expect("a recording");
    let place: usize = frames_of(&px4())[..700].iter().map(|frame| 8 + frame.len()).sum();
    assert_eq!(tlog[place + 8], 0xFD, "MAVLink 2");
    tlog[place + 8 + 8] ^= 0x40;
    fs::write(dir.path().join("flip.tlog"), &tlog).expect("written");
    run(dir.path(), "decode flip.tlog -o same.tlog --format tlog", 0);
    assert!(fs::read(dir.path().join("same.tlog")).expect("made") == tlog);
    let packed = run(dir.path(), "decode --format hum flip.tlog -o flip.hum --json", 0);
    assert!(packed.stderr.is_empty(), "no byte is of no frame");
    assert_eq!(json(&packed)["logs"][0]["files"][0]["counts"]["frames"], 16_645);
    run(dir.path(), "info --verify flip.hum", 0);
    run(dir.path(), "decode flip.hum -o back.tlog --format tlog", 0);
    assert!(frames_of(&dir.path().join("back.tlog")) == frames_of(&dir.path().join("flip.tlog")));
    let told = text(&attempt(dir.path(), "check flip.tlog"));
    assert!(told.contains("1 frame of messages that this program has no definition of"), "{told}");
}

#[test]
fn a_file_that_is_no_log_has_an_object_too() {
    let dir = tempfile::tempdir().expect("directory");
    fs::write(dir.path().join("zeros"), vec![0; 100_000]).expect("written");
    let checked = json(&run(dir.path(), "check --json zeros", 1));
    assert!(checked["error"].as_str().is_some_and(|error| error.contains("zeros")), "{checked}");
    let both = text(&run(dir.path(), "check --json zeros PX4", 1));
    assert_eq!(both.lines().count(), 2, "{both}");
}

#[test]
fn what_another_vehicle_flew_teaches_nothing_and_is_said() {
    let dir = tempfile::tempdir().expect("directory");
    let names = ["ap_quad_guided.tlog", "px4_hil_quad_low.tlog"];
    for name in names {
        end_of(name, dir.path());
    }
    let [ardupilot, px4] = names;
    let said = stderr(&run(dir.path(), &format!("check --past {ardupilot} --past {px4} {px4}"), 2));
    assert!(said.contains("name flights of one vehicle") && said.contains(px4), "{said}");
    let told = |past: &str| text(&attempt(dir.path(), &format!("check --past {past} {px4}")));
    let words = "trends are not judged: the flights of --past are of another vehicle (system 1, quadrotor";
    assert!(told(ardupilot).contains(words), "{}", told(ardupilot));
    assert!(!told(px4).contains("another vehicle"), "{}", told(px4));
    let bytes = fs::read(dir.path().join(px4)).expect("there");
    let piped = piped(hums().current_dir(dir.path()).args(["check", "--past", ardupilot, "-"]), &bytes);
    assert!(text(&piped).contains(words), "{}", text(&piped));
    let alone = attempt(dir.path(), &format!("check {px4}"));
    assert_eq!(piped.status.code(), alone.status.code());
}

#[test]
fn bytes_of_no_frame_are_told_as_that_and_not_as_time_that_is_missing() {
    let dir = tempfile::tempdir().expect("directory");
    let signed = fs::read(flight("ap_quad_signed.raw")).expect("there");
    fs::write(dir.path().join("signed.raw"), &signed).expect("a copy");
    let checked = text(&run(dir.path(), "check signed.raw", 0));
    assert!(
        !checked.contains("of no frame") && checked.contains("160 bytes at its beginning are words"),
        "{checked}"
    );
    let info = text(&run(dir.path(), "info signed.raw", 0));
    assert!(info.contains("gaps     none"), "{info}");
    run(dir.path(), "report signed.raw -o pages/", 0);
    let table = fs::read_to_string(dir.path().join("pages/index.html")).expect("a table");
    assert!(table.contains("\"faults\":[]"));
    // Noise stays at its place.
    let (before, after) = signed.split_at(signed.len() / 2);
    let noisy = [before, &[0x80; 300], after].concat();
    fs::write(dir.path().join("noisy.raw"), noisy).expect("a copy");
    let checked = text(&run(dir.path(), "check noisy.raw", 0));
    assert!(checked.contains("; bytes of no frame are in it"), "{checked}");
    assert!(!checked.contains("not recorded"), "{checked}");
    let gaps = json(&run(dir.path(), "info --json noisy.raw", 0))["logs"][0]["gaps"].clone();
    let from_s = gaps[0]["from_s"].as_f64().expect("a time");
    assert!((40.0..120.0).contains(&from_s) && gaps[0]["to_s"].is_null() && gaps[1].is_null(), "{gaps}");
    run(dir.path(), "report noisy.raw -o pages/", 0);
    let table = fs::read_to_string(dir.path().join("pages/index.html")).expect("a table");
    assert!(table.contains("\"faults\":[\"1 place of loss or noise\"]"));
}

#[test]
fn raw_bytes_have_the_time_of_day_that_their_autopilot_tells() {
    let dir = tempfile::tempdir().expect("directory");
    fs::copy(flight("ap_quad_signed.raw"), dir.path().join("signed.raw")).expect("a copy");
    let log = json(&run(dir.path(), "info --json signed.raw", 0))["logs"][0].clone();
    assert!(
        log["start_utc"].as_str().is_some_and(|utc| utc.starts_with("2026-11-20T21:29:46")),
        "{}",
        log["start_utc"]
    );
    for command in ["check signed.raw", "info --list signed.raw"] {
        let said = text(&run(dir.path(), command, 0));
        assert!(said.contains("2026-11-20") && said.contains("21:29:46"), "{said}");
    }
    let said = text(&run(dir.path(), "decode signed.raw -o out/ --format csv", 0));
    assert!(!said.contains("time of day"), "{said}");
}

fn filtered(name: &str, dir: &Path, file: &str, keep: impl Fn(usize, usize, u32) -> bool) {
    let log = fs::read(flight(name)).expect("a recording");
    let records = records(&log);
    let id = |frame: &[u8]| match frame[0] {
        0xFD => u32::from_le_bytes([frame[7], frame[8], frame[9], 0]),
        _ => u32::from(frame[5]),
    };
    let all = records.len();
    let kept = records.iter().enumerate().filter(|(place, (_, frame))| keep(*place, all, id(frame)));
    let bytes: Vec<u8> = kept.flat_map(|(_, (us, frame))| [&us.to_be_bytes()[..], frame].concat()).collect();
    fs::write(dir.join(file), bytes).expect("written");
}

#[test]
fn what_nothing_tells_is_told_neither_as_good_nor_as_zero() {
    let dir = tempfile::tempdir().expect("directory");
    filtered("ap_quad_guided.tlog", dir.path(), "beats.tlog", |_, _, id| matches!(id, 0 | 253));
    let checked = text(&run(dir.path(), "check beats.tlog", 0));
    assert!(
        checked.contains("in air   not known") && checked.contains("not enough to judge: 3 of "),
        "{checked}"
    );
    let info = text(&run(dir.path(), "info beats.tlog", 0));
    assert!(info.contains("findings not enough to judge: 3 of 67 checks"), "{info}");
    assert!(!info.contains("On the ground") && info.contains("Armed"), "{info}");
    let listed = text(&run(dir.path(), "info --list beats.tlog", 0));
    assert!(listed.contains("not enough to judge (3 of 67 checks)"), "{listed}");
    let log = json(&run(dir.path(), "info --list --json beats.tlog", 0))["logs"][0].clone();
    assert_eq!((log["flight_s"].is_null(), log["checks_judged"].as_u64()), (true, Some(3)), "{log}");
    run(dir.path(), "report beats.tlog -o pages/", 0);
    let table = fs::read_to_string(dir.path().join("pages/index.html")).expect("a table");
    assert!(table.contains("\"little\":true") && table.contains("\"flight_unknown\":true"));
    let (mut encoder, mut buffer) = (Encoder::of(1, 1), [0; FRAME_BYTES_MAX]);
    let beat = Packet::new(0).u8(4, 2).u8(5, 3).u8(7, 3).u8(8, 3);
    let mut beats = Vec::new();
    for second in 0..60_u64 {
        beats.extend((1_800_000_000_000_000 + second * 1_000_000).to_be_bytes());
        beats.extend(encoder.frame(&mut buffer, &beat));
    }
    fs::write(dir.path().join("alone.tlog"), beats).expect("written");
    run(dir.path(), "sim alone.tlog --sd card.img", 0);
    let listed = text(&run(dir.path(), "info --list card.img", 0));
    assert!(listed.contains("not enough to judge"), "{listed}");
}

#[test]
fn a_recording_that_ends_in_the_air_says_so_everywhere_and_where_it_was_heard_last() {
    let dir = tempfile::tempdir().expect("directory");
    filtered("ap_quad_faults.tlog", dir.path(), "cut.tlog", |place, all, _| place < all / 3 * 2);
    for command in ["check cut.tlog", "info cut.tlog"] {
        let said = text(&attempt(dir.path(), command));
        assert!(said.contains("the recording ends in the air: ") && said.contains("m above home"), "{said}");
        assert!(said.contains("over ground, at ") && said.contains("what became of the vehicle"), "{said}");
    }
    let listed = text(&attempt(dir.path(), "info --list cut.tlog"));
    assert!(listed.contains("; ends in the air"), "{listed}");
    run(dir.path(), "report cut.tlog -o pages/", 0);
    let table = fs::read_to_string(dir.path().join("pages/index.html")).expect("a table");
    assert!(table.contains("\"ends_in_air\":true"));
    let end = json(&attempt(dir.path(), "check --json cut.tlog"))["ends_in_air"].clone();
    assert!(end["latitude_deg"].as_f64().is_some_and(|north| north.abs() > 1.0), "{end}");
    let later = |place: usize, all: usize| place > all / 2 && place < all / 3 * 2;
    filtered("ap_quad_faults.tlog", dir.path(), "later.tlog", |place, all, _| later(place, all));
    run(dir.path(), "sim later.tlog --sd later.img", 0);
    let listed = text(&attempt(dir.path(), "info --list later.img"));
    assert!(listed.contains("; begins in the air; ends in the air"), "{listed}");
}

#[test]
fn a_finding_has_one_onset_and_one_worst_value_in_every_command() {
    let dir = tempfile::tempdir().expect("directory");
    faults(dir.path());
    let in_flight = |place: usize, all: usize| place < all / 4 * 3;
    filtered("ap_quad_faults.tlog", dir.path(), "cut.tlog", |place, all, _| in_flight(place, all));
    run(dir.path(), "sim faults.tlog --sd card.img", 0);
    run(dir.path(), "sim cut.tlog --sd cut.img", 0);
    let mut rises = Vec::new();
    for log in ["faults.tlog", "cut.tlog", "card.img", "cut.img"] {
        let checked = json(&attempt(dir.path(), &format!("check --json {log}")));
        let info = json(&attempt(dir.path(), &format!("info --json {log}")));
        let findings = checked["findings"].as_array().expect("an array");
        assert_eq!(Some(findings), info["logs"][0]["findings"].as_array(), "{log}");
        let mut worse = 0;
        for problem in checked["problems"].as_array().expect("an array") {
            let is_it = |finding: &&serde_json::Value| {
                ["check", "instance", "level", "time_s"].iter().all(|name| finding[*name] == problem[*name])
            };
            let finding = findings.iter().find(is_it).expect("the finding");
            assert_eq!(
                (&finding["value"], &finding["worst"]),
                (&problem["onset"], &problem["value"]),
                "{log}"
            );
            worse += usize::from(problem["onset"] != problem["value"]);
            if problem["check"] == "vibration_rise" {
                rises.push(problem["value"].as_f64().expect("a number"));
            }
        }
        assert!(worse > 0, "{log}: no value that became worse");
        for command in ["check", "info"] {
            let said = text(&attempt(dir.path(), &format!("{command} {log}")));
            assert!(said.contains("usual, at worst "), "{command} {log}: {said}");
        }
    }
    run(dir.path(), "report faults.tlog -o page.html", 0);
    assert!(fs::read_to_string(dir.path().join("page.html")).expect("a page").contains("usual, at worst "));
    let [first, .., last] = rises.as_slice() else { panic!("{rises:?}") };
    assert!((first - last).abs() < 0.1 * first, "{rises:?}");
}

/// A log with the samples of its inertial sensor at 1 kHz has their spectrum on its page; one at 100 Hz has none.
#[test]
fn a_page_has_the_spectrum_of_vibration_where_the_log_has_the_rate() {
    let dir = tempfile::tempdir().expect("directory");
    for (name, rate_hz) in [("fast", 1_000_u32), ("slow", 100)] {
        let mut log = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
             FMT, 152, 35, IMU, Qffffff, TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ\n"
            .to_owned();
        for place in 0..rate_hz * 4 {
            let second = f64::from(place) / f64::from(rate_hz);
            let shaking = (std::f64::consts::TAU * 40.0 * second).sin();
            let time_us = (second * 1e6) as u64;
            let _ = writeln!(log, "IMU, {time_us}, 0, 0, 0.1, 0, {shaking}, -9.8");
        }
        fs::write(dir.path().join(format!("{name}.log")), log).expect("written");
        run(dir.path(), &format!("report {name}.log"), 0);
        let page = fs::read_to_string(dir.path().join(format!("{name}.html"))).expect("a page");
        assert_eq!(page.contains("\"spectra\":[]"), name == "slow");
        assert_eq!(page.contains("\"unit\":\"m/s²/√Hz\""), name == "fast");
    }
}
