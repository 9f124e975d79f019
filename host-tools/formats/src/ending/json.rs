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
    /// `closed`, `next_start`, `mark`, `none`, `short`.
    proof: &'static str,
    words: String,
    mark: Option<MarkJson>,
    marks: u64,
    /// Seconds after the last mark, without a proof of their end.
    after_mark_s: Option<f64>,
    /// Arming or take-off after the last mark, seconds since power-on.
    moved_s: Option<f64>,
    /// Found by the next start.
    sectors_missing: u32,
    frames_missing: Option<u32>,
    behind: BlocksJson,
    /// Sentences: why the log does not count as whole, and a remark on rebuilt sectors.
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
            not_proved: ending.faults(),
        }
    }
}

/// Blocks of 512 bytes.
#[derive(Debug, Serialize)]
pub struct BlocksJson {
    blocks: u64,
    /// Copies of a sector in progress, and older content of this session.
    superseded: u64,
    misplaced: u64,
    damaged: u64,
    other_session: u64,
    parity: u64,
    /// Rebuilt from parity.
    repaired: u64,
    zero: u64,
    erased: u64,
    /// Heads without a valid check, of other sessions as far as known.
    unsound: u64,
    foreign: u64,
    older_format: u64,
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
