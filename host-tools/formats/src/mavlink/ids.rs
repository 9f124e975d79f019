//! Ids of messages that the host tools look at one by one.

macro_rules! ids {
    ($($name:ident $id:literal;)*) => {
        $(#[doc = concat!("`", stringify!($name), "`")] pub const $name: u32 = $id;)*

        #[cfg(test)]
        const ALL: &[(&str, u32)] = &[$((stringify!($name), $name),)*];
    };
}

ids! {
    HEARTBEAT 0;
    SYSTEM_TIME 2;
    PARAM_REQUEST_READ 20;
    PARAM_REQUEST_LIST 21;
    PARAM_VALUE 22;
    PARAM_SET 23;
    NAV_CONTROLLER_OUTPUT 62;
    RC_CHANNELS 65;
    COMMAND_ACK 77;
    ATTITUDE_TARGET 83;
    POSITION_TARGET_LOCAL_NED 85;
    POSITION_TARGET_GLOBAL_INT 87;
    FILE_TRANSFER_PROTOCOL 110;
    AUTOPILOT_VERSION 148;
    WIND 168;
    WIND_COV 231;
    NAMED_VALUE_FLOAT 251;
    NAMED_VALUE_INT 252;
    STATUSTEXT 253;
    EVENT 410;
    SETUP_SIGNING 256;
    ACTUATOR_OUTPUT_STATUS 375;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_the_dialects() {
        for (name, id) in ALL {
            assert_eq!(hums_dialect::message(*id).map(|message| message.name), Some(*name));
        }
    }
}
