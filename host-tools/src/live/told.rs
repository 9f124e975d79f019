//! Settings and part hours of the box on board: limits here are its own.

use hums_link::encode::COMPONENT;
use hums_link::packet::Fields;
use hums_link::{Check, Frame};

use crate::mavlink::ids::PARAM_VALUE;
pub use crate::params::Limits;
pub use crate::source::told::MonitorRecord;

/// A part's place from 0, of `CMP1_KIND`.
pub fn place_of(name: &str) -> Option<usize> {
    name.strip_prefix("CMP")?.strip_suffix("_KIND")?.parse::<usize>().ok()?.checked_sub(1)
}

/// Sent to a ground station.
pub fn parameter(frame: &Frame<'_>) -> Option<(String, f32)> {
    if frame.id() != PARAM_VALUE || frame.component() != COMPONENT || frame.check() != Check::Verified {
        return None;
    }
    let fields = Fields(frame.payload());
    Some((fields.text(8, 16)?.to_owned(), fields.f32(0)))
}
