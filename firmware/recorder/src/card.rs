//! The log segments of one card, through `embedded-sdmmc`: find, make, overwrite, write in place.

use core::fmt;
use core::ops::ControlFlow;

use embedded_sdmmc::{
    Block, BlockDevice, BlockIdx, Error, Mode, RawDirectory, RawFile, RawVolume, ShortFileName, VolumeIdx,
    VolumeManager,
};

use crate::gate::{Gate, GateError, HeldBlocks};
use crate::layout::{Layout, LayoutError};
use crate::name::{EXTENSION, LogName};
use crate::status::{CardStatus, FatClock};

type Manager<'a, D> = VolumeManager<Gate<'a, D>, FatClock<'a>, 1, 1, 1>;

/// Directory blocks that a root directory may have before it counts as going in circles: 64 K entries.
const DIRECTORY_BLOCKS_MAX: u32 = 4_096;

/// Why a card operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CardError<E> {
    /// The card failed or was pulled.
    Device(E),
    /// The card cannot be used as it is.
    Foreign(LayoutError<E>),
    /// The file system on it is damaged.
    Damaged,
    /// No free clusters.
    Full,
    /// There is no such segment.
    NotFound,
    /// No segment is open.
    NotOpen,
}

impl<E: fmt::Debug> fmt::Display for CardError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(error) => write!(f, "the card failed: {error:?}"),
            Self::Foreign(why) => write!(f, "{why}"),
            Self::Damaged => {
                write!(f, "the card's file system is damaged: copy its files, then format it as FAT32")
            }
            Self::Full => write!(f, "the card is full and holds no log to overwrite: delete other files"),
            Self::NotFound => write!(f, "there is no such log"),
            Self::NotOpen => write!(f, "no log is open"),
        }
    }
}

impl<E> From<Error<GateError<E>>> for CardError<E>
where
    GateError<E>: core::error::Error,
{
    fn from(error: Error<GateError<E>>) -> Self {
        match error {
            Error::DeviceError(GateError::Device(error)) => Self::Device(error),
            Error::NotEnoughSpace | Error::DiskFull => Self::Full,
            Error::NotFound => Self::NotFound,
            _ => Self::Damaged,
        }
    }
}

impl<E> From<GateError<E>> for CardError<E> {
    fn from(error: GateError<E>) -> Self {
        match error {
            GateError::Device(error) => Self::Device(error),
            GateError::Refused | GateError::Runaway => Self::Damaged,
        }
    }
}

/// One log segment in the card's root directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogEntry {
    /// Its name.
    pub name: LogName,
    /// The file's length in bytes: what is allocated, not what is written.
    pub bytes: u32,
    block: BlockIdx,
    offset: u32,
}

struct Open {
    file: RawFile,
    name: LogName,
    bytes: u32,
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
    open: Option<Open>,
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
        let manager = VolumeManager::new_with_limits(Gate::new(device, layout, held), clock, 1);
        match Self::open_root(&manager) {
            Ok((volume, root)) => {
                Ok(Self { manager: Some(manager), volume, root, layout, clock, held, open: None })
            }
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
    pub fn unmount(self) -> Option<D> {
        self.manager.map(|manager| manager.free().0.into_device())
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

    /// Opens the volume anew, because the library remembers blocks that were changed or dropped behind its back.
    fn reopen(&mut self) -> Result<(), CardError<D::Error>> {
        self.open = None;
        let manager = self.manager.take().ok_or(CardError::Damaged)?;
        let device = manager.free().0.into_device();
        let manager =
            VolumeManager::new_with_limits(Gate::new(device, self.layout, self.held), self.clock, 1);
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
                each(LogEntry { name, bytes: entry.size, block, offset });
            }
            ControlFlow::Continue(())
        })?;
        Ok(())
    }

    /// Makes a segment of `bytes` (rounded up to whole clusters) and opens it. Its contents are whatever its clusters
    /// held before. At every moment in between, the directory is as before or holds the whole segment.
    pub fn create(&mut self, name: LogName, bytes: u32) -> Result<(), CardError<D::Error>> {
        self.close();
        let made = self.allocate(name, bytes);
        let committed = self.manager()?.device(|gate| {
            if made.is_ok() {
                gate.commit()
            } else {
                gate.abort();
                Ok(())
            }
        });
        self.reopen()?;
        made?;
        committed?;
        self.open(name)
    }

    fn allocate(&self, name: LogName, bytes: u32) -> Result<(), CardError<D::Error>> {
        let cluster_bytes = self.layout.cluster_blocks * Block::LEN_U32;
        let clusters = bytes.div_ceil(cluster_bytes).max(1);
        self.manager()?.device(|gate| has_free_clusters(gate, clusters))?;
        let manager = self.manager()?;
        manager.device(|gate| gate.begin());
        let file = manager.open_file_in_dir(self.root, short_name(name)?, Mode::ReadWriteCreate)?;
        manager.device(|gate| gate.discard_data(true));
        let zeros = [0; Block::LEN];
        for _ in 0..clusters * self.layout.cluster_blocks {
            // Each block may look for a free cluster through the whole FAT.
            self.manager()?.write(file, &zeros)?;
        }
        manager.device(|gate| gate.discard_data(false));
        self.manager()?.close_file(file)?;
        Ok(())
    }

    /// Gives an existing segment a new name in one block write, and opens it to be written anew.
    pub fn recycle(&mut self, old: &LogEntry, name: LogName) -> Result<(), CardError<D::Error>> {
        self.close();
        let short = name.short();
        let old_short = old.name.short();
        let at = old.offset as usize;
        let renamed = self.manager()?.device(|gate| {
            let mut block = [Block::new()];
            gate.allow_reads(1);
            gate.read(&mut block, old.block)?;
            let entry = block[0].get_mut(at..at + LogName::SHORT_BYTES).ok_or(GateError::Refused)?;
            if entry != old_short {
                return Err(GateError::Refused);
            }
            entry.copy_from_slice(&short);
            gate.write(&block, old.block)
        });
        self.reopen()?;
        renamed?;
        self.open(name)
    }

    /// Opens an existing segment for reading and for writing in place.
    pub fn open(&mut self, name: LogName) -> Result<(), CardError<D::Error>> {
        self.close();
        let manager = self.manager()?;
        let file = manager.open_file_in_dir(self.root, short_name(name)?, Mode::ReadWriteAppend)?;
        let bytes = manager.file_length(file)?;
        self.open = Some(Open { file, name, bytes });
        Ok(())
    }

    /// Forgets the open segment. Nothing needs to be written for that: its length never changes.
    fn close(&mut self) {
        if self.open.take().is_some() {
            // The handle is given up by opening the volume anew; a card that fails then fails at the next operation.
            let _ = self.reopen();
        }
    }

    /// The open segment's name.
    pub fn open_name(&self) -> Option<LogName> {
        self.open.as_ref().map(|open| open.name)
    }

    /// How many whole blocks the open segment has.
    pub fn open_blocks(&self) -> u32 {
        self.open.as_ref().map_or(0, |open| open.bytes / Block::LEN_U32)
    }

    /// Writes one block of the open segment in place.
    pub fn write(&mut self, index: u32, block: &[u8; Block::LEN]) -> Result<(), CardError<D::Error>> {
        let open = self.open.as_ref().filter(|_| index < self.open_blocks()).ok_or(CardError::NotOpen)?;
        let manager = self.manager()?;
        manager.file_seek_from_start(open.file, index * Block::LEN_U32)?;
        manager.write(open.file, block)?;
        Ok(())
    }

    /// Reads one block of the open segment.
    pub fn read(&self, index: u32, block: &mut [u8; Block::LEN]) -> Result<(), CardError<D::Error>> {
        let open = self.open.as_ref().filter(|_| index < self.open_blocks()).ok_or(CardError::NotOpen)?;
        let manager = self.manager()?;
        manager.file_seek_from_start(open.file, index * Block::LEN_U32)?;
        let read = manager.read(open.file, block)?;
        if read == block.len() { Ok(()) } else { Err(CardError::Damaged) }
    }
}

/// Fails with [`CardError::Full`] unless that many clusters are free. Asked first, so that a segment that does not fit
/// leaves no half of a chain behind.
fn has_free_clusters<D: BlockDevice>(gate: &Gate<'_, D>, wanted: u32) -> Result<(), CardError<D::Error>> {
    let layout = gate.layout();
    let mut block = [Block::new()];
    let mut free = 0;
    let mut entries_left = layout.clusters + 2;
    for index in 0..layout.fat_blocks {
        gate.read(&mut block, BlockIdx(layout.fat_start + index))?;
        let entries = block[0].chunks_exact(4).take(entries_left as usize);
        free += entries
            .filter(|entry| u32::from_le_bytes([entry[0], entry[1], entry[2], entry[3] & 0x0F]) == 0)
            .count();
        if free >= wanted as usize {
            return Ok(());
        }
        entries_left = entries_left.saturating_sub(128);
    }
    Err(CardError::Full)
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
