//! The uplink task's body: the ground station's bytes to frames, and each with its time into the uplink queue.
//!
//! It is as urgent as the downlink: nothing is lost while its port's ring holds (88 ms at 57,600 baud). Input here is
//! untrusted. So each byte costs a framer's bounded work at most, and a flood ends at a full queue without an effect
//! on recording.

use hums_core::clock::{Instant, Span};
use hums_link::frame::Frame;
use hums_link::framer::Framer;

use crate::queues::UplinkIn;

/// After this silence a begun frame will not be finished: [`Uplink::idle`] is due.
pub const SILENCE: Span = Span::from_millis(100);

/// Ground station's port.
#[derive(Debug)]
pub struct Uplink {
    framer: Framer,
    frames_lost: u32,
}

impl Default for Uplink {
    fn default() -> Self {
        Self::new()
    }
}

impl Uplink {
    /// Before the first byte.
    pub const fn new() -> Self {
        Self { framer: Framer::new(), frames_lost: 0 }
    }

    /// Received by `now`, which each completed frame gets.
    pub fn bytes(&mut self, now: Instant, bytes: &[u8], frames: &mut UplinkIn) {
        let Self { framer, frames_lost } = self;
        framer.push(bytes, &mut |frame| queue(now, &frame, frames, frames_lost));
    }

    /// Room for the next bytes; see [`Framer::room`].
    pub fn room(&mut self) -> &mut [u8] {
        self.framer.room()
    }

    /// Takes the first `count` bytes of [`Self::room`] as [`Self::bytes`] does.
    pub fn received(&mut self, now: Instant, count: usize, frames: &mut UplinkIn) {
        let Self { framer, frames_lost } = self;
        framer.received(count, &mut |frame| queue(now, &frame, frames, frames_lost));
    }

    /// The line has been silent: decides about bytes that wait for more.
    pub fn idle(&mut self, now: Instant, frames: &mut UplinkIn) {
        let Self { framer, frames_lost } = self;
        framer.idle(&mut |frame| queue(now, &frame, frames, frames_lost));
    }

    /// The queue was full; modulo 2^32.
    pub const fn frames_lost(&self) -> u32 {
        self.frames_lost
    }
}

fn queue(now: Instant, frame: &Frame<'_>, frames: &mut UplinkIn, frames_lost: &mut u32) {
    if !frames.put(now.as_micros(), frame) {
        *frames_lost = frames_lost.wrapping_add(1);
    }
}
