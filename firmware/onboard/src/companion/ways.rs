//! Each port's outlet, which decides what may go when, with its queue.

use hums_core::clock::Instant;
use hums_core::parameters::{Param, Params};
use hums_link::encode::FRAME_BYTES_MAX;
use hums_link::frame::Frame;
use hums_link::outlet::{self, Class, Outlet};
use hums_link::packet::Packet;
use hums_link::request::Port;
use hums_link::signing::SIGNATURE_BYTES;
use hums_link::summary::Summary;

use crate::queues::{GsIn, SummaryRoute};

/// Bytes that may wait at the autopilot's port. Its queue has room for them, for as many of the summary where the
/// autopilot carries it, and for the longest frame.
const WAITING_BYTES: u32 = 400;
/// Budget of the USB port, bytes a second. A packet of 64 bytes takes some 5,000 cycles, so this takes 1 % of the processor.
const USB_BUDGET: u32 = 20_000;

pub(crate) struct Outlets<'q> {
    /// With the outlet of the radio's port.
    pub(crate) summary: Summary,
    pub(crate) autopilot: Outlet,
    pub(crate) usb: Outlet,
    pub(crate) queues: GsIn<'q>,
}

impl<'q> Outlets<'q> {
    pub(crate) fn new(params: &Params, queues: GsIn<'q>) -> Self {
        let (budget, baud) = (params.get(Param::ApBudget) as u32, params.get(Param::ApBaud) as u32);
        Self {
            summary: Summary::new(params),
            autopilot: Outlet::new(budget, baud, WAITING_BYTES),
            usb: Outlet::new(USB_BUDGET, outlet::NO_LINE, FRAME_BYTES_MAX as u32),
            queues,
        }
    }

    /// By the port's number.
    pub(crate) const fn all(&mut self) -> [&mut Outlet; Port::ALL.len()] {
        [&mut self.summary.outlet, &mut self.autopilot, &mut self.usb]
    }

    fn room(&mut self, port: Port, class: Class) -> Option<(&mut Outlet, impl FnMut(&[u8]))> {
        let Self { summary, autopilot, usb, queues } = self;
        let outlet = match port {
            Port::Gs => &mut summary.outlet,
            Port::Autopilot => autopilot,
            Port::Usb => usb,
        };
        // Bulk leaves room in a queue without a line for three findings, or the longest frame.
        let bytes = if class == Class::Bulk { 2 * FRAME_BYTES_MAX } else { FRAME_BYTES_MAX };
        queues.has_room(port, bytes).then_some((outlet, move |bytes: &[u8]| queues.send(port, bytes)))
    }

    pub(crate) fn send(&mut self, now: Instant, port: Port, class: Class, packet: &Packet) -> bool {
        self.room(port, class).is_some_and(|(outlet, mut out)| outlet.send(now, class, packet, &mut out))
    }

    /// Passes a frame of another system on, likewise.
    pub(crate) fn pass(&mut self, now: Instant, port: Port, class: Class, frame: &[u8]) -> bool {
        self.room(port, class).is_some_and(|(outlet, mut out)| outlet.pass(now, class, frame, &mut out))
    }

    pub(crate) fn bulk_frame_max(&mut self, port: Port) -> usize {
        self.all()[port as usize].bulk_frame_max()
    }

    /// Our frames of the summary stream: to its carrier, and to the USB port while that is open.
    pub(crate) fn summarise(&mut self, now: Instant, say: impl FnOnce(&mut Summary, &mut dyn FnMut(&[u8]))) {
        let Self { summary, usb, queues, .. } = self;
        say(summary, &mut |frame| {
            queues.tell(frame);
            tell_usb(now, frame, usb, queues);
        });
    }

    /// The vehicle's, likewise. The autopilot does not carry its own frames.
    pub(crate) fn forward(&mut self, at: Instant, frame: &Frame<'_>) {
        let Self { summary, usb, queues, .. } = self;
        summary.frame(at, frame, &mut |frame| queue_forwarded(at, frame, usb, queues));
    }
}

pub(super) fn queue_forwarded(at: Instant, frame: &[u8], usb: &mut Outlet, queues: &mut GsIn) {
    if queues.route() == SummaryRoute::Port {
        queues.tell(frame);
    }
    tell_usb(at, frame, usb, queues);
}

// Own stack frame (ARCHITECTURE.md, Memory).
#[inline(never)]
fn tell_usb(now: Instant, frame: &[u8], usb: &mut Outlet, queues: &mut GsIn) {
    if !queues.is_open(Port::Usb) {
        return;
    }
    let has_room = queues.has_room(Port::Usb, frame.len() + SIGNATURE_BYTES);
    let mut out = |bytes: &[u8]| queues.send(Port::Usb, bytes);
    // Ours have been selected: here they are all alike.
    let is_sent = has_room
        && match usb.encoder.message_of(frame) {
            Some(packet) => usb.send(now, Class::Critical, &packet, &mut out),
            None => usb.pass(now, Class::Event, frame, &mut out),
        };
    if !is_sent {
        queues.lose(Port::Usb);
    }
}
