//! MCAP for Foxglove and `PlotJuggler`: each message in Protocol Buffers with its definition (`docs/decode.md` has
//! the topics).
//!
//! Times are UTC, or since power-on without UTC. Units of fields are in their channel's metadata.

mod container;
mod protobuf;
mod schemas;

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use hums_core::clock::Instant;
use hums_core::health::Level;
use hums_core::observation::Observation;

use crate::checked::finding_words;
use crate::context::Context;
use crate::format::{Entry, Files, Finished, FormatDetails, GroupEncoder, Totals, Writer};
use crate::made::OutputFile;
use crate::mavlink::values::{Array, FieldValue, Scalar};
use crate::motion::{Motion, quaternion_up};
use crate::plural::count;
use crate::row::{Cell, Row};
use crate::source::epochs::Epochs;
use crate::source::told::Finding;
use crate::story::{Story, StoryEntry};
use container::Container;
use protobuf::{bytes, double, float, inside, signed, unsigned, varint};
use schemas::Schema;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Topic {
    /// Of a system and a component.
    Mavlink(u8, u8, u32),
    Opaque,
    Row(&'static str),
    Position,
    Pose,
    Texts,
    /// By its number.
    Battery(u8),
}

/// Messages without their channels, which are numbered as parts come together in order.
#[derive(Default)]
pub(super) struct Messages {
    data: Vec<u8>,
    /// The topic, the time, and the end in `data`.
    entries: Vec<(Topic, u64, usize)>,
    /// The first row of each table, which has its columns.
    rows: BTreeMap<&'static str, Row>,
}

impl Messages {
    fn add(&mut self, topic: Topic, time_ns: u64, write: impl FnOnce(&mut Vec<u8>)) {
        write(&mut self.data);
        self.entries.push((topic, time_ns, self.data.len()));
    }

    fn iter(&self) -> impl Iterator<Item = (Topic, u64, &[u8])> {
        let begins = std::iter::once(0).chain(self.entries.iter().map(|(.., end)| *end));
        self.entries.iter().zip(begins).map(|((topic, time_ns, end), begin)| {
            (*topic, *time_ns, self.data.get(begin..*end).unwrap_or_default())
        })
    }
}

fn time_ns(epochs: &Epochs, at: Instant) -> u64 {
    epochs.utc_us(at).unwrap_or_else(|| at.as_micros()).saturating_mul(1000)
}

impl GroupEncoder for Messages {
    fn frame(&mut self, _: &Context, entry: &Entry<'_>) {
        let frame = entry.frame;
        let time_ns = entry.utc_us.unwrap_or_else(|| entry.at.as_micros()).saturating_mul(1000);
        let Some(payload) = entry.known else {
            return self.add(Topic::Opaque, time_ns, |out| {
                let numbers = [
                    frame.system().into(),
                    frame.component().into(),
                    frame.id().into(),
                    frame.sequence().into(),
                ];
                (1..).zip(numbers).for_each(|(number, value)| unsigned(out, number, value));
                bytes(out, 5, frame.payload());
            });
        };
        self.add(Topic::Mavlink(frame.system(), frame.component(), frame.id()), time_ns, |out| {
            for (number, (_, value)) in (1..).zip(payload.fields()) {
                match value {
                    FieldValue::Scalar(value) => scalar(out, number, value),
                    FieldValue::Array(values) => inside(out, number, |out| list(out, values)),
                    FieldValue::Text(text) => bytes(out, number, String::from_utf8_lossy(text).as_bytes()),
                }
            }
        });
    }

    fn row(&mut self, context: &Context, at: Instant, row: &Row) {
        let time_ns = time_ns(&context.epochs, at);
        self.rows.entry(row.table).or_insert_with(|| row.clone());
        self.add(Topic::Row(row.table), time_ns, |out| {
            (1..).zip(&row.cells).for_each(|(number, (_, value))| cell(out, number, value));
        });
    }

    fn finding(&mut self, context: &Context, finding: &Finding) {
        let time_ns = time_ns(&context.epochs, finding.at);
        let level = match finding.level {
            Level::Critical => 5,
            Level::Warning | Level::Stale => 3,
            Level::Ok | Level::Advisory => 2,
        };
        let words = finding_words(finding);
        self.add(Topic::Texts, time_ns, |out| log(out, time_ns, level, &words, "hums"));
    }

    fn held_bytes(&self) -> usize {
        self.data.len() + size_of::<(Topic, u64, usize)>() * self.entries.len() + ROW_BYTES * self.rows.len()
    }
}

/// Memory of the first row of a table, roughly.
const ROW_BYTES: usize = 2_048;

fn scalar(out: &mut Vec<u8>, number: u32, value: Scalar) {
    match value {
        Scalar::Unsigned(value) => unsigned(out, number, value),
        Scalar::Signed(value) => signed(out, number, value),
        Scalar::Single(value) => float(out, number, value),
        Scalar::Double(value) => double(out, number, value),
    }
}

fn list(out: &mut Vec<u8>, values: Array<'_>) {
    for value in values.iter() {
        match value {
            Scalar::Unsigned(value) => varint(out, value),
            Scalar::Signed(value) => varint(out, protobuf::zigzag(value)),
            Scalar::Single(value) => out.extend_from_slice(&value.to_le_bytes()),
            Scalar::Double(value) => out.extend_from_slice(&value.to_le_bytes()),
        }
    }
}

/// A value that is not known, or is a word in place of a number, is left out.
fn cell(out: &mut Vec<u8>, number: u32, value: &Cell) {
    match value {
        Cell::Number(value) => scalar(out, number, *value),
        Cell::Time(at) => double(out, number, at.as_secs_f64()),
        Cell::Flag(value) => unsigned(out, number, u64::from(*value)),
        Cell::Text(text) => bytes(out, number, text.as_bytes()),
        Cell::Hex(data) => bytes(out, number, data),
        Cell::Words(..) | Cell::Unknown(_) => {}
    }
}

/// `foxglove.Log`
fn log(out: &mut Vec<u8>, time_ns: u64, level: u64, words: &str, name: &str) {
    timestamp(out, 1, time_ns);
    unsigned(out, 2, level);
    bytes(out, 3, words.as_bytes());
    bytes(out, 4, name.as_bytes());
}

fn timestamp(out: &mut Vec<u8>, number: u32, time_ns: u64) {
    const SECOND_NS: u64 = 1_000_000_000;
    inside(out, number, |out| {
        unsigned(out, 1, time_ns / SECOND_NS);
        unsigned(out, 2, time_ns % SECOND_NS);
    });
}

pub(super) struct Mcap {
    file: Container,
    channels: BTreeMap<Topic, Option<u16>>,
    schemas: BTreeMap<String, u16>,
    motion: Motion,
    left_out: u64,
}

impl Mcap {
    fn channel(&mut self, topic: Topic, rows: &BTreeMap<&'static str, Row>) -> Option<u16> {
        if let Some(known) = self.channels.get(&topic) {
            return *known;
        }
        let Schema { name, topic: path, descriptors, about } = schemas::schema(topic, rows)?;
        let schema = match self.schemas.get(&name) {
            Some(known) => *known,
            None => self.file.schema(&name, &descriptors),
        };
        self.schemas.insert(name, schema);
        let channel = self.file.channel(schema, &path, &about);
        self.channels.insert(topic, channel);
        channel
    }

    fn derive(&mut self, context: &Context, story: &Story) -> Messages {
        let (mut messages, epochs) = (Messages::default(), &context.epochs);
        let mut said = story.said.iter().peekable();
        for observed in &story.observed {
            while let Some(said) = said.next_if(|said| said.at() <= observed.at) {
                text(&mut messages, epochs, said);
            }
            let own = self.motion.observe(observed);
            if own && context.selection.has_time(observed.at, epochs) {
                self.quantities(&mut messages, time_ns(epochs, observed.at), &observed.observation);
            }
        }
        said.for_each(|said| text(&mut messages, epochs, said));
        messages
    }

    fn quantities(&self, messages: &mut Messages, time_ns: u64, observation: &Observation) {
        match observation {
            Observation::GlobalPosition(_) | Observation::Gnss(_) => {
                let Some(place) = self.motion.fix_by(observation) else { return };
                messages.add(Topic::Position, time_ns, |out| {
                    double(out, 1, place.latitude_deg);
                    double(out, 2, place.longitude_deg);
                    double(out, 3, place.altitude_m.into());
                    unsigned(out, 5, 0);
                    timestamp(out, 6, time_ns);
                    bytes(out, 7, b"earth");
                });
            }
            Observation::Attitude(attitude) => {
                let [w, x, y, z] = quaternion_up(attitude);
                let [north, east, down] = self.motion.local().unwrap_or_default();
                messages.add(Topic::Pose, time_ns, |out| {
                    timestamp(out, 1, time_ns);
                    bytes(out, 2, b"local");
                    let vector = |out: &mut Vec<u8>, values: &[f64]| {
                        (1..).zip(values).for_each(|(number, value)| double(out, number, *value));
                    };
                    inside(out, 3, |out| {
                        inside(out, 1, |out| vector(out, &[east, north, -down]));
                        inside(out, 2, |out| vector(out, &[x, y, z, w]));
                    });
                });
            }
            _ => {}
        }
        if let Some(battery) = self.motion.battery_by(observation) {
            messages.add(Topic::Battery(battery.id), time_ns, |out| {
                timestamp(out, 1, time_ns);
                let values = [
                    battery.voltage.map(|value| value.0),
                    battery.current.map(|value| value.0),
                    battery.remaining.map(|value| value.0),
                    battery.consumed.map(|value| value.0),
                    battery.temperature.map(|value| value.0),
                ];
                let known = (2..).zip(values).filter_map(|(number, value)| Some((number, value?)));
                known.for_each(|(number, value)| float(out, number, value));
                let cells = battery.cells.iter().flatten();
                inside(out, 7, |out| {
                    cells.for_each(|cell| out.extend_from_slice(&cell.volts().0.to_le_bytes()));
                });
            });
        }
    }

    fn message(
        &mut self,
        rows: &BTreeMap<&'static str, Row>,
        (topic, time_ns, data): (Topic, u64, &[u8]),
    ) -> Result<()> {
        if let Some(channel) = self.channel(topic, rows) {
            return self.file.message(channel, time_ns, data);
        }
        self.left_out += 1;
        Ok(())
    }
}

fn text(messages: &mut Messages, epochs: &Epochs, said: &StoryEntry) {
    let StoryEntry::Text { at, severity, words } = said else { return };
    let level = match severity {
        0..=2 => 5,
        3 => 4,
        4 => 3,
        5 | 6 => 2,
        _ => 1,
    };
    let time_ns = time_ns(epochs, *at);
    messages.add(Topic::Texts, time_ns, |out| log(out, time_ns, level, words, "vehicle"));
}

impl Writer for Mcap {
    const ABOUT: FormatDetails = FormatDetails {
        has_observations: true,
        has_words: true,
        ..FormatDetails::new("mcap", "Everything, for Foxglove and PlotJuggler", Files::One("mcap"))
    };
    type Encoder = Messages;

    fn open(context: &Context, path: &Path) -> Result<Self> {
        Ok(Self {
            file: Container::open(context, path)?,
            channels: BTreeMap::new(),
            schemas: BTreeMap::new(),
            motion: Motion::default(),
            left_out: 0,
        })
    }

    fn part(&mut self, context: &Context, part: Messages, story: &Story) -> Result<()> {
        let derived = self.derive(context, story);
        let mut derived = derived.iter().peekable();
        for message in part.iter() {
            while let Some(earlier) = derived.next_if(|derived| derived.1 < message.1) {
                self.message(&part.rows, earlier)?;
            }
            self.message(&part.rows, message)?;
        }
        derived.try_for_each(|message| self.message(&part.rows, message))
    }

    fn finish(mut self, context: &Context, totals: Totals) -> Result<Finished> {
        // The words' reading told the vehicle.
        let facts = [("vehicle", &totals.vehicle), ("session", &context.identity.session)];
        self.file.metadata("hums", &facts.map(|(name, value)| (name.to_owned(), value.clone())))?;
        let (file, messages) = self.file.finish()?;
        let made = OutputFile::of(file.finish()?, "mcap", &[(messages, "message")]);
        let left_out = (self.left_out > 0).then(|| {
            format!(
                "{} left out: the file has no room for more than 65,535 topics",
                count(self.left_out, "message")
            )
        });
        Ok(Finished { made: vec![made], remarks: left_out.into_iter().collect() })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::{Path, PathBuf};

    use crate::args::{Decode, Split};
    use crate::formats::find;

    fn decode(input: &Path, output: &Path, format: &str, split: bool) {
        let request = Decode {
            inputs: vec![input.to_owned()],
            salvage: false,
            session: None,
            output: output.to_owned(),
            format: vec![find(format).expect("a format")],
            from: None,
            to: None,
            split: split.then_some(Split::Flights),
            offset: 0.0,
            findings: false,
            manifest: None,
            vehicle: Some("quad7".to_owned()),
            message: Vec::new(),
            force: false,
            json: false,
        };
        crate::run(&request, "hums").expect("decoded");
    }

    #[test]
    fn a_hums_log_has_its_vehicle_and_session_in_the_metadata() {
        let dir = tempfile::tempdir().expect("a folder");
        let recording =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/flights/px4_hil_quad_low.tlog");
        let log = dir.path().join("log.hum");
        decode(&recording, &log, "hum", false);
        for (folder, split, end) in [("whole/", false, ".mcap"), ("flights/", true, "-flight1.mcap")] {
            let output = dir.path().join(folder);
            decode(&log, &output, "mcap", split);
            let files = fs::read_dir(&output).expect("files").map(|entry| entry.expect("a file").path());
            let files: Vec<PathBuf> = files.filter(|path| path.to_string_lossy().ends_with(end)).collect();
            let [file] = files.as_slice() else { panic!("{files:?}") };
            let bytes = fs::read(file).expect("a file");
            let name = file.file_stem().expect("a name").to_string_lossy();
            let session = &name[name.rfind("-s").expect("a session") + 1..];
            let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
            let facts = ["vehicle", "quad7", "session", session].map(text).concat();
            assert!(bytes.windows(facts.len()).any(|part| part == facts), "{session}");
        }
    }
}
