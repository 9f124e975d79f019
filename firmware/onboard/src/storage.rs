//! The storage task's body: sectors from the queue onto the card, with one write command at a call.
//!
//! It is the least urgent task, because its library waits for the card. Sectors wait in their queue, sized for a card
//! that stalls for 2.5 s.

use hums_core::clock::{Instant, Span};
use hums_recorder::{Buffers, CardDevice, CardStatus, NotYet, Recorder};

use crate::queues::SectorsOut;
use crate::shelf::Server;

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

/// The recorder with the reading end of its queue.
pub struct Storage<'a, D: CardDevice> {
    recorder: Recorder<'a, D>,
}

impl<'a, D: CardDevice> Storage<'a, D> {
    /// See [`Recorder::new`].
    pub const fn new(device: D, status: &'a CardStatus, held: &'a Buffers, entropy: u32) -> Self {
        Self { recorder: Recorder::new(device, status, held, entropy) }
    }

    /// Writes waiting sectors with at most one command.
    pub fn service(&mut self, now: Instant, sectors: &mut SectorsOut) -> Service {
        if self.recorder.format(now) {
            return Service::Wrote;
        }
        match sectors.lend(|waiting| self.recorder.write(now, waiting)) {
            Ok(0) => {
                self.recorder.idle();
                Service::Idle
            }
            Ok(_) | Err(NotYet::Searching) => Service::Wrote,
            Err(NotYet::Later) => Service::NoCard,
        }
    }

    /// About the logs on the card; whether there was one. Only if [`Self::service`] found nothing to write.
    pub fn serve(&mut self, shelf: &mut Server<'_>) -> bool {
        shelf.serve(&mut self.recorder)
    }

    /// Ends the session after the last sector: the card can be pulled.
    pub fn finish(&mut self) {
        self.recorder.finish();
    }

    /// The recorder, for stored logs and for the card.
    pub const fn recorder(&mut self) -> &mut Recorder<'a, D> {
        &mut self.recorder
    }

    /// Gives the device back.
    pub fn into_device(self) -> Option<D> {
        self.recorder.into_device()
    }
}
