//! `cargo xtask flash` and `cargo xtask attach`: a firmware onto a board, as released or with a log.

use std::path::Path;

use anyhow::{Result, bail};

use crate::firmware::{self, Board};
use crate::setup::{self, Need};
use crate::shell::Shell;

const PROBE_RS: (&str, &str) =
    ("probe-rs", "cargo install probe-rs-tools --locked (or see https://probe.rs)");
const DFU_UTIL: (&str, &str) = ("dfu-util", "apt-get install dfu-util (macOS: brew install dfu-util)");

const CHIP: &str = "STM32F405RGTx";

/// Arguments of `flash`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// One of the files in boards/, by its name
    #[arg(long, value_parser = hums_boards::find, default_value = hums_boards::DEFAULT)]
    board: &'static Board,
    /// Over USB by the chip's own boot loader (dfu-util), not by a debug probe (probe-rs)
    #[arg(long)]
    dfu: bool,
}

/// The store is kept.
pub(crate) fn flash(options: &Options) -> Result<()> {
    setup::require(&[Need::Linker, Need::FirmwareTarget])?;
    let elf = firmware::build(options.board)?;
    if options.dfu {
        let path = elf.with_extension("dfu");
        println!("{}", path.display());
        require(DFU_UTIL)?;
        return load(&path).run();
    }
    require(PROBE_RS)?;
    load_by_probe(&elf.with_extension("hex")).run()?;
    Shell::new(PROBE_RS.0).args(["reset", "--chip", CHIP]).run()
}

pub(crate) fn attach(board: &Board) -> Result<()> {
    let elf = firmware::build_with_log(board)?;
    require(PROBE_RS)?;
    load_by_probe(&elf.with_extension("hex")).run()?;
    Shell::new(PROBE_RS.0).args(["reset", "--chip", CHIP]).run()?;
    Shell::new(PROBE_RS.0).args(["attach", "--chip", CHIP]).arg(elf).run()
}

/// Not the ELF file: probe-rs takes only its sections. Without --chip-erase only the image's sectors are erased.
fn load_by_probe(hex: &Path) -> Shell {
    Shell::new(PROBE_RS.0).args(["download", "--chip", CHIP, "--binary-format", "hex"]).arg(hex)
}

/// Alternate setting 0 is the flash; then the firmware starts.
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
    fn nothing_erases_the_whole_chip() {
        let probe = load_by_probe(Path::new("hums.hex"));
        assert_eq!(probe.shown(), "probe-rs download --chip STM32F405RGTx --binary-format hex hums.hex");
        let load = load(Path::new("hums.dfu"));
        assert_eq!(
            load.shown(),
            "dfu-util --device 0483:df11 --alt 0 --dfuse-address :leave --download hums.dfu"
        );
    }
}
