//! The storage task's side of the store.

use embedded_storage::nor_flash::NorFlash;
use hums_core::Monitor;
use hums_core::health::exceedance::Exceedances;
use hums_core::lifetime::{ITEM_BYTES_MAX, ItemKey, Room, Session};
use hums_core::parameters::ParamError;
use hums_store::{Error, Key, Store, StoreCondition, param};

use super::mailbox::MailboxOut;
use super::status::{EraseMoment, StoreState, StoreStatus};

const AHEAD: (usize, usize) = (5, 8);
/// A sector with a smaller free part is erased on the ground even while the autopilot talks.
const SCARCE: (usize, usize) = (1, 4);
/// Reserve for landing and disarming: all exceedances, the session's counters twice, and the times of [`SIGNED_MAX`]
/// signed changes, 40 bytes each.
const RESERVE: usize = 1_408;
pub(crate) const SIGNED_MAX: u8 = 4;
const LANDING: usize = Exceedances::BYTES + 2 * Session::BYTES_TYPICAL + 4 * 16;
const _: () = assert!(LANDING + SIGNED_MAX as usize * 40 <= RESERVE);

/// The result of one call of [`StoreWriter::service`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveStep {
    /// An item was taken: another may wait.
    Took,
    /// There is nothing to do.
    Idle,
    /// The item waits until an erase is allowed.
    Waits,
}

/// Saves items in the store.
pub struct StoreWriter<'a, F: NorFlash> {
    store: Option<Store<F>>,
    items: MailboxOut<'a>,
    pub(crate) status: &'a StoreStatus,
    waits: bool,
    /// The work of this calm time is done.
    turned: bool,
    /// Less than [`SCARCE`] of the sector in use is free.
    scarce: bool,
}

impl<'a, F: NorFlash> StoreWriter<'a, F> {
    /// Mounts the store in `flash`. It completes interrupted work, which may take an erase: before reception begins.
    pub fn mount(flash: F, items: MailboxOut<'a>, status: &'a StoreStatus) -> Self {
        let (store, state) = match Store::mount(flash) {
            Err(_) => (None, StoreState::Failed),
            Ok((store, StoreCondition::Kept)) => (Some(store), StoreState::Kept),
            Ok((store, StoreCondition::Damaged)) => {
                status.change(|store| store.unreadable += 1);
                (Some(store), StoreState::Kept)
            }
            Ok((store, StoreCondition::Blank)) => (Some(store), StoreState::New),
            Ok((store, StoreCondition::Unreadable)) => (Some(store), StoreState::Remade),
        };
        status.change(|store| store.state = state);
        Self { store, items, status, waits: false, turned: false, scarce: false }
    }

    /// Frees five eighths of a sector if less is free; whether that took an erase. Not after a reset that may have
    /// come in flight.
    pub fn turn_ahead(&mut self) -> bool {
        let Some(store) = &mut self.store else { return false };
        let turned = store.turn_ahead(F::ERASE_SIZE * AHEAD.0 / AHEAD.1);
        if turned.is_err() {
            self.status.change(|store| store.failed += 1);
        }
        self.look_for_room();
        turned.unwrap_or(false)
    }

    /// Gives all stored items to the monitor, the session last, since it is added to the others. An unreadable item
    /// is counted and ignored.
    pub fn load(&mut self, monitor: &mut Monitor) {
        const SESSION: Key = Key::item(ItemKey::Session.number());
        let Self { store: Some(store), status, .. } = self else { return };
        let outcome = store.for_each(|key, value| {
            if key != SESSION && !restore(monitor, key, value) {
                status.change(|store| store.unreadable += 1);
            }
        });
        if outcome.is_err() {
            status.change(|store| store.unreadable += 1);
        }
        let mut session = [0; ITEM_BYTES_MAX];
        match store.get(SESSION, &mut session) {
            Ok(None) => {}
            Ok(Some(length)) if restore(monitor, SESSION, session.get(..length).unwrap_or_default()) => {}
            Ok(Some(_)) | Err(_) => status.change(|store| store.unreadable += 1),
        }
        self.look_for_room();
    }

    /// An item of another owner, by number; returns its length, 0 if there is none.
    pub fn item(&mut self, number: u8, out: &mut [u8]) -> usize {
        let got = self.store.as_mut().map(|store| store.get(Key::item(number), out));
        got.and_then(Result::ok).flatten().unwrap_or(0)
    }

    /// Mounts since it was made; 0 if the flash does not work.
    pub fn mounts(&mut self) -> u32 {
        self.store.as_mut().and_then(|store| store.mounts().ok()).unwrap_or(0)
    }

    /// Saves one item. An erase is allowed by [`EraseMoment`] (the table in [`super`]), or by `may_erase`.
    pub fn service(&mut self, may_erase: bool) -> SaveStep {
        let calm = self.status.read().calm;
        let erases = calm == EraseMoment::Silent || (calm == EraseMoment::Grounded && self.scarce);
        self.turned &= calm != EraseMoment::None;
        if erases && !self.turned {
            // Before the first save: the next flight then has room, and a save needs no erase of its own.
            self.turned = true;
            if self.turn_ahead() && calm == EraseMoment::Grounded {
                self.status.change(|store| store.erased += 1);
            }
        }
        let Self { store, items, status, waits, .. } = self;
        let Some((key, value)) = items.waiting() else { return SaveStep::Idle };
        let Some(store) = store else {
            items.release();
            return SaveStep::Took;
        };
        if *waits && !may_erase && !erases {
            return SaveStep::Waits;
        }
        store.allow_erase(may_erase || calm == EraseMoment::Silent);
        let saved = store.save(key, value).or_else(|error| again(store, error, key, value));
        store.allow_erase(false);
        if matches!(saved, Err(Error::NotNow)) {
            if !core::mem::replace(waits, true) {
                status.change(|store| store.refused += 1);
            }
            return SaveStep::Waits;
        }
        *waits = false;
        // After two failures its owner saves it again when it has changed.
        status.change(|store| if saved.is_ok() { store.saved += 1 } else { store.failed += 1 });
        items.release();
        self.look_for_room();
        SaveStep::Took
    }

    /// More than the reserve.
    fn look_for_room(&mut self) {
        if let Some(store) = &self.store {
            let room = store.room();
            self.scarce = room < F::ERASE_SIZE * SCARCE.0 / SCARCE.1;
            let room = if room < RESERVE { Room::Reserve } else { Room::Enough };
            self.status.change(|store| store.room = room);
        }
    }
}

fn again<F: NorFlash>(
    store: &mut Store<F>,
    error: Error<F::Error>,
    key: Key,
    value: &[u8],
) -> Result<hums_store::SaveResult, Error<F::Error>> {
    if matches!(error, Error::Flash(_)) { store.save(key, value) } else { Err(error) }
}

/// `false` if unreadable; unknown items are ignored.
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
