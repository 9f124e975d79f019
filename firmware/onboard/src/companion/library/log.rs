//! Logs by `LOG_REQUEST_LIST` and `LOG_REQUEST_DATA`, with a number that is a place in the directory.
//!
//! A place means another log once the directory has changed, and a full card gives a segment to a later log while it
//! is downloaded. So a download is bound to its log when it begins (at offset 0), and goes on with that log or not at
//! all. A request by a place in an outdated list is refused with a text. A refusal sends no data: a `LOG_DATA`
//! without bytes would mean that the log ends there.

use hums_link::messages;
use hums_link::request::Reply;

use super::step::{JobOut, JobStep};
use crate::shelf::{Answer, LogId, NoLog, RequestedLog, RequestedPart};

const DATA_BYTES: usize = 90;

/// A number keeps its log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Places {
    listed: Option<u32>,
    download: Option<Download>,
    /// A refusal, since then.
    told: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Download {
    id: u16,
    /// `None` once the log is gone.
    log: Option<LogId>,
    listed: Option<u32>,
}

impl Places {
    pub(super) const fn new() -> Self {
        Self { listed: None, download: None, told: false }
    }

    /// Ends the download.
    pub(super) const fn end(&mut self) {
        self.download = None;
    }

    fn wanted(&self, id: u16, offset: u32) -> Option<RequestedLog> {
        let place = RequestedLog::At(id.saturating_sub(1));
        match self.download.filter(|download| download.id == id) {
            Some(download) if offset > 0 => download.log.map(RequestedLog::Same),
            Some(Download { log: Some(log), listed, .. }) if listed == self.listed => {
                Some(RequestedLog::Same(log))
            }
            _ => Some(place),
        }
    }

    fn is_listed(&self, offset: u32, directory: u32) -> bool {
        self.listed.map_or(offset == 0, |listed| listed == directory)
    }

    fn bind(&mut self, id: u16, log: LogId) {
        self.download = Some(Download { id, log: Some(log), listed: self.listed });
        self.told = false;
    }

    fn lose(&mut self, id: u16) {
        self.download = Some(Download { id, log: None, listed: self.listed });
    }

    /// Reports a refusal once, until there is a list or a download again: a client may repeat its request for ever.
    fn refuse(&mut self) -> JobStep {
        if core::mem::replace(&mut self.told, true) {
            JobStep::Done
        } else {
            JobStep::End(Reply::LogsChanged)
        }
    }
}

/// A list in progress: entries by place, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct List {
    next: u16,
    last: u16,
    lacks: bool,
}

impl List {
    pub(super) fn new(first: u16, last: u16) -> Self {
        Self { next: first.saturating_sub(1), last: last.saturating_sub(1), lacks: false }
    }

    pub(super) const fn want(&self) -> (RequestedLog, RequestedPart) {
        (RequestedLog::At(self.next), RequestedPart::Length)
    }

    const fn end(&self) -> JobStep {
        if self.lacks { JobStep::End(Reply::LogsUnread) } else { JobStep::Done }
    }

    /// `LOG_ENTRY`
    pub(super) fn step(&mut self, answer: &Answer, places: &mut Places, out: &mut JobOut<'_, '_>) -> JobStep {
        let count = answer.count;
        if answer.found == Err(NoLog::Unread) {
            self.lacks = true;
            if count == 0 {
                return self.end();
            }
        }
        if self.next == 0 || places.listed.is_none() {
            // The rest is of the same directory, or outdated.
            (places.listed, places.told) = (Some(answer.directory), false);
        }
        if answer.found == Err(NoLog::Absent) {
            // An empty list is an answer; past the last log no answer comes.
            let none = messages::log_entry(0, 0, 0, 0, 0);
            return if count == 0 { out.say(&none, self.end()) } else { self.end() };
        }
        let is_last = self.next >= self.last || self.next + 1 >= count;
        let then = if is_last { self.end() } else { JobStep::Next };
        let step = match answer.found {
            Ok(()) => out
                .say(&messages::log_entry(self.next + 1, count, count, answer.bytes, answer.utc_secs), then),
            // Its length is unknown.
            Err(_) => then,
        };
        if step == JobStep::Next {
            self.next += 1;
        }
        step
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Data {
    id: u16,
    which: RequestedLog,
    offset: u32,
    end: u32,
}

impl Data {
    /// `None`: nothing to read.
    pub(super) fn new(id: u16, offset: u32, count: u32, places: &Places) -> Option<Self> {
        let which = places.wanted(id, offset)?;
        Some(Self { id, which, offset, end: offset.saturating_add(count) })
    }

    pub(super) const fn want(&self) -> (RequestedLog, RequestedPart) {
        (self.which, RequestedPart::Data(self.offset))
    }

    /// `LOG_DATA`
    pub(super) fn step(
        &mut self,
        (answer, data): (&Answer, &[u8]),
        places: &mut Places,
        out: &mut JobOut<'_, '_>,
    ) -> JobStep {
        match self.which {
            // The card cannot read it now. The client asks again.
            _ if answer.found == Err(NoLog::Unread) => return JobStep::Done,
            RequestedLog::Same(_) if answer.found.is_err() => {
                places.lose(self.id);
                return JobStep::End(Reply::LogGone);
            }
            RequestedLog::Same(_) => {}
            _ if !places.is_listed(self.offset, answer.directory) => return places.refuse(),
            _ if answer.found.is_err() => {
                return out.say(&messages::log_data(self.id, self.offset, &[]), JobStep::Done);
            }
            _ => {
                places.bind(self.id, answer.log);
                self.which = RequestedLog::Same(answer.log);
            }
        }
        if data.is_empty() && self.offset < answer.bytes {
            // As above.
            return JobStep::Done;
        }
        self.send(answer, data, out)
    }

    fn send(&mut self, answer: &Answer, data: &[u8], out: &mut JobOut<'_, '_>) -> JobStep {
        // Sent before the port was full.
        let mut rest = data.get(self.offset.wrapping_sub(answer.offset) as usize..).unwrap_or_default();
        loop {
            let wanted = (self.end.saturating_sub(self.offset) as usize).min(DATA_BYTES);
            let piece = rest.get(..wanted).unwrap_or(rest);
            // Short, but the log goes on: the next answer has the rest.
            if piece.len() < wanted && self.offset.saturating_add(piece.len() as u32) < answer.bytes {
                return JobStep::Next;
            }
            let is_last =
                piece.len() < DATA_BYTES || self.offset.saturating_add(DATA_BYTES as u32) >= self.end;
            let packet = messages::log_data(self.id, self.offset, piece);
            match out.say(&packet, if is_last { JobStep::Done } else { JobStep::Next }) {
                JobStep::Next => {
                    self.offset = self.offset.saturating_add(piece.len() as u32);
                    rest = rest.get(piece.len()..).unwrap_or_default();
                }
                step => return step,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use hums_recorder::LogName;

    use super::*;

    const fn log(session: u32) -> LogId {
        LogId { name: LogName { session: 1, segment: 0 }, session, first: 0 }
    }

    #[test]
    fn a_download_goes_on_with_its_log_whatever_stands_at_its_place() {
        let mut places = Places::new();
        places.listed = Some(7);
        assert_eq!(places.wanted(3, 0), Some(RequestedLog::At(2)), "a beginning is looked up");
        assert!(places.is_listed(0, 7) && !places.is_listed(0, 8));
        places.bind(3, log(42));
        assert_eq!(places.wanted(3, 90), Some(RequestedLog::Same(log(42))));
        assert_eq!(places.wanted(3, 0), Some(RequestedLog::Same(log(42))), "the first piece was lost");
        places.listed = Some(9);
        assert_eq!(places.wanted(3, 90), Some(RequestedLog::Same(log(42))));
        assert_eq!(places.wanted(3, 0), Some(RequestedLog::At(2)));
        places.lose(3);
        assert_eq!(places.wanted(3, 90), None);
        assert_eq!(places.wanted(3, 0), Some(RequestedLog::At(2)));
    }

    #[test]
    fn what_was_never_listed_may_be_begun_but_not_gone_on_with() {
        let mut places = Places::new();
        assert!(places.is_listed(0, 7) && !places.is_listed(90, 7));
        assert_eq!(places.refuse(), JobStep::End(Reply::LogsChanged));
        assert_eq!(places.refuse(), JobStep::Done, "it is told once");
    }
}
