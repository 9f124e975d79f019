//! Status between the two sides: atomics, so that neither waits.

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

use hums_core::lifetime::Room;

/// The state of the store.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum StoreState {
    /// The stored items have been read.
    #[default]
    Kept = 0,
    /// The store was new.
    New = 1,
    /// The stored items were unreadable, and the store begins anew.
    Remade = 2,
    /// The flash does not work: saved items are lost at power-off.
    Failed = 3,
}

/// The cost of an erase now, by the vehicle's state. An erase stops the processor for up to 0.5 s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum EraseMoment {
    /// The vehicle is armed, flies, or was disarmed a moment ago: no erase.
    #[default]
    None = 0,
    /// Disarmed on the ground for [`GROUNDED`](super::handover::GROUNDED), with a talking autopilot: frames would be
    /// lost.
    Grounded = 1,
    /// Disarmed, and no frame for [`QUIET`](super::handover::QUIET): nothing would be lost.
    Silent = 2,
}

/// Status of the store's writer for the monitor, and back.
#[derive(Debug, Default)]
pub struct StoreStatus {
    state: AtomicU8,
    pub(crate) unreadable: AtomicU32,
    pub(crate) saved: AtomicU32,
    pub(crate) refused: AtomicU32,
    pub(crate) failed: AtomicU32,
    pub(crate) erased: AtomicU32,
    calm: AtomicU8,
    reserve_only: AtomicBool,
}

/// A reading of [`StoreStatus`]; counters since power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StoreReading {
    /// The store's state at the start.
    pub state: StoreState,
    /// Unreadable items at the start, plus one if the flash was damaged.
    pub unreadable: u32,
    /// Items saved.
    pub saved: u32,
    /// Waited: no erase was allowed.
    pub refused: u32,
    /// Unsaved items.
    pub failed: u32,
    /// Erases while the autopilot talked: frames were lost with each.
    pub erased: u32,
    /// Whether there is room to spare.
    pub room: Room,
}

impl StoreStatus {
    /// Nothing done.
    pub const fn new() -> Self {
        Self {
            state: AtomicU8::new(StoreState::Kept as u8),
            unreadable: AtomicU32::new(0),
            saved: AtomicU32::new(0),
            refused: AtomicU32::new(0),
            failed: AtomicU32::new(0),
            erased: AtomicU32::new(0),
            calm: AtomicU8::new(EraseMoment::None as u8),
            reserve_only: AtomicBool::new(false),
        }
    }

    /// The values, each valid by itself.
    pub fn read(&self) -> StoreReading {
        StoreReading {
            state: match self.state.load(Ordering::Relaxed) {
                1 => StoreState::New,
                2 => StoreState::Remade,
                3 => StoreState::Failed,
                _ => StoreState::Kept,
            },
            unreadable: self.unreadable.load(Ordering::Relaxed),
            saved: self.saved.load(Ordering::Relaxed),
            refused: self.refused.load(Ordering::Relaxed),
            failed: self.failed.load(Ordering::Relaxed),
            erased: self.erased.load(Ordering::Relaxed),
            room: if self.reserve_only.load(Ordering::Relaxed) { Room::Reserve } else { Room::Enough },
        }
    }

    /// Cost of an erase now, by the vehicle's state.
    pub fn calm(&self) -> EraseMoment {
        match self.calm.load(Ordering::Relaxed) {
            1 => EraseMoment::Grounded,
            2 => EraseMoment::Silent,
            _ => EraseMoment::None,
        }
    }

    pub(crate) fn set_calm(&self, calm: EraseMoment) {
        self.calm.store(calm as u8, Ordering::Relaxed);
    }

    pub(crate) fn set_room(&self, room: Room) {
        self.reserve_only.store(room == Room::Reserve, Ordering::Relaxed);
    }

    pub(crate) fn set_state(&self, state: StoreState) {
        self.state.store(state as u8, Ordering::Relaxed);
    }
}

pub(crate) fn count(counter: &AtomicU32) {
    counter.fetch_add(1, Ordering::Relaxed);
}
