//! The ring of a vehicle that is recorded by arming: while it is disarmed only the last while is kept, in small
//! segments of which the oldest goes once those after it hold enough. [`crate::CardStatus::wait_from`] turns it on.

use heapless::Vec;
use hums_core::time::{Instant, Span};

use crate::name::LogName;

/// Bytes of a segment in the ring: 10 s of the busiest vehicle.
pub(crate) const SEGMENT_BYTES: u32 = 256 * 1024;
/// Segments at most: two minutes of the busiest vehicle, and one to write.
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
    /// Nothing of the last segment is on the card yet: where that fails, another one takes its place.
    is_last_empty: bool,
}

struct Segment {
    name: LogName,
    /// When it was begun.
    began: Instant,
}

impl Ring {
    pub(crate) const fn new() -> Self {
        Self { keep: None, segments: Vec::new(), group_asked: false, is_last_empty: false }
    }

    /// Keeps so much of what comes from that sector on; `None`: everything, what is in the ring included.
    pub(crate) fn keep(&mut self, keep: Option<(u32, Span)>) {
        self.keep = keep;
        if keep.is_none() {
            self.clear();
        }
    }

    /// Whether not everything is kept.
    pub(crate) const fn is_on(&self) -> bool {
        self.keep.is_some()
    }

    /// Whether no segment is in it yet.
    pub(crate) fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    /// All that is in it stays.
    pub(crate) fn clear(&mut self) {
        self.is_last_empty = false;
        self.segments.clear();
    }

    /// A segment was begun, which goes when its time is over.
    pub(crate) fn begin(&mut self, name: LogName, now: Instant) {
        self.group_asked = false;
        if self.is_on() {
            if core::mem::replace(&mut self.is_last_empty, true) {
                self.segments.pop();
            }
            // There is room: a full ring gave one away before.
            let _ = self.segments.push(Segment { name, began: now });
        }
    }

    /// What the segment begins with is on the card.
    pub(crate) fn has_begun(&mut self) {
        self.is_last_empty = false;
    }

    /// Whether the next group is to begin the next segment.
    pub(crate) fn is_due(&self, now: Instant) -> bool {
        let age = |open: &Segment| now.since(open.began);
        self.keep
            .is_some_and(|(_, keep)| self.segments.last().map(age).is_none_or(|age| age >= keep.max(AGE_MIN)))
    }

    /// Whether a group is to be asked for: once for each segment.
    pub(crate) fn asks_for_group(&mut self, now: Instant) -> bool {
        self.is_due(now) && !core::mem::replace(&mut self.group_asked, true)
    }

    /// The oldest segment, where those after it hold enough, or there is no room for one more. None goes any more once something
    /// else is `wanted` than the ring keeps: the vehicle was armed, though what came before that may still wait for the card.
    pub(crate) fn oldest(&self, now: Instant, wanted: Option<(u32, Span)>) -> Option<LogName> {
        let (_, keep) = self.keep.filter(|keep| Some(*keep) == wanted)?;
        let enough = self.segments.get(1).is_some_and(|second| now.since(second.began) >= keep);
        self.segments.first().filter(|_| enough || self.segments.is_full()).map(|oldest| oldest.name)
    }

    /// This segment is gone.
    pub(crate) fn forget(&mut self, name: LogName) {
        self.is_last_empty &= self.segments.last().is_some_and(|last| last.name != name);
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

    fn begin(ring: &mut Ring, segment: u32, now: Instant) {
        ring.begin(name(segment), now);
        ring.has_begun();
    }

    #[test]
    fn the_oldest_goes_once_those_after_it_hold_enough() {
        let mut ring = Ring::new();
        ring.keep(Some(LAST_30_S));
        for segment in 0..4 {
            let now = Instant::from_millis(u64::from(segment) * 12_000);
            assert_eq!(ring.oldest(now, Some(LAST_30_S)), None, "segment {segment}");
            begin(&mut ring, segment, now);
        }
        assert_eq!(ring.oldest(Instant::from_millis(41_999), Some(LAST_30_S)), None, "29.999 s without it");
        assert_eq!(ring.oldest(Instant::from_millis(42_000), Some(LAST_30_S)), Some(name(0)));
        assert_eq!(
            ring.oldest(Instant::from_millis(42_000), Some(LAST_30_S)),
            Some(name(0)),
            "it is not written anew yet"
        );
        ring.forget(name(0));
        assert_eq!(ring.oldest(Instant::from_millis(42_000), Some(LAST_30_S)), None);
    }

    #[test]
    fn a_full_ring_gives_its_oldest_away_and_one_that_is_off_none() {
        let mut ring = Ring::new();
        ring.keep(Some(LAST_120_S));
        (0..SEGMENTS_MAX as u32).for_each(|segment| begin(&mut ring, segment, Instant::ZERO));
        assert_eq!(ring.oldest(Instant::ZERO, Some(LAST_120_S)), Some(name(0)));
        ring.keep(None);
        assert!(ring.is_empty() && !ring.is_due(Instant::from_millis(1_000_000)));
        assert_eq!(ring.oldest(Instant::from_millis(1_000_000), Some(LAST_120_S)), None);
    }

    #[test]
    fn none_goes_once_the_vehicle_was_armed_though_the_recorder_is_not_there_yet() {
        let mut ring = Ring::new();
        ring.keep(Some(LAST_30_S));
        (0..3)
            .for_each(|segment| begin(&mut ring, segment, Instant::from_millis(u64::from(segment) * 12_000)));
        let later = Instant::from_millis(60_000);
        assert_eq!(ring.oldest(later, Some(LAST_30_S)), Some(name(0)));
        assert_eq!(ring.oldest(later, None), None, "armed");
        assert_eq!(ring.oldest(later, Some((8, Span::from_secs(30)))), None, "armed, and disarmed again");
    }

    #[test]
    fn a_segment_that_got_nothing_holds_nothing_of_the_last_while() {
        let mut ring = Ring::new();
        ring.keep(Some(LAST_30_S));
        begin(&mut ring, 0, Instant::ZERO);
        // Refused again and again, in one segment and in the next ones.
        for segment in [1, 1, 1, 2, 3] {
            ring.begin(name(segment), Instant::from_millis(10_000));
        }
        ring.begin(name(4), Instant::from_millis(20_000));
        ring.has_begun();
        assert_eq!(
            ring.segments.iter().map(|segment| segment.name.segment).collect::<std::vec::Vec<_>>(),
            [0, 4]
        );
        assert_eq!(ring.oldest(Instant::from_millis(49_999), Some(LAST_30_S)), None);
        assert_eq!(ring.oldest(Instant::from_millis(50_000), Some(LAST_30_S)), Some(name(0)));
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
