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
}

impl Uplink {
    /// Before the first byte.
    pub const fn new(port: Port) -> Self {
        Self { port, framer: Framer::new() }
    }

    /// Queues each frame that these bytes complete.
    pub fn bytes(&mut self, bytes: &[u8], frames: &UplinkIn) {
        let Self { port, framer } = self;
        framer.push(bytes, &mut |frame| queue(*port, &frame, frames));
    }

    /// Room for the next bytes; see [`Framer::room`].
    pub fn room(&mut self) -> &mut [u8] {
        self.framer.room()
    }

    /// Takes the first `count` bytes of [`Self::room`] as [`Self::bytes`] does.
    pub fn received(&mut self, count: usize, frames: &UplinkIn) {
        let Self { port, framer } = self;
        framer.received(count, &mut |frame| queue(*port, &frame, frames));
    }

    /// The line has been silent: decides about bytes that wait for more.
    pub fn idle(&mut self, frames: &UplinkIn) {
        let Self { port, framer } = self;
        framer.idle(&mut |frame| queue(*port, &frame, frames));
    }
}

/// A station repeats a request that found the queue full.
fn queue(port: Port, frame: &Frame<'_>, frames: &UplinkIn) {
    let _ = frames.put(port as u64, frame);
}
