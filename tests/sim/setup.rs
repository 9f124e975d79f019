//! `hums box setup` and `hums box report` over the port of a box whose autopilot answers for its parameters.

use std::collections::{BTreeMap, VecDeque};
use std::fs;
use std::io::Write as _;
use std::net::{TcpStream, UdpSocket};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
use hums_link::packet::{Fields, Packet};
use hums_link::{Frame, Framer, ids, messages};
use hums_tests::flights::own;
use hums_tests::live::{Live, free_port};
use hums_tests::program::hums;
use serde_json::Value;

use super::board::{Board, on};

type Values = Arc<Mutex<BTreeMap<String, f32>>>;

/// Plays the recording from power-on in real time, until it is dropped.
struct Autopilot(Values);

impl Autopilot {
    fn start(port: u16, values: &[(&str, f32)]) -> Self {
        let values = values.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
        let values = Arc::new(Mutex::new(values));
        let known = Arc::clone(&values);
        thread::spawn(move || play(port, &known));
        Self(values)
    }

    fn values(&self) -> Vec<(String, f32)> {
        self.0.lock().unwrap().clone().into_iter().collect()
    }
}

fn play(port: u16, values: &Values) {
    let tlog = fs::read(own("ap_quad_guided.tlog")).unwrap();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.connect(("127.0.0.1", port)).unwrap();
    socket.set_nonblocking(true).unwrap();
    let (mut framer, mut encoder) = (Framer::new(), Encoder::of(1, 1));
    let (start, mut first_us, mut rest) = (Instant::now(), None, &tlog[..]);
    let (mut waiting, mut out) = (VecDeque::new(), [0; FRAME_BYTES_MAX]);
    while let Some((time, frames)) = rest.split_first_chunk::<8>().filter(|_| Arc::strong_count(values) > 1) {
        let us = u64::from_be_bytes(*time);
        let due = Duration::from_micros(us - *first_us.get_or_insert(us));
        while start.elapsed() < due {
            answer(&socket, &mut framer, values, &mut waiting);
            thread::sleep(Duration::from_millis(1));
        }
        // MAVLink 2 without signatures.
        let (frame, after) = frames.split_at(12 + usize::from(frames[1]));
        if frame[5..7] == [1, 1] {
            // An answer takes the place and the sequence number of a frame: nothing seems lost.
            let sent = waiting.pop_front().map_or(frame, |packet: Packet| {
                encoder.set_sequence(frame[4]);
                encoder.frame(&mut out, &packet)
            });
            let _ = socket.send(sent);
        }
        rest = after;
    }
}

fn answer(socket: &UdpSocket, framer: &mut Framer, values: &Values, waiting: &mut VecDeque<Packet>) {
    let mut buffer = [0; 2048];
    while let Ok(count) = socket.recv(&mut buffer) {
        framer.push(&buffer[..count], &mut |frame: Frame<'_>| {
            let fields = Fields(frame.payload());
            let at = match frame.id() {
                ids::PARAM_REQUEST_READ => 4,
                ids::PARAM_SET => 6,
                _ => return,
            };
            let mut values = values.lock().unwrap();
            let name = fields.text(at, 16).unwrap_or_default();
            let Some(value) = values.get_mut(name).filter(|_| frame.target() == Some((1, 1))) else { return };
            if frame.id() == ids::PARAM_SET {
                *value = fields.f32(0);
            }
            waiting.push_back(messages::param_value(name, *value, 0, 3));
        });
    }
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

#[test]
fn an_autopilot_is_set_for_the_box_and_the_bench_check_says_that_it_is_ready() {
    let dir = tempfile::tempdir().unwrap();
    let files = tempfile::tempdir().unwrap();
    let file = |name: &str| files.path().join(name).display().to_string();
    fs::write(file("params.txt"), "GS_BUDGET 5000\nGS_PASS 1\n").unwrap();
    let port = free_port();
    let before = [("BRD_SER2_RTSCTS", 2.0), ("SERIAL2_BAUD", 57.0), ("SERIAL2_PROTOCOL", 2.0)];
    let input = format!("udpin:127.0.0.1:{port}");
    let board = Board::start_with(input.as_ref(), dir, &["--params", &file("params.txt")]);
    let autopilot = Autopilot::start(port, &before);
    let address = board.address();

    let undo = file("before.param");
    on(&address, &format!("setup --set --undo {undo} --json")).expect_code(&[0, 4]);
    assert_eq!(fs::read_to_string(&undo).unwrap(), "SERIAL2_BAUD,57\nBRD_SER2_RTSCTS,2\n");
    let wanted = [("BRD_SER2_RTSCTS", 0.0), ("SERIAL2_BAUD", 921.0), ("SERIAL2_PROTOCOL", 2.0)];
    let owned = |values: [(&str, f32); 3]| values.map(|(name, value)| (name.to_owned(), value)).to_vec();
    assert_eq!(autopilot.values(), owned(wanted));
    // The autopilot sends its streams a few seconds after power-on, and arms after 43 s.
    let (start, mut code) = (Instant::now(), None);
    while code != Some(0) {
        let checked = on(&address, "setup --json").expect_code(&[0, 4]);
        let told = json(&checked.text());
        code = checked.code;
        assert_eq!(told["ready"], code == Some(0), "{told}");
        assert!(start.elapsed() < Duration::from_secs(40), "not ready: {told}");
    }
    // The page shows the same check.
    let live = Live::start(&["--setup", &address]);
    let (mut page, mut stream) = (live.page().unwrap(), TcpStream::connect(live.host()).unwrap());
    let body = "Content-Length: 22\r\n\r\n{\"cmd\":\"check\",\"to\":1}";
    write!(stream, "POST /command HTTP/1.1\r\nHost: {}\r\n{body}", live.host()).unwrap();
    let shown = (0..9_999).map(|_| json(&page.message())).find(|told| told["found"].is_object()).unwrap();
    assert_eq!(shown["words"], "ready to fly, but not known: clock", "of a recording: {shown}");

    on(&address, &format!("setup --restore {undo}")).expect_code(&[0]);
    assert_eq!(autopilot.values(), owned(before));
    let report = file("report.json");
    on(&address, &format!("report -o {report}")).expect_code(&[0]);
    let report = json(&fs::read_to_string(&report).unwrap());
    // The parameters that are not as delivered.
    assert!(records(&report, "HUMS_BOOT") >= 1 && records(&report, "HUMS_PARAM") == 2, "{report}");
    drop(board);
}

/// At the autopilot's USB. With these settings the autopilot sends nothing to the box.
#[test]
fn the_port_of_a_box_that_hears_nothing_is_set_and_restored() {
    let files = tempfile::tempdir().unwrap();
    let undo = files.path().join("before.param").display().to_string();
    let before = [("BRD_SER2_RTSCTS", 0.0), ("SERIAL2_BAUD", 57.0), ("SERIAL2_PROTOCOL", -1.0)];
    let owned = |values: [(&str, f32); 3]| values.map(|(name, value)| (name.to_owned(), value)).to_vec();
    let port = free_port();
    let autopilot = Autopilot::start(port, &before);
    let address = format!("udpin:127.0.0.1:{port}");
    let told = json(&on(&address, &format!("setup --set --undo {undo} --json")).expect_code(&[4]).text());
    let checks: Vec<[&str; 2]> = told["checks"]
        .as_array()
        .unwrap()
        .iter()
        .map(|check| ["check", "state"].map(|name| check[name].as_str().unwrap()))
        .collect();
    assert_eq!(checks, [["box", "missing"], ["settings", "ok"]], "{told}");
    let wanted = [("BRD_SER2_RTSCTS", 0.0), ("SERIAL2_BAUD", 921.0), ("SERIAL2_PROTOCOL", 2.0)];
    assert_eq!(autopilot.values(), owned(wanted));
    on(&address, &format!("setup --restore {undo}")).expect_code(&[0]);
    assert_eq!(autopilot.values(), owned(before));
}

fn records(report: &Value, table: &str) -> usize {
    let records = report["logs"][0]["records"].as_array().unwrap();
    records.iter().filter(|record| record["record"] == table).count()
}

#[test]
fn a_report_of_a_card_has_the_box_and_neither_place_nor_vehicle() {
    let dir = tempfile::tempdir().unwrap();
    let card = dir.path().join("card.img").display().to_string();
    let flight = own("ap_quad_faults.tlog").display().to_string();
    hums(["sim", &flight, "--sd", &card]).expect_code(&[0]);
    let path = dir.path().join("report.json").display().to_string();
    hums(["box", "report", &card, "-o", &path]).expect_code(&[0]);
    let text = fs::read_to_string(&path).unwrap();
    let report = json(&text);
    assert!(records(&report, "HUMS_BOOT") >= 1 && records(&report, "HUMS_STATS") == 1, "{text}");
    for told in ["HUMS_VEHICLE", "HUMS_CLOCK", "HUMS_FINDING", "latitude", "ap_quad_faults"] {
        assert!(!text.contains(told), "{told}");
    }
    hums(["box", "report", &card, "-o", &path]).expect_code(&[1]);
    hums(["box", "report", &card, "-o", &path, "--force"]).expect_code(&[0]);
    assert!(Path::new(&card).exists());
}

#[test]
fn without_a_box_the_setup_still_shows_the_wiring_and_says_where_to_look() {
    let port = free_port();
    let address = format!("udpin:127.0.0.1:{port}");
    let silent = on(&address, "setup --board speedybee-f405-v4").expect_code(&[1]);
    let (told, error) = (silent.text(), silent.stderr.clone());
    assert!(told.contains("R1 (PA10)") && told.contains("T1 (PA9)") && told.contains("PC13"), "{told}");
    assert!(
        error.contains("check its LED") && error.contains("no HUMS box or autopilot is heard"),
        "{error}"
    );
    let unknown = on(&address, "setup --board no-such").expect_code(&[2]);
    assert!(unknown.stderr.contains("speedybee-f405-v4"), "{}", unknown.stderr);
}
