//! The line protocol of `InfluxDB`, `VictoriaMetrics`, `QuestDB` and Telegraf: `measurement,tags fields nanoseconds`
//! (`docs/decode.md`).
//!
//! A database keeps one point for a set of tags and a time. The record's clock has milliseconds, in which a
//! message may come twice: the second one's time is a nanosecond later, so that both are kept.

use std::path::Path;

use anyhow::Result;
use hums_core::clock::Instant;
use hums_core::health::Level;
use hums_core::observation::Observation;
use hums_dialect::{Field, Kind};
use hums_link::Frame;

use crate::context::Context;
use crate::field_names::free_name;
use crate::format::{Entry, Files, Finished, FormatDetails, GroupEncoder, SingleFile, Totals, Writer};
use crate::hex::hex;
use crate::made::OutputFile;
use crate::mavlink::ids::ACTUATOR_OUTPUT_STATUS;
use crate::mavlink::values::{FieldValue, Payload, Scalar};
use crate::reference::{Quantity, Reference};
use crate::row::{Cell, Row};
use crate::source::epochs::Epochs;
use crate::story::Story;
use crate::table::Table;
use crate::text::{push_finite, push_integer};

/// Columns of records that are tags: few values, used for grouping.
const TAGS: [&str; 3] = ["subsystem", "check", "counter"];
/// Names that the database or our tags have already: a field called `time` would be dropped.
pub(crate) const TAKEN: [&str; 5] = ["time", "vehicle", "session", "system", "component"];

/// The tags of every point.
#[derive(Clone, Debug, Default)]
pub struct Tags {
    session: String,
    vehicle: String,
}

impl Tags {
    /// The tags of a vehicle's session.
    pub fn new(session: &str, vehicle: &str) -> Self {
        Self { session: tag_value(session), vehicle: tag_value(vehicle) }
    }

    /// Tags in the order of the alphabet, as databases like it.
    fn push_session(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(b",session=");
        out.extend_from_slice(self.session.as_bytes());
    }

    fn push_vehicle(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(b",vehicle=");
        out.extend_from_slice(self.vehicle.as_bytes());
    }
}

/// Lines without their times, which are only settled when all come together in order.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    text: Vec<u8>,
    /// The end of each line in `text`, and its time.
    ends: Vec<(usize, Instant)>,
}

impl Lines {
    /// Whether it has no lines.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Number of lines.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// A line without fields is dropped.
    fn end(&mut self, start: usize, at: Instant, fields: usize) {
        if fields == 0 {
            self.text.truncate(start);
        } else {
            self.ends.push((self.text.len(), at));
        }
    }

    /// A point for a frame.
    pub fn frame(&mut self, tags: &Tags, at: Instant, frame: &Frame<'_>, known: Option<&Payload>) {
        let start = self.text.len();
        let name = Table::of(frame, known.is_some()).name();
        self.text.extend_from_slice(name.as_bytes());
        self.text.extend_from_slice(b",component=");
        push_integer(&mut self.text, u64::from(frame.component()));
        tags.push_session(&mut self.text);
        self.text.extend_from_slice(b",system=");
        push_integer(&mut self.text, u64::from(frame.system()));
        tags.push_vehicle(&mut self.text);
        let mut fields = Fields::of(&mut self.text);
        if let Some(payload) = known {
            payload.fields().for_each(|(field, value)| fields.value(field, value));
        } else {
            fields.name("sequence").integer(i64::from(frame.sequence()));
            fields.text("payload", &hex(frame.payload()));
        }
        let count = fields.count;
        self.end(start, at, count);
        if let Some(payload) = known.filter(|_| frame.id() == ACTUATOR_OUTPUT_STATUS) {
            self.actuators(tags, at, payload);
        }
    }

    fn actuators(&mut self, tags: &Tags, at: Instant, payload: &Payload) {
        let Some(active) = payload.number("active") else { return };
        self.reference(tags, at, None, [("Actuator Output Status".to_owned(), Scalar::Double(active))]);
        let values = payload.fields().find_map(|(field, value)| match value {
            FieldValue::Array(values) if field.name == "actuator" => Some(values),
            _ => None,
        });
        for (place, value) in values.into_iter().flat_map(|values| values.iter().enumerate()) {
            if active as u64 >> place & 1 == 1 {
                self.reference(tags, at, Some(place), [("Actuator Value".to_owned(), value)]);
            }
        }
    }

    /// Points of the reference system's measurement from an observation.
    pub fn observed(&mut self, tags: &Tags, at: Instant, reference: &Reference, observation: &Observation) {
        for (motor, quantities) in reference.told_by(observation) {
            let fields = quantities
                .into_iter()
                .filter_map(|quantity: Quantity| Some((quantity.field()?, reference.value(at, quantity)?)));
            self.reference(tags, at, motor, fields);
        }
    }

    fn reference(
        &mut self,
        tags: &Tags,
        at: Instant,
        motor: Option<usize>,
        values: impl IntoIterator<Item = (String, Scalar)>,
    ) {
        let start = self.text.len();
        self.text.extend_from_slice(b"HUMS");
        if let Some(motor) = motor {
            self.text.extend_from_slice(b",motor=");
            push_integer(&mut self.text, motor as u64);
        }
        tags.push_session(&mut self.text);
        tags.push_vehicle(&mut self.text);
        let mut fields = Fields::of(&mut self.text);
        for (name, value) in values {
            fields.float(&name, value);
        }
        let count = fields.count;
        self.end(start, at, count);
    }

    /// A point for a record of the monitor's own.
    pub fn row(&mut self, tags: &Tags, at: Instant, row: &Row) {
        let start = self.text.len();
        self.text.extend_from_slice(row.table.as_bytes());
        let mut own: Vec<(&str, String)> = Vec::new();
        for (name, cell) in &row.cells {
            if let (true, Cell::Text(text)) = (TAGS.contains(name), cell) {
                // A motor's counter, `motor3_run_time_s`, is the counter of a motor.
                let split = text.strip_prefix("motor").and_then(|rest| rest.split_once('_'));
                match split.filter(|(motor, _)| motor.parse::<u8>().is_ok()) {
                    Some((motor, counter)) if *name == "counter" => {
                        own.extend([("motor", motor.to_owned()), ("counter", counter.to_owned())]);
                    }
                    _ => own.push((name, text.clone())),
                }
            }
        }
        own.sort_unstable();
        for (name, value) in own.iter().filter(|(_, value)| !value.is_empty()) {
            self.text.extend_from_slice(format!(",{name}={}", tag_value(value)).as_bytes());
        }
        tags.push_session(&mut self.text);
        tags.push_vehicle(&mut self.text);
        let mut fields = Fields::of(&mut self.text);
        for (name, cell) in row.cells.iter().filter(|(name, _)| !TAGS.contains(name)) {
            fields.cell(name, cell);
            if let ("level", Cell::Text(level)) = (*name, cell) {
                fields.level_number(level);
            }
        }
        let count = fields.count;
        self.end(start, at, count);
    }
}

struct Fields<'a> {
    text: &'a mut Vec<u8>,
    count: usize,
}

impl<'a> Fields<'a> {
    fn of(text: &'a mut Vec<u8>) -> Self {
        Self { text, count: 0 }
    }

    /// Begins a field.
    fn name(&mut self, name: &str) -> &mut Self {
        self.text.push(if self.count == 0 { b' ' } else { b',' });
        self.count += 1;
        push_key(self.text, name);
        self.text.push(b'=');
        self
    }

    fn integer(&mut self, value: i64) {
        self.text.extend_from_slice(itoa::Buffer::new().format(value).as_bytes());
        self.text.push(b'i');
    }

    fn float(&mut self, name: &str, value: Scalar) {
        if value.as_f64().is_finite() {
            self.name(name);
            push_finite(self.text, value);
        }
    }

    fn value(&mut self, field: &Field, value: FieldValue<'_>) {
        let name = free_name(field.name, &TAKEN);
        match value {
            FieldValue::Scalar(scalar) => self.scalar(field, &name, scalar),
            FieldValue::Text(text) => self.text(&name, &String::from_utf8_lossy(text)),
            FieldValue::Array(values) => {
                for (place, scalar) in values.iter().enumerate() {
                    self.scalar(field, &format!("{name}[{place}]"), scalar);
                }
            }
        }
    }

    fn scalar(&mut self, field: &Field, name: &str, scalar: Scalar) {
        match scalar {
            Scalar::Single(_) | Scalar::Double(_) => self.float(name, scalar),
            Scalar::Signed(value) => self.name(name).integer(value),
            Scalar::Unsigned(value) if field.kind == Kind::U64 && field.units.is_empty() => {
                self.text(name, &value.to_string());
            }
            Scalar::Unsigned(value) => {
                // Larger values are more than 292,000 years of microseconds.
                if let Ok(value) = i64::try_from(value) {
                    self.name(name).integer(value);
                }
            }
        }
    }

    fn text(&mut self, name: &str, text: &str) {
        let out = &mut *self.name(name).text;
        out.push(b'"');
        for byte in text.bytes() {
            match byte {
                b'"' | b'\\' => out.extend_from_slice(&[b'\\', byte]),
                b'\n' | b'\r' => out.push(b' '),
                _ => out.push(byte),
            }
        }
        out.push(b'"');
    }

    /// A finding's level for databases that keep numbers only, as `VictoriaMetrics`: by [`Level::ALL`].
    fn level_number(&mut self, name: &str) {
        if let Some(number) = (0_i64..).zip(Level::ALL).find(|(_, level)| level.name() == name) {
            self.name("level_number").integer(number.0);
        }
    }

    fn cell(&mut self, name: &str, cell: &Cell) {
        match cell {
            Cell::Number(value) if name == "value" => self.float(name, *value),
            Cell::Number(Scalar::Unsigned(value)) => {
                self.name(name).integer(i64::try_from(*value).unwrap_or(i64::MAX));
            }
            Cell::Number(Scalar::Signed(value)) => self.name(name).integer(*value),
            Cell::Number(value) => self.float(name, *value),
            Cell::Time(at) => self.float(name, Scalar::Double(at.as_secs_f64())),
            Cell::Flag(value) => {
                self.name(name).text.extend_from_slice(if *value { b"true" } else { b"false" });
            }
            Cell::Text(text) => self.text(name, text),
            Cell::Hex(bytes) => self.text(name, &hex(bytes)),
            // A field of the line protocol has one type.
            Cell::Words(..) | Cell::Unknown(_) => {}
        }
    }
}

fn push_key(out: &mut Vec<u8>, key: &str) {
    for byte in key.bytes() {
        if matches!(byte, b',' | b' ' | b'=') {
            out.push(b'\\');
        }
        out.push(byte);
    }
}

/// A tag's value: escaped like a key. It may not end in a backslash nor hold a line's end.
fn tag_value(text: &str) -> String {
    let mut out = Vec::new();
    push_key(&mut out, &text.replace(['\n', '\r', '\\'], "_"));
    String::from_utf8_lossy(&out).into_owned()
}

/// Settles the times of lines as they come together in order.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    last_ns: u64,
}

impl Clock {
    /// Writes lines with their times, each a nanosecond after the one before at least.
    pub fn write(&mut self, lines: &Lines, epochs: &Epochs, out: &mut Vec<u8>) {
        let mut start = 0;
        for &(end, at) in &lines.ends {
            out.extend_from_slice(lines.text.get(start..end).unwrap_or_default());
            start = end;
            out.push(b' ');
            push_integer(out, self.settle(epochs.utc_us(at).unwrap_or_else(|| at.as_micros())));
            out.push(b'\n');
        }
    }

    /// A clock that was set back is let through: only points of the same millisecond are moved apart.
    fn settle(&mut self, micros: u64) -> u64 {
        const MILLISECOND_NS: u64 = 1_000_000;
        let ns = micros.saturating_mul(1000).min(i64::MAX as u64);
        let close = ns <= self.last_ns && self.last_ns - ns < MILLISECOND_NS;
        self.last_ns = if close { self.last_ns + 1 } else { ns };
        self.last_ns
    }
}

pub(super) struct Influx {
    file: SingleFile,
    messages: Clock,
    quantities: Clock,
    reference: Reference,
    text: Vec<u8>,
    /// Points so far.
    count: u64,
}

impl GroupEncoder for Lines {
    fn frame(&mut self, context: &Context, entry: &Entry<'_>) {
        self.frame(&context.tags, entry.at, entry.frame, entry.known);
    }

    fn row(&mut self, context: &Context, at: Instant, row: &Row) {
        self.row(&context.tags, at, row);
    }

    fn held_bytes(&self) -> usize {
        self.text.len() + size_of::<(usize, Instant)>() * self.ends.len()
    }
}

impl Writer for Influx {
    const ABOUT: FormatDetails = FormatDetails {
        has_observations: true,
        needs_identity: true,
        ..FormatDetails::new("influx", "Lines for InfluxDB, VictoriaMetrics and QuestDB", Files::One("lp"))
    };
    type Encoder = Lines;

    fn open(context: &Context, path: &Path) -> Result<Self> {
        Ok(Self {
            file: SingleFile::open(context, path)?,
            messages: Clock::default(),
            quantities: Clock::default(),
            reference: Reference::default(),
            text: Vec::new(),
            count: 0,
        })
    }

    fn part(&mut self, context: &Context, part: Lines, story: &Story) -> Result<()> {
        self.text.clear();
        self.messages.write(&part, &context.epochs, &mut self.text);
        let mut lines = Lines::default();
        for observed in &story.observed {
            let own = self.reference.observe(observed.at, observed.source, &observed.observation);
            if own && context.selection.has_time(observed.at, &context.epochs) {
                lines.observed(&context.tags, observed.at, &self.reference, &observed.observation);
            }
        }
        self.quantities.write(&lines, &context.epochs, &mut self.text);
        self.count += memchr::memchr_iter(b'\n', &self.text).count() as u64;
        self.file.write(&self.text)
    }

    fn is_empty(&self) -> bool {
        self.count == 0
    }

    fn finish(self, _: &Context, _: Totals) -> Result<Finished> {
        Ok(OutputFile::of(self.file.finish()?, "influx", &[(self.count, "point")]).into())
    }
}
