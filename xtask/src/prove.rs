//! `cargo xtask prove`: the campaigns, thousands of cases each; what is left of them is `docs/proof.md`.
//!
//! The campaigns themselves are in the tests' crate; this builds them and sees to what they need. Two parts are no
//! campaigns: `diagnosis` judges labelled flights and writes `docs/diagnosis.md`; `emulator` flies the recordings of `HUMS_FLIGHTS` through the firmware in the emulator, which takes minutes,
//! and compares with this PC.

use anyhow::{Result, bail};

use crate::firmware::{self, Board};
use crate::oracle;
use crate::pc;
use crate::setup::{self, Need};
use crate::shell::Shell;

/// What the campaigns look at cards with.
pub(crate) const NEEDS: &[Need] = &[Need::Dosfstools];

/// The part that needs the emulator.
const EMULATOR: &str = "emulator";

/// The part that looks at no card.
const DIAGNOSIS: &str = "diagnosis";

/// Runs the campaigns with these arguments: names, `--short`, `--seed N`, `--runs N`; or `diagnosis` with its own; or the
/// emulator's part.
pub(crate) fn run(arguments: &[String]) -> Result<()> {
    if arguments.iter().any(|argument| argument == EMULATOR) {
        if arguments.len() > 1 {
            bail!("prove {EMULATOR} is run alone");
        }
        return further_recordings();
    }
    let is_diagnosis = arguments.first().is_some_and(|first| first == DIAGNOSIS);
    let mut needs = if is_diagnosis { Vec::new() } else { NEEDS.to_vec() };
    needs.push(Need::Linker);
    setup::ensure(&needs, false).require_all()?;
    let run = ["run", "--release", "--quiet", "--package=hums-tests", "--bin", "prove", "--"];
    Shell::cargo().args(run).args(arguments).run()
}

fn further_recordings() -> Result<()> {
    if std::env::var_os("HUMS_FLIGHTS").is_none_or(|folder| folder.is_empty()) {
        bail!("HUMS_FLIGHTS is not set: it names the folder with the recordings to fly");
    }
    let needs = [Need::Linker, Need::FirmwareTarget, Need::Qemu, Need::PythonVenv, Need::Dosfstools];
    setup::ensure(&needs, false).require_all()?;
    firmware::build(Board::Emulated)?;
    pc::build()?;
    oracle::prepare()?;
    pc::end_to_end("emulator", &["--ignored"])
}
