//! Signals between tasks. Signals coalesce, so sending one never blocks.

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use hums_core::clock::Instant;

type Link<T = ()> = Signal<CriticalSectionRawMutex, T>;

pub(crate) static FRAMES: Link = Signal::new();
pub(crate) static SECTORS: Link = Signal::new();
pub(crate) static GS: Link = Signal::new();
pub(crate) static UPLINK: Link = Signal::new();
pub(crate) static AUTOPILOT: Link = Signal::new();

/// The board's clock, as everything below the app counts time.
pub(crate) fn now() -> Instant {
    Instant::from_micros(embassy_time::Instant::now().as_micros())
}

pub(crate) const fn wait(span: hums_core::clock::Span) -> embassy_time::Duration {
    embassy_time::Duration::from_micros(span.as_micros())
}
