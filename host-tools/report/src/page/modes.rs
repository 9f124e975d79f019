//! Flight modes by their names: `HEARTBEAT.custom_mode` of `ArduPilot` and PX4.

use std::borrow::Cow;

use hums_core::observation::{Autopilot, Heartbeat};

use crate::source::{dataflash, ulog};

/// The mode in a heartbeat; its number if it has no name here.
pub fn name(heartbeat: &Heartbeat) -> Cow<'static, str> {
    let known = match heartbeat.autopilot {
        Autopilot::ArduPilot => dataflash::mode_name(heartbeat.type_number, heartbeat.mode),
        Autopilot::Px4 => ulog::mode_name(heartbeat.mode),
        Autopilot::Other => None,
    };
    known.map_or_else(|| format!("mode {}", heartbeat.mode).into(), Cow::Borrowed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mode_has_the_name_of_its_autopilot_and_vehicle() {
        let of = |autopilot, type_number, mode| {
            name(&Heartbeat { autopilot, type_number, mode, ..Heartbeat::default() }).into_owned()
        };
        assert_eq!(of(Autopilot::ArduPilot, 2, 5), "LOITER");
        assert_eq!(of(Autopilot::ArduPilot, 1, 5), "FBWA");
        assert_eq!(of(Autopilot::Px4, 2, 4 << 16 | 4 << 24), "Mission");
        assert_eq!(of(Autopilot::Px4, 2, 4 << 16 | 6 << 24), "Land");
        assert_eq!(of(Autopilot::Px4, 2, 1 << 16), "Manual");
        assert_eq!(of(Autopilot::Other, 2, 7), "mode 7");
    }
}
