//! The back-channel (`GS_PASS`): our ports for ground stations serve the autopilot too.
//!
//! Frames of others pass unaltered, with their signatures, within each port's budget. Without room they are lost and
//! counted, and the sender repeats them, as on any radio.
//!
//! All frames go up except those addressed to us, those from the vehicle itself, a radio's reports about its link
//! with us, and keys.
//!
//! Besides the summary stream, these frames go down:
//!
//! - frames addressed to others;
//! - answers without an address ([`ANSWERS`]);
//! - heartbeats of the vehicle's other components;
//! - once a second a frame of an unknown definition.

use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::parameters::Param;
use hums_link::encode::COMPONENT;
use hums_link::frame::{Check, Frame};
use hums_link::ids;
use hums_link::outlet::Class;
use hums_link::request::Port;

use super::ways::Outlets;
use crate::queues::SummaryRoute;

const RADIO: [u32; 2] = [ids::RADIO, ids::RADIO_STATUS];
const ANSWERS: [u32; 13] = [
    ids::PARAM_VALUE,
    ids::GPS_GLOBAL_ORIGIN,
    ids::LOG_ENTRY,
    ids::LOG_DATA,
    ids::MAG_CAL_PROGRESS,
    ids::MAG_CAL_REPORT,
    ids::CAMERA_INFORMATION,
    ids::PROTOCOL_VERSION,
    ids::PARAM_EXT_VALUE,
    ids::COMPONENT_INFORMATION,
    ids::COMPONENT_METADATA,
    ids::EVENT,
    ids::CURRENT_EVENT_SEQUENCE,
];
const UNKNOWN: Span = Span::from_secs(1);

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BackChannel {
    pub(super) lost: u32,
    unknown_at: Option<Instant>,
}

impl BackChannel {
    pub(crate) const fn new() -> Self {
        Self { lost: 0, unknown_at: None }
    }

    pub(crate) fn up(
        &mut self,
        now: Instant,
        port: Port,
        frame: &Frame<'_>,
        monitor: &Monitor,
        ways: &mut Outlets,
    ) {
        let Some(vehicle) = monitor.vehicle().source else { return };
        let of = (frame.system(), frame.component());
        let pretends = of == (vehicle.system, vehicle.component) || of == (vehicle.system, COMPONENT);
        let stays = pretends
            || frame.target() == Some((vehicle.system, COMPONENT))
            || frame.id() == ids::SETUP_SIGNING
            || RADIO.contains(&frame.id());
        if stays || !is_on(port, monitor, ways) {
            return;
        }
        let sent = ways.pass(now, Port::Autopilot, Class::Forward, frame.bytes());
        self.lost = self.lost.saturating_add(u32::from(!sent));
    }

    pub(crate) fn down(&mut self, now: Instant, frame: &Frame<'_>, monitor: &Monitor, ways: &mut Outlets) {
        let to = [Port::Gs, Port::Usb].map(|port| Some(port).filter(|port| is_on(*port, monitor, ways)));
        if to == [None; 2] || frame.id() == ids::SETUP_SIGNING {
            return;
        }
        let Some(vehicle) = monitor.vehicle().source else { return };
        let names_another = |(system, _): (u8, u8)| system != 0 && system != vehicle.system;
        let is_other = frame.component() != vehicle.component || frame.system() != vehicle.system;
        let passes = if frame.check() == Check::Unverified {
            let due = self.unknown_at.is_none_or(|at| now.since(at) >= UNKNOWN);
            if due {
                self.unknown_at = Some(now);
            }
            due
        } else {
            frame.target().is_some_and(names_another) && frame.id() != ids::COMMAND_ACK
                || ANSWERS.contains(&frame.id())
                || frame.id() == ids::HEARTBEAT && is_other
        };
        for port in to.into_iter().flatten().filter(|_| passes) {
            let sent = ways.pass(now, port, Class::Bulk, frame.bytes());
            self.lost = self.lost.saturating_add(u32::from(!sent));
        }
    }
}

fn is_on(port: Port, monitor: &Monitor, ways: &Outlets) -> bool {
    let is_used =
        if port == Port::Gs { ways.queues.route() == SummaryRoute::Port } else { ways.queues.is_open(port) };
    is_used && monitor.params().get(Param::GsPass) > 0.5
}
