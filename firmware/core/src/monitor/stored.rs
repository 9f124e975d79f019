//! Items of the monitor that outlive power: stored when due, and restored at the next start.

use super::Monitor;
use crate::component::Component;
use crate::flight::FlightEvent;
use crate::happening::Happening;
use crate::health::exceedance::Exceedances;
use crate::lifetime::{Airframe, ITEM_BYTES_MAX, Item as _, ItemKey, Lifetime, Room, Session, Unreadable};
use crate::time::{BootMs, Millis};

/// Time after which an autopilot without a unique id has none: the answer to `AUTOPILOT_VERSION` comes long before.
const UID_COMES: Millis = Millis::from_secs(60);

impl Monitor {
    pub(super) fn step_life(&mut self, now: BootMs, event: Option<FlightEvent>) {
        let uid = self.vehicle.identity.get().map_or(0, |identity| identity.uid);
        // A system id can be set, so a known unique id is waited for. Nothing is decided before the vehicle is
        // settled.
        let waits = uid == 0 && self.before.airframe.uid != 0 && self.vehicle.known_for(now) < UID_COMES;
        if waits || !self.vehicle.is_settled(now) {
            return self.save_life(event);
        }
        let seen = Airframe { system: self.vehicle.source.map_or(0, |source| source.system), uid };
        if self.before.airframe.differs(seen) {
            self.happenings.push(Happening::OtherAirframe);
            self.before = Lifetime { boots: self.before.boots, ..Lifetime::default() };
            self.exceedances.forget_life();
            self.saving.hurry(ItemKey::Lifetime);
            self.saving.hurry(ItemKey::Exceedances);
        }
        let airframe = self.before.airframe.learn(seen);
        if airframe != self.before.airframe {
            self.before.airframe = airframe;
            self.saving.hurry(ItemKey::Lifetime);
        }
        self.save_life(event);
    }

    fn save_life(&mut self, event: Option<FlightEvent>) {
        self.saving.change(ItemKey::Session);
        if event == Some(FlightEvent::Landing) || (self.before_tick.armed && !self.vehicle.armed()) {
            self.saving.hurry_all();
        }
    }

    /// Takes an item that was saved in an earlier session; to be called before the first tick, and for
    /// [`ItemKey::Session`] once and last. An unreadable item counts as none.
    pub fn restore(&mut self, key: ItemKey, stored: &[u8]) -> Result<(), Unreadable> {
        match key {
            ItemKey::Lifetime => {
                self.before = Lifetime::decode(stored)?;
                for (battery, count) in self.before.cells.into_iter().enumerate() {
                    self.derived.cells.remember(battery, count);
                }
            }
            ItemKey::Exceedances => self.exceedances = Exceedances::decode(stored)?,
            ItemKey::Component(place) => {
                let component = Component::decode(stored)?;
                *self.components.get_mut(usize::from(place)).ok_or(Unreadable)? = component;
            }
            ItemKey::Session => {
                let session = Session::decode(stored)?;
                self.before.add(&session);
                self.components
                    .iter_mut()
                    .for_each(|component| component.add(session.boots, &session.totals));
            }
        }
        Ok(())
    }

    /// The item to be saved next, if any is due; the same until it is [`Self::saved`]. Items must be saved in this
    /// order.
    pub fn save_due(&mut self, now: BootMs, room: Room) -> Option<ItemKey> {
        self.saving.due(now, self.vehicle.armed(), room)
    }

    /// Marks all changes as due: the session ends, or the power is about to go.
    pub const fn save_all(&mut self) {
        self.saving.hurry_all();
    }

    /// Writes an item for the store; returns its length.
    pub fn encode_item(&self, key: ItemKey, out: &mut [u8; ITEM_BYTES_MAX]) -> usize {
        let boots = self.boots();
        match key {
            ItemKey::Lifetime => Lifetime { boots, ..self.before }.encode(out),
            ItemKey::Exceedances => self.exceedances.encode(self.usage.until(), out),
            ItemKey::Component(place) => {
                let component = self.components.get(usize::from(place)).copied().unwrap_or_default();
                Component { as_of: boots, ..component }.encode(out)
            }
            ItemKey::Session => {
                Session { boots, heard: self.heard(), totals: self.usage.totals() }.encode(out)
            }
        }
    }

    /// The store has taken the item's bytes.
    pub const fn saved(&mut self, key: ItemKey) {
        self.saving.saved(key);
    }
}
