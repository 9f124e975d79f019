//! The page of a flight: what `hums live` shows as it grows and `hums report` when it is whole.
//!
//! ```text
//! observations -> samples -> history -> parts -> page (flight.js)
//! ```
//!
//! A flight is a [`history::History`]: series with names, units and limits ([`plots`]), track, findings and texts
//! ([`mod@note`]), phases and flight modes ([`spans`], [`modes`]), parameters ([`parameters`]). A page gets it in parts: over a
//! socket as it grows, or one part that is the whole, inside the report. The same modules in `assets/` draw both; [`program`]
//! makes one script of those that an entry needs, and there is one style sheet.
//!
//! Nothing that a vehicle sent becomes markup: text goes to the page as data ([`json`]), and only as text onto it.

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
