//! A stretch of requested sectors of a log, read and judged as by `hums info --verify`, without the rest of
//! the log. Each place should hold its own sector. If one does not, its part of the recording is unknown and
//! may hold the wanted data.

use std::ops::Range;
use std::path::PathBuf;

use anyhow::Result;
use hums_blackbox::{BlockCounts, Gap, Header, SECTOR_BYTES};
use hums_core::clock::Instant;

use super::session::number;
use crate::logs::fat::Extent as Bytes;
use crate::logs::{Log, Piece};
use crate::plural::count;
use crate::summary::{FindingLine, Overview};
use crate::utc::moment;
use crate::verify::{Extent, failed};

/// Requested places of a log.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    /// As the board calls the log.
    pub(super) name: String,
    /// The file with the sectors on this PC.
    pub(super) path: PathBuf,
    pub(super) places: Range<u32>,
    /// Number of places of the log.
    pub(super) sectors: u32,
}

impl Stretch {
    /// All of it, for readers of logs.
    pub(super) fn piece(&self) -> Piece {
        const SECTOR: u64 = SECTOR_BYTES as u64;
        let Range { start, end } = self.places;
        let length = u64::from(end.saturating_sub(start)) * SECTOR;
        Piece { path: self.path.clone(), extents: vec![Bytes { start: u64::from(start) * SECTOR, length }] }
    }
}

/// The data read from consecutive stretches.
pub(super) struct Reading {
    overview: Overview,
    /// The first place holds a sector.
    begins: bool,
    /// The last one.
    last: Option<Stretch>,
}

impl Reading {
    /// Reads stretches of the logs of one number, in order; each one continues the one before.
    pub(super) fn of(stretches: &[Stretch]) -> Result<Self> {
        let name = stretches.first().map_or_else(String::new, |first| first.name.clone());
        let pieces = stretches.iter().map(Stretch::piece).collect();
        let log = Log { name, files: Vec::new(), pieces, session: None, left_over: false };
        Ok(Self {
            begins: log.blocks().next_block()?.is_some_and(|block| Header::read(block).is_ok()),
            last: stretches.last().cloned(),
            overview: Overview::verified(&log)?,
        })
    }

    /// Times of the first and the last readable entry. A session has no data before its first entry.
    pub(super) fn span(&self) -> Option<(Instant, Instant)> {
        let summary = &self.overview.ending.summary;
        let first =
            summary.first.map(|first| if summary.first_number == Some(0) { Instant::ZERO } else { first });
        first.zip(summary.last)
    }

    /// The board's name of the first one.
    pub(super) fn first_name(&self) -> &str {
        &self.overview.ending.name
    }

    /// The board's name of the last one.
    pub(super) fn name(&self) -> &str {
        self.last.as_ref().map_or("", |last| &last.name)
    }

    /// Whether the log has more than these; `names` are those of the session's files.
    pub(super) fn goes_on(&self, names: &[String]) -> bool {
        let is_later = |name: &&String| number(name) == number(self.name()) && name.as_str() > self.name();
        self.last.as_ref().is_some_and(|last| last.places.end < last.sectors)
            || names.iter().any(|name| is_later(&name))
    }

    /// Whether the session ends with them.
    pub(super) fn is_to_end(&self, names: &[String]) -> bool {
        !self.goes_on(names) && names.last().is_some_and(|newest| newest == self.name())
    }

    /// UTC at power-on, microseconds since 1970, by the last clock record.
    pub(super) fn epoch_us(&self) -> Option<u64> {
        self.overview.ending.summary.epoch_us
    }

    /// The changes of level, in order.
    pub(super) fn findings(&self) -> &[FindingLine] {
        &self.overview.contents.findings
    }

    /// The way they end, if the end has no fault but completeness is not proved.
    pub(super) fn unproved_end(&self) -> Option<String> {
        let ending = &self.overview.ending;
        (ending.proof.holds() && !ending.proof.is_whole()).then(|| ending.words())
    }

    /// Their faults, as parts of sentences; with `to_end` also a missing proof of the log's end.
    pub(super) fn faults(&self, to_end: bool) -> Vec<String> {
        self.faults_of(|_| true, to_end)
    }

    /// The same; of the unreadable places only those that `is_wanted` accepts.
    pub(super) fn faults_of(&self, is_wanted: impl FnOnce(&Unread) -> bool, to_end: bool) -> Vec<String> {
        let unread = self.unread().filter(is_wanted).as_ref().map(Unread::words);
        // Their numbers show a gap before them.
        let extent = Extent { from_start: false, to_end, follows: false };
        let failed = failed(&self.overview, extent);
        unread.into_iter().chain(failed.into_iter().map(|(check, why)| format!("{check}: {why}"))).collect()
    }

    /// Places with a missing or undecodable sector.
    pub(super) fn unread(&self) -> Option<Unread> {
        let summary = &self.overview.ending.summary;
        let mut lost = not_ours(&summary.blocks);
        let mut is_lost_behind = not_ours(&summary.behind) > 0;
        if summary.closed {
            // Blocks after a log's end do not belong to it.
            (lost, is_lost_behind) = (lost - not_ours(&summary.behind), false);
        }
        // The data before them were not requested and are not a gap.
        let is_within = |gap: &&Gap| gap.from.is_some() || gap.sectors_skipped > 0;
        let gaps: Vec<&Gap> = self.overview.contents.gaps.iter().filter(is_within).collect();
        let missing =
            gaps.iter().filter(|gap| gap.from.is_some()).map(|gap| u64::from(gap.sectors_lost)).sum();
        let useless: u64 = gaps.iter().map(|gap| u64::from(gap.sectors_skipped)).sum();
        if lost == 0 && gaps.is_empty() {
            return None;
        }
        let from = match gaps.first() {
            _ if !self.begins => None,
            Some(gap) => gap.from,
            None => summary.last,
        };
        let to = match gaps.last() {
            _ if is_lost_behind => None,
            Some(gap) => gap.to,
            None => summary.first,
        };
        // A gap of unknown length counts as at least one sector.
        Some(Unread { sectors: lost.max(missing).saturating_add(useless).max(1), from, to })
    }
}

/// Number of blocks that are not the log's sectors, or not at their places.
const fn not_ours(blocks: &BlockCounts) -> u64 {
    let BlockCounts { misplaced, damaged, stale, unsound, empty, erased, foreign, .. } = *blocks;
    misplaced + damaged + stale + unsound + empty + erased + foreign
}

/// Stretches of logs of one number each, in their order.
pub(super) fn by_number(stretches: &[Stretch]) -> impl Iterator<Item = &[Stretch]> {
    stretches.chunk_by(|one, next| number(&one.name) == number(&next.name))
}

/// Requested sectors that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Unread {
    pub(super) sectors: u64,
    /// The last entry before them, and the first one behind them.
    pub(super) from: Option<Instant>,
    pub(super) to: Option<Instant>,
}

impl Unread {
    /// All of these: some, and later ones.
    pub(super) fn all(earlier: Option<Self>, later: Option<Self>) -> Option<Self> {
        let (Some(one), Some(other)) = (earlier, later) else { return earlier.or(later) };
        Some(Self { sectors: one.sectors.saturating_add(other.sectors), from: one.from, to: other.to })
    }

    /// Whether any of them may be of this time. If no data were read before or after them, they may be of any
    /// time.
    pub(super) fn is_within(&self, from: Instant, to: Instant) -> bool {
        self.to.is_none_or(|behind| behind >= from) && self.from.is_none_or(|before| before <= to)
    }

    /// `2 sectors between 3:47.3 and the end cannot be read`.
    pub(super) fn words(&self) -> String {
        let from = self.from.map_or_else(|| "the beginning".to_owned(), moment);
        let to = self.to.map_or_else(|| "the end".to_owned(), moment);
        format!("{} between {from} and {to} cannot be read", count(self.sectors, "sector"))
    }
}
