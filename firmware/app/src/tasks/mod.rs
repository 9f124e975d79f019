//! The tasks: each owns its peripheral and calls one body of `hums_onboard`. Their urgency is in `executors`.

pub(crate) mod downlink;
pub(crate) mod monitor;
pub(crate) mod reception;
pub(crate) mod storage;
pub(crate) mod uplink;
pub(crate) mod usb;
