//! Each port's outlet, which decides what may go when, with its queue.

use hums_core::clock::Instant;
use hums_link::outlet::{Class, Outlet};
use hums_link::packet::Packet;
use hums_link::request::Port;

use crate::queues::GsIn;

pub(crate) struct Ways<'w, 'q> {
    pub(crate) gs: &'w mut Outlet,
    pub(crate) autopilot: &'w mut Outlet,
    pub(crate) queues: &'w mut GsIn<'q>,
}

impl Ways<'_, '_> {
    pub(crate) fn send(&mut self, now: Instant, port: Port, class: Class, packet: &Packet) -> bool {
        let Self { gs, autopilot, queues } = self;
        match port {
            Port::Gs => gs.send(now, class, packet, &mut |bytes| queues.put(bytes)),
            Port::Autopilot => autopilot.send(now, class, packet, &mut |bytes| queues.autopilot.put(bytes)),
        }
    }

    /// Passes a frame of another system on, likewise.
    pub(crate) fn pass(&mut self, now: Instant, port: Port, class: Class, frame: &[u8]) -> bool {
        let Self { gs, autopilot, queues } = self;
        match port {
            Port::Gs => gs.pass(now, class, frame, &mut |bytes| queues.put(bytes)),
            Port::Autopilot => autopilot.pass(now, class, frame, &mut |bytes| queues.autopilot.put(bytes)),
        }
    }

    pub(crate) fn bulk_frame_max(&self, port: Port) -> usize {
        match port {
            Port::Gs => self.gs.bulk_frame_max(),
            Port::Autopilot => self.autopilot.bulk_frame_max(),
        }
    }
}
