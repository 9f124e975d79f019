//! `STATUSTEXT` messages of several parts (`id` not 0, `chunk_seq`), put together before their meaning is looked up.

use hums_core::cause::Alert;
use hums_core::clock::Instant;
use hums_core::observation::Source;
use hums_core::time::{self, Millis};
use hums_dialect::ids::STATUSTEXT;

use crate::alert;
use crate::frame::{Check, Frame};
use crate::packet::Fields;
use crate::statustext::TEXT_BYTES_MAX;

/// Time after which a text without its last part counts as complete. Autopilots send the parts in one go.
const COMPLETE_AFTER: Millis = Millis::from_secs(1);
/// Bytes of a text that are looked up: two parts. Longer texts of autopilots begin with their subject.
const BYTES_MAX: usize = 2 * TEXT_BYTES_MAX;
/// The autopilot, and a companion computer that talks at the same time.
const SENDERS_MAX: usize = 2;

struct TextChunk<'a> {
    severity: u8,
    /// 0 for a text in one message.
    id: u16,
    /// Its place among the parts, from 0.
    sequence: u8,
    words: &'a [u8],
}

impl<'a> TextChunk<'a> {
    fn of(payload: &'a [u8]) -> Option<Self> {
        const TEXT: usize = 1;
        let fields = Fields(payload);
        let words = payload.get(TEXT..payload.len().min(TEXT + TEXT_BYTES_MAX))?;
        let words = words.split(|byte| *byte == 0).next()?;
        Some(Self { severity: fields.u8(0), id: fields.u16(51), sequence: fields.u8(53), words })
    }

    const fn is_last(&self) -> bool {
        self.id == 0 || self.words.len() < TEXT_BYTES_MAX
    }
}

/// The alert in a text of one message. `None` for a part of a longer text, which [`LongTexts`] takes.
pub(crate) fn alert_of_text(payload: &[u8]) -> Option<Alert> {
    let part = TextChunk::of(payload)?;
    let is_whole = part.is_last() && part.sequence == 0 && !part.words.is_empty();
    if is_whole { alert::of_text(Some(part.severity), part.words) } else { None }
}

/// A text that lacks its last part.
#[derive(Clone, Debug)]
struct Open {
    at: time::BootMs,
    source: Source,
    id: u16,
    severity: u8,
    words: heapless::Vec<u8, BYTES_MAX>,
}

/// Puts long texts together: one of each sender, of at most two senders at a time. A part of another text of its
/// sender, or of one sender more, completes the text before.
#[derive(Clone, Debug, Default)]
pub struct LongTexts([Option<Open>; SENDERS_MAX]);

impl LongTexts {
    /// No text.
    pub const fn new() -> Self {
        Self([const { None }; SENDERS_MAX])
    }

    /// Gives the alerts of complete texts.
    pub fn frame(&mut self, at: Instant, frame: &Frame<'_>, give: &mut impl FnMut(Source, Alert)) {
        let at = time::BootMs::from(at);
        for open in &mut self.0 {
            complete(open, give, |open| at.since(open.at) > COMPLETE_AFTER);
        }
        if frame.id() != STATUSTEXT || frame.check() != Check::Verified {
            return;
        }
        let Some(part) = TextChunk::of(frame.payload()).filter(|part| part.id != 0) else { return };
        if part.is_last() && part.sequence == 0 {
            return; // `alert_of_text` has it.
        }
        let source = frame.source();
        let of_sender = |open: &Option<Open>| open.as_ref().is_some_and(|open| open.source == source);
        let places = || self.0.iter();
        let place = places().position(of_sender).or_else(|| places().position(Option::is_none));
        let Some(open) = self.0.get_mut(place.unwrap_or(0)) else { return };
        complete(open, give, |open| open.source != source || open.id != part.id);
        let words = heapless::Vec::new();
        let open_text = open.get_or_insert(Open { at, source, id: part.id, severity: part.severity, words });
        let room = BYTES_MAX - open_text.words.len();
        let _ = open_text.words.extend_from_slice(part.words.get(..room).unwrap_or(part.words));
        complete(open, give, |_| part.is_last());
    }
}

fn complete(
    open: &mut Option<Open>,
    give: &mut impl FnMut(Source, Alert),
    is_complete: impl Fn(&Open) -> bool,
) {
    if let Some(text) = open.take_if(|open| is_complete(open))
        && let Some(alert) = alert::of_text(Some(text.severity), &text.words)
    {
        give(text.source, alert);
    }
}

#[cfg(test)]
mod tests {
    use hums_core::cause::{Cause, Urgency};

    use super::*;
    use crate::encode::{Encoder, FRAME_BYTES_MAX};
    use crate::packet::Packet;

    fn causes(parts: &[(u64, u8, u16, u8, &str)]) -> Vec<Cause> {
        let (mut long, mut causes) = (LongTexts::new(), Vec::new());
        for (ms, system, id, sequence, words) in parts {
            let packet = Packet::new(STATUSTEXT).u8(0, 2).text(1, TEXT_BYTES_MAX, words);
            let packet = packet.u16(51, *id).u8(53, *sequence);
            let (mut encoder, mut buffer) = (Encoder::of(*system, 1), [0; FRAME_BYTES_MAX]);
            let frame = Frame::parse(encoder.frame(&mut buffer, &packet)).unwrap();
            let mut give = |_: Source, alert: Alert| {
                assert!(matches!(alert.urgency, Urgency::Warning | Urgency::Critical));
                causes.push(alert.cause);
            };
            long.frame(Instant::from_millis(*ms), &frame, &mut give);
            if let Some(alert) = alert_of_text(frame.payload()) {
                give(frame.source(), alert);
            }
        }
        causes
    }

    #[test]
    fn a_long_text_is_one_alert_of_its_whole_words() {
        let first = "The filter of the second sensor set has an EKF vari"; // 51 bytes: one is over
        let first = &first[1..];
        assert_eq!(first.len(), TEXT_BYTES_MAX);
        for (name, parts, expected) in [
            ("two parts", vec![(0, 1, 7, 0, first), (5, 1, 7, 1, "ance")], vec![Cause::Estimator]),
            ("one message", vec![(0, 1, 0, 0, "EKF variance")], vec![Cause::Estimator]),
            ("one part with an id", vec![(0, 1, 7, 0, "EKF variance")], vec![Cause::Estimator]),
            (
                "last part lost",
                vec![(0, 1, 7, 0, first), (2_000, 1, 0, 0, "Crash: Disarming")],
                vec![Cause::Other, Cause::Crash],
            ),
            ("first part lost", vec![(0, 1, 7, 1, "ance variance")], vec![Cause::Other]),
            (
                "two senders at a time",
                vec![(0, 1, 7, 0, first), (1, 2, 7, 0, first), (2, 1, 7, 1, "ance"), (3, 2, 7, 1, "ance")],
                vec![Cause::Estimator, Cause::Estimator],
            ),
            (
                "a third sender",
                vec![
                    (0, 1, 7, 0, first),
                    (1, 2, 7, 0, first),
                    (2, 3, 7, 0, first),
                    (3, 2, 7, 1, "ance"),
                    (5_000, 1, 0, 0, "EKF variance"),
                ],
                vec![Cause::Other, Cause::Estimator, Cause::Other, Cause::Estimator],
            ),
            (
                "too long",
                vec![(0, 1, 7, 0, first); 9].into_iter().chain([(9, 1, 7, 9, "")]).collect(),
                vec![Cause::Other],
            ),
        ] {
            assert_eq!(causes(&parts), expected, "{name}");
        }
    }
}
