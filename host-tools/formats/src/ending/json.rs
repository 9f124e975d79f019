//! The end of a log as JSON.

use hums_blackbox::BlockCounts;
use hums_core::clock::Instant;
use serde::Serialize;

use super::log::Ending;
use super::proof::{Proof, seconds_after};
use crate::utc::iso8601;

/// The end of a log as JSON.
#[derive(Debug, Serialize)]
pub struct EndJson {
    /// `closed`, `next_start`, `mark`, `none`, `short`, `differs`.
    proof: &'static str,
    /// The proof in words.
    words: String,
    /// The last end mark.
    mark: Option<MarkJson>,
    /// Number of marks.
    marks: u64,
    /// Recorded seconds after the last mark.
    after_mark_s: Option<f64>,
    /// An arming or take-off after the last mark.
    moved_s: Option<f64>,
    /// Counted by the next start, but lost.
    sectors_missing: u32,
    /// Counted by the next start, but lost.
    frames_missing: Option<u32>,
    /// Blocks behind the last sector.
    behind: BlocksJson,
    /// Sentences: why the log is not proved complete, and rebuilt sectors.
    not_proved: Vec<String>,
}

#[derive(Debug, Serialize)]
struct MarkJson {
    /// `landed`, `disarmed`, `mishap`.
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
            not_proved: ending.faults(),
        }
    }
}

/// Blocks of 512 bytes.
#[derive(Debug, Serialize)]
pub struct BlocksJson {
    /// All.
    blocks: u64,
    /// Older copies of a sector in progress, or left over from this session.
    superseded: u64,
    /// Sectors of this log at a wrong place.
    misplaced: u64,
    /// Damaged sectors.
    damaged: u64,
    /// Sectors of another session.
    other_session: u64,
    parity: u64,
    /// Sectors rebuilt from parity.
    repaired: u64,
    /// Only zeros.
    zero: u64,
    /// Only ones.
    erased: u64,
    /// The head of a sector with a wrong check.
    unsound: u64,
    /// Other data.
    foreign: u64,
    /// Sectors of another version.
    older_format: u64,
    /// Sectors of a newer version, and sealed ones.
    newer_format: u64,
}

impl BlocksJson {
    /// The JSON of these counts.
    pub const fn new(counts: &BlockCounts) -> Self {
        Self {
            blocks: counts.blocks,
            superseded: counts.superseded,
            misplaced: counts.misplaced,
            damaged: counts.damaged,
            other_session: counts.stale,
            parity: counts.parity,
            repaired: counts.repaired,
            zero: counts.empty,
            erased: counts.erased,
            unsound: counts.unsound,
            foreign: counts.foreign,
            older_format: counts.older_version,
            newer_format: counts.newer_version,
        }
    }
}
