//! The pipeline between the ports and the card, with time and I/O as arguments. It has the bodies of the firmware's
//! tasks; driven by a virtual clock, it is all of `hums sim`.
//!
//! ```text
//!              Reception            Monitoring                     Storage
//! UART bytes ------------> frames ---------------> sectors ------------------> card
//!                          (queue)        \        (queue)
//!                                          \-----> GS bytes (queue) ---------> GS port
//! ```
//! [`queues`] has all queues, their capacities, and their behaviour when full.
#![cfg_attr(not(test), no_std)]

mod arming;
mod companion;
mod journal;
mod loss;
pub mod monitoring;
mod notices;
pub mod persist;
pub mod port;
pub mod queues;
pub mod reception;
mod records;
mod reset;
pub mod shelf;
pub mod storage;
pub mod supervisor;
pub mod update;
pub mod uplink;
pub mod wait;

pub use arming::ArmingWatch;
pub use monitoring::Monitoring;
pub use persist::{Handover, Mailbox, StoreStatus, StoreWriter};
pub use port::PortStatus;
pub use reception::Reception;
pub use reset::ResetCause;
pub use storage::Service;
pub use supervisor::{Supervisor, Task};
