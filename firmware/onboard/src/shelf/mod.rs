//! Logs on the card for downloads: the monitor asks, and storage answers when it has nothing to write. So reading
//! delays a sector by at most one answer.
//!
//! | queue | from | to | capacity | when it is full |
//! |---|---|---|---|---|
//! | wants | monitor | storage | 2 | the monitor asks again |
//! | answers | storage | monitor | 1 | storage waits with the next one |
//!
//! A log's length is the recorded length, not the file's: storage finds the last sector of the first one's session
//! (14 blocks of an 8 MiB segment). For the log in work it is the finished part, without copies of the sector in
//! progress.
//!
//! A full card gives a segment's place to a later log. So a download asks for a log by its [`LogId`], and each answer
//! checks the log's first sector again. A log that was overwritten, or is on another card, is not found.
//!
//! A checksum is computed a few blocks at a call; in between storage writes waiting sectors.

mod asked;
mod on_card;

use hums_link::ftp;
use hums_recorder::card::{LogEntry, Segment};
use hums_recorder::{BLOCK_BYTES, Card, CardDevice, CardError, Recorder};

use crate::queues::ring::{In, Out, Ring};
pub use asked::{Answer, DATA_MAX, LogId, LogRequest, NoLog, RequestedLog, RequestedPart};
use on_card::{for_each_part, holds, in_work, measure};

/// Requests at once.
const WANTS: usize = 2;
/// Blocks of a checksum at a call: some 5 ms of a card on SPI, as a small answer takes.
const SUM_BLOCKS: u32 = 4;

pub(crate) type Answered = (Answer, heapless::Vec<u8, DATA_MAX>);

/// Part of the firmware's one static.
pub struct Shelf {
    wants: Ring<LogRequest, WANTS>,
    answers: Ring<Answered, 1>,
}

impl Shelf {
    /// Empty.
    pub(crate) const fn new() -> Self {
        const NONE: LogRequest =
            LogRequest { ticket: 0, which: RequestedLog::At(0), what: RequestedPart::Length };
        Self {
            wants: Ring::new([NONE; WANTS]),
            answers: Ring::new([(Answer::none(0), heapless::Vec::new())]),
        }
    }

    pub(crate) fn split(&mut self) -> (Reader<'_>, Server<'_>) {
        let (wants_in, wants_out) = self.wants.split();
        let (answers_in, answers_out) = self.answers.split();
        (
            Reader { wants: wants_in, answers: answers_out },
            Server {
                wants: wants_out,
                answers: answers_in,
                last: None,
                sum: None,
                listed: ListedLog::default(),
                erases: None,
            },
        )
    }
}

/// The monitor's ends.
pub struct Reader<'a> {
    wants: In<'a, LogRequest, WANTS>,
    answers: Out<'a, Answered, 1>,
}

impl Reader<'_> {
    /// `false` without room.
    pub fn want(&mut self, want: LogRequest) -> bool {
        let Some(place) = self.wants.free() else { return false };
        *place = want;
        self.wants.commit();
        true
    }

    /// The answer to the request with this ticket, if it has come. It stays until [`Self::release`]; answers to other
    /// requests are dropped.
    pub(crate) fn answer(&mut self, ticket: u16) -> Option<&Answered> {
        if self.answers.waiting().first().is_some_and(|(answer, _)| answer.ticket != ticket) {
            self.release();
        }
        self.answers.waiting().first()
    }

    pub(crate) fn release(&mut self) {
        self.answers.release(1);
    }
}

/// Storage's ends.
pub struct Server<'a> {
    wants: Out<'a, LogRequest, WANTS>,
    answers: In<'a, Answered, 1>,
    last: Option<FoundLog>,
    sum: Option<Sum>,
    /// Found last, by place.
    listed: ListedLog,
    /// An erase in progress, a block of the directory at a call: its next entry.
    erases: Option<u32>,
}

#[derive(Clone, Copy, Default)]
struct ListedLog {
    names: u32,
    place: u16,
    entry: u32,
}

#[derive(Clone, Copy)]
struct FoundLog {
    answer: Answer,
    segment: Segment,
}

/// A checksum in progress: of `done` bytes of the log's first `answer.offset` ones.
#[derive(Clone, Copy)]
struct Sum {
    log: FoundLog,
    done: u32,
    so_far: u32,
}

impl Server<'_> {
    /// Whether a request waits.
    pub fn is_wanted(&self) -> bool {
        self.erases.is_some() || self.sum.is_some() || self.wants.len() > 0
    }

    /// Part of a request, if there is room for its answer; whether there was one.
    pub fn serve<D: CardDevice>(&mut self, recorder: &mut Recorder<'_, D>) -> bool {
        if let Some(entry) = self.erases {
            self.last = None;
            self.erases = erase_next(recorder, entry);
            return true;
        }
        match self.wants.waiting().first().copied() {
            Some(LogRequest { what: RequestedPart::Erase, .. }) => {
                self.wants.release(1);
                self.erases = Some(0);
                true
            }
            Some(want) => self.answer(recorder, &want),
            None => self.add(recorder),
        }
    }

    fn answer<D: CardDevice>(&mut self, recorder: &mut Recorder<'_, D>, want: &LogRequest) -> bool {
        let Some((to, data)) = self.answers.free() else { return false };
        self.wants.release(1);
        if want.which != RequestedLog::Settings {
            // One conversation at a time: a request for something else cancels a checksum.
            self.sum = None;
        }
        let log = find(recorder, want, self.last.take(), &mut self.listed);
        let mut answer = Answer { ticket: want.ticket, ..log.answer };
        data.clear();
        if let (Some(card), Some(mut segment)) = (recorder.card(), log.segment) {
            match want.what {
                RequestedPart::Data(offset) => {
                    answer.offset = offset;
                    copy(card, &mut segment, &answer, data);
                }
                RequestedPart::Checksum(bytes) => {
                    let bytes = if bytes == 0 { answer.bytes } else { bytes.min(answer.bytes) };
                    let log = FoundLog { answer: Answer { offset: bytes, ..answer }, segment };
                    self.sum = Some(Sum { log, done: 0, so_far: 0 });
                }
                RequestedPart::Length | RequestedPart::Erase => {}
            }
            self.last = Some(FoundLog { answer, segment })
                .filter(|found| want.which != RequestedLog::Settings && found.answer.found.is_ok());
        }
        if self.sum.is_some() && matches!(want.what, RequestedPart::Checksum(_)) {
            return true;
        }
        *to = answer;
        self.answers.commit();
        true
    }

    fn add<D: CardDevice>(&mut self, recorder: &mut Recorder<'_, D>) -> bool {
        let Some(Sum { log: FoundLog { mut answer, mut segment }, mut done, mut so_far }) = self.sum else {
            return false;
        };
        let Some(place) = self.answers.free() else { return false };
        let end = answer.offset.min(done.saturating_add(SUM_BLOCKS * BLOCK_BYTES as u32));
        let mut why = NoLog::Unread;
        let is_read = recorder.card().is_some_and(|card| {
            let add = |part: &[u8]| so_far = ftp::checksum(so_far, part);
            let is_same = holds(card, &mut segment, &answer.log);
            if is_same == Some(false) {
                why = NoLog::Absent;
            }
            is_same == Some(true) && for_each_part(card, &mut segment, &answer.log, done..end, add)
        });
        done = end;
        if is_read && done < answer.offset {
            self.sum = Some(Sum { log: FoundLog { answer, segment }, done, so_far });
            return true;
        }
        self.sum = None;
        if !is_read {
            answer = answer.without(why);
        }
        *place = (answer, so_far.to_le_bytes().into_iter().collect());
        self.answers.commit();
        true
    }
}

/// Hides logs of earlier sessions in the directory's block of this entry; returns the next block's entry. `None` at
/// the end, or if the card refuses.
fn erase_next<D: CardDevice>(recorder: &mut Recorder<'_, D>, entry: u32) -> Option<u32> {
    let session = recorder.log_name().map(|name| name.session);
    let more = recorder.card()?.hide_logs(entry, session);
    more.is_ok_and(|more| more).then_some(entry + BLOCK_BYTES as u32 / 32)
}

struct Lookup {
    answer: Answer,
    segment: Option<Segment>,
}

fn find<D: CardDevice>(
    recorder: &mut Recorder<'_, D>,
    want: &LogRequest,
    last: Option<FoundLog>,
    listed: &mut ListedLog,
) -> Lookup {
    let none = Lookup { answer: Answer::none(want.ticket), segment: None };
    let recorded = recorder.in_work();
    let Some(card) = recorder.card() else { return none };
    let mut answer = none.answer;
    (answer.count, answer.directory) = card.shown();
    let of_none = |why| Lookup { answer: answer.without(why), segment: None };
    let found = match want.which {
        RequestedLog::Settings => {
            let Some((segment, bytes)) = card.settings() else { return none };
            return Lookup { answer: Answer { found: Ok(()), bytes, ..none.answer }, segment: Some(segment) };
        }
        RequestedLog::Same(log) => {
            if let Some(FoundLog { answer, mut segment }) = last.filter(|last| last.answer.log == log)
                && holds(card, &mut segment, &log) == Some(true)
            {
                return Lookup { answer, segment: Some(segment) };
            }
            card.shown_log(log.name)
        }
        RequestedLog::Named(name) => card.shown_log(name),
        RequestedLog::At(place) if place >= answer.count => return of_none(NoLog::Absent),
        RequestedLog::At(place) => at_place(card, place, listed),
    };
    let entry = match found {
        Ok(Some(entry)) => entry,
        Ok(None) => return of_none(NoLog::Absent),
        Err(_) => return Lookup { answer: none.answer.without(NoLog::Unread), segment: None },
    };
    let mut segment = Segment::of(&entry);
    let measured = match recorded.filter(|recorded| recorded.name == entry.name) {
        Some(recorded) => Some(in_work(&recorded)),
        None => measure(card, &mut segment, entry.name),
    };
    let Some((log, blocks)) = measured else { return of_none(NoLog::Unread) };
    if matches!(want.which, RequestedLog::Same(wanted) if wanted != log) {
        return of_none(NoLog::Absent);
    }
    (answer.log, answer.bytes, answer.found) = (log, blocks * BLOCK_BYTES as u32, Ok(()));
    answer.utc_secs = entry.utc_secs;
    Lookup { answer, segment: Some(segment) }
}

fn at_place<D: CardDevice>(
    card: &Card<'_, D>,
    place: u16,
    listed: &mut ListedLog,
) -> Result<Option<LogEntry>, CardError<D::Error>> {
    let (_, names) = card.shown();
    if listed.names != names || listed.place > place {
        *listed = ListedLog { names, ..ListedLog::default() };
    }
    let found = card.shown_behind(listed.entry, place - listed.place)?;
    if let Some((entry, _)) = found {
        (listed.place, listed.entry) = (place, entry);
    }
    Ok(found.map(|(_, log)| log))
}

fn copy<D: CardDevice>(
    card: &Card<'_, D>,
    segment: &mut Segment,
    answer: &Answer,
    to: &mut heapless::Vec<u8, DATA_MAX>,
) {
    let end = answer.offset.saturating_add(DATA_MAX as u32).min(answer.bytes);
    for_each_part(card, segment, &answer.log, answer.offset..end, |part| {
        let _ = to.extend_from_slice(part);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Server<'_> {
        pub(crate) fn serve_text(&mut self, text: &[u8]) {
            let Some(&mut LogRequest {
                ticket,
                which: RequestedLog::Settings,
                what: RequestedPart::Data(offset),
            }) = self.wants.waiting().first_mut()
            else {
                return;
            };
            self.wants.release(1);
            let data = &text[(offset as usize).min(text.len())..];
            let data = &data[..data.len().min(DATA_MAX)];
            let answer = Answer { found: Ok(()), bytes: text.len() as u32, offset, ..Answer::none(ticket) };
            let place = self.answers.free().expect("room for one answer");
            *place = (answer, data.iter().copied().collect());
            self.answers.commit();
        }
    }
}
