//! The page of a flight, and the report made of it.
//!
//! * [`page`]: a flight as a page shows it, live or complete; the scripts and the style that draw it
//! * [`browser`]: both in one file, with the program inside
//! * [`report`]: a page for each recording, a table of pages, flights side by side
//!
//! It reads recordings through `hums_analysis` only.

#![deny(
    clippy::print_stderr,
    reason = "`eprintln!` panics where standard error lies on a full disk: `output::note`, `output::aside`"
)]

#[macro_use(note)]
extern crate hums_base;

use hums_analysis::{check, counters, log_json, part, reference, series, states, summary, track};
use hums_base::{files, outcome, output, plural, printable, utc};
use hums_formats::{followed, logs, mavlink, names, naming, source, statustext};

pub mod browser;
pub mod page;
pub mod report;
