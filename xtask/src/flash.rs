//! `cargo xtask flash` and `cargo xtask attach`: a firmware onto a board, as released or with a log.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use crate::firmware::{self, Board};
use crate::setup::{self, Need};
use crate::shell::Shell;

const PROBE_RS: (&str, &str) =
    ("probe-rs", "cargo install probe-rs-tools --locked (or see https://probe.rs)");
const DFU_UTIL: (&str, &str) = ("dfu-util", "apt-get install dfu-util (macOS: brew install dfu-util)");

/// The chip of every board, as probe-rs calls it.
const CHIP: &str = "STM32F405RGTx";

/// How the firmware gets onto the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    /// A debug probe.
    Probe,
    /// The chip's own boot loader, over USB.
    Dfu,
}

/// Arguments of `flash` and `attach`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Options {
    pub(crate) board: &'static Board,
    pub(crate) way: Way,
}

impl Options {
    /// `with_dfu`: whether `--dfu` means anything.
    pub(crate) fn parse(words: &[&str], with_dfu: bool) -> Result<Self> {
        let mut options = Self { board: firmware::default_board(), way: Way::Probe };
        let mut words = words.iter();
        while let Some(word) = words.next() {
            match *word {
                "--board" => {
                    options.board =
                        firmware::board(words.next().context("--board wants the name of a board")?)?;
                }
                "--dfu" if with_dfu => options.way = Way::Dfu,
                other => bail!(
                    "{other} is not understood here: --board BOARD{}",
                    if with_dfu { ", --dfu" } else { "" }
                ),
            }
        }
        Ok(options)
    }
}

/// Builds the firmware and programs it. The board's store is kept.
pub(crate) fn flash(options: Options) -> Result<()> {
    setup::ensure(&[Need::Linker, Need::FirmwareTarget], false).require_all()?;
    let elf = firmware::build(options.board)?;
    match options.way {
        Way::Probe => {
            require(PROBE_RS)?;
            // Without --chip-erase it erases the sectors that the image has bytes in, and no others.
            probe("download", &elf).run()?;
            Shell::new(PROBE_RS.0).args(["reset", "--chip", CHIP]).run()
        }
        Way::Dfu => {
            let path = elf.with_extension("dfu");
            println!("{}", path.display());
            require(DFU_UTIL)?;
            load(&path).run()
        }
    }
}

/// Builds the firmware with its feature `log`, programs it and shows the log as it goes on.
pub(crate) fn attach(options: Options) -> Result<()> {
    let elf = firmware::build_with_log(options.board)?;
    require(PROBE_RS)?;
    probe("run", &elf).run()
}

fn probe(command: &str, elf: &PathBuf) -> Shell {
    Shell::new(PROBE_RS.0).args([command, "--chip", CHIP]).arg(elf)
}

/// The boot loader's alternate setting 0 is the flash; afterwards the firmware starts.
fn load(file: &Path) -> Shell {
    Shell::new(DFU_UTIL.0)
        .args(["--device", "0483:df11", "--alt", "0", "--dfuse-address", ":leave", "--download"])
        .arg(file)
}

fn require((program, how): (&str, &str)) -> Result<()> {
    if Shell::new(program).arg("--version").ask().is_none() {
        bail!("{program} is not installed. Type: {how}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_named_with_what_to_type() {
        let error = require(("no-such-program", "apt-get install such-program")).unwrap_err().to_string();
        assert_eq!(error, "no-such-program is not installed. Type: apt-get install such-program");
        require(("cargo", "")).unwrap();
    }

    #[test]
    fn boards_and_ways_are_chosen() {
        let parse = |line: &str, dfu| Options::parse(&line.split_whitespace().collect::<Vec<_>>(), dfu);
        for (line, name, way) in
            [("", hums_boards::DEFAULT, Way::Probe), ("--dfu --board micoair405", "micoair405", Way::Dfu)]
        {
            let options = parse(line, true).unwrap();
            assert_eq!((options.board.name.as_str(), options.way), (name, way));
        }
        for line in ["--board", "--board f407", "--board emulated", "--erase"] {
            assert!(parse(line, true).is_err(), "{line}");
        }
        assert!(parse("--dfu", false).is_err(), "there is nothing to attach to");
    }

    #[test]
    fn nothing_erases_the_whole_chip() {
        let elf = PathBuf::from("hums.elf");
        let probe = probe("download", &elf);
        assert_eq!(probe.shown(), "probe-rs download --chip STM32F405RGTx hums.elf");
        let load = load(Path::new("hums.dfu"));
        assert_eq!(
            load.shown(),
            "dfu-util --device 0483:df11 --alt 0 --dfuse-address :leave --download hums.dfu"
        );
    }
}
