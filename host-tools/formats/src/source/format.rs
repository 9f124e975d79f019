//! A recording's format, by its first bytes.

use std::path::Path;

use hums_blackbox::Header;
use hums_store::sim::is_store;

use super::input::Input;
use super::sniff::{InputKind, sniff_bytes};
use super::{dataflash, ulog};
use crate::archive;

pub(super) const LOOK_BYTES: usize = 64 * 1024;
/// Noise has a frame by chance once in a hundred times of this size: more are MAVLink.
const BY_CHANCE_BYTES: usize = LOOK_BYTES / 2;
pub(super) const KNOWN: &str = "a recording that this program knows: a tlog, raw MAVLink, an ArduPilot log (.bin, .log), a PX4 log (.ulg), \
                     each also as .gz";

/// A sector of the board's flash; the store (`--store`) has two.
pub const STORE_SECTOR_BYTES: usize = 16 * 1024;

/// The format of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Format {
    /// A log from a file, a card or an image.
    Hums,
    /// A ground station's log.
    Tlog,
    /// A port's bytes.
    Raw,
    /// ArduPilot's, binary or text.
    DataFlash,
    /// PX4's.
    Ulog,
}

impl Format {
    /// The name that JSON and tables use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hums => "hums",
            Self::Tlog => "tlog",
            Self::Raw => "raw",
            Self::DataFlash => "dataflash",
            Self::Ulog => "ulog",
        }
    }

    /// The name for people.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Hums => "log of HUMS",
            Self::Tlog => "ground station's log (tlog)",
            Self::Raw => "raw MAVLink",
            Self::DataFlash => "ArduPilot log (DataFlash)",
            Self::Ulog => "PX4 log (ULog)",
        }
    }

    /// The format in a sentence: `a PX4 log (ULog)`.
    pub fn with_article(self) -> String {
        match self {
            Self::Raw => self.words().to_owned(),
            Self::DataFlash => format!("an {}", self.words()),
            Self::Hums | Self::Tlog | Self::Ulog => format!("a {}", self.words()),
        }
    }

    /// Received over a link, not written by the autopilot.
    pub const fn is_of_link(self) -> bool {
        matches!(self, Self::Hums | Self::Tlog | Self::Raw)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Detected {
    Tlog,
    Raw,
    /// ArduPilot's onboard log.
    DataFlash(dataflash::Form),
    Ulog,
}

impl Detected {
    pub(super) const fn format(self) -> Format {
        match self {
            Self::Tlog => Format::Tlog,
            Self::Raw => Format::Raw,
            Self::DataFlash(_) => Format::DataFlash,
            Self::Ulog => Format::Ulog,
        }
    }
}

/// An autopilot's log, by some hundred bytes.
pub(super) fn begins_recording(start: &[u8]) -> bool {
    ulog::detect(start) || dataflash::begins(start).is_some()
}

/// `None` if unknown.
pub(super) fn detect(start: &[u8]) -> Option<Detected> {
    if hint(start).is_some() {
        // An archive's uncompressed log would be read from its middle.
        return None;
    }
    if ulog::detect(start) {
        return Some(Detected::Ulog);
    }
    if let Some(form) = dataflash::begins(start) {
        return Some(Detected::DataFlash(form));
    }
    // DataFlash's signs are weaker, and 64 KiB of other data rarely hold a valid frame of version 1.
    let (kind, frames) = sniff_bytes(start);
    let is_mavlink = frames > start.len() / BY_CHANCE_BYTES;
    if dataflash::is_headless(start, frames) {
        return Some(Detected::DataFlash(dataflash::Form::Binary));
    }
    match kind {
        InputKind::Tlog if is_mavlink => Some(Detected::Tlog),
        InputKind::Raw if is_mavlink => Some(Detected::Raw),
        _ => dataflash::detect(start).map(Detected::DataFlash),
    }
}

/// Known but not read, with advice.
pub(super) fn hint(start: &[u8]) -> Option<&'static str> {
    const TWICE: &str = "is compressed twice with gzip; unpack it once";
    const STORE: &str = "is the memory of a simulated board, and no recording; it may stay there";
    const OWN: &str = "is a log of HUMS in another file, compressed or joined; unpack it";
    const TABLE: &str = "is a Parquet table, which was made of a recording; give the recording";
    let is_own = || start.first_chunk().is_some_and(|block| Header::read(block).is_ok());
    archive::hint(start)
        .or_else(|| start.starts_with(&archive::GZIP).then_some(TWICE))
        .or_else(|| start.starts_with(b"PAR1").then_some(TABLE))
        .or_else(|| is_own().then_some(OWN))
        .or_else(|| is_store::<STORE_SECTOR_BYTES>(start).then_some(STORE))
}

/// The format by 64 KiB or the whole file; not HUMS logs.
pub fn format_of(start: &[u8]) -> Option<Format> {
    detect(start).map(Detected::format)
}

pub(super) fn is_recording(path: &Path) -> bool {
    detect(&start_of(path)).is_some()
}

/// Empty if unreadable.
pub(super) fn start_of(path: &Path) -> Vec<u8> {
    Input::open(path).ok().and_then(|mut input| input.peek(LOOK_BYTES).ok()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_that_is_one_by_chance_makes_no_mavlink_of_an_autopilots_log() {
        use crate::mavlink::frame::tests::HEARTBEAT;
        let binary = [&[0xa3, 0x95, 128, 128, 89][..], b"FMT\0BBnNZ", &HEARTBEAT].concat();
        let text = [b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n", &HEARTBEAT[..]].concat();
        for start in [binary, text] {
            assert_eq!(format_of(&start), Some(Format::DataFlash));
        }
        assert_eq!(format_of(&HEARTBEAT.repeat(3)), Some(Format::Raw));
        // One frame in noise does not count.
        for (frames, expected) in [(1, None), (2, None), (3, Some(Format::Raw))] {
            let noise = vec![0x55; LOOK_BYTES - frames * HEARTBEAT.len()];
            assert_eq!(format_of(&[noise, HEARTBEAT.repeat(frames)].concat()), expected);
        }
    }
}
