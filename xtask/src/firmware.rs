//! Building the firmware: always with its own profile and for one board, so never by a plain `cargo build`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

use anyhow::{Context as _, Result, bail};

use crate::dfu;
use crate::image;
use crate::repo::{self, FIRMWARE_TARGET};
use crate::shell::Shell;

/// Flags of `cargo rustc` for the last crate, into which all of the program is inlined: only functions below half of
/// the compiler's own limit. 4.7 KB of flash less, at 0.2 % more load.
pub(crate) const LAST: [&str; 2] = ["--", "-Cllvm-args=-inline-threshold=40"];

/// The firmware's targets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Board {
    /// A real board with an STM32F405.
    F405,
    /// A NUCLEO-F429ZI.
    F429,
}

impl Board {
    pub(crate) const ALL: [Self; 2] = [Self::F405, Self::F429];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::F405 => "f405",
            Self::F429 => "f429",
        }
    }

    /// The arguments that choose this board, for any cargo command on the firmware's package.
    pub(crate) fn choice(self) -> [String; 4] {
        [
            format!("--target={FIRMWARE_TARGET}"),
            "--no-default-features".into(),
            "--features".into(),
            format!("board-{}", self.name()),
        ]
    }

    /// The same with package and profile, for builds from the root.
    pub(crate) fn cargo_arguments(self) -> Vec<String> {
        ["--package=hums-app", "--profile=firmware"]
            .map(Into::into)
            .into_iter()
            .chain(self.choice())
            .collect()
    }

    /// Where [`build`] leaves the image: one file a board, so that building one does not replace the other.
    pub(crate) fn image(self) -> PathBuf {
        repo::target().join("firmware").join(format!("hums-{}.elf", self.name()))
    }
}

/// The compiler's flags of everything that is released from `tree`, as cargo takes them. Paths of the machine are
/// replaced by `/hums` and `/cargo`: the same commit gives the same bytes everywhere.
pub(crate) fn flags(tree: &Path) -> Result<OsString> {
    let cargo_home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let cargo_home = cargo_home.or_else(|| Some(env::home_dir()?.join(".cargo")));
    let cargo_home = cargo_home.context("neither CARGO_HOME nor a home folder is known")?;
    let mut flags = OsString::new();
    // Of several that fit the compiler takes the last one. The folder of a registry has a long name, which is in each place of a panic.
    let sources = fs::read_dir(cargo_home.join("registry/src")).into_iter().flatten();
    let registries = sources.filter_map(|entry| Some((entry.ok()?.path(), "/cargo")));
    for (from, to) in [(tree.canonicalize()?, "/hums"), (cargo_home, "/cargo")].into_iter().chain(registries)
    {
        flags.push("--remap-path-prefix=");
        flags.push(from);
        // Not separated by spaces: a folder may have one in its name.
        flags.push(format!("={to}\u{1f}"));
    }
    // SHA-256 (the signatures of a few frames a second) as loops: 6 KB of flash less than unrolled.
    flags.push("--cfg\u{1f}sha2_backend_soft=\"compact\"");
    Ok(flags)
}

/// cargo with the flags of a release, for the firmware.
pub(crate) fn cargo() -> Result<Shell> {
    Ok(Shell::cargo().env("CARGO_ENCODED_RUSTFLAGS", flags(repo::root())?))
}

/// Compiles the firmware with these further arguments; the compiler's ELF file.
fn compile(board: Board, further: &[&str]) -> Result<PathBuf> {
    cargo()?.arg("rustc").args(board.cargo_arguments()).args(further).args(LAST).run()?;
    Ok(repo::target().join(FIRMWARE_TARGET).join("firmware/hums-firmware"))
}

/// Builds the firmware with logs for a debug probe, and returns its ELF file's path.
pub(crate) fn build_with_log(board: Board) -> Result<PathBuf> {
    compile(board, &["--features=log"])
}

/// Builds the firmware for `board` as a release does and returns its ELF file's path; beside it are the other files of a release.
pub(crate) fn build(board: Board) -> Result<PathBuf> {
    let built = compile(board, &[])?;
    let elf = fs::read(&built).with_context(|| format!("cannot read {}", built.display()))?;
    let image = board.image();
    for (name, data) in files(board, elf)? {
        let path = image.with_file_name(name);
        write_if_different(&path, &data).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(image)
}

/// [`build`], and programs for this PC at the same time: the last part of each is one core's work.
pub(crate) fn build_beside(board: Board, pc: impl FnOnce() -> Result<()>) -> Result<PathBuf> {
    std::thread::scope(|scope| {
        let firmware = scope.spawn(|| build(board));
        pc()?;
        firmware.join().unwrap_or_else(|_| bail!("the build of the firmware panicked"))
    })
}

/// The flashable files of the firmware of `board`: the name and the content of each file, the ELF file last.
pub(crate) fn files(board: Board, elf: Vec<u8>) -> Result<[(String, Vec<u8>); 3]> {
    let name = format!("hums-{}", board.name());
    let pieces = image::pieces(&elf).with_context(|| name.clone())?;
    Ok([
        (format!("{name}.dfu"), dfu::file(&name, &pieces)),
        (format!("{name}.bin"), image::flat(&pieces)),
        (format!("{name}.elf"), elf),
    ])
}

/// Lints the firmware for `board`, which is built; a warning is an error.
pub(crate) fn lint(board: Board) -> Result<()> {
    cargo()?.arg("clippy").args(board.cargo_arguments()).args(["--", "-D", "warnings"]).run()
}

/// An unchanged image keeps its time, so that nothing that depends on it is made anew.
fn write_if_different(to: &Path, new: &[u8]) -> io::Result<()> {
    if fs::read(to).is_ok_and(|old| old == new) {
        return Ok(());
    }
    fs::create_dir_all(to.parent().unwrap_or(to))?;
    fs::write(to, new)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boards_are_known_by_name() {
        for board in Board::ALL {
            assert_eq!(<Board as clap::ValueEnum>::from_str(board.name(), false), Ok(board));
        }
    }

    #[test]
    fn each_board_keeps_its_own_image() {
        assert_ne!(Board::F405.image(), Board::F429.image());
    }
}
