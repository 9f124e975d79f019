//! Readers of recordings. Each becomes one stream of [`source::item::Item`]s, whatever its format.
//!
//! [`logs`] reads HUMS logs on cards and images, [`source`] recordings of every format. The crate
//! judges no vehicle and writes no output.

#![deny(
    clippy::print_stderr,
    reason = "`eprintln!` panics where standard error lies on a full disk: `output::note`, `output::aside`"
)]

#[macro_use(note)]
extern crate hums_base;

use hums_base::{archive, endpoint, files, hex, outcome, plural, printable, progress, rng, utc};
#[cfg(not(target_family = "wasm"))]
use hums_base::{duplex, interrupt};

pub mod card;
pub mod ending;
pub mod followed;
pub mod logs;
pub mod loss;
pub mod mavlink;
pub mod names;
pub mod naming;
pub mod source;
pub mod statustext;
pub mod trend_words;
