//! The body of the uplink and of the USB port: a ground station's bytes to frames, and each with its port into the uplink queue.
//!
//! It is as urgent as the downlink: nothing is lost while its port's ring holds (88 ms at 57,600 baud). Input here is
//! untrusted. So each byte costs a framer's bounded work at most, and a flood ends at a full queue without an effect
//! on recording.

use hums_core::clock::Span;
use hums_link::frame::Frame;
use hums_link::framer::Framer;
pub use hums_link::request::Port;

use crate::queues::UplinkIn;

/// After this silence a begun frame will not be finished: [`Uplink::idle`] is due.
pub const SILENCE: Span = Span::from_millis(100);

/// A port for ground stations.
#[derive(Debug)]
pub struct Uplink {
    port: Port,
    framer: Framer,
    frames_lost: u32,
}

impl Uplink {
    /// Before the first byte.
    pub const fn new(port: Port) -> Self {
        Self { port, framer: Framer::new(), frames_lost: 0 }
    }

    /// Queues each frame that these bytes complete.
    pub fn bytes(&mut self, bytes: &[u8], frames: &UplinkIn) {
        let Self { port, framer, frames_lost } = self;
        framer.push(bytes, &mut |frame| queue(*port, &frame, frames, frames_lost));
    }

    /// Room for the next bytes; see [`Framer::room`].
    pub fn room(&mut self) -> &mut [u8] {
        self.framer.room()
    }

    /// Takes the first `count` bytes of [`Self::room`] as [`Self::bytes`] does.
    pub fn received(&mut self, count: usize, frames: &UplinkIn) {
        let Self { port, framer, frames_lost } = self;
        framer.received(count, &mut |frame| queue(*port, &frame, frames, frames_lost));
    }

    /// The line has been silent: decides about bytes that wait for more.
    pub fn idle(&mut self, frames: &UplinkIn) {
        let Self { port, framer, frames_lost } = self;
        framer.idle(&mut |frame| queue(*port, &frame, frames, frames_lost));
    }

    /// The queue was full; modulo 2^32.
    pub const fn frames_lost(&self) -> u32 {
        self.frames_lost
    }
}

fn queue(port: Port, frame: &Frame<'_>, frames: &UplinkIn, frames_lost: &mut u32) {
    if !frames.put(port as u64, frame) {
        *frames_lost = frames_lost.wrapping_add(1);
    }
}
