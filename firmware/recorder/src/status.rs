//! What the storage task tells the others, and what it is told: plain atomics, so that neither side ever waits.

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

use embedded_sdmmc::{TimeSource, Timestamp};
use hums_blackbox::record::{Before, Found};
use hums_core::clock::{Instant, Span};

/// No service of the card is going on.
const IDLE: u32 = u32::MAX;
/// How much room there is was not counted yet.
const UNCOUNTED: u32 = u32::MAX;

/// What the card is doing. The numbers are stored in logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum CardState {
    /// Not looked at yet.
    Unknown = 0,
    /// A session is being recorded.
    Recording = 1,
    /// No card, or it does not answer.
    Absent = 2,
    /// A card whose first partition is neither FAT32 nor exFAT. Like the next three: never formatted unasked.
    Foreign = 3,
    /// No free clusters, and no log of ours to overwrite.
    Full = 4,
    /// The card answers but does not take blocks.
    Failing = 5,
    /// The session was finished.
    Finished = 6,
    /// The card is write protected, or locked with a password.
    Locked = 7,
    /// The card is exFAT (or NTFS), as cards of more than 32 GB are when they are new.
    ExFat = 8,
    /// The card has no partition table: what is on it, if anything, is not for us to tell.
    Unpartitioned = 9,
    /// A FAT32 volume whose structures are damaged.
    Damaged = 10,
    /// The card is being formatted, because somebody asked for it.
    Formatting = 11,
}

impl CardState {
    /// Whether the card can be used once it is formatted, and what is on it is nothing that we can use.
    pub const fn wants_format(self) -> bool {
        matches!(self, Self::Foreign | Self::ExFat | Self::Unpartitioned | Self::Damaged)
    }

    /// The state of a stored number.
    pub const fn from_number(number: u8) -> Self {
        match number {
            1 => Self::Recording,
            2 => Self::Absent,
            3 => Self::Foreign,
            4 => Self::Full,
            5 => Self::Failing,
            6 => Self::Finished,
            7 => Self::Locked,
            8 => Self::ExFat,
            9 => Self::Unpartitioned,
            10 => Self::Damaged,
            11 => Self::Formatting,
            _ => Self::Unknown,
        }
    }
}

/// Shared by the storage task, which writes it, and the monitor, which reads it; the three `request`-like fields at the
/// end go the other way.
#[derive(Debug)]
pub struct CardStatus {
    state: AtomicU8,
    session: AtomicU32,
    segments: AtomicU32,
    segments_overwritten: AtomicU32,
    blocks_written: AtomicU32,
    writes: AtomicU32,
    write_errors: AtomicU32,
    frames_lost: AtomicU32,
    sectors_lost: AtomicU32,
    stall_ms_max: AtomicU32,
    /// When the service of the card that is going on began, milliseconds modulo 2^32; [`IDLE`] between services.
    busy_since_ms: AtomicU32,
    /// Thousandths of the card that logs can have.
    room: AtomicU32,
    used_mib: AtomicU32,
    total_mib: AtomicU32,
    group_wanted: AtomicBool,
    format_wanted: AtomicBool,
    fat_time: AtomicU32,
    /// The session before on this card: whether it is news, and what was found.
    before_news: AtomicBool,
    before_found: AtomicU8,
    before_number: AtomicU32,
    before_session: AtomicU32,
    before_sectors: AtomicU32,
    before_frames: AtomicU32,
    before_check: AtomicU32,
}

/// How much room a card has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counted {
    /// What logs can have of it, in thousandths.
    pub(crate) permille: u32,
    /// What is in use, logs included, in MiB.
    pub(crate) used_mib: u32,
    /// All there is, in MiB.
    pub(crate) total_mib: u32,
}

/// A reading of [`CardStatus`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CardReading {
    /// What the card is doing.
    pub state: CardState,
    /// The session's number on this card; 0 before there is one.
    pub session: u32,
    /// Segments begun in this session.
    pub segments: u32,
    /// Segments of earlier sessions that were overwritten because the card is full.
    pub segments_overwritten: u32,
    /// Blocks of 512 bytes of log data that the card took.
    pub blocks_written: u32,
    /// Write commands that took them: fewer, because sectors that wait together are written together.
    pub writes: u32,
    /// Writes that failed, retries included.
    pub write_errors: u32,
    /// Frames in sectors that could not be written.
    pub frames_lost: u32,
    /// Sectors that could not be written.
    pub sectors_lost: u32,
    /// The longest time that one service of the card took, in milliseconds.
    pub stall_ms_max: u32,
    /// The share of the card that logs can have, in thousandths: free clusters and those of logs. `None` until the
    /// file allocation table was counted, which takes a while on a large card.
    pub room_permille: Option<u32>,
    /// What was in use when that was counted, logs included, and all there is, in MiB.
    pub storage_mib: Option<(u32, u32)>,
}

impl Default for CardStatus {
    fn default() -> Self {
        Self::new()
    }
}

impl CardStatus {
    /// Before the card was looked at.
    pub const fn new() -> Self {
        Self {
            state: AtomicU8::new(CardState::Unknown as u8),
            session: AtomicU32::new(0),
            segments: AtomicU32::new(0),
            segments_overwritten: AtomicU32::new(0),
            blocks_written: AtomicU32::new(0),
            writes: AtomicU32::new(0),
            write_errors: AtomicU32::new(0),
            frames_lost: AtomicU32::new(0),
            sectors_lost: AtomicU32::new(0),
            stall_ms_max: AtomicU32::new(0),
            busy_since_ms: AtomicU32::new(IDLE),
            room: AtomicU32::new(UNCOUNTED),
            used_mib: AtomicU32::new(0),
            total_mib: AtomicU32::new(0),
            group_wanted: AtomicBool::new(false),
            format_wanted: AtomicBool::new(false),
            fat_time: AtomicU32::new(0),
            before_news: AtomicBool::new(false),
            before_found: AtomicU8::new(Found::Unknown as u8),
            before_number: AtomicU32::new(0),
            before_session: AtomicU32::new(0),
            before_sectors: AtomicU32::new(0),
            before_frames: AtomicU32::new(0),
            before_check: AtomicU32::new(0),
        }
    }

    /// All figures; each is right by itself, they may be a moment apart.
    pub fn read(&self) -> CardReading {
        CardReading {
            state: CardState::from_number(self.state.load(Ordering::Relaxed)),
            session: self.session.load(Ordering::Relaxed),
            segments: self.segments.load(Ordering::Relaxed),
            segments_overwritten: self.segments_overwritten.load(Ordering::Relaxed),
            blocks_written: self.blocks_written.load(Ordering::Relaxed),
            writes: self.writes.load(Ordering::Relaxed),
            write_errors: self.write_errors.load(Ordering::Relaxed),
            frames_lost: self.frames_lost.load(Ordering::Relaxed),
            sectors_lost: self.sectors_lost.load(Ordering::Relaxed),
            stall_ms_max: self.stall_ms_max.load(Ordering::Relaxed),
            room_permille: Some(self.room.load(Ordering::Relaxed)).filter(|room| *room != UNCOUNTED),
            storage_mib: Some((
                self.used_mib.load(Ordering::Relaxed),
                self.total_mib.load(Ordering::Relaxed),
            ))
            .filter(|(_, total)| *total > 0),
        }
    }

    /// Storage has found this out.
    pub fn set_state(&self, state: CardState) {
        self.state.store(state as u8, Ordering::Relaxed);
    }

    pub(crate) fn begin_segment(&self, session: u32, overwrote: bool) {
        self.session.store(session, Ordering::Relaxed);
        self.segments.fetch_add(1, Ordering::Relaxed);
        self.segments_overwritten.fetch_add(u32::from(overwrote), Ordering::Relaxed);
    }

    pub(crate) fn count_blocks(&self, blocks: u32) {
        self.blocks_written.fetch_add(blocks, Ordering::Relaxed);
        self.writes.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn count_write_errors(&self, errors: u32) {
        self.write_errors.fetch_add(errors, Ordering::Relaxed);
    }

    pub(crate) fn count_lost_sector(&self, frames: u32) {
        self.sectors_lost.fetch_add(1, Ordering::Relaxed);
        self.frames_lost.fetch_add(frames, Ordering::Relaxed);
    }

    /// Notes how much room the card has; `None`: not counted.
    pub(crate) fn set_room(&self, room: Option<Counted>) {
        let room = room.unwrap_or(Counted { permille: UNCOUNTED, used_mib: 0, total_mib: 0 });
        self.used_mib.store(room.used_mib, Ordering::Relaxed);
        self.total_mib.store(room.total_mib, Ordering::Relaxed);
        self.room.store(room.permille, Ordering::Relaxed);
    }

    /// A service of the card begins; [`Self::end_service`] is to follow.
    pub fn begin_service(&self, now: Instant) {
        self.busy_since_ms.store((now.as_millis() as u32).min(IDLE - 1), Ordering::Relaxed);
    }

    /// The service of the card has ended; it took this long, in milliseconds.
    pub fn end_service(&self, took_ms: u32) {
        self.busy_since_ms.store(IDLE, Ordering::Relaxed);
        self.stall_ms_max.fetch_max(took_ms, Ordering::Relaxed);
    }

    /// How long the service of the card that is going on has taken by now; zero between services.
    pub fn stall(&self, now: Instant) -> Span {
        match self.busy_since_ms.load(Ordering::Relaxed) {
            IDLE => Span::ZERO,
            // A service is far shorter than the 49 days after which the number repeats.
            since => Span::from_millis(u64::from((now.as_millis() as u32).wrapping_sub(since))),
        }
    }

    /// Storage asks for a new group: what comes next should be readable without what came before.
    pub fn want_group(&self) {
        self.group_wanted.store(true, Ordering::Release);
    }

    /// Whether storage asked for a new group since the last call.
    pub fn take_group_wanted(&self) -> bool {
        self.group_wanted.swap(false, Ordering::Acquire)
    }

    /// Somebody asks for the card that is in to be formatted.
    pub fn want_format(&self) {
        self.format_wanted.store(true, Ordering::Release);
    }

    /// Whether somebody asked since the last call.
    pub(crate) fn take_format_wanted(&self) -> bool {
        self.format_wanted.swap(false, Ordering::Acquire)
    }

    /// Tells which session was recorded before on the card that is in.
    pub(crate) fn set_before(&self, before: &Before) {
        self.before_found.store(before.found as u8, Ordering::Relaxed);
        self.before_number.store(before.number, Ordering::Relaxed);
        self.before_session.store(before.session, Ordering::Relaxed);
        self.before_sectors.store(before.sectors, Ordering::Relaxed);
        self.before_frames.store(before.frames, Ordering::Relaxed);
        self.before_check.store(before.check, Ordering::Relaxed);
        self.before_news.store(true, Ordering::Release);
    }

    /// Which session was recorded before, once for each card that is opened. The fields are written long before the next
    /// card can be: storage looks for one once a second.
    pub fn take_before(&self) -> Option<Before> {
        self.before_news.swap(false, Ordering::Acquire).then(|| Before {
            found: Found::from_number(self.before_found.load(Ordering::Relaxed)),
            number: self.before_number.load(Ordering::Relaxed),
            session: self.before_session.load(Ordering::Relaxed),
            sectors: self.before_sectors.load(Ordering::Relaxed),
            frames: self.before_frames.load(Ordering::Relaxed),
            check: self.before_check.load(Ordering::Relaxed),
        })
    }

    /// Tells the date for directory entries, in seconds since 1970 UTC.
    pub fn set_utc_secs(&self, utc_secs: u32) {
        self.fat_time.store(utc_secs, Ordering::Relaxed);
    }

    /// Whether the date was told.
    pub(crate) fn is_utc_known(&self) -> bool {
        self.fat_time.load(Ordering::Relaxed) != 0
    }
}

/// The clock of directory entries: UTC once it is known, 1 January 1980 (FAT's zero) before.
#[derive(Clone, Copy, Debug)]
pub struct FatClock<'a>(pub &'a CardStatus);

impl TimeSource for FatClock<'_> {
    fn get_timestamp(&self) -> Timestamp {
        timestamp(self.0.fat_time.load(Ordering::Relaxed))
    }
}

/// Civil date from days since 1970 (Howard Hinnant, "chrono-compatible low-level date algorithms"), for 1980 to 2106.
fn timestamp(utc_secs: u32) -> Timestamp {
    const FAT_EPOCH_SECS: u32 = 315_532_800; // 1980-01-01
    let secs = utc_secs.max(FAT_EPOCH_SECS);
    let (days, second_of_day) = (secs / 86_400 + 719_468, secs % 86_400);
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = year_of_era + era * 400 + u32::from(month <= 2);
    Timestamp {
        year_since_1970: (year - 1970) as u8,
        zero_indexed_month: (month - 1) as u8,
        zero_indexed_day: (day - 1) as u8,
        hours: (second_of_day / 3_600) as u8,
        minutes: (second_of_day / 60 % 60) as u8,
        seconds: (second_of_day % 60) as u8,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_civil() {
        let leap_day = timestamp(1_709_210_096); // 2024-02-29T12:34:56Z
        assert_eq!(leap_day.to_string(), "2024-02-29 12:34:56");
        assert_eq!(timestamp(0).to_string(), "1980-01-01 00:00:00");
    }

    #[test]
    fn a_service_that_goes_on_is_seen_until_it_ends() {
        let status = CardStatus::new();
        assert_eq!(status.stall(Instant::from_millis(5_000)), Span::ZERO);
        status.begin_service(Instant::from_millis(5_000));
        assert_eq!(status.stall(Instant::from_millis(7_500)), Span::from_millis(2_500));
        status.end_service(2_600);
        assert_eq!(status.stall(Instant::from_millis(8_000)), Span::ZERO);
        assert_eq!(status.read().stall_ms_max, 2_600);
    }

    #[test]
    fn a_wanted_group_is_told_once() {
        let status = CardStatus::new();
        status.want_group();
        assert!(status.take_group_wanted());
        assert!(!status.take_group_wanted());
    }
}
