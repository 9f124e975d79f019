//! The end of a log that was read: the evidence of its completeness.

use super::place::SessionBefore;
use super::proof::Proof;
use crate::logs::Log;
use crate::logs::reader::LogSummary;
use crate::logs::sessions::copy_words;
use crate::logs::strangers::ForeignSectors;
use crate::plural::{are, count, noun};

/// The end of a log that was read: the evidence of its completeness, the same for every command.
#[derive(Clone, Debug, Default)]
pub struct Ending {
    /// Its name.
    pub name: String,
    /// The log's files.
    pub files: Vec<String>,
    /// Totals.
    pub summary: LogSummary,
    /// Proof of the end.
    pub proof: Proof,
    /// The session just before it.
    pub before: SessionBefore,
    /// The original's name, if this is a copy.
    pub again: Option<String>,
    /// Rest of a session outside of all files.
    pub left_over: bool,
}

impl Ending {
    /// A log alone; [`crate::followed`] adds later evidence.
    pub fn of(log: &Log, mut summary: LogSummary) -> Self {
        summary.is_cut_by_image = log.ends_with_image();
        let proof = Proof::of(&summary, None);
        let (name, files, left_over) = (log.name.clone(), log.files.clone(), log.left_over);
        Self { name, files, summary, proof, left_over, ..Self::default() }
    }

    /// How the log ends, as a part of a sentence.
    pub fn words(&self) -> String {
        self.proof.words(&self.summary)
    }

    /// A copy, a rest or old content: its losses do not count.
    pub fn aside(&self) -> Option<String> {
        let left_over = || {
            format!(
                "is in no file: it was deleted, its file lost its name, or newer sessions have written over it; {} can be read",
                count(self.summary.frames, "frame")
            )
        };
        let again = self.again.as_deref().map(copy_words);
        again.or_else(|| self.left_over.then(left_over))
    }

    /// Whether its session is not there under another name.
    pub const fn is_counted(&self) -> bool {
        self.again.is_none()
    }

    /// Whether earlier logs of its card are missing from the inputs.
    pub const fn is_without_earlier(&self) -> bool {
        matches!(self.before, SessionBefore::NotLookedFor(_))
    }

    /// No loss or damage, and proved at least to its last end mark.
    pub fn is_sound(&self) -> bool {
        self.faults().is_empty()
    }

    /// Parts of sentences: missing proof, rebuilt sectors, missing parity.
    pub fn faults(&self) -> Vec<String> {
        let weakened = [made_again_words(self.made_again()), unprotected_words(self.unprotected())];
        self.unproved().into_iter().chain(weakened.into_iter().flatten()).collect()
    }

    /// Sectors rebuilt from parity: a damaged card, but no loss. In a file begun anew the new session has
    /// overwritten some, which do not count.
    pub const fn made_again(&self) -> u64 {
        self.summary.blocks.repaired
    }

    /// Missing parity sectors: further losses cannot be rebuilt. A refused block is not written again: no
    /// proof of a loss.
    pub fn unprotected(&self) -> u64 {
        if self.has_parity() && !self.summary.marks.refused { self.summary.parity.missing } else { 0 }
    }

    fn has_parity(&self) -> bool {
        self.aside().is_none() && self.summary.marks.has_boot
    }

    /// Parts of sentences: losses, missing proof, foreign data. A copy reports only its additional data.
    pub fn unproved(&self) -> Vec<String> {
        if self.aside().is_some() {
            return self.besides();
        }
        let mut all = Vec::new();
        let (summary, blocks) = (&self.summary, &self.summary.blocks);
        let lost = summary.marks.lost;
        let losses = [
            (summary.gaps, format!("{}, {} missing", count(summary.gaps, "gap"), summary.missing_words())),
            (blocks.damaged, count(blocks.damaged, "damaged sector")),
            (lost, format!("{} or {} lost while recording", count(lost, "frame"), noun(lost, "record"))),
        ];
        let losses: Vec<String> =
            losses.into_iter().filter(|(number, _)| *number > 0).map(|(_, words)| words).collect();
        if !losses.is_empty() {
            all.push(losses.join(", "));
        }
        if blocks.misplaced > 0 {
            all.push(format!("{} there twice, or where others belong", are(blocks.misplaced, "sector")));
        }
        if summary.times_fell > 0 {
            all.push(format!(
                "its times fall back at the beginning of {}",
                count(summary.times_fell, "group")
            ));
        }
        if summary.unchained > 0 {
            all.push(format!(
                "{} not where the sectors before end: they are of another recording",
                are(summary.unchained, "group")
            ));
        }
        if summary.marks.wrong > 0 {
            all.push(format!(
                "{} of another number of frames than were read",
                count(summary.marks.wrong, "end mark")
            ));
        }
        if !self.proof.holds() && summary.session.is_some() {
            all.push(self.words());
        }
        all.extend(self.contradicted());
        all.extend(self.noise());
        all.extend(self.strange());
        all.extend(self.before.gone());
        all
    }

    /// Foreign sectors in a copy's files.
    pub fn besides(&self) -> Vec<String> {
        if self.again.is_some() { self.others() } else { Vec::new() }
    }

    /// The next start found this session in the log's last file. Returns whether that file was to be
    /// rewritten, which is not a finding.
    pub fn confirm_begun_anew(&mut self, session: u32) -> bool {
        let last = self.files.len().saturating_sub(1);
        let strange = &mut self.summary.strange;
        let is_it = |strange: &ForeignSectors| {
            strange.hollow && strange.file == last && last > 0 && strange.session == session
        };
        let before = strange.len();
        strange.retain(|strange| !is_it(strange));
        strange.len() < before
    }
}

/// A sentence with advice; `None` without any.
pub fn made_again_words(sectors: u64) -> Option<String> {
    (sectors > 0).then(|| {
        format!(
            "{} had to be made again from parity, without a loss: keep the original as it is, copy the card, and replace it",
            count(sectors, "sector")
        )
    })
}

/// A sentence with advice; `None` without any.
pub fn unprotected_words(sectors: u64) -> Option<String> {
    (sectors > 0).then(|| {
        format!(
            "{} missing: what the card loses of these files cannot be made again: keep the original as it is, copy the card, and replace it",
            are(sectors, "parity sector")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parity_is_missing_where_no_record_says_that_the_card_refused_blocks() {
        let of = |refused| {
            let mut summary = LogSummary { session: Some(7), closed: true, ..LogSummary::default() };
            (summary.marks.has_boot, summary.marks.refused, summary.parity.missing) = (true, refused, 3);
            let ending = Ending { proof: Proof::of(&summary, None), summary, ..Ending::default() };
            (ending.unprotected(), ending.is_sound())
        };
        assert_eq!([of(false), of(true)], [(3, false), (0, true)]);
    }

    #[test]
    fn a_log_whose_times_fall_back_is_not_proved() {
        let summary =
            |times_fell| LogSummary { session: Some(7), closed: true, times_fell, ..LogSummary::default() };
        let unproved = |times_fell| {
            let summary = summary(times_fell);
            Ending { proof: Proof::of(&summary, None), summary, ..Ending::default() }.unproved()
        };
        assert_eq!(unproved(0), Vec::<String>::new());
        assert_eq!(unproved(2), ["its times fall back at the beginning of 2 groups"]);
    }
}
