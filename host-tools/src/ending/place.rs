//! A log's place among the logs of its card: what its boot record and its sectors' numbers say against its name.

use std::path::Path;

use crate::hex::hex;
use crate::logs::board::Board;
use crate::logs::naming::segment_or_part;
use crate::logs::sessions::copy_words;
use crate::plural::count;

/// A log whose files have another session's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misnamed {
    /// The same session is there under this lower number.
    Copy {
        /// The number.
        of: u32,
    },
    /// It was recorded after the session of this number, which is its own or a higher one.
    Later {
        /// The number.
        before: u32,
    },
    /// It was the first session on its card.
    First,
    /// It was packed on a PC, and lies among a card's logs.
    Packed,
    /// The session of this number was recorded just before it, so its own number is the next one.
    Ahead {
        /// The number.
        before: u32,
    },
    /// A file's name tells another session than its sectors.
    Session {
        /// As the name tells.
        named: u32,
        /// As the sectors tell.
        own: u32,
    },
    /// A file's name tells another box than the log's boot record.
    Board {
        /// As the name tells.
        named: Board,
        /// As the record tells.
        own: Board,
    },
}

impl Misnamed {
    /// What a file's name tells, of a log that a box with this id recorded, that is not so.
    pub fn of_name(file: &str, session: u32, board: Option<Board>) -> Option<Self> {
        let name = segment_or_part(Path::new(file))?;
        if let Some(named) = name.named_session().filter(|named| *named != session) {
            return Some(Self::Session { named, own: session });
        }
        let (named, own) = name.named_board().zip(board)?;
        (named != own).then_some(Self::Board { named, own })
    }

    /// What disagrees, as a part of a sentence.
    pub fn words(self) -> String {
        match self {
            Self::Copy { of } => format!("it {}", copy_words(of)),
            Self::Later { before } => format!(
                "it was recorded after session {before:05}, so its number is not its own: files were renamed or exchanged"
            ),
            Self::First => {
                "it was the first session on its card, so its number is not its own: files were renamed"
                    .to_owned()
            }
            Self::Packed => {
                "it was packed on a PC, so it is no log of the card and its number is not its own".to_owned()
            }
            Self::Ahead { before } => format!(
                "it was recorded just after session {before:05}, so its number is not its own: files were renamed"
            ),
            Self::Session { named, own } => format!(
                "its name tells session {named:08x}, and its sectors are of session {own:08x}: files were renamed or exchanged"
            ),
            Self::Board { named, own } => format!(
                "its name tells box {}, and box {} recorded it: files were renamed or exchanged",
                hex(&named),
                hex(&own)
            ),
        }
    }
}

/// The session that was recorded on a card just before a log, as the log's boot record names it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SessionBefore {
    /// No boot record names one.
    #[default]
    NotNamed,
    /// It was read too.
    There,
    /// It is not among what was read, and nothing tells that it should be: the oldest logs make room for new ones.
    NotLookedFor(u32),
    /// It is not there, and an older log of the card is; or its files hold another session.
    Gone(u32),
    /// It is there under another number: files were renamed or exchanged.
    Elsewhere {
        /// Its number.
        number: u32,
        /// The number under which it is there.
        there: u32,
    },
}

impl SessionBefore {
    /// What is missing, as a part of a sentence.
    pub fn gone(self) -> Option<String> {
        match self {
            Self::Gone(number) => Some(format!(
                "session {number:05}, which was recorded just before it, is not there under that number"
            )),
            Self::Elsewhere { number, there } => Some(format!(
                "session {number:05}, which was recorded just before it, is there under the name {there:05}: files were \
                 renamed or exchanged"
            )),
            Self::NotNamed | Self::There | Self::NotLookedFor(_) => None,
        }
    }
}

/// How a log follows the one before it of the same power-on. A vehicle that is recorded by arming has several logs of a
/// power-on, whose sectors are numbered on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PowerOn {
    /// It is the first one, or nothing tells.
    #[default]
    First,
    /// It goes on where the one before it ends.
    Follows,
    /// It is not the first one, and the ones before are not among what was read. Nothing tells that they should be: the
    /// oldest logs make room for new ones.
    NotRead,
    /// Logs that were recorded before it are not there.
    Missing {
        /// The number of the last one that is there, if one is.
        after: Option<u32>,
        /// Sectors that were recorded meanwhile. Of those of a vehicle that waited disarmed not all were kept.
        sectors: u32,
        /// Frames until it begins.
        frames: Option<u32>,
        /// Seconds until it begins.
        seconds: Option<f64>,
    },
    /// No sector is missing between it and the log of this number, and its own number is not the next one.
    Renamed {
        /// The number.
        after: u32,
    },
    /// Its sectors were recorded before the end of the log of this lower number.
    Disordered {
        /// The number.
        after: u32,
    },
}

impl PowerOn {
    /// What is wrong, as a part of a sentence.
    pub fn wrong(self) -> Option<String> {
        match self {
            Self::First | Self::Follows | Self::NotRead => None,
            Self::Missing { after, sectors, frames, seconds } => {
                let after = after.map_or_else(String::new, |after| format!(" after session {after:05}"));
                let frames =
                    frames.map_or_else(String::new, |frames| format!(", {}", count(frames, "frame")));
                let seconds = seconds.map_or_else(String::new, |seconds| format!(", {seconds:.1} s"));
                Some(format!(
                    "what was recorded just before it{after} in the same power-on is not there: up to {}{frames}{seconds}",
                    count(sectors, "sector")
                ))
            }
            Self::Renamed { after } => Some(format!(
                "it goes on where session {after:05} of the same power-on ends, so its number is not its own: files were \
                 renamed"
            )),
            Self::Disordered { after } => Some(format!(
                "its sectors were recorded before the end of session {after:05} of the same power-on: files were renamed, \
                 exchanged or copied"
            )),
        }
    }

    /// What there is to say where nothing is wrong.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Follows => "it goes on where the one before it ends",
            Self::NotRead => "the logs before it are not among what was read",
            _ => "",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_held_against_the_session_and_the_box_where_both_are_known() {
        let (session, board) = (0x1a2b_3c4d, [0x3f; 12]);
        let misnamed = |file: &str, board| Misnamed::of_name(file, session, board);
        let box_named = "00001-box3f3f3f3f3f3f3f3f3f3f3f3f-s1a2b3c4d_00.HUM";
        assert_eq!(misnamed(box_named, Some(board)), None);
        assert_eq!(misnamed(box_named, None), None, "nothing tells which box it was");
        assert_eq!(misnamed("00001_00.HUM", Some(board)), None);
        let other = Misnamed::Board { named: board, own: [7; 12] };
        assert_eq!(misnamed(box_named, Some([7; 12])), Some(other));
        assert!(other.words().starts_with("its name tells box 3f3f3f3f3f3f3f3f3f3f3f3f, and box 0707"));
        let other = Misnamed::Session { named: 7, own: session };
        assert_eq!(misnamed("00001-s00000007_00.HUM", Some(board)), Some(other));
    }
}
