//! The schema of each topic.

use std::collections::{BTreeMap, BTreeSet};

use hums_dialect::Kind;

use super::Topic;
use super::protobuf::{
    BOOL, BYTES, DOUBLE, ENUM, Enumeration, FLOAT, Field, INT32, INT64, MESSAGE, SINT64, STRING, Type,
    UINT64, file,
};
use crate::row::{Row, plain_name};
use crate::source::item::{ColumnType, Table};

pub(super) struct Schema {
    pub(super) name: String,
    pub(super) topic: String,
    /// A `FileDescriptorSet`.
    pub(super) descriptors: Vec<u8>,
    /// The channel's metadata: units.
    pub(super) about: Vec<(String, String)>,
}

const TIME_FILE: &str = "google/protobuf/timestamp.proto";
const TIMESTAMP: Type = (MESSAGE, ".google.protobuf.Timestamp");

type Definition<'a> = (&'a str, Vec<Field>, Option<Enumeration>);

/// `None` of a message without a definition, or a table without a row.
pub(super) fn schema(topic: Topic, rows: &BTreeMap<&'static str, Row>) -> Option<Schema> {
    Some(match topic {
        Topic::Mavlink(system, component, id) => {
            let message = hums_dialect::message(id)?;
            let fields = message.fields.iter().map(|field| {
                let is_list = field.array > 0 && field.kind != Kind::Char;
                (field.name.to_owned(), of_kind(field.kind), is_list, field.units)
            });
            let path = format!("/mavlink/{system}/{component}/{}", message.name);
            plain("mavlink", message.name, path, fields)
        }
        Topic::Opaque => {
            let numbers = ["system", "component", "id", "sequence"].map(|name| (name, UINT64));
            let fields = numbers.into_iter().chain([("payload", BYTES)]);
            let fields = fields.map(|(name, kind)| (name.to_owned(), kind, false, ""));
            plain("mavlink", "Opaque", "/opaque".to_owned(), fields)
        }
        Topic::Row(table) => {
            let package = if table.starts_with("HUMS_") { "hums" } else { "log" };
            let mut taken = BTreeSet::new();
            let fields = rows.get(table)?.cells.iter().map(|(column, cell)| {
                let (name, unit) = plain_name(column);
                let name = Table::free_name(&mut taken, &identifier(&name));
                (name, of_column(cell.column_type()), false, unit)
            });
            plain(package, &identifier(table), format!("/{package}/{table}"), fields)
        }
        Topic::Battery(id) => {
            let numbers = [
                ("voltage", "V"),
                ("current", "A"),
                ("remaining", "1"),
                ("consumed", "Ah"),
                ("temperature", "degC"),
            ];
            let numbers = numbers.map(|(name, unit)| (name.to_owned(), FLOAT, false, unit));
            let fields = [("timestamp".to_owned(), TIMESTAMP, false, "")].into_iter().chain(numbers);
            let fields = fields.chain([("cells".to_owned(), FLOAT, true, "V")]);
            plain("hums", "Battery", format!("/battery/{id}"), fields)
        }
        Topic::Position => foxglove("LocationFix", "/position"),
        Topic::Pose => foxglove("PoseInFrame", "/pose"),
        Topic::Texts => foxglove("Log", "/texts"),
    })
}

/// Fields are numbered from 1: name, type, list or not, unit.
fn plain(
    package: &str,
    name: &str,
    topic: String,
    fields: impl Iterator<Item = (String, Type, bool, &'static str)>,
) -> Schema {
    let (mut defined, mut about) = (Vec::new(), Vec::new());
    for (number, (name, kind, is_list, unit)) in (1..).zip(fields) {
        if !unit.is_empty() {
            about.push((format!("units.{name}"), unit.to_owned()));
        }
        defined.push(Field { name, number, kind, is_list });
    }
    let descriptors = with_time(package, &[(name, defined, None)]);
    Schema { name: format!("{package}.{name}"), topic, descriptors, about }
}

fn with_time(package: &str, messages: &[Definition<'_>]) -> Vec<u8> {
    let mut out = Vec::new();
    let time = ("Timestamp", fields(&[("seconds", INT64), ("nanos", INT32)]), None);
    file(&mut out, (TIME_FILE, "google.protobuf"), None, &[time]);
    file(&mut out, (&format!("{package}.proto"), package), Some(TIME_FILE), messages);
    out
}

fn fields(named: &[(&str, Type)]) -> Vec<Field> {
    let field = |(number, (name, kind)): (u32, &(&str, Type))| Field {
        name: (*name).to_owned(),
        number,
        kind: *kind,
        is_list: false,
    };
    (1..).zip(named).map(field).collect()
}

/// One of Foxglove's schemas, with those of its fields that we know: the numbers are Foxglove's.
fn foxglove(name: &str, topic: &str) -> Schema {
    const VECTOR: Type = (MESSAGE, ".foxglove.Vector3");
    let double = |name| (name, DOUBLE);
    let place = [
        double("latitude"),
        double("longitude"),
        double("altitude"),
        double("position_covariance"),
        ("position_covariance_type", (ENUM, ".foxglove.LocationFix.PositionCovarianceType")),
        ("timestamp", TIMESTAMP),
        ("frame_id", STRING),
    ];
    let place =
        fields(&place).into_iter().map(|field| Field { is_list: field.number == 4, ..field }).collect();
    let log = [
        ("timestamp", TIMESTAMP),
        ("level", (ENUM, ".foxglove.Log.Level")),
        ("message", STRING),
        ("name", STRING),
    ];
    let pose = [("timestamp", TIMESTAMP), ("frame_id", STRING), ("pose", (MESSAGE, ".foxglove.Pose"))];
    let parts = [("position", VECTOR), ("orientation", (MESSAGE, ".foxglove.Quaternion"))];
    let covariance: Enumeration =
        ("PositionCovarianceType", &["UNKNOWN", "APPROXIMATED", "DIAGONAL_KNOWN", "KNOWN"]);
    let level: Enumeration = ("Level", &["UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"]);
    let all = [
        ("LocationFix", place, Some(covariance)),
        ("Log", fields(&log), Some(level)),
        ("PoseInFrame", fields(&pose), None),
        ("Pose", fields(&parts), None),
        ("Vector3", fields(&["x", "y", "z"].map(double)), None),
        ("Quaternion", fields(&["x", "y", "z", "w"].map(double)), None),
    ];
    let descriptors = with_time("foxglove", &all);
    Schema { name: format!("foxglove.{name}"), topic: topic.to_owned(), descriptors, about: Vec::new() }
}

fn identifier(name: &str) -> String {
    let plain = |character: char| if character.is_ascii_alphanumeric() { character } else { '_' };
    let name: String = name.chars().map(plain).collect();
    if name.starts_with(|first: char| first.is_ascii_digit()) { format!("_{name}") } else { name }
}

const fn of_kind(kind: Kind) -> Type {
    match kind {
        Kind::Char => STRING,
        number => of_column(ColumnType::of(number)),
    }
}

const fn of_column(kind: ColumnType) -> Type {
    match kind {
        ColumnType::Unsigned => UINT64,
        ColumnType::Signed => SINT64,
        ColumnType::Single => FLOAT,
        ColumnType::Double => DOUBLE,
        ColumnType::Flag => BOOL,
        ColumnType::Text => STRING,
        ColumnType::Bytes => BYTES,
    }
}
