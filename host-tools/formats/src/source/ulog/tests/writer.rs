//! Writes `ULog` by the format's description.

use hums_core::clock::Instant;

use crate::mavlink::values::Scalar;
use crate::source::item::{CellValue, Gap, Item, Needs, Reader, RecordingSummary, Rows};
use crate::source::ulog::Ulog;

#[derive(Clone)]
pub(in crate::source::ulog) struct Writer {
    pub(in crate::source::ulog) bytes: Vec<u8>,
}

impl Writer {
    /// Logging began at this time.
    pub(in crate::source::ulog) fn new(time_us: u64) -> Self {
        let mut bytes = crate::source::ulog::message::MAGIC.to_vec();
        bytes.push(1);
        bytes.extend(time_us.to_le_bytes());
        Self { bytes }
    }

    pub(in crate::source::ulog) fn message(mut self, kind: u8, body: &[&[u8]]) -> Self {
        let body = body.concat();
        self.bytes.extend(u16::try_from(body.len()).expect("a message of 64 KiB").to_le_bytes());
        self.bytes.push(kind);
        self.bytes.extend(body);
        self
    }

    pub(in crate::source::ulog) fn flags(self, incompatible: u8, appended: [u64; 3]) -> Self {
        let offsets: Vec<u8> = appended.iter().flat_map(|offset| offset.to_le_bytes()).collect();
        self.message(b'B', &[&[0; 8], &[incompatible, 0, 0, 0, 0, 0, 0, 0], &offsets])
    }

    pub(in crate::source::ulog) fn format(self, text: &str) -> Self {
        self.message(b'F', &[text.as_bytes()])
    }

    fn keyed(self, kind: u8, before: &[u8], key: &str, value: &[u8]) -> Self {
        self.message(kind, &[before, &[key.len() as u8], key.as_bytes(), value])
    }

    pub(in crate::source::ulog) fn information(self, key: &str, value: &[u8]) -> Self {
        self.keyed(b'I', &[], key, value)
    }

    pub(in crate::source::ulog) fn parameter(self, name: &str, value: f32) -> Self {
        self.keyed(b'P', &[], &format!("float {name}"), &value.to_le_bytes())
    }

    pub(in crate::source::ulog) fn integer_parameter(self, name: &str, value: i32) -> Self {
        self.keyed(b'P', &[], &format!("int32_t {name}"), &value.to_le_bytes())
    }

    pub(in crate::source::ulog) fn default_parameter(self, groups: u8, name: &str, value: f32) -> Self {
        self.keyed(b'Q', &[groups], &format!("float {name}"), &value.to_le_bytes())
    }

    pub(in crate::source::ulog) fn subscribe(self, id: u16, instance: u8, name: &str) -> Self {
        self.message(b'A', &[&[instance], &id.to_le_bytes(), name.as_bytes()])
    }

    pub(in crate::source::ulog) fn data(self, id: u16, time_us: u64, data: &[u8]) -> Self {
        self.message(b'D', &[&id.to_le_bytes(), &time_us.to_le_bytes(), data])
    }

    pub(in crate::source::ulog) fn text(self, level: u8, time_us: u64, words: &str) -> Self {
        self.message(b'L', &[&[level], &time_us.to_le_bytes(), words.as_bytes()])
    }

    pub(in crate::source::ulog) fn tagged(self, level: u8, tag: u16, time_us: u64, words: &str) -> Self {
        self.message(b'C', &[&[level], &tag.to_le_bytes(), &time_us.to_le_bytes(), words.as_bytes()])
    }

    pub(in crate::source::ulog) fn sync(self) -> Self {
        self.message(b'S', &[&[0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12]])
    }

    pub(in crate::source::ulog) fn dropout(self, milliseconds: u16) -> Self {
        self.message(b'O', &[&milliseconds.to_le_bytes()])
    }
}

/// Items as texts: comparable and readable.
#[derive(Debug, Default)]
pub(in crate::source::ulog) struct Read {
    pub(in crate::source::ulog) items: Vec<(u64, String)>,
    pub(in crate::source::ulog) gaps: Vec<Gap>,
    pub(in crate::source::ulog) summary: RecordingSummary,
}

impl Read {
    pub(in crate::source::ulog) fn of(&self, kind: &str) -> Vec<&str> {
        self.items.iter().filter_map(|(_, item)| item.strip_prefix(kind)).map(str::trim_start).collect()
    }
}

pub(in crate::source::ulog) fn read(bytes: &[u8]) -> Read {
    try_read(bytes).expect("a ULog")
}

/// Perhaps a log; times never fall.
pub(in crate::source::ulog) fn try_read(bytes: &[u8]) -> anyhow::Result<Read> {
    let mut read = Read::default();
    let mut last = Instant::ZERO;
    let want = Needs { observations: true, rows: Rows::All, ..Needs::default() };
    let summary = Ulog::new(bytes).read(want, &mut |at, item| {
        assert!(at >= last, "time falls from {last:?} to {at:?}");
        last = at;
        if let Item::Gap(gap) = &item {
            read.gaps.push((*gap).clone());
        }
        read.items.push((at.as_micros(), told(&item)));
        Ok(())
    })?;
    read.summary = summary;
    Ok(read)
}

fn told(item: &Item<'_>) -> String {
    match item {
        Item::Epoch(utc_us) => format!("epoch {utc_us}"),
        Item::Observation(source, observation) => format!("observation {}: {observation:?}", source.system),
        Item::Parameter(parameter) => format!("parameter {} {}", parameter.name, parameter.value),
        Item::Text(text) => format!("text {} {}", text.severity, text.words),
        Item::Mode(mode) => format!("mode {} {}", mode.number, mode.name.unwrap_or_default()),
        Item::Event(event) => format!("event {} {}", event.number, event.severity),
        Item::Fact(fact) => format!("fact {:?} {}", fact.about, fact.words),
        Item::Row(row) => {
            assert_eq!(row.values.len(), row.table.columns.len());
            let values: Vec<String> = row.values.iter().map(value).collect();
            format!("row {} {}", row.table.name, values.join(","))
        }
        Item::Gap(gap) => format!("gap {:?} {}", gap.cause, gap.words),
        Item::Restart => "restart".to_owned(),
        Item::Joint => "joint".to_owned(),
        Item::Frame(_) | Item::Record(_) => unreachable!("a ULog has neither"),
    }
}

fn value(value: &CellValue<'_>) -> String {
    match value {
        CellValue::Unknown => String::new(),
        CellValue::Number(Scalar::Unsigned(number)) => number.to_string(),
        CellValue::Number(Scalar::Signed(number)) => number.to_string(),
        CellValue::Number(Scalar::Single(number)) => number.to_string(),
        CellValue::Number(Scalar::Double(number)) => number.to_string(),
        CellValue::Flag(flag) => flag.to_string(),
        CellValue::Text(text) => (*text).to_owned(),
        CellValue::Bytes(bytes) => format!("{bytes:02x?}"),
    }
}
