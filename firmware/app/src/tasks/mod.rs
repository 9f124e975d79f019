//! The tasks: each owns its peripheral and calls one body of `hums_onboard`. Their urgency is in `executors`.

pub(crate) mod downlink;
pub(crate) mod monitor;
pub(crate) mod reception;
pub(crate) mod storage;
pub(crate) mod uplink;

use hums_onboard::{Mailbox, PortStatus, StoreStatus, Supervisor};
use hums_recorder::CardStatus;

/// Who has reported in.
pub(crate) static SUPERVISOR: Supervisor = Supervisor::new();
/// What reception counts.
pub(crate) static PORT_STATUS: PortStatus = PortStatus::new();
/// What storage counts.
pub(crate) static CARD_STATUS: CardStatus = CardStatus::new();
/// Monitor to storage: what is to outlive power.
pub(crate) static MAILBOX: Mailbox = Mailbox::new();
/// What became of it.
pub(crate) static STORE_STATUS: StoreStatus = StoreStatus::new();
