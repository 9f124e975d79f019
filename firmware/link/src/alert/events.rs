//! Meanings of PX4's events (`EVENT`, 410). Source: names, argument types and enumerations of PX4's public event
//! definitions (`events/all_events.json` of a build of v1.17, BSD-3-Clause), and of v1.13 to v1.16.
//!
//! An event's number is its component, 1 for the autopilot, in the highest byte, and the FNV-1a hash of its name in
//! the three others. So a name gives its number here, while the firmware is built, and stays the same for all
//! versions that keep the name.

use hums_core::cause::{Alert, Cause};
use hums_core::fnv1a;

use super::Meaning;

/// The autopilot's component in the number of an event.
const AUTOPILOT: u32 = 1 << 24;

const fn number(name: &str) -> u32 {
    AUTOPILOT | fnv1a(name) & 0x00FF_FFFF
}

#[derive(Clone, Copy, Debug)]
enum EventMeaning {
    /// A fixed one.
    Is(Meaning),
    /// A failsafe whose cause is this byte of the arguments (`failsafe_cause_t`).
    Failsafe(u8),
    /// A sensor that is left for another one: the first byte tells which (`sensor_type_t`).
    Failover,
}

macro_rules! events {
    (fine: $($fine:ident)+; $($urgency:ident $cause:ident: $($name:ident)+;)*) => {
        const EVENTS: &[(&str, EventMeaning)] = &[
            ("sensor_failover", EventMeaning::Failover),
            ("commander_failsafe_enter", EventMeaning::Failsafe(5)),
            ("commander_failsafe_enter_hold", EventMeaning::Failsafe(7)),
            ("commander_failsafe_enter_warn", EventMeaning::Failsafe(4)),
            $($((stringify!($name), EventMeaning::Is(Meaning::Wrong(Alert::$urgency(Cause::$cause)))),)+)*
            $((stringify!($fine), EventMeaning::Is(Meaning::Fine)),)+
        ];
    };
}

events! {
    // Severe by their level, but no fault of the vehicle: a mode that may not be flown now, or an arming that is
    // refused. A flight termination is also a pilot's kill switch after a landing.
    fine:
        check_system_flight_term_active commander_kill_sw_engaged check_modes_angular_velocity
        check_modes_attitude check_modes_global_pos check_modes_local_alt check_modes_local_pos
        check_modes_manual_control check_modes_mission check_modes_offboard_signal check_modes_home_position
        check_modes_cannot_takeoff check_rc_dl_no_dllink check_system_usb_connected
        check_man_control_rtl_engaged check_external_modes_unavailable commander_arming_check_summary
        commander_health_summary commander_modeswitch_not_avail commander_disarm_denied_not_landed
        commander_arm_denied_calibrating commander_arm_denied_not_manual commander_arm_denied_resolve_failures
        commander_arm_denied_throttle_center commander_arm_denied_throttle_high mavlink_log_not_enough_bw;
    warning Compass:
        sensor_failover_mag check_mag_missing check_mag_no_data check_mag_fault check_mag_consistency
        check_mag_sys_has_mag_missing check_estimator_mag_fault check_estimator_mag_interference;
    critical Compass:
        commander_stopping_mag_use;
    warning Barometer:
        sensor_failover_baro check_baro_missing check_baro_no_data;
    warning Accelerometer:
        check_accel_missing check_accel_no_data check_imu_accel_inconsistent check_estimator_high_accel_bias;
    warning Gyro:
        check_gyro_missing check_gyro_no_data check_imu_gyro_inconsistent check_estimator_high_gyro_bias;
    warning Airspeed:
        check_airspeed_invalid check_airspeed_no_data check_airspeed_too_high airspeed_selector_sensor_failure
        airspeed_selector_estimation_invalid airspeed_selector_switch;
    warning Gnss:
        check_estimator_gnss_fault check_estimator_gnss_fusion_stopped check_estimator_gps_fix_too_low
        check_estimator_gps_generic check_estimator_gps_not_fusing check_estimator_gps_num_sats_too_low
        check_estimator_gps_pdop_too_high check_estimator_gps_speed_acc_too_low
        check_estimator_gps_hor_pos_drift_too_high check_estimator_gps_hor_pos_err_too_high
        check_estimator_gps_hor_speed_drift_too_high check_estimator_gps_vert_pos_drift_too_high
        check_estimator_gps_vert_pos_err_too_high check_estimator_gps_vert_speed_drift_too_high
        check_estimator_gps_spoofing_indicated;
    critical Gnss:
        check_estimator_gnss_warning_jamming check_estimator_gnss_warning_spoofing
        check_estimator_gps_jamming_critical check_estimator_gps_jammed check_estimator_gps_spoofed
        check_estimator_gps_multiple_spoofing_indicated commander_stopping_gnss_heading_use;
    over Gnss:
        check_estimator_gnss_fusion_started;
    warning Estimator:
        check_estimator_heading_not_stable check_estimator_hgt_not_stable check_estimator_hor_pos_not_stable
        check_estimator_hor_vel_not_stable check_estimator_vert_vel_not_stable
        check_estimator_low_position_accuracy check_estimator_position_failure_imminent;
    critical Attitude:
        check_failure_detector_roll check_failure_detector_pitch check_failure_detector_alt;
    warning Propulsion:
        check_failure_detector_imbalanced_prop check_failure_detector_arm_esc check_escs_fault
        check_escs_offline check_escs_telem_missing check_vtol_fixed_wing_system_failure;
    critical Propulsion:
        check_failure_detector_motor;
    warning Power:
        check_battery_low check_battery_rem_flight_time_low check_battery_disconnected check_battery_fault
        check_battery_unhealthy check_avionics_power_low check_avionics_power_high check_power_oc_hipower
        check_power_oc_periph check_power_oc_report commander_failsafe_enter_low_bat
        commander_failsafe_enter_low_flight_time_warn;
    critical Power:
        check_battery_critical check_battery_emergency commander_low_bat_shutdown
        commander_low_bat_shutdown_failed commander_failsafe_enter_crit_bat_warn
        commander_failsafe_enter_crit_low_bat_warn;
    warning RemoteControl:
        commander_rc_lost;
    over RemoteControl:
        commander_rc_regained;
    warning GroundStation:
        commander_gcs_lost commander_mission_comp_lost commander_high_latency_lost;
    over GroundStation:
        commander_dl_regained;
    warning Failsafe:
        commander_failsafe_enter_generic commander_failsafe_enter_generic_hold
        commander_failsafe_enter_generic_warn commander_failsafe_enter_autopilot_disengaged;
    warning Vibration:
        vehicle_imu_accel_clipping vehicle_imu_gyro_clipping;
    warning Fence:
        check_gf_violation_custom_gf check_gf_violation_max_alt check_gf_violation_max_hor_dist;
    warning Ranging:
        check_distance_sensor_invalid check_distance_sensor_missing check_optical_flow_sensor_invalid
        check_optical_sensor_missing;
    warning Terrain:
        navigator_terrain_collision_risk;
    warning Logging:
        check_missing_fmu_sdcard logger_storage_full;
    warning Processor:
        check_cpuload_too_high check_ram_usage_too_high;
    critical Crash:
        vtol_att_ctrl_quadchute_alt_loss vtol_att_ctrl_quadchute_max_pitch vtol_att_ctrl_quadchute_max_roll
        vtol_att_ctrl_quadchute_min_alt vtol_att_ctrl_quadchute_tout vtol_att_ctrl_quadchute_trans_alt_err;
}

/// By number, computed when the firmware is built: the firmware holds no names.
static NUMBERED: [(u32, EventMeaning); EVENTS.len()] = {
    let mut numbered = [(0, EventMeaning::Is(Meaning::Fine)); EVENTS.len()];
    let mut row = 0;
    while row < EVENTS.len() {
        numbered[row] = (number(EVENTS[row].0), EVENTS[row].1);
        row += 1;
    }
    numbered
};

/// The name of an event; `None` if it is not in the table.
pub fn name(id: u32) -> Option<&'static str> {
    EVENTS.iter().map(|(name, _)| *name).find(|name| number(name) == id)
}

pub(super) fn meaning(id: u32, arguments: &[u8]) -> Meaning {
    let argument = |at: u8| arguments.get(usize::from(at)).copied().unwrap_or_default();
    let Some((_, says)) = NUMBERED.iter().find(|(known, _)| *known == id) else { return Meaning::Unknown };
    Meaning::Wrong(match says {
        EventMeaning::Is(meaning) => return *meaning,
        EventMeaning::Failsafe(at) => match argument(*at) {
            1 => Alert::warning(Cause::RemoteControl),
            2 => Alert::warning(Cause::GroundStation),
            3 | 6 => Alert::warning(Cause::Power),
            4 | 5 => Alert::critical(Cause::Power),
            _ => Alert::warning(Cause::Failsafe),
        },
        EventMeaning::Failover => match argument(0) {
            0 => Alert::warning(Cause::Accelerometer),
            1 => Alert::warning(Cause::Gyro),
            _ => Alert::warning(Cause::Compass),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_events_are_those_of_the_public_definitions() {
        for (name, known) in [
            ("sensor_failover", 12_894_058),
            ("check_accel_no_data", 16_230_031),
            ("check_estimator_gps_jamming_critical", 12_780_289),
            ("commander_health_summary", 1_914_663),
        ] {
            assert_eq!(number(name), AUTOPILOT | known, "{name}");
        }
    }

    #[test]
    fn no_event_is_there_twice() {
        for (place, (id, _)) in NUMBERED.iter().enumerate() {
            assert!(NUMBERED[..place].iter().all(|(other, _)| other != id), "{}", EVENTS[place].0);
            assert_eq!(name(*id), Some(EVENTS[place].0));
        }
    }
}
