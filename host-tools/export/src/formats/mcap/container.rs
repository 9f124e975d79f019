//! The container: chunks compressed with LZ4, an index of each, and the summary at the end, by the
//! [specification](https://mcap.dev/spec).

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use lz4_flex::frame::FrameEncoder;

use crate::context::Context;
use crate::files::cannot_write;
use crate::format::SingleFile;

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
const CHUNK_BYTES: usize = 1 << 20;
const HEADER: u8 = 1;
const FOOTER: u8 = 2;
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
const MESSAGE_INDEX: u8 = 7;
const CHUNK_INDEX: u8 = 8;
const STATISTICS: u8 = 0x0B;
const METADATA: u8 = 0x0C;
const METADATA_INDEX: u8 = 0x0D;
const SUMMARY_OFFSET: u8 = 0x0E;
const DATA_END: u8 = 0x0F;

pub(super) struct Container {
    file: SingleFile,
    path: PathBuf,
    /// Bytes written.
    place: u64,
    chunk: Chunk,
    /// Records of schemas and channels, for the summary.
    schemas: Vec<u8>,
    channels: Vec<u8>,
    counts: Vec<u64>,
    schema_count: u16,
    chunk_indices: Vec<u8>,
    chunk_count: u32,
    metadata_indices: Vec<u8>,
    span: Option<(u64, u64)>,
}

#[derive(Default)]
struct Chunk {
    records: Vec<u8>,
    /// Time and place of each message, by channel.
    indices: BTreeMap<u16, Vec<u8>>,
    span: Option<(u64, u64)>,
}

#[derive(Default)]
struct Record(Vec<u8>);

impl Record {
    fn u16(mut self, value: u16) -> Self {
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    fn u32(mut self, value: u32) -> Self {
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    fn u64(mut self, value: u64) -> Self {
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    fn bytes(mut self, bytes: &[u8]) -> Self {
        self = self.u32(bytes.len() as u32);
        self.0.extend_from_slice(bytes);
        self
    }

    fn text(self, text: &str) -> Self {
        self.bytes(text.as_bytes())
    }

    fn map(self, pairs: &[(String, String)]) -> Self {
        let pairs = pairs.iter().fold(Self::default(), |map, (key, value)| map.text(key).text(value));
        self.bytes(&pairs.0)
    }

    fn push(&self, operation: u8, out: &mut Vec<u8>) {
        out.push(operation);
        out.extend_from_slice(&(self.0.len() as u64).to_le_bytes());
        out.extend_from_slice(&self.0);
    }

    fn record(&self, operation: u8) -> Vec<u8> {
        let mut out = Vec::new();
        self.push(operation, &mut out);
        out
    }
}

fn span_with(span: Option<(u64, u64)>, time_ns: u64) -> (u64, u64) {
    let (first, last) = span.unwrap_or((time_ns, time_ns));
    (first.min(time_ns), last.max(time_ns))
}

impl Container {
    pub(super) fn open(context: &Context, path: &Path) -> Result<Self> {
        let mut container = Self {
            file: SingleFile::open(context, path)?,
            path: path.to_owned(),
            place: 0,
            chunk: Chunk::default(),
            schemas: Vec::new(),
            channels: Vec::new(),
            counts: Vec::new(),
            schema_count: 0,
            chunk_indices: Vec::new(),
            chunk_count: 0,
            metadata_indices: Vec::new(),
            span: None,
        };
        container.write(MAGIC)?;
        let library = concat!("hums ", env!("CARGO_PKG_VERSION"));
        container.write(&Record::default().text("").text(library).record(HEADER))?;
        Ok(container)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.place += bytes.len() as u64;
        self.file.write(bytes)
    }

    pub(super) fn schema(&mut self, name: &str, descriptors: &[u8]) -> u16 {
        self.schema_count = self.schema_count.saturating_add(1);
        let record = Record::default().u16(self.schema_count).text(name).text("protobuf").bytes(descriptors);
        record.push(SCHEMA, &mut self.chunk.records);
        record.push(SCHEMA, &mut self.schemas);
        self.schema_count
    }

    /// Returns the channel's number; `None` if the file has no room for more.
    pub(super) fn channel(&mut self, schema: u16, topic: &str, about: &[(String, String)]) -> Option<u16> {
        let number = u16::try_from(self.counts.len()).ok()?;
        let record = Record::default().u16(number).u16(schema).text(topic).text("protobuf").map(about);
        record.push(CHANNEL, &mut self.chunk.records);
        record.push(CHANNEL, &mut self.channels);
        self.counts.push(0);
        Some(number)
    }

    pub(super) fn message(&mut self, channel: u16, time_ns: u64, data: &[u8]) -> Result<()> {
        let Some(count) = self.counts.get_mut(usize::from(channel)) else { return Ok(()) };
        let sequence = *count as u32;
        *count += 1;
        let chunk = &mut self.chunk;
        let index = chunk.indices.entry(channel).or_default();
        index.extend_from_slice(&time_ns.to_le_bytes());
        index.extend_from_slice(&(chunk.records.len() as u64).to_le_bytes());
        let length = 2 + 4 + 8 + 8 + data.len() as u64;
        chunk.records.push(MESSAGE);
        chunk.records.extend_from_slice(&length.to_le_bytes());
        chunk.records.extend_from_slice(&channel.to_le_bytes());
        chunk.records.extend_from_slice(&sequence.to_le_bytes());
        chunk.records.extend_from_slice(&time_ns.to_le_bytes());
        chunk.records.extend_from_slice(&time_ns.to_le_bytes());
        chunk.records.extend_from_slice(data);
        chunk.span = Some(span_with(chunk.span, time_ns));
        self.span = Some(span_with(self.span, time_ns));
        if self.chunk.records.len() >= CHUNK_BYTES { self.end_chunk() } else { Ok(()) }
    }

    pub(super) fn metadata(&mut self, name: &str, facts: &[(String, String)]) -> Result<()> {
        let record = Record::default().text(name).map(facts).record(METADATA);
        let index = Record::default().u64(self.place).u64(record.len() as u64).text(name);
        index.push(METADATA_INDEX, &mut self.metadata_indices);
        self.write(&record)
    }

    fn end_chunk(&mut self) -> Result<()> {
        let Chunk { records, indices, span } = std::mem::take(&mut self.chunk);
        if records.is_empty() {
            return Ok(());
        }
        let mut encoder = FrameEncoder::new(Vec::with_capacity(records.len() / 2));
        let packed = encoder.write_all(&records).map_err(Into::into).and_then(|()| encoder.finish());
        let packed = packed.with_context(|| cannot_write(&self.path))?;
        let mut crc = flate2::Crc::new();
        crc.update(&records);
        let (first, last) = span.unwrap_or_default();
        let (bytes, packed_bytes) = (records.len() as u64, packed.len() as u64);
        let head =
            Record::default().u64(first).u64(last).u64(bytes).u32(crc.sum()).text("lz4").u64(packed_bytes);
        let place = self.place;
        let length = head.0.len() as u64 + packed_bytes;
        self.write(&[CHUNK])?;
        self.write(&length.to_le_bytes())?;
        self.write(&head.0)?;
        self.write(&packed)?;
        let chunk_bytes = self.place - place;
        let (mut places, begin) = (Record::default(), self.place);
        for (channel, index) in indices {
            places = places.u16(channel).u64(self.place);
            self.write(&Record::default().u16(channel).bytes(&index).record(MESSAGE_INDEX))?;
        }
        let index = Record::default().u64(first).u64(last).u64(place).u64(chunk_bytes).bytes(&places.0);
        let index = index.u64(self.place - begin).text("lz4").u64(packed_bytes).u64(bytes);
        index.push(CHUNK_INDEX, &mut self.chunk_indices);
        self.chunk_count += 1;
        Ok(())
    }

    pub(super) fn finish(mut self) -> Result<(SingleFile, u64)> {
        self.end_chunk()?;
        self.write(&Record::default().u32(0).record(DATA_END))?;
        let messages = self.counts.iter().sum();
        let (first, last) = self.span.unwrap_or_default();
        let counts = (0..)
            .zip(&self.counts)
            .fold(Record::default(), |map, (channel, count)| map.u16(channel).u64(*count));
        let metadata = u32::from(!self.metadata_indices.is_empty());
        let statistics = Record::default().u64(messages).u16(self.schema_count).u32(self.counts.len() as u32);
        let statistics =
            statistics.u32(0).u32(metadata).u32(self.chunk_count).u64(first).u64(last).bytes(&counts.0);
        let groups = [
            (SCHEMA, std::mem::take(&mut self.schemas)),
            (CHANNEL, std::mem::take(&mut self.channels)),
            (STATISTICS, statistics.record(STATISTICS)),
            (CHUNK_INDEX, std::mem::take(&mut self.chunk_indices)),
            (METADATA_INDEX, std::mem::take(&mut self.metadata_indices)),
        ];
        let (summary, mut offsets) = (self.place, Vec::new());
        for (operation, records) in groups.iter().filter(|(_, records)| !records.is_empty()) {
            let offset = Record(vec![*operation]).u64(self.place).u64(records.len() as u64);
            offset.push(SUMMARY_OFFSET, &mut offsets);
            self.write(records)?;
        }
        let offsets_place = self.place;
        self.write(&offsets)?;
        // No checksum of the summary: zero says so.
        self.write(&Record::default().u64(summary).u64(offsets_place).u32(0).record(FOOTER))?;
        self.write(MAGIC)?;
        Ok((self.file, messages))
    }
}
