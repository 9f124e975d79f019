//! No command overwrites any of its inputs.

use std::fs;
use std::path::Path;

use clap::{Arg, ArgAction, ArgGroup, CommandFactory as _};
use hums::cli::Cli;

use crate::support::{Stamp, attempt, contents, furnished, recorded, run, stamps, stderr, text};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Input,
    Output,
    /// No file.
    Other,
}

/// An argument that is not listed fails the test: decide its kind, and the test covers it from then on.
fn role(arg: &Arg) -> Role {
    match arg.get_id().as_str() {
        "inputs" | "input" | "gs_input" | "image" | "params" | "key" | "firmware" | "past" | "restore" => {
            Role::Input
        }
        "output" | "sd" | "gs" | "tap" | "store" | "manifest" => Role::Output,
        "around" | "board" | "port" | "bucket" | "number" | "part" | "serial" | "card" | "card_out"
        | "command" | "card_size" | "cut_after_writes" | "cut_store_after" | "folder" | "format" | "from"
        | "influx" | "last" | "line_rate" | "link" | "listen" | "listen_token" | "map" | "message"
        | "name" | "names" | "noise" | "offset" | "org" | "provoke" | "reboot_at_us" | "seed" | "session"
        | "setup" | "shell" | "span" | "speed" | "split" | "stall" | "system" | "to" | "token" | "value"
        | "vehicle" | "write_error"
        // A file that exists is refused.
        | "undo" => Role::Other,
        unknown => panic!("is --{unknown} an input, an output or none? Say so in `role`"),
    }
}

/// Flags that allow to overwrite: tried with each spelling of an input. Others are tried with one.
const OVERWRITES: [&str; 2] = ["--force", "--overwrite-oldest"];

const IS_INPUT: &str = "input of this command";

/// For an output that is not a file, the error instead of [`IS_INPUT`]: the command, the output, the text, and the
/// reason.
const ELSE_REFUSED: [(&str, &str, &str, &str); 1] = [(
    "box pull",
    "output",
    "is a file, and a directory is needed there",
    "what it writes lies in that folder",
)];

const NO_PAIRS: [(&str, &str); 15] = [
    ("check", "prints"),
    ("live", "shows and sends"),
    ("completions", "prints"),
    ("man", "prints"),
    ("due", "prints"),
    ("compact", "changes its folder"),
    ("box replaced", "talks with a board"),
    ("box setup", "talks with a board"),
    ("box card-reader", "talks with a board"),
    ("box update", "writes into the card's folder"),
    ("box format-card", "talks with a board"),
    ("box params list", "talks with a board"),
    ("box params get", "talks with a board"),
    ("box params sign", "talks with a board"),
    ("box params set", "talks with a board"),
];

pub(crate) fn value(command: &str, arg: &str) -> &'static str {
    match (command, arg) {
        ("decode" | "report" | "info" | "box", "inputs") | ("check", "past") => "log.hum",
        ("check" | "logbook", "inputs") | (_, "input" | "gs_input") => "flight.tlog",
        ("completions", "shell") => "bash",
        (_, "params") => "hums.param",
        (_, "key") => "key.txt",
        (_, "firmware") => "hums.elf",
        (_, "sd") => "new.img",
        ("logbook", "output") => "new.html",
        ("compact", "folder") => "folder",
        (_, "output") => "new.out",
        (_, "format") => "tlog",
        (_, "link") => "tcp:127.0.0.1:1",
        (_, "name" | "names") => "GS_BUDGET",
        (_, "value") => "1",
        (_, "listen") => "127.0.0.1:0",
        (command, arg) => panic!("hums {command} needs --{arg}: which value is good?"),
    }
}

pub(crate) fn words(command: &clap::Command, path: &[&str], given: &[(&Arg, String)]) -> Vec<String> {
    let mut words: Vec<String> = path.iter().map(|word| (*word).to_owned()).collect();
    let mut push = |arg: &Arg, value: String| {
        if let Some(long) = arg.get_long() {
            words.push(format!("--{long}"));
        }
        words.push(value);
    };
    let has_one =
        |group: &ArgGroup| group.get_args().any(|id| given.iter().any(|(arg, _)| arg.get_id() == id));
    let groups = command.get_groups().filter(|group| group.is_required_set() && !has_one(group));
    let firsts: Vec<_> = groups.filter_map(|group| group.get_args().next()).collect();
    for arg in command.get_arguments() {
        let id = arg.get_id();
        if let Some((_, value)) = given.iter().find(|(given, _)| given.get_id() == id) {
            push(arg, value.clone());
        } else if arg.is_required_set() || firsts.contains(&id) {
            push(arg, value(path[0], id.as_str()).to_owned());
        }
    }
    words
}

fn flags(command: &clap::Command) -> Vec<String> {
    let is_flag = |arg: &&Arg| matches!(arg.get_action(), ArgAction::SetTrue);
    command.get_arguments().filter(is_flag).filter_map(|arg| Some(format!("--{}", arg.get_long()?))).collect()
}

pub(crate) fn leaves<'a>(
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

#[test]
fn no_command_writes_over_any_of_its_inputs() {
    let mut root = Cli::command();
    root.build();
    let mut commands = Vec::new();
    leaves(&root, &[], &mut commands);
    let dir = furnished();
    let (before, whole) = (stamps(dir.path()), contents(dir.path()));
    for (command, path) in &commands {
        let mut pairs = 0;
        let name = path.join(" ");
        let takes = |arg: &&Arg| arg.get_action().takes_values();
        let of = |wanted: Role| -> Vec<&Arg> {
            command.get_arguments().filter(takes).filter(|arg| role(arg) == wanted).collect()
        };
        for output in of(Role::Output) {
            for input in of(Role::Input) {
                let file = value(path[0], input.get_id().as_str());
                let is = |known: &&(&str, &str, &str, &str)| {
                    (known.0, known.1) == (&*name, output.get_id().as_str())
                };
                let said = ELSE_REFUSED.iter().find(is).map_or(IS_INPUT, |known| known.2);
                let spellings = [
                    file.to_owned(),
                    format!("./folder/../{file}"),
                    format!("link-{file}"),
                    format!("hard-{file}"),
                ];
                for (number, spelling) in spellings.into_iter().enumerate() {
                    let words = words(command, path, &[(input, file.to_owned()), (output, spelling)]);
                    refused(dir.path(), &words, said, &before);
                    let is_tried = |flag: &String| number == 0 || OVERWRITES.contains(&flag.as_str());
                    for flag in flags(command).into_iter().filter(is_tried) {
                        let with = [words.as_slice(), &[flag]].concat();
                        refused(dir.path(), &with, said, &before);
                    }
                }
                if input.get_id() == "inputs" {
                    let given = [(input, "folder".to_owned()), (output, format!("folder/{file}"))];
                    refused(dir.path(), &words(command, path, &given), said, &before);
                }
                pairs += 1;
            }
        }
        let why = NO_PAIRS.iter().find(|(known, _)| *known == name).map(|(_, why)| *why);
        assert_eq!(
            pairs == 0,
            why.is_some(),
            "hums {name}: {pairs} pairs were tried, and it is said: {why:?}"
        );
    }
    assert!(contents(dir.path()) == whole, "something was changed");
}

#[test]
fn a_page_that_would_go_into_an_input_is_refused_before_any_other_is_written() {
    let dir = furnished();
    let pages = dir.path().join("pages");
    fs::create_dir(&pages).expect("made");
    std::os::unix::fs::symlink("../log.hum", pages.join("index.html")).expect("a link");
    let before = contents(dir.path());
    for flag in ["", "--force", "--compare"] {
        let ended = run(dir.path(), &format!("report log.hum -o pages {flag}"), 2);
        let said = stderr(&ended);
        assert!(said.contains("index.html: is an input of this command"), "{said}");
        assert!(contents(dir.path()) == before && text(&ended).is_empty(), "{flag}: {said}");
    }
}

#[test]
fn a_cards_image_is_written_over_by_no_format() {
    let dir = recorded();
    let at = dir.path();
    let (before, whole) = (stamps(at), contents(at));
    for format in ["tlog", "csv", "jsonl", "parquet", "thesis", "mcap", "ulog", "kml,srt", "gpx"] {
        for output in ["card.img", "./card.img"] {
            for flag in ["", "--force", "--salvage"] {
                refused(
                    at,
                    &words_of(&format!("decode card.img -o {output} --format {format} {flag}")),
                    IS_INPUT,
                    &before,
                );
            }
        }
    }
    for flag in ["", "--force"] {
        let line = format!("report card.img -o ./card.img {flag}");
        refused(at, &words_of(&line), IS_INPUT, &before);
    }
    assert!(contents(at) == whole, "something was changed");
}

fn words_of(line: &str) -> Vec<String> {
    line.split_whitespace().map(str::to_owned).collect()
}

#[track_caller]
fn refused(dir: &Path, words: &[String], words_said: &str, before: &[(String, Stamp)]) {
    let line = words.join(" ");
    let output = attempt(dir, &line);
    let said = stderr(&output);
    assert!(matches!(output.status.code(), Some(1 | 2)), "hums {line}: {:?}\n{said}", output.status);
    let after = stamps(dir);
    for file in before {
        assert!(after.contains(file), "hums {line}: {} is not what it was\n{said}", file.0);
    }
    assert!(said.contains(words_said), "hums {line}: does not say: {words_said}\n{said}");
    assert!(!dir.join("new-folder").exists(), "hums {line}: made a folder\n{said}");
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
        run(dir.path(), &format!("{line} --force"), 0);
        assert_eq!(contents(&dir.path().join("folder")), made);
    }
    let after = contents(&dir.path().join("folder"));
    assert!(before.iter().all(|file| after.contains(file)), "every input is what it was");
    assert!(after.len() > before.len() + 60);
}
