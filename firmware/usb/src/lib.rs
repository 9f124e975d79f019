//! The USB plug: the card as a read-only disk (*card-reader mode*), and a serial port while the box records ([`serial`]).
//!
//! ```text
//! host -> bulk OUT -> Server (reads ahead) -> Transport (wrappers, lengths) -> Disk (SCSI commands) -> CardDevice
//! host <- bulk IN  <-
//! ```
//! [`server`], [`transport`] and [`scsi`] have no I/O but the card. [`class`] moves their bytes through any driver of
//! `embassy_usb`, which [`guard`] protects from a hostile host.
//!
//! Rules:
//! * The disk cannot be written. Writes are refused as protected, and hosts are told so by MODE SENSE.
//! * Each address and length of a host is checked against the card before the card is read.
//! * A read error of the card is a medium error. Data is sent only after the card has given it without an error.
//!
//! Sources: USB Mass Storage Class Bulk-Only Transport 1.0 (*BOT*), SPC-4, SBC-3.
#![cfg_attr(not(test), no_std)]

pub mod class;
pub mod guard;
pub mod presence;
pub mod scsi;
pub mod serial;
pub mod server;
pub mod transport;

pub use embassy_usb::driver;
pub use embassy_usb::{Builder, Config, UsbDevice};

/// Bytes of a packet on a bulk endpoint at full speed.
pub const PACKET_BYTES: usize = 64;
