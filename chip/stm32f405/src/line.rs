//! A line into a receiver: characters at the times of a sender's own clock.

use std::collections::VecDeque;

use crate::time::{NEVER, Ps};

/// The fault of a character.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// Nothing.
    None,
    /// The noise flag, the byte right.
    Noise,
    /// The framing flag.
    Framing,
}

/// Start bit, eight bits, stop bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Char {
    /// When its start bit begins.
    pub start: Ps,
    /// Bit length.
    pub bit: Ps,
    /// The byte.
    pub byte: u8,
    /// Its fault.
    pub flaw: Flaw,
}

impl Char {
    /// When its stop bit ends.
    pub fn end(&self) -> Ps {
        self.start + 10 * self.bit
    }

    fn bits(&self) -> u16 {
        u16::from(self.byte) << 1 | if self.flaw == Flaw::Framing { 0 } else { 1 << 9 }
    }
}

/// A character as a receiver reads it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// The byte.
    pub byte: u8,
    /// The samples disagreed.
    pub noise: bool,
    /// The stop bit was low.
    pub framing: bool,
}

/// High between characters.
#[derive(Clone, Debug, Default)]
pub struct Line {
    chars: VecDeque<Char>,
}

impl Line {
    /// Adds characters.
    pub fn extend(&mut self, chars: impl IntoIterator<Item = Char>) {
        self.chars.extend(chars);
    }

    /// Characters still to come or to be forgotten.
    pub fn waiting(&self) -> usize {
        self.chars.len()
    }

    /// Discards past characters.
    pub fn forget(&mut self, before: Ps) {
        while self.chars.front().is_some_and(|char| char.end() <= before) {
            self.chars.pop_front();
        }
    }

    /// Next falling edge, at this moment or after it.
    pub fn falls(&self, from: Ps) -> Ps {
        for char in &self.chars {
            if char.start >= from {
                return char.start;
            }
            let bits = char.bits();
            for bit in 1..10 {
                let edge = char.start + bit * char.bit;
                if edge >= from && bits >> (bit - 1) & 1 == 1 && bits >> bit & 1 == 0 {
                    return edge;
                }
            }
        }
        NEVER
    }

    fn is_high(&self, at: Ps) -> bool {
        for char in &self.chars {
            if at < char.start {
                return true;
            }
            if at < char.end() {
                return char.bits() >> ((at - char.start) / char.bit) & 1 == 1;
            }
        }
        true
    }

    /// Read with bits of this length from its start bit; `None`: a glitch.
    pub fn sample(&self, edge: Ps, bit: Ps) -> Option<Seen> {
        let middle = |number: Ps| edge + number * bit + bit / 2;
        if self.is_high(middle(0)) {
            return None;
        }
        let byte = (0..8).map(|number| u8::from(self.is_high(middle(number + 1))) << number).sum();
        let flawed = |flaw| {
            self.chars
                .iter()
                .take_while(|char| char.start <= edge)
                .any(|char| char.flaw == flaw && char.end() > edge)
        };
        Some(Seen { byte, noise: flawed(Flaw::Noise), framing: !self.is_high(middle(9)) })
    }
}

/// Back to back from `start`; and the end.
pub fn chars(bytes: &[u8], start: Ps, baud: f64) -> (Vec<Char>, Ps) {
    let bit = (1e12 / baud) as Ps;
    let char_at = |(index, byte): (usize, &u8)| Char {
        start: start + index as Ps * 10 * bit,
        bit,
        byte: *byte,
        flaw: Flaw::None,
    };
    (bytes.iter().enumerate().map(char_at).collect(), start + bytes.len() as Ps * 10 * bit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn right(permille: f64) -> usize {
        let bytes: Vec<u8> = (0..=255).collect();
        let (chars, _) = chars(&bytes, 1_000, 921_600.0 * (1.0 + permille / 1_000.0));
        let mut line = Line::default();
        line.extend(chars);
        let bit = (1e12 / 921_600.0) as Ps;
        let (mut at, mut seen) = (0, Vec::new());
        loop {
            let edge = line.falls(at);
            if edge == NEVER {
                break;
            }
            at = edge + 9 * bit + bit / 2;
            seen.extend(line.sample(edge, bit).filter(|seen| !seen.framing).map(|seen| seen.byte));
        }
        bytes.iter().zip(&seen).take_while(|(sent, seen)| sent == seen).count()
    }

    #[test]
    fn a_receiver_stands_a_sender_that_is_five_percent_off() {
        // Sampled in the middle: half a bit in nine and a half is 5.3 %.
        for (permille, all) in [(0.0, true), (-40.0, true), (50.0, true), (-70.0, false), (70.0, false)] {
            assert_eq!(right(permille) == 256, all, "{permille}: {}", right(permille));
        }
    }
}
