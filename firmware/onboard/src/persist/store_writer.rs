//! The storage task's side: the store and what goes into it.

use embedded_storage::nor_flash::NorFlash;
use hums_core::Monitor;
use hums_core::health::exceedance::Exceedances;
use hums_core::lifetime::{ITEM_BYTES_MAX, ItemKey, Room, Session};
use hums_core::params::ParamError;
use hums_store::{Error, Found, Key, Store, param};

use super::mailbox::MailboxOut;
use super::status::{Calm, StoreState, StoreStatus, count};

/// What part of a sector is free before a flight, at the least.
const AHEAD: (usize, usize) = (5, 8);
/// A sector with less than this part of it free is erased on the ground even while the autopilot talks.
const SCARCE: (usize, usize) = (1, 4);
/// What landing and disarming need: all exceedances and the session's counters twice; beside them the times of
/// so many signed changes, 40 bytes each.
const RESERVE: usize = 1_408;
pub(crate) const SIGNED_MAX: u8 = 4;
const LANDING: usize = Exceedances::BYTES + 2 * Session::BYTES_TYPICAL + 4 * 16;
const _: () = assert!(LANDING + SIGNED_MAX as usize * 40 <= RESERVE);

/// What one call of [`StoreWriter::service`] did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saved {
    /// An item was taken: there may be another.
    Took,
    /// There is nothing to do.
    Idle,
    /// The oldest item waits until an erase is allowed.
    Waits,
}

/// The storage task's side: the store and what goes into it.
pub struct StoreWriter<'a, F: NorFlash> {
    store: Option<Store<F>>,
    items: MailboxOut<'a>,
    pub(crate) status: &'a StoreStatus,
    /// The oldest item has been counted as waiting.
    waits: bool,
    /// What there is to do in this calm has been done.
    turned: bool,
    /// Less than [`SCARCE`] of the sector in use is free.
    scarce: bool,
}

impl<'a, F: NorFlash> StoreWriter<'a, F> {
    /// With the store in `flash`, if there is one. Ends what power cut short, which may take an erase: before reception
    /// begins.
    pub fn mount(flash: Option<F>, items: MailboxOut<'a>, status: &'a StoreStatus) -> Self {
        let store = flash.and_then(|flash| {
            let Ok((store, found)) = Store::mount(flash) else {
                status.set_state(StoreState::Failed);
                return None;
            };
            status.set_state(match found {
                Found::Kept => StoreState::Kept,
                Found::Damaged => {
                    count(&status.unreadable);
                    StoreState::Kept
                }
                Found::Blank => StoreState::New,
                Found::Unreadable => StoreState::Remade,
            });
            Some(store)
        });
        Self { store, items, status, waits: false, turned: false, scarce: false }
    }

    /// Makes five eighths of a sector free where less is; whether that took an erase. Not after a reset that may have come
    /// in flight.
    pub fn turn_ahead(&mut self) -> bool {
        let Some(store) = &mut self.store else { return false };
        let turned = store.turn_ahead(F::ERASE_SIZE * AHEAD.0 / AHEAD.1);
        if turned.is_err() {
            count(&self.status.failed);
        }
        self.look_for_room();
        turned.unwrap_or(false)
    }

    /// Gives the monitor everything that is stored, the last session after all else: it is added to the others. An item
    /// that cannot be read is counted, and is as if there were none.
    pub fn load(&mut self, monitor: &mut Monitor) {
        const SESSION: Key = Key::item(ItemKey::Session.number());
        let Self { store: Some(store), status, .. } = self else { return };
        let outcome = store.for_each(|key, value| {
            if key != SESSION && !restore(monitor, key, value) {
                count(&status.unreadable);
            }
        });
        if outcome.is_err() {
            count(&status.unreadable);
        }
        let mut session = [0; ITEM_BYTES_MAX];
        match store.get(SESSION, &mut session) {
            Ok(None) => {}
            Ok(Some(length)) if restore(monitor, SESSION, session.get(..length).unwrap_or_default()) => {}
            Ok(Some(_)) | Err(_) => count(&status.unreadable),
        }
        self.look_for_room();
    }

    /// A stored item of somebody else's, by its number; how long it is, 0 where there is none.
    pub fn item(&mut self, number: u8, out: &mut [u8]) -> usize {
        let got = self.store.as_mut().map(|store| store.get(Key::item(number), out));
        got.and_then(Result::ok).flatten().unwrap_or(0)
    }

    /// How often the store was mounted since it was made; 0 where there is none.
    pub fn mounts(&mut self) -> u32 {
        self.store.as_mut().and_then(|store| store.mounts().ok()).unwrap_or(0)
    }

    /// Saves one item. An erase is allowed where [`Calm`] allows it (the table in [`super`]), or if `may_erase` says so.
    pub fn service(&mut self, may_erase: bool) -> Saved {
        let calm = self.status.calm();
        let erases = calm == Calm::Silent || (calm == Calm::Grounded && self.scarce);
        self.turned &= calm != Calm::None;
        if erases && !self.turned {
            // Before anything is saved: the next flight has room then, and a save needs no erase of its own.
            self.turned = true;
            if self.turn_ahead() && calm == Calm::Grounded {
                count(&self.status.erased);
            }
        }
        let Self { store, items, status, waits, .. } = self;
        let Some(store) = store else {
            return items.oldest(|_, _| (Saved::Took, true)).unwrap_or(Saved::Idle);
        };
        if *waits && !may_erase && !erases {
            return Saved::Waits;
        }
        store.allow_erase(may_erase || calm == Calm::Silent);
        let kept = items.oldest(|key, value| {
            match store.save(key, value).or_else(|error| again(store, error, key, value)) {
                Ok(_) => {
                    count(&status.saved);
                    (Saved::Took, true)
                }
                Err(Error::NotNow) => (Saved::Waits, false),
                // Twice; its owner saves it again when it has changed.
                Err(_) => {
                    count(&status.failed);
                    (Saved::Took, true)
                }
            }
        });
        store.allow_erase(false);
        let waited = core::mem::replace(waits, kept == Some(Saved::Waits));
        if *waits && !waited {
            count(&status.refused);
        }
        let kept = kept.unwrap_or(Saved::Idle);
        if kept == Saved::Took {
            self.look_for_room();
        }
        kept
    }

    /// Tells the monitor whether there is room to spare.
    fn look_for_room(&mut self) {
        if let Some(store) = &self.store {
            let room = store.room();
            self.scarce = room < F::ERASE_SIZE * SCARCE.0 / SCARCE.1;
            self.status.set_room(if room < RESERVE { Room::Reserve } else { Room::Enough });
        }
    }
}

/// Saves an item once more that met an error of the flash: it is tried at another place.
fn again<F: NorFlash>(
    store: &mut Store<F>,
    error: Error<F::Error>,
    key: Key,
    value: &[u8],
) -> Result<hums_store::Saved, Error<F::Error>> {
    if matches!(error, Error::Flash(_)) { store.save(key, value) } else { Err(error) }
}

/// `false` where the item cannot be read. One that this version does not know is left alone.
fn restore(monitor: &mut Monitor, key: Key, value: &[u8]) -> bool {
    if key.is_param() {
        return match param(value).map(|(name, value)| monitor.params_mut().set(name, value)) {
            Some(Ok(()) | Err(ParamError::UnknownName)) => true,
            Some(Err(ParamError::OutOfRange { .. })) | None => false,
        };
    }
    match key.number().and_then(ItemKey::from_number) {
        Some(item) => monitor.restore(item, value).is_ok(),
        None => true,
    }
}
