//! The black box's record: its format, its writer and its reader, in one crate, so that they cannot drift apart.
//!
//! ```text
//! frames, records -> Writer -> sectors of 512 bytes -> card … blocks -> Assembler -> GroupDecoder -> frames, records
//! ```
//! * An *entry* is a frame as it was received or a record of the monitor's own, with its time.
//! * The *model* (`codec`) predicts each entry from earlier ones and codes only the unpredicted part.
//! * A *group* of up to 64 sectors (32 KiB) starts the model afresh: reading can start there, damage ends there.
//! * A *sector* identifies itself and has a check; *parity* rebuilds lost ones.
//! * The *chain* is a check of all received entries, which a reader computes again from the decoded ones.
//!
//! `docs/log-format.md` describes the format completely. Everything here is bounded and needs no allocation.
#![cfg_attr(not(test), no_std)]

mod assemble;
mod bytes;
mod chain;
mod codec;
mod coder;
mod crc;
mod distribution;
mod gap;
mod group;
pub mod layouts;
mod limits;
pub mod parity;
mod preamble;
pub mod record;
mod sector;
mod writer;

pub use assemble::{Assembler, BlockCounts, PAGE_SECTORS, Step};
pub use gap::{Cause, Gap};
pub use group::{Entry, GroupDecoder, GroupError, Outline};
pub use hums_dialect::wire::FRAME_BYTES_MAX;
pub use preamble::Preamble;
pub use record::Record;
pub use sector::{BODY_BYTES, GROUP_SECTORS, Header, NotASector, SECTOR_BYTES, Sector, VERSION};
pub use writer::{Counters, ENTRY_SECTORS_MAX, Full, SectorSink, Writer};

/// A value whose bytes are all zeros. As a static, it needs no image in flash.
const fn zeros<T: zerocopy::FromZeros>() -> T {
    // SAFETY: by the trait, zeros are a value of the type.
    unsafe { core::mem::zeroed() }
}

/// Bytes: three quarters of the STM32F405's core-coupled memory.
pub const WRITER_BYTES_MAX: usize = 48 * 1024;

const _: () = assert!(size_of::<Writer>() <= WRITER_BYTES_MAX);
