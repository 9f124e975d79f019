//! Shared status of the tasks: written by one, read by any at any time.

use core::sync::atomic::AtomicBool;

use hums_onboard::persist::status::StoreReading;
use hums_onboard::port::PortReading;
use hums_onboard::update::UpdateStatus;
use hums_onboard::{PortStatus, StoreStatus, Supervisor};
use hums_recorder::CardStatus;

pub(crate) static SUPERVISOR: Supervisor = Supervisor::new();
/// Counters of reception.
pub(crate) static PORT_STATUS: PortStatus = PortStatus::new(PortReading::NONE);
/// Counters of storage.
pub(crate) static CARD_STATUS: CardStatus = CardStatus::new();
pub(crate) static STORE_STATUS: StoreStatus = StoreStatus::new(StoreReading::NONE);
pub(crate) static UPDATE_STATUS: UpdateStatus = UpdateStatus::new(None);
/// Monitor to storage: after the last sector the log ends.
pub(crate) static LOG_ENDS: AtomicBool = AtomicBool::new(false);
pub(crate) static LOG_ENDED: AtomicBool = AtomicBool::new(false);
