//! The reception task's body: bytes in, frames with their times into the frame queue.
//!
//! The most urgent task: the port's ring holds 22 ms at 921,600 baud. It only finds frames, about ten instructions a
//! byte, and never waits.

use hums_core::clock::{Instant, Span};
use hums_link::frame::Frame;
use hums_link::framer::Framer;

use crate::port::{PortReading, PortStatus};
use crate::queues::FramesIn;

/// After this silence a begun frame will not be finished: [`Reception::idle`] is due.
pub const SILENCE: Span = Span::from_millis(20);

/// The autopilot port's framer, and its losses.
pub struct Reception<'a> {
    framer: Framer,
    status: &'a PortStatus,
    frames_lost: u64,
}

impl<'a> Reception<'a> {
    /// Before the first byte.
    pub const fn new(status: &'a PortStatus) -> Self {
        Self { framer: Framer::new(), status, frames_lost: 0 }
    }

    /// Received by `now`, which each completed frame gets.
    pub fn bytes(&mut self, now: Instant, bytes: &[u8], frames: &mut FramesIn) {
        let Self { framer, frames_lost, .. } = self;
        framer.push(bytes, &mut |frame| queue(now, &frame, frames, frames_lost));
        self.publish(frames);
    }

    /// Room for the next bytes; see [`Framer::room`].
    pub fn room(&mut self) -> &mut [u8] {
        self.framer.room()
    }

    /// Takes the first `count` bytes of [`Self::room`] as [`Self::bytes`] does.
    pub fn received(&mut self, now: Instant, count: usize, frames: &mut FramesIn) {
        let Self { framer, frames_lost, .. } = self;
        framer.received(count, &mut |frame| queue(now, &frame, frames, frames_lost));
        self.publish(frames);
    }

    /// The line has been silent (or has ended): decides about bytes that wait for more.
    pub fn idle(&mut self, now: Instant, frames: &mut FramesIn) {
        let Self { framer, frames_lost, .. } = self;
        framer.idle(&mut |frame| queue(now, &frame, frames, frames_lost));
        self.publish(frames);
    }

    fn publish(&self, frames: &FramesIn) {
        let (counts, frames_lost, queue_bytes_max) =
            (self.framer.counts(), self.frames_lost, frames.bytes_max());
        self.status.change(|port| {
            *port = PortReading {
                bytes: counts.bytes,
                bytes_not_frames: counts.bytes_not_frames,
                damaged: counts.damaged,
                frames: counts.frames,
                frames_lost,
                queue_bytes_max,
                // The port itself counts its overruns.
                ..*port
            };
        });
    }
}

fn queue(now: Instant, frame: &Frame, frames: &mut FramesIn, frames_lost: &mut u64) {
    if !frames.put(now.as_micros(), frame) {
        *frames_lost += 1;
    }
}
