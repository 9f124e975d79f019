//! The base of all of hums: complete or absent files ([`files`]), links ([`endpoint`], [`duplex`], [`sink`]), results
//! and messages ([`output`], [`outcome`]), numbers and times as text ([`utc`], [`plural`], [`hex`]).
//!
//! It has no knowledge of recordings or vehicles. In a browser (WASI) there are files, and neither links nor signals.

#![deny(
    clippy::print_stderr,
    reason = "`eprintln!` panics where standard error lies on a full disk: `output::note`, `output::aside`"
)]

/// A message on standard error, without control characters from foreign texts.
#[macro_export]
macro_rules! note {
    ($($words:tt)*) => {
        $crate::output::note(&format!($($words)*))
    };
}

pub mod archive;
pub mod colour;
pub mod console;
#[cfg(not(target_family = "wasm"))]
pub mod duplex;
pub mod endpoint;
pub mod files;
pub mod hex;
#[cfg(not(target_family = "wasm"))]
pub mod interrupt;
pub mod outcome;
pub mod output;
pub mod plural;
pub mod printable;
pub mod progress;
pub mod rng;
#[cfg(not(target_family = "wasm"))]
pub mod sink;
pub mod table;
pub mod utc;
