//! Fuzz targets: rules for any bytes at a reader.
//!
//! A target is a function of bytes that panics if a rule is broken. Three things run it:
//!
//! | what | when | inputs |
//! |---|---|---|
//! | `fuzz/tests/corpus.rs` | each `cargo xtask test` | the corpus, and some hundred mutations of it: the same ones each time |
//! | the campaign `mutations` | `cargo xtask prove` | 400 times as many mutations, from another seed |
//! | libFuzzer (`fuzz/libfuzzer`) | `cargo xtask fuzz` | mutations that follow the code's branches, five minutes a target; needs nightly Rust and cargo-fuzz, and no test runs it |
//!
//! # To add a target
//! 1. Write `fuzz/src/NAME.rs` with `pub fn check(data: &[u8])`. The framework limits the length of `data`; the function bounds
//!    everything else. It gives any bytes to the reader, for instance a file's contents ([`file::with_file`] makes a file of
//!    them), and asserts its rules. A panic of the reader itself needs no assertion.
//! 2. Add `pub mod NAME;` and a row of [`TARGETS`] to this file.
//! 3. Put a few small inputs that the reader understands into `fuzz/corpus/NAME/` (some kB in all). They are generated, never
//!    taken from foreign recordings. Inputs that our own writers can make come from `fuzz/src/corpus.rs`; `cargo run -p
//!    hums-fuzz --example corpus` writes them.
//!
//! An input that breaks a target is written to `target/fuzz/NAME-HASH`; it goes into the corpus with the fix.
#![allow(clippy::missing_panics_doc, reason = "a target panics where something does not hold")]

pub mod card;
pub mod corpus;
pub mod dataflash;
pub mod decoder;
pub mod file;
pub mod find;
pub mod framer;
#[path = "../../firmware/blackbox/tests/common/log.rs"]
mod log;
pub mod mutate;
pub mod page;
pub mod reader;
pub mod recording;
pub mod round_trip;
pub mod ulog;

/// A fuzz target.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name, which its module and its folder in the corpus have too.
    pub name: &'static str,
    /// The longest input, in bytes.
    pub bytes_max: usize,
    /// Mutations that each `cargo xtask test` tries: about half a second of them.
    pub rounds: u64,
    /// Panics if a rule is broken.
    pub check: fn(&[u8]),
}

/// The targets.
pub const TARGETS: &[Target] = &[
    Target { name: "card", bytes_max: 4_096, rounds: 1_000, check: card::check },
    Target { name: "dataflash", bytes_max: 8_192, rounds: 500, check: dataflash::check },
    Target { name: "decoder", bytes_max: 8_192, rounds: 500, check: decoder::check },
    Target { name: "find", bytes_max: 16_384, rounds: 200, check: find::check },
    Target { name: "framer", bytes_max: 4_096, rounds: 1_000, check: framer::check },
    Target { name: "page", bytes_max: 8_192, rounds: 100, check: page::check },
    Target { name: "reader", bytes_max: 16_384, rounds: 500, check: reader::check },
    Target { name: "recording", bytes_max: 16_384, rounds: 500, check: recording::check },
    Target { name: "round_trip", bytes_max: 8_192, rounds: 500, check: round_trip::check },
    Target { name: "ulog", bytes_max: 16_384, rounds: 1_000, check: ulog::check },
];

/// The target of this name.
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|target| target.name == name)
}
