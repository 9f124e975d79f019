//! The page of a flight: `hums live` shows it as it grows, `hums report` when it is complete.
//!
//! ```text
//! observations -> samples -> history -> parts -> page (flight.js)
//! ```
//!
//! A flight is a [`history::History`]: series with names, units and limits ([`plots`]), track, findings and
//! texts ([`mod@note`]), phases and flight modes ([`spans`], [`modes`]), parameters ([`parameters`]). A page
//! gets it in parts: over a socket as it grows, or one part with the whole, inside the report. The same
//! modules in `assets/` draw both. [`program`] joins the modules of an entry to one script, and there is one
//! style sheet.
//!
//! A vehicle's data never become markup: text goes to the page as data ([`json`]), and only as text onto it.

pub mod frames;
pub mod history;
pub mod json;
pub mod merged;
pub mod modes;
pub mod more;
pub mod note;
pub mod parameters;
pub mod plots;
pub mod program;
pub mod samples;
pub mod spans;
pub mod spectrum;
