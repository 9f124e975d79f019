//! Helpers of the end-to-end tests: the `hums` program as a user runs it, the recorded flights, and readers of MAVLink
//! that share no code with what they check.
//!
//! * [`chip`] is a board on the model of the chip, with the image that is flashed.
//! * [`child`] runs a program with a limit on its time, and tells what it said and the memory it took.
//! * [`program`] runs `hums` and reads what it left behind.
//! * [`frames`] reads MAVLink frames with a few lines of its own and the checksum seeds of pymavlink.
//! * [`flights`] knows the recordings and what pymavlink found in them; [`oracle`] asks it about others.
//! * [`live`] starts `hums live`, and sends it frames.
//! * [`prove`] are the campaigns, thousands of cases each.
//! * [`hostile`] makes inputs that are far larger inside than outside.
//! * [`store`] reads what outlives power.
//! * [`not_tested`] tells what a machine does not let us test.
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

/// Tells `cargo xtask test` that something was not tested on this machine, so that its table says so: what was not tested
/// is no success.
pub fn not_tested(what: &str) {
    use std::io::Write as _;
    // Not `println!`, which libtest keeps to itself. On a line of its own, whatever it was printing.
    let _ = write!(std::io::stdout().lock(), "\nNOT TESTED: {what}\n");
}
