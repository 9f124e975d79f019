//! The mass storage class on a USB driver: bytes between endpoints and [`Transport`].

use embassy_futures::select::{Either, select};
use embassy_futures::{poll_once, yield_now};
use embassy_usb::control::{InResponse, OutResponse, Recipient, Request, RequestType};
use embassy_usb::driver::{Driver, Endpoint as _, EndpointError, EndpointIn as _, EndpointOut as _};
use embassy_usb::types::InterfaceNumber;
use embassy_usb::{Builder, Handler};
use hums_recorder::{Block, CardDevice};

use crate::PACKET_BYTES;
use crate::guard::Link;
use crate::scsi::Disk;
use crate::transport::{Step, Transport};

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
    /// Of the class that shares this state.
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

/// The packet on the bus was not followed by the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// The host has ejected the disk, and has the status of that command.
    Ejected,
    Disabled,
}

impl From<EndpointError> for End {
    fn from(_: EndpointError) -> Self {
        Self::Disabled
    }
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

    /// Serves the disk until the host ejects it. `buffer` is for blocks on their way: at least one.
    pub async fn run<C: CardDevice>(&mut self, disk: &mut Disk<C>, buffer: &mut [Block]) {
        loop {
            self.from_host.wait_enabled().await;
            self.link.abort.reset();
            let link = self.link;
            // The host sends none before the status of its request.
            let mut packet = [0; PACKET_BYTES];
            let _ = poll_once(self.from_host.read(&mut packet));
            // The abort first: the rest of an aborted command must not reach an endpoint that was emptied.
            if let Either::Second(End::Ejected) = select(link.abort.wait(), self.serve(disk, buffer)).await {
                return;
            }
        }
    }

    async fn serve<C: CardDevice>(&mut self, disk: &mut Disk<C>, buffer: &mut [Block]) -> End {
        loop {
            match self.command(disk, buffer).await {
                Ok(()) if disk.is_ejected() => return End::Ejected,
                Ok(()) => {}
                // The abort ends this wait.
                Err(End::Disabled) => core::future::pending::<()>().await,
                Err(end) => return end,
            }
        }
    }

    async fn command<C: CardDevice>(&mut self, disk: &mut Disk<C>, buffer: &mut [Block]) -> Result<(), End> {
        let mut packet = [0; PACKET_BYTES];
        let bytes = self.from_host.read(&mut packet).await?;
        // The card may block each step for its whole service. The watchdog is fed between two of them.
        yield_now().await;
        let Some(scratch) = buffer.first_mut() else { return Err(End::Disabled) };
        let Ok(mut transport) = Transport::begin(packet.get(..bytes).unwrap_or_default(), disk, scratch)
        else {
            self.link.halt();
            return Err(End::Disabled);
        };
        yield_now().await;
        loop {
            match transport.step(disk, buffer) {
                Step::Send([]) => self.to_host.write(&[]).await?,
                Step::Send(data) => {
                    for packet in data.chunks(PACKET_BYTES) {
                        self.to_host.write(packet).await?;
                    }
                }
                Step::Take => transport.taken(self.from_host.read(&mut packet).await?),
                Step::Status(status) => return Ok(self.to_host.write(&status).await?),
            }
        }
    }
}
