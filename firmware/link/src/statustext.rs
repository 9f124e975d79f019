//! `STATUSTEXT`: shown or spoken to the pilot.

use core::fmt::{self, Write as _};

/// Bytes of text in one message.
pub const TEXT_BYTES_MAX: usize = 50;

/// `MAV_SEVERITY`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Severity {
    /// Act now.
    Critical = 2,
    /// Act soon.
    Warning = 4,
    /// Worth knowing.
    Notice = 5,
    /// All is well again.
    Info = 6,
}

/// A text in assembly; it is cut at its limit.
#[derive(Clone, Debug, Default)]
pub struct Text(heapless::String<TEXT_BYTES_MAX>);

impl Text {
    /// Formats a text.
    pub fn new(arguments: fmt::Arguments<'_>) -> Self {
        let mut text = Self::default();
        // Cut when full: a text has 50 bytes.
        let _ = text.write_fmt(arguments);
        text
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            self.0.push(character).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_cut_at_fifty_bytes_between_characters() {
        let text = Text::new(format_args!("{}é", "a".repeat(49)));
        assert_eq!(text.as_str(), "a".repeat(49));
    }
}
