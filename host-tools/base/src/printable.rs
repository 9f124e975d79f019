//! Foreign texts on a terminal. A text from a log, a vehicle or a file's name may control a terminal: escape
//! sequences clear the screen or write elsewhere. Others change the reading of the text: after `U+202E`, which turns
//! the direction, `evil` looks like `live`. They are shown by their numbers, as `\u{1b}`.
//!
//! All printed text passes through here: standard output in [`crate::output`], standard error by `note!`.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

use crate::colour::is_mark;

/// Characters that change the direction of writing (Unicode 16, property `Bidi_Control`), and the two separators that end a
/// line.
pub const fn redirects(c: char) -> bool {
    matches!(
        c,
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}'
    )
}

/// Whether a character controls a terminal: C0, DEL, C1 (Unicode category Cc), and changes of writing direction.
fn is_obeyed(c: char) -> bool {
    c.is_control() || redirects(c)
}

/// A name, or words of the world: one line, without colours.
pub fn word(text: &str) -> Cow<'_, str> {
    escaped(text, |c| is_obeyed(c) || is_mark(c))
}

/// A path, as one line.
pub fn path(path: &Path) -> String {
    word(&path.to_string_lossy()).into_owned()
}

/// Lines of the program, with foreign texts in them.
pub fn lines(text: &str) -> Cow<'_, str> {
    escaped(text, |c| is_obeyed(c) && c != '\n')
}

/// A message. Its further lines are indented by two spaces; any other line break came with a foreign text.
pub fn message(text: &str) -> Cow<'_, str> {
    if !text.contains(|c| is_obeyed(c) || is_mark(c)) {
        return Cow::Borrowed(text);
    }
    text.split("\n  ").map(word).collect::<Vec<_>>().join("\n  ").into()
}

/// JSON with the same meaning: such characters occur inside of strings only, and are written there by their numbers.
pub fn json(text: &str) -> Cow<'_, str> {
    let is_meant = |c: char| (c > '\u{7e}' && c.is_control()) || redirects(c);
    rewritten(text, is_meant, |out, c| {
        let _ = write!(out, "\\u{:04x}", u32::from(c));
    })
}

fn escaped(text: &str, is_meant: impl Fn(char) -> bool) -> Cow<'_, str> {
    rewritten(text, is_meant, |out, c| out.extend(c.escape_unicode()))
}

/// The text, with `write` in the place of each character that is meant.
pub fn rewritten(
    text: &str,
    is_meant: impl Fn(char) -> bool,
    write: impl Fn(&mut String, char),
) -> Cow<'_, str> {
    if !text.contains(&is_meant) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 64);
    for c in text.chars() {
        if is_meant(c) {
            write(&mut out, c);
        } else {
            out.push(c);
        }
    }
    out.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_obeys_is_shown_by_its_number_and_all_else_stays() {
        assert_eq!(word("a\u{1b}[2Jb\n\u{9b}31m\u{7f}"), "a\\u{1b}[2Jb\\u{a}\\u{9b}31m\\u{7f}");
        assert_eq!(word("rtl\u{202e}evil\u{2069}"), "rtl\\u{202e}evil\\u{2069}");
        assert_eq!(lines("one\n\ttwo"), "one\n\\u{9}two");
        for plain in ["Grüße \u{5d0}\u{644} <b> \\ 👩‍✈️", ""] {
            assert_eq!(word(plain), plain);
        }
    }

    #[test]
    fn a_name_with_a_line_end_makes_no_line_of_a_message() {
        assert_eq!(message("a\nhums: all is well: no"), "a\\u{a}hums: all is well: no");
        assert_eq!(
            message("none is in there\n  a\u{1b}: passed over"),
            "none is in there\n  a\\u{1b}: passed over"
        );
    }

    #[test]
    fn json_is_the_same_to_its_reader() {
        let value = serde_json::json!({"name": "a\u{1b}\u{9b}\u{202e}\u{7f}\n\"é"});
        let text = value.to_string();
        let shown = json(&text);
        assert!(!shown.contains(is_obeyed), "{shown}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).expect("JSON"), value);
    }
}
