//! The card's slot.

use super::Buffers;
use crate::CardDevice;
use crate::card::{Card, CardError};
use crate::format::{FormatError, Formatting};
use crate::status::CardStatus;

#[expect(
    clippy::large_enum_variant,
    reason = "one of these exists, in a static: its largest variant is the budget"
)]
pub(super) enum Socket<'a, D: CardDevice> {
    /// The device, while no usable card is in it.
    Waiting(D),
    Mounted(Card<'a, D>),
    Formatting(D, Formatting),
    /// Only while the value is replaced.
    Moving,
}

impl<'a, D: CardDevice> Socket<'a, D> {
    /// Mounts the present card; `false` unless the slot waits for one.
    // Not inlined: moved volumes must not lie on the stack below later calls.
    #[inline(never)]
    pub(super) fn mount(
        &mut self,
        status: &'a CardStatus,
        buffers: &'a Buffers,
    ) -> Result<bool, CardError<D::Error>> {
        if !matches!(self, Self::Waiting(_)) {
            return Ok(false);
        }
        let Self::Waiting(device) = core::mem::replace(self, Self::Moving) else { return Ok(false) };
        device.reset();
        match Card::mount(device, status, buffers) {
            Ok(card) => {
                *self = Self::Mounted(card);
                Ok(true)
            }
            Err((device, error)) => {
                *self = Self::Waiting(device);
                Err(error)
            }
        }
    }

    /// Unmounts the card.
    pub(super) fn release(&mut self) {
        *self = match core::mem::replace(self, Self::Moving) {
            Self::Mounted(card) => Self::Waiting(card.unmount()),
            other => other,
        };
    }

    /// Begins to format the card that was examined last; `false` unless the slot waits for a card. A card that could
    /// be mounted since the command is never formatted.
    pub(super) fn begin_format(&mut self, volume_id: u32) -> bool {
        if !matches!(self, Self::Waiting(_)) {
            return false;
        }
        let Self::Waiting(device) = core::mem::replace(self, Self::Moving) else { return false };
        device.recheck();
        *self = Self::Formatting(device, Formatting::new(volume_id));
        true
    }

    /// Whether it is done; `None` if nothing is being formatted.
    pub(super) fn format(&mut self) -> Option<Result<bool, FormatError<D::Error>>> {
        let Self::Formatting(device, formatting) = self else { return None };
        let done = formatting.step(device);
        if !matches!(done, Ok(false))
            && let Self::Formatting(device, _) = core::mem::replace(self, Self::Moving)
        {
            *self = Self::Waiting(device);
        }
        Some(done)
    }

    pub(super) fn begin_service(&self) {
        match self {
            Self::Waiting(device) | Self::Formatting(device, _) => device.begin_service(),
            Self::Mounted(card) => card.device().begin_service(),
            Self::Moving => {}
        }
    }

    pub(super) fn take_retries(&self) -> u32 {
        match self {
            Self::Mounted(card) => card.device().take_retries(),
            Self::Waiting(_) | Self::Formatting(..) | Self::Moving => 0,
        }
    }

    pub(super) const fn is_mounted(&self) -> bool {
        matches!(self, Self::Mounted(_))
    }

    pub(super) const fn card(&mut self) -> Option<&mut Card<'a, D>> {
        if let Self::Mounted(card) = self { Some(card) } else { None }
    }

    pub(super) fn into_device(mut self) -> Option<D> {
        self.release();
        if let Self::Waiting(device) = self { Some(device) } else { None }
    }
}
