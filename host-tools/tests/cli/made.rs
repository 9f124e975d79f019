//! Tlogs that `hums decode` made, beside what they were made of.

use std::fs;

use crate::copied::copied;
use crate::support::{attempt, end_of, flight, named, run, text};

/// What `decode` made is read where what it was made of is not there.
#[test]
fn a_tlog_that_was_made_of_a_log_counts_its_flight_once_beside_it() {
    let dir = copied(1);
    let recording = end_of("px4_hil_quad_low.tlog", &dir.path().join("copied"));
    run(dir.path(), "decode copied -o copied/ --format tlog", 0);
    let made: Vec<_> = fs::read_dir(dir.path().join("copied"))
        .expect("there")
        .map(|entry| entry.expect("there").path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "tlog") && *path != recording)
        .collect();
    assert_eq!(made.len(), 2, "{made:?}");
    for command in ["check copied", "ls copied", "info copied", "report copied -o pages/"] {
        let said = attempt(dir.path(), command);
        let told = String::from_utf8_lossy(&said.stderr).into_owned();
        assert_eq!(told.matches(", which is read, and is passed over").count(), 2, "{command}: {told}");
    }
    let said = text(&attempt(dir.path(), "check copied"));
    assert!(said.contains("2 logs checked"), "{said}");
    fs::remove_file(dir.path().join("copied/00001_00.HUM")).expect("ours");
    fs::remove_file(recording).expect("ours");
    let said = text(&attempt(dir.path(), "check copied"));
    assert!(said.contains("2 logs checked"), "{said}");
}

#[test]
fn another_flight_under_the_name_that_decode_gives_is_read() {
    let dir = copied(1);
    let at = |name: &str| dir.path().join("copied").join(name);
    run(dir.path(), "decode copied -o copied/ --format tlog", 0);
    let made = at(&format!("{}.tlog", named(&at("."), "00001")));
    let said = |line: &str| String::from_utf8_lossy(&attempt(dir.path(), line).stderr).into_owned();
    assert!(said("check copied").contains(", which is read, and is passed over"));
    fs::copy(flight("ap_quad_faults.tlog"), &made).expect("another flight");
    for command in ["check copied", "ls copied", "info copied", "report copied -o pages/"] {
        let said = said(command);
        assert!(
            said.contains(", and more or other frames: it is read as a recording of its own"),
            "{command}: {said}"
        );
    }
    assert!(text(&attempt(dir.path(), "check copied")).contains("2 logs checked"));
}

#[test]
fn a_flight_behind_what_decode_made_or_under_the_name_of_what_it_makes_of_a_recording_is_read() {
    let dir = copied(1);
    let at = |name: &str| dir.path().join("copied").join(name);
    let recording = end_of("px4_hil_quad_low.tlog", &at("."));
    let other = fs::read(end_of("ap_quad_guided.tlog", dir.path())).expect("there");
    run(dir.path(), "decode copied -o copied/ --format tlog", 0);
    let of_log = at(&format!("{}.tlog", named(&at("."), "00001")));
    let of_recording = fs::read_dir(at(".")).expect("there").map(|entry| entry.expect("there").path());
    let of_recording = of_recording
        .filter(|path| ![&of_log, &recording].contains(&path))
        .find(|path| path.extension().is_some_and(|ending| ending == "tlog"))
        .expect("made of the recording");
    let read = || {
        let checked = attempt(dir.path(), "check copied");
        let said = String::from_utf8_lossy(&checked.stderr).into_owned();
        let own = said.matches(", and more or other frames: it is read as a recording of its own").count();
        (text(&checked).contains(&format!("{} logs checked", 2 + own)), own)
    };
    assert_eq!(read(), (true, 0));
    // Behind its end; and in the place of it.
    for (path, spoiled) in [
        (&of_log, [fs::read(&of_log).expect("there"), other.clone()].concat()),
        (&of_recording, [fs::read(&of_recording).expect("there"), other.clone()].concat()),
        (&of_recording, other),
    ] {
        let made = fs::read(path).expect("there");
        fs::write(path, spoiled).expect("written");
        assert_eq!(read(), (true, 1), "{}", path.display());
        fs::write(path, made).expect("written");
    }
}

/// The place of each record of a tlog whose frames are of MAVLink 2.
fn records(tlog: &[u8]) -> Vec<usize> {
    let mut places = Vec::new();
    let mut at = 0;
    while let Some([0xfd, length, flags, ..]) = tlog.get(at + 8..) {
        places.push(at);
        at += 8 + 12 + usize::from(*length) + 13 * usize::from(flags & 1);
    }
    assert_eq!(at, tlog.len());
    places
}

/// Puts the times of these records on by so many microseconds.
fn put_on(tlog: &mut [u8], places: &[usize], by_us: u64) {
    for at in places {
        let time = tlog[*at..at + 8].first_chunk_mut().expect("eight");
        *time = (u64::from_be_bytes(*time) + by_us).to_be_bytes();
    }
}

#[test]
fn a_tlog_whose_times_were_edited_is_read() {
    let dir = copied(1);
    let at = |name: &str| dir.path().join("copied").join(name);
    let recording = end_of("px4_hil_quad_low.tlog", &at("."));
    run(dir.path(), "decode copied -o copied/ --format tlog", 0);
    let made: Vec<_> = fs::read_dir(at("."))
        .expect("there")
        .map(|entry| entry.expect("there").path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "tlog") && *path != recording)
        .collect();
    assert_eq!(made.len(), 2, "{made:?}");
    for path in made {
        let whole = fs::read(&path).expect("there");
        let places = records(&whole);
        // One time, and all of them; of a part from the middle on, which is one all the same, none.
        let middle = places.len() / 2;
        let mut one = whole.clone();
        put_on(&mut one, &places[middle..=middle], 40_000);
        let mut all = whole.clone();
        put_on(&mut all, &places, 3_600_000_000);
        for (bytes, own) in [(&one[..], 1), (&all, 1), (&whole[places[middle]..], 0), (&whole, 0)] {
            fs::write(&path, bytes).expect("written");
            let checked = attempt(dir.path(), "check copied");
            let said = String::from_utf8_lossy(&checked.stderr).into_owned();
            let told =
                said.matches(", and its frames at other times: it is read as a recording of its own").count();
            assert_eq!(told, own, "{}: {said}", path.display());
            assert!(text(&checked).contains(&format!("{} logs checked", 2 + own)), "{}", text(&checked));
        }
    }
}

#[test]
fn a_tlog_is_said_to_be_made_of_nothing_else_that_has_the_same_session() {
    let dir = tempfile::tempdir().expect("directory");
    // A packed log's session is a number of its recording's length and ends.
    let mut recording = fs::read(flight("px4_hil_quad_low.tlog")).expect("there");
    let places = records(&recording);
    fs::create_dir(dir.path().join("packs")).expect("made");
    for name in ["a", "b"] {
        fs::write(dir.path().join(format!("{name}.tlog")), &recording).expect("written");
        run(dir.path(), &format!("pack {name}.tlog -o packs/{name}.hum"), 0);
        let middle = places.len() / 2;
        put_on(&mut recording, &places[middle..=middle], 5_000);
    }
    run(dir.path(), "decode packs/b.hum -o packs/ --format tlog", 0);
    let said = || String::from_utf8_lossy(&attempt(dir.path(), "check packs").stderr).into_owned();
    assert!(said().contains(".tlog: was made by hums of packs:b, which is read"), "{}", said());
    // Of which of two with these frames nothing tells.
    fs::copy(dir.path().join("packs/b.hum"), dir.path().join("packs/c.hum")).expect("copied");
    assert!(said().contains(".tlog: was made by hums of packs:b or packs:c, which is read"), "{}", said());
}
