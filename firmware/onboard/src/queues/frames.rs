//! Queues of frames, each with its stamp and its message.

use bbqueue::nicknames::Churrasco;
use bbqueue::prod_cons::framed::{FramedConsumer, FramedProducer};

use hums_link::frame::Frame;

use super::capacities::{FRAME_QUEUE_BYTES, UPLINK_QUEUE_BYTES};
use super::level::Level;

/// Bytes before a frame in its queue: its stamp (u64: the arrival time in microseconds, or the uplink's port) and its message (u16 as [`Frame::message`],
/// [`UNKNOWN`] for none).
pub(super) const STAMP_BYTES: usize = 10;
const UNKNOWN: u16 = u16::MAX;

/// Writing end.
pub struct FramesIn<'a, const BYTES: usize = FRAME_QUEUE_BYTES>(
    pub(super) FramedProducer<&'a Churrasco<BYTES>>,
    pub(super) &'a Level,
);
/// Writing end.
pub type UplinkIn<'a> = FramesIn<'a, UPLINK_QUEUE_BYTES>;

impl<const BYTES: usize> FramesIn<'_, BYTES> {
    /// `false` without room. Tasks of one urgency may share the end: none interrupts another one here.
    pub fn put(&self, stamp: u64, frame: &Frame<'_>) -> bool {
        let bytes = frame.bytes();
        let len = STAMP_BYTES + bytes.len();
        let Ok(mut grant) = self.0.grant(len as u16) else { return false };
        grant[..8].copy_from_slice(&stamp.to_le_bytes());
        grant[8..STAMP_BYTES].copy_from_slice(&frame.message().unwrap_or(UNKNOWN).to_le_bytes());
        grant[STAMP_BYTES..len].copy_from_slice(bytes);
        // Before the reader can take it out.
        self.1.change(|fill| fill.rise(len));
        grant.commit(len as u16);
        true
    }

    /// The most bytes that waited at once.
    pub fn bytes_max(&self) -> u32 {
        self.1.read().bytes_max as u32
    }
}

/// Reading end.
pub struct FramesOut<'a, const BYTES: usize = FRAME_QUEUE_BYTES>(
    pub(super) FramedConsumer<&'a Churrasco<BYTES>>,
    pub(super) &'a Level,
);
/// Reading end.
pub type UplinkOut<'a> = FramesOut<'a, UPLINK_QUEUE_BYTES>;

impl<const BYTES: usize> FramesOut<'_, BYTES> {
    /// Stamp, message, bytes; `false` if there is none.
    pub fn take(&mut self, take: impl FnOnce(u64, Option<u16>, &[u8])) -> bool {
        let Ok(grant) = self.0.read() else { return false };
        if let Some((stamp, rest)) = grant.split_first_chunk()
            && let Some((message, frame)) = rest.split_first_chunk()
        {
            let message = Some(u16::from_le_bytes(*message)).filter(|message| *message != UNKNOWN);
            take(u64::from_le_bytes(*stamp), message, frame);
        }
        self.1.change(|fill| fill.fall(grant.len()));
        grant.release();
        true
    }
}
