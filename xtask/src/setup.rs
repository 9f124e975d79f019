//! Requirements: purpose, search and installation.
//!
//! Rust's parts come from `rustup`, others from `apt-get` as root or by a `sudo` without password; otherwise, or with
//! `HUMS_SETUP=never`, the command is printed.

use std::collections::BTreeSet;
use std::env;
use std::path::PathBuf;

use anyhow::{Result, bail};

use Source::{Component, Packages, Target};

use crate::repo::{BROWSER_TARGET, FIRMWARE_TARGET};
use crate::shell::{Shell, is_root};

/// Needs no library of its machine.
pub(crate) const STATIC_TARGET: &str =
    if cfg!(target_arch = "aarch64") { "aarch64-unknown-linux-musl" } else { "x86_64-unknown-linux-musl" };

/// Linked by MinGW.
pub(crate) const WINDOWS_TARGET: &str = "x86_64-pc-windows-gnu";

/// Linked by nothing here.
pub(crate) const MAC_TARGET: &str = "aarch64-apple-darwin";

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Need {
    Linker,
    FirmwareTarget,
    BrowserTarget,
    StaticTarget,
    Musl,
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
    Firefox,
    Java,
}

/// Found and installed.
enum Source {
    Target(&'static str),
    /// Found by a command of cargo.
    Component(&'static str, &'static str),
    /// Debian and Ubuntu, found by a line of `sh`.
    Packages(&'static str, &'static str),
}

const TABLE: [(Need, &str, Source); 19] = [
    (Need::Linker, "a C linker", Packages("command -v cc", "gcc libc6-dev")),
    (Need::FirmwareTarget, "Rust's target of the firmware", Target(FIRMWARE_TARGET)),
    (Need::BrowserTarget, "Rust's target of the check in a browser", Target(BROWSER_TARGET)),
    (Need::StaticTarget, "Rust's musl target, for the hums of a release", Target(STATIC_TARGET)),
    (
        Need::Musl,
        "a C compiler for musl, for object storage in a release",
        Packages("command -v musl-gcc", "musl-tools"),
    ),
    (Need::WindowsTarget, "Rust's target for hums.exe", Target(WINDOWS_TARGET)),
    (Need::Mingw, "MinGW, which links hums.exe", Packages(FIND_MINGW, "gcc-mingw-w64-x86-64")),
    (Need::Wine, "Wine, which runs hums.exe for dist --check", Packages(FIND_WINE, "wine64")),
    (Need::MacTarget, "Rust's target for macOS, for which hums is type-checked", Target(MAC_TARGET)),
    (Need::Rustfmt, "rustfmt, which checks the formatting", Component("fmt", "rustfmt")),
    (Need::Clippy, "clippy, for the lints", Component("clippy", "clippy")),
    (Need::Mtools, "mtools, another reader of card images", Packages("command -v mcopy", "mtools")),
    (Need::Dosfstools, "fsck.vfat, which checks cards", Packages("command -v fsck.vfat", "dosfstools")),
    (Need::PythonVenv, "Python with venv, for pymavlink", Packages(FIND_VENV, "python3-venv")),
    (Need::Influx, "InfluxDB", Packages("command -v influxd", "influxdb")),
    (Need::Victoria, "VictoriaMetrics", Packages("command -v victoria-metrics", "victoria-metrics")),
    (Need::Chromium, "Chromium and its driver", Packages(FIND_CHROMIUM, CHROMIUM)),
    (Need::Firefox, "Firefox", Packages("command -v firefox-esr", "firefox-esr")),
    (
        Need::Java,
        "Java, which runs Spark for prove fleet",
        Packages("command -v java", "default-jre-headless"),
    ),
];

const FIND_MINGW: &str = "command -v x86_64-w64-mingw32-gcc";
const FIND_VENV: &str = "python3 -c 'import venv, ensurepip'";
const FIND_CHROMIUM: &str = "command -v chromium && command -v chromedriver";
const CHROMIUM: &str = "chromium chromium-driver fonts-dejavu-core";
/// Debian keeps it out of `PATH`.
const FIND_WINE: &str = "command -v wine64 || command -v wine || ls /usr/lib/wine/wine64";

impl Need {
    pub(crate) fn all() -> Vec<Self> {
        TABLE.iter().map(|(need, ..)| *need).collect()
    }

    fn row(self) -> (&'static str, &'static Source) {
        let row = TABLE.iter().find(|(need, ..)| *need == self).expect("every need has its row");
        (row.1, &row.2)
    }

    fn present(self) -> bool {
        match self.row().1 {
            Source::Target(target) => {
                sh(&format!("test -d \"$(rustc --print target-libdir --target {target})\"")).is_some()
            }
            Source::Component(command, _) => Shell::cargo().args([command, "--version"]).ask().is_some(),
            Source::Packages(test, _) => sh(test).is_some(),
        }
    }

    fn install(self) -> String {
        match self.row().1 {
            Source::Target(target) => format!("rustup target add {target}"),
            Source::Component(_, component) => format!("rustup component add {component}"),
            Source::Packages(_, packages) => {
                let root = if is_root() { "" } else { "sudo -n " };
                format!(
                    "{root}apt-get update -qq && {root}env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq \
                     --no-install-recommends {packages}"
                )
            }
        }
    }
}

/// `None` if it fails; also looks at system folders, which Debian's users lack.
fn sh(line: &str) -> Option<String> {
    Shell::new("sh").args(["-c", &format!("PATH=\"$PATH:/usr/sbin:/sbin\"; {line}")]).ask()
}

pub(crate) fn find_wine() -> Option<PathBuf> {
    Some(PathBuf::from(sh(FIND_WINE)?.lines().next()?))
}

/// Missing after [`ensure`].
#[derive(Debug, Default)]
pub(crate) struct Outcome {
    missing: BTreeSet<Need>,
}

impl Outcome {
    pub(crate) fn has(&self, need: Need) -> bool {
        !self.missing.contains(&need)
    }

    pub(crate) fn require_all(&self) -> Result<()> {
        if self.missing.is_empty() {
            return Ok(());
        }
        let names: Vec<&str> = self.missing.iter().map(|need| need.row().0).collect();
        bail!("missing: {}; what to type is above", names.join("; "))
    }
}

/// A missing tool is an error.
pub(crate) fn require(needs: &[Need]) -> Result<()> {
    ensure(needs, false).require_all()
}

/// Prints and installs `needs` (not with `dry_run`). Returns the missing ones.
pub(crate) fn ensure(needs: &[Need], dry_run: bool) -> Outcome {
    let mut missing: Vec<Need> = needs.iter().copied().filter(|need| !need.present()).collect();
    let install = !dry_run && env::var_os("HUMS_SETUP").is_none_or(|value| value != "never");
    for need in &missing {
        let (purpose, line) = (need.row().0, need.install());
        eprintln!("missing: {purpose}\n  {line}");
        // The needs that are still missing decide.
        if install && let Err(error) = Shell::new("sh").args(["-c", &line]).quiet().run() {
            eprintln!("warning: {error:#}");
        }
    }
    missing.retain(|need| !need.present());
    Outcome { missing: missing.into_iter().collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_thing_is_named_and_fails_only_what_needs_it() {
        let outcome = Outcome { missing: [Need::Mtools].into() };
        assert!(!outcome.has(Need::Mtools) && outcome.has(Need::Dosfstools));
        assert!(outcome.require_all().unwrap_err().to_string().contains("mtools"));
        Outcome::default().require_all().unwrap();
    }

    #[test]
    fn every_need_has_a_line_that_installs_it() {
        for need in Need::all() {
            assert!(
                need.install().contains(" install ") || need.install().starts_with("rustup "),
                "{need:?}"
            );
        }
    }

    #[test]
    fn programs_are_found_by_name_only_where_they_are() {
        assert!(sh("command -v sh").is_some());
        assert!(sh("command -v no-such-program-here").is_none());
    }
}
