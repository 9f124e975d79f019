//! The monitor's requests to storage about a log, and the answers.

use hums_recorder::LogName;

/// Bytes of a log in one answer.
pub const DATA_MAX: usize = 240;
/// Bytes of an answer's head.
pub(super) const HEAD: usize = 36;
/// The identity of a log, independent of the card's directory: another log of the same name differs in the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogId {
    /// Its name.
    pub name: LogName,
    /// Session of its first sector, random; 0 if unreadable.
    pub session: u32,
    /// Its first sector's number in the session.
    pub first: u32,
}

impl LogId {
    /// Stands for no log.
    pub const NONE: Self = Self { name: LogName { session: 0, segment: 0 }, session: 0, first: 0 };
}

/// The requested part of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// Its length.
    Length,
    /// Bytes from an offset on.
    Data(u32),
    /// The checksum of the first bytes (`hums_link::ftp::checksum`), at most of all; 0 is all.
    Checksum(u32),
    /// An erase: all earlier logs are hidden, and overwritten first. It has no answer.
    Erase,
}

/// A log, or the file of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// By its place in the directory, from 0; erased ones left out.
    At(u16),
    /// By its name.
    Named(LogName),
    /// This log and no other.
    Same(LogId),
    /// No log: the file of parameters, `PARAMS.TXT`.
    Settings,
}

/// A request; the ticket comes back with the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Want {
    /// Tells answers from earlier ones.
    pub ticket: u16,
    /// The log.
    pub which: Which,
    /// The part.
    pub what: What,
}

/// Reasons for an answer without a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoLog {
    /// The log does not exist.
    Absent,
    /// The card could not read the log or the directory: nothing is known.
    Unread,
}

/// Outcomes in an answer's head.
const FOUND: u16 = 0;
const ABSENT: u16 = 1;
const UNREAD: u16 = 2;

/// Head of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The request's ticket.
    pub ticket: u16,
    /// 0 also without a card, and if the directory was unreadable.
    pub count: u16,
    /// Whether the log was found.
    pub found: Result<(), NoLog>,
    /// The log's identity.
    pub log: LogId,
    /// The log's length in bytes.
    pub bytes: u32,
    /// Time of its last write by its directory entry, in seconds since 1970 UTC; 0: unknown.
    pub utc_secs: u32,
    /// Offset of the data in the log; for a checksum, the number of summed bytes.
    pub offset: u32,
    /// A number that changes with the names in the directory: a place then means another log.
    pub directory: u32,
}

impl Answer {
    pub(super) const fn none(ticket: u16) -> Self {
        let found = Err(NoLog::Absent);
        Self { ticket, count: 0, found, log: LogId::NONE, bytes: 0, utc_secs: 0, offset: 0, directory: 0 }
    }

    pub(super) const fn without(self, why: NoLog) -> Self {
        Self { found: Err(why), bytes: 0, ..self }
    }

    pub(super) fn write(&self) -> [u8; HEAD] {
        let mut head = [0; HEAD];
        head[..2].copy_from_slice(&self.ticket.to_le_bytes());
        head[2..4].copy_from_slice(&self.count.to_le_bytes());
        let found = match self.found {
            Ok(()) => FOUND,
            Err(NoLog::Absent) => ABSENT,
            Err(NoLog::Unread) => UNREAD,
        };
        head[4..6].copy_from_slice(&found.to_le_bytes());
        head[6] = self.log.name.segment as u8;
        let words = [
            self.log.name.session,
            self.bytes,
            self.offset,
            self.log.session,
            self.log.first,
            self.directory,
            self.utc_secs,
        ];
        for (to, word) in head[8..].chunks_exact_mut(4).zip(words) {
            to.copy_from_slice(&word.to_le_bytes());
        }
        head
    }

    pub(super) fn read(head: &[u8; HEAD]) -> Self {
        let u16_at = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
        let word = |index: usize| {
            let at = 8 + 4 * index;
            u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]])
        };
        let name = LogName { session: word(0), segment: u32::from(head[6]) };
        Self {
            ticket: u16_at(0),
            count: u16_at(2),
            found: match u16_at(4) {
                FOUND => Ok(()),
                UNREAD => Err(NoLog::Unread),
                _ => Err(NoLog::Absent),
            },
            log: LogId { name, session: word(3), first: word(4) },
            bytes: word(1),
            offset: word(2),
            directory: word(5),
            utc_secs: word(6),
        }
    }
}
