//! Words of trends over flights, which no box judges.

use hums_link::vocabulary::{RadioWords, Scope, Words};

/// Name for people, part, meaning, action, input.
const fn words(
    check: &'static str,
    [name, part, meaning, action, needs]: [&'static str; 5],
    alarm: &'static str,
) -> Words {
    let said = RadioWords { check, name, part, alarm, advice: "" };
    Words { said, meaning, action, needs, scope: Scope::Stored }
}

/// Checks against earlier flights. Boxes that judged trends sent alarms.
pub static WORDS: [Words; 6] = [
    words(
        "batt_capacity",
        [
            "battery capacity",
            "battery",
            "The battery gave less charge for the voltage that it lost than in earlier flights.",
            "Replace the pack soon.",
            "charge and cell voltage of earlier flights to compare with",
        ],
        "battery # holds less|-~",
    ),
    words(
        "motor_trend",
        [
            "motor balance trend",
            "motor",
            "The motor's speed or output has changed against the others since earlier flights.",
            "Check its propeller and bearings, and what is loaded on one side.",
            "speeds or outputs of single motors in earlier flights to compare with",
        ],
        "motor # not as before|~ off",
    ),
    words(
        "throttle_trend",
        [
            "hover throttle trend",
            "",
            "Hovering took more throttle than in earlier flights, and not as more weight does.",
            "Check propellers and motors; and the weight, where power is not measured.",
            "throttle of earlier flights to compare with",
        ],
        "hover throttle up|+~",
    ),
    words(
        "power_trend",
        [
            "hover power trend",
            "",
            "Hovering took more power than in earlier flights.",
            "Check propellers, motors, bearings and weight.",
            "power of earlier flights to compare with",
        ],
        "hover power up|+~",
    ),
    words(
        "weight_trend",
        [
            "weight trend",
            "",
            "Hovering took as much more throttle and power as a heavier vehicle takes.",
            "Check the load. Without more load: check propellers and motors.",
            "throttle and power of earlier flights to compare with",
        ],
        "heavier than usual|+~",
    ),
    words(
        "vibration_trend",
        [
            "vibration trend",
            "",
            "Vibration has changed against earlier flights; a cut propeller can lower it.",
            "Check propellers, bearings and mounting.",
            "vibration of earlier flights to compare with",
        ],
        "vibration changed|by ~",
    ),
];
