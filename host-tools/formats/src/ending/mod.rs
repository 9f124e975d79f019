//! The evidence of a log's end, and its words.
//!
//! A log that lost its last sectors looks like one whose power failed earlier. So only two records prove its
//! end: the mark of a session that ended properly, and the findings of the next start on the card. Without
//! these the log is proved up to its last end mark (a disarming or a landing). That holds only if the vehicle
//! did not move on after it.

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
