//! Helpers of the end-to-end tests: the `hums` program as for a user, recorded flights, and readers of MAVLink
//! without code of ours.
//!
//! * [`chip`] is a board on the model of the chip, with the image that is flashed.
//! * [`child`] runs a program with a time limit, and returns its output and its memory.
//! * [`program`] runs `hums` and reads its output files.
//! * [`frames`] reads MAVLink frames with a few lines of its own and the checksum seeds of pymavlink.
//! * [`flights`] has the recordings and pymavlink's results on them; [`oracle`] asks it about others.
//! * [`live`] starts `hums live`, and sends it frames.
//! * [`prove`] are the campaigns, thousands of cases each.
//! * [`hostile`] makes inputs that are far larger inside than outside.
//! * [`store`] reads the items that outlive power.
//! * [`not_tested`] reports tests that a machine does not allow.
//! * [`damage`] makes noise; [`fat`] checks a card's file system with the system's own tools.
#![allow(
    clippy::missing_panics_doc,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test's helper fails by panicking"
)]

pub mod child;
pub mod chip;
#[cfg(test)]
mod claims;
pub mod damage;
pub mod fat;
pub mod flights;
pub mod frames;
pub mod hostile;
pub mod live;
pub mod oracle;
pub mod program;
pub mod prove;
pub mod store;

/// Reports to `cargo xtask test` that a part was not tested on this machine, for its table: an untested part is not a
/// success.
pub fn not_tested(what: &str) {
    use std::io::Write as _;
    // Not `println!`, which libtest captures. It begins a new line.
    let _ = write!(std::io::stdout().lock(), "\nNOT TESTED: {what}\n");
}
