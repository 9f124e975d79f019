//! Inputs of the command line (LOG, IMAGE and DIR), and the logs in them.
//!
//! Its forms:
//! - on the card, a row of segments (`00042_00.HUM`, `00042_01.HUM`, …);
//! - copied off the card, the same files in a directory;
//! - pulled, these with the session in their names (`naming`);
//! - packed, one file.
//!
//! Here each is a list of places of 512-byte blocks.

pub mod board;
mod card;
pub mod fat;
pub mod find;
pub mod fingerprint;
mod folder;
mod found;
pub mod groups;
pub mod in_order;
mod look;
pub mod marks;
pub mod naming;
pub mod places;
pub mod reader;
mod repair;
mod scan;
pub mod sessions;
pub mod side_by_side;
pub mod strangers;

pub use card::{Card, is_card, on_card};
pub use find::{Content, FoundLogs, find};
pub use folder::{WalkedFolders, is_named_as_card, is_named_as_log, kind_of, passed_over};
pub use naming::segment_name;
pub use places::{Log, Piece};

impl FoundLogs {
    /// Files with a part of a log or damage.
    pub fn paths(&self) -> impl Iterator<Item = &std::path::Path> {
        let pieces = self.logs.iter().flat_map(|log| &log.pieces).map(|piece| piece.path.as_path());
        pieces.chain(self.images.iter().map(|image| image.path.as_path()))
    }
}
