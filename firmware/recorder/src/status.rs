//! Status of the storage task, and requests to it.

use hums_blackbox::record::LastSession;
use hums_core::clock::{Instant, Span};

use crate::shared::Shared;

/// The state of the card.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CardState {
    /// Not looked at yet.
    #[default]
    Unknown,
    /// A session is being recorded.
    Recording,
    /// No card, or it does not answer.
    Absent,
    /// A card whose first partition is neither FAT32 nor exFAT. Like the next three: never formatted unasked.
    Foreign,
    /// No free clusters, and no log of ours to overwrite.
    Full,
    /// The card answers but does not take blocks.
    Failing,
    /// The session was finished.
    Finished,
    /// The card is write protected, or locked with a password.
    Locked,
    /// The card is exFAT (or NTFS), as cards of more than 32 GB are when they are new.
    ExFat,
    /// The card has no partition table; its data, if any, is of unknown kind.
    Unpartitioned,
    /// A FAT32 volume whose structures are damaged.
    Damaged,
    /// The card is being formatted on request.
    Formatting,
}

impl CardState {
    /// Whether the card can be used after formatting, and holds no data in a known form.
    pub const fn wants_format(self) -> bool {
        matches!(self, Self::Foreign | Self::ExFat | Self::Unpartitioned | Self::Damaged)
    }
}

/// Written by the storage task and read by the monitor. The monitor's requests go the other way.
#[derive(Default)]
pub struct CardStatus(Shared<CardReading>);

/// A reading of [`CardStatus`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
    /// Start of the running command in milliseconds; `None` between commands.
    busy_since_ms: Option<u64>,
    /// The longest command of the present service: its start and its duration.
    longest_ms: (u64, u64),
    group_wanted: bool,
    format_wanted: bool,
    utc_secs: u32,
    /// The previous session on this card, until it was read.
    before: Option<LastSession>,
}

impl CardStatus {
    /// Before the card was looked at.
    pub const fn new() -> Self {
        Self(Shared::new(CardReading {
            state: CardState::Unknown,
            session: 0,
            segments: 0,
            segments_overwritten: 0,
            blocks_written: 0,
            writes: 0,
            write_errors: 0,
            frames_lost: 0,
            sectors_lost: 0,
            stall_ms_max: 0,
            volume: 0,
            room_permille: None,
            storage_mib: None,
            busy_since_ms: None,
            longest_ms: (0, 0),
            group_wanted: false,
            format_wanted: false,
            utc_secs: 0,
            before: None,
        }))
    }

    /// The values of this moment.
    pub fn read(&self) -> CardReading {
        self.0.read()
    }

    pub(crate) fn change<R>(&self, change: impl FnOnce(&mut CardReading) -> R) -> R {
        self.0.change(change)
    }

    /// Sets the state.
    pub fn set_state(&self, state: CardState) {
        self.change(|card| card.state = state);
    }

    /// Sets the serial number of the opened volume.
    pub fn set_volume(&self, volume: u32) {
        self.change(|card| card.volume = volume);
    }

    pub(crate) fn count_blocks(&self, blocks: u32) {
        self.change(|card| {
            card.blocks_written += blocks;
            card.writes += 1;
        });
    }

    pub(crate) fn count_write_errors(&self, errors: u32) {
        self.change(|card| card.write_errors += errors);
    }

    pub(crate) fn begin_service(&self) {
        self.change(|card| card.longest_ms = (0, 0));
    }

    /// A command begins; [`Self::end_command`] is to follow.
    pub(crate) fn begin_command(&self, now: Instant) {
        self.change(|card| card.busy_since_ms = Some(now.as_millis()));
    }

    pub(crate) fn end_command(&self, now: Instant) {
        self.change(|card| {
            let Some(since_ms) = card.busy_since_ms.take() else { return };
            let took_ms = now.as_millis().saturating_sub(since_ms);
            card.stall_ms_max = card.stall_ms_max.max(took_ms as u32);
            if took_ms > card.longest_ms.1 {
                card.longest_ms = (since_ms, took_ms);
            }
        });
    }

    /// Duration of the running command so far; zero between commands. Commands of a simulated card end in the future;
    /// of those the longest one of the service counts.
    pub fn stall(&self, now: Instant) -> Span {
        let CardReading { busy_since_ms, longest_ms: (longest_since_ms, longest_ms), .. } = self.read();
        let ago_ms = now.as_millis().saturating_sub(busy_since_ms.unwrap_or(longest_since_ms));
        Span::from_millis(if busy_since_ms.is_some() || ago_ms < longest_ms { ago_ms } else { 0 })
    }

    /// The next data is readable without earlier sectors.
    pub fn want_group(&self) {
        self.change(|card| card.group_wanted = true);
    }

    /// A group requested since the last call.
    pub fn take_group_wanted(&self) -> bool {
        self.change(|card| core::mem::take(&mut card.group_wanted))
    }

    /// Requests that the present card be formatted.
    pub fn want_format(&self) {
        self.change(|card| card.format_wanted = true);
    }

    pub(crate) fn take_format_wanted(&self) -> bool {
        self.change(|card| core::mem::take(&mut card.format_wanted))
    }

    pub(crate) fn set_before(&self, before: LastSession) {
        self.change(|card| card.before = Some(before));
    }

    /// The previous session, once for each card that is opened.
    pub fn take_before(&self) -> Option<LastSession> {
        self.change(|card| card.before.take())
    }

    /// The date for directory entries, seconds since 1970 UTC.
    pub fn set_utc_secs(&self, utc_secs: u32) {
        self.change(|card| card.utc_secs = utc_secs);
    }

    /// Time and date for a directory entry: UTC once it is known, 1 January 1980 (FAT's zero) before.
    pub(crate) fn fat_date(&self) -> [u8; 4] {
        fat_date(self.read().utc_secs)
    }

    pub(crate) fn is_utc_known(&self) -> bool {
        self.read().utc_secs != 0
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
