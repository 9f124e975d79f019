//! Copies of one session side by side: each flight counts once, and damage of a copy is reported.

use std::fs;

use crate::copied::{BLOCK, all_say, copied, each_says, without};
use crate::support::{attempt, run, stderr, text};

#[test]
fn one_session_under_two_names_is_told_by_every_command_and_counted_once() {
    let dir = copied(3);
    let at = |name: &str| dir.path().join("copied").join(name);
    fs::copy(at("00001_00.HUM"), at("00003_00.HUM")).expect("copied");
    let words = "is a copy of 00001 (not counted)";
    all_say(dir.path(), "copied", 0, &[words]);
    let said = text(&run(dir.path(), "info --verify copied", 0));
    assert!(said.contains("\n2 sessions: "), "{said}");
    let said = text(&attempt(dir.path(), "check copied"));
    assert!(said.contains("2 logs checked") && said.contains("1  copy of another log"), "{said}");
    fs::create_dir(dir.path().join("other")).expect("made");
    fs::remove_file(at("00003_00.HUM")).expect("removed");
    fs::copy(at("00001_00.HUM"), dir.path().join("other/00001_00.HUM")).expect("copied");
    all_say(dir.path(), "copied other", 0, &[]);
}

#[test]
fn a_mere_copy_is_told_and_its_flight_counted_once() {
    let dir = copied(1);
    let log = dir.path().join("copied/00001_00.HUM");
    for name in ["Copy of 00001_00.HUM", "00001_00 (1).HUM", "flight.hum"] {
        fs::copy(&log, dir.path().join("copied").join(name)).expect("copied");
    }
    fs::copy(dir.path().join("card.img"), dir.path().join("again.img")).expect("copied");
    for (inputs, out) in [("copied", "a"), ("card.img again.img copied", "b")] {
        let (decode, report) = (format!("-o {out}/ --format csv"), format!("-o {out}-pages/"));
        let commands =
            [("info --verify", ""), ("info", ""), ("check", ""), ("decode", &decode), ("report", &report)];
        for (command, flags) in commands {
            let said = attempt(dir.path(), &format!("{command} {inputs} {flags}"));
            let told = text(&said) + &String::from_utf8_lossy(&said.stderr);
            assert!(matches!(said.status.code(), Some(0 | 4)), "{command}: {told}");
            assert!(told.contains("is a copy of"), "{command}: {told}");
        }
        let said = text(&run(dir.path(), &format!("info --verify {inputs}"), 0));
        assert!(said.contains("\n1 session: "), "{said}");
        let said = text(&attempt(dir.path(), &format!("check {inputs}")));
        assert!(
            said.contains("1 log checked") && said.contains("copy of another log (not counted above)"),
            "{said}"
        );
    }
    let mut copy = without(&fs::read(&log).expect("there"), usize::MAX, 0);
    copy[20 * BLOCK + 100] ^= 1;
    fs::write(dir.path().join("copied/flight.hum"), copy).expect("written");
    let said = text(&run(dir.path(), "info --verify copied", 3));
    assert!(said.contains("\n2 sessions: "), "{said}");
}

/// A shell's `*` names them beside their recordings.
#[test]
fn what_decode_made_is_passed_over_beside_its_recording_whatever_the_order_of_the_inputs() {
    let dir = copied(1);
    fs::copy(dir.path().join("copied/00001_00.HUM"), dir.path().join("b.hum")).expect("copied");
    run(dir.path(), "decode b.hum -o made/ --format tlog,csv", 0);
    let made = fs::read_dir(dir.path().join("made")).expect("made").map(|entry| entry.expect("read").path());
    let made = made.into_iter().find(|path| path.extension().is_some_and(|ending| ending == "tlog"));
    let made = made.expect("a tlog").strip_prefix(dir.path()).expect("inside").display().to_string();
    fs::create_dir(dir.path().join("empty")).expect("made");
    for inputs in [format!("b.hum {made}"), format!("{made} b.hum"), "made b.hum".to_owned()] {
        let said = attempt(dir.path(), &format!("check {inputs}"));
        let told = text(&said) + &stderr(&said);
        assert!(told.contains("was made of b.hum, which is read, and is passed over"), "{inputs}: {told}");
        // The last input has no recording, and is not the first to be missed.
        let said = attempt(dir.path(), &format!("info --list {inputs} empty"));
        let told = text(&said) + &stderr(&said);
        assert!(said.status.code() == Some(1) && told.contains("empty: no log"), "{inputs}: {told}");
    }
    let said = stderr(&run(dir.path(), "decode b.hum empty -o again/ --format tlog", 1));
    assert!(said.contains("instead of `*` name the folder"), "{said}");
}

#[test]
fn two_copies_of_one_session_have_two_pages_and_the_damaged_one_is_not_kept_alone() {
    let dir = copied(1);
    let whole = fs::read(dir.path().join("copied/00001_00.HUM")).expect("a log");
    for (folder, spoiled) in [("damaged", true), ("same", false)] {
        let mut log = whole.clone();
        if spoiled {
            log = without(&log, usize::MAX, 0);
            log[20 * BLOCK + 100] ^= 1;
        }
        fs::create_dir(dir.path().join(folder)).expect("made");
        fs::write(dir.path().join(folder).join("00001_00.HUM"), log).expect("written");
    }
    for flags in ["", "--force"] {
        let said = run(dir.path(), &format!("report damaged copied same -o pages/ {flags}"), 3);
        let lines = text(&said);
        let (tables, pages): (Vec<_>, Vec<_>) =
            lines.lines().partition(|line| line.contains("table of 2 pages"));
        assert_eq!((pages.len(), tables.len()), (2, 1), "{lines}");
        let told = stderr(&said);
        assert!(told.contains("is a copy of copied/00001 (not counted)"), "{told}");
        let mut pages: Vec<String> = fs::read_dir(dir.path().join("pages"))
            .expect("pages")
            .map(|page| page.expect("a page").file_name().to_string_lossy().into_owned())
            .filter(|name| name != "index.html")
            .collect();
        pages.sort();
        assert!(pages.len() == 2 && pages[0].ends_with("-2.html"), "{pages:?}");
    }
}

#[test]
fn another_log_behind_a_copy_is_told_by_every_command() {
    let dir = copied(2);
    let at = |name: &str| dir.path().join("copied").join(name);
    let [one, other] = ["00001_00.HUM", "00002_00.HUM"].map(|name| fs::read(at(name)).expect("there"));
    fs::write(at("all.hum"), [&one[..], &other].concat()).expect("written");
    fs::remove_file(at("00002_00.HUM")).expect("removed");
    let session = u32::from_le_bytes(other[7..11].try_into().expect("four"));
    let words =
        format!("not of this log (the first at block {}, of session {session:08x})", one.len() / BLOCK);
    all_say(dir.path(), "copied", 3, &[&words, "is a copy of 00001 (not counted)"]);
    let said = text(&run(dir.path(), "info --verify copied", 3));
    assert!(said.contains("FAILED  files ") && said.contains("1 session: not proved to be whole"), "{said}");
    assert!(text(&run(dir.path(), "info --list copied", 3)).contains("not proved to be whole"));
    fs::write(at("all.hum"), &one).expect("written");
    all_say(dir.path(), "copied", 0, &["is a copy of 00001 (not counted)"]);
}

#[test]
fn what_is_wrong_with_a_copy_is_told_by_every_command() {
    let dir = copied(1);
    let at = |name: &str| dir.path().join("copied").join(name);
    let mut damaged = fs::read(at("00001_00.HUM")).expect("there");
    damaged[20 * BLOCK..21 * BLOCK].fill(0);
    fs::write(at("Copy of 00001_00.HUM"), damaged).expect("written");
    each_says(dir.path(), "copied", 3, &["1 sector had to be made again from parity"]);
}
