//! Asks pymavlink, in the environment that `cargo xtask setup` makes.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use serde_json::Value;

use crate::child;
use crate::flights::{Manifest, root};

/// pymavlink reads some 50,000 frames a second.
const LIMIT: Duration = Duration::from_mins(5);

fn from_environment(name: &str, otherwise: &str) -> PathBuf {
    let path = std::env::var_os(name).map_or_else(|| root().join(otherwise), PathBuf::from);
    assert!(path.exists(), "{} is missing: `cargo xtask setup` makes it", path.display());
    path
}

fn ask(script: &str, files: &[PathBuf]) -> String {
    let mut command = Command::new(from_environment("HUMS_PYTHON", "target/venv/bin/python"));
    command.arg(root().join("tests/oracle").join(script));
    command.arg(from_environment("HUMS_DIALECT", "target/oracle/hums_dialect.py")).args(files);
    // The repository stays as it is: no compiled scripts in it.
    command.env("PYTHONDONTWRITEBYTECODE", "1");
    child::run(&mut command, LIMIT).expect_code(&[0]).text()
}

/// What pymavlink finds in these recordings.
pub fn manifest(files: &[PathBuf]) -> Manifest {
    Manifest::parse(&ask("manifest.py", files))
}

/// Parses a stream to the ground station strictly and tells what was in it: see `tests/oracle/gs_stream.py`.
///
/// # Panics
/// If a single byte of it is not part of a good frame.
pub fn ground_station(stream: &Path) -> Value {
    serde_json::from_str(&ask("gs_stream.py", &[stream.to_owned()])).expect("gs_stream.py prints JSON")
}

/// Talks to the box at this UDP port as a ground station does: see `tests/oracle/companion.py`.
pub fn companion(port: u16) -> Value {
    let said = ask("companion.py", &[PathBuf::from(port.to_string())]);
    serde_json::from_str(&said).expect("companion.py prints JSON")
}
