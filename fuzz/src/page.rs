//! Any messages in a log, for the report's page and the live page: data on a page is JSON, and cannot end its
//! element.

use std::path::Path;

use hums::endpoint::Endpoint;
use hums::live::recording::{self, Content};
use hums::live::show::{self, HeadInputs, SourceJson};
use hums::live::told::Limits;
use hums::live::world::{Histories, World};
use hums::logs;
use hums::page::history::Cursor;
use hums::report::replay::Replay;
use hums::report::{page, trend};
use hums::source::recording::LogPlace;
use hums::summary::Overview;
use hums_blackbox::record::Note;
use hums_blackbox::{FRAME_BYTES_MAX, Record, Sector, SectorSink, Writer};
use hums_core::clock::Instant;
use hums_link::encode::Encoder;
use hums_link::packet::Packet;
use serde_json::Value;

use crate::file::with_file;

const BEGINS: &str = "<script type=\"application/json\" id=\"data\">";

#[derive(Default)]
struct Log(Vec<u8>);

impl SectorSink for Log {
    fn room(&self) -> usize {
        usize::MAX
    }

    fn put(&mut self, sector: &Sector) {
        let mut sector = *sector;
        sector.seal(7);
        self.0.extend_from_slice(sector.bytes());
    }
}

/// A log made from the input: entries of kind, time since the one before, two bytes of message, length, content. The
/// kind's three lowest bits: 7 a note, 6 a frame that is not verified, others a frame of a known message. The four
/// highest give the system.
pub fn log(mut data: &[u8]) -> Vec<u8> {
    let (mut writer, mut log) = (Box::new(Writer::new()), Log::default());
    let (mut at_ms, messages) = (0, hums_dialect::messages());
    while let [kind, step, low, high, length, rest @ ..] = data {
        let (content, rest) = rest.split_at(usize::from(*length).min(rest.len()));
        data = rest;
        at_ms += if *step < 0xf8 { u64::from(*step) } else { u64::from(*step) << 18 };
        let at = Instant::from_millis(at_ms);
        let number = u16::from_le_bytes([*low, *high]);
        if kind & 7 == 7 {
            let text: String = String::from_utf8_lossy(content).chars().take(50).collect();
            let note = Record::Note(Note { severity: *low & 7, text: &text });
            writer.record(at, &note, &mut log).expect("room");
            continue;
        }
        let system = (kind >> 4) + 1;
        if kind & 7 == 6 {
            let mut bytes = vec![0xfd, content.len() as u8, 0, 0, at_ms as u8, system, 1, *low, *high, 0];
            bytes.extend_from_slice(content);
            bytes.extend_from_slice(&[0, 0]);
            bytes.truncate(FRAME_BYTES_MAX);
            writer.frame(at, &bytes, false, &mut log).expect("room");
            continue;
        }
        let message = &messages[usize::from(number) % messages.len()];
        let content = &content[..content.len().min(usize::from(message.len_max))];
        let mut buffer = [0; FRAME_BYTES_MAX];
        let packet = Packet::new(message.id).bytes(0, content);
        let bytes = Encoder::of(system, 1).frame(&mut buffer, &packet);
        writer.frame(at, bytes, true, &mut log).expect("room");
    }
    writer.finish(&mut log);
    log.0
}

/// Takes the input for the entries of a log.
pub fn check(data: &[u8]) {
    with_file(&log(data), |path| {
        report(path);
        live(path);
    });
}

fn report(path: &Path) {
    let found = logs::find(&[path.to_owned()], false).expect("it is a log");
    let overview = Overview::of(&found.logs[0]).expect("a file that can be read");
    let place = LogPlace::log("log".to_owned(), found.logs[0].clone());
    let replay = Replay::of(&place, &overview).expect("a file that can be read");
    let html = page::html(&overview, &replay, &trend::of(&trend::Session::of(&overview), &[]), None, None);
    let (_, data) = html.split_once(BEGINS).expect("it has data");
    let (data, after) = data.split_once('<').expect("the element ends");
    assert!(after.starts_with("/script>"), "something in the data begins an element");
    serde_json::from_str::<Value>(data).expect("JSON");
}

fn live(path: &Path) {
    let mut opened = recording::open(&Endpoint::File(path.to_owned()), None).expect("it is a log");
    let (mut world, mut histories) = (World::new(Limits::default()), Histories::new());
    let mut last = None;
    recording::each(&mut opened, &mut |at, _, progress, content| {
        assert!((0.0..=1.0).contains(&progress));
        if last.is_none() {
            world.begin(at);
        }
        last = Some(at);
        match content {
            Content::Frame(frame) => world.frame(at, frame, Some(&mut histories)),
            Content::Entry(entry) => world.entry(at, entry, Some(&mut histories)),
            Content::Told(told) => world.told(at, told, Some(&mut histories)),
        }
        world.found.clear();
        Ok(true)
    })
    .expect("a file that can be read");
    let now = last.unwrap_or_default();
    let source = SourceJson::default();
    let around = HeadInputs { source: &source, epoch_us: Some(1), frames_s: 1.0, influx: None };
    let (head, crafts) = show::all(&world, now, &around);
    for text in crafts.into_iter().map(|(_, text)| text).chain([head]) {
        serde_json::from_str::<Value>(&text).expect("JSON");
    }
    for (system, history) in &histories {
        let part = history.since(*system, &mut Cursor::default(), now);
        let text = serde_json::to_string(&part).expect("JSON");
        serde_json::from_str::<Value>(&text).expect("JSON");
    }
}
