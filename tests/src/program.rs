//! `hums` as run by a user.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;

use crate::child::{self, Outcome};
use crate::flights::root;
use crate::frames::{self, Frame, Seeds};

/// A command that takes longer hangs.
pub const LIMIT: Duration = Duration::from_mins(2);

/// A second of flight takes some 0.15 s on the chip's model.
pub const LIMIT_CHIP: Duration = Duration::from_mins(20);

/// The path from `HUMS_BIN`, or built once.
pub fn path() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| match std::env::var_os("HUMS_BIN") {
        Some(path) => PathBuf::from(path),
        None => build(),
    })
}

fn build() -> PathBuf {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(root()).args(["build", "--package=hums", "--message-format=json"]);
    let outcome = child::run(&mut cargo, Duration::from_mins(20)).expect_code(&[0]);
    let text = outcome.text();
    let mut messages = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let executable = messages.find_map(|message| message["executable"].as_str().map(PathBuf::from));
    executable.expect("the package hums has a program")
}

/// The users' build, beside that of the tests.
///
/// # Panics
///
/// There is none.
pub fn release() -> PathBuf {
    let release = path().with_file_name("../release/hums");
    assert!(release.is_file(), "{} is missing: `cargo xtask prove` builds it", release.display());
    release
}

/// The default board's ELF file: `HUMS_FIRMWARE`, or xtask's.
///
/// # Panics
///
/// There is none.
pub fn firmware() -> PathBuf {
    let built = || root().join(format!("target/firmware/hums-{}.elf", hums_boards::DEFAULT));
    let path = std::env::var_os("HUMS_FIRMWARE").map_or_else(built, PathBuf::from);
    assert!(path.is_file(), "{} is missing: `cargo xtask firmware`", path.display());
    path
}

/// The browser's program: `HUMS_BROWSER`, or its own build.
///
/// # Panics
///
/// There is none.
pub fn browser() -> PathBuf {
    let built = || root().join("target/wasm32-wasip1/debug/hums-browser.wasm");
    let path = std::env::var_os("HUMS_BROWSER").map_or_else(built, PathBuf::from);
    assert!(path.is_file(), "{} is missing: `cargo xtask test --only wasm`", path.display());
    path
}

/// `hums` with these arguments, not yet run.
pub fn command<A: AsRef<OsStr>>(arguments: impl IntoIterator<Item = A>) -> Command {
    let mut command = Command::new(path());
    command.args(arguments);
    command
}

/// Runs `hums` with these arguments.
#[track_caller]
pub fn hums<A: AsRef<OsStr>>(arguments: impl IntoIterator<Item = A>) -> Outcome {
    child::run(&mut command(arguments), LIMIT)
}

/// Runs `hums` with these words; each `{}` is the next one of these values.
///
/// # Panics
///
/// There are more or fewer values.
#[track_caller]
pub fn hums_with(words: &str, values: &[&dyn AsRef<OsStr>]) -> Outcome {
    let mut values = values.iter();
    let word = |word| match word {
        "{}" => (*values.next().expect("a value for each {}")).as_ref(),
        word => OsStr::new(word),
    };
    let words: Vec<&OsStr> = words.split(' ').map(word).collect();
    assert!(values.next().is_none(), "more values than {{}} in {words:?}");
    hums(words)
}

/// The machine that runs the pipeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Machine {
    /// `hums sim`: this PC.
    Sim,
    /// `hums sim --firmware`: the image on the model of its chip.
    Chip,
}

/// A finished recording, in a folder of its own.
#[derive(Debug)]
pub struct Recording {
    dir: TempDir,
    /// How `hums` ended.
    pub outcome: Outcome,
}

impl Recording {
    /// Records `input` with these further flags, with any result.
    #[track_caller]
    pub fn attempt(machine: Machine, input: &Path, flags: &[&str]) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let limit = match machine {
            Machine::Sim => LIMIT,
            Machine::Chip => LIMIT_CHIP,
        };
        // Tests read all of the card.
        let mut command = command(["sim", "--json", "--card-size", "64"]);
        command.arg(input).arg("--sd").arg(dir.path().join("card.img"));
        command.arg("--gs").arg(dir.path().join("gs.bin")).args(flags);
        match machine {
            Machine::Sim => command.args(["--speed", "max"]),
            Machine::Chip => command.arg("--firmware").arg(firmware()),
        };
        let outcome = child::run(&mut command, limit);
        Self { dir, outcome }
    }

    /// Exit code 0, or 3 if the input has bytes outside records.
    #[track_caller]
    pub fn make(machine: Machine, input: &Path, flags: &[&str]) -> Self {
        let recording = Self::attempt(machine, input, flags);
        let is_damaged =
            recording.outcome.stderr.contains("of no record of the tlog, and arriving as noise: ");
        recording.expect_code(if is_damaged { &[3] } else { &[0] })
    }

    /// Expects one of these exit codes.
    #[track_caller]
    #[must_use]
    pub fn expect_code(self, codes: &[i32]) -> Self {
        Self { outcome: self.outcome.expect_code(codes), ..self }
    }

    /// The card's image.
    pub fn image(&self) -> PathBuf {
        self.dir.path().join("card.img")
    }

    /// The ground station's bytes.
    pub fn gs(&self) -> PathBuf {
        self.dir.path().join("gs.bin")
    }

    /// The object that `--json` printed.
    pub fn json(&self) -> Value {
        let text = self.outcome.text();
        serde_json::from_str(&text)
            .unwrap_or_else(|error| panic!("--json printed no JSON ({error}): {text:?}"))
    }

    /// A number of the JSON.
    pub fn number(&self, name: &str) -> u64 {
        self.json()[name].as_u64().unwrap_or_else(|| panic!("--json has no number {name}: {}", self.json()))
    }

    /// The monitor's records on the card, in order.
    #[track_caller]
    pub fn records(&self) -> Vec<Value> {
        records(&self.image(), &[0])
    }

    /// Exit code: one of `codes`.
    #[track_caller]
    pub fn decode(&self, codes: &[i32]) -> Decoded {
        Decoded::of(&self.image(), codes)
    }
}

/// The monitor's records on a card; exit code: one of `codes`.
#[track_caller]
pub fn records(image: &Path, codes: &[i32]) -> Vec<Value> {
    let mut command = command(["decode".as_ref(), image.as_os_str(), "-o".as_ref(), "-".as_ref()]);
    let text = child::run(command.args(["--format", "jsonl"]), LIMIT).expect_code(codes).text();
    let records = text.lines().filter(|line| line.contains("\"record\":"));
    records.map(|line| serde_json::from_str(line).expect("a line of JSON")).collect()
}

/// A decoded card or log.
#[derive(Debug)]
pub struct Decoded {
    tlogs: Vec<Vec<u8>>,
}

impl Decoded {
    /// Decodes to tlog; exit code: one of `codes`.
    #[track_caller]
    pub fn of(source: &Path, codes: &[i32]) -> Self {
        let dir = tempfile::tempdir().unwrap();
        // A file for one log, a folder for several.
        let out = dir.path().join("out");
        let mut command = command(["decode".as_ref(), source.as_os_str(), "-o".as_ref(), out.as_os_str()]);
        child::run(command.args(["--format", "tlog"]), LIMIT).expect_code(codes);
        let mut files = Vec::new();
        collect(&out, &mut files);
        files.sort();
        Self { tlogs: files.iter().map(|file| fs::read(file).unwrap()).collect() }
    }

    /// All frames in the order of file names.
    pub fn frames(&self, seeds: &Seeds) -> Vec<Frame<'_>> {
        self.tlogs.iter().flat_map(|tlog| frames::of_tlog(tlog, seeds, true)).collect()
    }

    /// The files themselves.
    pub fn tlogs(&self) -> &[Vec<u8>] {
        &self.tlogs
    }
}

/// `path` may not exist.
fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    if path.is_file() {
        files.push(path.to_owned());
    } else if let Ok(entries) = fs::read_dir(path) {
        entries.for_each(|entry| collect(&entry.unwrap().path(), files));
    }
}
