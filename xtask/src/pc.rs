//! Builds for this PC: one choice for tests and campaigns. Test programs run without cargo.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use anyhow::{Context as _, Result, bail};
use cargo_metadata::diagnostic::DiagnosticLevel;
use cargo_metadata::{Artifact, Message, Metadata, MetadataCommand, TargetKind};

use crate::browser;
use crate::firmware;
use crate::hums;
use crate::oracle;
use crate::repo;
use crate::shell::Shell;

/// Without the firmware's binaries, which turn on other features in shared crates.
pub(crate) const CHOICE: [&str; 6] = [
    "--workspace",
    "--exclude=hums-app",
    "--exclude=hums-resident",
    "--exclude=hums-stm32f4",
    "--features",
    FEATURES,
];

const FEATURES: &str = "hums-tests/chip,hums-tests/browser,hums-tests/databases";

const END_TO_END: &str = "hums-tests";

#[derive(Debug)]
struct TestProgram {
    package: String,
    name: String,
    /// From `tests/`, not from the sources.
    is_integration: bool,
    folder: PathBuf,
    path: PathBuf,
}

/// The programs that [`build`] built.
static PROGRAMS: OnceLock<Vec<TestProgram>> = OnceLock::new();

/// `hums`, campaigns and tests by one call; a warning is an error. Examples are only linted.
pub(crate) fn build() -> Result<()> {
    let cargo = Shell::cargo()
        .args(["test", "--no-run", "--message-format=json", "--lib", "--bins", "--tests"])
        .args(CHOICE);
    let (messages, code) = cargo.output_and_code()?;
    let (mut artifacts, mut warned) = (Vec::new(), false);
    for message in Message::parse_stream(messages.as_bytes()) {
        match message? {
            Message::CompilerArtifact(artifact) => artifacts.push(artifact),
            Message::CompilerMessage(message) => {
                eprintln!("{}", message.message.rendered.unwrap_or(message.message.message));
                warned |= message.message.level == DiagnosticLevel::Warning;
            }
            _ => {}
        }
    }
    if code != 0 {
        bail!("cargo ended with exit code {code}");
    }
    let metadata = MetadataCommand::new().no_deps().current_dir(repo::root()).exec()?;
    let mut programs = test_programs(artifacts, &metadata)?;
    programs.sort_by(|a, b| (&a.package, &a.name).cmp(&(&b.package, &b.name)));
    println!("{} test programs", programs.len());
    PROGRAMS.get_or_init(|| programs);
    if warned {
        bail!("the compiler has warnings");
    }
    Ok(())
}

fn test_programs(artifacts: Vec<Artifact>, metadata: &Metadata) -> Result<Vec<TestProgram>> {
    let mut programs = Vec::new();
    for Artifact { package_id, target, profile, executable, .. } in artifacts {
        let (Some(path), true) = (executable, profile.test) else { continue };
        let package = metadata.packages.iter().find(|package| package.id == package_id);
        let package = package
            .with_context(|| format!("cargo metadata has no package {package_id}; run cargo clean"))?;
        programs.push(TestProgram {
            package: package.name.to_string(),
            name: target.name,
            is_integration: target.kind.contains(&TargetKind::Test),
            folder: package
                .manifest_path
                .parent()
                .context("a package of the workspace has no folder")?
                .into(),
            path: path.into(),
        });
    }
    Ok(programs)
}

fn programs() -> Result<&'static [TestProgram]> {
    PROGRAMS.get().map(Vec::as_slice).context("the tests were not built; cargo's messages are above")
}

pub(crate) fn unit_tests() -> Result<()> {
    for program in programs()?.iter().filter(|one| !(one.is_integration && one.package == END_TO_END)) {
        run(program, &browser::tested(), &[])?;
    }
    Ok(())
}

pub(crate) fn end_to_end(arguments: &[&str]) -> Result<()> {
    end_to_end_with(&browser::tested(), arguments)
}

/// With this program of the check in a browser.
pub(crate) fn end_to_end_with(browser: &Path, arguments: &[&str]) -> Result<()> {
    let program = programs()?.iter().find(|one| one.is_integration && one.package == END_TO_END);
    run(program.with_context(|| format!("cargo built no tests of {END_TO_END}"))?, browser, arguments)
}

pub(crate) fn check_format() -> Result<()> {
    Shell::cargo().args(["fmt", "--all", "--", "--check"]).run()
}

/// A warning is an error.
pub(crate) fn lint() -> Result<()> {
    Shell::cargo().arg("clippy").args(CHOICE).args(["--all-targets", "--", "-D", "warnings"]).run()
}

/// A warning is an error.
pub(crate) fn document() -> Result<()> {
    Shell::cargo()
        .env("RUSTDOCFLAGS", "-D warnings")
        .args(["doc", "--quiet", "--lib", "--no-deps", "--document-private-items"])
        .args(CHOICE)
        .run()
}

pub(crate) fn short_campaigns() -> Result<()> {
    Shell::new(repo::target().join("debug/prove")).arg("--short").run()
}

/// As `cargo test` runs it.
fn run(program: &TestProgram, browser: &Path, options: &[&str]) -> Result<()> {
    println!("\n{} {}", program.package, program.name);
    Shell::new(&program.path)
        .env("HUMS_FIRMWARE", firmware::image_of(firmware::default_board()))
        .env("HUMS_DIALECT", oracle::dialect())
        .env("HUMS_PYTHON", oracle::python())
        .env("HUMS_BIN", hums::program())
        .env("HUMS_BROWSER", browser)
        .env("CARGO_MANIFEST_DIR", &program.folder)
        .within(&program.folder)
        .args(options)
        .run()
}
