//! Folders with other entries than logs: links, pipes, sockets, names of the same file.

use std::ffi::OsString;
use std::fs;
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use hums_tests::child;
use hums_tests::flights;
use hums_tests::hostile;
use hums_tests::not_tested;
use hums_tests::program::{LIMIT, command, hums};
use serde_json::Value;

/// Longer than reading a handful of files on a busy machine.
const SOON: Duration = Duration::from_secs(20);

fn names(outcome: &child::Outcome) -> Vec<String> {
    let json: Value = serde_json::from_str(&outcome.text()).unwrap();
    let logs = json["logs"].as_array().unwrap();
    logs.iter().map(|log| log["name"].as_str().unwrap().to_owned()).collect()
}

fn info(path: &Path) -> child::Outcome {
    child::run(&mut command(["info".as_ref(), "--json".as_ref(), path.as_os_str()]), SOON)
}

#[test]
fn a_loop_of_links_ends_at_once_and_a_log_is_listed_once() {
    let dir = tempfile::tempdir().unwrap();
    let log = hostile::heartbeats(dir.path(), 100);
    for name in ["a", "b", "c"] {
        symlink(".", dir.path().join(name)).unwrap();
    }
    symlink(&log, dir.path().join("link.hum")).unwrap();
    fs::hard_link(&log, dir.path().join("twin.hum")).unwrap();
    let outcome = info(dir.path()).expect_code(&[0]);
    assert_eq!(names(&outcome), ["heartbeats"]);
    for said in ["link.hum: is the same file", "twin.hum: is the same file"] {
        assert!(outcome.stderr.contains(said), "{said}: {}", outcome.stderr);
    }
    let twice = ["info".as_ref(), "--json".as_ref(), log.as_os_str(), dir.path().as_os_str()];
    assert_eq!(names(&hums(twice).expect_code(&[0])).len(), 1);
}

fn readers(path: &Path, out: &Path) -> Vec<Vec<OsString>> {
    let words = |words: &[&str]| words.iter().map(OsString::from).collect::<Vec<_>>();
    let (page, tables) = (out.join("page.html").into_os_string(), out.join("csv").into_os_string());
    let input = path.as_os_str().to_owned();
    vec![
        [words(&["info"]), vec![input.clone()]].concat(),
        [words(&["check"]), vec![input.clone()]].concat(),
        [words(&["report", "-o"]), vec![page, input.clone()]].concat(),
        [words(&["decode", "--format", "csv", "-o"]), vec![tables, input.clone()]].concat(),
        // The default one may be another program's.
        [words(&["live", "--listen", "127.0.0.1:0"]), vec![input]].concat(),
    ]
}

#[test]
fn a_pipe_or_a_device_that_is_named_is_refused_by_each_command_with_the_way_out() {
    let dir = tempfile::tempdir().unwrap();
    let pipe = dir.path().join("pipe.bin");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for input in [pipe.as_path(), Path::new("/dev/zero")] {
        for words in readers(input, dir.path()) {
            let outcome = child::run(&mut command(&words), SOON).expect_clear_failure();
            assert!(outcome.stderr.contains("copy it into a file first"), "{words:?}: {}", outcome.stderr);
        }
    }
}

/// A device may have no end, or do something when it is opened.
#[test]
fn pipes_sockets_and_devices_beside_recordings_are_passed_over_by_each_command_and_said() {
    let (dir, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let path = |name: &str| dir.path().join(name);
    hostile::heartbeats(dir.path(), 100);
    fs::copy(flights::own("ap_quad_guided.tlog"), path("flight.tlog")).unwrap();
    assert!(Command::new("mkfifo").arg(path("pipe.bin")).status().unwrap().success());
    let _listener = UnixListener::bind(path("socket.hum")).unwrap();
    symlink("/dev/zero", path("link.bin")).unwrap();
    let made = Command::new("mknod").arg(path("device.bin")).args(["c", "1", "5"]).output();
    let is_made = made.is_ok_and(|made| made.status.success());
    let others = ["pipe.bin", "socket.hum", "link.bin", "device.bin"];
    let others = &others[..3 + usize::from(is_made)];
    assert_eq!(names(&info(dir.path()).expect_code(&[0])), ["heartbeats", "flight.tlog"]);
    // `live` would keep running.
    for words in readers(dir.path(), out.path()).into_iter().filter(|words| words[0] != "live") {
        let outcome = child::run(&mut command(&words), LIMIT).expect_code(&[0, 4]);
        for other in others {
            let said = format!("{other}: is a pipe, a socket or a device");
            assert!(outcome.stderr.contains(&said), "{words:?}, {said}: {}", outcome.stderr);
        }
    }
    // Without permission to make one, this folder's device serves.
    if !is_made && Path::new("/dev/pts/ptmx").exists() {
        let outcome = info(Path::new("/dev/pts")).expect_code(&[1]);
        assert!(outcome.stderr.contains("ptmx: is a pipe, a socket or a device"), "{}", outcome.stderr);
    } else if !is_made {
        not_tested("a device in a folder (none can be made here, and /dev/pts has none)");
    }
}
