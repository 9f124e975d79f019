//! The logs that are on the card already, for those who download them: the monitor asks, storage answers when it has
//! nothing to write. So reading never keeps a sector waiting, but for the time of one answer.
//!
//! | queue | from | to | capacity | when it is full |
//! |---|---|---|---|---|
//! | wants | monitor | storage | 2 | the monitor asks again |
//! | answers | storage | monitor | [`ANSWER_BYTES`] | storage waits with the next one |
//!
//! A log's length is what was recorded, not what its file has: storage looks for the last sector that has the first
//! one's session (14 blocks of an 8 MiB segment).

use bbqueue::nicknames::Churrasco;
use bbqueue::prod_cons::framed::{FramedConsumer, FramedProducer};
use embedded_sdmmc::{Block, BlockDevice};
use heapless::spsc;
use hums_blackbox::Header;
use hums_recorder::card::Segment;
use hums_recorder::{Card, CardDevice, LogName, Recorder};

/// Bytes of a log in one answer.
pub const DATA_MAX: usize = 240;
/// What an answer's head takes.
const HEAD: usize = 20;
/// The longest answer in one piece, with the queue's own two bytes, wherever the last one ended: twice its length.
pub const ANSWER_BYTES: usize = 2 * (HEAD + DATA_MAX + 2) + 8;

/// What is wanted of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// How long it is.
    Length,
    /// Bytes from an offset on.
    Data(u32),
    /// That all earlier logs are no longer offered, and make room first. Not answered.
    Erase,
}

/// A log, by its place in the directory from 0 (erased ones left out), or by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// By its place.
    At(u16),
    /// By its name.
    Named(LogName),
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

/// What storage answers, without the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The want's.
    pub ticket: u16,
    /// How many logs there are; 0 also where there is no card.
    pub count: u16,
    /// The log's place; `None` where there is no such log.
    pub found: Option<u16>,
    /// The log's name.
    pub name: LogName,
    /// The log's length in bytes.
    pub bytes: u32,
    /// Where the data lies in the log.
    pub offset: u32,
}

/// Both queues; part of the firmware's one static.
pub struct Shelf {
    wants: spsc::Queue<Want, 3>,
    answers: Churrasco<ANSWER_BYTES>,
}

impl Shelf {
    /// Empty.
    pub(crate) const fn new() -> Self {
        Self { wants: spsc::Queue::new(), answers: Churrasco::new() }
    }

    pub(crate) fn split(&mut self) -> (Reader<'_>, Server<'_>) {
        let (wants_in, wants_out) = self.wants.split();
        let reader = Reader { wants: wants_in, answers: self.answers.framed_consumer() };
        (
            reader,
            Server { wants: wants_out, answers: self.answers.framed_producer(), last: None, erases: false },
        )
    }
}

/// The monitor's ends.
pub struct Reader<'a> {
    wants: spsc::Producer<'a, Want>,
    answers: FramedConsumer<&'a Churrasco<ANSWER_BYTES>>,
}

impl Reader<'_> {
    /// Asks; `false` while there is no room.
    pub fn want(&mut self, want: Want) -> bool {
        self.wants.enqueue(want).is_ok()
    }

    /// Shows the oldest answer, if there is one; it is gone afterwards when `look` says so.
    pub fn answer(&mut self, look: impl FnOnce(&Answer, &[u8]) -> bool) -> bool {
        let Ok(grant) = self.answers.read() else { return false };
        let done = match grant.split_first_chunk::<HEAD>() {
            Some((head, data)) => look(&Answer::read(head), data),
            None => true,
        };
        if done {
            grant.release();
        }
        true
    }
}

/// Storage's ends.
pub struct Server<'a> {
    wants: spsc::Consumer<'a, Want>,
    answers: FramedProducer<&'a Churrasco<ANSWER_BYTES>>,
    /// The log that was read last.
    last: Option<(Answer, Segment)>,
    /// Logs are being erased, one at a call.
    erases: bool,
}

impl Answer {
    fn write(&self) -> [u8; HEAD] {
        let mut head = [0; HEAD];
        head[..2].copy_from_slice(&self.ticket.to_le_bytes());
        head[2..4].copy_from_slice(&self.count.to_le_bytes());
        head[4..6].copy_from_slice(&self.found.unwrap_or(u16::MAX).to_le_bytes());
        head[6] = self.name.segment as u8;
        head[8..12].copy_from_slice(&self.name.session.to_le_bytes());
        head[12..16].copy_from_slice(&self.bytes.to_le_bytes());
        head[16..].copy_from_slice(&self.offset.to_le_bytes());
        head
    }

    fn read(head: &[u8; HEAD]) -> Self {
        let u16_at = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
        let u32_at = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        Self {
            ticket: u16_at(0),
            count: u16_at(2),
            found: Some(u16_at(4)).filter(|index| *index != u16::MAX),
            name: LogName { session: u32_at(8), segment: u32::from(head[6]) },
            bytes: u32_at(12),
            offset: u32_at(16),
        }
    }
}

impl Server<'_> {
    /// Whether somebody waits for an answer.
    pub fn is_wanted(&self) -> bool {
        self.erases || self.wants.ready()
    }

    /// Answers one want, if there is one and room for its answer; whether there was.
    pub fn serve<D: CardDevice>(&mut self, recorder: &mut Recorder<'_, D>) -> bool {
        if self.erases {
            self.last = None;
            self.erases = erase_next(recorder);
            return true;
        }
        let Some(want) = self.wants.peek().copied() else { return false };
        if want.what == What::Erase {
            let _ = self.wants.dequeue();
            self.erases = true;
            return true;
        }
        let Ok(mut grant) = self.answers.grant((HEAD + DATA_MAX) as u16) else { return false };
        let _ = self.wants.dequeue();
        let mut answer = Answer {
            ticket: want.ticket,
            count: 0,
            found: None,
            name: LogName { session: 0, segment: 0 },
            bytes: 0,
            offset: 0,
        };
        let mut data = 0;
        if let Some(card) = recorder.card()
            && let Some((found, segment)) = find(card, &want, self.last.take())
        {
            answer = Answer { ticket: want.ticket, ..found };
            if let Some(mut segment) = segment {
                if let What::Data(offset) = want.what {
                    answer.offset = offset;
                    let to = grant.get_mut(HEAD..).unwrap_or_default();
                    data = copy(card, &mut segment, answer.bytes, offset, to);
                }
                self.last = Some((answer, segment)).filter(|_| want.which != Which::Settings);
            }
        }
        if let Some(head) = grant.get_mut(..HEAD) {
            head.copy_from_slice(&answer.write());
        }
        grant.commit((HEAD + data) as u16);
        true
    }
}

/// Hides one log of an earlier session; `false` when there is none, or the card does not take it.
fn erase_next<D: CardDevice>(recorder: &mut Recorder<'_, D>) -> bool {
    let session = recorder.log_name().map(|name| name.session);
    let Some(card) = recorder.card() else { return false };
    let mut next = None;
    let looked = card.logs(|entry| {
        if !entry.hidden && Some(entry.name.session) != session {
            next = Some(entry);
        }
    });
    looked.is_ok() && next.is_some_and(|entry| card.hide(&entry).is_ok())
}

/// The log that is wanted, from the directory unless it is the one that was read last.
fn find<D: BlockDevice>(
    card: &Card<'_, D>,
    want: &Want,
    last: Option<(Answer, Segment)>,
) -> Option<(Answer, Option<Segment>)> {
    if let (Some((answer, segment)), What::Data(_)) = (last, want.what) {
        let same = match want.which {
            Which::At(index) => answer.found == Some(index),
            Which::Named(name) => answer.name == name && answer.found.is_some(),
            Which::Settings => false,
        };
        if same {
            return Some((answer, Some(segment)));
        }
    }
    if want.which == Which::Settings {
        let (segment, bytes) = card.text(b"PARAMS", b"TXT").ok()?;
        let answer =
            Answer { ticket: want.ticket, count: 0, found: Some(0), name: segment.name, bytes, offset: 0 };
        return Some((answer, Some(segment)));
    }
    let (mut count, mut found) = (0_u16, None);
    card.logs(|entry| {
        if entry.hidden {
            return;
        }
        let wanted = match want.which {
            Which::At(index) => index == count,
            Which::Named(name) => name == entry.name,
            Which::Settings => false,
        };
        if wanted {
            found = Some((count, entry.name));
        }
        count = count.saturating_add(1);
    })
    .ok()?;
    let name = found.map_or(LogName { session: 0, segment: 0 }, |(_, name)| name);
    let mut answer = Answer {
        ticket: want.ticket,
        count,
        found: found.map(|(index, _)| index),
        name,
        bytes: 0,
        offset: 0,
    };
    let mut segment = found.and_then(|(_, name)| card.segment(name).ok());
    match &mut segment {
        Some(segment) => answer.bytes = recorded_blocks(card, segment) * Block::LEN_U32,
        None => answer.found = None,
    }
    Some((answer, segment))
}

/// How many blocks hold sectors of the session that the first one names.
fn recorded_blocks<D: BlockDevice>(card: &Card<'_, D>, segment: &mut Segment) -> u32 {
    let blocks = segment.blocks();
    let mut session_of = |index: u32| {
        let mut block = Block::new();
        card.read(segment, index, &mut block).ok()?;
        Header::read(&block.contents).ok().map(|header| header.session)
    };
    let Some(session) = session_of(0) else { return 0 };
    // Below `first` all are; from `end` on none is. One that is torn does not end it.
    let (mut first, mut end) = (1, blocks);
    while first < end {
        let middle = first + (end - first) / 2;
        if (middle..(middle + 2).min(end)).any(|index| session_of(index) == Some(session)) {
            first = middle + 1;
        } else {
            end = middle;
        }
    }
    first
}

/// Copies what there is from `offset` on; how many bytes.
fn copy<D: BlockDevice>(
    card: &Card<'_, D>,
    segment: &mut Segment,
    bytes: u32,
    offset: u32,
    to: &mut [u8],
) -> usize {
    let wanted = (bytes.saturating_sub(offset) as usize).min(to.len()).min(DATA_MAX);
    let mut block = Block::new();
    let mut done = 0;
    while done < wanted {
        let at = offset + done as u32;
        if card.read(segment, at / Block::LEN_U32, &mut block).is_err() {
            break;
        }
        let from = block.contents.get((at % Block::LEN_U32) as usize..).unwrap_or_default();
        let count = from.len().min(wanted - done);
        if let (Some(to), Some(from)) = (to.get_mut(done..done + count), from.get(..count)) {
            to.copy_from_slice(from);
        }
        done += count;
    }
    done
}
