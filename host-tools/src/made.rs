//! The kinds of files that commands make, told by their content: what `--replace` may replace.
//!
//! A tlog or raw MAVLink of a ground station, or a log off a card, looks as what this program makes; it is an original
//! unless its content or its name tells otherwise.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read as _, Seek as _, SeekFrom};

use hums_blackbox::{Entry, GroupDecoder, Header, Record, SECTOR_BYTES, Sector};

use crate::files::{Amount, Kind, Origin};
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
    origin: Origin::Told { of: packed, all: has_sectors_only, amount: |_| None },
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
    origin: Origin::Told { of: |start| session_of(first_line(start)), all: has_lines_only, amount: |_| None },
};

/// What `hums report` makes.
pub const PAGE: Kind = Kind {
    words: "a page of hums report",
    is: |start| {
        head(start).starts_with("<!doctype html>")
            && head(start).contains("<title>HUMS flight report</title>")
    },
    origin: Origin::Told {
        of: |start| meta(start, "hums-log"),
        all: |file, _| ends_as_page(file),
        amount: |start| Amount::parse(&meta(start, "hums-amount")?),
    },
};

/// The longest line that is looked at: the longest text of an autopilot's log takes less.
const LINE_BYTES_MAX: u64 = 1 << 20;

fn first_line(start: &[u8]) -> &[u8] {
    start.split(|byte| *byte == b'\n').next().unwrap_or_default()
}

/// The tags of the first line of line protocol.
fn tags(start: &[u8]) -> String {
    String::from_utf8_lossy(first_line(start)).split(' ').next().unwrap_or_default().to_owned()
}

/// The session that a line of line protocol names.
fn session_of(line: &[u8]) -> Option<String> {
    let line = String::from_utf8_lossy(line);
    let (_, rest) = line.split_once(",session=")?;
    rest.split([',', ' ']).next().map(str::to_owned)
}

/// Whether each line is whole and names this session: nothing else was written behind, or between.
fn has_lines_only(file: File, session: &str) -> io::Result<bool> {
    let (mut file, mut line) = (BufReader::new(file), Vec::new());
    loop {
        line.clear();
        if file.by_ref().take(LINE_BYTES_MAX).read_until(b'\n', &mut line)? == 0 {
            return Ok(true);
        }
        if line.last() != Some(&b'\n') || session_of(&line).as_deref() != Some(session) {
            return Ok(false);
        }
    }
}

/// Whether each block is a sound sector of this session.
fn has_sectors_only(file: File, session: &str) -> io::Result<bool> {
    let (mut file, mut block) = (BufReader::new(file), [0; SECTOR_BYTES]);
    while !file.fill_buf()?.is_empty() {
        match file.read_exact(&mut block) {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(false),
            read => read?,
        }
        if !Header::read(&block).is_ok_and(|header| name_of(&header) == session) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// How a page ends.
const PAGE_END: &[u8] = b"</html>\n";

/// Whether nothing was written behind a page.
fn ends_as_page(mut file: File) -> io::Result<bool> {
    let length = file.seek(SeekFrom::End(0))?;
    file.seek(SeekFrom::Start(length.saturating_sub(PAGE_END.len() as u64)))?;
    let mut end = Vec::new();
    file.take(PAGE_END.len() as u64).read_to_end(&mut end)?;
    Ok(end == PAGE_END)
}

/// What the head of a page says under this name.
fn meta(start: &[u8], name: &str) -> Option<String> {
    between(&head(start), &format!("<meta name=\"{name}\" content=\""), "\"")
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
    (note.text == PACKED).then(|| name_of(&header))
}

/// A sector's session, as names of files have it.
fn name_of(header: &Header) -> String {
    format!("s{:08x}", header.session)
}
