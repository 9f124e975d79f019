//! `cargo xtask test --quick`.

use std::path::Path;

use anyhow::{Context as _, Result};
use cargo_metadata::{MetadataCommand, Package};

use crate::firmware;
use crate::pc;
use crate::repo;
use crate::shell::Shell;

/// Packages that only cross-compile.
const FIRMWARE: [&str; 3] = [firmware::APPLICATION, firmware::RESIDENT, firmware::CHIP];

/// Changed packages: since the last commit, or in it.
pub(super) fn run() -> Result<()> {
    pc::check_format()?;
    let mut files =
        git(&["diff", "--name-only", "HEAD"])? + &git(&["ls-files", "--others", "--exclude-standard"])?;
    if files.is_empty() {
        files = git(&["diff", "--name-only", "HEAD~1"])?;
    }
    let metadata = MetadataCommand::new().no_deps().current_dir(repo::root()).exec()?;
    let mut changed: Vec<&str> =
        files.lines().filter_map(|file| package(Path::new(file), &metadata.packages)).collect();
    changed.sort_unstable();
    changed.dedup();
    if FIRMWARE.iter().any(|package| changed.contains(package)) {
        firmware::lint()?;
    }
    let choice: Vec<String> = changed
        .iter()
        .filter(|name| !FIRMWARE.contains(name))
        .map(|name| format!("--package={name}"))
        .collect();
    if choice.is_empty() {
        return Ok(());
    }
    Shell::cargo().arg("clippy").args(&choice).args(["--all-targets", "--", "-D", "warnings"]).run()?;
    Shell::cargo().args(["test", "--quiet", "--lib", "--bins"]).args(&choice).run()
}

fn package<'a>(file: &Path, packages: &'a [Package]) -> Option<&'a str> {
    let holds = |package: &&Package| {
        package.manifest_path.parent().is_some_and(|folder| repo::root().join(file).starts_with(folder))
    };
    let innermost = packages.iter().filter(holds).max_by_key(|package| package.manifest_path.as_str().len());
    innermost.map(|package| package.name.as_str())
}

fn git(arguments: &[&str]) -> Result<String> {
    Shell::new("git")
        .args(arguments)
        .ask()
        .with_context(|| format!("git {} failed: is this a git checkout?", arguments.join(" ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_belongs_to_the_innermost_package() {
        let metadata = MetadataCommand::new().no_deps().current_dir(repo::root()).exec().unwrap();
        for (file, name) in [
            ("firmware/core/src/lib.rs", Some("hums-core")),
            ("firmware/core/tests/docs.rs", Some("hums-core-tests")),
            ("docs/check.md", None),
        ] {
            assert_eq!(package(Path::new(file), &metadata.packages), name, "{file}");
        }
    }
}
