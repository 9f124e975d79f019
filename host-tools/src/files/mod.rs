//! The files that commands write. [`Output`], [`Folder`] and [`Begun`] are the only things in this program that make, empty or
//! rename files of the user's. They never touch an input ([`Inputs`]). What is there is never removed or written over: it
//! stays, or, where the user says `--replace`, it is kept under another name once the new one is whole. What
//! somebody opened for us (standard output, which `-` means, or `/dev/fd/3`) is written as it is, and never over bytes that
//! are in it.
//!
//! Three kinds of files are updated in place, and not made by [`Output`]: a simulated card's image (`--sd`), the simulated
//! board's flash (`--store`) and the points that wait for a database (`--spool`). They stand for memory that a program is to
//! find as the last one left it, also where that one was killed in the middle of a write: a copy that is renamed at the end
//! would be just what a card and a flash are not, and would lose what a kill must not lose. What keeps them safe instead:
//! a new one has its name only once it is whole ([`make_in_place`]), one program at a time has it, an input of the same
//! command is refused, and so is a file of any other kind. A test in `host-tools/tests/cli/inputs.rs` holds every other file
//! to this module.

mod aside;
mod descriptor;
mod ends;
mod folder;
mod identity;
mod inputs;
mod output;
mod part;
mod paths;
mod short;
mod stamp;
mod there;

pub use aside::{remake_in_place, set_aside};
pub use descriptor::{
    Opened, STANDARD_ERROR, STANDARD_INPUT, STANDARD_OUTPUT, check_standard_output, descriptor,
    means_standard_output,
};
pub use ends::{add_ends, content_identity, digest, short};
pub use folder::{Folder, FolderFile, buffered};
pub use identity::{FileId, check_only_name, is_seekable};
pub use inputs::Inputs;
pub use output::{Begun, Output};
pub use part::{make_in_place, open_in_place, take_turn};
pub use paths::{
    appended, cannot_write, check_parent, inside, make_directory, make_parent, says_directory, settle,
    why_unread,
};
pub use short::read_short;

#[cfg(test)]
mod tests;
