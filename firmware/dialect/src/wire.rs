//! The parts of any frame, and their lengths (MAVLink developer guide, "Packet serialization").
//!
//! ```text
//! MAVLink 1: start, length, sequence, system, component, id (1 byte)                          | payload | checksum
//! MAVLink 2: start, length, incompat, compat, sequence, system, component, id (3 bytes) | payload | checksum [| signature]
//! ```

/// The first byte of a MAVLink 1 frame.
pub const START_V1: u8 = 0xfe;
/// The first byte of a MAVLink 2 frame.
pub const START_V2: u8 = 0xfd;
/// Header bytes of a MAVLink 1 frame.
pub const HEADER_V1_BYTES: usize = 6;
/// Header bytes of a MAVLink 2 frame.
pub const HEADER_V2_BYTES: usize = 10;
/// The longest payload.
pub const PAYLOAD_BYTES_MAX: usize = u8::MAX as usize;
/// The checksum.
pub const CHECKSUM_BYTES: usize = 2;
/// The signature behind the checksum of a signed frame: link id, time stamp of 6 bytes, hash of 6 bytes.
pub const SIGNATURE_BYTES: usize = 13;
/// The longest frame: MAVLink 2, signed.
pub const FRAME_BYTES_MAX: usize = HEADER_V2_BYTES + PAYLOAD_BYTES_MAX + CHECKSUM_BYTES + SIGNATURE_BYTES;

/// The only defined incompatibility flag: the frame is signed.
pub const INCOMPAT_SIGNED: u8 = 1;
