//! Building the firmware: always with its own profile and for one board, so never by a plain `cargo build`.

use std::path::PathBuf;
use std::{fs, io};

use anyhow::{Context as _, Result, bail};

use crate::repo::{self, FIRMWARE_TARGET};
use crate::shell::Shell;

/// What the firmware runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Board {
    /// A real board with an STM32F405.
    F405,
    /// A NUCLEO-F429ZI.
    F429,
    /// The first one's chip in QEMU.
    Emulated,
}

impl Board {
    pub(crate) const ALL: [Self; 3] = [Self::F405, Self::F429, Self::Emulated];

    pub(crate) fn parse(name: &str) -> Result<Self> {
        match Self::ALL.into_iter().find(|board| board.name() == name) {
            Some(board) => Ok(board),
            None => bail!("there is no board {name}: f405, f429 or emulated"),
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::F405 => "f405",
            Self::F429 => "f429",
            Self::Emulated => "emulated",
        }
    }

    /// Bytes of memory that can be written to: RAM and CCM (`firmware/app/src/boards/*.x`).
    pub(crate) fn ram_bytes(self) -> u64 {
        match self {
            Self::F405 | Self::Emulated => (128 + 64) * 1024,
            Self::F429 => (192 + 64) * 1024,
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

    /// The same with package and profile, for what builds it from the root.
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

/// Builds the firmware for `board` and returns where its ELF file lies.
pub(crate) fn build(board: Board) -> Result<PathBuf> {
    Shell::cargo().arg("build").args(board.cargo_arguments()).run()?;
    let built = repo::target().join(FIRMWARE_TARGET).join("firmware/hums-firmware");
    let image = board.image();
    copy_if_different(&built, &image)
        .with_context(|| format!("cannot copy {} to {}", built.display(), image.display()))?;
    Ok(image)
}

/// Lints the firmware for `board`; a warning is an error.
pub(crate) fn lint(board: Board) -> Result<()> {
    Shell::cargo().arg("clippy").args(board.cargo_arguments()).args(["--", "-D", "warnings"]).run()
}

/// An unchanged image keeps its time, so that nothing that depends on it is made anew.
fn copy_if_different(from: &PathBuf, to: &PathBuf) -> io::Result<()> {
    let new = fs::read(from)?;
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
            assert_eq!(Board::parse(board.name()).unwrap(), board);
        }
        assert!(Board::parse("f407").unwrap_err().to_string().contains("f405, f429 or emulated"));
    }

    #[test]
    fn each_board_keeps_its_own_image() {
        assert_ne!(Board::F405.image(), Board::Emulated.image());
    }
}
