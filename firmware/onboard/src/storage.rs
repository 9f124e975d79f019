//! The storage task's body: sectors from the queue onto the card, one at a call.
//!
//! The least urgent task, because its library waits for the card: nothing else may wait with it. What waits for it is
//! the sector queue, sized for a card that stands still for 2.5 s.

use hums_core::time::{Instant, Span};
use hums_recorder::recorder::Written;
use hums_recorder::{CardDevice, CardStatus, HeldBlocks, Recorder};

use crate::queues::SectorsOut;

/// How soon to call again after [`Service::NoCard`].
pub const NO_CARD_RETRY: Span = Span::from_millis(100);

/// What one call did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// A sector was written: call again at once.
    Wrote,
    /// Nothing waits: call again when something does.
    Idle,
    /// There is no card to write to: call again in a while (the card is looked for once a second).
    NoCard,
}

/// The recorder with its queue's other side.
pub struct Storage<'a, D: CardDevice> {
    recorder: Recorder<'a, D>,
    status: &'a CardStatus,
}

impl<'a, D: CardDevice> Storage<'a, D> {
    /// For the card in `device`; see [`Recorder::new`].
    pub const fn new(device: D, status: &'a CardStatus, held: &'a HeldBlocks, entropy: u32) -> Self {
        Self { recorder: Recorder::new(device, status, held, entropy), status }
    }

    /// Writes at most one sector. The caller tells [`CardStatus::end_service`] afterwards how long it took.
    pub fn service(&mut self, now: Instant, sectors: &mut SectorsOut) -> Service {
        self.status.begin_service(now);
        let Some(sector) = sectors.oldest() else {
            // So that the card's state is known, and a session open, before there is anything to write.
            return if self.recorder.ready(now) { Service::Idle } else { Service::NoCard };
        };
        let mut sector = *sector;
        match self.recorder.write(now, &mut sector) {
            Written::Done => {
                sectors.drop_oldest();
                Service::Wrote
            }
            Written::Later => Service::NoCard,
        }
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
