//! Recorded losses as counts and texts.

use hums_blackbox::record::{Loss, LossKind};
use hums_blackbox::{Cause, Gap};

use crate::plural::count;
use crate::utc::moment;

/// Noise was no frame, so it is no loss.
pub fn lost(loss: &Loss) -> u64 {
    match loss.what {
        LossKind::NotFrames | LossKind::DamagedFrames => 0,
        LossKind::UartOverrun
        | LossKind::QueueFull
        | LossKind::Card
        | LossKind::Records
        | LossKind::WrongChecksums
        | LossKind::DamagedPlaces
        | LossKind::Other => loss.count,
    }
}

/// The queue lasts for 2.5 s without the card.
const CARD_LATE: &str = "the card took nothing for too long";

/// The end of a sentence; `None` unless it concerns the recorder.
pub fn words(loss: &Loss) -> Option<String> {
    let (one, why) = match loss.what {
        LossKind::NotFrames
        | LossKind::DamagedFrames
        | LossKind::WrongChecksums
        | LossKind::DamagedPlaces => return None,
        LossKind::UartOverrun => ("byte", "came faster than the recorder took them"),
        LossKind::QueueFull => ("frame", CARD_LATE),
        LossKind::Card => ("sector", "could not be written to the card"),
        LossKind::Records => ("record", CARD_LATE),
        LossKind::Other => ("unit", "for a reason that this program does not know"),
    };
    let was = if loss.count == 1 { "was" } else { "were" };
    Some(format!("{} {was} not recorded: {why}", count(loss.count, one)))
}

/// None before the first sector of a log with an unknown beginning.
pub fn sectors_lost(gap: &Gap) -> Option<u32> {
    let is_known =
        gap.from.is_some() || gap.sectors_lost > 0 || gap.sectors_skipped > 0 || gap.frames.is_some();
    is_known.then_some(gap.sectors_lost)
}

/// The likeliest reason.
pub const fn why(gap: &Gap) -> &'static str {
    match (gap.cause, gap.from, gap.to) {
        (Cause::Missing, None, _) => "the first sectors are not there: newer logs took their place",
        (Cause::Missing, _, None) => "the last sectors are not there: they were never written",
        (Cause::Missing, Some(_), Some(_)) => "the card has lost sectors",
        (Cause::Damaged, ..) => "sectors are damaged",
        (Cause::UnknownLayouts(_), ..) => {
            "written with message layouts that this program does not know; take a newer hums"
        }
        (Cause::Corrupt, ..) => "sectors hold what no recorder writes",
        (Cause::Altered, ..) => "the recorder's memory had changed: what it wrote is not what came",
        (Cause::Disarmed, ..) => "not recorded: disarmed",
    }
}

/// The content of a loss record, with its time.
pub fn told(loss: &Loss) -> String {
    let words = words(loss).unwrap_or_else(|| match loss.what {
        LossKind::NotFrames => format!("{} of no frame came over the line", count(loss.count, "byte")),
        LossKind::DamagedFrames => format!("{} came over the line", count(loss.count, "damaged frame")),
        LossKind::WrongChecksums => format!("{} with a wrong checksum came", count(loss.count, "frame")),
        _ => format!("{} of what was packed", count(loss.count, "damaged place")),
    });
    format!("{words}, between {} and {}", moment(loss.from), moment(loss.to))
}

#[cfg(test)]
mod tests {
    use hums_core::clock::Instant;

    use super::*;

    #[test]
    fn noise_is_nothing_that_the_recorder_lost() {
        let of = |what| lost(&Loss { what, count: 7, from: Instant::ZERO, to: Instant::ZERO });
        assert_eq!([of(LossKind::NotFrames), of(LossKind::DamagedFrames)], [0, 0]);
        assert_eq!([of(LossKind::QueueFull), of(LossKind::Card), of(LossKind::Other)], [7, 7, 7]);
    }

    #[test]
    fn what_a_log_does_not_have_is_told_with_its_likeliest_reason() {
        let at = |ms: Option<u64>| ms.map(Instant::from_millis);
        let why = |from, to| {
            let (sectors_lost, sectors_skipped, frames) = (9, 0, None);
            why(&Gap {
                from: at(from),
                to: at(to),
                cause: Cause::Missing,
                sectors_lost,
                sectors_skipped,
                frames,
            })
        };
        assert!(why(None, Some(9)).ends_with("newer logs took their place"));
        assert!(why(Some(9), None).ends_with("they were never written"));
        assert_eq!(why(Some(1), Some(9)), "the card has lost sectors");
    }

    #[test]
    fn what_was_not_recorded_is_said_with_its_reason() {
        let of = |what, count| words(&Loss { what, count, from: Instant::ZERO, to: Instant::ZERO });
        assert_eq!(
            of(LossKind::QueueFull, 3_591).as_deref(),
            Some("3591 frames were not recorded: the card took nothing for too long")
        );
        assert_eq!(of(LossKind::NotFrames, 7), None);
    }
}
