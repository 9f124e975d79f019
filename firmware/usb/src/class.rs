//! The mass storage class on a USB driver: packets between endpoints and [`crate::server`].

use core::future::pending;
use core::iter;

use embassy_futures::join::join;
use embassy_futures::poll_once;
use embassy_futures::select::select;
use embassy_usb::control::{InResponse, OutResponse, Recipient, Request, RequestType};
use embassy_usb::driver::{Driver, Endpoint as _, EndpointIn, EndpointOut};
use embassy_usb::types::InterfaceNumber;
use embassy_usb::{Builder, Handler};

use crate::PACKET_BYTES;
use crate::guard::Link;
use crate::server::{Lane, Outgoing};

/// Mass storage, SCSI commands, Bulk-Only Transport (BOT, 4.3).
const CLASS: u8 = 0x08;
const SUBCLASS: u8 = 0x06;
const PROTOCOL: u8 = 0x50;
/// Requests of the class (BOT, 3).
const RESET: u8 = 0xFF;
const GET_MAX_LUN: u8 = 0xFE;

/// Control requests of the class, and events of the bus. Without a class it has the events only.
pub struct Control<'d> {
    interface: Option<InterfaceNumber>,
    link: &'d Link,
}

impl<'d> Control<'d> {
    /// The transport of the class with this state.
    pub const fn new(link: &'d Link) -> Self {
        Self { interface: None, link }
    }

    fn concerns(&self, request: &Request) -> bool {
        let of = (request.request_type, request.recipient, request.value);
        let interface = self.interface.map(u8::from).map(u16::from);
        of == (RequestType::Class, Recipient::Interface, 0) && Some(request.index) == interface
    }
}

impl Handler for Control<'_> {
    fn reset(&mut self) {
        self.link.configured(false);
    }

    fn configured(&mut self, is_so: bool) {
        self.link.configured(is_so);
    }

    fn set_alternate_setting(&mut self, _: InterfaceNumber, _: u8) {
        self.link.abort();
    }

    fn control_out(&mut self, request: Request, _data: &[u8]) -> Option<OutResponse> {
        if !self.concerns(&request) {
            return None;
        }
        if (request.request, request.length) != (RESET, 0) {
            return Some(OutResponse::Rejected);
        }
        self.link.reset();
        Some(OutResponse::Accepted)
    }

    fn control_in<'a>(&'a mut self, request: Request, _buffer: &'a mut [u8]) -> Option<InResponse<'a>> {
        if !self.concerns(&request) {
            return None;
        }
        // One unit, number 0.
        Some(if request.request == GET_MAX_LUN { InResponse::Accepted(&[0]) } else { InResponse::Rejected })
    }
}

/// The endpoints of the class.
pub struct MassStorage<'d, D: Driver<'d>> {
    from_host: D::EndpointOut,
    to_host: D::EndpointIn,
    link: &'d Link,
}

impl<'d, D: Driver<'d>> MassStorage<'d, D> {
    /// Adds the class to a device. The state of `control` and the driver's guard must be the same.
    pub fn new(builder: &mut Builder<'d, D>, control: &'d mut Control<'d>) -> Self {
        let link = control.link;
        let mut function = builder.function(CLASS, SUBCLASS, PROTOCOL);
        let mut interface = function.interface();
        control.interface = Some(interface.interface_number());
        let mut setting = interface.alt_setting(CLASS, SUBCLASS, PROTOCOL, None);
        let from_host = setting.endpoint_bulk_out(None, PACKET_BYTES as u16);
        let to_host = setting.endpoint_bulk_in(None, PACKET_BYTES as u16);
        drop(function);
        builder.handler(control);
        Self { from_host, to_host, link }
    }

    /// Moves packets between bus and card, for ever.
    pub async fn run(&mut self, lane: &Lane, mut chunks: Outgoing<'_, '_>) -> ! {
        let Self { from_host, to_host, link } = self;
        loop {
            from_host.wait_enabled().await;
            link.abort.reset();
            lane.abort(&mut chunks);
            // The host sends no packet before the status of its request.
            let mut packet = [0; PACKET_BYTES];
            let _ = poll_once(from_host.read(&mut packet));
            // The abort first: the rest of an aborted command must not reach an endpoint that was emptied.
            let serve = join(take(from_host, lane), send(to_host, &mut chunks));
            select(link.abort.wait(), serve).await;
        }
    }
}

/// Until the endpoint is disabled, after which the abort comes.
async fn take(from_host: &mut impl EndpointOut, lane: &Lane) {
    let mut packet = [0; PACKET_BYTES];
    while let Ok(bytes) = from_host.read(&mut packet).await {
        lane.packets.send((packet, bytes)).await;
    }
    pending::<()>().await;
}

/// As [`take`].
async fn send(to_host: &mut impl EndpointIn, chunks: &mut Outgoing<'_, '_>) {
    loop {
        let mut packets = chunks.receive().await.data().chunks(PACKET_BYTES);
        let first = packets.next().unwrap_or_default();
        for packet in iter::once(first).chain(packets) {
            if to_host.write(packet).await.is_err() {
                return pending().await;
            }
        }
        chunks.receive_done();
    }
}
