//! What is known of a log's end, and in which words.
//!
//! A log whose last sectors are gone looks like one whose power went earlier: nothing in it tells. So its end is proved
//! only by what was written for that: the mark of a session that was ended in order, or what the next start on the card
//! found. Without these the log is proved up to its last end mark (a disarming or a landing), as long as the vehicle did
//! not move on after it.

use hums_blackbox::BlockCounts;
use hums_blackbox::record::{Before, Found, Resting};
use hums_core::time::Instant;
use serde::Serialize;

use crate::logs::reader::Summary;
use crate::plural::count;
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
    /// The next start on the card found more than is there now: so many sectors, and frames where they were counted.
    Short {
        /// Sectors that are missing.
        sectors: u32,
        /// Frames that are missing.
        frames: Option<u32>,
    },
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
            return Self::Short { sectors: next.sectors - sectors, frames };
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
            Self::Short { sectors, frames } => {
                let frames =
                    frames.map_or_else(String::new, |frames| format!(", {}", count(frames, "frame")));
                format!("{} missing at its end{frames}: the next start found them", count(sectors, "sector"))
            }
        }
    }
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

/// Whether sectors of a session that began later lie in the log's files. What is left over there is older: a file is
/// only ever overwritten by a newer session.
pub fn has_newer(summary: &Summary) -> bool {
    let both = summary.other_epoch_us.zip(summary.epoch_us);
    both.is_some_and(|(other, own)| other > own.saturating_add(EPOCH_SLACK_US))
}

/// What lies behind the last sector, in words; empty where nothing does.
pub fn behind_words(behind: &BlockCounts) -> String {
    let kinds = [
        (behind.damaged, "damaged"),
        (behind.misplaced, "of earlier parts of this log"),
        (behind.stale, "of another session"),
        (behind.foreign, "that are no sectors"),
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
}

#[derive(Debug, Serialize)]
struct MarkJson {
    why: &'static str,
    time_s: f64,
    time_utc: Option<String>,
}

impl EndJson {
    /// The end of this log.
    pub fn new(proof: Proof, summary: &Summary) -> Self {
        let (sectors_missing, frames_missing) = match proof {
            Proof::Short { sectors, frames } => (sectors, frames),
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
            newer_session: has_newer(summary),
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
