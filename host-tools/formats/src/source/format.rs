//! The format of a recording, by its first bytes.

use std::path::Path;

use hums_blackbox::Header;
use hums_store::sim::is_store;

use super::input::Input;
use super::sniff::{Kind, sniff_bytes};
use super::{dataflash, ulog};
use crate::archive;

/// Number of bytes read to find the format.
pub(super) const LOOK_BYTES: usize = 64 * 1024;
/// In this many bytes of noise a frame is found by chance once in a hundred times. More than one frame for
/// each of these is MAVLink.
const BY_CHANCE_BYTES: usize = LOOK_BYTES / 2;
/// The known formats besides our own logs, for messages: the end of a sentence.
pub(super) const KNOWN: &str = "a recording that this program knows: a tlog, raw MAVLink, an ArduPilot log (.bin, .log), a PX4 log (.ulg), \
                     each also as .gz";

/// Size of a sector of the board's flash; two sectors are its store (`--store`).
pub const STORE_SECTOR_BYTES: usize = 16 * 1024;

/// The format of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Format {
    /// A log of HUMS, from a file, a card or a card's image.
    Hums,
    /// A ground station's log.
    Tlog,
    /// The bytes of a port.
    Raw,
    /// ArduPilot's onboard log, binary or as text.
    DataFlash,
    /// PX4's onboard log.
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

    /// The name for people, in a sentence: `a PX4 log (ULog)`.
    pub fn with_article(self) -> String {
        match self {
            Self::Raw => self.words().to_owned(),
            Self::DataFlash => format!("an {}", self.words()),
            Self::Hums | Self::Tlog | Self::Ulog => format!("a {}", self.words()),
        }
    }

    /// Whether it was received over a link, by a ground station or a recorder on a port; otherwise the
    /// autopilot wrote it itself.
    pub const fn is_of_link(self) -> bool {
        matches!(self, Self::Hums | Self::Tlog | Self::Raw)
    }
}

/// The kind found from some first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Detected {
    /// A ground station's log.
    Tlog,
    /// The bytes of a port.
    Raw,
    /// ArduPilot's onboard log.
    DataFlash(dataflash::Form),
    /// PX4's onboard log.
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

/// Whether a file that begins so (some hundred bytes) is an autopilot's own log, whatever follows.
pub(super) fn begins_recording(start: &[u8]) -> bool {
    ulog::detect(start) || dataflash::begins(start).is_some()
}

/// The kind of a file with these first bytes; `None` if unknown.
pub(super) fn detect(start: &[u8]) -> Option<Detected> {
    if hint(start).is_some() {
        // An uncompressed log in an archive would be read from its middle.
        return None;
    }
    if ulog::detect(start) {
        return Some(Detected::Ulog);
    }
    if let Some(form) = dataflash::begins(start) {
        return Some(Detected::DataFlash(form));
    }
    // Before DataFlash's weaker signs. A valid frame of version 1 in 64 KiB of other data is rare, but
    // happens.
    let (kind, frames) = sniff_bytes(start);
    let is_mavlink = frames > start.len() / BY_CHANCE_BYTES;
    if dataflash::is_headless(start, frames) {
        return Some(Detected::DataFlash(dataflash::Form::Binary));
    }
    match kind {
        Kind::Tlog if is_mavlink => Some(Detected::Tlog),
        Kind::Raw if is_mavlink => Some(Detected::Raw),
        _ => dataflash::detect(start).map(Detected::DataFlash),
    }
}

/// Description of a known file that is not read, by its first bytes after unpacking, with advice.
pub(super) fn hint(start: &[u8]) -> Option<&'static str> {
    const TWICE: &str = "is compressed twice with gzip; unpack it once (gzip -dk)";
    const STORE: &str = "is the memory of a simulated board (--store), and no recording; it may stay there";
    const OWN: &str = "is a log of HUMS in another file, compressed or joined; unpack it (gzip -dk)";
    let is_own = || start.first_chunk().is_some_and(|block| Header::read(block).is_ok());
    archive::hint(start)
        .or_else(|| start.starts_with(&archive::GZIP).then_some(TWICE))
        .or_else(|| is_own().then_some(OWN))
        .or_else(|| is_store::<STORE_SECTOR_BYTES>(start).then_some(STORE))
}

/// The format of a file with these first bytes (64 KiB, or the whole file), if it is a recording other than
/// our own logs.
pub fn format_of(start: &[u8]) -> Option<Format> {
    detect(start).map(Detected::format)
}

/// Whether a file is a recording other than our own logs.
pub(super) fn is_recording(path: &Path) -> bool {
    detect(&start_of(path)).is_some()
}

/// The first bytes of a file; empty if unreadable.
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
        // A single frame in noise does not count.
        for (frames, expected) in [(1, None), (2, None), (3, Some(Format::Raw))] {
            let noise = vec![0x55; LOOK_BYTES - frames * HEARTBEAT.len()];
            assert_eq!(format_of(&[noise, HEARTBEAT.repeat(frames)].concat()), expected);
        }
    }
}
