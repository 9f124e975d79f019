//! The log segments of one card: find, make, overwrite, write in place.
//!
//! Power may go at each single block write. A new segment's FAT is written first and its directory entry last: a cut in between
//! leaves clusters that no file has, and nothing else. All other changes of the file system are one block write.

use core::ops::{ControlFlow, Range};

pub use crate::card_error::CardError;
use crate::chain::ClusterChain;
use crate::directory::{
    ARCHIVE, ATTRIBUTES, BLOCK_ENTRIES, CLUSTER_HIGH, CLUSTER_LOW, DELETED, Directory, ENTRY_BYTES, Entry,
    HIDDEN, LENGTH, MADE, NEVER_USED, Newest, Slot, WRITTEN, clusters_of, walk,
};
use crate::free::{FreeSearch, chain_free, free_chain, write_hint};
use crate::layout::{Layout, LayoutError};
use crate::name::LogName;
use crate::recorder::Buffers;
use crate::status::CardStatus;
use crate::volume::Volume;
use crate::{BLOCK_BYTES, Block, CardDevice};

/// Bytes of a segment on a card with room for many: an hour of a busy vehicle.
pub const SEGMENT_BYTES_MAX: u32 = 8 * 1024 * 1024;

/// Blocks of 512 bytes.
const BLOCKS_PER_MIB: u64 = 2_048;

/// Logs with broken chains that are skipped in the search for one to overwrite: each takes reads of the FAT.
const UNCHAINED_MAX: usize = 8;

/// If logs have all of the card but this part, the oldest one is overwritten before all of the FAT was searched.
const UNSEARCHED: u32 = 64;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EntryAddress {
    block: u32,
    offset: u16,
}

impl EntryAddress {
    pub(crate) const fn of(block: u32, index: u32) -> Self {
        Self { block, offset: (index % BLOCK_ENTRIES) as u16 * ENTRY_BYTES as u16 }
    }
}

/// One log segment in the card's root directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogEntry {
    /// Its name.
    pub name: LogName,
    /// Allocated, not written.
    pub bytes: u32,
    /// It was erased over a link ([`Card::hide_logs`]): no longer offered, and kept until its room is needed.
    pub hidden: bool,
    /// When it was written, in seconds since 1970 UTC; 0: unknown.
    pub utc_secs: u32,
    pub(crate) first: u32,
    pub(crate) place: EntryAddress,
}

/// A segment's place on the card, for reading it and writing it in place. Good until the card is unmounted or the
/// segment recycled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Its name.
    pub name: LogName,
    /// The file's length in bytes.
    pub bytes: u32,
    chain: ClusterChain,
    place: EntryAddress,
}

impl Segment {
    /// The segment of a directory entry.
    pub const fn of(entry: &LogEntry) -> Self {
        Self {
            name: entry.name,
            bytes: entry.bytes,
            chain: ClusterChain::new(entry.first),
            place: entry.place,
        }
    }

    /// Its whole blocks.
    pub const fn blocks(&self) -> u32 {
        self.bytes / BLOCK_BYTES as u32
    }
}

/// FAT32 in the first partition, at most one segment open.
pub struct Card<'a, D> {
    volume: Volume<'a, D>,
    directory: Directory,
    free: FreeSearch,
    status: &'a CardStatus,
    buffers: &'a Buffers,
    open: Option<Segment>,
}

impl<'a, D: CardDevice> Card<'a, D> {
    /// Examines the card, and walks over its directory once.
    pub fn mount(
        device: &'a D,
        status: &'a CardStatus,
        buffers: &'a Buffers,
    ) -> Result<Self, CardError<D::Error>> {
        let layout = Layout::read(device).map_err(|error| match error {
            LayoutError::Device(error) => CardError::Device(error),
            why => CardError::Foreign(why),
        })?;
        let volume = Volume::new(device, status, layout);
        let free = FreeSearch::new(&volume);
        let directory = Directory::new(layout.root);
        let mut card = Self { volume, directory, free, status, buffers, open: None };
        card.begin()?;
        Ok(card)
    }

    /// Walks over the directory. Without a free cluster in the information sector, the clusters behind all logs come first.
    fn begin(&mut self) -> Result<(), CardError<D::Error>> {
        let mut parity = self.buffers.parity.borrow_mut();
        self.directory.learn(&self.volume, parity.lend(), self.free.next())?;
        self.free.begin(&self.volume, self.directory.claimed_end())
    }

    /// The device, for accesses besides files.
    pub const fn device(&self) -> &'a D {
        self.volume.device()
    }

    /// The card's layout.
    pub const fn layout(&self) -> &Layout {
        &self.volume.layout
    }

    fn look_on(&mut self, buffer: &mut [Block]) -> Result<(), CardError<D::Error>> {
        let changed = self.directory.look_on(&self.volume, buffer, self.free.next());
        // After an error too: chains may have been repaired before it.
        if !matches!(changed, Ok(false)) {
            self.free.restart();
        }
        changed.map(|_| ())
    }

    fn look_for_next(&mut self) -> Result<(), CardError<D::Error>> {
        let buffers = self.buffers;
        self.look_on(buffers.parity.borrow_mut().lend())?;
        Err(CardError::Searching)
    }

    /// While nothing is to be written, searches a little further for the next segment: a block of the directory or of
    /// the FAT.
    #[inline(never)]
    pub(crate) fn look_ahead(&mut self) -> Result<(), CardError<D::Error>> {
        if self.directory.must_look(self.free.next()) {
            return self.look_on(&mut [[0; BLOCK_BYTES]]);
        }
        match self.free.search_on(&self.volume) {
            Err(CardError::Searching | CardError::Full) => Ok(()),
            searched => searched,
        }
    }

    /// Log segments in directory order.
    pub fn logs(&self, mut each: impl FnMut(LogEntry)) -> Result<(), CardError<D::Error>> {
        self.walk(0, &mut |slot| {
            if let Some(entry) = slot.log().filter(|entry| entry.bytes > 0) {
                each(entry);
            }
            ControlFlow::Continue(())
        })?;
        Ok(())
    }

    #[inline(never)]
    fn walk(
        &self,
        from: u32,
        each: &mut dyn FnMut(&Slot<'_>) -> ControlFlow<()>,
    ) -> Result<u32, CardError<D::Error>> {
        let mut chain = ClusterChain::new(self.volume.layout.root);
        walk(&self.volume, &mut chain, from, &mut [[0; BLOCK_BYTES]], &mut |slot| Ok(each(slot)))
    }

    /// The shown log behind this many others, from the directory's entry `from` on, and its entry number.
    pub fn shown_behind(
        &self,
        from: u32,
        others: u16,
    ) -> Result<Option<(u32, LogEntry)>, CardError<D::Error>> {
        let (mut left, mut found) = (others, None);
        self.walk(from, &mut |slot| {
            let Some(entry) = slot.log().filter(|entry| entry.bytes > 0 && !entry.hidden) else {
                return ControlFlow::Continue(());
            };
            if left > 0 {
                left -= 1;
                return ControlFlow::Continue(());
            }
            found = Some((slot.index, entry));
            ControlFlow::Break(())
        })?;
        Ok(found)
    }

    /// Unless it is hidden.
    pub fn shown_log(&self, name: LogName) -> Result<Option<LogEntry>, CardError<D::Error>> {
        Ok(self.find(name)?.filter(|entry| !entry.hidden))
    }

    fn find(&self, name: LogName) -> Result<Option<LogEntry>, CardError<D::Error>> {
        let mut found = None;
        self.walk(0, &mut |slot| {
            found = slot.log().filter(|entry| entry.name == name && entry.bytes > 0);
            if found.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        Ok(found)
    }

    /// Shown logs, and a number that changes with their names.
    pub const fn shown(&self) -> (u16, u32) {
        (self.directory.shown, self.directory.names)
    }

    pub(crate) const fn newest(&self) -> &Newest {
        &self.directory.newest
    }

    pub(crate) fn next_session(&self) -> (Option<LogName>, Option<LogName>) {
        self.directory.next_session()
    }

    /// Makes a segment of `bytes` (rounded up to whole clusters) and opens it. Its contents are those of the clusters
    /// before. At every moment in between, the directory is as before or holds the whole segment.
    pub fn create(&mut self, name: LogName, bytes: u32) -> Result<(), CardError<D::Error>> {
        self.open = None;
        let wanted = clusters_of(&self.volume, bytes).max(1);
        // A card that is filled by logs and the directory is not searched.
        let others = self.volume.layout.clusters.saturating_sub(self.directory.clusters).saturating_sub(1);
        if others < wanted {
            return Err(CardError::Full);
        }
        if self.place_for_new()?.is_none() {
            self.lengthen_directory()?;
        }
        let found = match self.find_free(wanted) {
            // Little can be free, and a search of all of the FAT takes seconds without recording.
            Err(CardError::Searching)
                if others < self.volume.layout.clusters / UNSEARCHED && !self.device().keeps_logs() =>
            {
                return Err(CardError::Full);
            }
            found => found?,
        };
        let place = self.place_for_new()?.ok_or(CardError::Damaged)?;
        let (first, last) = chain_free(&self.volume, &found, wanted)?;
        write_hint(&self.volume, last + 1);
        let bytes = wanted.saturating_mul(self.volume.layout.cluster_blocks * BLOCK_BYTES as u32);
        let made = self.make_entry(LogEntry { name, bytes, hidden: false, utc_secs: 0, first, place })?;
        self.directory.take_place();
        self.directory.add(made, wanted);
        self.open = Some(Segment::of(&made));
        Ok(())
    }

    /// Writes the entry of a new segment, which is unused. An entry that the card refuses is skipped, as long as
    /// deleted ones are known. If no entry can be written, the segment's clusters are freed.
    fn make_entry(&mut self, mut made: LogEntry) -> Result<LogEntry, CardError<D::Error>> {
        let (name, first, date) = (made.name.short(), made.first.to_le_bytes(), self.status.fat_date());
        loop {
            let written = self.change_entry(made.place, |entry| {
                let was_unused = is_unused(entry);
                *entry = [0; ENTRY_BYTES];
                entry[..LogName::SHORT_BYTES].copy_from_slice(&name);
                entry[ATTRIBUTES] = ARCHIVE;
                entry[CLUSTER_HIGH..CLUSTER_HIGH + 2].copy_from_slice(&first[2..]);
                entry[CLUSTER_LOW..CLUSTER_LOW + 2].copy_from_slice(&first[..2]);
                entry[LENGTH..].copy_from_slice(&made.bytes.to_le_bytes());
                set_date(entry, date);
                was_unused
            });
            // The card may have written the entry despite its error: then the clusters are the file's.
            if written.is_ok() || !self.is_unused(made.place)? {
                return written.map(|()| made);
            }
            let is_other = self.directory.pass_by();
            let Some(place) = self.place_for_new().ok().flatten().filter(|_| is_other) else {
                let _ = free_chain(&self.volume, made.first);
                return written.map(|()| made);
            };
            made.place = place;
        }
    }

    /// The place of a new entry; an error if a file has it, because the directory then differs from the notes.
    /// `None`: the directory needs another cluster.
    fn place_for_new(&mut self) -> Result<Option<EntryAddress>, CardError<D::Error>> {
        let place = self.directory.place_for_new(&self.volume)?;
        match place {
            Some(place) if !self.is_unused(place)? => Err(CardError::Damaged),
            place => Ok(place),
        }
    }

    /// Claimed by no log.
    fn find_free(&mut self, wanted: u32) -> Result<Range<u32>, CardError<D::Error>> {
        let found = self.free.find(&self.volume, wanted)?;
        if !self.directory.is_verified(&found) {
            self.free.again(&found);
            self.look_for_next()?;
        }
        Ok(found)
    }

    /// Entries never used.
    fn lengthen_directory(&mut self) -> Result<(), CardError<D::Error>> {
        let last = self.directory.last_cluster();
        let found = self.find_free(1)?;
        let (cluster, _) = chain_free(&self.volume, &found, 1)?;
        let (first, blocks) = (self.volume.block_of(cluster), self.volume.layout.cluster_blocks);
        let mut parity = self.buffers.parity.borrow_mut();
        let zeros = parity.lend();
        for block in zeros.iter_mut() {
            block.fill(0);
        }
        for at in (0..blocks).step_by(zeros.len()) {
            let zeros = zeros.get(..(blocks - at) as usize).unwrap_or(zeros);
            self.volume.write_metadata(zeros, first + at)?;
        }
        self.volume.link(last, cluster)
    }

    fn is_chained(&self, entry: &LogEntry) -> Result<bool, CardError<D::Error>> {
        let mut segment = Segment::of(entry);
        let last = segment.blocks().saturating_sub(1);
        Ok(segment.chain.locate(&self.volume, last, 1)?.is_some())
    }

    /// Renames the oldest log to `name`, and opens it for a new recording. Up to [`UNCHAINED_MAX`] logs with broken
    /// chains are skipped.
    pub(crate) fn recycle_oldest(&mut self, name: LogName) -> Result<(), CardError<D::Error>> {
        if self.device().keeps_logs() {
            return Err(CardError::Full);
        }
        for unchained in 0..UNCHAINED_MAX {
            match self.directory.take_oldest() {
                Some(oldest) if self.is_chained(&oldest)? => return self.recycle(&oldest, name),
                Some(_) => {}
                None if unchained > 0 => break,
                None if self.directory.has_more() => self.look_for_next()?,
                None => return Err(CardError::Full),
            }
        }
        Err(CardError::Damaged)
    }

    /// Renames and dates an existing segment in one block write, and opens it for a new recording.
    pub fn recycle(&mut self, old: &LogEntry, name: LogName) -> Result<(), CardError<D::Error>> {
        self.open = None;
        let date = self.status.fat_date();
        self.change_entry(old.place, |entry| {
            let is_same = entry.starts_with(&old.name.short());
            entry[..LogName::SHORT_BYTES].copy_from_slice(&name.short());
            entry[ATTRIBUTES] &= !HIDDEN;
            set_date(entry, date);
            is_same
        })?;
        let new = LogEntry { name, hidden: false, ..*old };
        self.directory.replace(old, new);
        self.open = Some(Segment::of(&new));
        Ok(())
    }

    /// Hides the logs of all sessions but `except` in the directory's block of entry `from`, in one block write;
    /// `false` if the directory ends before it. The files stay, and the open one stays open.
    pub fn hide_logs(&mut self, from: u32, except: Option<u32>) -> Result<bool, CardError<D::Error>> {
        let mut chain = ClusterChain::new(self.volume.layout.root);
        let Some((at, _)) = chain.locate(&self.volume, from / BLOCK_ENTRIES, 1)? else { return Ok(false) };
        let mut block = [[0; BLOCK_BYTES]];
        self.volume.read(&mut block, at)?;
        let (mut is_changed, mut is_end) = (false, false);
        for (index, bytes) in (0..).zip(block[0].as_chunks_mut::<ENTRY_BYTES>().0) {
            is_end |= bytes[0] == 0;
            let slot = Slot { index, place: EntryAddress::of(at, index), bytes };
            let log = slot.log().filter(|log| !is_end && !log.hidden && log.bytes > 0);
            if let Some(log) = log.filter(|log| Some(log.name.session) != except) {
                bytes[ATTRIBUTES] |= HIDDEN;
                self.directory.hide(log.name);
                is_changed = true;
            }
        }
        if is_changed {
            self.volume.write_metadata(&block, at)?;
        }
        Ok(!is_end)
    }

    pub(crate) fn date_open(&mut self) -> Result<(), CardError<D::Error>> {
        let Segment { name, place, .. } = self.open.ok_or(CardError::NotOpen)?;
        let date = self.status.fat_date();
        self.change_entry(place, |entry| {
            set_date(entry, date);
            entry.starts_with(&name.short())
        })
    }

    #[inline(never)]
    fn change_entry(
        &self,
        place: EntryAddress,
        change: impl FnOnce(&mut Entry) -> bool,
    ) -> Result<(), CardError<D::Error>> {
        let mut block = [[0; BLOCK_BYTES]];
        self.volume.read(&mut block, place.block)?;
        let entry = block[0].get_mut(usize::from(place.offset)..).and_then(|entry| entry.first_chunk_mut());
        if !change(entry.ok_or(CardError::Damaged)?) {
            return Err(CardError::Damaged);
        }
        self.volume.write_metadata(&block, place.block)
    }

    #[inline(never)]
    fn is_unused(&self, place: EntryAddress) -> Result<bool, CardError<D::Error>> {
        let mut block = [[0; BLOCK_BYTES]];
        self.volume.read(&mut block, place.block)?;
        Ok(block[0].get(usize::from(place.offset)..).is_some_and(is_unused))
    }

    /// Finds an existing segment.
    pub fn segment(&self, name: LogName) -> Result<Segment, CardError<D::Error>> {
        Ok(Segment::of(&self.find(name)?.ok_or(CardError::NotFound)?))
    }

    /// The file of parameters, `PARAMS.TXT`, for reading, and its length.
    pub fn settings(&self) -> Option<(Segment, u32)> {
        self.directory.settings.map(file_of)
    }

    /// The file of an update, `HUMS.UPD`, for reading, and its length.
    pub fn update(&self) -> Option<(Segment, u32)> {
        self.directory.update.map(file_of)
    }

    /// Opens an existing segment for writing in place.
    pub fn open(&mut self, name: LogName) -> Result<(), CardError<D::Error>> {
        self.open = None;
        self.open = Some(self.segment(name)?);
        Ok(())
    }

    /// Whole ones of the open segment.
    pub fn open_blocks(&self) -> u32 {
        self.open.as_ref().map_or(0, Segment::blocks)
    }

    /// Writes the first of `blocks` of the open segment in place, as many as lie in a row, with one command. Returns
    /// their number, at least one. After an error any of them may have been written.
    pub fn write(&mut self, index: u32, blocks: &[Block]) -> Result<usize, CardError<D::Error>> {
        let open = self.open.as_mut().filter(|open| index < open.blocks()).ok_or(CardError::NotOpen)?;
        let wanted = blocks.len().min((open.blocks() - index) as usize);
        let located = open.chain.locate(&self.volume, index, wanted as u32)?;
        let (start, in_row) = located.ok_or(CardError::Damaged)?;
        let blocks = blocks.get(..wanted.min(in_row as usize)).unwrap_or_default();
        self.volume.write(blocks, start)?;
        Ok(blocks.len())
    }

    /// Reads one block of a segment.
    pub fn read(
        &self,
        segment: &mut Segment,
        index: u32,
        block: &mut Block,
    ) -> Result<(), CardError<D::Error>> {
        if index >= segment.blocks() {
            return Err(CardError::NotFound);
        }
        let (start, _) = segment.chain.locate(&self.volume, index, 1)?.ok_or(CardError::Damaged)?;
        self.volume.read(core::slice::from_mut(block), start)
    }

    /// Counts the share of the card that logs can have, one block of the FAT per call. Publishes the result at the last
    /// block, and returns whether it was that.
    pub(crate) fn count_room(&mut self) -> Result<bool, CardError<D::Error>> {
        let Some(free) = self.free.count(&self.volume)? else { return Ok(false) };
        let Layout { clusters, cluster_blocks, .. } = self.volume.layout;
        let for_logs = u64::from(free) + u64::from(self.directory.clusters);
        let mib = |clusters: u32| (u64::from(clusters) * u64::from(cluster_blocks) / BLOCKS_PER_MIB) as u32;
        self.status.change(|card| {
            card.room_permille = Some((for_logs * 1000 / u64::from(clusters)).min(1000) as u32);
            card.storage_mib = Some((mib(clusters.saturating_sub(free)), mib(clusters)));
        });
        Ok(true)
    }
}

fn file_of((first, bytes): (u32, u32)) -> (Segment, u32) {
    // Its last block is read whole.
    let blocks = bytes.checked_next_multiple_of(BLOCK_BYTES as u32).unwrap_or(u32::MAX);
    let (name, chain) = (LogName { session: 0, segment: 0 }, ClusterChain::new(first));
    (Segment { name, bytes: blocks, chain, place: EntryAddress::of(0, 0) }, bytes)
}

fn is_unused(entry: &[u8]) -> bool {
    matches!(entry.first(), Some(&(NEVER_USED | DELETED)))
}

/// Both the same.
fn set_date(entry: &mut Entry, date: [u8; 4]) {
    for at in [MADE, WRITTEN] {
        entry[at..at + 4].copy_from_slice(&date);
    }
}
