//! The files that commands write. [`Output`] and [`Folder`] are the only things in this program that make, empty or
//! rename files of the user's. They never touch an input ([`Inputs`]). A file that is there is never replaced by other
//! content, unless the user says `--replace`; then it is the old one or the whole new one, whatever happens while it
//! is written. What somebody opened for us (standard output, which `-` means, or `/dev/fd/3`) is written as it is, and
//! never over bytes that are in it.
//!
//! Two kinds of files are updated in place by design and are not made here: a simulated card's image (`--sd`) and the
//! simulated board's flash (`--store`). A test in `host-tools/tests/cli/inputs.rs` holds every other file to this module.

mod amount;
mod ends;
mod folder;
mod identity;
mod inputs;
mod kind;
mod output;
mod part;
mod paths;
mod stamp;
mod there;

pub use amount::Amount;
pub use ends::{add_ends, digest, short};
pub use folder::{Folder, FolderFile, buffered};
pub use identity::{FileId, check_standard_output, check_standard_output_is_open, means_standard_output};
pub use inputs::Inputs;
pub use kind::{Kind, Origin};
pub use output::Output;
pub use part::{InPlacePart, is_part, lock_in_place, make_in_place};
pub use paths::{
    PART, appended, cannot_write, check_parent, inside, is_seekable, make_directory, make_parent,
    remove_if_empty, says_directory, settle,
};

#[cfg(test)]
mod tests;
