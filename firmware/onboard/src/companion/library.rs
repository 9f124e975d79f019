//! Logs for download: `LOG_REQUEST_LIST`, `LOG_REQUEST_DATA` as ground stations speak them, and MAVLink FTP.
//!
//! One conversation at a time: who asks anew ends the one before. Nothing is remembered that a client could fill: a
//! question that is lost, or its answer, is asked again by the client, from wherever it likes. Everything goes out in
//! the class [`Class::Bulk`], in what the port's budget leaves to it.
//!
//! A log's id is its place in the card's directory, from 1; over FTP it has its name.

use core::fmt::Write as _;

use hums_core::time::Instant;
use hums_link::ftp::{self, Error, Operation};
use hums_link::messages;
use hums_link::outlet::Class;
use hums_link::packet::Packet;
use hums_link::request::Request;
use hums_recorder::LogName;

use super::limiter::Asker;
use super::ways::Ways;
use crate::shelf::{Answer, Want, What, Which};

/// Bytes in one `LOG_DATA`.
const LOG_DATA_BYTES: usize = 90;
/// What an FTP message adds to its data, and the least data that is worth it.
const FTP_FRAME: usize = 12 + 3 + ftp::HEAD + 13;
const FTP_DATA_MIN: usize = 20;
/// Messages of one burst; the client then asks on, and so a client that has gone is not sent a whole log.
const BURST: u16 = 64;

/// The conversation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Library {
    job: Option<Job>,
    ticket: u16,
    /// What is wanted next has been asked for.
    asked: bool,
    /// Earlier logs are to be erased.
    pub(crate) erases: bool,
    /// The log that is open over FTP.
    open: Option<LogName>,
}

#[derive(Clone, Copy, Debug)]
struct Job {
    asker: Asker,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    /// Entries by place, from 0: the next and the last.
    List { next: u16, last: u16 },
    /// Bytes of a log: place, offset, end.
    Data { at: u16, offset: u32, end: u32 },
    /// One entry of a directory.
    FtpList { reply: ftp::Reply, entry: u16 },
    /// The file that is to be opened.
    FtpOpen { reply: ftp::Reply, name: LogName },
    /// Bytes of the file that is open.
    FtpRead { reply: ftp::Reply, name: LogName, size: u8, left: u16 },
    /// An answer that needs nothing from the card.
    FtpSay { reply: ftp::Reply, error: Option<Error> },
}

/// What one look at an answer did.
enum Step {
    /// The port is full: later.
    Wait,
    /// The answer has no more to give.
    Next,
    /// All is said.
    Done,
}

impl Library {
    pub(crate) const fn new() -> Self {
        Self { job: None, ticket: 0, asked: false, erases: false, open: None }
    }

    /// For somebody else's question.
    pub(crate) const fn next_ticket(&mut self) -> u16 {
        self.ticket = self.ticket.wrapping_add(1);
        self.ticket
    }

    fn begin(&mut self, asker: Asker, kind: Kind) {
        self.job = Some(Job { asker, kind });
        self.ticket = self.ticket.wrapping_add(1);
        self.asked = false;
    }

    /// Takes a question; `false` when it is none about logs.
    pub(crate) fn asked(&mut self, asker: Asker, request: &Request<'_>) -> bool {
        match *request {
            Request::LogList(first, last) => {
                let kind = Kind::List { next: first.saturating_sub(1), last: last.saturating_sub(1) };
                self.begin(asker, kind);
            }
            Request::LogData(id, offset, count) => {
                let kind = Kind::Data { at: id.saturating_sub(1), offset, end: offset.saturating_add(count) };
                self.begin(asker, kind);
            }
            Request::LogEnd => self.job = None,
            Request::File(payload) => {
                let kind = file(&ftp::read(payload), &mut self.open);
                self.begin(asker, kind);
            }
            _ => return false,
        }
        true
    }
}

fn file(asked: &ftp::Asked<'_>, open: &mut Option<LogName>) -> Kind {
    let reply = ftp::Reply::to(asked);
    let say = |error| Kind::FtpSay { reply, error };
    match asked.operation {
        Operation::None => say(None),
        Operation::End => {
            *open = None;
            say(None)
        }
        Operation::List("" | "/" | "." | "/." | "/logs" | "@MAV_LOG" | "@MAV_LOG/", offset) => {
            Kind::FtpList { reply, entry: offset.min(u32::from(u16::MAX)) as u16 }
        }
        Operation::List(..) => say(Some(Error::FileNotFound)),
        Operation::Open(path) => match name(path) {
            Some(name) => {
                *open = Some(name);
                Kind::FtpOpen { reply, name }
            }
            None => say(Some(Error::FileNotFound)),
        },
        Operation::Read(offset, size) | Operation::Burst(offset, size) => match *open {
            Some(name) => {
                let left = if matches!(asked.operation, Operation::Burst(..)) { BURST } else { 1 };
                Kind::FtpRead { reply: ftp::Reply { offset, ..reply }, name, size: size.max(1), left }
            }
            None => say(Some(Error::InvalidSession)),
        },
        Operation::Write => say(Some(Error::FileProtected)),
        Operation::Unknown => say(Some(Error::UnknownCommand)),
    }
}

/// `/00042_07.HUM`, with or without a directory before it.
fn name(path: &str) -> Option<LogName> {
    let (base, extension) = path.rsplit('/').next()?.split_once('.')?;
    LogName::from_short(base.as_bytes(), extension.as_bytes())
}

impl Kind {
    fn want(&self) -> Option<(Which, What)> {
        match *self {
            Self::List { next, .. } => Some((Which::At(next), What::Length)),
            Self::Data { at, offset, .. } => Some((Which::At(at), What::Data(offset))),
            Self::FtpList { entry, .. } => Some((Which::At(entry), What::Length)),
            Self::FtpOpen { name, .. } => Some((Which::Named(name), What::Length)),
            Self::FtpRead { name, reply, .. } => Some((Which::Named(name), What::Data(reply.offset))),
            Self::FtpSay { .. } => None,
        }
    }
}

impl Library {
    /// Goes on with the conversation as far as the card's answers and the port's budget allow.
    pub(crate) fn lend(&mut self, now: Instant, ways: &mut Ways) {
        if self.erases {
            let ticket = self.next_ticket();
            self.erases = !ways.queues.shelf.want(Want { ticket, which: Which::At(0), what: What::Erase });
            self.asked = false;
        }
        // Bounded by the port's budget; a number all the same.
        for _ in 0..64 {
            let Some(mut job) = self.job else {
                while ways.queues.shelf.answer(|_, _| true) {}
                return;
            };
            let step = if job.kind.want().is_none() {
                step(now, &mut job, None, ways)
            } else {
                let ticket = self.ticket;
                let mut seen = None;
                // A copy, because to send needs everything else.
                let there = ways.queues.shelf.answer(|answer, data| {
                    if answer.ticket == ticket {
                        let mut copy = heapless::Vec::<u8, { crate::shelf::DATA_MAX }>::new();
                        let _ = copy.extend_from_slice(data);
                        seen = Some((*answer, copy));
                    }
                    true
                });
                let Some((answer, data)) = seen else {
                    if !there {
                        self.want(&job, ways);
                        return;
                    }
                    continue;
                };
                step(now, &mut job, Some((&answer, &data)), ways)
            };
            match step {
                Step::Done => self.job = None,
                Step::Wait | Step::Next => {
                    self.job = Some(job);
                    self.asked = false;
                }
            }
            if matches!(step, Step::Wait) {
                return;
            }
        }
    }

    fn want(&mut self, job: &Job, ways: &mut Ways) {
        if let Some((which, what)) = job.kind.want().filter(|_| !self.asked) {
            let ticket = self.next_ticket();
            self.asked = ways.queues.shelf.want(Want { ticket, which, what });
        }
    }
}

/// Says what an answer holds.
fn step(now: Instant, job: &mut Job, answer: Option<(&Answer, &[u8])>, ways: &mut Ways) -> Step {
    let asker = job.asker;
    let mut say = |packet: &Packet, then: Step| {
        if ways.send(now, asker.port, Class::Bulk, packet) { then } else { Step::Wait }
    };
    match (&mut job.kind, answer) {
        (Kind::List { next, last }, Some((answer, _))) => entry(next, *last, answer, &mut say),
        (Kind::Data { at, offset, end }, Some((answer, data))) => {
            log_data(*at, offset, *end, (answer, data), &mut say)
        }
        (kind, answer) => {
            let size_max = ways.bulk_frame_max(asker.port).saturating_sub(FTP_FRAME).max(FTP_DATA_MIN);
            let mut say = |payload: &[u8], then: Step| {
                let packet = messages::file_transfer(asker.by.0, asker.by.1, payload);
                if ways.send(now, asker.port, Class::Bulk, &packet) { then } else { Step::Wait }
            };
            file_step(kind, answer, size_max, &mut say)
        }
    }
}

/// `LOG_ENTRY`
fn entry(next: &mut u16, last: u16, answer: &Answer, say: &mut impl FnMut(&Packet, Step) -> Step) -> Step {
    let count = answer.count;
    if answer.found.is_none() {
        // "There are none" is an answer; past the last one there is nothing to say.
        let none = messages::log_entry(0, 0, 0, 0, 0);
        return if count == 0 { say(&none, Step::Done) } else { Step::Done };
    }
    let entry = messages::log_entry(*next + 1, count, count, answer.bytes, 0);
    let is_last = *next >= last || *next + 1 >= count;
    let step = say(&entry, if is_last { Step::Done } else { Step::Next });
    if matches!(step, Step::Next) {
        *next += 1;
    }
    step
}

/// `LOG_DATA`
fn log_data(
    at: u16,
    offset: &mut u32,
    end: u32,
    (answer, data): (&Answer, &[u8]),
    say: &mut impl FnMut(&Packet, Step) -> Step,
) -> Step {
    let mut rest = data;
    loop {
        let wanted = (end.saturating_sub(*offset) as usize).min(LOG_DATA_BYTES);
        let piece = rest.get(..wanted).unwrap_or(rest);
        // Short, and the log goes on: the next answer has the rest.
        if piece.len() < wanted && (*offset).saturating_add(piece.len() as u32) < answer.bytes {
            return Step::Next;
        }
        let is_last = piece.len() < LOG_DATA_BYTES || offset.saturating_add(LOG_DATA_BYTES as u32) >= end;
        let packet = messages::log_data(at + 1, *offset, piece);
        match say(&packet, if is_last { Step::Done } else { Step::Next }) {
            Step::Next => {
                *offset = offset.saturating_add(piece.len() as u32);
                rest = rest.get(piece.len()..).unwrap_or_default();
            }
            step => return step,
        }
    }
}

/// `FILE_TRANSFER_PROTOCOL`
fn file_step(
    kind: &mut Kind,
    answer: Option<(&Answer, &[u8])>,
    size_max: usize,
    say: &mut impl FnMut(&[u8], Step) -> Step,
) -> Step {
    let mut buffer = [0; ftp::HEAD + ftp::DATA_MAX];
    match (kind, answer) {
        (Kind::FtpSay { reply, error }, _) => {
            let payload = match error {
                Some(error) => reply.nak(*error, &mut buffer),
                None => reply.ack(&[], &mut buffer),
            };
            say(payload, Step::Done)
        }
        (Kind::FtpList { reply, .. }, Some((answer, _))) => {
            if answer.found.is_none() {
                return say(reply.nak(Error::EndOfFile, &mut buffer), Step::Done);
            }
            let mut text = heapless::String::<40>::new();
            // Fits: 12 characters of a name and at most 10 digits.
            let _ = write!(text, "F{}\t{}\0", answer.name, answer.bytes);
            say(reply.ack(text.as_bytes(), &mut buffer), Step::Done)
        }
        (Kind::FtpOpen { reply, .. }, Some((answer, _))) => {
            let payload = match answer.found {
                Some(_) => reply.ack(&answer.bytes.to_le_bytes(), &mut buffer),
                None => reply.nak(Error::FileNotFound, &mut buffer),
            };
            say(payload, Step::Done)
        }
        (Kind::FtpRead { reply, size, left, .. }, Some((answer, data))) => {
            let size = usize::from(*size).min(size_max);
            let mut rest = data;
            loop {
                let piece = rest.get(..size).unwrap_or(rest);
                let end = reply.offset.saturating_add(piece.len() as u32);
                if reply.offset >= answer.bytes {
                    return say(reply.nak(Error::EndOfFile, &mut buffer), Step::Done);
                }
                if piece.len() < size && end < answer.bytes {
                    return if piece.is_empty() && data.is_empty() { Step::Done } else { Step::Next };
                }
                reply.complete = *left <= 1 && reply.opcode == 15;
                let then = if *left <= 1 { Step::Done } else { Step::Next };
                match say(reply.ack(piece, &mut buffer), then) {
                    Step::Next => {
                        *left -= 1;
                        reply.sequence = reply.sequence.wrapping_add(1);
                        reply.offset = end;
                        rest = rest.get(piece.len()..).unwrap_or_default();
                    }
                    step => return step,
                }
            }
        }
        // What is asked of the card and was not answered, or is no file.
        _ => Step::Done,
    }
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
