//! Status between the two sides.

use hums_core::lifetime::Room;
use hums_recorder::shared::Shared;

/// Status of the store's writer for the monitor, and back.
pub type StoreStatus = Shared<StoreReading>;

/// The state of the store.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StoreState {
    /// The stored items have been read.
    #[default]
    Kept,
    /// The store was new.
    New,
    /// The stored items were unreadable, and the store begins anew.
    Remade,
    /// The flash does not work: saved items are lost at power-off.
    Failed,
}

/// The cost of an erase now, by the vehicle's state. An erase stops the processor for up to 0.5 s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum EraseMoment {
    /// The vehicle is armed, flies, or was disarmed a moment ago: no erase.
    #[default]
    None,
    /// Disarmed on the ground for [`GROUNDED`](super::handover::GROUNDED), with a talking autopilot: frames would be
    /// lost.
    Grounded,
    /// Disarmed, and no frame for [`QUIET`](super::handover::QUIET): nothing would be lost.
    Silent,
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
    /// Cost of an erase now, by the vehicle's state.
    pub calm: EraseMoment,
}

impl StoreReading {
    /// Nothing done.
    pub const NONE: Self = Self {
        state: StoreState::Kept,
        unreadable: 0,
        saved: 0,
        refused: 0,
        failed: 0,
        erased: 0,
        room: Room::Enough,
        calm: EraseMoment::None,
    };
}
