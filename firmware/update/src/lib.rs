//! Signed update from the card (`docs/update.md`).
//!
//! The *resident program* starts first and is never rewritten. It installs an image from the card into the
//! *application's region*, or starts the application there. All of it but the registers is here, and runs on a PC.
//!
//! | module | content |
//! |---|---|
//! | [`map`] | the places of both programs in flash |
//! | [`header`] | the header of an image: board, version, length, signature |
//! | [`keys`] | the public keys |
//! | [`files`] | a file in a card's root directory, read only |
//! | [`state`] | trials and their ends, as records in a sector of flash |
//! | [`resident`] | the decisions of a start, and the installation |
//! | [`message`] | words from the application to the resident program and back |
#![cfg_attr(not(test), no_std)]

#[cfg(any(test, feature = "sign"))]
extern crate alloc;

pub mod files;
pub mod header;
pub mod keys;
pub mod map;
pub mod message;
pub mod resident;
pub mod state;

#[cfg(test)]
mod campaign_tests;

/// The file on the card, as an entry of a directory has its name: `HUMS.UPD`.
pub const UPDATE: &files::Name = b"HUMS    UPD";
/// The image before it, which `hums box update` keeps: `HUMS.OLD`.
pub const PREVIOUS: &files::Name = b"HUMS    OLD";

/// Oldest version that may follow this one: a later one if an earlier one must not come back.
pub const FLOOR: &str = "0.1.0";

/// CRC-32 (IEEE 802.3), continued from an earlier one; 0 at the beginning.
#[must_use]
pub fn crc32(before: u32, bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!before, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ 0xEDB8_8320 & (crc & 1).wrapping_neg())
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_checksum_is_the_usual_one_in_one_or_several_parts() {
        assert_eq!(super::crc32(0, b"123456789"), 0xCBF4_3926);
        assert_eq!(super::crc32(super::crc32(0, b"1234"), b"56789"), 0xCBF4_3926);
    }
}
