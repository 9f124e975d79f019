//! The storage task's body: sectors from the queue onto the card, with one write command at a call.
//!
//! The least urgent task, because its library waits for the card: nothing else may wait with it. What waits for it is
//! the sector queue, sized for a card that stands still for 2.5 s.

use hums_core::clock::{Instant, Span};
use hums_recorder::recorder::Written;
use hums_recorder::{Buffers, CardDevice, CardStatus, Recorder};

use crate::queues::SectorsOut;
use crate::shelf::Server;

/// How soon to call again after [`Service::NoCard`].
pub const NO_CARD_RETRY: Span = Span::from_millis(100);

/// What one call did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// Something was written, formatted or looked through: call again at once.
    Wrote,
    /// Nothing waits: call again when something does.
    Idle,
    /// There is no card to write to: call again in a while (the card is looked for once a second).
    NoCard,
}

impl Service {
    /// What follows from what the recorder did.
    const fn after(written: Written) -> Self {
        match written {
            Written::Done | Written::Searching => Self::Wrote,
            Written::Later => Self::NoCard,
        }
    }
}

/// The recorder with its queue's other side.
pub struct Storage<'a, D: CardDevice> {
    recorder: Recorder<'a, D>,
}

impl<'a, D: CardDevice> Storage<'a, D> {
    /// For the card in `device`; see [`Recorder::new`].
    pub const fn new(device: D, status: &'a CardStatus, held: &'a Buffers, entropy: u32) -> Self {
        Self { recorder: Recorder::new(device, status, held, entropy) }
    }

    /// Writes what waits with at most one command.
    pub fn service(&mut self, now: Instant, sectors: &mut SectorsOut) -> Service {
        if self.recorder.format(now) {
            return Service::Wrote;
        }
        while sectors.oldest().is_some_and(|sector| self.recorder.take(sector)) {
            sectors.drop_oldest();
        }
        if self.recorder.waiting() == 0 {
            // So that the card's state is known, and a session open, before there is anything to write.
            let ready = self.recorder.ready(now);
            if ready == Written::Done {
                self.recorder.idle();
                return Service::Idle;
            }
            return Service::after(ready);
        }
        Service::after(self.recorder.write(now))
    }

    /// Answers one question about the logs on the card, if there is one; whether there was. To be called only when
    /// [`Self::service`] found nothing to write.
    pub fn serve(&mut self, shelf: &mut Server<'_>) -> bool {
        shelf.serve(&mut self.recorder)
    }

    /// Whether everything that was given to it is on the card.
    pub fn is_done(&self, sectors: &SectorsOut) -> bool {
        self.recorder.waiting() == 0 && sectors.is_empty()
    }

    /// Drops what waits because there is no card to write it to; how many frames are lost with it.
    pub fn abandon(&mut self, sectors: &mut SectorsOut) -> u64 {
        self.recorder.abandon() + sectors.abandon()
    }

    /// Ends the session after the last sector: the card can be pulled.
    pub fn finish(&mut self) {
        self.recorder.finish();
    }

    /// The recorder, for what is stored and for the card.
    pub const fn recorder(&mut self) -> &mut Recorder<'a, D> {
        &mut self.recorder
    }

    /// Gives the device back.
    pub fn into_device(self) -> Option<D> {
        self.recorder.into_device()
    }
}
