//! What of a log's files is not the log's, and what lies behind its last sector.

use std::path::Path;

use hums_blackbox::{BlockCounts, PAGE_SECTORS};

use super::proof::Proof;
use crate::hex::hex;
use crate::logs::naming::is_part;
use crate::logs::reader::Summary;
use crate::logs::segment_name;
use crate::logs::strangers::{Others, Shift, Strange};
use crate::plural::{are, count};

/// Clocks of two power-ons differ by more than this, or say nothing about which one was first: microseconds.
const EPOCH_SLACK_US: u64 = 60_000_000;
/// No box recorded before 2025, and a clock that says so is wrong: microseconds since 1970.
const EARLIEST_US: u64 = 1_735_689_600_000_000;
/// Files of a log that are named one by one.
const NAMED_MAX: usize = 3;

/// A log's files, and what was read of them.
pub(super) struct Files<'a> {
    pub(super) names: &'a [String],
    pub(super) summary: &'a Summary,
    pub(super) proof: Proof,
}

impl Files<'_> {
    /// Blocks behind the last sector that are neither empty nor sectors of any log, where nothing proves that the log ends
    /// before them: sectors of the log that went wrong look so. What was on a card before the box used it is more than a card's
    /// page, and goes on to the end of the last file. What begins as a sector and fails its check is counted only where no
    /// sound sector of another session lies there too: then it is left over as they are.
    pub(super) fn noise(&self) -> Option<String> {
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

    /// That sectors disagree with their parity, which was made of them when they were on the card.
    pub(super) fn contradicted(&self) -> Option<String> {
        let parity = &self.summary.parity;
        let (file, first, last) = parity.first?;
        let file = self.names.get(file).map_or("a file", String::as_str);
        let more = match parity.contradicted.saturating_sub(1) {
            0 => String::new(),
            more => format!(", and so it is with {more} more of their columns"),
        };
        Some(format!(
            "every eighth sector from {first} to {last} of {file} and the parity of these disagree: the file was altered after it \
             was recorded, and nothing was made again from that parity{more}"
        ))
    }

    /// Files that hold what is not the log's, and files that are missing before its first one.
    pub(super) fn strange(&self) -> Vec<String> {
        let parts = self.names.iter().filter(|name| is_part(Path::new(name)));
        let part_words = |name: &String| {
            format!(
                "{name} is a part of its log, as `hums pull --around` brings it: what it lacks was not brought, or came damaged; `hums pull` \
                 brings what the card has"
            )
        };
        let parts: Vec<_> = parts.map(part_words).collect();
        let told: Vec<_> = self.summary.strange.iter().filter(|strange| !self.is_usual(strange)).collect();
        let strange = told.iter().take(NAMED_MAX).map(|strange| self.strange_words(strange));
        let mut all: Vec<_> = parts.into_iter().chain(strange).collect();
        if told.len() > NAMED_MAX {
            all.push(format!("so it is with {} more of its files", told.len() - NAMED_MAX));
        }
        let gone = self.summary.files_gone;
        if gone > 0 {
            all.push(format!(
                "the first {} of it {} not there: the recorder overwrites the oldest ones when a card is full; else they \
                 were taken away",
                count(gone, "file"),
                if gone == 1 { "is" } else { "are" }
            ));
        }
        all.extend(self.joined());
        all.extend(self.misnumbered());
        all
    }

    /// What other logs its files hold, which are not read.
    pub(super) fn others(&self) -> Vec<String> {
        let is_other = |strange: &&Strange| strange.others.is_some() && !self.is_usual(strange);
        let strange = self.summary.strange.iter().filter(is_other).map(|strange| self.strange_words(strange));
        strange.chain(self.joined()).chain(self.newer()).collect()
    }

    /// A file that the next start found empty was made when the power went; so was one that was to be written anew, which
    /// still holds what it held before. One between sectors that follow each other got nothing: the card refused it, or was out.
    fn is_usual(&self, strange: &Strange) -> bool {
        let is_empty = strange.hollow && matches!(self.proof, Proof::NextStart(None) | Proof::NextLog);
        match strange.others {
            Some(others) => is_empty && self.is_begun_anew(strange, &others),
            None if strange.shift.is_some() => false,
            None => {
                is_empty || strange.passed || strange.older && self.is_last(strange) && !self.summary.closed
            }
        }
    }

    fn is_last(&self, strange: &Strange) -> bool {
        strange.file + 1 == self.names.len()
    }

    /// Whether all that a file holds is another log from its beginning on, as of one that was to be written anew, and what
    /// that one had not written over. Its first sector may be torn.
    fn is_begun_anew(&self, strange: &Strange, others: &Others) -> bool {
        strange.hollow && self.is_last(strange) && others.first <= 1
    }

    /// Another log of the same power-on is in its files.
    fn joined(&self) -> Option<String> {
        self.summary.joined.map(|joined| {
            let (place, of) = if joined.is_within {
                ("in one of its files", "another file")
            } else {
                ("behind its end", "a later log")
            };
            format!(
                "{} {place}, from number {} on, of {of} of the same power-on: logs were joined into one file; only the \
                 first is read: give each by itself",
                are(joined.sectors, "sector"),
                joined.first
            )
        })
    }

    /// Names of its files that do not follow each other. The recorder numbers them one by one, and only the first ones may
    /// be missing.
    fn misnumbered(&self) -> Option<String> {
        let segment = |name: &String| segment_name(Path::new(name)).map(|name| name.segment);
        let first = self.names.first().filter(|_| self.summary.is_renamed).map(|file| {
            format!(
                "{file} begins as the first file of its log, and has not the number of one: files were renamed, or nothing came into \
                 those before it"
            )
        });
        // Where the card was out, or refused what came, a file may have been begun into which nothing came: it is not copied.
        let is_passed = self.summary.gaps == 0 && self.summary.marks.has_card_trouble();
        let jump = || {
            self.names.iter().zip(self.names.iter().skip(1)).find_map(|(before, after)| {
                let (before_number, number) = (segment(before)?, segment(after)?);
                let follows = before_number.checked_add(1)? == number || is_passed && before_number < number;
                (!follows).then(|| {
                    format!("no file is there between {before} and {after}: one was taken away, or files were renamed")
                })
            })
        };
        first.or_else(jump)
    }

    fn strange_words(&self, strange: &Strange) -> String {
        let file = self.names.get(strange.file).map_or("a file", String::as_str);
        match strange.others {
            None if strange.older => {
                format!(
                    "all sectors in {file} are older than the log's first one: files were renamed or exchanged"
                )
            }
            None => match strange.shift {
                Some(Shift { at, blocks }) => format!(
                    "from block {at} of {file} on its sectors lie {} too far back: something was put before them",
                    count(blocks, "block")
                ),
                None => format!("{file} has the name of a segment and holds nothing of ours"),
            },
            Some(others) if strange.hollow => format!(
                "{file} has the name of a segment of this log and holds {}{}{}",
                count(others.sectors, "sector"),
                of_whom(&others),
                if self.is_begun_anew(strange, &others) {
                    ": the recorder had just begun to write it anew when power went, or files were exchanged"
                } else {
                    ""
                }
            ),
            Some(others) => format!(
                "sectors {} to {} of {file} are{}: logs were joined into one file, or it was made where a deleted log \
                 lay; only this log is read: give each by itself",
                others.first,
                others.last,
                of_whom(&others)
            ),
        }
    }

    /// Sectors of a session that began later lie where a recycled file may have older ones.
    pub(super) fn newer(&self) -> Option<String> {
        let told = self.summary.strange.iter().any(|strange| strange.others.is_some());
        (self.has_newer() && !told).then(|| {
            format!(
                "{} of other sessions, of which one began later by its clock: logs were joined into one file; only this \
                 log is read: give each by itself",
                are(self.summary.blocks.stale, "sector")
            )
        })
    }

    /// Whether sectors of a session that began later lie in the log's files. What is left over there is older: a file is
    /// only ever overwritten by a newer session.
    pub(super) fn has_newer(&self) -> bool {
        let both =
            self.summary.other_epoch_us.zip(self.summary.epoch_us.filter(|epoch| *epoch >= EARLIEST_US));
        both.is_some_and(|(other, own)| other > own.saturating_add(EPOCH_SLACK_US))
    }
}

/// Whose sectors they are.
fn of_whom(others: &Others) -> String {
    let board = others.board.map_or_else(String::new, |board| format!("box {}, ", hex(&board)));
    let several = if others.several { ", and of more" } else { "" };
    format!(" of another session ({board}session {:08x}{several})", others.session)
}

/// That a block is no sector of a log.
const fn foreign_words(number: u64) -> &'static str {
    if number == 1 { "that is no sector" } else { "that are no sectors" }
}

/// Of blocks that begin as a sector does.
const UNSOUND: &str = "with the head of a sector and a wrong check";

/// What lies behind the last sector, in words; empty where nothing does.
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

/// What lies before its last sector and is not the log's, in words; empty where nothing does. A file that is not the last one
/// may have been left before it was full.
pub fn among_words(summary: &Summary) -> String {
    let (all, behind) = (&summary.blocks, &summary.behind);
    let foreign = all.foreign - behind.foreign;
    words_of(&[
        (all.stale - behind.stale, "of another session"),
        (all.unsound - behind.unsound, UNSOUND),
        (foreign, foreign_words(foreign)),
    ])
}

/// Sectors of the log that count once more or not at all, in words; empty where there are none.
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
    fn a_stranger_is_named_by_box_and_session() {
        let others = Others {
            sectors: 300,
            first: 400,
            last: 699,
            session: 0x1a2b_3c4d,
            board: Some([0x3f; 12]),
            several: false,
        };
        let words = |hollow| {
            let strange = vec![Strange {
                file: 0,
                hollow,
                passed: false,
                older: false,
                others: Some(others),
                shift: None,
            }];
            let summary = Summary { strange, ..Summary::default() };
            Files { names: &["00001_00.HUM".to_owned()], summary: &summary, proof: Proof::None }
                .strange()
                .join("")
        };
        let [joined, hollow] = [false, true].map(words);
        let whom = "of another session (box 3f3f3f3f3f3f3f3f3f3f3f3f, session 1a2b3c4d)";
        assert!(joined.starts_with(&format!("sectors 400 to 699 of 00001_00.HUM are {whom}: ")), "{joined}");
        assert!(hollow.ends_with(&format!("holds 300 sectors {whom}")), "{hollow}");
    }

    #[test]
    fn a_number_that_no_file_has_is_no_finding_where_the_card_took_nothing_and_nothing_is_missing() {
        let strange = |second: &str, card_out, gaps| {
            let mut summary = Summary { gaps, ..Summary::default() };
            summary.marks.card_out = card_out;
            let names = ["00001_00.HUM", second].map(str::to_owned);
            Files { names: &names, summary: &summary, proof: Proof::None }.strange().len()
        };
        assert_eq!([strange("00001_01.HUM", false, 0), strange("00001_03.HUM", false, 0)], [0, 1]);
        assert_eq!([strange("00001_03.HUM", true, 0), strange("00001_03.HUM", true, 1)], [0, 1]);
    }

    #[test]
    fn a_clock_of_before_any_box_says_nothing_about_which_session_began_later() {
        let has_newer = |own, other| {
            let summary = Summary { epoch_us: Some(own), other_epoch_us: Some(other), ..Summary::default() };
            Files { names: &[], summary: &summary, proof: Proof::None }.has_newer()
        };
        let (then, now) = (1_554_595_200_000_000, 1_790_000_000_000_000);
        assert!(has_newer(now, now + 2 * EPOCH_SLACK_US) && !has_newer(now, now));
        assert!(!has_newer(then, now), "2019");
    }

    #[test]
    fn noise_behind_a_log_is_damage_unless_it_is_what_was_on_the_card_before() {
        let noise = |foreign, unsound, stale, foreign_at_end| {
            let behind = BlockCounts { foreign, unsound, stale, ..BlockCounts::default() };
            let summary = Summary { session: Some(1), behind, foreign_at_end, ..Summary::default() };
            Files { names: &[], summary: &summary, proof: Proof::None }.noise()
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
