//! The files that commands write. [`Output`] and [`Folder`] are the only things in this program that make, empty or
//! rename files of the user's. They never touch an input ([`Inputs`]). What is there is never removed or written over: it
//! stays, or, where the user says `--replace`, it is kept under another name once the new one is whole. What
//! somebody opened for us (standard output, which `-` means, or `/dev/fd/3`) is written as it is, and never over bytes that
//! are in it.
//!
//! Two kinds of files are updated in place by design and are not made here: a simulated card's image (`--sd`) and the
//! simulated board's flash (`--store`). A test in `host-tools/tests/cli/inputs.rs` holds every other file to this module.

mod aside;
mod ends;
mod folder;
mod identity;
mod inputs;
mod output;
mod part;
mod paths;
mod stamp;
mod there;

pub use ends::{add_ends, digest, short};
pub use folder::{Folder, FolderFile, buffered};
pub use identity::{FileId, check_standard_output, check_standard_output_is_open, means_standard_output};
pub use inputs::Inputs;
pub use output::Output;
pub use part::{InPlacePart, lock_in_place, make_in_place};
pub use paths::{
    PART, appended, cannot_write, check_parent, inside, is_seekable, make_directory, make_parent,
    remove_if_empty, says_directory, settle, why_unread,
};

#[cfg(test)]
mod tests;
