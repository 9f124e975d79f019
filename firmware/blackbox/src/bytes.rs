//! Little-endian fields in and out of byte slices, bounded at both ends.

use hums_core::time::Instant;

use crate::record::{NAME_BYTES_MAX, TEXT_BYTES_MAX};

/// Copies `from` to the start of `to`, as far as there is room. Few bytes are copied in pieces of fixed sizes: less work
/// than a call of `memcpy`, which the compiler makes of anything plainer.
#[inline]
pub(crate) fn copy_few(from: &[u8], to: &mut [u8]) {
    if from.len() >= 64 {
        for (place, &byte) in to.iter_mut().zip(from) {
            *place = byte;
        }
        return;
    }
    let rest = copy_piece::<32>((from, to));
    let rest = copy_piece::<16>(rest);
    let rest = copy_piece::<8>(rest);
    let rest = copy_piece::<4>(rest);
    let rest = copy_piece::<2>(rest);
    copy_piece::<1>(rest);
}

/// Copies `N` bytes if there are so many, and gives the rest.
#[inline]
fn copy_piece<'f, 't, const N: usize>((from, to): (&'f [u8], &'t mut [u8])) -> (&'f [u8], &'t mut [u8]) {
    if from.len() < N || to.len() < N {
        return (from, to);
    }
    let (bytes, from) = from.split_at(N);
    let (places, to) = to.split_at_mut(N);
    places.copy_from_slice(bytes);
    (from, to)
}

/// Reads fields; beyond the end there are zeros and empty texts.
pub(crate) struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    pub(crate) const fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    /// Up to `count` bytes: what there is.
    pub(crate) fn bytes(&mut self, count: usize) -> &'a [u8] {
        let (taken, rest) = self.rest.split_at(count.min(self.rest.len()));
        self.rest = rest;
        taken
    }

    pub(crate) fn array<const N: usize>(&mut self) -> [u8; N] {
        let mut array = [0; N];
        let taken = self.bytes(N);
        array[..taken.len()].copy_from_slice(taken);
        array
    }

    pub(crate) fn u8(&mut self) -> u8 {
        u8::from_le_bytes(self.array())
    }

    pub(crate) fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.array())
    }

    pub(crate) fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.array())
    }

    pub(crate) fn instant(&mut self) -> Instant {
        Instant::from_micros(self.u64())
    }

    /// A length and that many bytes; what is not UTF-8 ends the text.
    pub(crate) fn text(&mut self) -> &'a str {
        let len = self.u8();
        let bytes = self.bytes(usize::from(len));
        match core::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => core::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
        }
    }
}

/// Writes fields; remembers when there were too many.
pub(crate) struct Sink<'a> {
    out: &'a mut [u8],
    len: usize,
}

impl<'a> Sink<'a> {
    pub(crate) fn new(out: &'a mut [u8]) -> Self {
        Self { out, len: 0 }
    }

    /// The bytes written, or `None` where they did not fit.
    pub(crate) fn len(&self) -> Option<usize> {
        (self.len <= self.out.len()).then_some(self.len)
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        let end = self.len.saturating_add(bytes.len());
        if let Some(place) = self.out.get_mut(self.len..end) {
            place.copy_from_slice(bytes);
        }
        self.len = end;
        self
    }

    /// A record's kind, in its version 1.
    pub(crate) fn head(&mut self, kind: u8) -> &mut Self {
        self.u8(kind).u8(1)
    }

    pub(crate) fn u8(&mut self, value: u8) -> &mut Self {
        self.bytes(&[value])
    }

    pub(crate) fn u32(&mut self, value: u32) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    pub(crate) fn u64(&mut self, value: u64) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    /// A name, cut at a character's border where it is too long.
    pub(crate) fn name(&mut self, text: &str) -> &mut Self {
        self.cut(text, NAME_BYTES_MAX)
    }

    /// A text, cut likewise.
    pub(crate) fn text(&mut self, text: &str) -> &mut Self {
        self.cut(text, TEXT_BYTES_MAX)
    }

    fn cut(&mut self, text: &str, bytes_max: usize) -> &mut Self {
        let mut end = text.len().min(bytes_max);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        self.u8(end as u8).bytes(&text.as_bytes()[..end])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_and_many_bytes_are_copied_as_they_are() {
        let from: Vec<u8> = (1..=100).collect();
        for len in 0..=from.len() {
            for room in [0, 1, 7, 64, 100, 120] {
                let mut to = vec![0; room];
                copy_few(&from[..len], &mut to);
                let copied = to.iter().zip(&from[..len]).take_while(|(a, b)| a == b).count();
                assert!(to[copied..].iter().all(|&byte| byte == 0));
                assert!(copied == len || room < len, "{len} into {room}: {copied}");
            }
        }
    }
}
