//! What of the losses that a log records counts as lost.

use hums_blackbox::record::{Loss, Lost};

use crate::plural::count;

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

/// What a loss record says was not recorded, as the end of a sentence; `None` where it says nothing of the recorder.
pub fn words(loss: &Loss) -> Option<String> {
    let (one, why) = match loss.what {
        Lost::NotFrames | Lost::DamagedFrames | Lost::WrongChecksums | Lost::DamagedPlaces => return None,
        Lost::UartOverrun => ("byte", "came faster than the recorder took them"),
        Lost::QueueFull => ("frame", "found the recorder's queue full"),
        Lost::Card => ("sector", "could not be written to the card"),
        Lost::Records => ("record", "found the recorder's queue full"),
        Lost::Other => ("unit", "for a reason that this program does not know"),
    };
    let was = if loss.count == 1 { "was" } else { "were" };
    Some(format!("{} {was} not recorded: {why}", count(loss.count, one)))
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

    #[test]
    fn what_was_not_recorded_is_said_with_its_reason() {
        let of = |what, count| words(&Loss { what, count, from: Instant::ZERO, to: Instant::ZERO });
        assert_eq!(
            of(Lost::QueueFull, 3_591).as_deref(),
            Some("3591 frames were not recorded: found the recorder's queue full")
        );
        assert_eq!(of(Lost::NotFrames, 7), None);
    }
}
