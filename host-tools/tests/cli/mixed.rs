//! Logs that were joined, exchanged or renamed: no command makes one flight of two.

use std::fs;

use crate::copied::{BLOCK, SEGMENT, all_say, copied};
use crate::support::{end_of, run, text};

#[test]
fn another_session_under_the_number_of_the_session_before_is_told_by_every_command() {
    let dir = copied(3);
    all_say(dir.path(), "copied", 0, &[]);
    let at = |name: &str| dir.path().join("copied").join(name);
    fs::rename(at("00001_00.HUM"), at("00002_00.HUM")).expect("renamed");
    all_say(
        dir.path(),
        "copied",
        3,
        &["session 00002, which was recorded just before it, is not there under that number"],
    );
    let said = String::from_utf8_lossy(&run(dir.path(), "verify copied", 3).stdout).into_owned();
    assert!(said.contains("FAILED  session before     1 checked, 1 failed"), "{said}");
    // Without any log before it nothing tells that one should be there: that is said, and is no finding.
    fs::remove_file(at("00002_00.HUM")).expect("removed");
    let said = String::from_utf8_lossy(&run(dir.path(), "verify copied", 0).stdout).into_owned();
    let words = "session before     0 checked, 0 failed; session 00002 is not among what was read";
    assert!(said.contains(words), "{said}");
}

#[test]
fn two_logs_in_one_file_are_told_by_every_command_in_both_orders() {
    let dir = tempfile::tempdir().expect("directory");
    let [one, other] = ["px4_hil_quad_low.tlog", "ap_quad_guided.tlog"].map(|name| {
        run(dir.path(), &format!("pack {} -o {name}.hum", end_of(name, dir.path()).display()), 0);
        fs::read(dir.path().join(format!("{name}.hum"))).expect("a log")
    });
    for (first, second) in [(&one, &other), (&other, &one)] {
        fs::write(dir.path().join("joined.hum"), [&first[..], second].concat()).expect("written");
        let (from, to) = (first.len() / BLOCK, (first.len() + second.len()) / BLOCK - 1);
        let session = u32::from_le_bytes(second[7..11].try_into().expect("four"));
        let words =
            format!("sectors {from} to {to} of joined.hum are of another session (session {session:08x})");
        all_say(dir.path(), "joined.hum", 3, &[&words, "give each by itself"]);
    }
    // Segments off a card, with the room behind their sectors.
    let dir = copied(2);
    let [one, other] = ["00001_00.HUM", "00002_00.HUM"]
        .map(|name| fs::read(dir.path().join("copied").join(name)).expect("there"));
    fs::write(dir.path().join("joined.hum"), [&one[..], &other].concat()).expect("written");
    let from = SEGMENT / BLOCK;
    all_say(
        dir.path(),
        "joined.hum",
        3,
        &[&format!("sectors {from} to "), "are of another session (session "],
    );
}

#[test]
fn segments_of_two_boxes_under_one_sessions_name_are_told_by_every_command() {
    let dir = copied(2);
    let at = |name: &str| dir.path().join("copied").join(name);
    fs::rename(at("00002_00.HUM"), at("00001_01.HUM")).expect("renamed");
    all_say(
        dir.path(),
        "copied",
        3,
        &["00001_01.HUM has the name of a segment of this log and holds ", "of another session (session "],
    );
}

#[test]
fn logs_that_were_renamed_or_exchanged_are_told_by_every_command() {
    let dir = copied(3);
    let at = |name: &str| dir.path().join("copied").join(name);
    fs::rename(at("00001_00.HUM"), at("00009_00.HUM")).expect("renamed");
    let words = |session, name| {
        format!("session {session}, which was recorded just before it, is there under the name {name}")
    };
    all_say(dir.path(), "copied", 3, &[&words("00001", "00009")]);
    let said = text(&run(dir.path(), "verify copied", 3));
    assert!(said.contains("FAILED  session before     1 checked, 1 failed"), "{said}");
    fs::rename(at("00009_00.HUM"), at("00001_00.HUM")).expect("renamed");
    all_say(dir.path(), "copied", 0, &[]);
    // The newest one under a number that is not the next one; a first file under the number of a further one.
    for (one, other, words) in [
        (
            "00003_00.HUM",
            "00099_00.HUM",
            "it was recorded just after session 00002, so its number is not its own",
        ),
        ("00001_00.HUM", "00001_07.HUM", "00001_07.HUM begins as the first file of its log"),
    ] {
        fs::rename(at(one), at(other)).expect("renamed");
        all_say(dir.path(), "copied", 3, &[words]);
        fs::rename(at(other), at(one)).expect("renamed");
    }
    // The oldest one and the newest one exchanged.
    fs::rename(at("00001_00.HUM"), at("other")).expect("renamed");
    fs::rename(at("00003_00.HUM"), at("00001_00.HUM")).expect("renamed");
    fs::rename(at("other"), at("00003_00.HUM")).expect("renamed");
    let later = "it was recorded after session 00002, so its number is not its own";
    all_say(dir.path(), "copied", 3, &[later, &words("00001", "00003")]);

    // Two entries of a card's directory.
    let image = dir.path().join("card.img");
    let mut card = fs::read(&image).expect("a card");
    let [second, third] = [b"00002_00HUM", b"00003_00HUM"].map(|name| {
        card.windows(name.len()).position(|bytes| bytes == name).expect("an entry of the directory")
    });
    (card[second + 4], card[third + 4]) = (card[third + 4], card[second + 4]);
    fs::write(&image, card).expect("written");
    all_say(dir.path(), "card.img", 3, &[&words("00002", "00003")]);
}

#[test]
fn a_name_that_tells_another_session_than_its_sectors_is_told_by_every_command() {
    let dir = copied(1);
    let at = |name: &str| dir.path().join("copied").join(name);
    let log = fs::read(at("00001_00.HUM")).expect("there");
    let session = u32::from_le_bytes(log[7..11].try_into().expect("four"));
    let (right, wrong) = (format!("00001-s{session:08x}_00.HUM"), "00001-sdeadbeef_00.HUM");
    fs::rename(at("00001_00.HUM"), at(&right)).expect("renamed");
    all_say(dir.path(), "copied", 0, &[]);
    fs::rename(at(&right), at(wrong)).expect("renamed");
    let words = format!("its name tells session deadbeef, and its sectors are of session {session:08x}");
    all_say(dir.path(), "copied", 3, &[&words]);
    assert!(text(&run(dir.path(), "ls copied", 3)).contains("not proved to be whole"));
    // Of a copy, too.
    fs::write(at("00001_00.HUM"), &log).expect("written");
    all_say(dir.path(), "copied", 3, &[&words]);
}
