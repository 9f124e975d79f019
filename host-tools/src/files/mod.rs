//! The files that commands write. [`Output`] is the one thing in this program that makes, empties or renames a file
//! of the user's. It never touches an input ([`Inputs`]), and a file of its name is either the old one or the
//! whole new one, whatever happens while it is written.
//!
//! Two kinds of files are updated in place by design and are not made here: a simulated card's image (`--sd`) and the
//! simulated board's flash (`--store`). A test in `host-tools/tests/cli/files.rs` holds every other file to this module.

mod ends;
mod folder;
mod identity;
mod inputs;
mod output;
mod part;
mod paths;

pub use ends::{add_ends, short};
pub use folder::{Folder, Held, buffered};
pub use identity::FileId;
pub use inputs::Inputs;
pub use output::Output;
pub use part::{PART, is_part};
pub use paths::{appended, cannot_write, inside, make_directory, make_parent, says_directory, settle};

#[cfg(test)]
mod tests;
