//! Helpers of the end-to-end tests: the `hums` program as for a user, recorded flights, and readers of MAVLink
//! without code of ours.
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

/// Reports an untested part to `cargo xtask test`, for its table: it is not a success.
pub fn not_tested(what: &str) {
    use std::io::Write as _;
    // libtest captures `println!`.
    let _ = write!(std::io::stdout().lock(), "\nNOT TESTED: {what}\n");
}
