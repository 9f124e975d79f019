//! The schema of each topic.

use std::collections::{BTreeMap, BTreeSet};

use hums_dialect::Kind;

use super::Topic;
use super::protobuf::{Enumeration, Field, Type, file};
use crate::row::{CellType, Row, plain_name};
use crate::source::item::Table;

pub(super) struct Schema {
    pub(super) name: String,
    pub(super) topic: String,
    /// A `FileDescriptorSet`.
    pub(super) descriptors: Vec<u8>,
    /// The channel's metadata: units.
    pub(super) about: Vec<(String, String)>,
}

const TIME_FILE: &str = "google/protobuf/timestamp.proto";
const TIMESTAMP: Type = Type::Message(".google.protobuf.Timestamp");

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
            let numbers = ["system", "component", "id", "sequence"].map(|name| (name, Type::Uint64));
            let fields = numbers.into_iter().chain([("payload", Type::Bytes)]);
            let fields = fields.map(|(name, kind)| (name.to_owned(), kind, false, ""));
            plain("mavlink", "Opaque", "/opaque".to_owned(), fields)
        }
        Topic::Row(table) => {
            let package = if table.starts_with("HUMS_") { "hums" } else { "log" };
            let mut taken = BTreeSet::new();
            let fields = rows.get(table)?.cells.iter().map(|(column, cell)| {
                let (name, unit) = plain_name(column);
                let name = Table::free_name(&mut taken, &identifier(&name));
                (name, of_cell(cell.cell_type()), false, unit)
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
            let numbers = numbers.map(|(name, unit)| (name.to_owned(), Type::Float, false, unit));
            let fields = [("timestamp".to_owned(), TIMESTAMP, false, "")].into_iter().chain(numbers);
            let fields = fields.chain([("cells".to_owned(), Type::Float, true, "V")]);
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
    let time = ("Timestamp", fields(&[("seconds", Type::Int64), ("nanos", Type::Int32)]), None);
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
    const VECTOR: Type = Type::Message(".foxglove.Vector3");
    let double = |name| (name, Type::Double);
    let place = [
        double("latitude"),
        double("longitude"),
        double("altitude"),
        double("position_covariance"),
        ("position_covariance_type", Type::Enum(".foxglove.LocationFix.PositionCovarianceType")),
        ("timestamp", TIMESTAMP),
        ("frame_id", Type::String),
    ];
    let place =
        fields(&place).into_iter().map(|field| Field { is_list: field.number == 4, ..field }).collect();
    let log = [
        ("timestamp", TIMESTAMP),
        ("level", Type::Enum(".foxglove.Log.Level")),
        ("message", Type::String),
        ("name", Type::String),
    ];
    let pose =
        [("timestamp", TIMESTAMP), ("frame_id", Type::String), ("pose", Type::Message(".foxglove.Pose"))];
    let parts = [("position", VECTOR), ("orientation", Type::Message(".foxglove.Quaternion"))];
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
        Kind::U8 | Kind::U16 | Kind::U32 | Kind::U64 => Type::Uint64,
        Kind::I8 | Kind::I16 | Kind::I32 | Kind::I64 => Type::Sint64,
        Kind::F32 => Type::Float,
        Kind::F64 => Type::Double,
        Kind::Char => Type::String,
    }
}

const fn of_cell(cell: CellType) -> Type {
    match cell {
        CellType::Count => Type::Uint64,
        CellType::Signed => Type::Sint64,
        CellType::Single => Type::Float,
        CellType::Double | CellType::Time => Type::Double,
        CellType::Flag => Type::Bool,
        CellType::Text => Type::String,
        CellType::Hex => Type::Bytes,
    }
}
