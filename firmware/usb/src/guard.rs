//! A USB driver for hostile hosts, around any other driver.
//!
//! The guard adds:
//! * Requests about endpoints that no class has do nothing. Drivers of embassy panic on them.
//! * A class can halt its endpoints (`Link::halt`). They stay halted until the host resets class or bus (BOT, 6.6.1).
//! * A packet that the host did not fetch is dropped by the next configuration, and by a reset of the class. A driver may wait for it
//!   for ever.
//! * After a halt, and with a configuration, an endpoint begins with DATA0 (USB 2.0, 9.1.1.5 and 9.4.5), by a function of the board.
//! * A control transfer ends with the next SETUP, with a reset or sleep of the bus, or after [`CONTROL_MAX`]. A driver waits for the
//!   host's last packet for ever.
//!
//! The guard drops futures of the control pipe that wait, and begins them again. The pipe inside must have changed nothing until then,
//! as that of `embassy_usb_synopsys_otg`.

use core::future::poll_fn;
use core::pin::pin;
use core::sync::atomic::{AtomicBool, Ordering};
use core::task::{Context, Poll};

use embassy_futures::select::{Either3, select3};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_usb::driver::{
    self, Direction, EndpointAddress, EndpointAllocError, EndpointError, EndpointType, Event, Unsupported,
};
use hums_core::clock::{Instant, Span};

use crate::PACKET_BYTES;

/// A stage of a control transfer ends after this time. Hosts give a whole transfer 5 s.
pub const CONTROL_MAX: Span = Span::from_secs(1);

/// Functions of the board that its driver leaves out.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// The endpoint goes on with DATA0.
    pub begin_with_data0: fn(EndpointAddress),
    /// Drops the packet that the control endpoint has for the host.
    pub drop_control_packet: fn(),
    /// The bus was reset or sleeps, and [`driver::Bus::poll`] has not seen it yet.
    pub has_bus_event: fn() -> bool,
    /// The clock of [`CONTROL_MAX`].
    pub now: fn() -> Instant,
}

/// State that class, control requests and bus share.
pub struct Link {
    /// The host has reset class or bus: the command in work is over.
    pub(crate) abort: Signal<CriticalSectionRawMutex, ()>,
    halt: Signal<CriticalSectionRawMutex, ()>,
    empty: Signal<CriticalSectionRawMutex, ()>,
    is_halted: AtomicBool,
    is_configured: AtomicBool,
}

impl Link {
    /// Before the host is there.
    pub const fn new() -> Self {
        Self {
            abort: Signal::new(),
            halt: Signal::new(),
            empty: Signal::new(),
            is_halted: AtomicBool::new(false),
            is_configured: AtomicBool::new(false),
        }
    }

    /// Whether a host has configured the device. A charger does not. A pulled cable does not change it.
    pub fn is_configured(&self) -> bool {
        self.is_configured.load(Ordering::Relaxed)
    }

    pub(crate) fn halt(&self) {
        self.is_halted.store(true, Ordering::Relaxed);
        self.halt.signal(());
    }

    /// The host has reset the class: it may clear halts.
    pub(crate) fn reset(&self) {
        self.abort();
        self.empty.signal(());
    }

    /// Ends the command in work.
    pub(crate) fn abort(&self) {
        self.is_halted.store(false, Ordering::Relaxed);
        self.halt.reset();
        self.abort.signal(());
    }

    pub(crate) fn configured(&self, is_so: bool) {
        self.is_configured.store(is_so, Ordering::Relaxed);
        self.abort();
    }
}

/// Endpoints of the classes: a bit for each number, in and out.
#[derive(Clone, Copy, Debug, Default)]
struct Endpoints {
    to_host: u16,
    from_host: u16,
}

impl Endpoints {
    fn add(&mut self, address: EndpointAddress) {
        let bits = match address.direction() {
            Direction::In => &mut self.to_host,
            Direction::Out => &mut self.from_host,
        };
        *bits |= 1 << address.index();
    }

    fn has(self, address: EndpointAddress) -> bool {
        let bits = match address.direction() {
            Direction::In => self.to_host,
            Direction::Out => self.from_host,
        };
        bits >> address.index() & 1 == 1
    }

    fn each(self, mut act: impl FnMut(EndpointAddress)) {
        for index in 0..16 {
            for direction in [Direction::In, Direction::Out] {
                let address = EndpointAddress::from_parts(index, direction);
                if self.has(address) {
                    act(address);
                }
            }
        }
    }
}

/// The guarded driver.
pub struct GuardedDriver<'d, D> {
    inner: D,
    link: &'d Link,
    port: Port,
    endpoints: Endpoints,
}

impl<'d, D> GuardedDriver<'d, D> {
    /// Around the driver of this port.
    pub fn new(inner: D, link: &'d Link, port: Port) -> Self {
        Self { inner, link, port, endpoints: Endpoints::default() }
    }
}

impl<'d, D: driver::Driver<'d>> driver::Driver<'d> for GuardedDriver<'d, D> {
    type EndpointOut = D::EndpointOut;
    type EndpointIn = D::EndpointIn;
    type ControlPipe = GuardedPipe<D::ControlPipe>;
    type Bus = GuardedBus<'d, D::Bus>;

    fn alloc_endpoint_out(
        &mut self,
        kind: EndpointType,
        address: Option<EndpointAddress>,
        packet_bytes: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointOut, EndpointAllocError> {
        let endpoint = self.inner.alloc_endpoint_out(kind, address, packet_bytes, interval_ms)?;
        self.endpoints.add(driver::Endpoint::info(&endpoint).addr);
        Ok(endpoint)
    }

    fn alloc_endpoint_in(
        &mut self,
        kind: EndpointType,
        address: Option<EndpointAddress>,
        packet_bytes: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointIn, EndpointAllocError> {
        let endpoint = self.inner.alloc_endpoint_in(kind, address, packet_bytes, interval_ms)?;
        self.endpoints.add(driver::Endpoint::info(&endpoint).addr);
        Ok(endpoint)
    }

    fn start(self, control_packet_bytes: u16) -> (Self::Bus, Self::ControlPipe) {
        let Self { inner, link, port, endpoints } = self;
        let (bus, control) = inner.start(control_packet_bytes);
        (GuardedBus { inner: bus, link, port, endpoints }, GuardedPipe { inner: control, port, setup: None })
    }
}

/// Its bus.
pub struct GuardedBus<'d, B> {
    inner: B,
    link: &'d Link,
    port: Port,
    endpoints: Endpoints,
}

fn empty(bus: &mut impl driver::Bus, address: EndpointAddress) {
    if address.is_in() {
        bus.endpoint_set_enabled(address, false);
        bus.endpoint_set_enabled(address, true);
    }
}

impl<B: driver::Bus> driver::Bus for GuardedBus<'_, B> {
    async fn enable(&mut self) {
        self.inner.enable().await;
    }

    async fn disable(&mut self) {
        self.inner.disable().await;
    }

    async fn poll(&mut self) -> Event {
        loop {
            match select3(self.inner.poll(), self.link.halt.wait(), self.link.empty.wait()).await {
                Either3::First(event) => return event,
                Either3::Second(()) => {
                    self.endpoints.each(|address| self.inner.endpoint_set_stalled(address, true));
                }
                // An endpoint without a configuration is off, and emptying would turn it on.
                Either3::Third(()) if !self.link.is_configured() => {}
                Either3::Third(()) => self.endpoints.each(|address| empty(&mut self.inner, address)),
            }
        }
    }

    fn endpoint_set_enabled(&mut self, address: EndpointAddress, is_enabled: bool) {
        if !self.endpoints.has(address) {
            return;
        }
        self.inner.endpoint_set_enabled(address, is_enabled);
        if is_enabled {
            empty(&mut self.inner, address);
            self.inner.endpoint_set_stalled(address, false);
            (self.port.begin_with_data0)(address);
        }
    }

    fn endpoint_set_stalled(&mut self, address: EndpointAddress, is_stalled: bool) {
        if !self.endpoints.has(address) || self.link.is_halted.load(Ordering::Relaxed) {
            return;
        }
        self.inner.endpoint_set_stalled(address, is_stalled);
        if !is_stalled {
            (self.port.begin_with_data0)(address);
        }
    }

    fn endpoint_is_stalled(&mut self, address: EndpointAddress) -> bool {
        self.endpoints.has(address) && self.inner.endpoint_is_stalled(address)
    }

    async fn remote_wakeup(&mut self) -> Result<(), Unsupported> {
        self.inner.remote_wakeup().await
    }
}

/// Its control pipe.
pub struct GuardedPipe<P> {
    inner: P,
    port: Port,
    setup: Option<[u8; 8]>,
}

impl<P: driver::ControlPipe> GuardedPipe<P> {
    fn poll_setup(&mut self, context: &mut Context<'_>) -> Poll<[u8; 8]> {
        let setup = pin!(self.inner.setup()).poll(context);
        if setup.is_ready() {
            // The host has ended the transfer before.
            (self.port.drop_control_packet)();
        }
        setup
    }

    async fn stage<T>(&mut self, mut poll: impl FnMut(&mut P, &mut Context<'_>) -> Poll<T>) -> Option<T> {
        let end = (self.port.now)() + CONTROL_MAX;
        poll_fn(|context| {
            // The bus and the SETUP first: a packet that is written now would be taken for one of the next transfer.
            if self.setup.is_some() || (self.port.has_bus_event)() {
                return Poll::Ready(None);
            }
            if let Poll::Ready(setup) = self.poll_setup(context) {
                self.setup = Some(setup);
                return Poll::Ready(None);
            }
            match poll(&mut self.inner, context) {
                Poll::Ready(value) => Poll::Ready(Some(value)),
                Poll::Pending if (self.port.now)() < end => Poll::Pending,
                Poll::Pending => Poll::Ready(None),
            }
        })
        .await
    }
}

impl<P: driver::ControlPipe> driver::ControlPipe for GuardedPipe<P> {
    fn max_packet_size(&self) -> usize {
        self.inner.max_packet_size()
    }

    async fn setup(&mut self) -> [u8; 8] {
        poll_fn(|context| {
            if let Some(setup) = self.setup.take() {
                return Poll::Ready(setup);
            }
            // A packet of a transfer that was given up: none of the next transfer comes before the driver has given its SETUP.
            let _ = pin!(self.inner.data_out(&mut [0; PACKET_BYTES], true, true)).poll(context);
            self.poll_setup(context)
        })
        .await
    }

    async fn data_out(&mut self, buffer: &mut [u8], first: bool, last: bool) -> Result<usize, EndpointError> {
        let stage = self.stage(|inner, context| pin!(inner.data_out(buffer, first, last)).poll(context));
        stage.await.unwrap_or(Err(EndpointError::Disabled))
    }

    async fn data_in(&mut self, data: &[u8], first: bool, last: bool) -> Result<(), EndpointError> {
        let write = self.stage(|inner, context| pin!(inner.data_in(data, first, false)).poll(context));
        write.await.unwrap_or(Err(EndpointError::Disabled))?;
        if last {
            // The status, which the driver would wait for in one with the data.
            self.data_out(&mut [], false, true).await?;
        }
        Ok(())
    }

    async fn accept(&mut self) {
        let _ = self.stage(|inner, context| pin!(inner.accept()).poll(context)).await;
    }

    async fn reject(&mut self) {
        self.inner.reject().await;
    }

    async fn accept_set_address(&mut self, address: u8) {
        let _ = self.stage(|inner, context| pin!(inner.accept_set_address(address)).poll(context)).await;
    }
}
