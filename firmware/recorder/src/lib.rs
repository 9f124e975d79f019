//! Log files on a FAT32 card: the storage of sectors.
//!
//! Power can cut only the card's file system in half. So it is touched rarely, and in an order that leaves it whole
//! at every single block write:
//!
//! * A log is a row of *segments*: files that are allocated whole when they are made ([`card::Card::create`]). They
//!   are written in place, one block write a sector, without an update of directory or FAT.
//! * A new segment's FAT blocks are written first, its directory entry last: a cut in between leaves unused clusters,
//!   nothing else.
//! * On a full card the oldest segment is renamed, one block write, and written anew ([`card::Card::recycle`]).
//! * Lost sectors of a segment are rebuilt from parity at the segment's end (`hums_blackbox::parity`).
//! * Waiting sectors in a row are written with one command (`chain::ClusterChain`).
//! * The directory is read once, when a card is mounted (`directory::Directory`).
//!
//! [`spi`] is the driver of a real card; the PC's cards are files.
//!
//! No data on a card may stop the monitor: [`layout::Layout`] is checked before it is used, so is each cluster number,
//! and each walk over a chain has an end.
#![cfg_attr(not(test), no_std)]

pub mod card;
mod card_error;
mod chain;
mod directory;
pub mod format;
mod free;
pub mod layout;
mod name;
mod parity;
pub mod recorder;
pub mod shared;
pub mod spi;
pub mod status;
mod volume;

pub use card::{Card, CardError};
pub use name::LogName;
pub use recorder::{Buffers, Recorder, WaitReason};
pub use spi::SpiCard;
pub use status::{CardState, CardStatus};

use hums_core::clock::Instant;

/// The consequence of a card error for recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// No card answers, or another one does.
    Gone,
    /// It does not become ready, and must be identified anew.
    Stuck,
    /// It answers, but refused this access: another try or another place may work.
    Refusing,
    /// It must not be written.
    Locked,
}

/// Bytes of a block.
pub const BLOCK_BYTES: usize = 512;

/// A block, in which cards are read and written.
pub type Block = [u8; BLOCK_BYTES];

/// Work while a card's driver waits. It returns whether the processor may sleep until the next interrupt.
pub type WaitWork<'a> = &'a mut dyn FnMut() -> bool;

/// A card: a device of blocks that can start over, as after it was pulled and put back.
pub trait CardDevice {
    /// The reason that an access failed.
    type Error: core::fmt::Debug;

    /// Blocks in a row, from this one on.
    fn read(&self, blocks: &mut [Block], start: u32) -> Result<(), Self::Error>;

    /// The same, with work for the processor while the card has none for it. That work must not use the card.
    fn read_while(
        &self,
        blocks: &mut [Block],
        start: u32,
        _meanwhile: WaitWork<'_>,
    ) -> Result<(), Self::Error> {
        self.read(blocks, start)
    }

    /// Blocks in a row, from this one on.
    fn write(&self, blocks: &[Block], start: u32) -> Result<(), Self::Error>;

    /// How many blocks the card has.
    fn num_blocks(&self) -> Result<u32, Self::Error>;

    /// Drops the card's identity: the next access identifies any card.
    fn reset(&self) {}

    /// Identifies the card at the next access, which fails if it is another one.
    fn recheck(&self) {}

    /// A service begins: all waits until the next call together have a limit.
    fn begin_service(&self) {}

    /// The clock for timing the card's commands.
    fn now(&self) -> Instant {
        Instant::ZERO
    }

    /// Repeated since the last call.
    fn take_retries(&self) -> u32 {
        0
    }

    /// Whether logs of earlier power-ons are never overwritten: a card without room is full then. No board uses this.
    fn keeps_logs(&self) -> bool {
        false
    }

    /// The consequence of an error.
    fn trouble(_error: &Self::Error) -> Trouble {
        Trouble::Refusing
    }
}
