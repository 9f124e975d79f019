//! Each port's outlet, which decides what may go when, with its queue.

use hums_core::clock::Instant;
use hums_link::encode::FRAME_BYTES_MAX;
use hums_link::outlet::{Class, Outlet};
use hums_link::packet::Packet;
use hums_link::request::Port;

use crate::queues::GsIn;

pub(crate) struct Outlets<'w, 'q> {
    /// By the port's number.
    pub(crate) outlets: [&'w mut Outlet; Port::ALL.len()],
    pub(crate) queues: &'w mut GsIn<'q>,
}

impl Outlets<'_, '_> {
    pub(crate) fn send(&mut self, now: Instant, port: Port, class: Class, packet: &Packet) -> bool {
        let Self { outlets, queues } = self;
        let has_room = queues.has_room(port, room(class));
        has_room && outlets[port as usize].send(now, class, packet, &mut |bytes| queues.send(port, bytes))
    }

    /// Passes a frame of another system on, likewise.
    pub(crate) fn pass(&mut self, now: Instant, port: Port, class: Class, frame: &[u8]) -> bool {
        let Self { outlets, queues } = self;
        let has_room = queues.has_room(port, room(class));
        has_room && outlets[port as usize].pass(now, class, frame, &mut |bytes| queues.send(port, bytes))
    }

    pub(crate) fn bulk_frame_max(&self, port: Port) -> usize {
        self.outlets[port as usize].bulk_frame_max()
    }
}

/// Bulk leaves room in a queue without a line for three findings, or the longest frame.
const fn room(class: Class) -> usize {
    if matches!(class, Class::Bulk) { 2 * FRAME_BYTES_MAX } else { FRAME_BYTES_MAX }
}
