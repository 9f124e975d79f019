//! Sectors to segments: one session's log on the present card.
//!
//! A sector with number `n` belongs at block `n - base` of the open segment. A segment is left for the next one at
//! the first group that no longer fits, so that each file can be read by itself. A *partial* sector (one in progress)
//! goes alternately to its own place and to the next one, so a torn write never destroys the older copy. If the
//! newest copy is at the sector's own place, the whole sector is first written as a copy at the next one.
//!
//! Each stretch of a segment has its parity at the segment's end. It is written when the stretch is full, when the
//! segment is left, when the log ends in order, and every 10 s meanwhile. It may fail without consequence: the
//! sectors themselves are there.
//!
//! A failed write is tried again, then with a new segment; then the card is given up and looked for once a second. A
//! sector counts as lost only when it can never be written: the caller keeps it until then.

mod before;
mod segments;
mod trouble;

use core::cell::RefCell;

use crate::{Block, CardDevice};
use hums_blackbox::parity::{STRETCH_SECTORS, data_blocks, parity_block};
use hums_blackbox::{GROUP_SECTORS, Sector};
use hums_core::clock::{Instant, Span};

use crate::card::{Card, CardError};
use crate::format::{FormatError, Formatting};
use crate::name::LogName;
use crate::parity::Parity;
use crate::status::{CardState, CardStatus};
use segments::{Log, NewestCopy, Segments};
use trouble::may_work_elsewhere;

const RETRY: Span = Span::from_secs(1);
/// How often a sector is tried before the segment is given up. A card that refuses one block of five at random then needs a new
/// segment once in 100,000 sectors.
const WRITE_TRIES: u32 = 8;

/// Reasons to wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitReason {
    /// The search for room goes on: call again at once.
    Searching,
    /// No card can be written now: try again later.
    Later,
}

/// The segment in work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OpenLog {
    /// Its name.
    pub name: LogName,
    /// The session number in the seal of its sectors.
    pub session: u32,
    /// 0 without sectors.
    pub first: u32,
    /// Blocks of finished sectors, from the first one on. Copies of the sector in progress, behind them, are still
    /// overwritten.
    pub blocks: u32,
}

/// Maximum blocks of log in one command. They keep their places in the queue until the card has taken all.
pub const ROW_BLOCKS: usize = 4;

/// The parity buffer, 8 KiB. It is lent, because the recorder is moved and would take it along on the firmware's
/// stack.
pub struct Buffers {
    pub(crate) parity: RefCell<Parity>,
}

impl Buffers {
    /// Empty.
    pub const fn new() -> Self {
        Self { parity: RefCell::new(Parity::new()) }
    }

    /// The memory as plain blocks, for a program without a recorder.
    pub fn blocks(&mut self) -> &mut [Block] {
        self.parity.get_mut().lend()
    }
}

/// The storage task's state.
pub struct Recorder<'a, D: CardDevice> {
    status: &'a CardStatus,
    buffers: &'a Buffers,
    device: &'a D,
    card: Option<Card<'a, D>>,
    formatting: Option<Formatting>,
    retry_at: Instant,
    /// The card was changed within a group: on the new card nothing is readable before the next group.
    await_group: bool,
    segments: Segments<'a>,
    room_known: bool,
    finished: bool,
}

impl<'a, D: CardDevice> Recorder<'a, D> {
    /// A recorder for the card in `device`. `entropy` distinguishes sessions of equal number on equal cards: a random
    /// number, or any number that changes with each power-on.
    pub const fn new(device: &'a D, status: &'a CardStatus, buffers: &'a Buffers, entropy: u32) -> Self {
        Self {
            status,
            buffers,
            device,
            card: None,
            formatting: None,
            retry_at: Instant::ZERO,
            await_group: false,
            segments: Segments::new(status, entropy),
            room_known: false,
            finished: false,
        }
    }

    fn ready(&mut self, now: Instant) -> Result<(), WaitReason> {
        self.begin_service();
        if self.card.is_none() {
            if self.finished || now < self.retry_at {
                return Err(WaitReason::Later);
            }
            self.retry_at = now + RETRY;
            if self.formatting.is_some() {
                return Err(WaitReason::Later);
            }
            if let Err(error) = self.mount() {
                self.tell(&error);
                return Err(WaitReason::Later);
            }
            (self.segments.is_open, self.room_known) = (false, false);
            self.status.change(|card| (card.room_permille, card.storage_mib) = (None, None));
        }
        if self.segments.is_open {
            return Ok(());
        }
        self.begin().map_err(|error| self.not_yet(now, &error))
    }

    // Not inlined: a moved card must not lie on the stack below later calls.
    #[inline(never)]
    fn mount(&mut self) -> Result<(), CardError<D::Error>> {
        self.device.reset();
        self.card = Some(Card::mount(self.device, self.status, self.buffers)?);
        Ok(())
    }

    /// Writes waiting sectors: the first, and with the same command those that belong right behind it. Returns the
    /// number of finished ones, which are to be dropped. Without sectors it opens a session, so that the card's state
    /// is known early.
    pub fn write(&mut self, now: Instant, waiting: &mut [Block]) -> Result<usize, WaitReason> {
        self.ready(now)?;
        let Some(first) = waiting.first().map(sector_of) else { return Ok(0) };
        self.await_group &= !first.starts_group();
        if self.await_group {
            if !first.is_partial() {
                self.status.change(|card| {
                    card.sectors_lost += 1;
                    card.frames_lost += u32::from(first.frames());
                });
            }
            return Ok(1);
        }
        for tries in 0..WRITE_TRIES {
            // After a refused row, the first block alone is more likely to be taken.
            let most = waiting.len().min(if tries == 0 { ROW_BLOCKS } else { 1 });
            let written = self.try_write(now, &first, waiting.get_mut(..most).unwrap_or_default());
            self.count_retries();
            match written {
                Ok(count) => return Ok(count),
                Err(CardError::Searching) => return Err(WaitReason::Searching),
                Err(error) => {
                    if !matches!(error, CardError::Full) {
                        self.status.count_write_errors(1);
                    }
                    if !may_work_elsewhere::<D>(&error) {
                        return Err(self.lose(now, &error));
                    }
                }
            }
        }
        // A new segment may lie where the card still works.
        let moved = self.next_segment(true).and_then(|()| {
            self.status.want_group();
            self.try_write(now, &first, waiting.get_mut(..1).unwrap_or_default())
        });
        self.count_retries();
        moved.map_err(|error| self.lose(now, &error))
    }

    fn count_retries(&self) {
        self.status.count_write_errors(self.device.take_retries());
    }

    /// Work for times without writes: finds the end of the previous session, dates the segment, and continues the
    /// count of room. The first needs a sector of this session on the card, the second the date.
    pub fn idle(&mut self) {
        let Some(card) = &mut self.card else { return };
        if self.segments.has_sector() {
            self.segments.look_before(card);
            self.segments.date(card);
        }
        let _ = card.look_ahead();
        // An error ends the count.
        self.room_known = self.room_known || !matches!(card.count_room(), Ok(false));
    }

    /// The card can be pulled.
    pub fn finish(&mut self) {
        self.finished = true;
        self.write_parity();
        if self.card.take().is_some() {
            self.status.set_state(CardState::Finished);
        }
    }

    fn open_segment(&self) -> Option<Log> {
        self.segments.log.filter(|_| self.card.is_some() && self.segments.is_open)
    }

    /// The name of the segment in work.
    pub fn log_name(&self) -> Option<LogName> {
        self.open_segment().map(|log| log.name)
    }

    /// Finished part; data behind it is old.
    pub fn in_work(&self) -> Option<OpenLog> {
        let log = self.open_segment()?;
        let blocks = log.base.map_or(0, |_| self.buffers.parity.borrow().end());
        Some(OpenLog { name: log.name, session: log.session, first: log.base.unwrap_or(0), blocks })
    }

    /// The card, for stored logs; `None` without one.
    pub const fn card(&mut self) -> Option<&mut Card<'a, D>> {
        self.card.as_mut()
    }

    /// Formats the card on request, a little at each call; returns whether to call again at once. All data on the
    /// card is lost; a new session begins on it.
    pub fn format(&mut self, now: Instant) -> bool {
        if self.status.take_format_wanted() && !self.finished {
            self.retry_at = now + RETRY;
            // A card that could be mounted since the command is never formatted.
            if self.card.is_none() && self.formatting.is_none() {
                self.device.recheck();
                self.formatting = Some(Formatting::new(self.segments.volume_id(now)));
                self.status.set_state(CardState::Formatting);
            }
        }
        self.begin_service();
        let Some(formatting) = &mut self.formatting else { return false };
        let done = formatting.step(self.device);
        if !matches!(done, Ok(false)) {
            self.formatting = None;
        }
        match done {
            Ok(false) => {}
            Ok(true) => self.retry_at = now,
            Err(FormatError::Device(error)) => self.tell(&CardError::Device(error)),
            Err(FormatError::TooSmall) => self.status.set_state(CardState::Foreign),
        }
        true
    }

    fn begin_service(&self) {
        self.status.begin_service();
        self.device.begin_service();
    }

    fn try_write(
        &mut self,
        now: Instant,
        first: &Sector,
        waiting: &mut [Block],
    ) -> Result<usize, CardError<D::Error>> {
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
                self.write_copy(log.session, at + 1, waiting)?;
            }
            // A card may erase the blocks of a command before they come (SD specification, 4.3.4), and a copy lies in the second.
            let alone = core::mem::replace(&mut log.newest_copy, NewestCopy::None) != NewestCopy::None;
            self.begin_stretch(at / STRETCH_SECTORS);
            let in_stretch = STRETCH_SECTORS - at % STRETCH_SECTORS;
            let most = if alone { 1 } else { (blocks - at).min(in_stretch) as usize };
            count_in_row(number, waiting).min(most)
        };
        let row = waiting.get_mut(..count).ok_or(CardError::NotOpen)?;
        seal(row, None, log.session);
        let written = self.mounted()?.write(at, row)?;
        self.status.count_blocks(written as u32);
        self.segments.log = Some(log);
        let is_closed = self.add_to_parity(now, at, row.get(..written).unwrap_or_default());
        if is_closed || self.buffers.parity.borrow().is_overdue(now) {
            self.write_parity();
        }
        Ok(written)
    }

    fn begin_stretch(&mut self, stretch: u32) {
        if self.buffers.parity.borrow().stretch() != stretch {
            self.write_parity();
            self.buffers.parity.borrow_mut().begin(stretch);
        }
    }

    /// Adds sectors that were written from block `at` on; whether the log ends in order with one of them.
    fn add_to_parity(&self, now: Instant, at: u32, written: &[Block]) -> bool {
        let mut parity = self.buffers.parity.borrow_mut();
        let mut is_closed = false;
        for (at, block) in (at..).zip(written) {
            let sector = sector_of(block);
            if !sector.is_partial() {
                parity.add(now, at, sector.bytes());
                is_closed |= sector.is_closed();
            }
        }
        is_closed
    }

    /// A failure is counted.
    fn write_parity(&mut self) {
        let buffers = self.buffers;
        let mut parity = buffers.parity.borrow_mut();
        let Some(Log { session, base: Some(base), .. }) = self.segments.log else { return };
        let Some(card) = self.card.as_mut().filter(|_| parity.is_due()) else { return };
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

    /// Writes the first waiting sector as a partial copy, at the place after its own: a torn write at its own place
    /// then destroys nothing.
    #[inline(never)]
    fn write_copy(
        &mut self,
        session: u32,
        at: u32,
        waiting: &mut [Block],
    ) -> Result<(), CardError<D::Error>> {
        let first = waiting.get_mut(..1).ok_or(CardError::NotOpen)?;
        seal(first, Some(true), session);
        let written = self.mounted().and_then(|card| card.write(at, first));
        seal(first, Some(false), session);
        written.map(|_| ())
    }

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

    /// Just mounted.
    fn begin(&mut self) -> Result<(), CardError<D::Error>> {
        let card = self.card.as_mut().ok_or(CardError::NotOpen)?;
        let begun = self.segments.begin(card);
        self.buffers.parity.borrow_mut().begin(0);
        self.await_group = begun?;
        Ok(())
    }

    fn next_segment(&mut self, is_short: bool) -> Result<(), CardError<D::Error>> {
        self.write_parity();
        let next = self.segments.next(is_short, self.card.as_mut().ok_or(CardError::NotOpen)?);
        self.buffers.parity.borrow_mut().begin(0);
        next
    }

    fn mounted(&mut self) -> Result<&mut Card<'a, D>, CardError<D::Error>> {
        self.card().ok_or(CardError::NotOpen)
    }

    /// Gives the card up. The next one may be another one, on which only data from a group's start on is readable: an
    /// early group start loses least.
    fn lose(&mut self, now: Instant, error: &CardError<D::Error>) -> WaitReason {
        if !matches!(error, CardError::Searching) {
            self.status.want_group();
        }
        self.not_yet(now, error)
    }

    /// The consequence of an error for the waiting sectors. A card is given up unless it is being searched.
    fn not_yet(&mut self, now: Instant, error: &CardError<D::Error>) -> WaitReason {
        if matches!(error, CardError::Searching) {
            return WaitReason::Searching;
        }
        self.tell(error);
        self.retry_at = now + RETRY;
        self.card = None;
        WaitReason::Later
    }

    fn tell(&self, error: &CardError<D::Error>) {
        self.status.set_state(trouble::state::<D>(error));
    }
}

/// The number of waiting sectors, from sector `number` on, that go right behind each other. All are full ones, and
/// only the first may begin a group, because a segment may end before the next.
fn count_in_row(number: u32, waiting: &[Block]) -> usize {
    let follows = |(index, block): &(usize, &Block)| {
        let sector = sector_of(block);
        let in_order = sector.number() == number.wrapping_add(*index as u32);
        *index == 0 || in_order && !sector.is_partial() && !sector.starts_group()
    };
    waiting.iter().enumerate().take_while(follows).count()
}

#[inline(never)]
fn seal(blocks: &mut [Block], partial: Option<bool>, session: u32) {
    for block in blocks {
        let mut sector = sector_of(block);
        if let Some(partial) = partial {
            sector.set_partial(partial);
        }
        sector.seal(session);
        *block = *sector.bytes();
    }
}

const fn sector_of(block: &Block) -> Sector {
    Sector::from_bytes(*block)
}
