//! Sectors to segments: one session's log on whatever card is there.
//!
//! A sector with number `n` belongs at block `n - base` of the open segment. A segment is left for the next one at the
//! first group that no longer fits, so that each file can be read by itself. A *partial* sector (one still in progress)
//! is written alternately at its own place and at the next one, so that a torn write never takes the older copy with it.
//!
//! Of what a disarmed vehicle sends, when it is recorded by arming, only the last while is kept: small segments in a
//! ring, of which the oldest is renamed and written anew once those after it hold enough. The monitor says when
//! ([`CardStatus::wait_from`]) and says so in the record.
//!
//! What fails is tried again, then given a new segment, then the card is given up and looked for once a second. A
//! sector is only counted lost when it can never be written: the caller keeps it until then.

mod formatting;
mod trouble;

use embedded_sdmmc::Block;
use hums_blackbox::{GROUP_SECTORS, SECTOR_BYTES, Sector};
use hums_core::time::{Instant, Span};

use crate::CardDevice;
use crate::card::{Card, CardError, LogEntry};
use crate::format::Formatting;
use crate::gate::HeldBlocks;
use crate::name::LogName;
use crate::ring::{self, Ring};
use crate::status::{CardState, CardStatus};
use trouble::may_work_elsewhere;

/// Bytes of a segment on a card with room for many: an hour of a busy vehicle.
pub const SEGMENT_BYTES_MAX: u32 = 8 * 1024 * 1024;
/// Segments that even a small card should hold, so that overwriting the oldest loses little.
const SEGMENTS_MIN: u64 = 16;
/// How often a missing or failing card is looked for.
const RETRY: Span = Span::from_secs(1);
/// How often one block is tried before the segment is given up.
const WRITE_TRIES: u32 = 3;

/// What became of a sector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Written {
    /// It is on the card.
    Done,
    /// There is no card to write it to now: keep it and try again later.
    Later,
}

/// The storage task's state.
pub struct Recorder<'a, D: CardDevice> {
    status: &'a CardStatus,
    held: &'a HeldBlocks,
    /// Any number that differs from one power-on to the next.
    entropy: u32,
    slot: Slot<'a, D>,
    retry_at: Instant,
    log: Option<Log>,
    /// The card in the slot is another one than the group's beginning was written to: nothing is readable on it before
    /// the next group.
    await_group: bool,
    /// The segments of a disarmed vehicle.
    ring: Ring,
    /// How much room this card has was counted.
    room_known: bool,
    finished: bool,
}

// One of these exists, in a static: the size of the largest variant is the budget.
#[allow(clippy::large_enum_variant)]
enum Slot<'a, D: CardDevice> {
    /// The device, while no usable card is in it.
    Waiting(D),
    Mounted(Card<'a, D>),
    /// A card that is being formatted.
    Formatting(D, Formatting),
    /// Only while the value is being replaced.
    Moving,
}

/// The session's log on the card that is in.
#[derive(Clone, Copy)]
struct Log {
    name: LogName,
    /// What seals its sectors.
    session: u32,
    volume_id: u32,
    /// The sector number at block 0 of the open segment; `None` before the first sector.
    base: Option<u32>,
    /// Where the next partial sector goes: at its own place, or one further.
    partial_further: bool,
}

impl<'a, D: CardDevice> Recorder<'a, D> {
    /// A recorder for the card in `device`. `entropy` keeps sessions of equal number on equal cards apart: random
    /// where the board has a random number generator, else any number that changes from one power-on to the next.
    pub const fn new(device: D, status: &'a CardStatus, held: &'a HeldBlocks, entropy: u32) -> Self {
        let slot = Slot::Waiting(device);
        Self {
            status,
            held,
            entropy,
            slot,
            retry_at: Instant::ZERO,
            log: None,
            await_group: false,
            ring: Ring::new(),
            room_known: false,
            finished: false,
        }
    }

    /// Looks for a card if there is none, at most once a second. Whether a session is open now.
    pub fn ready(&mut self, now: Instant) -> bool {
        self.begin_service();
        if matches!(self.slot, Slot::Mounted(_)) {
            return true;
        }
        if self.finished || now < self.retry_at {
            return false;
        }
        self.retry_at = now + RETRY;
        if !self.mount() {
            return false;
        }
        self.room_known = false;
        self.status.set_room_permille(None);
        match self.begin(now) {
            Ok(()) => true,
            Err(error) => {
                self.give_up(now, &error);
                false
            }
        }
    }

    /// Not within its caller: the volumes that are moved here are not to lie on the stack below what follows.
    #[inline(never)]
    fn mount(&mut self) -> bool {
        let Slot::Waiting(device) = core::mem::replace(&mut self.slot, Slot::Moving) else { return false };
        device.reset();
        match Card::mount(device, self.status, self.held) {
            Ok(card) => {
                self.slot = Slot::Mounted(card);
                true
            }
            Err((device, error)) => {
                self.slot = Slot::Waiting(device);
                self.tell(&error);
                false
            }
        }
    }

    /// Takes a sector to be written; `false`: there is no room for more, [`Self::write`] makes some.
    pub fn take(&mut self, sector: &Sector) -> bool {
        let mut block = Block::new();
        block.contents = *sector.bytes();
        self.held.batch.borrow_mut().push(block).is_ok()
    }

    /// Sectors that were taken and are not on the card yet.
    pub fn waiting(&self) -> usize {
        self.held.batch.borrow().len()
    }

    /// Forgets them, because there is no card; how many frames are lost with them.
    pub fn abandon(&mut self) -> u64 {
        let mut batch = self.held.batch.borrow_mut();
        let frames = batch.iter().map(sector_of).filter(|sector| !sector.is_partial());
        let frames = frames.map(|sector| u64::from(sector.frames())).sum();
        batch.clear();
        frames
    }

    /// Writes sectors that were taken: the oldest, and with the same command those after it that belong right behind
    /// it. With none taken there is nothing to do, which is [`Written::Done`].
    pub fn write(&mut self, now: Instant) -> Written {
        if !self.ready(now) {
            return Written::Later;
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
        for _ in 0..WRITE_TRIES {
            match self.try_write(now, &first) {
                Ok(()) => {
                    self.count_retries();
                    return Written::Done;
                }
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
        let moved = self.next_segment(now).and_then(|()| {
            self.status.want_group();
            self.try_write(now, &first)
        });
        self.count_retries();
        match moved {
            Ok(()) => Written::Done,
            Err(error) => {
                self.lose(now, &error);
                Written::Later
            }
        }
    }

    fn begin_service(&self) {
        match &self.slot {
            Slot::Waiting(device) | Slot::Formatting(device, _) => device.begin_service(),
            Slot::Mounted(card) => card.device(D::begin_service).unwrap_or_default(),
            Slot::Moving => {}
        }
    }

    fn count_retries(&self) {
        if let Slot::Mounted(card) = &self.slot {
            self.status.count_write_errors(card.device(D::take_retries).unwrap_or_default());
        }
    }

    /// With nothing to write: counts a little further how much room there is on the card.
    pub fn idle(&mut self) {
        if self.room_known {
            return;
        }
        let Slot::Mounted(card) = &mut self.slot else { return };
        match card.count_room() {
            Ok(None) => {}
            Ok(room) => {
                self.status.set_room_permille(room);
                self.room_known = true;
            }
            // The next write meets the same trouble and deals with it.
            Err(_) => self.room_known = true,
        }
    }

    /// Ends the session: nothing more is written, and the card can be pulled.
    pub fn finish(&mut self) {
        self.finished = true;
        if matches!(self.slot, Slot::Mounted(_)) {
            self.status.set_state(CardState::Finished);
        }
        self.release();
    }

    /// The name of the segment in work.
    pub fn log_name(&self) -> Option<LogName> {
        self.log.filter(|_| matches!(self.slot, Slot::Mounted(_))).map(|log| log.name)
    }

    /// The card, for serving stored logs; `None` while there is none.
    pub const fn card(&mut self) -> Option<&mut Card<'a, D>> {
        if let Slot::Mounted(card) = &mut self.slot { Some(card) } else { None }
    }

    /// Gives the device back, with whatever is on it.
    pub fn into_device(mut self) -> Option<D> {
        self.release();
        if let Slot::Waiting(device) = self.slot { Some(device) } else { None }
    }

    fn try_write(&mut self, now: Instant, first: &Sector) -> Result<(), CardError<D::Error>> {
        let number = first.number();
        let keep = self.status.waiting().filter(|(from, _)| number >= *from).map(|(_, keep)| keep);
        self.ring.keep(keep);
        if self.must_move(now, first)? {
            self.next_segment(now)?;
        }
        let mut log = self.log.ok_or(CardError::NotOpen)?;
        if self.ring.is_empty() {
            // The segment of the power-on is the first that may go.
            self.ring.begin(log.name, now);
        }
        let mut at = number.wrapping_sub(*log.base.get_or_insert(number));
        let blocks = self.mounted()?.open_blocks();
        let count = if first.is_partial() {
            if log.partial_further && at + 1 < blocks {
                at += 1;
            }
            log.partial_further = !log.partial_further;
            1
        } else {
            log.partial_further = true;
            self.count_in_row(number, (blocks - at) as usize)
        };
        let written = self.write_sealed(&log, at, count)?;
        self.status.count_blocks(written as u32);
        self.log = Some(log);
        self.drop_written(written);
        Ok(())
    }

    fn write_sealed(&mut self, log: &Log, at: u32, count: usize) -> Result<usize, CardError<D::Error>> {
        let mut batch = self.held.batch.borrow_mut();
        let batch = batch.get_mut(..count).ok_or(CardError::NotOpen)?;
        for block in batch.iter_mut() {
            let mut sector = sector_of(block);
            sector.seal(log.session);
            block.contents = *sector.bytes();
        }
        self.mounted()?.write(at, batch)
    }

    /// Whether this sector belongs into a new segment.
    fn must_move(&mut self, now: Instant, sector: &Sector) -> Result<bool, CardError<D::Error>> {
        let Some(Log { base: Some(base), .. }) = self.log else { return Ok(false) };
        let blocks = self.mounted()?.open_blocks();
        let at = sector.number().wrapping_sub(base);
        if at >= blocks {
            // Also a number from before this segment (a restarted count) gets a segment of its own.
            return Ok(true);
        }
        if self.ring.asks_for_group(now) {
            self.status.want_group();
        }
        let fits = at.saturating_add(GROUP_SECTORS as u32) <= blocks;
        Ok(sector.starts_group() && at > 0 && (!fits || self.ring.is_due(now)))
    }

    /// How many of the sectors that wait, the first one being sector `number`, go right behind each other: full ones,
    /// and only the first may begin a group, because a segment may end before the next.
    fn count_in_row(&self, number: u32, max: usize) -> usize {
        let batch = self.held.batch.borrow();
        let follows = |(index, block): &(usize, &Block)| {
            let sector = sector_of(block);
            let in_order = sector.number() == number.wrapping_add(*index as u32);
            *index == 0 || in_order && !sector.is_partial() && !sector.starts_group()
        };
        batch.iter().enumerate().take(max).take_while(follows).count()
    }

    fn sector(&self, index: usize) -> Option<Sector> {
        self.held.batch.borrow().get(index).map(sector_of)
    }

    fn drop_written(&self, count: usize) {
        self.held.batch.borrow_mut().drain(..count);
    }

    /// Opens a segment on a card just mounted: the session goes on where the same card came back, and is a new one on
    /// another card.
    fn begin(&mut self, now: Instant) -> Result<(), CardError<D::Error>> {
        let volume_id = self.mounted()?.layout().volume_id;
        let newest = self.survey(LogName { session: 0, segment: 0 })?.newest;
        let resumed = self.log.filter(|log| log.volume_id == volume_id && newest == Some(log.name));
        let log = if let Some(log) = resumed {
            log
        } else {
            let name = newest.map_or(Some(LogName { session: 1, segment: 0 }), LogName::next_session);
            // The numbers end at 99,999; the last session number then goes on with its segments.
            let name = name.or_else(|| newest.and_then(LogName::next_segment)).ok_or(CardError::Full)?;
            let session = mix(mix(volume_id, name.session), self.entropy);
            Log { name, session, volume_id, base: None, partial_further: true }
        };
        let before = self.log.replace(log);
        self.ring.clear();
        if Some(log.name) == newest {
            self.next_segment(now)?;
        } else {
            self.open_segment(now, log.name)?;
        }
        if let Some(before) = before {
            self.await_group = before.session != log.session;
            self.status.want_group();
        }
        Ok(())
    }

    fn next_segment(&mut self, now: Instant) -> Result<(), CardError<D::Error>> {
        let log = self.log.ok_or(CardError::NotOpen)?;
        // What is recorded around one arming is a log of its own.
        let begins_waiting = self.ring.is_on() && self.ring.is_empty() && log.base.is_some();
        let name = if begins_waiting { log.name.next_session() } else { log.name.next_segment() };
        self.open_segment(now, name.ok_or(CardError::Full)?)
    }

    /// Makes a segment, or overwrites the oldest one when the card has no room, or the oldest one of those that are
    /// kept only for a while when that while is over.
    fn open_segment(&mut self, now: Instant, name: LogName) -> Result<(), CardError<D::Error>> {
        let overwrote = match self.ring.release(now) {
            Some(old) => self.recycle(&old, name)?,
            None => self.create_or_overwrite(name)?,
        };
        if let Some(log) = &mut self.log {
            log.name = name;
            log.base = None;
            log.partial_further = true;
        }
        self.ring.begin(name, now);
        self.status.begin_segment(name.session, overwrote);
        self.status.set_state(CardState::Recording);
        Ok(())
    }

    /// Overwrites the segment `old`, which no longer counts; makes a new one where it is gone.
    fn recycle(&mut self, old: &LogName, name: LogName) -> Result<bool, CardError<D::Error>> {
        let mut found = None;
        self.mounted()?.logs(|entry| {
            if entry.name == *old {
                found = Some(entry);
            }
        })?;
        match found {
            Some(entry) => {
                self.mounted()?.recycle(&entry, name)?;
                self.status.count_released();
                Ok(false)
            }
            None => self.create_or_overwrite(name),
        }
    }

    fn create_or_overwrite(&mut self, name: LogName) -> Result<bool, CardError<D::Error>> {
        let bytes_max = if self.ring.is_on() { ring::SEGMENT_BYTES } else { SEGMENT_BYTES_MAX };
        let bytes = (self.mounted()?.layout().data_bytes() / SEGMENTS_MIN).min(u64::from(bytes_max)) as u32;
        loop {
            match self.mounted()?.create(name, bytes) {
                Ok(()) => return Ok(false),
                Err(CardError::Full) => {}
                Err(error) => return Err(error),
            }
            if let Some(oldest) = self.survey(name)?.oldest {
                self.ring.forget(oldest.name);
                self.mounted()?.recycle(&oldest, name)?;
                return Ok(true);
            }
            if !self.mounted()?.may_have_room() {
                return Err(CardError::Full);
            }
        }
    }

    /// The newest log on the card, and the oldest one that may be overwritten.
    fn survey(&mut self, except: LogName) -> Result<Survey, CardError<D::Error>> {
        let mut survey = Survey { newest: None, oldest: None };
        let open = self.mounted()?.open_name();
        self.mounted()?.logs(|entry| {
            survey.newest = survey.newest.max(Some(entry.name));
            let usable = entry.bytes as usize >= 2 * GROUP_SECTORS * SECTOR_BYTES;
            let older = survey.oldest.is_none_or(|oldest| entry.name < oldest.name);
            if usable && older && entry.name != except && Some(entry.name) != open {
                survey.oldest = Some(entry);
            }
        })?;
        Ok(survey)
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
        self.release();
    }

    fn release(&mut self) {
        self.slot = match core::mem::replace(&mut self.slot, Slot::Moving) {
            Slot::Mounted(card) => card.unmount().map_or(Slot::Moving, Slot::Waiting),
            other => other,
        };
    }
}

fn sector_of(block: &Block) -> Sector {
    Sector::from_bytes(block.contents)
}

struct Survey {
    newest: Option<LogName>,
    oldest: Option<LogEntry>,
}

/// Mixes two numbers into one whose every bit depends on all of theirs (the finalizer of `MurmurHash3`).
const fn mix(a: u32, b: u32) -> u32 {
    let mut hash = a.rotate_left(16) ^ b.wrapping_mul(0x9E37_79B1);
    hash = (hash ^ (hash >> 16)).wrapping_mul(0x85EB_CA6B);
    hash = (hash ^ (hash >> 13)).wrapping_mul(0xC2B2_AE35);
    hash ^ (hash >> 16)
}
