//! Searches a card's blocks for sectors, by session.
//!
//! Memory: at most [`RUNS_MAX`] runs of 16 bytes and twice [`SESSIONS_MAX`] sessions. The sessions with the most
//! sectors are listed, others counted.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use anyhow::{Context as _, Result};
use hums_blackbox::Header;

use super::fat::Extent;
use super::places::{BLOCK_BYTES, Log, LogBlocks, Piece};
use super::sessions::first_session;
use crate::card::image::data_from;
use crate::progress;

/// All sessions: 16 MiB. The recorder makes a segment in a few runs.
const RUNS_MAX: usize = 1 << 20;
/// Between two looks at the bar.
const STEP_BYTES: u64 = 1 << 20;
/// Kept sessions.
const SESSIONS_MAX: usize = 10_000;

pub(super) struct Scan {
    /// The sessions, by the place of their first sector.
    pub(super) logs: Vec<Log>,
    /// Too many sessions or runs.
    pub(super) left_out: u64,
}

/// Consecutive in place and number; damaged ones between them are theirs.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// Its first block.
    start: u64,
    number: u32,
    blocks: u32,
}

impl Run {
    /// Whether the run goes on after at most one group of other blocks.
    fn goes_on(&self, number: u32, at: u64) -> bool {
        let blocks = at.checked_sub(self.start);
        let numbers = number.checked_sub(self.number).map(u64::from);
        let (held, group) = (u64::from(self.blocks), hums_blackbox::GROUP_SECTORS as u64);
        blocks == numbers && blocks.is_some_and(|blocks| (held..=held + group).contains(&blocks))
    }
}

#[derive(Default)]
struct Sessions {
    runs: BTreeMap<u32, Vec<Run>>,
    count: usize,
    left_out: u64,
}

impl Sessions {
    fn sector(&mut self, header: &Header, at: u64) {
        if let Some(last) = self.runs.get_mut(&header.session).and_then(|runs| runs.last_mut())
            && last.goes_on(header.number, at)
        {
            last.blocks = header.number - last.number + 1;
            return;
        }
        if self.count >= RUNS_MAX || self.runs.len() >= 2 * SESSIONS_MAX {
            self.make_room();
        }
        if self.count >= RUNS_MAX {
            self.left_out += 1;
            return;
        }
        self.count += 1;
        let run = Run { start: at, number: header.number, blocks: 1 };
        self.runs.entry(header.session).or_insert_with(|| Vec::with_capacity(1)).push(run);
    }

    fn make_room(&mut self) {
        if self.runs.len() <= SESSIONS_MAX {
            return;
        }
        let sectors = |runs: &[Run]| runs.iter().map(|run| u64::from(run.blocks)).sum::<u64>();
        let mut sizes: Vec<(u64, u32)> =
            self.runs.iter().map(|(session, runs)| (sectors(runs), *session)).collect();
        sizes.sort_unstable();
        for &(sectors, session) in sizes.iter().take(self.runs.len() - SESSIONS_MAX) {
            self.left_out += sectors;
            self.count -= self.runs.remove(&session).map_or(0, |runs| runs.len());
        }
    }
}

/// A sound file system's files, through which their logs are read.
#[derive(Debug, Default)]
pub(super) struct Files {
    /// Extents by first block: blocks, and its log's session.
    extents: BTreeMap<u64, (u64, u32)>,
}

impl Files {
    pub(super) fn of(logs: &[Log]) -> Self {
        let mut files = Self::default();
        for (log, session) in logs.iter().filter_map(|log| Some((log, first_session(log)?))) {
            for extent in log.pieces.iter().flat_map(|piece| &piece.extents) {
                let [start, blocks] = [extent.start, extent.length].map(|bytes| bytes / BLOCK_BYTES as u64);
                files.extents.insert(start, (blocks, session));
            }
        }
        files
    }

    fn has(&self, session: u32, at: u64) -> bool {
        let extent = self.extents.range(..=at).next_back();
        extent.is_some_and(|(start, (blocks, of))| at - start < *blocks && *of == session)
    }
}

/// Skips sectors of `files`.
pub(super) fn scan(path: &Path, length: u64, files: &Files) -> Result<Scan> {
    let context = || format!("{}: cannot be read", path.display());
    let file = File::open(path).with_context(context)?;
    let (mut sessions, mut end) = (Sessions::default(), 0);
    // 128 GB take minutes.
    let bar = progress::bytes(Some(length), &format!("{}: looking at every block", path.display()));
    // The holes of a sparse file have no sectors.
    while let Some(data) = data_from(&file, end).with_context(context)?.filter(|data| *data < length) {
        let start = data / STEP_BYTES * STEP_BYTES;
        end = start + STEP_BYTES;
        bar.set_position(start);
        let extents = vec![Extent { start, length: STEP_BYTES.min(length - start) }];
        let log = Log { pieces: vec![Piece { path: path.to_owned(), extents }], ..Log::default() };
        let (mut blocks, mut at): (LogBlocks<'_>, u64) = (log.blocks(), start / BLOCK_BYTES as u64);
        while let Some(block) = blocks.next_block()? {
            if let Ok(header) = Header::read(block)
                && !files.has(header.session, at)
            {
                sessions.sector(&header, at);
            }
            at += 1;
        }
    }
    bar.finish_and_clear();
    sessions.make_room();
    let Sessions { runs, left_out, .. } = sessions;
    let block_bytes = BLOCK_BYTES as u64;
    let left_over = !files.extents.is_empty();
    let log = |(session, mut runs): (u32, Vec<Run>)| {
        runs.sort_unstable_by_key(|run| (run.number, run.start));
        let extent = |run: &Run| Extent {
            start: run.start * block_bytes,
            length: u64::from(run.blocks) * block_bytes,
        };
        let piece = Piece { path: path.to_owned(), extents: runs.iter().map(extent).collect() };
        let files = vec![path.display().to_string()];
        Log {
            name: format!("session-{session:08x}"),
            files,
            pieces: vec![piece],
            session: Some(session),
            left_over,
        }
    };
    let mut logs: Vec<Log> = runs.into_iter().map(log).collect();
    // A log reports on the one before it: their order matters.
    logs.sort_by_key(|log| {
        log.pieces.first().and_then(|piece| piece.extents.first()).map(|extent| extent.start)
    });
    Ok(Scan { logs, left_out })
}

#[cfg(test)]
mod tests {
    use std::io::{Seek as _, SeekFrom, Write as _};

    use hums_blackbox::{SECTOR_BYTES, Sector};

    use super::*;

    fn sector(session: u32, number: u8) -> [u8; SECTOR_BYTES] {
        let mut bytes = [0; SECTOR_BYTES];
        bytes[..3].copy_from_slice(&[0x48, 0xb3, number]);
        bytes[11] = number;
        let mut sector = Sector::from_bytes(bytes);
        sector.seal(session);
        *sector.bytes()
    }

    #[test]
    fn a_flight_is_found_among_more_sessions_than_are_kept_and_what_is_left_out_is_counted() {
        let mut file = tempfile::NamedTempFile::new().expect("a file");
        // On Linux a hole, elsewhere 5 GiB.
        let hole = 5 << 30;
        file.seek(SeekFrom::Start(hole)).expect("a hole");
        let others = 3 * SESSIONS_MAX as u32;
        for session in 0..others {
            file.write_all(&sector(1_000_000 + session, 0)).expect("room");
            if session == others / 2 {
                (0..40).for_each(|number| file.write_all(&sector(7, number)).expect("room"));
            }
        }
        let length = hole + u64::from(others + 40) * 512;
        let Scan { logs, left_out } = scan(file.path(), length, &Files::default()).expect("a file");
        assert_eq!(logs.len(), SESSIONS_MAX);
        assert_eq!(left_out, u64::from(others + 1) - SESSIONS_MAX as u64);
        let flight = logs.iter().find(|log| log.session == Some(7)).expect("the flight");
        assert_eq!(flight.bytes(), 40 * 512);
        let start = hole + u64::from(others / 2 + 1) * 512;
        assert_eq!(flight.pieces[0].extents, [Extent { start, length: 40 * 512 }]);
    }
}
