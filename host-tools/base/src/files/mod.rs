//! The files that commands write, by five rules:
//!
//! 1. An output that is an input of the same command is refused ([`Inputs`]).
//! 2. An output is written beside its place, and renamed when complete ([`Output`], [`Folder`]). A kill, an error or
//!    a full disk leaves the old file or none.
//! 3. A file or folder that exists is not overwritten without `--force`.
//! 4. A folder of tables with another session's files, or with foreign ones, is refused even then.
//! 5. A stream (`-`, a pipe, `/dev/null`) is written directly.
//!
//! A simulated card (`--sd`) and a simulated board's flash (`--store`) are updated in place, like real memories. A
//! run locks them ([`open_in_place`]) and makes new ones whole ([`make_in_place`]).

mod ends;
mod folder;
mod identity;
mod in_place;
mod inputs;
mod output;
mod paths;
mod short;
mod stamp;

pub use ends::{add_ends, digest, digest_of, short};
pub use folder::{Folder, FolderFile, buffered};
pub use identity::{FileId, is_seekable};
pub use in_place::{make_in_place, open_in_place};
pub use inputs::Inputs;
pub use output::Output;
pub use paths::{
    appended, begin, cannot_write, check_parent, inside, make_directory, make_parent, means_standard_output,
    says_directory, settle, why_unread,
};
pub use short::read_short;

#[cfg(test)]
mod tests;
