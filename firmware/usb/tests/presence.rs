//! A host is there while it is awake and uses the device.

use hums_core::clock::{Instant, Span};
use hums_usb::presence::Presence;

const LOOK: u64 = 100;

/// Looks at a bus for some looks; returns the time without a host, in milliseconds.
fn absent(looks: impl IntoIterator<Item = (bool, u16)>) -> u64 {
    let mut presence = Presence::new(Instant::ZERO);
    let mut now = Instant::ZERO;
    for (is_configured, frame) in looks {
        now = now + Span::from_millis(LOOK);
        presence.look(now, is_configured, frame);
    }
    presence.absent(now).as_millis()
}

#[test]
fn time_without_a_host_counts_from_its_last_frame() {
    // The number has 11 bits at full speed.
    let frames = (0..1_000_u16).map(|look| look.wrapping_mul(97) & 0x7FF);
    assert_eq!(absent(frames.clone().map(|frame| (true, frame))), 0);
    assert_eq!(absent((0..50).map(|_| (false, 0))), 50 * LOOK);
    assert_eq!(absent(frames.clone().take(50).map(|frame| (false, frame))), 50 * LOOK);
    let pulled = frames.clone().take(20).chain([7; 30]).map(|frame| (true, frame));
    assert_eq!(absent(pulled.clone()), 29 * LOOK);
    assert_eq!(absent(pulled.chain([(true, 8)])), 0);
}
