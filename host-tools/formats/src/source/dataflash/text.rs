//! The lines of a text log: `NAME, value, value`.
//!
//! A banner, or an old console's menu, before the first FMT is not damage. A line is at most 64 KiB.

use std::borrow::Cow;
use std::io::{self, Read};

use super::ahead::AHEAD_BYTES;
use crate::source::buffer::Buffer;

const LINE_BYTES_MAX: usize = 64 * 1024;

#[derive(Debug)]
pub(super) struct Line<'a> {
    pub(super) place: u64,
    pub(super) bytes: u64,
    /// Invalid UTF-8 is read as ISO 8859-1.
    pub(super) words: Cow<'a, str>,
    /// A line's end, which only the last line may lack.
    pub(super) whole: bool,
    /// Buffered after it.
    pub(super) after: &'a [u8],
    /// Nothing follows.
    pub(super) is_end: bool,
}

impl Line<'_> {
    /// Invalid UTF-8 or control characters.
    pub(super) fn is_odd(&self) -> bool {
        let is_text = |byte: u8| byte == b'\t' || !byte.is_ascii_control();
        matches!(self.words, Cow::Owned(_)) || !self.words.bytes().all(is_text)
    }
}

pub(super) struct Lines<R>(Buffer<R>);

impl<R: Read> Lines<R> {
    /// Reads from `input`.
    pub(super) fn new(input: R) -> Self {
        Self(Buffer::new(input))
    }

    pub(super) fn window(&mut self, bytes: usize) -> io::Result<&[u8]> {
        self.0.try_fill(bytes)?;
        Ok(self.0.rest())
    }

    /// `None` at the end.
    pub(super) fn next(&mut self) -> io::Result<Option<Line<'_>>> {
        self.0.try_fill(LINE_BYTES_MAX.max(AHEAD_BYTES))?;
        let rest = self.0.rest();
        if rest.is_empty() {
            return Ok(None);
        }
        let searched = rest.get(..LINE_BYTES_MAX).unwrap_or(rest);
        let end = searched.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
        let length = end.unwrap_or(searched.len());
        let next = length + usize::from(end.is_some());
        let place = self.0.place();
        let is_end = self.0.ended();
        let (line, after) = self.0.take_before(next);
        let line = line.get(..length).unwrap_or_default();
        let words = std::str::from_utf8(line).map_or_else(
            |_| line.iter().map(|byte| char::from(*byte)).collect::<String>().into(),
            Cow::Borrowed,
        );
        Ok(Some(Line { place, bytes: next as u64, words, whole: end.is_some(), after, is_end }))
    }
}

pub(super) fn values(line: &str, columns: usize) -> Vec<&str> {
    match line.split_once(',') {
        Some((_, rest)) if columns > 0 => rest.splitn(columns, ',').collect(),
        _ => Vec::new(),
    }
}

/// FMT defines itself here; the text before is another log's end.
pub(super) fn beginning(line: &str) -> Option<usize> {
    line.find("FMT, 128, 89, FMT")
}

pub(super) fn name(line: &str) -> &str {
    line.split(',').next().unwrap_or_default().trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_any_way_and_the_last_may_have_no_end() {
        let mut lines = Lines::new(&b"FMT, 1\r\nMSG, a, b\nATT, 3"[..]);
        let mut seen = Vec::new();
        while let Some(line) = lines.next().expect("memory") {
            seen.push((line.words.into_owned(), line.place, line.whole));
        }
        let expected = [("FMT, 1", 0, true), ("", 7, true), ("MSG, a, b", 8, true), ("ATT, 3", 18, false)];
        assert_eq!(seen, expected.map(|(words, place, whole)| (words.to_owned(), place, whole)));
    }

    #[test]
    fn a_line_with_bytes_that_are_no_text_is_odd() {
        let is_odd = |line: &[u8]| Lines::new(line).next().expect("memory").expect("a line").is_odd();
        assert!(!is_odd("ATT, 1, 2\t\u{e9}\r\n".as_bytes()));
        assert!(is_odd(b"ATT, 1\xff\xff, 2\n"));
        assert!(is_odd(b"ATT, 1\0, 2\n"));
    }

    #[test]
    fn the_last_column_keeps_its_commas() {
        assert_eq!(values("MSG, 12, one, two", 2), [" 12", " one, two"]);
        assert_eq!(values("MSG", 2), Vec::<&str>::new());
    }

    #[test]
    fn a_line_without_an_end_for_ever_takes_no_memory() {
        let mut lines = Lines::new(io::repeat(b'a').take(1 << 22));
        let mut count = 0;
        while let Some(line) = lines.next().expect("memory") {
            assert!(line.words.len() <= LINE_BYTES_MAX);
            count += 1;
        }
        assert_eq!((count, lines.0.capacity() <= 1 << 20), (64, true));
    }
}
