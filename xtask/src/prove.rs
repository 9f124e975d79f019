//! `cargo xtask prove`: the campaigns, thousands of cases each; their results are `docs/proof.md`.
//!
//! The campaigns themselves are in the tests' crate; this builds them and their requirements. Four parts are separate
//! from the campaigns: `diagnosis` judges labelled flights and writes `docs/diagnosis.md`; `chip` has the long tests on the model of the chip
//! for want of time; `boards` runs the image of every board there; `foreign` judges that model by programs that are not ours.

use anyhow::Result;

use crate::firmware::{self, Board};
use crate::foreign;
use crate::oracle;
use crate::pc;
use crate::setup::{self, Need};
use crate::shell::Shell;

/// The campaigns' tools for cards.
pub(crate) const NEEDS: &[Need] = &[Need::Dosfstools];

/// The part that runs the image that is flashed.
const CHIP: &str = "chip";

/// The part that runs the image of every board.
const BOARDS: &str = "boards";

/// The part that judges the model of the chip.
const FOREIGN: &str = "foreign";

/// The part that looks at no card.
const DIAGNOSIS: &str = "diagnosis";

/// Runs the campaigns with these arguments: names, `--short`, `--seed N`, `--runs N`; or `diagnosis` with its own; or `chip`
/// or `foreign` with theirs.
pub(crate) fn run(arguments: &[String]) -> Result<()> {
    match arguments.split_first().map(|(first, rest)| (first.as_str(), rest)) {
        Some((CHIP, rest)) => return chip(&[firmware::default_board()], rest),
        Some((BOARDS, [])) => {
            return chip(&hums_boards::all().iter().collect::<Vec<_>>(), &["boards::".to_owned()]);
        }
        Some((FOREIGN, rest)) => return foreign::run(rest),
        _ => {}
    }
    let is_diagnosis = arguments.first().is_some_and(|first| first == DIAGNOSIS);
    let mut needs = if is_diagnosis { Vec::new() } else { NEEDS.to_vec() };
    needs.push(Need::Linker);
    setup::require(&needs)?;
    let run = ["run", "--release", "--quiet", "--package=hums-tests", "--bin", "prove", "--"];
    Shell::cargo().args(run).args(arguments).run()
}

/// The long tests, some of them or all, with the images of these boards.
fn chip(boards: &[&'static Board], names: &[String]) -> Result<()> {
    let needs = [Need::Linker, Need::FirmwareTarget, Need::PythonVenv, Need::Dosfstools];
    setup::require(&needs)?;
    firmware::build_beside(boards.iter().copied(), pc::build)?;
    oracle::prepare()?;
    let names = names.iter().map(String::as_str);
    let names: Vec<&str> = if names.len() == 0 { vec!["chip::"] } else { names.collect() };
    pc::end_to_end(&[&["--ignored", "--nocapture"], &names[..]].concat())
}
