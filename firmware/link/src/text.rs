//! `STATUSTEXT` put together again: MAVLink 2 sends what is longer than 50 characters in several messages.
//!
//! A text with an id other than zero comes in parts, numbered from zero; the last one has a zero byte in it. A part that
//! is lost leaves a `…` in the text instead of hiding the rest. Bounded: two senders at a time, [`TEXT_MAX`] bytes each;
//! what is longer is cut.

use heapless::String;
use hums_core::observation::Source;

use crate::frame::{Check, Frame};

/// The longest text: five parts.
pub const TEXT_MAX: usize = 250;
const ID: u32 = 253;
const PART: usize = 50;
/// Senders whose texts may be interleaved.
const SENDERS: usize = 2;

/// A text that a component of a vehicle or a ground station said.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Text {
    /// Who said it.
    pub source: Source,
    /// `MAV_SEVERITY`: 0 is an emergency, 7 debugging.
    pub severity: u8,
    /// What it said. Bytes that are no ASCII became `?`.
    pub text: String<TEXT_MAX>,
}

#[derive(Clone, Debug)]
struct Partial {
    text: Text,
    id: u16,
    next_part: u8,
}

/// Puts texts together.
#[derive(Clone, Debug, Default)]
pub struct Texts {
    partial: [Option<Partial>; SENDERS],
}

impl Texts {
    /// Nothing begun.
    pub const fn new() -> Self {
        Self { partial: [const { None }; SENDERS] }
    }

    /// Takes a frame; `sink` gets each text that is complete with it, or will never be.
    pub fn frame(&mut self, frame: &Frame<'_>, sink: &mut impl FnMut(&Text)) {
        if frame.id() != ID || frame.check() != Check::Verified {
            return;
        }
        let source = Source { system: frame.system(), component: frame.component() };
        let payload = frame.payload();
        let byte = |at: usize| payload.get(at).copied().unwrap_or(0);
        let (severity, id, part) = (byte(0), u16::from_le_bytes([byte(51), byte(52)]), byte(53));
        // Zeros at the end are left out on the way, so that a part which ends early is the last one.
        let characters = payload.iter().skip(1).take(PART).take_while(|byte| **byte != 0);
        let is_last = characters.clone().count() < PART;

        let mut current = self.take(source, id, part, sink).unwrap_or_else(|| Partial {
            text: Text { source, severity, text: String::new() },
            id,
            next_part: 0,
        });
        if part > current.next_part {
            // A full text stays as it is: it is cut anyway.
            let _ = current.text.text.push('…');
        }
        for byte in characters {
            let character = if byte.is_ascii() { char::from(*byte) } else { '?' };
            let _ = current.text.text.push(character);
        }
        current.next_part = part.saturating_add(1);
        if id == 0 || is_last {
            sink(&current.text);
        } else {
            self.keep(current, sink);
        }
    }

    /// Gives out what was begun and is still not complete: no more parts will come.
    pub fn finish(&mut self, sink: &mut impl FnMut(&Text)) {
        for partial in &mut self.partial {
            if let Some(partial) = partial.take() {
                sink(&partial.text);
            }
        }
    }

    /// What is begun by this sender, if this part continues it. Otherwise its end was lost, and it is given out as it is.
    fn take(&mut self, source: Source, id: u16, part: u8, sink: &mut impl FnMut(&Text)) -> Option<Partial> {
        let same = |partial: &&mut Option<Partial>| {
            partial.as_ref().is_some_and(|partial| partial.text.source == source)
        };
        let partial = self.partial.iter_mut().find(same)?.take()?;
        if partial.id == id && part >= partial.next_part {
            return Some(partial);
        }
        sink(&partial.text);
        None
    }

    fn keep(&mut self, partial: Partial, sink: &mut impl FnMut(&Text)) {
        let free = self.partial.iter().position(Option::is_none);
        // Where there is no place, the oldest text is given out as it is.
        if free.is_none()
            && let Some(oldest) = self.partial[0].take()
        {
            sink(&oldest.text);
        }
        self.partial[free.unwrap_or(0)] = Some(partial);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crc;

    fn frame(component: u8, id: u16, part: u8, text: &[u8]) -> Vec<u8> {
        let mut payload = vec![4];
        payload.extend_from_slice(text);
        payload.resize(51, 0);
        payload.extend_from_slice(&id.to_le_bytes());
        payload.push(part);
        while payload.last() == Some(&0) {
            payload.pop();
        }
        let mut bytes = vec![0xfd, payload.len() as u8, 0, 0, 0, 1, component, 253, 0, 0];
        bytes.extend_from_slice(&payload);
        let sum = crc::step(crc::update(crc::START, &bytes[1..]), 83);
        bytes.extend_from_slice(&sum.to_le_bytes());
        bytes
    }

    fn read(frames: &[Vec<u8>]) -> Vec<std::string::String> {
        let mut texts = Texts::new();
        let mut read = Vec::new();
        for bytes in frames {
            let frame = Frame::parse(bytes).expect("a frame");
            texts.frame(&frame, &mut |text| read.push(text.text.as_str().to_owned()));
        }
        texts.finish(&mut |text| read.push(text.text.as_str().to_owned()));
        read
    }

    const LONG: [u8; 50] = [b'a'; 50];

    #[test]
    fn a_short_text_is_whole() {
        assert_eq!(read(&[frame(1, 0, 0, b"Arming motors")]), ["Arming motors"]);
        assert_eq!(read(&[frame(1, 0, 0, &LONG)]), ["a".repeat(50)], "as long as one part may be");
    }

    #[test]
    fn parts_are_put_together_also_when_two_speak_at_once() {
        let frames = [
            frame(1, 7, 0, &LONG),
            frame(2, 7, 0, &[b'b'; 50]),
            frame(1, 7, 1, b" end of a"),
            frame(2, 7, 1, b" end of b"),
        ];
        assert_eq!(read(&frames), ["a".repeat(50) + " end of a", "b".repeat(50) + " end of b"]);
    }

    #[test]
    fn a_lost_part_leaves_a_mark_and_hides_nothing() {
        assert_eq!(read(&[frame(1, 7, 0, &LONG), frame(1, 7, 2, b"end")]), ["a".repeat(50) + "…end"]);
        assert_eq!(read(&[frame(1, 7, 1, b"end")]), ["…end"]);
    }

    #[test]
    fn a_lost_end_is_given_out_with_the_next_text() {
        assert_eq!(read(&[frame(1, 7, 0, &LONG), frame(1, 8, 0, b"next")]), ["a".repeat(50), "next".into()]);
        assert_eq!(read(&[frame(1, 7, 0, &LONG)]), ["a".repeat(50)]);
    }

    #[test]
    fn more_parts_and_senders_than_there_is_room_for_are_cut_and_never_lost_silently() {
        let parts: Vec<_> = (0..9).map(|part| frame(1, 7, part, &LONG)).collect();
        assert_eq!(read(&parts), ["a".repeat(250)]);
        let senders: Vec<_> = (1..=4).map(|component| frame(component, 7, 0, &LONG)).collect();
        assert_eq!(read(&senders).len(), 4);
    }

    #[test]
    fn characters_that_are_none_become_question_marks() {
        assert_eq!(read(&[frame(1, 0, 0, b"caf\xe9")]), ["caf?"]);
    }
}
