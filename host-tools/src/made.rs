//! The kinds of files that commands make, told by their content: what `--replace` may replace.

use hums_blackbox::Header;

use crate::files::Kind;
use crate::source::recording::{Format, format_of};

/// What `hums decode --format tlog` makes.
pub const TLOG: Kind = Kind { words: "a tlog", is: |start| format_of(start) == Some(Format::Tlog) };

/// What a port got or sent: `--gs`, `--tap`.
pub const RAW: Kind = Kind { words: "raw MAVLink", is: |start| format_of(start) == Some(Format::Raw) };

/// What `hums pack` makes.
pub const LOG: Kind = Kind {
    words: "a log of HUMS",
    is: |start| start.first_chunk().is_some_and(|block| Header::read(block).is_ok()),
};

/// What `hums decode --format jsonl` makes.
pub const JSONL: Kind =
    Kind { words: "JSON lines of hums decode", is: |start| start.starts_with(b"{\"time_boot\":") };

/// What `hums decode --format influx` makes.
pub const LINES: Kind = Kind {
    words: "line protocol of hums decode",
    is: |start| {
        let line = start.split(|byte| *byte == b'\n').next().unwrap_or_default();
        let tags = String::from_utf8_lossy(line);
        let tags = tags.split(' ').next().unwrap_or_default();
        // A spool has such lines too, behind a head that is no text.
        let is_text = line.iter().all(|byte| *byte >= b' ');
        is_text && [",session=", ",vehicle="].iter().all(|tag| tags.contains(tag))
    },
};

/// What `hums report` makes.
pub const PAGE: Kind = Kind {
    words: "a page of hums report",
    is: |start| {
        let head = String::from_utf8_lossy(start.get(..4096).unwrap_or(start));
        head.starts_with("<!doctype html>") && head.contains("<title>HUMS flight report</title>")
    },
};
