//! MAVLink: frames, and payloads as typed values.

pub mod frame;
pub mod ids;
pub mod values;
