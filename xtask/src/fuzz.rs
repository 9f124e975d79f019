//! `cargo xtask fuzz`: the fuzz targets under libFuzzer, one after the other. `fuzz/src/lib.rs` describes them.

use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result, bail};

use crate::repo;
use crate::shell::Shell;

/// The targets are the folders of the corpus: a test of `hums-fuzz` holds the one against the other.
const CORPUS: &str = "fuzz/corpus";
/// libFuzzer's new inputs are kept here, outside of the repository.
const FOUND: &str = "target/fuzz/found";
/// The longest input, in bytes; each target's own limit is for the mutations on stable Rust.
const BYTES_MAX: u32 = 16_384;

/// Runs each target for that many seconds. Inputs that break one are in `fuzz/libfuzzer/artifacts`.
pub(crate) fn run(seconds: u32) -> Result<()> {
    require(&["+nightly", "--version"], "a nightly compiler: rustup toolchain install nightly")?;
    require(&["fuzz", "--version"], "cargo-fuzz: cargo install cargo-fuzz")?;
    for target in targets(&repo::root().join(CORPUS))? {
        let found = repo::root().join(FOUND).join(&target);
        fs::create_dir_all(&found)?;
        // An input may take ten seconds and 2 GiB at most: nothing is unbounded.
        cargo()
            .env("HUMS_FUZZ_TARGET", &target)
            .args(["+nightly", "fuzz", "run", "--fuzz-dir", "fuzz/libfuzzer", "any"])
            .arg(&found)
            .arg(repo::root().join(CORPUS).join(&target))
            .args(["--", "-timeout=10", "-rss_limit_mb=2048", "-print_final_stats=1"])
            .arg(format!("-max_total_time={seconds}"))
            .arg(format!("-max_len={BYTES_MAX}"))
            .run()?;
    }
    Ok(())
}

/// The names of the folders in the corpus, in order.
fn targets(corpus: &Path) -> Result<Vec<String>> {
    let context = || format!("{}: cannot be read", corpus.display());
    let entries = fs::read_dir(corpus).with_context(context)?;
    let names = entries.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    let mut names = names.collect::<std::io::Result<Vec<_>>>().with_context(context)?;
    names.sort();
    Ok(names)
}

/// The `cargo` that understands `+nightly`: rustup's, not the one that runs this program.
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
    fn each_folder_of_the_corpus_is_a_target() {
        let targets = targets(&repo::root().join(CORPUS)).unwrap();
        assert!(
            ["card", "find", "page", "recording"].iter().all(|name| targets.contains(&(*name).to_owned()))
        );
    }
}
