//! File names of log segments: `00042_07.HUM` is segment 7 of session 42. Every FAT reader shows eight characters and
//! three unaltered, and file managers sort them by age.

use core::fmt;

pub(crate) const EXTENSION: &str = "HUM";

/// The name of one segment of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LogName {
    /// The session's number on this card, 1 to [`LogName::SESSION_MAX`]; counts up with each power-on.
    pub session: u32,
    /// The segment within the session, 0 to [`LogName::SEGMENT_MAX`].
    pub segment: u32,
}

impl LogName {
    /// The largest session number: ten power-ons a day for 27 years.
    pub const SESSION_MAX: u32 = 99_999;
    /// The largest segment number of a session; the session goes on under the next session number.
    pub const SEGMENT_MAX: u32 = 99;
    /// Bytes of a name in a directory entry.
    pub const SHORT_BYTES: usize = 11;

    pub(crate) const fn next_segment(self) -> Option<Self> {
        if self.segment < Self::SEGMENT_MAX {
            Some(Self { session: self.session, segment: self.segment + 1 })
        } else {
            self.next_session()
        }
    }

    pub(crate) const fn next_session(self) -> Option<Self> {
        if self.session < Self::SESSION_MAX {
            Some(Self { session: self.session + 1, segment: 0 })
        } else {
            None
        }
    }

    /// The name in a directory entry, without the dot.
    pub fn short(self) -> [u8; Self::SHORT_BYTES] {
        let mut short = *b"00000_00HUM";
        let digits = |value: u32, place: u32| b'0' + (value / 10_u32.pow(place) % 10) as u8;
        for (index, byte) in short[..5].iter_mut().enumerate() {
            *byte = digits(self.session, 4 - index as u32);
        }
        short[6] = digits(self.segment, 1);
        short[7] = digits(self.segment, 0);
        short
    }

    /// `None` for a foreign file.
    pub fn from_short(base: &[u8], extension: &[u8]) -> Option<Self> {
        let (session, segment) = match base {
            [session @ .., b'_', tens, units] if session.len() == 5 => (session, [*tens, *units]),
            _ => return None,
        };
        let number = |digits: &[u8]| {
            digits.iter().try_fold(0_u32, |value, digit| {
                digit.is_ascii_digit().then(|| value * 10 + u32::from(digit - b'0'))
            })
        };
        if extension != EXTENSION.as_bytes() {
            return None;
        }
        let name = Self { session: number(session)?, segment: number(&segment)? };
        (name.session > 0).then_some(name)
    }
}

impl fmt::Display for LogName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:05}_{:02}.{EXTENSION}", self.session, self.segment)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_reads_back() {
        for name in [LogName { session: 1, segment: 0 }, LogName { session: 99_999, segment: 99 }] {
            let short = name.short();
            assert_eq!(LogName::from_short(&short[..8], &short[8..]), Some(name));
            assert_eq!(name.to_string().replace('.', "").as_bytes(), short);
        }
    }

    #[test]
    fn other_files_are_not_ours() {
        for (base, extension) in
            [("00042_07", "TXT"), ("0042_07", "HUM"), ("A0042_07", "HUM"), ("00000_00", "HUM"), ("", "HUM")]
        {
            assert_eq!(
                LogName::from_short(base.as_bytes(), extension.as_bytes()),
                None,
                "{base}.{extension}"
            );
        }
    }

    #[test]
    fn numbers_end_instead_of_wrapping() {
        let last = LogName { session: LogName::SESSION_MAX, segment: LogName::SEGMENT_MAX };
        assert_eq!(last.next_segment(), None);
        let full = LogName { session: 7, segment: LogName::SEGMENT_MAX };
        assert_eq!(full.next_segment(), Some(LogName { session: 8, segment: 0 }));
    }
}
