//! The monitor's requests to storage about a log, and the answers.

use hums_recorder::LogName;

/// Bytes of a log in one answer.
pub const DATA_MAX: usize = 240;
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
pub enum RequestedPart {
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
pub enum RequestedLog {
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
pub struct LogRequest {
    /// Tells answers from earlier ones.
    pub ticket: u16,
    /// The log.
    pub which: RequestedLog,
    /// The part.
    pub what: RequestedPart,
}

/// Reasons for an answer without a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoLog {
    /// The log does not exist.
    Absent,
    /// The card could not read the log or the directory: nothing is known.
    Unread,
}

/// Storage's answer, without its data.
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
}
