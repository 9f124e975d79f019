//! `docs/proof.md`, written whole, by one run of all campaigns on one commit with one seed. A short run of all compares its labels.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result, ensure};

use super::Campaign;
use super::figures::Figures;

/// The figures' source.
#[derive(Debug)]
pub struct Provenance {
    /// The commit, without any change.
    pub commit: String,
    /// The seed.
    pub seed: u64,
}

/// One campaign's results.
#[derive(Debug)]
pub struct Part {
    /// Which.
    pub campaign: &'static Campaign,
    /// Its results.
    pub figures: Figures,
    /// Duration, seconds.
    pub seconds: f64,
}

const HEAD: &str = "\
# Proof

For investigators and safety engineers. Afterwards you know the promises about the record, how often each was tested, and the result. Each
section is a campaign. All ran on a PC, with simulated cards and links: no box and no real card. Other pages have the
[limits of the proof](safety.md#evidence), the [firmware on the model of its chip](chip.md#results), and the [found faults](diagnosis.md).

`cargo xtask prove` runs all campaigns on the recordings of the repository (an hour) and writes this page. `cargo xtask prove NAME`
prints one. `cargo xtask test` runs a short form of each. The same commit and seed give the same figures, apart from the seconds.
";

/// Campaigns changed and were not run as a whole since.
const OUTDATED: &str = "**Outdated:** the figures below are of several older commits, and campaigns have changed since. The \
                        next `cargo xtask prove` replaces all of them.";

/// Writes the document.
pub fn write(path: &Path, parts: &[Part], from: &Provenance) -> Result<()> {
    fs::write(path, text(parts, from)).with_context(|| path.display().to_string())
}

/// The document has the labels and promises of these results.
///
/// # Errors
/// It has others.
pub fn compare(path: &Path, parts: &[Part]) -> Result<()> {
    let written = fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let rest = written.strip_prefix(HEAD).context("docs/proof.md has another beginning")?;
    if rest.trim_start().starts_with(OUTDATED) {
        return Ok(());
    }
    let made = text(parts, &Provenance { commit: String::new(), seed: 0 });
    let (written, made) = (labels(&written), labels(&made));
    let other = written.iter().zip(&made).find(|(written, made)| written != made);
    let is_same = other.is_none() && written.len() == made.len();
    ensure!(
        is_same,
        "`cargo xtask prove` writes docs/proof.md: it is {other:?} of {} and {} labels",
        written.len(),
        made.len()
    );
    Ok(())
}

/// Constant text, in order.
fn labels(text: &str) -> Vec<&str> {
    let mut labels = Vec::new();
    let mut is_heading = true;
    for line in text.lines() {
        let table = line.starts_with('|');
        // A label may have a colon and a space.
        let label =
            if line.starts_with("* ") { line.rsplit_once(": ") } else { line.split_once(" It took ") };
        if line.starts_with("## ") || line.starts_with("Commit ") || (table && is_heading) {
            labels.push(line.split(' ').next().filter(|word| *word == "Commit").unwrap_or(line));
        } else if let Some((label, _)) = label {
            labels.push(label);
        }
        is_heading = !table;
    }
    labels
}

fn text(parts: &[Part], from: &Provenance) -> String {
    let Provenance { commit, seed } = from;
    let mut text = format!("{HEAD}\nCommit {commit}, seed {seed}.\n");
    for Part { campaign, figures, seconds } in parts {
        let _ = write!(
            text,
            "\n## {}\n\n{} It took {seconds:.0} s.\n\n{}\n",
            campaign.name,
            sentence(campaign.about),
            figures.text().trim()
        );
    }
    text
}

/// A capital letter and a full stop.
fn sentence(about: &str) -> String {
    let mut letters = about.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect()) + "."
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prove::CAMPAIGNS;

    #[test]
    fn other_labels_in_the_document_are_noticed() {
        let results = |campaign| {
            let mut figures = Figures::with(&["recording", "frames"]);
            figures.fact("cuts: all", "1, 2");
            figures.row(&[&"a.tlog", &7]);
            Part { campaign, figures, seconds: 1.0 }
        };
        let parts: Vec<Part> = CAMPAIGNS.iter().map(results).collect();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("proof.md");
        write(&path, &parts, &Provenance { commit: "0123456789ab".to_owned(), seed: 1 }).unwrap();
        compare(&path, &parts).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert!(
            text.contains("\nCommit 0123456789ab, seed 1.\n") && text.contains("\n\n* cuts: all: 1, 2\n\n")
        );
        assert!(text.contains("\n| recording | frames |\n|---|---|\n| a.tlog | 7 |\n"), "{text}");
        for (from, to) in [
            ("* cuts: all:", "* cut: all:"),
            ("| recording |", "| flight |"),
            ("## noise", "## noises"),
            ("Promise: ", "Hope: "),
            ("seed 1.\n", "seed 1.\nCommit a, seed 2.\n"),
            ("# Proof", "# Proofs"),
        ] {
            assert!(text.contains(from), "{from}");
            fs::write(&path, text.replacen(from, to, 1)).unwrap();
            assert!(compare(&path, &parts).is_err(), "{to}");
        }
    }
}
