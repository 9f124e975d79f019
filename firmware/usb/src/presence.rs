//! Whether a host is there: a pulled cable gives no reliable event, but frame numbers stop.

use hums_core::clock::{Instant, Span};

/// Time without a host.
#[derive(Clone, Copy, Debug)]
pub struct Presence {
    frame: u16,
    seen: Instant,
}

impl Presence {
    /// The time begins now.
    pub const fn new(now: Instant) -> Self {
        Self { frame: 0, seen: now }
    }

    /// A look at the bus. An awake host begins a frame with a new number each millisecond (USB 2.0, 8.4.3). A host that has not
    /// configured the device does not use it.
    pub fn look(&mut self, now: Instant, is_configured: bool, frame: u16) {
        if is_configured && frame != self.frame {
            self.seen = now;
        }
        self.frame = frame;
    }

    /// Time since a host was there at the last looks.
    pub const fn absent(&self, now: Instant) -> Span {
        now.since(self.seen)
    }
}
