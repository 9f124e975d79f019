//! MAVLink: frames, and payloads as typed values.

pub mod frame;
pub mod values;

pub use hums_dialect::ids;
