//! `cargo xtask prove`: the campaigns, thousands of cases each; what is left of them is `docs/proof.md`.
//!
//! The campaigns themselves are in the tests' crate; this builds them and sees to what they need.

use anyhow::Result;

use crate::setup::{self, Need};
use crate::shell::Shell;

/// What the campaigns look at cards with.
pub(crate) const NEEDS: &[Need] = &[Need::Dosfstools];

/// Runs the campaigns with these arguments: names, `--short`, `--seed N`, `--runs N`.
pub(crate) fn run(arguments: &[String]) -> Result<()> {
    let mut needs = NEEDS.to_vec();
    needs.push(Need::Linker);
    setup::ensure(&needs, false).require_all()?;
    campaigns(arguments)
}

/// The short form of each, as a step of the tests.
pub(crate) fn short() -> Result<()> {
    campaigns(&["--short".to_owned()])
}

fn campaigns(arguments: &[String]) -> Result<()> {
    let run = ["run", "--release", "--quiet", "--package=hums-tests", "--bin", "prove", "--"];
    Shell::cargo().args(run).args(arguments).run()
}
