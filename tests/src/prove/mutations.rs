//! The fuzz targets of `hums-fuzz` on stable Rust, in a long round; a test of `hums-fuzz` is a short one.

use anyhow::{Context as _, Result, bail};
use hums_fuzz::{TARGETS, Target, mutate};
use rayon::prelude::*;

use super::figures::Figures;
use super::options::Options;

/// Times the test's inputs, which take half a second a target.
const LONG: u64 = 400;
/// Part of the test's inputs.
const SHORT: u64 = 5;

pub(super) fn run(options: &Options) -> Result<Figures> {
    // The test has 1.
    let seed = options.seed.wrapping_add(1);
    let outcomes = TARGETS.par_iter().with_max_len(1).map(|target| try_often(target, options, seed));
    let outcomes = outcomes.collect::<Result<Vec<_>>>()?;
    let mut figures = Figures::with(&["reader", "inputs"]);
    figures.fact("readers", outcomes.len());
    figures.fact("inputs tried", outcomes.iter().sum::<u64>());
    // The first one ends the campaign.
    figures.fact("inputs that broke a rule", 0);
    for (target, tried) in TARGETS.iter().zip(outcomes) {
        figures.row(&[&target.name, &tried]);
    }
    Ok(figures)
}

fn try_often(target: &'static Target, options: &Options, seed: u64) -> Result<u64> {
    let rounds = options.runs(LONG * target.rounds, target.rounds / SHORT);
    match mutate::run(target, seed, |mutations| mutations < rounds).context(target.name)? {
        Ok(tried) => Ok(tried),
        Err(broken) => bail!("{}: {} breaks it", broken.target, broken.path.display()),
    }
}
