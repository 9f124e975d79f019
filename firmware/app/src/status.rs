//! What tasks know of each other without asking: written by one, read by any at any time.

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
