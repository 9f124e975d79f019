//! MAVLink as the host tools read it: frames apart, and payload bytes as typed values.

pub mod frame;
pub mod ids;
pub mod values;
