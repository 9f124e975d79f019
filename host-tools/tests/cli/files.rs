//! What commands may write: never an input, never half a file, never two sessions in one.

use std::fs;
use std::io::Write as _;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use clap::{Arg, CommandFactory as _};
use hums::cli::Cli;
use tempfile::TempDir;

use crate::support::{all_named, attempt, flight, frames_of, hums, named, px4, run, text};

/// What an argument names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// A file or a folder that is only read.
    Input,
    /// A file or a folder that is written.
    Output,
    /// No file.
    Other,
}

/// An argument that is not here fails the test: decide what it names, and the test tries it from then on.
fn role(arg: &Arg) -> Role {
    match arg.get_id().as_str() {
        "inputs" | "input" | "gs_input" | "params" | "key" | "firmware" => Role::Input,
        "output" | "sd" | "gs" | "tap" | "store" | "dir" | "spool" => Role::Output,
        "bucket" | "card_out" | "card_size" | "cut_after_writes" | "cut_store_after" | "dashboard"
        | "format" | "from" | "influx" | "last" | "line_rate" | "link" | "listen" | "listen_token"
        | "message" | "name" | "names" | "noise" | "org" | "provoke" | "reboot_at_us" | "seed"
        | "session" | "speed" | "spool_limit" | "stall" | "to" | "token" | "value" | "write_error" => {
            Role::Other
        }
        unknown => panic!("is --{unknown} an input, an output or none? Say so in `role`"),
    }
}

/// A good value for an argument, where one is needed.
fn value(command: &str, arg: &str) -> &'static str {
    match (command, arg) {
        ("decode" | "report" | "info" | "verify", "inputs") => "log.hum",
        (_, "input" | "gs_input") => "flight.tlog",
        (_, "params") => "hums.param",
        (_, "key") => "key.txt",
        (_, "firmware") => "hums.elf",
        (_, "sd") => "new.img",
        (_, "output") => "new.out",
        (_, "format") => "tlog",
        (_, "link") => "tcp:127.0.0.1:1",
        (_, "dir") => "new",
        (_, "name" | "names") => "GS_BUDGET",
        (_, "value") => "1",
        (command, arg) => panic!("hums {command} needs --{arg}: which value is good?"),
    }
}

/// A directory with an input of each kind, as a file, through links, and in a folder.
fn furnished() -> TempDir {
    let dir = tempfile::tempdir().expect("directory");
    let at = |name: &str| dir.path().join(name);
    fs::copy(px4(), at("flight.tlog")).expect("a copy");
    run(dir.path(), "pack flight.tlog -o log.hum", 0);
    fs::write(at("hums.param"), "CELL_VOLT_WARN 3.6\n").expect("a file");
    fs::write(at("key.txt"), "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff\n")
        .expect("a file");
    let mut elf = b"\x7fELF".to_vec();
    elf.resize(64, 0);
    elf[18] = 40;
    fs::write(at("hums.elf"), elf).expect("a file");
    fs::create_dir(at("folder")).expect("a directory");
    for name in ["flight.tlog", "log.hum", "hums.param", "key.txt", "hums.elf"] {
        symlink(name, at(&format!("link-{name}"))).expect("a link");
        fs::hard_link(at(name), at(&format!("hard-{name}"))).expect("a link");
        fs::copy(at(name), at("folder").join(name)).expect("a copy");
    }
    dir
}

/// The words of a command line: its name, what it requires, and these arguments.
fn words(command: &clap::Command, path: &[&str], given: &[(&Arg, String)]) -> Vec<String> {
    let mut words_more = Vec::new();
    let mut words: Vec<String> = path.iter().map(|word| (*word).to_owned()).collect();
    let mut push = |arg: &Arg, value: String| {
        if let Some(long) = arg.get_long() {
            words.push(format!("--{long}"));
        }
        words.push(value);
    };
    for arg in command.get_arguments() {
        let id = arg.get_id();
        if let Some((_, value)) = given.iter().find(|(given, _)| given.get_id() == id) {
            push(arg, value.clone());
            if id == "spool" {
                // Only with a database do points wait.
                words_more = ["--influx", "http://127.0.0.1:9"].map(String::from).to_vec();
            }
        } else if arg.is_required_set() {
            push(arg, value(path[0], id.as_str()).to_owned());
        }
    }
    words.extend(words_more);
    words
}

/// All commands that do something, with the words that call them.
fn leaves<'a>(
    command: &'a clap::Command,
    path: &[&'a str],
    found: &mut Vec<(&'a clap::Command, Vec<&'a str>)>,
) {
    if command.get_subcommands().next().is_none() {
        found.push((command, path.to_vec()));
    }
    for sub in command.get_subcommands().filter(|sub| sub.get_name() != "help") {
        let path: Vec<&str> = path.iter().copied().chain([sub.get_name()]).collect();
        leaves(sub, &path, found);
    }
}

/// Everything that a directory has, by name.
fn contents(dir: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    let entries = fs::read_dir(dir).expect("a directory");
    for path in entries.map(|entry| entry.expect("an entry").path()) {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if path.is_dir() {
            found
                .extend(contents(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            found.push((name, fs::read(&path).expect("a file")));
        }
    }
    found.sort();
    found
}

#[test]
fn no_command_writes_over_any_of_its_inputs() {
    let mut root = Cli::command();
    root.build();
    let mut commands = Vec::new();
    leaves(&root, &[], &mut commands);
    let dir = furnished();
    let before = contents(dir.path());
    let mut tried = Vec::new();
    for (command, path) in &commands {
        let takes = |arg: &&Arg| arg.get_action().takes_values();
        let of = |wanted: Role| -> Vec<&Arg> {
            command.get_arguments().filter(takes).filter(|arg| role(arg) == wanted).collect()
        };
        for output in of(Role::Output) {
            for input in of(Role::Input) {
                let file = value(path[0], input.get_id().as_str());
                let spellings = [
                    file.to_owned(),
                    format!("./folder/../{file}"),
                    format!("link-{file}"),
                    format!("hard-{file}"),
                ];
                for spelling in spellings {
                    let given = [(input, file.to_owned()), (output, spelling)];
                    refused(dir.path(), &words(command, path, &given), &before);
                }
                if input.get_id() == "inputs" {
                    let given = [(input, "folder".to_owned()), (output, format!("folder/{file}"))];
                    refused(dir.path(), &words(command, path, &given), &before);
                }
                tried.push(format!("{} --{}", path.join(" "), output.get_id()));
            }
        }
    }
    tried.dedup();
    for known in ["decode --output", "report --output", "pack --output", "sim --sd", "sim --gs", "sim --tap"]
    {
        assert!(tried.iter().any(|tried| tried == known), "{known} is not among {tried:?}");
    }
}

#[track_caller]
fn refused(dir: &Path, words: &[String], before: &[(String, Vec<u8>)]) {
    let line = words.join(" ");
    let output = attempt(dir, &line);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(matches!(output.status.code(), Some(1 | 2)), "hums {line}: {:?}\n{said}", output.status);
    // Nothing was changed, and nothing was left either.
    let after = contents(dir);
    for (name, bytes) in before {
        let kept = after.iter().find(|(other, _)| other == name);
        assert!(
            kept.is_some_and(|(_, kept)| kept == bytes),
            "hums {line}: {name} is not what it was\n{said}"
        );
    }
    for (name, _) in &after {
        let made = before.iter().all(|(other, _)| other != name);
        if made {
            assert!(name.starts_with("new"), "hums {line}: left {name}\n{said}");
            let _ = fs::remove_file(dir.join(name));
        }
    }
}

#[test]
fn an_output_into_an_input_folder_replaces_nothing_there() {
    let dir = furnished();
    let before = contents(&dir.path().join("folder"));
    for line in ["decode folder -o folder --format csv,parquet,thesis,tlog", "report folder -o folder/"] {
        run(dir.path(), line, 0);
        let made = contents(&dir.path().join("folder"));
        // And again: what is there is the same. A tlog that was made is no input, though it is a recording.
        run(dir.path(), line, 0);
        assert_eq!(contents(&dir.path().join("folder")), made);
    }
    let after = contents(&dir.path().join("folder"));
    assert!(before.iter().all(|file| after.contains(file)), "every input is what it was");
    assert!(after.len() > before.len() + 60);
}

/// Two cards, each with the first session of a vehicle of its own.
fn two_cards() -> TempDir {
    let dir = tempfile::tempdir().expect("directory");
    for (name, recording) in [("c1", "px4_hil_quad_low.tlog"), ("c2", "ap_quad_guided.tlog")] {
        let recording = flight(recording);
        let code = attempt(dir.path(), &format!("sim --input {} --sd {name}.img", recording.display()));
        assert!(code.status.success(), "{name}");
    }
    dir
}

fn parquet_sessions(fleet: &Path) -> Vec<PathBuf> {
    let mut sessions: Vec<PathBuf> = contents(fleet)
        .into_iter()
        .filter_map(|(name, _)| name.strip_suffix("/HEARTBEAT.parquet").map(PathBuf::from))
        .collect();
    sessions.sort();
    sessions
}

#[test]
fn two_cards_decoded_into_one_folder_stay_apart() {
    let dir = two_cards();
    let formats = "--format tlog,csv,parquet,thesis,jsonl,influx";
    for card in ["c1", "c2"] {
        run(dir.path(), &format!("decode {card}.img -o one_by_one {formats}"), 0);
        run(dir.path(), &format!("decode {card}.img -o {card} --format tlog,csv"), 0);
    }
    run(dir.path(), &format!("decode c1.img c2.img -o at_once {formats}"), 0);
    for folder in ["one_by_one", "at_once"] {
        let folder = dir.path().join(folder);
        assert_eq!(all_named(&folder, "00001").len(), 2, "{}", folder.display());
        assert_eq!(parquet_sessions(&folder).len(), 2, "{}", folder.display());
        for (card, recording) in [("c1", "px4_hil_quad_low.tlog"), ("c2", "ap_quad_guided.tlog")] {
            let alone = dir.path().join(card);
            let name = named(&alone, "00001");
            assert_eq!(frames_of(&folder.join(format!("{name}.tlog"))), frames_of(&flight(recording)));
            assert_eq!(
                contents(&folder.join(&name)),
                contents(&alone.join(&name)),
                "{card}: tables of one card"
            );
        }
    }
    assert_eq!(contents(&dir.path().join("one_by_one")), contents(&dir.path().join("at_once")));
}

/// Two folders, each with a log of the same name: the whole one, and one whose last half is gone.
fn whole_and_cut() -> TempDir {
    let dir = tempfile::tempdir().expect("directory");
    for folder in ["whole", "cut", "one"] {
        fs::create_dir(dir.path().join(folder)).expect("a directory");
    }
    run(dir.path(), "pack PX4 -o whole/log.hum", 0);
    let log = fs::read(dir.path().join("whole/log.hum")).expect("a log");
    fs::write(dir.path().join("cut/log.hum"), &log[..log.len() / 1024 * 512]).expect("written");
    dir
}

#[test]
fn what_is_there_is_not_replaced_by_other_content_unless_the_user_says_so() {
    let dir = whole_and_cut();
    let out = dir.path().join("out");
    for line in ["decode LOG -o out --format tlog,jsonl,influx,csv,thesis", "report LOG -o out/"] {
        let line =
            |log: &str, more: &str| format!("{} {more}", line.replace("LOG", &format!("{log}/log.hum")));
        run(dir.path(), &line("whole", ""), 0);
        let made = contents(&out);
        run(dir.path(), &line("whole", ""), 0);
        assert_eq!(contents(&out), made, "the same again");
        let kept = |line: &str| {
            let said = String::from_utf8_lossy(&run(dir.path(), line, 1).stderr).into_owned();
            assert!(said.contains("is there already with other content, and was not replaced"), "{said}");
            assert!(said.contains("--replace"), "{said}");
            assert!(contents(&out) == made, "{line} changed something");
        };
        kept(&line("cut", ""));
        if line("", "").starts_with("decode") {
            kept(&line("whole", "--from 20"));
            kept(&line("whole", "--message ATTITUDE"));
        }
        // Each format by itself, so that none hides behind another.
        for format in ["tlog", "jsonl", "influx", "csv", "thesis"] {
            if line("", "").starts_with("decode") {
                kept(&format!("decode cut/log.hum -o out --format {format}"));
            }
        }
        run(dir.path(), &line("cut", "--replace"), 0);
        assert_ne!(contents(&out), made);
        run(dir.path(), &line("whole", "--replace"), 0);
        assert_eq!(contents(&out), made, "no table of the others is left");
    }
    // Parquet tables of two parts of a session lie side by side.
    run(dir.path(), "decode whole/log.hum -o fleet --format parquet", 0);
    run(dir.path(), "decode whole/log.hum -o fleet --format parquet --message ATTITUDE", 1);
    run(dir.path(), "decode cut/log.hum -o fleet --format parquet", 0);
    run(dir.path(), "decode whole/log.hum -o fleet --format parquet", 0);
    assert_eq!(parquet_sessions(&dir.path().join("fleet")).len(), 2);
    // A table of the user's own stays, and so does the folder that it is in.
    let tables = out.join(named(&out, "log"));
    fs::write(tables.join("mine.csv"), "mine").expect("written");
    let before = contents(&out);
    run(dir.path(), "decode whole/log.hum -o out --format csv", 0);
    let said = run(dir.path(), "decode cut/log.hum -o out --format csv --replace", 1);
    assert!(String::from_utf8_lossy(&said.stderr).contains("mine.csv, which hums did not make"));
    assert_eq!(contents(&out), before);
}

#[test]
fn a_slip_in_the_name_of_an_output_costs_no_recording_with_any_flag() {
    let dir = furnished();
    run(dir.path(), "sim --input PX4 --sd card.img --card-size 64", 0);
    let at = |name: &str| dir.path().join(name);
    fs::write(at("spool"), b"HUMSPOOL and what waits").expect("written");
    fs::write(at("thesis.txt"), "months of work").expect("written");
    fs::write(at("flight.ulg"), b"ULog\x01\x12\x35\x01 and so on").expect("written");
    let before = contents(dir.path());
    for line in [
        "decode folder/log.hum -o OUT --format tlog",
        "decode folder/log.hum -o OUT --format jsonl",
        "decode folder/log.hum -o OUT --format influx",
        "report folder/log.hum -o OUT",
        "pack folder/flight.tlog -o OUT",
        "sim --input folder/flight.tlog --sd new.img --gs OUT",
        "sim --input folder/flight.tlog --sd new.img --tap OUT",
    ] {
        for name in ["card.img", "spool", "thesis.txt", "flight.ulg", "hums.elf", "flight.tlog", "log.hum"] {
            for flag in ["", "--replace"] {
                let same = line.starts_with("pack") && name == "log.hum"
                    || line.ends_with("tlog") && name == "flight.tlog";
                if same {
                    continue;
                }
                let line = format!("{} {flag}", line.replace("OUT", name));
                run(dir.path(), &line, 1);
                assert!(contents(dir.path()) == before, "{line}");
            }
        }
    }
    // What the command makes itself it replaces.
    for (line, name) in [
        ("decode folder/log.hum -o OUT --format tlog --to 20", "flight.tlog"),
        ("sim --input folder/flight.tlog --sd new.img --gs OUT", "gs"),
    ] {
        let line = line.replace("OUT", name);
        fs::write(at("gs"), frames_of(&px4())[..50].concat()).expect("written");
        run(dir.path(), &line, 1);
        run(dir.path(), &format!("{line} --replace"), 0);
    }
    let said = run(dir.path(), "sim --input PX4 --sd new.img --gs both --tap ./both", 2);
    assert!(String::from_utf8_lossy(&said.stderr).contains("are one file"));
}

#[test]
fn a_command_with_all_files_of_a_folder_can_be_called_again() {
    let dir = tempfile::tempdir().expect("directory");
    fs::copy(px4(), dir.path().join("flight.tlog")).expect("a copy");
    run(dir.path(), "pack flight.tlog -o log.hum", 0);
    for line in ["decode * -o . --format tlog,csv,jsonl,influx,parquet,thesis", "report * -o ./"] {
        // As a shell puts it there: without what begins with a dot.
        let all = || -> String {
            let entries = fs::read_dir(dir.path()).expect("a directory");
            let names =
                entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
            let mut names: Vec<String> = names.filter(|name| !name.starts_with('.')).collect();
            names.sort();
            line.replace('*', &names.join(" "))
        };
        run(dir.path(), &all(), 0);
        let made = contents(dir.path());
        let said = String::from_utf8_lossy(&run(dir.path(), &all(), 0).stderr).into_owned();
        assert!(said.contains("and is passed over"), "{said}");
        assert!(line.starts_with("report") || said.contains("is what this command makes of"), "{said}");
        assert!(line.starts_with("report") || contents(dir.path()) == made);
        // An output that was changed is not replaced, and no input either.
        run(dir.path(), &format!("{} --replace", all()), 0);
        assert!(line.starts_with("report") || contents(dir.path()) == made);
    }
}

#[test]
fn gaps_of_an_earlier_copy_do_not_stay_beside_a_tlog_without_gaps() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "pack PX4 -o log.hum", 0);
    let log = fs::read(dir.path().join("log.hum")).expect("a log");
    let mut damaged = log.clone();
    damaged[150 * 512 + 100] ^= 4;
    fs::write(dir.path().join("log.hum"), damaged).expect("written");
    let line = "decode log.hum -o back.tlog --format tlog";
    run(dir.path(), line, 3);
    run(dir.path(), line, 3);
    let gaps = dir.path().join("back.tlog.gaps.csv");
    assert!(gaps.exists());
    fs::write(dir.path().join("log.hum"), log).expect("written");
    run(dir.path(), line, 1);
    fs::remove_file(dir.path().join("back.tlog")).expect("removed");
    run(dir.path(), line, 1);
    assert!(gaps.exists() && !dir.path().join("back.tlog").exists());
    run(dir.path(), &format!("{line} --replace"), 0);
    assert!(!gaps.exists());
}

#[test]
fn a_time_in_which_there_is_nothing_is_told_and_nothing_is_written() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "pack PX4 -o log.hum", 0);
    for (output, format) in [("out", "csv,tlog,parquet,thesis"), ("out.tlog", "tlog"), ("-", "jsonl")] {
        let line = format!("decode log.hum -o {output} --format {format} --from 99999");
        let output = run(dir.path(), &line, 1);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            said.contains("log: nothing of it is within --from and --to: its times go from 0.000 s to "),
            "{said}"
        );
        assert!(text(&output).is_empty());
    }
    assert!(!dir.path().join("out.tlog").exists());
    assert!(all_named(&dir.path().join("out"), "log").is_empty());
}

/// Files and folders that are not whole.
fn parts(dir: &Path) -> Vec<String> {
    contents(dir).into_iter().map(|(name, _)| name).filter(|name| name.contains(".hums-part")).collect()
}

#[test]
fn a_full_disk_leaves_the_old_file_or_nothing() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "pack PX4 -o log.hum", 0);
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
        ("pack few.tlog -o old", "pack PX4 -o old", "old"),
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
        let limited = format!("ulimit -f 20; exec {program} {} --replace", line.replace("PX4", &tlog));
        let output_of = Command::new("bash").args(["-c", &limited]).current_dir(dir.path()).output();
        let ended = output_of.expect("it runs");
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(1), "{line}: {said}");
        assert!(said.contains("cannot be written"), "{line}: {said}");
        assert_eq!(fs::read(dir.path().join("old")).unwrap_or_default(), old, "{line}");
        assert_eq!(parts(dir.path()), Vec::<String>::new(), "{line}");
        if output == "new" {
            let left =
                if dir.path().join("new").exists() { contents(&dir.path().join("new")) } else { Vec::new() };
            assert_eq!(left, Vec::new(), "{line}");
        }
    }
    run(dir.path(), "sim --input PX4 --sd card.img --gs /dev/full", 1);
}

/// Waits until something is so.
#[track_caller]
pub(crate) fn until(what: &str, is: impl Fn() -> bool) {
    let limit = Instant::now() + Duration::from_secs(30);
    while !is() {
        assert!(Instant::now() < limit, "{what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_killed_run_leaves_the_old_file_and_is_in_nobodys_way() {
    let dir = tempfile::tempdir().expect("directory");
    let (old, part) = (dir.path().join("old.hum"), dir.path().join(".old.hum.hums-part"));
    run(dir.path(), &format!("pack {} -o old.hum", flight("ap_quad_guided.tlog").display()), 0);
    let before = fs::read(&old).expect("there");
    let mut program = Command::new(env!("CARGO_BIN_EXE_hums"))
        .args(["pack", "-", "-o", "old.hum", "--replace"])
        .current_dir(dir.path())
        .stdin(Stdio::piped())
        .spawn()
        .expect("it runs");
    let tlog = fs::read(px4()).expect("a recording");
    let mut input = program.stdin.take().expect("it is piped");
    input.write_all(&tlog[..tlog.len() / 2]).expect("it reads");
    until("it writes", || part.metadata().is_ok_and(|about| about.len() > 10_000));
    // While it is written nobody else writes it.
    let said = run(dir.path(), "pack PX4 -o old.hum --replace", 1);
    assert!(String::from_utf8_lossy(&said.stderr).contains("another run of hums is writing it"));
    program.kill().expect("it is ours");
    program.wait().expect("it is ours");
    assert_eq!(fs::read(&old).expect("there"), before);
    assert!(part.exists());
    run(dir.path(), "pack PX4 -o old.hum --replace", 0);
    assert!(!part.exists());
    run(dir.path(), "verify old.hum", 0);
}

#[test]
fn tables_of_a_killed_run_are_the_old_ones_or_the_new_ones() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "pack PX4 -o log.hum", 0);
    run(dir.path(), "decode log.hum -o out --format csv,parquet --message ATTITUDE", 0);
    let out = dir.path().join("out");
    let (few, name) = (contents(&out), named(&out, "log"));
    run(dir.path(), "decode log.hum -o whole --format csv,parquet", 0);
    let whole = contents(&dir.path().join("whole"));
    let of = |all: &[(String, Vec<u8>)], start: &str| -> Vec<(String, Vec<u8>)> {
        let is_of = |file: &&(String, Vec<u8>)| file.0.starts_with(start) && !file.0.contains(".hums-part");
        all.iter().filter(is_of).cloned().collect()
    };
    let mut killed = 0;
    for after_ms in (0..60).step_by(6) {
        let mut program = Command::new(env!("CARGO_BIN_EXE_hums"))
            .args(["decode", "log.hum", "-o", "out", "--format", "csv,parquet", "--replace"])
            .current_dir(dir.path())
            .stdout(Stdio::null())
            .spawn()
            .expect("it runs");
        std::thread::sleep(Duration::from_millis(after_ms));
        program.kill().expect("it is ours");
        killed += u32::from(!program.wait().expect("it is ours").success());
        let now = contents(&out);
        for tables in [format!("{name}/"), "vehicle=".to_owned()] {
            let found = of(&now, &tables);
            assert!(
                found == of(&few, &tables) || found == of(&whole, &tables),
                "{tables} after {after_ms} ms: {:?}",
                found.iter().map(|(name, bytes)| (name, bytes.len())).collect::<Vec<_>>()
            );
        }
    }
    assert!(killed > 0);
    run(dir.path(), "decode log.hum -o out --format csv,parquet --replace", 0);
    assert_eq!(contents(&out), whole, "and nothing of the killed runs is left");
}

#[test]
fn a_demo_removes_what_a_demo_made_and_nothing_else() {
    let dir = tempfile::tempdir().expect("directory");
    let at = |name: &str| dir.path().join(name);
    let demo = |code: i32| -> String {
        let input = px4().display().to_string();
        let words = ["demo", "--input", &input, "--dir", ".", "--dashboard", "never"];
        // Without a path there is no emulator.
        let ended = hums().current_dir(dir.path()).env("PATH", "").args(words).output().expect("it runs");
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(code), "{said}");
        said
    };
    for name in ["card.img", "report.html"] {
        fs::write(at(name), "evidence").expect("written");
        assert!(demo(1).contains("no demo made it"));
        assert_eq!(fs::read(at(name)).expect("there"), b"evidence");
        fs::remove_file(at(name)).expect("removed");
    }
    demo(0);
    let made = contents(dir.path());
    // What the user puts beside it stays.
    let tables = at("decoded").join(named(&at("decoded"), "00001"));
    for path in [at("mine.tlog"), at("decoded/mine.csv")] {
        fs::write(path, "mine").expect("written");
    }
    demo(0);
    for path in [at("mine.tlog"), at("decoded/mine.csv")] {
        assert_eq!(fs::read(&path).expect("there"), b"mine");
        fs::remove_file(path).expect("removed");
    }
    assert!(contents(dir.path()) == made, "a demo is the same again");
    // What was changed, or put among the tables, ends it before anything is removed.
    for (path, why) in [
        (tables.join("mine.csv"), "is among the demo's tables"),
        (tables.join("HEARTBEAT.csv"), "was changed since the demo made it"),
        (at("card.img"), "was changed since the demo made it"),
    ] {
        let was = fs::read(&path).ok();
        fs::write(&path, "evidence").expect("written");
        let before = contents(dir.path());
        assert!(demo(1).contains(why), "{}", path.display());
        assert!(contents(dir.path()) == before, "{}", path.display());
        was.map_or_else(|| fs::remove_file(&path), |was| fs::write(&path, was)).expect("as it was");
    }
}

/// Where files may be made, emptied, renamed or removed besides `files/`, and why.
const MAY_WRITE: [(&str, &str); 4] = [
    ("card/image.rs", "a simulated card's image is updated in place, as a card is"),
    ("run/store.rs", "the simulated board's flash is updated in place, as flash is"),
    ("run/qemu/mod.rs", "files in a temporary directory of its own"),
    (
        "live/influx/spool.rs",
        "a queue that outlives the program, in place; it takes a file of its own kind only",
    ),
];

fn is_rust(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension == "rs")
}

#[test]
fn one_place_makes_files() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    for (name, bytes) in contents(&sources).into_iter().filter(|(name, _)| is_rust(name)) {
        let source = String::from_utf8(bytes).expect("UTF-8");
        // Tests may do what they like.
        let source = source.split("#[cfg(test)]").next().unwrap_or_default();
        let calls = [
            "File::create",
            "File::options",
            "OpenOptions::new",
            "fs::write",
            "fs::rename",
            "fs::copy",
            "fs::remove",
            "fs::hard_link",
        ];
        let writes = calls.iter().any(|call| source.contains(call));
        if writes && !name.starts_with("files/") && !MAY_WRITE.iter().any(|(file, _)| *file == name) {
            found.push(name);
        }
    }
    assert_eq!(found, Vec::<String>::new(), "use `files::Output`, or say here why not");
}
