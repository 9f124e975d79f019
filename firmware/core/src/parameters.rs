//! The parameter table: every limit and setting, in one place, with unit, default, range and source. Names are those
//! that a ground station shows (at most 16 characters); a limit that is NaN is off.

/// A parameter without its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParamSpec {
    /// At most 16 characters: what `PARAM_VALUE` carries.
    pub name: &'static str,
    /// Used until it is set.
    pub default: f32,
    /// The smallest value that is accepted.
    pub min: f32,
    /// The largest value that is accepted.
    pub max: f32,
}

/// The words of a parameter for people. They are apart so that the firmware does not link them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParamWords {
    /// The unit of value, default and range.
    pub unit: &'static str,
    /// A description in a few words; empty for the limit of one check, which the check's name describes.
    pub what: &'static str,
    /// The meanings of its values from 0; empty for quantities.
    pub options: &'static [&'static str],
    /// Details, and the source of the default.
    pub source: &'static str,
}

macro_rules! params {
    ($($variant:ident $name:tt $unit:literal $default:literal $min:literal $max:literal $source:literal
       $(is $($what:literal)+)? $(of $($option:literal)|+)?;)*) => {
        /// A parameter; its number is its index in [`TABLE`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum Param {
            $(#[doc = concat!($source, ".")] $variant,)*
        }

        impl Param {
            /// All of them, by their number.
            pub const ALL: [Self; TABLE.len()] = [$(Self::$variant,)*];
        }

        /// All parameters, in the order of [`Param`].
        pub const TABLE: &[ParamSpec] = &[
            $(ParamSpec {
                name: $name, default: $default, min: $min, max: $max,
            },)*
        ];

        /// What people read of all parameters, in the same order.
        pub const WORDS: &[ParamWords] = &[$(ParamWords {
            unit: $unit,
            what: concat!($($($what),+)?),
            options: &[$($($option,)+)?],
            source: $source,
        },)*];

        /// The values of all parameters, and which of them are still to be saved.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Params {
            values: [f32; TABLE.len()],
            /// A bit each.
            unsaved: [u32; TABLE.len().div_ceil(32)],
        }

        impl Params {
            /// All defaults, which need not be saved.
            pub const fn defaults() -> Self {
                Self { values: [$($default,)*], unsaved: [0; TABLE.len().div_ceil(32)] }
            }
        }
    };
}

/// The parameters, with the same six of each part that wears (`CMP1_KIND` and so on) between the others.
macro_rules! with_parts {
    (
        { $($before:tt)* }
        parts { $($n:literal $kind:ident $number:ident $hours:ident $flights:ident $cycles:ident $motor_hours:ident;)* }
        { $($after:tt)* }
    ) => {
        params! {
            $($before)*
            $(
                $kind (concat!("CMP", $n, "_KIND")) "" 0.0 0.0 8.0 "docs/usage.md" is "Part " $n ": kind" of "none" | "airframe" | "battery" | "motor" | "propeller" | "ESC" | "card" | "engine" | "other";
                $number (concat!("CMP", $n, "_NUMBER")) "" 0.0 0.0 12.0 "which battery or motor, from 1; 0: all" is "Part " $n ": number";
                $hours (concat!("CMP", $n, "_HOURS")) "h" 0.0 0.0 100_000.0 "limit of hours in the air (card, other: powered); 0: none" is "Part " $n ": life in hours";
                $flights (concat!("CMP", $n, "_FLIGHTS")) "" 0.0 0.0 1_000_000.0 "limit of flights; 0: none" is "Part " $n ": life in flights";
                $cycles (concat!("CMP", $n, "_CYCLES")) "" 0.0 0.0 100_000.0 "limit of full battery discharges; 0: none" is "Part " $n ": life in battery cycles";
                $motor_hours (concat!("CMP", $n, "_MOT_HOURS")) "h" 0.0 0.0 100_000.0 "limit of hours that the motor turned; 0: none" is "Part " $n ": life in motor hours";
            )*
            $($after)*
        }
    };
}

with_parts! {
{
    BatRemWarn "BAT_REM_WARN" "%" 15.0 0.0 100.0 "PX4 commander, COM_LOW_BAT (BAT_LOW_THR 15 %)";
    BatRemCrit "BAT_REM_CRIT" "%" 7.0 0.0 100.0 "PX4 commander, BAT_CRIT_THR 7 %";
    BatCells "BAT_CELLS" "" 0.0 0.0 24.0 "0: from messages, the autopilot's parameters, or the voltage at rest if only one count fits it" is "Cells of a battery in series";
    CellVoltWarn "CELL_VOLT_WARN" "V" 3.6 0.0 4.5 "common LiPo practice";
    CellVoltCrit "CELL_VOLT_CRIT" "V" 3.5 0.0 4.5 "common LiPo practice";
    CellDevWarn "CELL_DEV_WARN" "V" 0.07 0.0 2.0 "AirData: 0.07 V for 10 s" is "Battery cell balance: warning above; critical where it lasts for a minute";
    CellDevCrit "CELL_DEV_CRIT" "V" 0.15 0.0 2.0 "AirData: 0.15 V for 10 s";
    BatTempWarn "BAT_TEMP_WARN" "degC" 60.0 0.0 150.0 "battery vendors";
    BatTempCrit "BAT_TEMP_CRIT" "degC" 75.0 0.0 150.0 "battery vendors";
    RailLowWarn "RAIL_LOW_WARN" "V" 4.8 0.0 6.0 "PX4 power check";
    RailLowCrit "RAIL_LOW_CRIT" "V" 4.5 0.0 6.0 "PX4 power check";
    RailHighWarn "RAIL_HIGH_WARN" "V" 5.4 0.0 6.0 "PX4 power check";
    EscAgeWarn "ESC_AGE_WARN" "s" 0.3 0.05 60.0 "PX4 ESC telemetry timeout 300 ms";
    EscAgeCrit "ESC_AGE_CRIT" "s" 2.0 0.05 60.0 "ESC telemetry silent for good";
    EscTempWarn "ESC_TEMP_WARN" "degC" 90.0 0.0 200.0 "ESC vendors";
    EscTempCrit "ESC_TEMP_CRIT" "degC" 110.0 0.0 200.0 "ESC vendors";
    MotImbalWarn "MOT_IMBAL_WARN" "%" 15.0 1.0 100.0 "LogHat; PX4 imbalanced propeller metric";
    MotImbalCrit "MOT_IMBAL_CRIT" "%" 30.0 1.0 100.0 "LogHat; PX4 imbalanced propeller metric 30";
    VibeWarn "VIBE_WARN" "m/s2" 30.0 0.0 500.0 "ArduPilot vibration guide" is "Vibration of an ArduPilot: warning above";
    VibeCrit "VIBE_CRIT" "m/s2" 60.0 0.0 500.0 "ArduPilot vibration guide" is "Vibration of an ArduPilot: critical above";
    VibePx4Warn "VIBE_PX4_WARN" "m/s2" 4.905 0.0 500.0 "PX4 Flight Review: accelerometer metric, yellow" is "Vibration of a PX4: warning above";
    VibePx4Crit "VIBE_PX4_CRIT" "m/s2" 9.81 0.0 500.0 "PX4 Flight Review: accelerometer metric, red" is "Vibration of a PX4: critical above";
    ClipWarn "CLIP_WARN" "" 10.0 1.0 100_000.0 "samples without ten calm seconds between: one or a few are a gust or a touch";
    ClipCrit "CLIP_CRIT" "" 100.0 1.0 100_000.0 "ArduPilot vibration guide: more than 100";
    LoadFacWarn "LOAD_FAC_WARN" "g" 3.8 1.0 20.0 "by airframe; the limit of CS-23 for the normal category";
    LoadFacCrit "LOAD_FAC_CRIT" "g" 4.4 1.0 20.0 "by airframe; the limit of CS-23 for the utility category";
    EkfVarWarn "EKF_VAR_WARN" "" 0.8 0.0 10.0 "ArduPilot FS_EKF_THRESH 0.8: above it an innovation is not believed" is "Estimator variance, that of the compass too: warning above";
    EkfVarCrit "EKF_VAR_CRIT" "" 0.8 0.0 10.0 "ArduPilot FS_EKF_THRESH 0.8 on two of three";
    EkfRatioWarn "EKF_RATIO_WARN" "" 0.5 0.0 10.0 "PX4 innovation test ratio, half way" is "Estimator test ratio, that of the compass too: warning above";
    EkfRatioCrit "EKF_RATIO_CRIT" "" 1.0 0.0 10.0 "PX4: a ratio above 1 rejects the sensor" is "Estimator test ratio, that of the compass too: critical above";
    GpsSatsWarn "GPS_SATS_WARN" "" 6.0 0.0 60.0 "PX4 EKF2_REQ_NSATS 6, the least before a takeoff";
    GpsHdopWarn "GPS_HDOP_WARN" "" 3.0 0.0 50.0 "receivers with a 3D fix and 7 to 9 satellites report up to 2.9";
    GpsHaccWarn "GPS_HACC_WARN" "m" 3.0 0.0 100.0 "PX4 EKF2_REQ_EPH 3 m";
    GpsFixCrit "GPS_FIX_CRIT" "" 3.0 0.0 6.0 "less than a 3D fix in flight";
    LinkAgeWarn "LINK_AGE_WARN" "s" 3.5 0.5 60.0 "ArduPilot sends none for up to 3 s while it calibrates at its start";
    LinkAgeCrit "LINK_AGE_CRIT" "s" 5.0 0.5 60.0 "MAVLink heartbeat protocol: 4 to 5 missed";
    LinkLossWarn "LINK_LOSS_WARN" "%" 2.0 0.0 100.0 "frames lost on the autopilot's port";
    LinkLossCrit "LINK_LOSS_CRIT" "%" 5.0 0.0 100.0 "frames lost on the autopilot's port";
    RcRssiWarn "RC_RSSI_WARN" "" 0.0 0.0 254.0 "device scale; 0 is off";
    RcRssiCrit "RC_RSSI_CRIT" "" 0.0 0.0 254.0 "device scale; 0 is off";
    RadioMargWarn "RADIO_MARG_WARN" "" 10.0 0.0 254.0 "SiK radio: rssi above noise, device scale";
    CpuLoadWarn "CPU_LOAD_WARN" "%" 80.0 0.0 100.0 "PX4 CPU check";
    CpuLoadCrit "CPU_LOAD_CRIT" "%" 95.0 0.0 100.0 "PX4 CPU check";
    McuTempWarn "MCU_TEMP_WARN" "degC" 85.0 0.0 150.0 "PX4; STM32 ambient limit";
    McuTempCrit "MCU_TEMP_CRIT" "degC" 100.0 0.0 150.0 "PX4; STM32 junction limit 105";
    TiltWarn "TILT_WARN" "deg" 45.0 0.0 180.0 "PX4 failure detector FD_FAIL_R, FD_FAIL_P 60" is "Unwanted roll and pitch angle: warning above";
    TiltCrit "TILT_CRIT" "deg" 60.0 0.0 180.0 "PX4 failure detector FD_FAIL_R, FD_FAIL_P 60" is "Unwanted roll and pitch angle: critical above";
    RecQueueWarn "REC_QUEUE_WARN" "%" 50.0 0.0 100.0 "half of the queue, which fills while a card pauses";
    RecQueueCrit "REC_QUEUE_CRIT" "%" 90.0 0.0 100.0 "frames are lost next";
    RecStopWarn "REC_STOP_WARN" "" 0.5 0.0 3.0 "1: not recording";
    RecStopCrit "REC_STOP_CRIT" "" 1.5 0.0 3.0 "2: not recording while armed (PX4#12565, ardupilot#6863)";
    RecLostWarn "REC_LOST_WARN" "frames" 0.5 0.0 1_000_000.0 "any frame lost in the last ten seconds";
    EscFailWarn "ESC_FAIL_WARN" "" 0.5 0.0 3.0 "1: any ESC failure flag";
    EscFailCrit "ESC_FAIL_CRIT" "" 1.5 0.0 3.0 "2: motor stuck, or the ESC failed";
    EngChtWarn "ENG_CHT_WARN" "degC" 2000.0 0.0 2000.0 "by engine; off until set";
    EngChtCrit "ENG_CHT_CRIT" "degC" 2000.0 0.0 2000.0 "by engine; off until set";
    EngEgtWarn "ENG_EGT_WARN" "degC" 2000.0 0.0 2000.0 "by engine; off until set";
    EngEgtCrit "ENG_EGT_CRIT" "degC" 2000.0 0.0 2000.0 "by engine; off until set";
    EngFuelWarn "ENG_FUEL_WARN" "hPa" 0.0 0.0 20_000.0 "by engine; off until set";
    EngFuelCrit "ENG_FUEL_CRIT" "hPa" 0.0 0.0 20_000.0 "by engine; off until set";
    GpsJamWarn "GPS_JAM_WARN" "" 1.5 0.0 4.0 "GNSS_INTEGRITY: 2 is mitigated" is "GPS spoofing: warning above this state";
    GpsJamCrit "GPS_JAM_CRIT" "" 2.5 0.0 4.0 "GNSS_INTEGRITY: 3 is detected" is "GPS jamming and spoofing: critical above this state";
    Latch "HEALTH_LATCH" "" 0.0 0.0 1.0 "no: a warning ends when its value is good again" is "Warnings stay until the vehicle disarms" of "no" | "yes";
    BatResWarn "BAT_RES_WARN" "%" 30.0 0.0 1000.0 "LogHat: internal resistance above its baseline";
    BatResCrit "BAT_RES_CRIT" "%" 60.0 0.0 1000.0 "LogHat: internal resistance above its baseline";
    BatFaultWarn "BAT_FAULT_WARN" "" 0.5 0.0 32.0 "any MAV_BATTERY_FAULT bit";
    EscErrWarn "ESC_ERR_WARN" "1/min" 10.0 0.0 100_000.0 "ESC_INFO error count, rising";
    MotLossCrit "MOT_LOSS_CRIT" "%" 10.0 0.0 100.0 "PX4 motor failure check: near-zero current above 0.2 throttle";
    RadioRssiWarn "RADIO_RSSI_WARN" "" 0.0 0.0 254.0 "device scale; 0 is off";
    RebootCrit "AP_REBOOT_CRIT" "" 0.5 0.0 100.0 "1: the autopilot restarted within 30 s";
    StateCrit "AP_STATE_CRIT" "" 4.5 0.0 10.0 "MAV_STATE: 5 is critical, 6 emergency";
    AlertWarn "AP_ALERT_WARN" "" 0.5 0.0 3.0 "1: the autopilot reports a fault" is "Alerts of the autopilot: warning above this state";
    AlertCrit "AP_ALERT_CRIT" "" 1.5 0.0 3.0 "2: the autopilot reports a fault that needs action at once" is "Alerts of the autopilot: critical above this state";
    HardLanding "HARD_LANDING" "m/s" 2.0 0.1 20.0 "four times ArduPilot's LAND_SPEED of 0.5 m/s" is "Sink rate from which a landing counts as hard";
    BatCapacity "BAT_CAPACITY" "Ah" 0.0 0.0 1000.0 "of all batteries together, for counting cycles; 0: as the autopilot has it (BATT_CAPACITY, BAT1_CAPACITY)" is "Capacity of all batteries together";
    GsBudget "GS_BUDGET" "B/s" 2000.0 100.0 5000.0 "a 57,600 baud radio shared with its own overhead" is "Limit of bytes to the ground station in a second";
    TrdVibeWarn "TRD_VIBE_WARN" "%" 30.0 0.0 10_000.0 "steady vibration above or below its baseline, of real cut propellers 35 below; off from 10,000" is "Steady vibration against earlier flights: warning above";
    TrdVibeCrit "TRD_VIBE_CRIT" "%" 150.0 0.0 10_000.0 "steady vibration above or below its baseline" is "Steady vibration against earlier flights: critical above";
    TrdThrWarn "TRD_THR_WARN" "%" 3.0 0.0 10_000.0 "hover throttle above its baseline: heavier, or less thrust; real propellers cut by 10 mm and more 10 to 20, by 5 mm 2 to 4" is "Hover throttle and power against earlier flights: warning above";
    TrdThrCrit "TRD_THR_CRIT" "%" 20.0 0.0 10_000.0 "hover throttle above its baseline" is "Hover throttle and power against earlier flights: critical above";
    TrdEscWarn "TRD_ESC_WARN" "%" 5.0 0.0 100.0 "LogHat: a motor's speed against the others, from its baseline" is "Balance of motors against earlier flights: warning above";
    TrdEscCrit "TRD_ESC_CRIT" "%" 15.0 0.0 100.0 "a motor's speed against the others, from its baseline" is "Balance of motors against earlier flights: critical above";
    ProtAction "PROT_ACTION" "" 0.0 0.0 2.0 "MAV_CMD 20 and 21, announced first; see docs/safety.md" is "Protective action that the autopilot is asked for" of "nothing" | "return" | "land";
    ProtCheck "PROT_CHECK" "" 0.0 0.0 9.0 "0: low battery alone; else any check of the subsystem" is "Subsystem whose critical finding starts the protective action" of "empty battery" | "power" | "propulsion" | "engine" | "structure" | "navigation" | "link" | "computer" | "attitude" | "recorder";
    ProtDelay "PROT_DELAY" "s" 10.0 0.0 120.0 "the time in which the pilot can cancel" is "Time from the announcement to the request";
    RecStallWarn "REC_STALL_WARN" "ms" 500.0 0.0 60_000.0 "SD cards: 250 ms are allowed, 2.5 s were seen (PX4#15596)";
    RecStallCrit "REC_STALL_CRIT" "ms" 2_500.0 0.0 60_000.0 "the queue lasts for so long at full rate";
    RecErrWarn "REC_ERR_WARN" "" 0.5 0.0 1_000_000.0 "any block write that the card refused in the last ten seconds";
    RecRoomWarn "REC_ROOM_WARN" "%" 10.0 0.0 100.0 "of the card are left for logs: other files fill it";
    RecRoomCrit "REC_ROOM_CRIT" "%" 1.0 0.0 100.0 "of the card are left for logs: other files fill it";
    CompYellow "CMP_YELLOW" "%" 90.0 1.0 1000.0 "of the limit that is reached first: soon due" is "A part's life used: warning above";
    CompRed "CMP_RED" "%" 100.0 1.0 1000.0 "of the limit that is reached first: due" is "A part's life used: critical above";
}

parts {
    1 Cmp1Kind Cmp1Number Cmp1Hours Cmp1Flights Cmp1Cycles Cmp1MotorHours;
    2 Cmp2Kind Cmp2Number Cmp2Hours Cmp2Flights Cmp2Cycles Cmp2MotorHours;
    3 Cmp3Kind Cmp3Number Cmp3Hours Cmp3Flights Cmp3Cycles Cmp3MotorHours;
    4 Cmp4Kind Cmp4Number Cmp4Hours Cmp4Flights Cmp4Cycles Cmp4MotorHours;
    5 Cmp5Kind Cmp5Number Cmp5Hours Cmp5Flights Cmp5Cycles Cmp5MotorHours;
    6 Cmp6Kind Cmp6Number Cmp6Hours Cmp6Flights Cmp6Cycles Cmp6MotorHours;
    7 Cmp7Kind Cmp7Number Cmp7Hours Cmp7Flights Cmp7Cycles Cmp7MotorHours;
    8 Cmp8Kind Cmp8Number Cmp8Hours Cmp8Flights Cmp8Cycles Cmp8MotorHours;
}

{
    GsPath "GS_PATH" "" 1.0 0.0 2.0 "docs/companion.md" is "Where the summary for the ground station goes" of "nowhere" | "radio at the box" | "through the autopilot";
    GsBaud "GS_BAUD" "baud" 57_600.0 9_600.0 921_600.0 "what SiK radios come with" is "Rate of the ground station's port";
    GsPass "GS_PASS" "" 0.0 0.0 1.0 "the box forwards frames between ground station and autopilot" is "The radio serves the autopilot too" of "no" | "yes";
    GsSign "GS_SIGN" "" 0.0 0.0 2.0 "counts once there is a key" is "Signing at the ground station's port" of "no" | "our frames are signed" | "and unsigned requests are refused";
    ApBaud "AP_BAUD" "baud" 921_600.0 9_600.0 921_600.0 "PX4 TELEM2, ArduPilot SERIAL2 for companions" is "Rate of the autopilot's port";
    ApBudget "AP_BUDGET" "B/s" 2000.0 100.0 10_000.0 "the box's own frames, with the answers that the autopilot forwards" is "Limit of bytes to the autopilot in a second";
    ApStreams "AP_STREAMS" "" 1.0 0.0 1.0 "SET_MESSAGE_INTERVAL, REQUEST_DATA_STREAM" is "The box requests the messages of its checks from the autopilot" of "no" | "yes";
    ApSign "AP_SIGN" "" 0.0 0.0 2.0 "as GS_SIGN, for what comes through the autopilot" is "Signing at the autopilot's port" of "no" | "our frames are signed" | "and unsigned requests are refused";
    SignPort "SIGN_PORT" "" 0.0 0.0 2.0 "docs/companion.md" is "The port that may bring a key" of "none" | "ground station's" | "autopilot's";
    MisFallTime "MIS_FALL_TIME" "s" 0.3 0.1 5.0 "a fall of half a metre, below 0.3 g";
    MisImpact "MIS_IMPACT" "g" 3.0 1.5 50.0 "a shock; landings at 2 m/s and less stay below";
    MisTumble "MIS_TUMBLE" "deg/s" 300.0 60.0 3000.0 "above the rates that angle modes fly with (PX4 220, ArduPilot 200)";
    MisDisarm "MIS_DISARM_H" "m" 3.0 0.5 100.0 "height above home from which a disarming is watched";
    BatStateWarn "BAT_STATE_WARN" "" 0.5 0.0 3.0 "1: the autopilot calls it low or unhealthy, by its own thresholds";
    BatStateCrit "BAT_STATE_CRIT" "" 1.5 0.0 3.0 "2: the autopilot calls it critical, an emergency or failed";
    MisSink "MIS_SINK" "m/s" 6.0 1.0 50.0 "above the fastest descent that PX4 (4) and ArduPilot (5) can be set to";
    MisOverturn "MIS_OVERTURN" "deg" 60.0 30.0 180.0 "tilt of what carries the vehicle; of the estimator's attitude 100 degrees at least";
    AccMismWarn "ACC_MISM_WARN" "m/s2" 1.0 0.05 100.0 "accelerometers apart beyond usual; PX4 arms up to 0.7 (COM_ARM_IMU_ACC), ArduPilot up to 0.75";
    GyroMismWarn "GYRO_MISM_WARN" "rad/s" 0.1 0.01 10.0 "gyros apart beyond usual; PX4 arms up to 0.25 (COM_ARM_IMU_GYR), ArduPilot up to 0.09";
    GyroNoiseWarn "GYRO_NOISE_WARN" "rad/s" 0.5 0.01 1000.0 "PX4's gyro metric; 0.01 to 0.12 in healthy flights, 0.16 on a vehicle that shakes beyond Flight Review's red";
    MagMismWarn "MAG_MISM_WARN" "%" 40.0 1.0 1000.0 "compasses apart beyond usual, of the field; ArduPilot arms up to 200 mG, which is 40 % of it";
    BaroMismWarn "BARO_MISM_WARN" "m" 8.0 0.5 10_000.0 "barometers apart beyond usual; above what wind and motors do to one of them";
    VibeRiseWarn "VIBE_RISE_WARN" "" 2.2 1.1 1000.0 "times what is usual in this flight, on rotors";
    MotOutWarn "MOT_OUT_WARN" "%" 8.0 1.0 1000.0 "a motor's output alone above its usual share and what it varies by; healthy flights stay below 7";
    MotOutCrit "MOT_OUT_CRIT" "%" 35.0 1.0 1000.0 "a motor's output alone above its usual share: it gives two thirds of its thrust";
    StuckWarn "SENS_STUCK_WARN" "s" 1.0 0.3 1000.0 "a sensor repeats one value in flight for four times its longest repetition before" is "A sensor repeats one value: warning after";
    BaroGpsWarn "BARO_GPS_WARN" "m" 8.0 1.0 10_000.0 "barometer and GPS height apart beyond usual, a tenth of the climb and half of the dynamic pressure";
    BaroNoiseWarn "BARO_NOISE_WARN" "m" 2.0 0.2 10_000.0 "steps of the barometer's height beyond usual; noise of barometers is 0.1 to 0.3 (data sheets)";
    RateWarn "RATE_MISS_WARN" "deg/s" 30.0 5.0 1000.0 "wanted less measured body rate, over a second; healthy flights reach 12" is "Missing roll and pitch rate: warning above";
    RateCrit "RATE_MISS_CRIT" "deg/s" 60.0 5.0 1000.0 "wanted less measured body rate, over a second" is "Missing roll and pitch rate: critical above";
    ThrustWarn "THRUST_WARN" "s" 2.0 0.5 1000.0 "full throttle without a climb; ArduPilot warns of thrust loss after 1 s, and looks at the attitude too";
    EkfClimbWarn "EKF_CLIMB_WARN" "m/s" 8.0 0.5 1000.0 "estimator's climb against the barometer's, over a second; up to 6.6 in healthy real flights";
    EkfClimbCrit "EKF_CLIMB_CRIT" "m/s" 12.0 0.5 1000.0 "estimator's climb against the barometer's, over a second; 14 and 24 where height control ran away";
    GpsSpeedWarn "GPS_SPEED_WARN" "m/s" 1.0 0.1 1000.0 "a receiver's velocity against the way between its positions, over four seconds; below 1 in healthy real flights";
    TrdFalse "TRD_FALSE" "flights" 400.0 20.0 100_000.0 "`hums check` reports one false trend in so many unchanged flights; a larger number reports true ones later" is "Unchanged flights for one false trend";
    TrdCapWarn "TRD_CAP_WARN" "%" 20.0 0.0 100.0 "battery capacity below its baseline; cells are called worn out at 80 % of their capacity" is "Battery capacity against earlier flights: warning above";
    TrdCapCrit "TRD_CAP_CRIT" "%" 40.0 0.0 100.0 "battery capacity below its baseline" is "Battery capacity against earlier flights: critical above";
    GpsHeightWarn "GPS_HEIGHT_WARN" "m" 6.0 0.5 10_000.0 "a receiver's height moves within four seconds as neither climb nor barometer do; up to 5.3 in healthy real flights";
    PosAgeWarn "POS_AGE_WARN" "s" 3.0 0.5 60.0 "position messages stop in flight, while others come: some come at 1 Hz";
    MagHeadWarn "MAG_HEAD_WARN" "deg" 12.0 1.0 180.0 "the compass's heading apart from the estimator's beyond usual" is "Compass against estimated heading: warning above";
    GpsSatsFall "GPS_SATS_FALL" "%" 30.0 5.0 100.0 "satellites fewer than usual in the flight; up to 18 in healthy real flights" is "GPS satellites lost of those usual in the flight: warning above";
    GpsHdopRise "GPS_HDOP_RISE" "" 1.8 1.1 100.0 "dilution of precision times the usual one of the flight; up to 1.3 in healthy real flights" is "GPS dilution of precision times the usual one: warning above";
    Ahrs2TiltWarn "AHRS2_TILT_WARN" "deg" 30.0 1.0 180.0 "two estimators' attitudes apart; up to 22 in hard manoeuvres of healthy flights";
    Ahrs2HgtWarn "AHRS2_HGT_WARN" "m" 8.0 0.5 10_000.0 "two estimators' heights apart beyond usual; up to 3.5 in healthy real flights";
    Ahrs2HgtCrit "AHRS2_HGT_CRIT" "m" 12.0 0.5 10_000.0 "two estimators' heights apart; the autopilot may hold a wrong height";
    Ahrs2PosWarn "AHRS2_POS_WARN" "m" 10.0 0.5 10_000.0 "two estimators' positions apart beyond half a second of flight; up to 2.6 with it in healthy real flights";
    ImuGpsWarn "IMU_GPS_WARN" "m/s2" 1.0 0.1 1000.0 "measured force, turned by the attitude, less the change of GPS velocity; up to 0.4 in healthy flights of simulators" is "Measured force less change of GPS velocity: warning above";
    GenSpeedWarn "GEN_SPEED_WARN" "rpm" 0.0 0.0 65_000.0 "by generator, below its idle speed; off until set";
    GenSpeedCrit "GEN_SPEED_CRIT" "rpm" 0.0 0.0 65_000.0 "by generator, below its idle speed; off until set";
}
}

impl Param {
    /// The parameter with this name.
    pub fn find(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|param| param.spec().name == name)
    }

    /// Name, default and range.
    pub const fn spec(self) -> &'static ParamSpec {
        &TABLE[self as usize]
    }

    /// The words for people.
    pub const fn words(self) -> &'static ParamWords {
        &WORDS[self as usize]
    }
}

impl Default for Params {
    fn default() -> Self {
        Self::defaults()
    }
}

impl Params {
    /// A parameter's value.
    pub const fn get(&self, param: Param) -> f32 {
        self.values[param as usize]
    }

    /// Sets a parameter by name. After an error nothing changed.
    pub fn set(&mut self, name: &str, value: f32) -> Result<(), ParamError> {
        let param = Param::find(name).ok_or(ParamError::UnknownName)?;
        let (index, spec) = (param as usize, param.spec());
        if !(spec.min..=spec.max).contains(&value) {
            return Err(ParamError::OutOfRange { min: spec.min, max: spec.max });
        }
        // Compared bit for bit: an equal value need not be saved.
        if self.values[index].to_bits() != value.to_bits() {
            self.values[index] = value;
            self.unsaved[index / 32] |= 1 << (index % 32);
        }
        Ok(())
    }

    /// A parameter that was set and not saved since: its index in [`TABLE`], and its value.
    pub fn unsaved(&self) -> Option<(usize, &'static ParamSpec, f32)> {
        let word = self.unsaved.iter().position(|word| *word != 0)?;
        let index = word * 32 + self.unsaved[word].trailing_zeros() as usize;
        Some((index, TABLE.get(index)?, self.values[index]))
    }

    /// Marks the parameter as saved.
    pub fn saved(&mut self, index: usize) {
        if let Some(word) = self.unsaved.get_mut(index / 32) {
            *word &= !(1 << (index % 32));
        }
    }

    /// Marks all as saved: they were just read from the store.
    pub const fn all_saved(&mut self) {
        self.unsaved = [0; TABLE.len().div_ceil(32)];
    }

    /// All parameters with their values, in table order.
    pub fn iter(&self) -> impl Iterator<Item = (&'static ParamSpec, f32)> {
        TABLE.iter().zip(self.values)
    }
}

/// The reason that a parameter was not set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParamError {
    /// No parameter has this name.
    UnknownName,
    /// The value is not a number within the range.
    OutOfRange {
        /// The smallest value that is accepted.
        min: f32,
        /// The largest value that is accepted.
        max: f32,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_fits_a_param_value_and_finds_its_parameter_alone() {
        for (index, param) in Param::ALL.into_iter().enumerate() {
            let spec = param.spec();
            // The first one of a name is found.
            assert_eq!((Param::find(spec.name), param as usize), (Some(param), index));
            let is_sane = spec.name.len() <= 16 && (spec.min..=spec.max).contains(&spec.default);
            assert!(is_sane, "{}", spec.name);
        }
        assert_eq!(Param::find("bat_rem_warn"), None);
    }

    #[test]
    fn a_value_out_of_range_changes_nothing() {
        let mut params = Params::defaults();
        assert_eq!(params.set("BAT_REM_WARN", 101.0), Err(ParamError::OutOfRange { min: 0.0, max: 100.0 }));
        assert!(params.set("BAT_REM_WARN", f32::NAN).is_err());
        assert_eq!(params.set("NO_SUCH", 1.0), Err(ParamError::UnknownName));
        assert_eq!(params, Params::defaults());
        params.set("BAT_REM_WARN", 20.0).expect("in range");
        assert!((params.get(Param::BatRemWarn) - 20.0).abs() < f32::EPSILON);
    }
}
