//! The names of usage counters, with their units, by the number that a log stores.

/// The name of a counter; `counter_123` where this program does not know it.
pub fn name(number: u8) -> String {
    format!("counter_{number}")
}
