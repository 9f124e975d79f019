//! Time as the monitor counts it: microseconds since its own power-on, from one monotonic clock that the caller reads.
//!
//! 64 bits of microseconds last 584,000 years, so nothing here wraps.

use core::fmt;
use core::num::{NonZeroU32, NonZeroU64};
use core::ops::Add;

/// A point in time: microseconds since the monitor's power-on. Kept one higher, so that one that may be missing takes no more
/// room: the monitor has more than a hundred of them.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instant(NonZeroU64);

const _: () = assert!(size_of::<Option<Instant>>() == size_of::<Instant>());

impl Default for Instant {
    fn default() -> Self {
        Self::ZERO
    }
}

impl fmt::Debug for Instant {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_tuple("Instant").field(&self.as_micros()).finish()
    }
}

impl Instant {
    /// Power-on.
    pub const ZERO: Self = Self(NonZeroU64::MIN);

    /// Later than all that there is.
    pub(crate) const FAR: Self = Self(NonZeroU64::MAX);

    /// From microseconds since power-on; the last one of 64 bits is taken for the one before it.
    pub const fn from_micros(micros: u64) -> Self {
        Self(NonZeroU64::MIN.saturating_add(micros))
    }

    /// From milliseconds since power-on.
    pub const fn from_millis(millis: u64) -> Self {
        Self::from_micros(millis.saturating_mul(1_000))
    }

    /// Microseconds since power-on.
    pub const fn as_micros(self) -> u64 {
        self.0.get() - 1
    }

    /// Whole milliseconds since power-on, rounded down.
    pub const fn as_millis(self) -> u64 {
        self.as_micros() / 1_000
    }

    /// Seconds since power-on; exact to a microsecond for the first 285 years.
    pub fn as_secs_f64(self) -> f64 {
        self.as_micros() as f64 / 1e6
    }

    /// The span from `earlier` to here; zero where `earlier` is the later one.
    pub const fn since(self, earlier: Self) -> Span {
        Span(self.0.get().saturating_sub(earlier.0.get()))
    }
}

impl Add<Span> for Instant {
    type Output = Self;

    fn add(self, span: Span) -> Self {
        Self(self.0.saturating_add(span.0))
    }
}

/// A point in time, or none, in four bytes, for what there is much of: milliseconds modulo 2^32, and never zero. What is measured from
/// it is far shorter than the 49.7 days after which it would be mistaken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Stamp(Option<NonZeroU32>);

impl Stamp {
    pub(crate) const NONE: Self = Self(None);

    pub(crate) const fn at(at: Instant) -> Self {
        match NonZeroU32::new(at.as_millis() as u32) {
            Some(millis) => Self(Some(millis)),
            // A millisecond earlier.
            None => Self(Some(NonZeroU32::MAX)),
        }
    }

    pub(crate) const fn is_set(self) -> bool {
        self.0.is_some()
    }

    /// Whether it is set and more than `span` ago.
    pub(crate) fn older_than(self, now: Instant, span: Span) -> bool {
        self.age_ms(now).is_some_and(|age_ms| age_ms > span.as_millis())
    }

    pub(crate) fn age_ms(self, now: Instant) -> Option<u64> {
        Some(u64::from((now.as_millis() as u32).wrapping_sub(self.0?.get())))
    }

    /// How long ago it was, up to 24.8 days; no time where it is yet to come.
    pub(crate) fn age(self, now: Instant) -> Option<Span> {
        let age_ms = (now.as_millis() as u32).wrapping_sub(self.0?.get()).cast_signed();
        Some(Span::from_millis(u64::from(age_ms.max(0).cast_unsigned())))
    }

    /// The point in time, to a millisecond.
    pub(crate) fn instant(self, now: Instant) -> Option<Instant> {
        let age_ms = self.age(now)?.as_millis();
        Some(Instant::from_millis(now.as_millis().saturating_sub(age_ms)))
    }

    /// Runs while `on`; whether it has run for `span`.
    pub(crate) fn run(&mut self, on: bool, now: Instant, span: Span) -> bool {
        if !on {
            *self = Self::NONE;
            return false;
        }
        if !self.is_set() {
            *self = Self::at(now);
        }
        self.age_ms(now).is_some_and(|age_ms| age_ms >= span.as_millis())
    }
}

/// A length of time in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Span(u64);

impl Span {
    /// No time.
    pub const ZERO: Self = Self(0);

    /// From microseconds.
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// From milliseconds.
    pub const fn from_millis(millis: u64) -> Self {
        Self(millis.saturating_mul(1_000))
    }

    /// From seconds.
    pub const fn from_secs(secs: u64) -> Self {
        Self(secs.saturating_mul(1_000_000))
    }

    /// Microseconds.
    pub const fn as_micros(self) -> u64 {
        self.0
    }

    /// Whole milliseconds, rounded down.
    pub const fn as_millis(self) -> u64 {
        self.0 / 1_000
    }

    /// Seconds; single precision is enough for a rate or a step of integration.
    pub fn as_secs_f32(self) -> f32 {
        self.0 as f32 / 1e6
    }
}

impl Add for Span {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}
