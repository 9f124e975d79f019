//! Health: what the checks say, in the words that the log, the GS and the host tools share.

pub mod finding;

pub use finding::{Finding, Level, Subsystem};
