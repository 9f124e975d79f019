//! How much of a log is in an output: what `--replace` goes by, because a damaged copy may make a larger file.

use std::fmt;
use std::path::Path;

use crate::outcome::Differs;
use crate::plural::count;

/// How much of a log is in an output. What has a place for it says so: a page in its head, a folder in its stamp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Amount {
    /// Frames, and records of what recorded it.
    pub entries: u64,
    /// Gaps that are damage.
    pub gaps: u64,
}

impl fmt::Display for Amount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {}", count(self.entries, "entry"), count(self.gaps, "gap"))
    }
}

impl Amount {
    /// Reads what [`fmt::Display`] writes.
    pub fn parse(text: &str) -> Option<Self> {
        let (entries, gaps) = text.split_once(", ")?;
        let number = |words: &str| words.split(' ').next()?.parse().ok();
        let amount = Self { entries: number(entries)?, gaps: number(gaps)? };
        (amount.to_string() == text).then_some(amount)
    }
}

/// An output by what is in it, as far as that is known, and by its length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Content {
    pub(super) amount: Option<Amount>,
    pub(super) bytes: u64,
}

impl Content {
    /// Refuses to put less, or anything with more gaps, in the place of what is `there`. Where nothing tells what that has,
    /// its length counts, and what is damaged takes its place in no case.
    pub(super) fn check_replaces(self, there: Self, path: &Path) -> Result<(), Differs> {
        let refused = |there: &dyn fmt::Display, new: &dyn fmt::Display| {
            Err(Differs::less(path, there.to_string(), new.to_string()))
        };
        match (there.amount, self.amount) {
            (Some(old), Some(new)) if new.entries < old.entries || new.gaps > old.gaps => refused(&old, &new),
            (Some(old), Some(new)) if new != old => Ok(()),
            (None, Some(new)) if new.gaps > 0 => refused(&"nothing tells of gaps", &new),
            _ if self.bytes < there.bytes => {
                let bytes = |content: Self| count(content.bytes, "byte");
                refused(&bytes(there), &bytes(self))
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_replaced_by_less_of_it_or_by_what_is_damaged() {
        let of = |entries, gaps, bytes| Content { amount: Some(Amount { entries, gaps }), bytes };
        let unknown = |bytes| Content { amount: None, bytes };
        let replaces = |new: Content, there: Content| new.check_replaces(there, Path::new("a file")).is_ok();
        // A table of gaps makes it longer.
        assert!(!replaces(of(99, 1, 1100), of(100, 0, 1000)));
        assert!(!replaces(of(200, 1, 2000), of(100, 0, 1000)), "damage that was not there");
        assert!(replaces(of(100, 0, 900), of(99, 1, 1000)));
        assert!(replaces(of(100, 1, 1000), of(100, 1, 1000)) && !replaces(of(100, 0, 999), of(100, 0, 1000)));
        assert!(replaces(of(5, 0, 10), unknown(10)) && !replaces(of(5, 0, 9), unknown(10)));
        assert!(!replaces(of(5, 1, 11), unknown(10)));
        assert!(replaces(unknown(10), of(5, 0, 10)) && !replaces(unknown(9), of(5, 0, 10)));
        for (amount, words) in [
            (Amount { entries: 10_414, gaps: 1 }, "10414 entries, 1 gap"),
            (Amount { entries: 1, gaps: 2 }, "1 entry, 2 gaps"),
        ] {
            assert_eq!((amount.to_string().as_str(), Amount::parse(words)), (words, Some(amount)));
        }
        for words in ["10414 entries", "10414 entries, 1 gaps", "10414 entries, 1 gap, 3"] {
            assert_eq!(Amount::parse(words), None, "{words}");
        }
    }
}
