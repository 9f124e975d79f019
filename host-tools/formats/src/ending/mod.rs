//! What is known of a log's end, and in which words.
//!
//! A log whose last sectors are gone looks like one whose power went earlier: nothing in it tells. So its end is proved
//! only by what was written for that: the mark of a session that was ended in order, or what the next start on the card
//! found. Without these the log is proved up to its last end mark (a disarming or a landing), as long as the vehicle did
//! not move on after it.

mod files;
mod json;
mod log;
mod place;
mod proof;

pub use files::{among_words, behind_words, copies_words};
pub use json::{BlocksJson, EndJson};
pub use log::{Ending, made_again_words, not_taken_words, unprotected_words};
pub use place::SessionBefore;
pub use proof::{Proof, Teller};
