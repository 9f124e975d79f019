//! Reports about a log's end after a power cut. After the last landing or disarming: whole up to that. In
//! flight: not proved. More data on the card: the end is missing.

use std::fs;
use std::path::Path;

use hums_blackbox::Header;
use hums_blackbox::parity::COLUMNS;
use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
use hums_link::packet::Packet;
use hums_tests::flights::own;
use hums_tests::program::{hums, hums_with};
use serde_json::Value;

const FLIGHT: &str = "ap_quad_guided.tlog";
const BLOCK: usize = 512;
/// An orderly end is one sector and the parity of the last stretch.
const CLOSING_WRITES: u64 = 1 + 2 * COLUMNS as u64;

fn record(image: &Path, cut: Option<u64>) -> u64 {
    record_of(&own(FLIGHT), image, cut)["blocks_written"].as_u64().unwrap()
}

fn record_of(flight: &Path, image: &Path, cut: Option<u64>) -> Value {
    let mut arguments = vec!["sim".into(), "--json".into(), "--card-size".into(), "64".into()];
    arguments.extend([flight.display().to_string()]);
    arguments.extend(["--sd".into(), image.display().to_string()]);
    arguments.extend(cut.iter().flat_map(|cut| ["--cut-after-writes".into(), cut.to_string()]));
    serde_json::from_str(&hums(arguments).expect_code(&[0, 3]).text()).unwrap()
}

fn verify(image: &Path, code: i32) -> Vec<Value> {
    let text = hums_with("info --verify --json {}", &[&image]).expect_code(&[code]).text();
    let all: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(all["ok"], code == 0, "{text}");
    all["logs"].as_array().unwrap().clone()
}

#[test]
fn power_that_goes_after_the_disarming_leaves_a_log_that_is_whole_to_it() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    let writes = record(&image, None);
    assert_eq!(verify(&image, 0)[0]["end"]["proof"], "closed");
    fs::remove_file(&image).unwrap();
    record(&image, Some(writes - CLOSING_WRITES));
    let logs = verify(&image, 0);
    let end = &logs[0]["end"];
    assert_eq!((&end["proof"], &end["mark"]["why"]), (&"mark".into(), &"disarmed".into()), "{end}");
    assert!(end["words"].as_str().unwrap().contains("whole to the disarming at 20"), "{end}");
    let text = hums_with("info --verify {}", &[&image]).expect_code(&[0]).text();
    assert!(text.contains("whose end cannot be proved") && !text.contains("everything holds"), "{text}");
    let info = hums_with("info {}", &[&image]).expect_code(&[0]).text();
    assert!(info.contains("  end      whole to the disarming at"), "{info}");
}

#[test]
fn power_that_goes_in_flight_leaves_an_end_that_is_not_proved() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    record(&image, Some(1_000));
    let logs = verify(&image, 3);
    let end = &logs[0]["end"];
    assert_eq!(end["proof"], "none", "{end}");
    assert!(end["words"].as_str().unwrap().contains("armed or in the air since"), "{end}");
    hums_with("info {}", &[&image]).expect_code(&[3]);
}

#[test]
fn the_next_log_on_the_card_tells_that_the_end_of_the_one_before_is_gone() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    let writes = record(&image, None);
    fs::remove_file(&image).unwrap();
    record(&image, Some(writes - CLOSING_WRITES));
    record(&image, None);
    let logs = verify(&image, 0);
    assert_eq!(logs[0]["end"]["proof"], "next_start", "{}", logs[0]);
    // The last 80 sectors: more than parity can rebuild.
    let mut bytes = fs::read(&image).unwrap();
    let blocks = bytes.as_chunks_mut::<BLOCK>().0;
    let first = blocks.iter().find_map(|block| Header::read(block).ok()).unwrap().session;
    let own = |block: &&mut [u8; BLOCK]| Header::read(block).is_ok_and(|header| header.session == first);
    let count = blocks.iter_mut().filter(own).count();
    blocks.iter_mut().filter(own).skip(count - 80).for_each(|block| block.fill(0xff));
    fs::write(&image, &bytes).unwrap();
    let logs = verify(&image, 3);
    let end = &logs[0]["end"];
    assert_eq!(end["proof"], "short", "{end}");
    assert!(
        end["sectors_missing"].as_u64().unwrap() >= 78 && end["frames_missing"].as_u64().unwrap() > 0,
        "{end}"
    );
    // A partial sector before its whole one may be among them.
    assert!(end["behind"]["erased"].as_u64().is_some_and(|erased| (79..=80).contains(&erased)), "{end}");
    assert_eq!(logs[1]["end"]["proof"], "closed");
}

/// Armed at 5 s, in the air from 8 s on, lands at 38 s and stays armed; 56 frames a second.
fn landing(path: &Path) {
    let (mut log, mut encoder) = (Vec::new(), Encoder::of(1, 1));
    for tick in 0..60 * 50_u64 {
        let armed = if tick >= 5 * 50 { 0x80 } else { 0 };
        let landed = if (8 * 50..38 * 50).contains(&tick) { 2 } else { 1 };
        let heartbeat = || Packet::new(0).u8(4, 2).u8(5, 3).u8(6, 0x51 | armed).u8(7, 4).u8(8, 3);
        let state = || Packet::new(245).u8(1, landed);
        let packets = [
            Some(Packet::new(30).u32(0, tick as u32 * 20)),
            tick.is_multiple_of(50).then(heartbeat),
            tick.is_multiple_of(10).then(state),
        ];
        for packet in packets.iter().flatten() {
            let mut buffer = [0; FRAME_BYTES_MAX];
            log.extend_from_slice(&(1_700_000_000_000_000 + tick * 20_000).to_be_bytes());
            log.extend_from_slice(encoder.frame(&mut buffer, packet));
        }
    }
    fs::write(path, log).unwrap();
}

#[test]
fn power_that_goes_after_a_landing_while_armed_leaves_a_log_that_is_whole_to_it_within_200_ms() {
    let dir = tempfile::tempdir().unwrap();
    let (flight, image) = (dir.path().join("flight.tlog"), dir.path().join("card.img"));
    landing(&flight);
    let cut = |at| {
        let _ = fs::remove_file(&image);
        let report = record_of(&flight, &image, at);
        let text = hums_with("info --verify --json {}", &[&image]).expect_code(&[0, 3]).text();
        (report, serde_json::from_str::<Value>(&text).unwrap()["logs"][0]["end"].clone())
    };
    // The first write with the mark.
    let (mut without, mut with) = (1, cut(None).0["blocks_written"].as_u64().unwrap());
    while with - without > 1 {
        let middle = without.midpoint(with);
        let is_there = cut(Some(middle)).1["mark"]["why"] == "landed";
        (without, with) = if is_there { (without, middle) } else { (middle, with) };
    }
    let (report, end) = cut(Some(with));
    assert_eq!(end["proof"], "mark", "{end}");
    assert!(end["words"].as_str().unwrap().contains("whole to the landing at "), "{end}");
    hums_with("info --verify {}", &[&image]).expect_code(&[0]);
    // The input between mark and write.
    let rows = hums_with("decode {} -o - --format jsonl", &[&image]).expect_code(&[0]).text();
    let mark = rows.lines().find(|row| row.contains("HUMS_MARK")).expect("a mark");
    let mark: Value = serde_json::from_str(mark).unwrap();
    let later = report["frames_in"].as_u64().unwrap() - mark["fields"]["frames"].as_u64().unwrap();
    assert!(later * 1_000 <= 200 * 56, "{later} frames after the mark: {report}");
}
