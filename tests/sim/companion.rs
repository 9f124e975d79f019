//! The box as a companion, against a ground station of pymavlink's.
#![cfg(feature = "oracle")]

use std::ffi::OsStr;
use std::fs;
use std::io::ErrorKind;
use std::net::UdpSocket;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use hums_tests::fat::drive;
use hums_tests::flights::{own, root};
use hums_tests::oracle;
use hums_tests::program::{hums, hums_with};
use serde_json::Value;
use tempfile::TempDir;

use super::board::{Board, assert_on_card, card, on, pulled_log};

#[test]
fn a_ground_station_lists_reads_sets_and_commands() {
    let board = Board::start(&[]);
    let said = oracle::companion(board.port);
    let log = board.end();

    assert_eq!(said["heartbeat"], serde_json::json!([1, 18, 8]), "system, type, autopilot: {said}");
    let names: Vec<&str> = said["names"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(names.contains(&"GS_BUDGET") && names.contains(&"BAT_REM_WARN"), "{said}");
    for list in ["listed", "listed_again"] {
        assert_eq!(said[list], said["count"], "{list}: {said}");
        assert_eq!(said["count"].as_u64(), Some(names.len() as u64));
    }
    assert_eq!((&said["read"], &said["read_at_0"]), (&2000.0.into(), &0.into()));
    assert_eq!((&said["set"], &said["set_as_integer"]), (&22.0.into(), &9.0.into()), "{said}");
    for kept in ["refused", "refused_nan", "after"] {
        assert_eq!(said[kept], 22.0, "{kept}: the value that counts: {said}");
    }
    // MAV_RESULT: 0 accepted, 3 unsupported.
    assert_eq!(said["unsupported"], 3);
    // 2 denied, 4 failed.
    assert_eq!((&said["no_component"], &said["nothing_to_cancel"]), (&2.into(), &4.into()), "{said}");
    for accepted in ["version_ack", "stop", "record", "replaced"] {
        assert_eq!(said[accepted], 0, "{accepted}: {said}");
    }
    // COMMAND_INT, FTP, MAVLink 2, C_CAST.
    assert_eq!(said["capabilities"], 8 | 32 | 8_192 | 131_072);
    assert_eq!(said["protocol"], 200);
    assert_eq!(said["for_the_autopilot"], Value::Null, "that is not ours to answer");

    // Each change with its author.
    let changes: Vec<Value> = log
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap())
        .filter(|row| row["record"] == "HUMS_PARAM" && row["fields"]["changed"] == true)
        .map(|row| row["fields"].clone())
        .collect();
    let change = |name: &str, value: f64| {
        serde_json::json!({
            "name": name, "value": value, "changed": true, "by_system": 255, "by_component": 190
        })
    };
    let expected = [("BAT_REM_WARN", 22.0), ("BAT_REM_CRIT", 9.0), ("CMP1_KIND", 4.0)];
    assert_eq!(changes, expected.map(|(name, value)| change(name, value)));
    for recorded in ["recording stopped by 255/190", "recording started by 255/190"] {
        assert!(log.contains(recorded), "the record does not tell: {recorded}");
    }
}

#[test]
fn once_there_is_a_key_only_what_is_signed_with_it_and_new_does_anything_also_after_power_off() {
    let dir = tempfile::tempdir().unwrap();
    let (params, store, state) =
        (dir.path().join("params.txt"), dir.path().join("store"), dir.path().join("state"));
    fs::write(&params, "GS_BUDGET 5000\nSIGN_PORT 1\nGS_SIGN 2\n").unwrap();
    let (params, store) = (params.display().to_string(), store.display().to_string());

    let board = Board::start_in(dir, &["--params", &params, "--store", &store]);
    let first = oracle::signing(board.port, &state);
    let dir = board.switch_off();
    assert_eq!((&first["before"], &first["plain"]["signed"]), (&20.0.into(), &0.into()), "{first}");
    assert_eq!(first["key"], "HUMS: signing key set", "{first}");

    let board = Board::start_in(dir, &["--store", &store]);
    let second = oracle::signing(board.port, &state);
    let dir = board.switch_off();
    assert_eq!(second["replayed_after_power_off"], serde_json::json!([24.0]), "{second}");
    assert_eq!(second["stamps_go_on"], true, "{second}");

    for (said, stays) in [(&first, 20.0), (&second, 24.0)] {
        let sealed = &said["sealed"];
        assert!(sealed["signed"].as_u64() > Some(3), "{said}");
        assert_eq!(sealed["good"], sealed["signed"], "{said}");
        assert_eq!([&sealed["unsigned"], &sealed["wrong"], &sealed["bad"]], [0, 0, 0], "{said}");
        assert_eq!((&sealed["rises"], &said["unsigned_list"]), (&true.into(), &true.into()), "{said}");
        assert_eq!((&said["unsigned_set"], &said["unsigned_command"]), (&stays.into(), &2.into()), "{said}");
        assert_eq!((&said["signed_set"], &said["signed_command"]), (&21.0.into(), &true.into()), "{said}");
        assert_eq!(said["wrong_key"], serde_json::json!([23.0]), "{said}");
        assert_eq!(said["replayed"], serde_json::json!([23.0, 23.0]), "{said}");
        assert_eq!(said["after"], 24.0, "{said}");
    }
    // At least the two unsigned ones, in each session.
    assert!(statistic(&dir, "requests_refused").into_iter().all(|refused| refused >= 2), "not recorded");
    let card = fs::read(dir.path().join("card.img")).unwrap();
    let key: Vec<u8> = (1..33).collect();
    assert!(memchr::memmem::find(&card, &key).is_none(), "the key is on the card");
}

fn statistic(dir: &TempDir, name: &str) -> Vec<u64> {
    let (image, out) = (dir.path().join("card.img"), dir.path().join("decoded"));
    hums_with("decode {} -o {} --format jsonl", &[&image, &out]).expect_code(&[0, 3]);
    let logs = fs::read_dir(out).unwrap().map(|log| fs::read_to_string(log.unwrap().path()).unwrap());
    logs.map(|log| {
        let mut rows = log.lines().rev().map(|line| serde_json::from_str::<Value>(line).unwrap());
        let stats = rows.find(|row| row["record"] == "HUMS_STATS").unwrap();
        stats["fields"][name].as_u64().unwrap()
    })
    .collect()
}

fn between_autopilot_and_ground_station(kind: &str) -> (Value, TempDir) {
    let (dir, _) = card(0..80_000, "1");
    let params = dir.path().join("params.txt");
    fs::write(&params, "GS_BUDGET 5000\nGS_PASS 1\n").unwrap();
    let autopilot = hums_tests::live::free_port();
    let input = format!("udpin:127.0.0.1:{autopilot}");
    let board = Board::start_with(input.as_ref(), dir, &["--params", params.to_str().unwrap()]);
    let said = oracle::vehicle(autopilot, board.port, kind);
    (said, board.switch_off())
}

fn assert_what_passes(said: &Value, dir: &TempDir) {
    for (passes, expected) in [("up", true), ("down", true), ("stays_up", false), ("stays_down", false)] {
        for (name, passed) in said[passes].as_object().unwrap() {
            assert_eq!(passed, &Value::from(expected), "{passes} {name}: {said}");
        }
    }
    // The key's bytes that passed both ports.
    let key: Vec<u8> = (0..32).collect();
    let card = fs::read(dir.path().join("card.img")).unwrap();
    assert!(memchr::memmem::find(&card, &key).is_none(), "the key is on the card");
    let (before, after) = (said["logs_before"].as_array().unwrap(), said["logs_after"].as_array().unwrap());
    assert_eq!((before.len(), after.len()), (2, 1), "erased but for the one in work: {said}");
    // The log is on the card, but not offered.
    let image = dir.path().join("card.img");
    let info = hums_with("info {}", &[&image]).expect_code(&[0, 3]).text();
    assert!(info.contains("00001_00.HUM"), "{info}");
}

#[test]
fn a_px4_is_asked_for_what_is_missing_and_its_radio_is_shared() {
    let (said, dir) = between_autopilot_and_ground_station("px4");
    let asked: Vec<u64> = said["asked"].as_array().unwrap().iter().filter_map(Value::as_u64).collect();
    // SYSTEM_TIME comes unasked; this autopilot refuses VIBRATION, which is not requested again.
    assert!(asked.contains(&30) && asked.contains(&291) && !asked.contains(&2), "{said}");
    assert!(!asked.contains(&11_030), "that is ArduPilot's: {said}");
    assert_eq!((&said["times_asked"], &said["groups"]), (&1.into(), &serde_json::json!([])), "{said}");
    assert!(said["version_asked"].as_u64() >= Some(1), "{said}");
    assert!(said["asked_again"].as_u64() >= Some(10), "after a reboot: {said}");
    assert_what_passes(&said, &dir);
    // With the requests to the autopilot until then: system, component, confirmation.
    assert_eq!(said["cancelled"], serde_json::json!([true, true, false, []]), "{said}");
    assert_eq!(said["asked_for"], serde_json::json!([true, false, true, [[1, 1, 0]]]), "{said}");
}

#[test]
fn an_ardupilot_that_knows_no_intervals_is_asked_for_groups_and_its_radio_is_shared() {
    let (said, dir) = between_autopilot_and_ground_station("ardupilot");
    assert_eq!(said["groups"], serde_json::json!([1, 2, 3, 6, 10, 11, 12]), "{said}");
    assert!(said["asked"].as_array().unwrap().len() <= 5, "refused often enough: {said}");
    assert!(said["asked_again"].as_u64() >= Some(7), "after a reboot: {said}");
    assert_what_passes(&said, &dir);
}

#[test]
fn mavproxy_lists_sets_downloads_and_signs() {
    let (dir, card) = card(0..80_000, "1");
    let params = dir.path().join("params.txt");
    fs::write(&params, "GS_BUDGET 5000\nSIGN_PORT 1\nGS_SIGN 2\n").unwrap();
    let folder = dir.path().join("mavproxy");
    let board = Board::start_in(dir, &["--params", params.to_str().unwrap()]);
    let said = oracle::mavproxy(board.port, &folder);
    assert_eq!(said["detected"], "Detected vehicle 1:191", "{said}");
    let count = said["received"].as_str().and_then(|count| count.parse().ok());
    assert_eq!(count, Some(hums_core::parameters::TABLE.len()), "{said}");
    assert_eq!((&said["shown"], &said["set"]), (&"5000.0".into(), &"33.0".into()), "{said}");
    assert_eq!(said["refused"], "33.0", "{said}");
    assert_eq!(said["logs"], "2", "{said}");
    assert_on_card(&folder.join("log.bin"), &card);
    assert_on_card(&folder.join("ftp.hum"), &card);
    let whole = fs::read(folder.join("ftp.hum")).unwrap();
    let crc = said["crc"].as_str().and_then(|crc| u32::from_str_radix(&crc[2..], 16).ok());
    assert_eq!(crc, Some(hums_link::ftp::checksum(0, &whole)), "{said}");
    assert_eq!((&said["key"], &said["signed"]), (&"HUMS: signing key set".into(), &"34.0".into()), "{said}");

    // With the passphrase our own tool gets an answer.
    let key = folder.join("key.txt");
    fs::write(&key, "passphrase-of-this-flight\n").unwrap();
    let get = "params get BAT_REM_WARN";
    for (words, keyed, code, said) in [
        (get, false, 1, "no answer"),
        (get, true, 0, "BAT_REM_WARN 34\n"),
        ("params sign --remove", true, 0, "key removed\n"),
        (get, false, 0, "BAT_REM_WARN 34\n"),
        ("params sign", true, 0, "key set\n"),
        (get, true, 0, "BAT_REM_WARN 34\n"),
    ] {
        let words = if keyed { format!("{words} --key {}", key.display()) } else { words.to_owned() };
        let outcome = on(&board.address(), &words).expect_code(&[code]);
        let told = if code == 0 { outcome.text() == said } else { outcome.stderr.contains(said) };
        assert!(told, "{words}: {outcome:?}");
    }
}

#[test]
fn mavproxy_shows_what_the_box_says_with_the_module_and_nothing_without_it() {
    let dir = tempfile::tempdir().unwrap();
    let (card, stream) = (dir.path().join("card.img"), dir.path().join("stream.raw"));
    let flight = root().join("tests/labelled/f40_baro_off.tlog.gz");
    let arguments: [&OsStr; 6] = [
        "sim".as_ref(),
        flight.as_os_str(),
        "--sd".as_ref(),
        card.as_os_str(),
        "--gs".as_ref(),
        stream.as_os_str(),
    ];
    hums(arguments).expect_code(&[0]);
    let said = oracle::mavproxy_alerts(&stream, &root().join("docs/stations"), &dir.path().join("mavproxy"));
    assert_eq!((&said["autopilot"], &said["loaded"]), (&true.into(), &true.into()), "{said}");
    let texts = said["texts"].as_array().unwrap();
    assert!(texts.contains(&"HUMS: autopilot warns: barometer".into()), "{said}");
    assert_eq!(said["without"], serde_json::json!([]), "{said}");
    assert_eq!(said["with"], said["texts"], "each, in its order: {said}");
    assert_eq!(said["again"], said["texts"], "{said}");
    let level = said["level"].as_str().unwrap();
    assert!(level.contains("HUMS level: ") && !level.contains("not heard"), "{said}");
}

fn put_parameters(image: &Path, lines: &str) {
    let text = image.with_file_name("PARAMS.TXT");
    fs::write(&text, lines).unwrap();
    let copied =
        Command::new("mcopy").args(["-i", &drive(image)]).arg(&text).arg("::PARAMS.TXT").status().unwrap();
    assert!(copied.success());
}

#[test]
fn a_box_that_restarts_in_the_air_reads_no_parameters() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    let flight = own("ap_quad_faults.tlog");
    let record = |further: &[&str], codes: &[i32]| {
        let input = flight.as_os_str();
        let command = ["sim".as_ref(), input, "--sd".as_ref(), image.as_os_str()];
        hums(command.into_iter().chain(further.iter().map(AsRef::as_ref))).expect_code(codes)
    };
    record(&[], &[0]);
    put_parameters(&image, "PROT_ACTION 1\nBAT_REM_WARN 31\n");
    // Input while the power is off is lost.
    let said = record(&["--json", "--reboot-at", "60"], &[3]).text();
    let said: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said["log_files"].as_array().map(Vec::len), Some(2), "{said}");
    assert!(said["frames_lost"].as_u64() < Some(150), "{said}");
    let out = dir.path().join("out");
    hums_with("decode {} -o {} --format jsonl", &[&image, &out]).expect_code(&[0, 3]);
    let mut sessions: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path()).collect();
    sessions.sort();
    let is_set = |line: &&str| line.contains("HUMS_PARAM") && line.contains("\"changed\":true");
    let set = sessions.iter().map(|log| fs::read_to_string(log).unwrap().lines().filter(is_set).count());
    assert_eq!(set.collect::<Vec<_>>(), [0, 2, 0]);
}

#[test]
fn parameters_on_the_card_are_set_and_recorded_and_wrong_ones_are_told() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    let recording = own("px4_hil_quad_low.tlog");
    let record = |expected: &[i32]| {
        let input = recording.as_os_str();
        hums(["sim".as_ref(), input, "--sd".as_ref(), image.as_os_str()]).expect_code(expected);
    };
    record(&[0]);
    let long = "x".repeat(300);
    let lines = format!(
        "# of this airframe {long}\nBAT_REM_WARN,31\r\nSIGN_PORT 2\n1\t1\tARMING_CHECK\t1\t6\nNO_SUCH 1\n\
         BAT_REM_CRIT 1000\n{long}\nCELL_VOLT_CRIT 3.25"
    );
    put_parameters(&image, &lines);
    record(&[0]);
    let out = dir.path().join("out");
    hums_with("decode {} -o {} --format jsonl", &[&image, &out]).expect_code(&[0]);
    let second = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path()).max().unwrap();
    let log = fs::read_to_string(second).unwrap();
    for (name, value) in [("BAT_REM_WARN", "31.0"), ("SIGN_PORT", "2.0"), ("CELL_VOLT_CRIT", "3.25")] {
        let set = log.lines().any(|line| line.contains(name) && line.contains(value));
        assert!(set, "{name} is not set to {value}");
    }
    for told in ["line 5 is refused", "line 6 is refused", "line 7 is refused", "PARAMS.TXT: lines refused"] {
        assert!(log.contains(told), "{told}");
    }
    assert!(!log.contains("line 1 is refused") && !log.contains("line 4 is refused"));
}

struct Lossy {
    port: u16,
    lost: Arc<AtomicU32>,
    over: Arc<AtomicBool>,
}

impl Lossy {
    fn to(board: u16) -> Self {
        let (lost, over) = (Arc::new(AtomicU32::new(0)), Arc::new(AtomicBool::new(false)));
        let client = UdpSocket::bind("127.0.0.1:0").unwrap();
        let port = client.local_addr().unwrap().port();
        let server = UdpSocket::bind("127.0.0.1:0").unwrap();
        server.connect(("127.0.0.1", board)).unwrap();
        let (counted, ended) = (Arc::clone(&lost), Arc::clone(&over));
        std::thread::spawn(move || {
            for socket in [&client, &server] {
                socket.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
            }
            let (mut peer, mut random, mut buffer) = (None, 7_u32, [0; 2048]);
            let mut loses = || {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let loses = random >> 16 & 0xff < 26;
                counted.fetch_add(u32::from(loses), Ordering::Relaxed);
                loses
            };
            while !ended.load(Ordering::Relaxed) {
                match client.recv_from(&mut buffer) {
                    Ok((count, from)) => {
                        peer = Some(from);
                        if !loses() {
                            let _ = server.send(&buffer[..count]);
                        }
                    }
                    Err(error) => {
                        assert!(matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut));
                    }
                }
                if let (Ok(count), Some(peer)) = (server.recv(&mut buffer), peer)
                    && !loses()
                {
                    let _ = client.send_to(&buffer[..count], peer);
                }
            }
        });
        Self { port, lost, over }
    }
}

impl Drop for Lossy {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

#[test]
fn a_log_pulled_over_a_link_that_loses_a_tenth_is_the_one_on_the_card() {
    let (dir, card) = card(0..80_000, "1");
    let params = dir.path().join("params.txt").display().to_string();
    let (pulled, downloaded) = (dir.path().join("pulled"), dir.path().join("downloaded"));
    let board = Board::start_in(dir, &["--params", &params]);
    let link = Lossy::to(board.port);
    let address = format!("udpout:127.0.0.1:{}", link.port);
    let pull = format!("pull 00001_00.HUM -o {}", pulled.display());
    on(&address, &pull).expect_code(&[0]);
    assert!(link.lost.load(Ordering::Relaxed) > 5, "nothing was lost: {:?}", link.lost);
    assert_on_card(&pulled_log(&pulled, "00001"), &card);
    let again = on(&address, &pull).expect_code(&[0]);
    assert!(again.stderr.contains("00001_00.HUM: is there already as "), "{}", again.stderr);

    let said = oracle::log_download(board.port, &downloaded, 0.1);
    assert_eq!(said["missing"], 0, "{said}");
    assert!(said["requests"].as_u64() > Some(1), "nothing was lost: {said}");
    assert_on_card(&downloaded, &card);
}

#[test]
fn the_command_line_lists_reads_and_sets_parameters_over_a_bad_link() {
    let board = Board::start(&[]);
    let link = Lossy::to(board.port);
    let address = format!("udpout:127.0.0.1:{}", link.port);
    let listed = hums(["box", "params", "list", "--link", &address]).expect_code(&[0]);
    assert!(listed.stderr.contains("system 1: its HUMS box is heard"), "{}", listed.stderr);
    let list = listed.text();
    assert!(list.contains("GS_BUDGET 2000\n") && list.contains("BAT_REM_WARN 15\n"), "{list}");
    for words in ["params set BAT_REM_WARN 21.5", "params get BAT_REM_WARN"] {
        assert_eq!(on(&address, words).expect_code(&[0]).text(), "BAT_REM_WARN 21.5\n");
    }
    let refused = on(&address, "params set BAT_REM_WARN 1000").expect_code(&[1]);
    assert!(refused.stderr.contains("keeps 21.5"), "{}", refused.stderr);
}

#[test]
fn a_card_from_the_shop_is_formatted_by_command_and_one_with_logs_is_not() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    // One partition of the type of exFAT, on a card of an odd size.
    let mut card = vec![0; 70_001 * 512];
    card[446..462].copy_from_slice(&[0, 0, 2, 0, 7, 0xFE, 0xFF, 0xFF, 0, 8, 0, 0, 0x71, 9, 1, 0]);
    card[510..512].copy_from_slice(&[0x55, 0xAA]);
    fs::write(&image, &card).unwrap();
    let board = Board::start_in(dir, &[]);
    let format = |flag: &str| on(&board.address(), &format!("format-card{flag}"));
    assert!(format("").expect_code(&[2]).stderr.contains("erases all files"));
    assert_eq!(fs::read(&image).unwrap(), card, "nobody said --yes");
    let done = format(" --yes").expect_code(&[0]).text();
    assert_eq!(done, "system 1: formatted, and recorded on\n");
    let again = format(" --yes").expect_code(&[1]);
    assert!(again.stderr.contains("format such a card on a PC"), "{}", again.stderr);
    let log = board.end();
    assert!(log.contains("card is formatted by 255/190"), "the record says who did it");
}
