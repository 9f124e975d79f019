//! Waits for an armed vehicle on the autopilot's line, without a monitor: in card-reader mode nothing is recorded.

use hums_core::observation::{Observation, Source};
use hums_link::frame::{Check, Frame};
use hums_link::framer::Framer;

/// Armed heartbeats until the vehicle counts as armed. A checksum of 16 bits passes one damaged frame in 65,536.
const HEARTBEATS: u8 = 2;

/// The watch. About 1 KiB.
#[derive(Debug)]
pub struct ArmingWatch {
    framer: Framer,
    armed: Armed,
}

/// Armed heartbeats, and whose was the last. Another vehicle's that say disarmed do not count.
#[derive(Debug)]
struct Armed {
    count: u8,
    by: Option<Source>,
}

impl ArmingWatch {
    /// Before the first byte.
    pub const fn new() -> Self {
        Self { framer: Framer::new(), armed: Armed { count: 0, by: None } }
    }

    /// Room for the next bytes; see [`Framer::room`].
    pub fn room(&mut self) -> &mut [u8] {
        self.framer.room()
    }

    /// Takes the first `count` bytes of [`Self::room`].
    pub fn received(&mut self, count: usize) {
        let Self { framer, armed } = self;
        framer.received(count, &mut |frame| heard(armed, &frame));
    }

    /// Bytes were lost before the next ones: a begun frame will not be finished.
    pub fn lost(&mut self) {
        let Self { framer, armed } = self;
        framer.idle(&mut |frame| heard(armed, &frame));
    }

    /// Two heartbeats were armed, and the vehicle of the first did not disarm between them.
    pub const fn is_armed(&self) -> bool {
        self.armed.count >= HEARTBEATS
    }
}

fn heard(armed: &mut Armed, frame: &Frame<'_>) {
    if armed.count >= HEARTBEATS || frame.check() != Check::Verified {
        return;
    }
    if let Some((source, Observation::Heartbeat(heartbeat))) = hums_link::observe(frame) {
        if heartbeat.armed {
            *armed = Armed { count: armed.count + 1, by: Some(source) };
        } else if armed.by == Some(source) {
            armed.count = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
    use hums_link::packet::Packet;

    use super::*;

    const ARMED: u8 = 0x81;
    const DISARMED: u8 = 0x01;

    fn heartbeat(kind: u8, autopilot: u8, base_mode: u8) -> Vec<u8> {
        heartbeat_of(1, kind, autopilot, base_mode)
    }

    fn heartbeat_of(system: u8, kind: u8, autopilot: u8, base_mode: u8) -> Vec<u8> {
        let packet = Packet::new(0).u8(4, kind).u8(5, autopilot).u8(6, base_mode).u8(7, 4).u8(8, 3);
        Encoder::of(system, 1).frame(&mut [0; FRAME_BYTES_MAX], &packet).to_vec()
    }

    fn after(bytes: &[u8]) -> bool {
        let mut watch = ArmingWatch::new();
        for piece in bytes.chunks(7) {
            watch.room()[..piece.len()].copy_from_slice(piece);
            watch.received(piece.len());
        }
        watch.is_armed()
    }

    #[test]
    fn two_armed_heartbeats_of_a_vehicle_in_a_row_arm_it_and_nothing_else_does() {
        let (armed, disarmed) = (heartbeat(2, 3, ARMED), heartbeat(2, 3, DISARMED));
        let mut damaged = armed.clone();
        damaged[16] ^= 1;
        assert!(after(&[armed.clone(), armed.clone()].concat()));
        assert!(after(&[disarmed.clone(), armed.clone(), damaged.clone(), armed.clone()].concat()));
        assert!(!after(&armed));
        assert!(!after(&[armed.clone(), disarmed, armed.clone()].concat()));
        assert!(!after(&[damaged.clone(), damaged, armed].concat()));
        assert!(!after(&heartbeat(6, 3, ARMED).repeat(3)));
        assert!(!after(&heartbeat(30, 8, ARMED).repeat(3)));
        assert!(!after(&[0xFD; 2_000]));
    }

    #[test]
    fn another_vehicle_that_is_disarmed_does_not_hide_an_armed_one() {
        let (armed, disarmed) = (heartbeat(2, 3, ARMED), heartbeat(2, 3, DISARMED));
        let other = |base_mode| heartbeat_of(2, 2, 3, base_mode);
        assert!(after(&[armed.clone(), other(DISARMED), armed.clone()].concat()));
        assert!(after(&[other(DISARMED), armed.clone(), other(ARMED)].concat()));
        assert!(!after(&[armed.clone(), disarmed.clone(), other(ARMED)].concat()));
        assert!(!after(&[armed, other(DISARMED), disarmed].concat().repeat(3)));
    }

    #[test]
    fn a_frame_that_was_cut_by_a_loss_does_not_hide_the_next_one() {
        let armed = heartbeat(2, 3, ARMED);
        let mut watch = ArmingWatch::new();
        let cut = [&[0xFD, 200, 0, 0][..], &armed[..9]].concat();
        watch.room()[..cut.len()].copy_from_slice(&cut);
        watch.received(cut.len());
        watch.lost();
        let two = armed.repeat(2);
        watch.room()[..two.len()].copy_from_slice(&two);
        watch.received(two.len());
        assert!(watch.is_armed());
    }
}
