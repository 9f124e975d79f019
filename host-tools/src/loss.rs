//! What of the losses that a log records counts as lost.

use hums_blackbox::record::{Loss, Lost};

/// How much a loss record says the recorder lost. Noise on the line is not the recorder's loss: it was no frame.
pub fn lost(loss: &Loss) -> u64 {
    match loss.what {
        Lost::NotFrames | Lost::DamagedFrames => 0,
        Lost::UartOverrun
        | Lost::QueueFull
        | Lost::Card
        | Lost::Records
        | Lost::WrongChecksums
        | Lost::DamagedPlaces
        | Lost::Other => loss.count,
    }
}

#[cfg(test)]
mod tests {
    use hums_core::time::Instant;

    use super::*;

    #[test]
    fn noise_is_nothing_that_the_recorder_lost() {
        let of = |what| lost(&Loss { what, count: 7, from: Instant::ZERO, to: Instant::ZERO });
        assert_eq!([of(Lost::NotFrames), of(Lost::DamagedFrames)], [0, 0]);
        assert_eq!([of(Lost::QueueFull), of(Lost::Card), of(Lost::Other)], [7, 7, 7]);
    }
}
