//! `cargo xtask fuzz`: the targets of `fuzz/src/lib.rs` under libFuzzer.

use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result, bail};

use crate::repo;
use crate::shell::Shell;

/// Folders are targets: a test of `hums-fuzz` compares them.
const CORPUS: &str = "fuzz/corpus";
/// New inputs, outside of the repository.
const FOUND: &str = "target/fuzz/found";
/// Bytes; targets' limits are for mutations on stable Rust.
const BYTES_MAX: u32 = 16_384;

/// Failing inputs: `fuzz/libfuzzer/artifacts`.
pub(crate) fn run(seconds: u32) -> Result<()> {
    require(&["+nightly", "--version"], "a nightly compiler: rustup toolchain install nightly")?;
    require(&["fuzz", "--version"], "cargo-fuzz: cargo install cargo-fuzz")?;
    for target in targets(&repo::root().join(CORPUS))? {
        let found = repo::root().join(FOUND).join(&target);
        fs::create_dir_all(&found)?;
        // Ten seconds and 2 GiB at most.
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

fn targets(corpus: &Path) -> Result<Vec<String>> {
    let context = || format!("{}: cannot be read", corpus.display());
    let entries = fs::read_dir(corpus).with_context(context)?;
    let names = entries.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    let mut names = names.collect::<std::io::Result<Vec<_>>>().with_context(context)?;
    names.sort();
    Ok(names)
}

/// Rustup's, which understands `+nightly`.
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
