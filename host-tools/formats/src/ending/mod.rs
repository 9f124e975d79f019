//! The evidence of a log's end, and its words.
//!
//! A log that lost its last sectors looks like one whose power failed earlier. Two records prove its end: the
//! mark of a proper end, and the findings of the next start. Otherwise the log is proved up to its last end
//! mark (a disarming or a landing), if the vehicle did not move on after it.

mod files;
mod json;
mod log;
mod place;
mod proof;

pub use files::{among_words, behind_words, copies_words};
pub use json::{BlocksJson, EndJson};
pub use log::{Ending, made_again_words, unprotected_words};
pub use place::SessionBefore;
pub use proof::{Proof, Teller};
