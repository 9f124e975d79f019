//! Logs as files over MAVLink FTP (<https://mavlink.io/en/services/ftp.html>): list, open, read, burst, checksum.
//!
//! An open file is a log and not a name. Once the log is overwritten, or the card is changed, requests for it get an
//! error. Files that the firmware holds ([`super::builtin`]) are opened by their names, are in no list, and need
//! nothing of the card.

use core::fmt::Write as _;

use hums_link::ftp::{self, Error, Operation};
use hums_link::request::Reply;
use hums_recorder::LogName;

use super::builtin::BuiltinFile;
use super::step::{JobOut, JobStep};
use crate::shelf::{Answer, LogId, NoLog, RequestedLog, RequestedPart};

/// Bytes of one burst, in messages of the longest data. The client then asks for the next one, so a client that has
/// gone does not get a whole log.
const BURST_BYTES: u32 = 64 * ftp::DATA_MAX as u32;

/// The open file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Open {
    Log(LogId),
    Builtin(BuiltinFile),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Job {
    reply: ftp::FtpReply,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Say(Option<Error>),
    /// One entry of the directory, by place.
    List(u16),
    Open(LogName),
    /// Length or checksum of a file that the firmware holds.
    Number(u32),
    Read {
        of: Open,
        size: u8,
    },
    Burst {
        of: Open,
        size: u8,
        left: u32,
    },
    /// Of the first `bytes`; 0 is all.
    Checksum {
        name: LogName,
        bytes: u32,
        sum: Option<u32>,
    },
}

impl Job {
    pub(super) fn new(asked: &ftp::FtpRequest<'_>, open: &mut Option<Open>) -> Self {
        let mut reply = ftp::FtpReply::to(asked);
        let kind = match asked.operation {
            Operation::None => Kind::Say(None),
            Operation::End => {
                *open = None;
                Kind::Say(None)
            }
            Operation::List("" | "/" | "." | "/." | "/logs" | "@MAV_LOG" | "@MAV_LOG/", offset) => {
                Kind::List(offset.min(u32::from(u16::MAX)) as u16)
            }
            Operation::List(..) => Kind::Say(Some(Error::FileNotFound)),
            Operation::Open(path) => {
                let builtin = BuiltinFile::named(path);
                *open = builtin.map(Open::Builtin);
                match (builtin, name(path)) {
                    (Some(builtin), _) => Kind::Number(builtin.bytes().len() as u32),
                    (None, Some(name)) => Kind::Open(name),
                    (None, None) => Kind::Say(Some(Error::FileNotFound)),
                }
            }
            Operation::Checksum(path, bytes) => match (BuiltinFile::named(path), name(path)) {
                (Some(builtin), _) => {
                    // The checksum of all of it, even if a part is requested.
                    reply.offset = builtin.bytes().len() as u32;
                    Kind::Number(builtin.crc())
                }
                (None, Some(name)) => Kind::Checksum { name, bytes, sum: None },
                (None, None) => Kind::Say(Some(Error::FileNotFound)),
            },
            Operation::Read(offset, size) | Operation::Burst(offset, size) => {
                reply.offset = offset;
                match *open {
                    Some(of) if asked.opcode == ftp::BURST => Kind::Burst { of, size, left: BURST_BYTES },
                    Some(of) => Kind::Read { of, size },
                    None => Kind::Say(Some(Error::InvalidSession)),
                }
            }
            Operation::Write => Kind::Say(Some(Error::FileProtected)),
            Operation::Unknown => Kind::Say(Some(Error::UnknownCommand)),
        };
        Self { reply, kind }
    }

    /// Whether `other` requests the same checksum, which may take seconds: the running computation then answers this
    /// request.
    pub(super) fn takes_over(&mut self, other: &Self) -> bool {
        let wanted = |kind: Kind| match kind {
            Kind::Checksum { name, bytes, .. } => Some((name, bytes)),
            _ => None,
        };
        let same = wanted(self.kind).is_some() && wanted(self.kind) == wanted(other.kind);
        if same {
            self.reply = other.reply;
        }
        same
    }

    pub(super) const fn want(&self) -> Option<(RequestedLog, RequestedPart)> {
        match self.kind {
            Kind::List(entry) => Some((RequestedLog::At(entry), RequestedPart::Length)),
            Kind::Open(name) => Some((RequestedLog::Named(name), RequestedPart::Length)),
            Kind::Checksum { name, bytes, sum: None } => {
                Some((RequestedLog::Named(name), RequestedPart::Checksum(bytes)))
            }
            Kind::Read { of: Open::Log(log), .. } | Kind::Burst { of: Open::Log(log), .. } => {
                Some((RequestedLog::Same(log), RequestedPart::Data(self.reply.offset)))
            }
            Kind::Say(_)
            | Kind::Number(_)
            | Kind::Checksum { sum: Some(_), .. }
            | Kind::Read { of: Open::Builtin(_), .. }
            | Kind::Burst { of: Open::Builtin(_), .. } => None,
        }
    }

    /// `FILE_TRANSFER_PROTOCOL`
    pub(super) fn step(
        &mut self,
        answer: Option<(&Answer, &[u8])>,
        open: &mut Option<Open>,
        out: &mut JobOut<'_, '_>,
    ) -> JobStep {
        let mut buffer = [0; ftp::HEAD + ftp::DATA_MAX];
        let Self { reply, kind } = self;
        match (*kind, answer) {
            (Kind::Say(None), _) => out.file(reply.ack(&[], &mut buffer), JobStep::Done),
            (Kind::Say(Some(error)), _) => out.file(reply.nak(error, &mut buffer), JobStep::Done),
            // An entry without a name has its place in the list; without a directory there is no list.
            (Kind::List(_), Some((answer, _))) if answer.found == Err(NoLog::Unread) && answer.count > 0 => {
                out.file(reply.ack(b"S\0", &mut buffer), JobStep::Done)
            }
            // The card cannot read it now. The client asks again.
            (_, Some((answer, _))) if answer.found == Err(NoLog::Unread) => {
                out.file(reply.nak(Error::Fail, &mut buffer), JobStep::Done)
            }
            (Kind::List(_), Some((answer, _))) if answer.found.is_err() => {
                out.file(reply.nak(Error::EndOfFile, &mut buffer), JobStep::Done)
            }
            (Kind::List(_), Some((answer, _))) => {
                let mut text = heapless::String::<40>::new();
                // Fits: 12 characters of a name and at most 10 digits.
                let _ = write!(text, "F{}\t{}\0", answer.log.name, answer.bytes);
                out.file(reply.ack(text.as_bytes(), &mut buffer), JobStep::Done)
            }
            (Kind::Open(_) | Kind::Checksum { .. }, Some((answer, _))) if answer.found.is_err() => {
                out.file(reply.nak(Error::FileNotFound, &mut buffer), JobStep::Done)
            }
            (Kind::Open(_), Some((answer, _))) => {
                *open = Some(Open::Log(answer.log));
                out.file(reply.ack(&answer.bytes.to_le_bytes(), &mut buffer), JobStep::Done)
            }
            (Kind::Checksum { name, bytes, sum: None }, Some((answer, data))) => {
                reply.offset = answer.offset;
                let sum = data.first_chunk().map_or(0, |sum| u32::from_le_bytes(*sum));
                // It is not computed again if the port is full now.
                *kind = Kind::Checksum { name, bytes, sum: Some(sum) };
                out.file(reply.ack(&sum.to_le_bytes(), &mut buffer), JobStep::Done)
            }
            (Kind::Checksum { sum: Some(sum), .. } | Kind::Number(sum), _) => {
                out.file(reply.ack(&sum.to_le_bytes(), &mut buffer), JobStep::Done)
            }
            (Kind::Read { of, .. } | Kind::Burst { of, .. }, Some((answer, _))) if answer.found.is_err() => {
                let step =
                    out.file(reply.nak(Error::FileNotFound, &mut buffer), JobStep::End(Reply::LogGone));
                if step != JobStep::Wait && *open == Some(of) {
                    *open = None;
                }
                step
            }
            (Kind::Read { .. } | Kind::Burst { .. }, Some((answer, data))) => {
                // Sent before the port was full.
                let rest = data.get(reply.offset.wrapping_sub(answer.offset) as usize..).unwrap_or_default();
                self.read(answer.bytes, rest, &mut buffer, out)
            }
            (
                Kind::Read { of: Open::Builtin(builtin), .. }
                | Kind::Burst { of: Open::Builtin(builtin), .. },
                None,
            ) => {
                let bytes = builtin.bytes();
                let rest = bytes.get(self.reply.offset as usize..).unwrap_or_default();
                self.read(bytes.len() as u32, rest, &mut buffer, out)
            }
            (_, None) => JobStep::Done,
        }
    }

    /// Sends bytes of a file of this length, in messages of the requested size, as far as the port's budget allows.
    ///
    /// A burst ends after [`BURST_BYTES`] with "burst complete", as with `ArduPilot` and PX4: a client that waits for
    /// a timeout after each burst gives up. `MAVProxy` and pymavlink take a shorter message with this mark for the
    /// file's end. So if the line is too slow for messages of that size, the mark comes in a message without data.
    /// The file's end is always a message of its own.
    fn read(
        &mut self,
        bytes: u32,
        data: &[u8],
        buffer: &mut [u8; ftp::HEAD + ftp::DATA_MAX],
        out: &mut JobOut<'_, '_>,
    ) -> JobStep {
        let Self { reply, kind } = self;
        let (asked, mut left) = match *kind {
            Kind::Burst { size, left, .. } => (usize::from(size), left),
            Kind::Read { size, .. } => (usize::from(size), 0),
            _ => return JobStep::Done,
        };
        let (size, is_burst) = (asked.min(out.file_data_max()), reply.opcode == ftp::BURST);
        let mut rest = data;
        loop {
            if reply.offset >= bytes {
                return out.file(reply.nak(Error::EndOfFile, buffer), JobStep::Done);
            }
            let piece = rest.get(..size).unwrap_or(rest);
            let end = reply.offset.saturating_add(piece.len() as u32);
            if is_burst && left == 0 {
                reply.complete = true;
                return out.file(reply.ack(&[], buffer), JobStep::Done);
            }
            if data.is_empty() {
                return out.file(reply.nak(Error::Fail, buffer), JobStep::Done);
            }
            if piece.len() < size && end < bytes {
                return JobStep::Next;
            }
            let is_last = left <= piece.len() as u32;
            reply.complete = is_burst && is_last && piece.len() == asked;
            let is_done = reply.complete || !is_burst;
            match out.file(reply.ack(piece, buffer), if is_done { JobStep::Done } else { JobStep::Next }) {
                JobStep::Next => {
                    left = left.saturating_sub(piece.len() as u32);
                    if let Kind::Burst { left: kept, .. } = kind {
                        *kept = left;
                    }
                    reply.sequence = reply.sequence.wrapping_add(1);
                    reply.offset = end;
                    rest = rest.get(piece.len()..).unwrap_or_default();
                }
                step => return step,
            }
        }
    }
}

/// `/00042_07.HUM`, with or without a directory.
fn name(path: &str) -> Option<LogName> {
    let (base, extension) = path.rsplit('/').next()?.split_once('.')?;
    LogName::from_short(base.as_bytes(), extension.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_a_logs_name_with_or_without_its_directory() {
        let expected = Some(LogName { session: 42, segment: 7 });
        for path in ["00042_07.HUM", "/00042_07.HUM", "@MAV_LOG/00042_07.HUM"] {
            assert_eq!(name(path), expected, "{path}");
        }
        for path in ["", "/", "42.HUM", "../etc/passwd", "00042_07.TXT"] {
            assert_eq!(name(path), None, "{path}");
        }
    }
}
