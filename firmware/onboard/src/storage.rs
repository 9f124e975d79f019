//! The storage task's body: sectors from the queue onto the card, with one write command at a call.
//!
//! It is the least urgent task, because its library waits for the card. Sectors wait in their queue, sized for a card
//! that stalls for 2.5 s.

use hums_core::clock::{Instant, Span};
use hums_recorder::{CardDevice, Recorder, WaitReason};

use crate::queues::SectorsOut;

/// How soon to call again after [`Service::NoCard`].
pub const NO_CARD_RETRY: Span = Span::from_millis(100);

/// The result of one call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// It wrote, formatted or searched: call again at once.
    Wrote,
    /// Nothing waits: call again with new work.
    Idle,
    /// No card accepts data: call again after a time (the card is looked for once a second).
    NoCard,
}

/// Writes waiting sectors with at most one command.
pub fn service<D: CardDevice>(
    recorder: &mut Recorder<'_, D>,
    now: Instant,
    sectors: &mut SectorsOut,
) -> Service {
    if recorder.format(now) {
        return Service::Wrote;
    }
    match sectors.lend(|waiting| recorder.write(now, waiting)) {
        Ok(0) => {
            recorder.idle();
            Service::Idle
        }
        Ok(_) | Err(WaitReason::Searching) => Service::Wrote,
        Err(WaitReason::Later) => Service::NoCard,
    }
}

/// Ends the session if no sector waits; whether it has ended. Ask for the end before this call: a sector that was queued
/// before the request is then on the card.
pub fn finish_after<D: CardDevice>(recorder: &mut Recorder<'_, D>, sectors: &SectorsOut) -> bool {
    let is_last = sectors.is_empty();
    if is_last {
        recorder.finish();
    }
    is_last
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::queues::Queues;
    use hums_blackbox::{Sector, SectorSink};
    use hums_recorder::{BLOCK_BYTES, Block, Buffers, CardStatus};

    /// A slot without a card.
    struct Empty;

    impl CardDevice for Empty {
        type Error = ();

        fn read(&self, _: &mut [Block], _: u32) -> Result<(), ()> {
            Err(())
        }

        fn write(&self, _: &[Block], _: u32) -> Result<(), ()> {
            Err(())
        }

        fn num_blocks(&self) -> Result<u32, ()> {
            Err(())
        }
    }

    #[test]
    fn a_log_ends_only_after_its_last_sector_whatever_the_card_does() {
        let (status, buffers, mut queues) =
            (CardStatus::new(), Box::new(Buffers::new()), Box::new(Queues::new()));
        let (mut out, mut ends) = queues.split();
        let mut recorder = Recorder::new(&Empty, &status, &buffers, 1);
        for second in 0..3 {
            service(&mut recorder, Instant::from_millis(second * 1_000), &mut ends.sectors_out);
            out.sectors.put(&Sector::from_bytes([0; BLOCK_BYTES]));
            assert!(!finish_after(&mut recorder, &ends.sectors_out));
        }
        ends.sectors_out.abandon();
        assert!(finish_after(&mut recorder, &ends.sectors_out));
    }
}
