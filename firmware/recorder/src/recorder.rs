//! Sectors to segments: one session's log on whatever card is there.
//!
//! A sector with number `n` belongs at block `n - base` of the open segment. A segment is left for the next one at the
//! first group that no longer fits, so that each file can be read by itself. A *partial* sector (one still in progress)
//! is written alternately at its own place and at the next one, so that a torn write never takes the older copy with it.
//!
//! What fails is tried again, then given a new segment, then the card is given up and looked for once a second. A
//! sector is only counted lost when it can never be written: the caller keeps it until then.

use hums_blackbox::{GROUP_SECTORS, SECTOR_BYTES, Sector};
use hums_core::time::{Instant, Span};

use crate::CardDevice;
use crate::card::{Card, CardError, LogEntry};
use crate::gate::HeldBlocks;
use crate::name::LogName;
use crate::status::{CardState, CardStatus};

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
    finished: bool,
}

// One of these exists, in a static: the size of the largest variant is the budget.
#[allow(clippy::large_enum_variant)]
enum Slot<'a, D: CardDevice> {
    /// The device, while no usable card is in it.
    Waiting(D),
    Mounted(Card<'a, D>),
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
            finished: false,
        }
    }

    /// Looks for a card if there is none, at most once a second. Whether a session is open now.
    pub fn ready(&mut self, now: Instant) -> bool {
        if matches!(self.slot, Slot::Mounted(_)) {
            return true;
        }
        if self.finished || now < self.retry_at {
            return false;
        }
        self.retry_at = now + RETRY;
        let Slot::Waiting(device) = core::mem::replace(&mut self.slot, Slot::Moving) else { return false };
        device.reset();
        match Card::mount(device, self.status, self.held) {
            Ok(card) => self.slot = Slot::Mounted(card),
            Err((device, error)) => {
                self.slot = Slot::Waiting(device);
                self.tell(&error);
                return false;
            }
        }
        match self.begin() {
            Ok(()) => true,
            Err(error) => {
                self.give_up(now, &error);
                false
            }
        }
    }

    /// Writes a sector at its place.
    pub fn write(&mut self, now: Instant, sector: &mut Sector) -> Written {
        if !self.ready(now) {
            return Written::Later;
        }
        self.await_group &= !sector.starts_group();
        if self.await_group {
            if !sector.is_partial() {
                self.status.count_lost_sector(u32::from(sector.frames()));
            }
            return Written::Done;
        }
        for _ in 0..WRITE_TRIES {
            match self.try_write(sector) {
                Ok(()) => return Written::Done,
                Err(CardError::Full) => {
                    self.give_up(now, &CardError::Full);
                    return Written::Later;
                }
                Err(_) => self.status.count_write_error(),
            }
        }
        // A new segment may lie where the card still works.
        let moved = self.next_segment().and_then(|()| {
            self.status.want_group();
            self.try_write(sector)
        });
        match moved {
            Ok(()) => Written::Done,
            Err(error) => {
                self.give_up(now, &error);
                Written::Later
            }
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

    fn try_write(&mut self, sector: &mut Sector) -> Result<(), CardError<D::Error>> {
        let Some(mut log) = self.log else { return Err(CardError::NotOpen) };
        let blocks = self.mounted()?.open_blocks();
        let number = sector.number();
        let base = *log.base.get_or_insert(number);
        let mut at = number.wrapping_sub(base);
        // Also a number from before this segment (a restarted count) gets a segment of its own.
        let no_room_for_group =
            sector.starts_group() && at > 0 && at.saturating_add(GROUP_SECTORS as u32) > blocks;
        if at >= blocks || no_room_for_group {
            self.next_segment()?;
            log = self.log.ok_or(CardError::NotOpen)?;
            log.base = Some(number);
            at = 0;
        }
        if sector.is_partial() {
            if log.partial_further && at + 1 < self.mounted()?.open_blocks() {
                at += 1;
            }
            log.partial_further = !log.partial_further;
        } else {
            log.partial_further = true;
        }
        sector.seal(log.session);
        self.mounted()?.write(at, sector.bytes())?;
        self.status.count_block();
        self.log = Some(log);
        Ok(())
    }

    /// Opens a segment on a card just mounted: the session goes on where the same card came back, and is a new one on
    /// another card.
    fn begin(&mut self) -> Result<(), CardError<D::Error>> {
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
        if Some(log.name) == newest {
            self.next_segment()?;
        } else {
            self.open_segment(log.name)?;
        }
        if let Some(before) = before {
            self.await_group = before.session != log.session;
            self.status.want_group();
        }
        Ok(())
    }

    fn next_segment(&mut self) -> Result<(), CardError<D::Error>> {
        let name = self.log.and_then(|log| log.name.next_segment()).ok_or(CardError::Full)?;
        self.open_segment(name)
    }

    /// Makes a segment, or overwrites the oldest one when the card has no room.
    fn open_segment(&mut self, name: LogName) -> Result<(), CardError<D::Error>> {
        let card = self.mounted()?;
        let bytes = (card.layout().data_bytes() / SEGMENTS_MIN).min(u64::from(SEGMENT_BYTES_MAX)) as u32;
        let overwrote = match card.create(name, bytes) {
            Ok(()) => false,
            Err(CardError::Full) => {
                let oldest = self.survey(name)?.oldest.ok_or(CardError::Full)?;
                self.mounted()?.recycle(&oldest, name)?;
                true
            }
            Err(error) => return Err(error),
        };
        if let Some(log) = &mut self.log {
            log.name = name;
            log.base = None;
            log.partial_further = true;
        }
        self.status.begin_segment(name.session, overwrote);
        self.status.set_state(CardState::Recording);
        Ok(())
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

    fn tell(&self, error: &CardError<D::Error>) {
        self.status.set_state(match error {
            CardError::Device(_) => CardState::Absent,
            CardError::Foreign(_) | CardError::Damaged => CardState::Foreign,
            CardError::Full => CardState::Full,
            CardError::NotFound | CardError::NotOpen => CardState::Failing,
        });
    }
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
