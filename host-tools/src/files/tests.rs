use std::fs;
use std::io::Write as _;
use std::path::Path;

use super::folder::{old_of, put_in_place};
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

#[test]
fn a_file_is_the_old_one_until_the_new_one_is_whole() {
    let dir = furnished();
    let path = dir.path().join("old");
    let mut output = Output::create(&path, &Inputs::none()).expect("created");
    output.write_all(&vec![b'x'; 100_000]).expect("written");
    assert_eq!(fs::read(&path).expect("there"), b"what was there");
    drop(output);
    assert_eq!(names(dir.path()), ["old"], "what was dropped before its end leaves nothing");
    assert_eq!(fs::read(&path).expect("there"), b"what was there");
    let mut output = Output::create(&path, &Inputs::none()).expect("created");
    output.write_all(b"new").expect("written");
    output.finish().expect("whole");
    assert_eq!(
        (names(dir.path()), fs::read(&path).expect("there")),
        (vec!["old".to_owned()], b"new".to_vec())
    );
}

#[test]
fn what_a_killed_run_has_left_is_in_nobodys_way_and_two_runs_do_not_mix() {
    let dir = furnished();
    let path = dir.path().join("new");
    fs::write(dir.path().join(".new.hums-part"), [b'x'; 1000]).expect("written");
    let mut first = Output::create(&path, &Inputs::none()).expect("created");
    let second = Output::create(&path, &Inputs::none()).expect_err("somebody writes it").to_string();
    assert!(second.contains("another run of hums is writing it"), "{second}");
    first.write_all(b"first").expect("written");
    first.finish().expect("whole");
    assert_eq!(fs::read(&path).expect("there"), b"first");
    assert_eq!(names(dir.path()), ["new", "old"]);
}

#[test]
fn what_was_begun_goes_on_and_can_begin_anew() {
    let dir = furnished();
    let path = dir.path().join("log");
    let (mut output, bytes) = Output::resume(&path, &Inputs::none()).expect("created");
    assert_eq!(bytes, 0);
    output.write_all(b"one").expect("written");
    drop(output);
    let (mut output, bytes) = Output::resume(&path, &Inputs::none()).expect("goes on");
    assert_eq!((bytes, fs::read(output.part()).expect("there")), (3, b"one".to_vec()));
    output.write_all(b"two").expect("written");
    output.finish().expect("whole");
    assert_eq!(fs::read(&path).expect("there"), b"onetwo");
    let (mut output, bytes) = Output::resume(&path, &Inputs::none()).expect("created");
    assert_eq!(bytes, 0);
    output.write_all(b"wrong").expect("written");
    output.begin_anew().expect("emptied");
    output.write_all(b"right").expect("written");
    output.finish().expect("whole");
    assert_eq!(fs::read(&path).expect("there"), b"right");
}

#[test]
#[cfg(unix)]
fn a_link_stays_a_link_and_permissions_stay() {
    use std::os::unix::fs::{PermissionsExt as _, symlink};
    let dir = furnished();
    let old = dir.path().join("old");
    fs::set_permissions(&old, fs::Permissions::from_mode(0o640)).expect("set");
    symlink("old", dir.path().join("link")).expect("a link");
    let mut output = Output::create(&dir.path().join("link"), &Inputs::none()).expect("created");
    output.write_all(b"new").expect("written");
    output.finish().expect("whole");
    assert!(dir.path().join("link").is_symlink());
    assert_eq!(fs::read(&old).expect("there"), b"new");
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
    let folder = Inputs::of([dir.path()]);
    let refused = Output::create(&at("hard"), &folder).expect_err("in the folder").to_string();
    assert!(refused.contains("lies in the input folder"), "{refused}");
    Output::create(&at("new"), &folder).expect("nothing is replaced");
    assert_eq!(fs::read(at("old")).expect("there"), b"what was there");
}

#[test]
#[cfg(unix)]
fn what_is_no_regular_file_is_written_as_it_is() {
    let mut output = Output::create(Path::new("/dev/null"), &Inputs::none()).expect("opened");
    output.write_all(b"gone").expect("written");
    output.finish().expect("whole");
    assert!(!Path::new("/dev/null").is_file());
    let dir = Output::create(Path::new("/"), &Inputs::none()).expect_err("a directory").to_string();
    assert!(dir.contains("is a directory"), "{dir}");
}

/// A folder with one table of this text.
fn made(path: &Path, stamp: &str, text: &str) {
    let folder = Folder::create(path, &Inputs::none(), stamp).expect("begun");
    folder.file("T.csv").expect("a file").write_all(text.as_bytes()).expect("written");
    folder.finish().expect("whole");
}

fn table(path: &Path) -> String {
    fs::read_to_string(path.join("T.csv")).expect("a table")
}

#[test]
fn a_folder_replaces_its_own_and_nothing_else() {
    let dir = furnished();
    let path = dir.path().join("session");
    made(&path, "one", "first");
    let dropped = Folder::create(&path, &Inputs::none(), "one").expect("begun");
    dropped.file("T.csv").expect("a file").write_all(b"half").expect("written");
    drop(dropped);
    assert_eq!((table(&path), names(dir.path())), ("first".to_owned(), vec!["old".into(), "session".into()]));
    made(&path, "one", "second");
    assert_eq!(
        (table(&path), names(dir.path())),
        ("second".to_owned(), vec!["old".into(), "session".into()])
    );
    let refused = Folder::create(&path, &Inputs::none(), "two").expect_err("another's").to_string();
    assert!(refused.contains("another recording"), "{refused}");
    fs::create_dir(dir.path().join("mine")).expect("made");
    made(&dir.path().join("mine"), "one", "an empty folder is free");
    fs::create_dir(path.join("inner")).expect("made");
    let refused = Folder::create(&path, &Inputs::none(), "one").expect_err("has more").to_string();
    assert!(refused.contains("inner, which hums did not make"), "{refused}");
    assert!(Folder::remove(&path).is_err() && path.join("inner").exists());
    assert!(Folder::remove(dir.path()).is_err() && dir.path().join("old").exists());
    Folder::remove(&dir.path().join("mine")).expect("removed");
    assert_eq!(table(&path), "second");
}

#[test]
fn where_folders_cannot_be_swapped_two_renames_do_and_a_kill_between_them_loses_nothing() {
    let dir = furnished();
    let (path, other) = (dir.path().join("session"), dir.path().join("other"));
    made(&path, "one", "old");
    made(&other, "one", "new");
    put_in_place(&other, &path, |_, _| false).expect("renamed");
    assert_eq!((table(&path), names(dir.path())), ("new".to_owned(), vec!["old".into(), "session".into()]));
    // Killed after the first rename.
    fs::rename(&path, old_of(&path)).expect("renamed");
    drop(Folder::create(&path, &Inputs::none(), "one").expect("begun"));
    assert_eq!((table(&path), names(dir.path())), ("new".to_owned(), vec!["old".into(), "session".into()]));
    // Killed before the old one was removed.
    made(&old_of(&path), "one", "old");
    drop(Folder::create(&path, &Inputs::none(), "one").expect("begun"));
    assert_eq!((table(&path), names(dir.path())), ("new".to_owned(), vec!["old".into(), "session".into()]));
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
