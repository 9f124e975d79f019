//! `docs/proof.md`, written whole, by one run of all campaigns on one commit with one seed.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result};

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
#[cfg(test)]
const OUTDATED: &str = "**Outdated:** the figures below are of several older commits, and campaigns have changed since. The \
                        next `cargo xtask prove` replaces all of them.";

/// Writes the document.
pub fn write(path: &Path, parts: &[Part], from: &Provenance) -> Result<()> {
    fs::write(path, text(parts, from)).with_context(|| path.display().to_string())
}

fn text(parts: &[Part], from: &Provenance) -> String {
    let Provenance { commit, seed } = from;
    let mut text = format!("{HEAD}\nCommit {commit}, seed {seed}.\n");
    for Part { campaign, figures, seconds } in parts {
        let _ = write!(
            text,
            "\n{}\n\n{} It took {seconds:.0} s.\n\n{}\n",
            heading(campaign),
            sentence(campaign.about),
            figures.text().trim()
        );
    }
    text
}

fn heading(campaign: &Campaign) -> String {
    format!("## {}", campaign.name)
}

/// A capital letter and a full stop.
fn sentence(about: &str) -> String {
    let mut letters = about.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect()) + "."
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flights::root;
    use crate::prove::CAMPAIGNS;

    /// Constant lines, in order.
    fn labels(text: &str) -> Vec<&str> {
        let mut labels = Vec::new();
        let mut is_heading = true;
        for line in text.lines() {
            let table = line.starts_with('|');
            if line.starts_with("## ") || line.starts_with("* ") || (table && is_heading) {
                // A label may have a colon and a space.
                labels.push(
                    line.starts_with("* ")
                        .then(|| line.rsplit_once(": "))
                        .flatten()
                        .map_or(line, |(label, _)| &line[..=label.len()]),
                );
            }
            is_heading = !table;
        }
        labels
    }

    fn expected() -> Vec<String> {
        CAMPAIGNS.iter().flat_map(|one| std::iter::once(heading(one)).chain(one.labels.lines())).collect()
    }

    fn figures(campaign: &'static Campaign) -> Figures {
        let mut figures = Figures::new(&campaign.labels);
        for what in campaign.labels.facts {
            figures.fact(what, "1, 2");
        }
        figures
    }

    fn document() -> String {
        let parts: Vec<Part> = CAMPAIGNS
            .iter()
            .map(|campaign| Part { campaign, figures: figures(campaign), seconds: 1.0 })
            .collect();
        text(&parts, &Provenance { commit: "0123456789ab".to_owned(), seed: 1 })
    }

    #[test]
    fn what_is_written_has_each_label_once_one_commit_and_one_seed() {
        let text = document();
        assert_eq!(labels(&text), expected());
        assert_eq!(text.matches("\nCommit 0123456789ab, seed 1.\n").count(), 1);
        assert!(CAMPAIGNS.iter().all(|one| text.contains(&format!("\n{} It took", sentence(one.about)))));
    }

    #[test]
    fn a_label_that_the_code_does_not_print_is_noticed() {
        let text = document();
        for (from, to) in [("* cuts:", "* cut:"), ("| recording |", "| flight |"), ("## noise", "## noises")]
        {
            assert!(text.contains(from), "{from}");
            assert_ne!(labels(&text.replacen(from, to, 1)), expected(), "{to}");
        }
    }

    #[test]
    fn the_document_has_the_labels_that_the_campaigns_print() {
        let text = fs::read_to_string(root().join("docs/proof.md")).unwrap();
        assert!(text.starts_with(HEAD), "docs/proof.md has another beginning: `cargo xtask prove` writes it");
        if text[HEAD.len()..].trim_start().starts_with(OUTDATED) {
            return;
        }
        assert_eq!(labels(&text), expected(), "`cargo xtask prove` writes docs/proof.md");
        assert_eq!(
            text.lines().filter(|line| line.starts_with("Commit ")).count(),
            1,
            "one commit, one seed"
        );
        for campaign in CAMPAIGNS {
            assert!(text.contains(&sentence(campaign.about)), "{}: what it tries", campaign.name);
        }
    }
}
