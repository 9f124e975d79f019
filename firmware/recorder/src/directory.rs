//! The root directory: one walk over it at mounting collects all that recording needs.
//!
//! The walk notes the newest logs, the oldest ones, the place of the next entry, and the number of clusters of logs.
//! So a new segment needs no walk. While nothing is to be written, the recorder looks on ([`Directory::look_on`]), a
//! block at a call. It looks for more of the oldest logs once half of the noted ones are overwritten, and for claims
//! on the clusters that come next.
//!
//! # Clusters that a log claims although the FAT calls them free
//! A card that lost power may have kept a log's directory entry and lost blocks of the FAT. The next segment would be
//! written over that log. A segment mostly lies in a row. So its clusters are known all the same: as many as its size
//! takes, from the first one on. The FAT may follow this row up to an entry "free", which no sound chain contains.
//! Then the free entries of the row are chained again. Clusters of other files are not touched, and a log whose chain
//! leaves the row is skipped. Behind the last cluster that any log claims, this need not be looked for
//! ([`Directory::is_verified`]).

use core::ops::{ControlFlow, Range};

use heapless::Vec;

use crate::card::{CardError, EntryAddress, LogEntry, SEGMENT_BYTES_MAX};
use crate::chain::ClusterChain;
use crate::name::LogName;
use crate::status::utc_secs;
use crate::volume::{END_OF_CHAIN, ENTRIES, Volume, entry, set_entry};
use crate::{BLOCK_BYTES, Block, CardDevice};

/// Entries that a root directory may have before its chain counts as going in circles.
const ENTRIES_MAX: u32 = 131_072;
pub(crate) const BLOCK_ENTRIES: u32 = BLOCK_BYTES as u32 / ENTRY_BYTES as u32;
/// Logs that are noted: the newest, and the oldest that may be overwritten.
const NEWEST_MAX: usize = 4;
const OLDEST_MAX: usize = 8;
const DELETED_MAX: usize = 8;
const OVERWRITTEN_MIN: u32 = 2 * (hums_blackbox::GROUP_SECTORS * hums_blackbox::SECTOR_BYTES) as u32;
/// FAT blocks that one walk checks for claims.
pub(crate) const VERIFY_BLOCKS: u32 = 64;

/// Bytes of an entry, and offsets of its fields: attributes, times of creation and of writing, both halves of the
/// first cluster's number, length.
pub(crate) const ENTRY_BYTES: usize = 32;
pub(crate) const ATTRIBUTES: usize = LogName::SHORT_BYTES;
pub(crate) const MADE: usize = 14;
pub(crate) const WRITTEN: usize = 22;
pub(crate) const CLUSTER_HIGH: usize = 20;
pub(crate) const CLUSTER_LOW: usize = 26;
pub(crate) const LENGTH: usize = 28;

/// Attributes: hidden in lists; a volume's label, a directory or a part of a long name; written since a backup.
pub(crate) const HIDDEN: u8 = 0x02;
const NO_FILE: u8 = 0x18;
const LONG_NAME: u8 = 0x0F;
pub(crate) const ARCHIVE: u8 = 0x20;

/// First bytes of an entry: end of the directory, and a deleted one.
pub(crate) const NEVER_USED: u8 = 0;
pub(crate) const DELETED: u8 = 0xE5;

pub(crate) type Entry = [u8; ENTRY_BYTES];

const UPDATE: &[u8; LogName::SHORT_BYTES] = b"HUMS    UPD";
const SETTINGS: &[u8; LogName::SHORT_BYTES] = b"PARAMS  TXT";

pub(crate) type Newest = Vec<LogEntry, NEWEST_MAX>;

pub(crate) struct Directory {
    root: ClusterChain,
    /// The newest names below the last session number. A folder has the length 0.
    pub(crate) newest: Newest,
    last: Option<LogName>,
    /// Oldest logs for overwriting, oldest first; the first `sure` are older than all others.
    oldest: Vec<LogEntry, OLDEST_MAX>,
    sure: usize,
    has_more: bool,
    deleted: Vec<u32, DELETED_MAX>,
    end: u32,
    /// Clusters that logs have. Each counts at most the clusters of the longest segment, since its entry may be
    /// wrong.
    pub(crate) clusters: u32,
    pub(crate) shown: u16,
    pub(crate) names: u32,
    pub(crate) settings: Option<(u32, u32)>,
    pub(crate) update: Option<(u32, u32)>,
    claimed_end: u32,
    verified: Range<u32>,
    /// Looking on: the next entry, and the FAT blocks that are being checked for claims.
    next: u32,
    verifying: Range<u32>,
}

impl Directory {
    pub(crate) const fn new(root: u32) -> Self {
        Self {
            root: ClusterChain::new(root),
            newest: Vec::new(),
            last: None,
            oldest: Vec::new(),
            sure: 0,
            has_more: false,
            deleted: Vec::new(),
            end: 0,
            clusters: 0,
            shown: 0,
            names: 0,
            settings: None,
            update: None,
            claimed_end: 0,
            verified: 0..0,
            next: 0,
            verifying: 0..0,
        }
    }

    /// Also repairs chains that logs claim of the FAT from this block on.
    pub(crate) fn learn<D: CardDevice>(
        &mut self,
        volume: &Volume<'_, D>,
        buffer: &mut [Block],
        verify: u32,
    ) -> Result<(), CardError<D::Error>> {
        let verified = verify..verify.saturating_add(VERIFY_BLOCKS).min(volume.layout.fat_blocks);
        let mut root = self.root;
        self.end = walk(volume, &mut root, 0, buffer, &mut |slot| {
            if slot.bytes[0] == DELETED {
                let _ = self.deleted.push(slot.index);
            } else if slot.is_file(SETTINGS) {
                self.settings = Some((slot.first(), slot.bytes()));
            } else if slot.is_file(UPDATE) {
                // The first one, as the resident program takes it.
                self.update.get_or_insert((slot.first(), slot.bytes()));
            } else if let Some(row) = self.note(volume, slot) {
                mend(volume, &row, &verified)?;
            }
            Ok(ControlFlow::Continue(()))
        })?;
        (self.root, self.verified, self.sure) = (root, verified, self.oldest.len());
        Ok(())
    }

    /// Whether looking on is needed, if free clusters come from this block of the FAT on.
    pub(crate) fn must_look(&self, free: u32) -> bool {
        let first = self.unverified(free);
        self.next > 0
            || self.has_more && self.sure <= OLDEST_MAX / 2
            || first * ENTRIES < self.claimed_end && first - free < VERIFY_BLOCKS / 2
    }

    fn unverified(&self, from: u32) -> u32 {
        if self.verified.contains(&from) { self.verified.end } else { from }
    }

    /// Reads as many blocks as `buffer` has; begins anew at the end. Collects the oldest logs, and repairs
    /// claims of logs on the next FAT blocks from `free` on. Returns whether chains were repaired.
    pub(crate) fn look_on<D: CardDevice>(
        &mut self,
        volume: &Volume<'_, D>,
        buffer: &mut [Block],
        free: u32,
    ) -> Result<bool, CardError<D::Error>> {
        if self.next == 0 {
            let first = self.unverified(free);
            self.verifying = first..first.saturating_add(VERIFY_BLOCKS).min(volume.layout.fat_blocks);
            self.has_more = false;
        }
        let (from, mut chain, mut changed) = (self.next, self.root, false);
        let until = from + buffer.len() as u32 * BLOCK_ENTRIES;
        let verifying = self.verifying.clone();
        self.next = walk(volume, &mut chain, from, buffer, &mut |slot| {
            if let Some(entry) = slot.log().filter(|entry| entry.bytes > 0) {
                self.note_oldest(entry);
                if let Some(row) = claimed(volume, &entry) {
                    changed |= mend(volume, &row, &verifying)?;
                }
            }
            Ok(if slot.index + 1 < until { ControlFlow::Continue(()) } else { ControlFlow::Break(()) })
        })?;
        if self.next < until {
            let begin =
                if verifying.start == self.verified.end { self.verified.start } else { verifying.start };
            self.verified = begin..verifying.end;
            (self.sure, self.next) = (self.oldest.len(), 0);
        }
        Ok(changed)
    }

    /// Takes the oldest log that may be overwritten. `None`: none is known, and [`Self::look_on`] may find some.
    pub(crate) fn take_oldest(&mut self) -> Option<LogEntry> {
        self.sure = self.sure.checked_sub(1)?;
        (!self.oldest.is_empty()).then(|| self.oldest.remove(0))
    }

    pub(crate) const fn has_more(&self) -> bool {
        self.next > 0 || self.has_more
    }

    /// Returns the clusters that a log claims.
    fn note<D: CardDevice>(&mut self, volume: &Volume<'_, D>, slot: &Slot<'_>) -> Option<Range<u32>> {
        let entry = slot.log()?;
        self.note_newest(entry);
        if entry.bytes == 0 {
            return None;
        }
        if !entry.hidden {
            self.show(entry.name);
        }
        self.clusters = self.clusters.saturating_add(clusters_of(volume, entry.bytes.min(SEGMENT_BYTES_MAX)));
        self.note_oldest(entry);
        let claimed = claimed(volume, &entry)?;
        self.claimed_end = self.claimed_end.max(claimed.end);
        Some(claimed)
    }

    fn note_oldest(&mut self, entry: LogEntry) {
        if entry.bytes < OVERWRITTEN_MIN {
            return;
        }
        let place = self.oldest.partition_point(|older| older.name < entry.name);
        if self.oldest.get(place).is_some_and(|noted| noted.name == entry.name) {
            return;
        }
        if self.oldest.is_full() {
            self.has_more = true;
            if place == OLDEST_MAX {
                return;
            }
            self.oldest.pop();
        }
        // There is room.
        let _ = self.oldest.insert(place, entry);
    }

    fn note_newest(&mut self, entry: LogEntry) {
        if entry.name.session == LogName::SESSION_MAX {
            self.last = self.last.max(Some(entry.name));
            return;
        }
        let place = self.newest.partition_point(|newer| newer.name > entry.name);
        if self.newest.is_full() && place < NEWEST_MAX {
            self.newest.pop();
        }
        let _ = self.newest.insert(place, entry);
    }

    fn show(&mut self, name: LogName) {
        self.shown = self.shown.saturating_add(1);
        self.names ^= hash(name);
    }

    pub(crate) fn hide(&mut self, name: LogName) {
        for entry in self.oldest.iter_mut().filter(|entry| entry.name == name) {
            entry.hidden = true;
        }
        self.shown = self.shown.saturating_sub(1);
        self.names ^= hash(name);
    }

    pub(crate) fn add(&mut self, entry: LogEntry, clusters: u32) {
        self.note_newest(entry);
        self.show(entry.name);
        self.has_more |= entry.bytes >= OVERWRITTEN_MIN;
        self.clusters = self.clusters.saturating_add(clusters);
    }

    pub(crate) fn replace(&mut self, old: &LogEntry, new: LogEntry) {
        self.newest.retain(|entry| entry.name != old.name);
        if let Some(place) = self.oldest.iter().position(|entry| entry.name == old.name) {
            self.oldest.remove(place);
            self.sure -= usize::from(place < self.sure);
        }
        self.has_more |= new.bytes >= OVERWRITTEN_MIN;
        if !old.hidden {
            self.hide(old.name);
        }
        self.note_newest(new);
        self.show(new.name);
    }

    /// The newest session's name, and the next session's first name. A used session number is skipped, so
    /// that a foreign file with the last number does not end the numbers.
    pub(crate) fn next_session(&self) -> (Option<LogName>, Option<LogName>) {
        let is_free = |name: &LogName| {
            let is_last = name.session == LogName::SESSION_MAX && self.last.is_some();
            !is_last && self.newest.iter().all(|entry| entry.name.session != name.session)
        };
        let after = |entry: &LogEntry| Some((entry.name, entry.name.next_session().filter(is_free)?));
        match self.newest.iter().find_map(after) {
            Some((newest, next)) => (Some(newest), Some(next)),
            // The last session number goes on with its segments.
            None if self.last.is_some() && !self.newest.is_empty() => {
                (self.last, self.last.and_then(LogName::next_segment))
            }
            None => (None, Some(LogName { session: 1, segment: 0 })),
        }
    }

    /// Whether no log can claim free clusters of these FAT blocks.
    pub(crate) fn is_verified(&self, blocks: &Range<u32>) -> bool {
        blocks.start * ENTRIES >= self.claimed_end
            || blocks.start >= self.verified.start && blocks.end <= self.verified.end
    }

    pub(crate) const fn claimed_end(&self) -> u32 {
        self.claimed_end
    }

    /// Block and offset; `None`: the directory needs another cluster.
    pub(crate) fn place_for_new<D: CardDevice>(
        &mut self,
        volume: &Volume<'_, D>,
    ) -> Result<Option<EntryAddress>, CardError<D::Error>> {
        let index = self.deleted.last().copied().unwrap_or(self.end);
        let located = self.root.locate(volume, index / BLOCK_ENTRIES, 1)?;
        Ok(located.map(|(block, _)| EntryAddress::of(block, index)))
    }

    /// Skips the place of a new entry until the next walk. Returns `false` if there is no other.
    pub(crate) fn pass_by(&mut self) -> bool {
        self.deleted.pop().is_some()
    }

    pub(crate) fn take_place(&mut self) {
        if self.deleted.pop().is_none() {
            self.end += 1;
        }
    }

    pub(crate) const fn last_cluster(&self) -> u32 {
        self.root.last()
    }
}

type Step<E> = Result<ControlFlow<()>, CardError<E>>;

pub(crate) struct Slot<'b> {
    pub(crate) index: u32,
    pub(crate) place: EntryAddress,
    pub(crate) bytes: &'b Entry,
}

impl Slot<'_> {
    /// A log, or a folder of a log's name, which has the length 0.
    pub(crate) fn log(&self) -> Option<LogEntry> {
        let name = LogName::from_short(&self.bytes[..8], &self.bytes[8..LogName::SHORT_BYTES])?;
        let attributes = self.bytes[ATTRIBUTES];
        let bytes = if attributes & NO_FILE == 0 { self.bytes() } else { 0 };
        let hidden = attributes & HIDDEN != 0;
        let utc_secs = utc_secs(self.bytes.get(WRITTEN..)?.first_chunk()?);
        (attributes & LONG_NAME != LONG_NAME).then_some(LogEntry {
            name,
            bytes,
            hidden,
            utc_secs,
            first: self.first(),
            place: self.place,
        })
    }

    pub(crate) fn is_file(&self, short: &[u8; LogName::SHORT_BYTES]) -> bool {
        self.bytes.starts_with(short) && self.bytes[ATTRIBUTES] & NO_FILE == 0
    }

    pub(crate) fn bytes(&self) -> u32 {
        self.bytes.last_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes))
    }

    pub(crate) fn first(&self) -> u32 {
        let half = |at: usize| u16::from_le_bytes([self.bytes[at], self.bytes[at + 1]]) as u32;
        (half(CLUSTER_HIGH) << 16 | half(CLUSTER_LOW)) & 0x0FFF_FFFF
    }
}

/// Shows `each` the used and deleted entries from entry `from` on, with one command for all blocks of
/// `buffer`. Returns the first unused entry, or the one after that at which `each` broke off.
pub(crate) fn walk<D: CardDevice>(
    volume: &Volume<'_, D>,
    chain: &mut ClusterChain,
    from: u32,
    buffer: &mut [Block],
    each: &mut dyn FnMut(&Slot<'_>) -> Step<D::Error>,
) -> Result<u32, CardError<D::Error>> {
    let mut index = from;
    while index < ENTRIES_MAX {
        let wanted = buffer.len() as u32;
        let Some((block, in_row)) = chain.locate(volume, index / BLOCK_ENTRIES, wanted)? else {
            return Ok(index);
        };
        let blocks = buffer.get_mut(..wanted.min(in_row) as usize).unwrap_or_default();
        volume.read(blocks, block)?;
        let mut entries = blocks.iter().flat_map(|block| block.as_chunks::<ENTRY_BYTES>().0);
        let first = index % BLOCK_ENTRIES;
        for (at, bytes) in (first..).zip(entries.by_ref().skip(first as usize)) {
            if bytes[0] == NEVER_USED {
                return Ok(index);
            }
            let slot = Slot { index, place: EntryAddress::of(block + at / BLOCK_ENTRIES, index), bytes };
            index += 1;
            if each(&slot)?.is_break() {
                return Ok(index);
            }
        }
    }
    Err(CardError::Damaged)
}

pub(crate) const fn clusters_of<D>(volume: &Volume<'_, D>, bytes: u32) -> u32 {
    bytes.div_ceil(volume.layout.cluster_blocks * BLOCK_BYTES as u32)
}

fn claimed<D: CardDevice>(volume: &Volume<'_, D>, entry: &LogEntry) -> Option<Range<u32>> {
    let end = entry.first.checked_add(clusters_of(volume, entry.bytes))?;
    let is_sound = volume.is_cluster(entry.first) && volume.is_cluster(end.saturating_sub(1));
    is_sound.then_some(entry.first..end)
}

const fn hash(name: LogName) -> u32 {
    let hash = (name.session << 7 | name.segment).wrapping_mul(0x9E37_79B1);
    (hash ^ hash >> 15).wrapping_mul(0x85EB_CA6B)
}

/// Repairs the row of a log's clusters in these FAT blocks; returns whether an entry was lost.
fn mend<D: CardDevice>(
    volume: &Volume<'_, D>,
    row: &Range<u32>,
    blocks: &Range<u32>,
) -> Result<bool, CardError<D::Error>> {
    if row.start >= blocks.end * ENTRIES || row.end <= blocks.start * ENTRIES {
        return Ok(false);
    }
    let Some(broken_at) = broken_at(volume, row)? else { return Ok(false) };
    let lost = broken_at..row.end;
    let mut changed = false;
    for index in blocks.start.max(broken_at / ENTRIES)..blocks.end.min(row.end.div_ceil(ENTRIES)) {
        changed |= chain_block(volume, index, &lost)?;
    }
    Ok(changed)
}

#[inline(never)]
fn broken_at<D: CardDevice>(
    volume: &Volume<'_, D>,
    row: &Range<u32>,
) -> Result<Option<u32>, CardError<D::Error>> {
    let mut cluster = row.start;
    while cluster < row.end {
        let [block] = volume.read_fat(cluster / ENTRIES)?;
        for _ in cluster % ENTRIES..ENTRIES.min(row.end - cluster + cluster % ENTRIES) {
            match entry(&block, cluster) {
                0 => return Ok(Some(cluster)),
                next if next == cluster + 1 => cluster = next,
                _ => return Ok(None),
            }
        }
    }
    Ok(None)
}

/// Returns whether there were free entries. One block is written in each copy of the FAT. Each entry is valid
/// by itself, even in a torn block.
#[inline(never)]
fn chain_block<D: CardDevice>(
    volume: &Volume<'_, D>,
    index: u32,
    row: &Range<u32>,
) -> Result<bool, CardError<D::Error>> {
    let (first, end) = (row.start.max(index * ENTRIES), row.end.min((index + 1) * ENTRIES));
    let mut next = if end < row.end { volume.entry(end)? } else { END_OF_CHAIN };
    let mut block = volume.read_fat(index)?;
    let mut changed = false;
    for cluster in (first..end).rev() {
        let old = entry(&block[0], cluster);
        if old == 0 {
            set_entry(&mut block[0], cluster, if next == 0 { cluster + 1 } else { END_OF_CHAIN });
            changed = true;
        }
        next = old;
    }
    if changed {
        volume.write_fat(&block, index)?;
    }
    Ok(changed)
}
