//! `ArduPilot`'s onboard logs (`DataFlash`), binary (`.bin`) and text (`.log`), since 2012.
//!
//! A log describes itself: FMT messages define the others, FMTU, UNIT and MULT their units. Reading keeps one buffer,
//! the definitions (256 at most) and the vehicle's state.
//!
//! The first part of a file is searched first: units may follow a message's first rows, and the kind of
//! vehicle its first observations.

mod ahead;
mod binary;
mod clock;
mod definition;
mod epoch;
mod format;
mod message;
mod observe;
mod session;
mod stamp;
mod table;
#[cfg(test)]
mod tests;
mod text;

use std::collections::{BTreeSet, HashMap};

use anyhow::{Context as _, Result, bail};

use self::ahead::Ahead;
use self::binary::{Binary, Damage, Piece, Window};
use self::format::{BEGINNING, FMT_TYPE, HEADER_BYTES};
use self::message::Body;
pub(super) use self::observe::is_firmware;
pub use self::observe::mode_name;
use self::session::{First, Session};
use self::text::{Line, Lines};
use super::input::Input;
use super::item::{Cause, ItemSink, Needs, Reader, RecordingSummary};

/// Searched first. Definitions and parameters, 100 KiB, come in the first second, among up to 1 MiB of other
/// messages.
const FIRST_BYTES: usize = 2 * 1024 * 1024;
const SEARCHED_BYTES: usize = 64 * 1024;

/// A log's encoding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A header of two bytes.
    Binary,
    /// A line each.
    Text,
}

/// Whether a file begins as such a log: `FMT` defines itself.
pub fn begins(start: &[u8]) -> Option<Form> {
    if start.starts_with(BEGINNING) {
        Some(Form::Binary)
    } else {
        start.starts_with(b"FMT, 128, 89, FMT").then_some(Form::Text)
    }
}

/// The form of a log by the first 64 KiB.
pub fn detect(start: &[u8]) -> Option<Form> {
    /// Type 128, 89 bytes.
    const FMT: &[u8] = &[0xa3, 0x95, FMT_TYPE];
    let start = start.get(..SEARCHED_BYTES).unwrap_or(start);
    let text =
        |start: &[u8]| start.starts_with(b"FMT,") || start.windows(5).any(|window| window == b"\nFMT,");
    if start.windows(FMT.len()).any(|window| window == FMT) {
        Some(Form::Binary)
    } else {
        text(start).then_some(Form::Text)
    }
}

/// A binary log without its beginning: messages everywhere, and hardly any MAVLink frames. A recorded
/// download has 90 bytes of the log in each frame.
pub fn is_headless(start: &[u8], frames: usize) -> bool {
    /// Two such bytes occur in 64 KiB once by chance.
    const MESSAGE_BYTES: usize = 256;
    const HEADS_MIN: usize = 8;
    let heads = start.windows(2).filter(|bytes| *bytes == [0xA3, 0x95]).count();
    heads >= HEADS_MIN && heads * MESSAGE_BYTES >= start.len() && frames * 16 <= heads
}

/// The log's reader.
pub fn open(input: Input, form: Form) -> Result<Box<dyn Reader>> {
    Ok(Box::new(DataFlash { input: Some(input), form }))
}

struct DataFlash {
    input: Option<Input>,
    form: Form,
}

impl Reader for DataFlash {
    fn read(&mut self, want: Needs<'_>, take: &mut ItemSink<'_>) -> Result<RecordingSummary> {
        let Some(input) = self.input.take() else { bail!("a recording is read once") };
        match self.form {
            Form::Binary => binary(input, want, take),
            Form::Text => text(input, want, take),
        }
    }
}

/// A file may define names for ever.
const NAMES_MAX: usize = 4_096;
const CONTEXT: &str = "the log cannot be read on";
/// A banner, or the menu of an old console: no damage of a log before it.
const BANNER_BYTES_MAX: u64 = 4_096;
const ODD_LINE: &str = "a line with bytes that are no text";
const CUT_LINE: &str = "a line that the beginning of another log cuts off";

/// Reads a binary log.
pub fn binary(
    input: impl std::io::Read,
    want: Needs<'_>,
    take: &mut ItemSink<'_>,
) -> Result<RecordingSummary> {
    let mut bytes = Binary::new(input);
    let mut session = Session::new(first_of_bytes(&mut bytes)?, want);
    while let Some(piece) = bytes.next(session.lengths()).context(CONTEXT)? {
        match piece {
            Piece::Message { kind, payload, .. } if session.is_another(kind, Body::Bytes(payload)) => {
                session.begin_another(first_of_bytes(&mut bytes)?, take)?;
            }
            Piece::Message { kind, payload, place, after } => {
                let length = (HEADER_BYTES + payload.len()) as u64;
                session.message((kind, Body::Bytes(payload)), place, length, after, take)?;
            }
            Piece::Damage(Damage { place, bytes, is_cut, words }) => {
                let cause = if is_cut { Cause::Cut } else { Cause::Damaged };
                session.gap(cause, Some(place), bytes, words, take)?;
            }
        }
    }
    session.end(take)
}

fn first_of_bytes(bytes: &mut Binary<impl std::io::Read>) -> Result<First> {
    let bytes = bytes.window(FIRST_BYTES).context(CONTEXT)?;
    let (mut first, mut window, mut end) = (First::default(), Window::new(bytes), usize::MAX);
    while let Some((kind, payload, place, _)) = window.next(first.lengths()) {
        if first.is_another(kind, Body::Bytes(payload)) {
            end = place;
            break;
        }
        first.learn(kind, Body::Bytes(payload));
    }
    let mut window = Window::new(bytes);
    while let Some((kind, payload, place, after)) = window.next(first.lengths()) {
        if place >= end || first.begins(kind, Body::Bytes(payload), after) {
            break;
        }
    }
    Ok(first)
}

fn text(input: impl std::io::Read, want: Needs<'_>, take: &mut ItemSink<'_>) -> Result<RecordingSummary> {
    let mut lines = Lines::new(input);
    let (mut session, mut kinds) = (Session::new(first_of_lines(&mut lines)?, want), Kinds::default());
    session.tell_banner(take)?;
    let mut skipped: Option<Skipped> = None;
    while let Some(line) = lines.next().context(CONTEXT)? {
        if let Some(at) = text::beginning(&line.words).filter(|_| session.is_timed()) {
            // A banner, or the end of a line of the log before.
            let (place, cut) = (line.place, at as u64);
            if cut > 0 {
                session.gap(Cause::Cut, Some(place), cut, CUT_LINE.to_owned(), take)?;
            }
            let mut first = first_of_lines(&mut lines)?;
            if let Some(Skipped { place, bytes, words, firmware, .. }) = skipped.take() {
                if bytes > BANNER_BYTES_MAX {
                    session.gap(Cause::Damaged, Some(place), bytes, words, take)?;
                }
                if let Some(firmware) = firmware {
                    first.banner(&firmware);
                }
            }
            session.begin_another(first, take)?;
            kinds = Kinds { begun: true, ..Kinds::default() };
            continue;
        }
        let kind = match kinds.of(&line, session.formats()) {
            Ok(Some(kind)) => kind,
            Ok(None) => continue,
            Err(words) => {
                let skipped = skipped.get_or_insert(Skipped {
                    place: line.place,
                    bytes: 0,
                    words,
                    whole: true,
                    firmware: None,
                });
                skipped.bytes += line.bytes;
                skipped.whole = line.whole;
                let firmware = Some(line.words.trim()).filter(|words| is_firmware(words));
                skipped.firmware = firmware.map(str::to_owned).or_else(|| skipped.firmware.take());
                continue;
            }
        };
        if let Some(Skipped { place, bytes, words, .. }) = skipped.take() {
            session.gap(Cause::Damaged, Some(place), bytes, words, take)?;
        }
        if line.is_odd() {
            session.gap(Cause::Damaged, Some(line.place), 0, ODD_LINE.to_owned(), take)?;
        }
        if let Some(words) = kinds.surplus(&line, kind, session.formats()) {
            session.gap(Cause::Damaged, Some(line.place), 0, words, take)?;
        }
        let values = values_of(&line, kind, session.formats());
        let body = (kind, Body::Words(&values));
        session.message(body, line.place, line.bytes, ahead_of(&line), take)?;
        kinds.learn(kind, session.formats());
    }
    if let Some(Skipped { place, bytes, words, whole, .. }) = skipped {
        let cause = if whole { Cause::Damaged } else { Cause::Cut };
        session.gap(cause, Some(place), bytes, words, take)?;
    }
    session.end(take)
}

fn first_of_lines(lines: &mut Lines<impl std::io::Read>) -> Result<First> {
    let bytes = lines.window(FIRST_BYTES).context(CONTEXT)?;
    let (mut first, mut kinds, mut end) = (First::default(), Kinds::default(), u64::MAX);
    let mut window = Lines::new(bytes);
    while let Some(line) = window.next()? {
        if first.is_timed() && text::beginning(&line.words).is_some() {
            end = line.place;
            break;
        }
        if !kinds.begun {
            first.banner(&line.words);
        }
        if let Ok(Some(kind)) = kinds.of(&line, first.formats()) {
            let values = values_of(&line, kind, first.formats());
            first.learn(kind, Body::Words(&values));
            kinds.learn(kind, first.formats());
        }
    }
    let mut window = Lines::new(bytes);
    while let Some(line) = window.next()?.filter(|line| line.place < end) {
        let Ok(Some(kind)) = kinds.of(&line, first.formats()) else { continue };
        let values = values_of(&line, kind, first.formats());
        if first.begins(kind, Body::Words(&values), ahead_of(&line)) {
            break;
        }
    }
    Ok(first)
}

fn ahead_of<'a>(line: &Line<'a>) -> Ahead<'a> {
    Ahead { bytes: line.after, is_text: true, is_end: line.is_end }
}

fn values_of<'a>(line: &'a Line<'_>, kind: u8, formats: &format::Formats) -> Vec<&'a str> {
    let Some(format) = formats.get(kind) else { return Vec::new() };
    let mut values = text::values(&line.words, format.fields.len());
    // Later values are reported, not read.
    if let Some(last) = values.last_mut().filter(|_| !format.ends_in_text()) {
        *last = last.split(',').next().unwrap_or_default();
    }
    values
}

struct Skipped {
    place: u64,
    bytes: u64,
    words: String,
    whole: bool,
    /// The banner of a joined log.
    firmware: Option<String>,
}

#[derive(Default)]
struct Kinds {
    by_name: HashMap<String, u8>,
    /// Earlier lines are a banner.
    begun: bool,
    /// Too many values were reported.
    surplus: BTreeSet<u8>,
}

impl Kinds {
    /// `None` for an empty line or a banner, an error for an invalid line.
    fn of(&mut self, line: &Line<'_>, formats: &format::Formats) -> Result<Option<u8>, String> {
        let name = text::name(&line.words);
        if name == "FMT" {
            self.begun = true;
            return Ok(Some(FMT_TYPE));
        }
        if !self.begun || line.words.trim().is_empty() {
            return Ok(None);
        }
        // A renamed type is another message.
        let is_named = |kind: &&u8| formats.get(**kind).is_some_and(|format| format.name == name);
        let Some(&kind) = self.by_name.get(name).filter(is_named) else {
            let name: String = name.chars().take(20).collect();
            return Err(format!("a line that begins with {name:?}, which no FMT has defined before it"));
        };
        let columns = formats.get(kind).map_or(0, |format| format.fields.len());
        let found = line.words.matches(',').count();
        if found < columns {
            return Err(format!("a line of {name} with {found} of {columns} values"));
        }
        Ok(Some(kind))
    }

    /// More values than columns; once for each type.
    fn surplus(&mut self, line: &Line<'_>, kind: u8, formats: &format::Formats) -> Option<String> {
        let format = formats.get(kind).filter(|format| !format.ends_in_text())?;
        let (columns, found) = (format.characters.max(format.fields.len()), line.words.matches(',').count());
        (found > columns && self.surplus.insert(kind)).then(|| {
            format!(
                "a line of {} with {found} values for {columns} columns: the others are not read",
                format.name
            )
        })
    }

    fn learn(&mut self, kind: u8, formats: &format::Formats) {
        if kind == FMT_TYPE
            && let Some(format) = formats.newest()
            && self.by_name.len() < NAMES_MAX
        {
            self.by_name.insert(format.name.clone(), format.kind);
        }
    }
}
