//! `hums decode --format hum`: a recording becomes one log file. It passes the same framer and writer as on board,
//! but no card's file system, queues or checks.

use std::collections::VecDeque;
use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, Result};
use hums_blackbox::record::{Clock, Loss, LossKind, Note};
use hums_blackbox::{Full, Record, Sector, SectorSink, Writer};
use hums_core::clock::Instant;
use hums_link::{Check, Framer};
use sha2::{Digest as _, Sha256};

use crate::SCHEMA;
use crate::args::Decode;
use crate::endpoint::Endpoint;
use crate::files::{Inputs, Output, cannot_write, says_directory};
use crate::format::{Files, Format, FormatDetails, Way};
use crate::logs::marks::PACKED;
use crate::made::{LogJson, MadeJson, OutputFile};
use crate::outcome::{Outcome, usage};
use crate::output;
use crate::plural::count;
use crate::printable;
use crate::source::booted::BootTimedSource;
use crate::source::checksums::Checksums;
use crate::source::own::JOINED;
use crate::source::{self, Source, Timing};
use hums_analysis::soundness::Soundness;

/// Where UTC came from: the recording's own times (see `hums_blackbox::record::Clock`).
const FROM_RECORDING: u8 = 2;

pub(super) const FORMAT: Format = Format {
    about: FormatDetails {
        is_of_frames: true,
        omits: "an autopilot's own log, findings",
        ..FormatDetails::new(
            "hum",
            "A log as the box writes it, of one tlog or raw recording; written alone",
            Files::One("hum"),
        )
    },
    way: Way::Alone(run),
};

fn run(args: &Decode) -> Result<Outcome> {
    let (input, path) = (input(args)?, output(args));
    let name = input.to_string();
    let mut inputs = Inputs::none().forcing(args.force);
    inputs.add_endpoint(&input);
    let source = source::open(&input, Timing { line_rate: None })?;
    // Raw bytes have the autopilot's times, as in `check`.
    let mut source: Box<dyn Source> =
        if source.has_records() { source } else { Box::new(BootTimedSource::new(source)) };
    let context = || cannot_write(&path);
    let read = || format!("{name}: cannot be read");
    // A pipe may wait for its first byte for ever, so no file is made before it.
    let (mut first, mut hash, mut bytes) = (VecDeque::new(), Sha256::new(), 0);
    while bytes < FIRST_BYTES
        && let Some(chunk) = source.next().with_context(read)?
    {
        hash.update(chunk.at_us.to_le_bytes());
        hash.update(&chunk.bytes);
        bytes += chunk.bytes.len();
        first.push_back(chunk);
    }
    let utc_us = source.utc_start_us();
    hash.update(utc_us.unwrap_or(0).to_le_bytes());
    let session = session_of(hash);
    let file = Output::create(&path, &inputs)?;
    let mut packer = Packer::new(file, session);
    packer.start(utc_us).with_context(context)?;
    let mut last_us = 0;
    loop {
        let next = match first.pop_front() {
            Some(chunk) => Some(chunk),
            None => source.next().with_context(read)?,
        };
        let Some(chunk) = next else { break };
        if source.begins_another() && first.is_empty() {
            packer.joint(chunk.at_us).with_context(context)?;
        }
        packer.chunk(chunk.at_us, &chunk.bytes, source.has_records()).with_context(context)?;
        packer.damaged(last_us, chunk.at_us, source.damages()).with_context(context)?;
        last_us = chunk.at_us;
    }
    packer.damaged(last_us, last_us, source.damages()).with_context(context)?;
    let (done, mut file) = packer.finish(last_us).with_context(context)?;
    if done.frames == 0 {
        return Err(source::no_frame(&input));
    }
    file.finish()?;
    if let Some(remark) = source.remark() {
        note!("{name}: {remark}");
    }
    if done.bytes_not_frames > 0 {
        let bytes = count(done.bytes_not_frames, "byte");
        note!("{bytes} of the recording are outside of frames; the log only counts them");
    }
    if let Some(words) = &done.wrong_checksums {
        note!("{name}: {words}");
    }
    let whole = source.damages() == 0 && done.wrong_checksums.is_none();
    let made = OutputFile::of(path, "hum", &[(done.frames, "frame"), (done.log_bytes, "byte")]);
    if args.json {
        let state = if whole { Soundness::Whole } else { Soundness::Damaged }.name();
        let logs = vec![LogJson { name, state, whole, files: vec![made] }];
        output::json(SCHEMA, &MadeJson { logs })?;
    } else {
        output::line(&printable::word(&made.line()))?;
    }
    Ok(Outcome::lossy(!whole))
}

/// The one recording that is read; a usage error if more is asked for than all of it.
fn input(args: &Decode) -> Result<Endpoint> {
    let is_part = args.session.is_some()
        || args.from.is_some()
        || args.to.is_some()
        || args.split.is_some()
        || !args.message.is_empty();
    match args.inputs.as_slice() {
        [input] if args.format.len() == 1 && !is_part => {
            Ok(if input.as_os_str() == "-" { Endpoint::Standard } else { Endpoint::File(input.clone()) })
        }
        _ => Err(usage(
            "--format hum writes all of one recording, and no other format beside it; leave out --session, --from, --to, --split and --message",
        )),
    }
}

fn output(args: &Decode) -> PathBuf {
    let stem = args.inputs.first().and_then(|input| input.file_stem()).unwrap_or_default();
    if says_directory(&args.output) {
        args.output.join(stem).with_extension("hum")
    } else {
        args.output.clone()
    }
}

/// Bytes of frames that make the session's number: few, because a recording that has grown is the same one.
const FIRST_BYTES: usize = 2 * 1024;

/// The session's number, by the recording's first time and its first frames with theirs. So a log packed twice is the
/// same to the byte, and two recordings do not look like parts of one session.
fn session_of(hash: Sha256) -> u32 {
    let number: [u8; 4] = hash.finalize().first_chunk().copied().unwrap_or_default();
    u32::from_be_bytes(number) | 1
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Done {
    frames: u64,
    log_bytes: u64,
    bytes_not_frames: u64,
    /// Frames of a tlog whose checksum does not fit, as a sentence.
    wrong_checksums: Option<String>,
}

#[derive(Default)]
struct Finished(Vec<Sector>);

impl SectorSink for Finished {
    fn room(&self) -> usize {
        usize::MAX
    }

    fn put(&mut self, sector: &Sector) {
        self.0.push(*sector);
    }
}

struct Packer<W> {
    file: W,
    writer: Box<Writer>,
    framer: Framer,
    finished: Finished,
    /// The session's number.
    session: u32,
    log_bytes: u64,
    checksums: Checksums,
    /// Bytes of frames of unknown messages that the framer took for none, and that are kept all the same.
    unknown_bytes: u64,
    damages: u64,
}

impl<W: Write> Packer<W> {
    fn new(file: W, session: u32) -> Self {
        let (writer, framer) = (Box::new(Writer::new()), Framer::new());
        Self {
            file,
            writer,
            framer,
            finished: Finished::default(),
            session,
            log_bytes: 0,
            checksums: Checksums::default(),
            unknown_bytes: 0,
            damages: 0,
        }
    }

    fn start(&mut self, utc_us: Option<u64>) -> Result<()> {
        let note = Record::Note(Note { severity: 6, text: PACKED });
        self.record(Instant::ZERO, &note)?;
        if let Some(utc_micros) = utc_us {
            let clock = Clock { boot: Instant::ZERO, utc_micros, source: FROM_RECORDING };
            self.record(Instant::ZERO, &Record::Clock(clock))?;
        }
        Ok(())
    }

    fn record(&mut self, at: Instant, record: &Record<'_>) -> Result<()> {
        self.writer.record(at, record, &mut self.finished)?;
        self.write_out()
    }

    fn chunk(&mut self, at_us: u64, bytes: &[u8], is_record: bool) -> Result<()> {
        let Self { framer, writer, finished, checksums, .. } = self;
        if is_record {
            checksums.begin(Instant::from_micros(at_us), 0, bytes);
        }
        let mut result = Ok(());
        let mut take = |frame: hums_link::Frame<'_>| {
            checksums.frame(&frame);
            let verified = frame.check() == Check::Verified;
            let taken = writer.frame(Instant::from_micros(at_us), frame.bytes(), verified, finished);
            result = std::mem::replace(&mut result, Ok(())).and(taken);
        };
        framer.push(bytes, &mut take);
        if is_record {
            framer.idle(&mut take);
            if let Some(frame) = checksums.end(bytes) {
                self.unknown_bytes += bytes.len() as u64;
                result =
                    result.and(writer.frame(Instant::from_micros(at_us), frame.bytes(), false, finished));
            }
        }
        result.map_err(|full: Full| anyhow::anyhow!("the log writer refused a frame: {full}"))?;
        self.write_out()
    }

    fn joint(&mut self, at_us: u64) -> Result<()> {
        let at = Instant::from_micros(at_us);
        self.framer.idle(&mut |_: hums_link::Frame<'_>| {});
        self.record(at, &Record::Note(Note { severity: 6, text: JOINED }))
    }

    /// Damage of the recording up to now; its increase since the previous chunk is a loss.
    fn damaged(&mut self, before_us: u64, at_us: u64, damages: u64) -> Result<()> {
        let count = damages - std::mem::replace(&mut self.damages, damages).min(damages);
        if count == 0 {
            return Ok(());
        }
        let (from, to) = (Instant::from_micros(before_us), Instant::from_micros(at_us));
        self.record(to, &Record::Loss(Loss { what: LossKind::DamagedPlaces, count, from, to }))
    }

    fn finish(mut self, last_us: u64) -> Result<(Done, W)> {
        self.chunk(last_us, &[], true)?;
        let bytes_not_frames = self.framer.counts().bytes_not_frames.saturating_sub(self.unknown_bytes);
        if bytes_not_frames > 0 {
            let loss = Loss {
                what: LossKind::NotFrames,
                count: bytes_not_frames,
                from: Instant::ZERO,
                to: Instant::from_micros(last_us),
            };
            self.record(Instant::from_micros(last_us), &Record::Loss(loss))?;
        }
        let wrong_checksums = self.checksums.gap();
        if let Some(gap) = &wrong_checksums {
            let (from, to) = (gap.from.unwrap_or(Instant::ZERO), Instant::from_micros(last_us));
            let (what, count) = (LossKind::WrongChecksums, self.checksums.damaged());
            self.record(to, &Record::Loss(Loss { what, count, from, to }))?;
        }
        self.writer.finish(&mut self.finished);
        self.write_out()?;
        let counters = self.writer.counters();
        let done = Done {
            frames: counters.frames,
            log_bytes: self.log_bytes,
            bytes_not_frames,
            wrong_checksums: wrong_checksums.map(|gap| gap.words),
        };
        Ok((done, self.file))
    }

    fn write_out(&mut self) -> Result<()> {
        for mut sector in self.finished.0.drain(..) {
            sector.seal(self.session);
            self.file.write_all(sector.bytes())?;
            self.log_bytes += sector.bytes().len() as u64;
        }
        Ok(())
    }
}
