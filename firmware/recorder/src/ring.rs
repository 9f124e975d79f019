//! The ring of a vehicle that is recorded by arming: while it is disarmed only the last while is kept, in small
//! segments of which the oldest goes once those after it hold enough. [`crate::CardStatus::wait_from`] turns it on.

use heapless::Vec;
use hums_core::time::{Instant, Span};

use crate::name::LogName;

/// Bytes of a segment in the ring at least: so many of them hold [`HELD_SECS`] of a full line (921,600 baud) whose frames cannot be
/// compressed.
pub(crate) const SEGMENT_BYTES: u32 = 256 * 1024;
/// Seconds that a ring of such segments holds; where more are to be kept, they are larger.
const HELD_SECS: u32 = 30;
/// Segments at most, of which one is to be written.
const SEGMENTS_MAX: usize = 16;
/// A segment is not left sooner than this, however little is to be kept.
const AGE_MIN: Span = Span::from_secs(5);

/// The segments that hold the last while, the oldest first, the open one last.
pub(crate) struct Ring {
    /// From which sector on, and how much, is kept; `None`: everything, and there is no ring.
    keep: Option<(u32, Span)>,
    segments: Vec<Segment, SEGMENTS_MAX>,
    /// A group was asked for, so that the next segment can begin.
    group_asked: bool,
}

struct Segment {
    name: LogName,
    /// When its first group was begun, as its first sector tells.
    began: Instant,
}

impl Ring {
    pub(crate) const fn new() -> Self {
        Self { keep: None, segments: Vec::new(), group_asked: false }
    }

    /// Keeps so much of what comes from that sector on; `None`: everything. Once it is something else, what is in the ring stays.
    pub(crate) fn keep(&mut self, keep: Option<(u32, Span)>) {
        if self.keep != keep {
            self.keep = keep;
            self.clear();
        }
    }

    /// Keeps everything; from which sector on only the last while was kept until now.
    pub(crate) fn stop(&mut self) -> Option<u32> {
        let (from, _) = self.keep?;
        self.keep(None);
        Some(from)
    }

    /// Whether not everything is kept.
    pub(crate) const fn is_on(&self) -> bool {
        self.keep.is_some()
    }

    /// Bytes of its segments; `None`: there is no ring.
    pub(crate) fn segment_bytes(&self) -> Option<u32> {
        let (_, keep) = self.keep?;
        let secs = (keep.as_millis() / 1000) as u32;
        Some(SEGMENT_BYTES.max((SEGMENT_BYTES / HELD_SECS).saturating_mul(secs)))
    }

    /// All that is in it stays.
    pub(crate) fn clear(&mut self) {
        self.segments.clear();
    }

    /// A segment has its first sector on the card, of a group that was begun then. It goes when its time is over.
    pub(crate) fn begin(&mut self, name: LogName, began: Instant) {
        self.group_asked = false;
        if self.is_on() {
            // There is room: a full ring gave one away before.
            let _ = self.segments.push(Segment { name, began });
        }
    }

    /// Whether a group that is begun now is to begin the next segment.
    pub(crate) fn is_due(&self, now: Instant) -> bool {
        let age = |open: &Segment| now.since(open.began);
        self.keep
            .is_some_and(|(_, keep)| self.segments.last().map(age).is_none_or(|age| age >= keep.max(AGE_MIN)))
    }

    /// Whether a group is to be asked for: once for each segment.
    pub(crate) fn asks_for_group(&mut self, now: Instant) -> bool {
        self.is_due(now) && !core::mem::replace(&mut self.group_asked, true)
    }

    /// The oldest segment, where those after it hold enough before the group that begins the next one, or there is no room for one
    /// more. Readers do the same sum of the times in the segments. None goes any more once something else is `wanted` than the ring
    /// keeps: the vehicle was armed, though what came before that may still wait for the card.
    pub(crate) fn oldest(&self, group: Option<Instant>, wanted: Option<(u32, Span)>) -> Option<LogName> {
        let (_, keep) = self.keep.filter(|keep| Some(*keep) == wanted)?;
        let holds_enough = |group: Instant, second: &Segment| group.since(second.began) >= keep;
        let enough =
            group.zip(self.segments.get(1)).is_some_and(|(group, second)| holds_enough(group, second));
        self.segments.first().filter(|_| enough || self.segments.is_full()).map(|oldest| oldest.name)
    }

    /// This segment is gone.
    pub(crate) fn forget(&mut self, name: LogName) {
        self.segments.retain(|segment| segment.name != name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(segment: u32) -> LogName {
        LogName { session: 1, segment }
    }

    const LAST_30_S: (u32, Span) = (7, Span::from_secs(30));
    const LAST_120_S: (u32, Span) = (7, Span::from_secs(120));

    #[test]
    fn the_oldest_goes_once_those_after_it_hold_enough() {
        let mut ring = Ring::new();
        ring.keep(Some(LAST_30_S));
        for segment in 0..4 {
            let now = Instant::from_millis(u64::from(segment) * 12_000);
            assert_eq!(ring.oldest(Some(now), Some(LAST_30_S)), None, "segment {segment}");
            ring.begin(name(segment), now);
        }
        let oldest = |ring: &Ring, at_ms| ring.oldest(Some(Instant::from_millis(at_ms)), Some(LAST_30_S));
        assert_eq!(oldest(&ring, 41_999), None, "29.999 s without it");
        assert_eq!(oldest(&ring, 42_000), Some(name(0)));
        assert_eq!(oldest(&ring, 42_000), Some(name(0)), "it is not written anew yet");
        assert_eq!(
            ring.oldest(None, Some(LAST_30_S)),
            None,
            "what the next segment begins with is not known"
        );
        ring.forget(name(0));
        assert_eq!(oldest(&ring, 42_000), None);
    }

    #[test]
    fn a_full_ring_gives_its_oldest_away_and_one_that_is_off_none() {
        let mut ring = Ring::new();
        ring.keep(Some(LAST_120_S));
        (0..SEGMENTS_MAX as u32).for_each(|segment| ring.begin(name(segment), Instant::ZERO));
        assert_eq!(ring.oldest(None, Some(LAST_120_S)), Some(name(0)));
        ring.keep(None);
        let later = Instant::from_millis(1_000_000);
        assert!(ring.segments.is_empty() && !ring.is_due(later));
        assert_eq!(ring.oldest(Some(later), Some(LAST_120_S)), None);
    }

    /// A full line fills a segment but for its parity and a group that no longer fits.
    #[test]
    fn a_full_ring_holds_what_is_to_be_kept_of_a_full_line() {
        const BYTES_A_SECOND: u64 = 921_600 / 10;
        for secs in [5, 30, 60, 120] {
            let mut ring = Ring::new();
            assert_eq!(ring.segment_bytes(), None);
            ring.keep(Some((0, Span::from_secs(secs))));
            let blocks = ring.segment_bytes().expect("it is on") / 512;
            let data = u64::from(hums_blackbox::parity::data_blocks(blocks)) - 64;
            assert!((SEGMENTS_MAX as u64 - 1) * data * 489 >= secs * BYTES_A_SECOND, "{secs} s");
        }
    }

    #[test]
    fn what_was_kept_stays_once_something_else_is_kept() {
        for next in [None, Some((8, Span::from_secs(30)))] {
            let mut ring = Ring::new();
            ring.keep(Some(LAST_30_S));
            ring.begin(name(0), Instant::ZERO);
            ring.keep(Some(LAST_30_S));
            assert_eq!(ring.segments.len(), 1);
            ring.keep(next);
            assert!(ring.segments.is_empty(), "{next:?}");
        }
        let mut ring = Ring::new();
        assert_eq!(ring.stop(), None);
        ring.keep(Some(LAST_30_S));
        assert_eq!((ring.stop(), ring.is_on()), (Some(7), false));
    }

    #[test]
    fn none_goes_once_the_vehicle_was_armed_though_the_recorder_is_not_there_yet() {
        let mut ring = Ring::new();
        ring.keep(Some(LAST_30_S));
        (0..3)
            .for_each(|segment| ring.begin(name(segment), Instant::from_millis(u64::from(segment) * 12_000)));
        let later = Some(Instant::from_millis(60_000));
        assert_eq!(ring.oldest(later, Some(LAST_30_S)), Some(name(0)));
        assert_eq!(ring.oldest(later, None), None, "armed");
        assert_eq!(ring.oldest(later, Some((8, Span::from_secs(30)))), None, "armed, and disarmed again");
    }

    #[test]
    fn a_group_is_asked_for_once_a_segment() {
        let mut ring = Ring::new();
        ring.keep(Some(LAST_30_S));
        ring.begin(name(0), Instant::ZERO);
        assert!(!ring.asks_for_group(Instant::from_millis(29_999)));
        assert!(ring.asks_for_group(Instant::from_millis(30_000)));
        assert!(!ring.asks_for_group(Instant::from_millis(31_000)));
        ring.begin(name(1), Instant::from_millis(31_000));
        assert!(ring.asks_for_group(Instant::from_millis(61_000)));
    }
}
