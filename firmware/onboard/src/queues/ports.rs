//! Output of the ports: a queue each, and the way of the summary stream.
//!
//! The USB port has no line of its own speed: its queue is its limit, and it is closed while no host takes its bytes.

use bbqueue::nicknames::Churrasco;
use bbqueue::prod_cons::framed::{FramedConsumer, FramedGrantR, FramedProducer};
use hums_link::encode::FRAME_BYTES_MAX;

use hums_link::request::Port;

use super::capacities::{AUTOPILOT_QUEUE_BYTES, GS_QUEUE_BYTES, USB_QUEUE_BYTES};
use super::level::{Fill, HEAD_BYTES, Level};
use crate::shelf::Reader;

/// All ports, and the logs on the card.
pub struct GsIn<'a> {
    pub(super) gs: PortIn<'a, GS_QUEUE_BYTES>,
    /// To the autopilot.
    pub autopilot: PortIn<'a, AUTOPILOT_QUEUE_BYTES>,
    pub(super) usb: PortIn<'a, USB_QUEUE_BYTES>,
    /// The logs on the card.
    pub shelf: Reader<'a>,
    pub(super) route: SummaryRoute,
}

/// The way of the summary stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SummaryRoute {
    /// There is none.
    Nobody,
    /// A radio at the ground station's port.
    Port,
    /// The autopilot carries it.
    Autopilot,
}

impl GsIn<'_> {
    /// Queues a frame at this port, or counts it as lost.
    pub fn send(&mut self, port: Port, frame: &[u8]) {
        match port {
            Port::Gs => self.gs.put(frame),
            Port::Autopilot => self.autopilot.put(frame),
            Port::Usb => self.usb.put(frame),
        }
    }

    /// Counts a frame for this port that was not queued.
    pub fn lose(&mut self, port: Port) {
        match port {
            Port::Gs => self.gs.lost += 1,
            Port::Autopilot => self.autopilot.lost += 1,
            Port::Usb => self.usb.lost += 1,
        }
    }

    /// Whether somebody takes the frames of this port.
    pub fn is_open(&self, port: Port) -> bool {
        port != Port::Usb || self.usb.level.read().is_open
    }

    /// Whether a frame of `bytes` has room. The outlets of the other ports know their queues by a model of the line.
    pub fn has_room(&self, port: Port, bytes: usize) -> bool {
        // The end of the queue may be too short for a frame.
        const USABLE: usize = USB_QUEUE_BYTES - (HEAD_BYTES + FRAME_BYTES_MAX);
        let Fill { is_open, bytes: waiting, .. } = self.usb.level.read();
        port != Port::Usb || (is_open && waiting + HEAD_BYTES + bytes <= USABLE)
    }

    /// Queues a frame of the summary stream.
    pub fn tell(&mut self, frame: &[u8]) {
        match self.route {
            SummaryRoute::Nobody => {}
            SummaryRoute::Port => self.gs.put(frame),
            SummaryRoute::Autopilot => self.autopilot.put(frame),
        }
    }

    /// The way of the summary stream.
    pub const fn route(&self) -> SummaryRoute {
        self.route
    }

    /// Sets the way of the summary stream.
    pub const fn set_route(&mut self, route: SummaryRoute) {
        self.route = route;
    }

    /// Frames queued since power-on.
    pub const fn frames(&self) -> u64 {
        self.gs.frames
    }

    /// Bytes queued since power-on.
    pub const fn bytes(&self) -> u64 {
        self.gs.bytes
    }

    /// Lost frames to ground stations, at both ports.
    pub fn lost(&self) -> u64 {
        self.gs.lost() + self.usb.lost()
    }

    /// Most waiting bytes.
    pub fn bytes_max(&self) -> u32 {
        self.gs.level.read().bytes_max as u32
    }
}

/// Writing end of a port's queue, with its counters.
pub struct PortIn<'a, const BYTES: usize> {
    queue: FramedProducer<&'a Churrasco<BYTES>>,
    level: &'a Level,
    frames: u64,
    bytes: u64,
    lost: u64,
}

impl<'a, const BYTES: usize> PortIn<'a, BYTES> {
    pub(super) const fn new(queue: FramedProducer<&'a Churrasco<BYTES>>, level: &'a Level) -> Self {
        Self { queue, level, frames: 0, bytes: 0, lost: 0 }
    }

    /// Queues a frame, or counts it as lost.
    pub fn put(&mut self, frame: &[u8]) {
        let len = frame.len() as u16;
        let Ok(mut grant) = self.queue.grant(len) else {
            self.lost += 1;
            return;
        };
        grant.copy_from_slice(frame);
        self.level.change(|fill| fill.rise(frame.len()));
        grant.commit(len);
        self.frames += 1;
        self.bytes += frame.len() as u64;
    }

    /// Frames queued since power-on.
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// Frames that were not queued, or not sent.
    pub fn lost(&self) -> u64 {
        self.lost + u64::from(self.level.read().dropped)
    }
}

/// The reading end of a port's queue.
pub struct PortOut<'a, const BYTES: usize>(
    pub(super) FramedConsumer<&'a Churrasco<BYTES>>,
    pub(super) &'a Level,
);
/// Reading end.
pub type GsOut<'a> = PortOut<'a, GS_QUEUE_BYTES>;
/// Reading end.
pub type UsbOut<'a> = PortOut<'a, USB_QUEUE_BYTES>;
/// Reading end.
pub type AutopilotOut<'a> = PortOut<'a, AUTOPILOT_QUEUE_BYTES>;

impl<'a, const BYTES: usize> PortOut<'a, BYTES> {
    /// Removes it; returns its length, `None` if there is none.
    pub fn take(&mut self, out: &mut [u8; FRAME_BYTES_MAX]) -> Option<usize> {
        let grant = self.0.read().ok()?;
        let len = grant.len().min(out.len());
        out[..len].copy_from_slice(&grant[..len]);
        self.release(grant, true);
        Some(len)
    }

    /// A host takes the frames from now on.
    pub fn open(&self) {
        self.1.change(|fill| fill.is_open = true);
    }

    /// Nobody takes the frames any more: those that wait are dropped and counted.
    pub fn close(&mut self) {
        self.1.change(|fill| fill.is_open = false);
        while let Ok(grant) = self.0.read() {
            self.release(grant, false);
        }
    }

    /// Lends the oldest frame in place, then removes it, and counts it as lost if `send` says `false`. Returns what that
    /// says, `None` if there is no frame.
    pub async fn lend(&mut self, send: impl AsyncFnOnce(&[u8]) -> bool) -> Option<bool> {
        let grant = self.0.read().ok()?;
        let is_sent = send(&grant).await;
        self.release(grant, is_sent);
        Some(is_sent)
    }

    fn release(&self, frame: FramedGrantR<&'a Churrasco<BYTES>>, is_sent: bool) {
        self.1.change(|fill| {
            fill.fall(frame.len());
            fill.dropped += u32::from(!is_sent);
        });
        frame.release();
    }
}
