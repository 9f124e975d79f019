//! The golden list: every finding and event of every recorded flight in the repository, as the box judges it.
//!
//! Each `tests/FOLDER/*.tlog` (or `.tlog.gz`) is parsed and monitored by the code that the box runs. The list in
//! `tests/golden` has one line for each finding: time, check, instance, new level, cause. A line with `>` is a text to the ground.
//! A commit that only moves code leaves the list as it is. A commit that changes behaviour contains the difference.
//! `HUMS_GOLDEN=write cargo test -p hums-onboard golden::` writes the list anew.

use std::fmt::Write as _;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::{env, fs, thread};

use flate2::read::GzDecoder;
use hums_core::Monitor;
use hums_core::clock::Instant;
use hums_core::observation::Observation;
use hums_core::parameters::Params;
use hums_core::status::{RecorderStatus, Recording};
use hums_link::LongTexts;
use hums_link::frame::{Check, Frame};
use hums_link::framer::Framer;
use hums_link::sequence::Sequences;
use hums_link::summary::Summary;
use hums_onboard::monitoring::TICK;

/// Microseconds since 1970, big-endian.
const TIME_BYTES: usize = 8;
const STATUSTEXT: u32 = 253;
/// A longer step of the recorder's clock does not count as time of the flight, milliseconds.
const STEP_MAX_MS: u64 = 60_000;

#[test]
fn flights() {
    compare("flights");
}

#[test]
fn labelled_ardupilot() {
    compare("labelled");
}

#[test]
fn labelled_px4() {
    compare("labelled/px4");
}

fn compare(folder: &str) {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests");
    let recordings = recordings(&tests.join(folder));
    assert!(!recordings.is_empty(), "no recordings in tests/{folder}");
    let middle = recordings.len() / 2;
    let list = thread::scope(|scope| {
        let second = scope.spawn(|| judge_all(&recordings[middle..]));
        judge_all(&recordings[..middle]) + &second.join().expect("a recording's thread panicked")
    });
    let golden = tests.join("golden").join(format!("{}.txt", folder.replace('/', "_")));
    if env::var_os("HUMS_GOLDEN").is_some_and(|value| value == "write") {
        fs::write(&golden, list).expect("the golden list can be written");
        return;
    }
    let known = fs::read_to_string(&golden).expect("the golden list can be read");
    let differs = known.lines().zip(list.lines()).position(|(known, now)| known != now);
    let differs = differs.or((known != list).then(|| known.lines().count().min(list.lines().count())));
    let line = differs.unwrap_or_default();
    assert!(
        differs.is_none(),
        "{}:{}: {}\n known: {}\n now:   {}\nRun with HUMS_GOLDEN=write and look at the difference.",
        golden.display(),
        line + 1,
        known.lines().take(line + 1).filter(|line| line.starts_with('#')).last().unwrap_or_default(),
        known.lines().nth(line).unwrap_or("(end)"),
        list.lines().nth(line).unwrap_or("(end)"),
    );
}

fn recordings(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("the folder can be read");
    let paths = entries.map(|entry| entry.expect("an entry can be read").path());
    let mut paths: Vec<PathBuf> = paths.filter(|path| is_tlog(path)).collect();
    paths.sort();
    paths
}

fn is_tlog(path: &Path) -> bool {
    let name = path.to_string_lossy();
    name.ends_with(".tlog") || name.ends_with(".tlog.gz")
}

fn judge_all(recordings: &[PathBuf]) -> String {
    recordings.iter().map(|path| judge(path)).collect()
}

fn judge(path: &Path) -> String {
    let mut box_of = BoxUnderTest::new();
    let name = path.file_name().expect("a recording has a name").to_string_lossy();
    writeln!(box_of.list, "# {name}").expect("a string takes text");
    for (at_us, bytes) in &frames(&read(path)) {
        box_of.take(*at_us, bytes);
    }
    box_of.list
}

fn read(path: &Path) -> Vec<u8> {
    let bytes = fs::read(path).expect("a recording can be read");
    if path.extension().is_none_or(|extension| extension != "gz") {
        return bytes;
    }
    let mut plain = Vec::new();
    GzDecoder::new(&bytes[..]).read_to_end(&mut plain).expect("a recording can be unpacked");
    plain
}

fn frames(tlog: &[u8]) -> Vec<(u64, &[u8])> {
    let (mut frames, mut rest, mut now_us, mut before) = (Vec::new(), tlog, 0, None);
    while let Some((time, after)) = rest.split_first_chunk::<TIME_BYTES>() {
        let time_us = u64::from_be_bytes(*time);
        let Some(length) = frame_length(after) else { break };
        let Some((frame, next)) = after.split_at_checked(length) else { break };
        let step_us = time_us.saturating_sub(before.unwrap_or(time_us));
        now_us += if step_us > STEP_MAX_MS * 1_000 { 0 } else { step_us };
        before = Some(time_us);
        frames.push((now_us, frame));
        rest = next;
    }
    frames
}

fn frame_length(bytes: &[u8]) -> Option<usize> {
    match bytes {
        [0xFE, length, ..] => Some(8 + usize::from(*length)),
        [0xFD, length, flags, ..] => Some(12 + usize::from(*length) + if flags & 1 != 0 { 13 } else { 0 }),
        _ => None,
    }
}

struct BoxUnderTest {
    framer: Framer,
    sequences: Sequences,
    long_texts: LongTexts,
    monitor: Monitor,
    summary: Summary,
    ticked: Instant,
    list: String,
}

impl BoxUnderTest {
    fn new() -> Self {
        let mut params = Params::defaults();
        params.set("PROT_ACTION", 1.0).expect("a return is a protective action");
        let (framer, sequences) = (Framer::new(), Sequences::new());
        let (long_texts, monitor) = (LongTexts::new(), Monitor::new(params));
        let summary = Summary::new(&params);
        Self { framer, sequences, long_texts, monitor, summary, ticked: Instant::ZERO, list: String::new() }
    }

    fn take(&mut self, at_us: u64, bytes: &[u8]) {
        let at = Instant::from_micros(at_us);
        while at.since(self.ticked) >= TICK {
            self.ticked = self.ticked + TICK;
            self.tick();
        }
        let Self { framer, sequences, long_texts, monitor, .. } = self;
        let mut observe = |frame: hums_link::frame::Frame<'_>| {
            if frame.check() == Check::Verified {
                sequences.frame(at, &frame);
                long_texts.frame(at, &frame, &mut |source, alert| {
                    monitor.observe(at.into(), source, &Observation::Alert(alert));
                });
                if let Some((source, observation)) = hums_link::observe(&frame) {
                    monitor.observe(at.into(), source, &observation);
                }
            }
        };
        framer.push(bytes, &mut observe);
        framer.idle(&mut observe);
    }

    fn tick(&mut self) {
        let Self { sequences, monitor, summary, ticked, list, .. } = self;
        let mut texts = Vec::new();
        let mut sent = |frame: &[u8]| texts.extend(text_of(frame));
        let link = sequences.reading(*ticked, monitor.vehicle().source);
        let recorder = RecorderStatus { recording: Recording::Running, ..RecorderStatus::default() };
        let seconds = ticked.as_secs_f64();
        monitor.tick((*ticked).into(), &link, &recorder, &mut |finding| {
            let (check, instance, level) = (finding.check, finding.instance, finding.level.name());
            let cause = if finding.because.is_empty() { "told" } else { finding.because };
            writeln!(list, "{seconds:9.3} {check} {instance} {level} {cause}").expect("a string takes text");
            summary.finding(*ticked, finding, &mut sent);
        });
        summary.tick(*ticked, monitor, &mut sent);
        for text in texts {
            writeln!(list, "{seconds:9.3} > {text}").expect("a string takes text");
        }
        while let Some(happening) = monitor.take_happening() {
            writeln!(list, "{seconds:9.3} {happening:?}").expect("a string takes text");
        }
    }
}

fn text_of(frame: &[u8]) -> Option<String> {
    let frame = Frame::again(frame, Check::Verified).filter(|frame| frame.id() == STATUSTEXT)?;
    let text = frame.payload().get(1..)?;
    Some(String::from_utf8_lossy(text).trim_end_matches('\0').trim_start_matches("HUMS: ").to_owned())
}
