//! Colours on a terminal, for the words that decide: levels and verdicts.
//!
//! A text is made with marks in it. [`crate::output`] prints colours in their place on a terminal with colours, and
//! nothing elsewhere. `NO_COLOR`, `CLICOLOR`, `CLICOLOR_FORCE` and `TERM=dumb` count, as in the crate `anstream`.
//! Marks are noncharacters, which Unicode reserves for a program's own use (The Unicode Standard, 23.7). In foreign
//! texts they are shown by their numbers ([`crate::printable::word`]).

use std::borrow::Cow;
use std::fmt;

use anstyle::{AnsiColor, Style};

/// The meaning of a word's colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    /// Something is badly wrong.
    Critical,
    /// Something is to be looked at.
    Warning,
    /// All is well.
    Good,
}

const END: char = '\u{fdd3}';

impl Colour {
    const ALL: [Self; 3] = [Self::Critical, Self::Warning, Self::Good];

    const fn mark(self) -> char {
        match self {
            Self::Critical => '\u{fdd0}',
            Self::Warning => '\u{fdd1}',
            Self::Good => '\u{fdd2}',
        }
    }

    const fn style(self) -> Style {
        match self {
            Self::Critical => AnsiColor::Red.on_default().bold(),
            Self::Warning => AnsiColor::Yellow.on_default(),
            Self::Good => AnsiColor::Green.on_default(),
        }
    }
}

/// Whether it is one of our marks.
pub const fn is_mark(c: char) -> bool {
    matches!(c, '\u{fdd0}'..=END)
}

/// A word in its colour; `{:<8}` pads it as it pads the word.
#[derive(Clone, Copy, Debug)]
pub struct Coloured<'a> {
    word: &'a str,
    colour: Option<Colour>,
}

impl fmt::Display for Coloured<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use fmt::Write as _;
        let Some(colour) = self.colour else { return f.pad(self.word) };
        f.write_char(colour.mark())?;
        f.pad(self.word)?;
        f.write_char(END)
    }
}

/// The word of a level or a verdict; one that is neither good nor bad has no colour.
pub fn level(word: &str) -> Coloured<'_> {
    let colour = match word {
        "critical" | "CRITICAL" | "FAILED" | "DUE" | "MISSING" => Some(Colour::Critical),
        "warning" | "damaged" | "unproved" | "rebuilt" | "soon" => Some(Colour::Warning),
        "ok" => Some(Colour::Good),
        _ => None,
    };
    Coloured { word, colour }
}

/// Words that say that something is to be looked at.
pub const fn warning(words: &str) -> Coloured<'_> {
    Coloured { word: words, colour: Some(Colour::Warning) }
}

/// The text with colours in the place of its marks, or without both.
pub fn shown(text: &str, in_colour: bool) -> Cow<'_, str> {
    if !text.contains(is_mark) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 64);
    for c in text.chars() {
        match Colour::ALL.into_iter().find(|colour| colour.mark() == c) {
            Some(colour) if in_colour => out.push_str(&colour.style().render().to_string()),
            None if c == END && in_colour => out.push_str(&anstyle::Reset.render().to_string()),
            None if c != END => out.push(c),
            Some(_) | None => {}
        }
    }
    out.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::printable;

    #[test]
    fn a_level_has_its_colour_on_a_terminal_and_is_plain_elsewhere() {
        let text = format!("[{:<8}] {:>4} {}", level("critical"), level("ok"), level("unknown"));
        assert_eq!(shown(&text, false), "[critical]   ok unknown");
        assert_eq!(
            shown(&text, true),
            "[\u{1b}[1m\u{1b}[31mcritical\u{1b}[0m] \u{1b}[32m  ok\u{1b}[0m unknown"
        );
    }

    #[test]
    fn words_of_the_world_have_no_colours() {
        let hostile = format!("{}a{END}", Colour::Good.mark());
        assert_eq!(printable::word(&hostile), "\\u{fdd2}a\\u{fdd3}");
        assert_eq!(printable::lines(&hostile), hostile, "lines are ours");
    }
}
