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
    /// How much is kept; `None`: everything, and there is no ring.
    keep: Option<Span>,
    segments: Vec<Segment, SEGMENTS_MAX>,
    /// A group was asked for, so that the next segment can begin.
    group_asked: bool,
}

struct Segment {
    name: LogName,
    /// When it was begun.
    began: Instant,
}

impl Ring {
    pub(crate) const fn new() -> Self {
        Self { keep: None, segments: Vec::new(), group_asked: false }
    }

    /// Keeps so much from now on; `None`: everything, what is in the ring included.
    pub(crate) fn keep(&mut self, keep: Option<Span>) {
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
        self.segments.clear();
    }

    /// A segment was begun, which goes when its time is over.
    pub(crate) fn begin(&mut self, name: LogName, now: Instant) {
        self.group_asked = false;
        if self.is_on() {
            // There is room: a full ring gave one away before.
            let _ = self.segments.push(Segment { name, began: now });
        }
    }

    /// Whether the next group is to begin the next segment.
    pub(crate) fn is_due(&self, now: Instant) -> bool {
        let age = |open: &Segment| now.since(open.began);
        self.keep.is_some_and(|keep| self.segments.last().map(age).is_none_or(|age| age >= keep.max(AGE_MIN)))
    }

    /// Whether a group is to be asked for: once for each segment.
    pub(crate) fn asks_for_group(&mut self, now: Instant) -> bool {
        self.is_due(now) && !core::mem::replace(&mut self.group_asked, true)
    }

    /// The oldest segment, where those after it hold enough, or there is no room for one more.
    pub(crate) fn oldest(&self, now: Instant) -> Option<LogName> {
        let keep = self.keep?;
        let enough = self.segments.get(1).is_some_and(|second| now.since(second.began) >= keep);
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

    #[test]
    fn the_oldest_goes_once_those_after_it_hold_enough() {
        let mut ring = Ring::new();
        ring.keep(Some(Span::from_secs(30)));
        for segment in 0..4 {
            let now = Instant::from_millis(u64::from(segment) * 12_000);
            assert_eq!(ring.oldest(now), None, "segment {segment}");
            ring.begin(name(segment), now);
        }
        assert_eq!(ring.oldest(Instant::from_millis(41_999)), None, "29.999 s without it");
        assert_eq!(ring.oldest(Instant::from_millis(42_000)), Some(name(0)));
        assert_eq!(ring.oldest(Instant::from_millis(42_000)), Some(name(0)), "it is not written anew yet");
        ring.forget(name(0));
        assert_eq!(ring.oldest(Instant::from_millis(42_000)), None);
    }

    #[test]
    fn a_full_ring_gives_its_oldest_away_and_one_that_is_off_none() {
        let mut ring = Ring::new();
        ring.keep(Some(Span::from_secs(120)));
        (0..SEGMENTS_MAX as u32).for_each(|segment| ring.begin(name(segment), Instant::ZERO));
        assert_eq!(ring.oldest(Instant::ZERO), Some(name(0)));
        ring.keep(None);
        assert!(ring.is_empty() && !ring.is_due(Instant::from_millis(1_000_000)));
        assert_eq!(ring.oldest(Instant::from_millis(1_000_000)), None);
    }

    #[test]
    fn a_group_is_asked_for_once_a_segment() {
        let mut ring = Ring::new();
        ring.keep(Some(Span::from_secs(30)));
        ring.begin(name(0), Instant::ZERO);
        assert!(!ring.asks_for_group(Instant::from_millis(29_999)));
        assert!(ring.asks_for_group(Instant::from_millis(30_000)));
        assert!(!ring.asks_for_group(Instant::from_millis(31_000)));
        ring.begin(name(1), Instant::from_millis(31_000));
        assert!(ring.asks_for_group(Instant::from_millis(61_000)));
    }
}
