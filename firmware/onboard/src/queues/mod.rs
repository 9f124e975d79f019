//! All queues: one writer and one reader each, without waiting; a full queue is a counted loss.
//!
//! | queue | from | to | capacity | when it is full |
//! |---|---|---|---|---|
//! | frames | reception | monitor | [`FRAME_QUEUE_BYTES`] | the frame is lost, counted in [`crate::PortStatus`] |
//! | sectors | monitor | storage | [`SECTOR_QUEUE_SECTORS`] | frames are refused before they are encoded, and counted; [`SECTOR_RESERVE`] stays for records |
//! | GS | monitor | downlink | [`GS_QUEUE_BYTES`] | the frame is lost, counted; the summary stream repeats what matters |
//! | uplink | uplink, USB | monitor | [`UPLINK_QUEUE_BYTES`] | the frame is lost; whoever asks at a port for ground stations must ask again |
//! | USB | monitor | USB | [`USB_QUEUE_BYTES`] | answers wait; a frame of the summary stream is lost, counted |
//! | autopilot | monitor | requests | [`AUTOPILOT_QUEUE_BYTES`] | the frame is lost, counted; requests are repeated |

mod capacities;
mod frames;
mod level;
mod ports;
pub(crate) mod ring;
mod sectors;

use bbqueue::nicknames::Churrasco;
pub use hums_link::encode::FRAME_BYTES_MAX;

use crate::shelf::{Server, Shelf};
pub use capacities::{
    AUTOPILOT_QUEUE_BYTES, FRAME_QUEUE_BYTES, GS_QUEUE_BYTES, SECTOR_QUEUE_BYTES, SECTOR_QUEUE_SECTORS,
    SECTOR_RESERVE, UPLINK_QUEUE_BYTES, USB_QUEUE_BYTES,
};
pub use frames::{FramesIn, FramesOut, UplinkIn, UplinkOut};
use level::{Fill, Level};
pub use ports::{AutopilotOut, GsIn, GsOut, PortIn, PortOut, SummaryRoute, UsbOut};
use sectors::SectorQueue;
pub use sectors::{SectorsIn, SectorsOut};

const _: () = assert!(size_of::<SectorQueue>() <= 81 * 1024);

type FrameQueue = Churrasco<FRAME_QUEUE_BYTES>;
type GsQueue = Churrasco<GS_QUEUE_BYTES>;
type UplinkQueue = Churrasco<UPLINK_QUEUE_BYTES>;
type AutopilotQueue = Churrasco<AUTOPILOT_QUEUE_BYTES>;
type UsbQueue = Churrasco<USB_QUEUE_BYTES>;

/// The firmware's queues.
pub struct Queues {
    frames: FrameQueue,
    gs: GsQueue,
    uplink: UplinkQueue,
    autopilot: AutopilotQueue,
    usb: UsbQueue,
    sectors: SectorQueue,
    shelf: Shelf,
    levels: [Level; 5],
}

/// Queue ends of the monitor.
pub struct MonitorEnds<'a> {
    /// To storage.
    pub sectors: SectorsIn<'a>,
    /// To the ports.
    pub gs: GsIn<'a>,
}

/// All other ends, by task.
pub struct Ends<'a> {
    /// For reception.
    pub frames_in: FramesIn<'a>,
    /// For the monitor.
    pub frames_out: FramesOut<'a>,
    /// For storage.
    pub sectors_out: SectorsOut<'a>,
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
    /// For the USB port.
    pub usb_out: UsbOut<'a>,
}

impl Queues {
    /// Empty queues.
    pub const fn new() -> Self {
        Self {
            frames: Churrasco::new(),
            gs: Churrasco::new(),
            uplink: Churrasco::new(),
            autopilot: Churrasco::new(),
            usb: Churrasco::new(),
            sectors: sectors::sector_queue(),
            shelf: Shelf::new(),
            levels: [const { Level::new(Fill::EMPTY) }; 5],
        }
    }

    /// Hands out the ends, once.
    pub fn split(&mut self) -> (MonitorEnds<'_>, Ends<'_>) {
        let (sectors, sectors_out) = sectors::split(&mut self.sectors, SECTOR_RESERVE);
        let (reader, shelf) = self.shelf.split();
        let [frames, gs, uplink, autopilot, usb] = &self.levels;
        let gs_in = GsIn {
            gs: PortIn::new(self.gs.framed_producer(), gs),
            autopilot: PortIn::new(self.autopilot.framed_producer(), autopilot),
            usb: PortIn::new(self.usb.framed_producer(), usb),
            shelf: reader,
            route: SummaryRoute::Port,
        };
        let others = Ends {
            frames_in: FramesIn(self.frames.framed_producer(), frames),
            frames_out: FramesOut(self.frames.framed_consumer(), frames),
            sectors_out,
            shelf,
            gs_out: PortOut(self.gs.framed_consumer(), gs),
            uplink_in: FramesIn(self.uplink.framed_producer(), uplink),
            uplink_out: FramesOut(self.uplink.framed_consumer(), uplink),
            autopilot_out: PortOut(self.autopilot.framed_consumer(), autopilot),
            usb_out: PortOut(self.usb.framed_consumer(), usb),
        };
        (MonitorEnds { sectors, gs: gs_in }, others)
    }
}

#[cfg(test)]
mod tests {
    use super::frames::STAMP_BYTES;
    use hums_blackbox::{ENTRY_SECTORS_MAX, Sector, SectorSink as _};
    use hums_link::encode::Encoder;
    use hums_link::frame::Frame;
    use hums_link::packet::Packet;
    use hums_link::request::Port;
    use hums_recorder::recorder::ROW_BLOCKS;

    use super::*;

    fn put<const BYTES: usize>(frames: &FramesIn, at_micros: u64, mut bytes: [u8; BYTES]) -> bool {
        bytes[..6].copy_from_slice(&[0xFE, BYTES as u8 - 8, 0, 1, 1, 255]);
        frames.put(at_micros, &Frame::parse(&bytes).expect("a frame"))
    }

    fn block_on<T>(future: impl Future<Output = T>) -> T {
        let mut context = core::task::Context::from_waker(core::task::Waker::noop());
        match core::pin::pin!(future).poll(&mut context) {
            core::task::Poll::Ready(value) => value,
            core::task::Poll::Pending => panic!("it waits"),
        }
    }

    #[test]
    fn a_frame_comes_out_with_the_message_that_it_was_found_to_be() {
        let mut queues = Box::new(Queues::new());
        let (_, mut ends) = queues.split();
        let mut out = [0; FRAME_BYTES_MAX];
        for id in [0, 30, 253] {
            let bytes = Encoder::of(1, 1).frame(&mut out, &Packet::new(id)).to_vec();
            let put = Frame::parse(&bytes).expect("a frame");
            assert!(ends.frames_in.put(5, &put) && put.message().is_some());
            let mut is_same = false;
            ends.frames_out.take(|_, message, bytes| {
                is_same = Frame::from_queue(bytes, message) == Some(put);
            });
            assert!(is_same, "message {id}");
        }
    }

    #[test]
    fn a_full_frame_queue_refuses_and_keeps_what_it_has() {
        let mut queues = Box::new(Queues::new());
        let (_, mut ends) = queues.split();
        let mut taken = 0;
        while put(&ends.frames_in, taken, [taken as u8; 100]) {
            taken += 1;
        }
        assert!(taken as usize >= FRAME_QUEUE_BYTES / 120, "{taken} frames of 100 bytes");
        for expected in 0..taken {
            let mut seen = false;
            ends.frames_out.take(|at, message, frame| {
                seen = (at, message, &frame[6..98]) == (expected, None, &[expected as u8; 92][..]);
            });
            assert!(seen, "frame {expected}");
        }
        assert!(!ends.frames_out.take(|_, _, _| panic!("the queue should be empty")));
    }

    #[test]
    fn how_full_a_queue_was_is_remembered_when_it_is_empty_again() {
        let mut queues = Box::new(Queues::new());
        let (mut monitor, mut ends) = queues.split();
        let mut out = [0; FRAME_BYTES_MAX];
        for frames in [3, 1] {
            for _ in 0..frames {
                put(&ends.frames_in, 0, [1; 50]);
                monitor.gs.send(Port::Gs, &[7; 100]);
            }
            while ends.frames_out.take(|_, _, _| {}) && ends.gs_out.take(&mut out).is_some() {}
            assert_eq!(ends.frames_in.bytes_max(), 3 * (2 + 50 + STAMP_BYTES as u32));
            assert_eq!(monitor.gs.bytes_max(), 3 * 102);
        }
    }

    #[test]
    fn the_reserve_is_kept_for_records() {
        let mut queues = Box::new(Queues::new());
        let (mut monitor, _) = queues.split();
        let sector = Sector::zeroed();
        while monitor.sectors.room() > 0 {
            monitor.sectors.put(&sector);
        }
        assert_eq!(monitor.sectors.len(), SECTOR_QUEUE_SECTORS - SECTOR_RESERVE);
        assert_eq!(monitor.sectors.with_reserve(|sink| sink.room()), SECTOR_RESERVE);
        assert_eq!(monitor.sectors.room(), 0);
    }

    #[test]
    fn while_the_card_takes_a_row_there_is_room_for_a_stall_of_2_5_s() {
        let sectors = capacities::STALL_SECTORS;
        let mut queues = Box::new(Queues::new());
        let (MonitorEnds { sectors: mut sectors_in, .. }, Ends { mut sectors_out, .. }) = queues.split();
        let sector = Sector::zeroed();
        for _ in 0..ROW_BLOCKS {
            sectors_in.put(&sector);
        }
        let written = sectors_out.lend(|row| {
            assert_eq!(row.len(), ROW_BLOCKS);
            for index in 0..sectors {
                assert!(sectors_in.room() >= ENTRY_SECTORS_MAX, "sector {index} of {sectors}");
                sectors_in.put(&sector);
            }
            Ok::<_, ()>(row.len())
        });
        assert_eq!((written, sectors_out.len()), (Ok(ROW_BLOCKS), sectors));
    }

    #[test]
    fn the_outlets_frames_fit_behind_a_frame_that_is_being_sent() {
        let waiting = (hums_link::summary::WAITING_BYTES + hums_link::outlet::FINDINGS) as usize;
        let frame = [7; 92];
        for shift in 0..GS_QUEUE_BYTES {
            let mut queues = Box::new(Queues::new());
            let (MonitorEnds { gs: mut gs_in, .. }, Ends { mut gs_out, .. }) = queues.split();
            let mut out = [0; FRAME_BYTES_MAX];
            for len in [shift / 8, shift % 8].into_iter().filter(|len| *len > 0) {
                for _ in 0..if len == shift / 8 { 8 } else { 1 } {
                    gs_in.send(Port::Gs, &vec![0; len][..]);
                    gs_out.take(&mut out);
                }
            }
            gs_in.send(Port::Gs, &[7; FRAME_BYTES_MAX]);
            let sent = gs_out.lend(async |_| {
                for _ in 0..waiting / (frame.len() + 2) {
                    gs_in.send(Port::Gs, &frame);
                }
                true
            });
            assert_eq!(block_on(sent), Some(true));
            assert_eq!(gs_in.lost(), 0, "from byte {shift} on");
        }
    }

    #[test]
    fn a_usb_port_takes_frames_while_it_is_open_and_counts_those_that_its_end_drops() {
        let mut queues = Box::new(Queues::new());
        let (MonitorEnds { gs: mut gs_in, .. }, Ends { mut usb_out, .. }) = queues.split();
        let mut out = [0; FRAME_BYTES_MAX];
        assert!(gs_in.is_open(Port::Gs) && !gs_in.is_open(Port::Usb) && !gs_in.has_room(Port::Usb, 0));
        for _ in 0..200 {
            usb_out.open();
            let mut frames = 0;
            while gs_in.has_room(Port::Usb, FRAME_BYTES_MAX - 13) {
                gs_in.send(Port::Usb, &[7; FRAME_BYTES_MAX - 13]);
                frames += 1;
            }
            assert_eq!((frames, gs_in.lost()), (3, 0), "from any place in the queue");
            while usb_out.take(&mut out).is_some() {}
        }
        for _ in 0..4 {
            gs_in.send(Port::Usb, &[7; 60]);
        }
        let mut lend = |is_sent| block_on(usb_out.lend(async |_| is_sent));
        assert_eq!((lend(true), lend(false)), (Some(true), Some(false)));
        usb_out.close();
        assert!(gs_in.lost() == 3 && !gs_in.has_room(Port::Usb, 0) && usb_out.take(&mut out).is_none());
    }

    #[test]
    fn a_full_gs_queue_counts_what_it_refuses() {
        let mut queues = Box::new(Queues::new());
        let (mut monitor, mut ends) = queues.split();
        for _ in 0..100 {
            monitor.gs.send(Port::Gs, &[7; 100]);
        }
        assert_eq!(monitor.gs.frames() + monitor.gs.lost(), 100);
        assert!(monitor.gs.lost() > 0);
        let mut out = [0; FRAME_BYTES_MAX];
        assert_eq!(ends.gs_out.take(&mut out), Some(100));
    }
}
