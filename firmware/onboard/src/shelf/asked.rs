//! What the monitor asks of storage about a log, and what it is answered.

use hums_recorder::LogName;

/// Bytes of a log in one answer.
pub const DATA_MAX: usize = 240;
/// What an answer's head takes.
pub(super) const HEAD: usize = 36;
/// Which log it is, whatever happens to the card's directory: another one of the same name differs in the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogId {
    /// Its name.
    pub name: LogName,
    /// The session of its first sector, a random number; 0 where that cannot be read.
    pub session: u32,
    /// Its first sector's number in the session.
    pub first: u32,
}

impl LogId {
    /// Of a log that is not there.
    pub const NONE: Self = Self { name: LogName { session: 0, segment: 0 }, session: 0, first: 0 };
}

/// What is wanted of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// How long it is.
    Length,
    /// Bytes from an offset on.
    Data(u32),
    /// The checksum of the first so many bytes (`hums_link::ftp::checksum`), at most of all; 0 is all.
    Checksum(u32),
    /// That all earlier logs are no longer offered, and make room first. Not answered.
    Erase,
}

/// A log, or the file of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// By its place in the directory, from 0; erased ones left out.
    At(u16),
    /// By its name.
    Named(LogName),
    /// This one and no other.
    Same(LogId),
    /// No log: the file of parameters, `PARAMS.TXT`.
    Settings,
}

/// Something wanted; the ticket comes back with the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Want {
    /// Tells answers to this from answers to an earlier one.
    pub ticket: u16,
    /// Of which log.
    pub which: Which,
    /// What.
    pub what: What,
}

/// Why an answer is of no log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoLog {
    /// There is no such log.
    Absent,
    /// The card did not give it, or not the directory: nothing is known of it, also not that nothing is in it.
    Unread,
}

/// What an answer's head has for each outcome.
const FOUND: u16 = 0;
const ABSENT: u16 = 1;
const UNREAD: u16 = 2;

/// What storage answers, without the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The want's.
    pub ticket: u16,
    /// How many logs there are; 0 also where there is no card, and where the card did not give the directory.
    pub count: u16,
    /// Whether the log was found.
    pub found: Result<(), NoLog>,
    /// Which log it is.
    pub log: LogId,
    /// The log's length in bytes.
    pub bytes: u32,
    /// When it was written last by its directory entry, in seconds since 1970 UTC; 0: not known.
    pub utc_secs: u32,
    /// Where the data lies in the log; with a checksum, how many bytes it is of.
    pub offset: u32,
    /// Changes with the names in the directory: a place means another log then.
    pub directory: u32,
}

impl Answer {
    /// That there is no such log.
    pub(super) const fn none(ticket: u16) -> Self {
        let found = Err(NoLog::Absent);
        Self { ticket, count: 0, found, log: LogId::NONE, bytes: 0, utc_secs: 0, offset: 0, directory: 0 }
    }

    /// The same of no log.
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
