//! What a campaign found, for people: on the terminal, and in `docs/proof.md`.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result};

use super::Campaign;
use super::figures::Figures;

/// Where figures come from.
#[derive(Debug)]
pub struct Provenance {
    /// The commit, and whether files differed from it.
    pub commit: String,
    /// The seed.
    pub seed: u64,
    /// How long the campaign took, in seconds.
    pub seconds: f64,
}

/// What stands before the campaigns.
const HEAD: &str = "\
# Proof

What the recorder promises, tried in bulk. `cargo xtask prove` makes this file anew (hours); `cargo xtask prove NAME`
replaces one part of it; `cargo xtask test` runs the short form of each campaign. The same seed gives the same figures.
";

/// Puts a campaign's figures into the document at `path`; those of other campaigns stay.
pub fn write(path: &Path, campaign: &Campaign, figures: &Figures, from: &Provenance) -> Result<()> {
    let old = fs::read_to_string(path).unwrap_or_default();
    let mut parts: Vec<(String, String)> = old
        .split("\n## ")
        .skip(1)
        .filter_map(|part| part.split_once('\n'))
        .map(|(name, body)| (name.to_owned(), body.trim().to_owned()))
        .collect();
    let Provenance { commit, seed, seconds } = from;
    let body = format!(
        "{}.\n\nCommit {commit}, seed {seed}, {seconds:.0} s: `cargo xtask prove {} --seed {seed}`\n\n{}",
        sentence(campaign.about),
        campaign.name,
        figures.text().trim()
    );
    match parts.iter_mut().find(|(name, _)| name == campaign.name) {
        Some(part) => part.1 = body,
        None => parts.push((campaign.name.to_owned(), body)),
    }
    let order = |name: &str| super::CAMPAIGNS.iter().position(|known| known.name == name);
    parts.sort_by_key(|(name, _)| order(name).unwrap_or(usize::MAX));
    let mut text = HEAD.to_owned();
    for (name, body) in parts {
        let _ = write!(text, "\n## {name}\n\n{body}\n");
    }
    fs::write(path, text).with_context(|| path.display().to_string())
}

fn sentence(about: &str) -> String {
    let mut letters = about.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
