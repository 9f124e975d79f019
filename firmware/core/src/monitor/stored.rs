//! What of the monitor outlives power: items, to be stored when they are due and taken back at the next start.

use super::Monitor;
use crate::baseline::Baselines;
use crate::bytes::Unreadable;
use crate::component::Component;
use crate::exposure::Exposure;
use crate::health::exceedance::Exceedances;
use crate::lifetime::{ITEM_BYTES_MAX, ItemKey, Lifetime, Room, Session};
use crate::time::Instant;

impl Monitor {
    /// Takes an item that was saved in an earlier session; to be called before the first tick, and for
    /// [`ItemKey::Session`] once and last. One that cannot be read is as if there were none.
    pub fn restore(&mut self, key: ItemKey, stored: &[u8]) -> Result<(), Unreadable> {
        match key {
            ItemKey::Lifetime => {
                self.before = Lifetime::decode(stored)?;
                for (battery, count) in self.before.cells.into_iter().enumerate() {
                    self.derived.cells_mut().remember(battery, count);
                }
            }
            ItemKey::Baselines => self.baselines = Baselines::decode(stored)?,
            ItemKey::Exceedances => self.exceedances = Exceedances::decode(stored)?,
            ItemKey::Exposure => self.exposure = Exposure::decode(stored)?,
            ItemKey::Component(place) => {
                let component = Component::decode(stored)?;
                *self.components.get_mut(usize::from(place)).ok_or(Unreadable)? = component;
            }
            ItemKey::Session => {
                let session = Session::decode(stored)?;
                self.before.add(&session);
                self.exposure.add(session.boots, session.exposure());
                self.components
                    .iter_mut()
                    .for_each(|component| component.add(session.boots, &session.wear()));
            }
        }
        Ok(())
    }

    /// The item to be saved next, if any is due; the same until it is [`Self::saved`]. To be saved in this order.
    pub fn save_due(&mut self, now: Instant, room: Room) -> Option<ItemKey> {
        self.saving.due(now, self.vehicle.armed(), room)
    }

    /// Everything that changed is due: the session ends, or the power is about to go.
    pub const fn save_all(&mut self) {
        self.saving.hurry_all();
    }

    /// Everything is due: what was stored is lost.
    pub fn save_anew(&mut self) {
        for key in ItemKey::ALL {
            let used = match key {
                ItemKey::Component(place) => self.component_figures(usize::from(place)).is_some(),
                _ => true,
            };
            if used {
                self.saving.hurry(key);
            }
        }
    }

    /// Writes an item as it is to be saved; gives its length.
    pub fn encode_item(&self, key: ItemKey, out: &mut [u8; ITEM_BYTES_MAX]) -> usize {
        match key {
            ItemKey::Lifetime => {
                encoded(out, |out| Lifetime { boots: self.boots(), ..self.before }.encode(out))
            }
            ItemKey::Baselines => encoded(out, |out| self.baselines.encode(out)),
            ItemKey::Exceedances => {
                out.first_chunk_mut().map_or(0, |out| self.exceedances.encode(self.usage.until(), out))
            }
            ItemKey::Exposure => encoded(out, |out| self.exposure.encode(self.boots(), out)),
            ItemKey::Component(place) => {
                let component = self.components.get(usize::from(place)).unwrap_or(&Component::NONE);
                encoded(out, |out| component.encode(self.boots(), out))
            }
            ItemKey::Session => {
                let (totals, wear) = (self.usage.totals(), self.usage.wear());
                Session::now(self.boots(), self.heard(), &totals, &wear, &self.exposure).encode(out)
            }
        }
    }

    /// The item's bytes are with the store.
    pub const fn saved(&mut self, key: ItemKey) {
        self.saving.saved(key);
    }
}

/// Writes at the start of the buffer; gives the length.
fn encoded<const N: usize>(out: &mut [u8; ITEM_BYTES_MAX], encode: impl FnOnce(&mut [u8; N])) -> usize {
    const { assert!(N <= ITEM_BYTES_MAX) };
    out.first_chunk_mut().map_or(0, |out| {
        encode(out);
        N
    })
}
