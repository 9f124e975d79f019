//! All queues: one writer and one reader each, nobody ever waits, a full queue is a counted loss.
//!
//! | queue | from | to | capacity | when it is full |
//! |---|---|---|---|---|
//! | frames | reception | monitor | [`FRAME_QUEUE_BYTES`] | the frame is lost, counted in [`crate::PortStatus`] |
//! | sectors | monitor | storage | [`SECTOR_QUEUE_SECTORS`] | frames are refused before they are encoded, and counted; [`SECTOR_RESERVE`] stays for records |
//! | GS | monitor | downlink | [`GS_QUEUE_BYTES`] | the frame is lost, counted; the summary stream repeats what matters |
//! | uplink | uplink | monitor | [`UPLINK_QUEUE_BYTES`] | the frame is lost, counted; whoever asks the ground station's port must ask again |
//! | autopilot | monitor | requests | [`AUTOPILOT_QUEUE_BYTES`] | the frame is lost, counted; requests are repeated |

use core::sync::atomic::{AtomicU32, Ordering};

use bbqueue::nicknames::Churrasco;
use bbqueue::prod_cons::framed::{FramedConsumer, FramedProducer};
use heapless::spsc;
use hums_blackbox::{ENTRY_SECTORS_MAX, Header, SECTOR_BYTES, Sector, SectorSink};
pub use hums_link::encode::FRAME_BYTES_MAX;
use hums_link::{outlet, summary};

use crate::shelf::{Reader, Server, Shelf};

/// 16 ms of a line at 921,600 baud, stamps included: the monitor's longest step, a tick that records everything there
/// is, takes 4 (`ARCHITECTURE.md` has the figures).
pub const FRAME_QUEUE_BYTES: usize = 2 * 1024;

/// What the port's outlet lets wait, findings and all, and the end of the queue that the longest frame does not fit into.
pub const GS_QUEUE_BYTES: usize = (summary::WAITING_BYTES + outlet::FINDINGS) as usize + FRAME_BYTES_MAX;

/// 0.17 s of a radio at 57,600 baud: the monitor looks at least every 50 ms. Three of the longest frames.
pub const UPLINK_QUEUE_BYTES: usize = 1024;

/// A round of requests to the autopilot (9 commands of 45 bytes, signed 58) and two frames that pass through.
pub const AUTOPILOT_QUEUE_BYTES: usize = 1100;

/// 2.5 s of a standing card at 921,600 baud: 92 kB/s at 3.5 times smaller is 66 KB; storage holds eight sectors more.
pub const SECTOR_QUEUE_SECTORS: usize = 132;

/// Sectors kept free for findings and losses when frames are refused already: two sectors of them, as the last has to
/// leave room for the longest entry there is.
pub const SECTOR_RESERVE: usize = ENTRY_SECTORS_MAX + 1;

/// Bytes of log that the sector queue holds.
pub const SECTOR_QUEUE_BYTES: usize = SECTOR_QUEUE_SECTORS * SECTOR_BYTES;

// The queue keeps one place empty to tell full from empty.
type SectorQueue = spsc::Queue<Sector, { SECTOR_QUEUE_SECTORS + 1 }>;
const _: () = assert!(size_of::<SectorQueue>() <= 72 * 1024);
const _: () = assert!(SECTOR_QUEUE_BYTES >= 66 * 1024);

type FrameQueue = Churrasco<FRAME_QUEUE_BYTES>;
type GsQueue = Churrasco<GS_QUEUE_BYTES>;
type UplinkQueue = Churrasco<UPLINK_QUEUE_BYTES>;
type AutopilotQueue = Churrasco<AUTOPILOT_QUEUE_BYTES>;

/// All queues of the firmware; one static.
pub struct Queues {
    frames: FrameQueue,
    gs: GsQueue,
    uplink: UplinkQueue,
    autopilot: AutopilotQueue,
    sectors: SectorQueue,
    shelf: Shelf,
    levels: [Level; 4],
}

/// The ends of all queues, each for one task.
pub struct Ends<'a> {
    /// For reception.
    pub frames_in: FramesIn<'a>,
    /// For the monitor.
    pub frames_out: FramesOut<'a>,
    /// For the monitor.
    pub sectors_in: SectorsIn<'a>,
    /// For storage.
    pub sectors_out: SectorsOut<'a>,
    /// For the monitor.
    pub gs_in: GsIn<'a>,
    /// For the downlink.
    pub gs_out: GsOut<'a>,
    /// For the uplink.
    pub uplink_in: UplinkIn<'a>,
    /// For the monitor.
    pub uplink_out: UplinkOut<'a>,
    /// For storage.
    pub shelf: Server<'a>,
    /// For the task that sends to the autopilot.
    pub autopilot_out: AutopilotOut<'a>,
}

impl Default for Queues {
    fn default() -> Self {
        Self::new()
    }
}

impl Queues {
    /// Empty queues.
    pub const fn new() -> Self {
        Self {
            frames: Churrasco::new(),
            gs: Churrasco::new(),
            uplink: Churrasco::new(),
            autopilot: Churrasco::new(),
            sectors: spsc::Queue::new(),
            shelf: Shelf::new(),
            levels: [const { Level::new() }; 4],
        }
    }

    /// Hands out the ends, once.
    pub fn split(&mut self) -> Ends<'_> {
        let (sectors_in, sectors_out) = self.sectors.split();
        let (reader, shelf) = self.shelf.split();
        let [frames, gs, uplink, autopilot] = &self.levels;
        Ends {
            frames_in: FramesIn(self.frames.framed_producer(), frames),
            frames_out: FramesOut(self.frames.framed_consumer(), frames),
            sectors_in: SectorsIn { queue: sectors_in, reserve: SECTOR_RESERVE, deepest: 0 },
            sectors_out: SectorsOut(sectors_out),
            gs_in: GsIn {
                gs: PortIn::new(self.gs.framed_producer(), gs),
                autopilot: PortIn::new(self.autopilot.framed_producer(), autopilot),
                shelf: reader,
                path: Path::Port,
            },
            shelf,
            gs_out: PortOut(self.gs.framed_consumer(), gs),
            uplink_in: FramesIn(self.uplink.framed_producer(), uplink),
            uplink_out: FramesOut(self.uplink.framed_consumer(), uplink),
            autopilot_out: PortOut(self.autopilot.framed_consumer(), autopilot),
        }
    }
}

/// How full a queue is, and was at most.
#[derive(Debug, Default)]
struct Level {
    bytes: AtomicU32,
    bytes_max: AtomicU32,
}

impl Level {
    const fn new() -> Self {
        Self { bytes: AtomicU32::new(0), bytes_max: AtomicU32::new(0) }
    }

    fn rise(&self, bytes: usize) {
        let before = self.bytes.fetch_add(bytes as u32, Ordering::Relaxed);
        self.bytes_max.fetch_max(before.wrapping_add(bytes as u32), Ordering::Relaxed);
    }

    fn fall(&self, bytes: usize) {
        self.bytes.fetch_sub(bytes as u32, Ordering::Relaxed);
    }

    fn max(&self) -> u32 {
        self.bytes_max.load(Ordering::Relaxed)
    }
}

/// Bytes before a frame in its queue: when it came (u64 microseconds) and whether its checksum is ours.
const STAMP_BYTES: usize = 9;

/// The frame queue's writing end.
pub struct FramesIn<'a, const BYTES: usize = FRAME_QUEUE_BYTES>(
    FramedProducer<&'a Churrasco<BYTES>>,
    &'a Level,
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
    FramedConsumer<&'a Churrasco<BYTES>>,
    &'a Level,
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

/// The sector queue's writing end: refuses frames while only the reserve is left.
pub struct SectorsIn<'a> {
    queue: spsc::Producer<'a, Sector>,
    reserve: usize,
    deepest: usize,
}

impl SectorsIn<'_> {
    /// Lets what follows use the reserve as well: for records.
    pub(crate) fn with_reserve<R>(&mut self, write: impl FnOnce(&mut Self) -> R) -> R {
        let reserve = core::mem::replace(&mut self.reserve, 0);
        let result = write(self);
        self.reserve = reserve;
        result
    }

    /// Whether storage has caught up.
    pub fn is_empty(&self) -> bool {
        self.queue.len() == 0
    }

    /// Sectors waiting.
    pub fn len(&self) -> usize {
        self.queue.len()
    }

    /// The most sectors that waited at once.
    pub const fn deepest(&self) -> usize {
        self.deepest
    }
}

impl SectorSink for SectorsIn<'_> {
    fn room(&self) -> usize {
        self.queue.capacity().saturating_sub(self.queue.len()).saturating_sub(self.reserve)
    }

    fn put(&mut self, sector: &Sector) {
        // The writer asked for room first; there is no more to be done here if it did not.
        let _ = self.queue.enqueue(*sector);
        self.deepest = self.deepest.max(self.queue.len());
    }
}

/// The sector queue's reading end.
pub struct SectorsOut<'a>(spsc::Consumer<'a, Sector>);

impl SectorsOut<'_> {
    /// The oldest sector, which stays in the queue.
    pub fn oldest(&mut self) -> Option<&Sector> {
        self.0.peek()
    }

    /// Takes the oldest sector out.
    pub(crate) fn drop_oldest(&mut self) {
        let _ = self.0.dequeue();
    }

    /// Empties the queue because there is no card to write to; how many frames are lost with it. Copies of a sector in
    /// progress hold no frames of their own.
    pub fn abandon(&mut self) -> u64 {
        let mut frames = 0;
        while let Some(mut sector) = self.0.dequeue() {
            // Only a sealed sector's header can be read; which session it names does not matter here.
            sector.seal(0);
            if let Ok(header) = Header::read(sector.bytes()) {
                frames += if header.partial { 0 } else { u64::from(header.frames) };
            }
        }
        frames
    }

    /// Sectors waiting.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.0.len() == 0
    }
}

/// The monitor's ends of what is around it: both ports, and the logs on the card.
pub struct GsIn<'a> {
    gs: PortIn<'a, GS_QUEUE_BYTES>,
    /// To the autopilot.
    pub autopilot: PortIn<'a, AUTOPILOT_QUEUE_BYTES>,
    /// To storage and back: the logs on the card.
    pub shelf: Reader<'a>,
    path: Path,
}

/// The way of the summary stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// There is none.
    Nobody,
    /// A radio at the ground station's port.
    Port,
    /// The autopilot carries it.
    Autopilot,
}

impl GsIn<'_> {
    /// Queues a frame for the GS, or counts it lost.
    pub fn put(&mut self, frame: &[u8]) {
        self.gs.put(frame);
    }

    /// Queues a frame of the summary stream, on its way.
    pub fn tell(&mut self, frame: &[u8]) {
        match self.path {
            Path::Nobody => {}
            Path::Port => self.gs.put(frame),
            Path::Autopilot => self.autopilot.put(frame),
        }
    }

    /// The way of the summary stream.
    pub const fn path(&self) -> Path {
        self.path
    }

    /// Another way for the summary stream.
    pub const fn set_path(&mut self, path: Path) {
        self.path = path;
    }

    /// Frames queued since power-on.
    pub const fn frames(&self) -> u64 {
        self.gs.frames
    }

    /// Bytes queued since power-on.
    pub const fn bytes(&self) -> u64 {
        self.gs.bytes
    }

    /// Frames that found the queue full.
    pub const fn lost(&self) -> u64 {
        self.gs.lost
    }

    /// The most bytes that waited for the GS port at once.
    pub fn bytes_max(&self) -> u32 {
        self.gs.level.max()
    }
}

/// The writing end of a port's queue, with what went in.
pub struct PortIn<'a, const BYTES: usize> {
    queue: FramedProducer<&'a Churrasco<BYTES>>,
    level: &'a Level,
    frames: u64,
    bytes: u64,
    lost: u64,
}

impl<'a, const BYTES: usize> PortIn<'a, BYTES> {
    const fn new(queue: FramedProducer<&'a Churrasco<BYTES>>, level: &'a Level) -> Self {
        Self { queue, level, frames: 0, bytes: 0, lost: 0 }
    }

    /// Queues a frame, or counts it lost.
    pub fn put(&mut self, frame: &[u8]) {
        let len = frame.len() as u16;
        let Ok(mut grant) = self.queue.grant(len) else {
            self.lost += 1;
            return;
        };
        grant.copy_from_slice(frame);
        self.level.rise(frame.len());
        grant.commit(len);
        self.frames += 1;
        self.bytes += frame.len() as u64;
    }

    /// Frames queued since power-on.
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// Frames that found the queue full.
    pub const fn lost(&self) -> u64 {
        self.lost
    }
}

/// The reading end of a port's queue.
pub struct PortOut<'a, const BYTES: usize>(FramedConsumer<&'a Churrasco<BYTES>>, &'a Level);
/// The GS queue's reading end.
pub type GsOut<'a> = PortOut<'a, GS_QUEUE_BYTES>;
/// The autopilot queue's reading end.
pub type AutopilotOut<'a> = PortOut<'a, AUTOPILOT_QUEUE_BYTES>;

impl<const BYTES: usize> PortOut<'_, BYTES> {
    /// Copies the oldest frame into `out` and takes it out of the queue; its length, or `None` when there is none.
    pub fn take(&mut self, out: &mut [u8; FRAME_BYTES_MAX]) -> Option<usize> {
        let grant = self.0.read().ok()?;
        let len = grant.len().min(out.len());
        out[..len].copy_from_slice(&grant[..len]);
        self.1.fall(grant.len());
        grant.release();
        Some(len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_frame_queue_refuses_and_keeps_what_it_has() {
        let mut queues = Box::new(Queues::new());
        let mut ends = queues.split();
        let mut taken = 0;
        while ends.frames_in.put(taken, true, &[taken as u8; 100]) {
            taken += 1;
        }
        assert!(taken as usize >= FRAME_QUEUE_BYTES / 120, "{taken} frames of 100 bytes");
        for expected in 0..taken {
            let mut seen = false;
            ends.frames_out.take(|at, verified, frame| {
                seen = (at, verified, frame) == (expected, true, &[expected as u8; 100][..]);
            });
            assert!(seen, "frame {expected}");
        }
        assert!(!ends.frames_out.take(|_, _, _| panic!("the queue should be empty")));
    }

    #[test]
    fn how_full_a_queue_was_is_remembered_when_it_is_empty_again() {
        let mut queues = Box::new(Queues::new());
        let mut ends = queues.split();
        let mut out = [0; FRAME_BYTES_MAX];
        for frames in [3, 1] {
            for _ in 0..frames {
                ends.frames_in.put(0, true, &[1; 50]);
                ends.gs_in.put(&[7; 100]);
            }
            while ends.frames_out.take(|_, _, _| {}) && ends.gs_out.take(&mut out).is_some() {}
            assert_eq!(ends.frames_in.bytes_max(), 3 * (50 + STAMP_BYTES as u32));
            assert_eq!(ends.gs_in.bytes_max(), 300);
        }
    }

    #[test]
    fn the_reserve_is_kept_for_records() {
        let mut queues = Box::new(Queues::new());
        let mut ends = queues.split();
        let sector = Sector::zeroed();
        while ends.sectors_in.room() > 0 {
            ends.sectors_in.put(&sector);
        }
        assert_eq!(ends.sectors_in.len(), SECTOR_QUEUE_SECTORS - SECTOR_RESERVE);
        assert_eq!(ends.sectors_in.with_reserve(|sink| sink.room()), SECTOR_RESERVE);
        assert_eq!(ends.sectors_in.room(), 0);
    }

    #[test]
    fn a_full_gs_queue_counts_what_it_refuses() {
        let mut queues = Box::new(Queues::new());
        let mut ends = queues.split();
        for _ in 0..100 {
            ends.gs_in.put(&[7; 100]);
        }
        assert_eq!(ends.gs_in.frames() + ends.gs_in.lost(), 100);
        assert!(ends.gs_in.lost() > 0);
        let mut out = [0; FRAME_BYTES_MAX];
        assert_eq!(ends.gs_out.take(&mut out), Some(100));
    }
}
