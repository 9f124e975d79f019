//! `cargo xtask dist`: a release's files, the same from every build.
//!
//! Built from a commit in a clone: no stray file of the working copy. Flags and files are those of every build
//! ([`firmware::flags`], [`firmware::files`]). `--check` compares two builds in two places, runs the unit tests, and the
//! Windows program under Wine.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::{env, fs};

use anyhow::{Context as _, Result, bail};
use hums_update::keys;
use sha2::{Digest as _, Sha256};

use crate::browser;
use crate::budgets;
use crate::firmware;
use crate::repo::{self, FIRMWARE_TARGET};
use crate::setup::{self, MAC_TARGET, Need, STATIC_TARGET, WINDOWS_TARGET};
use crate::shell::Shell;
use crate::update::{self, SecretKey};
use crate::wine::{self, Wine};

/// Arguments of `dist`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Build them twice and compare, and run what is for Windows under Wine
    #[arg(long)]
    check: bool,
    /// File of the secret key that signs the update files: 64 hexadecimal digits. Without it there are none
    #[arg(long)]
    key: Option<PathBuf>,
}

/// The checked-out commit, in `target/dist`; with `--check` a second one elsewhere, compared.
pub(crate) fn run(options: &Options) -> Result<()> {
    let check = options.check;
    let key = options.key.as_deref().map(update::release_key).transpose()?.map(Rc::new);
    if key.is_some() && !git(&["status", "--porcelain", "--", KEYS])?.is_empty() {
        bail!("{KEYS} differs from the commit that the release is built from. Commit it first");
    }
    if key.is_none() {
        eprintln!("note: no update files (HUMS.UPD) without --key FILE; the others are for a cable");
    }
    if keys::ALL == [keys::TEST] {
        eprintln!("WARNING: {KEYS} has no key but the test key: no card can ever update these boxes");
    }
    let mut needs = vec![Need::Linker, Need::Clippy, Need::FirmwareTarget, Need::StaticTarget];
    needs.push(Need::BrowserTarget);
    needs.extend([Need::Musl, Need::WindowsTarget, Need::Mingw, Need::MacTarget]);
    needs.extend(check.then_some(Need::Wine));
    setup::require(&needs)?;
    ensure_tool("cyclonedx", &[])?;
    // Unoptimised it builds in a third of the time.
    ensure_tool("deny", &["--debug"])?;
    // `cargo xtask test` leaves out one board.
    budgets::check(&hums_boards::all().iter().collect::<Vec<_>>(), false)?;
    firmware::lint()?;
    without_std()?;
    dependencies()?;
    lint_for(WINDOWS_TARGET)?;
    lint_for(MAC_TARGET)?;
    let commit = git(&["rev-parse", "HEAD"])?;
    if !git(&["status", "--porcelain"])?.is_empty() {
        eprintln!("note: what is not committed is not in the release, which is of {commit}");
    }
    let folder = repo::target().join("dist");
    let files = Release::new(&commit, &repo::target().join("dist-build"), key.clone())?.make()?;
    write_all(&folder, &files)?;
    print!("{}", sums(&files));
    println!("{}", repo::shown(&folder));
    if !check {
        return Ok(());
    }
    let wine = Wine::start()?;
    wine.unit_tests()?;
    let windows = folder.join("hums.exe");
    check_findings(|flight| wine.run(&windows).args(["check", "--json"]).arg(flight), repo::root())?;
    wine::try_out(&wine, &windows, &repo::root().join(FAULTY))?;
    let elsewhere = env::temp_dir().join(format!("hums-built-again-{}", std::process::id()));
    let again = Release::new(&commit, &elsewhere, key).and_then(|release| release.make());
    // Gigabytes of no use.
    fs::remove_dir_all(&elsewhere).with_context(|| format!("cannot remove {}", elsewhere.display()))?;
    let again = again?;
    let different = differences(&files, &again);
    if !different.is_empty() {
        write_all(&repo::target().join("dist-again"), &again)?;
        bail!("built again elsewhere these differ: {different:?}; they are in target/dist-again");
    }
    println!("built again in {}: all {} files are the same", elsewhere.display(), files.len());
    Ok(())
}

/// Public keys that the boxes take.
const KEYS: &str = "firmware/update/keys";

/// Arguments for `hums`. One program is for pilots and for owners of a fleet: object storage has 5 of its 22 MB.
const fn hums(target: &str) -> [&str; 4] {
    ["--target", target, "--features", "object-storage"]
}

/// Name and content.
pub(crate) type File = (String, Vec<u8>);

struct Release {
    tree: PathBuf,
    commit: String,
    flags: OsString,
    key: Option<Rc<SecretKey>>,
}

impl Release {
    fn new(commit: &str, tree: &Path, key: Option<Rc<SecretKey>>) -> Result<Self> {
        if tree.exists() {
            fs::remove_dir_all(tree)?;
        }
        Shell::new("git").args(["clone", "--quiet", "--no-checkout", "."]).arg(tree).run()?;
        Shell::new("git").within(tree).args(["checkout", "--quiet", "--detach", commit]).run()?;
        let tree = tree.canonicalize()?;
        let flags = firmware::flags(&tree)?;
        Ok(Self { tree, commit: commit.to_owned(), flags, key })
    }

    fn make(&self) -> Result<Vec<File>> {
        let mut files = Vec::new();
        for board in hums_boards::all() {
            let arguments = firmware::cargo_arguments(firmware::APPLICATION);
            let arguments = [&arguments[..], &firmware::LAST.map(Into::into)].concat();
            self.cargo("build", &firmware::cargo_arguments(firmware::RESIDENT), &board.name)?;
            self.cargo("rustc", &arguments, &board.name)?;
            let programs = firmware::Programs::read(&self.target())?;
            let commit = self.commit.get(..12).unwrap_or(&self.commit);
            files.extend(firmware::files(board, &programs, commit, self.key.as_deref())?);
        }
        files.push(self.sbom("hums-firmware", "firmware/app", &[firmware::target()])?);
        files.push(self.sbom("hums-resident", "firmware/resident", &[firmware::target()])?);
        self.build(STATIC_TARGET)?;
        let program = self.target().join(STATIC_TARGET).join("release/hums");
        // The released program, not the tests' build.
        check_findings(|flight| Shell::new(&program).args(["check", "--json"]).arg(flight), &self.tree)?;
        files.push(read("hums", &program)?);
        files.extend(for_shells(&program)?);
        files.push(self.sbom("hums", "host-tools", &hums(STATIC_TARGET))?);
        self.build(WINDOWS_TARGET)?;
        files.push(read("hums.exe", &self.target().join(WINDOWS_TARGET).join("release/hums.exe"))?);
        files.push(self.sbom("hums.exe", "host-tools", &hums(WINDOWS_TARGET))?);
        files.push(self.check_page()?);
        for name in ["mavproxy_hums.py", "hums_texts.lua", "ParameterMetaData.xml"] {
            files.push(read(name, &self.tree.join("docs/stations").join(name))?);
        }
        for licence in ["LICENSE-APACHE", "LICENSE-MIT"] {
            files.push(read(licence, &self.tree.join(licence))?);
        }
        files.push(("README.txt".to_owned(), include_bytes!("release.txt").to_vec()));
        files.push(("BUILD".to_owned(), self.provenance()?.into_bytes()));
        files.push(("SHA256SUMS".to_owned(), sums(&files).into_bytes()));
        Ok(files)
    }

    fn check_page(&self) -> Result<File> {
        let [command, arguments @ ..] = browser::arguments(browser::SHIPPED);
        self.cargo(command, &arguments, hums_boards::DEFAULT)?;
        let page = self.target().join("hums-check.html");
        let run = ["--release", "--quiet", "--package=hums-browser", "--bin=hums-check-page", "--"];
        let paths = [browser::shipped(&self.target()), page.clone()];
        let paths: Vec<OsString> = paths.into_iter().map(PathBuf::into_os_string).collect();
        self.cargo("run", &[&run.map(Into::into)[..], &paths[..]].concat(), hums_boards::DEFAULT)?;
        read("hums-check.html", &page)
    }

    fn target(&self) -> PathBuf {
        self.tree.join("target")
    }

    fn build(&self, target: &str) -> Result<()> {
        let arguments = [&["--release", "--package=hums"][..], &hums(target)].concat();
        self.cargo("build", &arguments, hums_boards::DEFAULT)
    }

    fn cargo<A: AsRef<std::ffi::OsStr>>(&self, command: &str, arguments: &[A], board: &str) -> Result<()> {
        Shell::cargo()
            .within(&self.tree)
            .env("CARGO_TARGET_DIR", self.target())
            .env("CARGO_ENCODED_RUSTFLAGS", &self.flags)
            .env(firmware::BOARD, board)
            // Without the test key.
            .env("HUMS_RELEASE", "1")
            // In place of the time of day.
            .env("SOURCE_DATE_EPOCH", self.stamp()?)
            .args([command, "--locked"])
            .args(arguments)
            .run()
    }

    /// Seconds since 1970.
    fn stamp(&self) -> Result<String> {
        let stamp = Shell::new("git").within(&self.tree).args(["log", "-1", "--format=%ct"]).output()?;
        Ok(stamp.trim().to_owned())
    }

    /// `CycloneDX` of the program in `folder`: every crate that it is built of.
    fn sbom<A: AsRef<std::ffi::OsStr>>(&self, name: &str, folder: &str, arguments: &[A]) -> Result<File> {
        let folder = self.tree.join(folder);
        Shell::cargo()
            .within(&folder)
            .env("SOURCE_DATE_EPOCH", self.stamp()?)
            .args(["cyclonedx", "--quiet", "--format=json", "--spec-version=1.5", "--describe=binaries"])
            .arg("--manifest-path")
            .arg(folder.join("Cargo.toml"))
            .args(arguments)
            .run()?;
        let suffix = "_bin.cdx.json";
        let made = fs::read_dir(&folder)?.filter_map(|entry| Some(entry.ok()?.path()));
        let made = made.filter(|path| path.to_string_lossy().ends_with(suffix));
        let [made] = <[PathBuf; 1]>::try_from(made.collect::<Vec<_>>())
            .map_err(|all| anyhow::anyhow!("cargo cyclonedx made {} files, not one", all.len()))?;
        let text = fs::read_to_string(&made)?;
        fs::remove_file(&made)?;
        let text = text.replace(&*self.tree.to_string_lossy(), "/hums");
        Ok((format!("{name}.cdx.json"), text.into_bytes()))
    }

    /// Information for a reproduction of the build.
    fn provenance(&self) -> Result<String> {
        let rustc = Shell::new(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
        let rustc = rustc.args(["--version", "--verbose"]).output()?;
        let key = if self.key.is_some() { " --key FILE" } else { "" };
        Ok(format!("commit {}\n{rustc}command cargo xtask dist{key}\n", self.commit))
    }
}

/// Faults of `docs/usage.md`.
const FAULTY: &str = "tests/flights/ap_quad_faults.tlog";

fn check_findings(program: impl Fn(&Path) -> Shell, tree: &Path) -> Result<()> {
    const FINDINGS: [&str; 3] = ["cell_voltage", "autopilot_state", "batt_state"];
    let (json, code) = program(&tree.join(FAULTY)).output_and_code()?;
    let missing: Vec<_> =
        FINDINGS.into_iter().filter(|check| !json.contains(&format!("\"{check}\""))).collect();
    if code != 4 || !missing.is_empty() {
        bail!(
            "the program of the release does not find {} in {FAULTY} (exit code {code}, not 4)",
            missing.join(", ")
        );
    }
    Ok(())
}

/// `cargo xtask test` builds for no other system.
fn lint_for(target: &str) -> Result<()> {
    let choice = ["--package=hums", "--lib", "--bins", "--target", target];
    Shell::cargo().arg("clippy").args(choice).args(["--", "-D", "warnings"]).run()
}

fn for_shells(program: &Path) -> Result<Vec<File>> {
    let made = |name: &str, arguments: &[&str]| -> Result<File> {
        Ok((name.to_owned(), Shell::new(program).args(arguments).output()?.into_bytes()))
    };
    let mut files = Vec::new();
    for (name, shell) in
        [("hums.bash", "bash"), ("_hums", "zsh"), ("hums.fish", "fish"), ("hums.ps1", "powershell")]
    {
        files.push(made(name, &["completions", shell])?);
    }
    let (name, page) = made("hums.1", &["man"])?;
    // Names its commands' pages.
    let text = String::from_utf8_lossy(&page).replace("\\-", "-");
    let commands = text.lines().filter_map(|line| line.strip_prefix("hums-")?.strip_suffix("(1)"));
    for command in commands.filter(|command| *command != "help") {
        files.push(made(&format!("hums-{command}.1"), &["man", command])?);
    }
    files.push((name, page));
    Ok(files)
}

/// Installed if missing.
fn ensure_tool(name: &str, options: &[&str]) -> Result<()> {
    if Shell::cargo().args([name, "--version"]).ask().is_some() {
        return Ok(());
    }
    let package = format!("cargo-{name}");
    eprintln!("{package} is not installed: building it, once (some minutes)");
    Shell::cargo().args(["install", "--quiet", "--locked"]).args(options).arg(package).run()
}

/// The target has no std: `hums-onboard` and its crates must compile without. `hums-app` turns further features on: left out.
fn without_std() -> Result<()> {
    firmware::cargo(firmware::default_board())?
        .args(["check", "--profile=firmware", "--target", FIRMWARE_TARGET, "--package=hums-onboard"])
        .run()
}

/// By deny.toml. Advisories need a network and appear at any time: no failure.
fn dependencies() -> Result<()> {
    let deny = || Shell::cargo().args(["deny", "--log-level", "warn"]);
    deny()
        .args(["check", "bans", "licenses", "sources"])
        .run()
        .context("cargo deny refuses a dependency; its messages are above, its rules in deny.toml")?;
    if deny().args(["fetch", "db"]).ask().is_none() {
        eprintln!(
            "note: advisories about dependencies were not looked at, because their database cannot be fetched"
        );
    } else if deny().args(["check", "--disable-fetch", "advisories"]).run().is_err() {
        eprintln!("warning: there are advisories about dependencies, see above");
    }
    Ok(())
}

fn git(arguments: &[&str]) -> Result<String> {
    Ok(Shell::new("git").args(arguments).output()?.trim().to_owned())
}

fn read(name: &str, path: &Path) -> Result<File> {
    let data = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok((name.to_owned(), data))
}

fn write_all(folder: &Path, files: &[File]) -> Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder)?;
    }
    fs::create_dir_all(folder)?;
    for (name, data) in files {
        fs::write(folder.join(name), data)?;
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        fs::set_permissions(folder.join("hums"), fs::Permissions::from_mode(0o755))?;
    }
    Ok(())
}

pub(crate) fn sums(files: &[File]) -> String {
    files.iter().fold(String::new(), |mut text, (name, data)| {
        for byte in Sha256::digest(data) {
            let _ = write!(text, "{byte:02x}");
        }
        let _ = writeln!(text, "  {name}");
        text
    })
}

fn differences<'a>(one: &'a [File], other: &'a [File]) -> BTreeSet<&'a str> {
    let [one, other] = [one, other].map(BTreeSet::from_iter);
    one.symmetric_difference(&other).map(|&file| file.0.as_str()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str, data: &[u8]) -> File {
        (name.to_owned(), data.to_vec())
    }

    #[test]
    fn sums_are_those_of_sha256sum() {
        // FIPS 180-4's example.
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  a\n";
        assert_eq!(sums(&[file("a", b"abc")]), expected);
    }

    #[test]
    fn one_byte_or_one_file_more_is_a_difference() {
        let one = [file("a", b"1"), file("b", b"2")];
        assert!(differences(&one, &one).is_empty());
        let b = BTreeSet::from(["b"]);
        assert_eq!(differences(&one, &[file("a", b"1"), file("b", b"3")]), b);
        assert_eq!(differences(&one, &one[..1]), b);
        assert_eq!(differences(&one[..1], &one), b);
    }
}
