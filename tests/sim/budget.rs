//! The ground station's port on recordings: bytes in each window of a second, no starving message, critical
//! findings in time.

use std::collections::BTreeMap;
use std::path::Path;

use hums::card::{Faults, SimCard, image};
use hums::endpoint::Endpoint;
use hums::run::sim::both_ports::{BoardSetup, Outcome, Side, run};
use hums::source::{self, Chunk, Timing};
use hums_core::health::Level;
use hums_core::parameters::Params;
use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
use hums_link::packet::{Fields, Packet};
use hums_link::{Check, Frame};
use hums_tests::flights::{own, root};

const BUDGETS: [u32; 3] = [100, 1_000, 5_000];
const BAUD: u64 = 57_600;
const SECOND: u64 = 1_000_000;

/// The first byte's time, microseconds, to a step.
pub(crate) struct Sent {
    pub(crate) at_us: u64,
    bytes: Vec<u8>,
}

impl Sent {
    pub(crate) fn frame(&self) -> Frame<'_> {
        Frame::again(&self.bytes, Check::Verified).expect("a frame")
    }

    fn end_us(&self) -> u64 {
        self.at_us + self.bytes.len() as u64 * 10 * SECOND / BAUD
    }
}

/// Each `step_us` time moves on; `ask` returns the ground station's bytes for each 100 ms.
fn chunks(recording: &Path, step_us: u64, mut ask: impl FnMut(u64) -> Vec<u8>) -> Vec<(Side, Chunk)> {
    let endpoint: Endpoint = recording.display().to_string().parse().unwrap();
    let mut source = source::open(&endpoint, Timing { line_rate: None }).unwrap();
    let (mut chunks, mut now_us) = (Vec::new(), 0);
    while let Some(chunk) = source.next().unwrap() {
        while now_us < chunk.at_us {
            let bytes = if now_us % 100_000 == 0 { ask(now_us) } else { Vec::new() };
            let side = if bytes.is_empty() { Side::Autopilot } else { Side::Ground };
            chunks.push((side, Chunk { at_us: now_us, bytes }));
            now_us += step_us;
        }
        chunks.push((Side::Autopilot, chunk));
    }
    chunks
}

/// The output to the ground station.
pub(crate) fn power_on(
    recording: &Path,
    params: &Params,
    step_us: u64,
    ask: impl FnMut(u64) -> Vec<u8>,
) -> (Outcome, Vec<Sent>) {
    let dir = tempfile::tempdir().unwrap();
    let file = image::open_or_make(&dir.path().join("card.img"), Some(64), |_| Ok(())).unwrap();
    let card = SimCard::new(file, Faults::default()).unwrap();
    hums_recorder::format::format(&card, 7).unwrap();
    let board = BoardSetup { card: &card, params, key: None, boots: 1 };
    let mut sent = Vec::new();
    let outcome = run(&board, chunks(recording, step_us, ask), |side, at_us, bytes| {
        if side == Side::Ground {
            sent.push(Sent { at_us, bytes: bytes.to_vec() });
        }
    });
    (outcome.unwrap(), sent)
}

fn with_budget(recording: &Path, budget: u32, ask: impl FnMut(u64) -> Vec<u8>) -> (Outcome, Vec<Sent>) {
    let mut params = Params::defaults();
    params.set("GS_BUDGET", budget as f32).unwrap();
    power_on(recording, &params, 1_000, ask)
}

fn fullest_second(sent: &[Sent]) -> usize {
    let (mut first, mut bytes, mut most) = (0, 0, 0);
    for (index, frame) in sent.iter().enumerate() {
        bytes += frame.bytes.len();
        while sent[index].at_us - sent[first].at_us >= SECOND {
            bytes -= sent[first].bytes.len();
            first += 1;
        }
        most = most.max(bytes);
    }
    most
}

/// One recording of each autopilot: all exceed any budget.
#[test]
fn no_second_holds_more_than_the_budget_and_nothing_starves() {
    for recording in ["px4_hil_quad_low.tlog", "ap_quad_signed.raw"].map(own) {
        for budget in BUDGETS {
            let (outcome, sent) = with_budget(&recording, budget, |_| Vec::new());
            let most = fullest_second(&sent);
            let name = recording.display();
            println!("{name}: {most} of {budget} B/s at most, {} frames", sent.len());
            assert!(most <= budget as usize, "{name}: {most} bytes in a second of {budget}");
            assert_eq!(outcome.done.stats.frames_lost, 0, "{name}");
            assert_nothing_starves(&name.to_string(), budget, &sent);
        }
    }
}

/// The gap between two of a kind is limited. A message may stop in the last minute.
fn assert_nothing_starves(name: &str, budget: u32, sent: &[Sent]) {
    let longest_s = match budget {
        100 => 150,
        1_000 => 30,
        _ => 15,
    };
    let mut ours: BTreeMap<u32, Vec<u64>> = BTreeMap::new();
    for frame in sent.iter().filter(|sent| sent.frame().component() == 191) {
        ours.entry(frame.frame().id()).or_default().push(frame.at_us);
    }
    let end = sent.last().map_or(0, |frame| frame.at_us);
    for id in [0, 251, 252] {
        let mut times = ours.get(&id).cloned().unwrap_or_default();
        times.insert(0, 0);
        times.push(end);
        let gap = times.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0) / SECOND;
        assert!(gap <= longest_s, "{name}, {budget} B/s: {gap} s without message {id} of ours");
    }
}

/// Requests parameters, logs, files and commands all the time.
fn greedy(now_us: u64) -> Vec<u8> {
    let mut encoder = Encoder::of(255, 190);
    encoder.set_sequence((now_us / 100_000) as u8);
    let mut bytes = Vec::new();
    let mut say = |packet: &Packet| {
        let mut buffer = [0; FRAME_BYTES_MAX];
        bytes.extend_from_slice(encoder.frame(&mut buffer, packet));
    };
    say(&Packet::new(21).u8(0, 1).u8(1, 191));
    say(&Packet::new(76).f32(0, 148.0).u16(28, 512).u8(30, 1).u8(31, 191));
    if now_us.is_multiple_of(2_000_000) {
        say(&Packet::new(119).u32(0, 0).u32(4, 1_000_000).u16(8, 1).u8(10, 1).u8(11, 191));
    }
    bytes
}

#[test]
fn a_critical_finding_is_out_within_fifty_milliseconds_however_busy_the_port_is() {
    let motor = root().join("tests/labelled/f01_motor_dead_hexa.tlog.gz");
    for recording in [motor, own("ap_quad_faults.tlog"), own("px4_hil_quad_low.tlog")] {
        let (outcome, sent) = with_budget(&recording, 5_000, greedy);
        let most = fullest_second(&sent);
        assert!(most <= 5_000, "{}: {most} bytes in a second", recording.display());
        assert_eq!(outcome.done.stats.frames_lost, 0, "{}", recording.display());
        let ours = || sent.iter().filter(|sent| sent.frame().id() == 253 && sent.frame().component() == 191);
        let texts: Vec<(u64, u64, &Sent)> = ours()
            // MAV_SEVERITY_CRITICAL
            .filter(|sent| Fields(sent.frame().payload()).u8(0) == 2)
            .map(|sent| (sent.at_us, sent.end_us(), sent))
            .collect();
        let critical: Vec<u64> = outcome
            .findings
            .iter()
            .filter(|finding| finding.level == Level::Critical)
            .map(|finding| finding.at.as_micros())
            .collect();
        // An explained finding has no text.
        assert!(texts.len() <= critical.len(), "{}", recording.display());
        assert_eq!(texts.is_empty(), critical.is_empty(), "{}", recording.display());
        let (mut worst_begin, mut worst_end) = (0, 0);
        for (at_us, end_us, _) in &texts {
            let found_us = critical.iter().rev().find(|found_us| *found_us <= at_us).unwrap();
            worst_begin = worst_begin.max(at_us.saturating_sub(*found_us));
            worst_end = worst_end.max(end_us.saturating_sub(*found_us));
        }
        println!(
            "{}: {} critical findings, begun after {} ms at most, out after {} ms; {most} B/s at most",
            recording.display(),
            critical.len(),
            worst_begin / 1_000,
            worst_end / 1_000
        );
        assert!(worst_begin <= 50_000, "{}: {worst_begin} us", recording.display());
    }
}
