//! The examples of every `--help`, extracted from its text and run in a directory with their files.

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead as _, BufReader};
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Command, Stdio};

use clap::CommandFactory as _;
use hums::cli::Cli;
use tempfile::TempDir;

use super::inputs::leaves;
use super::support::{end_of, hums, run, text};

/// The commands that run until Ctrl-C; they work if they print the address of their page.
const SERVES: &str = "live";
/// Examples that need a firmware image (`tests/chip` runs one) or a board (`tests/sim/companion.rs` simulates one).
const ELSEWHERE: [&str; 3] = ["--firmware", "box ", "s3://"];

const DOCUMENTED: [(&str, &str); 2] = [
    ("tests/flights/ap_quad_faults.tlog", "tests/flights/ap_quad_faults.tlog"),
    ("f12.bin", "tests/labelled/bin/f12_gps_jump.bin.gz"),
];

/// `$ hums ...`, and the beginning of its answer.
#[test]
fn the_documents_show_what_the_program_prints() {
    let (dir, root) =
        (tempfile::tempdir().expect("directory"), Path::new(env!("CARGO_MANIFEST_DIR")).join(".."));
    for (name, from) in DOCUMENTED {
        fs::create_dir_all(dir.path().join(name).parent().expect("a folder")).expect("a folder");
        fs::copy(root.join(from), dir.path().join(name)).expect("a copy");
    }
    for document in ["README.md", "docs/check.md"] {
        let words = fs::read_to_string(root.join(document)).expect("a document");
        let (_, example) = words.split_once("\n$ hums ").expect("an example");
        let (arguments, shown) = example.split_once('\n').expect("its answer");
        let (shown, _) = shown.split_once("```").expect("its end");
        let printed = text(&run(dir.path(), arguments, 4));
        assert!(printed.starts_with(shown), "{document}: hums {arguments} prints\n{printed}");
    }
}

fn examples(help: &str) -> Vec<String> {
    let lines = help.lines().filter_map(|line| line.strip_prefix("  hums "));
    let plain = |line: &str| {
        Some(line.split("   ").next()?.split(" | ").next()?.split(" > ").next()?.trim().to_owned())
    };
    lines.filter_map(plain).collect()
}

fn helps(dir: &Path) -> Vec<String> {
    let mut root = Cli::command();
    root.build();
    let mut commands = Vec::new();
    leaves(&root, &[], &mut commands);
    assert!(commands.len() > 10);
    std::iter::once(text(&run(dir, "--help", 0)))
        .chain(commands.iter().map(|(_, path)| text(&run(dir, &format!("{} --help", path.join(" ")), 0))))
        .collect()
}

/// Whether an example waits for a connection, takes as long as the flight, or needs a port that another program may
/// use.
fn waits(example: &str) -> bool {
    let for_a_link = ["serial:", "tcp:", "192.168.", "--listen"].iter().any(|form| example.contains(form));
    let live = example.starts_with(SERVES);
    for_a_link || (!live && (example.contains("udpin:") || example.contains("udpout:")))
}

fn serve(dir: &Path, example: &str) {
    let port = UdpSocket::bind("127.0.0.1:0").expect("a port").local_addr().expect("its address").port();
    let example = example.replace(":14550", &format!(":{port}"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_hums"));
    command
        .current_dir(dir)
        .env("PATH", "")
        // The output of the example that waits for a database is there.
        .args(example.split_whitespace())
        .args(["--listen", "127.0.0.1:0"]);
    let mut program = command.stdout(Stdio::piped()).spawn().expect("it runs");
    let mut first = String::new();
    let read = BufReader::new(program.stdout.take().expect("it is piped")).read_line(&mut first);
    program.kill().expect("it is ours");
    program.wait().expect("it is ours");
    assert!(read.is_ok() && first.starts_with("http://127.0.0.1:"), "hums {example}\n{first}");
}

fn furnished() -> TempDir {
    let dir = tempfile::tempdir().expect("directory");
    let path = |name: &str| dir.path().join(name);
    fs::rename(end_of("px4_hil_quad_low.tlog", dir.path()), path("flight.tlog")).expect("renamed");
    fs::write(path("hums.param"), "CELL_VOLT_WARN 3.6\n").expect("a file");
    run(dir.path(), "sim flight.tlog --sd card.img", 0);
    fs::create_dir(path("cards")).expect("a directory");
    copy(&path("card.img"), &path("cards/card.img"));
    // An example begins at 60 s.
    run(dir.path(), "decode --format hum PX4 -o 00001_00.HUM", 0);
    run(dir.path(), "decode --format ulog flight.tlog -o flight.ulg", 0);
    run(dir.path(), "decode --format parquet flight.tlog -o fleet", 0);
    fs::create_dir_all(path("flights/may")).expect("a directory");
    for copy in ["flights/may/flight.tlog", "flights/june.bin", "before.tlog"] {
        fs::copy(path("flight.tlog"), path(copy)).expect("a copy");
    }
    fs::rename(end_of("ap_quad_guided.tlog", dir.path()), path("after.tlog")).expect("renamed");
    dir
}

/// Copies a file or a folder. An image is nearly all holes, which only the system's own program preserves.
fn copy(from: &Path, to: &Path) {
    let copied = Command::new("cp").args(["-r", "--sparse=always"]).arg(from).arg(to).status().expect("cp");
    assert!(copied.success(), "cp {} {}", from.display(), to.display());
}

fn works(dir: &Path, example: &str) {
    let named = example.split_whitespace().skip_while(|word| *word != "-o").nth(1);
    let made = dir.join(named.unwrap_or("made"));
    if made.exists() {
        if made.is_dir() { fs::remove_dir_all(made) } else { fs::remove_file(made) }.expect("it is ours");
    }
    let output = hums().current_dir(dir).args(example.split_whitespace()).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    // 3: the example of a fault recorded losses; 4: a check has a finding.
    assert!(matches!(output.status.code(), Some(0 | 3 | 4)), "hums {example}\n{said}");
}

#[test]
fn every_example_that_needs_nobody_works_as_it_is_typed() {
    let anywhere = tempfile::tempdir().expect("directory");
    let (mut ran, mut elsewhere) = (BTreeSet::new(), BTreeSet::new());
    let furnished = furnished();
    for (index, help) in helps(anywhere.path()).into_iter().enumerate() {
        let dir = anywhere.path().join(index.to_string());
        copy(furnished.path(), &dir);
        for example in examples(&help) {
            let command = example.split(' ').next().unwrap_or_default().to_owned();
            if let Some(needed) = ELSEWHERE.iter().find(|needed| example.contains(**needed)) {
                elsewhere.insert(*needed);
            } else if !waits(&example) {
                if command == SERVES {
                    serve(&dir, &example);
                } else {
                    works(&dir, &example);
                }
                ran.insert(command);
            }
        }
    }
    let commands = "check compact completions decode due flight.tlog info live logbook man report share sim";
    assert_eq!(ran, commands.split(' ').map(String::from).collect(), "each of these ran");
    assert_eq!(elsewhere, BTreeSet::from(ELSEWHERE), "each of these has an example");
}
