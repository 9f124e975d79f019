//! USB: what its driver leaves out.

use embassy_stm32::pac;
use hums_usb::driver::{Direction, EndpointAddress};

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
