//! A binary log's messages: two bytes of head, the type, and a length by FMT.
//!
//! A message counts if the next head, or the end, follows it. Otherwise bytes were lost or changed:
//! - If a chain of messages begins inside of it, it is damaged, and reading goes on at the chain.
//! - If not, it is whole, and the bytes after it are skipped up to the next chain.
//!
//!
//! Memory: one buffer; each byte is looked at a bounded number of times (255 at most).

use std::io::{self, Read};

use super::ahead::{AHEAD_BYTES, Ahead};
use super::format::{HEADER_BYTES, Lengths};
use crate::source::buffer::Buffer;

const HEAD: [u8; 2] = [0xA3, 0x95];
const MESSAGE_BYTES_MAX: u64 = 256;
/// The longest message, and the next head.
const LOOKAHEAD_BYTES: usize = 2 * 258;

#[derive(Debug)]
pub(super) enum Piece<'a> {
    /// Type, bytes after the header, place.
    Message {
        /// Its type.
        kind: u8,
        payload: &'a [u8],
        /// Its beginning.
        place: u64,
        after: Ahead<'a>,
    },
    Damage(Damage),
}

/// Unreadable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Damage {
    /// Their beginning.
    pub(super) place: u64,
    /// Their number.
    pub(super) bytes: u64,
    /// The file ends with what a power-off leaves: a part of a message, or a fill.
    pub(super) is_cut: bool,
    /// Their description.
    pub(super) words: String,
}

/// Being skipped.
#[derive(Clone, Copy, Debug)]
struct Skipped {
    place: u64,
    bytes: u64,
    /// All are this byte.
    only: Option<u8>,
    /// The type of an undefined message at their beginning.
    undefined: Option<u8>,
    /// The type of a shortened message at their beginning.
    cut: Option<u8>,
}

pub(super) struct Binary<R> {
    buffer: Buffer<R>,
    skipped: Option<Skipped>,
}

impl<R: Read> Binary<R> {
    /// Reads from `input`.
    pub(super) fn new(input: R) -> Self {
        Self { buffer: Buffer::new(input), skipped: None }
    }

    pub(super) fn window(&mut self, bytes: usize) -> io::Result<&[u8]> {
        self.buffer.try_fill(bytes)?;
        Ok(self.buffer.rest())
    }

    pub(super) fn place(&self) -> u64 {
        self.buffer.place()
    }

    /// Skipped bytes come before the next message; `None` at the end. `lengths` learns the right one of a
    /// type's two lengths.
    pub(super) fn next(&mut self, lengths: &mut Lengths) -> io::Result<Option<Piece<'_>>> {
        loop {
            self.buffer.try_fill(LOOKAHEAD_BYTES.max(AHEAD_BYTES))?;
            let (rest, is_end) = (self.buffer.rest(), self.buffer.ended());
            if rest.is_empty() {
                let end = self.skipped.take().map(|skipped| Piece::Damage(skipped.told(true)));
                return Ok(end);
            }
            match look(rest, is_end, lengths) {
                Look::Message(length) => {
                    if let Some(skipped) = self.skipped.take() {
                        return Ok(Some(Piece::Damage(skipped.told(false))));
                    }
                    let place = self.place();
                    let (bytes, after) = self.buffer.take_before(length);
                    let after = Ahead { bytes: after, is_text: false, is_end };
                    let kind = bytes.get(2).copied().unwrap_or_default();
                    let payload = bytes.get(HEADER_BYTES..).unwrap_or_default();
                    return Ok(Some(Piece::Message { kind, payload, place, after }));
                }
                Look::Skip { bytes, undefined, cut } => self.skip(bytes, undefined, cut),
            }
        }
    }

    fn skip(&mut self, bytes: usize, undefined: Option<u8>, cut: Option<u8>) {
        let place = self.place();
        let gone = self.buffer.take(bytes);
        let first = gone.first().copied();
        let only = first.filter(|first| gone.iter().all(|byte| byte == first));
        let new = Skipped { place, bytes: bytes as u64, only, undefined, cut };
        self.skipped = Some(match self.skipped {
            None => new,
            Some(before) => Skipped {
                bytes: before.bytes + bytes as u64,
                only: only.filter(|_| only == before.only),
                ..before
            },
        });
    }
}

impl Skipped {
    fn told(self, at_end: bool) -> Damage {
        let Self { place, bytes, only, undefined, cut } = self;
        let is_cut = at_end && (only.is_some() || bytes < MESSAGE_BYTES_MAX);
        let words = match (only, undefined, cut) {
            (Some(0), ..) if bytes > 1 => "nothing but zeros".to_owned(),
            (Some(0xFF), ..) if bytes > 1 => "nothing but erased memory (0xFF)".to_owned(),
            (_, Some(kind), _) => format!("a message of type {kind}, which no FMT has defined before it"),
            (_, _, Some(kind)) => format!("a message of type {kind} that is not whole"),
            _ => "no message begins here".to_owned(),
        };
        Damage { place, bytes, is_cut, words }
    }
}

/// Complete bytes; unreadable ones are passed over.
pub(super) struct Window<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Window<'a> {
    pub(super) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    pub(super) fn next(&mut self, lengths: &mut Lengths) -> Option<(u8, &'a [u8], usize, Ahead<'a>)> {
        loop {
            let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
            let length = match look(rest, true, lengths) {
                Look::Message(length) => length,
                Look::Skip { bytes, .. } => {
                    self.at += bytes;
                    continue;
                }
            };
            let (message, after) = rest.split_at_checked(length)?;
            let place = self.at;
            self.at += length;
            let kind = message.get(2).copied().unwrap_or_default();
            let payload = message.get(HEADER_BYTES..).unwrap_or_default();
            return Some((kind, payload, place, Ahead { bytes: after, is_text: false, is_end: true }));
        }
    }
}

enum Look {
    /// A message of this length begins here.
    Message(usize),
    /// No message.
    Skip { bytes: usize, undefined: Option<u8>, cut: Option<u8> },
}

fn look(rest: &[u8], ended: bool, lengths: &mut Lengths) -> Look {
    let kind = match rest {
        [a, b, kind, ..] if [*a, *b] == HEAD => *kind,
        _ => {
            return Look::Skip {
                bytes: none(searched(rest, ended), rest, ended, lengths),
                undefined: None,
                cut: None,
            };
        }
    };
    let length = usize::from(lengths.told[usize::from(kind)]);
    if length == 0 {
        let bytes = none(searched(rest, ended), rest, ended, lengths);
        return Look::Skip { bytes, undefined: Some(kind), cut: None };
    }
    if length <= rest.len() && followed(rest, length, ended) {
        return Look::Message(length);
    }
    let other = usize::from(lengths.fields[usize::from(kind)]);
    if other > HEADER_BYTES && other <= rest.len() && followed(rest, other, ended) {
        // The columns were right: from here on they count.
        lengths.told[usize::from(kind)] = other as u8;
        lengths.fields[usize::from(kind)] = 0;
        return Look::Message(other);
    }
    let inside = none(rest.get(..length).unwrap_or(rest), rest, ended, lengths);
    if length > rest.len() || inside < length {
        return Look::Skip { bytes: inside, undefined: None, cut: Some(kind) };
    }
    Look::Message(length)
}

fn followed(rest: &[u8], length: usize, ended: bool) -> bool {
    match rest.get(length..) {
        Some([a, b, ..]) => [*a, *b] == HEAD,
        Some([a]) => *a == HEAD[0],
        Some([]) => ended,
        None => false,
    }
}

fn searched(rest: &[u8], ended: bool) -> &[u8] {
    let limit = if ended { rest.len() } else { rest.len().saturating_sub(LOOKAHEAD_BYTES / 2).max(1) };
    rest.get(..limit).unwrap_or(rest)
}

fn none(within: &[u8], rest: &[u8], ended: bool, lengths: &Lengths) -> usize {
    let mut at = 1;
    while let Some(found) = within.get(at..).and_then(|rest| rest.iter().position(|byte| *byte == HEAD[0])) {
        at += found;
        if let Some([a, b, kind]) = rest.get(at..at + HEADER_BYTES)
            && [*a, *b] == HEAD
        {
            let lengths = [lengths.told[usize::from(*kind)], lengths.fields[usize::from(*kind)]];
            let begins = |length: u8| {
                length > 0 && rest.get(at..).is_some_and(|rest| followed(rest, usize::from(length), ended))
            };
            if lengths.into_iter().any(begins) {
                return at;
            }
        }
        at += 1;
    }
    within.len()
}
