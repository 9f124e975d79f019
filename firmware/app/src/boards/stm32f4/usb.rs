//! USB: what its driver leaves out.

use embassy_stm32::pac;
use hums_usb::driver::{Direction, EndpointAddress};

/// The bus was reset, or sleeps, and the driver does not know yet.
pub(crate) fn has_bus_event() -> bool {
    let flags = pac::USB_OTG_FS.gintsts().read();
    flags.usbrst() || flags.enumdne() || flags.usbsusp()
}

/// Number of the last frame that a host began, 11 bits.
pub(crate) fn frame_number() -> u16 {
    pac::USB_OTG_FS.dsts().read().fnsof()
}

/// Drops the packet that the control endpoint has for the host. A new SETUP leaves it enabled, and the driver then waits for it for
/// ever.
pub(crate) fn drop_control_packet() {
    let port = pac::USB_OTG_FS;
    critical_section::with(|_| {
        if !port.diepctl(0).read().epena() {
            return;
        }
        port.diepctl(0).modify(|w| {
            w.set_snak(true);
            w.set_epdis(true);
        });
        port.grstctl().write(|w| {
            w.set_txfnum(0);
            w.set_txfflsh(true);
        });
        while port.grstctl().read().txfflsh() {}
    });
}

/// An endpoint goes on with DATA0 (RM0090, 34.16.4: SD0PID), as after a halt that the host has cleared. The driver keeps the
/// toggle.
pub(crate) fn begin_with_data0(endpoint: EndpointAddress) {
    let (port, index) = (pac::USB_OTG_FS, endpoint.index());
    // The driver changes the same registers in interrupts.
    critical_section::with(|_| match endpoint.direction() {
        Direction::In => port.diepctl(index).modify(|w| w.set_sd0pid_sevnfrm(true)),
        Direction::Out => port.doepctl(index).modify(|w| w.set_sd0pid_sevnfrm(true)),
    });
}
