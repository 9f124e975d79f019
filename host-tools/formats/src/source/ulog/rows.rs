//! Every field of every message under its own name.
//!
//! `ULog` has no units. PX4's names end in units (`voltage_v`, `vel_m_s`): `unit` uses that.

use super::format::{Field, Layout, Number};
use super::message::words;
use crate::mavlink::values::Scalar;
use crate::source::item::{CellValue, ColumnType, Columns, Table};

/// A topic's instance. There may be two batteries.
pub(super) const INSTANCE: &str = "multi_id";

pub(super) fn table(layout: &Layout) -> Table {
    let mut columns = Columns::default();
    columns.push(INSTANCE, "", ColumnType::Unsigned);
    for field in &layout.fields {
        let (unit, kind) = (unit(&field.name), kind(field.number));
        match elements(field) {
            None => columns.push(&field.name, unit, kind),
            Some(count) => {
                (0..count)
                    .for_each(|element| columns.push(&format!("{}[{element}]", field.name), unit, kind));
            }
        }
    }
    Table { name: table_name(layout), columns: columns.finish() }
}

pub(super) fn columns(layout: &Layout) -> usize {
    1 + layout.fields.iter().map(|field| elements(field).unwrap_or(1) as usize).sum::<usize>()
}

/// Other than topics.
pub(super) const DEFAULTS: &str = "default_parameters";
pub(super) const INFORMATION: &str = "information";
pub(super) const PARAMETERS: &str = "parameters";
pub(super) const TEXTS: &str = "logged_messages";
const OWN: [&str; 4] = [DEFAULTS, INFORMATION, PARAMETERS, TEXTS];

pub(super) fn table_name(layout: &Layout) -> String {
    let name = layout.name.replace('/', "_");
    let is_taken =
        OWN.contains(&name.as_str()) || name.get(..5).is_some_and(|ours| ours.eq_ignore_ascii_case("HUMS_"));
    if is_taken { format!("topic_{name}") } else { name }
}

pub(super) fn values<'a>(layout: &Layout, instance: u8, data: &'a [u8]) -> Vec<CellValue<'a>> {
    let mut values = Vec::with_capacity(layout.fields.len() + 1);
    values.push(CellValue::Number(Scalar::Unsigned(u64::from(instance))));
    for field in &layout.fields {
        let (at, bytes) = (field.offset as usize, field.number.bytes());
        if field.number == Number::CHAR {
            let text = data.get(at..at + field.array.unwrap_or(1) as usize);
            values.push(text.map_or(CellValue::Unknown, |text| CellValue::Text(words(text))));
            continue;
        }
        for element in 0..field.array.unwrap_or(1) as usize {
            let at = at + element * bytes;
            let number = data.get(at..at + bytes);
            values.push(number.and_then(|bytes| field.number.value(bytes)).unwrap_or(CellValue::Unknown));
        }
    }
    values
}

fn elements(field: &Field) -> Option<u32> {
    field.array.filter(|_| field.number != Number::CHAR)
}

fn kind(number: Number) -> ColumnType {
    match number {
        Number::CHAR => ColumnType::Text,
        Number::Of(kind) => ColumnType::of(kind),
        Number::Bool => ColumnType::Flag,
    }
}

/// Ends of names, longest first. PX4 v1.8 to v1.16.
const UNITS: &str = "_m_s_s=m/s2 _m_s2=m/s2 _m_s=m/s _rad_s=rad/s _deg_s=deg/s _rad=rad _deg=deg _msl_m=m _alt_meter=m \
    _ellipsoid_m=m _celcius=degC _celsius=degC _usec=us _us=us _ms=ms _hz=Hz _pa=Pa _mah=mAh _wh=Wh \
    _ga=G _gs=G _rpm=rpm _percent=% _cell_v=V _filtered_v=V voltage_v=V 5v_v=V 3v3_v=V current_a=A \
    _average_a=A _filtered_a=A";

/// Names without their unit at the end.
const NAMED: &str = "timestamp=us timestamp_sample=us esc_voltage=V esc_current=A esc_temperature=degC vx=m/s vy=m/s \
    vz=m/s ref_alt=m dist_bottom=m eph=m epv=m time_remaining_s=s voltage5V_v=V";

/// Empty if unknown.
pub(super) fn unit(name: &str) -> &'static str {
    let name = name.rsplit_once('.').map_or(name, |(_, last)| last);
    let pairs = |table: &'static str| table.split(' ').filter_map(|pair| pair.split_once('='));
    let named = pairs(NAMED).find(|(known, _)| *known == name);
    let ending = || pairs(UNITS).find(|(ending, _)| name.ends_with(ending));
    named.or_else(ending).map_or("", |(_, unit)| unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::ulog::format::Formats;

    #[test]
    fn units_are_those_of_the_names() {
        let units = [
            "voltage_cell_v",
            "vel_m_s",
            "accelerometer_m_s2",
            "esc[2].esc_rpm",
            "q",
            "vel_m_s_not",
            "timestamp",
        ];
        assert_eq!(units.map(unit), ["V", "m/s", "m/s2", "rpm", "", "", "us"]);
    }

    #[test]
    fn names_that_come_twice_get_numbers() {
        let mut formats = Formats::default();
        formats
            .define(b"t:uint64_t timestamp;float a;float a;uint8_t multi_id;int8_t[2] b;int8_t[2] b;")
            .expect("defined");
        let columns = table(&formats.layout("t").expect("resolved")).columns;
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        let twice = [INSTANCE, "timestamp", "a", "a_2", "multi_id_2", "b[0]", "b[1]", "b[0]_2", "b[1]_2"];
        assert_eq!(names, twice);
    }

    #[test]
    fn a_row_has_a_value_for_each_column_even_where_the_padding_at_the_end_is_left_out() {
        let mut formats = Formats::default();
        formats
            .define(b"t/x:uint64_t timestamp;float[2] v;char[4] s;bool b;int8_t i;uint8_t[2] _padding0;")
            .expect("a definition");
        let layout = formats.layout("t/x").expect("resolved");
        let table = table(&layout);
        let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(
            (table.name.as_str(), names),
            ("t_x", vec![INSTANCE, "timestamp", "v[0]", "v[1]", "s", "b", "i"])
        );
        let data =
            [&7_u64.to_le_bytes()[..], &1.5_f32.to_le_bytes(), &f32::NAN.to_le_bytes(), b"ab\0c", &[1, 0xff]]
                .concat();
        let values = values(&layout, 2, &data);
        assert_eq!(values.len(), table.columns.len());
        assert_eq!(
            values[..3],
            [
                CellValue::Number(Scalar::Unsigned(2)),
                CellValue::Number(Scalar::Unsigned(7)),
                CellValue::Number(Scalar::Single(1.5))
            ]
        );
        assert_eq!(
            values[4..],
            [CellValue::Text("ab"), CellValue::Flag(true), CellValue::Number(Scalar::Signed(-1))]
        );
    }
}
