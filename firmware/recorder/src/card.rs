//! The log segments of one card, through `embedded-sdmmc`: find, make, overwrite, write in place.

use core::ops::ControlFlow;

use embedded_sdmmc::{
    Block, BlockDevice, BlockIdx, Mode, RawDirectory, RawVolume, ShortFileName, TimeSource as _, VolumeIdx,
    VolumeManager,
};

pub use crate::card_error::CardError;
use crate::chain::Chain;
use crate::gate::{Gate, GateError, HeldBlocks};
use crate::layout::{Layout, LayoutError};
use crate::name::{EXTENSION, LogName};
use crate::room::{Room, chain_free};
use crate::status::{CardStatus, Counted, FatClock};

type Manager<'a, D> = VolumeManager<Gate<'a, D>, FatClock<'a>, 1, 1, 1>;

/// Directory blocks that a root directory may have before it counts as going in circles: 64 K entries.
const DIRECTORY_BLOCKS_MAX: u32 = 4_096;

/// Bytes of a segment on a card with room for many: an hour of a busy vehicle.
pub const SEGMENT_BYTES_MAX: u32 = 8 * 1024 * 1024;

/// Blocks of 512 bytes.
const BLOCKS_PER_MIB: u64 = 2_048;

/// The attributes of a file that lists do not show, and of one that was written since a backup.
const HIDDEN: u8 = 2;
const ARCHIVE: u8 = 32;

/// A directory entry's bytes, and where in it stand the attributes, when it was made (time and date), when it was written, its first
/// cluster's upper and lower half, and the file's length.
const ENTRY_BYTES: usize = 32;
const ATTRIBUTES: usize = LogName::SHORT_BYTES;
const MADE: usize = 14;
const WRITTEN: usize = 22;
const CLUSTER_HIGH: usize = 20;
const CLUSTER_LOW: usize = 26;
const LENGTH: usize = 28;

/// One log segment in the card's root directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogEntry {
    /// Its name.
    pub name: LogName,
    /// The file's length in bytes: what is allocated, not what is written.
    pub bytes: u32,
    /// It was erased over a link ([`Card::hide`]): not offered any longer, and there until its room is wanted.
    pub hidden: bool,
    block: BlockIdx,
    offset: u32,
}

/// A segment's place on the card, for reading it and writing it in place. Good until the card is unmounted or the
/// segment recycled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Its name.
    pub name: LogName,
    /// The file's length in bytes.
    pub bytes: u32,
    chain: Chain,
}

impl Segment {
    /// How many whole blocks it has.
    pub const fn blocks(&self) -> u32 {
        self.bytes / Block::LEN_U32
    }
}

/// A card whose first partition is FAT32, with at most one segment open.
pub struct Card<'a, D: BlockDevice> {
    /// `None` only while the volume is being opened anew.
    manager: Option<Manager<'a, D>>,
    volume: RawVolume,
    root: RawDirectory,
    layout: Layout,
    clock: FatClock<'a>,
    held: &'a HeldBlocks,
    open: Option<Segment>,
    room: Room,
}

impl<'a, D: BlockDevice> Card<'a, D> {
    /// Checks and opens a card. On failure the device comes back with the reason.
    pub fn mount(
        device: D,
        status: &'a CardStatus,
        held: &'a HeldBlocks,
    ) -> Result<Self, (D, CardError<D::Error>)> {
        let layout = match Layout::read(&device) {
            Ok(layout) => layout,
            Err(LayoutError::Device(error)) => return Err((device, CardError::Device(error))),
            Err(why) => return Err((device, CardError::Foreign(why))),
        };
        let clock = FatClock(status);
        let manager = VolumeManager::new_with_limits(Gate::new(device, layout, held, 0), clock, 1);
        match Self::open_root(&manager) {
            Ok((volume, root)) => Ok(Self {
                manager: Some(manager),
                volume,
                root,
                layout,
                clock,
                held,
                open: None,
                room: Room::new(),
            }),
            Err(error) => Err((manager.free().0.into_device(), error)),
        }
    }

    fn open_root(manager: &Manager<'a, D>) -> Result<(RawVolume, RawDirectory), CardError<D::Error>> {
        manager.device(|gate| gate.allow_reads(DIRECTORY_BLOCKS_MAX));
        let volume = manager.open_raw_volume(VolumeIdx(0))?;
        let root = manager.open_root_dir(volume)?;
        Ok((volume, root))
    }

    /// Gives the device back.
    pub(crate) fn unmount(self) -> Option<D> {
        self.manager.map(|manager| manager.free().0.into_device())
    }

    /// The device, for what is no matter of files.
    pub fn device<T>(&self, act: impl FnOnce(&D) -> T) -> Option<T> {
        self.manager.as_ref().map(|manager| manager.device(|gate| act(gate.device())))
    }

    /// The card's layout.
    pub const fn layout(&self) -> &Layout {
        &self.layout
    }

    fn manager(&self) -> Result<&Manager<'a, D>, CardError<D::Error>> {
        let manager = self.manager.as_ref().ok_or(CardError::Damaged)?;
        // Any one operation may walk the FAT twice and the directory once.
        let reads = self.layout.fat_blocks.saturating_mul(2).saturating_add(DIRECTORY_BLOCKS_MAX);
        manager.device(|gate| gate.allow_reads(reads));
        Ok(manager)
    }

    /// Opens the volume anew, because the library remembers blocks that were changed or dropped behind its back. From cluster
    /// `free_from` on are free ones; 0: as the card says.
    fn reopen(&mut self, free_from: u32) -> Result<(), CardError<D::Error>> {
        self.open = None;
        let manager = self.manager.take().ok_or(CardError::Damaged)?;
        let device = manager.free().0.into_device();
        let gate = Gate::new(device, self.layout, self.held, free_from);
        let manager = VolumeManager::new_with_limits(gate, self.clock, 1);
        let opened = Self::open_root(&manager);
        self.manager = Some(manager);
        (self.volume, self.root) = opened?;
        Ok(())
    }

    /// Calls `each` for every log segment of the root directory, in directory order.
    pub fn logs(&self, mut each: impl FnMut(LogEntry)) -> Result<(), CardError<D::Error>> {
        self.manager()?.iterate_dir(self.root, |entry| {
            let name = LogName::from_short(entry.name.base_name(), entry.name.extension());
            if let Some(name) = name.filter(|_| !entry.attributes.is_directory()) {
                let (block, offset) = (entry.entry_block, entry.entry_offset);
                let hidden = entry.attributes.is_hidden();
                each(LogEntry { name, bytes: entry.size, hidden, block, offset });
            }
            ControlFlow::Continue(())
        })?;
        Ok(())
    }

    /// The newest name of a log that the root directory has, also where it is that of a folder.
    pub(crate) fn newest_name(&self) -> Result<Option<LogName>, CardError<D::Error>> {
        let mut newest = None;
        self.manager()?.iterate_dir(self.root, |entry| {
            newest = newest.max(LogName::from_short(entry.name.base_name(), entry.name.extension()));
            ControlFlow::Continue(())
        })?;
        Ok(newest)
    }

    /// Makes a segment of `bytes` (rounded up to whole clusters) and opens it. Its contents are whatever its clusters
    /// held before. At every moment in between, the directory is as before or holds the whole segment.
    pub fn create(&mut self, name: LogName, bytes: u32) -> Result<(), CardError<D::Error>> {
        self.open = None;
        let mut made = self.allocate(name, bytes);
        let committed = self.manager()?.device(|gate| {
            if made.is_ok() {
                return gate.commit();
            }
            if let Some(failure) = gate.take_failure() {
                made = Err(CardError::Device(failure));
            }
            gate.abort();
            Ok(())
        });
        self.reopen(0)?;
        made?;
        committed?;
        self.open(name)
    }

    fn allocate(&mut self, name: LogName, bytes: u32) -> Result<(), CardError<D::Error>> {
        let cluster_bytes = self.layout.cluster_blocks * Block::LEN_U32;
        let clusters = bytes.div_ceil(cluster_bytes).max(1);
        // A card that logs and the directory fill is not searched.
        if self.layout.clusters.saturating_sub(self.log_clusters()?).saturating_sub(1) < clusters {
            return Err(CardError::Full);
        }
        let mut room = self.room;
        let found = self.manager()?.device(|gate| room.find(gate, clusters));
        self.room = room;
        let from = found?;
        self.reopen(from)?;
        let manager = self.manager()?;
        manager.device(|gate| gate.begin());
        // Makes the directory longer where it is full. Only then are the file's clusters taken.
        let file = manager.open_file_in_dir(self.root, short_name(name)?, Mode::ReadWriteCreate)?;
        manager.close_file(file)?;
        let (first, last) = self.manager()?.device(|gate| chain_free(gate, from, clusters))?;
        let made = self.find(name)?;
        self.manager()?.device(|gate| {
            gate.set_hint(last + 1)?;
            change_entry(gate, &made, |entry| {
                entry[ATTRIBUTES] |= ARCHIVE;
                entry[CLUSTER_HIGH..CLUSTER_HIGH + 2].copy_from_slice(&first.to_le_bytes()[2..]);
                entry[CLUSTER_LOW..CLUSTER_LOW + 2].copy_from_slice(&first.to_le_bytes()[..2]);
                entry[LENGTH..].copy_from_slice(&(clusters * cluster_bytes).to_le_bytes());
            })
        })?;
        Ok(())
    }

    /// Whether a segment's clusters are chained to its end: one whose part of the FAT was lost cannot be written anew.
    pub(crate) fn is_chained(&self, segment: &LogEntry) -> Result<bool, CardError<D::Error>> {
        let mut segment = self.place(segment)?;
        let last = segment.blocks().saturating_sub(1);
        match self.manager()?.device(|gate| segment.chain.locate(gate, last, 1)) {
            Ok(_) => Ok(true),
            Err(GateError::Device(error)) => Err(CardError::Device(error)),
            Err(_) => Ok(false),
        }
    }

    /// Gives an existing segment a new name, and the date of now, in one block write, and opens it to be written anew.
    pub fn recycle(&mut self, old: &LogEntry, name: LogName) -> Result<(), CardError<D::Error>> {
        self.open = None;
        let date = self.clock.get_timestamp().serialize_to_fat();
        self.change_entry(old, |entry| {
            entry[..LogName::SHORT_BYTES].copy_from_slice(&name.short());
            entry[ATTRIBUTES] &= !HIDDEN;
            set_date(entry, date);
        })?;
        self.open(name)
    }

    /// Marks a segment as hidden, in one block write: it stays as it is, and the open one stays open.
    pub fn hide(&mut self, segment: &LogEntry) -> Result<(), CardError<D::Error>> {
        let open = self.open;
        self.change_entry(segment, |entry| entry[ATTRIBUTES] |= HIDDEN)?;
        self.open = open;
        Ok(())
    }

    /// Gives the open segment the date of now, in one block write. It stays open.
    pub(crate) fn date_open(&mut self) -> Result<(), CardError<D::Error>> {
        let open = self.open.ok_or(CardError::NotOpen)?;
        let date = self.clock.get_timestamp().serialize_to_fat();
        self.change_entry(&self.find(open.name)?, |entry| set_date(entry, date))?;
        self.open = Some(open);
        Ok(())
    }

    /// Changes name, attributes or dates of a directory entry that is still as it was, at once.
    fn change_entry(
        &mut self,
        old: &LogEntry,
        change: impl FnOnce(&mut [u8; ENTRY_BYTES]),
    ) -> Result<(), CardError<D::Error>> {
        let changed = self.manager()?.device(|gate| change_entry(gate, old, change));
        self.reopen(0)?;
        Ok(changed?)
    }

    /// A segment's directory entry.
    fn find(&self, name: LogName) -> Result<LogEntry, CardError<D::Error>> {
        let mut found = None;
        self.logs(|entry| found = found.or((entry.name == name).then_some(entry)))?;
        found.ok_or(CardError::NotFound)
    }

    /// Finds an existing segment.
    pub fn segment(&self, name: LogName) -> Result<Segment, CardError<D::Error>> {
        self.place(&self.find(name)?)
    }

    fn place(&self, entry: &LogEntry) -> Result<Segment, CardError<D::Error>> {
        let mut block = [Block::new()];
        self.manager()?.device(|gate| gate.read(&mut block, entry.block))?;
        let at = entry.offset as usize;
        let word =
            |at: usize| Some(u32::from(u16::from_le_bytes([*block[0].get(at)?, *block[0].get(at + 1)?])));
        let (Some(high), Some(low)) = (word(at + 20), word(at + 26)) else { return Err(CardError::Damaged) };
        Ok(Segment {
            name: entry.name,
            bytes: entry.bytes,
            chain: Chain::new((high << 16 | low) & 0x0FFF_FFFF),
        })
    }

    /// Finds a file of somebody else's in the root directory, for reading; how long it is.
    pub fn text(&self, base: &[u8], extension: &[u8]) -> Result<(Segment, u32), CardError<D::Error>> {
        let mut found = None;
        self.manager()?.iterate_dir(self.root, |entry| {
            let is_it = entry.name.base_name() == base && entry.name.extension() == extension;
            if is_it && !entry.attributes.is_directory() {
                let (block, offset) = (entry.entry_block, entry.entry_offset);
                let name = LogName { session: 0, segment: 0 };
                found = Some(LogEntry { name, bytes: entry.size, hidden: false, block, offset });
            }
            ControlFlow::Continue(())
        })?;
        let entry = found.ok_or(CardError::NotFound)?;
        let segment = self.place(&entry)?;
        // Its last block is read whole.
        let bytes = entry.bytes.checked_next_multiple_of(Block::LEN_U32).unwrap_or(u32::MAX);
        Ok((Segment { bytes, ..segment }, entry.bytes))
    }

    /// Opens an existing segment for writing in place.
    pub fn open(&mut self, name: LogName) -> Result<(), CardError<D::Error>> {
        self.open = None;
        self.open = Some(self.segment(name)?);
        Ok(())
    }

    /// The open segment's name.
    pub fn open_name(&self) -> Option<LogName> {
        self.open.as_ref().map(|open| open.name)
    }

    /// How many whole blocks the open segment has.
    pub fn open_blocks(&self) -> u32 {
        self.open.as_ref().map_or(0, Segment::blocks)
    }

    /// Writes the first of `blocks` of the open segment in place, as many as lie in a row, with one command. How many
    /// that were: at least one. After an error any of them may have been written.
    pub fn write(&mut self, index: u32, blocks: &[Block]) -> Result<usize, CardError<D::Error>> {
        let mut open = self.open.filter(|open| index < open.blocks()).ok_or(CardError::NotOpen)?;
        let blocks_max = (open.blocks() - index) as usize;
        let written = self.manager()?.device(|gate| {
            let wanted = blocks.len().min(blocks_max);
            let (start, in_row) = open.chain.locate(gate, index, wanted as u32)?;
            let blocks = blocks.get(..wanted.min(in_row as usize)).unwrap_or_default();
            gate.write_data(blocks, start).map(|()| blocks.len())
        })?;
        self.open = Some(open);
        Ok(written)
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
        let read = self.manager()?.device(|gate| {
            let (start, _) = segment.chain.locate(gate, index, 1)?;
            gate.read(core::slice::from_mut(block), start)
        });
        Ok(read?)
    }

    /// Counts a little further how much of the card logs can have, one block of the FAT at a call; how much once all of it is
    /// counted.
    pub(crate) fn count_room(&mut self) -> Result<Option<Counted>, CardError<D::Error>> {
        let mut room = self.room;
        let counted = self.manager()?.device(|gate| room.count(gate));
        self.room = room;
        let Some(free) = counted? else { return Ok(None) };
        let Layout { clusters, cluster_blocks, .. } = self.layout;
        let for_logs = u64::from(free) + u64::from(self.log_clusters()?);
        let mib = |clusters: u32| (u64::from(clusters) * u64::from(cluster_blocks) / BLOCKS_PER_MIB) as u32;
        Ok(Some(Counted {
            permille: (for_logs * 1000 / u64::from(clusters)).min(1000) as u32,
            used_mib: mib(clusters.saturating_sub(free)),
            total_mib: mib(clusters),
        }))
    }

    /// So many clusters at least the logs have. None has more than a segment can have, whatever its entry says.
    fn log_clusters(&self) -> Result<u32, CardError<D::Error>> {
        let cluster_bytes = self.layout.cluster_blocks * Block::LEN_U32;
        let mut clusters = 0_u32;
        self.logs(|entry| {
            clusters = clusters.saturating_add(entry.bytes.min(SEGMENT_BYTES_MAX).div_ceil(cluster_bytes));
        })?;
        Ok(clusters)
    }
}

/// Changes a directory entry that is still as it was.
fn change_entry<D: BlockDevice>(
    gate: &Gate<'_, D>,
    old: &LogEntry,
    change: impl FnOnce(&mut [u8; ENTRY_BYTES]),
) -> Result<(), GateError<D::Error>> {
    let mut block = [Block::new()];
    gate.allow_reads(1);
    gate.read(&mut block, old.block)?;
    let entry = block[0].get_mut(old.offset as usize..).and_then(|entry| entry.first_chunk_mut());
    let entry = entry.ok_or(GateError::Refused)?;
    if entry.first_chunk() != Some(&old.name.short()) {
        return Err(GateError::Refused);
    }
    change(entry);
    gate.write(&block, old.block)
}

/// When it was made and when it was written: the same.
fn set_date(entry: &mut [u8; ENTRY_BYTES], date: [u8; 4]) {
    for at in [MADE, WRITTEN] {
        entry[at..at + 4].copy_from_slice(&date);
    }
}

fn short_name<E>(name: LogName) -> Result<ShortFileName, CardError<E>> {
    let short = name.short();
    let mut text = heapless::String::<12>::new();
    for byte in &short[..8] {
        text.push(char::from(*byte)).map_err(|_| CardError::Damaged)?;
    }
    text.push('.').and_then(|()| text.push_str(EXTENSION)).map_err(|_| CardError::Damaged)?;
    ShortFileName::create_from_str(&text).map_err(|_| CardError::Damaged)
}
