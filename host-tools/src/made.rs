//! The kinds of files that commands make, told by their content: what `--replace` may replace.
//!
//! A tlog or raw MAVLink of a ground station, or a log off a card, looks as what this program makes; it is an original
//! unless its content or its name tells otherwise.

use hums_blackbox::{Entry, GroupDecoder, Header, Record, Sector};

use crate::files::{Kind, Origin};
use crate::source::recording::{Format, format_of};

/// What `hums decode --format tlog` makes.
pub const TLOG: Kind =
    Kind { words: "a tlog", is: |start| format_of(start) == Some(Format::Tlog), origin: Origin::Unknown };

/// What a port got or sent: `--gs`, `--tap`.
pub const RAW: Kind =
    Kind { words: "raw MAVLink", is: |start| format_of(start) == Some(Format::Raw), origin: Origin::Unknown };

/// The note that a packed log begins with.
pub const PACKED: &str = "packed on a PC by hums pack";

/// What `hums pack` makes. What a box recorded begins with the record of its start.
pub const LOG: Kind = Kind {
    words: "a log of HUMS",
    is: |start| start.first_chunk().is_some_and(|block| Header::read(block).is_ok()),
    origin: Origin::Told(packed),
};

/// What `hums decode --format jsonl` makes. Nothing in it tells of which log.
pub const JSONL: Kind =
    Kind { words: "JSON lines of hums decode", is: is_json_lines, origin: Origin::Unknown };

/// What `hums decode --format influx` makes.
pub const LINES: Kind = Kind {
    words: "line protocol of hums decode",
    is: |start| {
        // A spool has such lines too, behind a head that is no text.
        let is_text = first_line(start).iter().all(|byte| *byte >= b' ');
        is_text && [",session=", ",vehicle="].iter().all(|tag| tags(start).contains(tag))
    },
    origin: Origin::Told(|start| between(&tags(start), ",session=", ",")),
};

/// What `hums report` makes.
pub const PAGE: Kind = Kind {
    words: "a page of hums report",
    is: |start| {
        head(start).starts_with("<!doctype html>")
            && head(start).contains("<title>HUMS flight report</title>")
    },
    origin: Origin::Told(|start| between(&head(start), "<meta name=\"hums-log\" content=\"", "\"")),
};

fn first_line(start: &[u8]) -> &[u8] {
    start.split(|byte| *byte == b'\n').next().unwrap_or_default()
}

/// The tags of the first line of line protocol.
fn tags(start: &[u8]) -> String {
    String::from_utf8_lossy(first_line(start)).split(' ').next().unwrap_or_default().to_owned()
}

fn head(start: &[u8]) -> String {
    String::from_utf8_lossy(start.get(..4096).unwrap_or(start)).into_owned()
}

fn between(text: &str, before: &str, after: &str) -> Option<String> {
    let (_, rest) = text.split_once(before)?;
    Some(rest.split_once(after).map_or(rest, |(inside, _)| inside).to_owned())
}

/// Whether each whole line is one that `hums decode` writes.
fn is_json_lines(start: &[u8]) -> bool {
    let is_ours = |line: &[u8]| {
        let Ok(serde_json::Value::Object(object)) = serde_json::from_slice(line) else { return false };
        let has = |names: &[&str]| {
            object.len() == names.len() && names.iter().all(|name| object.contains_key(*name))
        };
        line.starts_with(b"{\"time_boot\":")
            && (has(&["time_boot", "time_utc", "system", "component", "id", "message", "fields"])
                || has(&[
                    "time_boot",
                    "time_utc",
                    "system",
                    "component",
                    "id",
                    "message",
                    "verified",
                    "payload",
                ])
                || has(&["time_boot", "time_utc", "record", "fields"]))
    };
    // What follows the last line's end may be cut off.
    let mut lines: Vec<&[u8]> = start.split(|byte| *byte == b'\n').collect();
    lines.pop();
    !lines.is_empty() && lines.into_iter().all(is_ours)
}

/// Of which recording a log was packed; none of a box's.
fn packed(start: &[u8]) -> Option<String> {
    let mut decoder = Box::new(GroupDecoder::new());
    let block = start.first_chunk()?;
    let header = Header::read(block).ok()?;
    decoder.push(&header, &Sector::from_bytes(*block)).ok()?;
    let Ok(Entry::Record { record: Record::Note(note), .. }) = decoder.next_entry()? else { return None };
    (note.text == PACKED).then(|| format!("s{:08x}", header.session))
}
