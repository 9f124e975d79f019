//! Sectors to segments: one session's log on whatever card is there.
//!
//! A sector with number `n` belongs at block `n - base` of the open segment. A segment is left for the next one at the
//! first group that no longer fits, so that each file can be read by itself. A *partial* sector (one still in progress)
//! is written alternately at its own place and at the next one, so that a torn write never takes the older copy with it.
//! Where the newest copy lies at the sector's own place, the whole sector is first written as a copy at the next one.
//!
//! Each stretch of a segment has its parity at the segment's end: written when it is full, when the segment is left, when the
//! log ends in order, and every 10 s meanwhile. It may fail without consequence: the sectors themselves are there.
//!
//! What fails is tried again, then given a new segment, then the card is given up and looked for once a second. A
//! sector is only counted lost when it can never be written: the caller keeps it until then.

mod before;
mod segments;
mod socket;
mod trouble;

use core::cell::RefCell;

use embedded_sdmmc::Block;
use heapless::Vec;
use hums_blackbox::parity::{STRETCH_SECTORS, data_blocks, parity_block};
use hums_blackbox::{GROUP_SECTORS, Sector};
use hums_core::clock::{Instant, Span};

use crate::CardDevice;
use crate::card::{Card, CardError};
use crate::format::FormatError;
use crate::name::LogName;
use crate::parity::Parity;
use crate::status::{CardState, CardStatus};
use segments::{Log, NewestCopy, Segments};
use socket::Socket;
use trouble::may_work_elsewhere;

/// How often a missing or failing card is looked for.
const RETRY: Span = Span::from_secs(1);
/// How often a sector is tried before the segment is given up. A card that refuses one block of five at random so comes to
/// a new segment once in 100,000 sectors; the device bounds the time of all tries together.
const WRITE_TRIES: u32 = 8;

/// What became of a sector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Written {
    /// It is on the card.
    Done,
    /// Room on the card is still looked for: keep it and call again at once.
    Searching,
    /// There is no card to write it to now: keep it and try again later.
    Later,
}

/// The segment in work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InWork {
    /// Its name.
    pub name: LogName,
    /// What seals its sectors.
    pub session: u32,
    /// The number of its first sector; 0 where it has none.
    pub first: u32,
    /// How many blocks, from its first one on, hold sectors that are whole. Copies of the sector in progress, behind them, are still
    /// written over.
    pub blocks: u32,
}

/// Blocks of log that are written with one command at most: the gain of more is small, and they take RAM.
const BATCH_BLOCKS: usize = 8;

/// Room for the sectors that are being written, and for their parity. Lent, because the recorder is moved and this, 12 KiB, would come
/// along on the firmware's stack.
#[derive(Default)]
pub struct Buffers {
    batch: RefCell<Vec<Block, BATCH_BLOCKS>>,
    pub(crate) parity: RefCell<Parity>,
}

impl Buffers {
    /// Empty.
    pub const fn new() -> Self {
        Self { batch: RefCell::new(Vec::new()), parity: RefCell::new(Parity::new()) }
    }
}

/// The storage task's state.
pub struct Recorder<'a, D: CardDevice> {
    status: &'a CardStatus,
    buffers: &'a Buffers,
    socket: Socket<'a, D>,
    retry_at: Instant,
    /// The card in the slot is another one than the group's beginning was written to: nothing is readable on it before
    /// the next group.
    await_group: bool,
    segments: Segments<'a>,
    /// How much room this card has was counted.
    room_known: bool,
    finished: bool,
}

impl<'a, D: CardDevice> Recorder<'a, D> {
    /// A recorder for the card in `device`. `entropy` keeps sessions of equal number on equal cards apart: random
    /// where the board has a random number generator, else any number that changes from one power-on to the next.
    pub const fn new(device: D, status: &'a CardStatus, buffers: &'a Buffers, entropy: u32) -> Self {
        let socket = Socket::Waiting(device);
        Self {
            status,
            buffers,
            socket,
            retry_at: Instant::ZERO,
            await_group: false,
            segments: Segments::new(status, entropy),
            room_known: false,
            finished: false,
        }
    }

    /// Looks for a card if there is none, at most once a second, and opens a session on it. [`Written::Done`]: one is open now.
    pub fn ready(&mut self, now: Instant) -> Written {
        self.begin_service();
        if !self.socket.is_mounted() {
            if self.finished || now < self.retry_at {
                return Written::Later;
            }
            self.retry_at = now + RETRY;
            match self.socket.mount(self.status, self.buffers) {
                Ok(true) => {}
                Ok(false) => return Written::Later,
                Err(error) => {
                    self.tell(&error);
                    return Written::Later;
                }
            }
            (self.segments.is_open, self.room_known) = (false, false);
            self.status.set_room(None);
        }
        if self.segments.is_open {
            return Written::Done;
        }
        match self.begin() {
            Ok(()) => Written::Done,
            Err(CardError::Searching) => Written::Searching,
            Err(error) => {
                self.give_up(now, &error);
                Written::Later
            }
        }
    }

    /// Takes a sector to be written; `false`: there is no room for more, [`Self::write`] makes some.
    pub fn take(&mut self, sector: &Sector) -> bool {
        let mut block = Block::new();
        block.contents = *sector.bytes();
        self.buffers.batch.borrow_mut().push(block).is_ok()
    }

    /// Sectors that were taken and are not on the card yet.
    pub fn waiting(&self) -> usize {
        self.buffers.batch.borrow().len()
    }

    /// Forgets them, because there is no card; how many frames are lost with them.
    pub fn abandon(&mut self) -> u64 {
        let mut batch = self.buffers.batch.borrow_mut();
        let frames = batch.iter().map(sector_of).filter(|sector| !sector.is_partial());
        let frames = frames.map(|sector| u64::from(sector.frames())).sum();
        batch.clear();
        frames
    }

    /// Writes sectors that were taken: the oldest, and with the same command those after it that belong right behind
    /// it. With none taken there is nothing to do, which is [`Written::Done`].
    pub fn write(&mut self, now: Instant) -> Written {
        match self.ready(now) {
            Written::Done => {}
            not => return not,
        }
        let Some(first) = self.sector(0) else { return Written::Done };
        self.await_group &= !first.starts_group();
        if self.await_group {
            if !first.is_partial() {
                self.status.count_lost_sector(u32::from(first.frames()));
            }
            self.drop_written(1);
            return Written::Done;
        }
        for tries in 0..WRITE_TRIES {
            // Of a row in which one block was refused, the first alone is more likely to be taken.
            let most = if tries == 0 { usize::MAX } else { 1 };
            match self.try_write(now, &first, most) {
                Ok(()) => {
                    self.count_retries();
                    return Written::Done;
                }
                Err(CardError::Searching) => return Written::Searching,
                Err(error) => {
                    self.count_retries();
                    if !matches!(error, CardError::Full) {
                        self.status.count_write_errors(1);
                    }
                    if !may_work_elsewhere::<D>(&error) {
                        self.lose(now, &error);
                        return Written::Later;
                    }
                }
            }
        }
        // A new segment may lie where the card still works.
        let moved = self.next_segment(true).and_then(|()| {
            self.status.want_group();
            self.try_write(now, &first, 1)
        });
        self.count_retries();
        match moved {
            Ok(()) => Written::Done,
            Err(CardError::Searching) => Written::Searching,
            Err(error) => {
                self.lose(now, &error);
                Written::Later
            }
        }
    }

    fn count_retries(&self) {
        self.status.count_write_errors(self.socket.take_retries());
    }

    /// With nothing to write: looks for where the session before ended, once the session has a sector on the card, gives the
    /// segment its date, once it is known, and counts a little further how much room there is on the card.
    pub fn idle(&mut self) {
        let Some(card) = self.socket.card() else { return };
        if self.segments.has_sector() {
            self.segments.look_before(card);
            self.segments.date(card);
        }
        if self.room_known {
            return;
        }
        // The next write meets the same trouble and deals with it.
        let _ = card.search_on();
        match card.count_room() {
            Ok(None) => {}
            Ok(room) => {
                self.status.set_room(room);
                self.room_known = true;
            }
            Err(_) => self.room_known = true,
        }
    }

    /// Ends the session: nothing more is written, and the card can be pulled.
    pub fn finish(&mut self) {
        self.finished = true;
        self.write_parity();
        if self.socket.is_mounted() {
            self.status.set_state(CardState::Finished);
        }
        self.socket.release();
    }

    /// The segment in work.
    fn open_segment(&self) -> Option<Log> {
        self.segments.log.filter(|_| self.socket.is_mounted() && self.segments.is_open)
    }

    /// The name of the segment in work.
    pub fn log_name(&self) -> Option<LogName> {
        self.open_segment().map(|log| log.name)
    }

    /// What of the segment in work no longer changes. What lies behind it, also where it has nothing yet, is left over.
    pub fn in_work(&self) -> Option<InWork> {
        let log = self.open_segment()?;
        let blocks = log.base.map_or(0, |_| self.buffers.parity.borrow().end());
        Some(InWork { name: log.name, session: log.session, first: log.base.unwrap_or(0), blocks })
    }

    /// The card, for serving stored logs; `None` while there is none.
    pub const fn card(&mut self) -> Option<&mut Card<'a, D>> {
        self.socket.card()
    }

    /// Gives the device back, with whatever is on it.
    pub fn into_device(self) -> Option<D> {
        self.socket.into_device()
    }

    /// Formats the card if somebody asked for it, a little at each call; whether there was something to do: call again
    /// at once. What is on the card is lost; a new session begins on it.
    pub fn format(&mut self, now: Instant) -> bool {
        if self.status.take_format_wanted() && !self.finished {
            self.retry_at = now + RETRY;
            if self.socket.begin_format(self.segments.volume_id(now)) {
                self.status.set_state(CardState::Formatting);
            }
        }
        self.begin_service();
        match self.socket.format() {
            None => return false,
            Some(Ok(false)) => {}
            Some(Ok(true)) => self.retry_at = now,
            Some(Err(FormatError::Device(error))) => self.tell(&CardError::Device(error)),
            Some(Err(FormatError::TooSmall)) => self.status.set_state(CardState::Foreign),
        }
        true
    }

    fn begin_service(&self) {
        self.status.begin_service();
        self.socket.begin_service();
    }

    /// Writes the sector that waits first, and of those behind it so many as belong there, `most` in all.
    fn try_write(&mut self, now: Instant, first: &Sector, most: usize) -> Result<(), CardError<D::Error>> {
        let number = first.number();
        if self.must_move(first)? {
            self.next_segment(false)?;
        }
        let mut log = self.segments.log.ok_or(CardError::NotOpen)?;
        let mut at = number.wrapping_sub(*log.base.get_or_insert(number));
        let blocks = data_blocks(self.mounted()?.open_blocks());
        let has_next = at + 1 < blocks;
        let count = if first.is_partial() {
            let further = log.newest_copy != NewestCopy::Further && has_next;
            at += u32::from(further);
            log.newest_copy = if further { NewestCopy::Further } else { NewestCopy::InPlace };
            1
        } else {
            if log.newest_copy == NewestCopy::InPlace && has_next {
                self.write_copy(log.session, at + 1)?;
            }
            // A card may erase the blocks of a command before they come (SD specification, 4.3.4), and a copy lies in the second.
            let alone = core::mem::replace(&mut log.newest_copy, NewestCopy::None) != NewestCopy::None;
            self.begin_stretch(at / STRETCH_SECTORS);
            let in_stretch = STRETCH_SECTORS - at % STRETCH_SECTORS;
            let most = if alone { 1 } else { most.min((blocks - at).min(in_stretch) as usize) };
            self.count_in_row(number, most)
        };
        let written = self.write_sealed(&log, at, count)?;
        self.status.count_blocks(written as u32);
        self.segments.log = Some(log);
        let is_closed = self.add_to_parity(now, at, written);
        self.drop_written(written);
        if is_closed || self.buffers.parity.borrow().is_overdue(now) {
            self.write_parity();
        }
        Ok(())
    }

    /// The next sector is of this stretch.
    fn begin_stretch(&mut self, stretch: u32) {
        if self.buffers.parity.borrow().stretch() != stretch {
            self.write_parity();
            self.buffers.parity.borrow_mut().begin(stretch);
        }
    }

    /// The first sectors that wait are on the card, from block `at` on; whether the log ends in order with one of them.
    fn add_to_parity(&self, now: Instant, at: u32, written: usize) -> bool {
        let (batch, mut parity) = (self.buffers.batch.borrow(), self.buffers.parity.borrow_mut());
        let mut is_closed = false;
        for (at, block) in (at..).zip(batch.iter().take(written)) {
            let sector = sector_of(block);
            if !sector.is_partial() {
                parity.add(now, at, sector.bytes());
                is_closed |= sector.is_closed();
            }
        }
        is_closed
    }

    /// Writes the parity of the stretch in work, if there is any that is not on the card. What fails is counted.
    fn write_parity(&mut self) {
        let buffers = self.buffers;
        let mut parity = buffers.parity.borrow_mut();
        let Some(Log { session, base: Some(base), .. }) = self.segments.log else { return };
        let Some(card) = self.socket.card().filter(|_| parity.is_due()) else { return };
        let mut at = parity_block(card.open_blocks(), parity.stretch());
        let mut blocks = parity.blocks(session, base);
        while !blocks.is_empty() {
            let Ok(written) = card.write(at, blocks) else {
                self.status.count_write_errors(1);
                return;
            };
            self.status.count_blocks(written as u32);
            at += written as u32;
            blocks = blocks.get(written..).unwrap_or_default();
        }
    }

    /// Writes the first sector that waits as a partial copy, at the place after its own: a torn write at its own place then
    /// takes nothing with it.
    #[inline(never)]
    fn write_copy(&mut self, session: u32, at: u32) -> Result<(), CardError<D::Error>> {
        let mut batch = self.buffers.batch.borrow_mut();
        let block = batch.get_mut(..1).ok_or(CardError::NotOpen)?;
        mark(block, Some(session));
        let written = self.mounted().and_then(|card| card.write(at, block));
        mark(block, None);
        written.map(|_| ())
    }

    fn write_sealed(&mut self, log: &Log, at: u32, count: usize) -> Result<usize, CardError<D::Error>> {
        let mut batch = self.buffers.batch.borrow_mut();
        let batch = batch.get_mut(..count).ok_or(CardError::NotOpen)?;
        for block in batch.iter_mut() {
            let mut sector = sector_of(block);
            sector.seal(log.session);
            block.contents = *sector.bytes();
        }
        self.mounted()?.write(at, batch)
    }

    /// Whether this sector belongs into a new segment.
    fn must_move(&mut self, sector: &Sector) -> Result<bool, CardError<D::Error>> {
        let Some(Log { base: Some(base), .. }) = self.segments.log else { return Ok(false) };
        let blocks = data_blocks(self.mounted()?.open_blocks());
        let at = sector.number().wrapping_sub(base);
        if at >= blocks {
            // Also a number from before this segment (a restarted count) gets a segment of its own.
            return Ok(true);
        }
        let fits = at.saturating_add(GROUP_SECTORS as u32) <= blocks;
        Ok(at > 0 && !fits && sector.starts_group())
    }

    /// How many of the sectors that wait, the first one being sector `number`, go right behind each other: full ones,
    /// and only the first may begin a group, because a segment may end before the next.
    fn count_in_row(&self, number: u32, max: usize) -> usize {
        let batch = self.buffers.batch.borrow();
        let follows = |(index, block): &(usize, &Block)| {
            let sector = sector_of(block);
            let in_order = sector.number() == number.wrapping_add(*index as u32);
            *index == 0 || in_order && !sector.is_partial() && !sector.starts_group()
        };
        batch.iter().enumerate().take(max).take_while(follows).count()
    }

    fn sector(&self, index: usize) -> Option<Sector> {
        self.buffers.batch.borrow().get(index).map(sector_of)
    }

    fn drop_written(&self, count: usize) {
        self.buffers.batch.borrow_mut().drain(..count);
    }

    /// Opens a segment on a card just mounted.
    fn begin(&mut self) -> Result<(), CardError<D::Error>> {
        let card = self.socket.card().ok_or(CardError::NotOpen)?;
        let begun = self.segments.begin(card);
        self.buffers.parity.borrow_mut().begin(0);
        self.await_group = begun?;
        Ok(())
    }

    /// Leaves the open segment for the next one, a short one where the open one did not take a sector.
    fn next_segment(&mut self, is_short: bool) -> Result<(), CardError<D::Error>> {
        self.write_parity();
        let next = self.segments.next(is_short, self.socket.card().ok_or(CardError::NotOpen)?);
        self.buffers.parity.borrow_mut().begin(0);
        next
    }

    fn mounted(&mut self) -> Result<&mut Card<'a, D>, CardError<D::Error>> {
        self.card().ok_or(CardError::NotOpen)
    }

    /// The card in work is given up. The next one may be another one, for which only what comes from a group's start on
    /// can be read: the sooner there is one, the less is lost.
    fn lose(&mut self, now: Instant, error: &CardError<D::Error>) {
        self.status.want_group();
        self.give_up(now, error);
    }

    fn give_up(&mut self, now: Instant, error: &CardError<D::Error>) {
        self.tell(error);
        self.retry_at = now + RETRY;
        self.socket.release();
    }

    fn tell(&self, error: &CardError<D::Error>) {
        self.status.set_state(trouble::state::<D>(error));
    }
}

/// Makes the block's sector a partial copy for this session, or the sector itself again.
#[inline(never)]
fn mark(block: &mut [Block], session: Option<u32>) {
    for block in block {
        let mut sector = sector_of(block);
        sector.set_partial(session.is_some());
        sector.seal(session.unwrap_or_default());
        block.contents = *sector.bytes();
    }
}

fn sector_of(block: &Block) -> Sector {
    Sector::from_bytes(block.contents)
}
