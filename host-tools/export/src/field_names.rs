//! The name of a field in an output with names of its own.

use std::borrow::Cow;

/// A field's name, with `_field` appended if `taken` has that name already. This is the rule of all outputs,
/// so a message's `session` is `session_field` in the line protocol as in Parquet.
pub(super) fn free_name<'a>(name: &'a str, taken: &[&str]) -> Cow<'a, str> {
    if taken.contains(&name) { Cow::Owned(format!("{name}_field")) } else { Cow::Borrowed(name) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{influx, parquet};

    #[test]
    fn only_a_name_that_is_taken_changes() {
        assert_eq!(free_name("session", &["utc", "session"]), "session_field");
        assert_eq!(free_name("sessions", &["utc", "session"]), "sessions");
    }

    #[test]
    fn what_a_free_name_becomes_is_no_name_of_the_same_message() {
        let messages = hums_dialect::messages();
        let mut renamed = 0;
        for message in messages {
            for taken in [influx::TAKEN.as_slice(), parquet::TAKEN_FRAMES.as_slice()] {
                for field in message.fields {
                    let name = free_name(field.name, taken);
                    renamed += u32::from(name != field.name);
                    let others = message.fields.iter().filter(|other| other.name != field.name);
                    assert!(others.into_iter().all(|other| other.name != name), "{}", message.name);
                }
            }
        }
        assert!(renamed > 0, "some message has such a field");
    }
}
