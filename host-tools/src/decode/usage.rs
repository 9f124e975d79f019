//! The names of usage counters, with their units, by the number that a log stores.

use hums_core::usage::{CounterName, counter_name};

/// The name of a counter, for instance `flight_time_s` or `motor0_run_time_s`; `counter_123` where this program does
/// not know it.
pub fn name(number: u8) -> String {
    match counter_name(number) {
        Some(CounterName::Vehicle(name)) => name.to_owned(),
        Some(CounterName::Motor(name, motor)) => format!("motor{motor}_{name}"),
        None => format!("counter_{number}"),
    }
}
