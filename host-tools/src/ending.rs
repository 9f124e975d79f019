//! What is known of a log's end, and in which words.
//!
//! A log whose last sectors are gone looks like one whose power went earlier: nothing in it tells. So its end is proved
//! only by what was written for that: the mark of a session that was ended in order, or what the next start on the card
//! found. Without these the log is proved up to its last end mark (a disarming or a landing), as long as the vehicle did
//! not move on after it.

use std::path::Path;

use hums_blackbox::record::{Before, Found, Resting};
use hums_blackbox::{BlockCounts, PAGE_SECTORS};
use hums_core::time::Instant;
use serde::Serialize;

use crate::hex::hex;
use crate::logs::reader::Summary;
use crate::logs::strangers::{Others, Strange};
use crate::logs::{Log, segment_name};
use crate::plural::{are, count, noun};
use crate::sessions::{again_words, copy_words};
use crate::utc::iso8601;

/// Clocks of two power-ons differ by more than this, or say nothing about which one was first: microseconds.
const EPOCH_SLACK_US: u64 = 60_000_000;

/// What proves how a log ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Proof {
    /// Its last sector says that the session was ended in order.
    Closed,
    /// The next start on the card found that it ends there; with when the vehicle was armed or took off, if power went
    /// then: what the card did not take any more nobody knows.
    NextStart(Option<Instant>),
    /// It is whole to its last end mark.
    Mark(Instant, Resting),
    /// Nothing: it has no end mark, or the vehicle was armed or took off after the last one.
    #[default]
    None,
    /// There was more than is there now: so many sectors, and frames where they were counted.
    Short {
        /// Sectors that are missing.
        sectors: u32,
        /// Frames that are missing.
        frames: Option<u32>,
        /// Who tells.
        by: Teller,
    },
}

/// What tells where a log ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Teller {
    /// The next start on the card.
    NextStart,
    /// The next log of the same power-on, which was recorded by arming.
    NextLog,
}

impl Proof {
    /// What proves it, by what was read of the log and what the next start on the card recorded, if that is known.
    pub fn of(summary: &Summary, next: Option<&Before>) -> Self {
        let next = next.filter(|next| next.has_end() && Some(next.session) == summary.session);
        let sectors = summary.last_number.map_or(0, |last| last.wrapping_add(1));
        if let Some(next) = next
            && next.sectors > sectors
        {
            let counted = (next.found == Found::Frames).then_some(next.frames);
            let frames = counted.zip(summary.frames_end).map(|(there, here)| there.wrapping_sub(here));
            let frames = frames.filter(|missing| *missing < 1 << 31);
            return Self::Short { sectors: next.sectors - sectors, frames, by: Teller::NextStart };
        }
        if summary.closed {
            return Self::Closed;
        }
        if next.is_some_and(|next| next.sectors == sectors) {
            return Self::NextStart(summary.marks.moved);
        }
        match summary.marks.last {
            Some((at, why)) if summary.marks.moved.is_none() => Self::Mark(at, why),
            _ => Self::None,
        }
    }

    /// Whether nothing is known to be missing at the end, up to the last end mark at least.
    pub const fn holds(self) -> bool {
        matches!(self, Self::Closed | Self::NextStart(None) | Self::Mark(..))
    }

    /// Whether all of the end is proved.
    pub const fn is_whole(self) -> bool {
        matches!(self, Self::Closed | Self::NextStart(None))
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::NextStart(_) => "next_start",
            Self::Mark(..) => "mark",
            Self::None => "none",
            Self::Short { .. } => "short",
        }
    }

    /// How the log ends, as a part of a sentence.
    pub fn words(self, summary: &Summary) -> String {
        let moment = |at| moment(summary, at);
        match self {
            Self::Closed => "ended in order".to_owned(),
            Self::NextStart(None) if summary.session.is_none() => {
                "nothing was written into it, as the next start found".to_owned()
            }
            Self::NextStart(None) => "whole to its end, as the next start found it".to_owned(),
            Self::NextStart(Some(moved)) => format!(
                "whole to its end, as the next start found it; armed or in the air since {} when power went: what was \
                 not written then is not known",
                moment(moved)
            ),
            Self::Mark(at, why) => match seconds_after(summary, at).unwrap_or(0.0) {
                ..0.05 => format!("whole to the {} at {}; its end cannot be proved", why.words(), moment(at)),
                after => format!(
                    "whole to the {} at {}; after it {after:.1} s, whose end cannot be proved",
                    why.words(),
                    moment(at)
                ),
            },
            Self::None => match (summary.marks.moved, summary.marks.last) {
                (Some(moved), Some((at, why))) => format!(
                    "not proved to its end: armed or in the air since {}, without a landing or a disarming after it \
                     (the last was the {} at {})",
                    moment(moved),
                    why.words(),
                    moment(at)
                ),
                (Some(moved), None) => format!(
                    "not proved to its end: armed or in the air since {}, without a landing or a disarming after it",
                    moment(moved)
                ),
                (None, _) => {
                    "not proved to its end: it has no landing, no disarming and no orderly end".to_owned()
                }
            },
            Self::Short { sectors, frames, by } => {
                let frames =
                    frames.map_or_else(String::new, |frames| format!(", {}", count(frames, "frame")));
                let by = match by {
                    Teller::NextStart => "the next start found them",
                    Teller::NextLog => "the next log of the same power-on begins after them",
                };
                format!("{} missing at its end{frames}: {by}", count(sectors, "sector"))
            }
        }
    }
}

/// Files of a log that are named one by one.
const NAMED_MAX: usize = 3;

/// A log that was read: what tells whether it is whole, for every command alike.
#[derive(Clone, Debug, Default)]
pub struct Ending {
    /// Its name.
    pub name: String,
    /// The files that hold it.
    pub files: Vec<String>,
    /// What the reader saw.
    pub summary: Summary,
    /// What is known of its end.
    pub proof: Proof,
    /// What became of the session that was recorded on the card just before this one.
    pub before: SessionBefore,
    /// How it follows the log before it of the same power-on, where it was recorded by arming.
    pub power_on: PowerOn,
    /// What of its name disagrees with what the logs hold.
    pub misnamed: Option<Misnamed>,
    /// The name of the log of which it is a mere copy.
    pub again: Option<String>,
    /// It is what newer sessions left of one that no file holds any more.
    pub left_over: bool,
}

/// A log whose files have another session's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misnamed {
    /// The same session is there under this lower number.
    Copy {
        /// The number.
        of: u32,
    },
    /// It was recorded after the session of this number, which is its own or a higher one.
    Later {
        /// The number.
        before: u32,
    },
}

/// The session that was recorded on a card just before a log, as the log's boot record names it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SessionBefore {
    /// No boot record names one.
    #[default]
    NotNamed,
    /// It was read too.
    There,
    /// It is not among what was read, and nothing tells that it should be: the oldest logs make room for new ones.
    NotLookedFor(u32),
    /// It is not there, and an older log of the card is; or its files hold another session.
    Gone(u32),
    /// It is there under another number: files were renamed or exchanged.
    Elsewhere {
        /// Its number.
        number: u32,
        /// The number under which it is there.
        there: u32,
    },
}

impl SessionBefore {
    /// What is missing, as a part of a sentence.
    pub fn gone(self) -> Option<String> {
        match self {
            Self::Gone(number) => Some(format!(
                "session {number:05}, which was recorded just before it, is not there under that number"
            )),
            Self::Elsewhere { number, there } => Some(format!(
                "session {number:05}, which was recorded just before it, is there under the name {there:05}: files were \
                 renamed or exchanged"
            )),
            Self::NotNamed | Self::There | Self::NotLookedFor(_) => None,
        }
    }
}

/// How a log follows the one before it of the same power-on. A vehicle that is recorded by arming has several logs of a
/// power-on, whose sectors are numbered on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PowerOn {
    /// It is the first one, or nothing tells.
    #[default]
    First,
    /// It goes on where the one before it ends.
    Follows,
    /// It is not the first one, and the ones before are not among what was read. Nothing tells that they should be: the
    /// oldest logs make room for new ones.
    NotRead,
    /// Logs that were recorded before it are not there.
    Missing {
        /// The number of the last one that is there, if one is.
        after: Option<u32>,
        /// Sectors that were recorded meanwhile. Of those of a vehicle that waited disarmed not all were kept.
        sectors: u32,
        /// Frames until it begins.
        frames: Option<u32>,
        /// Seconds until it begins.
        seconds: Option<f64>,
    },
    /// No sector is missing between it and the log of this number, and its own number is not the next one.
    Renamed {
        /// The number.
        after: u32,
    },
    /// Its sectors were recorded before the end of the log of this lower number.
    Disordered {
        /// The number.
        after: u32,
    },
}

impl PowerOn {
    /// What is wrong, as a part of a sentence.
    pub fn wrong(self) -> Option<String> {
        match self {
            Self::First | Self::Follows | Self::NotRead => None,
            Self::Missing { after, sectors, frames, seconds } => {
                let after = after.map_or_else(String::new, |after| format!(" after session {after:05}"));
                let frames =
                    frames.map_or_else(String::new, |frames| format!(", {}", count(frames, "frame")));
                let seconds = seconds.map_or_else(String::new, |seconds| format!(", {seconds:.1} s"));
                Some(format!(
                    "what was recorded just before it{after} in the same power-on is not there: up to {}{frames}{seconds}",
                    count(sectors, "sector")
                ))
            }
            Self::Renamed { after } => Some(format!(
                "it goes on where session {after:05} of the same power-on ends, so its number is not its own: files were \
                 renamed"
            )),
            Self::Disordered { after } => Some(format!(
                "its sectors were recorded before the end of session {after:05} of the same power-on: files were renamed, \
                 exchanged or copied"
            )),
        }
    }

    /// What there is to say where nothing is wrong.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Follows => "it goes on where the one before it ends",
            Self::NotRead => "the logs before it are not among what was read",
            _ => "",
        }
    }
}

impl Ending {
    /// A log by itself; [`crate::followed`] adds what later ones tell of it.
    pub fn of(log: &Log, summary: Summary) -> Self {
        let proof = Proof::of(&summary, None);
        Self {
            name: log.name.clone(),
            files: log.files.clone(),
            summary,
            proof,
            before: SessionBefore::NotNamed,
            power_on: PowerOn::default(),
            misnamed: None,
            again: None,
            left_over: log.left_over,
        }
    }

    /// How the log ends, as a part of a sentence.
    pub fn words(&self) -> String {
        self.proof.words(&self.summary)
    }

    /// The number under which the same session is there too, of a log that is not to be counted again.
    pub const fn copy_of(&self) -> Option<u32> {
        match self.misnamed {
            Some(Misnamed::Copy { of }) => Some(of),
            _ => None,
        }
    }

    /// That it is a mere copy of a log that was read too, as a part of a sentence.
    pub fn again(&self) -> Option<String> {
        self.again.as_deref().map(again_words)
    }

    /// That it is left over, as a part of a sentence.
    pub fn left_over_words(&self) -> Option<String> {
        self.left_over.then(|| {
            format!(
                "is left over from before: no file holds it any more; {} can be read, and what is missing was deleted or \
                 written over",
                count(self.summary.frames, "frame")
            )
        })
    }

    /// Whether it is not to be counted: its session is there under another name.
    pub const fn is_counted(&self) -> bool {
        self.copy_of().is_none() && self.again.is_none()
    }

    /// Whether nothing was lost or damaged, and the log is proved to its end or at least to its last end mark.
    pub fn is_proved(&self) -> bool {
        self.unproved().is_empty()
    }

    /// Why it is not, as parts of sentences: what is lost or damaged, what is not proved, what of its files is not the log's.
    /// What there is to say of a mere copy is said of its original.
    pub fn unproved(&self) -> Vec<String> {
        let mut all = Vec::new();
        if self.again.is_some() || self.left_over {
            return all;
        }
        let (summary, blocks) = (&self.summary, &self.summary.blocks);
        let lost = summary.marks.lost;
        if summary.gaps > 0 || blocks.damaged > 0 || lost > 0 {
            all.push(format!(
                "{}, {} missing, {}, {} or {} lost while recording",
                count(summary.gaps, "gap"),
                summary.missing_words(),
                count(blocks.damaged, "damaged sector"),
                count(lost, "frame"),
                noun(lost, "record")
            ));
        }
        if blocks.misplaced > 0 {
            all.push(format!("{} there twice, or where others belong", are(blocks.misplaced, "sector")));
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
        all.extend(self.noise());
        all.extend(self.strange());
        all.extend(self.newer());
        all.extend(self.before.gone());
        all.extend(self.power_on.wrong());
        all
    }

    /// Blocks behind the last sector that are neither empty nor sectors of any log, where nothing proves that the log ends
    /// before them: sectors of the log that went wrong look so. What was on a card before the box used it is more than a card's
    /// page, and goes on to the end of the last file.
    pub fn noise(&self) -> Option<String> {
        let is_older = |number: u64| number > PAGE_SECTORS as u64 && self.summary.foreign_at_end > 0;
        let number = Some(self.summary.behind.foreign).filter(|number| *number > 0 && !is_older(*number))?;
        (!self.proof.is_whole() && self.summary.session.is_some()).then(|| {
            format!(
                "{} {} behind its last sector: damaged sectors, or what other files left there",
                count(number, "block"),
                foreign_words(number)
            )
        })
    }

    /// What of its files is not the log's.
    pub fn strange(&self) -> Vec<String> {
        // A file that the next start found empty was made when the power went; so was one that was to be written anew.
        let last = self.files.len().saturating_sub(1);
        let is_usual = |strange: &Strange| {
            strange.hollow && self.proof == Proof::NextStart(None)
                || strange.older && strange.file == last && !self.summary.closed
        };
        let told = |strange: &&Strange| !is_usual(strange) || strange.others.is_some();
        let told: Vec<_> = self.summary.strange.iter().filter(told).collect();
        let mut all: Vec<_> =
            told.iter().take(NAMED_MAX).map(|strange| self.strange_words(strange)).collect();
        let gone = self.summary.files_gone;
        if gone > 0 {
            all.push(format!(
                "the first {} of it {} not there: the recorder overwrites the oldest ones when a card is full; else they \
                 were taken away",
                count(gone, "file"),
                if gone == 1 { "is" } else { "are" }
            ));
        }
        match self.misnamed {
            Some(Misnamed::Copy { of }) => all.push(format!("it {}", copy_words(of))),
            Some(Misnamed::Later { before }) => all.push(format!(
                "it was recorded after session {before:05}, so its number is not its own: files were renamed or exchanged"
            )),
            None => {}
        }
        if told.len() > NAMED_MAX {
            all.push(format!("so it is with {} more of its files", told.len() - NAMED_MAX));
        }
        all.extend(self.joined());
        all.extend(self.misnumbered());
        all
    }

    /// A later log of the same power-on follows in its files.
    fn joined(&self) -> Option<String> {
        self.summary.joined.map(|joined| {
            format!(
                "{} behind its end, from number {} on, of a later log of the same power-on: logs were joined into one \
                 file; only the first is read: give each by itself",
                are(joined.sectors, "sector"),
                joined.first
            )
        })
    }

    /// Names of its files that do not follow each other. The recorder numbers them one by one, and only the first ones may
    /// be missing.
    fn misnumbered(&self) -> Option<String> {
        let segment = |name: &String| segment_name(Path::new(name)).map(|name| name.segment);
        let first = self.files.first().filter(|_| self.summary.is_renamed).map(|file| {
            format!("{file} begins as the first file of its log, and has not the number of one: files were renamed")
        });
        let jump = || {
            self.files.iter().zip(self.files.iter().skip(1)).find_map(|(before, after)| {
                let follows = segment(before)?.checked_add(1)? == segment(after)?;
                (!follows).then(|| {
                    format!("no file is there between {before} and {after}: one was taken away, or files were renamed")
                })
            })
        };
        first.or_else(jump)
    }

    fn strange_words(&self, strange: &Strange) -> String {
        let file = self.files.get(strange.file).map_or("a file", String::as_str);
        match strange.others {
            None if strange.older => {
                format!(
                    "all sectors in {file} are older than the log's first one: files were renamed or exchanged"
                )
            }
            None => format!("{file} has the name of a segment and holds nothing of ours"),
            Some(others) if strange.hollow => format!(
                "{file} has the name of a segment of this log and holds {}{}",
                count(others.sectors, "sector"),
                of_whom(&others)
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
    fn newer(&self) -> Option<String> {
        let told = self.summary.strange.iter().any(|strange| strange.others.is_some());
        (self.has_newer() && !told).then(|| {
            format!(
                "{} of other sessions, of which one began later: logs were joined into one file; only this log is \
                 read: give each by itself",
                are(self.summary.blocks.stale, "sector")
            )
        })
    }

    /// Whether sectors of a session that began later lie in the log's files. What is left over there is older: a file is
    /// only ever overwritten by a newer session. Where the log's end is proved, the other one's clock was wrong.
    pub fn has_newer(&self) -> bool {
        let both = self.summary.other_epoch_us.zip(self.summary.epoch_us);
        !self.proof.is_whole() && both.is_some_and(|(other, own)| other > own.saturating_add(EPOCH_SLACK_US))
    }
}

/// Whose sectors they are.
fn of_whom(others: &Others) -> String {
    let board = others.board.map_or_else(String::new, |board| format!("box {}, ", hex(&board)));
    let several = if others.several { ", and of more" } else { "" };
    format!(" of another session ({board}session {:08x}{several})", others.session)
}

/// From a time to the log's last entry.
fn seconds_after(summary: &Summary, at: Instant) -> Option<f64> {
    summary.last.map(|last| last.since(at).as_micros() as f64 / 1e6)
}

/// A time in UTC where it is known, otherwise in seconds since power-on.
fn moment(summary: &Summary, at: Instant) -> String {
    let utc = summary.epoch_us.map(|epoch| epoch.saturating_add(at.as_micros()));
    utc.map_or_else(|| format!("{:.3} s", at.as_secs_f64()), |utc| iso8601(utc / 1000 * 1000))
}

/// That a block is no sector of a log.
const fn foreign_words(number: u64) -> &'static str {
    if number == 1 { "that is no sector" } else { "that are no sectors" }
}

/// What lies behind the last sector, in words; empty where nothing does.
pub fn behind_words(behind: &BlockCounts) -> String {
    let kinds = [
        (behind.damaged, "damaged"),
        (behind.misplaced, "of earlier parts of this log"),
        (behind.stale, "of another session"),
        (behind.foreign, foreign_words(behind.foreign)),
        (behind.erased, "erased"),
        (behind.empty, "of zeros"),
    ];
    let parts: Vec<_> = kinds
        .iter()
        .filter(|(number, _)| *number > 0)
        .map(|(number, kind)| format!("{} {kind}", count(*number, "block")))
        .collect();
    parts.join(", ")
}

/// The end of a log as JSON.
#[derive(Debug, Serialize)]
pub struct EndJson {
    /// What proves it: `closed`, `next_start`, `mark`, `none`, `short`.
    proof: &'static str,
    /// The same in words.
    words: String,
    /// The last end mark.
    mark: Option<MarkJson>,
    /// How many end marks there are.
    marks: u64,
    /// Seconds after the last end mark, whose end nothing proves.
    after_mark_s: Option<f64>,
    /// When the vehicle was armed or took off after the last end mark, seconds since power-on.
    moved_s: Option<f64>,
    /// Sectors and frames that the next start found and that are gone.
    sectors_missing: u32,
    frames_missing: Option<u32>,
    /// What lies behind the last sector.
    behind: BlocksJson,
    /// Sectors of a session that began later lie in it.
    newer_session: bool,
    /// Why the log is not called whole, as sentences; none where it is.
    not_proved: Vec<String>,
}

#[derive(Debug, Serialize)]
struct MarkJson {
    why: &'static str,
    time_s: f64,
    time_utc: Option<String>,
}

impl EndJson {
    /// The end of this log.
    pub fn new(ending: &Ending) -> Self {
        let (proof, summary) = (ending.proof, &ending.summary);
        let (sectors_missing, frames_missing) = match proof {
            Proof::Short { sectors, frames, .. } => (sectors, frames),
            _ => (0, Some(0)),
        };
        let mark = summary.marks.last.map(|(at, why)| MarkJson {
            why: why.name(),
            time_s: at.as_secs_f64(),
            time_utc: summary.epoch_us.map(|epoch| iso8601(epoch.saturating_add(at.as_micros()))),
        });
        let after = summary.marks.last.and_then(|(at, _)| seconds_after(summary, at));
        Self {
            proof: proof.name(),
            words: proof.words(summary),
            mark,
            marks: summary.marks.count,
            after_mark_s: after,
            moved_s: summary.marks.moved.map(Instant::as_secs_f64),
            sectors_missing,
            frames_missing,
            behind: BlocksJson::new(&summary.behind),
            newer_session: ending.has_newer(),
            not_proved: ending.unproved(),
        }
    }
}

/// Blocks of 512 bytes, by what they are.
#[derive(Debug, Serialize)]
pub struct BlocksJson {
    blocks: u64,
    /// Copies of a sector in progress, and what the file held before from this session.
    superseded: u64,
    misplaced: u64,
    damaged: u64,
    other_session: u64,
    zero: u64,
    erased: u64,
    foreign: u64,
    newer_format: u64,
}

impl BlocksJson {
    /// These counts.
    pub const fn new(counts: &BlockCounts) -> Self {
        Self {
            blocks: counts.blocks,
            superseded: counts.superseded,
            misplaced: counts.misplaced,
            damaged: counts.damaged,
            other_session: counts.stale,
            zero: counts.empty,
            erased: counts.erased,
            foreign: counts.foreign,
            newer_format: counts.other_version,
        }
    }
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
        let strange = |hollow| Ending {
            files: vec!["00001_00.HUM".to_owned()],
            summary: Summary {
                strange: vec![Strange { file: 0, hollow, older: false, others: Some(others) }],
                ..Summary::default()
            },
            ..Ending::default()
        };
        let [joined, hollow] = [false, true].map(|hollow| strange(hollow).strange().join(""));
        let whom = "of another session (box 3f3f3f3f3f3f3f3f3f3f3f3f, session 1a2b3c4d)";
        assert!(joined.starts_with(&format!("sectors 400 to 699 of 00001_00.HUM are {whom}: ")), "{joined}");
        assert!(hollow.ends_with(&format!("holds 300 sectors {whom}")), "{hollow}");
    }

    #[test]
    fn noise_behind_a_log_is_damage_unless_it_is_what_was_on_the_card_before() {
        let noise = |foreign, foreign_at_end| {
            let behind = BlockCounts { foreign, ..BlockCounts::default() };
            let summary = Summary { session: Some(1), behind, foreign_at_end, ..Summary::default() };
            Ending { summary, ..Ending::default() }.noise()
        };
        assert!(noise(0, 0).is_none());
        for (foreign, at_end) in [(1, 0), (32, 32), (100, 0), (10_000, 0)] {
            assert!(noise(foreign, at_end).is_some(), "{foreign}");
        }
        assert!(noise(10_000, 9_000).is_none(), "an old film");
    }
}
