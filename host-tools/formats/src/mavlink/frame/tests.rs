//! A recorded frame, whole and damaged.

use super::*;

/// ArduCopter 4.6, MAVLink 2, recorded.
pub(crate) const HEARTBEAT: [u8; 21] = [
    0xfd, 0x09, 0x00, 0x00, 0x00, 0xff, 0xbe, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x06, 0x08, 0x00,
    0x04, 0x03, 0x3d, 0x48,
];

#[test]
fn a_frame_from_a_recording_checks() {
    let Peek::Frame(frame) = peek(&HEARTBEAT) else { panic!("no frame") };
    assert_eq!((frame.id(), frame.system(), frame.component()), (0, 255, 190));
    assert!(frame.payload().len() == 9 && is_good(&frame));
}

#[test]
fn a_flipped_bit_is_noticed() {
    for at in 10..HEARTBEAT.len() {
        let mut bytes = HEARTBEAT;
        bytes[at] ^= 0x10;
        let Peek::Frame(frame) = peek(&bytes) else { panic!("no frame") };
        assert!(!is_good(&frame), "byte {at}");
    }
}

#[test]
fn every_cut_is_short_and_other_bytes_are_other() {
    for end in 1..HEARTBEAT.len() {
        assert_eq!(peek(&HEARTBEAT[..end]), Peek::Short, "{end} bytes");
    }
    assert_eq!(peek(b""), Peek::Other);
    assert_eq!(peek(b"Init ArduCopter"), Peek::Other);
    assert_eq!(peek(&[0xfd, 9, 0x40, 0]), Peek::Other, "an incompatibility flag nobody knows");
}
