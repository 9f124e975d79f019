//! The hash of the message layouts, which each group names: it decodes with the layouts that it was written with. Stored form,
//! ids ascending:
//!
//! ```text
//! message: id u24, checksum seed u8, payload bytes without extensions u8, fields u8, then for each field in wire
//!          order: u8 with the kind in bits 0..=3 (0 u8, 1 i8, 2 char, 3 u16, 4 i16, 5 u32, 6 i32, 7 f32, 8 u64,
//!          9 i64, 10 f64) and the role in bits 4..=5 (0 plain, 1 instance, 2 milliseconds, 3 microseconds),
//!          elements u8 (0: a scalar)
//! ```
//! The hash is the CRC-32C of the stored form.

use crate::crc::Crc32c;

/// A constant, so that no flip of memory makes all groups of a session wrong.
pub(crate) const CURRENT: u32 = Crc32c::of_constant(include_bytes!("../layouts/table-1.bin"));

/// Stores the table.
pub fn store(mut out: impl FnMut(&[u8])) {
    for message in hums_dialect::messages() {
        let [low, middle, high, _] = message.id.to_le_bytes();
        out(&[low, middle, high, message.crc_extra, message.len_base, message.fields.len() as u8]);
        for field in message.fields {
            out(&[field.kind as u8 | (field.role as u8) << 4, field.array]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_that_of_this_build() {
        let mut crc = Crc32c::new();
        store(|bytes| crc.add(bytes));
        // Logs of the former table become unreadable: first bring back stored tables.
        assert_eq!(crc.value(), CURRENT, "a new dialect: bring back stored tables, or logs are lost");
    }
}
