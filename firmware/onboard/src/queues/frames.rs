//! Queues of frames, each with its time and whether its checksum is ours.

use bbqueue::nicknames::Churrasco;
use bbqueue::prod_cons::framed::{FramedConsumer, FramedProducer};

use super::capacities::{FRAME_QUEUE_BYTES, UPLINK_QUEUE_BYTES};
use super::level::Level;

/// Bytes before a frame in its queue: when it came (u64 microseconds) and whether its checksum is ours.
pub(super) const STAMP_BYTES: usize = 9;

/// The frame queue's writing end.
pub struct FramesIn<'a, const BYTES: usize = FRAME_QUEUE_BYTES>(
    pub(super) FramedProducer<&'a Churrasco<BYTES>>,
    pub(super) &'a Level,
);
/// The uplink queue's writing end.
pub type UplinkIn<'a> = FramesIn<'a, UPLINK_QUEUE_BYTES>;

impl<const BYTES: usize> FramesIn<'_, BYTES> {
    /// Queues a frame; `false` when there is no room for it.
    pub fn put(&mut self, at_micros: u64, verified: bool, frame: &[u8]) -> bool {
        let len = STAMP_BYTES + frame.len();
        let Ok(mut grant) = self.0.grant(len as u16) else { return false };
        grant[..8].copy_from_slice(&at_micros.to_le_bytes());
        grant[8] = u8::from(verified);
        grant[STAMP_BYTES..len].copy_from_slice(frame);
        // Before anybody can take it out.
        self.1.rise(len);
        grant.commit(len as u16);
        true
    }

    /// The most bytes that waited at once.
    pub fn bytes_max(&self) -> u32 {
        self.1.max()
    }
}

/// The frame queue's reading end.
pub struct FramesOut<'a, const BYTES: usize = FRAME_QUEUE_BYTES>(
    pub(super) FramedConsumer<&'a Churrasco<BYTES>>,
    pub(super) &'a Level,
);
/// The uplink queue's reading end.
pub type UplinkOut<'a> = FramesOut<'a, UPLINK_QUEUE_BYTES>;

impl<const BYTES: usize> FramesOut<'_, BYTES> {
    /// Hands the oldest frame to `take` (time in microseconds, verified, bytes); `false` when there is none.
    pub fn take(&mut self, take: impl FnOnce(u64, bool, &[u8])) -> bool {
        let Ok(grant) = self.0.read() else { return false };
        if let Some((stamp, frame)) = grant.split_first_chunk::<STAMP_BYTES>() {
            let mut at = [0; 8];
            at.copy_from_slice(&stamp[..8]);
            take(u64::from_le_bytes(at), stamp[8] != 0, frame);
        }
        self.1.fall(grant.len());
        grant.release();
        true
    }
}
