//! The definition in an FMT message.

use super::format::{FMT_TYPE, Format, Role};
use super::message::Message;

/// 64 characters in a binary log; a text log may have been made of several.
const DEFINITION_CHARACTERS_MAX: usize = 256;

pub(super) fn definition(message: &Message<'_>) -> Option<Format> {
    let format = message.format();
    if format.role != Role::Fmt {
        return None;
    }
    // Lacks its last column's name.
    let columns = words(message, "Columns")
        .or_else(|| message.text(4).map(|words| shortened(&words)))
        .unwrap_or_default();
    let (kind, length) = (byte(message, "Type")?, byte(message, "Length")?);
    // Lines have no length.
    let length = if message.is_words() && kind != FMT_TYPE { 0 } else { length };
    let (name, characters) = (words(message, "Name")?, words(message, "Format")?);
    Some(Format::new(kind, length, &name, characters.as_bytes(), &columns))
}

/// A log begins with it.
pub(super) fn is_of_itself(message: &Message<'_>) -> bool {
    message.format().role == Role::Fmt && message.unsigned(0) == Some(FMT_TYPE.into())
}

/// Characters are signed in the file.
pub(super) fn byte(message: &Message<'_>, name: &str) -> Option<u8> {
    let number = message.signed(message.format().field(name)?)?;
    u8::try_from(number).or_else(|_| i8::try_from(number).map(|number| number as u8)).ok()
}

/// Cut at a binary definition's length: lines may be of any length.
pub(super) fn words(message: &Message<'_>, name: &str) -> Option<String> {
    message.text(message.format().field(name)?).map(|words| shortened(&words))
}

fn shortened(words: &str) -> String {
    words.chars().take(DEFINITION_CHARACTERS_MAX).collect()
}
