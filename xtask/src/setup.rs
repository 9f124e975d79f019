//! What the other commands need, and its installation where that is allowed.
//!
//! Allowed means: as root, or with a `sudo` that asks for no password, on a system with `apt-get`; and `rustup` for
//! what belongs to Rust. Everything else is said, ready to be typed, and left to the user. With `HUMS_SETUP=never` in
//! the environment nothing is installed.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::{env, fs};

use anyhow::{Result, bail};

use crate::apt::{self, Distribution, SourceFile};
use crate::repo::FIRMWARE_TARGET;
use crate::shell::{Shell, is_root};

/// The emulator's first version that has the STM32F405's 128 KiB of SRAM and its 64 KiB of CCM.
const QEMU_MAJOR_MIN: u32 = 8;

/// The target of a `hums` that needs no library of the machine it runs on.
pub(crate) const STATIC_TARGET: &str =
    if cfg!(target_arch = "aarch64") { "aarch64-unknown-linux-musl" } else { "x86_64-unknown-linux-musl" };

/// Something that a command needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Need {
    /// `cc`: rustc links with it. (`.cargo/linker` sees to it before this program can run at all.)
    Linker,
    FirmwareTarget,
    StaticTarget,
    Rustfmt,
    Clippy,
    Qemu,
    Mtools,
    Dosfstools,
    PythonVenv,
    Influx,
    Victoria,
    Chromium,
    Graphviz,
}

impl Need {
    pub(crate) const ALL: [Self; 13] = [
        Self::Linker,
        Self::FirmwareTarget,
        Self::StaticTarget,
        Self::Rustfmt,
        Self::Clippy,
        Self::Qemu,
        Self::Mtools,
        Self::Dosfstools,
        Self::PythonVenv,
        Self::Influx,
        Self::Victoria,
        Self::Chromium,
        Self::Graphviz,
    ];

    /// What it is and what it is for.
    fn purpose(self) -> &'static str {
        match self {
            Self::Linker => "a C linker (cc), for everything that rustc builds",
            Self::FirmwareTarget => "the Rust target thumbv7em-none-eabihf, for the firmware",
            Self::StaticTarget => "Rust's musl target, for the static hums of a release",
            Self::Rustfmt => "rustfmt, for the check of the formatting",
            Self::Clippy => "clippy, for the lints",
            Self::Qemu => "qemu-system-arm 8.0 or later, which runs the firmware",
            Self::Mtools => "mtools, which reads the card's image independently of our own reader",
            Self::Dosfstools => "dosfstools (fsck.vfat), which checks the card's file system",
            Self::PythonVenv => "python3 with venv, for pymavlink, the independent reader of MAVLink",
            Self::Influx => "influxdb, which takes the line protocol",
            Self::Victoria => "victoria-metrics, another database that takes the line protocol",
            Self::Chromium => "chromium and its driver, which look at the pages",
            Self::Graphviz => "graphviz (dot), which draws the picture of the modules",
        }
    }

    fn present(self) -> bool {
        let cargo_has = |tool: &str| Shell::cargo().args([tool, "--version"]).ask().is_some();
        match self {
            Self::Linker => find_program("cc").is_some(),
            Self::FirmwareTarget => target_installed(FIRMWARE_TARGET),
            Self::StaticTarget => target_installed(STATIC_TARGET),
            Self::Rustfmt => cargo_has("fmt"),
            Self::Clippy => cargo_has("clippy"),
            Self::Qemu => qemu_major().is_some_and(|major| major >= QEMU_MAJOR_MIN),
            Self::Mtools => find_program("mcopy").is_some(),
            Self::Dosfstools => find_program("fsck.vfat").is_some(),
            Self::PythonVenv => Shell::new("python3").args(["-c", "import venv, ensurepip"]).ask().is_some(),
            Self::Influx => find_program("influxd").is_some(),
            Self::Victoria => find_program("victoria-metrics").is_some(),
            Self::Chromium => find_program("chromium").is_some() && find_program("chromedriver").is_some(),
            Self::Graphviz => find_program("dot").is_some(),
        }
    }

    /// The arguments for `rustup`, for what comes from there.
    fn rustup(self) -> Option<[&'static str; 3]> {
        match self {
            Self::FirmwareTarget => Some(["target", "add", FIRMWARE_TARGET]),
            Self::StaticTarget => Some(["target", "add", STATIC_TARGET]),
            Self::Rustfmt => Some(["component", "add", "rustfmt"]),
            Self::Clippy => Some(["component", "add", "clippy"]),
            _ => None,
        }
    }

    /// The Debian and Ubuntu packages, for what comes from there.
    fn packages(self) -> &'static [&'static str] {
        match self {
            Self::Linker => &["gcc", "libc6-dev"],
            Self::Qemu => &["qemu-system-arm"],
            Self::Mtools => &["mtools"],
            Self::Dosfstools => &["dosfstools"],
            Self::PythonVenv => &["python3-venv"],
            Self::Influx => &["influxdb"],
            Self::Victoria => &["victoria-metrics"],
            Self::Chromium => &["chromium", "chromium-driver", "fonts-dejavu-core"],
            Self::Graphviz => &["graphviz"],
            Self::FirmwareTarget | Self::StaticTarget | Self::Rustfmt | Self::Clippy => &[],
        }
    }
}

/// What is still missing after [`ensure`].
#[derive(Debug, Default)]
pub(crate) struct Outcome {
    missing: BTreeSet<Need>,
}

impl Outcome {
    pub(crate) fn has(&self, need: Need) -> bool {
        !self.missing.contains(&need)
    }

    /// An error if anything is missing.
    pub(crate) fn require_all(&self) -> Result<()> {
        if self.missing.is_empty() {
            return Ok(());
        }
        let names: Vec<&str> = self.missing.iter().map(|need| need.purpose()).collect();
        bail!("missing: {}; what to type is above", names.join("; "))
    }
}

/// Sees to `needs`: installs what is missing where that is allowed (never with `dry_run`), says what to type where it
/// is not, and tells what is missing in the end.
pub(crate) fn ensure(needs: &[Need], dry_run: bool) -> Outcome {
    let missing: Vec<Need> = needs.iter().copied().filter(|need| !need.present()).collect();
    if missing.is_empty() {
        return Outcome::default();
    }
    eprintln!("missing on this machine:");
    for need in &missing {
        eprintln!("  {}", need.purpose());
    }
    let install = !dry_run && env::var_os("HUMS_SETUP").is_none_or(|value| value != "never");
    install_from_rustup(&missing, install);
    install_from_apt(&missing, install);
    Outcome { missing: missing.into_iter().filter(|need| !need.present()).collect() }
}

/// A failed installation is no error here: what is still missing decides.
fn attempt(shell: Shell) {
    if let Err(error) = shell.run() {
        eprintln!("warning: {error:#}");
    }
}

fn install_from_rustup(missing: &[Need], install: bool) {
    let wanted: Vec<_> = missing.iter().filter_map(|need| need.rustup()).collect();
    if wanted.is_empty() {
        return;
    }
    let rustup = find_program("rustup");
    for arguments in wanted {
        if install && rustup.is_some() {
            attempt(Shell::new("rustup").args(arguments));
        } else {
            advise(&format!("rustup {}", arguments.join(" ")));
        }
    }
}

fn install_from_apt(missing: &[Need], install: bool) {
    let wanted: Vec<Need> = missing.iter().copied().filter(|need| !need.packages().is_empty()).collect();
    if wanted.is_empty() {
        return;
    }
    if find_program("apt-get").is_none() {
        eprintln!("this system has no apt-get; install with its own package manager:");
        for need in wanted {
            eprintln!("  {}", need.purpose());
        }
        return;
    }
    let plain: Vec<&str> = wanted
        .iter()
        .filter(|need| **need != Need::Qemu)
        .flat_map(|need| need.packages().iter().copied())
        .collect();
    let install = install && may_be_root();
    if install {
        attempt(Shell::as_root("apt-get").args(["update", "-qq"]));
    } else {
        advise("sudo apt-get update");
    }
    if !plain.is_empty() {
        apt_install(&plain, None, install);
    }
    if wanted.contains(&Need::Qemu) {
        install_qemu(install);
    }
}

fn apt_install(packages: &[&str], suite: Option<&str>, install: bool) {
    let suite: Vec<&str> = suite.map_or_else(Vec::new, |suite| vec!["-t", suite]);
    if install {
        attempt(
            Shell::as_root("env")
                .args(["DEBIAN_FRONTEND=noninteractive", "apt-get", "install", "-y", "-qq"])
                .args(["--no-install-recommends", "-o", "DPkg::Lock::Timeout=300"])
                .args(&suite)
                .args(packages)
                .quiet(),
        );
    } else {
        let words: Vec<&str> = ["sudo apt-get install -y --no-install-recommends"]
            .into_iter()
            .chain(suite)
            .chain(packages.iter().copied())
            .collect();
        advise(&words.join(" "));
    }
}

/// The distribution's own emulator if it is new enough, otherwise the one of Debian's backports.
fn install_qemu(install: bool) {
    let offered = || Shell::new("apt-cache").args(["madison", "qemu-system-arm"]).ask().unwrap_or_default();
    let own = Shell::new("apt-cache").args(["policy", "qemu-system-arm"]).ask().unwrap_or_default();
    let candidate = own.lines().find_map(|line| line.trim().strip_prefix("Candidate: ")?.into());
    if candidate.and_then(apt::major_version).is_some_and(|major| major >= QEMU_MAJOR_MIN) {
        return apt_install(&["qemu-system-arm"], None, install);
    }
    if let Some(suite) = apt::suite_with(&offered(), QEMU_MAJOR_MIN) {
        return apt_install(&["qemu-system-arm"], Some(&suite), install);
    }
    let distribution = Distribution::parse(&fs::read_to_string("/etc/os-release").unwrap_or_default());
    let source = apt::backports(&source_files(Path::new("/etc/apt")), &distribution.codename);
    match source {
        Some(source) if distribution.is_debian() => {
            add_source(&source, install);
            let suite = format!("{}-backports", distribution.codename);
            apt_install(&["qemu-system-arm"], Some(&suite), install);
        }
        _ => {
            eprintln!("This system's packages have no qemu-system-arm of version {QEMU_MAJOR_MIN} or later.");
            if distribution.id == "ubuntu" {
                eprintln!("Ubuntu's own cloud archive carries one for 22.04:");
                advise("sudo apt-get install -y software-properties-common");
                advise("sudo add-apt-repository -y cloud-archive:caracal");
                advise("sudo apt-get install -y qemu-system-arm");
            }
        }
    }
}

fn add_source(source: &SourceFile, install: bool) {
    let path = format!("/etc/apt/sources.list.d/{}", source.name);
    if install {
        eprintln!("adding Debian's backports, from the same archive as the rest:\n{}", source.text);
        if let Err(error) = Shell::as_root("tee").arg(&path).run_with_input(&source.text) {
            eprintln!("warning: {error:#}");
        }
        attempt(Shell::as_root("apt-get").args(["update", "-qq"]));
    } else {
        advise(&format!("sudo tee {path} <<'END'\n{}END", source.text));
        advise("sudo apt-get update");
    }
}

/// The names and texts of the machine's package sources, in the order in which apt reads them.
fn source_files(apt: &Path) -> Vec<(String, String)> {
    let mut paths: Vec<PathBuf> = fs::read_dir(apt.join("sources.list.d"))
        .map(|entries| entries.filter_map(|entry| Some(entry.ok()?.path())).collect())
        .unwrap_or_default();
    paths.sort();
    paths.insert(0, apt.join("sources.list"));
    let named = |path: PathBuf| Some((path.display().to_string(), fs::read_to_string(path).ok()?));
    paths.into_iter().filter_map(named).collect()
}

/// Says what to type.
fn advise(line: &str) {
    eprintln!("  type: {line}");
}

fn target_installed(target: &str) -> bool {
    let library = Shell::new(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()))
        .args(["--print", "target-libdir", "--target", target])
        .ask();
    library.is_some_and(|dir| Path::new(dir.trim()).is_dir())
}

fn qemu_major() -> Option<u32> {
    apt::major_version(&Shell::new("qemu-system-arm").arg("--version").ask()?)
}

/// Where a program lies. The system folders are looked at too: a user's `PATH` on Debian leaves them out.
fn find_program(name: &str) -> Option<PathBuf> {
    let path = env::var_os("PATH").unwrap_or_default();
    let system = ["/usr/sbin", "/sbin"].map(PathBuf::from);
    env::split_paths(&path).chain(system).map(|dir| dir.join(name)).find(|file| file.is_file())
}

fn may_be_root() -> bool {
    is_root() || Shell::new("sudo").args(["-n", "true"]).ask().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_thing_is_named_and_fails_only_what_needs_it() {
        let outcome = Outcome { missing: [Need::Qemu].into() };
        assert!(!outcome.has(Need::Qemu) && outcome.has(Need::Mtools));
        assert!(outcome.require_all().unwrap_err().to_string().contains("qemu-system-arm 8.0"));
        Outcome::default().require_all().unwrap();
    }

    #[test]
    fn everything_comes_from_rustup_or_from_a_package() {
        for need in Need::ALL {
            assert!(need.rustup().is_some() == need.packages().is_empty(), "{need:?}");
        }
    }

    #[test]
    fn programs_are_found_by_name_only_where_they_are() {
        assert!(find_program("sh").is_some());
        assert_eq!(find_program("no-such-program-here"), None);
    }
}
