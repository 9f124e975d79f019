//! What the other commands need, and its installation where that is allowed.
//!
//! Allowed means: as root, or with a `sudo` that asks for no password, on a system with `apt-get`; and `rustup` for
//! what belongs to Rust. Everything else is said, ready to be typed, and left to the user. With `HUMS_SETUP=never` in
//! the environment nothing is installed.

use std::collections::BTreeSet;
use std::env;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use crate::repo::FIRMWARE_TARGET;
use crate::shell::{Shell, is_root};

/// The target of a `hums` that needs no library of the machine it runs on.
pub(crate) const STATIC_TARGET: &str =
    if cfg!(target_arch = "aarch64") { "aarch64-unknown-linux-musl" } else { "x86_64-unknown-linux-musl" };

/// The target of the `hums` for Windows, which MinGW links.
pub(crate) const WINDOWS_TARGET: &str = "x86_64-pc-windows-gnu";

/// The target of a `hums` for macOS, which nothing here links.
pub(crate) const MAC_TARGET: &str = "aarch64-apple-darwin";

/// Something that a command needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Need {
    /// `cc`: rustc links with it.
    Linker,
    FirmwareTarget,
    StaticTarget,
    WindowsTarget,
    Mingw,
    Wine,
    MacTarget,
    Rustfmt,
    Clippy,
    Mtools,
    Dosfstools,
    PythonVenv,
    Influx,
    Victoria,
    Chromium,
}

impl Need {
    pub(crate) const ALL: [Self; 15] = [
        Self::Linker,
        Self::FirmwareTarget,
        Self::StaticTarget,
        Self::WindowsTarget,
        Self::Mingw,
        Self::Wine,
        Self::MacTarget,
        Self::Rustfmt,
        Self::Clippy,
        Self::Mtools,
        Self::Dosfstools,
        Self::PythonVenv,
        Self::Influx,
        Self::Victoria,
        Self::Chromium,
    ];

    /// What it is and what it is for.
    fn purpose(self) -> &'static str {
        match self {
            Self::Linker => "a C linker (cc), for everything that rustc builds",
            Self::FirmwareTarget => "the Rust target thumbv7em-none-eabihf, for the firmware",
            Self::StaticTarget => "Rust's musl target, for the static hums of a release",
            Self::WindowsTarget => "Rust's target for Windows, for the hums.exe of a release",
            Self::Mingw => "MinGW's linker for Windows (gcc-mingw-w64-x86-64), for the same",
            Self::Wine => "Wine (wine64), which runs hums.exe for dist --check",
            Self::MacTarget => "Rust's target for macOS, for which hums is type-checked before a release",
            Self::Rustfmt => "rustfmt, for the check of the formatting",
            Self::Clippy => "clippy, for the lints",
            Self::Mtools => "mtools, which reads the card's image independently of our own reader",
            Self::Dosfstools => "dosfstools (fsck.vfat), which checks the card's file system",
            Self::PythonVenv => "python3 with venv, for pymavlink, the independent reader of MAVLink",
            Self::Influx => "influxdb, which takes the line protocol",
            Self::Victoria => "victoria-metrics, another database that takes the line protocol",
            Self::Chromium => "chromium and its driver, which look at the pages",
        }
    }

    fn present(self) -> bool {
        let cargo_has = |tool: &str| Shell::cargo().args([tool, "--version"]).ask().is_some();
        match self {
            Self::Linker => find_program("cc").is_some(),
            Self::FirmwareTarget => target_installed(FIRMWARE_TARGET),
            Self::StaticTarget => target_installed(STATIC_TARGET),
            Self::WindowsTarget => target_installed(WINDOWS_TARGET),
            Self::Mingw => find_program("x86_64-w64-mingw32-gcc").is_some(),
            Self::Wine => find_wine().is_some(),
            Self::MacTarget => target_installed(MAC_TARGET),
            Self::Rustfmt => cargo_has("fmt"),
            Self::Clippy => cargo_has("clippy"),
            Self::Mtools => find_program("mcopy").is_some(),
            Self::Dosfstools => find_program("fsck.vfat").is_some(),
            Self::PythonVenv => Shell::new("python3").args(["-c", "import venv, ensurepip"]).ask().is_some(),
            Self::Influx => find_program("influxd").is_some(),
            Self::Victoria => find_program("victoria-metrics").is_some(),
            Self::Chromium => find_program("chromium").is_some() && find_program("chromedriver").is_some(),
        }
    }

    /// The arguments for `rustup`, for what comes from there.
    fn rustup(self) -> Option<[&'static str; 3]> {
        match self {
            Self::FirmwareTarget => Some(["target", "add", FIRMWARE_TARGET]),
            Self::StaticTarget => Some(["target", "add", STATIC_TARGET]),
            Self::WindowsTarget => Some(["target", "add", WINDOWS_TARGET]),
            Self::MacTarget => Some(["target", "add", MAC_TARGET]),
            Self::Rustfmt => Some(["component", "add", "rustfmt"]),
            Self::Clippy => Some(["component", "add", "clippy"]),
            _ => None,
        }
    }

    /// The Debian and Ubuntu packages, for what comes from there.
    fn packages(self) -> &'static [&'static str] {
        match self {
            Self::Linker => &["gcc", "libc6-dev"],
            Self::Mingw => &["gcc-mingw-w64-x86-64"],
            Self::Wine => &["wine64"],
            Self::Mtools => &["mtools"],
            Self::Dosfstools => &["dosfstools"],
            Self::PythonVenv => &["python3-venv"],
            Self::Influx => &["influxdb"],
            Self::Victoria => &["victoria-metrics"],
            Self::Chromium => &["chromium", "chromium-driver", "fonts-dejavu-core"],
            Self::FirmwareTarget
            | Self::StaticTarget
            | Self::WindowsTarget
            | Self::MacTarget
            | Self::Rustfmt
            | Self::Clippy => &[],
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
    let packages: Vec<&str> = wanted.iter().flat_map(|need| need.packages().iter().copied()).collect();
    let install = install && may_be_root();
    if install {
        attempt(Shell::as_root("apt-get").args(["update", "-qq"]));
    } else {
        advise("sudo apt-get update");
    }
    if install {
        attempt(
            Shell::as_root("env")
                .args(["DEBIAN_FRONTEND=noninteractive", "apt-get", "install", "-y", "-qq"])
                .args(["--no-install-recommends", "-o", "DPkg::Lock::Timeout=300"])
                .args(packages)
                .quiet(),
        );
    } else {
        advise(&format!("sudo apt-get install -y --no-install-recommends {}", packages.join(" ")));
    }
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

/// Where a program lies. The system folders are looked at too: a user's `PATH` on Debian leaves them out.
fn find_program(name: &str) -> Option<PathBuf> {
    let path = env::var_os("PATH").unwrap_or_default();
    let system = ["/usr/sbin", "/sbin"].map(PathBuf::from);
    env::split_paths(&path).chain(system).map(|dir| dir.join(name)).find(|file| file.is_file())
}

/// Wine: Debian keeps the program of its package `wine64` out of `PATH`.
pub(crate) fn find_wine() -> Option<PathBuf> {
    let hidden = || Some(PathBuf::from("/usr/lib/wine/wine64")).filter(|path| path.is_file());
    ["wine64", "wine"].into_iter().find_map(find_program).or_else(hidden)
}

fn may_be_root() -> bool {
    is_root() || Shell::new("sudo").args(["-n", "true"]).ask().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_thing_is_named_and_fails_only_what_needs_it() {
        let outcome = Outcome { missing: [Need::Dosfstools].into() };
        assert!(!outcome.has(Need::Dosfstools) && outcome.has(Need::Mtools));
        assert!(outcome.require_all().unwrap_err().to_string().contains("dosfstools"));
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
