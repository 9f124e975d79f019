//! `hums decode --format hum`: a recording becomes one log file. It passes the same writer as on board, but no card's
//! file system, queues or checks.

use std::path::PathBuf;

use anyhow::{Result, bail};
use hums_blackbox::record::{Clock, Loss, LossKind, Note};
use hums_blackbox::{Record, Sector, SectorSink, Writer};
use hums_core::clock::Instant;
use hums_link::Check;
use sha2::{Digest as _, Sha256};

use crate::args::Decode;
use crate::context::Context;
use crate::files::says_directory;
use crate::format::{Files, Format, FormatDetails, SingleFile, Way};
use crate::logs::marks::PACKED;
use crate::made::{MadeJson, OutputFile};
use crate::outcome::{Outcome, usage};
use crate::output;
use crate::source::find::find;
use crate::source::item::{Cause, Gap, Item, Needs};
use crate::source::no_frame;
use crate::source::own::JOINED;
use crate::{Done, SCHEMA};
use hums_analysis::soundness::Soundness;

/// Where UTC came from: the recording's own times (see `hums_blackbox::record::Clock`).
const FROM_RECORDING: u8 = 2;
/// Gaps whose words are shown.
const SHOWN_MAX: usize = 8;

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
    check(args)?;
    let found = find(&args.inputs, false)?;
    found.tell();
    let [place] = found.places.as_slice() else {
        bail!("{} recordings were found; --format hum is for one: name its file", found.places.len());
    };
    let recording = place.open()?;
    if place.own().is_some() || !recording.format.is_of_link() {
        let (title, what) = (&place.title, recording.format.with_article());
        bail!(
            "{title}: is {what}, which --format hum does not pack (a tlog or raw MAVLink); hums reads it as it is"
        );
    }
    let inputs = found.with_inputs(&args.inputs).forcing(args.force);
    let context = Context { inputs: inputs.into(), ..Context::default() };
    let mut packer = Packer::new(SingleFile::open(&context, &output(args))?);
    packer.record(Instant::ZERO, &Record::Note(Note { severity: 6, text: PACKED }))?;
    let want = Needs { frames: true, ..Needs::default() };
    let summary = recording.read(want, &mut |at, item| packer.item(at, item))?;
    let mut done = Done::read(place, summary, packer.lacks);
    done.remarks.extend(packer.words.iter().map(|words| format!("{}: {words}", place.title)));
    done.made.push(packer.finish(&place.title)?);
    let mut json = args.json.then(MadeJson::default);
    let outcome = done.outcome().and(Outcome::lossy(found.is_lossy()));
    done.tell(json.as_mut(), 1)?;
    json.map_or(Ok(()), |json| output::json(SCHEMA, &json))?;
    Ok(outcome)
}

/// A usage error if more is asked for than all of one recording.
fn check(args: &Decode) -> Result<()> {
    let is_part = args.session.is_some()
        || args.from.is_some()
        || args.to.is_some()
        || args.split.is_some()
        || !args.message.is_empty();
    if args.inputs.len() == 1 && args.format.len() == 1 && !is_part {
        return Ok(());
    }
    Err(usage(
        "--format hum writes all of one recording, and no other format beside it: name one file, and no --session, --from, --to, --split or --message",
    ))
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

struct Packer {
    file: SingleFile,
    writer: Box<Writer>,
    finished: Finished,
    /// The recording's UTC and its first frames with their times. So a log packed twice is the same to the byte, and two
    /// recordings do not look like parts of one session.
    hash: Sha256,
    hashed_bytes: usize,
    /// The session's number, once the first frames are known.
    session: Option<u32>,
    /// After a restart the times of the log have no UTC: it has one for all of them.
    is_later_part: bool,
    last: Instant,
    log_bytes: u64,
    lacks: Soundness,
    words: Vec<String>,
}

impl Packer {
    fn new(file: SingleFile) -> Self {
        Self {
            file,
            writer: Box::new(Writer::new()),
            finished: Finished::default(),
            hash: Sha256::new(),
            hashed_bytes: 0,
            session: None,
            is_later_part: false,
            last: Instant::ZERO,
            log_bytes: 0,
            lacks: Soundness::Whole,
            words: Vec::new(),
        }
    }

    fn item(&mut self, at: Instant, item: Item<'_>) -> Result<()> {
        self.last = self.last.max(at);
        match item {
            Item::Frame(frame) => {
                if self.session.is_none() {
                    self.hash.update(self.last.as_micros().to_le_bytes());
                    self.hash.update(frame.bytes());
                    self.hashed_bytes += frame.bytes().len();
                }
                let verified = frame.check() == Check::Verified;
                self.writer.frame(self.last, frame.bytes(), verified, &mut self.finished)?;
                if self.hashed_bytes >= FIRST_BYTES { self.write_out() } else { Ok(()) }
            }
            Item::Epoch(utc_micros) if !self.is_later_part => {
                self.hash.update(utc_micros.to_le_bytes());
                let clock = Clock { boot: Instant::ZERO, utc_micros, source: FROM_RECORDING };
                self.record(self.last, &Record::Clock(clock))
            }
            Item::Restart => {
                self.is_later_part = true;
                Ok(())
            }
            Item::Joint => {
                self.is_later_part = true;
                self.record(self.last, &Record::Note(Note { severity: 6, text: JOINED }))
            }
            Item::Gap(gap) => self.gap(gap),
            _ => Ok(()),
        }
    }

    fn gap(&mut self, gap: &Gap) -> Result<()> {
        self.lacks = self.lacks.max(Soundness::of_gap(gap));
        if self.words.len() < SHOWN_MAX {
            self.words.push(gap.words.clone());
        }
        let frames = gap.own.and_then(|own| own.frames);
        let (what, count) = match frames {
            _ if gap.is_noise() => (LossKind::NotFrames, gap.bytes),
            Some(frames) => (LossKind::WrongChecksums, frames.into()),
            None if matches!(gap.cause, Cause::NotKept | Cause::Cut) => return Ok(()),
            None => (LossKind::DamagedPlaces, 1),
        };
        let (from, to) = (gap.from.unwrap_or(Instant::ZERO), gap.to.unwrap_or(self.last));
        self.record(self.last, &Record::Loss(Loss { what, count, from, to }))
    }

    fn record(&mut self, at: Instant, record: &Record<'_>) -> Result<()> {
        Ok(self.writer.record(at, record, &mut self.finished)?)
    }

    fn finish(mut self, title: &str) -> Result<OutputFile> {
        self.writer.finish(&mut self.finished);
        self.write_out()?;
        let frames = self.writer.counters().frames;
        if frames == 0 {
            return Err(no_frame(title));
        }
        let counts = [(frames, "frame"), (self.log_bytes, "byte")];
        Ok(OutputFile::of(self.file.finish()?, "hum", &counts))
    }

    fn write_out(&mut self) -> Result<()> {
        let session = *self.session.get_or_insert_with(|| {
            let number: [u8; 4] = self.hash.clone().finalize().first_chunk().copied().unwrap_or_default();
            u32::from_be_bytes(number) | 1
        });
        for mut sector in self.finished.0.drain(..) {
            sector.seal(session);
            self.file.write(sector.bytes())?;
            self.log_bytes += sector.bytes().len() as u64;
        }
        Ok(())
    }
}
