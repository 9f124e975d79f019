//! Frames lost on the way to us, by the senders' sequence numbers.
//!
//! Each component counts its frames modulo 256, so a gap gives the number of missing ones. A gap of half the range or
//! more is a restarted sender or a late frame, and is ignored.

use hums_core::clock::{Instant, Span};
use hums_core::observation::Source;
use hums_core::status::LinkReading;

use crate::frame::Frame;

const SENDERS_MAX: usize = 8;
const WINDOW_SECS: usize = 10;
const FRAMES_MIN: u32 = 20;

#[derive(Clone, Copy, Debug, Default)]
struct Second {
    received: u16,
    lost: u16,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sender {
    source: Source,
    sequence: u8,
    /// The most frames of a window since the last loss: a falling rate does not make a loss a larger part.
    of: u16,
    seconds: [Second; WINDOW_SECS],
    newest_s: u32,
}

impl Sender {
    fn advance(&mut self, now_s: u32) {
        let passed = now_s.saturating_sub(self.newest_s).min(WINDOW_SECS as u32);
        for second in 0..passed {
            self.seconds[(now_s - second) as usize % WINDOW_SECS] = Second::default();
        }
        self.newest_s = self.newest_s.max(now_s);
    }

    fn count(&mut self, now_s: u32, lost: u8) {
        self.advance(now_s);
        if lost > 0 {
            self.of = 0;
        }
        let second = &mut self.seconds[self.newest_s as usize % WINDOW_SECS];
        second.received = second.received.saturating_add(1);
        second.lost = second.lost.saturating_add(u16::from(lost));
    }
}

/// The sequence numbers of all senders on a link.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sequences {
    senders: [Option<Sender>; SENDERS_MAX],
}

impl Sequences {
    /// No sender yet.
    pub const fn new() -> Self {
        Self { senders: [None; SENDERS_MAX] }
    }

    /// Returns the frames lost right before it.
    pub fn frame(&mut self, at: Instant, frame: &Frame<'_>) -> u8 {
        let source = frame.source();
        let now_s = seconds(at);
        let known = |slot: &Option<Sender>| slot.is_none_or(|sender| sender.source == source);
        let Some(slot) = self.senders.iter_mut().find(|slot| known(slot)) else { return 0 };
        let lost = slot.map_or(0, |sender| frame.sequence().wrapping_sub(sender.sequence).wrapping_sub(1));
        let lost = if lost < 128 { lost } else { 0 };
        let sender = slot.get_or_insert(Sender { source, newest_s: now_s, ..Sender::default() });
        sender.sequence = frame.sequence();
        sender.count(now_s, lost);
        lost
    }

    /// The lost part of one sender's frames in the last ten seconds.
    pub fn reading(&mut self, now: Instant, source: Option<Source>) -> LinkReading {
        let now_s = seconds(now);
        let sender = self.senders.iter_mut().flatten().find(|sender| Some(sender.source) == source);
        let frames_lost = sender.and_then(|sender| {
            sender.advance(now_s);
            let received: u32 = sender.seconds.iter().map(|second| u32::from(second.received)).sum();
            let lost: u32 = sender.seconds.iter().map(|second| u32::from(second.lost)).sum();
            sender.of = sender.of.max(u16::try_from(received + lost).unwrap_or(u16::MAX));
            (received + lost >= FRAMES_MIN).then(|| lost as f32 / f32::from(sender.of))
        });
        LinkReading { frames_lost, at: now.into() }
    }
}

/// Whole seconds since power-on; 136 years fit.
fn seconds(at: Instant) -> u32 {
    (at.as_micros() / Span::from_secs(1).as_micros()) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode::{Encoder, FRAME_BYTES_MAX};

    const SOURCE: Source = Source { system: 1, component: 191 };

    fn heartbeats(sequences: &mut Sequences, from_ms: u64, numbers: impl IntoIterator<Item = u8>) -> u32 {
        let mut lost = 0;
        for (index, number) in (0..).zip(numbers) {
            let mut encoder = Encoder::new();
            encoder.set_system(1);
            encoder.set_sequence(number);
            let mut buffer = [0; FRAME_BYTES_MAX];
            let bytes = encoder.frame(&mut buffer, &crate::messages::heartbeat(4));
            let frame = Frame::parse(bytes).expect("a frame of ours");
            lost += u32::from(sequences.frame(Instant::from_millis(from_ms + index * 10), &frame));
        }
        lost
    }

    #[test]
    fn a_gap_is_counted_also_across_the_wrap() {
        let mut sequences = Sequences::new();
        assert_eq!(heartbeats(&mut sequences, 0, [250, 251, 254, 255, 0, 3]), 2 + 2);
    }

    #[test]
    fn a_restart_of_the_sender_is_no_loss() {
        let mut sequences = Sequences::new();
        assert_eq!(heartbeats(&mut sequences, 0, [200, 201, 0, 1]), 54);
        assert_eq!(heartbeats(&mut sequences, 0, [0, 1]), 0, "a step back counts for nothing");
    }

    #[test]
    fn a_loss_is_no_larger_part_because_less_is_sent_after_it() {
        let part = |sequences: &mut Sequences, ms| {
            sequences.reading(Instant::from_millis(ms), Some(SOURCE)).frames_lost.expect("enough frames")
        };
        let mut sequences = Sequences::new();
        heartbeats(&mut sequences, 0, 0..200);
        heartbeats(&mut sequences, 7_000, (200..255_u8).filter(|number| !(240..250).contains(number)));
        let before = part(&mut sequences, 8_000);
        assert!((before - 10.0 / 255.0).abs() < 0.001, "{before}");
        heartbeats(&mut sequences, 14_000, [255]);
        let after = part(&mut sequences, 14_500);
        assert!((after - before).abs() < 0.001, "{after}");
        heartbeats(&mut sequences, 17_000, 0..30);
        assert!(part(&mut sequences, 17_500) < 0.001, "its second has passed");
    }

    #[test]
    fn a_reading_covers_ten_seconds_and_forgets() {
        let mut sequences = Sequences::new();
        heartbeats(&mut sequences, 0, (0..100_u8).filter(|number| number % 10 != 5));
        let reading = sequences.reading(Instant::from_millis(1_000), Some(SOURCE));
        assert!((reading.frames_lost.expect("enough frames") - 0.1).abs() < 0.01);
        assert_eq!(sequences.reading(Instant::from_millis(30_000), Some(SOURCE)).frames_lost, None);
        assert_eq!(sequences.reading(Instant::from_millis(1_000), None).frames_lost, None);
    }
}
