//! The public keys that this build takes: `keys/NAME.pub`, 64 hexadecimal digits each.

include!(concat!(env!("OUT_DIR"), "/keys.rs"));

/// The public key of the repository's test key, whose secret everybody has. A release takes no image of it.
pub const TEST: [u8; 32] = TEST_KEY;
