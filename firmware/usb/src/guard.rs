//! A USB driver for hostile hosts, around any other driver.
//!
//! It adds four things to the driver inside:
//! * Requests about endpoints that no class has do nothing. Drivers of embassy panic on them.
//! * A class can halt its endpoints ([`Link::halt`]). They stay halted until the host resets class or bus (BOT, 6.6.1).
//! * A packet that the host did not fetch is dropped by the next configuration, and by a reset of the class. A driver may wait for it
//!   for ever.
//! * After a halt an endpoint begins with DATA0 again (USB 2.0, 9.4.5), by a function of the board.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_futures::select::{Either3, select3};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_usb::driver::{
    self, Direction, EndpointAddress, EndpointAllocError, EndpointType, Event, Unsupported,
};

/// State that class, control requests and bus share.
pub struct Link {
    /// The host has reset class or bus: the command in work is over.
    pub(crate) abort: Signal<CriticalSectionRawMutex, ()>,
    halt: Signal<CriticalSectionRawMutex, ()>,
    empty: Signal<CriticalSectionRawMutex, ()>,
    is_halted: AtomicBool,
    is_configured: AtomicBool,
    is_suspended: AtomicBool,
}

impl Default for Link {
    fn default() -> Self {
        Self::new()
    }
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
            is_suspended: AtomicBool::new(false),
        }
    }

    /// Whether a host uses the device. A charger does not, nor does a host that sleeps or whose cable is pulled.
    pub fn has_host(&self) -> bool {
        self.is_configured.load(Ordering::Relaxed) && !self.is_suspended.load(Ordering::Relaxed)
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

    fn abort(&self) {
        self.is_halted.store(false, Ordering::Relaxed);
        self.halt.reset();
        self.abort.signal(());
    }

    pub(crate) fn configured(&self, is_so: bool) {
        self.is_configured.store(is_so, Ordering::Relaxed);
        self.abort();
    }

    pub(crate) fn suspended(&self, is_so: bool) {
        self.is_suspended.store(is_so, Ordering::Relaxed);
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
pub struct Guarded<'d, D> {
    inner: D,
    link: &'d Link,
    begin_anew: fn(EndpointAddress),
    endpoints: Endpoints,
}

impl<'d, D> Guarded<'d, D> {
    /// Around this driver. `begin_anew` lets an endpoint go on with DATA0.
    pub fn new(inner: D, link: &'d Link, begin_anew: fn(EndpointAddress)) -> Self {
        Self { inner, link, begin_anew, endpoints: Endpoints::default() }
    }
}

impl<'d, D: driver::Driver<'d>> driver::Driver<'d> for Guarded<'d, D> {
    type EndpointOut = D::EndpointOut;
    type EndpointIn = D::EndpointIn;
    type ControlPipe = D::ControlPipe;
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
        let Self { inner, link, begin_anew, endpoints } = self;
        let (inner, control) = inner.start(control_packet_bytes);
        (GuardedBus { inner, link, begin_anew, endpoints }, control)
    }
}

/// Its bus.
pub struct GuardedBus<'d, B> {
    inner: B,
    link: &'d Link,
    begin_anew: fn(EndpointAddress),
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
        }
    }

    fn endpoint_set_stalled(&mut self, address: EndpointAddress, is_stalled: bool) {
        if !self.endpoints.has(address) || self.link.is_halted.load(Ordering::Relaxed) {
            return;
        }
        self.inner.endpoint_set_stalled(address, is_stalled);
        if !is_stalled {
            (self.begin_anew)(address);
        }
    }

    fn endpoint_is_stalled(&mut self, address: EndpointAddress) -> bool {
        self.endpoints.has(address) && self.inner.endpoint_is_stalled(address)
    }

    async fn remote_wakeup(&mut self) -> Result<(), Unsupported> {
        self.inner.remote_wakeup().await
    }
}
