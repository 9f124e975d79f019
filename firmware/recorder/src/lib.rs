//! Log files on a FAT32 card: what the storage task does with sectors.
//!
//! The card's file system is the one thing here that power can cut in half, so it is touched as rarely as possible and
//! in an order that leaves it whole at every single block write:
//!
//! * A log is a row of *segments*: files that are allocated whole when they are made ([`card::Card::create`]) and
//!   written in place from then on, one block write a sector, without a directory or FAT update.
//! * A new segment's FAT blocks are written first, its directory entry last: a cut in between leaves unused clusters,
//!   nothing else.
//! * When the card is full the oldest segment is renamed, one block write, and written anew ([`card::Card::recycle`]).
//!
//! * What a card loses of a segment is made again from parity, at the segment's end (`hums_blackbox::parity`).
//! * Sectors that wait together and lie in a row are written with one command (`chain::ClusterChain`).
//! * The directory is read once, when a card is mounted (`directory::Directory`).
//!
//! [`spi`] is the driver of a real card; the PC's cards are files.
//!
//! Nothing on a card may stop the monitor: [`layout::Layout`] is checked before anything is computed from it, a number of a cluster
//! before it is used, and each walk over a chain has an end.
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
pub mod spi;
pub mod status;
mod volume;

pub use card::{Card, CardError};
pub use name::LogName;
pub use recorder::{Buffers, NotYet, Recorder};
pub use spi::SpiCard;
pub use status::{CardState, CardStatus};

use hums_core::clock::Instant;

/// What an error of a card means for whoever records on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// No card answers, or another one does.
    Gone,
    /// It does not become ready: nothing more is to be had of it before it is identified anew.
    Stuck,
    /// It answers, and refused this access: the same again, or another place, may work.
    Refusing,
    /// It must not be written.
    Locked,
}

/// Bytes of a block.
pub const BLOCK_BYTES: usize = 512;

/// A block, in which cards are read and written.
pub type Block = [u8; BLOCK_BYTES];

/// A card: a device of blocks that can be told to start over, as it must be after it was pulled and put back.
pub trait CardDevice {
    /// Why an access failed.
    type Error: core::fmt::Debug;

    /// Reads blocks that lie in a row, from this one on.
    fn read(&self, blocks: &mut [Block], start: u32) -> Result<(), Self::Error>;

    /// Writes blocks that lie in a row, from this one on.
    fn write(&self, blocks: &[Block], start: u32) -> Result<(), Self::Error>;

    /// How many blocks the card has.
    fn num_blocks(&self) -> Result<u32, Self::Error>;

    /// Forgets what is known of the card, so that the next access identifies it anew, and whichever it is.
    fn reset(&self) {}

    /// Identifies the card anew at the next access, which fails if it is another one by then.
    fn recheck(&self) {}

    /// A service begins: all waits until the next call are together to have an end.
    fn begin_service(&self) {}

    /// The time, by which the card's commands are timed.
    fn now(&self) -> Instant {
        Instant::ZERO
    }

    /// Accesses that the device itself tried again since the last call.
    fn take_retries(&self) -> u32 {
        0
    }

    /// Whether logs of earlier power-ons are never overwritten: a card without room is full then. No card of a board asks for that.
    fn keeps_logs(&self) -> bool {
        false
    }

    /// What an error means.
    fn trouble(_error: &Self::Error) -> Trouble {
        Trouble::Refusing
    }
}
