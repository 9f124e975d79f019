//! Capacities of the queues, with their sums.

use hums_blackbox::{ENTRY_SECTORS_MAX, SECTOR_BYTES};
use hums_link::encode::FRAME_BYTES_MAX;
use hums_link::{outlet, summary};
use hums_recorder::recorder::ROW_BLOCKS;

/// 14 ms of a line at 921,600 baud in frames of 40 bytes, with their stamps, and an end too short for the longest frame. The monitor's
/// longest step, a tick that records everything there is, takes 4 ms.
pub const FRAME_QUEUE_BYTES: usize = 2 * 1024;

/// The waiting frames of the port's outlet, with findings; the frame being sent; and an end of the queue too short
/// for the longest frame.
pub const GS_QUEUE_BYTES: usize = (summary::WAITING_BYTES + outlet::FINDINGS) as usize + 2 * FRAME_BYTES_MAX;

/// Three of the longest frames, one of them being sent, and an end of the queue too short for a fourth. A host fetches 64 bytes in
/// less than a millisecond.
pub const USB_QUEUE_BYTES: usize = 4 * FRAME_BYTES_MAX + 16;

/// 0.17 s of a radio at 57,600 baud: the monitor looks at least every 50 ms. Three of the longest frames.
pub const UPLINK_QUEUE_BYTES: usize = 1024;

/// A round of requests to the autopilot (9 commands of 45 bytes, signed 58), two frames that pass through, and the frame being sent.
pub const AUTOPILOT_QUEUE_BYTES: usize = 1100 + FRAME_BYTES_MAX;

/// 2.5 s of a stalled card at 921,600 baud: 92 kB/s, compressed 3.03 times.
pub(super) const STALL_SECTORS: usize = (92_160 * 5 / 2 * 100 / 303_usize).div_ceil(SECTOR_BYTES);

/// A stall, with the reserve, the room that the writer asks for, and the row that the card is taking.
pub const SECTOR_QUEUE_SECTORS: usize = STALL_SECTORS + SECTOR_RESERVE + ENTRY_SECTORS_MAX + ROW_BLOCKS;

/// Sectors for findings and losses when frames are refused already: two of them, as the last must have room for the
/// longest entry.
pub const SECTOR_RESERVE: usize = ENTRY_SECTORS_MAX + 1;

/// Bytes of log that the sector queue holds.
pub const SECTOR_QUEUE_BYTES: usize = SECTOR_QUEUE_SECTORS * SECTOR_BYTES;
