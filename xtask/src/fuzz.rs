//! `cargo xtask fuzz`: the fuzz targets, one after the other.

use anyhow::{Result, bail};

use crate::repo;
use crate::shell::Shell;

/// A target, the longest input it is given, and a folder with inputs to begin with.
const TARGETS: [(&str, u32, Option<&str>); 4] = [
    ("framer", 4_096, None),
    ("round_trip", 8_192, None),
    ("decoder", 8_192, None),
    ("reader", 16_384, Some("firmware/blackbox/tests/golden")),
];

/// How long each target runs unless told.
pub(crate) const SECONDS: u32 = 300;

pub(crate) fn parse(words: &[&str]) -> Result<u32> {
    match words {
        [] => Ok(SECONDS),
        ["--seconds", seconds] => Ok(seconds.parse()?),
        _ => bail!("fuzz takes --seconds N"),
    }
}

/// Runs each target for so many seconds; what it finds lies in `fuzz/artifacts`.
pub(crate) fn run(seconds: u32) -> Result<()> {
    require(&["+nightly", "--version"], "a nightly compiler: rustup toolchain install nightly")?;
    require(&["fuzz", "--version"], "cargo-fuzz: cargo install cargo-fuzz")?;
    for (target, bytes_max, seeds) in TARGETS {
        let corpus = repo::root().join("fuzz/corpus").join(target);
        std::fs::create_dir_all(&corpus)?;
        let mut shell = cargo().args(["+nightly", "fuzz", "run", "--fuzz-dir", "fuzz", target]).arg(&corpus);
        if let Some(seeds) = seeds {
            shell = shell.arg(repo::root().join(seeds));
        }
        // An input may take ten seconds and 2 GiB at most: nothing is unbounded.
        shell
            .args(["--", "-timeout=10", "-rss_limit_mb=2048", "-print_final_stats=1"])
            .arg(format!("-max_total_time={seconds}"))
            .arg(format!("-max_len={bytes_max}"))
            .run()?;
    }
    Ok(())
}

/// The `cargo` that understands `+nightly`: that of rustup, not the one that runs this program.
fn cargo() -> Shell {
    Shell::new("cargo")
}

fn require(arguments: &[&str], what: &str) -> Result<()> {
    match cargo().args(arguments).ask() {
        Some(_) => Ok(()),
        None => bail!("fuzzing needs {what}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_is_five_minutes_or_what_is_said() {
        assert_eq!(parse(&[]).unwrap(), SECONDS);
        assert_eq!(parse(&["--seconds", "7"]).unwrap(), 7);
        assert!(parse(&["--seconds"]).is_err());
        assert!(parse(&["--second", "7"]).is_err());
    }
}
