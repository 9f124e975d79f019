//! Status of the storage task, and requests to it: plain atomics, so that neither side ever waits.

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

use hums_blackbox::record::{LastSession, PreviousEnd};
use hums_core::clock::{Instant, Span};

const IDLE: u32 = u32::MAX;
const UNCOUNTED: u32 = u32::MAX;

/// The state of the card. The numbers are stored in logs.
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
    /// The card has no partition table; its data, if any, is of unknown kind.
    Unpartitioned = 9,
    /// A FAT32 volume whose structures are damaged.
    Damaged = 10,
    /// The card is being formatted on request.
    Formatting = 11,
}

impl CardState {
    /// Whether the card can be used after formatting, and holds no data in a known form.
    pub const fn wants_format(self) -> bool {
        matches!(self, Self::Foreign | Self::ExFat | Self::Unpartitioned | Self::Damaged)
    }

    /// Unknown numbers included.
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
    /// Start of the running command, milliseconds modulo 2^32; [`IDLE`] between commands.
    busy_since_ms: AtomicU32,
    /// The longest command of the present service: its start and its duration.
    longest_since_ms: AtomicU32,
    longest_ms: AtomicU32,
    /// The volume's serial number.
    volume: AtomicU32,
    /// Thousandths of the card that logs can have.
    room: AtomicU32,
    used_mib: AtomicU32,
    total_mib: AtomicU32,
    group_wanted: AtomicBool,
    format_wanted: AtomicBool,
    fat_time: AtomicU32,
    /// The previous session on this card: whether it is unread, and the result.
    before_news: AtomicBool,
    before_found: AtomicU8,
    before_number: AtomicU32,
    before_session: AtomicU32,
    before_sectors: AtomicU32,
    before_frames: AtomicU32,
    before_check: AtomicU32,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CardUsage {
    pub(crate) permille: u32,
    /// Used space, logs included, in MiB.
    pub(crate) used_mib: u32,
    pub(crate) total_mib: u32,
}

/// A reading of [`CardStatus`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CardReading {
    /// The state of the card.
    pub state: CardState,
    /// The session's number on this card; 0 before there is one.
    pub session: u32,
    /// Segments begun in this session.
    pub segments: u32,
    /// Overwritten segments of earlier sessions: the card is full.
    pub segments_overwritten: u32,
    /// 512 bytes each, taken by the card.
    pub blocks_written: u32,
    /// Write commands for them: fewer, because waiting sectors are written together.
    pub writes: u32,
    /// Retries included.
    pub write_errors: u32,
    /// Frames in sectors that could not be written.
    pub frames_lost: u32,
    /// Unwritten sectors.
    pub sectors_lost: u32,
    /// Longest command, ms.
    pub stall_ms_max: u32,
    /// Serial number of the volume opened last.
    pub volume: u32,
    /// The share of the card that logs can have, in thousandths: free clusters and those of logs. `None` until the
    /// file allocation table was counted, which takes a while on a large card.
    pub room_permille: Option<u32>,
    /// Used space at that count, logs included, and total space, in MiB.
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
            longest_since_ms: AtomicU32::new(0),
            longest_ms: AtomicU32::new(0),
            volume: AtomicU32::new(0),
            room: AtomicU32::new(UNCOUNTED),
            used_mib: AtomicU32::new(0),
            total_mib: AtomicU32::new(0),
            group_wanted: AtomicBool::new(false),
            format_wanted: AtomicBool::new(false),
            fat_time: AtomicU32::new(0),
            before_news: AtomicBool::new(false),
            before_found: AtomicU8::new(PreviousEnd::Unknown as u8),
            before_number: AtomicU32::new(0),
            before_session: AtomicU32::new(0),
            before_sectors: AtomicU32::new(0),
            before_frames: AtomicU32::new(0),
            before_check: AtomicU32::new(0),
        }
    }

    /// The values; each may be of another moment.
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
            volume: self.volume.load(Ordering::Relaxed),
            room_permille: Some(self.room.load(Ordering::Relaxed)).filter(|room| *room != UNCOUNTED),
            storage_mib: Some((
                self.used_mib.load(Ordering::Relaxed),
                self.total_mib.load(Ordering::Relaxed),
            ))
            .filter(|(_, total)| *total > 0),
        }
    }

    /// Sets the state.
    pub fn set_state(&self, state: CardState) {
        self.state.store(state as u8, Ordering::Relaxed);
    }

    /// Sets the serial number of the opened volume.
    pub fn set_volume(&self, volume: u32) {
        self.volume.store(volume, Ordering::Relaxed);
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

    /// `None`: not counted.
    pub(crate) fn set_room(&self, room: Option<CardUsage>) {
        let room = room.unwrap_or(CardUsage { permille: UNCOUNTED, used_mib: 0, total_mib: 0 });
        self.used_mib.store(room.used_mib, Ordering::Relaxed);
        self.total_mib.store(room.total_mib, Ordering::Relaxed);
        self.room.store(room.permille, Ordering::Relaxed);
    }

    pub(crate) fn begin_service(&self) {
        self.longest_ms.store(0, Ordering::Relaxed);
    }

    /// A command begins; [`Self::end_command`] is to follow.
    pub(crate) fn begin_command(&self, now: Instant) {
        self.busy_since_ms.store((now.as_millis() as u32).min(IDLE - 1), Ordering::Relaxed);
    }

    pub(crate) fn end_command(&self, now: Instant) {
        let since_ms = self.busy_since_ms.swap(IDLE, Ordering::Relaxed);
        let took_ms = (now.as_millis() as u32).wrapping_sub(since_ms);
        self.stall_ms_max.fetch_max(took_ms, Ordering::Relaxed);
        if took_ms > self.longest_ms.load(Ordering::Relaxed) {
            self.longest_since_ms.store(since_ms, Ordering::Relaxed);
            self.longest_ms.store(took_ms, Ordering::Relaxed);
        }
    }

    /// Duration of the running command so far; zero between commands. Commands of a simulated card end in the future;
    /// of those the longest one of the service counts.
    pub fn stall(&self, now: Instant) -> Span {
        // A command is far shorter than the 49 days after which the number repeats.
        let since = |since_ms: u32| (now.as_millis() as u32).wrapping_sub(since_ms);
        let ms = match self.busy_since_ms.load(Ordering::Relaxed) {
            IDLE => {
                let ms = since(self.longest_since_ms.load(Ordering::Relaxed));
                if ms < self.longest_ms.load(Ordering::Relaxed) { ms } else { 0 }
            }
            since_ms => since(since_ms),
        };
        Span::from_millis(u64::from(ms))
    }

    /// The next data is readable without earlier sectors.
    pub fn want_group(&self) {
        self.group_wanted.store(true, Ordering::Release);
    }

    /// A group requested since the last call.
    pub fn take_group_wanted(&self) -> bool {
        self.group_wanted.swap(false, Ordering::Acquire)
    }

    /// Requests that the present card be formatted.
    pub fn want_format(&self) {
        self.format_wanted.store(true, Ordering::Release);
    }

    pub(crate) fn take_format_wanted(&self) -> bool {
        self.format_wanted.swap(false, Ordering::Acquire)
    }

    pub(crate) fn set_before(&self, before: &LastSession) {
        self.before_found.store(before.found as u8, Ordering::Relaxed);
        self.before_number.store(before.number, Ordering::Relaxed);
        self.before_session.store(before.session, Ordering::Relaxed);
        self.before_sectors.store(before.sectors, Ordering::Relaxed);
        self.before_frames.store(before.frames, Ordering::Relaxed);
        self.before_check.store(before.check, Ordering::Relaxed);
        self.before_news.store(true, Ordering::Release);
    }

    /// The previous session, once for each card that is opened. The fields are stable until the next card: storage
    /// looks for one once a second.
    pub fn take_before(&self) -> Option<LastSession> {
        self.before_news.swap(false, Ordering::Acquire).then(|| LastSession {
            found: PreviousEnd::from_number(self.before_found.load(Ordering::Relaxed)),
            number: self.before_number.load(Ordering::Relaxed),
            session: self.before_session.load(Ordering::Relaxed),
            sectors: self.before_sectors.load(Ordering::Relaxed),
            frames: self.before_frames.load(Ordering::Relaxed),
            check: self.before_check.load(Ordering::Relaxed),
        })
    }

    /// The date for directory entries, seconds since 1970 UTC.
    pub fn set_utc_secs(&self, utc_secs: u32) {
        self.fat_time.store(utc_secs, Ordering::Relaxed);
    }

    /// Time and date for a directory entry: UTC once it is known, 1 January 1980 (FAT's zero) before.
    pub(crate) fn fat_date(&self) -> [u8; 4] {
        fat_date(self.fat_time.load(Ordering::Relaxed))
    }

    pub(crate) fn is_utc_known(&self) -> bool {
        self.fat_time.load(Ordering::Relaxed) != 0
    }
}

/// Time and date of a directory entry (Microsoft's FAT specification 1.03), for 1980 to 2106. The civil date from days since 1970 is
/// Howard Hinnant's, "chrono-compatible low-level date algorithms".
const fn fat_date(utc_secs: u32) -> [u8; 4] {
    const FAT_EPOCH_SECS: u32 = 315_532_800; // 1980-01-01
    let secs = if utc_secs > FAT_EPOCH_SECS { utc_secs } else { FAT_EPOCH_SECS };
    let (days, second_of_day) = (secs / 86_400 + 719_468, secs % 86_400);
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = year_of_era + era * 400 + if month <= 2 { 1 } else { 0 };
    let date = (year - 1980) << 9 | month << 5 | day;
    let (hour, minute, second) = (second_of_day / 3_600, second_of_day / 60 % 60, second_of_day % 60);
    let time = hour << 11 | minute << 5 | (second / 2);
    (date << 16 | time).to_le_bytes()
}

/// Seconds since 1970 of time and date of a directory entry; 0 for 1 January 1980, which stands for an unknown date.
/// The inverse of [`fat_date`], by the same algorithms.
pub(crate) const fn utc_secs(fat: &[u8; 4]) -> u32 {
    let (time, date) =
        (u16::from_le_bytes([fat[0], fat[1]]) as u32, u16::from_le_bytes([fat[2], fat[3]]) as u32);
    let (month, day) = (date >> 5 & 15, date & 31);
    if month == 0 || day == 0 || date == 1 << 5 | 1 {
        return 0;
    }
    let year = 1980 + (date >> 9) - if month <= 2 { 1 } else { 0 };
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let days = 365 * year + year / 4 - year / 100 + year / 400 + day_of_year - 719_468;
    days.saturating_mul(86_400).saturating_add((time >> 11) * 3_600 + (time >> 5 & 63) * 60 + 2 * (time & 31))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_civil() {
        let fields = |utc_secs| {
            let word = u32::from_le_bytes(fat_date(utc_secs));
            let (date, time) = (word >> 16, word & 0xFFFF);
            let day = (1980 + (date >> 9), date >> 5 & 15, date & 31);
            (day, (time >> 11, time >> 5 & 63, 2 * (time & 31)))
        };
        assert_eq!(fields(1_709_210_096), ((2024, 2, 29), (12, 34, 56)));
        assert_eq!(fields(0), ((1980, 1, 1), (0, 0, 0)));
        for secs in [1_709_210_096, 1_704_067_200, 4_102_444_798] {
            assert_eq!(utc_secs(&fat_date(secs)), secs);
        }
        assert_eq!((utc_secs(&fat_date(0)), utc_secs(&[0; 4])), (0, 0));
        assert!((0..=255).map(|byte| utc_secs(&[byte; 4])).max() == Some(u32::MAX), "nothing overflows");
    }

    #[test]
    fn a_command_that_goes_on_is_seen_until_it_ends() {
        let status = CardStatus::new();
        let at = Instant::from_millis;
        assert_eq!(status.stall(at(5_000)), Span::ZERO);
        status.begin_command(at(5_000));
        assert_eq!(status.stall(at(7_500)), Span::from_millis(2_500));
        status.end_command(at(7_600));
        assert_eq!(status.stall(at(8_000)), Span::ZERO);
        assert_eq!(status.read().stall_ms_max, 2_600);
    }

    #[test]
    fn many_short_commands_are_no_stall() {
        let status = CardStatus::new();
        status.begin_service();
        for ms in (0..3_000).step_by(30) {
            status.begin_command(Instant::from_millis(ms));
            assert!(status.stall(Instant::from_millis(ms + 20)) <= Span::from_millis(20));
            status.end_command(Instant::from_millis(ms + 25));
        }
        assert_eq!(status.read().stall_ms_max, 25);
    }

    #[test]
    fn a_wanted_group_is_told_once() {
        let status = CardStatus::new();
        status.want_group();
        assert!(status.take_group_wanted());
        assert!(!status.take_group_wanted());
    }
}
