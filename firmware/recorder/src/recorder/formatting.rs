//! Formats the card that is in, because somebody asked for it.

use hums_core::time::Instant;

use super::{RETRY, Recorder, Slot, mix};
use crate::CardDevice;
use crate::card::CardError;
use crate::format::{FormatError, Formatting};
use crate::status::CardState;

impl<D: CardDevice> Recorder<'_, D> {
    /// Formats the card if somebody asked for it, a little at each call; whether there was something to do: call again
    /// at once. What is on the card is lost; a new session begins on it.
    pub fn format(&mut self, now: Instant) -> bool {
        if self.status.take_format_wanted() && !self.finished {
            self.begin_format(now);
        }
        self.begin_service();
        let Slot::Formatting(device, formatting) = &mut self.slot else { return false };
        let done = formatting.step(device);
        if let Ok(false) = done {
            return true;
        }
        if let Slot::Formatting(device, _) = core::mem::replace(&mut self.slot, Slot::Moving) {
            self.slot = Slot::Waiting(device);
        }
        match done {
            Err(FormatError::Device(error)) => self.tell(&CardError::Device(error)),
            Err(FormatError::TooSmall) => self.status.set_state(CardState::Foreign),
            Ok(_) => self.retry_at = now,
        }
        true
    }

    fn begin_format(&mut self, now: Instant) {
        self.release();
        self.retry_at = now + RETRY;
        let Slot::Waiting(device) = core::mem::replace(&mut self.slot, Slot::Moving) else { return };
        device.reset();
        let volume_id = mix(self.entropy, now.as_micros() as u32);
        self.slot = Slot::Formatting(device, Formatting::new(volume_id));
        self.status.set_state(CardState::Formatting);
    }
}
