//! The files after a kill or on a full disk.

use std::fs;
use std::io::Write as _;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::support::{
    all_named, attempt, contents, frames_of, furnished, json, named, px4, run, stderr, until,
};

fn parts(dir: &Path) -> Vec<String> {
    contents(dir).into_iter().map(|(name, _)| name).filter(|name| name.contains(".hums-part")).collect()
}

#[test]
fn a_full_disk_leaves_the_old_file_or_nothing() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "decode --format hum PX4 -o log.hum", 0);
    let program = env!("CARGO_BIN_EXE_hums");
    let tlog = px4().display().to_string();
    fs::write(dir.path().join("few.tlog"), &fs::read(px4()).expect("a recording")[..4000]).expect("written");
    for (before, line, output) in [
        (
            "decode log.hum -o old --format tlog --message HEARTBEAT",
            "decode log.hum -o old --format tlog",
            "old",
        ),
        ("decode log.hum -o old --format jsonl --to 0.1", "decode log.hum -o old --format jsonl", "old"),
        ("report few.tlog -o old", "report log.hum -o old", "old"),
        ("decode --format hum few.tlog -o old", "decode --format hum PX4 -o old", "old"),
        ("", "decode log.hum -o new/ --format tlog", "new"),
        ("", "decode log.hum -o new --format csv", "new"),
        ("", "decode log.hum -o new --format thesis", "new"),
        ("", "decode log.hum -o new --format parquet", "new"),
    ] {
        let _ = fs::remove_file(dir.path().join("old"));
        if !before.is_empty() {
            attempt(dir.path(), before);
        }
        let old = fs::read(dir.path().join("old")).unwrap_or_default();
        // No file may be longer than 20 KiB: a write beyond that fails as on a full disk.
        let limited = format!("ulimit -f 20; exec {program} {} --force", line.replace("PX4", &tlog));
        let output_of = Command::new("bash").args(["-c", &limited]).current_dir(dir.path()).output();
        let ended = output_of.expect("it runs");
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(1), "{line}: {said}");
        assert!(said.contains("cannot be written") && !said.contains("there is no folder"), "{line}: {said}");
        assert_eq!(fs::read(dir.path().join("old")).unwrap_or_default(), old, "{line}");
        assert_eq!(parts(dir.path()), Vec::<String>::new(), "{line}");
        if output == "new" {
            let left =
                if dir.path().join("new").exists() { contents(&dir.path().join("new")) } else { Vec::new() };
            assert_eq!(left, Vec::new(), "{line}");
        }
    }
}

#[test]
fn what_is_written_beside_a_recording_may_fail_and_the_recording_goes_on() {
    let dir = tempfile::tempdir().expect("directory");
    let frames =
        |image: &str| json(&run(dir.path(), &format!("info {image} --json"), 0))["logs"][0]["frames"].clone();
    let said = stderr(&run(dir.path(), "sim PX4 --sd full.img --gs /dev/full --tap /dev/full", 3));
    for flag in ["--gs", "--tap"] {
        let words = format!("{flag}: /dev/full: cannot be written");
        assert_eq!(said.matches(&words).count(), 1, "{said}");
    }
    assert_eq!(frames("full.img"), 16_645);
    // The reader has closed the pipe.
    let mut sim = Command::new(env!("CARGO_BIN_EXE_hums"));
    sim.args(["sim", "--sd", "pipe.img", "--gs", "-"]).arg(px4()).current_dir(dir.path());
    let mut sim = sim.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    drop(sim.stdout.take());
    let ended = sim.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(3), "{said}");
    assert!(said.contains("--gs: cannot be written: standard output was closed"), "{said}");
    assert_eq!(frames("pipe.img"), 16_645);
}

#[test]
fn a_killed_run_leaves_the_old_file_and_is_in_nobodys_way() {
    let dir = tempfile::tempdir().expect("directory");
    let old = dir.path().join("old.hum");
    let few: usize = frames_of(&px4())[..60].iter().map(|frame| 8 + frame.len()).sum();
    fs::write(dir.path().join("few.tlog"), &fs::read(px4()).expect("a recording")[..few]).expect("written");
    run(dir.path(), "decode --format hum few.tlog -o old.hum", 0);
    let before = fs::read(&old).expect("there");
    let mut program = Command::new(env!("CARGO_BIN_EXE_hums"))
        .args(["decode", "--format", "hum", "-", "-o", "old.hum", "--force"])
        .current_dir(dir.path())
        .stdin(Stdio::piped())
        .spawn()
        .expect("it runs");
    let tlog = fs::read(px4()).expect("a recording");
    let mut input = program.stdin.take().expect("it is piped");
    input.write_all(&tlog[..tlog.len() / 2]).expect("it reads");
    let begun = |name: &String| fs::metadata(dir.path().join(name)).is_ok_and(|about| about.len() > 10_000);
    until("it writes", || parts(dir.path()).first().is_some_and(begun));
    program.kill().expect("it is ours");
    program.wait().expect("it is ours");
    assert_eq!(fs::read(&old).expect("there"), before);
    run(dir.path(), "decode --format hum PX4 -o old.hum --force", 0);
    run(dir.path(), "info --verify old.hum", 0);
}

#[test]
fn tables_of_a_killed_run_are_the_old_ones_or_the_new_ones() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "decode --format hum PX4 -o log.hum", 0);
    run(dir.path(), "decode log.hum -o out --format csv,parquet --message ATTITUDE", 0);
    let out = dir.path().join("out");
    let (few, name) = (contents(&out), named(&out, "log"));
    run(dir.path(), "decode log.hum -o whole --format csv,parquet", 0);
    let whole = contents(&dir.path().join("whole"));
    let csv = format!("{name}/");
    let of = |all: &[(String, Vec<u8>)], is_csv: bool| -> Vec<(String, Vec<u8>)> {
        let is_of = |(name, _): &&(String, Vec<u8>)| {
            name.starts_with(&csv) == is_csv && !name.contains(".hums-part") && !name.contains(".hums-fleet")
        };
        all.iter().filter(is_of).cloned().collect()
    };
    let mut killed = 0;
    for after_ms in (0..60).step_by(6) {
        let mut program = Command::new(env!("CARGO_BIN_EXE_hums"))
            .args(["decode", "log.hum", "-o", "out", "--format", "csv,parquet", "--force"])
            .current_dir(dir.path())
            .stdout(Stdio::null())
            .spawn()
            .expect("it runs");
        std::thread::sleep(Duration::from_millis(after_ms));
        program.kill().expect("it is ours");
        killed += u32::from(!program.wait().expect("it is ours").success());
        run(dir.path(), "decode log.hum -o out --format parquet", 0);
        let now = contents(&out);
        for is_csv in [true, false] {
            let (found, whole) = (of(&now, is_csv), of(&whole, is_csv));
            assert!(
                found == whole
                    || found == of(&few, is_csv)
                    || is_csv && found.iter().all(|file| few.contains(file)),
                "CSV {is_csv} after {after_ms} ms: {:?}",
                found.iter().map(|(name, bytes)| (name, bytes.len())).collect::<Vec<_>>()
            );
        }
    }
    assert!(killed > 0);
    run(dir.path(), "decode log.hum -o out --format csv,parquet --force", 0);
    let is_made = |(name, _): &(String, Vec<u8>)| !name.contains(".hums-part");
    assert_eq!(contents(&out).into_iter().filter(is_made).collect::<Vec<_>>(), whole);
}

#[test]
fn what_came_live_before_a_kill_is_there_and_no_command_takes_it_away() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "decode --format hum PX4 -o log.hum", 0);
    let server = TcpListener::bind("127.0.0.1:0").expect("a port");
    let mut sim = Command::new(env!("CARGO_BIN_EXE_hums"))
        .args(["sim", "--sd", "card.img", "--tap", "tap.bin"])
        .arg(format!("tcp:{}", server.local_addr().expect("an address")))
        .current_dir(dir.path())
        .spawn()
        .expect("it runs");
    let sent = frames_of(&px4())[..100].concat();
    let (mut stream, _) = server.accept().expect("a connection");
    stream.write_all(&sent).expect("sent");
    let tap = dir.path().join("tap.bin");
    until("it records", || tap.metadata().is_ok_and(|about| about.len() == sent.len() as u64));
    sim.kill().expect("it is ours");
    sim.wait().expect("it is ours");
    run(dir.path(), "check tap.bin", 0);
    for line in [
        "sim PX4 --sd other.img --tap tap.bin",
        "sim PX4 --sd other.img --gs tap.bin",
        "decode --format hum PX4 -o tap.bin",
    ] {
        run(dir.path(), line, 1);
        assert!(fs::read(&tap).expect("there") == sent, "{line}");
    }
    assert_eq!(parts(dir.path()), Vec::<String>::new());
}

#[test]
fn what_is_not_whole_in_a_folder_is_passed_over_and_told() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "decode --format hum PX4 -o log.hum", 0);
    let folder = dir.path().join("folder");
    fs::create_dir_all(folder.join(".x.hums-part")).expect("made");
    for name in ["00001_00.HUM", ".00002_00.HUM.hums-part", ".00003_00.HUM.pull.hums-part"] {
        fs::copy(dir.path().join("log.hum"), folder.join(name)).expect("copied");
    }
    for line in
        ["info --verify IN", "info IN", "check IN", "report IN -o pages/", "decode IN -o out/ --format tlog"]
    {
        let said = stderr(&run(dir.path(), &line.replace("IN", "folder"), 0));
        assert_eq!(said.matches("has not ended, and is passed over").count(), 3, "{line}: {said}");
    }
    assert_eq!(all_named(&dir.path().join("out"), "00001").len(), 1);
}

#[test]
fn a_signal_while_it_starts_ends_the_writing_of_a_recording_with_words() {
    let dir = tempfile::tempdir().expect("directory");
    let params = dir.path().join("params");
    let made = Command::new("mkfifo").arg(&params).status();
    assert!(made.expect("it runs").success());
    let mut live = Command::new(env!("CARGO_BIN_EXE_hums"));
    live.args(["live", "--influx", "http://127.0.0.1:9", "--listen", "127.0.0.1:0"]).arg(px4());
    live.arg("--params").arg(&params);
    let mut live = live.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it runs");
    let mut writer = fs::OpenOptions::new().write(true).open(&params).expect("it is read");
    let end = || Command::new("kill").args(["-TERM", &live.id().to_string()]).status();
    assert!(end().expect("it runs").success());
    std::thread::sleep(Duration::from_millis(200));
    writer.write_all(b"GS_BUDGET 5000\n").expect("it is read");
    drop(writer);
    std::thread::sleep(Duration::from_millis(500));
    // Ends the wait for the database.
    end().expect("it runs");
    let mut said = String::new();
    std::io::Read::read_to_string(live.stderr.as_mut().expect("piped"), &mut said).expect("text");
    assert_eq!(live.wait().expect("it ends").code(), Some(3), "{said}");
    let words =
        "was interrupted; its points go to 0.0 s; the rest is not in the database: write the recording again";
    assert!(said.contains(words), "{said}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_standard_error_on_a_full_disk_ends_nothing() {
    let dir = furnished();
    let shell = |line: &str| {
        let hums = format!("hums() {{ {} \"$@\"; }}; {line}", env!("CARGO_BIN_EXE_hums"));
        Command::new("bash").args(["-c", &hums]).current_dir(dir.path()).status().expect("a shell").code()
    };
    assert_eq!(shell("hums info --list nosuch 2> /dev/full"), Some(1));
    let line = "hums sim flight.tlog --sd card.img --card-size 34 --tap /dev/full 2> /dev/full";
    assert_eq!(shell(line), Some(3));
    assert_eq!(shell("hums decode card.img -o all.tlog --format tlog"), Some(0));
    let [all, flight] = ["all.tlog", "flight.tlog"].map(|name| frames_of(&dir.path().join(name)).len());
    assert_eq!(all, flight);
}
