//! Logs for download: `LOG_REQUEST_LIST`, `LOG_REQUEST_DATA` as ground stations speak them ([`log`]), and MAVLink FTP
//! (`file`), which also has the files that the firmware holds itself ([`builtin`]).
//!
//! One conversation at a time: a client whose request or answer is lost asks again, from any offset. All data goes
//! out in the class `Bulk`, in the rest of the port's budget.
//!
//! ```text
//! question -> job -> what it wants of the card -> storage's answer -> messages -> what it wants next, or the end
//! ```

pub(super) mod builtin;
mod file;
mod log;
mod step;

use hums_core::clock::Instant;
use hums_link::ftp;
use hums_link::request::{Port, Reply, Request};

use self::file::Open;
use self::log::Places;
use self::step::{JobOut, JobStep};
use super::limiter::Requester;
use super::ways::Outlets;
use crate::shelf::{Answered, LogRequest, RequestedLog, RequestedPart};

/// Answers looked at in one call. The port's budget limits them too.
const LOOKS_MAX: usize = 64;

/// The conversation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Library {
    job: Option<Job>,
    ticket: u16,
    asked: bool,
    pub(crate) erases: bool,
    places: Places,
    open: Option<Open>,
}

#[derive(Clone, Copy, Debug)]
struct Job {
    asker: Requester,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    List(log::List),
    Data(log::Data),
    File(file::Job),
}

impl Kind {
    fn want(&self) -> Option<(RequestedLog, RequestedPart)> {
        match self {
            Self::List(list) => Some(list.want()),
            Self::Data(data) => Some(data.want()),
            Self::File(file) => file.want(),
        }
    }
}

impl Library {
    pub(crate) const fn new() -> Self {
        Self { job: None, ticket: 0, asked: false, erases: false, places: Places::new(), open: None }
    }

    pub(crate) const fn next_ticket(&mut self) -> u16 {
        self.ticket = self.ticket.wrapping_add(1);
        self.asked = false;
        self.ticket
    }

    fn begin(&mut self, asker: Requester, kind: Kind) {
        self.job = Some(Job { asker, kind });
        self.next_ticket();
    }

    pub(crate) fn asked(&mut self, asker: Requester, request: &Request<'_>) -> bool {
        match *request {
            Request::LogList(first, last) => self.begin(asker, Kind::List(log::List::new(first, last))),
            Request::LogData(id, offset, count) => match log::Data::new(id, offset, count, &self.places) {
                Some(data) => self.begin(asker, Kind::Data(data)),
                None => self.job = None,
            },
            Request::LogEnd => {
                self.places.end();
                self.job = None;
            }
            Request::File(payload) => self.asked_for_file(asker, payload),
            _ => return false,
        }
        true
    }

    fn asked_for_file(&mut self, asker: Requester, payload: &[u8]) {
        let file = file::Job::new(&ftp::read(payload), &mut self.open);
        if let Some(Job { asker: by, kind: Kind::File(under_way) }) = &mut self.job
            && under_way.takes_over(&file)
        {
            *by = asker;
            return;
        }
        self.begin(asker, Kind::File(file));
    }

    pub(crate) fn lend(&mut self, now: Instant, ways: &mut Outlets) -> Option<(Port, Reply)> {
        if self.erases {
            let ticket = self.next_ticket();
            self.erases = !ways.queues.shelf.want(LogRequest {
                ticket,
                which: RequestedLog::At(0),
                what: RequestedPart::Erase,
            });
        }
        self.job = self.job.filter(|job| ways.queues.is_open(job.asker.port));
        for _ in 0..LOOKS_MAX {
            let Some(mut job) = self.job else {
                ways.queues.shelf.release();
                return None;
            };
            let answered = match job.kind.want() {
                Some(want) => Some(self.answered(want, ways)?),
                None => None,
            };
            let mut out = JobOut { now, asker: job.asker, ways };
            let step = self.step(&mut job, answered.as_ref(), &mut out);
            let goes_on = matches!(step, JobStep::Wait | JobStep::Next);
            self.job = goes_on.then_some(job);
            if step == JobStep::Wait {
                return None;
            }
            self.asked = false;
            if answered.is_some() {
                ways.queues.shelf.release();
            }
            if let JobStep::End(reply) = step {
                return Some((job.asker.port, reply));
            }
        }
        None
    }

    fn answered(
        &mut self,
        (which, what): (RequestedLog, RequestedPart),
        ways: &mut Outlets,
    ) -> Option<Answered> {
        let seen = ways.queues.shelf.answer(self.ticket).cloned();
        if seen.is_none() && !self.asked {
            let ticket = self.next_ticket();
            self.asked = ways.queues.shelf.want(LogRequest { ticket, which, what });
        }
        seen
    }

    fn step(&mut self, job: &mut Job, answered: Option<&Answered>, out: &mut JobOut<'_, '_>) -> JobStep {
        let answer = answered.map(|(answer, data)| (answer, data.as_slice()));
        match (&mut job.kind, answer) {
            (Kind::List(list), Some((answer, _))) => list.step(answer, &mut self.places, out),
            (Kind::Data(data), Some(answer)) => data.step(answer, &mut self.places, out),
            (Kind::File(file), answer) => file.step(answer, &mut self.open, out),
            (Kind::List(_) | Kind::Data(_), None) => JobStep::Done,
        }
    }
}
