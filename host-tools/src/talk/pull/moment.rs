//! Finds a moment in a log by random access: a group begins with its time, so each sector read halves the
//! search.

use std::ops::Range;

use anyhow::Result;
use hums_blackbox::{GROUP_SECTORS, Header, Sector};
use hums_core::clock::Instant;

/// Sectors before one that cannot be read, among which the beginning of a group is looked for.
const STEPS_BACK_MAX: u32 = 2 * GROUP_SECTORS as u32;

/// A log with random access to its sectors.
pub(super) trait Sectors {
    /// Number of sectors.
    fn count(&self) -> u32;

    /// The sector at this place; `None` if it is damaged, or another one is there.
    fn sector(&mut self, place: u32) -> Result<Option<(Header, Sector)>>;
}

/// The beginning of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Start {
    /// The place of its first sector.
    pub(super) place: u32,
    /// When it begins, on the monitor's clock.
    pub(super) at: Instant,
}

/// The group of a sector; if that is unreadable, the last readable one before it.
pub(super) fn group_of(log: &mut impl Sectors, place: u32) -> Result<Option<Start>> {
    let mut next = Some(place);
    for _ in 0..STEPS_BACK_MAX {
        let Some(place) = next else { break };
        next = match log.sector(place)? {
            Some((header, sector)) if header.starts_group() => {
                let preamble = sector.preamble();
                return Ok(
                    preamble.map(|preamble| Start { place, at: Instant::from_millis(preamble.start_ms) })
                );
            }
            Some((header, _)) => place.checked_sub(u32::from(header.since_first)),
            None => place.checked_sub(1),
        };
    }
    Ok(None)
}

/// The first group that begins in a log: the sectors before it end a group of the log before.
pub(super) fn first_group(log: &mut impl Sectors) -> Result<Option<Start>> {
    for place in 0..log.count().min(STEPS_BACK_MAX) {
        if log.sector(place)?.is_some_and(|(header, _)| header.starts_group()) {
            return group_of(log, place);
        }
    }
    Ok(None)
}

/// Start of the group that holds the sector before this place. If unreadable, the nearest readable start
/// before it, or the log's beginning.
pub(super) fn group_before(log: &mut impl Sectors, place: u32) -> Result<u32> {
    let mut place = place;
    while let Some(last) = place.checked_sub(1) {
        if let Some(start) = group_of(log, last)? {
            return Ok(start.place);
        }
        place = place.saturating_sub(STEPS_BACK_MAX);
    }
    Ok(0)
}

/// Sectors among which is all that was recorded from one time to the other, and no more than a group before and behind it.
pub(super) fn between(log: &mut impl Sectors, from: Instant, to: Instant) -> Result<Range<u32>> {
    Ok(around(log, from)?.start..around(log, to)?.end)
}

/// Sectors that hold the recording of this time. They begin with a group that starts then or before, and end
/// with a group that starts later, or with the log.
fn around(log: &mut impl Sectors, time: Instant) -> Result<Range<u32>> {
    let group = GROUP_SECTORS as u32;
    let (mut start, mut end) = (0, log.count());
    while end - start > group {
        // Never in the group that begins at `start`.
        let middle = start + ((end - start) / 2).max(group);
        match group_of(log, middle)? {
            Some(found) if found.place > start && found.at <= time => start = found.place,
            Some(found) if found.place > start => end = found.place,
            // The time before it is unknown: all of it is taken.
            _ => break,
        }
    }
    Ok(start..end)
}

#[cfg(test)]
mod tests {
    use hums_blackbox::record::{Note, Record};
    use hums_blackbox::{SectorSink, Writer};

    use super::*;

    struct Memory {
        sectors: Vec<Sector>,
        damaged: Range<u32>,
        looks: u32,
    }

    impl SectorSink for Memory {
        fn room(&self) -> usize {
            usize::MAX
        }

        fn put(&mut self, sector: &Sector) {
            let mut sector = *sector;
            sector.seal(7);
            self.sectors.push(sector);
        }
    }

    impl Sectors for Memory {
        fn count(&self) -> u32 {
            self.sectors.len() as u32
        }

        fn sector(&mut self, place: u32) -> Result<Option<(Header, Sector)>> {
            self.looks += 1;
            let sector = self.sectors.get(place as usize).filter(|_| !self.damaged.contains(&place));
            Ok(sector.and_then(|sector| Some((Header::read(sector.bytes()).ok()?, *sector))))
        }
    }

    /// A log of a note each tenth of a second, for an hour.
    fn log() -> Memory {
        let mut memory = Memory { sectors: Vec::new(), damaged: 0..0, looks: 0 };
        let mut writer = Box::new(Writer::new());
        for tenth in 0..36_000_u64 {
            let random = tenth.wrapping_mul(0x9E37_79B9_7F4A_7C15);
            let text = format!("{random:016x}{:016x}", random.rotate_left(29) ^ tenth);
            let note = Record::Note(Note { severity: 6, text: &text });
            writer.record(Instant::from_millis(tenth * 100), &note, &mut memory).expect("there is room");
        }
        memory
    }

    #[test]
    fn any_moment_is_found_by_looking_at_few_sectors() {
        let mut log = log();
        let count = log.count();
        assert!(count > 1_000, "{count}");
        for second in [0, 1, 777, 1_800, 3_598, 3_600, 9_999] {
            log.looks = 0;
            let time = Instant::from_millis(second * 1_000);
            let found = around(&mut log, time).expect("memory");
            assert!(
                log.looks < 40 && found.len() <= 2 * GROUP_SECTORS,
                "{second}: {} looks, {found:?}",
                log.looks
            );
            let start = group_of(&mut log, found.start).expect("memory").expect("a group");
            assert!(start.place == found.start && start.at <= time, "{second}: {start:?}");
            if found.end < count {
                let next = group_of(&mut log, found.end).expect("memory").expect("a group");
                assert!(next.place == found.end && next.at > time, "{second}: {next:?}");
            }
        }
        let minute =
            between(&mut log, Instant::from_millis(600_000), Instant::from_millis(660_000)).expect("memory");
        assert!(minute.len() < count as usize / 60 + 3 * GROUP_SECTORS, "{minute:?}");
    }

    #[test]
    fn damaged_sectors_hide_no_moment() {
        let mut log = log();
        let whole = around(&mut log, Instant::from_millis(1_800_000)).expect("memory");
        log.damaged = whole.start..whole.start + 3;
        let found = around(&mut log, Instant::from_millis(1_800_000)).expect("memory");
        assert!(found.start <= whole.start && found.end >= whole.end, "{found:?} {whole:?}");
        assert!(found.len() < 6 * GROUP_SECTORS, "{found:?}");
    }
}
