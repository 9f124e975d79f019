//! JSON for the pages, safe against texts that change the display of their surroundings.
//!
//! A vehicle's texts may hold Unicode's bidirectional controls. U+202E reverses the text after it, so that
//! `evil` looks like `live`. In JSON they occur only inside of strings; there they are replaced by their
//! name, as `<U+202E>`. The record keeps them unchanged.

use std::fmt::Write as _;

use serde::Serialize;

use crate::printable::{redirects, rewritten};

/// Most texts fit in this: they are made many times a second.
const ROOM_BYTES: usize = 4_096;

/// A value as JSON for a `script` element, without ending or beginning one. `<`, `>` and `&` occur in strings
/// only, where an escape is the same; the two line separators are not valid in JavaScript.
pub fn embedded(value: &impl Serialize) -> String {
    rewritten(
        &json(value),
        |c| matches!(c, '<' | '>' | '&' | '\u{2028}' | '\u{2029}'),
        |out, c| {
            let _ = write!(out, "\\u{:04x}", u32::from(c));
        },
    )
    .into_owned()
}

/// A value as JSON; empty if it has no form in JSON, which does not occur for the types of the pages.
pub fn json(value: &impl Serialize) -> String {
    let mut text = Vec::with_capacity(ROOM_BYTES);
    let text = match serde_json::to_writer(&mut text, value) {
        Ok(()) => String::from_utf8(text).unwrap_or_default(),
        Err(_) => String::new(),
    };
    // None of them is in ASCII, and nearly all text is. That check takes many bytes at a time.
    if text.is_ascii() {
        return text;
    }
    rewritten(&text, redirects, |out, c| {
        let _ = write!(out, "<U+{:04X}>", u32::from(c));
    })
    .into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_of_the_writing_direction_are_named_and_all_else_stays() {
        assert_eq!(json(&"rtl\u{202e}evil\u{2069}\u{61c}"), "\"rtl<U+202E>evil<U+2069><U+061C>\"");
        let hostile = "</script><script>alert(1)</script><!-- &";
        let inside = embedded(&hostile);
        assert!(!inside.contains(['<', '>', '&']), "{inside}");
        assert_eq!(serde_json::from_str::<String>(&inside).expect("JSON"), hostile);
        for plain in ["Grüße \u{5d0}\u{644} <b> \\ 👩‍✈️", ""] {
            assert_eq!(json(&plain), serde_json::to_string(plain).expect("text"));
        }
    }
}
