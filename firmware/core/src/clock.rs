//! Time at the edge (links, recorder, files): microseconds since power-on, from one monotonic clock that the caller reads.
//!
//! Judgement works with [`crate::time`], in milliseconds.

use core::fmt;
use core::num::NonZeroU64;
use core::ops::Add;

use crate::time;

/// UTC that can be true, microseconds since 1970: 2010 to 2100. A GPS receiver without a fix, or one that counts its weeks from
/// 0 again, reports an earlier date.
pub const UTC_MICROS: core::ops::Range<u64> = 1_262_304_000_000_000..4_102_444_800_000_000;

/// A point in time: microseconds since the box's power-on. Kept one higher, so that an optional one takes no more room.
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

impl Instant {
    /// The point in time that a reading of the millisecond clock means: the one within 24 days of `near`.
    pub const fn of(at: time::BootMs, near: Self) -> Self {
        let ahead_ms = (at.as_millis() as u32).wrapping_sub(near.as_millis() as u32).cast_signed() as i64;
        let millis = near.as_millis().saturating_add_signed(ahead_ms);
        // A time within the same millisecond is that time itself.
        if millis == near.as_millis() { near } else { Self::from_millis(millis) }
    }
}

impl From<Instant> for time::BootMs {
    fn from(at: Instant) -> Self {
        Self::from_millis(at.as_millis())
    }
}

impl From<Span> for time::Millis {
    fn from(span: Span) -> Self {
        Self::from_millis(span.as_millis())
    }
}

impl From<time::Millis> for Span {
    fn from(span: time::Millis) -> Self {
        Self::from_millis(span.as_millis())
    }
}
