//! Four words at the end of memory, which survive a reset: the application asks the resident program for an installation, and the
//! resident program reports the result. After a power-on they are anything.

use crate::header::Refusal;

/// What one program has for the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message {
    /// Install the update file.
    Install,
    /// It is installed and on trial.
    Installed,
    /// It was not installed.
    Refused {
        /// Of the image, or 0.
        id: u32,
        /// The reason.
        why: Refusal,
    },
    /// The application failed on trial, and the one before it is back.
    FellBack,
    /// The application failed on trial, and gets another one because a person switched power on.
    Retried,
}

/// First word of every message.
const MARK: u32 = 0x5550_4454;

impl Message {
    /// Its words.
    pub fn words(self) -> [u32; 4] {
        let (kind, id) = match self {
            Self::Install => (1, 0),
            Self::Installed => (2, 0),
            Self::FellBack => (3, 0),
            Self::Retried => (4, 0),
            Self::Refused { id, why } => (0x10 + why as u32, id),
        };
        [MARK, kind, id, sum(kind, id)]
    }

    /// Of these words; `None` for any others.
    pub fn of(words: [u32; 4]) -> Option<Self> {
        let [mark, kind, id, check] = words;
        if mark != MARK || check != sum(kind, id) {
            return None;
        }
        match kind {
            1 => Some(Self::Install),
            2 => Some(Self::Installed),
            3 => Some(Self::FellBack),
            4 => Some(Self::Retried),
            _ => {
                let why = *Refusal::ALL.get(kind.checked_sub(0x10)? as usize)?;
                Some(Self::Refused { id, why })
            }
        }
    }
}

fn sum(kind: u32, id: u32) -> u32 {
    !(MARK.rotate_left(7) ^ kind.wrapping_mul(0x9E37_79B9) ^ id.rotate_left(13))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_comes_as_it_went_and_a_changed_bit_makes_it_none() {
        let refusals = Refusal::ALL.map(|why| Message::Refused { id: 0x1234_5678, why });
        let others = [Message::Install, Message::Installed, Message::FellBack, Message::Retried];
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
