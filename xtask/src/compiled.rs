//! What a build compiled of ours: lints and documentation begin with the dependencies that it left. `cargo clippy` and `cargo doc`
//! would first compile each of those once more, which takes longer than the lints.
//!
//! cargo runs this program as its `RUSTC_WRAPPER`, which changes nothing in what it builds. It notes each command line of the
//! compiler, with what cargo says in the environment. A note that is older than what was built is of another build: see
//! [`Compiled::is_known`].

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::SystemTime;
use std::{env, fs};

use anyhow::{Context as _, Result, bail};
use cargo_metadata::diagnostic::DiagnosticLevel;
use cargo_metadata::{Artifact, Message, TargetKind};
use serde::{Deserialize, Serialize};

use crate::repo;
use crate::shell::Shell;

/// Where the notes go, for this program in the place of rustc.
const FOLDER: &str = "HUMS_NOTES";

/// What cargo and build scripts of ours say in the environment begins so.
const SAID: [&str; 7] = [
    "CARGO_BIN_",
    "CARGO_CRATE_",
    "CARGO_MANIFEST_",
    "CARGO_PKG_",
    "CARGO_TARGET_TMPDIR",
    "HUMS_",
    "OUT_DIR",
];

/// The builds of one folder and choice.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Compiled(pub(crate) &'static str);

/// What cargo said of a build.
#[derive(Debug, Default)]
pub(crate) struct Said {
    /// What it compiled or found compiled.
    pub(crate) artifacts: Vec<Artifact>,
    /// The compiler had a warning, now or when it compiled.
    pub(crate) warned: bool,
}

/// A source file that was compiled, alone or with its tests.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
struct Unit {
    /// From the root.
    source: PathBuf,
    with_tests: bool,
    is_library: bool,
    built: PathBuf,
}

/// How the compiler was called.
#[derive(Debug, Serialize, Deserialize)]
struct Call {
    compiler: PathBuf,
    arguments: Vec<String>,
    environment: BTreeMap<String, String>,
}

/// Variables by which somebody has a wrapper of the compiler of his own. (One of cargo's configuration gives way to ours.)
const WRAPPERS: [&str; 4] = [
    "RUSTC_WRAPPER",
    "CARGO_BUILD_RUSTC_WRAPPER",
    "RUSTC_WORKSPACE_WRAPPER",
    "CARGO_BUILD_RUSTC_WORKSPACE_WRAPPER",
];

impl Compiled {
    fn folder(self) -> PathBuf {
        repo::target().join("test").join(self.0)
    }

    /// Runs cargo, so that it notes what it compiles. Notes are not kept for who has a wrapper of his own.
    pub(crate) fn by(self, cargo: Shell) -> Result<Said> {
        let mut cargo = cargo.arg("--message-format=json");
        let is_free = |name: &&str| env::var_os(name).is_none_or(|wrapper| wrapper.is_empty());
        if WRAPPERS.iter().all(is_free) {
            fs::create_dir_all(self.folder())?;
            // A copy: the build may replace the file of this program.
            let (this, stand_in) = (Path::new("/proc/self/exe"), self.folder().join("rustc"));
            let this = if this.exists() { this.to_owned() } else { env::current_exe()? };
            fs::copy(this, &stand_in).with_context(|| stand_in.display().to_string())?;
            cargo = cargo.env("RUSTC_WRAPPER", &stand_in).env(FOLDER, self.folder());
        }
        let (text, code) = cargo.output_and_code()?;
        let mut said = Said::default();
        for message in Message::parse_stream(text.as_bytes()) {
            match message? {
                Message::CompilerArtifact(artifact) => said.artifacts.push(artifact),
                Message::CompilerMessage(message) => {
                    eprintln!("{}", message.message.rendered.unwrap_or(message.message.message));
                    said.warned |= message.message.level == DiagnosticLevel::Warning;
                }
                _ => {}
            }
        }
        if code == 0 { Ok(said) } else { bail!("cargo ended with exit code {code}") }
    }

    /// Keeps which sources a build has compiled, now or before, from what cargo said.
    pub(crate) fn keep(self, artifacts: &[Artifact]) -> Result<()> {
        let unit = |artifact: &Artifact| {
            Some(Unit {
                source: artifact.target.src_path.as_std_path().strip_prefix(repo::root()).ok()?.to_owned(),
                with_tests: artifact.profile.test,
                is_library: artifact.target.kind.contains(&TargetKind::Lib),
                built: artifact.filenames.first()?.into(),
            })
        };
        let mut units: Vec<Unit> = artifacts.iter().filter_map(unit).collect();
        units.sort();
        fs::create_dir_all(self.folder())?;
        fs::write(self.folder().join("units.json"), serde_json::to_vec(&units)?)?;
        Ok(())
    }

    fn units(self) -> Vec<Unit> {
        let bytes = fs::read(self.folder().join("units.json")).unwrap_or_default();
        serde_json::from_slice(&bytes).unwrap_or_default()
    }

    /// Whether each of these was compiled while notes were kept, and nothing was built of it since.
    fn is_known(self, units: &[Unit]) -> bool {
        !units.is_empty()
            && units.iter().all(|unit| {
                let note = time(&note(&self.folder(), &unit.source, unit.with_tests));
                note.is_some() && note >= time(&unit.built)
            })
    }

    /// Lints all of it, each source once: with its tests where it has some (what the compiler itself has to say without them, it said in
    /// the build). A warning is an error. `false` if it is not known how it was compiled.
    pub(crate) fn lint(self) -> Result<bool> {
        let units = self.units();
        let has_tests = |unit: &Unit| units.iter().any(|one| one.with_tests && one.source == unit.source);
        let units: Vec<Unit> =
            units.iter().filter(|unit| unit.with_tests || !has_tests(unit)).cloned().collect();
        self.each(&units, "linted", |call, out| {
            let mut command = Command::new(call.compiler.with_file_name("clippy-driver"));
            // As `cargo clippy -- -D warnings` passes it on.
            command.env("CLIPPY_ARGS", "-D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__");
            command.arg(&call.compiler).args(call.for_lints()).arg("--out-dir").arg(out);
            command
        })
    }

    /// Writes the documentation of its libraries; a warning is an error. `false` if it is not known how they were compiled.
    pub(crate) fn document(self) -> Result<bool> {
        let units = self.units();
        let units: Vec<Unit> = units.into_iter().filter(|unit| unit.is_library && !unit.with_tests).collect();
        self.each(&units, "documented", |call, _| {
            let mut command = Command::new(call.compiler.with_file_name("rustdoc"));
            command.args(call.for_documentation()).args(["--document-private-items", "-D", "warnings", "-o"]);
            command.arg(repo::target().join("doc"));
            command
        })
    }

    /// Runs a program for each that has changed since it was `done`.
    fn each(self, units: &[Unit], done: &str, program: impl Fn(&Call, &Path) -> Command) -> Result<bool> {
        if !self.is_known(units) {
            return Ok(false);
        }
        let out = self.folder().join(done);
        fs::create_dir_all(&out)?;
        let rules = time(&repo::root().join("clippy.toml"));
        let mut failed = Vec::new();
        for unit in units {
            let note = note(&self.folder(), &unit.source, unit.with_tests);
            let mark = out.join(note.file_name().unwrap_or_default());
            if time(&mark) >= time(&note).max(rules) {
                continue;
            }
            let call: Call = serde_json::from_slice(&fs::read(&note)?)?;
            let mut command = program(&call, &out);
            command.envs(&call.environment).current_dir(repo::root());
            let name = unit.source.display().to_string();
            eprintln!("{done}: {name}");
            if command.status().with_context(|| format!("{}", command.get_program().display()))?.success() {
                fs::write(&mark, "")?;
            } else {
                failed.push(name);
            }
        }
        if !failed.is_empty() {
            bail!("not {done}, because of warnings or errors: {}", failed.join(", "));
        }
        Ok(true)
    }
}

impl Call {
    /// The arguments that say what is compiled with what; without those of what is written and of how errors are shown.
    fn for_lints(&self) -> Vec<&str> {
        let mut kept = vec!["--emit=metadata"];
        let mut words = self.arguments.iter().map(String::as_str);
        while let Some(word) = words.next() {
            match word {
                "--out-dir" => drop(words.next()),
                _ if ["--emit=", "--error-format=", "--json="].iter().any(|one| word.starts_with(one)) => {}
                _ => kept.push(word),
            }
        }
        kept
    }

    /// Those of them that rustdoc has too.
    fn for_documentation(&self) -> Vec<&str> {
        const WITH_VALUE: [&str; 7] =
            ["--crate-name", "--crate-type", "--cfg", "--check-cfg", "--extern", "--target", "-L"];
        let mut kept = Vec::new();
        let mut words = self.arguments.iter().map(String::as_str);
        while let Some(word) = words.next() {
            if WITH_VALUE.contains(&word) {
                kept.push(word);
                kept.extend(words.next());
            } else if word.starts_with("--edition=") || is_source(word) {
                kept.push(word);
            }
        }
        kept
    }
}

/// Ours: cargo names sources of the workspace from its root, others by their whole path.
fn is_source(word: &str) -> bool {
    let path = Path::new(word);
    path.is_relative() && path.extension().is_some_and(|extension| extension == "rs")
}

fn note(folder: &Path, source: &Path, with_tests: bool) -> PathBuf {
    let name = source.display().to_string().replace(['/', '\\'], "_");
    folder.join(format!("{name}{}.json", if with_tests { "-tests" } else { "" }))
}

/// When a file was last written; `None` before all times.
fn time(path: &Path) -> Option<SystemTime> {
    fs::metadata(path).ok()?.modified().ok()
}

/// In the place of rustc, if this program was started so: the first argument is the compiler.
pub(crate) fn stand_in() -> Option<ExitCode> {
    let folder = env::var_os(FOLDER)?;
    let mut arguments = env::args_os().skip(1);
    let compiler = PathBuf::from(arguments.next()?);
    Some(compile(&compiler, &arguments.collect::<Vec<_>>(), Path::new(&folder)).unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    }))
}

fn compile(compiler: &Path, arguments: &[OsString], folder: &Path) -> Result<ExitCode> {
    let status = Command::new(compiler).args(arguments).status().context("rustc cannot be run")?;
    if !status.success() {
        return Ok(ExitCode::FAILURE);
    }
    let arguments: Option<Vec<String>> = arguments.iter().map(|one| Some(one.to_str()?.to_owned())).collect();
    let Some(arguments) = arguments.filter(|_| compiler.file_stem().is_some_and(|name| name == "rustc"))
    else {
        return Ok(ExitCode::SUCCESS);
    };
    // Build scripts of others try the compiler too.
    let is_ours =
        env::var_os("CARGO_MANIFEST_DIR").is_some_and(|of| Path::new(&of).starts_with(repo::root()));
    if let Some(source) = arguments.iter().find(|word| is_ours && is_source(word)) {
        let note = note(folder, Path::new(source), arguments.iter().any(|word| word == "--test"));
        let said = |name: &String| SAID.iter().any(|one| name.starts_with(one));
        let environment = env::vars_os().filter_map(|(name, value)| {
            Some((name.into_string().ok().filter(said)?, value.into_string().ok()?))
        });
        let call = Call { compiler: compiler.to_owned(), environment: environment.collect(), arguments };
        fs::write(&note, serde_json::to_vec(&call)?).with_context(|| note.display().to_string())?;
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn call() -> Call {
        let line = "--crate-name a --edition=2024 a/src/lib.rs --error-format=json --json=artifacts --crate-type lib \
                    --emit=dep-info,metadata,link -C opt-level=1 --warn=clippy::pedantic --cfg f --out-dir deps -L dependency=deps \
                    --extern b=deps/libb.rmeta";
        let arguments = line.split_whitespace().map(str::to_owned).collect();
        Call { compiler: "rustc".into(), arguments, environment: BTreeMap::new() }
    }

    #[test]
    fn lints_write_nothing_that_the_build_uses_and_have_all_else() {
        assert_eq!(
            call().for_lints().join(" "),
            "--emit=metadata --crate-name a --edition=2024 a/src/lib.rs --crate-type lib -C opt-level=1 \
             --warn=clippy::pedantic --cfg f -L dependency=deps --extern b=deps/libb.rmeta"
        );
    }

    #[test]
    fn documentation_is_of_the_same_crate_with_the_same_dependencies() {
        assert_eq!(
            call().for_documentation().join(" "),
            "--crate-name a --edition=2024 a/src/lib.rs --crate-type lib --cfg f -L dependency=deps --extern b=deps/libb.rmeta"
        );
    }

    #[test]
    fn a_source_of_ours_is_named_from_the_root() {
        assert!(is_source("host-tools/src/main.rs"));
        assert!(!is_source("/home/registry/a/src/lib.rs") && !is_source("lib"));
    }
}
