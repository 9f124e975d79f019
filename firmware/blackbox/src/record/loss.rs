//! Records of losses and of the recorder's counters.

use hums_core::clock::Instant;

use super::stored::{Fields, Sink};

/// The kind of a loss. The numbers are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum LossKind {
    /// Bytes lost because the receive buffer overflowed.
    #[default]
    UartOverrun = 0,
    /// Bytes outside frames.
    NotFrames = 1,
    /// Frames that were cut or damaged.
    DamagedFrames = 2,
    /// Frames for which the queue had no room.
    QueueFull = 3,
    /// Sectors that could not be written.
    Card = 4,
    /// Records for which there was no room.
    Records = 5,
    /// Frames of a recording that was packed whose checksum did not fit.
    WrongChecksums = 6,
    /// Damaged places of a recording that was packed.
    DamagedPlaces = 7,
    /// A cause that this reader does not know.
    Other = 255,
}

impl LossKind {
    /// The name that reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::UartOverrun => "uart_overrun",
            Self::NotFrames => "bytes_not_frames",
            Self::DamagedFrames => "damaged_frames",
            Self::QueueFull => "queue_full",
            Self::Card => "card",
            Self::Records => "records",
            Self::WrongChecksums => "wrong_checksums",
            Self::DamagedPlaces => "damaged_places",
            Self::Other => "other",
        }
    }

    const fn from_number(number: u8) -> Self {
        match number {
            0 => Self::UartOverrun,
            1 => Self::NotFrames,
            2 => Self::DamagedFrames,
            3 => Self::QueueFull,
            4 => Self::Card,
            5 => Self::Records,
            6 => Self::WrongChecksums,
            7 => Self::DamagedPlaces,
            _ => Self::Other,
        }
    }
}

/// Something was lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Loss {
    /// Kind and cause.
    pub what: LossKind,
    /// Bytes, frames, sectors or records.
    pub count: u64,
    /// The first one.
    pub from: Instant,
    /// The last one.
    pub to: Instant,
}

impl Loss {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(7).time(self.from).time(self.to).u64(self.count).u8(self.what as u8);
    }

    pub(super) fn read(fields: &mut Fields<'_>) -> Self {
        Self {
            what: LossKind::from_number(fields.u8()),
            from: fields.instant(),
            to: fields.instant(),
            count: fields.u64(),
        }
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
            pub(super) fn store(&self, sink: &mut Sink<'_>) {
                let numbers = [$(self.$name),+];
                sink.head(8);
                // Missing bytes read as zeros.
                let stored = numbers.iter().rposition(|&number| number != 0).map_or(0, |last| last + 1);
                for &number in numbers.iter().take(stored.max(STATS_MIN)) {
                    sink.u64(number);
                }
            }

            pub(super) fn read(fields: &mut Fields<'_>) -> Self {
                Self { $($name: fields.u64(),)+ }
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
