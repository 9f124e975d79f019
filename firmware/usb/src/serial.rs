//! A serial port (CDC-ACM) by `embassy_usb`'s own class: frames in packets, and whether a host takes them.

pub use embassy_usb::class::cdc_acm::{CdcAcmClass, Receiver, Sender, State};
use embassy_usb::driver::{Driver, EndpointError};

use crate::PACKET_BYTES;

/// Bytes of the configuration's descriptor.
pub const DESCRIPTOR_BYTES: usize = 80;

/// Sends a frame. Returns when its last packet waits for the host.
pub async fn send<'d, D: Driver<'d>>(sender: &mut Sender<'d, D>, frame: &[u8]) -> Result<(), EndpointError> {
    for packet in frame.chunks(PACKET_BYTES) {
        sender.write_packet(packet).await?;
    }
    if frame.len().is_multiple_of(PACKET_BYTES) {
        // A host hands over what it has at a short packet.
        sender.write_packet(&[]).await?;
    }
    Ok(())
}

/// Returns when a host has fetched a packet without bytes: a program has opened the port. Hosts fetch none before.
pub async fn wait_for_reader<'d, D: Driver<'d>>(sender: &mut Sender<'d, D>) -> Result<(), EndpointError> {
    // The first one waits for the host, the second one for the first one to be fetched.
    sender.write_packet(&[]).await?;
    sender.write_packet(&[]).await
}
