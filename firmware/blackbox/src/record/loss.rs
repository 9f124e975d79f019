//! Records of losses and of the recorder's counters.

use hums_core::clock::Instant;

use super::stored::{Field, Fields, Sink, numbered, record};

numbered! {
    /// The kind of a loss. The numbers are stored.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    LossKind {
        /// Bytes lost because the receive buffer overflowed.
        #[default]
        UartOverrun = 0 "uart_overrun",
        /// Bytes outside frames.
        NotFrames = 1 "bytes_not_frames",
        /// Frames that were cut or damaged.
        DamagedFrames = 2 "damaged_frames",
        /// Frames for which the queue had no room.
        QueueFull = 3 "queue_full",
        /// Sectors that could not be written.
        Card = 4 "card",
        /// Records for which there was no room.
        Records = 5 "records",
        /// Frames of a recording that was packed whose checksum did not fit.
        WrongChecksums = 6 "wrong_checksums",
        /// Damaged places of a recording that was packed.
        DamagedPlaces = 7 "damaged_places",
        /// A cause that this reader does not know.
        Other = 255 "other",
    } else Other
}

record! {
    /// Something was lost.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    Loss {
        /// Kind and cause.
        what: LossKind,
        /// The first one.
        from: Instant,
        /// The last one.
        to: Instant,
        /// Bytes, frames, sectors or records.
        count: u64,
    }
}

/// The numbers that the first version had: always stored. Later ones are stored if they are not zero.
const STATS_MIN: usize = 12;

/// A struct with its numbers in stored order; a further one goes to the end.
macro_rules! statistics {
    ($($(#[$doc:meta])+ $name:ident,)+) => {
        /// The recorder's statistics since power-on.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct Stats {
            $($(#[$doc])+ pub $name: u64,)+
        }

        impl Stats {
            /// Each number with its name, in stored order.
            pub fn named(&self) -> impl Iterator<Item = (&'static str, u64)> {
                [$((stringify!($name), self.$name)),+].into_iter()
            }
        }

        impl<'a> Field<'a> for Stats {
            fn numbers(&self, sink: &mut Sink<'_>) {
                let numbers = [$(self.$name),+];
                // Missing bytes read as zeros.
                let stored = numbers.iter().rposition(|&number| number != 0).map_or(0, |last| last + 1);
                for &number in numbers.iter().take(stored.max(STATS_MIN)) {
                    sink.u64(number);
                }
            }

            fn read(fields: &mut Fields<'a>) -> Option<Self> {
                Some(Self { $($name: fields.u64(),)+ })
            }
        }
    };
}

statistics! {
    /// Frames received.
    frames_in,
    /// Frames encoded.
    frames_logged,
    /// Frames lost.
    frames_lost,
    /// Bytes received.
    bytes_in,
    /// Bytes that were no frame.
    bytes_not_frames,
    /// Bytes of the sectors made.
    bytes_logged,
    /// Blocks written to the card, file system included.
    blocks_written,
    /// The fullest the sector queue was, bytes.
    queue_bytes_max,
    /// Capacity of the sector queue, bytes.
    queue_bytes_capacity,
    /// The longest the card took for one call, milliseconds.
    sd_stall_ms_max,
    /// Frames sent to the ground station.
    gs_frames,
    /// Bytes sent to the ground station.
    gs_bytes,
    /// The fullest the frame queue was, bytes.
    frame_queue_bytes_max,
    /// Capacity of the frame queue, bytes.
    frame_queue_bytes_capacity,
    /// The fullest the queue to the ground station was, bytes.
    gs_queue_bytes_max,
    /// Capacity of the queue to the ground station, bytes.
    gs_queue_bytes_capacity,
    /// Processor load of the last second, thousandths; 0 if not measured.
    cpu_permille,
    /// The same in the worst second.
    cpu_permille_max,
    /// The deepest the stack was, bytes.
    stack_bytes_max,
    /// Size of the stack, bytes.
    stack_bytes_capacity,
    /// Frames for the ground station that found their queue full.
    gs_frames_lost,
    /// Frames for the autopilot that found their queue full.
    autopilot_frames_lost,
    /// Frames of others that were to be passed on and found no room within the port's budget.
    passed_frames_lost,
    /// Requests refused for their signature.
    requests_refused,
}
