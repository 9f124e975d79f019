//! Folders of copies from cards, and files that are named one by one. An input without a log is reported, and does
//! not keep others from being read.

use std::fs;
use std::io::Write as _;

use crate::copied::{SEGMENT, all_say, copied, readers};
use crate::support::{px4, run, stderr, text};

#[test]
fn a_copied_card_is_whole_and_each_file_that_holds_nothing_of_ours_is_told_by_every_command() {
    let dir = copied(2);
    all_say(dir.path(), "copied", 0, &[]);
    let noise: Vec<u8> = (0..SEGMENT as u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 21) as u8).collect();
    let names = ["00001_01.HUM", "00002_01.HUM", "00003_00.HUM"];
    let contents = [vec![0; SEGMENT], noise, Vec::new(), vec![0xff; SEGMENT], b"hello".to_vec()];
    let pairs = contents.iter().map(|content| (names[0], content));
    for (name, content) in pairs.chain(names[1..].iter().map(|name| (*name, &contents[0]))) {
        let path = dir.path().join("copied").join(name);
        fs::write(&path, content).expect("written");
        let told = format!("{name} has the name of a segment and holds nothing of ours");
        all_say(dir.path(), "copied", 3, &[&told]);
        fs::remove_file(path).expect("removed");
    }
    let path = dir.path().join("copied/00001_00.HUM");
    let was = fs::read(&path).expect("there");
    fs::write(&path, vec![0; SEGMENT]).expect("written");
    all_say(dir.path(), "copied", 3, &["00001_00.HUM has the name of a segment and holds nothing of ours"]);
    fs::write(&path, was).expect("written");
    fs::write(dir.path().join("copied/flight.hum"), "nothing").expect("written");
    all_say(dir.path(), "copied", 3, &["flight.hum: has the name of a log and holds nothing of ours"]);
}

#[test]
fn a_recording_in_a_folder_that_holds_nothing_is_told() {
    let dir = copied(1);
    for (name, content) in [("a.tlog", &b""[..]), ("b.bin", b"no log"), ("c.ulg", b""), ("d.tlog.gz", b"no")]
    {
        let path = dir.path().join("copied").join(name);
        fs::write(&path, content).expect("written");
        all_say(dir.path(), "copied", 3, &[&format!("{name}: has the name of a recording and holds none")]);
        fs::remove_file(path).expect("removed");
    }
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
    let said = stderr(&run(dir.path(), "info --verify copied", 0));
    for words in ["1 recording of other kinds passed over", "1 file passed over: no log of a known kind"] {
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn not_everything_holds_where_something_was_passed_over() {
    let dir = copied(2);
    let verify = |words| text(&run(dir.path(), words, 0));
    let verdict = || verify("info --verify copied").lines().last().expect("a verdict").to_owned();
    assert_eq!(verdict(), "2 sessions: everything holds");
    assert_eq!(verify("info --verify copied").lines().count(), 3, "a line for each session");
    assert_eq!(verify("info --verify -v copied").matches(" checked, 0 failed").count(), 34);
    let link = dir.path().join("copied/00003_00.HUM");
    std::os::unix::fs::symlink("nowhere", &link).expect("a link");
    assert_eq!(verdict(), "2 sessions: all that was read holds; what was passed over was not read");
}

#[test]
fn files_that_are_named_one_by_one_are_judged_as_their_folder_is() {
    let dir = copied(3);
    let at = |name: &str| dir.path().join("copied").join(name);
    let named = "copied/00003_00.HUM copied/00001_00.HUM";
    let all = format!("{named} ./copied/00002_00.HUM");
    let said = |line: &str, code| text(&run(dir.path(), line, code)).replace("./", "");
    assert_eq!(said(&format!("info --verify {all}"), 0), said("info --verify copied", 0));
    fs::rename(at("00002_00.HUM"), dir.path().join("elsewhere")).expect("renamed");
    all_say(dir.path(), named, 3, &["session 00002, which was recorded just before it, is not there"]);
    assert_eq!(said(&format!("info --verify {named}"), 3), said("info --verify copied", 3));
    // Without their endings, and two cards.
    fs::rename(dir.path().join("elsewhere"), at("00002_00")).expect("renamed");
    run(dir.path(), "info --verify copied", 0);
    run(dir.path(), &format!("info --verify {named} copied/00002_00"), 0);
    fs::create_dir_all(dir.path().join("other/copied")).expect("made");
    fs::rename(at("00002_00"), dir.path().join("other/copied/00002_00.HUM")).expect("renamed");
    run(dir.path(), &format!("info --verify {named} other/copied/00002_00.HUM"), 3);
}

#[test]
fn a_file_that_the_next_start_found_empty_is_no_loss() {
    let dir = copied(2);
    let at = |name: &str| dir.path().join("copied").join(name);
    fs::rename(at("00002_00.HUM"), at("00003_00.HUM")).expect("renamed");
    fs::write(at("00002_00.HUM"), vec![0; SEGMENT]).expect("written");
    for (command, code, said) in readers(dir.path(), "copied") {
        assert_eq!(code, 0, "{command}: {said}");
    }
    fs::remove_file(at("00003_00.HUM")).expect("removed");
    all_say(dir.path(), "copied", 3, &["00002_00.HUM has the name of a segment and holds nothing of ours"]);
}

#[test]
fn a_folder_that_cannot_be_read_keeps_nothing_else_from_being_read() {
    let dir = copied(1);
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

#[test]
fn a_pipe_or_a_device_as_a_recording_is_refused_at_once_and_nothing_is_left() {
    let dir = tempfile::tempdir().expect("directory");
    let made = std::process::Command::new("mkfifo").arg(dir.path().join("pipe")).status();
    assert!(made.expect("it runs").success());
    for line in [
        "decode --format hum /dev/zero -o new.hum",
        "decode --format hum pipe -o new.hum",
        "sim pipe --sd new.img",
        "sim PX4 --gs-input pipe --sd new.img",
        "sim PX4 --sd pipe",
        "sim PX4 --sd new.img --store pipe",
    ] {
        let said = stderr(&run(dir.path(), line, 1));
        assert!(
            ["is a pipe", "is no file", "is not a file"].iter().any(|words| said.contains(words)),
            "{line}: {said}"
        );
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
    let dir = copied(2);
    for line in
        ["decode card.img -o out.tlog --format tlog", "decode copied/00001_00.HUM -o out.csv --format csv"]
    {
        let said = run(dir.path(), line, 2);
        assert!(String::from_utf8_lossy(&said.stderr).contains("is the name of a file"), "{line}");
        assert!(!dir.path().join("out.tlog").exists() && !dir.path().join("out.csv").exists());
    }
    run(dir.path(), "decode card.img -o out.tlog/ --format tlog", 0);
}
