//! Losses waiting to be recorded: a loss is data too, with its count and its first and last moment.

use hums_blackbox::record::{Loss, LossKind};
use hums_core::clock::{Instant, Span};

/// Losses of one kind, in one record.
const WINDOW: Span = Span::from_secs(1);

/// Possible in the pipeline.
pub(crate) const KINDS: [LossKind; 6] = [
    LossKind::UartOverrun,
    LossKind::NotFrames,
    LossKind::DamagedFrames,
    LossKind::QueueFull,
    LossKind::Card,
    LossKind::Records,
];

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Losses {
    open: [Option<Loss>; KINDS.len()],
}

impl Losses {
    pub(crate) const fn new() -> Self {
        Self { open: [None; KINDS.len()] }
    }

    /// Noticed at `now`, begun at `since` at the earliest.
    #[inline(never)]
    pub(crate) fn count(&mut self, since: Instant, now: Instant, what: LossKind, count: u64) {
        let Some(slot) = KINDS.iter().position(|kind| *kind == what).filter(|_| count > 0) else { return };
        let loss = self.open[slot].get_or_insert(Loss { what, count: 0, from: since, to: now });
        loss.count = loss.count.saturating_add(count);
        loss.to = now;
    }

    /// Hands each loss whose window is over (or every one, at the end) to `write`, which returns whether it was
    /// written. Otherwise the loss stays open.
    pub(crate) fn flush(&mut self, now: Instant, all: bool, mut write: impl FnMut(&Loss) -> bool) {
        for slot in &mut self.open {
            if let Some(loss) = slot
                && (all || now.since(loss.from) >= WINDOW)
                && write(loss)
            {
                *slot = None;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_of_a_second_are_one_record_and_wait_until_it_is_written() {
        let mut losses = Losses::new();
        losses.count(Instant::from_millis(100), Instant::from_millis(200), LossKind::NotFrames, 3);
        losses.count(Instant::from_millis(900), Instant::from_millis(900), LossKind::NotFrames, 4);
        let mut written = Vec::new();
        losses.flush(Instant::from_millis(1_000), false, |loss| {
            written.push(*loss);
            true
        });
        assert_eq!(written, [], "the window is not over");
        losses.flush(Instant::from_millis(1_100), false, |_| false);
        losses.flush(Instant::from_millis(1_200), false, |loss| {
            written.push(*loss);
            true
        });
        let (from, to) = (Instant::from_millis(100), Instant::from_millis(900));
        assert_eq!(written, [Loss { what: LossKind::NotFrames, count: 7, from, to }]);
    }
}
