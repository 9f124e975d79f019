//! The USB device of both modes: its identity, and its driver with the guard against hostile hosts.

use hums_usb::guard::{GuardedDriver, Link, Port};
use hums_usb::scsi::SERIAL_BYTES;
use hums_usb::{Config, PACKET_BYTES};

use crate::boards::board;
use crate::links::now;

/// The test numbers of pid.codes: the project has none of its own.
const VENDOR: u16 = 0x1209;

/// A mode's device.
#[derive(Clone, Copy)]
pub(crate) struct Identity {
    pub(crate) product: u16,
    pub(crate) name: &'static str,
}

/// One packet of each endpoint from the host: control and class.
pub(crate) type Packets = [u8; 2 * PACKET_BYTES];

pub(crate) type Driver<'d> = GuardedDriver<'d, board::UsbDriver<'d>>;

pub(crate) fn driver<'d>(usb: board::Usb, packets: &'d mut Packets, link: &'d Link) -> Driver<'d> {
    let port = Port {
        begin_with_data0: board::begin_with_data0,
        drop_control_packet: board::drop_control_packet,
        has_bus_event: board::has_bus_event,
        now,
    };
    GuardedDriver::new(usb.driver(packets), link, port)
}

pub(crate) fn config(identity: Identity, serial: &[u8; SERIAL_BYTES]) -> Config<'_> {
    let mut config = Config::new(VENDOR, identity.product);
    config.self_powered = true;
    config.manufacturer = Some("HUMS");
    config.product = Some(identity.name);
    config.serial_number = core::str::from_utf8(serial).ok();
    config
}

/// The chip's unique id in hexadecimal, as the class of disks wants a serial number (BOT, 4.1.1).
pub(crate) fn digits(id: [u8; 12]) -> [u8; SERIAL_BYTES] {
    let mut digits = [0; SERIAL_BYTES];
    let nibbles = id.into_iter().flat_map(|byte| [byte >> 4, byte & 15]);
    for (digit, nibble) in digits.iter_mut().zip(nibbles) {
        *digit = if nibble < 10 { b'0' + nibble } else { b'A' + nibble - 10 };
    }
    digits
}
