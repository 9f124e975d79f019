//! What was copied off cards: files that hold nothing of their log, logs that were joined, logs that are cut. Every
//! command that reads says the same of them, with the same exit code.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use hums_blackbox::parity::{Parity, Sum};
use hums_blackbox::{Header, Sector};
use tempfile::TempDir;

use crate::support::{attempt, end_of, flight, json, named, px4, run, text};

const BLOCK: usize = 512;
/// A segment of the cards here, with its parity at its end.
const SEGMENT: usize = 7_999 * BLOCK;

/// Every command that reads, with these inputs: its exit code and what it said on both streams. A finding of the vehicle's
/// health is no damage.
fn readers(dir: &Path, inputs: &str) -> Vec<(&'static str, i32, String)> {
    ["decode -o out --format csv", "report -o pages/", "verify", "info", "check"]
        .into_iter()
        .map(|command| {
            let ended = attempt(dir, &format!("{command} {inputs}"));
            for made in ["out", "pages"] {
                let _ = fs::remove_dir_all(dir.join(made));
            }
            let said = [ended.stdout, ended.stderr].concat();
            let code = ended.status.code().filter(|code| *code != 4).unwrap_or_default();
            (command, code, String::from_utf8_lossy(&said).into_owned())
        })
        .collect()
}

/// Each of them ends with this code and says this.
#[track_caller]
fn all_say(dir: &Path, inputs: &str, code: i32, words: &[&str]) {
    for (command, ended, said) in readers(dir, inputs) {
        assert_eq!(ended, code, "hums {command} {inputs}: {said}");
        for words in words {
            assert!(said.contains(words), "hums {command} {inputs}: `{words}` is not in {said}");
        }
    }
}

/// A folder `copied` with the first segments of a card's sessions, as a copy has them: each as long as it was allocated.
fn copied(sessions: usize, flags: &str) -> TempDir {
    let dir = tempfile::tempdir().expect("directory");
    let recordings = ["px4_hil_quad_low.tlog", "ap_quad_guided.tlog"].map(|name| end_of(name, dir.path()));
    for session in 0..sessions {
        let recording = recordings[session % 2].display();
        attempt(dir.path(), &format!("sim --input {recording} --sd card.img --card-size 64 {flags}"));
    }
    let image = fs::read(dir.path().join("card.img")).expect("an image");
    let mut starts: Vec<usize> = Vec::new();
    let mut last = None;
    for (at, block) in image.as_chunks::<BLOCK>().0.iter().enumerate() {
        let session = block.starts_with(&[0x48, 0xb3]).then(|| block[7..11].to_vec());
        if session.is_some() && session != last {
            starts.push(at * BLOCK);
            last = session;
        }
    }
    assert_eq!(starts.len(), sessions);
    fs::create_dir(dir.path().join("copied")).expect("made");
    for (session, start) in (1..).zip(starts) {
        let name = format!("copied/{session:05}_00.HUM");
        fs::write(dir.path().join(name), &image[start..start + SEGMENT]).expect("written");
    }
    dir
}

#[test]
fn a_copied_card_is_whole_and_each_file_that_holds_nothing_of_ours_is_told_by_every_command() {
    let dir = copied(2, "");
    all_say(dir.path(), "copied", 0, &[]);
    let noise: Vec<u8> = (0..SEGMENT as u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 21) as u8).collect();
    let names = ["00001_01.HUM", "00002_01.HUM", "00003_00.HUM"];
    let contents = [vec![0; SEGMENT], noise, Vec::new(), vec![0xff; SEGMENT], b"hello".to_vec()];
    // Each content under the first name, each name with the first content.
    let pairs = contents.iter().map(|content| (names[0], content));
    for (name, content) in pairs.chain(names[1..].iter().map(|name| (*name, &contents[0]))) {
        let path = dir.path().join("copied").join(name);
        fs::write(&path, content).expect("written");
        let told = format!("{name} has the name of a segment and holds nothing of ours");
        all_say(dir.path(), "copied", 3, &[&told]);
        fs::remove_file(path).expect("removed");
    }
    // The log itself, in place of its sectors.
    let path = dir.path().join("copied/00001_00.HUM");
    let was = fs::read(&path).expect("there");
    fs::write(&path, vec![0; SEGMENT]).expect("written");
    all_say(dir.path(), "copied", 3, &["00001_00.HUM has the name of a segment and holds nothing of ours"]);
    fs::write(&path, was).expect("written");
    // A log by another name.
    fs::write(dir.path().join("copied/flight.hum"), "nothing").expect("written");
    all_say(dir.path(), "copied", 3, &["flight.hum: has the name of a log and holds nothing of ours"]);
}

#[test]
fn a_recording_in_a_folder_that_holds_nothing_is_told() {
    let dir = copied(1, "");
    for (name, content) in [("a.tlog", &b""[..]), ("b.bin", b"no log"), ("c.ulg", b""), ("d.tlog.gz", b"no")]
    {
        let path = dir.path().join("copied").join(name);
        fs::write(&path, content).expect("written");
        all_say(dir.path(), "copied", 3, &[&format!("{name}: has the name of a recording and holds none")]);
        fs::remove_file(path).expect("removed");
    }
    // A log in an archive is not read; nor does `verify` judge recordings of others.
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzip.write_all(&fs::read(dir.path().join("copied/00001_00.HUM")).expect("there")).expect("packed");
    let path = dir.path().join("copied/00003_00.HUM.gz");
    fs::write(&path, gzip.finish().expect("packed")).expect("written");
    let words = "00003_00.HUM.gz: has the name of a compressed log, which is not read; unpack it";
    all_say(dir.path(), "copied", 3, &[words]);
    let said = run(dir.path(), "info copied", 3).stderr;
    assert_eq!(String::from_utf8_lossy(&said).matches("00003_00.HUM.gz").count(), 1);
    fs::remove_file(path).expect("removed");
    fs::copy(px4(), dir.path().join("copied/flight.tlog")).expect("copied");
    fs::write(dir.path().join("copied/notes.txt"), "mine").expect("written");
    let said = run(dir.path(), "verify copied", 0).stderr;
    let said = String::from_utf8_lossy(&said);
    for words in ["1 recording of other kinds passed over", "1 file passed over: no log of a known kind"] {
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn not_everything_holds_where_something_was_passed_over() {
    let dir = copied(2, "");
    let verdict = || {
        let said = text(&run(dir.path(), "verify copied", 0));
        said.lines().last().expect("a verdict").to_owned()
    };
    assert_eq!(verdict(), "2 sessions: everything holds");
    let link = dir.path().join("copied/00003_00.HUM");
    std::os::unix::fs::symlink("nowhere", &link).expect("a link");
    assert_eq!(verdict(), "2 sessions: all that was read holds; what was passed over was not read");
}

#[test]
fn files_that_are_named_one_by_one_are_judged_as_their_folder_is() {
    let dir = copied(3, "");
    let at = |name: &str| dir.path().join("copied").join(name);
    let named = "copied/00003_00.HUM copied/00001_00.HUM";
    let all = format!("{named} ./copied/00002_00.HUM");
    let said = |line: &str, code| text(&run(dir.path(), line, code)).replace("./", "");
    assert_eq!(said(&format!("verify {all}"), 0), said("verify copied", 0));
    fs::rename(at("00002_00.HUM"), dir.path().join("elsewhere")).expect("renamed");
    all_say(dir.path(), named, 3, &["session 00002, which was recorded just before it, is not there"]);
    assert_eq!(said(&format!("verify {named}"), 3), said("verify copied", 3));
    // Without their endings, and two cards.
    fs::rename(dir.path().join("elsewhere"), at("00002_00")).expect("renamed");
    run(dir.path(), "verify copied", 0);
    run(dir.path(), &format!("verify {named} copied/00002_00"), 0);
    fs::create_dir_all(dir.path().join("other/copied")).expect("made");
    fs::rename(at("00002_00"), dir.path().join("other/copied/00002_00.HUM")).expect("renamed");
    run(dir.path(), &format!("verify {named} other/copied/00002_00.HUM"), 3);
}

/// Power went before the second session had a sector; the third one found none there.
#[test]
fn a_file_that_the_next_start_found_empty_is_no_loss() {
    let dir = copied(2, "");
    let at = |name: &str| dir.path().join("copied").join(name);
    fs::rename(at("00002_00.HUM"), at("00003_00.HUM")).expect("renamed");
    fs::write(at("00002_00.HUM"), vec![0; SEGMENT]).expect("written");
    for (command, code, said) in readers(dir.path(), "copied") {
        assert_eq!(code, 0, "{command}: {said}");
    }
    // Without the third one nothing tells that.
    fs::remove_file(at("00003_00.HUM")).expect("removed");
    all_say(dir.path(), "copied", 3, &["00002_00.HUM has the name of a segment and holds nothing of ours"]);
}

#[test]
fn another_session_under_the_number_of_the_session_before_is_told_by_every_command() {
    let dir = copied(3, "");
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
    let dir = copied(2, "");
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
    let dir = copied(2, "");
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
fn a_log_that_is_cut_in_flight_is_told_in_the_same_words_by_every_command() {
    let dir = tempfile::tempdir().expect("directory");
    attempt(
        dir.path(),
        &format!(
            "sim --input {} --sd card.img --cut-after-writes 1000",
            flight("ap_quad_guided.tlog").display()
        ),
    );
    all_say(dir.path(), "card.img", 3, &["not proved to its end: armed or in the air since "]);
    // The next start on the card tells what was there: then all of them know.
    run(dir.path(), "sim --input PX4 --sd card.img", 0);
    all_say(
        dir.path(),
        "card.img",
        3,
        &["whole to its end, as the next start found it; armed or in the air since "],
    );
}

/// Deletes a file as an operating system does it: its entry and its chain in the FAT.
fn delete(image: &mut [u8], name: &[u8; 11]) {
    let at = image.windows(11).position(|bytes| bytes == name).expect("an entry");
    let word = |image: &[u8], at: usize| u32::from_le_bytes(image[at..at + 4].try_into().expect("four"));
    let partition = word(image, 446 + 8) as usize * BLOCK;
    let fat = partition + (word(image, partition + 14) & 0xffff) as usize * BLOCK;
    image[at] = 0xe5;
    let mut next = (word(image, at + 26) & 0xffff | word(image, at + 20) << 16) as usize;
    while next < 0x0fff_fff8 {
        let entry = fat + 4 * next;
        next = word(image, entry) as usize & 0x0fff_ffff;
        image[entry..entry + 4].fill(0);
    }
}

#[test]
fn numbers_begin_anew_where_all_logs_were_deleted() {
    let dir = copied(2, "");
    let path = dir.path().join("card.img");
    let rewrite = |names: &[&[u8; 11]]| {
        let mut image = fs::read(&path).expect("an image");
        for name in names {
            delete(&mut image, name);
        }
        fs::write(&path, image).expect("written");
    };
    let record = |flight: &Path| {
        run(dir.path(), &format!("sim --input {} --sd card.img", flight.display()), 0);
    };
    rewrite(&[b"00001_00HUM", b"00002_00HUM"]);
    // Its clock is 23 minutes later than that of the deleted session 00002.
    record(&flight("ap_quad_faults.tlog"));
    all_say(dir.path(), "card.img", 0, &[]);
    let logs = json(&run(dir.path(), "verify card.img --json", 0));
    assert_eq!(logs["logs"].as_array().map(Vec::len), Some(1), "the deleted ones are not the card's");
    // One that was recorded after it, of which no clock tells that it is older.
    record(&px4());
    rewrite(&[b"00002_00HUM"]);
    all_say(
        dir.path(),
        "card.img",
        3,
        &["session 00002, which is newer than all that are there, was deleted"],
    );
}

/// A header with a right check, of which frames and records are not what comes out: an entry that is none, or one that is lost.
#[test]
fn a_header_that_counts_what_is_not_there_is_told_by_every_command() {
    let dir = copied(1, "");
    let path = dir.path().join("copied/00001_00.HUM");
    let whole = fs::read(&path).expect("a log");
    let blocks = || whole.as_chunks::<BLOCK>().0.iter();
    let header = |block: &[u8; BLOCK]| Header::read(block).ok();
    let closed =
        blocks().position(|block| header(block).is_some_and(|header| header.closed)).expect("it is closed");
    for (at, [frames, records]) in [(closed, [0, 1]), (closed, [1, 0]), (closed / 2, [-1, 0])] {
        let mut bytes = whole.clone();
        let block = bytes.as_chunks_mut::<BLOCK>().0.get_mut(at).expect("a block");
        let own = header(block).expect("a sector");
        let add = |byte: u8, number: i8| byte.wrapping_add_signed(number);
        (block[4], block[5]) = (add(block[4], 2 * records), add(block[5], frames));
        let mut sector = Sector::from_bytes(*block);
        sector.seal(own.session);
        *block = *sector.bytes();
        fs::write(&path, &bytes).expect("written");
        all_say(dir.path(), "copied", 3, &[]);
        let said = text(&attempt(dir.path(), "verify copied"));
        let told = said
            .lines()
            .any(|line| line.contains("FAILED  group decoding") || line.contains("FAILED  frames missing"));
        assert!(told, "sector {at}: {said}");
    }
}

/// The file of the only log on the card, up to the parity of its first stretch, which ends it.
fn with_parity(dir: &TempDir) -> Vec<u8> {
    let image = fs::read(dir.path().join("card.img")).expect("an image");
    let all = image.as_chunks::<BLOCK>().0;
    let begin = all.iter().position(|block| Header::read(block).is_ok()).expect("a sector");
    let end = all.iter().rposition(|block| Parity::read(block).is_some()).expect("parity") + 1;
    image[begin * BLOCK..end * BLOCK].to_vec()
}

/// Parity covers sectors once they are on the card, and is made of them: it tells of an end that is gone, and of what was altered with a check
/// that fits.
#[test]
fn what_parity_contradicts_is_told_by_every_command() {
    let dir = copied(1, "");
    let path = dir.path().join("copied/00001_00.HUM");
    let whole = with_parity(&dir);
    let blocks = || whole.as_chunks::<BLOCK>().0.iter();
    let header = |block: &[u8; BLOCK]| Header::read(block).ok();
    let closed =
        blocks().position(|block| header(block).is_some_and(|header| header.closed)).expect("it is closed");
    // A page of 16 KiB at the end, of which each column has lost four.
    let mut erased = whole.clone();
    erased[(closed - 31) * BLOCK..(closed + 1) * BLOCK].fill(0xff);
    fs::write(&path, erased).expect("written");
    all_say(dir.path(), "copied", 3, &["32 sectors missing at its end: its parity tells of them"]);
    let verified = |bytes: &[u8]| {
        fs::write(&path, bytes).expect("written");
        let said = text(&attempt(dir.path(), "verify copied"));
        (said.contains("FAILED  parity "), said.contains("1 sector had to be made again from parity"))
    };
    assert_eq!(verified(&whole), (false, false));
    // A sector that is altered.
    let sealed = |block: &mut [u8; BLOCK]| {
        let mut sector = Sector::from_bytes(*block);
        sector.seal(sector.session());
        *block = *sector.bytes();
    };
    let mut altered = whole.clone();
    let block = altered.as_chunks_mut::<BLOCK>().0.get_mut(20).expect("a block");
    block[480] ^= 0x20;
    sealed(block);
    assert_eq!(verified(&altered), (true, false));
    let words = "every eighth sector from 4 to ";
    all_say(dir.path(), "copied", 3, &[words, "00001_00.HUM and the parity of these disagree"]);
    // A sector that is lost, and one of the two from which it would be made again.
    let mut parity = blocks().enumerate().filter_map(|(at, block)| Some((at, Parity::read(block)?)));
    let (at, one) = parity.find(|(_, one)| one.sum == Sum::P && one.last % 8 == 4).expect("parity of it");
    let mut lost = whole.clone();
    lost[20 * BLOCK..21 * BLOCK].fill(0);
    assert_eq!(verified(&lost), (false, true));
    let block = lost.as_chunks_mut::<BLOCK>().0.get_mut(at).expect("a block");
    block[480] ^= 0x20;
    Sum::P.seal(block, one.session, one.last);
    assert_eq!(verified(&lost), (true, false));
}

/// Nothing is lost of them, and a card that damaged them will damage others: no reader calls such a log good.
#[test]
fn sectors_that_parity_made_again_are_told_by_every_command() {
    let dir = copied(1, "");
    let path = dir.path().join("copied/00001_00.HUM");
    let whole = with_parity(&dir);
    let sector = |at: usize| at * BLOCK..(at + 1) * BLOCK;
    let frames = |said: &str| said.lines().find(|line| line.contains("  frames ")).map(str::to_owned);
    let before = frames(&text(&run(dir.path(), "info copied", 0)));
    let mut flipped = whole.clone();
    flipped[20 * BLOCK + 100] ^= 1;
    let mut erased = whole.clone();
    erased[20 * BLOCK..28 * BLOCK].fill(0xff);
    let mut zeroed = whole.clone();
    zeroed[sector(20)].fill(0);
    let mut copied = whole.clone();
    copied.copy_within(sector(20), 40 * BLOCK);
    let mut swapped = whole.clone();
    swapped[sector(20)].copy_from_slice(&whole[sector(40)]);
    swapped[sector(40)].copy_from_slice(&whole[sector(20)]);
    for (damaged, count) in [
        (flipped, "1 sector"),
        (erased, "8 sectors"),
        (zeroed, "1 sector"),
        (copied, "1 sector"),
        (swapped, "2 sectors"),
    ] {
        fs::write(&path, damaged).expect("written");
        let words = format!("{count} had to be made again from parity, without a loss: keep the original");
        all_say(dir.path(), "copied", 3, &[&words]);
        let said = text(&run(dir.path(), "verify copied", 3));
        let last = said.lines().last().expect("a verdict");
        assert!(last.starts_with(&format!("1 session: nothing is lost; {words}")), "{said}");
        assert_eq!(said.matches("FAILED").count(), 1, "{said}");
        let json = json(&run(dir.path(), "verify --json copied", 3));
        let made_again = json["logs"][0]["blocks"]["repaired"].as_u64().expect("a number");
        assert_eq!((&json["ok"], &json["logs"][0]["ok"]), (&false.into(), &false.into()));
        assert!(count.starts_with(&made_again.to_string()), "{json}");
        assert_eq!(frames(&text(&run(dir.path(), "info copied", 3))), before);
        // What people look at says it too, and not only standard error.
        let screen = text(&run(dir.path(), "check copied", 3));
        assert!(screen.contains("; the log was damaged, and made whole from its parity"), "{screen}");
    }
    fs::copy(&path, dir.path().join("copied/00002_00.HUM")).expect("a copy");
    let table = text(&run(dir.path(), "check copied", 3));
    assert!(table.contains("damaged, and made whole from its parity\n"), "{table}");
    assert!(table.contains("1  damaged, and made whole from their parity (counted above too)"), "{table}");
    fs::remove_file(dir.path().join("copied/00002_00.HUM")).expect("ours");
    // Also of a copy, whose losses are its original's.
    fs::write(dir.path().join("copied/Copy of 00001_00.HUM"), &whole).expect("written");
    let said = text(&run(dir.path(), "verify copied", 3));
    assert!(said.contains("not counted") && said.contains("2 sectors had to be made again"), "{said}");
}

/// A file in which so many parity sectors are overwritten.
fn without(bytes: &[u8], most: usize, with: u8) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let parity = bytes.as_chunks_mut::<BLOCK>().0.iter_mut().filter(|block| Parity::read(block).is_some());
    parity.take(most).for_each(|block| block.fill(with));
    bytes
}

/// The log is whole, and nothing can be made again of what its card loses next.
#[test]
fn parity_that_is_gone_is_told_by_every_command() {
    let dir = copied(1, "");
    let path = dir.path().join("copied/00001_00.HUM");
    let whole = with_parity(&dir);
    let is_parity = |block: &[u8; BLOCK]| Parity::read(block).is_some();
    let all = whole.as_chunks::<BLOCK>().0.iter().filter(|block| is_parity(block)).count();
    for (most, with, words) in [
        (all, 0, format!("{all} parity sectors are missing: what the card loses")),
        (all, 0xff, format!("{all} parity sectors are missing: what the card loses")),
        (1, 0, "1 parity sector is missing: what the card loses".to_owned()),
    ] {
        fs::write(&path, without(&whole, most, with)).expect("written");
        all_say(dir.path(), "copied", 3, &[&words]);
        let said = text(&run(dir.path(), "verify copied", 3));
        let last = said.lines().last().expect("a verdict");
        assert!(last.starts_with(&format!("1 session: nothing is lost; {words}")), "{said}");
        assert_eq!(said.matches("FAILED").count(), 1, "{said}");
        assert!(said.contains("FAILED  sectors protected"), "{said}");
        assert_eq!(json(&run(dir.path(), "verify --json copied", 3))["ok"], false);
        let screen = text(&run(dir.path(), "check copied", 3));
        assert!(screen.contains("; the log is whole, without all of its parity"), "{screen}");
    }
    // Of a log whose power went: that of each stretch but the last was written.
    let long = flight("ap_quad_guided.tlog");
    run(dir.path(), &format!("sim --input {} --sd long.img --card-size 64", long.display()), 0);
    fs::rename(dir.path().join("long.img"), dir.path().join("card.img")).expect("renamed");
    let mut long = with_parity(&dir);
    let blocks = long.as_chunks_mut::<BLOCK>().0;
    let end = blocks.iter().rposition(|block| Header::read(block).is_ok()).expect("a sector");
    assert!(end > 540, "{end}");
    blocks[520..=end].iter_mut().for_each(|block| block.fill(0));
    let is_later = |block: &[u8; BLOCK]| Parity::read(block).is_some_and(|one| one.last >= 504);
    blocks.iter_mut().filter(|block| is_later(block)).for_each(|block| block.fill(0));
    for (bytes, is_told) in [(long.clone(), false), (without(&long, usize::MAX, 0), true)] {
        fs::write(&path, bytes).expect("written");
        let said = text(&run(dir.path(), "verify copied", 3));
        assert_eq!(said.contains("FAILED  sectors protected  16 checked, 16 failed"), is_told, "{said}");
    }
}

/// What follows lies in other blocks then, and parity makes some of it again: what lies in the place of that is read too.
#[test]
fn a_sector_that_was_put_between_others_costs_no_frame() {
    let dir = copied(1, "");
    let path = dir.path().join("copied/00001_00.HUM");
    let whole = with_parity(&dir);
    let blocks = whole.as_chunks::<BLOCK>().0;
    let closed = blocks.iter().rposition(|block| Header::read(block).is_ok()).expect("a sector");
    let frames = || {
        let json = json(&attempt(dir.path(), "info --json copied"));
        (json["logs"][0]["frames"].clone(), json["logs"][0]["gaps_count"].clone())
    };
    let before = frames();
    // Of the eight columns none, some or all have lost more than the two that are made again.
    for (back, put) in [(3, 1), (9, 1), (16, 1), (18, 1), (21, 1), (30, 1), (9, 8), (16, 8), (19, 8), (30, 8)]
    {
        let mut longer = whole.clone();
        let at = (closed - back) * BLOCK;
        longer.splice(at..at, whole[18 * BLOCK..(18 + put) * BLOCK].to_vec());
        fs::write(&path, longer).expect("written");
        assert_eq!(frames(), before, "{put} put {back} sectors before the end");
        run(dir.path(), "verify copied", 3);
    }
}

#[test]
fn a_folder_that_cannot_be_read_keeps_nothing_else_from_being_read() {
    let dir = copied(1, "");
    // No system reads a path this long: it is made of two halves.
    let half = |name: &str| {
        let root = dir.path().join(name);
        let deep = (0..8).fold(root.clone(), |path, _| path.join("x".repeat(255)));
        fs::create_dir_all(&deep).expect("made");
        (root, deep)
    };
    let ((_, first), (second, _)) = (half("copied"), half("half"));
    fs::rename(second, first.join("x".repeat(255))).expect("moved");
    for (command, code, said) in readers(dir.path(), "copied") {
        assert_eq!(code, 3, "{command}: {said}");
        assert!(said.contains("x: cannot be read"), "{command}: {said}");
    }
    assert!(text(&run(dir.path(), "info copied", 3)).contains("ended in order"));
}

/// What of a log's file is superseded, of another session or no sector is counted by `verify` as by `info`.
#[test]
fn blocks_that_do_not_count_are_counted_by_verify_and_info() {
    let dir = copied(1, "");
    let path = dir.path().join("copied/00001_00.HUM");
    let mut log = fs::read(&path).expect("there");
    let last =
        log.as_chunks::<BLOCK>().0.iter().rposition(|block| Header::read(block).is_ok()).expect("a sector");
    // Behind its last sector: a copy of that while it was in progress, a sector of another session, a block that is none.
    let mut block = |at: usize, change: &dyn Fn(&mut [u8; BLOCK])| {
        let (from, to) = (last * BLOCK, (last + at) * BLOCK);
        log.copy_within(from..from + BLOCK, to);
        change(log[to..].first_chunk_mut().expect("a block"));
    };
    block(1, &|block| {
        let mut sector = Sector::from_bytes(*block);
        sector.set_partial(true);
        sector.seal(sector.session());
        *block = *sector.bytes();
    });
    block(2, &|block| {
        // A recycled file has such ones at their old places, or before these.
        block[11..15].copy_from_slice(&(last as u32 + 10).to_le_bytes());
        let mut sector = Sector::from_bytes(*block);
        sector.seal(sector.session() ^ 1);
        *block = *sector.bytes();
    });
    block(3, &|block| block.fill(0x5a));
    fs::write(&path, log).expect("written");
    for command in ["verify", "info"] {
        let said = text(&run(dir.path(), &format!("{command} copied"), 0));
        for words in ["1 sector superseded", "1 block of another session, 1 block that is no sector"] {
            assert!(said.contains(words), "{command}: `{words}` is not in {said}");
        }
    }
}

#[test]
fn a_wiped_card_and_a_deleted_newest_log_are_told_with_and_without_salvage() {
    let dir = copied(2, "");
    let path = dir.path().join("card.img");
    let image = fs::read(&path).expect("an image");
    let codes = || -> Vec<i32> {
        let codes = readers(dir.path(), "card.img --salvage").into_iter();
        // A report takes no such flag.
        codes.filter(|(command, ..)| !command.starts_with("report")).map(|(_, code, _)| code).collect()
    };
    assert_eq!(codes(), [0; 4]);
    let entry = |name: &[u8]| image.windows(11).position(|bytes| bytes == name).expect("an entry");
    let mut deleted = image.clone();
    delete(&mut deleted, b"00002_00HUM");
    fs::write(&path, &deleted).expect("written");
    all_say(
        dir.path(),
        "card.img",
        3,
        &["session 00002, which is newer than all that are there, was deleted"],
    );
    assert_eq!(codes(), [3; 4]);
    // The first digit of a deleted name is lost: an older one is not taken for a newer one, nor a newer one for an older one.
    let two = [b"00001_00HUM", b"00002_00HUM"].map(|name| entry(name));
    for (there, gone, is_newer) in [(b"10001", b"09998", false), (b"09999", b"10002", true)] {
        let mut cards = deleted.clone();
        cards[two[0]..][..5].copy_from_slice(there);
        cards[two[1] + 1..][..4].copy_from_slice(&gone[1..]);
        fs::write(&path, &cards).expect("written");
        let said = text(&attempt(dir.path(), "verify card.img"));
        let words = "session 10002, which is newer than all that are there, was deleted";
        assert_eq!((said.contains(words), said.contains("was deleted")), (is_newer, is_newer), "{said}");
    }
    // All of them: a card that was formatted in haste.
    let mut wiped = image.clone();
    for name in [b"00001_00HUM", b"00002_00HUM"] {
        wiped[entry(name)..entry(name) + 32].fill(0);
    }
    fs::write(&path, &wiped).expect("written");
    all_say(dir.path(), "card.img", 3, &[]);
    assert_eq!(codes(), [3; 4]);
}

/// Order is by number and by what a log says was recorded before it: a clock may have been wrong.
#[test]
fn a_newest_log_that_was_deleted_is_told_whatever_its_clock_says() {
    let dir = tempfile::tempdir().expect("directory");
    // The clocks of the later ones are 23 minutes and more behind that of the first.
    for name in ["ap_quad_faults.tlog", "px4_hil_quad_low.tlog", "px4_hil_quad_low.tlog"] {
        let recording = end_of(name, dir.path());
        run(dir.path(), &format!("sim --input {} --sd card.img --card-size 64", recording.display()), 0);
    }
    let path = dir.path().join("card.img");
    let mut image = fs::read(&path).expect("an image");
    for (gone, told) in [(b"00003_00HUM", "00003"), (b"00002_00HUM", "00003")] {
        delete(&mut image, gone);
        fs::write(&path, &image).expect("written");
        let words = format!("session {told}, which is newer than all that are there, was deleted");
        all_say(dir.path(), "card.img", 3, &[&words]);
    }
}

#[test]
fn a_log_under_another_name_is_read_and_one_that_only_salvage_finds_is_not_called_absent() {
    let dir = copied(3, "");
    let path = dir.path().join("card.img");
    let image = fs::read(&path).expect("an image");
    let entry = |name: &[u8]| image.windows(11).position(|bytes| bytes == name).expect("an entry");
    // The newest one was renamed on a PC.
    let mut renamed = image.clone();
    renamed[entry(b"00003_00HUM")..][..11].copy_from_slice(b"FLIGHT  BAK");
    fs::write(&path, &renamed).expect("written");
    all_say(dir.path(), "card.img", 0, &["FLIGHT.BAK begins as a log and has not the name of a segment"]);
    assert!(text(&run(dir.path(), "verify card.img", 0)).contains("Session FLIGHT_BAK (FLIGHT.BAK)"));
    // Another file has taken its entry, and its clusters are free.
    let at = entry(b"00003_00HUM");
    let word = |at: usize| u32::from_le_bytes(image[at..at + 4].try_into().expect("four"));
    let partition = word(446 + 8) as usize * BLOCK;
    let fat = partition + (word(partition + 14) & 0xffff) as usize * BLOCK;
    let free = |image: &mut [u8], entry: usize| {
        let mut next = (word(entry + 26) & 0xffff | word(entry + 20) << 16) as usize;
        while next < 0x0fff_fff8 {
            let following = word(fat + 4 * next) as usize & 0x0fff_ffff;
            image[fat + 4 * next..fat + 4 * next + 4].fill(0);
            next = following;
        }
    };
    let mut taken = image.clone();
    free(&mut taken, at);
    taken[at..at + 11].copy_from_slice(b"NOTES   TXT");
    taken[at + 20..at + 32].fill(0);
    fs::write(&path, &taken).expect("written");
    let words = "sectors that no file names were not looked at: --salvage does";
    for (command, sessions) in [("info", "Session 0000"), ("verify", "Session 0000")] {
        let said = text(&run(dir.path(), &format!("{command} card.img"), 0));
        assert!(said.contains(words) && said.matches(sessions).count() == 2, "{command}: {said}");
        let said = text(&run(dir.path(), &format!("{command} card.img --salvage"), 0));
        let counts = ["Session 0000", "Session session-"].map(|sessions| said.matches(sessions).count());
        assert!(!said.contains(words) && counts == [2, 1], "{command}: {said}");
    }
    let told = json(&run(dir.path(), "info --json card.img", 0));
    assert_eq!(told["images"][0]["not_looked_at"], words);
    // The oldest one was deleted: that makes room, and is told.
    let mut oldest = image.clone();
    let at = entry(b"00001_00HUM");
    free(&mut oldest, at);
    oldest[at] = 0xe5;
    fs::write(&path, &oldest).expect("written");
    let said = text(&run(dir.path(), "info card.img", 0));
    assert!(said.contains("not looked at, among them those of 1 deleted segment: --salvage does"), "{said}");
}

#[test]
fn a_report_of_the_newest_session_tells_that_an_older_one_on_the_card_is_damaged() {
    let dir = copied(2, "");
    let path = dir.path().join("card.img");
    let mut image = fs::read(&path).expect("an image");
    let blocks = image.as_chunks_mut::<BLOCK>().0;
    // Every eighth: three of them are more than parity makes again.
    let sectors = blocks.iter_mut().filter(|block| block.starts_with(&[0x48, 0xb3])).skip(20).step_by(8);
    sectors.take(3).for_each(|block| block[100] ^= 4);
    fs::write(&path, image).expect("written");
    for line in ["report card.img -o page.html", "verify card.img"] {
        run(dir.path(), line, 3);
    }
    let said = run(dir.path(), "report card.img -o other.html", 3).stderr;
    assert!(String::from_utf8_lossy(&said).contains("00001: 1 gap, "));
}

#[test]
fn a_report_compares_sessions_of_one_card_only() {
    let dir = copied(3, "");
    let sessions = |line: &str| {
        run(dir.path(), &format!("{line} -o page.html"), 0);
        let page = fs::read_to_string(dir.path().join("page.html")).expect("text");
        fs::remove_file(dir.path().join("page.html")).expect("removed");
        let (_, trend) = page.split_once("\"trend\":{\"sessions\":[").expect("a trend");
        trend.split_once(']').map_or(0, |(sessions, _)| sessions.matches("\"name\"").count())
    };
    assert_eq!((sessions("report card.img"), sessions("report copied")), (2, 2));
    // Packed logs may be anybody's: of two vehicles, for instance.
    for name in ["one", "two"] {
        run(dir.path(), &format!("pack PX4 -o {name}.hum"), 0);
    }
    assert_eq!(sessions("report one.hum two.hum"), 1);
}

#[test]
fn an_image_of_a_partition_alone_is_read_like_its_cards() {
    let dir = copied(2, "");
    let image = fs::read(dir.path().join("card.img")).expect("an image");
    let word = |at: usize| u32::from_le_bytes(image[at..at + 4].try_into().expect("four")) as usize;
    let partition = &image[word(446 + 8) * BLOCK..][..word(446 + 12) * BLOCK];
    fs::create_dir(dir.path().join("part")).expect("made");
    fs::write(dir.path().join("part/card.img"), partition).expect("written");
    for command in ["verify", "info", "verify --salvage"] {
        let said = |card: &str| text(&run(dir.path(), &format!("{command} {card}"), 0)).replace("part/", "");
        assert_eq!(said("part/card.img"), said("card.img"));
    }
}

#[test]
fn an_image_that_was_cut_short_is_told_as_that() {
    let dir = copied(1, "");
    let path = dir.path().join("card.img");
    let image = fs::read(&path).expect("an image");
    let half = image.len() / 2;
    fs::write(&path, &image[..half]).expect("written");
    let words = format!("the image is cut short: it has {half} bytes, and its partition ends at byte ");
    for (command, code, said) in readers(dir.path(), "card.img") {
        assert!(code == 3 && said.contains(&words), "{command}: {said}");
        assert!(!said.contains("larger than its partition"), "{command}: {said}");
    }
}

#[test]
fn a_damaged_image_in_a_folder_is_read_as_where_it_is_named() {
    let dir = copied(1, "");
    let cards = dir.path().join("cards");
    fs::create_dir(&cards).expect("a folder");
    let mut image = fs::read(dir.path().join("card.img")).expect("an image");
    image[..512].fill(0);
    fs::write(cards.join("card.img"), &image).expect("written");
    for (command, code, said) in readers(dir.path(), "cards") {
        assert!(code == 3 && !said.contains("no log"), "{command}: {said}");
    }
    // What is left of an image is told, and what is none is passed over and named.
    fs::write(cards.join("card.img"), &image[..300]).expect("written");
    fs::write(cards.join("notes.xyz"), "notes").expect("written");
    fs::copy(px4(), cards.join("flight.tlog")).expect("copied");
    let said = run(dir.path(), "check cards", 3);
    let said = String::from_utf8_lossy(&said.stderr).into_owned();
    assert!(said.contains("has the name of a card's image") && said.contains("notes.xyz"), "{said}");
}

#[test]
fn a_pipe_or_a_device_as_a_recording_is_refused_at_once_and_nothing_is_left() {
    let dir = tempfile::tempdir().expect("directory");
    let made = std::process::Command::new("mkfifo").arg(dir.path().join("pipe")).status();
    assert!(made.expect("it runs").success());
    for line in [
        "pack /dev/zero -o new.hum",
        "pack pipe -o new.hum",
        "sim --input pipe --sd new.img",
        "sim --input PX4 --gs-input pipe --sd new.img",
        "sim --input PX4 --sd pipe",
        "sim --input PX4 --sd new.img --store pipe",
    ] {
        let said = run(dir.path(), line, 1);
        let said = String::from_utf8_lossy(&said.stderr).into_owned();
        assert!(said.contains("is a pipe") || said.contains("is no file"), "{line}: {said}");
        let left: Vec<_> = fs::read_dir(dir.path())
            .expect("a directory")
            .map(|entry| entry.expect("one").file_name())
            .collect();
        assert!(left.iter().all(|name| name == "pipe" || name == "new.img"), "{line}: {left:?}");
        let _ = fs::remove_file(dir.path().join("new.img"));
    }
}

#[test]
fn the_name_of_a_file_does_not_become_a_folder() {
    let dir = copied(2, "");
    for line in
        ["decode card.img -o out.tlog --format tlog", "decode copied/00001_00.HUM -o out.csv --format csv"]
    {
        let said = run(dir.path(), line, 2);
        assert!(String::from_utf8_lossy(&said.stderr).contains("is the name of a file"), "{line}");
        assert!(!dir.path().join("out.tlog").exists() && !dir.path().join("out.csv").exists());
    }
    run(dir.path(), "decode card.img -o out.tlog/ --format tlog", 0);
}

#[test]
fn one_session_under_two_names_is_told_by_every_command_and_counted_once() {
    let dir = copied(3, "");
    let at = |name: &str| dir.path().join("copied").join(name);
    fs::copy(at("00001_00.HUM"), at("00003_00.HUM")).expect("copied");
    let words = "is session 00001 once more; its own log is not there";
    all_say(dir.path(), "copied", 3, &[words]);
    let said = text(&run(dir.path(), "verify copied", 3));
    assert!(said.contains("\n2 sessions: "), "{said}");
    let said = text(&attempt(dir.path(), "check copied"));
    assert!(said.contains("2 logs checked") && said.contains("1  the same session once more"), "{said}");
    // A damaged copy is one as well.
    let mut copy = fs::read(at("00003_00.HUM")).expect("there");
    copy[20 * BLOCK + 100] ^= 1;
    fs::write(at("00003_00.HUM"), copy).expect("written");
    all_say(dir.path(), "copied", 3, &[words]);
    // In a folder of its own a copy is nothing strange.
    fs::create_dir(dir.path().join("other")).expect("made");
    fs::remove_file(at("00003_00.HUM")).expect("removed");
    fs::copy(at("00001_00.HUM"), dir.path().join("other/00001_00.HUM")).expect("copied");
    all_say(dir.path(), "copied other", 0, &[]);
}

#[test]
fn a_mere_copy_is_told_and_its_flight_counted_once() {
    let dir = copied(1, "");
    let log = dir.path().join("copied/00001_00.HUM");
    for name in ["Copy of 00001_00.HUM", "00001_00 (1).HUM", "flight.hum"] {
        fs::copy(&log, dir.path().join("copied").join(name)).expect("copied");
    }
    // The same card three times.
    fs::copy(dir.path().join("card.img"), dir.path().join("again.img")).expect("copied");
    for (inputs, out) in [("copied", "a"), ("card.img again.img copied", "b")] {
        let (decode, report) = (format!("-o {out}/ --format csv"), format!("-o {out}-pages/"));
        let commands =
            [("verify", ""), ("info", ""), ("check", ""), ("decode", &decode), ("report", &report)];
        for (command, flags) in commands {
            let said = attempt(dir.path(), &format!("{command} {inputs} {flags}"));
            let told = text(&said) + &String::from_utf8_lossy(&said.stderr);
            assert!(matches!(said.status.code(), Some(0 | 4)), "{command}: {told}");
            let words = ["is the same session as", "is a copy of"];
            assert!(words.iter().any(|words| told.contains(words)), "{command}: {told}");
        }
        let said = text(&run(dir.path(), &format!("verify {inputs}"), 0));
        assert!(said.contains("\n1 session: "), "{said}");
        let said = text(&attempt(dir.path(), &format!("check {inputs}")));
        assert!(said.contains("1 log checked") && said.contains("the same session once more"), "{said}");
    }
    // One that differs is a log as any other.
    let mut copy = without(&fs::read(&log).expect("there"), usize::MAX, 0);
    copy[20 * BLOCK + 100] ^= 1;
    fs::write(dir.path().join("copied/flight.hum"), copy).expect("written");
    let said = text(&run(dir.path(), "verify copied", 3));
    assert!(said.contains("\n2 sessions: "), "{said}");
}

/// What `decode` made is read where what it was made of is not there.
#[test]
fn a_tlog_that_was_made_of_a_log_counts_its_flight_once_beside_it() {
    let dir = copied(1, "");
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
fn logs_that_were_renamed_or_exchanged_are_told_by_every_command() {
    let dir = copied(3, "");
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
fn noise_behind_the_last_end_mark_is_told_by_every_command() {
    let dir = copied(1, "");
    let path = dir.path().join("copied/00001_00.HUM");
    let log = without(&fs::read(&path).expect("a log"), usize::MAX, 0);
    let last = log
        .as_chunks::<BLOCK>()
        .0
        .iter()
        .rposition(|block| block.starts_with(&[0x48, 0xb3]))
        .expect("sectors");
    let mut noisy = log.clone();
    let noise = |(at, byte): (usize, &mut u8)| *byte = (at * 7 % 251) as u8 + 1;
    noisy[last * BLOCK..(last + 1) * BLOCK].iter_mut().enumerate().for_each(noise);
    fs::write(&path, noisy).expect("written");
    all_say(dir.path(), "copied", 3, &["1 block that is no sector"]);
    let said = text(&run(dir.path(), "verify copied", 3));
    assert!(said.contains("FAILED  end "), "{said}");
    // The head of a sector makes none: what fails the check is of nobody.
    let mut forged = log.clone();
    forged[last * BLOCK..(last + 1) * BLOCK].iter_mut().enumerate().for_each(noise);
    forged[last * BLOCK..][..2].copy_from_slice(&[0x48, 0xb3]);
    fs::write(&path, forged).expect("written");
    let said = text(&run(dir.path(), "verify copied", 3));
    assert!(
        said.contains("1 block with the head of a sector") && !said.contains("of another session"),
        "{said}"
    );
    // What a card held before the box used it, films for instance, goes on behind that, and is no finding.
    let mut film = log.clone();
    film[last * BLOCK..].iter_mut().enumerate().for_each(noise);
    fs::write(&path, film).expect("written");
    let said = text(&run(dir.path(), "verify copied", 0));
    assert!(said.contains("blocks that are no sectors") && said.contains("cannot be proved"), "{said}");
    // Nothing there: whether there was anything nobody knows.
    for empty in [0x00, 0xff] {
        let mut log = log.clone();
        log[last * BLOCK..(last + 1) * BLOCK].fill(empty);
        fs::write(&path, log).expect("written");
        let said = text(&attempt(dir.path(), "info copied"));
        assert!(!said.contains("that is no sector"), "{said}");
    }
}

#[test]
fn two_copies_of_one_session_have_two_pages_and_the_damaged_one_is_not_kept_alone() {
    let dir = copied(1, "");
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
    for flags in ["", "--replace"] {
        let said = run(dir.path(), &format!("report damaged copied same -o pages/ {flags}"), 3);
        let lines = text(&said);
        let (tables, pages): (Vec<_>, Vec<_>) =
            lines.lines().partition(|line| line.contains("table of 2 pages"));
        assert_eq!((pages.len(), tables.len()), (2, 1), "{lines}");
        let told = String::from_utf8_lossy(&said.stderr).into_owned();
        assert!(told.contains("is a copy of copied/00001, whose page is written once"), "{told}");
        let mut pages: Vec<String> = fs::read_dir(dir.path().join("pages"))
            .expect("pages")
            .map(|page| page.expect("a page").file_name().to_string_lossy().into_owned())
            .filter(|name| name != "index.html" && name != "hums-kept")
            .collect();
        pages.sort();
        assert!(pages.len() == 2 && pages[0].ends_with("-2.html"), "{pages:?}");
    }
}

/// A copy of a log with another log behind it: only the copied one is read, and it counts once. The other one is in no output.
#[test]
fn another_log_behind_a_copy_is_told_by_every_command() {
    let dir = copied(2, "");
    let at = |name: &str| dir.path().join("copied").join(name);
    let [one, other] = ["00001_00.HUM", "00002_00.HUM"].map(|name| fs::read(at(name)).expect("there"));
    fs::write(at("all.hum"), [&one[..], &other].concat()).expect("written");
    fs::remove_file(at("00002_00.HUM")).expect("removed");
    let session = u32::from_le_bytes(other[7..11].try_into().expect("four"));
    let words = format!("of another session (session {session:08x})");
    all_say(dir.path(), "copied", 3, &[&words, "give each by itself", "00001 once more (not counted)"]);
    let said = text(&run(dir.path(), "verify copied", 3));
    assert!(said.contains("FAILED  files ") && said.contains("1 session: damage"), "{said}");
    assert!(text(&run(dir.path(), "ls copied", 3)).contains("not proved to be whole"));
    // A copy alone is no finding.
    fs::write(at("all.hum"), &one).expect("written");
    all_say(dir.path(), "copied", 0, &["00001 once more (not counted)"]);
}

#[test]
fn what_is_wrong_with_a_copy_is_told_by_every_command() {
    let dir = copied(1, "");
    let at = |name: &str| dir.path().join("copied").join(name);
    let mut damaged = fs::read(at("00001_00.HUM")).expect("there");
    damaged[20 * BLOCK..21 * BLOCK].fill(0);
    fs::write(at("Copy of 00001_00.HUM"), damaged).expect("written");
    all_say(dir.path(), "copied", 3, &["1 sector had to be made again from parity"]);
}

#[test]
fn a_name_that_tells_another_session_than_its_sectors_is_told_by_every_command() {
    let dir = copied(1, "");
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

#[test]
fn a_log_that_is_cut_beside_a_whole_copy_is_told_by_every_command_and_counts_once() {
    let dir = copied(2, "");
    let at = |name: &str| dir.path().join("copied").join(name);
    let log = fs::read(at("00002_00.HUM")).expect("there");
    fs::write(at("zcopy.hum"), &log).expect("written");
    fs::write(at("00002_00.HUM"), &log[..20 * BLOCK]).expect("written");
    all_say(dir.path(), "copied", 3, &["it is the beginning of ", "its end is missing (not counted)"]);
    let said = text(&run(dir.path(), "verify copied", 3));
    assert!(
        said.contains("it is the beginning of zcopy, which has ") && said.contains("2 sessions: "),
        "{said}"
    );
    assert!(text(&attempt(dir.path(), "check copied")).contains("2 logs checked"));
    // The other way round, and a card's own file is whole.
    fs::rename(at("00002_00.HUM"), at("cut")).expect("renamed");
    fs::rename(at("zcopy.hum"), at("00002_00.HUM")).expect("renamed");
    fs::rename(at("cut"), at("cut.hum")).expect("renamed");
    all_say(dir.path(), "copied", 3, &["it is the beginning of ", "00002, which has "]);
}

#[test]
fn another_flight_under_the_name_that_decode_gives_is_read() {
    let dir = copied(1, "");
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
    let dir = copied(1, "");
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

#[test]
fn what_lies_behind_a_mere_copy_is_said_and_a_part_with_the_name_of_another_session_too() {
    let dir = copied(2, "");
    let at = |name: &str| dir.path().join("copied").join(name);
    let copy = fs::read(at("00001_00.HUM")).expect("there");
    let recording = fs::read(end_of("ap_quad_guided.tlog", dir.path())).expect("there");
    fs::write(at("zcopy.hum"), &copy).expect("written");
    all_say(dir.path(), "copied", 0, &["is the same session as 00001 once more (not counted)"]);
    fs::write(at("zcopy.hum"), [copy, recording].concat()).expect("written");
    let words = "is the same session as 00001 once more (not counted); behind its last sector: ";
    all_say(dir.path(), "copied", 0, &[words]);
    fs::remove_file(at("zcopy.hum")).expect("ours");
    let part = at("00002-sdeadbeef_00.part.HUM");
    fs::rename(at("00002_00.HUM"), &part).expect("renamed");
    all_say(dir.path(), "copied", 3, &["its name tells session deadbeef, and its sectors are of session "]);
}
