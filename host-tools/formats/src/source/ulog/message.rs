//! Messages: three bytes of header (length, kind), and a body.
//!
//! Without a checksum in `ULog` a message counts by its content: each kind has possible lengths and contents.
//! In doubt the next header must be valid as well ([`Parser::look`]). After damage the next message is
//! searched ([`Parser::find`]): synchronisation comes twice a second.

use super::format::{Number, typed_key};

/// Length and kind.
pub(super) const HEADER_BYTES: usize = 3;
/// The longest message.
pub(super) const MESSAGE_BYTES_MAX: usize = HEADER_BYTES + u16::MAX as usize;
/// Magic, version, start of logging.
pub(super) const FILE_HEADER_BYTES: usize = 16;
pub(super) const MAGIC: [u8; 7] = [b'U', b'L', b'o', b'g', 0x01, 0x12, 0x35];
/// Place of the format's version in the header; PX4 writes 1, and wrote 0 before v1.8.
pub(super) const VERSION_AT: usize = MAGIC.len();
pub(super) const VERSION_MAX: u8 = 1;
/// In a search, other than data: checking 65,536 bytes for each byte would take seconds a megabyte.
const FOUND_BYTES_MAX: usize = 2_048;
const SYNC: [u8; 8] = [0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Message<'a> {
    /// `B`: flags, and places of appended data.
    Flags { incompatible: [u8; 8], appended: [u64; 3] },
    /// `F`
    Format(&'a [u8]),
    /// `I`, and `M` if `multiple`.
    Information { value: Keyed<'a>, multiple: bool },
    /// `P`
    Parameter(Keyed<'a>),
    /// `Q`: 1 system-wide, 2 of the configuration.
    Default { groups: u8, value: Keyed<'a> },
    /// `A`
    Subscribe { id: u16, instance: u8, name: &'a str },
    /// `R`
    Unsubscribe(u16),
    /// `D`
    Data { id: u16, data: &'a [u8] },
    /// `L`, and `C` with the sending module's tag.
    Text { level: u8, tag: Option<u16>, time_us: u64, words: &'a [u8] },
    /// `O`, milliseconds.
    Dropout(u16),
    /// `S`
    Sync,
    /// A file's header in the middle.
    Beginning { version: u8, time_us: u64 },
    /// Newer than this reader.
    Unknown,
}

/// A value with its type and name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Keyed<'a> {
    pub(super) name: &'a str,
    pub(super) number: Option<Number>,
    pub(super) array: Option<u32>,
    pub(super) value: &'a [u8],
}

impl<'a> Keyed<'a> {
    fn of(body: &'a [u8]) -> Option<Self> {
        let (&key_bytes, rest) = body.split_first()?;
        let (key, value) = rest.split_at_checked(usize::from(key_bytes))?;
        let ((kind, array), name) = typed_key(std::str::from_utf8(key).ok()?)?;
        Some(Self { name, number: Number::named(kind), array, value })
    }

    fn fits(&self) -> bool {
        self.number
            .is_some_and(|number| number.bytes() * self.array.unwrap_or(1) as usize == self.value.len())
    }

    /// A single number.
    pub(super) fn number(&self) -> Option<f64> {
        let number =
            self.number.filter(|number| self.array.is_none() && number.bytes() == self.value.len())?;
        number.value(self.value)?.number()
    }

    pub(super) fn words(&self) -> Option<&'a str> {
        (self.number == Some(Number::CHAR)).then(|| words(self.value))
    }
}

/// Text up to the first NUL or invalid UTF-8 byte.
pub(super) fn words(bytes: &[u8]) -> &str {
    let bytes = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
    bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid())
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found<'a> {
    /// A message, and its bytes with the header.
    Message(Message<'a>, usize),
    /// The input ends within a message.
    Cut,
    /// No valid message.
    Nothing,
}

/// Data have their subscription's length; `None` without a subscription.
pub(super) type Fits<'a> = dyn Fn(u16, usize) -> Option<bool> + 'a;

pub(super) struct Parser<'a> {
    pub(super) fits: &'a Fits<'a>,
}

enum Belief<'a> {
    Sure(Message<'a>),
    /// It could be one, if the next one is.
    Likely(Message<'a>),
    Not,
}

impl Parser<'_> {
    /// The piece at the beginning. A `rest` shorter than the longest message and the next header ends the
    /// input.
    pub(super) fn look<'a>(&self, rest: &'a [u8]) -> Found<'a> {
        if let Some((version, time_us)) = beginning(rest) {
            return Found::Message(Message::Beginning { version, time_us }, FILE_HEADER_BYTES);
        }
        let Some((kind, body_bytes)) = header(rest) else {
            // A part of a header at the end is a cut message.
            let cut = rest.len() < HEADER_BYTES && rest.iter().any(|&byte| byte != 0);
            return if cut { Found::Cut } else { Found::Nothing };
        };
        let bytes = HEADER_BYTES + body_bytes;
        let Some(body) = rest.get(HEADER_BYTES..bytes) else {
            return if could_be(kind, body_bytes) { Found::Cut } else { Found::Nothing };
        };
        match self.believe(kind, body) {
            // A cut log with another joined on: its last message is not whole.
            Belief::Sure(_) if self.swallows_a_beginning(rest, bytes) => Found::Nothing,
            Belief::Sure(message) => Found::Message(message, bytes),
            Belief::Likely(message) if self.goes_on(rest.get(bytes..).unwrap_or_default()) => {
                Found::Message(message, bytes)
            }
            _ => Found::Nothing,
        }
    }

    /// The next valid message's place, from `from` on. `Err`: bytes that begin none; at the input's end
    /// (`last`) all, or else all but the longest message.
    pub(super) fn find(&self, rest: &[u8], from: usize, last: bool) -> Result<usize, usize> {
        let end = if last { rest.len() } else { rest.len().saturating_sub(MESSAGE_BYTES_MAX + HEADER_BYTES) };
        (from..end).find(|&at| self.begins(rest.get(at..).unwrap_or_default())).ok_or(end)
    }

    fn begins(&self, rest: &[u8]) -> bool {
        if beginning(rest).is_some() {
            return true;
        }
        let Some((kind, body_bytes)) = header(rest).filter(|&(kind, bytes)| could_be(kind, bytes)) else {
            return false;
        };
        if kind != b'D' && body_bytes > FOUND_BYTES_MAX {
            return false;
        }
        let bytes = HEADER_BYTES + body_bytes;
        let Some(body) = rest.get(HEADER_BYTES..bytes) else { return false };
        match self.believe(kind, body) {
            Belief::Sure(Message::Sync | Message::Data { .. }) => true,
            Belief::Sure(_) => self.goes_on(rest.get(bytes..).unwrap_or_default()),
            Belief::Likely(_) | Belief::Not => false,
        }
    }

    fn goes_on(&self, rest: &[u8]) -> bool {
        if rest.is_empty() || beginning(rest).is_some() {
            return true;
        }
        header(rest).map_or(rest.len() < HEADER_BYTES, |(kind, bytes)| {
            let known = rest
                .get(HEADER_BYTES..HEADER_BYTES + 2)
                .filter(|_| kind == b'D')
                .and_then(|id| (self.fits)(u16::from_le_bytes(id.try_into().ok()?), bytes.checked_sub(2)?));
            could_be(kind, bytes) && known != Some(false)
        })
    }

    /// Another log begins within, and no message follows these bytes.
    fn swallows_a_beginning(&self, rest: &[u8], bytes: usize) -> bool {
        let inside = rest.get(HEADER_BYTES..bytes + MAGIC.len() - 1).unwrap_or_default();
        !self.goes_on(rest.get(bytes..).unwrap_or_default())
            && inside.windows(MAGIC.len()).any(|window| window == MAGIC)
    }

    fn believe<'a>(&self, kind: u8, body: &'a [u8]) -> Belief<'a> {
        if !could_be(kind, body.len()) {
            // Newer kinds are ignored: letters so far.
            let newer = kind.is_ascii_alphabetic() && !KINDS.contains(&kind) && !body.is_empty();
            return if newer { Belief::Likely(Message::Unknown) } else { Belief::Not };
        }
        self.parse(kind, body).unwrap_or(Belief::Not)
    }

    fn parse<'a>(&self, kind: u8, body: &'a [u8]) -> Option<Belief<'a>> {
        let fitting = |message, value: &Keyed<'a>| {
            if value.fits() { Belief::Sure(message) } else { Belief::Likely(message) }
        };
        Some(match kind {
            b'B' => Belief::Likely(flags(body)?),
            b'F' => {
                std::str::from_utf8(body).ok()?;
                let message = Message::Format(body);
                if body.contains(&b':') && body.ends_with(b";") {
                    Belief::Sure(message)
                } else {
                    Belief::Likely(message)
                }
            }
            b'I' => {
                let value = Keyed::of(body)?;
                fitting(Message::Information { value, multiple: false }, &value)
            }
            b'M' => {
                let value = Keyed::of(body.get(1..)?)?;
                fitting(Message::Information { value, multiple: true }, &value)
            }
            b'P' => {
                let value = Keyed::of(body)?;
                fitting(Message::Parameter(value), &value)
            }
            b'Q' => {
                let (&groups, rest) = body.split_first()?;
                let value = Keyed::of(rest)?;
                fitting(Message::Default { groups, value }, &value)
            }
            b'A' => {
                let (&[instance, low, high], name) = body.split_first_chunk::<3>()?;
                let name = std::str::from_utf8(name).ok()?;
                let message = Message::Subscribe { id: u16::from_le_bytes([low, high]), instance, name };
                let letters = name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"_-/".contains(&byte));
                if letters { Belief::Sure(message) } else { Belief::Not }
            }
            b'R' => Belief::Likely(Message::Unsubscribe(u16::from_le_bytes(body.try_into().ok()?))),
            b'D' => {
                let (&id, data) = body.split_first_chunk::<2>()?;
                let id = u16::from_le_bytes(id);
                match (self.fits)(id, data.len()) {
                    Some(true) => Belief::Sure(Message::Data { id, data }),
                    Some(false) => Belief::Not,
                    None => Belief::Likely(Message::Data { id, data }),
                }
            }
            b'L' | b'C' => text(kind, body)?,
            b'O' => Belief::Likely(Message::Dropout(u16::from_le_bytes(body.try_into().ok()?))),
            b'S' if body == SYNC => Belief::Sure(Message::Sync),
            _ => Belief::Not,
        })
    }
}

const KINDS: [u8; 13] = *b"BFIMPQARDLCSO";

fn could_be(kind: u8, bytes: usize) -> bool {
    match kind {
        b'B' => (40..=1_024).contains(&bytes),
        b'F' | b'I' | b'P' => bytes >= 5,
        b'M' | b'Q' => bytes >= 6,
        // Names of topics.
        b'A' => (4..=256).contains(&bytes),
        b'R' | b'O' => bytes == 2,
        b'D' => bytes >= 2,
        b'L' => bytes >= 9,
        b'C' => bytes >= 11,
        b'S' => bytes == SYNC.len(),
        _ => false,
    }
}

fn header(rest: &[u8]) -> Option<(u8, usize)> {
    let &[low, high, kind] = rest.first_chunk::<HEADER_BYTES>()?;
    Some((kind, usize::from(u16::from_le_bytes([low, high]))))
}

/// Data messages until another kind, with their subscriptions.
pub(super) const fn data_after(bytes: &[u8]) -> DataAfter<'_> {
    DataAfter { rest: bytes }
}

/// See [`data_after`].
pub(super) struct DataAfter<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for DataAfter<'a> {
    type Item = (u16, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let (kind, body_bytes) = header(self.rest).filter(|(kind, _)| *kind != 0)?;
            let body = self.rest.get(HEADER_BYTES..HEADER_BYTES + body_bytes)?;
            self.rest = self.rest.get(HEADER_BYTES + body_bytes..)?;
            if let (b'D', Some((id, data))) = (kind, body.split_first_chunk()) {
                return Some((u16::from_le_bytes(*id), data));
            }
        }
    }
}

pub(super) fn beginning(rest: &[u8]) -> Option<(u8, u64)> {
    let header = rest.first_chunk::<FILE_HEADER_BYTES>()?;
    header.starts_with(&MAGIC).then(|| (header[VERSION_AT], word(header.get(8..))))
}

fn word(bytes: Option<&[u8]>) -> u64 {
    bytes.and_then(|bytes| bytes.first_chunk()).map_or(0, |word| u64::from_le_bytes(*word))
}

fn flags<'a>(body: &[u8]) -> Option<Message<'a>> {
    let incompatible = *body.get(8..)?.first_chunk()?;
    let appended = [16, 24, 32].map(|at| word(body.get(at..)));
    Some(Message::Flags { incompatible, appended })
}

/// A digit, and words.
fn text(kind: u8, body: &[u8]) -> Option<Belief<'_>> {
    let (&level, rest) = body.split_first()?;
    let level = level.checked_sub(b'0').filter(|level| *level < 8)?;
    let (tag, rest) = match kind {
        b'C' => rest.split_first_chunk().map(|(tag, rest)| (Some(u16::from_le_bytes(*tag)), rest))?,
        _ => (None, rest),
    };
    let (time, words) = rest.split_first_chunk()?;
    let message = Message::Text { level, tag, time_us: u64::from_le_bytes(*time), words };
    let is_odd = |byte: &u8| *byte < b' ' && !b"\n\r\t\x1b".contains(byte);
    let plain = std::str::from_utf8(words).is_ok() && !words.iter().any(is_odd);
    Some(if plain && !words.is_empty() { Belief::Sure(message) } else { Belief::Likely(message) })
}
