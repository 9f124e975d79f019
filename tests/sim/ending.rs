//! What is said of a log's end: whole to the last landing or disarming where power went after it, not proved where it
//! went in flight, and missing where the next start on the card found more than is there.

use std::fs;
use std::path::Path;

use hums_blackbox::Header;
use hums_tests::flights::own;
use hums_tests::program::hums;
use serde_json::Value;

const FLIGHT: &str = "ap_quad_guided.tlog";
const BLOCK: usize = 512;

/// Records the flight onto a card; power goes at this block write. How many there were.
fn record(image: &Path, cut: Option<u64>) -> u64 {
    let flight = own(FLIGHT);
    let mut arguments = vec!["sim".into(), "--json".into(), "--card-size".into(), "64".into()];
    arguments.extend(["--input".into(), flight.display().to_string()]);
    arguments.extend(["--sd".into(), image.display().to_string()]);
    arguments.extend(cut.iter().flat_map(|cut| ["--cut-after-writes".into(), cut.to_string()]));
    let report: Value = serde_json::from_str(&hums(arguments).expect_code(&[0, 3]).text()).unwrap();
    report["blocks_written"].as_u64().unwrap()
}

/// The logs as `verify --json` has them; the exit code must be this one.
fn verify(image: &Path, code: i32) -> Vec<Value> {
    let text = hums(["verify".as_ref(), "--json".as_ref(), image.as_os_str()]).expect_code(&[code]).text();
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
    record(&image, Some(writes - 1));
    let logs = verify(&image, 0);
    let end = &logs[0]["end"];
    assert_eq!((&end["proof"], &end["mark"]["why"]), (&"mark".into(), &"disarmed".into()), "{end}");
    assert!(end["words"].as_str().unwrap().contains("whole to the disarming at 20"), "{end}");
    let text = hums(["verify".as_ref(), image.as_os_str()]).expect_code(&[0]).text();
    assert!(text.contains("whose end cannot be proved") && !text.contains("everything holds"), "{text}");
    let info = hums(["info".as_ref(), image.as_os_str()]).expect_code(&[0]).text();
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
    hums(["info".as_ref(), image.as_os_str()]).expect_code(&[3]);
}

#[test]
fn the_next_log_on_the_card_tells_that_the_end_of_the_one_before_is_gone() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    let writes = record(&image, None);
    fs::remove_file(&image).unwrap();
    record(&image, Some(writes - 1));
    record(&image, None);
    let logs = verify(&image, 0);
    assert_eq!(logs[0]["end"]["proof"], "next_start", "{}", logs[0]);
    // The last 30 sectors of the first log are erased, the landing with them or not.
    let mut bytes = fs::read(&image).unwrap();
    let blocks = bytes.as_chunks_mut::<BLOCK>().0;
    let first = blocks.iter().find_map(|block| Header::read(block).ok()).unwrap().session;
    let own = |block: &&mut [u8; BLOCK]| Header::read(block).is_ok_and(|header| header.session == first);
    let count = blocks.iter_mut().filter(own).count();
    blocks.iter_mut().filter(own).skip(count - 30).for_each(|block| block.fill(0xff));
    fs::write(&image, &bytes).unwrap();
    let logs = verify(&image, 3);
    let end = &logs[0]["end"];
    assert_eq!(end["proof"], "short", "{end}");
    assert!(
        end["sectors_missing"].as_u64().unwrap() >= 28 && end["frames_missing"].as_u64().unwrap() > 0,
        "{end}"
    );
    assert_eq!(end["behind"]["erased"], 30, "{end}");
    assert_eq!(logs[1]["end"]["proof"], "closed");
}
