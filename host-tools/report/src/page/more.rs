//! Values for plots that are not observations, because checks do not need them: sticks, wind, setpoints. From
//! messages of a link, and from rows of an autopilot's own log.

use std::sync::LazyLock;

use hums_link::packet::Fields;

use super::plots::{Line, Plot};
use crate::mavlink::ids::{
    ATTITUDE_TARGET, NAV_CONTROLLER_OUTPUT, POSITION_TARGET_GLOBAL_INT, POSITION_TARGET_LOCAL_NED,
    RC_CHANNELS, WIND, WIND_COV,
};
use crate::source::item::{CellValue, Row, Rows};

const CHANNELS: u8 = 16;
/// `POSITION_TARGET_TYPEMASK`: ignored parts of a target.
const IGNORES_Z: u16 = 1 << 2;
const IGNORES_VELOCITY: [u16; 3] = [1 << 3, 1 << 4, 1 << 5];
/// `MAV_FRAME_LOCAL_NED`
const LOCAL_NED: u8 = 1;
/// `MAV_FRAME_GLOBAL`, `MAV_FRAME_GLOBAL_INT`: heights above mean sea level.
const ABOVE_SEA: [u8; 2] = [0, 5];

/// Callback for each value.
pub type ValueSink<'a> = dyn FnMut(Line, f32) + 'a;

/// An angle from north as a compass has it, 0 to 360 degrees.
pub fn compass_deg(radians: f32) -> f32 {
    radians.to_degrees().rem_euclid(360.0)
}

/// Yaw, radians, of a quaternion with its real part first.
fn yaw_rad([w, x, y, z]: [f32; 4]) -> f32 {
    (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z))
}

/// Wind to the north and to the east: its speed, and the direction from which it comes.
fn wind(north: f32, east: f32, put: &mut ValueSink<'_>) {
    put((Plot::Wind, 0), north.hypot(east));
    put((Plot::WindFrom, 0), compass_deg((-east).atan2(-north)));
}

/// The messages that have something of this.
pub fn is_of_use(id: u32) -> bool {
    matches!(
        id,
        RC_CHANNELS
            | WIND
            | WIND_COV
            | ATTITUDE_TARGET
            | NAV_CONTROLLER_OUTPUT
            | POSITION_TARGET_LOCAL_NED
            | POSITION_TARGET_GLOBAL_INT
    )
}

/// The values in a message.
pub fn of_message(id: u32, payload: &[u8], put: &mut ValueSink<'_>) {
    let fields = Fields(payload);
    match id {
        RC_CHANNELS => {
            for line in 0..fields.u8(40).min(CHANNELS) {
                channel(line, f32::from(fields.u16(4 + 2 * usize::from(line))), put);
            }
        }
        WIND => {
            put((Plot::Wind, 0), fields.f32(4));
            put((Plot::WindFrom, 0), fields.f32(0).rem_euclid(360.0));
        }
        WIND_COV => wind(fields.f32(8), fields.f32(12), put),
        ATTITUDE_TARGET => {
            let wanted = [4, 8, 12, 16].map(|at| fields.f32(at));
            // Zeros before there is one.
            if wanted.iter().any(|part| part.abs() > 0.5) {
                put((Plot::Heading, 1), compass_deg(yaw_rad(wanted)));
            }
        }
        NAV_CONTROLLER_OUTPUT => {
            put((Plot::Heading, 2), f32::from(fields.u16(20).cast_signed()).rem_euclid(360.0));
        }
        POSITION_TARGET_LOCAL_NED if fields.u8(50) == LOCAL_NED => {
            let ignored = fields.u16(48);
            if ignored & IGNORES_Z == 0 {
                put((Plot::Height, 1), -fields.f32(12));
            }
            for (axis, ignores) in (0_u8..).zip(IGNORES_VELOCITY) {
                if ignored & ignores == 0 {
                    put((Plot::Velocity, 3 + axis), fields.f32(16 + 4 * usize::from(axis)));
                }
            }
        }
        POSITION_TARGET_GLOBAL_INT
            if ABOVE_SEA.contains(&fields.u8(50)) && fields.u16(48) & IGNORES_Z == 0 =>
        {
            put((Plot::Altitude, 2), fields.f32(12));
        }
        _ => {}
    }
}

/// 0 and `UINT16_MAX`: not used.
fn channel(line: u8, pulse_us: f32, put: &mut ValueSink<'_>) {
    if pulse_us > 0.0 && pulse_us < f32::from(u16::MAX) {
        put((Plot::Sticks, line), pulse_us);
    }
}

/// Names of the rows that have something of this, and of those of parameters with their defaults.
pub const NAMES: [&str; 12] = [
    "RCIN",
    "XKF2",
    "NKF2",
    "ATT",
    "CTUN",
    "PARM",
    "input_rc",
    "wind",
    "wind_estimate",
    "vehicle_attitude_setpoint",
    "vehicle_local_position_setpoint",
    "default_parameters",
];

/// The rows that have something of this, and those of parameters with their defaults.
pub fn rows() -> Rows<'static> {
    static ALL: LazyLock<Vec<String>> = LazyLock::new(|| NAMES.map(str::to_owned).to_vec());
    Rows::Named(&ALL)
}

/// The values in a row of `ArduPilot`'s `DataFlash` or of PX4's topics, by the names there.
fn of_row(row: &Row<'_>, put: &mut ValueSink<'_>) {
    let number = |name: &str| number(row, name);
    match row.table.name.as_str() {
        "RCIN" => {
            for line in 0..CHANNELS {
                if let Some(pulse_us) = number(&format!("C{}", line + 1)) {
                    channel(line, pulse_us, put);
                }
            }
        }
        "input_rc" if is_first(row) => {
            let count = number("channel_count").unwrap_or(0.0) as u8;
            for line in 0..count.min(CHANNELS) {
                if let Some(pulse_us) = number(&format!("values[{line}]")) {
                    channel(line, pulse_us, put);
                }
            }
        }
        // Only the estimator's first core counts.
        "XKF2" | "NKF2" if number("C").is_none_or(|core| core < 0.5) => {
            if let Some((north, east)) = number("VWN").zip(number("VWE")) {
                wind(north, east, put);
            }
        }
        "wind" | "wind_estimate" if is_first(row) => {
            if let Some((north, east)) = number("windspeed_north").zip(number("windspeed_east")) {
                wind(north, east, put);
            }
        }
        "ATT" => {
            if let Some(yaw_deg) = number("DesYaw") {
                put((Plot::Heading, 1), yaw_deg.rem_euclid(360.0));
            }
        }
        "CTUN" => {
            if let Some(height_m) = number("DAlt") {
                put((Plot::Height, 1), height_m);
            }
        }
        "vehicle_attitude_setpoint" => {
            let [w, x, y, z] = ["q_d[0]", "q_d[1]", "q_d[2]", "q_d[3]"].map(number);
            if let (Some(w), Some(x), Some(y), Some(z)) = (w, x, y, z) {
                put((Plot::Heading, 1), compass_deg(yaw_rad([w, x, y, z])));
            }
        }
        "vehicle_local_position_setpoint" => {
            if let Some(down_m) = number("z") {
                put((Plot::Height, 1), -down_m);
            }
            for (line, name) in (3..).zip(["vx", "vy", "vz"]) {
                if let Some(speed) = number(name) {
                    put((Plot::Velocity, line), speed);
                }
            }
        }
        _ => {}
    }
}

/// Values in a row that are not observations.
#[derive(Clone, Debug, PartialEq)]
pub enum RowValues {
    /// Values of plots.
    Values(Box<[(Line, f32)]>),
    /// The default of a parameter.
    Default(ParameterDefault),
}

impl RowValues {
    /// The values of a row; `None` without any.
    pub fn of(row: &Row<'_>) -> Option<Self> {
        if let Some(default) = default_of(row) {
            return Some(Self::Default(default));
        }
        let mut values = Vec::new();
        of_row(row, &mut |line, value| values.push((line, value)));
        (!values.is_empty()).then(|| Self::Values(values.into()))
    }
}

/// The default of a parameter. There may be two: an airframe configuration's default comes before the
/// system's.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterDefault {
    /// The parameter.
    pub name: String,
    /// Its default.
    pub value: f64,
    /// It belongs to the airframe's configuration.
    pub is_of_airframe: bool,
}

/// The default in a row: `PARM` of `ArduPilot` has one since 4.3, and PX4's `ULog` has those that are
/// overridden.
fn default_of(row: &Row<'_>) -> Option<ParameterDefault> {
    let (name, value, is_of_airframe) = match row.table.name.as_str() {
        "PARM" => ("Name", "Default", false),
        "default_parameters" => ("name", "value", flag(row, "configuration")),
        _ => return None,
    };
    let Some(CellValue::Text(name)) = value_of(row, name) else { return None };
    let value = value_of(row, value).and_then(|value| value.number()).filter(|value| value.is_finite())?;
    Some(ParameterDefault { name: (*name).to_owned(), value, is_of_airframe })
}

fn value_of<'a, 'b>(row: &'a Row<'b>, name: &str) -> Option<&'a CellValue<'b>> {
    let place = row.table.columns.iter().position(|column| column.name == name)?;
    row.values.get(place)
}

pub(super) fn number(row: &Row<'_>, name: &str) -> Option<f32> {
    value_of(row, name)
        .and_then(|value| value.number())
        .map(|number| number as f32)
        .filter(|number| number.is_finite())
}

fn flag(row: &Row<'_>, name: &str) -> bool {
    matches!(value_of(row, name), Some(CellValue::Flag(true)))
}

pub(super) fn is_first(row: &Row<'_>) -> bool {
    number(row, "multi_id").is_none_or(|instance| instance < 0.5)
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_1_SQRT_2;
    use std::sync::Arc;

    use hums_link::packet::Packet;

    use super::*;
    use crate::mavlink::values::Scalar;
    use crate::source::item::{Column, ColumnType, Table};

    fn told(tell: impl FnOnce(&mut ValueSink<'_>)) -> Vec<(Line, f32)> {
        let mut all = Vec::new();
        tell(&mut |line, value| all.push((line, (value * 10.0).round() / 10.0)));
        all
    }

    fn message(packet: &Packet) -> Vec<(Line, f32)> {
        told(|put| of_message(packet.id(), packet.payload(), put))
    }

    fn row(name: &str, columns: &[&str], values: &[CellValue<'_>]) -> Vec<(Line, f32)> {
        with_row(name, columns, values, |row| told(|put| of_row(row, put)))
    }

    fn with_row<T>(
        name: &str,
        columns: &[&str],
        values: &[CellValue<'_>],
        take: impl FnOnce(&Row<'_>) -> T,
    ) -> T {
        let column =
            |name: &&str| Column { name: (*name).to_owned(), unit: String::new(), kind: ColumnType::Double };
        let table = Table { name: name.to_owned(), columns: columns.iter().map(column).collect() };
        take(&Row { table: &Arc::new(table), values })
    }

    const fn count(number: u64) -> CellValue<'static> {
        CellValue::Number(Scalar::Unsigned(number))
    }

    const fn single(number: f32) -> CellValue<'static> {
        CellValue::Number(Scalar::Single(number))
    }

    #[test]
    fn wind_comes_from_where_it_does_not_blow_to() {
        let east = Packet::new(WIND_COV).f32(8, 0.0).f32(12, 5.0);
        let from_west = [((Plot::Wind, 0), 5.0), ((Plot::WindFrom, 0), 270.0)];
        assert_eq!(message(&east), from_west);
        assert_eq!(message(&Packet::new(WIND).f32(0, -90.0).f32(4, 5.0)), from_west);
        let columns = ["C", "VWN", "VWE"];
        let values = [count(0), single(0.0), single(5.0)];
        assert_eq!(row("XKF2", &columns, &values), from_west);
        let second = [count(1), single(0.0), single(5.0)];
        assert_eq!(row("XKF2", &columns, &second), [], "another core is another estimate");
        let topic = ["multi_id", "windspeed_north", "windspeed_east"];
        assert_eq!(row("wind", &topic, &values), from_west);
    }

    #[test]
    fn what_is_wanted_is_told_where_it_is_not_to_be_ignored() {
        let target = Packet::new(POSITION_TARGET_LOCAL_NED).f32(12, -20.0).f32(16, 3.0).u8(50, LOCAL_NED);
        let ignoring = target.clone().u16(48, IGNORES_Z | IGNORES_VELOCITY[1] | IGNORES_VELOCITY[2]);
        assert_eq!(message(&ignoring), [((Plot::Velocity, 3), 3.0)]);
        assert_eq!(message(&target)[0], ((Plot::Height, 1), 20.0));
        let turned = Packet::new(ATTITUDE_TARGET).f32(4, FRAC_1_SQRT_2).f32(16, -FRAC_1_SQRT_2);
        assert_eq!(message(&turned), [((Plot::Heading, 1), 270.0)]);
        assert_eq!(message(&Packet::new(ATTITUDE_TARGET)), [], "there is none yet");
        let bearing = Packet::new(NAV_CONTROLLER_OUTPUT).u16(20, (-90_i16).cast_unsigned());
        assert_eq!(message(&bearing), [((Plot::Heading, 2), 270.0)]);
        let above_home = Packet::new(POSITION_TARGET_GLOBAL_INT).f32(12, 20.0).u8(50, 6);
        assert_eq!(message(&above_home), [], "not above the sea");
    }

    #[test]
    fn channels_that_are_not_used_have_no_line() {
        let sticks = Packet::new(RC_CHANNELS).u16(4, 1500).u16(6, 0).u16(8, u16::MAX).u16(10, 1900).u8(40, 4);
        assert_eq!(message(&sticks), [((Plot::Sticks, 0), 1500.0), ((Plot::Sticks, 3), 1900.0)]);
        let values = [count(1500), count(0)];
        assert_eq!(row("RCIN", &["C1", "C2"], &values), [((Plot::Sticks, 0), 1500.0)]);
        let values = [count(0), count(1), count(1100), count(1200)];
        let columns = ["multi_id", "channel_count", "values[0]", "values[1]"];
        assert_eq!(row("input_rc", &columns, &values), [((Plot::Sticks, 0), 1100.0)]);
    }

    #[test]
    fn a_default_is_the_one_that_the_log_tells() {
        let of = |value| [CellValue::Text("RTL_ALT"), single(15.0), single(value)];
        let parm = |value| with_row("PARM", &["Name", "Value", "Default"], &of(value), default_of);
        assert_eq!(parm(f32::NAN), None, "before 4.3, and where it is not known");
        assert_eq!(
            parm(20.0).map(|default| (default.name, default.value)),
            Some(("RTL_ALT".to_owned(), 20.0))
        );
        let values = [
            CellValue::Text("MC_ROLL_P"),
            CellValue::Number(Scalar::Double(6.5)),
            CellValue::Flag(false),
            CellValue::Flag(true),
        ];
        let columns = ["name", "value", "system", "configuration"];
        let default = with_row("default_parameters", &columns, &values, default_of).expect("one");
        assert!(default.is_of_airframe);
    }
}
