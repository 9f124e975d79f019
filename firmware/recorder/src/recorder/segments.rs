//! The choice of segments: the session's next one, made in free room, or else in place of the oldest.

use hums_blackbox::record::{LastSession, PreviousEnd};
use hums_core::clock::Instant;

use super::before;
use crate::CardDevice;
use crate::card::{Card, CardError, SEGMENT_BYTES_MAX};
use crate::directory::Newest;
use crate::name::LogName;
use crate::status::{CardState, CardStatus};

/// Segments that even a small card should hold, so that overwriting the oldest loses little.
const SEGMENTS_MIN: u64 = 16;

/// Bytes of a segment after a refused write: 30 s of a full line (921,600 baud).
const SHORT_SEGMENT_BYTES: u32 = 256 * 1024;

#[derive(Clone, Copy)]
pub(super) struct Log {
    pub(super) name: LogName,
    pub(super) session: u32,
    volume_id: u32,
    /// The sector number at block 0 of the open segment; `None` before the first sector.
    pub(super) base: Option<u32>,
    pub(super) newest_copy: NewestCopy,
}

/// The place of the newest copy of the sector in progress. A sector's place is its number less the number of the
/// segment's first sector.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum NewestCopy {
    None,
    /// At the sector's own place.
    InPlace,
    /// At the place after it. A new segment starts in this state, so that its first block is written first.
    Further,
}

pub(super) struct Segments<'a> {
    status: &'a CardStatus,
    /// Differs from power-on to power-on.
    entropy: u32,
    pub(super) log: Option<Log>,
    pub(super) is_open: bool,
    /// The newest segments on the card from before the session, until they were read.
    earlier: Newest,
    /// The open segment is dated in its directory entry, or dating failed.
    is_dated: bool,
}

impl<'a> Segments<'a> {
    pub(super) const fn new(status: &'a CardStatus, entropy: u32) -> Self {
        Self { status, entropy, log: None, is_open: false, earlier: Newest::new(), is_dated: false }
    }

    pub(super) const fn volume_id(&self, now: Instant) -> u32 {
        mix(self.entropy, now.as_micros() as u32)
    }

    /// On the same card the session goes on; another card gets a new one. Returns whether the card was
    /// changed within a group.
    pub(super) fn begin<D: CardDevice>(
        &mut self,
        card: &mut Card<'_, D>,
    ) -> Result<bool, CardError<D::Error>> {
        let volume_id = card.layout().volume_id;
        self.status.set_volume(volume_id);
        let (newest, next) = card.next_session();
        // Entries of further segments may exist despite an error of the card.
        let is_of =
            |log: &Log| newest.is_some_and(|newest| newest.session == log.name.session && newest >= log.name);
        let resumed = self.log.filter(|log| log.volume_id == volume_id && is_of(log));
        let log = if let Some(log) = resumed {
            Log { name: newest.unwrap_or(log.name), ..log }
        } else {
            self.earlier = card.newest().clone();
            if newest.is_none() {
                let found = PreviousEnd::Nothing;
                self.status.set_before(LastSession { found, ..LastSession::default() });
            }
            let name = next.ok_or(CardError::Full)?;
            let session = mix(mix(volume_id, name.session), self.entropy);
            Log { name, session, volume_id, base: None, newest_copy: NewestCopy::Further }
        };
        let before = self.log.replace(log);
        let opened =
            if Some(log.name) == newest { self.next(true, card) } else { self.open(log.name, false, card) };
        if let Err(error) = opened {
            self.log = before;
            return Err(error);
        }
        self.is_open = true;
        if before.is_some() {
            self.status.want_group();
        }
        Ok(before.is_some_and(|before| before.session != log.session))
    }

    /// Finds the end of the previous session, once for each card, and reports it. This takes 0.1 s of a usual card
    /// without recording. So it waits until the session has its first sector on the card, or overwrites an older
    /// segment.
    // Not inlined: its stack frame must not lie below that of making a segment.
    #[inline(never)]
    pub(super) fn look_before<D: CardDevice>(&mut self, card: &Card<'_, D>) {
        let earlier = core::mem::take(&mut self.earlier);
        if !earlier.is_empty() {
            self.status.set_before(before::look(card, &earlier));
        }
    }

    /// It reads and writes a block, so it waits until nothing is to be written. A failure is not repeated.
    #[inline(never)]
    pub(super) fn date<D: CardDevice>(&mut self, card: &mut Card<'_, D>) {
        if !self.is_dated && self.status.is_utc_known() {
            self.is_dated = true;
            let _ = card.date_open();
        }
    }

    pub(super) fn has_sector(&self) -> bool {
        self.log.is_some_and(|log| log.base.is_some())
    }

    /// Opens the next segment. A short one follows a refused write: a card that goes away or refuses again and again
    /// is not filled by begun segments.
    pub(super) fn next<D: CardDevice>(
        &mut self,
        is_short: bool,
        card: &mut Card<'_, D>,
    ) -> Result<(), CardError<D::Error>> {
        let log = self.log.ok_or(CardError::NotOpen)?;
        self.open(log.name.next_segment().ok_or(CardError::Full)?, is_short, card)
    }

    fn open<D: CardDevice>(
        &mut self,
        name: LogName,
        is_short: bool,
        card: &mut Card<'_, D>,
    ) -> Result<(), CardError<D::Error>> {
        let bytes_max = if is_short { SHORT_SEGMENT_BYTES } else { SEGMENT_BYTES_MAX };
        let overwrote = self.create_or_overwrite(name, card, bytes_max)?;
        if let Some(log) = &mut self.log {
            log.name = name;
            log.base = None;
            log.newest_copy = NewestCopy::Further;
        }
        self.is_dated = self.status.is_utc_known();
        self.status.change(|card| {
            card.session = name.session;
            card.segments += 1;
            card.segments_overwritten += u32::from(overwrote);
            card.state = CardState::Recording;
        });
        Ok(())
    }

    fn create_or_overwrite<D: CardDevice>(
        &mut self,
        name: LogName,
        card: &mut Card<'_, D>,
        bytes_max: u32,
    ) -> Result<bool, CardError<D::Error>> {
        let bytes = (card.layout().data_bytes() / SEGMENTS_MIN).min(u64::from(bytes_max)) as u32;
        match card.create(name, bytes) {
            Ok(()) => return Ok(false),
            Err(CardError::Full) => {}
            Err(error) => return Err(error),
        }
        self.look_before(card);
        card.recycle_oldest(name)?;
        Ok(true)
    }
}

/// Mixes two numbers into one whose every bit depends on all of theirs (the finalizer of `MurmurHash3`).
const fn mix(a: u32, b: u32) -> u32 {
    let mut hash = a.rotate_left(16) ^ b.wrapping_mul(0x9E37_79B1);
    hash = (hash ^ (hash >> 16)).wrapping_mul(0x85EB_CA6B);
    hash = (hash ^ (hash >> 13)).wrapping_mul(0xC2B2_AE35);
    hash ^ (hash >> 16)
}
