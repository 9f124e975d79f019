//! Stands between `embedded-sdmmc` and the card, so that neither can hurt the other.
//!
//! **Order of metadata.** The library writes FAT blocks and directory entries as it goes, and a cut between two of them
//! leaves a chain longer than its file, or a file without a chain. Within a transaction the gate holds these blocks
//! back; [`Gate::commit`] then writes FAT blocks first and directory entries last. Every cut then leaves the old
//! directory, and at worst clusters that no file uses. Outside a transaction the library cannot write metadata at all; the
//! recorder itself writes there to chain a log's lost clusters again (`claims`).
//!
//! **The free count** of the information sector is set to "unknown" once, so that it can never be wrong; the hint
//! where to look for free clusters is kept. A sector that is damaged is shown, and written, as one that knows nothing.
//!
//! **Bad FAT entries** would make the library compute with clusters that do not exist: they are shown to it as bad
//! clusters, which it refuses, and the block that holds them is never written back. A chain that goes in circles ends
//! when the reads that one operation may take are used up.

use core::cell::{Cell, RefCell};
use core::fmt;

use embedded_sdmmc::{Block, BlockCount, BlockDevice, BlockIdx};
use heapless::Vec;
use hums_blackbox::parity::PARITY_SECTORS;

use crate::layout::Layout;
use crate::parity::Parity;

/// Metadata blocks held back in a transaction: the FAT blocks of the segment in work, its directory block, and the
/// information sector. An 8 MiB segment's chain lies in up to three blocks of each FAT where clusters have 32 KiB, as on
/// cards of 32 GB; FAT blocks beyond this are written early, which is harmless: nothing refers to them yet.
pub(crate) const HELD_BLOCKS: usize = 8;

/// How often a block of the file system is tried to be written. A segment of which only a part of the FAT came through
/// takes clusters that no file has, so that a card which refuses now and then would look full after a while. The
/// device bounds the time of all tries together ([`crate::CardDevice::begin_service`]).
const METADATA_TRIES: u32 = 8;

/// Where in the information sector stands from which cluster on to look for free ones.
pub(crate) const HINT: usize = 492;

/// What went wrong below the file system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GateError<E> {
    /// The card reported an error.
    Device(E),
    /// The file system would have been written outside a transaction or outside its volume.
    Refused,
    /// One operation read more blocks than the volume's structures can hold: they go in circles.
    Runaway,
}

impl<E: fmt::Debug> fmt::Display for GateError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(error) => write!(f, "the card failed: {error:?}"),
            Self::Refused => {
                write!(f, "a write to the file system was refused because its structures are damaged")
            }
            Self::Runaway => write!(f, "the card's file system goes in circles: format the card"),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for GateError<E> {}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Fat,
    Info,
    Directory,
}

/// Where a block that is held back belongs. It lies in the block of the same place of the lent ones.
struct Held {
    at: u32,
    kind: Kind,
}

/// Blocks of log that are written with one command at most: the gain of more is small, and they take RAM.
pub(crate) const BATCH_BLOCKS: usize = 8;

const _: () = assert!(HELD_BLOCKS <= PARITY_SECTORS as usize);

/// Room for the blocks that are held back, for the sectors that are being written, and for their parity. Lent, because gate
/// and recorder are moved with the card and this, 12 KiB, would come along on the firmware's stack each time.
///
/// Blocks are held back while a segment is made, and then there is no parity: both have the same room.
#[derive(Default)]
pub struct HeldBlocks {
    metadata: RefCell<Vec<Held, HELD_BLOCKS>>,
    pub(crate) batch: RefCell<Vec<Block, BATCH_BLOCKS>>,
    pub(crate) parity: RefCell<Parity>,
}

impl HeldBlocks {
    /// Nothing held.
    pub const fn new() -> Self {
        Self {
            metadata: RefCell::new(Vec::new()),
            batch: RefCell::new(Vec::new()),
            parity: RefCell::new(Parity::new()),
        }
    }
}

/// The gate. Its methods take `&self` because the library owns it and hands out only shared references.
pub(crate) struct Gate<'a, D: BlockDevice> {
    device: D,
    layout: Layout,
    transaction: Cell<bool>,
    reads_left: Cell<u32>,
    /// From which cluster on the library is to look for free ones; 0: as the information sector says.
    free_from: u32,
    held: &'a HeldBlocks,
    /// What failed first in a transaction.
    failure: Cell<Option<D::Error>>,
}

impl<'a, D: BlockDevice> Gate<'a, D> {
    /// A gate for a card whose layout was checked. From cluster `free_from` on are free ones; 0: nobody has looked.
    pub(crate) fn new(device: D, layout: Layout, held: &'a HeldBlocks, free_from: u32) -> Self {
        // What another gate left there is about another mount.
        held.metadata.borrow_mut().clear();
        Self {
            device,
            layout,
            transaction: Cell::new(false),
            reads_left: Cell::new(0),
            free_from,
            held,
            failure: Cell::new(None),
        }
    }

    /// The card.
    pub(crate) const fn device(&self) -> &D {
        &self.device
    }

    /// Gives the card back; what was held back is forgotten.
    pub(crate) fn into_device(self) -> D {
        self.device
    }

    /// The layout that the gate guards.
    pub(crate) const fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Lets the next operation read at most `blocks` blocks.
    pub(crate) fn allow_reads(&self, blocks: u32) {
        self.reads_left.set(blocks);
    }

    /// How many blocks the operation may still read.
    pub(crate) const fn reads_left(&self) -> u32 {
        self.reads_left.get()
    }

    /// Holds metadata back from now on.
    pub(crate) fn begin(&self) {
        self.failure.set(None);
        self.held.metadata.borrow_mut().clear();
        self.transaction.set(true);
    }

    /// Writes what was held back, FAT blocks first, directory entries last.
    pub(crate) fn commit(&self) -> Result<(), GateError<D::Error>> {
        self.transaction.set(false);
        let (mut held, mut parity) = (self.held.metadata.borrow_mut(), self.held.parity.borrow_mut());
        for kind in [Kind::Fat, Kind::Info, Kind::Directory] {
            for (entry, block) in held.iter().zip(parity.lend()).filter(|(entry, _)| entry.kind == kind) {
                self.write_device(block, entry.at)?;
            }
        }
        held.clear();
        Ok(())
    }

    /// What of the card failed in the transaction, if it did. The library calls any failure of an allocation a full
    /// card, so it has to be asked for here.
    pub(crate) fn take_failure(&self) -> Option<D::Error> {
        self.failure.take()
    }

    fn fail(&self, error: D::Error) -> GateError<D::Error> {
        if self.transaction.get() {
            self.failure.set(Some(error));
            return GateError::Refused;
        }
        GateError::Device(error)
    }

    /// Forgets what was held back. The library may still remember some of it: open the volume anew.
    pub(crate) fn abort(&self) {
        self.transaction.set(false);
        self.held.metadata.borrow_mut().clear();
    }

    /// From which cluster on the next search for free ones is to begin, on whatever computer. Within a transaction.
    pub(crate) fn set_hint(&self, cluster: u32) -> Result<(), GateError<D::Error>> {
        let mut block = Block::new();
        self.read_block(&mut block, self.layout.info)?;
        block[HINT..HINT + 4].copy_from_slice(&cluster.to_le_bytes());
        self.write_block(&block, self.layout.info)
    }

    /// Writes blocks of a file in place, in one command. Not for use within a transaction.
    pub(crate) fn write_data(&self, blocks: &[Block], start: BlockIdx) -> Result<(), GateError<D::Error>> {
        let last = start.0.saturating_add((blocks.len() as u32).saturating_sub(1));
        if self.transaction.get() || !self.layout.is_data(start.0) || !self.layout.is_data(last) {
            return Err(GateError::Refused);
        }
        self.device.write(blocks, start).map_err(GateError::Device)
    }

    fn write_device(&self, block: &Block, at: u32) -> Result<(), GateError<D::Error>> {
        let mut tries = METADATA_TRIES;
        loop {
            tries -= 1;
            match self.device.write(core::slice::from_ref(block), BlockIdx(at)) {
                Err(error) if tries == 0 => return Err(self.fail(error)),
                Err(_) => {}
                Ok(()) => return Ok(()),
            }
        }
    }

    fn read_block(&self, block: &mut Block, at: u32) -> Result<(), GateError<D::Error>> {
        let left = self.reads_left.get().checked_sub(1).ok_or(GateError::Runaway)?;
        self.reads_left.set(left);
        if let Some(place) = self.held.metadata.borrow().iter().position(|held| held.at == at)
            && let Some(held) = self.held.parity.borrow_mut().lend().get(place)
        {
            *block = held.clone();
            return Ok(());
        }
        self.device.read(core::slice::from_mut(block), BlockIdx(at)).map_err(|error| self.fail(error))?;
        if self.layout.is_fat(at) {
            self.for_bad_entries(block, at, |entry| entry.copy_from_slice(&0x0FFF_FFF7_u32.to_le_bytes()));
            self.take_root(block, at);
        } else if at == self.layout.info {
            self.correct_info(block);
            if self.free_from > 0 {
                block[HINT..HINT + 4].copy_from_slice(&self.free_from.to_le_bytes());
            }
        }
        Ok(())
    }

    /// Where the FAT calls the root directory's first cluster free, its part of the FAT was lost. The directory ends there then: as
    /// a free cluster it would become a log's.
    fn take_root(&self, block: &mut Block, at: u32) {
        let first = (at - self.layout.fat_start) % self.layout.fat_blocks * 128;
        let place =
            self.layout.root.checked_sub(first).filter(|place| *place < 128).map(|place| place as usize * 4);
        if let Some(entry) = place.and_then(|place| block.get_mut(place..place + 4))
            && entry.iter().all(|byte| *byte == 0)
        {
            entry.copy_from_slice(&0x0FFF_FFFF_u32.to_le_bytes());
        }
    }

    /// Calls `bad` for each FAT entry of this block that names a cluster that does not exist.
    fn for_bad_entries(&self, block: &mut Block, at: u32, mut bad: impl FnMut(&mut [u8])) {
        let first = (at - self.layout.fat_start) % self.layout.fat_blocks * 128;
        let end = self.layout.clusters + 2;
        for (index, entry) in block.chunks_exact_mut(4).enumerate() {
            let number = first + index as u32;
            let next = u32::from_le_bytes([entry[0], entry[1], entry[2], entry[3]]) & 0x0FFF_FFFF;
            // Free, bad and end marks are in order; entry 0 and 1 are flags; entries past the end do not exist.
            let in_order = next == 0 || (2..end).contains(&next) || next >= 0x0FFF_FFF7;
            if number >= 2 && number < end && !in_order {
                bad(entry);
            }
        }
    }

    /// The library refuses a volume whose information sector has not its signatures (Microsoft's FAT specification 1.03, `FSInfo`),
    /// although it holds hints only: one that is damaged is one that knows nothing.
    fn correct_info(&self, block: &mut Block) {
        const SIGNATURES: [(usize, u32); 3] = [(0, 0x4161_5252), (484, 0x6141_7272), (508, 0xAA55_0000)];
        let is_signed = |(at, signature): (usize, u32)| block[at..at + 4] == signature.to_le_bytes();
        if !SIGNATURES.into_iter().all(is_signed) {
            *block = Block::new();
            for (at, signature) in SIGNATURES {
                block[at..at + 4].copy_from_slice(&signature.to_le_bytes());
            }
        }
        block[488..492].copy_from_slice(&u32::MAX.to_le_bytes());
        let hint = u32::from_le_bytes([block[HINT], block[HINT + 1], block[HINT + 2], block[HINT + 3]]);
        if !(2..self.layout.clusters + 2).contains(&hint) {
            block[HINT..HINT + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        }
    }

    fn write_block(&self, block: &Block, at: u32) -> Result<(), GateError<D::Error>> {
        if self.layout.is_data(at) {
            return self.write_cluster(block, at);
        }
        if !self.transaction.get() {
            return Err(GateError::Refused);
        }
        if self.layout.is_fat(at) {
            self.refuse_damaged(at)?;
            return self.hold(block, at, Kind::Fat);
        }
        if at == self.layout.info {
            let mut corrected = block.clone();
            self.correct_info(&mut corrected);
            return self.hold(&corrected, at, Kind::Info);
        }
        Err(GateError::Refused)
    }

    fn write_cluster(&self, block: &Block, at: u32) -> Result<(), GateError<D::Error>> {
        if !self.transaction.get() {
            return self.write_device(block, at);
        }
        // The only blocks of zeros that the library writes here are those of a cluster that makes the directory
        // longer: nothing refers to it yet, so it can be cleared at once.
        let known = self.held.metadata.borrow().iter().any(|held| held.at == at);
        if !known && block.iter().all(|byte| *byte == 0) {
            return self.write_device(block, at);
        }
        self.hold(block, at, Kind::Directory)
    }

    /// A FAT block with entries that were shown as bad clusters must not be written with them.
    fn refuse_damaged(&self, at: u32) -> Result<(), GateError<D::Error>> {
        if self.held.metadata.borrow().iter().any(|held| held.at == at) {
            return Ok(());
        }
        let mut block = [Block::new()];
        self.device.read(&mut block, BlockIdx(at)).map_err(|error| self.fail(error))?;
        let mut damaged = false;
        self.for_bad_entries(&mut block[0], at, |_| damaged = true);
        if damaged { Err(GateError::Refused) } else { Ok(()) }
    }

    fn hold(&self, block: &Block, at: u32, kind: Kind) -> Result<(), GateError<D::Error>> {
        let (mut held, mut parity) = (self.held.metadata.borrow_mut(), self.held.parity.borrow_mut());
        let blocks = parity.lend();
        let known = held.iter().position(|entry| entry.at == at);
        if known.is_none() && held.is_full() {
            // Nothing refers to the new chain before the directory entry is written, so its blocks may go early.
            let oldest = held.iter().position(|entry| entry.kind == Kind::Fat).ok_or(GateError::Refused)?;
            let early = held.remove(oldest);
            let left = blocks.get_mut(oldest..=held.len()).ok_or(GateError::Refused)?;
            left.rotate_left(1);
            self.write_device(left.last().ok_or(GateError::Refused)?, early.at)?;
        }
        let place = known.unwrap_or(held.len());
        *blocks.get_mut(place).ok_or(GateError::Refused)? = block.clone();
        if known.is_none() {
            held.push(Held { at, kind }).map_err(|_| GateError::Refused)?;
        }
        Ok(())
    }
}

impl<D: BlockDevice> BlockDevice for Gate<'_, D> {
    type Error = GateError<D::Error>;

    fn read(&self, blocks: &mut [Block], start: BlockIdx) -> Result<(), Self::Error> {
        for (index, block) in blocks.iter_mut().enumerate() {
            self.read_block(block, start.0.saturating_add(index as u32))?;
        }
        Ok(())
    }

    fn write(&self, blocks: &[Block], start: BlockIdx) -> Result<(), Self::Error> {
        for (index, block) in blocks.iter().enumerate() {
            self.write_block(block, start.0.saturating_add(index as u32))?;
        }
        Ok(())
    }

    fn num_blocks(&self) -> Result<BlockCount, Self::Error> {
        self.device.num_blocks().map_err(GateError::Device)
    }
}
