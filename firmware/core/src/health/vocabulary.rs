//! The meaning of each check in words: one table for every text, page and document.
//!
//! `alarm` and `advice` are the words of a radio text ([`Said`], the only ones that the firmware links). `meaning`
//! describes the fault, and `action` the remedy: on the ground, before the next flight, unless it says otherwise.
//! `needs` names the input, for reports of checks that had nothing to judge.

use core::fmt;

use crate::observation::Feeds;

numbered! {
    /// The source that a check is judged from.
    pub enum Scope {
        /// Messages of any vehicle.
        Vehicle "vehicle",
        /// Messages of ArduPilot.
        ArduPilot "ardupilot",
        /// Messages of PX4.
        Px4 "px4",
        /// The monitor's own place on the autopilot's wire: another place on another link tells of that link.
        Wire "wire",
        /// The monitor's own recorder.
        Recorder "recorder",
        /// The autopilot's own alerts. Silence cannot be judged.
        Said "said",
        /// Earlier flights, or what the monitor on board has stored of parts that wear.
        Stored "stored",
    }
}

/// The words of a check in radio texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Said {
    /// The check: [`super::Check::name`].
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

impl Said {
    fn of(line: &'static str) -> Option<Self> {
        let mut columns = line.split(';');
        let mut next = || columns.next();
        Some(Self { check: next()?, name: next()?, part: next()?, alarm: next()?, advice: next()? })
    }

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
    pub said: Said,
    /// The meaning, as a sentence.
    pub meaning: &'static str,
    /// The remedy, as a sentence.
    pub action: &'static str,
    /// Its input, as the end of "no …".
    pub needs: &'static str,
    /// The source that it is judged from.
    pub scope: Scope,
}

/// The words of all checks, in the order of the subsystems' tables.
pub fn all_words() -> impl Iterator<Item = Words> + Clone {
    SAID.lines().zip(MEANT.lines()).filter_map(|(said, meant)| {
        let mut columns = meant.split(" | ");
        let scope = columns.next()?;
        let scope = Scope::ALL.into_iter().find(|known| known.name() == scope)?;
        let (needs, meaning, action) = (columns.next()?, columns.next()?, columns.next()?);
        Some(Words { said: Said::of(said)?, meaning, action, needs, scope })
    })
}

/// The words of a check.
pub fn vocabulary(check: &str) -> Option<Words> {
    all_words().find(|words| words.said.check == check)
}

/// The words of a check in radio texts.
pub fn said(check: &str) -> Option<Said> {
    let is_of = |line: &&str| line.strip_prefix(check).is_some_and(|rest| rest.starts_with(';'));
    Said::of(SAID.split('\n').find(is_of)?)
}

/// What the firmware links, a check a line, in the order of the subsystems' tables: check, name, part, alarm, advice.
const SAID: &str = "\
batt_remaining;battery remaining;battery;battery # low;LAND NOW
cell_voltage;battery cell voltage;battery;battery # cell low;LAND NOW
cell_deviation;battery cell balance;battery;battery # cells uneven;LAND
cell_dev_lasting;battery cell balance, lasting;battery;battery # cells uneven;LAND
batt_resistance;battery resistance;battery;battery # worn|+~;REPLACE IT
batt_fault;battery fault;battery;battery # fault;
batt_temperature;battery temperature;battery;battery # hot;LAND NOW
batt_state;battery charge state;battery;autopilot: battery # low;LAND
rail_5v_low;5 V supply, low;;5 V supply low;LAND NOW
rail_5v_high;5 V supply, high;;5 V supply high;
battery_due;battery life;;a battery's life used|~;REPLACE IT
battery_alert;autopilot's battery alert;;autopilot warns: battery;LAND
esc_silent;ESC telemetry;ESC;ESC # silent;LAND
esc_temperature;ESC temperature;ESC;ESC # hot;LAND
esc_failure;ESC failure;ESC;ESC # failed;LAND NOW
esc_errors;ESC errors;ESC;ESC # errors;
motor_loss;motor current;motor;motor # lost|~ of normal amps;LAND NOW
motor_imbalance;motor balance;motor;motor # speed differs;LAND
motor_output;motor output;motor;motor # weak|output +~;LAND NOW
motor_off;motor in use;motor;motor # off: no output;LAND NOW
thrust_lost;climb with full throttle;;full throttle, no climb;
roll_rate;roll rate against what is wanted;;roll does not follow;LAND NOW
pitch_rate;pitch rate against what is wanted;;pitch does not follow;LAND NOW
drive_due;life of motors, propellers, ESCs;;motor/prop/ESC life used;REPLACE IT
drive_alert;autopilot's motor alert;;autopilot warns: motor;LAND NOW
cylinder_head;cylinder head temperature;;cylinder hot;LAND
exhaust_gas;exhaust gas temperature;;exhaust hot;LAND
fuel_pressure;fuel pressure;;fuel pressure low;LAND NOW
generator_speed;generator speed;;generator speed low;LAND
engine_due;engine life;;engine life used;SERVICE IT
vibration;vibration;;vibration high;LAND BY HAND
vibration_px4;vibration;;vibration high;LAND BY HAND
vibration_rise;vibration rise;;vibration up|~ usual;
clipping;accelerometer clipping;;accelerometer clipping;LAND BY HAND
load_factor;load factor;;load factor high;EASE OFF
airframe_due;airframe life;;airframe life used;SERVICE IT
vibration_alert;autopilot's vibration alert;;autopilot warns: vibration;LAND BY HAND
ekf_variance;EKF variance;;EKF doubts position or speed;
ekf_failsafe;EKF variance of two sensors;;EKF failing;LAND, MANUAL
ekf_compass;EKF variance of the compass;;EKF doubts compass;
ekf_test_ratio;EKF test ratio;;EKF rejects position or speed;LAND, MANUAL
ekf_mag_ratio;EKF test ratio of the compass;;EKF rejects compass;LAND, MANUAL
compass_unused;compass in use;;EKF dropped compass;
accel_mismatch;accelerometer agreement;accelerometer;accelerometer # and others differ;
gyro_mismatch;gyro agreement;gyro;gyro # and others differ;
gyro_noise;gyro noise;;gyro noisy;
imu_gps;IMU against GPS velocity;;IMU off GPS velocity;
compass_mismatch;compass agreement;compass;compass # and others differ;
compass_heading;compass heading;;compass heading off;
baro_mismatch;barometer agreement;barometer;barometer # and others differ;
baro_height;barometer against GPS height;;barometer off GPS height;
baro_noise;barometer noise;;barometer noisy;
ekf_climb;EKF climb;;EKF climb off baro;LAND BY HAND
ahrs2_tilt;attitudes of EKF and AHRS2;;EKF and AHRS2 attitudes differ;
ahrs2_height;heights of EKF and AHRS2;;two heights differ;LAND BY HAND
ahrs2_position;positions of EKF and AHRS2;;EKF and AHRS2 positions differ;
accel_stuck;accelerometer activity;accelerometer;accelerometer # frozen;
gyro_stuck;gyro activity;gyro;gyro # frozen;
compass_stuck;compass activity;compass;compass # frozen;
baro_stuck;barometer activity;barometer;barometer # frozen;
gps_stuck;GPS activity;GPS;GPS # frozen;
gps_satellites;GPS satellites;GPS;GPS # few satellites|~;
gps_sats_fall;GPS satellites against usual;GPS;GPS # lost satellites;
gps_speed;GPS speed against its positions;GPS;GPS # speed wrong;
gps_height;GPS height against climb;;GPS height wrong;
gps_hdop;GPS HDOP;GPS;GPS # poor geometry|HDOP ~;
gps_hdop_rise;GPS HDOP against usual;GPS;GPS # geometry worse|HDOP ~ usual;
gps_accuracy;GPS accuracy;GPS;GPS # inaccurate;
gps_fix;GPS fix;GPS;GPS # position lost;FLY MANUALLY
gps_jamming;GPS jamming;GPS;GPS # jammed;FLY MANUALLY
gps_spoofing;GPS spoofing;GPS;GPS # spoofed;FLY MANUALLY
gyro_alert;autopilot's gyro alert;;autopilot warns: gyro;LAND
accel_alert;autopilot's accelerometer alert;;autopilot warns: accelerometer;LAND
compass_alert;autopilot's compass alert;;autopilot warns: compass;LAND, MANUAL
baro_alert;autopilot's barometer alert;;autopilot warns: barometer;LAND
airspeed_alert;autopilot's airspeed alert;;autopilot warns: airspeed;LAND
gnss_alert;autopilot's GPS alert;;autopilot warns: GPS;FLY MANUALLY
ranging_alert;autopilot's rangefinder alert;;autopilot warns: rangefinder;LAND
terrain_alert;autopilot's terrain data alert;;autopilot warns: terrain;CLIMB
ekf_alert;autopilot's EKF alert;;autopilot warns: EKF;LAND, MANUAL
heartbeat;autopilot's heartbeat;;autopilot silent;LAND
frames_lost;frames lost on the wire;;autopilot's data lost;WATCH IT
position_silent;position messages;;no position heard;
rc_rssi;remote control signal;;RC signal weak;FLY BACK
radio_rssi;telemetry signal;;telemetry signal weak;
radio_margin;telemetry signal above noise;;telemetry signal near noise;
rc_alert;autopilot's remote control alert;;autopilot: remote control lost;WATCH IT
gcs_alert;autopilot's ground station alert;;autopilot: ground station lost;FLY BACK
load;processor load;;autopilot processor full;LAND
mcu_temperature;processor temperature;;autopilot processor hot;LAND
autopilot_reboot;autopilot restart;;autopilot restarted;LAND NOW
autopilot_state;autopilot failsafe;;autopilot in failsafe;WATCH IT
processor_alert;autopilot's processor alert;;autopilot warns: processor;LAND
logging_alert;autopilot's log alert;;autopilot does not log;CHECK CARD
fence_alert;autopilot's geofence alert;;geofence breached;FLY BACK
failsafe_alert;autopilot's failsafe alert;;autopilot's failsafe acts;WATCH IT
autopilot_alert;autopilot's other alert;;autopilot: severe message;READ IT
roll;roll angle;;banks too far;LEVEL OUT
pitch;pitch angle;;pitches too far;LEVEL OUT
attitude_alert;autopilot's attitude alert;;autopilot warns: attitude;TAKE OVER
recording;recording;;not recording;CHECK CARD
record_queue;recorder's queue;;card slow|buffer ~ full;CHANGE CARD
record_lost;frames lost by the recorder;;frames not recorded|~;
card_stall;card stall;;card stalls;CHANGE CARD
card_errors;card errors;;card refuses writes;
card_room;room on the card;;other files fill card;CLEAR CARD
card_due;card life;;card life used;REPLACE IT
free_fall;free fall;;falling;KEEP CLEAR
impact;impact;;impact;DISARM IF DOWN
tumbling;tumbling;;tumbling;KEEP CLEAR
disarmed_in_air;disarmed in the air;;disarmed in the air;KEEP CLEAR
sinking;sinking;;sinking fast;FLY FORWARD, CLIMB
overturned;overturned;;overturned;DISARM IF DOWN
crash_alert;autopilot's crash alert;;autopilot reports a crash;DISARM IF DOWN";

/// The rest of each, in the same order: scope, needs, meaning, action.
const MEANT: &str = "\
vehicle | battery level | The battery was nearly empty. | Land earlier, or take a fuller or larger battery.
vehicle | battery voltage of a known number of cells | The weakest cell was close to empty, or sagged under the load. | Check the pack under load; replace it if it was charged full before the flight.
vehicle | voltages of single cells | The cells of the battery differed in voltage. | Balance the pack; replace it if it happens again.
vehicle | voltages of single cells | The cells of the battery differed in voltage for more than a minute. | Replace the pack.
stored | voltage under a current that changes | The battery's internal resistance has risen since it was new. | Replace the pack soon.
vehicle | battery status | The battery reported a fault of its own. | Do not use the battery until its fault is known.
vehicle | battery temperature | The battery was too hot. | Let it cool before charging; look for a high load or a damaged cell.
vehicle | charge state of a battery | The autopilot called the battery low by its own thresholds. | Land earlier; check the pack and the thresholds.
vehicle | voltage of the 5 V supply | The autopilot's 5 V supply was too low: it can restart in flight. | Check the power module and its wiring; take loads off the 5 V supply.
vehicle | voltage of the 5 V supply | The autopilot's 5 V supply was too high: it can be damaged. | Check the power module before the next flight.
stored | battery registered with the monitor on board | A battery has reached the end of its life. | Replace it, and tell the monitor.
said | texts, events or health flags of the autopilot | The autopilot said that a battery or a supply was low or had failed. | Read its messages of that time; check pack, power module and wiring.
vehicle | ESC telemetry | The ESC of this motor stopped answering. | Check the ESC, its wiring and its telemetry line.
vehicle | ESC temperature | The ESC of this motor was too hot. | Check its cooling, the propeller and the motor for drag.
vehicle | failure flags of ESCs | The ESC of this motor reported a failure. | Do not fly until the ESC and the motor are checked.
vehicle | error counts of ESCs | The ESC of this motor counted many errors. | Check its signal and telemetry wiring.
vehicle | current of single motors | The motor took almost no current while the others worked: it or its propeller was lost. | Do not fly until motor, propeller and ESC are checked.
vehicle | speeds of single motors in steady flight | The motor's speed differed from the others' in steady flight. | Check this arm: propeller, motor, its tilt, and the centre of gravity.
vehicle | motor outputs of 4, 6 or 8 motors, on the ground and in flight | The motor was driven far harder than the others: it or its propeller gives less thrust. | Do not fly until its propeller, motor and ESC are checked.
vehicle | motor outputs of 4, 6 or 8 motors, on the ground and in flight | The autopilot, or a command, shut the motor down while the others carried. | Do not fly until it is known what shut it down.
vehicle | throttle and climb | Full throttle did not make the vehicle climb, or a plane keep its height. | Do not fly until propellers, motors, ESCs, battery and weight are checked.
vehicle | body rates that the autopilot wants | The vehicle did not roll as the autopilot wanted: a motor, propeller, servo or surface failed. | Do not fly until motors, propellers, servos and control surfaces are checked.
vehicle | body rates that the autopilot wants | The vehicle did not pitch as the autopilot wanted: a motor, propeller, servo or surface failed. | Do not fly until motors, propellers, servos and control surfaces are checked.
stored | motor, propeller or ESC registered with the monitor on board | A motor, propeller or ESC has reached the end of its life. | Replace it, and tell the monitor.
said | texts, events or health flags of the autopilot | The autopilot said that a motor, propeller or ESC had failed or gave too little thrust. | Do not fly until motors, propellers and ESCs are checked.
vehicle | engine data | The engine's cylinder head was too hot. | Check cooling and mixture before the next flight.
vehicle | engine data | The engine's exhaust gas was too hot. | Check the mixture before the next flight.
vehicle | engine data | The fuel pressure was too low. | Check pump, filter and lines before the next flight.
vehicle | generator data | The generator turned too slowly: the flight may have gone on by battery alone. | Check fuel, engine and generator before the next flight.
stored | engine registered with the monitor on board | The engine is due for maintenance. | Do the maintenance, and tell the monitor.
ardupilot | vibration levels | Vibration was strong enough to disturb the autopilot's estimator (EKF). | Balance propellers and motors, and check the autopilot's mounting.
px4 | vibration metrics | Vibration was strong enough to disturb the autopilot's estimator (EKF). | Balance propellers and motors, and check the autopilot's mounting.
vehicle | vibration levels of what flies on rotors | Vibration rose to a multiple of what it was before in the same flight. | Check propellers, motor bearings and mounting before the next flight.
vehicle | clipping counts | The accelerometers were at the end of their range: the EKF flew partly blind. | Find the source of vibration or shock, and check the mounting.
vehicle | acceleration | The airframe carried a high load: a hard manoeuvre, a shock or a landing. | Inspect the airframe and the landing gear.
stored | airframe registered with the monitor on board | The airframe or a part of it is due for maintenance. | Do the maintenance, and tell the monitor.
said | texts, events or health flags of the autopilot | The autopilot said that vibration or clipping disturbed it. | Balance propellers and motors, and check the autopilot's mounting.
ardupilot | variances of the EKF that it flies by | The EKF did not trust its measurements of position, height or speed. | Look at compass, GPS and vibration at that time.
ardupilot | variances of the EKF that it flies by, of no plane | The EKF did not trust two of compass, velocity and position: it could lose its position. | Do not fly until compass and GPS are checked.
ardupilot | compass variance of the EKF that it flies by | The EKF did not trust the compass. | Check the compass, its calibration and currents or magnets near it.
px4 | EKF test ratios | The EKF rejected, or nearly rejected, its measurements of position, height or speed. | Look at compass, GPS and vibration at that time.
px4 | EKF test ratios | The EKF rejected, or nearly rejected, the compass. | Check the compass, its calibration and currents or magnets near it.
px4 | EKF test ratio of the compass | The EKF stopped using the compass. | Check the compass, its calibration and currents or magnets near it.
vehicle | second accelerometer on rotors | Two accelerometers came apart in flight. Which one is wrong is known only where there are three. | Do not fly until the autopilot's accelerometers are checked.
vehicle | second gyro in flight | Two gyros came apart in flight. Which one is wrong is known only where there are three. | Do not fly until the autopilot's gyros are checked.
px4 | vibration metrics | The autopilot's gyro was noisy, or shaken fast: it steers by it. | Do not fly until the gyro, and the autopilot's mounting, are checked.
vehicle | acceleration, attitude and GPS velocity in flight | The measured force was not the change of GPS velocity: an accelerometer or a gyro is wrong. | Do not fly until the autopilot's accelerometers and gyros are checked.
vehicle | second compass | Compasses came apart in flight: one is wrong, of two either, or a current or magnet is near it. | Check the compasses, their wiring, and currents or magnets near them.
vehicle | compass of RAW_IMU and attitude in flight | The first compass's heading came apart from the EKF's in flight. | Check the compass, its calibration and currents or magnets near it.
vehicle | second barometer | Two barometers came apart in flight. Which one is wrong is known only where there are three. | Check the barometers, their cover and the airflow at them.
vehicle | air pressure and GPS height | The heights of barometer and GPS came apart in flight: one of them is wrong. | Check the barometer, its cover and the airflow at it, and the GPS antenna's view.
vehicle | air pressure and climb rate | The barometer became noisy in flight. | Check the barometer, its cover and the airflow at it.
vehicle | air pressure and climb rate on rotors | The EKF's climb was not that of the barometer: height control may run away. | Do not fly until vibration, accelerometers, the barometer and its cover are checked.
ardupilot | attitude of AHRS2 in flight | The autopilot's two estimators, EKF and AHRS2, gave different attitudes: one of them is wrong. | Do not fly until accelerometers, gyros and vibration are checked.
ardupilot | height of AHRS2 in flight | The autopilot's two estimators, EKF and AHRS2, gave different heights: one of them is wrong. | Check the barometer, its cover, GPS and vibration.
ardupilot | position of AHRS2 in flight | The autopilot's two estimators, EKF and AHRS2, gave different positions: one of them is wrong. | Check GPS, compass and vibration at that time.
vehicle | acceleration in flight | The accelerometer repeated one value: it has failed. | Do not fly until the autopilot's accelerometers are checked.
vehicle | body rates of a gyro in flight | The gyro repeated one value: it has failed. | Do not fly until the autopilot's gyros are checked.
vehicle | magnetic field in flight | The compass repeated one value: it has failed. | Check the compass and its wiring.
vehicle | air pressure in flight | The barometer repeated one value: it has failed, or its port is closed. | Check the barometer and its port.
vehicle | GPS position in flight | The receiver repeated one position: it has failed. | Check the receiver, its wiring and its firmware.
vehicle | GPS satellite count | Few satellites were in use: the position was not exact. | Wait for more satellites; check the antenna's view.
vehicle | GPS satellite count in flight | The receiver lost many of the satellites that it used in this flight. | Check the antenna's view, its cable and sources of interference.
vehicle | GPS speed and position in flight | The receiver's speed and course were not those of its positions: one of both is wrong. | Check the antenna's view, sources of interference and the receiver's firmware.
vehicle | GPS height, air pressure and climb in flight | The receiver's height moved as neither the barometer nor the climb did: it is wrong. | Check the antenna's view, sources of interference and the receiver's firmware.
vehicle | GPS HDOP | The satellites stood badly (HDOP): the position was not exact. | Wait for more satellites; check the antenna's view.
vehicle | GPS HDOP in flight | The satellites stood much worse (HDOP) than they did before in this flight. | Check the antenna's view, its cable and sources of interference.
vehicle | GPS accuracy | The receiver estimated its own position as not exact. | Check the antenna's view and sources of interference.
vehicle | GPS fix | The receiver lost its position in flight. | Check antenna, wiring and sources of interference.
vehicle | jamming or spoofing state of a GPS receiver | The receiver was jammed. | Fly elsewhere, or without depending on GPS; look for transmitters on board.
vehicle | jamming or spoofing state of a GPS receiver | The receiver detected false signals: its position could be wrong. | Do not depend on GPS there.
said | texts, events or health flags of the autopilot | The autopilot said that a gyro had failed or could not be trusted. | Do not fly until the autopilot's gyros are checked.
said | texts, events or health flags of the autopilot | The autopilot said that an accelerometer had failed or could not be trusted. | Do not fly until the autopilot's accelerometers are checked.
said | texts, events or health flags of the autopilot | The autopilot said that a compass had failed or could not be trusted. | Check the compass, its wiring, its calibration and currents or magnets near it.
said | texts, events or health flags of the autopilot | The autopilot said that a barometer had failed or could not be trusted. | Check the barometer, its cover and the airflow at it.
said | texts, events or health flags of the autopilot | The autopilot said that an airspeed sensor had failed or could not be trusted. | Check the pitot tube for water and dirt, its hoses and its calibration.
said | texts, events or health flags of the autopilot | The autopilot said that GPS was lost or not to be trusted: a glitch, jamming or spoofing. | Check the antenna's view, wiring and sources of interference.
said | texts, events or health flags of the autopilot | The autopilot said that a rangefinder, optical flow, vision or proximity sensor had failed. | Check that sensor and its wiring.
said | texts, events or health flags of the autopilot | The autopilot said that it lacked the heights of the ground, or could hit it. | Load terrain data before the flight; check the mission's heights.
said | texts, events or health flags of the autopilot | The autopilot said that its EKF doubted or had lost attitude, velocity, position or height. | Look at compass, GPS, barometer and vibration at that time.
wire | monitor on the autopilot's wire | The autopilot fell silent. | Check the wire between autopilot and monitor, and the autopilot's supply.
wire | monitor on the autopilot's wire | Messages of the autopilot were lost on the way. | Check the wire, and lower the message rates or raise the baud rate.
wire | position of the EKF in flight | The autopilot stopped telling its position: it has none, or its link is set otherwise. | Check the receiver and the EKF; check the rates of the autopilot's messages.
vehicle | signal strength of the remote control | The remote control's signal was weak. | Check antennas and range.
vehicle | telemetry radio status | The telemetry radio's signal was weak. | Check antennas and range.
vehicle | telemetry radio status | The telemetry radio's signal was hardly above the noise. | Check antennas, range and sources of interference.
said | texts, events or health flags of the autopilot | The autopilot said that the remote control was lost. | Check transmitter, receiver, antennas and range.
said | texts, events or health flags of the autopilot | The autopilot said that the ground station or a companion was lost. | Check the telemetry link and its range.
vehicle | processor load | The autopilot's processor was nearly full. | Switch off what is not needed; lower logging and stream rates.
vehicle | processor temperature | The autopilot's processor was too hot. | Check cooling and placement.
vehicle | heartbeat | The autopilot restarted. | In flight: do not fly until the supply and the firmware are checked.
vehicle | state of the autopilot | The autopilot declared a failsafe or an emergency: it returns, lands or stops by itself. | Read its messages of that time; mend the cause they name.
said | texts, events or health flags of the autopilot | The autopilot said that its processor or firmware had a problem. | Keep its log and tell the firmware's makers; lower logging and stream rates.
said | texts, events or health flags of the autopilot | The autopilot said that it could not write its own log. | Check the autopilot's card.
said | texts, events or health flags of the autopilot | The autopilot said that the geofence was breached. | Check the fence and the flight at that time.
said | texts, events or health flags of the autopilot | The autopilot said that a failsafe acted: it returns, lands or stops by itself. | Read its messages of that time; mend the cause they name.
said | texts, events or health flags of the autopilot | The autopilot gave a severe message that no table here knows. | Read its messages of that time.
vehicle | attitude of a vehicle on rotors | The vehicle banked further than it should. | Look at the flight at that time: wind, a manoeuvre, or lost control.
vehicle | attitude of a vehicle on rotors | The vehicle pitched further than it should. | Look at the flight at that time: wind, a manoeuvre, or lost control.
said | texts, events or health flags of the autopilot | The autopilot said that it had lost control of attitude or height. | Do not fly until motors, propellers and sensors are checked.
recorder | monitor's own recorder | The monitor did not record. | Push its card in, which was most likely out of the slot; replace it where that does not help.
recorder | monitor's own recorder | The card was too slow for a while. | Take a faster card.
recorder | monitor's own recorder | The recorder lost frames: they are not in the log. | Take a faster card.
recorder | monitor's own recorder | The card kept the recorder waiting. | Take a faster card.
recorder | monitor's own recorder | The card refused blocks. | Copy its logs, then replace it.
recorder | monitor's own recorder | Other files take the card's room. | Copy them elsewhere, then remove them.
stored | card registered with the monitor on board | The card has reached the end of its life. | Copy its logs, replace it, and tell the monitor.
vehicle | acceleration of a vehicle on rotors | Nothing carried the vehicle though its throttle asked for thrust. | Inspect the vehicle; look for lost power, ESCs or propellers in the seconds before.
vehicle | acceleration | The vehicle hit the ground or something else. | Do not fly until the whole vehicle is inspected.
vehicle | body rates | The vehicle turned over and over: it was out of control. | Do not fly until motors, propellers and sensors are checked.
vehicle | arming | The vehicle was disarmed, or its flight was terminated, in the air, and it fell. | Look for who or what did it; inspect the vehicle.
vehicle | climb rate of a vehicle on rotors | The vehicle sank fast without a command. | Look for lost thrust, vortex ring state, an empty battery or a wrong height.
vehicle | attitude of a vehicle on rotors | The vehicle turned over, or lay over, while its motors ran. | Inspect the vehicle; check motor order, propellers and calibration.
said | texts, events or health flags of the autopilot | The autopilot said that it crashed, released its parachute or ended the flight. | Do not fly until the whole vehicle is inspected.";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::health::checks;

    #[test]
    fn every_check_has_its_words_in_the_order_of_the_tables() {
        let checks: Vec<&str> = checks().map(|check| check.name).collect();
        let words: Vec<&str> = all_words().map(|words| words.said.check).collect();
        assert_eq!((words.len(), words), (MEANT.lines().count(), checks));
        assert!(all_words().all(|words| said(words.said.check) == Some(words.said)));
        assert_eq!([said(""), said("batt"), said("of_later")], [None; 3]);
    }

    #[test]
    fn words_are_sentences_and_parts_are_named_where_there_are_several() {
        for words in all_words() {
            let Said { check, name, part, .. } = words.said;
            for sentence in [words.meaning, words.action] {
                let first = sentence.chars().next().is_some_and(char::is_uppercase);
                assert!(first && sentence.ends_with('.') && sentence.len() <= 100, "{check}: {sentence}");
            }
            let several = crate::health::instances(check) > 1;
            assert_eq!(several, !part.is_empty(), "{check}");
            assert!(name.starts_with(part), "{check}: the number of the part goes after its word");
            assert!(!name.is_empty() && !words.needs.is_empty(), "{check}");
        }
    }

    #[test]
    fn an_alarm_names_its_part_and_is_one_checks_alone_and_what_is_critical_has_advice() {
        let twins = ["vibration_px4", "cell_dev_lasting"];
        for (index, Words { said, .. }) in all_words().enumerate() {
            let Said { check, part, alarm, advice, .. } = said;
            assert!(!alarm.is_empty() && alarm.is_ascii() && advice.is_ascii(), "{check}");
            assert_eq!(alarm.contains('#'), !part.is_empty(), "{check}: {alarm}");
            assert!(alarm.matches('#').count() <= 1, "{check}: {alarm}");
            let is_critical =
                crate::health::check_named(check).is_some_and(|check| check.limits.critical.is_some());
            assert_eq!(is_critical, !advice.is_empty(), "{check}: {advice}");
            let other = all_words().take(index).find(|other| other.said.alarm == alarm);
            assert_eq!(other.is_some(), twins.contains(&check), "{check}: {alarm}");
        }
    }
}
