//! Logs that were joined, or that have the number of another one: no command makes one flight of two.

use std::fs;

use crate::copied::{BLOCK, SEGMENT, all_say, copied, each_says};
use crate::support::{end_of, run};

#[test]
fn another_session_under_the_number_of_the_session_before_is_told_by_every_command() {
    let dir = copied(3);
    all_say(dir.path(), "copied", 0, &[]);
    let at = |name: &str| dir.path().join("copied").join(name);
    fs::rename(at("00001_00.HUM"), at("00002_00.HUM")).expect("renamed");
    each_says(
        dir.path(),
        "copied",
        3,
        &["session 00002, which was recorded just before it, is not there under that number"],
    );
    let said = String::from_utf8_lossy(&run(dir.path(), "info --verify copied", 3).stdout).into_owned();
    assert!(said.contains("FAILED  session before     1 checked, 1 failed"), "{said}");
    fs::remove_file(at("00002_00.HUM")).expect("removed");
    let said = String::from_utf8_lossy(&run(dir.path(), "info --verify -v copied", 0).stdout).into_owned();
    let words = "session before     0 checked, 0 failed; session 00002 is not among what was read";
    assert!(said.contains(words), "{said}");
}

#[test]
fn two_logs_in_one_file_are_told_by_every_command_in_both_orders() {
    let dir = tempfile::tempdir().expect("directory");
    let [one, other] = ["px4_hil_quad_low.tlog", "ap_quad_guided.tlog"].map(|name| {
        run(
            dir.path(),
            &format!("decode --format hum {} -o {name}.hum", end_of(name, dir.path()).display()),
            0,
        );
        fs::read(dir.path().join(format!("{name}.hum"))).expect("a log")
    });
    for (first, second) in [(&one, &other), (&other, &one)] {
        fs::write(dir.path().join("joined.hum"), [&first[..], second].concat()).expect("written");
        let from = first.len() / BLOCK;
        let session = u32::from_le_bytes(second[7..11].try_into().expect("four"));
        let words = format!(
            "of joined.hum are not of this log (the first at block {from}, of session {session:08x})"
        );
        all_say(dir.path(), "joined.hum", 3, &[&words]);
    }
    let dir = copied(2);
    let [one, other] = ["00001_00.HUM", "00002_00.HUM"]
        .map(|name| fs::read(dir.path().join("copied").join(name)).expect("there"));
    fs::write(dir.path().join("joined.hum"), [&one[..], &other].concat()).expect("written");
    let from = SEGMENT / BLOCK;
    all_say(
        dir.path(),
        "joined.hum",
        3,
        &[&format!("sectors of joined.hum are not of this log (the first at block {from}, of session ")],
    );
}

#[test]
fn segments_of_two_boxes_under_one_sessions_name_are_told_by_every_command() {
    let dir = copied(2);
    let at = |name: &str| dir.path().join("copied").join(name);
    fs::rename(at("00002_00.HUM"), at("00001_01.HUM")).expect("renamed");
    each_says(
        dir.path(),
        "copied",
        3,
        &["00001_01.HUM are not of this log (the first at block 0, of session "],
    );
}
