//! Pymavlink in its own environment. `mavgen` makes the dialect from the `mavlink` crate's XML files.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context as _, Result};
use cargo_metadata::MetadataCommand;

use crate::repo;
use crate::shell::Shell;

/// The scripts and the pinned requirements.
const FOLDER: &str = "tests/oracle";

fn venv() -> PathBuf {
    repo::target().join("venv")
}

pub(crate) fn python() -> PathBuf {
    venv().join("bin/python")
}

/// A Python module.
pub(crate) fn dialect() -> PathBuf {
    repo::target().join("oracle/hums_dialect.py")
}

/// Unless there already.
pub(crate) fn prepare() -> Result<()> {
    let [requirements, alone] =
        ["requirements.txt", "requirements-alone.txt"].map(|name| repo::root().join(FOLDER).join(name));
    let read = |path: &PathBuf| fs::read_to_string(path).with_context(|| format!("{}", path.display()));
    let wanted = read(&requirements)? + &read(&alone)?;
    // Written last: an interrupted installation is made anew.
    let stamp = venv().join("requirements.txt");
    if fs::read_to_string(&stamp).ok().as_deref() != Some(&wanted) {
        Shell::new("python3").args(["-m", "venv", "--clear"]).arg(venv()).run()?;
        // Python compiles what is imported; all of it would take longer than the rest.
        let options = ["install", "--quiet", "--disable-pip-version-check", "--no-compile"];
        let pip = || Shell::new(python()).args(["-m", "pip"]).args(options);
        let install = |pip: Shell, list: &PathBuf| {
            pip.arg("-r").arg(list).run().context("pymavlink cannot be installed: is there a network?")
        };
        install(pip(), &requirements)?;
        install(pip().arg("--no-deps"), &alone)?;
        fs::write(&stamp, &wanted)?;
    }
    let definitions = definitions()?;
    let stamp = dialect().with_extension("stamp");
    let made_of = format!("{}\n{wanted}", definitions.display());
    if !dialect().is_file() || fs::read_to_string(&stamp).ok().as_deref() != Some(&made_of) {
        fs::create_dir_all(repo::target().join("oracle"))?;
        Shell::new(python())
            .args([
                "-m",
                "pymavlink.tools.mavgen",
                "--lang=Python3",
                "--wire-protocol=2.0",
                "--no-validate",
                "-o",
            ])
            .arg(dialect())
            .arg(definitions)
            .output()?;
        fs::write(stamp, made_of)?;
    }
    Ok(())
}

/// More packages, for one command: Spark has half a gigabyte.
pub(crate) fn install(list: &str) -> Result<()> {
    let list = repo::root().join(FOLDER).join(list);
    let pip =
        Shell::new(python()).args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"]);
    pip.arg(&list)
        .run()
        .with_context(|| format!("{} cannot be downloaded: is there a network?", list.display()))
}

fn definitions() -> Result<PathBuf> {
    let metadata = MetadataCommand::new().current_dir(repo::root()).exec()?;
    let package = metadata.packages.iter().find(|package| package.name.as_str() == "mavlink");
    let package = package.context("Cargo.lock has no mavlink crate, whose definitions are needed")?;
    let folder = package
        .manifest_path
        .parent()
        .context("cargo names no folder of the mavlink crate; run cargo fetch")?;
    Ok(folder.join("mavlink/message_definitions/v1.0/all.xml").into())
}
