//! Analysis of a vehicle's recording.
//!
//! * [`check`]: the monitor of the board, run over a recording: flights, findings, and checks without data, with the
//!   reason
//! * [`summary`]: the contents of a recording, counted; [`soundness`]: what it lacks
//! * [`series`], [`track`]: quantities over time and the way over ground, for pages
//! * [`mod@reference`]: the quantities of the reference system; [`log_json`]: a recording as JSON; [`manifest`]: the files of a reading;
//!   [`order`]: logs in the order of time
//! * [`counters`], [`part`], [`states`], [`params`]: usage, components, words for states, limits from a file

#![deny(
    clippy::print_stderr,
    reason = "`eprintln!` panics where standard error lies on a full disk: `output::note`, `output::aside`"
)]

#[macro_use(note)]
extern crate hums_base;

use hums_base::{colour, files, hex, outcome, output, plural, printable, progress, table, utc};
use hums_formats::{ending, followed, logs, loss, mavlink, names, source};

pub mod check;
pub mod counters;
pub mod log_json;
pub mod manifest;
pub mod order;
pub mod params;
pub mod part;
pub mod reference;
pub mod series;
pub mod soundness;
pub mod states;
pub mod summary;
pub mod track;
