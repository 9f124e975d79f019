use std::fs;
use std::io::Write as _;
use std::path::Path;

use super::aside::{replace, set_aside};
use super::*;

/// A directory with a file `old` of this content.
fn furnished() -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a directory");
    fs::write(dir.path().join("old"), "what was there").expect("written");
    dir
}

fn names(dir: &Path) -> Vec<String> {
    let names = fs::read_dir(dir).expect("a directory").map(|entry| entry.expect("an entry").file_name());
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

fn create(path: &Path) -> anyhow::Result<Output> {
    Output::create(path, &Inputs::none())
}

/// Writes it whole; the error's words where that fails.
fn write(path: &Path, inputs: &Inputs, text: &str) -> Result<(), String> {
    let write = || -> anyhow::Result<()> {
        let mut output = Output::create(path, inputs)?;
        settle(output.write_all(text.as_bytes()), path)?;
        output.finish()
    };
    write().map_err(|error| format!("{error:#}"))
}

/// What an earlier replacement has kept.
fn kept(dir: &Path, number: u32, name: &str) -> String {
    let path = dir.join("hums-kept").join(number.to_string()).join(name);
    fs::read_to_string(path).expect("it is kept")
}

#[test]
fn a_file_is_the_old_one_until_the_new_one_is_whole_and_then_it_is_kept() {
    let dir = furnished();
    let path = dir.path().join("old");
    let replacing = Inputs::none().replacing(true);
    let mut output = Output::create(&path, &replacing).expect("created");
    output.write_all(&vec![b'x'; 100_000]).expect("written");
    assert_eq!(fs::read(&path).expect("there"), b"what was there");
    drop(output);
    assert_eq!(names(dir.path()), ["old"], "what was dropped before its end leaves nothing");
    assert_eq!(fs::read(&path).expect("there"), b"what was there");
    // The same, and more of the same: nothing is lost, and nothing is kept.
    for text in ["what was there", "what was there, and more"] {
        write(&path, &replacing, text).expect("whole");
        assert_eq!(
            (names(dir.path()), fs::read_to_string(&path).expect("there")),
            (vec!["old".into()], text.into())
        );
    }
    for (number, text) in [(1, "new"), (2, "newer"), (3, "what was there")] {
        let before = fs::read_to_string(&path).expect("there");
        write(&path, &replacing, if number == 2 { "ne" } else { text }).expect("whole");
        assert_eq!(
            (names(dir.path()), kept(dir.path(), number, "old")),
            (vec!["hums-kept".into(), "old".into()], before)
        );
    }
    // What is put there while it is written, too, and what lies under the kept name already stays.
    let (new, mine) = (dir.path().join("new"), dir.path().join("hums-kept/3/new"));
    fs::write(&mine, "mine").expect("written");
    let mut output = Output::create(&new, &replacing).expect("created");
    output.write_all(b"ours").expect("written");
    fs::write(&new, "theirs").expect("written");
    output.finish().expect("whole");
    assert_eq!(fs::read(&mine).expect("there"), b"mine");
    assert_eq!(
        (kept(dir.path(), 4, "new"), fs::read(&new).expect("there")),
        ("theirs".into(), b"ours".to_vec())
    );
}

#[test]
fn what_is_replaced_is_kept_under_the_next_number_where_one_is_no_folder() {
    let dir = furnished();
    let path = dir.path().join("old");
    let folder = dir.path().join("hums-kept");
    fs::create_dir(&folder).expect("made");
    fs::write(folder.join("1"), "a file").expect("written");
    set_aside(&path, &path).expect("kept");
    assert_eq!(kept(dir.path(), 2, "old"), "what was there");
    assert_eq!(fs::read(folder.join("1")).expect("there"), b"a file");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("elsewhere", folder.join("3")).expect("a link");
        fs::write(&path, "newer").expect("written");
        set_aside(&path, &path).expect("kept");
        assert_eq!(kept(dir.path(), 4, "old"), "newer");
        assert!(!dir.path().join("elsewhere").exists());
    }
    // No number is left.
    fs::write(folder.join(u64::MAX.to_string()), "a file").expect("written");
    fs::write(&path, "newest").expect("written");
    let refused = set_aside(&path, &path).expect_err("there is no place").to_string();
    assert!(refused.contains("hums-kept: no number is left in it; move it away"), "{refused}");
    assert_eq!(fs::read(&path).expect("there"), b"newest");
}

#[test]
fn a_replacement_that_fails_or_is_killed_loses_nothing() {
    let dir = furnished();
    let (path, part) = (dir.path().join("old"), dir.path().join("part"));
    replace(&part, &path).expect_err("there is no part");
    assert_eq!(
        (names(dir.path()), fs::read(&path).expect("there")),
        (vec!["old".into()], b"what was there".to_vec())
    );
    // Where nothing can be kept, nothing is replaced.
    fs::write(dir.path().join("hums-kept"), "a file").expect("written");
    let refused =
        write(&path, &Inputs::none().replacing(true), "new").expect_err("there is no place for the old one");
    assert!(
        refused.contains("hums-kept, and that is a file; nothing was replaced: move it away"),
        "{refused}"
    );
    assert_eq!(names(dir.path()), ["hums-kept", "old"]);
    assert_eq!(fs::read(&path).expect("there"), b"what was there");
    fs::remove_file(dir.path().join("hums-kept")).expect("removed");
    // Killed between the two renames.
    set_aside(&path, &path).expect("kept");
    write(&path, &Inputs::none(), "new").expect("whole");
    assert_eq!(
        (kept(dir.path(), 1, "old"), fs::read(&path).expect("there")),
        ("what was there".into(), b"new".to_vec())
    );
}

#[test]
fn a_file_with_other_content_is_replaced_only_where_the_user_says_so() {
    let dir = furnished();
    let path = dir.path().join("old");
    write(&path, &Inputs::none(), "what was there").expect("the same");
    for other in ["what", "what was there, and more", "What was there"] {
        let refused = write(&path, &Inputs::none(), other).expect_err(other);
        assert!(refused.contains("is there already with other content") && refused.contains("--replace"));
    }
    let mut output = create(&path).expect("compared");
    let early =
        output.write_all(&vec![b'x'; 100_000]).expect_err("at the first difference, and not at the end");
    assert!(early.to_string().contains("is there already with other content"), "{early}");
    drop(output);
    assert_eq!(
        (names(dir.path()), fs::read(&path).expect("there")),
        (vec!["old".into()], b"what was there".to_vec())
    );
    // An empty file is none.
    fs::write(dir.path().join("empty"), "").expect("written");
    write(&dir.path().join("empty"), &Inputs::none(), "new").expect("whole");
    // An input that the command makes again is not replaced, whatever the flags.
    fs::write(&path, "text").expect("written");
    let mut inputs = Inputs::of([&path]).replacing(true);
    inputs.compare_only(&path);
    write(&path, &inputs, "text").expect("the same");
    write(&path, &inputs, "another").expect_err("it is an input");
    assert_eq!(
        (names(dir.path()), fs::read(&path).expect("there")),
        (vec!["empty".into(), "old".into()], b"text".to_vec())
    );
}

#[test]
fn what_somebody_else_puts_there_while_a_file_is_written_stays() {
    let dir = furnished();
    let path = dir.path().join("new");
    for theirs in ["theirs", "ours", ""] {
        let _ = fs::remove_file(&path);
        let mut output = create(&path).expect("created");
        output.write_all(b"ours").expect("written");
        fs::write(&path, theirs).expect("written");
        assert_eq!(output.finish().is_ok(), theirs == "ours", "{theirs:?}");
        drop(output);
        assert_eq!(fs::read_to_string(&path).expect("there"), theirs);
        assert_eq!(names(dir.path()), ["new", "old"]);
    }
}

#[test]
#[cfg(unix)]
fn what_has_the_name_of_a_part_stays_and_is_in_nobodys_way_and_two_runs_do_not_mix() {
    let dir = furnished();
    let path = dir.path().join("new");
    let left = dir.path().join(".new.hums-part");
    fs::write(&left, "left").expect("written");
    std::os::unix::fs::symlink("old", dir.path().join(".new.2.hums-part")).expect("a link");
    let mut first = create(&path).expect("created");
    assert_eq!(first.part(), dir.path().join(".new.3.hums-part"));
    let second = create(&path).expect_err("somebody writes it").to_string();
    assert!(second.contains("another run of hums is writing it"), "{second}");
    first.write_all(b"first").expect("written");
    first.finish().expect("whole");
    assert_eq!(fs::read(&path).expect("there"), b"first");
    assert_eq!(fs::read(&left).expect("there"), b"left");
    assert_eq!(fs::read(dir.path().join("old")).expect("there"), b"what was there");
    assert_eq!(names(dir.path()), [".new.2.hums-part", ".new.hums-part", "new", "old"]);
    // Nor is a folder of this name, whatever is in it.
    let (tables, left) = (dir.path().join("tables"), dir.path().join(".tables.hums-part"));
    made(&left, "left");
    made(&tables, "new");
    assert_eq!((table(&tables), table(&left)), ("new".to_owned(), "left".to_owned()));
}

#[test]
fn a_name_may_have_as_many_bytes_as_the_file_system_takes() {
    let dir = tempfile::tempdir().expect("a folder");
    let long = "n".repeat(255);
    let path = dir.path().join(&long);
    write(&path, &Inputs::none(), "whole").expect("a name of 255 bytes");
    fs::remove_file(&path).expect("there");
    made(&path, "tables");
    assert_eq!((names(dir.path()), table(&path)), (vec![long], "tables".to_owned()));
}

#[test]
fn what_comes_live_has_its_name_and_is_in_the_file_at_once() {
    let dir = furnished();
    let path = dir.path().join("tap");
    let mut inputs = Inputs::none();
    inputs.add_endpoint(&"tcp:127.0.0.1:9".parse().expect("an endpoint"));
    let mut tap = Output::create(&path, &inputs).expect("created");
    tap.write_all(b"came").expect("written");
    assert_eq!(fs::read(&path).expect("there"), b"came");
    let second = Output::create(&path, &inputs).map(|_| ()).expect_err("it is there");
    assert!(format!("{second:#}").contains("is there already"), "{second:#}");
    drop(tap);
    assert_eq!(
        (names(dir.path()), fs::read(&path).expect("there")),
        (vec!["old".into(), "tap".into()], b"came".to_vec())
    );
}

#[test]
fn what_was_begun_goes_on_and_can_begin_anew() {
    let dir = furnished();
    let path = dir.path().join("log");
    let (mut output, bytes) = Output::resume(&path).expect("created");
    assert_eq!(bytes, 0);
    output.write_all(b"one").expect("written");
    drop(output);
    let (mut output, bytes) = Output::resume(&path).expect("goes on");
    assert_eq!((bytes, fs::read(output.part()).expect("there")), (3, b"one".to_vec()));
    output.write_all(b"two").expect("written");
    output.finish().expect("whole");
    // Not every system renames over a file that is open.
    drop(output);
    assert_eq!(fs::read(&path).expect("there"), b"onetwo");
    let (mut output, bytes) = Output::resume(&path).expect("created");
    assert_eq!(bytes, 0);
    output.write_all(b"wrong").expect("written");
    output.begin_anew().expect("emptied");
    output.write_all(b"onetwothree").expect("written");
    output.finish().expect("whole");
    drop(output);
    assert_eq!(fs::read(&path).expect("there"), b"onetwothree", "what was there was its beginning");
    // What is of another log stays.
    let (mut output, _) = Output::resume(&path).expect("created");
    output.write_all(b"of another log").expect("written");
    drop(output);
    let (mut output, _) = Output::resume(&path).expect("goes on");
    output.set_aside().expect("begun anew");
    output.write_all(b"onetwothree").expect("written");
    assert_eq!(kept(dir.path(), 1, "log"), "of another log");
    output.finish().expect("whole");
    drop(output);
    assert_eq!(kept(dir.path(), 1, "log"), "of another log");
    fs::remove_dir_all(dir.path().join("hums-kept")).expect("there");
    let (mut output, _) = Output::resume(&path).expect("created");
    output.write_all(b"another, and longer").expect("written");
    output.finish().expect_err("what is there is no beginning of it");
    drop(output);
    assert_eq!(names(dir.path()), [".log.pull.hums-part", "log", "old"]);
    assert_eq!(fs::read(&path).expect("there"), b"onetwothree");
    // Another command that writes a file of this name leaves what was begun alone.
    fs::remove_file(&path).expect("removed");
    let mut other = create(&path).expect("created");
    other.write_all(b"other").expect("written");
    other.finish().expect("whole");
    assert_eq!(names(dir.path()), [".log.pull.hums-part", "log", "old"]);
}

#[test]
#[cfg(unix)]
fn a_link_stays_a_link_and_permissions_stay_and_what_it_leads_to_is_kept_where_it_lay() {
    use std::os::unix::fs::{PermissionsExt as _, symlink};
    let dir = furnished();
    let old = dir.path().join("old");
    fs::set_permissions(&old, fs::Permissions::from_mode(0o640)).expect("set");
    let link = dir.path().join("folder/link");
    fs::create_dir(dir.path().join("folder")).expect("made");
    symlink("../old", &link).expect("a link");
    write(&link, &Inputs::none(), "new").expect_err("a link to what is there");
    write(&link, &Inputs::none().replacing(true), "new").expect("whole");
    assert!(link.is_symlink());
    assert_eq!(
        (names(dir.path()), names(&dir.path().join("folder"))),
        (vec!["folder".into(), "hums-kept".into(), "old".into()], vec!["link".into()])
    );
    assert_eq!(
        (kept(dir.path(), 1, "old"), fs::read(&old).expect("there")),
        ("what was there".into(), b"new".to_vec())
    );
    assert_eq!(fs::metadata(&old).expect("there").permissions().mode() & 0o777, 0o640);
}

#[test]
#[cfg(unix)]
fn an_output_that_is_an_input_is_refused_in_every_spelling() {
    use std::os::unix::fs::symlink;
    let dir = furnished();
    let at = |name: &str| dir.path().join(name);
    symlink("old", at("link")).expect("a link");
    symlink("link", at("link of a link")).expect("a link");
    fs::hard_link(at("old"), at("hard")).expect("a link");
    fs::create_dir(at("folder")).expect("made");
    symlink("nothing yet", at("dangling")).expect("a link");
    let inputs = Inputs::of([at("link"), at("nothing yet")]);
    for name in ["old", "link", "link of a link", "hard", "./old", "folder/../old", "dangling", "nothing yet"]
    {
        let refused = Output::create(&at(name), &inputs).expect_err(name).to_string();
        assert!(refused.contains("is an input of this command"), "{name}: {refused}");
    }
    assert_eq!(fs::read(at("old")).expect("there"), b"what was there");
}

#[test]
#[cfg(unix)]
fn what_is_no_regular_file_is_written_as_it_is() {
    let mut output = create(Path::new("/dev/null")).expect("opened");
    output.write_all(b"gone").expect("written");
    output.finish().expect("whole");
    assert!(!Path::new("/dev/null").is_file());
    let dir = create(Path::new("/")).expect_err("a directory").to_string();
    assert!(dir.contains("is a directory"), "{dir}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_file_that_is_spelled_through_proc_is_a_file_and_a_descriptor_is_written_as_it_is() {
    use std::os::fd::AsRawFd as _;
    let dir = furnished();
    let old = dir.path().join("old");
    let pid = std::process::id();
    let inner = old.strip_prefix("/").expect("absolute").to_str().expect("a name");
    let spellings =
        ["/proc/self/root", "/proc/thread-self/root", "/dev/fd/../root", &format!("/proc/{pid}/root")]
            .map(|root| Path::new(root).join(inner));
    for path in spellings {
        let refused = write(&path, &Inputs::none(), "new").expect_err("it has another content");
        assert!(refused.contains("is there already with other content"), "{}: {refused}", path.display());
        assert_eq!(fs::read(&old).expect("there"), b"what was there", "{}", path.display());
        write(&path, &Inputs::none().replacing(true), "what was there").expect("the same");
    }
    // What is open is written where nothing is in it.
    let open = fs::File::options().append(true).open(&old).expect("opened");
    let (number, link) = (open.as_raw_fd(), dir.path().join("link"));
    std::os::unix::fs::symlink(format!("/dev/fd/{number}"), &link).expect("a link");
    let paths = ["/dev/fd", "/proc/self/fd", "/proc/thread-self/fd"];
    for path in paths.map(|folder| Path::new(folder).join(number.to_string())).iter().chain([&link]) {
        let refused = write(path, &Inputs::none(), "+").expect_err("something is in it");
        assert!(refused.contains("has something in it, behind which nothing is made"), "{refused}");
        let there = fs::read(&old).expect("there");
        open.set_len(0).expect("emptied");
        write(path, &Inputs::none(), "+").expect("written");
        assert_eq!((there.is_empty(), fs::read(&old).expect("there")), (false, b"+".to_vec()));
    }
}

/// Its name may be another file's by now: what lies there is none of the output.
#[test]
#[cfg(target_os = "linux")]
fn what_another_process_has_open_is_written_only_where_it_has_the_name_that_its_link_says() {
    use std::process::{Command, Stdio};
    let dir = furnished();
    let (old, opened) = (dir.path().join("old"), dir.path().join("opened"));
    fs::write(&opened, "").expect("written");
    let open = fs::File::open(&opened).expect("opened");
    let mut waits = Command::new("sleep");
    let mut other = waits.arg("60").stdin(Stdio::from(open)).spawn().expect("started");
    let path = Path::new("/proc").join(other.id().to_string()).join("fd/0");
    std::os::unix::fs::symlink(&path, dir.path().join("link")).expect("a link");
    let inputs = Inputs::of([&old]).replacing(true);
    write(&path, &inputs, "new").expect("it is the file of that name");
    // The one that is open was replaced; then there is another one with the name that the link gives, and then an input.
    let deleted = fs::read_link(&path).expect("a link");
    for at in [None, Some(&old)] {
        at.map_or(Ok(()), |at| fs::hard_link(at, &deleted)).expect("a link");
        for path in [&path, &dir.path().join("link")] {
            let refused = write(path, &inputs, "newer").expect_err("the name is another file's");
            assert!(refused.contains("it was deleted, or is another process's"), "{refused}");
            assert_eq!(fs::read(&old).expect("there"), b"what was there");
        }
    }
    other.kill().and_then(|()| other.wait()).expect("ended");
}

/// A folder with one table of this text.
fn make(path: &Path, inputs: &Inputs, text: &str) -> Result<(), String> {
    let make = || -> anyhow::Result<()> {
        let folder = Folder::create(path, inputs, "of a recording")?;
        settle(folder.file("T.csv")?.write_all(text.as_bytes()), path)?;
        folder.finish()
    };
    make().map_err(|error| format!("{error:#}"))
}

fn made(path: &Path, text: &str) {
    make(path, &Inputs::none(), text).expect("made");
}

fn table(path: &Path) -> String {
    fs::read_to_string(path.join("T.csv")).expect("a table")
}

#[test]
fn a_folder_with_other_tables_is_replaced_only_where_the_user_says_so_and_kept_with_all_that_is_in_it() {
    let dir = furnished();
    let path = dir.path().join("session");
    let replacing = Inputs::none().replacing(true);
    made(&path, "first");
    made(&path, "first");
    let before = fs::read(path.join(".hums")).expect("a stamp");
    for other in ["firs", "first, and more", "First"] {
        let refused = make(&path, &Inputs::none(), other).expect_err(other);
        assert!(refused.contains("is there already with other content"), "{refused}");
    }
    // One table more than there is, and one less.
    let more = Folder::create(&path, &Inputs::none(), "of a recording").expect("compared");
    assert!(more.file("U.csv").is_err());
    let less = Folder::create(&path, &Inputs::none(), "of a recording").expect("compared");
    assert!(less.finish().is_err());
    let dropped = Folder::create(&path, &replacing, "of a recording").expect("begun");
    dropped.file("T.csv").expect("a file").write_all(b"half").expect("written");
    drop(dropped);
    make(&path, &replacing, "first").expect("the same");
    assert_eq!((table(&path), names(dir.path())), ("first".to_owned(), vec!["old".into(), "session".into()]));
    assert_eq!(fs::read(path.join(".hums")).expect("a stamp"), before);
    // What the user has put there is no table of ours: the folder is the same, and is kept with it.
    fs::write(path.join("mine.csv"), "mine").expect("written");
    made(&path, "first");
    for (number, text) in [(1, "second"), (2, "third")] {
        let was = table(&path);
        make(&path, &replacing, text).expect("replaced");
        assert_eq!(
            (table(&path), names(dir.path())),
            (text.to_owned(), vec!["hums-kept".into(), "old".into(), "session".into()])
        );
        assert_eq!(kept(dir.path(), number, "session/T.csv"), was);
    }
    assert_eq!(kept(dir.path(), 1, "session/mine.csv"), "mine");
    assert_eq!(names(&path), [".hums", "T.csv"]);
    fs::create_dir(dir.path().join("mine")).expect("made");
    made(&dir.path().join("mine"), "an empty folder is free");
    // A table that was changed is another one; a stamp that names nothing, or is cut off, too.
    for changed in ["T.csv", ".hums"] {
        fs::File::options()
            .append(true)
            .open(path.join(changed))
            .and_then(|mut file| file.write_all(b"mine"))
            .expect("written");
        make(&path, &Inputs::none(), "third").expect_err(changed);
        make(&path, &replacing, "third").expect("replaced");
        assert_eq!(names(&path), [".hums", "T.csv"]);
    }
    assert!(
        kept(dir.path(), 3, "session/T.csv").ends_with("mine")
            && kept(dir.path(), 4, "session/.hums").ends_with("mine")
    );
    fs::remove_file(path.join(".hums")).expect("removed");
    let refused = make(&path, &replacing, "second").expect_err("nobody knows whose it is");
    assert!(refused.contains("was not made by this command"), "{refused}");
    assert_eq!(table(&path), "third");
}

#[test]
fn what_somebody_else_puts_into_a_part_or_at_a_folders_place_stays() {
    let dir = furnished();
    let path = dir.path().join("session");
    let begun = Folder::create(&path, &Inputs::none(), "of a recording").expect("begun");
    begun.file("T.csv").expect("a file").write_all(b"half").expect("written");
    fs::write(dir.path().join(".session.hums-part/mine.csv"), "mine").expect("written");
    drop(begun);
    assert_eq!(names(&dir.path().join(".session.hums-part")), ["mine.csv"]);
    fs::remove_dir_all(dir.path().join(".session.hums-part")).expect("removed");
    // Without a word of the user's, and with one.
    for replaces in [false, true] {
        let begun =
            Folder::create(&path, &Inputs::none().replacing(replaces), "of a recording").expect("begun");
        fs::create_dir(&path).expect("made");
        fs::write(path.join("theirs"), "theirs").expect("written");
        assert_eq!(begun.finish().is_ok(), replaces);
        let there = if replaces { dir.path().join("hums-kept/1/session") } else { path.clone() };
        assert_eq!(fs::read(there.join("theirs")).expect("there"), b"theirs");
        fs::remove_dir_all(&path).expect("removed");
    }
    assert_eq!(names(dir.path()), ["hums-kept", "old"]);
}

#[test]
fn two_runs_do_not_write_one_folder() {
    let dir = furnished();
    let path = dir.path().join("session");
    let first = Folder::create(&path, &Inputs::none(), "one").expect("begun");
    let second = Folder::create(&path, &Inputs::none(), "one").expect_err("somebody writes it").to_string();
    assert!(second.contains("another run of hums is writing it"), "{second}");
    first.finish().expect("whole");
}

#[test]
fn of_many_runs_that_begin_at_once_each_gets_its_turn_or_is_told_of_another_one() {
    let dir = furnished();
    let (file, folder) = (dir.path().join("new"), dir.path().join("session"));
    let begin = || -> [Option<String>; 2] {
        let output = create(&file).map(drop);
        let tables = Folder::create(&folder, &Inputs::none(), "one").map(drop);
        [output, tables].map(|begun| begun.err().map(|error| format!("{error:#}")))
    };
    let told: Vec<String> = std::thread::scope(|scope| {
        let run = || (0..50).flat_map(|_| begin()).flatten().collect::<Vec<_>>();
        let runs: Vec<_> = (0..4).map(|_| scope.spawn(run)).collect();
        runs.into_iter().flat_map(|run| run.join().expect("no panic")).collect()
    });
    for told in told {
        assert!(told.contains("another run of hums is writing it"), "{told}");
    }
    // Windows does not remove a part while another run looks whether it is locked: that one stays.
    let names = names(dir.path()).into_iter().filter(|name| cfg!(unix) || !name.ends_with(".hums-part"));
    assert_eq!(names.collect::<Vec<_>>(), ["old"]);
}
