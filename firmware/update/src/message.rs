//! Four words at the end of memory, which survive a reset: the application asks the resident program for an installation, and the
//! resident program reports the result. After a power-on they are anything.

use crate::header::Refusal;

/// A message of one program to the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message {
    /// Install the update file.
    Install,
    /// A restart that is no fault of the application: low voltage, the card reader, an end of the log.
    Planned,
    /// It is installed and on trial.
    Installed,
    /// It was not installed.
    Refused(Refusal),
    /// The application failed on trial, and the one before it is back.
    FellBack,
    /// The application failed on trial, and gets another one: the card has nothing else.
    Retried,
}

const MARK: u32 = 0x5550_4454;

impl Message {
    /// Its words.
    pub fn words(self) -> [u32; 4] {
        let kind = match self {
            Self::Install => 1,
            Self::Installed => 2,
            Self::FellBack => 3,
            Self::Retried => 4,
            Self::Planned => 5,
            Self::Refused(why) => 0x10 + why as u32,
        };
        [MARK, kind, 0, sum(kind)]
    }

    /// Reads these words; `None` for any others.
    pub fn of(words: [u32; 4]) -> Option<Self> {
        let [mark, kind, none, check] = words;
        if mark != MARK || none != 0 || check != sum(kind) {
            return None;
        }
        match kind {
            1 => Some(Self::Install),
            2 => Some(Self::Installed),
            3 => Some(Self::FellBack),
            4 => Some(Self::Retried),
            5 => Some(Self::Planned),
            _ => Refusal::ALL.get(kind.checked_sub(0x10)? as usize).copied().map(Self::Refused),
        }
    }
}

fn sum(kind: u32) -> u32 {
    !(MARK.rotate_left(7) ^ kind.wrapping_mul(0x9E37_79B9))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_comes_as_it_went_and_a_changed_bit_makes_it_none() {
        let refusals = Refusal::ALL.map(Message::Refused);
        let others =
            [Message::Install, Message::Installed, Message::FellBack, Message::Retried, Message::Planned];
        for message in others.into_iter().chain(refusals) {
            assert_eq!(Message::of(message.words()), Some(message));
            for bit in 0..128 {
                let mut words = message.words();
                words[bit / 32] ^= 1 << (bit % 32);
                assert_eq!(Message::of(words), None, "{message:?}, bit {bit}");
            }
        }
        assert_eq!(Message::of([0; 4]), None);
    }
}
