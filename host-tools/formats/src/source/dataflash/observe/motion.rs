//! Position, motion, and their accuracy.

use std::num::NonZeroU32;

use hums_core::clock::{Span, UTC_MICROS};
use hums_core::observation::{
    Air, Attitude, AttitudeSetpoint, Estimator, EstimatorScale, GlobalPosition, Gnss, Hud, Imu,
    LocalPosition, MOTORS_MAX, Observation, Outputs, SecondEstimate, SystemTime, Vibration, VibrationScale,
    WantedRates,
};
use hums_core::units::{
    Celsius, Fraction, GRAVITY, Gauss, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2, Position,
    Radians, RadiansPerSecond, norm,
};

use super::handler::{Given, Handler, handler};
use super::out::Out;
use super::state::{Rates, State};
use super::words::Craft;
use crate::source::item::Item;

/// Bits of `MAV_SYS_STATUS_SENSOR`.
const GYRO: u32 = 1;
const ACCELEROMETER: u32 = 1 << 1;
const MAGNETOMETER: u32 = 1 << 2;
const PRESSURE: u32 = 1 << 3;

/// A fix with a position: `GPS_FIX_TYPE_2D_FIX`.
const FIX_2D: u8 = 2;
/// `GPS_FIX_TYPE_3D_FIX`
const FIX_3D: u8 = 3;
/// A week of the receiver's time.
const WEEK_MS: u64 = 7 * 86_400_000;
/// Ages of values in one MAVLink message.
const TOGETHER: Span = Span::from_secs(2);
/// Force of a shock: below its lowest limit, above nearly all flights' forces.
const SHOCK_MIN: f32 = 2.0 * GRAVITY;
/// Time between sensors, in one shock.
const AT_ONCE: Span = Span::from_millis(100);
/// Larger angles are invalid.
const TURN_DEG: f32 = 360.0;
const RATES_AGE: Span = Span::from_millis(500);

/// Columns of GPS.
const GPS: &str = "I Status NSats HDop Lat Lng Alt Spd GCrs VZ GWk|Week GMS|TimeMS RelAlt|RAlt";
/// Columns of RCOU.
const RCOU: &str = "C1|Ch1|Chan1 C2|Ch2|Chan2 C3|Ch3|Chan3 C4|Ch4|Chan4 C5|Ch5|Chan5 C6|Ch6|Chan6 C7|Ch7|Chan7 \
    C8|Ch8|Chan8 C9|Ch9 C10|Ch10 C11|Ch11 C12|Ch12";

pub(super) const HANDLERS: &[Handler] = &[
    handler("ATT", "Roll Pitch Yaw DesRoll DesPitch", attitude),
    handler("AHR2", "Roll Pitch Yaw Alt Lat Lng", second_estimate),
    handler("RATE", "RDes PDes YDes R P Y", rates),
    handler("IMU IMU2:1 IMU3:2", "I GyrX GyrY GyrZ AccX AccY AccZ T|Temp GH|GyHlt AH|AcHlt", imu),
    handler("GPS GPS2:1 GPSB:2", GPS, gnss),
    handler("GPA GPA2:1 GPAB:2", "I HAcc", accuracy),
    handler("BARO BAR2:1 BAR3:2", "I Press Temp Health|H CRt Alt", air),
    handler("MAG MAG2:1 MAG3:2", "I Health MagX MagY MagZ", compass),
    handler("RCOU", RCOU, outputs),
    handler("POS", "Lat Lng Alt RelHomeAlt|RelAlt", position).fact(),
    handler("ORGN", "Type Alt", origin),
    handler("XKF1 XKF6:1 NKF1 NKF6:1 EKF1", "C VN VE VD PN PE PD", local),
    handler("XKF4 XKF9:1 NKF4 NKF9:1 EKF4", "C SV SP SH SM SS PI", estimator),
    handler("VIBE", "IMU VibeX VibeY VibeZ Clip Clip0 Clip1 Clip2", vibration),
    handler("CTUN THR", "ThO|ThrOut CRt|CRate As|Aspd DCRt|DCRate", hud),
    handler("ARSP ASP2:1", "I Airspeed", airspeed),
];

fn attitude(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let Some([roll, pitch, yaw]) = given.singles(0) else { return };
    if [roll, pitch, yaw].into_iter().any(|degrees: f32| degrees.abs() > TURN_DEG) {
        return;
    }
    state.heading_deg.set(given.at, yaw.rem_euclid(360.0));
    let [roll, pitch, yaw] = [roll, pitch, signed(yaw)].map(|degrees| Radians(degrees.to_radians()));
    let known = state.rates.within(given.at, RATES_AGE);
    if let Some([roll, pitch]) = given.singles(3)
        && [roll, pitch].into_iter().all(|degrees: f32| degrees.abs() <= TURN_DEG)
    {
        let [roll, pitch] = [roll, pitch].map(|degrees| Radians(degrees.to_radians()));
        let rates = known.map(|known| WantedRates { about: known.wanted, of: None });
        out.observe(&Observation::AttitudeSetpoint(AttitudeSetpoint { roll, pitch, rates }));
    }
    let rates = known.map(|known| known.flown);
    out.observe(&Observation::Attitude(Attitude { roll, pitch, yaw, rates, boot_ms: boot_ms(given) }));
}

/// Second estimate: without the estimator's position the first place holds the receiver's, so the second does not count either.
fn second_estimate(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let angles =
        given.singles(0).filter(|angles: &[f32; 3]| angles.iter().all(|angle| angle.abs() <= TURN_DEG));
    let position = given.number(4).zip(given.number(5)).filter(|_| state.facts.has_positions);
    let position = position.and_then(|(north, east)| place(north, east));
    out.observe(&Observation::SecondEstimate(SecondEstimate {
        attitude: angles
            .map(|[roll, pitch, yaw]| [roll, pitch, signed(yaw)].map(|angle| Radians(angle.to_radians()))),
        position,
        altitude: given.single(3).map(Metres).filter(|_| position.is_some()),
    }));
}

/// 0 to 360 in the log, -180 to 180 in MAVLink.
fn signed(yaw_deg: f32) -> f32 {
    (yaw_deg + 180.0).rem_euclid(360.0) - 180.0
}

/// Degrees a second, until 3.3 hundredths (`Log_Write_Rate` of `ArduCopter`). Without a version the gyro decides.
fn rates(state: &mut State, given: &Given<'_>, _: &mut Out<'_>) {
    let Some(rates) = given.singles::<6>(0) else { return };
    let [_, _, _, flown @ ..] = rates;
    if let Some(gyro) = state.gyro.within(given.at, AT_ONCE) {
        state.rate_unit.take(norm(flown), gyro.to_degrees());
    }
    let Some(unit_deg) = state.facts.rate_unit_deg().or(state.rate_unit.degrees()) else { return };
    let [roll, pitch, yaw, flown @ ..] = rates.map(|rate| RadiansPerSecond((rate * unit_deg).to_radians()));
    state.rates.set(given.at, Rates { wanted: [roll, pitch, yaw], flown });
}

fn boot_ms(given: &Given<'_>) -> Option<u32> {
    // 32 bits, as in MAVLink.
    given.boot_us.map(|us| (us / 1_000) as u32)
}

fn imu(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let instance = given.instance(0);
    state.health(instance, GYRO, given.single(8));
    state.health(instance, ACCELEROMETER, given.single(9));
    let rate = given.singles(1).map(|rate: [f32; 3]| rate.map(RadiansPerSecond));
    let acceleration = given.singles(4).map(|acceleration: [f32; 3]| acceleration.map(MetresPerSecond2));
    if rate.is_none() && acceleration.is_none() {
        return;
    }
    if let Some(force) =
        acceleration.map(|axes| norm(axes.map(|axis| axis.0))).filter(|force| *force > SHOCK_MIN)
    {
        let other = state.shaken.replace((instance, given.at));
        // One such sensor may be broken. The first one's values are judged as they are.
        let agrees = other.is_some_and(|(by, at)| by != instance && given.at.since(at) <= AT_ONCE);
        if instance > 0 && agrees {
            out.observe(&Observation::Shock(MetresPerSecond2(force)));
        }
    }
    state.has_inertial = true;
    if let Some(rate) = rate.filter(|_| instance == 0) {
        state.gyro.set(given.at, norm(rate.map(|axis| axis.0)));
    }
    // A sensor without a thermometer has 0.
    let temperature = given.single(7).filter(|celsius| *celsius != 0.0).map(Celsius);
    let field = state.fields.get_mut(usize::from(instance)).and_then(Option::take);
    out.observe(&Observation::Imu(Imu { instance, acceleration, rate, field, temperature }));
}

fn place(latitude_deg: f64, longitude_deg: f64) -> Option<Position> {
    let valid = latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0;
    let somewhere = latitude_deg != 0.0 || longitude_deg != 0.0;
    (valid && somewhere).then_some(Position { latitude_deg, longitude_deg })
}

fn gnss(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let Some(fix) = given.byte(1) else { return };
    let instance = given.instance(0);
    let has_position = fix >= FIX_2D;
    let position = given.number(4).zip(given.number(5)).and_then(|(north, east)| place(north, east));
    let accuracy =
        state.accuracy.get(usize::from(instance)).and_then(|known| known.within(given.at, TOGETHER));
    let speed = given.single(7);
    let gnss = Gnss {
        instance,
        fix,
        satellites: given.byte(2),
        // 99.99 means unknown.
        hdop: given.single(3).filter(|hdop| *hdop > 0.0 && *hdop < 99.0),
        accuracy,
        position: position.filter(|_| has_position),
        altitude: given.single(6).filter(|_| has_position).map(Metres),
        speed: speed.map(MetresPerSecond),
        course: given.single(8).map(|degrees| Radians(degrees.to_radians())),
        measured_ms: receiver_ms(given),
    };
    out.observe(&Observation::Gnss(gnss));
    if instance == 0 {
        time(state, given, fix, out);
        if let Some(speed) = speed {
            state.ground_speed.set(given.at, speed);
            state.speed(given.at, if fix >= FIX_3D { speed } else { 0.0 });
        }
        if fix >= FIX_3D && !state.facts.has_positions {
            position_of_gnss(state, given, &gnss, out);
        }
    }
}

/// Modulo 2^32.
fn receiver_ms(given: &Given<'_>) -> Option<NonZeroU32> {
    let (week, ms) = given.unsigned(10).zip(given.unsigned(11))?;
    NonZeroU32::new(week.wrapping_mul(WEEK_MS).wrapping_add(ms) as u32)
}

/// UTC by the receiver's time of the week.
fn time(state: &mut State, given: &Given<'_>, fix: u8, out: &mut Out<'_>) {
    /// 1980-01-06 in seconds since 1970.
    const GPS_EPOCH_S: u64 = 315_964_800;
    const SAID_EVERY: Span = Span::from_secs(1);
    let (Some(week), Some(ms)) = (given.unsigned(10), given.unsigned(11)) else { return };
    if fix < FIX_3D || week > u64::from(u16::MAX) || ms > WEEK_MS {
        return;
    }
    // Leap seconds came at the ends of June 2012, June 2015 and December 2016 (IERS Bulletin C).
    let leap_s = match week {
        0..1_695 => 15,
        1_695..1_851 => 16,
        1_851..1_930 => 17,
        _ => 18,
    };
    let utc_us = (GPS_EPOCH_S - leap_s) * 1_000_000 + (week * WEEK_MS + ms) * 1_000;
    if !UTC_MICROS.contains(&utc_us) || state.utc_said.is_some_and(|at| given.at.since(at) < SAID_EVERY) {
        return;
    }
    state.utc_said = Some(given.at);
    out.item(Item::Epoch(utc_us.saturating_sub(given.at.as_micros())));
    if let Some(boot_ms) = boot_ms(given) {
        out.observe(&Observation::SystemTime(SystemTime { utc_micros: Some(utc_us), boot_ms }));
    }
}

/// Position before 2015, without POS: receiver's position, barometer's height.
fn position_of_gnss(state: &mut State, given: &Given<'_>, gnss: &Gnss, out: &mut Out<'_>) {
    let Some(Metres(altitude)) = gnss.altitude else { return };
    let first = *state.first_altitude.get_or_insert(altitude);
    let height = state.baro_height.within(given.at, TOGETHER);
    let above_home = || state.home_altitude.map(|home| altitude - home);
    let relative = given.single(12).or(height).or_else(above_home).unwrap_or(altitude - first);
    state.height(relative);
    state.altitude.set(given.at, altitude);
    out.observe(&Observation::GlobalPosition(GlobalPosition {
        position: gnss.position,
        altitude: Metres(altitude),
        relative_altitude: Metres(relative),
        velocity: velocity(state, given).map(MetresPerSecond),
    }));
    // Without an estimator's better one.
    if let Some([speed, course]) = given.singles(7) {
        let (east, north) = course.to_radians().sin_cos();
        let of_barometer = || state.climb.within(given.at, TOGETHER);
        let of_receiver = || given.single(9).map(|down| -down);
        let climb = state.told_climb.within(given.at, TOGETHER).or_else(of_receiver).or_else(of_barometer);
        state.receiver_velocity.set(given.at, [speed * north, speed * east, -climb.unwrap_or(0.0)]);
    }
}

fn velocity(state: &State, given: &Given<'_>) -> [f32; 3] {
    let of_receiver = || state.receiver_velocity.within(given.at, TOGETHER);
    state.velocity.within(given.at, TOGETHER).or_else(of_receiver).unwrap_or_default()
}

fn accuracy(state: &mut State, given: &Given<'_>, _: &mut Out<'_>) {
    /// Full 16 bits of centimetres.
    const FULL_M: f32 = 655.0;
    let known = given.single(1).filter(|metres| *metres > 0.0 && *metres < FULL_M);
    if let (Some(metres), Some(slot)) = (known, state.accuracy.get_mut(usize::from(given.instance(0)))) {
        slot.set(given.at, Metres(metres));
    }
}

fn air(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let instance = given.instance(0);
    state.health(instance, PRESSURE, given.single(3));
    if instance == 0 {
        if let Some(climb) = given.single(4) {
            state.climb.set(given.at, climb);
        }
        if let Some(height) = given.single(5) {
            state.baro_height.set(given.at, height);
        }
    }
    let pressure =
        given.single(1).filter(|pascals| *pascals > 0.0).map(|pascals| Hectopascals(pascals / 100.0));
    let temperature = given.single(2).map(Celsius);
    out.observe(&Observation::Air(Air { instance, pressure, temperature }));
}

/// mG; MAVLink sends it with the inertial sensor of that number.
fn compass(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let instance = given.instance(0);
    // SYS_STATUS is about the first one.
    if instance == 0 {
        state.health(0, MAGNETOMETER, given.single(1));
    }
    let Some(field) = given.singles(2).map(|field: [f32; 3]| field.map(|milli| Gauss(milli / 1e3))) else {
        return;
    };
    let before = state.fields.get_mut(usize::from(instance)).and_then(|slot| slot.replace(field));
    // No inertial sensor took it.
    if before.is_some() && !state.has_inertial {
        out.observe(&Observation::Imu(Imu { instance, field: before, ..Imu::default() }));
    }
}

fn outputs(_: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let pulse = |output: usize| given.unsigned(output).and_then(|pulse| pulse.try_into().ok()).unwrap_or(0);
    let pulses = std::array::from_fn::<u16, MOTORS_MAX, _>(pulse);
    out.observe(&Observation::Outputs(Outputs { port: 0, pulses }));
}

fn position(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let (Some(altitude), Some(relative)) = (given.single(2), given.single(3)) else { return };
    state.facts.has_positions = true;
    state.height(relative);
    state.altitude.set(given.at, altitude);
    let position = given.number(0).zip(given.number(1)).and_then(|(north, east)| place(north, east));
    out.observe(&Observation::GlobalPosition(GlobalPosition {
        position,
        altitude: Metres(altitude),
        relative_altitude: Metres(relative),
        velocity: velocity(state, given).map(MetresPerSecond),
    }));
}

/// The estimator's own origin (type 0) does not count.
fn origin(state: &mut State, given: &Given<'_>, _: &mut Out<'_>) {
    const HOME: u64 = 1;
    if given.unsigned(0) == Some(HOME) {
        state.home_altitude = given.single(1);
    }
}

/// EKF3's begin with an X, EKF2's with an N.
fn is_flying(state: &State, given: &Given<'_>) -> bool {
    let family = given.message.format().name.as_bytes().first();
    !matches!(
        (state.facts.estimator, family),
        (Some(2), Some(b'X')) | (Some(3), Some(b'N')) | (Some(0), Some(b'E' | b'N' | b'X'))
    )
}

fn local(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    if given.instance(0) != state.primary_core || !is_flying(state, given) {
        return;
    }
    let Some([north, east, down]) = given.singles(1) else { return };
    state.velocity.set(given.at, [north, east, down]);
    if let Some(position) = given.singles(4) {
        let position = position.map(Metres);
        let velocity = [north, east, down].map(MetresPerSecond);
        out.observe(&Observation::LocalPosition(LocalPosition { position, velocity }));
    }
}

/// As in `EKF_STATUS_REPORT`, in hundredths: roots of innovation test ratios, `ArduPilot`'s variances. The status has
/// the lower ten bits of `EKF_STATUS_FLAGS`.
fn estimator(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    const SAME_BITS: u64 = 0x3FF;
    const STATUS_GPS_GLITCHING: u64 = 1 << 14;
    const GPS_GLITCHING: u16 = 1 << 15;
    if !is_flying(state, given) {
        return;
    }
    if let Some(primary) = given.byte(6) {
        state.primary_core = primary;
    }
    if given.instance(0) != state.primary_core {
        return;
    }
    let status = given.unsigned(5);
    let flags = status.map_or(0, |status| {
        let glitching = if status & STATUS_GPS_GLITCHING == 0 { 0 } else { GPS_GLITCHING };
        (status & SAME_BITS) as u16 | glitching
    });
    // Zeros before the filter runs are not variances.
    let runs = status.is_none_or(|status| status & SAME_BITS != 0);
    let known = |slot: usize| given.single(slot).filter(|value| *value >= 0.0 && runs);
    out.observe(&Observation::Estimator(Estimator {
        scale: EstimatorScale::Variance,
        velocity: known(1),
        position_horizontal: known(2),
        position_vertical: known(3),
        compass: known(4),
        flags,
    }));
}

/// Vibration, since 4.1 by sensor; `VIBRATION` has the first one's levels and all clips.
fn vibration(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let count = |slot: usize| given.unsigned(slot).and_then(|count| u32::try_from(count).ok());
    let instance = usize::from(given.byte(0).unwrap_or(0));
    if let (Some(clips), Some(slot)) = (count(4), state.clips.get_mut(instance)) {
        *slot = clips;
    }
    for (slot, clips) in (5..8).zip(&mut state.clips) {
        *clips = count(slot).unwrap_or(*clips);
    }
    if instance == 0 {
        let levels = [1, 2, 3].map(|slot| given.single(slot).filter(|level| *level >= 0.0));
        out.observe(&Observation::Vibration(Vibration {
            scale: VibrationScale::PerAxis,
            levels,
            clips: state.clips,
        }));
    }
}

fn hud(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    // A copter's is in cm/s; a plane has none.
    let rate =
        |slot| given.single(slot).map(|climb| if given.is_integer(slot) { climb / 100.0 } else { climb });
    let climb = rate(1);
    if let Some(climb) = climb {
        state.told_climb.set(given.at, climb);
    }
    if let Some(wanted) = rate(3) {
        out.observe(&Observation::ClimbWanted(MetresPerSecond(wanted)));
    }
    let throttle = given.single(0).map(|throttle| match state.facts.craft {
        Craft::Plane | Craft::Rover => throttle / 100.0,
        // Thousandths before 3.4.
        _ if given.is_integer(0) => throttle / 1_000.0,
        _ => throttle,
    });
    if let Some(throttle) = throttle {
        state.throttle(given.at, throttle);
    }
    let airspeed = state.airspeed.within(given.at, TOGETHER).or_else(|| given.single(2));
    out.observe(&Observation::Hud(Hud {
        airspeed: airspeed.map(MetresPerSecond),
        groundspeed: ground_speed(state, given).map(MetresPerSecond),
        heading_deg: state.heading_deg.within(given.at, TOGETHER),
        throttle: throttle
            .filter(|throttle| (-1.0..=1.0).contains(throttle))
            .map(|part| Fraction(part.max(0.0))),
        altitude: state.altitude.within(given.at, TOGETHER).map(Metres),
        climb: climb.or_else(|| state.climb.within(given.at, TOGETHER)).map(MetresPerSecond),
    }));
}

fn ground_speed(state: &State, given: &Given<'_>) -> Option<f32> {
    let estimated = state.velocity.within(given.at, TOGETHER).map(|[north, east, _]| north.hypot(east));
    estimated.or_else(|| state.ground_speed.within(given.at, TOGETHER))
}

fn airspeed(state: &mut State, given: &Given<'_>, _: &mut Out<'_>) {
    if let Some(airspeed) = given.single(1).filter(|_| given.instance(0) == 0) {
        state.airspeed.set(given.at, airspeed);
    }
}
