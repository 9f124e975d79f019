//! What PX4's events mean (`EVENT`, 410). Source: names, argument types and enumerations of PX4's public event definitions
//! (`events/all_events.json` of a build of v1.17, BSD-3-Clause).
//!
//! An event's number is its component, 1 for the autopilot, in the highest byte, and the FNV-1a hash of its name in the three others.
//! So a name gives its number here, while the firmware is built, and stays the same for all versions that keep the name.

use crate::bytes::fnv1a;
use crate::cause::{Alert, Cause, Meaning};

/// The autopilot's component in the number of an event.
const AUTOPILOT: u32 = 1 << 24;

/// The number of an event of the autopilot, by its name.
const fn number(name: &str) -> u32 {
    AUTOPILOT | fnv1a(name) & 0x00FF_FFFF
}

/// What an event means.
#[derive(Clone, Copy, Debug)]
enum Says {
    /// Always this.
    Is(Meaning),
    /// A failsafe whose cause is this byte of the arguments (`failsafe_cause_t`).
    Failsafe(u8),
    /// A sensor that is left for another one; which, says the first byte (`sensor_type_t`).
    Failover,
}

const fn warn(name: &'static str, cause: Cause) -> Row {
    (name, Says::Is(Meaning::Wrong(Alert::warning(cause))))
}

const fn act(name: &'static str, cause: Cause) -> Row {
    (name, Says::Is(Meaning::Wrong(Alert::critical(cause))))
}

const fn over(name: &'static str, cause: Cause) -> Row {
    (name, Says::Is(Meaning::Wrong(Alert::over(cause))))
}

/// Severe in its own words, and nothing that is wrong with the vehicle.
const fn fine(name: &'static str) -> Row {
    (name, Says::Is(Meaning::Fine))
}

type Row = (&'static str, Says);

const EVENTS: &[Row] = &[
    ("sensor_failover", Says::Failover),
    warn("sensor_failover_mag", Cause::Compass),
    warn("sensor_failover_baro", Cause::Barometer),
    warn("check_accel_missing", Cause::Accelerometer),
    warn("check_accel_no_data", Cause::Accelerometer),
    warn("check_imu_accel_inconsistent", Cause::Accelerometer),
    warn("check_estimator_high_accel_bias", Cause::Accelerometer),
    warn("check_gyro_missing", Cause::Gyro),
    warn("check_gyro_no_data", Cause::Gyro),
    warn("check_imu_gyro_inconsistent", Cause::Gyro),
    warn("check_estimator_high_gyro_bias", Cause::Gyro),
    warn("check_mag_missing", Cause::Compass),
    warn("check_mag_no_data", Cause::Compass),
    warn("check_mag_fault", Cause::Compass),
    warn("check_mag_consistency", Cause::Compass),
    warn("check_mag_sys_has_mag_missing", Cause::Compass),
    warn("check_estimator_mag_fault", Cause::Compass),
    warn("check_estimator_mag_interference", Cause::Compass),
    warn("check_baro_missing", Cause::Barometer),
    warn("check_baro_no_data", Cause::Barometer),
    warn("check_airspeed_invalid", Cause::Airspeed),
    warn("check_airspeed_no_data", Cause::Airspeed),
    warn("check_airspeed_too_high", Cause::Airspeed),
    warn("airspeed_selector_sensor_failure", Cause::Airspeed),
    warn("airspeed_selector_estimation_invalid", Cause::Airspeed),
    warn("airspeed_selector_switch", Cause::Airspeed),
    warn("check_estimator_gnss_fault", Cause::Gnss),
    warn("check_estimator_gnss_fusion_stopped", Cause::Gnss),
    act("check_estimator_gnss_warning_jamming", Cause::Gnss),
    act("check_estimator_gnss_warning_spoofing", Cause::Gnss),
    act("check_estimator_gps_jamming_critical", Cause::Gnss),
    act("check_estimator_gps_jammed", Cause::Gnss),
    act("check_estimator_gps_spoofed", Cause::Gnss),
    warn("check_estimator_gps_fix_too_low", Cause::Gnss),
    warn("check_estimator_gps_generic", Cause::Gnss),
    warn("check_estimator_gps_not_fusing", Cause::Gnss),
    warn("check_estimator_gps_num_sats_too_low", Cause::Gnss),
    warn("check_estimator_gps_pdop_too_high", Cause::Gnss),
    warn("check_estimator_gps_speed_acc_too_low", Cause::Gnss),
    warn("check_estimator_gps_hor_pos_drift_too_high", Cause::Gnss),
    warn("check_estimator_gps_hor_pos_err_too_high", Cause::Gnss),
    warn("check_estimator_gps_hor_speed_drift_too_high", Cause::Gnss),
    warn("check_estimator_gps_vert_pos_drift_too_high", Cause::Gnss),
    warn("check_estimator_gps_vert_pos_err_too_high", Cause::Gnss),
    warn("check_estimator_gps_vert_speed_drift_too_high", Cause::Gnss),
    warn("check_estimator_heading_not_stable", Cause::Estimator),
    warn("check_estimator_hgt_not_stable", Cause::Estimator),
    warn("check_estimator_hor_pos_not_stable", Cause::Estimator),
    warn("check_estimator_hor_vel_not_stable", Cause::Estimator),
    warn("check_estimator_vert_vel_not_stable", Cause::Estimator),
    warn("check_estimator_low_position_accuracy", Cause::Estimator),
    warn("check_estimator_position_failure_imminent", Cause::Estimator),
    act("check_failure_detector_roll", Cause::Attitude),
    act("check_failure_detector_pitch", Cause::Attitude),
    act("check_failure_detector_alt", Cause::Attitude),
    act("check_failure_detector_motor", Cause::Propulsion),
    warn("check_failure_detector_imbalanced_prop", Cause::Propulsion),
    warn("check_failure_detector_arm_esc", Cause::Propulsion),
    warn("check_escs_fault", Cause::Propulsion),
    warn("check_escs_offline", Cause::Propulsion),
    warn("check_escs_telem_missing", Cause::Propulsion),
    warn("check_vtol_fixed_wing_system_failure", Cause::Propulsion),
    warn("check_battery_low", Cause::Power),
    warn("check_battery_rem_flight_time_low", Cause::Power),
    act("check_battery_critical", Cause::Power),
    act("check_battery_emergency", Cause::Power),
    warn("check_battery_disconnected", Cause::Power),
    warn("check_battery_fault", Cause::Power),
    warn("check_battery_unhealthy", Cause::Power),
    warn("check_avionics_power_low", Cause::Power),
    warn("check_avionics_power_high", Cause::Power),
    warn("check_power_oc_hipower", Cause::Power),
    warn("check_power_oc_periph", Cause::Power),
    warn("check_power_oc_report", Cause::Power),
    act("commander_low_bat_shutdown", Cause::Power),
    act("commander_low_bat_shutdown_failed", Cause::Power),
    warn("commander_failsafe_enter_low_bat", Cause::Power),
    warn("commander_failsafe_enter_low_flight_time_warn", Cause::Power),
    act("commander_failsafe_enter_crit_bat_warn", Cause::Power),
    act("commander_failsafe_enter_crit_low_bat_warn", Cause::Power),
    warn("commander_rc_lost", Cause::RemoteControl),
    over("commander_rc_regained", Cause::RemoteControl),
    over("commander_dl_regained", Cause::GroundStation),
    over("check_estimator_gnss_fusion_started", Cause::Gnss),
    warn("commander_gcs_lost", Cause::GroundStation),
    warn("commander_mission_comp_lost", Cause::GroundStation),
    warn("commander_high_latency_lost", Cause::GroundStation),
    ("commander_failsafe_enter", Says::Failsafe(5)),
    ("commander_failsafe_enter_hold", Says::Failsafe(7)),
    ("commander_failsafe_enter_warn", Says::Failsafe(4)),
    warn("commander_failsafe_enter_generic", Cause::Failsafe),
    warn("commander_failsafe_enter_generic_hold", Cause::Failsafe),
    warn("commander_failsafe_enter_generic_warn", Cause::Failsafe),
    warn("commander_failsafe_enter_autopilot_disengaged", Cause::Failsafe),
    warn("vehicle_imu_accel_clipping", Cause::Vibration),
    warn("vehicle_imu_gyro_clipping", Cause::Vibration),
    warn("check_gf_violation_custom_gf", Cause::Fence),
    warn("check_gf_violation_max_alt", Cause::Fence),
    warn("check_gf_violation_max_hor_dist", Cause::Fence),
    warn("check_distance_sensor_invalid", Cause::Ranging),
    warn("check_distance_sensor_missing", Cause::Ranging),
    warn("check_optical_flow_sensor_invalid", Cause::Ranging),
    warn("check_optical_sensor_missing", Cause::Ranging),
    warn("navigator_terrain_collision_risk", Cause::Terrain),
    warn("check_missing_fmu_sdcard", Cause::Logging),
    warn("logger_storage_full", Cause::Logging),
    warn("check_cpuload_too_high", Cause::Processor),
    warn("check_ram_usage_too_high", Cause::Processor),
    act("vtol_att_ctrl_quadchute_alt_loss", Cause::Crash),
    act("vtol_att_ctrl_quadchute_max_pitch", Cause::Crash),
    act("vtol_att_ctrl_quadchute_max_roll", Cause::Crash),
    act("vtol_att_ctrl_quadchute_min_alt", Cause::Crash),
    act("vtol_att_ctrl_quadchute_tout", Cause::Crash),
    act("vtol_att_ctrl_quadchute_trans_alt_err", Cause::Crash),
    // Also of a pilot's kill switch, after a landing too: HEARTBEAT says the same, and whether that matters is seen there.
    fine("check_system_flight_term_active"),
    fine("commander_kill_sw_engaged"),
    // Which mode may not be flown now, and why arming is refused: not that anything broke.
    fine("check_modes_angular_velocity"),
    fine("check_modes_attitude"),
    fine("check_modes_global_pos"),
    fine("check_modes_local_alt"),
    fine("check_modes_local_pos"),
    fine("check_modes_manual_control"),
    fine("check_modes_mission"),
    fine("check_modes_offboard_signal"),
    fine("check_modes_home_position"),
    fine("check_modes_cannot_takeoff"),
    fine("check_rc_dl_no_dllink"),
    fine("check_system_usb_connected"),
    fine("check_man_control_rtl_engaged"),
    fine("check_external_modes_unavailable"),
    fine("commander_arming_check_summary"),
    fine("commander_health_summary"),
    fine("commander_modeswitch_not_avail"),
    fine("commander_disarm_denied_not_landed"),
    fine("commander_arm_denied_calibrating"),
    fine("commander_arm_denied_not_manual"),
    fine("commander_arm_denied_resolve_failures"),
    fine("commander_arm_denied_throttle_center"),
    fine("commander_arm_denied_throttle_high"),
    fine("mavlink_log_not_enough_bw"),
];

/// The same by their numbers, worked out while the firmware is built: it holds no names.
static NUMBERED: [(u32, Says); EVENTS.len()] = {
    let mut numbered = [(0, Says::Is(Meaning::Fine)); EVENTS.len()];
    let mut row = 0;
    while row < EVENTS.len() {
        numbered[row] = (number(EVENTS[row].0), EVENTS[row].1);
        row += 1;
    }
    numbered
};

/// The name of an event, where it is in the table.
pub fn name(id: u32) -> Option<&'static str> {
    EVENTS.iter().map(|(name, _)| *name).find(|name| number(name) == id)
}

/// What an event means.
pub(super) fn meaning(id: u32, arguments: &[u8]) -> Meaning {
    let argument = |at: u8| arguments.get(usize::from(at)).copied().unwrap_or_default();
    let Some((_, says)) = NUMBERED.iter().find(|(known, _)| *known == id) else { return Meaning::Unknown };
    Meaning::Wrong(match says {
        Says::Is(meaning) => return *meaning,
        Says::Failsafe(at) => match argument(*at) {
            1 => Alert::warning(Cause::RemoteControl),
            2 => Alert::warning(Cause::GroundStation),
            3 | 6 => Alert::warning(Cause::Power),
            4 | 5 => Alert::critical(Cause::Power),
            _ => Alert::warning(Cause::Failsafe),
        },
        Says::Failover => match argument(0) {
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
        // From all_events.json.
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
