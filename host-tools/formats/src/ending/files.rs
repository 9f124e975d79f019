//! Foreign and missing parts of a log's files.

use std::path::Path;

use hums_blackbox::{BlockCounts, PAGE_SECTORS};

use super::log::Ending;
use super::proof::Proof;
use crate::logs::naming::is_part;
use crate::logs::reader::LogSummary;
use crate::logs::segment_name;
use crate::logs::strangers::ForeignSectors;
use crate::plural::count;

const NAMED_MAX: usize = 3;

impl Ending {
    /// Unknown blocks after the last sector, if the log's end is not proved before them. Damaged sectors of
    /// the log look like that. Older data are larger than a card's page, and go on to the end of the last
    /// file. An unsound head counts only without sound sectors of other sessions.
    pub fn noise(&self) -> Option<String> {
        let behind = &self.summary.behind;
        let unsound = if behind.stale == 0 { behind.unsound } else { 0 };
        let is_older = |number: u64| number > PAGE_SECTORS as u64 && self.summary.foreign_at_end > 0;
        let number = Some(behind.foreign + unsound).filter(|number| *number > 0 && !is_older(*number))?;
        (!self.proof.is_whole() && self.summary.session.is_some()).then(|| {
            format!(
                "{} {} behind its last sector: damaged sectors, or what other files left there",
                count(number, "block"),
                foreign_words(number)
            )
        })
    }

    /// Sectors that disagree with their parity.
    pub fn contradicted(&self) -> Option<String> {
        let parity = &self.summary.parity;
        let (file, first, last) = parity.first?;
        let file = self.files.get(file).map_or("a file", String::as_str);
        let more = match parity.contradicted.saturating_sub(1) {
            0 => String::new(),
            more => format!(", and so it is with {more} more of their columns"),
        };
        Some(format!(
            "every eighth sector from {first} to {last} of {file} and the parity of these disagree: the file was altered after it \
             was recorded, and nothing was made again from that parity{more}"
        ))
    }

    /// Foreign sectors in its files, and missing files.
    pub fn strange(&self) -> Vec<String> {
        let parts = self.files.iter().filter(|name| is_part(Path::new(name)));
        let part_words = |name: &String| {
            format!(
                "{name} is a part of its log: the rest was not downloaded, or came damaged; the card has the whole log"
            )
        };
        let mut all: Vec<_> = parts.map(part_words).collect();
        all.extend(self.empty());
        all.extend(self.others());
        all.extend(self.missing());
        all
    }

    /// Files without a sector: made when the power failed, refused by the card, or out of its slot.
    fn empty(&self) -> Option<String> {
        let is_usual = |strange: &ForeignSectors| {
            let is_between = strange.file + 1 < self.files.len() && self.summary.gaps == 0;
            is_between || matches!(self.proof, Proof::NextStart(None))
        };
        let is_told =
            |strange: &&ForeignSectors| strange.hollow && strange.sectors == 0 && !is_usual(strange);
        let mut told = self.summary.strange.iter().filter(is_told);
        let name = told.next().and_then(|strange| self.files.get(strange.file))?;
        let more = match told.count() {
            0 => String::new(),
            more => format!(", and {} more", count(more as u64, "file")),
        };
        Some(format!("{name} has the name of a segment and holds nothing of ours{more}"))
    }

    pub(super) fn others(&self) -> Vec<String> {
        let is_told = |strange: &&ForeignSectors| strange.sectors > 0 && !self.is_begun_anew(strange);
        let told: Vec<_> = self.summary.strange.iter().filter(is_told).collect();
        let words = |strange: &&ForeignSectors| {
            format!(
                "{} of {} not of this log (the first at block {}, of session {:08x}): only this log is read",
                count(strange.sectors, "sector"),
                self.files.get(strange.file).map_or("a file", String::as_str).to_owned()
                    + if strange.sectors == 1 { " is" } else { " are" },
                strange.first,
                strange.session
            )
        };
        let mut all: Vec<_> = told.iter().take(NAMED_MAX).map(words).collect();
        if told.len() > NAMED_MAX {
            all.push(format!("so it is with {} more of its files", told.len() - NAMED_MAX));
        }
        all
    }

    /// Whether the last file was about to be rewritten, and holds another session from its beginning on. Its
    /// first sector may be torn.
    fn is_begun_anew(&self, strange: &ForeignSectors) -> bool {
        let is_last = strange.file + 1 == self.files.len();
        strange.hollow && is_last && strange.first <= 1 && matches!(self.proof, Proof::NextStart(None))
    }

    fn missing(&self) -> Option<String> {
        let segment = |name: &String| segment_name(Path::new(name)).map(|name| name.segment);
        // Without data on the card an empty file may exist, which is not copied.
        let is_passed = self.summary.gaps == 0 && self.summary.marks.has_card_trouble();
        let between = || {
            self.files.iter().zip(self.files.iter().skip(1)).find_map(|(before, after)| {
                let (first, end) = (segment(before)?.checked_add(1)?, segment(after)?);
                (first < end && !is_passed).then_some((first, end))
            })
        };
        let gone = Some((0, self.summary.files_gone)).filter(|(first, end)| first < end);
        let (first, end) = gone.or_else(between)?;
        Some(match end - first {
            1 => format!("file {first:02} of this log is not there"),
            _ => format!("files {first:02} to {:02} of this log are not there", end - 1),
        })
    }
}

const fn foreign_words(number: u64) -> &'static str {
    if number == 1 { "that is no sector" } else { "that are no sectors" }
}

const UNSOUND: &str = "with the head of a sector and a wrong check";

/// Empty without any.
pub fn behind_words(behind: &BlockCounts) -> String {
    words_of(&[
        (behind.damaged, "damaged"),
        (behind.misplaced, "of earlier parts of this log"),
        (behind.stale, "of another session"),
        (behind.unsound, UNSOUND),
        (behind.foreign, foreign_words(behind.foreign)),
        (behind.erased, "erased"),
        (behind.empty, "of zeros"),
    ])
}

/// Foreign blocks before its last sector: an earlier file may not have been full.
pub fn among_words(summary: &LogSummary) -> String {
    let (all, behind) = (&summary.blocks, &summary.behind);
    let foreign = all.foreign - behind.foreign;
    words_of(&[
        (all.stale - behind.stale, "of another session"),
        (all.unsound - behind.unsound, UNSOUND),
        (foreign, foreign_words(foreign)),
    ])
}

/// Sectors that count as copies; empty without any.
pub fn copies_words(all: &BlockCounts) -> String {
    let kinds = [(all.superseded, "superseded"), (all.misplaced, "there twice or where others belong")];
    let kinds = kinds.iter().filter(|(number, _)| *number > 0);
    kinds.map(|(number, kind)| format!("{} {kind}", count(*number, "sector"))).collect::<Vec<_>>().join(", ")
}

fn words_of(kinds: &[(u64, &str)]) -> String {
    let kinds = kinds.iter().filter(|(number, _)| *number > 0);
    kinds.map(|(number, kind)| format!("{} {kind}", count(*number, "block"))).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sectors_of_another_log_are_counted_with_the_first_ones_place() {
        let words = |hollow, proof| {
            let strange =
                vec![ForeignSectors { file: 0, hollow, sectors: 300, first: 1, session: 0x1a2b_3c4d }];
            let summary = LogSummary { session: Some(7), strange, ..LogSummary::default() };
            let names = ["00001_00.HUM".to_owned()];
            Ending { files: names.to_vec(), summary, proof, ..Ending::default() }.strange().join("; ")
        };
        let told = "300 sectors of 00001_00.HUM are not of this log (the first at block 1, of session 1a2b3c4d): only this log is read";
        assert_eq!([words(false, Proof::None), words(true, Proof::None)], [told, told]);
        assert_eq!(words(true, Proof::NextStart(None)), "", "the next start found it so");
    }

    #[test]
    fn files_that_are_not_there_are_named() {
        let words = |names: &[&str], files_gone| {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            let summary = LogSummary { session: Some(7), files_gone, ..LogSummary::default() };
            Ending { files: names.clone(), summary, ..Ending::default() }.strange().join("; ")
        };
        assert_eq!(words(&["00001_03.HUM"], 3), "files 00 to 02 of this log are not there");
        assert_eq!(words(&["00001_00.HUM", "00001_02.HUM"], 0), "file 01 of this log is not there");
    }

    #[test]
    fn a_number_that_no_file_has_is_no_finding_where_the_card_took_nothing_and_nothing_is_missing() {
        let strange = |second: &str, card_out, gaps| {
            let mut summary = LogSummary { session: Some(7), gaps, ..LogSummary::default() };
            summary.marks.card_out = card_out;
            let names = ["00001_00.HUM", second].map(str::to_owned);
            Ending { files: names.to_vec(), summary, ..Ending::default() }.strange().len()
        };
        assert_eq!([strange("00001_01.HUM", false, 0), strange("00001_03.HUM", false, 0)], [0, 1]);
        assert_eq!([strange("00001_03.HUM", true, 0), strange("00001_03.HUM", true, 1)], [0, 1]);
    }

    #[test]
    fn noise_behind_a_log_is_damage_unless_it_is_what_was_on_the_card_before() {
        let noise = |foreign, unsound, stale, foreign_at_end| {
            let behind = BlockCounts { foreign, unsound, stale, ..BlockCounts::default() };
            let summary = LogSummary { session: Some(1), behind, foreign_at_end, ..LogSummary::default() };
            Ending { summary, ..Ending::default() }.noise()
        };
        assert!(noise(0, 0, 0, 0).is_none());
        for (foreign, at_end) in [(1, 0), (32, 32), (100, 0), (10_000, 0)] {
            assert!(noise(foreign, 0, 0, at_end).is_some(), "{foreign}");
        }
        assert!(noise(10_000, 0, 0, 9_000).is_none(), "an old film");
        assert!(noise(0, 3, 0, 0).is_some(), "blocks with the head of a sector");
        assert!(noise(0, 3, 500, 0).is_none(), "torn sectors of an older session");
    }
}
