//! The rules of the module, by files of a folder that only a test has.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use super::{Folder, Inputs, Output};
use crate::endpoint::Endpoint;

fn names(dir: &Path) -> Vec<String> {
    let names = fs::read_dir(dir).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

fn words<T: std::fmt::Debug>(result: anyhow::Result<T>) -> String {
    format!("{:#}", result.expect_err("an error"))
}

fn write(path: &Path, inputs: &Inputs, bytes: &[u8]) -> anyhow::Result<()> {
    let mut output = Output::create(path, inputs)?;
    output.write_all(bytes)?;
    output.finish()
}

#[test]
fn an_output_that_is_an_input_by_any_name_is_refused_also_with_force() {
    let dir = tempfile::tempdir().expect("a folder");
    let [input, link, hard] = ["in", "link", "hard"].map(|name| dir.path().join(name));
    fs::write(&input, "mine").expect("written");
    #[cfg(unix)]
    std::os::unix::fs::symlink("in", &link).expect("a link");
    fs::hard_link(&input, &hard).expect("a link");
    let inputs = Inputs::of([&input]).forcing(true);
    let spelled = dir.path().join("./in");
    for path in [&input, &hard, &spelled].into_iter().chain(cfg!(unix).then_some(&link)) {
        assert!(words(Output::create(path, &inputs)).contains("is an input of this command"));
    }
    assert_eq!(fs::read(&input).expect("there"), b"mine");
}

#[test]
fn an_output_has_its_name_when_it_is_whole_and_leaves_nothing_when_it_is_not() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("out");
    let mut output = Output::create(&path, &Inputs::none()).expect("begun");
    output.write_all(b"half").expect("written");
    assert!(!path.exists());
    drop(output);
    assert_eq!(names(dir.path()), Vec::<String>::new());
    write(&path, &Inputs::none(), b"whole").expect("written");
    assert_eq!(
        (fs::read(&path).expect("there"), names(dir.path())),
        (b"whole".to_vec(), vec!["out".to_owned()])
    );
}

#[test]
fn a_file_that_exists_is_overwritten_with_force_only() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("out");
    fs::write(&path, "old").expect("written");
    assert!(!words(write(&path, &Inputs::none(), b"new")).contains("--force"), "it has no such flag");
    assert!(words(write(&path, &Inputs::none().forcing(false), b"new")).contains("or say --force"));
    assert_eq!(fs::read(&path).expect("there"), b"old");
    write(&path, &Inputs::none().forcing(true), b"new").expect("written");
    assert_eq!(fs::read(&path).expect("there"), b"new");
    // Somebody puts a file there meanwhile.
    let late = dir.path().join("late");
    let mut output = Output::create(&late, &Inputs::none()).expect("begun");
    fs::write(&late, "mine").expect("written");
    assert!(words(output.finish()).contains("exists"));
    assert_eq!((fs::read(&late).expect("there"), names(dir.path()).len()), (b"mine".to_vec(), 2));
}

#[test]
fn an_output_of_a_live_source_has_its_name_and_its_bytes_at_once() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("out");
    let mut inputs = Inputs::none();
    inputs.add_endpoint(&"udpin:127.0.0.1:1".parse::<Endpoint>().expect("an endpoint"));
    let mut output = Output::create(&path, &inputs).expect("begun");
    output.write_all(b"so far").expect("written");
    assert_eq!(fs::read(&path).expect("there"), b"so far");
}

#[cfg(unix)]
#[test]
fn a_link_stays_a_link_and_a_folder_or_a_missing_one_is_told() {
    let dir = tempfile::tempdir().expect("a folder");
    let (link, file) = (dir.path().join("link"), dir.path().join("file"));
    std::os::unix::fs::symlink("file", &link).expect("a link");
    fs::write(&file, "old").expect("written");
    write(&link, &Inputs::none().forcing(true), b"bytes").expect("written");
    assert!(link.is_symlink() && fs::read(&file).expect("there") == b"bytes");
    assert!(words(write(dir.path(), &Inputs::none(), b"")).contains("is a directory"));
    assert!(words(write(&dir.path().join("no/out"), &Inputs::none(), b"")).contains("there is no folder"));
}

#[test]
fn what_was_begun_is_gone_on_with() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("log");
    let mut output = Output::resume(&path).expect("begun");
    output.write_all(b"ab").expect("written");
    assert!(words(Output::resume(&path)).contains("another run of hums is using it"));
    drop(output);
    let mut output = Output::resume(&path).expect("it is there");
    assert_eq!(fs::read(output.part()).expect("there"), b"ab");
    output.write_all(b"c").expect("written");
    output.finish().expect("whole");
    assert_eq!((fs::read(&path).expect("there"), names(dir.path()).len()), (b"abc".to_vec(), 1));
    drop(Output::resume(&dir.path().join("empty")).expect("begun"));
    assert_eq!(names(dir.path()), ["log"]);
}

fn tables(path: &Path, session: &str, force: bool, name: &str) -> anyhow::Result<()> {
    let folder = Folder::create(path, &Inputs::none().forcing(force), session)?;
    folder.file(name)?.write_all(b"rows")?;
    folder.finish()
}

#[test]
fn a_folder_is_replaced_as_a_whole_with_force_and_by_its_own_session_only() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("tables");
    drop(Folder::create(&path, &Inputs::none(), "s1").expect("begun"));
    assert_eq!(names(dir.path()), Vec::<String>::new());
    tables(&path, "s1", false, "a.csv").expect("made");
    assert_eq!(names(&path), [".hums", "a.csv"]);
    assert!(words(tables(&path, "s1", false, "b.csv")).contains("or say --force"));
    assert!(words(tables(&path, "s2", true, "b.csv")).contains("holds the files of another session, s1"));
    tables(&path, "s1", true, "b.csv").expect("made");
    assert_eq!(names(&path), [".hums", "b.csv"]);
    fs::write(path.join("notes"), "mine").expect("written");
    assert!(words(tables(&path, "s1", true, "c.csv")).contains("notes: was not made by this command"));
    assert_eq!(
        (names(&path), names(dir.path()).len()),
        (vec![".hums".into(), "b.csv".into(), "notes".into()], 1)
    );
    let other = dir.path().join("other");
    fs::create_dir(&other).expect("made");
    tables(&other, "s1", false, "a.csv").expect("an empty one is free");
    fs::remove_file(other.join(".hums")).expect("ours");
    assert!(words(tables(&other, "s1", true, "a.csv")).contains("was not made by this command"));
}

#[test]
fn a_stamp_that_names_files_elsewhere_removes_none() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("tables");
    tables(&path, "s1", false, "a.csv").expect("made");
    fs::write(dir.path().join("mine"), "mine").expect("written");
    fs::write(path.join(".hums"), "s1\nfiles 1\n../mine\n").expect("written");
    assert!(words(tables(&path, "s1", true, "a.csv")).contains("a.csv: was not made by this command"));
    assert!(dir.path().join("mine").exists());
}
