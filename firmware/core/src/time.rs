//! Time of all judgement: milliseconds since power-on in 32 bits, which wrap after 49.7 days.
//!
//! Two times are compared by their wrapping difference. A time may be up to `AHEAD_MAX` later than the one that it is compared
//! with; otherwise it is in the past, up to 49.7 days. Microseconds stay at the edge, in [`crate::clock`].

use core::fmt;
use core::num::NonZeroU32;
use core::ops::{Add, Sub};

/// A time that is later than `now` by up to this is in the future: messages may be processed in another order than
/// they came. A time 49.7 days less this in the past would be mistaken for a future one.
const AHEAD_MAX: Millis = Millis::from_secs(3_600);

/// A point in time: milliseconds since power-on, modulo 2^32. Kept one higher, so that an optional one takes no more room.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct BootMs(NonZeroU32);

const _: () = assert!(size_of::<Option<BootMs>>() == size_of::<u32>());

impl Default for BootMs {
    fn default() -> Self {
        Self::ZERO
    }
}

impl fmt::Debug for BootMs {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_tuple("BootMs").field(&self.as_millis()).finish()
    }
}

impl BootMs {
    /// Power-on.
    pub const ZERO: Self = Self(NonZeroU32::MIN);

    /// From milliseconds since power-on, modulo 2^32. The last one before the wrap counts as the first one after it.
    pub const fn from_millis(millis: u64) -> Self {
        match NonZeroU32::new((millis as u32).wrapping_add(1)) {
            Some(millis) => Self(millis),
            None => Self::ZERO,
        }
    }

    /// Milliseconds since power-on, modulo 2^32.
    pub const fn as_millis(self) -> u64 {
        (self.0.get() - 1) as u64
    }

    /// The span from `earlier` to here; zero if `earlier` is the later one.
    pub const fn since(self, earlier: Self) -> Millis {
        let millis = self.0.get().wrapping_sub(earlier.0.get());
        if millis > u32::MAX - AHEAD_MAX.0 { Millis::ZERO } else { Millis(millis) }
    }

    /// Whether this is later than `other`; both are within 24.8 days.
    pub const fn is_after(self, other: Self) -> bool {
        self.0.get().wrapping_sub(other.0.get()).cast_signed() > 0
    }

    /// The later one of two.
    #[must_use]
    pub const fn later(self, other: Self) -> Self {
        if other.is_after(self) { other } else { self }
    }

    /// The earlier one of two, by the rule of [`Self::since`].
    #[must_use]
    pub const fn earlier(self, other: Self) -> Self {
        if other.since(self).0 == 0 { other } else { self }
    }
}

impl Add<Millis> for BootMs {
    type Output = Self;

    fn add(self, span: Millis) -> Self {
        let millis = self.0.get().wrapping_add(span.0);
        Self(NonZeroU32::new(millis).unwrap_or(NonZeroU32::MIN))
    }
}

impl Sub<Millis> for BootMs {
    type Output = Self;

    fn sub(self, span: Millis) -> Self {
        let millis = self.0.get().wrapping_sub(span.0);
        Self(NonZeroU32::new(millis).unwrap_or(NonZeroU32::MAX))
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Stamp(Option<BootMs>);

impl Stamp {
    pub(crate) const NONE: Self = Self(None);

    pub(crate) const fn at(at: BootMs) -> Self {
        Self(Some(at))
    }

    pub(crate) const fn is_set(self) -> bool {
        self.0.is_some()
    }

    pub(crate) fn older_than(self, now: BootMs, span: Millis) -> bool {
        self.age(now).is_some_and(|age| age > span)
    }

    pub(crate) fn age(self, now: BootMs) -> Option<Millis> {
        Some(now.since(self.0?))
    }

    pub(crate) fn instant(self, now: BootMs) -> Option<BootMs> {
        Some(self.0?.earlier(now))
    }

    pub(crate) fn run(&mut self, on: bool, now: BootMs, span: Millis) -> bool {
        let began = self.0.filter(|_| on).or_else(|| on.then_some(now));
        *self = Self(began);
        began.is_some_and(|began| now.since(began) >= span)
    }
}

/// Longest gap between samples of one course, and largest age of a current sample: two messages of a stream at 1 Hz.
pub(crate) const PAUSE: Millis = Millis::from_secs(2);

/// Age up to which a message of a stream at 2 Hz or more counts as current.
pub(crate) const FRESH: Millis = Millis::from_secs(1);

/// Age from which a stream at 0.5 Hz or more counts as stopped.
pub(crate) const SILENT: Millis = Millis::from_secs(5);

/// A length of time in milliseconds, up to 49.7 days.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Millis(u32);

impl Millis {
    /// No time.
    pub const ZERO: Self = Self(0);

    /// From milliseconds; 49.7 days if it is more.
    pub const fn from_millis(millis: u64) -> Self {
        Self(if millis > u32::MAX as u64 { u32::MAX } else { millis as u32 })
    }

    /// From seconds; 49.7 days if it is more.
    pub const fn from_secs(secs: u64) -> Self {
        Self::from_millis(secs.saturating_mul(1_000))
    }

    /// Milliseconds.
    pub const fn as_millis(self) -> u64 {
        self.0 as u64
    }

    /// Seconds.
    pub fn as_secs_f32(self) -> f32 {
        self.0 as f32 / 1e3
    }
}

impl Add for Millis {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_compared_across_the_wrap() {
        const WRAP_MS: u64 = 1 << 32;
        for start_ms in [0, 1, WRAP_MS - 60_000, WRAP_MS - 2, WRAP_MS + 5] {
            let start = BootMs::from_millis(start_ms);
            for span_ms in [0, 1, 50, 60_000, 3_000_000, 30 * 86_400_000] {
                let later = start + Millis::from_millis(span_ms);
                assert!(later.since(start).as_millis().abs_diff(span_ms) <= 1, "{start:?} {span_ms}");
                assert!((later - Millis::from_millis(span_ms)).since(start) <= Millis::from_millis(1));
                if (2..=3_000_000).contains(&span_ms) {
                    assert_eq!(start.since(later), Millis::ZERO);
                    assert!(later.is_after(start) && !start.is_after(later));
                    assert_eq!((start.later(later), start.earlier(later)), (later, start));
                }
            }
        }
    }

    #[test]
    fn what_is_a_month_old_is_old() {
        let month = Millis::from_secs(30 * 86_400);
        for start_ms in [5, 1_u64 << 31, (1 << 32) - 5] {
            let start = BootMs::from_millis(start_ms);
            let now = start + month;
            assert!(Stamp::at(start).older_than(now, Millis::from_secs(2)));
            assert_eq!(start.earlier(now), start);
        }
    }
}
