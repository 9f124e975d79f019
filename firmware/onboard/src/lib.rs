//! The pipeline between the ports and the card, with time and I/O as arguments: the bodies of the firmware's tasks,
//! and, driven by a virtual clock, the whole of `hums sim`.
//!
//! ```text
//!              Reception            Monitoring                     Storage
//! UART bytes ------------> frames ---------------> sectors ------------------> card
//!                          (queue)        \        (queue)
//!                                          \-----> GS bytes (queue) ---------> GS port
//! ```
//! [`queues`] is the home of all queues, with their capacities and what happens when each is full.
#![cfg_attr(not(test), no_std)]

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
pub mod uplink;
pub mod wait;

pub use monitoring::Monitoring;
pub use persist::{Handover, Mailbox, StoreStatus, StoreWriter};
pub use port::PortStatus;
pub use reception::Reception;
pub use reset::ResetCause;
pub use storage::{Service, Storage};
pub use supervisor::{Supervisor, Task};
