//! Commands (`MAV_CMD`) that the box takes or sends, by their names in MAVLink's definitions. Their results
//! (`MAV_RESULT`) are constants of [`CommandAck`](hums_core::observation::CommandAck).

/// Restarts a component. The box takes only [`REBOOT_TO_MASS_STORAGE`].
pub const PREFLIGHT_REBOOT_SHUTDOWN: u16 = 246;
/// The action of a restart as a card reader, in ArduPilot's numbering.
pub const REBOOT_TO_MASS_STORAGE: u32 = 5;
/// Reports the obstacles to a flight.
pub const RUN_PREARM_CHECKS: u16 = 401;
/// Sends a message at an interval.
pub const SET_MESSAGE_INTERVAL: u16 = 511;
/// Sends a message once.
pub const REQUEST_MESSAGE: u16 = 512;
/// The older command for `PROTOCOL_VERSION`.
pub const REQUEST_PROTOCOL_VERSION: u16 = 519;
/// The older command for `AUTOPILOT_VERSION`.
pub const REQUEST_AUTOPILOT_CAPABILITIES: u16 = 520;
/// Formats a card.
pub const STORAGE_FORMAT: u16 = 526;
/// Records again.
pub const LOGGING_START: u16 = 2510;
/// Ends the record.
pub const LOGGING_STOP: u16 = 2511;
/// `USER_1`, the box's own: a part was replaced.
pub const USER_1_REPLACED: u16 = 31_010;
/// `USER_2`, the box's own: cancels the protective action.
pub const USER_2_CANCEL: u16 = 31_011;
