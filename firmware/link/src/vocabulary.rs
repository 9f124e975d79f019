//! The meaning of each check in words: one table for every text, page and document.
//!
//! `alarm` and `advice` are the words of a radio text ([`RadioWords`], the only ones that the firmware links). `meaning`
//! describes the fault, and `action` the remedy: on the ground, before the next flight, unless it says otherwise.
//! `needs` names the input, for reports of checks that had nothing to judge.

use core::fmt;

use hums_core::observation::Feeds;

/// The source that a check is judged from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Messages of any vehicle.
    Vehicle,
    /// Messages of ArduPilot.
    ArduPilot,
    /// Messages of PX4.
    Px4,
    /// The monitor's own place on the autopilot's wire: another place on another link tells of that link.
    Wire,
    /// The monitor's own recorder.
    Recorder,
    /// The autopilot's own alerts. Silence cannot be judged.
    Alerts,
    /// Earlier flights, or what the monitor on board has stored of parts that wear.
    Stored,
}

/// The words of a check in radio texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RadioWords {
    /// The check: [`hums_core::health::Check::name`].
    pub check: &'static str,
    /// Its name for people: the value, not the fault.
    pub name: &'static str,
    /// The part, if there are several, numbered from 1; empty if there is one.
    pub part: &'static str,
    /// The fault in a few words; `#` stands for the number of the part. After a bar: the form of the value, with `~` for the value and
    /// its unit.
    pub alarm: &'static str,
    /// The pilot's immediate action if it is critical; empty if it never is.
    pub advice: &'static str,
}

impl RadioWords {
    /// The fault of one part, counted from 0: `battery 2 (payload) low`.
    pub fn alarm_of(&self, instance: u8, feeds: Feeds) -> impl fmt::Display {
        let (alarm, _) = self.alarm.split_once('|').unwrap_or((self.alarm, ""));
        let (before, after) = alarm.split_once('#').unwrap_or((alarm, ""));
        let number = Number { instance, feeds };
        let several = !self.part.is_empty();
        fmt::from_fn(
            move |f| {
                if several { write!(f, "{before}{number}{after}") } else { f.write_str(before) }
            },
        )
    }

    /// The words before and after the value. `None` of a number without a unit, which tells a pilot nothing unless the words say its meaning.
    pub fn around_value(&self, unit: &str) -> Option<(&'static str, &'static str)> {
        match self.alarm.split_once('|') {
            Some((_, value)) => value.split_once('~'),
            None => (!unit.is_empty()).then_some(("", "")),
        }
    }

    /// The name of one part, which is counted from 0: `battery 2 cell voltage`.
    pub fn name_of(&self, instance: u8) -> impl fmt::Display {
        let Self { name, part, .. } = *self;
        let number = Number { instance, feeds: Feeds::Unsaid };
        fmt::from_fn(move |f| match name.strip_prefix(part) {
            Some(rest) if !part.is_empty() => write!(f, "{part} {number}{rest}"),
            _ => f.write_str(name),
        })
    }
}

/// The number of a part, counted from 1 as the autopilot does; for a battery also its consumer, if that is not the
/// vehicle's lift.
#[derive(Clone, Copy)]
struct Number {
    instance: u8,
    feeds: Feeds,
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = match self.feeds {
            Feeds::Vehicle | Feeds::Unsaid => "",
            Feeds::Avionics => " (avionics)",
            Feeds::Payload => " (payload)",
        };
        write!(f, "{}{of}", u16::from(self.instance) + 1)
    }
}

/// All words of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Words {
    /// The words in radio texts.
    pub said: RadioWords,
    /// The meaning, as a sentence.
    pub meaning: &'static str,
    /// The remedy, as a sentence.
    pub action: &'static str,
    /// Its input, as the end of "no …".
    pub needs: &'static str,
    /// The source that it is judged from.
    pub scope: Scope,
}

/// The words of a check.
pub fn vocabulary(check: &str) -> Option<&'static Words> {
    VOCABULARY.iter().find(|words| words.said.check == check)
}

/// The words of a check in radio texts.
pub fn said(check: &str) -> Option<RadioWords> {
    let is_of = |line: &&str| line.strip_prefix(check).is_some_and(|rest| rest.starts_with('\t'));
    let mut fields = SAID.split('\n').find(is_of)?.split('\t');
    let mut next = || fields.next();
    Some(RadioWords { check: next()?, name: next()?, part: next()?, alarm: next()?, advice: next()? })
}

macro_rules! vocabulary {
    ($($check:literal $scope:ident $name:literal, $part:literal, says $alarm:literal, $advice:literal, needs $needs:literal;
       $meaning:literal; $action:literal;)*) => {
        /// The words that the firmware links, in one text: a line for each check, and a tab between its words.
        const SAID: &str =
            concat!($($check, "\t", $name, "\t", $part, "\t", $alarm, "\t", $advice, "\n"),*);

        /// Every check, in the order of the subsystems' tables.
        pub const VOCABULARY: &[Words] = &[$(Words {
            said: RadioWords { check: $check, name: $name, part: $part, alarm: $alarm, advice: $advice },
            meaning: $meaning,
            action: $action,
            needs: $needs,
            scope: Scope::$scope,
        },)*];
    };
}

vocabulary! {
    "batt_remaining" Vehicle "battery remaining", "battery", says "battery # low", "LAND NOW", needs "battery level";
    "The battery was nearly empty."; "Land earlier, or take a fuller or larger battery.";
    "cell_voltage" Vehicle "battery cell voltage", "battery", says "battery # cell low", "LAND NOW", needs "battery voltage of a known number of cells";
    "The weakest cell was close to empty, or sagged under the load.";
    "Check the pack under load; replace it if it was charged full before the flight.";
    "cell_deviation" Vehicle "battery cell balance", "battery", says "battery # cells uneven", "LAND", needs "voltages of single cells";
    "The cells of the battery differed in voltage."; "Balance the pack; replace it if it happens again.";
    "cell_dev_lasting" Vehicle "battery cell balance, lasting", "battery", says "battery # cells uneven", "LAND", needs "voltages of single cells";
    "The cells of the battery differed in voltage for more than a minute."; "Replace the pack.";
    "batt_resistance" Stored "battery resistance", "battery", says "battery # worn|+~", "REPLACE IT", needs "voltage under a current that changes";
    "The battery's internal resistance has risen since it was new."; "Replace the pack soon.";
    "batt_fault" Vehicle "battery fault", "battery", says "battery # fault", "", needs "battery status";
    "The battery reported a fault of its own."; "Do not use the battery until its fault is known.";
    "batt_temperature" Vehicle "battery temperature", "battery", says "battery # hot", "LAND NOW", needs "battery temperature";
    "The battery was too hot."; "Let it cool before charging; look for a high load or a damaged cell.";
    "batt_state" Vehicle "battery charge state", "battery", says "autopilot: battery # low", "LAND", needs "charge state of a battery";
    "The autopilot called the battery low by its own thresholds."; "Land earlier; check the pack and the thresholds.";
    "rail_5v_low" Vehicle "5 V supply, low", "", says "5 V supply low", "LAND NOW", needs "voltage of the 5 V supply";
    "The autopilot's 5 V supply was too low: it can restart in flight.";
    "Check the power module and its wiring; take loads off the 5 V supply.";
    "rail_5v_high" Vehicle "5 V supply, high", "", says "5 V supply high", "", needs "voltage of the 5 V supply";
    "The autopilot's 5 V supply was too high: it can be damaged."; "Check the power module before the next flight.";
    "battery_due" Stored "battery life", "", says "a battery's life used|~", "REPLACE IT", needs "battery registered with the monitor on board";
    "A battery has reached the end of its life."; "Replace it, then `hums box replaced PART`.";

    "battery_alert" Alerts "autopilot's battery alert", "", says "autopilot warns: battery", "LAND", needs "texts, events or health flags of the autopilot";
    "The autopilot said that a battery or a supply was low or had failed.";
    "Read its messages of that time; check pack, power module and wiring.";

    "esc_silent" Vehicle "ESC telemetry", "ESC", says "ESC # silent", "LAND", needs "ESC telemetry";
    "The ESC of this motor stopped answering."; "Check the ESC, its wiring and its telemetry line.";
    "esc_temperature" Vehicle "ESC temperature", "ESC", says "ESC # hot", "LAND", needs "ESC temperature";
    "The ESC of this motor was too hot."; "Check its cooling, the propeller and the motor for drag.";
    "esc_failure" Vehicle "ESC failure", "ESC", says "ESC # failed", "LAND NOW", needs "failure flags of ESCs";
    "The ESC of this motor reported a failure."; "Do not fly until the ESC and the motor are checked.";
    "esc_errors" Vehicle "ESC errors", "ESC", says "ESC # errors", "", needs "error counts of ESCs";
    "The ESC of this motor counted many errors."; "Check its signal and telemetry wiring.";
    "motor_loss" Vehicle "motor current", "motor", says "motor # lost|~ of normal amps", "LAND NOW", needs "current of single motors";
    "The motor took almost no current while the others worked: it or its propeller was lost.";
    "Do not fly until motor, propeller and ESC are checked.";
    "motor_imbalance" Vehicle "motor balance", "motor", says "motor # speed differs", "LAND", needs "speeds of single motors in steady flight";
    "The motor's speed differed from the others' in steady flight.";
    "Check this arm: propeller, motor, its tilt, and the centre of gravity.";
    "motor_output" Vehicle "motor output", "motor", says "motor # weak|output +~", "LAND NOW", needs "motor outputs of 4, 6 or 8 motors, on the ground and in flight";
    "The motor was driven far harder than the others: it or its propeller gives less thrust.";
    "Do not fly until its propeller, motor and ESC are checked.";
    "motor_off" Vehicle "motor in use", "motor", says "motor # off: no output", "LAND NOW", needs "motor outputs of 6 or 8 motors, on the ground and in flight";
    "The autopilot, or a command, shut the motor down while the others carried.";
    "Do not fly until it is known what shut it down.";
    "thrust_lost" Vehicle "climb with full throttle", "", says "full throttle, no climb", "", needs "throttle and climb";
    "Full throttle did not make the vehicle climb, or a plane keep its height.";
    "Do not fly until propellers, motors, ESCs, battery and weight are checked.";
    "roll_rate" Vehicle "roll rate against what is wanted", "", says "roll does not follow", "LAND NOW", needs "body rates that the autopilot wants";
    "The vehicle did not roll as the autopilot wanted: a motor, propeller, servo or surface failed.";
    "Do not fly until motors, propellers, servos and control surfaces are checked.";
    "pitch_rate" Vehicle "pitch rate against what is wanted", "", says "pitch does not follow", "LAND NOW", needs "body rates that the autopilot wants";
    "The vehicle did not pitch as the autopilot wanted: a motor, propeller, servo or surface failed.";
    "Do not fly until motors, propellers, servos and control surfaces are checked.";
    "drive_due" Stored "life of motors, propellers, ESCs", "", says "motor/prop/ESC life used", "REPLACE IT", needs "motor, propeller or ESC registered with the monitor on board";
    "A motor, propeller or ESC has reached the end of its life."; "Replace it, then `hums box replaced PART`.";

    "drive_alert" Alerts "autopilot's motor alert", "", says "autopilot warns: motor", "LAND NOW", needs "texts, events or health flags of the autopilot";
    "The autopilot said that a motor, propeller or ESC had failed or gave too little thrust.";
    "Do not fly until motors, propellers and ESCs are checked.";

    "cylinder_head" Vehicle "cylinder head temperature", "", says "cylinder hot", "LAND", needs "engine data";
    "The engine's cylinder head was too hot."; "Check cooling and mixture before the next flight.";
    "exhaust_gas" Vehicle "exhaust gas temperature", "", says "exhaust hot", "LAND", needs "engine data";
    "The engine's exhaust gas was too hot."; "Check the mixture before the next flight.";
    "fuel_pressure" Vehicle "fuel pressure", "", says "fuel pressure low", "LAND NOW", needs "engine data";
    "The fuel pressure was too low."; "Check pump, filter and lines before the next flight.";
    "generator_speed" Vehicle "generator speed", "", says "generator speed low", "LAND", needs "generator data";
    "The generator turned too slowly: the flight may have gone on by battery alone."; "Check fuel, engine and generator before the next flight.";
    "engine_due" Stored "engine life", "", says "engine life used", "SERVICE IT", needs "engine registered with the monitor on board";
    "The engine is due for maintenance."; "Do the maintenance, then `hums box replaced PART`.";

    "vibration" ArduPilot "vibration", "", says "vibration high", "LAND BY HAND", needs "vibration levels";
    "Vibration was strong enough to disturb the autopilot's estimator (EKF).";
    "Balance propellers and motors, and check the autopilot's mounting.";
    "vibration_px4" Px4 "vibration", "", says "vibration high", "LAND BY HAND", needs "vibration metrics";
    "Vibration was strong enough to disturb the autopilot's estimator (EKF).";
    "Balance propellers and motors, and check the autopilot's mounting.";
    "vibration_rise" Vehicle "vibration rise", "", says "vibration up|~ usual", "", needs "vibration levels of what flies on rotors";
    "Vibration rose to a multiple of what it was before in the same flight.";
    "Check propellers, motor bearings and mounting before the next flight.";
    "clipping" Vehicle "accelerometer clipping", "", says "accelerometer clipping", "LAND BY HAND", needs "clipping counts";
    "The accelerometers were at the end of their range: the EKF flew partly blind.";
    "Find the source of vibration or shock, and check the mounting.";
    "load_factor" Vehicle "load factor", "", says "load factor high", "EASE OFF", needs "acceleration";
    "The airframe carried a high load: a hard manoeuvre, a shock or a landing.";
    "Inspect the airframe and the landing gear.";
    "airframe_due" Stored "airframe life", "", says "airframe life used", "SERVICE IT", needs "airframe registered with the monitor on board";
    "The airframe or a part of it is due for maintenance."; "Do the maintenance, then `hums box replaced PART`.";

    "vibration_alert" Alerts "autopilot's vibration alert", "", says "autopilot warns: vibration", "LAND BY HAND", needs "texts, events or health flags of the autopilot";
    "The autopilot said that vibration or clipping disturbed it.";
    "Balance propellers and motors, and check the autopilot's mounting.";

    "ekf_variance" ArduPilot "EKF variance", "", says "EKF doubts position or speed", "", needs "variances of the EKF that it flies by";
    "The EKF did not trust its measurements of position, height or speed."; "Look at compass, GPS and vibration at that time.";
    "ekf_failsafe" ArduPilot "EKF variance of two sensors", "", says "EKF failing", "LAND, MANUAL", needs "variances of the EKF that it flies by, of no plane";
    "The EKF did not trust two of compass, velocity and position: it could lose its position.";
    "Do not fly until compass and GPS are checked.";
    "ekf_compass" ArduPilot "EKF variance of the compass", "", says "EKF doubts compass", "", needs "compass variance of the EKF that it flies by";
    "The EKF did not trust the compass."; "Check the compass, its calibration and currents or magnets near it.";
    "ekf_test_ratio" Px4 "EKF test ratio", "", says "EKF rejects position or speed", "LAND, MANUAL", needs "EKF test ratios";
    "The EKF rejected, or nearly rejected, its measurements of position, height or speed."; "Look at compass, GPS and vibration at that time.";
    "ekf_mag_ratio" Px4 "EKF test ratio of the compass", "", says "EKF rejects compass", "LAND, MANUAL", needs "EKF test ratios";
    "The EKF rejected, or nearly rejected, the compass.";
    "Check the compass, its calibration and currents or magnets near it.";
    "compass_unused" Px4 "compass in use", "", says "EKF dropped compass", "", needs "EKF test ratio of the compass";
    "The EKF stopped using the compass."; "Check the compass, its calibration and currents or magnets near it.";
    "accel_mismatch" Vehicle "accelerometer agreement", "accelerometer", says "accelerometer # and others differ", "", needs "second accelerometer on rotors";
    "Two accelerometers came apart in flight. Which one is wrong is known only where there are three.";
    "Do not fly until the autopilot's accelerometers are checked.";
    "gyro_mismatch" Vehicle "gyro agreement", "gyro", says "gyro # and others differ", "", needs "second gyro in flight";
    "Two gyros came apart in flight. Which one is wrong is known only where there are three."; "Do not fly until the autopilot's gyros are checked.";
    "gyro_noise" Px4 "gyro noise", "", says "gyro noisy", "", needs "vibration metrics";
    "The autopilot's gyro was noisy, or shaken fast: it steers by it."; "Do not fly until the gyro, and the autopilot's mounting, are checked.";
    "imu_gps" Vehicle "IMU against GPS velocity", "", says "IMU off GPS velocity", "", needs "acceleration, attitude and GPS velocity in flight";
    "The measured force was not the change of GPS velocity: an accelerometer or a gyro is wrong.";
    "Do not fly until the autopilot's accelerometers and gyros are checked.";
    "compass_mismatch" Vehicle "compass agreement", "compass", says "compass # and others differ", "", needs "second compass";
    "Compasses came apart in flight: one is wrong, of two either, or a current or magnet is near it.";
    "Check the compasses, their wiring, and currents or magnets near them.";
    "compass_heading" Vehicle "compass heading", "", says "compass heading off", "", needs "compass of RAW_IMU and attitude in flight";
    "The first compass's heading came apart from the EKF's in flight."; "Check the compass, its calibration and currents or magnets near it.";
    "baro_mismatch" Vehicle "barometer agreement", "barometer", says "barometer # and others differ", "", needs "second barometer";
    "Two barometers came apart in flight. Which one is wrong is known only where there are three."; "Check the barometers, their cover and the airflow at them.";
    "baro_height" Vehicle "barometer against GPS height", "", says "barometer off GPS height", "", needs "air pressure and GPS height";
    "The heights of barometer and GPS came apart in flight: one of them is wrong.";
    "Check the barometer, its cover and the airflow at it, and the GPS antenna's view.";
    "baro_noise" Vehicle "barometer noise", "", says "barometer noisy", "", needs "air pressure and climb rate";
    "The barometer became noisy in flight."; "Check the barometer, its cover and the airflow at it.";
    "ekf_climb" Vehicle "EKF climb", "", says "EKF climb off baro", "LAND BY HAND", needs "air pressure and climb rate on rotors";
    "The EKF's climb was not that of the barometer: height control may run away.";
    "Do not fly until vibration, accelerometers, the barometer and its cover are checked.";
    "ahrs2_tilt" ArduPilot "attitudes of EKF and AHRS2", "", says "EKF and AHRS2 attitudes differ", "", needs "attitude of AHRS2 in flight";
    "The autopilot's two estimators, EKF and AHRS2, gave different attitudes: one of them is wrong.";
    "Do not fly until accelerometers, gyros and vibration are checked.";
    "ahrs2_height" ArduPilot "heights of EKF and AHRS2", "", says "two heights differ", "LAND BY HAND", needs "height of AHRS2 in flight";
    "The autopilot's two estimators, EKF and AHRS2, gave different heights: one of them is wrong."; "Check the barometer, its cover, GPS and vibration.";
    "ahrs2_position" ArduPilot "positions of EKF and AHRS2", "", says "EKF and AHRS2 positions differ", "", needs "position of AHRS2 in flight";
    "The autopilot's two estimators, EKF and AHRS2, gave different positions: one of them is wrong."; "Check GPS, compass and vibration at that time.";
    "accel_stuck" Vehicle "accelerometer activity", "accelerometer", says "accelerometer # frozen", "", needs "acceleration in flight";
    "The accelerometer repeated one value: it has failed."; "Do not fly until the autopilot's accelerometers are checked.";
    "gyro_stuck" Vehicle "gyro activity", "gyro", says "gyro # frozen", "", needs "body rates of a gyro in flight";
    "The gyro repeated one value: it has failed."; "Do not fly until the autopilot's gyros are checked.";
    "compass_stuck" Vehicle "compass activity", "compass", says "compass # frozen", "", needs "magnetic field in flight";
    "The compass repeated one value: it has failed."; "Check the compass and its wiring.";
    "baro_stuck" Vehicle "barometer activity", "barometer", says "barometer # frozen", "", needs "air pressure in flight";
    "The barometer repeated one value: it has failed, or its port is closed."; "Check the barometer and its port.";
    "gps_stuck" Vehicle "GPS activity", "GPS", says "GPS # frozen", "", needs "GPS position in flight";
    "The receiver repeated one position: it has failed."; "Check the receiver, its wiring and its firmware.";
    "gps_satellites" Vehicle "GPS satellites", "GPS", says "GPS # few satellites|~", "", needs "GPS satellite count";
    "Few satellites were in use: the position was not exact."; "Wait for more satellites; check the antenna's view.";
    "gps_sats_fall" Vehicle "GPS satellites against usual", "GPS", says "GPS # lost satellites", "", needs "GPS satellite count in flight";
    "The receiver lost many of the satellites that it used in this flight."; "Check the antenna's view, its cable and sources of interference.";
    "gps_speed" Vehicle "GPS speed against its positions", "GPS", says "GPS # speed wrong", "", needs "GPS speed and position in flight";
    "The receiver's speed and course were not those of its positions: one of both is wrong."; "Check the antenna's view, sources of interference and the receiver's firmware.";
    "gps_height" Vehicle "GPS height against climb", "", says "GPS height wrong", "", needs "GPS height, air pressure and climb in flight";
    "The receiver's height moved as neither the barometer nor the climb did: it is wrong."; "Check the antenna's view, sources of interference and the receiver's firmware.";
    "gps_hdop" Vehicle "GPS HDOP", "GPS", says "GPS # poor geometry|HDOP ~", "", needs "GPS HDOP";
    "The satellites stood badly (HDOP): the position was not exact."; "Wait for more satellites; check the antenna's view.";
    "gps_hdop_rise" Vehicle "GPS HDOP against usual", "GPS", says "GPS # geometry worse|HDOP ~ usual", "", needs "GPS HDOP in flight";
    "The satellites stood much worse (HDOP) than they did before in this flight."; "Check the antenna's view, its cable and sources of interference.";
    "gps_accuracy" Vehicle "GPS accuracy", "GPS", says "GPS # inaccurate", "", needs "GPS accuracy";
    "The receiver estimated its own position as not exact."; "Check the antenna's view and sources of interference.";
    "gps_fix" Vehicle "GPS fix", "GPS", says "GPS # position lost", "FLY MANUALLY", needs "GPS fix";
    "The receiver lost its position in flight."; "Check antenna, wiring and sources of interference.";
    "gps_jamming" Vehicle "GPS jamming", "GPS", says "GPS # jammed", "FLY MANUALLY", needs "jamming or spoofing state of a GPS receiver";
    "The receiver was jammed."; "Fly elsewhere, or without depending on GPS; look for transmitters on board.";
    "gps_spoofing" Vehicle "GPS spoofing", "GPS", says "GPS # spoofed", "FLY MANUALLY", needs "jamming or spoofing state of a GPS receiver";
    "The receiver detected false signals: its position could be wrong."; "Do not depend on GPS there.";

    "gyro_alert" Alerts "autopilot's gyro alert", "", says "autopilot warns: gyro", "LAND", needs "texts, events or health flags of the autopilot";
    "The autopilot said that a gyro had failed or could not be trusted."; "Do not fly until the autopilot's gyros are checked.";
    "accel_alert" Alerts "autopilot's accelerometer alert", "", says "autopilot warns: accelerometer", "LAND", needs "texts, events or health flags of the autopilot";
    "The autopilot said that an accelerometer had failed or could not be trusted.";
    "Do not fly until the autopilot's accelerometers are checked.";
    "compass_alert" Alerts "autopilot's compass alert", "", says "autopilot warns: compass", "LAND, MANUAL", needs "texts, events or health flags of the autopilot";
    "The autopilot said that a compass had failed or could not be trusted.";
    "Check the compass, its wiring, its calibration and currents or magnets near it.";
    "baro_alert" Alerts "autopilot's barometer alert", "", says "autopilot warns: barometer", "LAND", needs "texts, events or health flags of the autopilot";
    "The autopilot said that a barometer had failed or could not be trusted.";
    "Check the barometer, its cover and the airflow at it.";
    "airspeed_alert" Alerts "autopilot's airspeed alert", "", says "autopilot warns: airspeed", "LAND", needs "texts, events or health flags of the autopilot";
    "The autopilot said that an airspeed sensor had failed or could not be trusted.";
    "Check the pitot tube for water and dirt, its hoses and its calibration.";
    "gnss_alert" Alerts "autopilot's GPS alert", "", says "autopilot warns: GPS", "FLY MANUALLY", needs "texts, events or health flags of the autopilot";
    "The autopilot said that GPS was lost or not to be trusted: a glitch, jamming or spoofing.";
    "Check the antenna's view, wiring and sources of interference.";
    "ranging_alert" Alerts "autopilot's rangefinder alert", "", says "autopilot warns: rangefinder", "LAND", needs "texts, events or health flags of the autopilot";
    "The autopilot said that a rangefinder, optical flow, vision or proximity sensor had failed.";
    "Check that sensor and its wiring.";
    "terrain_alert" Alerts "autopilot's terrain data alert", "", says "autopilot warns: terrain", "CLIMB", needs "texts, events or health flags of the autopilot";
    "The autopilot said that it lacked the heights of the ground, or could hit it.";
    "Load terrain data before the flight; check the mission's heights.";
    "ekf_alert" Alerts "autopilot's EKF alert", "", says "autopilot warns: EKF", "LAND, MANUAL", needs "texts, events or health flags of the autopilot";
    "The autopilot said that its EKF doubted or had lost attitude, velocity, position or height.";
    "Look at compass, GPS, barometer and vibration at that time.";

    "heartbeat" Wire "autopilot's heartbeat", "", says "autopilot silent", "LAND", needs "monitor on the autopilot's wire";
    "The autopilot fell silent."; "Check the wire between autopilot and monitor, and the autopilot's supply.";
    "frames_lost" Wire "frames lost on the wire", "", says "autopilot's data lost", "WATCH IT", needs "monitor on the autopilot's wire";
    "Messages of the autopilot were lost on the way."; "Check the wire, and lower the message rates or raise the baud rate.";
    "position_silent" Wire "position messages", "", says "no position heard", "", needs "position of the EKF in flight";
    "The autopilot stopped telling its position: it has none, or its link is set otherwise."; "Check the receiver and the EKF; check the rates of the autopilot's messages.";
    "rc_rssi" Vehicle "remote control signal", "", says "RC signal weak", "FLY BACK", needs "signal strength of the remote control";
    "The remote control's signal was weak."; "Check antennas and range.";
    "radio_rssi" Vehicle "telemetry signal", "", says "telemetry signal weak", "", needs "telemetry radio status";
    "The telemetry radio's signal was weak."; "Check antennas and range.";
    "radio_margin" Vehicle "telemetry signal above noise", "", says "telemetry signal near noise", "", needs "telemetry radio status";
    "The telemetry radio's signal was hardly above the noise."; "Check antennas, range and sources of interference.";

    "rc_alert" Alerts "autopilot's remote control alert", "", says "autopilot: remote control lost", "WATCH IT", needs "texts, events or health flags of the autopilot";
    "The autopilot said that the remote control was lost."; "Check transmitter, receiver, antennas and range.";
    "gcs_alert" Alerts "autopilot's ground station alert", "", says "autopilot: ground station lost", "FLY BACK", needs "texts, events or health flags of the autopilot";
    "The autopilot said that the ground station or a companion was lost."; "Check the telemetry link and its range.";

    "load" Vehicle "processor load", "", says "autopilot processor full", "LAND", needs "processor load";
    "The autopilot's processor was nearly full."; "Switch off what is not needed; lower logging and stream rates.";
    "mcu_temperature" Vehicle "processor temperature", "", says "autopilot processor hot", "LAND", needs "processor temperature";
    "The autopilot's processor was too hot."; "Check cooling and placement.";
    "autopilot_reboot" Vehicle "autopilot restart", "", says "autopilot restarted", "LAND NOW", needs "heartbeat";
    "The autopilot restarted."; "In flight: do not fly until the supply and the firmware are checked.";
    "autopilot_state" Vehicle "autopilot failsafe", "", says "autopilot in failsafe", "WATCH IT", needs "state of the autopilot";
    "The autopilot declared a failsafe or an emergency: it returns, lands or stops by itself."; "Read its messages of that time; mend the cause they name.";
    "processor_alert" Alerts "autopilot's processor alert", "", says "autopilot warns: processor", "LAND", needs "texts, events or health flags of the autopilot";
    "The autopilot said that its processor or firmware had a problem.";
    "Keep its log and tell the firmware's makers; lower logging and stream rates.";
    "logging_alert" Alerts "autopilot's log alert", "", says "autopilot does not log", "CHECK CARD", needs "texts, events or health flags of the autopilot";
    "The autopilot said that it could not write its own log."; "Check the autopilot's card.";
    "fence_alert" Alerts "autopilot's geofence alert", "", says "geofence breached", "FLY BACK", needs "texts, events or health flags of the autopilot";
    "The autopilot said that the geofence was breached."; "Check the fence and the flight at that time.";
    "failsafe_alert" Alerts "autopilot's failsafe alert", "", says "autopilot's failsafe acts", "WATCH IT", needs "texts, events or health flags of the autopilot";
    "The autopilot said that a failsafe acted: it returns, lands or stops by itself."; "Read its messages of that time; mend the cause they name.";
    "autopilot_alert" Alerts "autopilot's other alert", "", says "autopilot: severe message", "READ IT", needs "texts, events or health flags of the autopilot";
    "The autopilot gave a severe message that no table here knows."; "Read its messages of that time.";

    "roll" Vehicle "roll angle", "", says "banks too far", "LEVEL OUT", needs "attitude of a vehicle on rotors";
    "The vehicle banked further than it should."; "Look at the flight at that time: wind, a manoeuvre, or lost control.";
    "pitch" Vehicle "pitch angle", "", says "pitches too far", "LEVEL OUT", needs "attitude of a vehicle on rotors";
    "The vehicle pitched further than it should."; "Look at the flight at that time: wind, a manoeuvre, or lost control.";

    "attitude_alert" Alerts "autopilot's attitude alert", "", says "autopilot warns: attitude", "TAKE OVER", needs "texts, events or health flags of the autopilot";
    "The autopilot said that it had lost control of attitude or height.";
    "Do not fly until motors, propellers and sensors are checked.";

    "recording" Recorder "recording", "", says "not recording", "CHECK CARD", needs "monitor's own recorder";
    "The monitor did not record."; "Push its card in, which was most likely out of the slot; replace it where that does not help.";
    "record_queue" Recorder "recorder's queue", "", says "card slow|buffer ~ full", "CHANGE CARD", needs "monitor's own recorder";
    "The card was too slow for a while."; "Take a faster card.";
    "record_lost" Recorder "frames lost by the recorder", "", says "frames not recorded|~", "", needs "monitor's own recorder";
    "The recorder lost frames: they are not in the log."; "Take a faster card.";
    "card_stall" Recorder "card stall", "", says "card stalls", "CHANGE CARD", needs "monitor's own recorder";
    "The card kept the recorder waiting."; "Take a faster card.";
    "card_errors" Recorder "card errors", "", says "card refuses writes", "", needs "monitor's own recorder";
    "The card refused blocks."; "Copy its logs, then replace it.";
    "card_room" Recorder "room on the card", "", says "other files fill card", "CLEAR CARD", needs "monitor's own recorder";
    "Other files take the card's room."; "Copy them elsewhere, then remove them.";
    "card_due" Stored "card life", "", says "card life used", "REPLACE IT", needs "card registered with the monitor on board";
    "The card has reached the end of its life."; "Copy its logs, replace it, then `hums box replaced card`.";

    "free_fall" Vehicle "free fall", "", says "falling", "KEEP CLEAR", needs "acceleration of a vehicle on rotors";
    "Nothing carried the vehicle though its throttle asked for thrust.";
    "Inspect the vehicle; look for lost power, ESCs or propellers in the seconds before.";
    "impact" Vehicle "impact", "", says "impact", "DISARM IF DOWN", needs "acceleration";
    "The vehicle hit the ground or something else."; "Do not fly until the whole vehicle is inspected.";
    "tumbling" Vehicle "tumbling", "", says "tumbling", "KEEP CLEAR", needs "body rates";
    "The vehicle turned over and over: it was out of control.";
    "Do not fly until motors, propellers and sensors are checked.";
    "disarmed_in_air" Vehicle "disarmed in the air", "", says "disarmed in the air", "KEEP CLEAR", needs "arming";
    "The vehicle was disarmed, or its flight was terminated, in the air, and it fell."; "Look for who or what did it; inspect the vehicle.";
    "sinking" Vehicle "sinking", "", says "sinking fast", "FLY FORWARD, CLIMB", needs "climb rate of a vehicle on rotors";
    "The vehicle sank fast without a command."; "Look for lost thrust, vortex ring state, an empty battery or a wrong height.";
    "overturned" Vehicle "overturned", "", says "overturned", "DISARM IF DOWN", needs "attitude of a vehicle on rotors";
    "The vehicle turned over, or lay over, while its motors ran.";
    "Inspect the vehicle; check motor order, propellers and calibration.";
    "crash_alert" Alerts "autopilot's crash alert", "", says "autopilot reports a crash", "DISARM IF DOWN", needs "texts, events or health flags of the autopilot";
    "The autopilot said that it crashed, released its parachute or ended the flight.";
    "Do not fly until the whole vehicle is inspected.";
}

#[cfg(test)]
mod tests {
    use hums_core::health::{check_named, checks, instances};

    use super::*;

    #[test]
    fn every_check_has_its_words_in_the_order_of_the_tables() {
        let checks: Vec<&str> = checks().map(|check| check.name).collect();
        let words: Vec<&str> = VOCABULARY.iter().map(|words| words.said.check).collect();
        assert_eq!(words, checks);
        assert!(VOCABULARY.iter().all(|words| said(words.said.check) == Some(words.said)));
        assert_eq!([said(""), said("batt"), said("of_later")], [None; 3]);
    }

    #[test]
    fn words_are_sentences_and_parts_are_named_where_there_are_several() {
        for words in VOCABULARY {
            let RadioWords { check, name, part, .. } = words.said;
            for sentence in [words.meaning, words.action] {
                let first = sentence.chars().next().is_some_and(char::is_uppercase);
                assert!(first && sentence.ends_with('.') && sentence.len() <= 100, "{check}: {sentence}");
            }
            let several = instances(check) > 1;
            assert_eq!(several, !part.is_empty(), "{check}");
            assert!(name.starts_with(part), "{check}: the number of the part goes after its word");
            assert!(!name.is_empty() && !words.needs.is_empty(), "{check}");
        }
    }

    #[test]
    fn an_alarm_names_its_part_and_is_one_checks_alone_and_what_is_critical_has_advice() {
        let twins = ["vibration_px4", "cell_dev_lasting"];
        for (index, Words { said, .. }) in VOCABULARY.iter().enumerate() {
            let RadioWords { check, part, alarm, advice, .. } = *said;
            assert!(!alarm.is_empty() && alarm.is_ascii() && advice.is_ascii(), "{check}");
            assert_eq!(alarm.contains('#'), !part.is_empty(), "{check}: {alarm}");
            assert!(alarm.matches('#').count() <= 1, "{check}: {alarm}");
            let is_critical = check_named(check).is_some_and(|check| check.limits.critical.is_some());
            assert_eq!(is_critical, !advice.is_empty(), "{check}: {advice}");
            let other = VOCABULARY[..index].iter().find(|other| other.said.alarm == alarm);
            assert_eq!(other.is_some(), twins.contains(&check), "{check}: {alarm}");
        }
    }
}
